//! Directional albedos of rough lobes, as the texture that `shaders/shading/tables.wesl` reads.
//!
//! Everything here is per outgoing direction: `cosine` is that direction's to the normal. Angles and roughness are spaced by
//! the square root of cosine and alpha, finer towards grazing angles and smoothness, where the albedos bend. The tables are in
//! `assets/lobe_tables.bin`, made by `crates/tracer/examples/make_lobe_tables.rs`: their quadrature would take 0.6 s of processor
//! time at every start.

use std::array;

use super::upload_image;
use crate::{
    features::{Feature, SceneFeatures},
    gpu::Gpu,
    kernels::{ALBEDO_COLUMNS, ALBEDO_ROWS, GLASS_LAYERS, GLASS_SIZE},
};

mod quadrature;

pub use quadrature::lobe_albedos;

/// What the texture depends on.
pub(super) const TABLE_FEATURES: [Feature; 3] = [Feature::Specular, Feature::Clearcoat, Feature::Sheen];

/// What [`lobe_albedos`] gave, as little-endian bytes.
static STORED: &[u8] = include_bytes!("../../../../assets/lobe_tables.bin");

/// Entries of the tables: pairs of numbers.
const ENTRIES: [u32; 3] =
    [ALBEDO_COLUMNS * ALBEDO_ROWS, ALBEDO_COLUMNS * ALBEDO_ROWS, GLASS_SIZE * GLASS_SIZE * GLASS_LAYERS];

/// Reflection, sheen and glass as they are stored.
fn stored() -> [Vec<[f32; 2]>; 3] {
    let mut pairs = STORED.chunks_exact(8).map(|bytes| {
        let number = |at: usize| f32::from_le_bytes(array::from_fn(|i| bytes[at + i]));
        [number(0), number(4)]
    });
    ENTRIES.map(|count| pairs.by_ref().take(count as usize).collect())
}

/// Width and texels of the table that the features need; one texel when they need none.
pub(super) fn upload(gpu: &Gpu, features: SceneFeatures) -> (wgpu::TextureView, u64) {
    let mut texels = Vec::new();
    let [reflection, sheen, glass] = stored();
    if TABLE_FEATURES.iter().any(|&feature| features.contains(feature)) {
        texels.extend(in_pairs(&reflection, ALBEDO_COLUMNS));
        let sheen = if features.contains(Feature::Sheen) { &sheen[..] } else { &[] };
        texels.extend(in_pairs(sheen, ALBEDO_COLUMNS));
        texels.resize((2 * ALBEDO_COLUMNS * ALBEDO_ROWS) as usize, [0.0; 4]);
    }
    if features.contains(Feature::Specular) {
        let rows = in_pairs(&glass, GLASS_SIZE);
        let rest = [[0.0; 4]; (ALBEDO_COLUMNS - GLASS_SIZE) as usize];
        rows.chunks(GLASS_SIZE as usize).for_each(|row| texels.extend(row.iter().chain(&rest)));
    }
    let mut size = [ALBEDO_COLUMNS, texels.len() as u32 / ALBEDO_COLUMNS];
    if texels.is_empty() {
        (texels, size) = (vec![[0.0; 4]], [1, 1]);
    }
    (upload_image(gpu, "lobe tables", size, &texels), texels.len() as u64 * 16)
}

/// Each texel holds an entry and its neighbour along the row: interpolation needs half as many loads.
fn in_pairs(entries: &[[f32; 2]], columns: u32) -> Vec<[f32; 4]> {
    let pair = |row: &[[f32; 2]], i: usize| {
        let next = row[(i + 1).min(row.len() - 1)];
        [row[i][0], row[i][1], next[0], next[1]]
    };
    entries.chunks(columns as usize).flat_map(|row| (0..row.len()).map(move |i| pair(row, i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stored_is_what_the_quadrature_gives() {
        assert_eq!(STORED.len(), 8 * ENTRIES.iter().sum::<u32>() as usize);
        for (stored, computed) in stored().iter().flatten().zip(lobe_albedos().iter().flatten()) {
            // Mathematical functions differ in their last digits between platforms.
            assert!((0..2).all(|i| (stored[i] - computed[i]).abs() <= 1e-6), "{stored:?} {computed:?}");
        }
    }
}
