//! The film: world-anchored, dense, cut into slabs of rows; all sums are integers.
//!
//! A pixel is ten 32-bit words: sums of R, G and B (64 bits each, in quanta of radiance), the number of samples, and
//! the sum of squared luminance (96 bits, in its own quanta). Integers make the film independent of order and of how
//! samples were cut into batches. The sum of squares is exact, so no pivot is needed: nothing cancels in integers.

use crate::{
    gpu::Gpu,
    kernels::{FILM_WORDS, layout::FilmCounters},
};

mod merge;
mod probe;
mod snapshot;

pub use merge::MergeError;
pub use probe::PixelsNear;
pub use snapshot::{DamagedFilm, FilmDifference, FilmHeader, FilmPixel, FilmSnapshot, SampleRange};
pub(crate) use snapshot::{LAST_SAMPLE, joined};

/// What a film pixel stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FilmMapping {
    /// A 360-degree panorama.
    Equirect,
    /// A perspective image; half extents of its image plane at distance 1.
    Perspective {
        /// tan of half the horizontal and vertical angles of view.
        half_extent: [f32; 2],
    },
}

/// Size and mapping of a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmOptions {
    /// Mapping of pixels to directions.
    pub mapping: FilmMapping,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
}

impl FilmOptions {
    /// A panorama of this size in pixels, each side at least 1; twice as wide as high is usual.
    pub const fn equirect(width: u32, height: u32) -> Self {
        Self { mapping: FilmMapping::Equirect, width, height }
    }

    /// A perspective film of this size in pixels, each side at least 1, with this vertical angle of view in radians, above 0 and below
    /// pi. [`Renderer`](crate::renderer::Renderer) refuses what is not a picture.
    pub fn perspective(width: u32, height: u32, yfov: f32) -> Self {
        let y = (yfov * 0.5).tan();
        let half_extent = [y * width as f32 / height as f32, y];
        Self { mapping: FilmMapping::Perspective { half_extent }, width, height }
    }

    /// Whether there is a pixel, and a place in the image plane for it.
    pub(crate) fn is_picture(&self) -> bool {
        self.pixels() > 0 && self.half_extent().iter().all(|&extent| extent > 0.0 && extent.is_finite())
    }

    /// Number of pixels.
    pub const fn pixels(&self) -> u64 {
        self.width as u64 * self.height as u64
    }

    /// Bytes on the device.
    pub const fn bytes(&self) -> u64 {
        self.pixels() * FILM_WORDS as u64 * 4
    }

    pub(crate) fn half_extent(&self) -> [f32; 2] {
        match self.mapping {
            FilmMapping::Equirect => [1.0; 2],
            FilmMapping::Perspective { half_extent } => half_extent,
        }
    }
}

/// A run of whole rows in one buffer.
#[derive(Debug)]
pub(crate) struct Slab {
    pub buffer: wgpu::Buffer,
    pub first_pixel: u32,
    pub pixel_count: u32,
}

/// The film on the device.
#[derive(Debug)]
pub(crate) struct Film {
    pub options: FilmOptions,
    pub slabs: Vec<Slab>,
    pub counters: wgpu::Buffer,
}

impl Film {
    /// Allocates a film; `None` when the device has no memory for it.
    pub fn new(gpu: &Gpu, options: FilmOptions) -> Option<Self> {
        if gpu.lacks_memory(options.bytes()) {
            return None;
        }
        let row_bytes = u64::from(options.width) * u64::from(FILM_WORDS) * 4;
        let rows_per_slab = (gpu.largest_binding() / row_bytes).clamp(1, u64::from(options.height)) as u32;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let slabs = (0..options.height)
            .step_by(rows_per_slab as usize)
            .map(|first_row| {
                let rows = rows_per_slab.min(options.height - first_row);
                Slab {
                    buffer: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                        label: Some("film slab"),
                        size: u64::from(rows) * row_bytes,
                        usage: wgpu::BufferUsages::STORAGE
                            | wgpu::BufferUsages::COPY_SRC
                            | wgpu::BufferUsages::COPY_DST,
                        mapped_at_creation: false,
                    }),
                    first_pixel: first_row * options.width,
                    pixel_count: rows * options.width,
                }
            })
            .collect();
        let counters = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("film counters"),
            size: size_of::<FilmCounters>() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        if pollster::block_on(scope.pop()).is_some() {
            return None;
        }
        Some(Self { options, slabs, counters })
    }

    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        for slab in &self.slabs {
            encoder.clear_buffer(&slab.buffer, 0, None);
        }
        encoder.clear_buffer(&self.counters, 0, None);
    }

    /// Replaces all sums; `words` must be as many as the film has.
    pub fn write(&self, gpu: &Gpu, words: &[u32], counters: FilmCounters) {
        for slab in &self.slabs {
            let words_of = |pixels: u32| pixels as usize * FILM_WORDS as usize;
            let first = words_of(slab.first_pixel);
            let slab_words = &words[first..first + words_of(slab.pixel_count)];
            gpu.queue.write_buffer(&slab.buffer, 0, bytemuck::cast_slice(slab_words));
            // Writes are staged until the next submission: one slab's worth at a time.
            gpu.queue.submit([]);
        }
        gpu.queue.write_buffer(&self.counters, 0, bytemuck::bytes_of(&counters));
    }

    /// Reads all slabs back, waiting for the device.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<u32>, ReadError> {
        let mut words = Vec::with_capacity((self.options.pixels() * u64::from(FILM_WORDS)) as usize);
        for slab in &self.slabs {
            words.extend_from_slice(&read_buffer::<u32>(gpu, &slab.buffer)?);
        }
        Ok(words)
    }

    pub fn read_counters(&self, gpu: &Gpu) -> Result<FilmCounters, ReadError> {
        let counters = read_buffer::<FilmCounters>(gpu, &self.counters)?;
        counters.first().copied().ok_or(ReadError)
    }
}

/// The device did not give a buffer back: it is lost.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the graphics device was lost while a buffer was read back")]
pub struct ReadError;

/// Copies a whole buffer to the host, waiting for the device.
pub(crate) fn read_buffer<T: bytemuck::Pod>(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<T>, ReadError> {
    read_ranges(gpu, &[(buffer, 0, buffer.size())])
}

/// Copies ranges (offset and length in bytes) of buffers to the host, one after the other, waiting for the device.
pub(crate) fn read_ranges<T: bytemuck::Pod>(
    gpu: &Gpu,
    ranges: &[(&wgpu::Buffer, u64, u64)],
) -> Result<Vec<T>, ReadError> {
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read-back"),
        size: ranges.iter().map(|(_, _, length)| length).sum(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read-back") });
    let mut end = 0;
    for &(buffer, offset, length) in ranges {
        encoder.copy_buffer_to_buffer(buffer, offset, &staging, end, length);
        end += length;
    }
    gpu.queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        // The receiver waits just below; it can only be gone when polling failed.
        let _ = sender.send(result);
    });
    gpu.wait().map_err(|_| ReadError)?;
    receiver.recv().map_err(|_| ReadError)?.map_err(|_| ReadError)?;
    let mapped = staging.slice(..).get_mapped_range().map_err(|_| ReadError)?;
    let mut values = vec![T::zeroed(); mapped.len() / size_of::<T>()];
    let bytes = values.len() * size_of::<T>();
    bytemuck::cast_slice_mut(&mut values).copy_from_slice(&mapped[..bytes]);
    Ok(values)
}
