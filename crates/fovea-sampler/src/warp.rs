//! The two-dimensional warp: uniform numbers to directions about a gaze, and back.

use std::sync::Arc;

use crate::frame::{Direction, gaze_frame, gaze_frame_f32};
use crate::inverse::lanes::{self, LANES, Lanes, map2};
use crate::inverse::unit_interval;
use crate::{Angle, Eccentricity, Geometry, Inverse, RadialDistribution, trig};

/// Directions about a gaze direction, distributed by an [`Inverse`]: the first number chooses the radius, the second the
/// azimuth.
///
/// # Definition
/// In the frame `[b1, b2, n]` of [`gaze_frame`] about the gaze `n`: `d = s cos(phi) b1 + s sin(phi) b2 + (1 - v) n`, with
/// `v = 1 - cos e` the inverse's value at `u[0]`, `s = sqrt(v (2 - v))`, `phi = 2 pi u[1]`.
///
/// # Density
/// [`Self::pdf`] and [`WarpSample::pdf`] are the density that the inverse implies, per steradian: what is sampled, not the
/// model.
///
/// # Numerics
/// Stable everywhere on the sphere: at the poles, at the seam, for a gaze opposite to the frame's axis, for negative zeros.
/// A direction's `v` is recovered as `|d - n|^2 / 2`, which keeps its digits near the gaze, where `1 - d.n` loses them all.
///
/// # Inputs out of range
/// Numbers below 0, above 1 and NaN count as 0, 1 and 0. A gaze or direction that is not a unit vector is normalised; one
/// that cannot be (zero, not finite) counts as `[0, 0, -1]`, the film's centre.
#[derive(Clone, Debug)]
pub struct GazeWarp {
    distribution: Arc<RadialDistribution>,
    inverse: Arc<Inverse>,
}

/// A direction drawn by [`GazeWarp::sample`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarpSample {
    /// The unit vector.
    pub direction: Direction,
    /// Its density per steradian.
    pub pdf: f64,
    /// Its angle to the gaze.
    pub eccentricity: Eccentricity,
}

impl GazeWarp {
    /// With the default inverse of the distribution.
    #[must_use]
    pub fn new(distribution: RadialDistribution) -> Self {
        let inverse = Inverse::default_for(&distribution);
        Self::with_inverse(distribution, inverse)
    }

    /// With a given inverse, which should be one of `distribution`.
    #[must_use]
    pub fn with_inverse(distribution: RadialDistribution, inverse: Inverse) -> Self {
        Self { distribution: Arc::new(distribution), inverse: Arc::new(inverse) }
    }

    /// The exact distribution.
    #[must_use]
    pub fn distribution(&self) -> &RadialDistribution {
        &self.distribution
    }

    /// The inverse in use.
    #[must_use]
    pub fn inverse(&self) -> &Inverse {
        &self.inverse
    }

    /// The direction at `u`.
    #[must_use]
    pub fn sample(&self, u: [f64; 2], gaze: Direction) -> WarpSample {
        let u = u.map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 });
        let (radial, _) = self.inverse.eval_f64(u[0]);
        let v = match self.inverse.geometry() {
            Geometry::Sphere => radial.clamp(0.0, 2.0),
            Geometry::Plane => Angle::from_radians(radial).versine(),
        };
        let (sine, azimuth) = ((v * (2.0 - v)).sqrt(), core::f64::consts::TAU * u[1]);
        let local = [sine * azimuth.cos(), sine * azimuth.sin(), 1.0 - v];
        let direction = to_world(gaze_frame(unit(gaze)), local);
        WarpSample { direction, pdf: self.inverse.implied_pdf(u[0]), eccentricity: Angle::from_versine(v) }
    }

    /// The shader's arithmetic: the unit direction in the gaze's frame, as WGSL's `warp_local`.
    #[inline]
    #[must_use]
    pub fn sample_local_f32(&self, u: [f32; 2]) -> [f32; 3] {
        local_direction(self.inverse.eval_versine(u[0]), u[1])
    }

    /// [`Self::sample_local_f32`] of many numbers, bit for bit, at a fraction of its cost: the inverse's form is chosen once
    /// for a block of them. As many as the shorter slice has.
    pub fn sample_local_batch(&self, numbers: &[[f32; 2]], directions: &mut [[f32; 3]]) {
        for_each_block(numbers, directions, |u, turns| {
            let v = self.inverse.eval_versine_lanes(u);
            let sine = lanes::map(&v, polar_sine);
            let [cos, sin] = cos_sin_lanes(turns);
            [map2(&sine, &cos, |s, c| s * c), map2(&sine, &sin, |s, c| s * c), lanes::map(&v, |v| 1.0 - v)]
        });
    }

    /// The shader's arithmetic: the direction in world space.
    #[inline]
    #[must_use]
    pub fn sample_f32(&self, u: [f32; 2], gaze: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.sample_local_f32(u);
        let [b1, b2, n] = gaze_frame_f32(gaze);
        core::array::from_fn(|k| b1[k] * x + b2[k] * y + n[k] * z)
    }

    /// The density per steradian of `direction`, given the gaze. Zero where nothing is sampled.
    #[must_use]
    pub fn pdf(&self, direction: Direction, gaze: Direction) -> f64 {
        let radial = self.radial(direction, gaze);
        let largest = self.inverse.eval_f64(1.0).0;
        if radial > largest * (1.0 + 1e-12) { 0.0 } else { self.inverse.implied_pdf(self.inverse.implied_cdf(radial)) }
    }

    /// The numbers that [`Self::sample`] takes to `direction`. The azimuth's number is in `[0, 1)`, 0 at the gaze itself.
    #[must_use]
    pub fn invert(&self, direction: Direction, gaze: Direction) -> [f64; 2] {
        let [b1, b2, n] = gaze_frame(unit(gaze));
        let d = unit(direction);
        let turns = dot(d, b2).atan2(dot(d, b1)) / core::f64::consts::TAU;
        let wrapped = turns - turns.floor();
        // A tiny negative angle rounds up to a whole turn.
        let azimuth = if wrapped < 1.0 { wrapped } else { 0.0 };
        [self.inverse.implied_cdf(self.radial_of(d, n)), azimuth]
    }

    fn radial(&self, direction: Direction, gaze: Direction) -> f64 {
        self.radial_of(unit(direction), unit(gaze))
    }

    fn radial_of(&self, d: Direction, n: Direction) -> f64 {
        let v = versine_between(d, n);
        match self.inverse.geometry() {
            Geometry::Sphere => v,
            Geometry::Plane => Angle::from_versine(v).radians(),
        }
    }
}

#[inline]
fn local_direction(versine: f32, turns: f32) -> [f32; 3] {
    let sine = polar_sine(versine);
    let [cos, sin] = trig::cos_sin_turn(unit_interval(turns));
    [sine * cos, sine * sin, 1.0 - versine]
}

#[inline]
fn polar_sine(versine: f32) -> f32 {
    (versine * (2.0 - versine)).max(0.0).sqrt()
}

/// Points of the unit disc, uniform by area, with `z = 0`: what a warp's cost is measured against, in the same blocks.
pub fn uniform_disc_batch(numbers: &[[f32; 2]], points: &mut [[f32; 3]]) {
    for_each_block(numbers, points, |u, turns| {
        let radius = lanes::map(u, |u| unit_interval(u).sqrt());
        let [cos, sin] = cos_sin_lanes(turns);
        [map2(&radius, &cos, |r, c| r * c), map2(&radius, &sin, |r, s| r * s), [0.0; LANES]]
    });
}

fn cos_sin_lanes(turns: &Lanes) -> [Lanes; 2] {
    let [mut cos, mut sin] = [[0.0; LANES]; 2];
    for ((turns, cos), sin) in turns.iter().zip(&mut cos).zip(&mut sin) {
        [*cos, *sin] = trig::cos_sin_turn(unit_interval(*turns));
    }
    [cos, sin]
}

#[inline]
fn for_each_block(numbers: &[[f32; 2]], out: &mut [[f32; 3]], block: impl Fn(&Lanes, &Lanes) -> [Lanes; 3]) {
    for (numbers, out) in numbers.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let [mut u, mut turns] = [[0.0; LANES]; 2];
        for ((number, u), turns) in numbers.iter().zip(&mut u).zip(&mut turns) {
            [*u, *turns] = *number;
        }
        let [x, y, z] = block(&u, &turns);
        let xyz = x.iter().zip(&y).zip(&z).take(numbers.len());
        for (out, ((x, y), z)) in out.iter_mut().zip(xyz) {
            *out = [*x, *y, *z];
        }
    }
}

/// `1 - cos` of the angle between unit vectors, as `|a - b|^2 / 2`: accurate near zero.
pub(crate) fn versine_between(a: Direction, b: Direction) -> f64 {
    let difference: Direction = core::array::from_fn(|k| a[k] - b[k]);
    (0.5 * dot(difference, difference)).min(2.0)
}

pub(crate) fn dot(a: Direction, b: Direction) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn to_world([b1, b2, n]: [Direction; 3], [x, y, z]: Direction) -> Direction {
    core::array::from_fn(|k| b1[k] * x + b2[k] * y + n[k] * z)
}

/// The unit vector along `v`; `[0, 0, -1]` if there is none.
pub(crate) fn unit(v: Direction) -> Direction {
    // Scaled first, so that the squares neither overflow nor vanish.
    let largest = v.iter().fold(0.0, |a: f64, x| if x.is_finite() { a.max(x.abs()) } else { f64::NAN });
    if !largest.is_normal() || v.iter().any(|x| !x.is_finite()) {
        return [0.0, 0.0, -1.0];
    }
    let scaled = v.map(|x| x / largest);
    let length = dot(scaled, scaled).sqrt();
    scaled.map(|x| x / length)
}
