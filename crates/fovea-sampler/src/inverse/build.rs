//! Building inverses: fits a form to the exact quantile and joins the pieces.

use super::certify::{ErrorBound, measure};
use super::{Argument, Core, Form, Inverse, LARGEST_ANGLE, MaxRelativeError, Outer, Piece, Tail};
use crate::fit::{Minimax, Problem, minimax};
use crate::truth::Truth;
use crate::{Angle, Geometry, RadialDistribution, SamplerError};

/// Points at which a new inverse's error is measured; the tests measure at others too ([`ErrorBound`]).
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
    let pieces = [(2, 4), (2, 5), (3, 5), (4, 5), (4, 6), (6, 6), (8, 6), (8, 7)];
    forms.extend(pieces.map(|(pieces, degree)| Form::Piecewise(pieces, degree)));
    forms.sort_by_key(|form| estimated_cost(*form));
    // Tables last, though cheaper than some: a large constant array burdens shader compilers.
    forms.extend((6..=12).map(|log2| Form::Table(1 << log2)));
    forms
}

/// Additions and multiplications, a division counted as 6 and a table's look-up as 12 and more as it outgrows the caches, a
/// comparison as 2.
fn estimated_cost(form: Form) -> u32 {
    match form {
        Form::Polynomial(degree) => 2 * u32::from(degree),
        Form::SquaredPolynomial(degree) => 2 * u32::from(degree) + 1,
        Form::Rational(n, m) => 2 * (u32::from(n) + u32::from(m)) + 6,
        Form::Piecewise(pieces, degree) => 2 * u32::from(degree) + 1 + 2 * u32::from(pieces),
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
    search(distribution, &truth, accuracy).unwrap_or_else(|best| match best {
        Some(best) => *best,
        None => {
            let form = Form::Table(4096);
            let fitted = Fitted::new(distribution, &truth, form).expect("a table is made of values, not fitted");
            assemble(distribution, &truth, form, fitted)
        }
    })
}

pub(super) fn fit(distribution: &RadialDistribution, accuracy: MaxRelativeError) -> Result<Inverse, SamplerError> {
    let truth = Truth::new(distribution);
    search(distribution, &truth, accuracy.0).map_err(|best| match best {
        Some(best) => SamplerError::Accuracy { requested: accuracy.0, best: best.bound.relative_e },
        None => SamplerError::Unsupported("no form on offer is monotone for this distribution"),
    })
}

/// The first candidate within `accuracy`, or else the best of those that rise, if one does.
fn search(distribution: &RadialDistribution, truth: &Truth, accuracy: f64) -> Result<Inverse, Option<Box<Inverse>>> {
    let mut best: Option<Inverse> = None;
    // What an exact-arithmetic fit misses, f32 will not find: the first pass does not even measure it.
    for skip_hopeless in [true, false] {
        for form in candidates(distribution.geometry()) {
            let Some(fitted) = Fitted::new(distribution, truth, form) else { continue };
            if (fitted.error > accuracy) == skip_hopeless {
                continue;
            }
            let inverse = assemble(distribution, truth, form, fitted);
            // A map that falls somewhere is no inverse.
            if inverse.bound.relative_density.is_infinite() {
                continue;
            }
            // Nor should one live on cancelling terms.
            let too_rough = inverse.bound.rounding > 0.2 * accuracy + 5e-7;
            if inverse.bound.relative_e <= accuracy && !too_rough {
                return Ok(inverse);
            }
            if best.as_ref().is_none_or(|best| inverse.bound.relative_e < best.bound.relative_e) {
                best = Some(inverse);
            }
        }
    }
    Err(best.map(Box::new))
}

pub(super) fn with_form(distribution: &RadialDistribution, form: Form) -> Result<Inverse, SamplerError> {
    let in_range = match form {
        Form::Polynomial(degree) => (2..=8).contains(&degree),
        Form::SquaredPolynomial(degree) => (2..=8).contains(&degree) && distribution.geometry() == Geometry::Sphere,
        Form::Rational(n, m) => (1..=5).contains(&n) && (1..=5).contains(&m),
        Form::Piecewise(pieces, degree) => (2..=8).contains(&pieces) && (3..=7).contains(&degree),
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
        Piece { end: 0.0965, argument: Argument::U, origin: 0.0, core: scaled(&[0.2330]), outer: Outer::TimesSqrtU },
        Piece {
            end: 1.0,
            argument: Argument::U,
            origin: 0.0,
            core: scaled(&[0.0404, 0.2984, 0.3451, 0.0021, 0.3136]),
            outer: Outer::Identity,
        },
    ];
    Ok(finish(distribution, Form::Eq6.name(), pieces))
}

/// The stretch between the flat centre and the flat rim, fitted.
struct Fitted {
    /// The fitted pieces; none if the distribution is flat throughout.
    pieces: Vec<Piece>,
    /// `U` at its ends.
    range: [f64; 2],
    /// Minimax error in exact arithmetic; 0 for tables, whose error is only measured.
    error: f64,
}

impl Fitted {
    fn new(distribution: &RadialDistribution, truth: &Truth, form: Form) -> Option<Self> {
        let stretches = distribution.stretches();
        let count = stretches.len();
        // Only the first flat stretch is the disc and only the last one the rim; the curve is what lies between.
        let first = usize::from(stretches[0].flat);
        let last = if stretches[count - 1].flat { count - 1 } else { count };
        if first >= last {
            let joint = stretches[0].end;
            return Some(Self { pieces: Vec::new(), range: [joint, joint], error: 0.0 });
        }
        let range = [stretches[first].start, stretches[last - 1].end];
        let kinks = stretches[first..last - 1].iter().map(|s| s.end).collect();
        let fitter = Fitter { distribution, truth, range, kinks, central: first == 0 };
        let (pieces, error) = fitter.fit(form)?;
        Some(Self { pieces, range, error })
    }

    /// The radius at `U`, in f64.
    fn value(&self, capped_u: f64) -> Option<f64> {
        let (last, others) = self.pieces.split_last()?;
        let piece = others.iter().find(|piece| capped_u <= f64::from(piece.end)).unwrap_or(last);
        Some(piece.eval_f64(capped_u).0)
    }
}

struct Fitter<'a> {
    distribution: &'a RadialDistribution,
    truth: &'a Truth,
    range: [f64; 2],
    /// `U` where two smooth stretches meet inside the range.
    kinks: Vec<f64>,
    /// Whether the fit begins at the gaze: then in `s = sqrt(U)`, of `v / U` or `e / s`.
    central: bool,
}

impl Fitter<'_> {
    fn fit(&self, form: Form) -> Option<(Vec<Piece>, f64)> {
        let whole = self.argument_range();
        let polynomial = |fit: &Minimax| Core::Polynomial(rounded(&fit.numerator));
        let one = |core: Core, error: f64| (vec![self.piece(core, whole[1], 0.0)], error);
        match form {
            Form::Polynomial(degree) => {
                let fit = minimax(&self.problem(whole, 0.0, false), degree.into(), 0)?;
                Some(one(polynomial(&fit), fit.error))
            }
            // At the gaze the square would lose the relative accuracy that the factor U gives.
            Form::SquaredPolynomial(_) if self.central => None,
            Form::SquaredPolynomial(degree) => {
                let fit = minimax(&self.problem(whole, 0.0, true), degree.into(), 0)?;
                let mut piece = self.piece(polynomial(&fit), whole[1], 0.0);
                piece.outer = Outer::Square;
                Some((vec![piece], fit.error))
            }
            Form::Rational(n, m) => {
                let fit = minimax(&self.problem(whole, 0.0, false), n.into(), m.into())?;
                let core =
                    Core::Rational { numerator: rounded(&fit.numerator), denominator: rounded(&fit.denominator) };
                Some(one(core, fit.error))
            }
            Form::Piecewise(pieces, degree) => self.piecewise(pieces.into(), degree.into()),
            Form::Table(cells) => Some(one(self.table(u32::from(cells)), 0.0)),
            Form::Eq6 => None,
        }
    }

    /// A piece of the curve that ends at argument `end`.
    fn piece(&self, core: Core, end: f64, origin: f32) -> Piece {
        let outer = match (self.central, self.distribution.geometry()) {
            (true, Geometry::Sphere) => Outer::TimesU,
            (true, Geometry::Plane) => Outer::TimesSqrtU,
            (false, _) => Outer::Identity,
        };
        let (argument, end) = if self.central { (Argument::SqrtU, end * end) } else { (Argument::U, end) };
        Piece { end: end as f32, argument, origin, core, outer }
    }

    /// Polynomials on pieces whose ends are moved until their errors are alike. `None` if the curve has more kinks than pieces.
    fn piecewise(&self, count: usize, degree: usize) -> Option<(Vec<Piece>, f64)> {
        let [lo, hi] = self.argument_range();
        let kinks: Vec<f64> = self.kinks.iter().map(|u| if self.central { u.sqrt() } else { *u }).collect();
        let smooth: Vec<f64> = core::iter::once(lo).chain(kinks).chain([hi]).collect();
        if smooth.len() - 1 > count {
            return None;
        }
        // The longest smooth stretches are cut until there are enough.
        let mut cuts: Vec<usize> = vec![1; smooth.len() - 1];
        while cuts.iter().sum::<usize>() < count {
            let length = |i: usize| (smooth[i + 1] - smooth[i]) / cuts[i] as f64;
            let longest = (0..cuts.len()).max_by(|a, b| length(*a).total_cmp(&length(*b)))?;
            cuts[longest] += 1;
        }
        let (mut pieces, mut worst) = (Vec::new(), 0.0_f64);
        for (ends, cuts) in smooth.windows(2).zip(cuts) {
            let (fits, edges) = self.balanced([ends[0], ends[1]], cuts, degree)?;
            for (fit, edge) in fits.iter().zip(edges.windows(2)) {
                // The correction to the exact values at the ends may double the error.
                worst = worst.max(2.0 * fit.error);
                pieces.push(self.joined(fit, [edge[0], edge[1]]));
            }
        }
        Some((pieces, worst))
    }

    /// Fits on `count` pieces of a smooth stretch; their widths are corrected by how the error scales with the width.
    fn balanced(&self, [lo, hi]: [f64; 2], count: usize, degree: usize) -> Option<(Vec<Minimax>, Vec<f64>)> {
        const ROUNDS: usize = 5;
        let mut widths = vec![(hi - lo) / count as f64; count];
        for round in 1.. {
            let mut edges = vec![lo];
            for width in &widths[..count - 1] {
                // Ends that f32 holds exactly, so that both sides are corrected at the same place.
                edges.push(f64::from((edges[edges.len() - 1] + width) as f32));
            }
            edges.push(hi);
            let fit = |i: usize| {
                let range = [edges[i], edges[i + 1]];
                minimax(&self.problem(range, middle(range), false), degree, 0)
            };
            let fits: Vec<Minimax> = (0..count).map(fit).collect::<Option<_>>()?;
            if count == 1 || round == ROUNDS {
                return Some((fits, edges));
            }
            let mean = fits.iter().map(|fit| fit.error.ln()).sum::<f64>() / count as f64;
            let power = 1.0 / (degree as f64 + 1.0);
            for (width, fit) in widths.iter_mut().zip(&fits) {
                *width *= ((mean - fit.error.ln()) * power).exp().clamp(0.3, 3.0);
            }
            let total: f64 = widths.iter().sum();
            widths.iter_mut().for_each(|width| *width *= (hi - lo) / total);
        }
        None
    }

    /// A fit with a straight line added that makes it exact at its ends, so that neighbours meet.
    fn joined(&self, fit: &Minimax, range: [f64; 2]) -> Piece {
        let origin = middle(range);
        let value = |t: f64| fit.numerator.iter().rev().fold(0.0, |sum, c| sum * t + c);
        let [a, b] = range.map(|t| t - f64::from(origin));
        let [at_a, at_b] = [self.core_value(range[0]) - value(a), self.core_value(range[1]) - value(b)];
        let slope = (at_b - at_a) / (b - a);
        let mut coefficients = fit.numerator.clone();
        coefficients[0] += at_a - slope * a;
        coefficients[1] += slope;
        self.piece(Core::Polynomial(rounded(&coefficients)), range[1], origin)
    }

    /// The core's argument at the ends.
    fn argument_range(&self) -> [f64; 2] {
        if self.central { self.range.map(f64::sqrt) } else { self.range }
    }

    /// The core's exact value at argument `t`.
    fn core_value(&self, t: f64) -> f64 {
        if self.central { self.truth.reduced(t) } else { self.truth.radial(t) }
    }

    /// The fit on a range of the argument in the measure of relative error in e: `d ln e = (v / (e sin e)) d ln v` on the
    /// sphere. The fit's variable is the argument less `origin`.
    fn problem(&self, [lo, hi]: [f64; 2], origin: f32, square_root: bool) -> Problem {
        let origin = f64::from(origin);
        Problem::new(lo - origin, hi - origin, |shifted| {
            let t = (shifted + origin).clamp(lo, hi);
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
        Core::Table { per_unit: per_unit as f32, first, cells: (first..last).map(cell).collect() }
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

fn rounded(coefficients: &[f64]) -> Vec<f32> {
    coefficients.iter().map(|x| *x as f32).collect()
}

fn middle([lo, hi]: [f64; 2]) -> f32 {
    (0.5 * (lo + hi)) as f32
}

/// Joins the fitted pieces with the flat disc before it and the flat ring after it.
fn assemble(distribution: &RadialDistribution, truth: &Truth, form: Form, fitted: Fitted) -> Inverse {
    let geometry = distribution.geometry();
    let [start, end] = fitted.range;
    let value = |u: f64| fitted.value(u).unwrap_or_else(|| truth.radial(u));
    let mut pieces = Vec::new();
    if start > 0.0 {
        let joint = f64::from(start as f32);
        let (coefficient, outer) = match geometry {
            Geometry::Sphere => (value(joint) / joint, Outer::TimesU),
            Geometry::Plane => (value(joint) / joint.sqrt(), Outer::TimesSqrtU),
        };
        let core = Core::Polynomial(vec![coefficient as f32]);
        pieces.push(Piece { end: start as f32, argument: Argument::U, origin: 0.0, core, outer });
    }
    let name = if fitted.pieces.is_empty() { "flat".into() } else { form.name() };
    if end < 1.0 {
        let joint = f64::from(end as f32);
        // The geometry's area is linear in U: v on the sphere, e^2 on the plane.
        let area = |x: f64| if geometry == Geometry::Sphere { x } else { x * x };
        let (at_joint, at_cap) = (area(value(joint)), area(truth.radial(1.0)));
        let slope = (at_cap - at_joint) / (1.0 - joint);
        let core = Core::Polynomial(vec![(at_cap - slope) as f32, slope as f32]);
        let outer = if geometry == Geometry::Sphere { Outer::Identity } else { Outer::Sqrt };
        pieces.extend(fitted.pieces);
        pieces.push(Piece { end: 1.0, argument: Argument::U, origin: 0.0, core, outer });
    } else {
        pieces.extend(fitted.pieces);
    }
    finish(distribution, name, pieces)
}

/// The largest f32 that is at most `x > 0`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// The radius of the antipode, where the map comes so near to it that it may reach beyond.
fn limit(inverse: &Inverse) -> Option<f32> {
    /// Of the radius: more than what the fits' errors change between the points that are looked at.
    const MARGIN: f64 = 1e-2;
    let antipode = match inverse.geometry() {
        Geometry::Sphere => 2.0,
        Geometry::Plane => LARGEST_ANGLE,
    };
    let within_cap = inverse.share_within_cap() / f64::from(MEASURE_POINTS);
    let radius = |k: u32| inverse.eval_f64(f64::from(k) * within_cap).0;
    let reaches = (0..=MEASURE_POINTS).any(|k| radius(k) > f64::from(antipode) * (1.0 - MARGIN));
    reaches.then_some(antipode)
}

/// Adds the part beyond the cap and measures the whole.
fn finish(distribution: &RadialDistribution, name: String, pieces: Vec<Piece>) -> Inverse {
    let geometry = distribution.geometry();
    let kappa = distribution.outer_ratio();
    let pieces: Vec<Piece> =
        if kappa > 0.0 { pieces.into_iter().map(|piece| piece.rescaled(1.0 + kappa)).collect() } else { pieces };
    let tail = (kappa > 0.0).then(|| {
        let joint = 1.0 / (1.0 + kappa);
        let at_cap = pieces.last().expect("an inverse has at least one piece").eval_f64(joint).0;
        let versine = if geometry == Geometry::Sphere { at_cap } else { Angle::from_radians(at_cap).versine() };
        Tail { joint, start: round_down(joint), slope: ((2.0 - versine) / (1.0 - joint)) as f32 }
    });
    let mut inverse = Inverse { name, geometry, pieces, tail, limit: None, bound: ErrorBound::UNKNOWN };
    inverse.limit = limit(&inverse);
    inverse.bound = measure(&inverse, distribution, MEASURE_POINTS).bound();
    inverse
}
