//! Regions of the sphere.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::frame::{Direction, gaze_frame};
use crate::warp::{to_world, unit, versine_between};
use crate::{Angle, SamplerError};

/// A region of directions with a known solid angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region(Shape);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Cap {
        centre: Direction,
        versine: f64,
    },
    /// Radians; `yaw[1]` may exceed pi (the region crosses the seam), `yaw[1] - yaw[0]` in (0, 2 pi].
    Rectangle {
        yaw: [f64; 2],
        pitch: [f64; 2],
    },
}

impl Region {
    /// All directions within `radius` of `centre`.
    ///
    /// # Errors
    /// Unless the radius lies in (0, 180] degrees.
    pub fn cap(centre: Direction, radius: Angle) -> Result<Self, SamplerError> {
        let value = radius.degrees();
        if !(value > 0.0 && value <= 180.0 + 1e-12) {
            return Err(SamplerError::Parameter {
                what: "a cap's radius in degrees",
                value,
                requirement: "in (0, 180]",
            });
        }
        Ok(Self(Shape::Cap { centre: unit(centre), versine: radius.versine() }))
    }

    /// A rectangle in yaw (+ to the right) and pitch (+ up) about the film's centre. A yaw range whose end lies below its
    /// start crosses the seam behind the viewer.
    ///
    /// # Errors
    /// If a yaw is outside `[-180, 180]` degrees, a pitch outside `[-90, 90]`, or the range empty.
    pub fn rectangle(yaw: [Angle; 2], pitch: [Angle; 2]) -> Result<Self, SamplerError> {
        let error = |what, value: f64, requirement| Err(SamplerError::Parameter { what, value, requirement });
        for angle in yaw {
            if angle.degrees().is_nan() || angle.degrees().abs() > 180.0 + 1e-12 {
                return error("a region's yaw in degrees", angle.degrees(), "in [-180, 180]");
            }
        }
        for angle in pitch {
            if angle.degrees().is_nan() || angle.degrees().abs() > 90.0 + 1e-12 {
                return error("a region's pitch in degrees", angle.degrees(), "in [-90, 90]");
            }
        }
        let ([lo, mut hi], pitch) = (yaw.map(Angle::radians), pitch.map(|p| p.radians().clamp(-FRAC_PI_2, FRAC_PI_2)));
        if hi <= lo {
            hi += TAU;
        }
        if hi == lo || hi - lo > TAU + 1e-12 {
            return error("the width of a region in degrees", Angle::from_radians(hi - lo).degrees(), "in (0, 360]");
        }
        if pitch[1] <= pitch[0] {
            let height = Angle::from_radians(pitch[1] - pitch[0]).degrees();
            return error("the height of a region in degrees", height, "positive");
        }
        Ok(Self(Shape::Rectangle { yaw: [lo, hi], pitch }))
    }

    /// Whether a unit direction lies inside.
    #[must_use]
    pub fn contains(&self, direction: Direction) -> bool {
        match self.0 {
            Shape::Cap { centre, versine } => versine_between(direction, centre) <= versine,
            Shape::Rectangle { yaw, pitch } => {
                let [x, y, z] = direction;
                let latitude = y.atan2(x.hypot(z));
                let longitude = x.atan2(-z);
                let turns_past = (longitude - yaw[0]).rem_euclid(TAU);
                (pitch[0]..=pitch[1]).contains(&latitude) && turns_past <= yaw[1] - yaw[0]
            }
        }
    }

    /// Its solid angle in steradians.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        match self.0 {
            Shape::Cap { versine, .. } => TAU * versine,
            Shape::Rectangle { yaw, pitch } => (yaw[1] - yaw[0]).min(TAU) * (pitch[1].sin() - pitch[0].sin()),
        }
    }

    /// A direction that is uniform in it for uniform `u`.
    pub(super) fn sample(&self, u: [f64; 2]) -> Direction {
        match self.0 {
            Shape::Cap { centre, versine } => {
                let v = versine * u[0];
                let (sine, (sin, cos)) = ((v * (2.0 - v)).sqrt(), (TAU * u[1]).sin_cos());
                to_world(gaze_frame(centre), [sine * cos, sine * sin, 1.0 - v])
            }
            Shape::Rectangle { yaw, pitch } => {
                let height = pitch[0].sin() + (pitch[1].sin() - pitch[0].sin()) * u[0];
                let cos_latitude = (1.0 - height * height).max(0.0).sqrt();
                let (sin, cos) = (yaw[0] + (yaw[1] - yaw[0]) * u[1]).sin_cos();
                [cos_latitude * sin, height, -cos_latitude * cos]
            }
        }
    }

    /// The whole sphere.
    pub(super) const SPHERE: Self = Self(Shape::Rectangle { yaw: [-PI, PI], pitch: [-FRAC_PI_2, FRAC_PI_2] });
}
