//! The environment on the device: its image and the grid that it is sampled by.

use std::f64::consts::PI;

use glam::Vec3;

use super::{AliasTable, UploadError, lights::luminance, upload_image};
use crate::{
    gpu::Gpu,
    scene::{Environment, EnvironmentImage},
};

/// Cells of the importance grid at most, along x and y.
const MOST_CELLS: [u32; 2] = [1024, 512];

/// What the kernels see of an environment.
pub struct EnvironmentOnGpu {
    /// The image, or one black texel.
    pub image: wgpu::TextureView,
    /// The grid: density per unit of the unit square, alias threshold, alias index (its bits); or one texel.
    pub cells: wgpu::TextureView,
    /// Its size; zero for a constant environment.
    pub cells_size: [u32; 2],
    /// Constant radiance, or the factor of the image.
    pub radiance: Vec3,
    /// Turns to the right.
    pub rotation_turns: f32,
    /// Largest radiance.
    pub brightest: f32,
}

impl EnvironmentOnGpu {
    /// Uploads the image and builds the grid. Adds the bytes to `bytes`.
    pub fn build(gpu: &Gpu, environment: &Environment, bytes: &mut u64) -> Result<Self, UploadError> {
        Ok(match environment {
            Environment::Constant(radiance) => Self {
                image: upload_image(gpu, "environment", [1, 1], &[[0.0; 4]]),
                cells: upload_image(gpu, "environment", [1, 1], &[[0.0; 4]]),
                cells_size: [0; 2],
                radiance: *radiance,
                rotation_turns: 0.0,
                brightest: radiance.max_element(),
            },
            Environment::Image { image, rotation_deg, intensity } => {
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
                *bytes += (texels.len() + cells.len()) as u64 * 16;
                let brightest = image.pixels.iter().flatten().fold(0.0f32, |a, &b| a.max(b)) * intensity;
                Self {
                    image: upload_image(gpu, "environment image", [image.width, image.height], &texels),
                    cells: upload_image(gpu, "environment grid", cells_size, &cells),
                    cells_size,
                    radiance: Vec3::splat(*intensity),
                    rotation_turns: rotation_deg / 360.0,
                    brightest,
                }
            }
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
        .map(|i| [table.probabilities[i] * count, table.thresholds[i], f32::from_bits(table.aliases[i]), 0.0])
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
