//! The same preview in a headset, by OpenXR and Vulkan.
//!
//! A [`headset::Headset`] is a runtime, its headset, a graphics device made as the runtime asks, and a session. The engine's
//! thread drives it: it takes the events, waits for the runtime's frames, draws both eyes at the latest head pose, and
//! traces in what is left of the frame. The film is a panorama about one point: the head turns in it (three degrees of
//! freedom), and there is no parallax.
//!
//! OpenXR's loader is looked for at run time; without one nothing else changes. All `unsafe` code is in `device` and
//! `calls`.
//!
//! LOCAL space is the runtime's: -Z was ahead when the session began or was recentred, +Y is up.

mod calls;
mod device;
pub mod error;
pub mod eyes;
pub mod gaze;
pub mod headset;
pub mod input;
pub mod lifecycle;
pub mod pacing;
pub mod runtime;

pub use error::VrError;
