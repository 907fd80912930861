//! Angles with their unit in the type.

/// An angle, held in radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Angle(f64);

/// The angle at the eye between the line of sight and a direction, in `[0, 180]` degrees.
pub type Eccentricity = Angle;

impl Angle {
    /// No angle.
    pub const ZERO: Self = Self(0.0);
    /// Half a turn, 180 degrees: the direction behind the viewer.
    pub const HALF_TURN: Self = Self(core::f64::consts::PI);

    /// From radians.
    #[must_use]
    pub const fn from_radians(radians: f64) -> Self {
        Self(radians)
    }

    /// From degrees.
    #[must_use]
    pub const fn from_degrees(degrees: f64) -> Self {
        Self(degrees * (core::f64::consts::PI / 180.0))
    }

    /// In radians.
    #[must_use]
    pub const fn radians(self) -> f64 {
        self.0
    }

    /// In degrees.
    #[must_use]
    pub const fn degrees(self) -> f64 {
        self.0 * (180.0 / core::f64::consts::PI)
    }

    /// `1 - cos` of the angle, without cancellation near zero: the variable in which the solid angle of a cap is
    /// linear (`2 pi v` steradians).
    #[must_use]
    pub fn versine(self) -> f64 {
        let half = (0.5 * self.0).sin();
        2.0 * half * half
    }

    /// The angle in `[0, pi]` with the given versine; the versine is clamped to `[0, 2]`.
    #[must_use]
    pub fn from_versine(versine: f64) -> Self {
        let v = versine.clamp(0.0, 2.0);
        // atan2 keeps full accuracy at both ends, where asin and acos lose it.
        Self(2.0 * (v / 2.0).sqrt().atan2((1.0 - v / 2.0).sqrt()))
    }
}
