//! The texel heap: all textures of one encoding as runs of texels in a stack of square pages.

use std::sync::Arc;

use super::UploadError;
use crate::{
    gpu::Gpu,
    kernels::TEXEL_PAGE_BITS,
    scene::{TexelEncoding, Texture},
};

/// Texels along a page's side.
const PAGE: u32 = 1 << TEXEL_PAGE_BITS;

/// The two page stacks.
#[derive(Debug)]
pub struct TexelHeap {
    /// Decodes sRGB on look-up.
    pub srgb: wgpu::TextureView,
    /// Linear values.
    pub linear: wgpu::TextureView,
    /// First texel of each texture.
    pub offsets: Vec<u32>,
    /// Of both.
    pub bytes: u64,
}

impl TexelHeap {
    /// Uploads textures.
    pub fn upload(gpu: &Gpu, textures: &[Arc<Texture>]) -> Result<Self, UploadError> {
        let (mut offsets, mut bytes) = (vec![0; textures.len()], 0);
        let srgb = stack(gpu, textures, TexelEncoding::Srgb, &mut offsets, &mut bytes)?;
        let linear = stack(gpu, textures, TexelEncoding::Linear, &mut offsets, &mut bytes)?;
        Ok(Self { srgb, linear, offsets, bytes })
    }
}

fn stack(
    gpu: &Gpu,
    textures: &[Arc<Texture>],
    encoding: TexelEncoding,
    offsets: &mut [u32],
    bytes: &mut u64,
) -> Result<wgpu::TextureView, UploadError> {
    let mut total = 0;
    for (texture, offset) in textures.iter().zip(offsets) {
        if texture.encoding == encoding {
            *offset = total as u32;
            total += texture.texels.len() as u64;
        }
    }
    let page_texels = u64::from(PAGE) * u64::from(PAGE);
    let pages = total.div_ceil(page_texels);
    let limit = u64::from(gpu.device.limits().max_texture_array_layers).min(1 << (32 - 2 * TEXEL_PAGE_BITS));
    if pages > limit {
        return Err(UploadError::TooLarge {
            what: "texels",
            bytes: total * 4,
            limit: limit * page_texels * 4,
            adapter: gpu.info().name.clone(),
        });
    }
    // An empty stack is one texel; a stack of one page is no higher than it needs to be.
    let height = if pages > 1 { PAGE } else { (total.div_ceil(u64::from(PAGE)) as u32).max(1) };
    let width = if total == 0 { 1 } else { PAGE };
    let (format, label) = match encoding {
        TexelEncoding::Srgb => (wgpu::TextureFormat::Rgba8UnormSrgb, "sRGB texels"),
        TexelEncoding::Linear => (wgpu::TextureFormat::Rgba8Unorm, "linear texels"),
    };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: pages.max(1) as u32 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    *bytes += u64::from(width) * u64::from(height) * pages.max(1) * 4;
    let mut run = textures.iter().filter(|t| t.encoding == encoding).flat_map(|t| t.texels.iter().copied());
    for page in 0..pages as u32 {
        let rows = (total - u64::from(page) * page_texels).div_ceil(u64::from(PAGE)).min(u64::from(PAGE)) as u32;
        let mut texels: Vec<[u8; 4]> = run.by_ref().take((rows * PAGE) as usize).collect();
        texels.resize((rows * PAGE) as usize, [0; 4]);
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: page },
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(&texels),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(PAGE * 4), rows_per_image: Some(rows) },
            wgpu::Extent3d { width: PAGE, height: rows, depth_or_array_layers: 1 },
        );
    }
    Ok(texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    }))
}
