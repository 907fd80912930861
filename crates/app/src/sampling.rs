//! From the choices of a command line or window to the tracer's distribution of samples.

use std::sync::Arc;

use anyhow::Context;
use fovea_sampler::{AcuityModel, Angle, Eccentricity, Form, Inverse, RadialDistribution, model};
use glam::{Quat, Vec2};
use tracer::distribution::{Clip as TracerClip, Distribution, Gaze, View};
use tracer::film::FilmOptions;

use crate::cli::choices::{Clip, EccentricityAt, Geometry, InverseForm, Mode, Model};

/// Eccentricity, in degrees, beyond which a model's density is the floor.
const CAP_DEG: f64 = 80.0;
/// Floor unless one is asked for; Eq. 6 as printed has none.
const DEFAULT_FLOOR: f64 = 0.002;
/// How much farther than the view's edge clipped samples may fall, as a fraction of its half width.
const CLIP_MARGIN: f32 = 0.1;
/// Share of the samples that ignore the clip.
const UNCLIPPED_SHARE: f32 = 0.05;

/// What decides the radius at which a foveated sample falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acuity {
    /// Visual acuity model.
    pub model: Model,
    /// What the density is a density of.
    pub geometry: Geometry,
    /// Form of the inverse; the default one without.
    pub inverse: Option<InverseForm>,
    /// Acuity below which no direction falls; 0.002 without, none for Eq. 6.
    pub floor: Option<f64>,
    /// How far off the gaze may be, degrees: the model's centre becomes that much wider. Eq. 6 as printed stays as it is.
    pub gaze_error_deg: f64,
}

/// A model for a gaze that is known to within an error: the acuity of the nearest place that the eye may look at.
#[derive(Debug)]
struct Widened {
    model: Box<dyn AcuityModel>,
    error_deg: f64,
}

impl AcuityModel for Widened {
    fn name(&self) -> &str {
        self.model.name()
    }

    fn citation(&self) -> &str {
        self.model.citation()
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        self.model.acuity(Angle::from_degrees((e.degrees() - self.error_deg).max(0.0)))
    }

    fn breakpoints(&self) -> Vec<Eccentricity> {
        let moved = self.model.breakpoints().into_iter().map(|e| e.degrees() + self.error_deg);
        let kinks = std::iter::once(self.error_deg).chain(moved).filter(|degrees| *degrees < 180.0);
        kinks.map(Angle::from_degrees).collect()
    }

    fn support(&self) -> Eccentricity {
        Angle::from_degrees((self.model.support().degrees() + self.error_deg).min(180.0))
    }
}

impl Acuity {
    /// The radial inverse.
    ///
    /// # Errors
    /// When the model or geometry does not admit the form.
    pub fn inverse(&self) -> anyhow::Result<Arc<Inverse>> {
        let default_floor = if self.inverse == Some(InverseForm::Eq6) { 0.0 } else { DEFAULT_FLOOR };
        let geometry = match self.geometry {
            Geometry::Sphere => fovea_sampler::Geometry::Sphere,
            Geometry::Plane => fovea_sampler::Geometry::Plane,
        };
        let model = model::by_name(self.model.sampler_name())
            .with_context(|| format!("the sampler has no model {}", self.model.sampler_name()))?;
        let widens = self.gaze_error_deg > 0.0 && self.inverse != Some(InverseForm::Eq6);
        let model = if widens { Box::new(Widened { model, error_deg: self.gaze_error_deg }) } else { model };
        let radial = RadialDistribution::from_arc(
            Arc::from(model),
            geometry,
            Angle::from_degrees(CAP_DEG),
            self.floor.unwrap_or(default_floor),
        )?;
        let inverse = match self.inverse {
            None => Inverse::default_for(&radial),
            Some(form) => Inverse::with_form(&radial, form.of_sampler(geometry)).context("--inverse")?,
        };
        Ok(Arc::new(inverse))
    }
}

impl InverseForm {
    /// The sampler's form. On the sphere the degree 5 is of a polynomial that is squared: 1 - cos e begins with a square.
    pub(crate) fn of_sampler(self, geometry: fovea_sampler::Geometry) -> Form {
        match self {
            Self::Eq6 => Form::Eq6,
            Self::Poly5 if geometry == fovea_sampler::Geometry::Sphere => Form::SquaredPolynomial(5),
            Self::Poly5 => Form::Polynomial(5),
            Self::Rational => Form::Rational(3, 3),
            Self::Table => Form::Table(64),
        }
    }
}

/// Where the samples go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// How they are distributed.
    pub mode: Mode,
    /// The visible view.
    pub view: View,
    /// Where in the view one looks: +-1 at its edges. May lie outside when eccentricity is measured in the scene.
    pub gaze: GazePoint,
    /// Whether foveated samples are clipped to the view.
    pub clip: Clip,
    /// Where eccentricity is measured.
    pub eccentricity: EccentricityAt,
    /// Half width and height of the view on the screen over the viewing distance.
    pub screen_half_extent: Vec2,
}

/// Where one looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GazePoint {
    /// Unit vector in the world.
    pub direction: glam::Vec3,
    /// The same on the view; zero when it lies behind the view.
    pub on_view: Vec2,
}

impl GazePoint {
    /// The gaze in a direction of the world.
    pub fn towards(direction: glam::Vec3, view: &View) -> Self {
        Self { direction, on_view: view.project(direction).unwrap_or(Vec2::ZERO) }
    }

    /// The gaze at a point of the view.
    pub fn at(on_view: Vec2, view: &View) -> Self {
        Self { direction: view.direction(on_view), on_view }
    }
}

impl Aim {
    /// The tracer's distribution on a film.
    pub fn distribution(&self, film: &FilmOptions, world_from_film: Quat, inverse: &Arc<Inverse>) -> Distribution {
        let inverse = Arc::clone(inverse);
        match self.mode {
            Mode::Od => Distribution::omnidirectional(inverse),
            Mode::Vp => Distribution::viewport(self.view, inverse),
            Mode::VpRegion => Distribution::region(self.view, film, world_from_film, inverse),
            Mode::Fv => {
                let gaze = match self.eccentricity {
                    EccentricityAt::Scene => Gaze::Scene { direction: self.gaze.direction },
                    EccentricityAt::Eye => Gaze::Eye {
                        on_screen: self.gaze.on_view,
                        screen_half_extent: self.screen_half_extent,
                        view: self.view,
                    },
                };
                let clip = (self.clip == Clip::View).then_some(TracerClip {
                    view: self.view,
                    margin: CLIP_MARGIN,
                    unclipped_share: UNCLIPPED_SHARE,
                });
                Distribution::foveated(gaze, clip, inverse)
            }
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn every_model_has_an_inverse_on_the_sphere() {
        for (model, _) in Model::LIST {
            for gaze_error_deg in [0.0, 0.3, 1.0, 1.4, 3.0] {
                let acuity = Acuity { model, geometry: Geometry::Sphere, inverse: None, floor: None, gaze_error_deg };
                acuity.inverse().unwrap();
            }
        }
    }

    #[test]
    fn an_uncertain_gaze_keeps_full_acuity_wherever_the_eye_may_look() {
        for (model, _) in Model::LIST {
            let plain = model::by_name(model.sampler_name()).unwrap();
            let wide = Widened { model: model::by_name(model.sampler_name()).unwrap(), error_deg: 1.5 };
            for step in 0..1200 {
                let e = f64::from(step) * 0.1;
                // The eye may look anywhere within 1.5 degrees of the gaze.
                let needed =
                    [-1.5, -0.7, 0.0, 0.7, 1.5].map(|off: f64| plain.acuity(Angle::from_degrees((e + off).abs())));
                let given = wide.acuity(Angle::from_degrees(e));
                assert!(needed.iter().all(|acuity| given >= acuity - 1e-12), "{model:?} at {e} degrees");
            }
        }
    }

    #[test]
    fn eq_6_is_planar_and_says_so() {
        let acuity = |geometry| Acuity {
            model: Model::Reddy,
            geometry,
            inverse: Some(InverseForm::Eq6),
            floor: None,
            gaze_error_deg: 0.0,
        };
        let printed = acuity(Geometry::Plane).inverse().unwrap();
        assert_eq!(printed.eval(1.0), Inverse::eq6().eval(1.0));
        let refused = acuity(Geometry::Sphere).inverse().unwrap_err();
        assert!(crate::session::one_line(&refused).contains("--inverse"));
    }

    #[test]
    fn the_gaze_on_the_view_and_in_the_world_agree() {
        let view = View::new(Quat::from_rotation_y(0.7), 1.2, 0.9);
        let at = GazePoint::at(Vec2::new(0.4, -0.6), &view);
        let towards = GazePoint::towards(at.direction, &view);
        assert!(towards.on_view.distance(at.on_view) < 1e-5);
        assert_eq!(GazePoint::towards(view.world_from_view * Vec3::Z, &view).on_view, Vec2::ZERO);
    }
}
