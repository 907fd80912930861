//! A picture of a scene that is not traced yet.

use std::sync::Arc;

use anyhow::Context;
use tracer::distribution::Distribution;
use tracer::renderer::{FilmPose, Renderer};
use tracer::scene::Scene;

use super::{COARSENESS, Tracing, renderer_options, view_settings};
use crate::film::FilmPlan;
use crate::preview::engine::{Look, Picture};
use crate::readback;

impl Tracing {
    /// The scene that was opened, while it is not traced yet.
    pub fn scene_to_prepare(&self) -> Option<Arc<Scene>> {
        self.open.as_ref().filter(|open| open.renderer.is_none()).map(|open| Arc::clone(&open.scene))
    }

    /// Draws a scene in the mean colours of its surfaces. What this puts on the device is there for [`Tracing::follow`], which takes
    /// much longer.
    pub fn sketch(&mut self, scene: &Scene, look: &Look) -> anyhow::Result<Picture> {
        let inverse = self.inverse(look.controls.acuity)?;
        let coarseness = if self.gpu.is_software() { COARSENESS } else { 1 };
        let size = self.picture_size(look, coarseness);
        let picture = self.target(size)?;
        let plan = FilmPlan::new(&look.standpoint.view, look.size_px.as_vec2(), self.film_memory_bytes());
        if self.sketched.is_none() {
            let everywhere = Distribution::omnidirectional(inverse);
            self.sketched = Some(Renderer::new(&self.gpu, &renderer_options(&self.args, plan), everywhere)?);
        }
        let renderer = self.sketched.as_mut().context("made above")?;
        renderer.set_pose(FilmPose { position: look.standpoint.position, world_from_film: plan.world_from_film });
        let settings = view_settings(look, size);
        renderer.sketch(scene, &settings, &picture.texture, readback::PICTURE_FORMAT)?;
        self.gpu.wait().context("while the scene is sketched")?;
        Ok(picture)
    }
}
