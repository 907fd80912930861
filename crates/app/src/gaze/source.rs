//! What every source of gaze samples offers.

use std::fmt;
use std::time::Instant;

use super::parse::opengaze::CalibrationSummary;
use super::sample::GazeSample;

/// What a source is up to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum SourceState {
    /// Looking for the device.
    #[default]
    Searching,
    /// Samples come.
    Connected,
    /// Connected, but nothing has come for a second.
    Stalled,
    /// Not reachable at the moment; it is tried again.
    Lost(String),
    /// Will not work until somebody changes something.
    Failed(String),
}

impl fmt::Display for SourceState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Searching => f.write_str("searching"),
            Self::Connected => f.write_str("connected"),
            Self::Stalled => f.write_str("connected, but sends nothing"),
            Self::Lost(why) => write!(f, "lost: {why}"),
            Self::Failed(why) => write!(f, "failed: {why}"),
        }
    }
}

/// The screen that a tracker looks at, in the pixels of the desktop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedScreen {
    /// Top left corner.
    pub origin_px: [f64; 2],
    /// Width and height.
    pub size_px: [f64; 2],
}

/// How far a calibration is.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Calibration {
    /// The device has none that this program can start, or none was asked for.
    #[default]
    None,
    /// The device shows its points.
    Running,
    /// The device is done and says how well it went.
    Done(CalibrationSummary),
    /// The device refused.
    Failed(String),
}

/// What a source says about itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceStatus {
    /// What it is up to.
    pub state: SourceState,
    /// What it is connected to, such as a stream's name, and oddities of what it sends.
    pub detail: String,
    /// Whether sample times are known by our clock, so that ages are whole.
    pub synchronised: bool,
    /// The screen that it looks at, where it says so.
    pub screen: Option<TrackedScreen>,
    /// The device's calibration.
    pub calibration: Calibration,
    /// Samples received since the source was opened.
    pub received: u64,
    /// Samples dropped because their time did not increase, because they held no numbers, or because nobody asked in time.
    pub dropped: u64,
}

/// Something that says where one looks.
pub trait GazeSource: Send {
    /// What it is up to.
    fn status(&self) -> SourceStatus;

    /// Appends the samples since the last call, oldest first. Never blocks.
    fn poll(&mut self, now: Instant, samples: &mut Vec<GazeSample>);

    /// Asks the device to calibrate itself; `false` when it cannot be asked.
    fn calibrate(&mut self) -> bool {
        false
    }

    /// Where the pointer is: +-1 at the picture's edges, y up. Only a pointer takes notice.
    fn pointer(&mut self, point: [f64; 2], at: Instant) {
        let _ = (point, at);
    }

    /// Whether samples are those of an eye, to be filtered and to be lost in a blink; a pointer's are not.
    fn is_eye(&self) -> bool {
        true
    }
}
