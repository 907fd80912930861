//! The panorama's passes and the eyes that look at it, recorded with the renderer's film and kernels.

use glam::{Mat3, Vec3};
use wgpu::util::DeviceExt;

use super::{RenderError, Renderer};
use crate::{
    kernels::{
        Kernel,
        layout::{self, EyeParams, PanoramaParams},
        pipelines::Pipeline,
    },
    panorama::{EyeSettings, FORMAT, Panorama, Pass, Step, level_size},
    view::CONFIDENCE_SAMPLES,
};

/// How far a refresh has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refreshed {
    /// Texels that were passed over.
    pub texels: u64,
    /// Whether the panorama now shows the film as it was when this round began.
    pub round_is_done: bool,
}

impl Renderer {
    /// Goes on with bringing a panorama up to date: passes over about `texels` texels, at least one step and at most what
    /// is left of the round. A panorama that does not fit the film stays as it is.
    ///
    /// # Errors
    /// When a kernel does not compile.
    pub fn refresh_panorama(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        panorama: &mut Panorama,
        texels: u64,
    ) -> Result<Refreshed, RenderError> {
        let mut done = Refreshed::default();
        if !panorama.fits(&self.options.film) {
            return Ok(done);
        }
        while let Some(step) = panorama.steps.get(panorama.next_step).copied() {
            self.record_step(encoder, panorama, step)?;
            panorama.next_step += 1;
            done.texels += panorama.step_texels(&step);
            if done.texels >= texels {
                break;
            }
        }
        if panorama.next_step == panorama.steps.len() {
            panorama.next_step = 0;
            done.round_is_done = true;
        }
        Ok(done)
    }

    fn record_step(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        panorama: &Panorama,
        step: Step,
    ) -> Result<(), RenderError> {
        let kernel = match step.pass {
            Pass::Resolve => Kernel::PanoramaResolve,
            Pass::Pull => Kernel::PanoramaPull,
            Pass::Push => Kernel::PanoramaPush,
        };
        let key = self.key(kernel);
        let pipeline = self.pipelines.drawn(&self.gpu.device, &key, FORMAT)?;
        let level = step.level as usize;
        let coarsest = panorama.known.len() - 1;
        let params = PanoramaParams {
            size: level_size(panorama.size(), step.level),
            coarse_size: level_size(panorama.size(), (step.level + 1).min(coarsest as u32)),
            first_slab_pixel: 0,
            confidence_samples: CONFIDENCE_SAMPLES,
            quanta_to_radiance: 1.0 / self.film_scales().0,
            pad_0: 0,
        };
        let known = wgpu::BindingResource::TextureView;
        match step.pass {
            Pass::Resolve => {
                for slab in &self.film.slabs {
                    let params = PanoramaParams { first_slab_pixel: slab.first_pixel, ..params };
                    let first_row = slab.first_pixel / params.size[0];
                    let end = first_row + slab.pixel_count / params.size[0];
                    let first = step.first_row.max(first_row);
                    let rows = (step.first_row + step.rows).min(end).saturating_sub(first);
                    if rows > 0 {
                        let resources = [(1, slab.buffer.as_entire_binding())];
                        let rows = Step { first_row: first, rows, ..step };
                        self.draw_rows(encoder, &pipeline, &panorama.known[level], params, rows, &resources);
                    }
                }
            }
            Pass::Pull => {
                let resources = [(2, known(&panorama.known[level - 1]))];
                self.draw_rows(encoder, &pipeline, &panorama.known[level], params, step, &resources);
            }
            Pass::Push => {
                // The coarsest level is filled from itself: all that is known is in it.
                let coarser = panorama.filled.get(level + 1).unwrap_or(&panorama.known[level]);
                let resources = [(2, known(&panorama.known[level])), (3, known(coarser))];
                self.draw_rows(encoder, &pipeline, &panorama.filled[level], params, step, &resources);
            }
        }
        Ok(())
    }

    fn draw_rows(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &Pipeline,
        target: &wgpu::TextureView,
        params: PanoramaParams,
        rows: Step,
        resources: &[(u32, wgpu::BindingResource<'_>)],
    ) {
        let uniform = self.uniform(bytemuck::bytes_of(&params));
        let mut all = vec![(0, uniform.as_entire_binding())];
        all.extend(resources.iter().cloned());
        let group = pipeline.bind(&self.gpu.device, 0, &all);
        let part = [0, rows.first_row, params.size[0], rows.rows];
        pipeline.cover(encoder, target, &[&group], Some(part));
    }

    fn uniform(&self, contents: &[u8]) -> wgpu::Buffer {
        self.gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("panorama parameters"),
            contents,
            usage: wgpu::BufferUsages::UNIFORM,
        })
    }

    /// Draws what an eye sees of a panorama to a target of `settings.size`. Targets whose format encodes for the display
    /// get linear values, the others encoded ones.
    ///
    /// # Errors
    /// When the kernel does not compile for the target's format.
    pub fn draw_eye(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        panorama: &Panorama,
        settings: &EyeSettings,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Result<(), RenderError> {
        let key = self.key(Kernel::Eye);
        let pipeline = self.pipelines.drawn(&self.gpu.device, &key, format)?;
        let frustum = settings.frustum;
        let film_from_eye = self.pose.world_from_film.inverse() * settings.world_from_eye;
        let (towards, marker_radius) = settings.marker.unwrap_or((Vec3::NEG_Z, 0.0));
        let params = EyeParams {
            film_from_eye: layout::columns(Mat3::from_quat(film_from_eye)),
            plane_origin: [frustum.left, frustum.up],
            plane_size: [frustum.right - frustum.left, frustum.down - frustum.up],
            size: settings.size,
            panorama_size: panorama.size(),
            gaze_in_eye: (settings.world_from_eye.inverse() * towards).to_array(),
            marker_radius,
            exposure: settings.exposure_ev.exp2(),
            tone_map: settings.tone_map as u32,
            linear_target: u32::from(format.is_srgb()),
            pad_0: 0,
        };
        let uniform = self.uniform(bytemuck::bytes_of(&params));
        let group = pipeline.bind(
            &self.gpu.device,
            0,
            &[
                (0, uniform.as_entire_binding()),
                (3, wgpu::BindingResource::TextureView(&panorama.all_filled)),
                (4, wgpu::BindingResource::Sampler(&panorama.sampler)),
            ],
        );
        pipeline.cover(encoder, target, &[&group], None);
        Ok(())
    }
}
