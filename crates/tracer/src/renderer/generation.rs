//! Ray generation alone, timed on the device: what the ray-generation bench measures.

use super::{
    LARGEST_BATCH, RenderError, Renderer,
    batch::{trace_groups, workgroups},
};
use crate::kernels::Kernel;

impl Renderer {
    /// Seconds that the device takes to choose the pixels of `rays` samples of the present distribution and to make
    /// their primary rays, by timestamp queries. At most [`LARGEST_BATCH`] rays, rounded down to a power of two.
    /// `None` where the adapter has no timestamps.
    ///
    /// # Errors
    /// When there is no scene, the kernel does not compile, or the device is lost.
    pub fn time_ray_generation(&mut self, rays: u32) -> Result<Option<f64>, RenderError> {
        let rays = 1 << rays.clamp(1, LARGEST_BATCH).ilog2();
        self.write_params(rays)?;
        let key = self.key(Kernel::Generate);
        let generate = self.pipelines.compute(&self.gpu.device, &key)?;
        let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
        let batch = [&self.params[0], &self.records, &self.pixel_list];
        let [group, _] = trace_groups(&self.gpu.device, &generate, scene, batch);
        self.timed_pass(generate.label(), |pass| generate.dispatch(pass, &[&group], workgroups(rays)))
    }
}
