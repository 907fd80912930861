//! One batch: its parameters, the kernels of the present scene, and their bind groups.

use std::sync::Arc;

use glam::Mat3;

use super::{
    RenderError, Renderer, SequenceKind,
    schedule::{PathBatch, PathKernels},
};
use crate::{
    coherence::{order_columns, roulette_block_bits},
    guide::Guide,
    kernels::{
        Kernel, WORKGROUP_SIZE,
        layout::{self, BatchParams},
        pipelines::Pipeline,
    },
    upload::SceneOnGpu,
};

/// Kernels of the present scene and distribution with their bind groups.
#[derive(Debug)]
pub(super) struct BoundKernels {
    pub paths: PathKernels,
    pub accumulate: Arc<Pipeline>,
    accumulate_groups: Vec<Option<wgpu::BindGroup>>,
}

impl Renderer {
    /// Powers of two: 16 times the brightest radiance is the largest sample that the film holds.
    pub(super) fn film_scales(&self) -> (f32, f32) {
        let brightest = self.scene.as_ref().map_or(1.0, |s| s.brightest_radiance);
        let exponent = brightest.log2().ceil().clamp(-60.0, 60.0) as i32 + 4;
        (2f32.powi(38 - exponent), 2f32.powi(32 - exponent))
    }

    /// Of a batch of so many samples, with what they are chosen by.
    pub(super) fn write_params(&mut self, samples: u32) -> Result<(), RenderError> {
        self.prepare_sampling(false)?;
        self.write_guided_params(samples, self.guide().map_or(0, Guide::rows))
    }

    /// The unit square has so many rows of cells; 0 without a guide.
    pub(super) fn write_guided_params(&mut self, samples: u32, guide_rows: u32) -> Result<(), RenderError> {
        let params = BatchParams { guide_rows, ..self.batch_params(samples)? };
        for (slab, buffer) in self.film.slabs.iter().zip(&self.params) {
            let params =
                BatchParams { first_slab_pixel: slab.first_pixel, slab_pixel_count: slab.pixel_count, ..params };
            self.gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&params));
        }
        Ok(())
    }

    /// So many samples' paths.
    pub(super) fn path_batch(&self, samples: u32) -> PathBatch {
        PathBatch { samples, max_bounces: self.options.max_bounces }
    }

    /// Of the next batch, but for the slab and the guide.
    pub(super) fn batch_params(&self, samples: u32) -> Result<BatchParams, RenderError> {
        let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
        let sampling = &self.sampling;
        let first = self.next_sample;
        let (radiance_scale, luminance_scale) = self.film_scales();
        let columns = order_columns(samples.max(1).ilog2());
        let mut order = [[0; 4]; 5];
        bytemuck::cast_slice_mut::<_, u32>(&mut order).copy_from_slice(&columns);
        Ok(BatchParams {
            first_index_low: first as u32,
            first_index_high: (first >> 32) as u32,
            sample_count: samples,
            seed: self.options.seed,
            film_size: [self.options.film.width, self.options.film.height],
            max_bounces: self.options.max_bounces.min(65_000),
            light_count: scene.light_count,
            camera_position: self.pose.position.to_array(),
            environment_probability: scene.environment_probability,
            world_from_film: layout::columns(Mat3::from_quat(self.pose.world_from_film)),
            environment_radiance: scene.environment_radiance.to_array(),
            environment_rotation_turns: scene.environment_rotation_turns,
            film_half_extent: self.options.film.half_extent(),
            first_slab_pixel: 0,
            slab_pixel_count: 0,
            radiance_scale,
            luminance_scale,
            layer_count: sampling.layer_count,
            use_sobol: u32::from(self.options.sequence == SequenceKind::Sobol),
            backdrop: scene.backdrop.unwrap_or_default().to_array(),
            has_backdrop: u32::from(scene.backdrop.is_some()),
            stratum_bits: self.distribution.stratum_bits(&self.options.film),
            guide_first: sampling.guide_first,
            guide_rows: 0,
            fovea_end: sampling.fovea_end,
            fovea_first: sampling.fovea_first,
            fovea_cells: sampling.fovea_cells,
            fovea_cell_bits: sampling.fovea_cell_bits,
            roulette_block_bits: roulette_block_bits(self.distribution.peak_share(&self.options.film)),
            pad_0: [0; 3],
            order,
            layers: sampling.layers,
        })
    }

    pub(super) fn bind(&mut self) -> Result<(), RenderError> {
        let paths = self.path_kernels()?;
        let accumulate_key = self.key(Kernel::Accumulate);
        let device = &self.gpu.device;
        let accumulate = self.pipelines.compute(device, &accumulate_key)?;
        let accumulate_groups = self
            .film
            .slabs
            .iter()
            .zip(&self.params)
            .map(|(slab, params)| {
                accumulate.bind(
                    device,
                    0,
                    &[
                        (0, params.as_entire_binding()),
                        (1, self.records.as_entire_binding()),
                        (2, slab.buffer.as_entire_binding()),
                        (3, self.film.counters.as_entire_binding()),
                    ],
                )
            })
            .collect();
        self.bound = Some(BoundKernels { paths, accumulate, accumulate_groups });
        Ok(())
    }

    /// Dispatches the kernels over no samples: some drivers compile at the first dispatch.
    pub(super) fn warm_up(&mut self) -> Result<(), RenderError> {
        self.write_params(0)?;
        self.submit_batch(self.path_batch(0))?;
        self.gpu.wait().map_err(|_| RenderError::DeviceLost)
    }
}

impl BoundKernels {
    pub(super) fn accumulate_in(&self, pass: &mut wgpu::ComputePass<'_>, samples: u32) {
        for group in &self.accumulate_groups {
            self.accumulate.dispatch(pass, &[group], workgroups(samples));
        }
    }
}

pub(super) fn workgroups(samples: u32) -> [u32; 2] {
    let groups = samples.div_ceil(WORKGROUP_SIZE).max(1);
    [groups.min(1 << 15), groups.div_ceil(1 << 15)]
}

/// Groups 0 and 1 of a path kernel; `batch` is parameters, records, pixel list.
pub(super) fn trace_groups(
    device: &wgpu::Device,
    kernel: &Pipeline,
    scene: &SceneOnGpu,
    batch: [&wgpu::Buffer; 3],
) -> [Option<wgpu::BindGroup>; 2] {
    let first: Vec<_> = (0..).zip(batch.map(wgpu::Buffer::as_entire_binding)).collect();
    [kernel.bind(device, 0, &first), scene_group(device, kernel, scene)]
}

/// Group 1 of a kernel that reads the scene.
pub(super) fn scene_group(device: &wgpu::Device, kernel: &Pipeline, scene: &SceneOnGpu) -> Option<wgpu::BindGroup> {
    let buffers = scene.bindings.buffers.iter().map(wgpu::Buffer::as_entire_binding);
    let textures = scene.bindings.textures.iter().map(wgpu::BindingResource::TextureView);
    let geometry = scene.bindings.geometry.iter().flatten().map(wgpu::BindingResource::TextureView);
    let resources: Vec<_> = (0..).zip(buffers.chain(textures).chain(geometry)).collect();
    kernel.bind(device, 1, &resources)
}
