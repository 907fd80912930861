//! `fovea bench`: its options.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::choices::ScheduleChoice;
use super::study::StudyScene;
use super::values::{Rgb, SizePx};

/// `fovea bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// glTF scene; FILE@CAMERA takes another camera than the first [default: the built-in scene]
    #[arg(value_name = "SCENE[@CAMERA]")]
    pub scene: Option<StudyScene>,
    /// What to measure [default: rays, modes, edits and start]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PART,...")]
    pub only: Vec<Part>,
    /// Write all raw numbers to this file; of other scenes and parts it keeps what it holds
    #[arg(long, value_name = "FILE.json")]
    pub json: Option<PathBuf>,
    /// Write the report on all that the file of --json holds into this folder: pages and plots
    #[arg(long, value_name = "DIR", requires = "json")]
    pub report: Option<PathBuf>,
    /// Directions that are looked in, spread over the panorama
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 12,
        value_parser = clap::value_parser!(u32).range(1..=256), value_name = "N"
    )]
    pub gazes: u32,
    /// Rounds over what is compared; medians of more are steadier
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000), value_name = "N"
    )]
    pub rounds: u32,
    /// Samples of a batch, rounded down to a power of two, at most 2^18
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 1 << 15,
        value_parser = clap::value_parser!(u32).range(64..=1 << 18), value_name = "N"
    )]
    pub samples: u32,
    /// Rays of each kind and gaze that are traced without shading, rounded down to a power of two, at most 2^18
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 1 << 15,
        value_parser = clap::value_parser!(u32).range(64..=1 << 18), value_name = "N"
    )]
    pub rays: u32,
    /// The panorama, pixels
    #[arg(long, default_value = "2048x1024", value_name = "WxH")]
    pub film: SizePx,
    /// Indirect bounces
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 8,
        value_parser = clap::value_parser!(u32).range(0..=4096), value_name = "N"
    )]
    pub max_bounces: u32,
    /// How kernels share the work of a path; the part `modes` measures the other one beside it
    #[arg(long, value_enum, default_value_t = ScheduleChoice::Auto, value_name = "SCHEDULE")]
    pub schedule: ScheduleChoice,
    /// Radiance from everywhere outside the scene, linear
    #[arg(long, value_name = "R,G,B")]
    pub background: Option<Rgb>,
    /// Graphics adapter whose name contains this [default: as `fovea adapters` says]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Shows the scene once and ends: what the part `start` times from outside
    #[arg(long, hide = true)]
    pub first_picture: bool,
}

/// Parts of the bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Rays a second without shading, beside obvhs on the CPU
    Rays,
    /// Samples and segments a second of every mode, and the time of every pass
    Modes,
    /// From an edit or a gaze to the picture that shows it
    Edits,
    /// From the start of the process to the first picture, with and without kernels in the driver's cache
    Start,
    /// What every feature of the kernels costs where the scene does not need it
    Features,
    /// Nothing: the report is made of what the file holds
    Report,
}

impl Part {
    /// What is measured unless it is said.
    pub const USUAL: [Self; 4] = [Self::Rays, Self::Modes, Self::Edits, Self::Start];

    /// Its name on the command line and in the raw numbers.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::Modes => "modes",
            Self::Edits => "edits",
            Self::Start => "start",
            Self::Features => "features",
            Self::Report => "report",
        }
    }
}

impl BenchArgs {
    /// What is to be measured.
    pub fn parts(&self) -> &[Part] {
        if self.only.is_empty() { &Part::USUAL } else { &self.only }
    }
}
