//! Eccentricity at the eye, for a flat screen that shows a perspective view of a scene.
//!
//! A monitor of 44 by 26 degrees may show 60 degrees of a scene, or 14 through a long lens; acuity falls with the angle at
//! the eye, not with the scene's. Gaze and samples are points of the screen: the warp runs in eye space, and the point where
//! its ray meets the screen is taken through the view to the scene.

use crate::frame::{Direction, gaze_frame};
use crate::warp::{GazeWarp, dot, unit};
use crate::{Angle, SamplerError};

/// A flat screen before an eye on the axis through its centre, showing a perspective view.
///
/// Eye space and scene space both look along -Z with +X right and +Y up. Both see the screen's plane by central projection,
/// so that a point's tangents in the scene are its tangents at the eye times [`Self::scene_scale`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeScreen {
    half_height_tan: f64,
    aspect: f64,
    scene_scale: f64,
}

/// A direction drawn by [`EyeScreen::sample`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeSample {
    /// In scene space, before the view's own rotation.
    pub direction: Direction,
    /// Density per steradian of the scene.
    pub pdf: f64,
    /// Angle at the eye between gaze and sample.
    pub eccentricity: Angle,
}

impl EyeScreen {
    /// From the screen's size and the eye's distance in millimetres and the vertical angle of the view that fills the screen.
    ///
    /// # Errors
    /// If a length is not positive, or the angle not in (0, 180) degrees.
    pub fn new(size_mm: [f64; 2], distance_mm: f64, vertical_fov: Angle) -> Result<Self, SamplerError> {
        let lengths = [
            ("the screen's width in mm", size_mm[0]),
            ("the screen's height in mm", size_mm[1]),
            ("the viewing distance in mm", distance_mm),
        ];
        for (what, value) in lengths {
            if !(1e-3..=1e7).contains(&value) {
                return Err(SamplerError::Parameter { what, value, requirement: "in [1e-3, 1e7]" });
            }
        }
        let degrees = vertical_fov.degrees();
        if !(degrees > 0.0 && degrees < 180.0) {
            let (what, requirement) = ("the vertical angle of view in degrees", "in (0, 180)");
            return Err(SamplerError::Parameter { what, value: degrees, requirement });
        }
        let half_height_tan = 0.5 * size_mm[1] / distance_mm;
        let scene_scale = (0.5 * vertical_fov.radians()).tan() / half_height_tan;
        Ok(Self { half_height_tan, aspect: size_mm[0] / size_mm[1], scene_scale })
    }

    /// Tangents in the scene over tangents at the eye: above 1 the screen shows more of the scene than its own angle.
    #[must_use]
    pub fn scene_scale(&self) -> f64 {
        self.scene_scale
    }

    /// The direction at the eye of a screen point: `(0, 0)` the top left corner, `(1, 1)` the bottom right.
    #[must_use]
    pub fn eye_from_point(&self, [s, t]: [f64; 2]) -> Direction {
        let y = self.half_height_tan;
        unit([(2.0 * s - 1.0) * y * self.aspect, (1.0 - 2.0 * t) * y, -1.0])
    }

    /// The screen point that a direction at the eye meets (it may lie beside the screen); `None` if it misses the plane.
    #[must_use]
    pub fn point_from_eye(&self, direction: Direction) -> Option<[f64; 2]> {
        let [x, y] = tangents(direction)?;
        let scale = 0.5 / self.half_height_tan;
        Some([0.5 + x * scale / self.aspect, 0.5 - y * scale])
    }

    /// The direction in the scene that is seen in a direction at the eye; `None` if that misses the screen's plane.
    #[must_use]
    pub fn scene_from_eye(&self, direction: Direction) -> Option<Direction> {
        let [x, y] = tangents(direction)?;
        Some(unit([x * self.scene_scale, y * self.scene_scale, -1.0]))
    }

    /// The inverse of [`Self::scene_from_eye`]; `None` behind the view.
    #[must_use]
    pub fn eye_from_scene(&self, direction: Direction) -> Option<Direction> {
        let [x, y] = tangents(direction)?;
        Some(unit([x / self.scene_scale, y / self.scene_scale, -1.0]))
    }

    /// The angle at the eye between two directions of the scene; `None` if either lies behind the view.
    #[must_use]
    pub fn eccentricity(&self, scene_direction: Direction, scene_gaze: Direction) -> Option<Angle> {
        let (d, n) = (self.eye_from_scene(scene_direction)?, self.eye_from_scene(scene_gaze)?);
        Some(Angle::from_versine(crate::warp::versine_between(d, n)))
    }

    /// Steradians at the eye per steradian of the scene, at a direction of the scene; 0 behind the view.
    ///
    /// # Formula
    /// Central projection onto a plane at distance 1 has `dA = dw / cos^3`; the planes' areas differ by `scene_scale^2`.
    #[must_use]
    pub fn eye_per_scene_steradian(&self, scene_direction: Direction) -> f64 {
        let scene = unit(scene_direction);
        self.eye_from_scene(scene)
            .map_or(0.0, |eye| (eye[2] / scene[2]).powi(3) / (self.scene_scale * self.scene_scale))
    }

    /// Draws a direction of the scene for a gaze at a direction of the scene. `None` if the gaze lies behind the view, or the
    /// draw misses the screen's plane, of probability [`Self::miss_probability`]: draw from the floor then, in scene space.
    #[must_use]
    pub fn sample(&self, warp: &GazeWarp, u: [f64; 2], scene_gaze: Direction) -> Option<EyeSample> {
        let drawn = warp.sample(u, self.eye_from_scene(scene_gaze)?);
        let direction = self.scene_from_eye(drawn.direction)?;
        let pdf = drawn.pdf * self.eye_per_scene_steradian(direction);
        Some(EyeSample { direction, pdf, eccentricity: drawn.eccentricity })
    }

    /// The density per steradian of the scene of [`Self::sample`]; it integrates to 1 less [`Self::miss_probability`].
    #[must_use]
    pub fn pdf(&self, warp: &GazeWarp, scene_direction: Direction, scene_gaze: Direction) -> f64 {
        match (self.eye_from_scene(scene_direction), self.eye_from_scene(scene_gaze)) {
            (Some(d), Some(n)) => warp.pdf(d, n) * self.eye_per_scene_steradian(scene_direction),
            _ => 0.0,
        }
    }

    /// The numbers that [`Self::sample`] takes to a direction of the scene; `None` behind the view.
    #[must_use]
    pub fn invert(&self, warp: &GazeWarp, scene_direction: Direction, scene_gaze: Direction) -> Option<[f64; 2]> {
        Some(warp.invert(self.eye_from_scene(scene_direction)?, self.eye_from_scene(scene_gaze)?))
    }

    /// The probability that [`Self::sample`] misses the screen's plane: 1 if the gaze lies behind the view.
    ///
    /// A midpoint sum over 4096 radii of the share of each circle that lies behind the plane, in closed form; error below
    /// 1e-4.
    #[must_use]
    pub fn miss_probability(&self, warp: &GazeWarp, scene_gaze: Direction) -> f64 {
        const RADII: u32 = 4096;
        let Some(gaze) = self.eye_from_scene(scene_gaze) else { return 1.0 };
        let [_, _, n] = gaze_frame(gaze);
        // On the circle of radius e, -z = cos e (-n_z) + sin e sqrt(1 - n_z^2) cos(phi - phi0).
        let (along, across) = (-n[2], (1.0 - n[2] * n[2]).max(0.0).sqrt());
        let behind = |e: Angle| {
            let (sin, cos) = e.radians().sin_cos();
            let (offset, swing) = (cos * along - LEAST_COSINE, sin * across);
            if offset >= swing {
                0.0
            } else if offset <= -swing {
                1.0
            } else {
                (offset / swing).acos() / core::f64::consts::PI
            }
        };
        let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(RADII);
        (0..RADII).map(|k| behind(warp.sample([middle(k), 0.0], gaze).eccentricity)).sum::<f64>() / f64::from(RADII)
    }
}

/// Directions closer than this to the screen's plane (89.94 degrees from its axis) count as missing it.
const LEAST_COSINE: f64 = 1e-3;

/// Where the ray meets the plane `z = -1`.
fn tangents(direction: Direction) -> Option<[f64; 2]> {
    let [x, y, z] = direction;
    let in_front = -z >= LEAST_COSINE * dot(direction, direction).sqrt();
    in_front.then(|| [x / -z, y / -z])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Geometry, RadialDistribution, Reddy2001};

    fn screen(fov: f64) -> EyeScreen {
        EyeScreen::new([600.0, 340.0], 650.0, Angle::from_degrees(fov)).expect("valid")
    }

    #[test]
    fn a_screen_that_shows_its_own_angle_changes_nothing() {
        let own = 2.0 * (170.0_f64 / 650.0).atan();
        let screen = EyeScreen::new([600.0, 340.0], 650.0, Angle::from_radians(own)).expect("valid");
        let d = unit([0.3, -0.2, -1.0]);
        assert!((screen.scene_scale() - 1.0).abs() < 1e-14);
        assert!((screen.eye_per_scene_steradian(d) - 1.0).abs() < 1e-13);
    }

    #[test]
    fn points_and_directions_are_inverse() {
        let screen = screen(60.0);
        for p in [[0.5, 0.5], [0.0, 0.0], [0.9, 0.2], [1.4, -0.3]] {
            let back = screen.point_from_eye(screen.eye_from_point(p)).expect("in front");
            assert!((back[0] - p[0]).abs() < 1e-13 && (back[1] - p[1]).abs() < 1e-13, "{p:?} {back:?}");
        }
        assert_eq!(screen.point_from_eye([0.0, 0.0, 1.0]), None);
        // The centre of the right edge: half the width over the distance.
        let right = screen.eye_from_point([1.0, 0.5]);
        assert!((right[0] / -right[2] - 300.0 / 650.0).abs() < 1e-14);
    }

    /// The Jacobian against a difference quotient of areas on the sphere.
    #[test]
    fn jacobian_matches_finite_differences() {
        for fov in [14.0, 60.0, 110.0] {
            let screen = screen(fov);
            for d in [[0.0, 0.0, -1.0], [0.7, 0.1, -1.0], [-0.3, 1.2, -1.0]] {
                let d = unit(d);
                let [b1, b2, _] = gaze_frame(d);
                let h = 1e-5;
                let moved = |b: Direction| unit(core::array::from_fn(|k| d[k] + h * b[k]));
                let eye = |d: Direction| screen.eye_from_scene(d).expect("in front");
                let [o, p, q] = [eye(d), eye(moved(b1)), eye(moved(b2))];
                let (a, b): (Direction, Direction) =
                    (core::array::from_fn(|k| p[k] - o[k]), core::array::from_fn(|k| q[k] - o[k]));
                let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
                let found = dot(cross, cross).sqrt() / (h * h);
                let expected = screen.eye_per_scene_steradian(d);
                assert!((found / expected - 1.0).abs() < 1e-3, "{fov} {d:?}: {found} against {expected}");
            }
        }
    }

    /// The pdf over the scene's sphere sums to what does not miss the plane.
    #[test]
    fn pdf_integrates_to_the_hits() {
        let distribution =
            RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.0).expect("valid");
        let warp = GazeWarp::new(distribution);
        let film = crate::Film::equirectangular(2048, 1024).expect("valid");
        for (fov, gaze) in [(60.0, [0.0, 0.0, -1.0]), (60.0, [0.9, 0.3, -1.0]), (25.0, [0.1, 0.0, -1.0])] {
            let (screen, gaze) = (screen(fov), unit(gaze));
            let miss = screen.miss_probability(&warp, gaze);
            let mut sum = 0.0;
            for y in 0..1024 {
                for x in 0..2048 {
                    let d = film.pixel_direction([x, y]);
                    sum += screen.pdf(&warp, d, gaze) * film.pixel_solid_angle([x, y]);
                }
            }
            assert!((sum + miss - 1.0).abs() < 4e-3, "fov {fov} gaze {gaze:?}: {sum} + {miss}");
        }
    }

    #[test]
    fn samples_have_the_pdf_they_report_and_invert() {
        let warp = GazeWarp::new(RadialDistribution::koskela_2017());
        let (screen, gaze) = (screen(60.0), unit([0.4, 0.2, -1.0]));
        for k in 0..500 {
            let u = [(f64::from(k) + 0.5) / 500.0, (f64::from(k) * 0.618_034).fract()];
            let Some(sample) = screen.sample(&warp, u, gaze) else { continue };
            let pdf = screen.pdf(&warp, sample.direction, gaze);
            assert!((pdf / sample.pdf - 1.0).abs() < 1e-9, "{u:?}: {pdf} against {}", sample.pdf);
            let e = screen.eccentricity(sample.direction, gaze).expect("in front");
            assert!((e.radians() / sample.eccentricity.radians() - 1.0).abs() < 1e-9);
            let back = screen.invert(&warp, sample.direction, gaze).expect("in front");
            assert!((back[0] - u[0]).abs() < 1e-9 && (back[1] - u[1]).abs() < 1e-7, "{u:?} {back:?}");
        }
    }

    #[test]
    fn impossible_screens_are_refused() {
        for (size, distance, fov) in
            [([0.0, 1.0], 1.0, 60.0), ([1.0, -1.0], 1.0, 60.0), ([1.0, 1.0], f64::NAN, 60.0), ([1.0, 1.0], 1.0, 180.0)]
        {
            assert!(EyeScreen::new(size, distance, Angle::from_degrees(fov)).is_err());
        }
    }
}
