//! How a film was made, as the header of an EXR file and `--json` say it.

use serde_json::{Map, Value, json};
use tracer::film::FilmHeader;
use tracer::renderer::SequenceKind;

use crate::cli::choices::{Clip, EccentricityAt, Geometry, InverseForm, Mode, Sequence, Show, ToneMapping};
use crate::output::header;
use crate::sampling::{Acuity, Aim};

/// What decides a film's content.
#[derive(Clone, Copy, Debug)]
pub struct RunSettings<'a> {
    /// What a person calls the scene.
    pub scene: &'a str,
    /// What the film is of.
    pub film: &'a FilmHeader,
    /// Where the last samples went; a window may have looked elsewhere before.
    pub aim: &'a Aim,
    /// What the foveated mode went by.
    pub acuity: Acuity,
}

impl RunSettings<'_> {
    /// The settings as one JSON object.
    pub fn to_json(&self) -> Map<String, Value> {
        let (aim, acuity) = (self.aim, self.acuity);
        let view = aim.view;
        let mut fields = header::to_json(self.film);
        let own = json!({
            "scene": self.scene,
            "mode": mode_name(aim.mode),
            "model": acuity.model.sampler_name(),
            "geometry": match acuity.geometry {
                Geometry::Sphere => "sphere",
                Geometry::Plane => "plane",
            },
            "inverse": acuity.inverse.map(InverseForm::name),
            "floor": acuity.floor,
            "gaze": aim.gaze.direction.to_array(),
            "view": { "world_from_view_xyzw": view.world_from_view.to_array(), "half_extent": view.half_extent.to_array() },
            "clip": match aim.clip {
                Clip::None => "none",
                Clip::View => "view",
            },
            "eccentricity": match aim.eccentricity {
                EccentricityAt::Scene => "scene",
                EccentricityAt::Eye => "eye",
            },
        });
        if let Value::Object(own) = own {
            fields.extend(own);
        }
        fields
    }
}

/// The mode as the command line has it.
pub fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Od => "od",
        Mode::Vp => "vp",
        Mode::VpRegion => "vp-region",
        Mode::Fv => "fv",
    }
}

impl From<Sequence> for SequenceKind {
    fn from(sequence: Sequence) -> Self {
        match sequence {
            Sequence::Sobol => Self::Sobol,
            Sequence::Independent => Self::Independent,
        }
    }
}

impl From<ToneMapping> for tracer::view::ToneMap {
    fn from(tone_map: ToneMapping) -> Self {
        match tone_map {
            ToneMapping::Agx => Self::AgX,
            ToneMapping::PbrNeutral => Self::PbrNeutral,
            ToneMapping::Linear => Self::Linear,
            ToneMapping::FalseColor => Self::FalseColor,
        }
    }
}

impl From<Show> for tracer::view::DebugView {
    fn from(show: Show) -> Self {
        match show {
            Show::Picture => Self::Beauty,
            Show::Density => Self::SampleDensity,
            Show::Noise => Self::Error,
            Show::Albedo => Self::Albedo,
            Show::Normals => Self::Normal,
            Show::Depth => Self::Depth,
            Show::Steps => Self::TraversalSteps,
        }
    }
}

impl InverseForm {
    /// The form as the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Eq6 => "eq6",
            Self::Poly5 => "poly5",
            Self::Rational => "rational",
            Self::Table => "table",
        }
    }
}
