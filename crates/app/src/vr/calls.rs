//! Calls into OpenXR that the crate `openxr` leaves unsafe or does not make.
#![expect(unsafe_code, reason = "foreign functions; each block says why it is sound")]

use std::ptr;

use openxr::sys::{self, EyeGazeSampleTimeEXT, SystemEyeGazeInteractionPropertiesEXT};
use openxr::{AsHandle, Entry, EntryError, Instance, Posef, Space, SpaceLocationFlags, SystemId, Time};

use super::error::VrError;

/// Opens the loader.
pub fn load_entry() -> Result<Entry, VrError> {
    // SAFETY: a library of the loader's name is taken to be OpenXR's loader, as every OpenXR program does.
    unsafe { Entry::load(&()) }.map_err(|error| match error {
        EntryError::Load(_) => VrError::NoLoader,
        EntryError::Xr(code) => VrError::NoRuntime(code),
    })
}

/// Whether the headset tells where the eyes look. The instance must have XR_EXT_eye_gaze_interaction.
pub fn supports_eye_gaze(instance: &Instance, system: SystemId) -> Result<bool, VrError> {
    let mut gaze = SystemEyeGazeInteractionPropertiesEXT {
        ty: SystemEyeGazeInteractionPropertiesEXT::TYPE,
        next: ptr::null_mut(),
        supports_eye_gaze_interaction: sys::FALSE,
    };
    let mut properties = sys::SystemProperties::out(ptr::from_mut(&mut gaze).cast());
    // SAFETY: both structures have their types set, the chain is the one that the extension describes, and both outlive
    // the call.
    let code = unsafe { (instance.fp().get_system_properties)(instance.as_raw(), system, properties.as_mut_ptr()) };
    succeeded(code).map_err(VrError::call("xrGetSystemProperties"))?;
    Ok(gaze.supports_eye_gaze_interaction.into())
}

/// Where a gaze space is.
#[derive(Clone, Copy, Debug)]
pub struct Located {
    /// In the base space.
    pub pose: Posef,
    /// Whether the orientation means anything.
    pub is_valid: bool,
    /// When the eye was there; `None` where the runtime does not know.
    pub sampled: Option<Time>,
}

/// Locates a gaze space, with the time of its sample. Both must be spaces of one session.
pub fn locate_gaze(instance: &Instance, gaze: &Space, base: &Space, time: Time) -> Result<Located, VrError> {
    let mut sample =
        EyeGazeSampleTimeEXT { ty: EyeGazeSampleTimeEXT::TYPE, next: ptr::null_mut(), time: Time::from_nanos(0) };
    let mut location = sys::SpaceLocation {
        ty: sys::SpaceLocation::TYPE,
        next: ptr::from_mut(&mut sample).cast(),
        location_flags: SpaceLocationFlags::EMPTY,
        pose: Posef::IDENTITY,
    };
    // SAFETY: both structures have their types set, the chain is the one that the extension describes, both outlive the
    // call, and the spaces' handles are alive because their owners are borrowed.
    let code = unsafe { (instance.fp().locate_space)(gaze.as_handle(), base.as_handle(), time, &mut location) };
    succeeded(code).map_err(VrError::call("xrLocateSpace"))?;
    let is_valid = location.location_flags.contains(SpaceLocationFlags::ORIENTATION_VALID);
    let sampled = (sample.time.as_nanos() > 0).then_some(sample.time);
    Ok(Located { pose: location.pose, is_valid, sampled })
}

fn succeeded(code: sys::Result) -> Result<(), sys::Result> {
    if code.into_raw() >= 0 { Ok(()) } else { Err(code) }
}
