//! What is shown of a scene before it is traced: while its images are read, and while it is prepared.

use std::sync::Arc;

use tracer::scene::Scene;

use super::{Look, Worker, lock};

/// Shapes of a scene that is still being read.
pub(super) struct Sketched {
    scene: Arc<Scene>,
    /// As they were drawn last, if they could be.
    by: Option<Look>,
}

impl Worker {
    /// Shows the shapes that there are, again when the look changes.
    pub(super) fn sketch_shapes(&mut self, look: &Look) {
        let newest = lock(&self.shared.shapes).take();
        if let Some(newest) = &newest {
            self.sketched = Some(Sketched { scene: Arc::clone(&newest.shapes.scene), by: None });
        }
        if let Some(Sketched { scene, by }) = &mut self.sketched
            && by.as_ref() != Some(look)
        {
            *by = Some(look.clone());
            let scene = Arc::clone(scene);
            // What stands in a sketch's way stands in the scene's too, and is told with that.
            let _ = self.show_sketch(&scene, look);
        }
        // With `newest` goes what the reading of images waits for.
    }

    /// Shows a sketch of a scene that is about to be prepared, where there is no picture of one yet.
    pub(super) fn sketch_scene(&mut self, look: &Look) -> anyhow::Result<()> {
        self.sketched = None;
        let is_first = {
            let state = lock(&self.shared.state);
            state.picture.is_none() || state.is_sketch
        };
        match self.tracing.scene_to_prepare().filter(|_| is_first && self.shown.is_none()) {
            Some(scene) => self.show_sketch(&scene, look),
            None => Ok(()),
        }
    }

    fn show_sketch(&mut self, scene: &Scene, look: &Look) -> anyhow::Result<()> {
        let mut picture = self.tracing.sketch(scene, look)?;
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
