//! What a study renders: scenes, gazes, methods, and the samples at which curves are read.

use std::sync::Arc;

use fovea_sampler::Inverse;
use fovea_sampler::report::Mark;
use glam::{EulerRot, Quat, Vec2};
use tracer::distribution::{Distribution, View};
use tracer::film::FilmOptions;
use tracer::renderer::SequenceKind;

use crate::cli::choices::{Clip, EccentricityAt, Geometry, InverseForm, Mode, Model};
use crate::cli::study::StudyArgs;
use crate::cli::values::GazeAngles;
use crate::sampling::{Acuity, Aim, GazePoint};
use crate::view::direction;

/// The foveal disc's radius in the acuity model, degrees.
pub const FOVEA_DEG: f64 = 5.79;
/// Outer edges of the rings of eccentricity, degrees; the first is the foveal disc.
pub const RING_EDGES_DEG: [f64; 7] = [FOVEA_DEG, 10.0, 20.0, 28.0, 40.0, 60.0, 80.0];
/// Angles across and up of the view of VP and of the picture that the artist sees.
pub const VIEW_DEG: f32 = 100.0;
/// Points of a curve; each has twice the samples of the one before.
const POINTS: u32 = 7;

/// A way to spread samples: one curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Method {
    /// Uniform over the film.
    Od,
    /// Uniform over the view's image plane.
    Vp,
    /// Uniform over the film pixels in the view.
    VpRegion,
    /// By acuity, density per solid angle.
    Fv,
    /// By acuity, the paper's planar polynomial as printed.
    FvEq6,
    /// By acuity on the sphere, clipped to the view.
    FvClip,
    /// All that the program has: sphere, clip, Sobol.
    FvBest,
    /// By acuity on the sphere, following a recorded gaze.
    FvWander,
}

impl Method {
    /// In the order of legends and tables.
    pub const ALL: [Self; 8] =
        [Self::Od, Self::Vp, Self::VpRegion, Self::Fv, Self::FvEq6, Self::FvClip, Self::FvBest, Self::FvWander];

    /// In file names and raw data.
    pub fn name(self) -> &'static str {
        match self {
            Self::Od => "od",
            Self::Vp => "vp",
            Self::VpRegion => "vp-region",
            Self::Fv => "fv",
            Self::FvEq6 => "fv-eq6",
            Self::FvClip => "fv-clip",
            Self::FvBest => "fv-best",
            Self::FvWander => "fv-wander",
        }
    }

    /// The method of a name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name)
    }

    /// Its colour in plots.
    pub fn mark(self) -> Mark {
        Mark::Series(self as u8)
    }

    /// Where its random numbers come from.
    pub fn sequence(self) -> SequenceKind {
        if self == Self::FvBest { SequenceKind::Sobol } else { SequenceKind::Independent }
    }

    /// Samples at the points of its curve on a film of so many pixels, when OD ends at `spp` a pixel. At a scene's first gaze
    /// the foveated curves on the sphere and by Eq. 6 go on until the periphery, too, has samples.
    pub fn schedule(self, pixels: u64, spp: u64, first_gaze: bool) -> Vec<u64> {
        // Foveated curves end at about four times OD's samples in a pixel where one looks: they are cheap.
        let (divisor, points) = match self {
            Self::Od => (1, POINTS),
            Self::Vp => (4, POINTS),
            Self::VpRegion => (8, POINTS),
            Self::Fv | Self::FvEq6 if first_gaze => (4, POINTS + 4),
            _ => (16, POINTS + 2),
        };
        let end = (pixels * spp / divisor).max(1);
        (0..points).rev().map(|step| (end >> step).max(1)).collect()
    }

    /// Its density at the gaze over OD's, for a gaze at a latitude in the middle of the view (samples per steradian;
    /// OD's is that of equirectangular pixels). `None` where it depends on the scene or the recording.
    pub fn density_over_od(self, latitude_deg: f64) -> Option<f64> {
        // Uniform over the film's pixels: 1 / (2 pi^2 cos latitude) a steradian.
        let od = 1.0 / (2.0 * std::f64::consts::PI.powi(2) * latitude_deg.to_radians().cos());
        // Uniform over an image plane of half extent t: 1 / (2 t)^2 a steradian in the middle.
        let half = f64::from(VIEW_DEG * 0.5).to_radians().tan();
        let fv = |inverse: anyhow::Result<Arc<Inverse>>| inverse.ok().map(|inverse| central_density(&inverse) / od);
        match self {
            Self::Od => Some(1.0),
            Self::Vp => Some(1.0 / (2.0 * half).powi(2) / od),
            Self::Fv => fv(self.inverse()),
            Self::FvEq6 => fv(self.inverse()),
            Self::VpRegion | Self::FvClip | Self::FvBest | Self::FvWander => None,
        }
    }

    /// The radial inverse that its kernel holds.
    pub fn inverse(self) -> anyhow::Result<Arc<Inverse>> {
        let printed = self == Self::FvEq6;
        let acuity = Acuity {
            model: Model::Reddy,
            geometry: if printed { Geometry::Plane } else { Geometry::Sphere },
            inverse: printed.then_some(InverseForm::Eq6),
            floor: None,
            gaze_error_deg: 0.0,
        };
        acuity.inverse()
    }

    /// Its distribution of samples.
    pub fn distribution(self, place: &Place, film: &FilmOptions, inverse: &Arc<Inverse>) -> Distribution {
        self.distribution_towards(place.gaze, place, film, inverse)
    }

    /// The same while one looks elsewhere in the view.
    pub fn distribution_towards(
        self,
        gaze: GazePoint,
        place: &Place,
        film: &FilmOptions,
        inverse: &Arc<Inverse>,
    ) -> Distribution {
        let mode = match self {
            Self::Od => Mode::Od,
            Self::Vp => Mode::Vp,
            Self::VpRegion => Mode::VpRegion,
            _ => Mode::Fv,
        };
        let clip = if matches!(self, Self::FvClip | Self::FvBest) { Clip::View } else { Clip::None };
        let aim = Aim {
            mode,
            view: place.view,
            gaze,
            clip,
            eccentricity: EccentricityAt::Scene,
            screen_half_extent: Vec2::ONE,
        };
        aim.distribution(film, place.world_from_film, inverse)
    }
}

/// Share of the samples a steradian at the gaze: what falls within a tenth of the fovea, over its solid angle.
fn central_density(inverse: &Inverse) -> f64 {
    let share = 0.001;
    f64::from(share) / (std::f64::consts::TAU * f64::from(inverse.eval_versine(share)))
}

/// A gaze with the view around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Degrees from the camera's axis.
    pub angles: GazeAngles,
    /// World from film.
    pub world_from_film: Quat,
    /// The view, centred at the gaze.
    pub view: View,
    /// The gaze.
    pub gaze: GazePoint,
}

impl Place {
    /// A gaze on a film.
    pub fn new(angles: GazeAngles, world_from_film: Quat) -> Self {
        let [yaw, pitch] = [angles.yaw_deg.to_radians(), angles.pitch_deg.to_radians()];
        let turn = Quat::from_euler(EulerRot::YXZ, -yaw, pitch, 0.0);
        let field = VIEW_DEG.to_radians();
        let view = View::new(world_from_film * turn, field, field);
        let gaze = GazePoint::towards(world_from_film * direction(yaw, pitch), &view);
        Self { angles, world_from_film, view, gaze }
    }

    /// In file names and raw data.
    pub fn name(&self) -> String {
        gaze_name(self.angles)
    }
}

/// `yaw,pitch` as raw data have it.
pub fn gaze_name(angles: GazeAngles) -> String {
    format!("{}_{}", angles.yaw_deg, angles.pitch_deg)
}

/// The gazes of a scene.
pub fn gazes(args: &StudyArgs, scene: &str) -> Vec<GazeAngles> {
    let here = |name: &Option<String>| name.as_ref().is_none_or(|name| name == scene);
    args.gazes.iter().filter(|gaze| here(&gaze.scene)).map(|gaze| gaze.angles).collect()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn densities_at_the_gaze_are_the_calculated_ones() {
        let ratio = |method: Method, latitude| method.density_over_od(latitude).unwrap();
        for (latitude, vp, fv, eq6) in [(0.0, 3.47, 60.5, 59.3), (30.0, 3.01, 52.4, 51.4), (60.0, 1.74, 30.25, 29.7)] {
            assert!((ratio(Method::Vp, latitude) / vp - 1.0).abs() < 0.005);
            assert!((ratio(Method::Fv, latitude) / fv - 1.0).abs() < 0.005, "{}", ratio(Method::Fv, latitude));
            assert!((ratio(Method::FvEq6, latitude) / eq6 - 1.0).abs() < 0.01, "{}", ratio(Method::FvEq6, latitude));
        }
    }

    #[test]
    fn schedules_double_and_end_alike_where_one_looks() {
        let pixels = 512 * 256;
        for method in Method::ALL {
            let schedule = method.schedule(pixels, 16, false);
            assert!(schedule.windows(2).all(|pair| pair[1] == 2 * pair[0]), "{method:?}");
            let end = *schedule.last().unwrap() as f64 / pixels as f64;
            if let Some(density) = method.density_over_od(0.0) {
                assert!((10.0..70.0).contains(&(end * density)), "{method:?}: {}", end * density);
            }
        }
        assert_eq!(Method::Od.schedule(64 * 32, 1, true), [32, 64, 128, 256, 512, 1024, 2048]);
    }

    #[test]
    fn the_view_is_centred_at_the_gaze() {
        let film = Quat::from_rotation_y(0.4);
        let place = Place::new(GazeAngles { yaw_deg: 40.0, pitch_deg: -60.0 }, film);
        assert!(place.gaze.on_view.length() < 1e-5);
        let latitude = (film.inverse() * place.gaze.direction).y.asin().to_degrees();
        assert!((latitude + 60.0).abs() < 1e-3);
        assert_eq!(place.name(), "40_-60");
    }
}
