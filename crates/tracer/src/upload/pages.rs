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
    /// Room for so many texels, at least one, to be bound as `binding`.
    pub(super) fn new(
        gpu: &Gpu,
        what: &'static str,
        format: wgpu::TextureFormat,
        binding: wgpu::TextureUsages,
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
            usage: binding | wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC,
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

    /// Writes texels from the first on. What is left of the last row becomes zero.
    pub(super) fn fill<T: bytemuck::Pod>(&self, gpu: &Gpu, texels: impl IntoIterator<Item = T>) {
        let mut rest = texels.into_iter();
        let mut page = 0;
        let mut piece: Vec<T> = Vec::new();
        loop {
            piece.clear();
            piece.extend(rest.by_ref().take((PAGE * PAGE) as usize));
            if piece.is_empty() {
                return;
            }
            let rows = piece.len().div_ceil(PAGE as usize);
            piece.resize(rows * PAGE as usize, T::zeroed());
            self.write(gpu, wgpu::Origin3d { x: 0, y: 0, z: page }, [PAGE, rows as u32], &piece);
            // Writes are staged until the next submission: one page's worth at a time.
            gpu.queue.submit([]);
            page += 1;
        }
    }

    /// Writes texels from number `first` on, and leaves the others.
    pub(super) fn put<T: bytemuck::Pod>(&self, gpu: &Gpu, first: usize, texels: &[T]) {
        let page = PAGE as usize;
        let (mut at, mut rest) = (first, texels);
        while !rest.is_empty() {
            let (piece, later) = rest.split_at(rest.len().min(page - at % page));
            let row = at / page;
            let origin = wgpu::Origin3d { x: (at % page) as u32, y: (row % page) as u32, z: (row / page) as u32 };
            self.write(gpu, origin, [piece.len() as u32, 1], piece);
            (at, rest) = (at + piece.len(), later);
        }
    }

    fn write<T: bytemuck::Pod>(&self, gpu: &Gpu, origin: wgpu::Origin3d, [width, height]: [u32; 2], texels: &[T]) {
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &self.texture,
                mip_level: 0,
                origin,
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * size_of::<T>() as u32),
                rows_per_image: Some(height),
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
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
