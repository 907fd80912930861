//! The environment on the device: its image and the grid that it is sampled by.

use std::f64::consts::PI;

use glam::Vec3;

use super::{AliasTable, UploadError, lights::luminance, upload_image};
use crate::{gpu::Gpu, scene::EnvironmentImage};

/// Cells of the importance grid at most, along x and y. Their numbers are floats in its texture: as an integer's bits they would be
/// denormal ones, which drivers may take for 0.
const MOST_CELLS: [u32; 2] = [1024, 512];
const _: () = assert!(MOST_CELLS[0] * MOST_CELLS[1] <= 1 << 23, "the kernels read whole numbers up to 2^23");

/// An environment image and its grid on the device.
#[derive(Debug)]
pub struct EnvironmentOnGpu {
    /// The image, or one black texel.
    pub image: wgpu::TextureView,
    /// The grid: density per unit of the unit square, alias threshold, alias index; or one texel.
    pub cells: wgpu::TextureView,
    /// Its size; zero for a constant environment.
    pub cells_size: [u32; 2],
    /// Largest radiance of the image.
    pub brightest: f32,
    /// Of both.
    pub bytes: u64,
}

impl EnvironmentOnGpu {
    /// For a constant environment: nothing but what the bindings need.
    pub fn constant(gpu: &Gpu) -> Self {
        let texel = || upload_image(gpu, "environment", [1, 1], &[[0.0; 4]]);
        Self { image: texel(), cells: texel(), cells_size: [0; 2], brightest: 0.0, bytes: 32 }
    }

    /// Uploads the image and builds the grid.
    pub fn of(gpu: &Gpu, image: &EnvironmentImage) -> Result<Self, UploadError> {
        let side = u64::from(gpu.device.limits().max_texture_dimension_2d);
        if u64::from(image.width.max(image.height)) > side {
            return Err(UploadError::TooLarge {
                what: "environment image",
                bytes: image.pixels.len() as u64 * 16,
                limit: side * side * 16,
                adapter: gpu.info().name.clone(),
            });
        }
        let texels: Vec<[f32; 4]> = image.pixels.iter().map(|p| [p[0], p[1], p[2], 1.0]).collect();
        let (cells, cells_size) = importance_grid(image);
        Ok(Self {
            image: upload_image(gpu, "environment image", [image.width, image.height], &texels),
            cells: upload_image(gpu, "environment grid", cells_size, &cells),
            cells_size,
            brightest: image.pixels.iter().flatten().fold(0.0f32, |a, &b| a.max(b)),
            bytes: (texels.len() + cells.len()) as u64 * 16,
        })
    }
}

/// Cells weighted by luminance and solid angle. A cell's luminance is the mean over the pixels within half a pixel of
/// it, so that bilinear interpolation shows nothing that the grid gives no density to.
fn importance_grid(image: &EnvironmentImage) -> (Vec<[f32; 4]>, [u32; 2]) {
    let size = [image.width.min(MOST_CELLS[0]), image.height.min(MOST_CELLS[1])];
    let at = |x: i64, y: i64| {
        let column = x.rem_euclid(i64::from(image.width));
        let row = y.clamp(0, i64::from(image.height) - 1);
        luminance(Vec3::from(image.pixels[(row * i64::from(image.width) + column) as usize]))
    };
    let mut weights = Vec::with_capacity((size[0] * size[1]) as usize);
    for y in 0..size[1] {
        let rows = pixel_span(y, size[1], image.height);
        let latitude = PI * ((f64::from(y) + 0.5) / f64::from(size[1]) - 0.5);
        for x in 0..size[0] {
            let columns = pixel_span(x, size[0], image.width);
            let pixels = rows.clone().flat_map(|r| columns.clone().map(move |c| (c, r)));
            let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), (c, r)| (sum + f64::from(at(c, r)), count + 1.0));
            weights.push(sum / count * latitude.cos());
        }
    }
    let table = AliasTable::build(&weights);
    let count = weights.len() as f32;
    let cells = (0..weights.len())
        .map(|i| [table.probabilities[i] * count, table.thresholds[i], table.aliases[i] as f32, 0.0])
        .collect();
    (cells, size)
}

/// Image pixels whose bilinear reach touches a cell.
fn pixel_span(cell: u32, cells: u32, pixels: u32) -> std::ops::RangeInclusive<i64> {
    let scale = f64::from(pixels) / f64::from(cells);
    let first = (f64::from(cell) * scale - 0.5).floor() as i64;
    let last = (f64::from(cell + 1) * scale + 0.5).floor() as i64;
    first..=last.max(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ContentHash;

    /// Aliases are numbers, none of them denormal, and rows add up to the density.
    #[test]
    fn cells_hold_their_aliases_as_numbers() {
        let pixels: Vec<[f32; 3]> = (0..64 * 32).map(|i| [(i % 29) as f32 + 0.1; 3]).collect();
        let image = EnvironmentImage { width: 64, height: 32, hash: ContentHash::of(&[]), pixels };
        let (cells, _) = importance_grid(&image);
        let mut mass = vec![0.0f32; cells.len()];
        for (i, &[_, threshold, alias, _]) in cells.iter().enumerate() {
            assert!(alias == alias.round() && (alias == 0.0 || alias.is_normal()), "{alias}");
            mass[i] += threshold;
            mass[alias as usize] += 1.0 - threshold;
        }
        for (&[density, ..], mass) in cells.iter().zip(mass) {
            assert!((density - mass).abs() <= 1e-4 * density, "{mass} instead of {density}");
        }
    }
}
