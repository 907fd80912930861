//! Inverses of the CDF in the shader's arithmetic: from a uniform `u` to a radius, in f32.

mod build;
mod certify;
mod form;
pub(crate) mod lanes;

use crate::{Angle, Geometry, RadialDistribution, SamplerError, trig};
pub use certify::{ErrorBound, ErrorReport};
pub(crate) use form::{Argument, Core, Outer, Piece};

/// The largest f32 that is at most pi, which f32's own exceeds.
const LARGEST_ANGLE: f32 = 3.141_592_5;

/// The largest relative error in eccentricity, in f32 arithmetic, that a fit may have.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct MaxRelativeError(pub f64);

/// The part beyond the cap: `v = 2 - (1 - u) slope` for `u > start`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tail {
    /// The `u` at the cap, `1 / (1 + kappa)`.
    pub(crate) joint: f64,
    /// The largest f32 that is at most `joint`.
    pub(crate) start: f32,
    pub(crate) slope: f32,
}

/// An approximate inverse of the CDF of a [`RadialDistribution`], evaluated in f32 exactly as the shader text of
/// [`crate::wgsl::radial_module`] prescribes.
///
/// # Definition
/// A few pieces: a disc about the gaze, where the density is flat; a polynomial, rational or table; a ring of flat density
/// where the model has one; and, with a floor, the cap's complement. A floor needs no new fit: within the cap the fit's
/// argument is `u (1 + kappa)`, a factor that is folded into the coefficients. The pieces meet: the flat pieces'
/// coefficients are taken from the fitted piece's value at the joint, which costs no accuracy, so that the map is a
/// bijection ([`Inverse::eq6`], kept as printed, leaves a gap).
///
/// # Domain
/// `u` in `[0, 1]`. Values below 0 count as 0, above 1 as 1, NaN as 0.
#[derive(Clone, Debug)]
pub struct Inverse {
    name: String,
    geometry: Geometry,
    pieces: Vec<Piece>,
    tail: Option<Tail>,
    /// Where a fit's error may reach beyond the antipode, the largest radius there is.
    limit: Option<f32>,
    bound: ErrorBound,
}

impl Inverse {
    /// The inverse to use when nothing is asked for: on the sphere the cheapest form within 2e-5 relative error in e (for
    /// Reddy's acuity a rational 3/3), on the plane a polynomial of degree 5 (4e-5 for Reddy's: the cost of Eq. 6). Where the
    /// model does not admit it, the best form on offer that rises; if none does, the finest table, the bound of whose density is then
    /// infinite.
    #[must_use]
    pub fn default_for(distribution: &RadialDistribution) -> Self {
        build::default_for(distribution)
    }

    /// The cheapest form on offer whose relative error in eccentricity, measured in f32, is at most what is asked for.
    ///
    /// # Errors
    /// [`SamplerError::Accuracy`] with the best error found. f32 itself allows about 1.5e-7.
    pub fn fit(distribution: &RadialDistribution, accuracy: MaxRelativeError) -> Result<Self, SamplerError> {
        build::fit(distribution, accuracy)
    }

    /// A given form.
    ///
    /// # Errors
    /// [`SamplerError::Unsupported`] if the form does not exist for the distribution or its fit breaks down.
    pub fn with_form(distribution: &RadialDistribution, form: Form) -> Result<Self, SamplerError> {
        build::with_form(distribution, form)
    }

    /// Eq. 6 of Koskela et al. 2017 as printed: the plane, cap 80 degrees, no floor.
    #[must_use]
    pub fn eq6() -> Self {
        build::eq6(&RadialDistribution::koskela_2017()).expect("this is Eq. 6's own distribution")
    }

    /// The name of its form, with its parameters, for reports.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The share of the range `[0, 1]` that stays within the cap: below 1 where the distribution has a floor beyond it.
    #[must_use]
    pub fn share_within_cap(&self) -> f64 {
        self.tail.as_ref().map_or(1.0, |tail| tail.joint)
    }

    /// The geometry of its distribution.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// What its error is, in which measure and over which domain.
    #[must_use]
    pub fn bound(&self) -> &ErrorBound {
        &self.bound
    }

    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    pub(crate) fn tail(&self) -> Option<Tail> {
        self.tail
    }

    pub(crate) fn limit(&self) -> Option<f32> {
        self.limit
    }

    /// The radius at `u`: `v = 1 - cos e` in `[0, 2]` on the sphere, `e` in radians on the plane.
    #[inline]
    #[must_use]
    pub fn eval(&self, u: f32) -> f32 {
        let u = unit_interval(u);
        match (self.tail_versine(u), self.geometry) {
            (Some(v), Geometry::Sphere) => v,
            (Some(v), Geometry::Plane) => (Angle::from_versine(f64::from(v)).radians() as f32).min(LARGEST_ANGLE),
            (None, _) => self.eval_capped(u),
        }
    }

    /// `v = 1 - cos e` in `[0, 2]` at `u`, in both geometries: the shader's `warp_radius`.
    #[inline]
    #[must_use]
    pub fn eval_versine(&self, u: f32) -> f32 {
        let u = unit_interval(u);
        match (self.tail_versine(u), self.geometry) {
            (Some(v), _) => v,
            (None, Geometry::Sphere) => self.eval_capped(u),
            (None, Geometry::Plane) => trig::versine(self.eval_capped(u)),
        }
    }

    /// [`Self::eval_versine`] of every lane, bit for bit.
    pub(crate) fn eval_versine_lanes(&self, u: &lanes::Lanes) -> lanes::Lanes {
        let u = lanes::map(u, unit_interval);
        let (last, others) = self.pieces.split_last().expect("an inverse has at least one piece");
        let mut radius = last.eval_lanes(&u);
        for piece in others.iter().rev() {
            for ((radius, value), u) in radius.iter_mut().zip(piece.eval_lanes(&u)).zip(&u) {
                *radius = if *u <= piece.end { value } else { *radius };
            }
        }
        if let Some(limit) = self.limit {
            radius = lanes::map(&radius, |x| x.min(limit));
        }
        let versine = match self.geometry {
            Geometry::Sphere => radius,
            Geometry::Plane => lanes::map(&radius, trig::versine),
        };
        match self.tail {
            None => versine,
            Some(tail) => {
                lanes::map2(&versine, &u, |v, u| if u > tail.start { 2.0 - (1.0 - u) * tail.slope } else { v })
            }
        }
    }

    #[inline]
    fn tail_versine(&self, u: f32) -> Option<f32> {
        self.tail.filter(|tail| u > tail.start).map(|tail| 2.0 - (1.0 - u) * tail.slope)
    }

    #[inline]
    fn eval_capped(&self, u: f32) -> f32 {
        let (last, others) = self.pieces.split_last().expect("an inverse has at least one piece");
        let radius = others.iter().find(|piece| u <= piece.end).unwrap_or(last).eval(u);
        self.limit.map_or(radius, |limit| radius.min(limit))
    }

    /// The radius and its derivative by `u` in f64, with the f32 coefficients: the map that the shader computes but for its
    /// rounding. Radius as in [`Self::eval`]. Where a fit's error reaches beyond the antipode the radius is the antipode's and the
    /// derivative the fit's.
    #[must_use]
    pub fn eval_f64(&self, u: f64) -> (f64, f64) {
        let u = if u > 0.0 { u.min(1.0) } else { 0.0 };
        if let Some(tail) = self.tail
            && u > tail.joint
        {
            let (v, slope) = (2.0 - (1.0 - u) * f64::from(tail.slope), f64::from(tail.slope));
            return match self.geometry {
                Geometry::Sphere => (v, slope),
                // de = dv / sin e
                Geometry::Plane => (Angle::from_versine(v).radians(), slope / (v * (2.0 - v)).max(1e-30).sqrt()),
            };
        }
        let (last, others) = self.pieces.split_last().expect("an inverse has at least one piece");
        let (radius, slope) = others.iter().find(|piece| u <= f64::from(piece.end)).unwrap_or(last).eval_f64(u);
        (self.limit.map_or(radius, |limit| radius.min(limit.into())), slope)
    }

    /// The eccentricity at `u`, from the f32 evaluation.
    #[must_use]
    pub fn eccentricity(&self, u: f32) -> Angle {
        let x = f64::from(self.eval(u));
        match self.geometry {
            Geometry::Sphere => Angle::from_versine(x),
            Geometry::Plane => Angle::from_radians(x),
        }
    }

    /// The density per steradian that this inverse implies at `u`: `1 / (2 pi dv/du)`, not the model's.
    #[must_use]
    pub fn implied_pdf(&self, u: f64) -> f64 {
        let (x, slope) = self.eval_f64(u);
        let versine_slope = match self.geometry {
            Geometry::Sphere => slope,
            // At the gaze sin(e) de/du is finite: sin(e) ~ e and e ~ sqrt(u).
            Geometry::Plane if x < 1e-12 => return self.implied_pdf(1e-18_f64.max(2.0 * u)),
            Geometry::Plane => x.sin() * slope,
        };
        1.0 / (core::f64::consts::TAU * versine_slope)
    }

    /// The `u` whose radius is `radial` (as in [`Self::eval`]): the CDF that this inverse implies. Below the range 0, above it
    /// 1; NaN gives 0. In a gap between pieces it is the joint's `u`.
    #[must_use]
    pub fn implied_cdf(&self, radial: f64) -> f64 {
        if radial.is_nan() || radial <= 0.0 {
            return 0.0;
        }
        let (mut lo, mut hi) = (0.0, 1.0);
        let mut u = 0.5;
        for _ in 0..200 {
            let (x, slope) = self.eval_f64(u);
            if x < radial {
                lo = u;
            } else {
                hi = u;
            }
            let newton = u - (x - radial) / slope;
            let next = if newton > lo && newton < hi { newton } else { 0.5 * (lo + hi) };
            let change = (next - u).abs();
            u = next;
            if change <= 1e-16 * u || hi - lo <= f64::EPSILON * hi {
                break;
            }
        }
        // The ends are inclusive: a radius at or beyond the last is probability one.
        if radial >= self.eval_f64(1.0).0 { 1.0 } else { u }
    }

    /// Runs the f32 evaluation over every `u = k / count`, `k` in `0..=count`, against the exact quantile, and reports every
    /// error measure. `count = 2^24` is every value that [`crate::sequence::to_unit_f32`] can give; it takes seconds.
    #[must_use]
    pub fn measure(&self, distribution: &RadialDistribution, count: u32) -> ErrorReport {
        certify::measure(self, distribution, count)
    }

    /// As [`Self::measure`] over every f32 in `[smallest, 1]`: 1.07e9 numbers from 0, minutes. Below about 2^-117 the radius on
    /// the sphere is subnormal and loses its digits, below 2^-140 it is 0.
    #[must_use]
    pub fn measure_every_f32(&self, distribution: &RadialDistribution, smallest: f32) -> ErrorReport {
        certify::measure_every_f32(self, distribution, smallest)
    }
}

/// The forms on offer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// A polynomial of this degree (2 to 8) beyond the flat centre.
    Polynomial(u8),
    /// The square of a polynomial of this degree (2 to 8); sphere only.
    SquaredPolynomial(u8),
    /// A rational with these degrees of numerator and denominator (1 to 5).
    Rational(u8, u8),
    /// This many polynomials (2 to 8) of this degree (3 to 7), on pieces of equal error, that meet.
    Piecewise(u8, u8),
    /// A cubic Hermite table with this many cells, a power of two in `[4, 4096]`. As WGSL a constant array, which software
    /// adapters compile slowly (64 cells are fine).
    Table(u16),
    /// Eq. 6 of Koskela et al. 2017 as printed; only for its own distribution, with any floor.
    Eq6,
}

impl Form {
    /// Whether its WGSL compiles in reasonable time everywhere: a table is a constant array there, and above 64 cells a
    /// software adapter takes minutes over it.
    #[must_use]
    pub fn suits_shaders(self) -> bool {
        !matches!(self, Self::Table(cells) if cells > 64)
    }

    /// Name for reports and the command line.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Polynomial(degree) => format!("poly{degree}"),
            Self::SquaredPolynomial(degree) => format!("poly{degree}-squared"),
            Self::Rational(n, m) => format!("rational{n}/{m}"),
            Self::Piecewise(pieces, degree) => format!("{pieces}xpoly{degree}"),
            Self::Table(cells) => format!("table{cells}"),
            Self::Eq6 => "eq6".into(),
        }
    }
}

/// `u` clamped to `[0, 1]`; NaN, for which `clamp` would be NaN, gives 0.
#[inline]
pub(crate) fn unit_interval(u: f32) -> f32 {
    if u > 0.0 { u.min(1.0) } else { 0.0 }
}
