//! One gaze sample, whatever it comes from.

use std::time::Instant;

/// Where one looked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Point {
    /// Fractions of the tracked screen from its top left; may lie outside 0..=1.
    Screen01([f64; 2]),
    /// Degrees from the view's centre: yaw + to the right, pitch + up.
    ViewDeg([f64; 2]),
    /// A point of the picture: +-1 at its edges, y up. Needs no window position.
    Picture([f64; 2]),
}

/// One sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GazeSample {
    /// Seconds by the device's clock, whose origin is its own.
    pub device_secs: f64,
    /// When the eye was there, as well as that is known by our clock; never after `arrived`.
    pub captured: Instant,
    /// When the sample came to this program.
    pub arrived: Instant,
    /// Where.
    pub point: Point,
    /// Whether the device vouches for the point.
    pub valid: bool,
    /// 0..=1.
    pub confidence: f64,
}
