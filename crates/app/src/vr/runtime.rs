//! The OpenXR runtime and the headset that it sees.

use openxr::sys::Result as Code;
use openxr::{ApplicationInfo, ExtensionSet, FormFactor, Instance, SystemId, Time, Version};

use super::calls;
use super::error::VrError;

/// An open runtime with a headset.
pub struct Runtime {
    pub(super) instance: Instance,
    pub(super) system: SystemId,
    facts: Facts,
}

/// What is known of a runtime and its headset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Facts {
    /// Name and version of the runtime.
    pub runtime: String,
    /// Name of the headset.
    pub system: String,
    /// Whether the runtime tells where the eyes look.
    pub eye_gaze: bool,
}

impl Runtime {
    /// Finds loader, runtime and headset.
    ///
    /// # Errors
    /// Which of the three is missing, or that the runtime does not take images from Vulkan.
    pub fn find() -> Result<Self, VrError> {
        let entry = calls::load_entry()?;
        let available = entry.enumerate_extensions().map_err(VrError::NoRuntime)?;
        let mut wanted = ExtensionSet::default();
        wanted.khr_vulkan_enable2 = available.khr_vulkan_enable2;
        wanted.ext_eye_gaze_interaction = available.ext_eye_gaze_interaction;
        #[cfg(windows)]
        {
            let has_clock = available.khr_win32_convert_performance_counter_time;
            wanted.khr_win32_convert_performance_counter_time = has_clock;
        }
        #[cfg(not(windows))]
        {
            wanted.khr_convert_timespec_time = available.khr_convert_timespec_time;
        }
        let application = ApplicationInfo {
            application_name: "Fovea",
            application_version: 0,
            engine_name: "Fovea",
            engine_version: 0,
            // What every runtime understands.
            api_version: Version::new(1, 0, 0),
        };
        let instance = entry.create_instance(&application, &wanted, &[], &()).map_err(|code| match code {
            Code::ERROR_RUNTIME_UNAVAILABLE | Code::ERROR_FILE_ACCESS_ERROR | Code::ERROR_FILE_CONTENTS_INVALID => {
                VrError::NoRuntime(code)
            }
            code => VrError::RuntimeDown(code),
        })?;
        let properties = instance.properties().map_err(VrError::call("xrGetInstanceProperties"))?;
        let runtime = format!("{} {}", properties.runtime_name, properties.runtime_version);
        if !available.khr_vulkan_enable2 {
            return Err(VrError::NoVulkan { runtime });
        }
        let system = instance
            .system(FormFactor::HEAD_MOUNTED_DISPLAY)
            .map_err(|code| VrError::NoHeadset { runtime: runtime.clone(), code })?;
        let name = instance.system_properties(system).map_err(VrError::call("xrGetSystemProperties"))?.system_name;
        let eye_gaze = available.ext_eye_gaze_interaction && calls::supports_eye_gaze(&instance, system)?;
        Ok(Self { instance, system, facts: Facts { runtime, system: name, eye_gaze } })
    }

    /// The runtime's clock; `None` where it cannot be asked for the time.
    pub(super) fn now(&self) -> Option<Time> {
        let extensions = self.instance.exts();
        #[cfg(windows)]
        let can_tell = extensions.khr_win32_convert_performance_counter_time.is_some();
        #[cfg(not(windows))]
        let can_tell = extensions.khr_convert_timespec_time.is_some();
        // The crate's call panics without the extension.
        can_tell.then(|| self.instance.now().ok()).flatten()
    }

    /// What is known of it.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }
}
