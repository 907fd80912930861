//! All ways to distribute samples converge to the same picture: OD against FV and VP against FV, block by block.
//!
//! Every pixel's mean is unbiased in every mode (given a sample), so the mean of a block's pixels, equally weighted, is too,
//! for blocks of which every pixel has a sample in every render. Its spread is taken over independent renders of `SEEDS`
//! seeds; blocks are compared by Welch's t-test, and so is the mean over the blocks, which sees what is small in each but
//! common to all. Šidák's correction over all of a comparison's tests: a right program fails one comparison with
//! probability `SIGNIFICANCE`. The planted faults show that the tests would notice.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_tests::{device, plant::exchanged, scenes, statistics};
use glam::{EulerRot, Quat, Vec2, Vec3};
use tracer::{
    distribution::{Distribution, Gaze, View},
    film::FilmOptions,
    gpu::Gpu,
    kernels::ShaderSources,
    renderer::FilmPose,
    scene::Scene,
};

const SEEDS: u32 = 8;
const SIGNIFICANCE: f64 = 1e-4;
const FILM: FilmOptions = FilmOptions::equirect(32, 16);
/// Pixels along a block's side.
const BLOCK: u32 = 4;
/// Largest standard error of the median block, relative to its value.
const LARGEST_MEDIAN_ERROR: f64 = 0.005;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Omnidirectional,
    Viewport,
    Foveated,
}

struct Case {
    name: &'static str,
    scene: Scene,
    position: Vec3,
    max_bounces: u32,
    gaze: Gaze,
    /// 100 by 100 degrees about the gaze.
    view: View,
    /// Samples of one render in the order of [`Mode`].
    samples: [u64; 3],
}

fn turn(yaw_deg: f32, pitch_deg: f32) -> Quat {
    Quat::from_euler(EulerRot::YXZ, -yaw_deg.to_radians(), pitch_deg.to_radians(), 0.0)
}

fn view(yaw_deg: f32, pitch_deg: f32) -> View {
    let angle = 100f32.to_radians();
    View::new(turn(yaw_deg, pitch_deg), angle, angle)
}

fn in_scene(view: &View) -> Gaze {
    Gaze::Scene { direction: view.direction(Vec2::ZERO) }
}

/// Glowing grey walls: little variance. The gaze is measured at the eye, so that FV has two layers.
fn glowing_room() -> Case {
    let mut builder = scenes::Builder::new(Vec3::ZERO);
    let materials = std::array::from_fn(|i| {
        let grey = Vec3::splat(0.3 + 0.05 * i as f32);
        builder.material(tracer::scene::Material { emission: grey, ..scenes::lambert(Vec3::splat(0.5)) })
    });
    builder.room(Vec3::new(-2.0, -1.0, -2.0), Vec3::new(1.5, 1.5, 3.0), materials);
    let view = view(25.0, 10.0);
    let screen_half_extent = Vec2::new(0.5, 0.5);
    Case {
        name: "glowing room, gaze at the eye",
        scene: builder.build(),
        position: Vec3::ZERO,
        max_bounces: 3,
        gaze: Gaze::Eye { on_screen: Vec2::new(0.1, -0.1), screen_half_extent, view },
        view,
        samples: [1 << 14, 1 << 14, 1 << 16],
    }
}

fn textured_room(yaw_deg: f32, pitch_deg: f32) -> Case {
    let view = view(yaw_deg, pitch_deg);
    Case {
        name: "textured room",
        scene: scenes::textured_room(),
        position: Vec3::ZERO,
        max_bounces: 2,
        gaze: in_scene(&view),
        view,
        samples: [1 << 17, 1 << 18, 3 << 17],
    }
}

/// Under an even sky: a checkered floor, walls, a rough metal sphere and a Lambertian one.
fn terrace() -> Case {
    let view = view(180.0, 0.0);
    Case {
        name: "terrace, gaze on the seam",
        scene: scenes::terrace(),
        position: Vec3::ZERO,
        max_bounces: 3,
        gaze: in_scene(&view),
        view,
        samples: [1 << 15, 1 << 15, 1 << 17],
    }
}

/// Means of the blocks' luminance for each seed; `None` where a pixel has no sample.
fn renders(
    gpu: &Gpu,
    case: &Case,
    mode: Mode,
    plant: impl Fn(&ShaderSources) -> ShaderSources,
) -> Vec<Vec<Option<f64>>> {
    let inverse = device::inverse();
    let distribution = match mode {
        Mode::Omnidirectional => Distribution::omnidirectional(inverse),
        Mode::Viewport => Distribution::viewport(case.view, inverse),
        Mode::Foveated => Distribution::foveated(case.gaze, None, inverse),
    };
    (0..SEEDS)
        .map(|seed| {
            // Seeds differ between modes too, so that all renders are independent.
            let seed = 1000 * (mode as u32 + 1) + seed;
            let mut renderer =
                device::independent(gpu, FILM, seed, case.max_bounces, distribution.clone(), &case.scene);
            renderer.set_shaders(plant(renderer.shaders())).unwrap();
            renderer.set_pose(FilmPose { position: case.position, world_from_film: Quat::IDENTITY });
            let film = device::trace(&mut renderer, case.samples[mode as usize]).unwrap();
            assert_eq!(renderer.statistics().unwrap().non_finite, 0);
            let (columns, rows) = (FILM.width / BLOCK, FILM.height / BLOCK);
            (0..columns * rows)
                .map(|block| {
                    let (x0, y0) = (block % columns * BLOCK, block / columns * BLOCK);
                    let pixels = (0..BLOCK * BLOCK).map(|i| {
                        let (x, y) = (x0 + i % BLOCK, y0 + i / BLOCK);
                        let pixel = film.pixel((y * FILM.width + x) as usize);
                        let [r, g, b] = pixel.mean;
                        (pixel.samples > 0).then_some(0.2126 * r + 0.7152 * g + 0.0722 * b)
                    });
                    let sum: Option<f64> = pixels.sum();
                    sum.map(|sum| sum / f64::from(BLOCK * BLOCK))
                })
                .collect()
        })
        .collect()
}

struct Comparison {
    /// Blocks that could be compared.
    blocks: usize,
    /// Least p-value, of the blocks and of their mean, after Šidák's correction.
    p: f64,
    /// Standard error of the median block, relative, in each of the two modes.
    median_errors: [f64; 2],
}

fn compare(what: &str, a: &[Vec<Option<f64>>], b: &[Vec<Option<f64>>]) -> Comparison {
    let of_block = |renders: &[Vec<Option<f64>>], block: usize| -> Option<Vec<f64>> {
        renders.iter().map(|render| render[block]).collect()
    };
    let pairs: Vec<(Vec<f64>, Vec<f64>)> =
        (0..a[0].len()).filter_map(|block| Some((of_block(a, block)?, of_block(b, block)?))).collect();
    assert!(!pairs.is_empty(), "{what}: no block has samples in every pixel");
    let mut p_values = Vec::new();
    let mut errors = [Vec::new(), Vec::new()];
    let mut means = [vec![0.0; a.len()], vec![0.0; b.len()]];
    for (a, b) in &pairs {
        p_values.push(statistics::welch_p(a, b));
        let (mean_a, error_a) = statistics::mean_and_error(a);
        let (mean_b, error_b) = statistics::mean_and_error(b);
        let level = 0.5 * (mean_a + mean_b);
        errors[0].push(error_a / level);
        errors[1].push(error_b / level);
        for (sums, values) in means.iter_mut().zip([a, b]) {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += value / level;
            }
        }
    }
    p_values.push(statistics::welch_p(&means[0], &means[1]));
    let common = statistics::mean_and_error(&means[0]).0 / statistics::mean_and_error(&means[1]).0 - 1.0;
    let least = p_values.iter().copied().fold(1.0, f64::min);
    let tests = p_values.len() as f64;
    // 1 - (1 - p)^tests, without cancellation.
    let p = -((-least).ln_1p() * tests).exp_m1();
    let median_errors = errors.map(|errors| statistics::median(&errors));
    eprintln!(
        "{what}: {} blocks, corrected p = {p:.2e}, common difference {:+.3} %, median standard errors {:.3} % and {:.3} %",
        pairs.len(),
        common * 100.0,
        median_errors[0] * 100.0,
        median_errors[1] * 100.0
    );
    Comparison { blocks: pairs.len(), p, median_errors }
}

fn assert_modes_agree(case: &Case) {
    let gpu = device::gpu();
    let render = |mode| renders(&gpu, case, mode, Clone::clone);
    let foveated = render(Mode::Foveated);
    let blocks = (FILM.width / BLOCK * (FILM.height / BLOCK)) as usize;
    for (mode, least_blocks) in [(Mode::Omnidirectional, blocks / 2), (Mode::Viewport, 2)] {
        let comparison = compare(&format!("{}: {mode:?} and FV", case.name), &render(mode), &foveated);
        assert!(comparison.p > SIGNIFICANCE, "{mode:?} and FV differ in {}", case.name);
        assert!(comparison.blocks >= least_blocks, "{} blocks are too few", comparison.blocks);
        assert!(comparison.median_errors.iter().all(|&e| e <= LARGEST_MEDIAN_ERROR), "too few samples for the claim");
    }
}

#[test]
fn modes_agree_at_an_ordinary_gaze() {
    let _time = device::Stopwatch::start("glowing room");
    assert_modes_agree(&glowing_room());
}

#[test]
fn modes_agree_near_the_pole() {
    let _time = device::Stopwatch::start("textured room");
    assert_modes_agree(&textured_room(60.0, 85.0));
}

#[test]
fn modes_agree_on_the_seam() {
    let _time = device::Stopwatch::start("terrace");
    assert_modes_agree(&terrace());
}

fn assert_noticed(case: &Case, fault: impl Fn(&ShaderSources) -> ShaderSources) {
    let gpu = device::gpu();
    let foveated = renders(&gpu, case, Mode::Foveated, fault);
    for mode in [Mode::Omnidirectional, Mode::Viewport] {
        let comparison =
            compare(&format!("fault: {mode:?} and FV"), &renders(&gpu, case, mode, Clone::clone), &foveated);
        assert!(comparison.p < SIGNIFICANCE, "{mode:?} and FV agree in spite of the fault");
    }
}

/// Where the density is a factor of the estimate, a density wrong by 2 % in one layer scales that layer's radiance.
#[test]
fn a_density_wrong_by_2_percent_in_one_layer_is_noticed() {
    let _time = device::Stopwatch::start("planted density");
    let case = glowing_room();
    assert_noticed(&case, |sources| {
        exchanged(
            sources,
            "path::start",
            &[
                (
                    "path.pixel = choose_pixel(first_random_2(&random), random);",
                    "let first = first_random_2(&random);\n    path.pixel = choose_pixel(first, random);",
                ),
                (
                    "path.throughput = vec3f(1.0);",
                    "let is_first = batch.layer_count > 1u && first.x < batch.layers[0].cumulative;
    path.throughput = vec3f(select(1.0, 1.02, is_first));",
                ),
            ],
        )
    });
}

/// A sample that stays where the density put it, instead of anywhere in its pixel, weights the pixel by the density.
#[test]
fn a_position_drawn_by_the_density_is_noticed() {
    let _time = device::Stopwatch::start("planted position");
    // At the lamp, whose edge is where density and radiance fall together.
    let case = Case { samples: [1 << 15, 1 << 15, 1 << 16], ..textured_room(0.0, 60.0) };
    assert_noticed(&case, |sources| {
        exchanged(
            sources,
            "path::start",
            &[
                (
                    "path.pixel = choose_pixel(first_random_2(&random), random);",
                    "let first = first_random_2(&random);\n    path.pixel = choose_pixel(first, random);",
                ),
                (
                    "import package::sampling::distribution::choose_pixel;",
                    "import package::sampling::distribution::{choose_pixel, layer_direction};",
                ),
                (
                    "let direction = batch.world_from_film * direction_of_film(corner_of_pixel(path.pixel) + place);",
                    "let direction = batch.world_from_film * normalize(layer_direction(0u, first));",
                ),
            ],
        )
    });
}
