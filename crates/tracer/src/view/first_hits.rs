//! First hits of a view's pixels on the device. Twin: `shaders/view/first_hit.wesl`.

use glam::{Quat, Vec3};

use super::{DebugScale, ViewProjection};
use crate::{
    film::{FilmOptions, ReadError, read_buffer},
    gpu::Gpu,
    kernels::layout::FirstHit,
};

/// What first hits depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HitsOf {
    pub projection: ViewProjection,
    /// Pixels.
    pub size: [u32; 2],
    /// The viewer's.
    pub position: Vec3,
    pub world_from_film: Quat,
    pub film: FilmOptions,
    /// Number of the scene version.
    pub scene: u64,
}

/// Of no hits: smallest and largest depth, largest number of steps.
const NO_ENDS: [u32; 3] = [u32::MAX, 0, 0];

/// Made row by row, from the top.
#[derive(Debug)]
pub(crate) struct FirstHits {
    pub of: HitsOf,
    pub buffer: wgpu::Buffer,
    pub ends: wgpu::Buffer,
    /// Rows that are done.
    pub rows: u32,
    /// Smallest and largest depth, metres; `None` where nothing was hit.
    depths: Option<[f32; 2]>,
    most_steps: u32,
}

impl FirstHits {
    /// Room for the hits of a view.
    pub fn new(gpu: &Gpu, of: HitsOf) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let pixels = u64::from(of.size[0]) * u64::from(of.size[1]);
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("first hits"),
            size: pixels * size_of::<FirstHit>() as u64,
            usage,
            mapped_at_creation: false,
        });
        let ends = gpu.buffer("ends of the first hits", bytemuck::cast_slice(&NO_ENDS), usage);
        Self { of, buffer, ends, rows: 0, depths: None, most_steps: 0 }
    }

    /// These of another view of the same size, from its first row.
    pub fn anew(self, gpu: &Gpu, of: HitsOf) -> Self {
        gpu.queue.write_buffer(&self.ends, 0, bytemuck::cast_slice(&NO_ENDS));
        Self { of, rows: 0, depths: None, most_steps: 0, ..self }
    }

    /// Takes in that more rows are done, waiting for the device.
    pub fn advance(&mut self, gpu: &Gpu, rows: u32) -> Result<(), ReadError> {
        let ends = read_buffer::<u32>(gpu, &self.ends)?;
        let [nearest, farthest, steps] = ends[..] else { return Err(ReadError) };
        self.rows += rows;
        self.depths = (nearest <= farthest).then(|| [nearest, farthest].map(f32::from_bits));
        self.most_steps = steps;
        Ok(())
    }

    /// Scale of the depths.
    pub fn depths(&self) -> Option<DebugScale> {
        self.depths.map(|[low, high]| DebugScale { low, high: high.max(1.01 * low), is_logarithmic: true })
    }

    /// Scale of the traversal steps.
    pub fn steps(&self) -> Option<DebugScale> {
        let high = self.most_steps.max(1) as f32;
        (self.rows > 0).then_some(DebugScale { low: 0.0, high, is_logarithmic: false })
    }
}
