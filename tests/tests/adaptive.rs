//! Adaptive sampling: the guide's densities, means that stay unbiased while the guide does not depend on them, films that do not
//! depend on the batches, and gazes that move.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f32::consts::FRAC_PI_4;

use fovea_tests::{device, plant::exchanged, scenes, statistics};
use glam::{Quat, Vec3};
use tracer::{
    distribution::{Distribution, Gaze},
    film::{FilmOptions, FilmSnapshot},
    gpu::Gpu,
    guide::{FLOOR, GUIDE_COLUMNS_PER_ROW, Guide},
    kernels::ShaderSources,
    renderer::{FIRST_BATCH, Renderer, RendererOptions, SequenceKind, StopCondition},
};

const FILM: FilmOptions = FilmOptions::equirect(64, 32);
/// Chance that a correct program fails a statistical test here.
const SIGNIFICANCE: f64 = 1e-3;
/// What a fault must fall below.
const NOTICED: f64 = 1e-6;

fn foveated(direction: Vec3) -> Distribution {
    Distribution::foveated(Gaze::Scene { direction }, None, device::inverse())
}

fn room(gpu: &Gpu, seed: u32) -> Renderer {
    let options = RendererOptions { film: FILM, max_bounces: 2, seed, sequence: SequenceKind::Sobol };
    let mut renderer = Renderer::new(gpu, &options, foveated(Vec3::NEG_Z)).unwrap();
    renderer.set_scene(&scenes::textured_room()).unwrap();
    renderer
}

/// Weights between nothing and a hundredfold, differing from cell to cell.
fn uneven(rows: u32) -> Guide {
    let cells = GUIDE_COLUMNS_PER_ROW * rows * rows;
    let weights: Vec<f32> = (0..cells).map(|cell| ((cell * 7919 % 101) as f32 / 10.0).powi(2)).collect();
    Guide::from_weights(&weights, rows).unwrap()
}

/// p-value of the counts of a film of OD whose cells are to have these densities.
fn fit(film: &FilmSnapshot, densities: &[f32], rows: u32) -> f64 {
    let columns = rows * GUIDE_COLUMNS_PER_ROW;
    let mut counts = vec![0.0; densities.len()];
    for (index, pixel) in film.pixels().enumerate() {
        let (x, y) = (index as u32 % FILM.width * columns / FILM.width, index as u32 / FILM.width * rows / FILM.height);
        counts[(x * rows + y) as usize] += f64::from(pixel.samples);
    }
    let total: f64 = counts.iter().sum();
    let expected: Vec<f64> = densities.iter().map(|d| f64::from(*d) * total / densities.len() as f64).collect();
    statistics::chi_squared_test(&counts, &expected).0
}

#[test]
fn a_guide_gives_each_cell_its_density_and_the_least_its_floor() {
    let _time = device::Stopwatch::start("densities");
    let gpu = device::gpu();
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut renderer = device::independent(&gpu, FILM, 5, 0, everywhere, &scenes::empty(Vec3::ONE));
    let guide = uneven(8);
    let densities = guide.densities();
    let least = densities.iter().copied().fold(f32::MAX, f32::min);
    assert!((least - FLOOR).abs() < 1e-3, "the least density is {least}");
    renderer.set_guide(Some(guide));
    let film = device::trace(&mut renderer, 1 << 18).unwrap();
    assert!(fit(&film, &densities, 8) > SIGNIFICANCE);
    assert!(fit(&film, &[1.0; 256], 8) < NOTICED, "this test notices other densities");
    assert_eq!(film.header.statistics.steered, 0, "nobody's samples decided where these went");
    renderer.set_guide(None);
    renderer.restart();
    let even = device::trace(&mut renderer, 1 << 18).unwrap();
    assert!(fit(&even, &[1.0; 256], 8) > SIGNIFICANCE);
}

/// Mean luminance about the gaze and farther away, seed by seed, of films that `guided` has a hand in.
fn means(gpu: &Gpu, seeds: std::ops::Range<u32>, mut guided: impl FnMut(&mut Renderer)) -> [Vec<f64>; 2] {
    let mut renderer = room(gpu, 0);
    let mut means = [Vec::new(), Vec::new()];
    for seed in seeds {
        renderer.set_randomness(seed, SequenceKind::Independent);
        guided(&mut renderer);
        let film = device::trace(&mut renderer, 1 << 14).unwrap();
        for (means, rows) in means.iter_mut().zip([14..18, 11..14]) {
            let pixels = rows.flat_map(|y| (26..38).map(move |x| y * 64 + x));
            let known: Vec<f64> =
                pixels.map(|index| film.pixel(index)).filter(|p| p.samples > 0).map(|p| p.luminance()).collect();
            means.push(known.iter().sum::<f64>() / known.len() as f64);
        }
    }
    means
}

/// Least p-value of the two regions, corrected for their number.
fn least_p(a: &[Vec<f64>; 2], b: &[Vec<f64>; 2]) -> f64 {
    let least = a.iter().zip(b).map(|(a, b)| statistics::welch_p(a, b)).fold(1.0, f64::min);
    for (a, b) in a.iter().zip(b) {
        let ((a, error_a), (b, error_b)) = (statistics::mean_and_error(a), statistics::mean_and_error(b));
        eprintln!("{:+.3} % +- {:.3} %", 100.0 * (a / b - 1.0), 100.0 * error_a.hypot(error_b) / b);
    }
    1.0 - (1.0 - least).powi(2)
}

#[test]
fn means_stay_unbiased_while_another_film_steers_and_a_weighted_sample_is_noticed() {
    let _time = device::Stopwatch::start("unbiased");
    let gpu = device::gpu();
    let plain = means(&gpu, 100..124, |_| {});
    // The steering film has other seeds; a guide of its own for each film that is shown.
    let mut steering = room(&gpu, 0);
    let mut steer = |seed: &mut u32, shown: &mut Renderer| {
        *seed += 1;
        steering.set_randomness(*seed, SequenceKind::Independent);
        device::trace(&mut steering, 1 << 12).unwrap();
        shown.set_guide(steering.measure_guide().unwrap());
        let densities = shown.guide().unwrap().densities();
        assert!(densities.iter().any(|d| *d > 1.3) && densities.iter().any(|d| *d < 0.8), "the noise is uneven");
    };
    let mut seed = 1000;
    let guided = means(&gpu, 200..224, |shown| steer(&mut seed, shown));
    let p = least_p(&guided, &plain);
    assert!(p > SIGNIFICANCE, "p = {p}");

    // A sample weighted by where the guide put it: what an estimator that needs the density would get wrong.
    let weighted = |sources: &ShaderSources| {
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
                    "path.throughput = vec3f(select(1.0, 1.05, guided(first).x > first.x));",
                ),
                (
                    "import package::sampling::distribution::choose_pixel;",
                    "import package::sampling::distribution::choose_pixel;\nimport package::sampling::guide::guided;",
                ),
            ],
        )
    };
    let faulty = means(&gpu, 200..224, |shown| {
        shown.set_shaders(weighted(&ShaderSources::new(&device::inverse()))).unwrap();
        shown.set_guide(Some(uneven(8)));
    });
    let p = least_p(&faulty, &plain);
    assert!(p < NOTICED, "p = {p} in spite of the fault");
}

#[test]
fn adaptive_films_do_not_depend_on_the_batches_and_say_what_they_are() {
    let _time = device::Stopwatch::start("batches");
    let gpu = device::gpu();
    let mut renderer = room(&gpu, 3);
    let plain = device::trace(&mut renderer, 20_000).unwrap();
    renderer.set_adaptive(true);
    renderer.restart();
    let whole = device::trace(&mut renderer, 20_000).unwrap();
    assert_ne!(whole.words, plain.words, "samples go elsewhere");
    // Four samples a pixel at the gaze come first: 4 x 2048 / 60.5, in powers of two.
    assert_eq!((whole.header.statistics.steered, plain.header.statistics.steered), (20_000 - 256, 0));
    for batch in [64, 1000, 5000] {
        renderer.restart();
        while renderer.samples() < 20_000 {
            renderer.trace(batch.min((20_000 - renderer.samples()) as u32)).unwrap();
        }
        assert_eq!(renderer.snapshot().unwrap(), whole, "in batches of {batch}");
    }
    renderer.restart();
    renderer.render(StopCondition::Samples(20_000), |_| true).unwrap();
    assert_eq!(renderer.snapshot().unwrap(), whole, "in batches by the clock");

    // A film of both kinds says how many samples were steered, and a header that contradicts itself is refused.
    let mut sum = whole.clone();
    let other = {
        renderer.set_adaptive(false);
        renderer.set_randomness(4, SequenceKind::Sobol);
        device::trace(&mut renderer, 20_000).unwrap()
    };
    sum.merge(&other).unwrap();
    assert_eq!((sum.header.samples(), sum.header.statistics.steered), (40_000, 20_000 - 256));
    let mut impossible = whole.clone();
    impossible.header.statistics.steered = 20_001;
    assert!(impossible.check().unwrap_err().to_string().contains("20001"));
    assert!(sum.merge(&impossible).is_err());
    renderer.set_randomness(3, SequenceKind::Sobol);
    renderer.restore(&whole).unwrap();
    assert_eq!(renderer.statistics().unwrap().steered, 20_000 - 256);
}

#[test]
fn a_gaze_that_moves_drops_the_guide_and_what_is_known_there_makes_a_new_one() {
    let gpu = device::gpu();
    let mut renderer = room(&gpu, 3);
    renderer.set_adaptive(true);
    let elsewhere = Quat::from_rotation_y(FRAC_PI_4) * Vec3::NEG_Z;
    device::trace(&mut renderer, 128).unwrap();
    renderer.set_distribution(foveated(elsewhere)).unwrap();
    device::trace(&mut renderer, 128).unwrap();
    assert!(renderer.guide().is_none() && renderer.statistics().unwrap().steered == 0, "too little is known");
    device::trace(&mut renderer, 1 << 14).unwrap();
    let first = renderer.guide().unwrap().clone();
    renderer.set_distribution(foveated(Vec3::NEG_Z)).unwrap();
    assert!(renderer.guide().is_none(), "it was for another gaze");
    // The film is there: the noise about the new gaze is judged as soon as the gaze has rested.
    device::trace(&mut renderer, FIRST_BATCH.into()).unwrap();
    assert!(renderer.guide().is_none(), "a gaze that moves costs nothing");
    let before = renderer.statistics().unwrap();
    renderer.trace(64).unwrap();
    let second = renderer.guide().unwrap().clone();
    assert_ne!(second, first);
    assert_eq!(renderer.statistics().unwrap().steered, before.steered + 64);
    renderer.restart();
    assert!(renderer.guide().is_none() && renderer.statistics().unwrap().steered == 0);
    renderer.set_adaptive(false);
    let plain = device::trace(&mut renderer, 4096).unwrap();
    assert_eq!(plain, device::trace(&mut room(&gpu, 3), 4096).unwrap(), "off is as if it had never been");
}
