//! The texel heap: all textures of one encoding as runs of texels in a stack of square pages.

use std::{collections::HashMap, sync::Arc};

use super::{UploadError, pages::Pages};
use crate::{
    gpu::Gpu,
    scene::{TexelEncoding, Texture},
};

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
    // An image that several slots show is there once.
    let (mut places, mut distinct) = (HashMap::new(), Vec::new());
    for (texture, offset) in textures.iter().zip(offsets).filter(|(texture, _)| texture.encoding == encoding) {
        *offset = *places.entry(texture.hash).or_insert_with(|| {
            let place = total as u32;
            total += texture.texels.len() as u64;
            distinct.push(texture);
            place
        });
    }
    let (format, label) = match encoding {
        TexelEncoding::Srgb => (wgpu::TextureFormat::Rgba8UnormSrgb, "sRGB texels"),
        TexelEncoding::Linear => (wgpu::TextureFormat::Rgba8Unorm, "linear texels"),
    };
    let pages = Pages::new(gpu, label, format, wgpu::TextureUsages::TEXTURE_BINDING, total)?;
    *bytes += pages.bytes();
    pages.fill(gpu, distinct.iter().flat_map(|texture| texture.texels.iter().copied()));
    Ok(pages.view)
}
