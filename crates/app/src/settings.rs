//! How a film was made, as the header of an EXR file and `--json` say it.

use serde_json::{Value, json};
use tracer::film::FilmMapping;
use tracer::renderer::{FilmPose, RendererOptions, SequenceKind};
use tracer::scene::Scene;

use crate::cli::choices::{Geometry, InverseForm, Mode, Sequence, ToneMapping};
use crate::sampling::Acuity;

/// What decides a film's content.
#[derive(Clone, Copy, Debug)]
pub struct RunSettings<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Film, bounces, seed and sequence.
    pub renderer: &'a RendererOptions,
    /// Where the film stands and looks.
    pub pose: FilmPose,
    /// The last mode; a window may have mixed several.
    pub mode: Mode,
    /// What the foveated mode went by.
    pub acuity: Acuity,
    /// Samples in the film.
    pub samples: u64,
}

impl RunSettings<'_> {
    /// The settings as one JSON object.
    pub fn to_json(&self) -> Value {
        let film = &self.renderer.film;
        let mapping = match film.mapping {
            FilmMapping::Equirect => json!({ "kind": "equirect" }),
            FilmMapping::Perspective { half_extent } => json!({ "kind": "perspective", "half_extent": half_extent }),
        };
        json!({
            "scene": self.scene.name,
            "scene_hash": self.scene.content_hash().to_string(),
            "seed": self.renderer.seed,
            "first_sample": 0,
            "samples": self.samples,
            "sequence": match self.renderer.sequence {
                SequenceKind::Sobol => "sobol",
                SequenceKind::Independent => "independent",
            },
            "max_bounces": self.renderer.max_bounces,
            "mode": mode_name(self.mode),
            "model": self.acuity.model.sampler_name(),
            "geometry": match self.acuity.geometry {
                Geometry::Sphere => "sphere",
                Geometry::Plane => "plane",
            },
            "film": { "width": film.width, "height": film.height, "mapping": mapping },
            "position_m": self.pose.position.to_array(),
            "world_from_film_xyzw": self.pose.world_from_film.to_array(),
        })
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
