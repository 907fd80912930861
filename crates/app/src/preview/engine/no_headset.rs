//! Where no OpenXR runtime takes images from Vulkan, there is no headset.

use super::{Look, Worker};

/// None can be made.
pub(super) enum HeadsetRun {}

impl Worker {
    pub(super) fn enter_headset(&mut self) -> anyhow::Result<Option<String>> {
        anyhow::bail!("headsets are supported on Linux and Windows only")
    }

    pub(super) fn leave_headset(&mut self) -> anyhow::Result<Option<String>> {
        Ok(None)
    }

    pub(super) fn toggle_marker(&mut self) {}

    pub(super) fn headset_frame(&mut self, _look: &Look) -> anyhow::Result<()> {
        Ok(())
    }
}
