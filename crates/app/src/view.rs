//! The movable view: where it looks, how much it sees, and how pointer movements turn it.
//!
//! Film space is the tracer's: -Z is the film's centre, +X its right, +Y up. A view never rolls. Points in the view are
//! *image-plane units*: (0, 0) is the centre, (+-1, +-1) the edges, x to the right, y up.

use glam::{EulerRot, Quat, Vec2, Vec3};

/// Smallest and largest angle, in degrees, that a view may span along one axis.
pub const FOV_RANGE_DEG: std::ops::RangeInclusive<f32> = 0.1..=tracer::scene::LARGEST_YFOV_DEG;

/// Unit direction in film space of yaw (+ to the right) and pitch (+ up), radians from the film's centre.
pub fn direction(yaw: f32, pitch: f32) -> Vec3 {
    Vec3::new(yaw.sin() * pitch.cos(), pitch.sin(), -yaw.cos() * pitch.cos())
}

/// Yaw in -pi..=pi and pitch in -pi/2..=pi/2, radians, of a direction in film space.
pub fn yaw_pitch(direction: Vec3) -> (f32, f32) {
    (direction.x.atan2(-direction.z), direction.y.atan2(direction.x.hypot(direction.z)))
}

/// A perspective view into the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Radians to the right of the film's centre, -pi..=pi.
    pub yaw: f32,
    /// Radians up from the film's centre, -pi/2..=pi/2.
    pub pitch: f32,
    /// Tangents of half the angles that the view spans, across and up.
    pub tan_half: Vec2,
}

impl View {
    /// A view of `hfov` by `vfov` radians; angles outside [`FOV_RANGE_DEG`] are clamped.
    pub fn new(yaw: f32, pitch: f32, hfov: f32, vfov: f32) -> Self {
        let tan_half = |fov: f32| (clamp_fov(fov) * 0.5).tan();
        Self { yaw: wrap(yaw), pitch: clamp_pitch(pitch), tan_half: Vec2::new(tan_half(hfov), tan_half(vfov)) }
    }

    /// The view that looks along a rotation's -Z (its roll is dropped), `vfov` radians high, of the given width over
    /// height.
    pub fn along(film_from_camera: Quat, vfov: f32, aspect: f32) -> Self {
        let (yaw, pitch) = yaw_pitch(film_from_camera * Vec3::NEG_Z);
        Self::new(yaw, pitch, vfov, vfov).with_aspect(aspect)
    }

    /// The view of these angles, radians: the yaw is wrapped, the pitch stops at +-pi/2.
    pub fn along_angles(yaw: f32, pitch: f32, tan_half: Vec2) -> Self {
        Self { yaw: wrap(yaw), pitch: clamp_pitch(pitch), tan_half }
    }

    /// The same height with another width over height.
    #[must_use]
    pub fn with_aspect(self, aspect: f32) -> Self {
        let limit = (FOV_RANGE_DEG.end().to_radians() * 0.5).tan();
        // A very wide window at a wide angle keeps its aspect: the height gives way, not the proportions.
        let height = self.tan_half.y.min(limit / aspect.max(1e-3));
        Self { tan_half: Vec2::new(height * aspect.max(1e-3), height), ..self }
    }

    /// Angle across, radians.
    pub fn hfov(&self) -> f32 {
        2.0 * self.tan_half.x.atan()
    }

    /// Angle up, radians.
    pub fn vfov(&self) -> f32 {
        2.0 * self.tan_half.y.atan()
    }

    /// Rotation from view space (-Z ahead, +Y up) to film space.
    pub fn film_from_view(&self) -> Quat {
        Quat::from_euler(EulerRot::YXZ, -self.yaw, self.pitch, 0.0)
    }

    /// Unit direction in film space through a point of the view.
    pub fn direction_at(&self, point: Vec2) -> Vec3 {
        self.film_from_view() * self.ray_in_view(point)
    }

    /// Where a direction in film space meets the view; `None` when it lies behind. May lie outside +-1.
    pub fn point_of(&self, direction_in_film: Vec3) -> Option<Vec2> {
        let in_view = self.film_from_view().inverse() * direction_in_film;
        (in_view.z < -1e-6).then(|| in_view.truncate() / (-in_view.z * self.tan_half))
    }

    /// Turns the view so that `grabbed` (film space) comes to lie at `point`: what one holds stays under the pointer.
    ///
    /// Near the poles, where no unrolled view can do that, the pitch stops at +-90 degrees.
    #[must_use]
    pub fn dragged(self, grabbed: Vec3, point: Vec2) -> Self {
        let ray = self.ray_in_view(point);
        // R_x(pitch) must raise the ray to grabbed.y: |yz| sin(pitch + phase) = grabbed.y.
        let yz = ray.y.hypot(ray.z);
        let phase = ray.y.atan2(-ray.z);
        let pitch = clamp_pitch((grabbed.y / yz).clamp(-1.0, 1.0).asin() - phase);
        let raised = Quat::from_rotation_x(pitch) * ray;
        if grabbed.x.hypot(grabbed.z) < 1e-4 || raised.x.hypot(raised.z) < 1e-4 {
            return Self { pitch, ..self };
        }
        let yaw = wrap(yaw_pitch(grabbed).0 - yaw_pitch(raised).0);
        Self { yaw, pitch, ..self }
    }

    /// Scales the image plane by `factor` (below 1: closer), keeping what lies at `point` where it is.
    #[must_use]
    pub fn zoomed(self, factor: f32, point: Vec2) -> Self {
        let limits = [FOV_RANGE_DEG.start(), FOV_RANGE_DEG.end()].map(|fov| (fov.to_radians() * 0.5).tan());
        let low = limits[0] / self.tan_half.min_element();
        let high = limits[1] / self.tan_half.max_element();
        let anchor = self.direction_at(point);
        let scaled = Self { tan_half: self.tan_half * factor.clamp(low.min(1.0), high.max(1.0)), ..self };
        scaled.dragged(anchor, point)
    }

    /// Unit direction in view space through a point of the view.
    fn ray_in_view(&self, point: Vec2) -> Vec3 {
        (point * self.tan_half).extend(-1.0).normalize()
    }
}

fn clamp_fov(fov: f32) -> f32 {
    fov.clamp(FOV_RANGE_DEG.start().to_radians(), FOV_RANGE_DEG.end().to_radians())
}

fn clamp_pitch(pitch: f32) -> f32 {
    pitch.clamp(-std::f32::consts::FRAC_PI_2, std::f32::consts::FRAC_PI_2)
}

/// Wraps an angle to -pi..=pi.
fn wrap(angle: f32) -> f32 {
    let turn = std::f32::consts::TAU;
    angle - turn * (angle / turn).round()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn view(yaw_deg: f32, pitch_deg: f32, fov_deg: f32) -> View {
        View::new(yaw_deg.to_radians(), pitch_deg.to_radians(), fov_deg.to_radians(), fov_deg.to_radians())
    }

    #[test]
    fn yaw_is_to_the_right_and_pitch_is_up() {
        let quarter = std::f32::consts::FRAC_PI_2;
        assert!(direction(0.0, 0.0).distance(Vec3::NEG_Z) < 1e-6);
        assert!(direction(quarter, 0.0).distance(Vec3::X) < 1e-6);
        assert!(direction(0.0, quarter).distance(Vec3::Y) < 1e-6);
        for (yaw, pitch) in [(0.3, -0.4), (-3.0, 1.2), (3.1, 0.0)] {
            let (found_yaw, found_pitch) = yaw_pitch(direction(yaw, pitch));
            assert!((found_yaw - yaw).abs() < 1e-5 && (found_pitch - pitch).abs() < 1e-5);
        }
    }

    #[test]
    fn the_centre_of_a_view_is_its_yaw_and_pitch() {
        let view = view(70.0, -35.0, 60.0);
        assert!(view.direction_at(Vec2::ZERO).distance(direction(view.yaw, view.pitch)) < 1e-6);
    }

    #[test]
    fn points_and_directions_round_trip() {
        let view = view(-160.0, 40.0, 95.0);
        for point in [Vec2::ZERO, Vec2::new(0.9, -0.7), Vec2::new(-1.0, 1.0)] {
            assert!(view.point_of(view.direction_at(point)).unwrap().distance(point) < 1e-4);
        }
        assert_eq!(view.point_of(-view.direction_at(Vec2::ZERO)), None);
    }

    #[test]
    fn the_right_edge_lies_half_the_angle_away() {
        let view = view(0.0, 0.0, 80.0);
        let (yaw, pitch) = yaw_pitch(view.direction_at(Vec2::X));
        assert!((yaw.to_degrees() - 40.0).abs() < 1e-3 && pitch.abs() < 1e-6);
    }

    #[test]
    fn what_is_grabbed_stays_under_the_pointer() {
        let start = view(25.0, 10.0, 70.0);
        let grabbed = start.direction_at(Vec2::new(0.2, -0.3));
        for target in [Vec2::new(0.8, 0.5), Vec2::new(-0.9, -0.1), Vec2::new(0.2, -0.3)] {
            let moved = start.dragged(grabbed, target);
            assert!(moved.point_of(grabbed).unwrap().distance(target) < 1e-3, "{target}");
        }
        assert!((start.dragged(grabbed, Vec2::new(0.2, -0.3)).yaw - start.yaw).abs() < 1e-5);
    }

    #[test]
    fn dragging_past_a_pole_stops_there() {
        let start = view(0.0, 85.0, 60.0);
        let grabbed = start.direction_at(Vec2::new(0.0, 1.0));
        let moved = start.dragged(grabbed, Vec2::new(0.3, -1.0));
        assert!(moved.pitch <= std::f32::consts::FRAC_PI_2 && moved.yaw.is_finite());
    }

    #[test]
    fn zoom_keeps_the_point_under_the_pointer_and_stays_in_range() {
        let start = view(120.0, -20.0, 70.0);
        let point = Vec2::new(0.6, 0.4);
        let anchor = start.direction_at(point);
        let closer = start.zoomed(0.5, point);
        assert!((closer.tan_half.x / start.tan_half.x - 0.5).abs() < 1e-5);
        assert!(closer.point_of(anchor).unwrap().distance(point) < 1e-3);
        let mut wide = start;
        for _ in 0..50 {
            wide = wide.zoomed(1.5, point);
        }
        assert!((wide.hfov().to_degrees() - FOV_RANGE_DEG.end()).abs() < 0.1);
    }

    #[test]
    fn aspect_changes_the_width_only_until_the_view_is_too_wide() {
        let square = view(0.0, 0.0, 60.0);
        let wide = square.with_aspect(2.0);
        assert_eq!(wide.tan_half.y, square.tan_half.y);
        assert!((wide.tan_half.x / wide.tan_half.y - 2.0).abs() < 1e-5);
        let too_wide = view(0.0, 0.0, 160.0).with_aspect(30.0);
        assert!(too_wide.hfov().to_degrees() <= FOV_RANGE_DEG.end() + 0.1);
        assert!((too_wide.tan_half.x / too_wide.tan_half.y - 30.0).abs() < 1e-3);
    }

    #[test]
    fn a_rolled_camera_gives_an_upright_view_in_its_direction() {
        let rotation = Quat::from_euler(EulerRot::YXZ, -0.8, 0.3, 0.5);
        let view = View::along(rotation, 1.0, 1.5);
        assert!(view.direction_at(Vec2::ZERO).distance(rotation * Vec3::NEG_Z) < 1e-5);
        assert!((view.vfov() - 1.0).abs() < 1e-5);
    }
}
