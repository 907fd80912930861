//! `fovea gaze`, and the window's options about gaze.

use std::path::PathBuf;

use clap::Args;

use super::values;
use crate::gaze::spec::SourceSpec;

const SOURCES: &str = "Watch this source: opengaze[:HOST[:PORT]], lsl[:name=N,type=T,...], pupil[:HOST[:PORT]][/SURFACE] or \
    trace:FILE[,loop]; the window also knows mouse and mouse-dwell";

/// `fovea gaze`.
#[derive(Clone, Debug, Args)]
#[command(group = clap::ArgGroup::new("what").required(true))]
pub struct GazeArgs {
    /// List the sources that can be reached now
    #[arg(long, group = "what", conflicts_with_all = ["record", "seconds"])]
    pub list: bool,
    /// Watch this source.
    #[arg(long, group = "what", value_name = "SRC", help = SOURCES)]
    pub source: Option<SourceSpec>,
    /// Record it to this file, which must not exist
    #[arg(long, requires = "source", value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Stop after so long [default: when the source ends or Ctrl C is pressed; --record then keeps what was written]
    #[arg(
        long, requires = "source", allow_negative_numbers = true,
        value_parser = values::positive_seconds, value_name = "SECONDS"
    )]
    pub seconds: Option<f64>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// The window's options about gaze.
#[derive(Clone, Debug, Default, Args)]
pub struct PreviewGazeArgs {
    /// Where the gaze comes from, as `fovea gaze --help` lists; may be given several times, the first that works counts
    /// and the pointer comes last [default: mouse]
    #[arg(long = "gaze", value_name = "SRC")]
    pub sources: Vec<SourceSpec>,
    /// How far off the tracker may be, degrees, 0..=20; the fovea is widened by it [default: what the last validation
    /// found, else 1]
    #[arg(
        long = "gaze-accuracy", allow_negative_numbers = true,
        value_parser = values::accuracy_deg, value_name = "DEG"
    )]
    pub accuracy_deg: Option<f64>,
    /// Whose drift correction and validation are used and kept
    #[arg(long = "gaze-person", default_value = "somebody", value_name = "NAME")]
    pub person: String,
}
