//! A picture of a scene that is still being prepared.

use anyhow::Context;
use tracer::distribution::Distribution;
use tracer::renderer::{FilmPose, Renderer};

use super::{COARSENESS, Tracing, renderer_options, view_settings};
use crate::film::FilmPlan;
use crate::preview::engine::{Look, Picture};
use crate::readback;

impl Tracing {
    /// Draws a scene that was opened and is not traced yet, in the mean colours of its surfaces; `None` where there is none. What
    /// this puts on the device is there for [`Tracing::follow`] with the same look, which takes much longer.
    pub fn sketch(&mut self, look: &Look) -> anyhow::Result<Option<Picture>> {
        if self.open.as_ref().is_none_or(|open| open.renderer.is_some()) {
            return Ok(None);
        }
        let inverse = self.inverse(look.controls.acuity)?;
        let coarseness = if self.gpu.is_software() { COARSENESS } else { 1 };
        let size = self.picture_size(look, coarseness);
        let picture = self.target(size)?;
        let plan = FilmPlan::new(&look.standpoint.view, look.size_px.as_vec2(), self.film_memory_bytes());
        let open = self.open.as_mut().context("no scene is open")?;
        let everywhere = Distribution::omnidirectional(inverse);
        let renderer = Renderer::new(&self.gpu, &renderer_options(&self.args, plan), everywhere)?;
        let (renderer, _) = open.sketched.insert((renderer, plan));
        renderer.set_pose(FilmPose { position: look.standpoint.position, world_from_film: plan.world_from_film });
        let settings = view_settings(look, size);
        renderer.sketch(&open.scene, &settings, &picture.texture, readback::PICTURE_FORMAT)?;
        self.gpu.wait().context("while the scene is sketched")?;
        Ok(Some(picture))
    }
}
