//! Ray generation alone, timed on the device: what the ray-generation bench measures.

use super::{LARGEST_BATCH, RenderError, Renderer, batch::trace_groups};
use crate::{
    film::read_buffer,
    kernels::{Kernel, WORKGROUP_SIZE},
};

impl Renderer {
    /// Seconds that the device takes to choose the pixels of `rays` samples of the present distribution and to make
    /// their primary rays, by timestamp queries. At most [`LARGEST_BATCH`] rays, rounded down to a power of two.
    /// `None` where the adapter has no timestamps.
    ///
    /// # Errors
    /// When there is no scene, the kernel does not compile, or the device is lost.
    pub fn time_ray_generation(&mut self, rays: u32) -> Result<Option<f64>, RenderError> {
        let gpu = self.gpu.clone();
        if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let rays = 1 << rays.clamp(1, LARGEST_BATCH).ilog2();
        self.write_params(rays)?;
        let key = self.key(Kernel::Generate);
        let generate = self.pipelines.compute(&gpu.device, &key)?;
        let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
        let batch = [&self.params[0], &self.records, &self.pixel_list, &self.direction_numbers];
        let [group, _] = trace_groups(&gpu.device, &generate, scene, batch);
        let queries = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("ray generation"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let times = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("ray generation times"),
            size: 16,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = self.encoder("ray generation");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(generate.label()),
                timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                    query_set: &queries,
                    beginning_of_pass_write_index: Some(0),
                    end_of_pass_write_index: Some(1),
                }),
            });
            generate.dispatch(&mut pass, &[&group], [rays.div_ceil(WORKGROUP_SIZE), 1]);
        }
        encoder.resolve_query_set(&queries, 0..2, &times, 0);
        gpu.queue.submit([encoder.finish()]);
        let ticks: Vec<u64> = read_buffer(&gpu, &times)?;
        let period = f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        Ok(ticks.get(1).zip(ticks.first()).map(|(end, start)| end.saturating_sub(*start) as f64 * period))
    }
}
