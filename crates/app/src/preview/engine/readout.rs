//! What the engine says to the person, and about a headset.

use std::time::{Duration, Instant};

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
