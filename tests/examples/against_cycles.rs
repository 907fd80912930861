//! `against_cycles masks` writes the masks of `tests/masks`; `against_cycles OUT_FOLDER SPP [NAME...]` compares scenes in full with
//! Cycles' panoramas, prints one line of a table each, and writes a map of the differences of 16x16 blocks: red where ours is brighter,
//! blue where it is darker, full colour from 20 %; the lower map is of pixels inside the mask. FOVEA_SCENES and FOVEA_REFERENCE name the
//! folders of the scenes and references.

use std::error::Error;
use std::path::{Path, PathBuf};

use fovea_tests::{
    cycles::{self, BLOCK, Block},
    device,
    statistics::median,
};
use glam::Vec3;
use image::{GrayImage, Luma, Rgb, RgbImage};
use tracer::{
    environment,
    import::{ImportOptions, load_gltf},
    renderer::RendererOptions,
    scene::Environment,
};

/// Pixels of the map along a block's side.
const MAP_BLOCK_PX: u32 = 8;
/// Relative difference that has full colour.
const FULL_COLOR: f64 = 0.2;

fn folder(variable: &str) -> Result<PathBuf, String> {
    std::env::var_os(variable).map(PathBuf::from).ok_or(format!("{variable} is not set"))
}

/// One map below the other, without what is not compared (grey).
fn write_map(file: &Path, maps: &[Vec<Option<Block>>], columns: u32) -> image::ImageResult<()> {
    let rows = maps.first().map_or(0, Vec::len) as u32 / columns;
    let all: Vec<&Option<Block>> = maps.iter().flatten().collect();
    let picture = RgbImage::from_fn(columns * MAP_BLOCK_PX, rows * maps.len() as u32 * MAP_BLOCK_PX, |x, y| {
        let Some(block) = all[(y / MAP_BLOCK_PX * columns + x / MAP_BLOCK_PX) as usize] else { return Rgb([128; 3]) };
        let strength = (block.relative() / FULL_COLOR).clamp(-1.0, 1.0);
        let faded = (255.0 * (1.0 - strength.abs())).round() as u8;
        if strength > 0.0 { Rgb([255, faded, faded]) } else { Rgb([faded, faded, 255]) }
    });
    picture.save(file)
}

fn line(blocks: &[Option<Block>]) -> String {
    let found: Vec<&Block> = blocks.iter().flatten().collect();
    if found.is_empty() {
        return "0 | | | | ".into();
    }
    let share =
        |errors: f64| 100.0 * found.iter().filter(|b| b.is_within(0.05, errors)).count() as f64 / found.len() as f64;
    let sum = |value: fn(&Block) -> f64| found.iter().map(|b| value(b)).sum::<f64>();
    let errors: Vec<f64> = found.iter().map(|b| 100.0 * b.error / b.theirs).collect();
    format!(
        "{} | {:.4} | {:.1} | {:.1} | {:.2}",
        found.len(),
        sum(|b| b.ours) / sum(|b| b.theirs),
        share(0.0),
        share(2.0),
        median(&errors)
    )
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments.first().ok_or("usage: against_cycles masks | OUT_FOLDER SPP [NAME...]")?;
    if out != "masks" {
        std::fs::create_dir_all(out)?;
    }
    let spp = arguments.get(1).map(|text| text.parse::<u64>()).transpose()?;
    let wanted = arguments.get(2..).unwrap_or_default();
    let (scenes, references) = (folder("FOVEA_SCENES")?.join("paper"), folder("FOVEA_REFERENCE")?.join("cycles"));
    let gpu = device::gpu();
    for case in cycles::CASES.iter().filter(|case| wanted.is_empty() || wanted.iter().any(|name| name == case.name)) {
        let name = case.name;
        let reference = environment::load(&references.join(format!("{name}.exr")))?.image;
        let (mut scene, _) = load_gltf(&scenes.join(format!("{name}.glb")), &ImportOptions::default())?;
        scene.environment = Environment::Constant(Vec3::splat(case.background));
        let Some(spp) = spp else {
            let mask = cycles::make_mask(&gpu, case, &scene, &reference);
            let picture = GrayImage::from_fn(reference.width, reference.height, |x, y| {
                Luma([if mask[(y * reference.width + x) as usize] { 255 } else { 0 }])
            });
            picture.save(cycles::mask_file(name))?;
            continue;
        };
        let mut renderer = cycles::renderer(&gpu, case, &scene, &reference, RendererOptions::default().max_bounces);
        let samples = spp * renderer.options().film.pixels();
        let film = device::trace(&mut renderer, samples)?;
        let masked = cycles::committed_mask(name);
        let unmasked: Vec<bool> = masked.iter().map(|m| !m).collect();
        let maps = [&unmasked, &masked].map(|chosen| cycles::blocks(&film, &reference, chosen));
        eprintln!("| {name} | {spp} | {} | {} |", line(&maps[0]), line(&maps[1]));
        write_map(&Path::new(out).join(format!("cycles-{name}.png")), &maps, reference.width / BLOCK as u32)?;
    }
    Ok(())
}
