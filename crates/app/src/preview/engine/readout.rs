//! What the engine says to the person, and about a headset.

use std::time::{Duration, Instant};

use tracer::renderer::SceneReport;

/// A headset in use.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeadsetReadout {
    /// Name and version of the OpenXR runtime.
    pub runtime: String,
    /// Name of the headset.
    pub system: String,
    /// Whether the runtime says where the eyes look.
    pub has_eye_tracker: bool,
    /// What the session is up to.
    pub words: String,
    /// What the fovea goes by.
    pub gaze_from: String,
    /// Age of the eyes' sample, where it is known.
    pub gaze_age: Option<Duration>,
    /// Frames handed to the runtime.
    pub frames: u64,
    /// Frames of the headset that went by without a new picture.
    pub missed: u64,
    /// How often the panorama that the eyes see was brought up to date.
    pub refreshes: u64,
    /// Width of the mirror over its height.
    pub mirror_aspect: f32,
}

/// A version of the scene on screen, and what it took to get it there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShownVersion {
    /// Counts the versions that were prepared, from 1; 0 before the first.
    pub number: u64,
    /// Bytes that went to the device for it; the rest was there since an earlier version.
    pub uploaded_bytes: u64,
    /// Bytes of the whole scene on the device.
    pub device_bytes: u64,
    /// To compile kernels.
    pub kernels: Duration,
    /// To prepare it altogether: hierarchies, upload, kernels, the split of light samples.
    pub prepared: Duration,
}

impl ShownVersion {
    /// From the renderer's report and how long its making took.
    pub(super) fn new(number: u64, report: &SceneReport, prepared: Duration) -> Self {
        Self {
            number,
            uploaded_bytes: report.upload.uploaded_bytes,
            device_bytes: report.upload.device_bytes,
            kernels: Duration::try_from_secs_f64(report.kernel_compile_secs).unwrap_or_default(),
            prepared,
        }
    }
}

/// A note for the person.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// One line.
    pub text: String,
    /// Whether something went wrong.
    pub wrong: bool,
    /// When it was written.
    pub at: Instant,
}

impl Message {
    /// A note of this moment.
    pub fn now(text: String, wrong: bool) -> Self {
        Self { text, wrong, at: Instant::now() }
    }
}
