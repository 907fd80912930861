//! The numbers that a sample's path draws: in OD each film pixel is a stratum, so the samples of a pixel must be as even among
//! themselves as a (0, 2)-sequence is, in every pair, whatever their number in the whole film. Over a list of pixels one is a few
//! strata. About the gaze of FV each pixel numbers its samples.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_tests::{
    device,
    plant::{exchanged, instead_of_paths},
    scenes,
};
use glam::Vec3;
use tracer::{
    distribution::{Distribution, Gaze, Layer, film_direction},
    film::FilmOptions,
    kernels::ShaderSources,
    renderer::{Renderer, RendererOptions, SequenceKind, StopCondition},
};

/// 2^9 strata.
const FILM: FilmOptions = FilmOptions::equirect(32, 16);
const PER_PIXEL: u32 = 64;

/// Root mean square error of the pixels' means of three numbers whose mean is a half: the place in the pixel, the first vertex's
/// direction, and whether its point on a light lies below the diagonal.
fn errors(
    sequence: SequenceKind,
    distribution: Distribution,
    plant: impl Fn(&ShaderSources) -> ShaderSources,
) -> [f64; 3] {
    let gpu = device::gpu();
    let options = RendererOptions { film: FILM, max_bounces: 1, seed: 5, sequence };
    let mut renderer = Renderer::new(&gpu, &options, distribution).unwrap();
    let body = "    var random = start_random(invocation);
    pixel = choose_pixel(first_random_2(&random), random);
    let place = place_in_pixel(random);
    let vertex = next_vertex(&random);
    radiance = vec3f(place.x, vertex.direction.x, select(0.0, 1.0, vertex.light.x < vertex.light.y));";
    let imports = "import package::sampling::random::{start_random, first_random_2, place_in_pixel, next_vertex};
import package::sampling::distribution::choose_pixel;";
    instead_of_paths(&mut renderer, plant, [imports, "", body]);
    renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
    // Not a power of two of samples a pixel in one piece: batches may end anywhere.
    renderer.render(StopCondition::Samples(u64::from(PER_PIXEL) * FILM.pixels()), |_| true).unwrap();
    let film = renderer.snapshot().unwrap();
    let mut squares = [0.0; 3];
    for pixel in film.pixels() {
        for (square, mean) in squares.iter_mut().zip(pixel.mean) {
            *square += (mean - 0.5).powi(2);
        }
    }
    squares.map(|square| (square / FILM.pixels() as f64).sqrt())
}

/// Error of a mean of one random number in each of [`PER_PIXEL`] intervals.
fn even() -> f64 {
    (1.0 / 12.0 / f64::from(PER_PIXEL).powi(3)).sqrt()
}

fn everywhere() -> Distribution {
    Distribution::omnidirectional(device::inverse())
}

/// All pixels, but as a list of which the first number alone chooses.
#[test]
fn the_samples_of_a_listed_pixel_are_a_few_sequences() {
    let list: Arc<[u32]> = (0..FILM.pixels() as u32).collect();
    let listed = Distribution::mixture(vec![(1.0, Layer::Pixels(list))], device::inverse()).unwrap();
    let found = errors(SequenceKind::Sobol, listed, Clone::clone);
    let independent = (1.0 / 12.0 / f64::from(PER_PIXEL)).sqrt();
    eprintln!("{found:.5?}, independent numbers {independent:.5}");
    assert!(found[..2].iter().all(|found| *found < 0.2 * independent), "{found:?} of {independent}");
}

#[test]
fn the_samples_of_a_pixel_are_a_sequence() {
    let n = f64::from(PER_PIXEL);
    let uniform = (1.0 / 12.0 / n).sqrt();
    let indicator = (0.25 / n).sqrt();
    let independent = errors(SequenceKind::Independent, everywhere(), Clone::clone);
    let sobol = errors(SequenceKind::Sobol, everywhere(), Clone::clone);
    eprintln!("independent {independent:.5?}, Sobol {sobol:.5?}");
    // 512 pixels: a standard deviation is known to 3 %.
    for (found, expected) in independent.into_iter().zip([uniform, uniform, indicator]) {
        assert!((found / expected - 1.0).abs() < 0.12, "{found} for {expected}");
    }
    // One number in each of n intervals: sqrt(1 / 12 n^3) at most; hashes of a few rounds scramble the last bits alike in many
    // intervals, which halves it. Along the diagonal about sqrt(n) of n cells are undecided.
    for found in &sobol[..2] {
        assert!(*found < 1.12 * even(), "{found} of {}", even());
    }
    assert!(sobol[2] < 0.6 * indicator, "{} of {indicator}", sobol[2]);
}

/// A stratum's samples numbered by their place in the whole film: pixels get numbers that are far apart in the sequence.
#[test]
fn numbers_of_the_whole_film_are_noticed() {
    let [first, second, _] = errors(SequenceKind::Sobol, everywhere(), |sources| {
        exchanged(
            sources,
            "sampling::random",
            &[("(global.index >> all) | (batch.first_index_high << (32u - all))", "global.index")],
        )
    });
    assert!(first > 2.0 * even() && second > 2.0 * even(), "{first} {second} for {}", even());
}

/// A film on which a pixel's ten degrees cannot hide from the table, and a gaze near its middle.
const WIDE_FILM: FilmOptions = FilmOptions::equirect(512, 256);

fn looking() -> Distribution {
    let gaze = Gaze::Scene { direction: Vec3::new(0.3, 0.2, -1.0).normalize() };
    Distribution::foveated(gaze, None, device::inverse())
}

/// Samples, and sums of number and its square, of the pixels within five degrees of the gaze.
fn numbers_in_pixels(batches: &[u64], plant: impl Fn(&ShaderSources) -> ShaderSources) -> Vec<[f64; 3]> {
    let gpu = device::gpu();
    let options = RendererOptions { film: WIDE_FILM, max_bounces: 1, seed: 9, sequence: SequenceKind::Sobol };
    let mut renderer = Renderer::new(&gpu, &options, looking()).unwrap();
    // The film holds samples up to 16: numbers are below 2^12.
    let body = "    var random = start_random(invocation);
    pixel = choose_pixel(first_random_2(&random), random);
    let number = f32(random.index & 0xfffu) / 4096.0;
    radiance = vec3f(number, number * number, 0.0);";
    let imports = "import package::sampling::random::{start_random, first_random_2};
import package::sampling::distribution::choose_pixel;";
    instead_of_paths(&mut renderer, plant, [imports, "", body]);
    renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
    for samples in batches {
        renderer.render(StopCondition::Samples(*samples), |_| true).unwrap();
    }
    let film = renderer.snapshot().unwrap();
    let gaze = Vec3::new(0.3, 0.2, -1.0).normalize();
    let near = film.pixels().enumerate().filter(|(i, _)| {
        let i = *i as u32;
        film_direction(&WIDE_FILM, i % WIDE_FILM.width, i / WIDE_FILM.width).angle_between(gaze) < 5f32.to_radians()
    });
    near.map(|(_, pixel)| {
        let n = f64::from(pixel.samples);
        [n, pixel.mean[0] * n * 4096.0, pixel.mean[1] * n * 4096.0 * 4096.0]
    })
    .collect()
}

/// Whether the samples of most pixels are numbered 0, 1, 2, ... without gap or repetition, by the sums of numbers and of squares.
/// All but those at the table's rim, which samples from outside it reach too.
fn share_numbered(pixels: &[[f64; 3]]) -> f64 {
    let numbered = pixels.iter().filter(|[n, sum, squares]| {
        let (of_numbers, of_squares) = (n * (n - 1.0) / 2.0, (n - 1.0) * n * (2.0 * n - 1.0) / 6.0);
        *n > 8.0 && (sum - of_numbers).abs() < 0.01 && (squares - of_squares).abs() < 0.5
    });
    numbered.count() as f64 / pixels.len() as f64
}

#[test]
fn samples_of_a_pixel_near_the_gaze_are_numbered() {
    let _time = device::Stopwatch::start("numbers in the fovea");
    let samples = 150_000;
    let pixels = numbers_in_pixels(&[samples], Clone::clone);
    eprintln!(
        "{} pixels, {:.1} samples each",
        pixels.len(),
        pixels.iter().map(|p| p[0]).sum::<f64>() / pixels.len() as f64
    );
    assert!(pixels.len() > 100);
    assert_eq!(share_numbered(&pixels), 1.0);
    // However the render was cut.
    assert_eq!(numbers_in_pixels(&[1 << 12, 70_001, samples], Clone::clone), pixels);
    // Numbers of the strata about the gaze, which pixels cut through.
    let strata = numbers_in_pixels(&[samples], |sources| {
        exchanged(
            sources,
            "sampling::random",
            &[(
                "(*state).index = number_in_pixel(entry, global.index, hash_combine(global.seed, 0u));",
                "(*state).index += 0u;",
            )],
        )
    });
    assert!(share_numbered(&strata) < 0.05, "{}", share_numbered(&strata));
}
