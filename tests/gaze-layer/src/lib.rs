//! An OpenXR API layer that gives a runtime without an eye tracker the gaze of a recording, so that the program under test
//! needs no test hook.
//!
//! The loader finds it by a manifest ([`manifest`]) and loads it when `XR_ENABLE_API_LAYERS` names [`NAME`]. The variable
//! [`TRACE`] names the recording: lines of `t_s,yaw_deg,pitch_deg,valid` about LOCAL space's -Z, yaw + to the right and
//! pitch + up, which is played from the first look on and begins again at its end. A sample comes out [`DELAY_MS`]
//! milliseconds after its time, as from a camera that must first find the pupil.

#[cfg(target_os = "linux")]
mod layer;

/// The layer's name.
pub const NAME: &str = "XR_APILAYER_FOVEA_gaze";
/// The variable that names the recording.
pub const TRACE: &str = "FOVEA_GAZE_TRACE";
/// Age of a sample when it can first be had, milliseconds.
pub const DELAY_MS: u32 = 20;

/// The layer's manifest for a library at `path`.
pub fn manifest(path: &str) -> String {
    format!(
        "{{\"file_format_version\":\"1.0.0\",\"api_layer\":{{\"name\":\"{NAME}\",\"library_path\":\"{path}\",\
         \"api_version\":\"1.0\",\"implementation_version\":\"1\",\"description\":\"gaze of a recording\"}}}}"
    )
}
