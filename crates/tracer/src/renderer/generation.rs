//! Ray generation alone, timed on the device: what the ray-generation bench measures.

use glam::Vec3;

use super::{
    LARGEST_BATCH, Query, RayKind, RenderError, Renderer,
    batch::{trace_groups, workgroups},
};
use crate::{
    film::read_ranges,
    kernels::{Kernel, layout::SampleRecord},
};

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
    /// The primary rays of the next samples of the present distribution, as the device makes them and in the order in which it
    /// traces them. At most [`LARGEST_BATCH`], rounded down to a power of two; samples that miss the film are left out.
    ///
    /// # Errors
    /// As [`Renderer::time_ray_generation`].
    pub fn primary_rays(&mut self, rays: u32) -> Result<Vec<Query>, RenderError> {
        let rays = 1 << rays.clamp(1, LARGEST_BATCH).ilog2();
        self.time_ray_generation(rays)?;
        let bytes = u64::from(rays) * size_of::<SampleRecord>() as u64;
        let records: Vec<SampleRecord> = read_ranges(&self.gpu, &[(&self.records, 0, bytes)])?;
        let directions = records.iter().map(|record| Vec3::from_array(record.radiance));
        let origin = self.pose.position;
        let query = |direction| Query { origin, direction, t_max: f32::MAX, kind: RayKind::Closest };
        Ok(directions.filter(|direction| *direction != Vec3::ZERO).map(query).collect())
    }
}
