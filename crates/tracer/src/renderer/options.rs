//! What a renderer is asked for, and what it reports.

use glam::{Quat, Vec3};

use crate::{film::FilmOptions, upload::UploadReport};

/// Where samples' random numbers come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SequenceKind {
    /// Owen-scrambled Sobol by global index.
    #[default]
    Sobol,
    /// Independent numbers, for statistics.
    Independent,
}

/// How light is found that both light sampling and BSDF sampling can reach. All three give the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SamplingTechnique {
    /// Both, weighted by the power heuristic: what one should use.
    #[default]
    Both,
    /// Light sampling alone, for comparisons.
    Lights,
    /// BSDF sampling alone, for comparisons.
    Bsdf,
}

/// Fixed at creation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RendererOptions {
    /// Size and mapping of the film.
    pub film: FilmOptions,
    /// Indirect bounces; higher is more accurate in enclosed and transparent scenes, and slower. At most 65,000.
    pub max_bounces: u32,
    /// Equal seeds give equal films.
    pub seed: u32,
    /// Where random numbers come from.
    pub sequence: SequenceKind,
}

impl Default for RendererOptions {
    /// A 2048x1024 panorama, 8 bounces, seed 1, Sobol.
    fn default() -> Self {
        Self { film: FilmOptions::equirect(2048, 1024), max_bounces: 8, seed: 1, sequence: SequenceKind::Sobol }
    }
}

/// Where the film's centre of projection is and what its centre looks at. A change restarts the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmPose {
    /// Metres, in the scene's coordinates.
    pub position: Vec3,
    /// World from film.
    pub world_from_film: Quat,
}

impl Default for FilmPose {
    fn default() -> Self {
        Self { position: Vec3::ZERO, world_from_film: Quat::IDENTITY }
    }
}

/// What setting a scene took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneReport {
    /// Building and uploading.
    pub upload: UploadReport,
    /// Composing and compiling kernels, with a first dispatch that does nothing.
    pub kernel_compile_secs: f64,
    /// Share of the light samples that go to the environment.
    pub environment_share: f32,
}

/// What is in the film, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderStatistics {
    /// Samples.
    pub samples: u64,
    /// Closest-hit rays.
    pub segments: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Samples that were not finite and were dropped.
    pub non_finite: u32,
    /// Samples brighter than the film's range, which were clamped.
    pub clamped: u32,
    /// Samples whose place was chosen by what this film's earlier ones had said: where there are any, the means are biased
    /// (by how much: docs/reports/adaptive.md).
    pub steered: u64,
}

/// When a render is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StopCondition {
    /// After this many samples in total.
    Samples(u64),
    /// After this many seconds of tracing.
    Seconds(f64),
}
