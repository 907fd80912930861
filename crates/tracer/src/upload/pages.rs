//! Runs of texels in stacks of square pages: what is not to be bounded by a storage binding.

use super::UploadError;
use crate::{gpu::Gpu, kernels::TEXEL_PAGE_BITS};

/// Texels along a page's side.
pub(super) const PAGE: u32 = 1 << TEXEL_PAGE_BITS;

/// A stack of pages. A single page is no higher than it needs to be.
#[derive(Clone, Debug)]
pub(super) struct Pages {
    texture: wgpu::Texture,
    /// All pages, as the kernels bind them.
    pub view: wgpu::TextureView,
    texel_bytes: u64,
}

impl Pages {
    /// Room for so many texels; at least one.
    pub(super) fn new(
        gpu: &Gpu,
        what: &'static str,
        format: wgpu::TextureFormat,
        texels: u64,
    ) -> Result<Self, UploadError> {
        let page_texels = u64::from(PAGE) * u64::from(PAGE);
        let texel_bytes = u64::from(format.block_copy_size(None).unwrap_or(4));
        let pages = texels.div_ceil(page_texels);
        let limit = u64::from(gpu.device.limits().max_texture_array_layers).min(1 << (32 - 2 * TEXEL_PAGE_BITS));
        if pages > limit {
            return Err(UploadError::TooLarge {
                what,
                bytes: texels * texel_bytes,
                limit: limit * page_texels * texel_bytes,
                adapter: gpu.info().name.clone(),
            });
        }
        let height = if pages > 1 { PAGE } else { (texels.div_ceil(u64::from(PAGE)) as u32).max(1) };
        let width = if texels == 0 { 1 } else { PAGE };
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: pages.max(1) as u32 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        Ok(Self { texture, view, texel_bytes })
    }

    /// On the device.
    pub(super) fn bytes(&self) -> u64 {
        let size = self.texture.size();
        u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers) * self.texel_bytes
    }

    /// Writes texels from the beginning of a row on; rows are numbered through all pages. What is left of the last row becomes zero.
    pub(super) fn write<T: bytemuck::Pod>(&self, gpu: &Gpu, first_row: u32, texels: impl IntoIterator<Item = T>) {
        let mut rest = texels.into_iter();
        let mut row = first_row;
        let mut piece: Vec<T> = Vec::new();
        loop {
            // To the page's end.
            let (page, y) = (row / PAGE, row % PAGE);
            let room = (PAGE - y) as usize * PAGE as usize;
            piece.clear();
            piece.extend(rest.by_ref().take(room));
            if piece.is_empty() {
                return;
            }
            let rows = piece.len().div_ceil(PAGE as usize);
            piece.resize(rows * PAGE as usize, T::zeroed());
            gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture: &self.texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y, z: page },
                    aspect: wgpu::TextureAspect::All,
                },
                bytemuck::cast_slice(&piece),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(PAGE * size_of::<T>() as u32),
                    rows_per_image: Some(rows as u32),
                },
                wgpu::Extent3d { width: PAGE, height: rows as u32, depth_or_array_layers: 1 },
            );
            // Writes are staged until the next submission: one page's worth at a time.
            gpu.queue.submit([]);
            row += rows as u32;
        }
    }

    /// Begins with what another stack holds, which must be no larger.
    pub(super) fn copy_from(&self, gpu: &Gpu, other: &Self) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_texture(
            other.texture.as_image_copy(),
            self.texture.as_image_copy(),
            other.texture.size(),
        );
        gpu.queue.submit([encoder.finish()]);
    }
}
