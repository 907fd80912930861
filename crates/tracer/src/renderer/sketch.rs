//! A picture of a scene before the scene can be traced.

use super::{RenderError, Renderer, inspect::first_hit_params};
use crate::{
    kernels::{Kernel, KernelKey},
    scene::Scene,
    upload::{SceneCache, SketchOnGpu},
    view::ViewSettings,
};

impl Renderer {
    /// Draws what a view of a scene shows first, from the film's place, in the mean colours of its surfaces: a picture that needs
    /// neither textures nor lights nor the path kernel, which a driver may compile for seconds. The scene's geometry goes to the
    /// device, where [`Renderer::set_scene`] finds it if no scene was set before; film and present scene stay. Of `settings` only projection and size count.
    ///
    /// # Errors
    /// When the geometry does not fit the device or the kernel does not compile.
    pub fn sketch(
        &mut self,
        scene: &Scene,
        settings: &ViewSettings,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Result<(), RenderError> {
        let mut apart = SceneCache::new(self.cache.hierarchy());
        let cache = if self.scene.is_none() { &mut self.cache } else { &mut apart };
        let on_gpu = SketchOnGpu::upload(&self.gpu, scene, cache)?;
        let key = KernelKey {
            kernel: Kernel::Sketch,
            features: on_gpu.features,
            constants: on_gpu.constants,
            sources: self.sources.clone(),
        };
        let device = &self.gpu.device;
        let kernel = self.pipelines.drawn(device, &key, format)?;
        let params = first_hit_params(&self.hits_of(settings), 0, settings.size[1]);
        let params = self.gpu.buffer("sketch", bytemuck::bytes_of(&params), wgpu::BufferUsages::UNIFORM);
        let own = [(0, params.as_entire_binding()), (1, on_gpu.part_colors.as_entire_binding())];
        let groups = [kernel.bind(device, 0, &own), kernel.bind(device, 1, &on_gpu.resources())];
        let mut encoder = self.encoder("sketch");
        kernel.cover(&mut encoder, target, &[&groups[0], &groups[1]], None);
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}
