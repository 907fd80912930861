//! Adaptive sampling: the guide's densities, means that stay unbiased while the guide does not depend on them, films that do not
//! depend on the batches, and gazes that move.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f32::consts::{FRAC_PI_4, PI, TAU};

use fovea_sampler::Inverse;
use fovea_tests::{device, plant::exchanged, scenes, statistics};
use glam::{Mat3, Quat, Vec3};
use tracer::{
    distribution::{Distribution, Gaze, gaze_frame},
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
    let densities = guide.densities().to_vec();
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

/// A place in FV's unit square: how far up in the radial inverse's range a direction lies, and its azimuth in turns. The gaze's frame
/// is twisted against the film's.
fn place_about_gaze(d: Vec3, frame: &Mat3, inverse: &Inverse) -> [f32; 2] {
    let local = frame.transpose() * d;
    let versine = 0.5 * (d - frame.z_axis).length_squared();
    let (mut low, mut high) = (0.0f32, 1.0f32);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if inverse.eval_versine(middle) < versine { low = middle } else { high = middle }
    }
    [low, (local.y.atan2(local.x) / TAU).rem_euclid(1.0)]
}

/// Pixels about the gaze are chosen from a table, all others by the layer: one guide is for both. Counts of FV with a guide against
/// counts without, times the densities of the pixels' cells. The last of nine groups has all pixels that are not wholly within cells of
/// one density.
#[test]
fn a_guide_moves_samples_of_the_table_about_the_gaze_as_well_as_of_the_layer() {
    const FILM: FilmOptions = FilmOptions::equirect(512, 256);
    const ROWS: u32 = 8;
    const COLUMNS: u32 = ROWS * GUIDE_COLUMNS_PER_ROW;
    /// Plain samples over guided ones.
    const PLAIN: u64 = 4;
    let _time = device::Stopwatch::start("densities about the gaze");
    let gpu = device::gpu();
    let inverse = device::inverse();
    let gaze = Vec3::new(0.3, 0.2, -1.0).normalize();
    let mut renderer = device::independent(&gpu, FILM, 5, 0, foveated(gaze), &scenes::empty(Vec3::ONE));
    let plain = device::trace(&mut renderer, PLAIN << 18).unwrap();
    // A density for each quarter of the azimuth in each half of the samples: the nearer half is the table's and some of the layer's.
    let group = |[x, y]: [f32; 2]| 4 * usize::from(x >= 0.5) + (4.0 * y) as usize;
    let weight = |cell: u32| {
        let place = [(cell / ROWS) as f32 + 0.5, (cell % ROWS) as f32 + 0.5];
        [8.0, 1.0, 3.0, 0.0, 1.0, 4.0, 0.0, 2.0][group([place[0] / COLUMNS as f32, place[1] / ROWS as f32])]
    };
    let weights: Vec<f32> = (0..COLUMNS * ROWS).map(weight).collect();
    let guide = Guide::from_weights(&weights, ROWS).unwrap();
    let densities: Vec<f64> =
        (0..8).map(|k| f64::from(guide.densities()[(16 * (k / 4) * ROWS + 2 * (k % 4)) as usize])).collect();
    renderer.restart();
    renderer.set_guide(Some(guide));
    let guided = device::trace(&mut renderer, 1 << 18).unwrap();

    let frame = gaze_frame(gaze);
    let is_near = |place: [f32; 2]| (place[0] - 0.5).abs() < 1.0 / COLUMNS as f32;
    let mut sums = [[0.0; 2]; 9];
    for (index, (with, without)) in (0..).zip(guided.pixels().zip(plain.pixels())) {
        let (x, y) = ((index % FILM.width) as f32, (index / FILM.width) as f32);
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[dx, dy]| {
            let (sin, cos) = (TAU * ((x + dx) / FILM.width as f32 - 0.5)).sin_cos();
            let (up, across) = (PI * (0.5 - (y + dy) / FILM.height as f32)).sin_cos();
            place_about_gaze(Vec3::new(across * sin, up, -across * cos), &frame, &inverse)
        });
        let groups = corners.map(group);
        let is_whole = groups.iter().all(|&other| other == groups[0]) && !corners.iter().any(|&place| is_near(place));
        let sums = &mut sums[if is_whole { groups[0] } else { 8 }];
        sums[0] += f64::from(with.samples);
        sums[1] += f64::from(without.samples) / PLAIN as f64;
    }
    let p = |densities: &[f64]| {
        let of_group = |(&[with, without], density): (&[f64; 2], &f64)| {
            let expected = density * without;
            (with - expected).powi(2) / (expected + density * expected / PLAIN as f64)
        };
        statistics::chi_squared_p(sums.iter().zip(densities).map(of_group).sum(), 8)
    };
    assert!(sums[..8].iter().all(|[_, without]| *without > 2000.0), "too few pixels in a group: {sums:?}");
    eprintln!("{sums:?} by {densities:?}: p = {}", p(&densities));
    assert!(p(&densities) > SIGNIFICANCE);
    let mut others = densities.clone();
    others[0] *= 1.05;
    assert!(p(&others) < NOTICED, "this test notices a density that is 5 % off");
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

    // A sample weighted by where it was put: what an estimator that needs the density would get wrong.
    let weighted = |sources: &ShaderSources| {
        let fault = "path.throughput = vec3f(select(1.0, 1.05, path.pixel % 2u == 0u));";
        exchanged(sources, "path::start", &[("path.throughput = vec3f(1.0);", fault)])
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
