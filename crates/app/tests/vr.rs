//! The headset, against Monado with a simulated one on lavapipe.
//!
//! `scripts/monado` unpacks Monado; `FOVEA_MONADO` names its folder. Its packages bring a C library of their own, so a test
//! starts this binary again, through their dynamic linker, to run the test of the same name in `inner`.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![cfg(target_os = "linux")]

#[path = "vr/failures.rs"]
mod failures;
#[path = "vr/gaze.rs"]
mod gaze;
#[path = "vr/inner.rs"]
mod inner;
#[path = "vr/monado.rs"]
mod monado;
#[path = "vr/preview.rs"]
mod preview;
#[path = "vr/session.rs"]
mod session;
