//! What is shown while a scene is prepared.

use super::{Look, Worker, lock};

impl Worker {
    /// Shows a sketch of a scene that is about to be prepared, where there is no picture yet.
    pub(super) fn show_sketch(&mut self, look: &Look) -> anyhow::Result<()> {
        if self.shown.is_some() || lock(&self.shared.state).picture.is_some() {
            return Ok(());
        }
        let Some(mut picture) = self.tracing.sketch(look)? else { return Ok(()) };
        if self.devices.are_two() {
            let (size, texels) = self.tracing.texels()?;
            picture = self.screen.show(size, texels, || self.tracing.next_generation());
        }
        let mut state = lock(&self.shared.state);
        (state.picture, state.is_sketch) = (Some(picture), true);
        drop(state);
        (self.repaint)();
        Ok(())
    }
}
