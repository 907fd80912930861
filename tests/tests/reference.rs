//! Against panoramas by Blender Cycles, on scenes whose materials are all Lambertian: image means within 1 %, means of 16x16
//! blocks within 3 % + 2 standard errors for 95 % of the blocks.
//!
//! The film's pixels are the reference's blocks: a mean over a block's area is what a pixel of a coarser film is. By default
//! few samples are traced and the standard errors are accordingly large, but bounded: each test states the largest that the
//! median block may have. `FOVEA_REFERENCE_SAMPLES` sets the samples per pixel of the reference (512x256) for longer runs.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_tests::{device, statistics::median};
use glam::{Quat, Vec3};
use tracer::{
    distribution::Distribution,
    environment,
    film::FilmOptions,
    import::{ImportOptions, load_gltf},
    renderer::{FilmPose, Renderer, RendererOptions},
    scene::Environment,
};

/// Pixels along a block's side.
const BLOCK: usize = 16;

fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// Standard error of a block's mean from its pixels' noise: second differences along rows, whose median does not see edges.
fn block_error(pixel: &dyn Fn(usize, usize) -> f64) -> f64 {
    let mut residuals = Vec::new();
    for y in 0..BLOCK {
        for x in 1..BLOCK - 1 {
            residuals.push((pixel(x, y) - 0.5 * (pixel(x - 1, y) + pixel(x + 1, y))).abs());
        }
    }
    // A residual has 1.5 times a pixel's variance; 1.4826 takes a median to a standard deviation.
    1.4826 * median(&residuals) / 1.5f64.sqrt() / BLOCK as f64
}

/// `default_samples` per pixel of the reference; `largest_median_error` is relative and of both images together.
fn compare(name: &str, background: f32, default_samples: u64, largest_median_error: f64) {
    let scene_file = device::external_file("reference", "FOVEA_SCENES", &format!("paper/{name}.glb"));
    let image_file = device::external_file("reference", "FOVEA_REFERENCE", &format!("cycles/{name}.exr"));
    let (Some(scene_file), Some(image_file)) = (scene_file, image_file) else { return };
    let _time = device::Stopwatch::start("reference");
    let reference = environment::load(&image_file).unwrap().image;
    let (width, height) = (reference.width as usize, reference.height as usize);
    let (mut scene, _) = load_gltf(&scene_file, &ImportOptions::default()).unwrap();
    scene.environment = Environment::Constant(Vec3::splat(background));

    let gpu = device::gpu();
    let (columns, rows) = (width / BLOCK, height / BLOCK);
    let options = RendererOptions { film: FilmOptions::equirect(columns as u32, rows as u32), ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    renderer.set_scene(&scene).unwrap();
    renderer.set_pose(FilmPose { position: scene.cameras[0].position, world_from_film: Quat::IDENTITY });
    let per_pixel = std::env::var("FOVEA_REFERENCE_SAMPLES").map_or(default_samples, |text| text.parse().unwrap());
    let samples = per_pixel * (width * height) as u64;
    let film = device::trace(&mut renderer, samples).unwrap();
    assert_eq!(renderer.statistics().unwrap().non_finite, 0);

    let mut sums = [[0.0; 3]; 2];
    let (mut close, mut errors) = (0, Vec::new());
    for (block, ours) in film.pixels().enumerate() {
        let (x0, y0) = (block % columns * BLOCK, block / columns * BLOCK);
        let pixel = |x: usize, y: usize| reference.pixels[(y0 + y) * width + x0 + x].map(f64::from);
        let mut theirs = [0.0; 3];
        for i in 0..BLOCK * BLOCK {
            for (sum, value) in theirs.iter_mut().zip(pixel(i % BLOCK, i / BLOCK)) {
                *sum += value / (BLOCK * BLOCK) as f64;
            }
        }
        for channel in 0..3 {
            sums[0][channel] += ours.mean[channel];
            sums[1][channel] += theirs[channel];
        }
        let error = ours.variance_of_mean.sqrt().hypot(block_error(&|x, y| luminance(pixel(x, y))));
        let level = luminance(theirs);
        errors.push(error / level);
        close += usize::from((luminance(ours.mean) - level).abs() <= 0.03 * level + 2.0 * error);
    }
    let ratios: [f64; 3] = std::array::from_fn(|channel| sums[0][channel] / sums[1][channel]);
    let share = close as f64 / errors.len() as f64;
    let typical = median(&errors);
    eprintln!(
        "{name}: {per_pixel} samples a pixel, mean ratios {ratios:.4?}, {:.1} % of {} blocks close, standard error of the \
         median block {:.2} %",
        share * 100.0,
        errors.len(),
        typical * 100.0
    );
    assert!(typical <= largest_median_error, "too few samples for the claim");
    assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() <= 0.01), "image means {ratios:?}");
    assert!(share >= 0.95, "only {share} of the blocks are close");
}

#[test]
fn sibenik_lambert_is_as_by_cycles() {
    compare("sibenik_lambert", 1.0, 8, 0.03);
}

#[test]
fn classroom_lambert_is_as_by_cycles() {
    compare("classroom_lambert", 0.0, 16, 0.05);
}
