//! What chooses the pixels of samples, as it lies on the device: the mixture's lists, the table of the pixels about the gaze and the
//! guide, in one buffer.

use glam::Quat;

use super::{RenderError, Renderer};
use crate::{
    distribution::{Encoded, FilmFrame, Layer, TableWords},
    film::FilmOptions,
    guide::Guide,
    kernels::layout::{MAX_LAYERS, SampleLayer},
};

/// The random number that chooses a pixel of a list has 24 bits.
const LONGEST_LIST: u64 = 1 << 24;

/// What is on the device, and where in the buffer its parts begin.
#[derive(Debug)]
pub(super) struct Sampling {
    /// What it was made for; `None` when it is to be made anew.
    key: Option<Key>,
    pub layers: [SampleLayer; MAX_LAYERS],
    pub layer_count: u32,
    pub guide_first: u32,
    pub fovea_first: u32,
    pub fovea_cells: u32,
    pub fovea_cell_bits: u32,
    pub fovea_end: u32,
}

/// What the table of the pixels about the gaze depends on, beside the distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    film: FilmOptions,
    world_from_film: Quat,
    /// For cells of the layers alone to be judged.
    is_judged: bool,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            key: None,
            layers: bytemuck::Zeroable::zeroed(),
            layer_count: 0,
            guide_first: 0,
            fovea_first: 0,
            fovea_cells: 0,
            fovea_cell_bits: 0,
            fovea_end: 0,
        }
    }
}

impl Sampling {
    /// Distribution or guide have changed.
    pub fn forget(&mut self) {
        self.key = None;
    }
}

impl Renderer {
    /// Brings to the device what the next batch's samples are chosen by, where it has changed.
    ///
    /// `is_judged`: the unit square is to be that of the layers alone.
    pub(super) fn prepare_sampling(&mut self, is_judged: bool) -> Result<(), RenderError> {
        let key = Key { film: self.options.film, world_from_film: self.pose.world_from_film, is_judged };
        if self.sampling.key == Some(key) {
            return Ok(());
        }
        self.check_pixel_lists()?;
        let frame = FilmFrame { options: &self.options.film, world_from_film: self.pose.world_from_film };
        let guide = self.guide().filter(|_| !is_judged);
        let Encoded { layers, layer_count, pixels: mut words, fovea, fovea_end, guide } =
            self.distribution.encode(frame, !is_judged, guide);
        let table = TableWords::new(&fovea, fovea_end);
        let fovea_first = words.len() as u32;
        words.extend_from_slice(table.entries.as_flattened());
        let fovea_cells = words.len() as u32;
        words.extend(table.cells);
        let guide_first = words.len() as u32;
        words.extend(guide.iter().flat_map(Guide::table).map(f32::to_bits));
        self.upload_pixel_list(&words)?;
        self.sampling = Sampling {
            key: Some(key),
            layers,
            layer_count,
            guide_first,
            fovea_first,
            fovea_cells,
            fovea_cell_bits: table.cell_bits,
            fovea_end,
        };
        Ok(())
    }

    /// Of a longer list the random number that chooses the pixel could not reach every one.
    fn check_pixel_lists(&self) -> Result<(), RenderError> {
        let lengths = self.distribution.layers().iter().filter_map(|(_, layer)| match layer {
            Layer::Pixels(list) => Some(list.len() as u64),
            _ => None,
        });
        match lengths.max() {
            Some(pixels) if pixels > LONGEST_LIST => Err(RenderError::PixelListTooLong { pixels, limit: LONGEST_LIST }),
            _ => Ok(()),
        }
    }

    fn upload_pixel_list(&mut self, words: &[u32]) -> Result<(), RenderError> {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        let limit = self.gpu.largest_binding();
        if bytes.len() as u64 > limit {
            return Err(RenderError::PixelListsTooLarge {
                bytes: bytes.len() as u64,
                limit,
                adapter: self.gpu.info().name.clone(),
            });
        }
        if self.pixel_list.size() < bytes.len() as u64 {
            self.pixel_list = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pixel list"),
                size: (bytes.len() as u64).next_power_of_two().min(limit),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            if let (Some(scene), Some(bound)) = (&self.scene, &mut self.bound) {
                bound.paths.rebind(&self.gpu.device, scene, [&self.params[0], &self.records, &self.pixel_list]);
            }
        }
        self.gpu.queue.write_buffer(&self.pixel_list, 0, bytes);
        Ok(())
    }
}
