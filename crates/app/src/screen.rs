//! The screen before the eye: millimetres, viewing distance, and angles at the eye.
//!
//! The eye is taken to be opposite the centre of the window; eye space has +X to the right, +Y up and -Z towards the
//! screen. Points on the screen are millimetres from the window's centre, y up.

use glam::{Quat, Vec2, Vec3};

/// Angle at the eye, in degrees, within which acuity is full in Reddy's model.
pub const FOVEA_DEG: f32 = 5.79;

/// Size and distance of a flat screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenGeometry {
    /// Width of the whole screen, millimetres.
    pub width_mm: f32,
    /// Height of the whole screen, millimetres.
    pub height_mm: f32,
    /// From the eye to the screen, millimetres.
    pub distance_mm: f32,
}

impl Default for ScreenGeometry {
    /// A 24-inch 16:9 monitor at 65 cm.
    fn default() -> Self {
        Self { width_mm: 531.0, height_mm: 299.0, distance_mm: 650.0 }
    }
}

impl ScreenGeometry {
    /// Millimetres per physical pixel, when the screen is `screen_px` wide and high.
    pub fn mm_per_px(&self, screen_px: Vec2) -> Vec2 {
        Vec2::new(self.width_mm, self.height_mm) / screen_px.max(Vec2::ONE)
    }

    /// Unit direction at the eye of a point on the screen.
    pub fn eye_direction(&self, point_mm: Vec2) -> Vec3 {
        point_mm.extend(-self.distance_mm).normalize()
    }

    /// Where a direction at the eye meets the screen's plane; `None` when it never does.
    pub fn screen_point_mm(&self, direction_in_eye: Vec3) -> Option<Vec2> {
        (direction_in_eye.z < -1e-6).then(|| direction_in_eye.truncate() * (self.distance_mm / -direction_in_eye.z))
    }

    /// Angle at the eye between two points of the screen, radians.
    pub fn eccentricity(&self, from_mm: Vec2, to_mm: Vec2) -> f32 {
        self.eye_direction(from_mm).angle_between(self.eye_direction(to_mm))
    }

    /// The closed curve of all points at `eccentricity` radians from a gaze point, in steps of a `count`-th of a turn.
    /// Points whose direction misses the screen's plane are left out.
    pub fn ring_mm(&self, gaze_mm: Vec2, eccentricity: f32, count: u16) -> Vec<Vec2> {
        let gaze = self.eye_direction(gaze_mm);
        let off_axis = Quat::from_axis_angle(gaze.any_orthonormal_vector(), eccentricity) * gaze;
        (0..count)
            .filter_map(|step| {
                let azimuth = std::f32::consts::TAU * f32::from(step) / f32::from(count);
                self.screen_point_mm(Quat::from_axis_angle(gaze, azimuth) * off_axis)
            })
            .collect()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn half_the_default_screen_is_22_degrees() {
        let screen = ScreenGeometry::default();
        let edge = Vec2::new(screen.width_mm * 0.5, 0.0);
        let expected = (265.5_f32 / 650.0).atan();
        assert!((screen.eccentricity(Vec2::ZERO, edge) - expected).abs() < 1e-5);
    }

    #[test]
    fn directions_and_points_round_trip() {
        let screen = ScreenGeometry { width_mm: 300.0, height_mm: 200.0, distance_mm: 400.0 };
        for point in [Vec2::ZERO, Vec2::new(140.0, -90.0), Vec2::new(-600.0, 10.0)] {
            let found = screen.screen_point_mm(screen.eye_direction(point)).unwrap();
            assert!(found.distance(point) < 0.01 * (1.0 + point.length()) * 0.01, "{point} {found}");
        }
        assert_eq!(screen.screen_point_mm(Vec3::Z), None);
    }

    #[test]
    fn every_point_of_the_ring_lies_at_its_angle() {
        let screen = ScreenGeometry::default();
        let angle = FOVEA_DEG.to_radians();
        for gaze in [Vec2::ZERO, Vec2::new(250.0, -140.0)] {
            let ring = screen.ring_mm(gaze, angle, 48);
            assert_eq!(ring.len(), 48);
            for point in ring {
                assert!((screen.eccentricity(gaze, point) - angle).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn at_the_centre_the_ring_is_a_circle_of_66_mm() {
        let ring = ScreenGeometry::default().ring_mm(Vec2::ZERO, FOVEA_DEG.to_radians(), 16);
        let expected = 650.0 * FOVEA_DEG.to_radians().tan();
        assert!(ring.iter().all(|point| (point.length() - expected).abs() < 0.01), "{expected}");
    }

    #[test]
    fn a_pixel_of_a_full_hd_screen_is_a_quarter_of_a_millimetre() {
        let pitch = ScreenGeometry::default().mm_per_px(Vec2::new(1920.0, 1080.0));
        assert!((pitch.x - 0.2766).abs() < 1e-3 && (pitch.y - 0.2769).abs() < 1e-3);
    }
}
