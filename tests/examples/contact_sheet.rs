//! `contact_sheet OUT.jpg [TILE_PX [SPP [FILE...]]]`: the models of the probe list, each as its probes see it, row by row in
//! the list's order. Without FILEs those whose licence does not allow pictures here are left out. FOVEA_SCENES names the folder
//! that holds `khronos`.

use std::error::Error;
use std::path::PathBuf;

use fovea_tests::{device, probes};
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};
use tracer::{
    distribution::Distribution,
    renderer::{Renderer, RendererOptions},
};

const COLUMNS: usize = 8;
const JPEG_QUALITY: u8 = 85;

/// sRGB's transfer function after clipping; a model's own colours are to be recognised, so no view transform.
fn encoded(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let srgb = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (srgb * 255.0).round() as u8
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().filter(|out| out.ends_with(".jpg"));
    let out = out.ok_or("usage: contact_sheet OUT.jpg [TILE_PX [SPP [FILE...]]]")?;
    let side = arguments.next().map_or(Ok(128), |text| text.parse::<u32>())?;
    let spp = arguments.next().map_or(Ok(24), |text| text.parse::<u64>())?;
    let wanted: Vec<String> = arguments.collect();
    let folder = PathBuf::from(std::env::var_os("FOVEA_SCENES").ok_or("FOVEA_SCENES is not set")?).join("khronos");

    let mut models = probes::list();
    models.retain(|model| if wanted.is_empty() { model.on_sheet } else { wanted.contains(&model.file) });
    let columns = COLUMNS.min(models.len().max(1));
    let (width, height) = (columns * side as usize, models.len().div_ceil(columns) * side as usize);
    let mut sheet = vec![255u8; width * height * 3];
    let options = RendererOptions { film: probes::film(side), max_bounces: probes::MAX_BOUNCES, ..Default::default() };
    let mut renderer = Renderer::new(&device::gpu(), &options, Distribution::omnidirectional(device::inverse()))?;
    for (tile, model) in models.iter().enumerate() {
        let scene = model.load(&folder)?;
        renderer.set_scene(&scene)?;
        renderer.set_pose(model.pose(&scene));
        let film = device::trace(&mut renderer, spp * options.film.pixels())?;
        for (i, pixel) in film.pixels().enumerate() {
            let x = tile % columns * side as usize + i % side as usize;
            let y = tile / columns * side as usize + i / side as usize;
            sheet[(y * width + x) * 3..][..3].copy_from_slice(&pixel.mean.map(encoded));
        }
    }
    let encoder = JpegEncoder::new_with_quality(std::fs::File::create(out)?, JPEG_QUALITY);
    encoder.write_image(&sheet, width as u32, height as u32, ExtendedColorType::Rgb8)?;
    Ok(())
}
