//! Rays answered one by one, for tools, tests and the traversal benches.

use glam::Vec3;
use wgpu::util::DeviceExt;

use super::{
    RenderError, Renderer,
    batch::{scene_group, workgroups},
};
use crate::{
    film::read_buffer,
    kernels::{
        Kernel,
        layout::{QueryHit, QueryRay, codes},
        pipelines::Pipeline,
    },
};

/// What a ray asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RayKind {
    /// The nearest surface.
    #[default]
    Closest,
    /// Whether there is any.
    Any,
}

impl RayKind {
    const fn code(self) -> u32 {
        match self {
            Self::Closest => codes::RAY_CLOSEST,
            Self::Any => codes::RAY_ANY,
        }
    }
}

/// A ray in the scene's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// Metres.
    pub origin: Vec3,
    /// Of any length but 0.
    pub direction: Vec3,
    /// The ray's end, in units of `direction`.
    pub t_max: f32,
    /// What is asked.
    pub kind: RayKind,
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueryAnswer {
    /// In units of the ray's direction.
    pub t: f32,
    /// Index of the scene's instance.
    pub instance: u32,
    /// Index of the triangle in the instance's mesh.
    pub triangle: u32,
    /// Nodes and triangles that were looked at.
    pub steps: u32,
}

/// Rays that one dispatch answers.
const LARGEST_QUERY: usize = 1 << 20;

impl Renderer {
    /// What each ray meets, transparent parts of alpha-tested surfaces left out; and the seconds that the device took to traverse, where it
    /// has timestamps. Waits for the device. The film is not touched.
    ///
    /// # Errors
    /// When there is no scene, the kernel does not compile, or the device is lost.
    pub fn query(&mut self, rays: &[Query]) -> Result<(Vec<Option<QueryAnswer>>, Option<f64>), RenderError> {
        let mut answers = Vec::with_capacity(rays.len());
        let mut seconds = self.gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then_some(0.0);
        for chunk in rays.chunks(LARGEST_QUERY) {
            let (hits, chunk_seconds) = self.query_chunk(chunk)?;
            seconds = seconds.zip(chunk_seconds).map(|(sum, more)| sum + more);
            let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
            answers.extend(hits.iter().map(|hit| {
                let instance = (*scene.sources.get(hit.part as usize)?)?;
                Some(QueryAnswer { t: hit.t, instance, triangle: hit.triangle, steps: hit.steps })
            }));
        }
        Ok((answers, seconds))
    }

    fn query_chunk(&mut self, rays: &[Query]) -> Result<(Vec<QueryHit>, Option<f64>), RenderError> {
        let gpu = self.gpu.clone();
        let keys = [Kernel::Query, Kernel::Identify].map(|kernel| self.key(kernel));
        let query = self.pipelines.compute(&gpu.device, &keys[0])?;
        let identify = self.pipelines.compute(&gpu.device, &keys[1])?;
        let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
        let encoded: Vec<QueryRay> = rays
            .iter()
            .map(|ray| QueryRay {
                origin: ray.origin.to_array(),
                t_max: ray.t_max,
                direction: ray.direction.to_array(),
                kind: ray.kind.code(),
            })
            .collect();
        let ray_buffer = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("queried rays"),
            contents: bytemuck::cast_slice(&encoded),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let hit_buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("their hits"),
            size: (rays.len() * size_of::<QueryHit>()) as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let buffers = [(0, ray_buffer.as_entire_binding()), (1, hit_buffer.as_entire_binding())];
        let bound =
            |kernel: &Pipeline| [kernel.bind(&gpu.device, 0, &buffers), scene_group(&gpu.device, kernel, scene)];
        let run = |kernel: &Pipeline, groups: &[Option<wgpu::BindGroup>; 2]| {
            self.timed_pass(kernel.label(), |pass| {
                kernel.dispatch(pass, &[&groups[0], &groups[1]], workgroups(rays.len() as u32));
            })
        };
        let seconds = run(&query, &bound(&query))?;
        run(&identify, &bound(&identify))?;
        Ok((read_buffer(&gpu, &hit_buffer)?, seconds))
    }
}
