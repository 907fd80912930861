//! Building inverses: fits a form to the exact quantile and joins the pieces.

use super::certify::{ErrorBound, measure};
use super::{Argument, Core, Form, Inverse, MaxRelativeError, Outer, Piece, Tail};
use crate::fit::{Minimax, Problem, minimax};
use crate::truth::Truth;
use crate::{Angle, Geometry, RadialDistribution, SamplerError};

/// Points at which a new inverse's error is measured; the tests measure all 2^24.
const MEASURE_POINTS: u32 = 1 << 14;
/// Beyond this eccentricity `1 - cos e` does not determine the angle to f32's accuracy; fits weigh it as here.
const LEAST_SINE: f64 = 0.5;

/// The forms on offer in the order of their estimated cost.
fn candidates(geometry: Geometry) -> Vec<Form> {
    let mut forms: Vec<Form> = (2..=8).map(Form::Polynomial).collect();
    if geometry == Geometry::Sphere {
        forms.extend((2..=8).map(Form::SquaredPolynomial));
    }
    forms.extend([(2, 2), (3, 2), (3, 3), (4, 3), (4, 4), (5, 4), (5, 5)].map(|(n, m)| Form::Rational(n, m)));
    forms.extend((4..=12).map(|log2| Form::Table(1 << log2)));
    forms.sort_by_key(|form| estimated_cost(*form));
    forms
}

/// Additions and multiplications, a division counted as 6 and a table's look-up as 12 and more as it outgrows the caches.
fn estimated_cost(form: Form) -> u32 {
    match form {
        Form::Polynomial(degree) => 2 * u32::from(degree),
        Form::SquaredPolynomial(degree) => 2 * u32::from(degree) + 1,
        Form::Rational(n, m) => 2 * (u32::from(n) + u32::from(m)) + 6,
        Form::Table(cells) => 18 + u32::from(cells).ilog2(),
        Form::Eq6 => 8,
    }
}

pub(super) fn default_for(distribution: &RadialDistribution) -> Inverse {
    let truth = Truth::new(distribution);
    let accuracy = match distribution.geometry() {
        Geometry::Sphere => 2e-5,
        Geometry::Plane => 4e-5,
    };
    search(distribution, &truth, accuracy).unwrap_or_else(|best| *best)
}

pub(super) fn fit(distribution: &RadialDistribution, accuracy: MaxRelativeError) -> Result<Inverse, SamplerError> {
    let truth = Truth::new(distribution);
    search(distribution, &truth, accuracy.0)
        .map_err(|best| SamplerError::Accuracy { requested: accuracy.0, best: best.bound.relative_e })
}

/// The first candidate within `accuracy`, or else the best of all.
fn search(distribution: &RadialDistribution, truth: &Truth, accuracy: f64) -> Result<Inverse, Box<Inverse>> {
    let mut best: Option<Inverse> = None;
    for form in candidates(distribution.geometry()) {
        let Some(fitted) = Fitted::new(distribution, truth, form) else { continue };
        // What the exact-arithmetic fit misses, f32 will not find.
        if fitted.error > accuracy && best.is_some() && !matches!(form, Form::Table(_)) {
            continue;
        }
        let inverse = assemble(distribution, truth, form, fitted);
        // Neither a map that falls somewhere nor one that lives on cancelling terms.
        let too_rough = inverse.bound.rounding > 0.2 * accuracy + 5e-7;
        if inverse.bound.relative_density.is_infinite() || (too_rough && best.is_some()) {
            continue;
        }
        if inverse.bound.relative_e <= accuracy {
            return Ok(inverse);
        }
        if best.as_ref().is_none_or(|best| inverse.bound.relative_e < best.bound.relative_e) {
            best = Some(inverse);
        }
    }
    Err(Box::new(best.expect("a table exists for every distribution")))
}

pub(super) fn with_form(distribution: &RadialDistribution, form: Form) -> Result<Inverse, SamplerError> {
    let in_range = match form {
        Form::Polynomial(degree) => (2..=8).contains(&degree),
        Form::SquaredPolynomial(degree) => (2..=8).contains(&degree) && distribution.geometry() == Geometry::Sphere,
        Form::Rational(n, m) => (1..=5).contains(&n) && (1..=5).contains(&m),
        Form::Table(cells) => (4..=4096).contains(&cells) && cells.is_power_of_two(),
        Form::Eq6 => return eq6(distribution),
    };
    if !in_range {
        return Err(SamplerError::Unsupported("this form's degrees are not on offer for this geometry"));
    }
    let truth = Truth::new(distribution);
    let fitted = Fitted::new(distribution, &truth, form)
        .ok_or(SamplerError::Unsupported("the fit of this form breaks down for this distribution"))?;
    let inverse = assemble(distribution, &truth, form, fitted);
    if inverse.bound.relative_density.is_infinite() {
        return Err(SamplerError::Unsupported("the fit of this form is not monotone for this distribution"));
    }
    Ok(inverse)
}

/// Eq. 6 as printed: `80 {0.2330 sqrt u, u <= 0.0965; 0.3136 u^4 + 0.0021 u^3 + 0.3451 u^2 + 0.2984 u + 0.0404}` degrees.
pub(super) fn eq6(distribution: &RadialDistribution) -> Result<Inverse, SamplerError> {
    let own = distribution.geometry() == Geometry::Plane
        && distribution.model().name() == "reddy"
        && (distribution.cap().degrees() - 80.0).abs() < 1e-9
        && distribution.floor() < 0.01;
    if !own {
        return Err(SamplerError::Unsupported(
            "Eq. 6 is an inverse for Reddy's acuity on the plane with a cap of 80 degrees",
        ));
    }
    let scale = Angle::from_degrees(80.0).radians();
    let scaled = |coefficients: &[f64]| Core::Polynomial(coefficients.iter().map(|c| (c * scale) as f32).collect());
    let pieces = vec![
        Piece { end: 0.0965, argument: Argument::U, core: scaled(&[0.2330]), outer: Outer::TimesSqrtU },
        Piece {
            end: 1.0,
            argument: Argument::U,
            core: scaled(&[0.0404, 0.2984, 0.3451, 0.0021, 0.3136]),
            outer: Outer::Identity,
        },
    ];
    Ok(finish(distribution, Form::Eq6.name(), pieces))
}

/// The stretch between the flat centre and the flat rim, fitted.
struct Fitted {
    /// The fitted piece; `None` if the distribution is flat throughout.
    piece: Option<Piece>,
    /// `U` at its ends.
    range: [f64; 2],
    /// Minimax error in exact arithmetic; 0 for tables, whose error is only measured.
    error: f64,
}

impl Fitted {
    fn new(distribution: &RadialDistribution, truth: &Truth, form: Form) -> Option<Self> {
        let stretches = distribution.stretches();
        let first_curved = stretches.iter().position(|s| !s.flat);
        // A flat stretch next to another (a disc and its floor) is a kink for the fit, so both count as curved but the first.
        let (Some(first), Some(last)) = (
            first_curved.or((stretches.len() > 2).then_some(1)),
            stretches.iter().rposition(|s| !s.flat).or((stretches.len() > 2).then(|| stretches.len() - 2)),
        ) else {
            let joint = stretches[0].end;
            return Some(Self { piece: None, range: [joint, joint], error: 0.0 });
        };
        // Several flat steps in front of the curved part belong to the fit too; only one can be the disc.
        let first = first.min(1);
        let last = last.max(stretches.len().saturating_sub(2)).max(first);
        let last = if stretches[stretches.len() - 1].flat { last } else { stretches.len() - 1 };
        let range = [stretches[first].start, stretches[last].end];
        let central = first == 0;
        let fitter = Fitter { distribution, truth, range, central };
        let (core, outer, error) = fitter.fit(form)?;
        let argument = if central { Argument::SqrtU } else { Argument::U };
        let piece = Piece { end: range[1] as f32, argument, core, outer };
        Some(Self { piece: Some(piece), range, error })
    }
}

struct Fitter<'a> {
    distribution: &'a RadialDistribution,
    truth: &'a Truth,
    range: [f64; 2],
    /// Whether the fit begins at the gaze: then in `s = sqrt(U)`, of `v / U` or `e / s`.
    central: bool,
}

impl Fitter<'_> {
    fn fit(&self, form: Form) -> Option<(Core, Outer, f64)> {
        let outer = match (self.central, self.distribution.geometry()) {
            (true, Geometry::Sphere) => Outer::TimesU,
            (true, Geometry::Plane) => Outer::TimesSqrtU,
            (false, _) => Outer::Identity,
        };
        let rounded = |c: &[f64]| c.iter().map(|x| *x as f32).collect::<Vec<f32>>();
        let polynomial = |fit: &Minimax| Core::Polynomial(rounded(&fit.numerator));
        match form {
            Form::Polynomial(degree) => {
                let fit = minimax(&self.problem(false), degree.into(), 0)?;
                Some((polynomial(&fit), outer, fit.error))
            }
            // At the gaze the square would lose the relative accuracy that the factor U gives.
            Form::SquaredPolynomial(_) if self.central => None,
            Form::SquaredPolynomial(degree) => {
                let fit = minimax(&self.problem(true), degree.into(), 0)?;
                Some((polynomial(&fit), Outer::Square, fit.error))
            }
            Form::Rational(n, m) => {
                let fit = minimax(&self.problem(false), n.into(), m.into())?;
                let core =
                    Core::Rational { numerator: rounded(&fit.numerator), denominator: rounded(&fit.denominator) };
                Some((core, outer, fit.error))
            }
            Form::Table(cells) => Some((self.table(u32::from(cells)), outer, 0.0)),
            Form::Eq6 => None,
        }
    }

    /// The core's argument at the ends.
    fn argument_range(&self) -> [f64; 2] {
        if self.central { self.range.map(f64::sqrt) } else { self.range }
    }

    /// The core's exact value at argument `t`.
    fn core_value(&self, t: f64) -> f64 {
        if self.central { self.truth.reduced(t) } else { self.truth.radial(t) }
    }

    /// The fit in the measure of relative error in e: `d ln e = (v / (e sin e)) d ln v` on the sphere.
    fn problem(&self, square_root: bool) -> Problem {
        let [lo, hi] = self.argument_range();
        Problem::new(lo, hi, |t| {
            let core = self.core_value(t);
            let e = self.truth.eccentricity(if self.central { t * t } else { t });
            let e_by_core = match self.distribution.geometry() {
                Geometry::Plane => 1.0,
                Geometry::Sphere if e < 1e-4 => 0.5,
                Geometry::Sphere => {
                    let sine = if e > 1.6 { e.sin().max(LEAST_SINE) } else { e.sin() };
                    Angle::from_radians(e).versine() / (e * sine)
                }
            };
            if square_root { (core.sqrt(), 2.0 * e_by_core / core.sqrt()) } else { (core, e_by_core / core) }
        })
    }

    /// Cubic Hermite interpolation on cells of width `1 / per_unit`, split at the fit's ends.
    fn table(&self, per_unit: u32) -> Core {
        let [lo, hi] = self.argument_range();
        let width = 1.0 / f64::from(per_unit);
        let first = ((lo * f64::from(per_unit)) as u32).min(per_unit - 1);
        let last = ((hi * f64::from(per_unit)).ceil() as u32).clamp(first + 1, per_unit);
        let cell = |i: u32| {
            let cell_lo = f64::from(i) * width;
            let (a, b) = (cell_lo.max(lo), (cell_lo + width).min(hi));
            let [y0, d0, y1, d1] = self.hermite_data(a, b);
            // y as a cubic in s = (t - a) / (b - a), then in the cell's own position p, s = offset + p ratio.
            let c = [y0, d0, 3.0 * (y1 - y0) - 2.0 * d0 - d1, 2.0 * (y0 - y1) + d0 + d1];
            let (offset, r) = ((cell_lo - a) / (b - a), width / (b - a));
            [
                c[0] + offset * (c[1] + offset * (c[2] + offset * c[3])),
                r * (c[1] + offset * (2.0 * c[2] + offset * 3.0 * c[3])),
                r * r * (c[2] + offset * 3.0 * c[3]),
                r * r * r * c[3],
            ]
            .map(|x| x as f32)
        };
        Core::Table { per_unit, first, cells: (first..last).map(cell).collect() }
    }

    /// Core values at `a` and `b` and one-sided slopes there, in units of the interval.
    fn hermite_data(&self, a: f64, b: f64) -> [f64; 4] {
        // Slopes from inside the interval: five-point one-sided differences of the truth, good to 1e-9 relative here.
        let step = (b - a) / 64.0;
        let slope = |at: f64, h: f64| {
            let y = |k: f64| self.core_value(at + k * h);
            (-25.0 * y(0.0) + 48.0 * y(1.0) - 36.0 * y(2.0) + 16.0 * y(3.0) - 3.0 * y(4.0)) / (12.0 * h)
        };
        let w = b - a;
        [self.core_value(a), slope(a, step) * w, self.core_value(b), slope(b, -step) * w]
    }
}

/// Joins the fitted piece with the flat disc before it and the flat ring after it.
fn assemble(distribution: &RadialDistribution, truth: &Truth, form: Form, fitted: Fitted) -> Inverse {
    let geometry = distribution.geometry();
    let [start, end] = fitted.range;
    let value = |u: f64| fitted.piece.as_ref().map_or_else(|| truth.radial(u), |piece| piece.eval_f64(u).0);
    let mut pieces = Vec::new();
    if start > 0.0 {
        let joint = f64::from(start as f32);
        let (coefficient, outer) = match geometry {
            Geometry::Sphere => (value(joint) / joint, Outer::TimesU),
            Geometry::Plane => (value(joint) / joint.sqrt(), Outer::TimesSqrtU),
        };
        let core = Core::Polynomial(vec![coefficient as f32]);
        pieces.push(Piece { end: start as f32, argument: Argument::U, core, outer });
    }
    let name = if fitted.piece.is_some() { form.name() } else { "flat".into() };
    if end < 1.0 {
        let joint = f64::from(end as f32);
        // The geometry's area is linear in U: v on the sphere, e^2 on the plane.
        let area = |x: f64| if geometry == Geometry::Sphere { x } else { x * x };
        let (at_joint, at_cap) = (area(value(joint)), area(truth.radial(1.0)));
        let slope = (at_cap - at_joint) / (1.0 - joint);
        let core = Core::Polynomial(vec![(at_cap - slope) as f32, slope as f32]);
        let outer = if geometry == Geometry::Sphere { Outer::Identity } else { Outer::Sqrt };
        pieces.extend(fitted.piece);
        pieces.push(Piece { end: 1.0, argument: Argument::U, core, outer });
    } else {
        pieces.extend(fitted.piece);
    }
    finish(distribution, name, pieces)
}

/// The largest f32 that is at most `x > 0`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// Adds the part beyond the cap and measures the whole.
fn finish(distribution: &RadialDistribution, name: String, pieces: Vec<Piece>) -> Inverse {
    let geometry = distribution.geometry();
    let kappa = distribution.outer_ratio();
    let tail = (kappa > 0.0).then(|| {
        let scale = (1.0 + kappa) as f32;
        let joint = 1.0 / (1.0 + kappa);
        let last = pieces.last().expect("an inverse has at least one piece");
        let at_cap = last.eval_f64(1.0).0;
        let versine = if geometry == Geometry::Sphere { at_cap } else { Angle::from_radians(at_cap).versine() };
        Tail { scale, joint, start: round_down(joint), slope: ((2.0 - versine) / (1.0 - joint)) as f32 }
    });
    let mut inverse = Inverse { name, geometry, pieces, tail, bound: ErrorBound::UNKNOWN };
    inverse.bound = measure(&inverse, distribution, MEASURE_POINTS).bound();
    inverse
}
