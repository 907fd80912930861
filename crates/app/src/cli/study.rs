//! `fovea study`: its options.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::values::{CameraChoice, GazeAngles, Rgb, SizePx};

/// `fovea study`.
#[derive(Clone, Debug, Args)]
pub struct StudyArgs {
    /// glTF scenes; FILE@CAMERA takes another camera than the first. Without one the built-in scene is studied
    #[arg(value_name = "SCENE[@CAMERA]")]
    pub scenes: Vec<StudyScene>,
    /// Where one looks, degrees from the camera's axis; SCENE= limits it to the scene of that name. May be repeated
    #[arg(
        long = "gaze", allow_hyphen_values = true, value_name = "[SCENE=]YAW,PITCH",
        default_values = ["0,0", "0,-30", "0,-60"]
    )]
    pub gazes: Vec<StudyGaze>,
    /// A recorded gaze that wanders over the view about the first gaze: one more curve
    #[arg(long, value_name = "FILE")]
    pub gaze_trace: Option<PathBuf>,
    /// Where all results go; finished parts found there are not repeated
    #[arg(short, long = "out", value_name = "DIR")]
    pub output: PathBuf,
    /// What to do
    #[arg(long, value_enum, default_value_t = Part::All, value_name = "PART")]
    pub only: Part,
    /// The panorama, pixels
    #[arg(long, default_value = "512x256", value_name = "WxH")]
    pub film: SizePx,
    /// Independent repetitions of every curve, 2..=1000; more narrow the confidence intervals
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 8,
        value_parser = clap::value_parser!(u32).range(2..=1000), value_name = "N"
    )]
    pub seeds: u32,
    /// Samples a film pixel at which the curve of mode od ends, a power of two; the other modes end at as many where one looks
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 16,
        value_parser = power_of_two, value_name = "N"
    )]
    pub spp: u64,
    /// Samples a film pixel of each of the two references
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 64,
        value_parser = clap::value_parser!(u64).range(1..=1 << 20), value_name = "N"
    )]
    pub reference_spp: u64,
    /// Indirect bounces
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 3,
        value_parser = clap::value_parser!(u32).range(0..=4096), value_name = "N"
    )]
    pub max_bounces: u32,
    /// Radiance from everywhere outside the scenes, linear
    #[arg(long, value_name = "R,G,B")]
    pub background: Option<Rgb>,
    /// Graphics adapter whose name contains this [default: as `fovea adapters` says]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// Parts of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Whatever is not there yet, and the report
    All,
    /// The references, curves and pictures: error against samples, which no load on the machine changes
    Curves,
    /// Seconds a sample, measured anew in short alternating rounds: wants a quiet machine
    Rates,
    /// The report, from what is there
    Report,
}

/// A scene and from where in it one looks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StudyScene {
    /// The file.
    pub path: PathBuf,
    /// The camera; the first without.
    pub camera: Option<CameraChoice>,
}

impl FromStr for StudyScene {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // Names of files and folders may have one, too.
        let is_camera = |camera: &str| !camera.contains(['/', '\\']) && !Path::new(text).exists();
        let (path, camera) = match text.rsplit_once('@').filter(|(_, camera)| is_camera(camera)) {
            Some((path, camera)) => (path, Some(camera.parse().map_err(|_| "no camera after the @".to_owned())?)),
            None => (text, None),
        };
        Ok(Self { path: path.into(), camera })
    }
}

/// Where one looks, in all scenes or one.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyGaze {
    /// File name of the scene without its ending; all scenes without.
    pub scene: Option<String>,
    /// Degrees from the camera's axis.
    pub angles: GazeAngles,
}

impl FromStr for StudyGaze {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (scene, angles) = match text.split_once('=') {
            Some((scene, angles)) => (Some(scene.to_owned()), angles),
            None => (None, text),
        };
        Ok(Self { scene, angles: angles.parse()? })
    }
}

fn power_of_two(text: &str) -> Result<u64, String> {
    let value: u64 = text.parse().map_err(|_| format!("`{text}` is no whole number"))?;
    if (1..=1 << 20).contains(&value) && value.is_power_of_two() {
        Ok(value)
    } else {
        Err(format!("{value} is no power of two in 1..=1048576"))
    }
}
