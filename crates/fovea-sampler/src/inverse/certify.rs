//! Error measures of an inverse against the exact quantile, and the bound that is derived from them.

use core::ops::RangeInclusive;

use super::Inverse;
use crate::truth::Truth;
use crate::{Angle, Geometry, RadialDistribution};

/// Beyond this eccentricity an angle is ill-conditioned in `v = 1 - cos e`: the error is stated as the chord's there.
const ANGLE_LIMIT_RAD: f64 = 150.0 / 180.0 * core::f64::consts::PI;

/// Points at which a map's density and CDF are measured, at most. A prime: none is a point that a bound was made from.
const MOST_MAP_POINTS: u32 = 40_009;

/// An upper bound on an inverse's errors.
///
/// # Domain and arithmetic
/// `relative_e` and `relative_chord` hold for the f32 evaluation at `u = 0` and every multiple of 2^-24 in `(0, 1]`;
/// `relative_density` and `cdf` for the f64 evaluation of the same coefficients. Each is the largest value measured at 2^14
/// points, spread over `[0, 1]` and on both sides of every joint and cell's edge, with a margin: 2 % of what is smooth in `u`
/// (5 % for the density), what f32's rounding adds once more, and one ulp. The crate's tests check the errors of the f32
/// evaluation at all 2^24, and density and CDF at 40,009 points other than those 2^14.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBound {
    /// `|e^ - e| / e`, over all `u` whose exact eccentricity is within the cap and at most 150 degrees.
    pub relative_e: f64,
    /// `|sin(e^/2) - sin(e/2)| / sin(e/2)`, over all `u`: the error in the chord from the gaze to the direction.
    pub relative_chord: f64,
    /// `|implied density / exact density - 1|` at the same eccentricity, within the cap; excludes gaps (Eq. 6's ring).
    pub relative_density: f64,
    /// `|CDF(e^) - u|`.
    pub cdf: f64,
    /// Largest relative difference, within the cap, between the radius in f32 and in f64 with the same coefficients: by how
    /// much rounding may make the radius fall where the map rises.
    pub rounding: f64,
}

impl ErrorBound {
    /// What an inverse has before it is measured.
    pub(super) const UNKNOWN: Self = Self {
        relative_e: f64::INFINITY,
        relative_chord: f64::INFINITY,
        relative_density: f64::INFINITY,
        cdf: f64::INFINITY,
        rounding: f64::INFINITY,
    };
}

/// The largest errors of an inverse over the points that were measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorReport {
    /// The number of intervals of `[0, 1]` whose ends were evaluated in f32.
    pub count: u32,
    /// As [`ErrorBound::relative_e`].
    pub relative_e: f64,
    /// The `u` of `relative_e`.
    pub relative_e_at: f32,
    /// Largest `|e^ - e|` in degrees, where `relative_e` is measured.
    pub absolute_e_deg: f64,
    /// As [`ErrorBound::relative_chord`].
    pub relative_chord: f64,
    /// As [`ErrorBound::relative_density`], at the middles of as many intervals, at most 40,009, and on both sides of every joint
    /// and of the edges of a table's cells.
    pub relative_density: f64,
    /// The eccentricity of `relative_density`, degrees.
    pub relative_density_at_deg: f64,
    /// As [`ErrorBound::cdf`], at the points of `relative_density`.
    pub cdf: f64,
    /// As [`ErrorBound::rounding`].
    pub rounding: f64,
}

impl ErrorReport {
    /// The bound that this report supports.
    pub(super) fn bound(&self) -> ErrorBound {
        const ULP: f64 = 6e-8;
        let with_rounding = |error: f64| error * 1.02 + self.rounding + ULP;
        ErrorBound {
            relative_e: with_rounding(self.relative_e),
            relative_chord: with_rounding(self.relative_chord),
            relative_density: self.relative_density * 1.05 + ULP,
            cdf: self.cdf * 1.02 + ULP,
            rounding: 2.0 * self.rounding + ULP,
        }
    }

    fn merge(self, other: Self) -> Self {
        let e = if self.relative_e >= other.relative_e { self } else { other };
        let density = if self.relative_density >= other.relative_density { self } else { other };
        Self {
            count: self.count,
            relative_e: e.relative_e,
            relative_e_at: e.relative_e_at,
            absolute_e_deg: self.absolute_e_deg.max(other.absolute_e_deg),
            relative_chord: self.relative_chord.max(other.relative_chord),
            relative_density: density.relative_density,
            relative_density_at_deg: density.relative_density_at_deg,
            cdf: self.cdf.max(other.cdf),
            rounding: self.rounding.max(other.rounding),
        }
    }

    const fn empty(count: u32) -> Self {
        Self {
            count,
            relative_e: 0.0,
            relative_e_at: 0.0,
            absolute_e_deg: 0.0,
            relative_chord: 0.0,
            relative_density: 0.0,
            relative_density_at_deg: 0.0,
            cdf: 0.0,
            rounding: 0.0,
        }
    }
}

/// Measures `inverse` at `u = k / count` on all cores.
pub(super) fn measure(inverse: &Inverse, distribution: &RadialDistribution, count: u32) -> ErrorReport {
    let count = count.max(1);
    let number = |k: u32| (f64::from(k) / f64::from(count)) as f32;
    measure_numbers(inverse, distribution, 0..=count, number)
}

/// Measures `inverse` at every f32 in `[smallest, 1]` on all cores.
pub(super) fn measure_every_f32(inverse: &Inverse, distribution: &RadialDistribution, smallest: f32) -> ErrorReport {
    let first = smallest.clamp(0.0, 1.0).to_bits();
    // Positive floats are ordered as their bits.
    measure_numbers(inverse, distribution, first..=1f32.to_bits(), f32::from_bits)
}

fn measure_numbers(
    inverse: &Inverse,
    distribution: &RadialDistribution,
    range: RangeInclusive<u32>,
    number: impl Fn(u32) -> f32 + Copy + Send + Sync,
) -> ErrorReport {
    let truth = &Truth::new(distribution);
    let (first, count) = (*range.start(), range.end() - range.start());
    let map_errors = measure_map(inverse, distribution, count.clamp(1, MOST_MAP_POINTS));
    let workers = if count > 1 << 16 { std::thread::available_parallelism().map_or(1, usize::from) as u32 } else { 1 };
    let chunk = count / workers + 1;
    let measured = std::thread::scope(|scope| {
        let work = |w: u32| {
            let numbers = (w * chunk..=((w + 1) * chunk).min(count)).map(move |k| number(first + k));
            scope.spawn(move || measure_f32(inverse, distribution, truth, numbers))
        };
        let handles: Vec<_> = (0..workers).map(work).collect();
        handles
            .into_iter()
            .map(|handle| handle.join().expect("the measurement does not panic"))
            .fold(ErrorReport::empty(count), ErrorReport::merge)
    });
    measured.merge(map_errors)
}

/// The errors of the f32 evaluation.
fn measure_f32(
    inverse: &Inverse,
    distribution: &RadialDistribution,
    truth: &Truth,
    numbers: impl Iterator<Item = f32>,
) -> ErrorReport {
    let mut report = ErrorReport::empty(0);
    let scale = 1.0 + distribution.outer_ratio();
    let within_cap = |u: f64| inverse.tail().is_none_or(|tail| u <= tail.joint);
    let mut add = |u: f32| {
        let found = f64::from(inverse.eval(u));
        let unrounded = inverse.eval_f64(f64::from(u)).0;
        if unrounded > 0.0 && within_cap(f64::from(u)) {
            report.rounding = report.rounding.max((found / unrounded - 1.0).abs());
        }
        report.add(inverse.geometry(), found, u, &ExactAt::new(distribution, truth, f64::from(u) * scale));
    };
    // Terms that cancel do so at the end, so its neighbours are looked at one by one.
    (0..256).map(|k| (1.0 - f64::from(k) / 16_777_216.0) as f32).for_each(&mut add);
    numbers.for_each(add);
    report
}

/// The exact eccentricity and versine at a `u`.
struct ExactAt {
    e: f64,
    versine: f64,
    within_cap: bool,
}

impl ExactAt {
    fn new(distribution: &RadialDistribution, truth: &Truth, capped_u: f64) -> Self {
        let within_cap = capped_u <= 1.0;
        if !within_cap {
            let e = distribution.quantile_of_capped(capped_u);
            return Self { e: e.radians(), versine: e.versine(), within_cap };
        }
        let radial = truth.radial(capped_u);
        match distribution.geometry() {
            Geometry::Sphere => Self { e: Angle::from_versine(radial).radians(), versine: radial, within_cap },
            Geometry::Plane => Self { e: radial, versine: Angle::from_radians(radial).versine(), within_cap },
        }
    }
}

impl ErrorReport {
    fn add(&mut self, geometry: Geometry, found: f64, u: f32, exact: &ExactAt) {
        if exact.e == 0.0 {
            if found != 0.0 {
                self.relative_e = f64::INFINITY;
            }
            return;
        }
        let (e, versine) = match geometry {
            Geometry::Sphere => (Angle::from_versine(found).radians(), found),
            Geometry::Plane => (found, Angle::from_radians(found).versine()),
        };
        self.relative_chord = self.relative_chord.max(((versine / exact.versine).sqrt() - 1.0).abs());
        if exact.within_cap && exact.e <= ANGLE_LIMIT_RAD {
            let absolute = (e - exact.e).abs();
            self.absolute_e_deg = self.absolute_e_deg.max(Angle::from_radians(absolute).degrees());
            if absolute / exact.e > self.relative_e {
                (self.relative_e, self.relative_e_at) = (absolute / exact.e, u);
            }
        }
    }
}

/// The errors of the map itself (f64): density and CDF.
fn measure_map(inverse: &Inverse, distribution: &RadialDistribution, count: u32) -> ErrorReport {
    let mut report = ErrorReport::empty(count);
    let joints = inverse.pieces().iter().flat_map(|piece| piece.edges().chain([f64::from(piece.end)]));
    let both_sides = joints.flat_map(|u| [u * (1.0 - 1e-7), u * (1.0 + 1e-7)]);
    for u in (0..count).map(|k| (f64::from(k) + 0.5) / f64::from(count)).chain(both_sides).filter(|u| *u <= 1.0) {
        let (radial, _) = inverse.eval_f64(u);
        let e = match inverse.geometry() {
            Geometry::Sphere => Angle::from_versine(radial),
            Geometry::Plane => Angle::from_radians(radial),
        };
        report.cdf = report.cdf.max((distribution.cdf(e) - u).abs());
        if inverse.tail().is_none_or(|tail| u <= tail.joint) && e <= distribution.cap() {
            let implied = inverse.implied_pdf(u);
            // A map that falls anywhere is no inverse: its error is unbounded.
            let error = if implied > 0.0 { (implied / distribution.pdf(e) - 1.0).abs() } else { f64::INFINITY };
            if error > report.relative_density {
                (report.relative_density, report.relative_density_at_deg) = (error, e.degrees());
            }
        }
    }
    report
}
