//! Why there is no picture in a headset.

use openxr::sys::Result as Code;
use thiserror::Error;
use tracer::gpu::GpuError;

/// What went wrong, in words that say what to do about it.
#[derive(Debug, Error)]
pub enum VrError {
    /// The loader's library is not installed.
    #[error(
        "no OpenXR loader found: install SteamVR, or the loader alone (on Debian or Ubuntu: libopenxr-loader1), and a \
         runtime for your headset"
    )]
    NoLoader,
    /// The loader knows of no runtime, or cannot open it.
    #[error(
        "no OpenXR runtime is set up ({0:?}): start SteamVR, WiVRn or Monado and make it the system's OpenXR runtime"
    )]
    NoRuntime(Code),
    /// A runtime is set up, but it does not answer.
    #[error("the OpenXR runtime does not answer ({0:?}): is it running?")]
    RuntimeDown(Code),
    /// The runtime sees no headset.
    #[error("{runtime} sees no headset ({code:?}): is it connected and switched on?")]
    NoHeadset {
        /// Its name.
        runtime: String,
        /// Its answer.
        code: Code,
    },
    /// The runtime shows images of other graphics interfaces only.
    #[error("{runtime} does not take images from Vulkan, which is what this program draws with")]
    NoVulkan {
        /// Its name.
        runtime: String,
    },
    /// The runtime wants another Vulkan.
    #[error("{runtime} needs Vulkan {wanted}; this system has {found}")]
    VulkanVersion {
        /// Its name.
        runtime: String,
        /// The least version.
        wanted: String,
        /// What there is.
        found: String,
    },
    /// No device could be made on the headset's adapter.
    #[error("no graphics device for the headset: {0}")]
    Device(String),
    /// The headset's adapter cannot run the tracer.
    #[error("the headset's graphics adapter: {0}")]
    Gpu(#[from] GpuError),
    /// The headset takes none of the pixel formats that are drawn.
    #[error("the headset takes none of the picture formats RGBA8 and BGRA8")]
    NoFormat,
    /// The runtime went away, or asked the program to let go.
    #[error("the OpenXR runtime was lost ({0:?}): it has ended, or was ended; the preview goes on in the window")]
    Lost(Code),
    /// A call failed that should not.
    #[error("OpenXR's {call} failed: {code:?}")]
    Call {
        /// Its name.
        call: &'static str,
        /// Its answer.
        code: Code,
    },
}

impl VrError {
    /// The error of a failed call. After some codes nothing works any more.
    pub fn call(call: &'static str) -> impl Fn(Code) -> Self {
        move |code| match code {
            Code::ERROR_INSTANCE_LOST
            | Code::ERROR_SESSION_LOST
            | Code::ERROR_RUNTIME_FAILURE
            | Code::ERROR_RUNTIME_UNAVAILABLE => Self::Lost(code),
            code => Self::Call { call, code },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_runtime_is_told_from_a_failed_call() {
        assert!(matches!(VrError::call("xrWaitFrame")(Code::ERROR_INSTANCE_LOST), VrError::Lost(_)));
        let failed = VrError::call("xrWaitFrame")(Code::ERROR_CALL_ORDER_INVALID).to_string();
        assert!(failed.contains("xrWaitFrame"), "{failed}");
    }
}
