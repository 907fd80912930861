//! The numbers that a sample's path draws: in OD each film pixel is a stratum, so the samples of a pixel must be as even among
//! themselves as a (0, 2)-sequence is, in every pair, whatever their number in the whole film. Over a list of pixels one is a few
//! strata.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_tests::{
    device,
    plant::{exchanged, instead_of_paths},
    scenes,
};
use glam::Vec3;
use tracer::{
    distribution::{Distribution, Layer},
    film::FilmOptions,
    kernels::ShaderSources,
    renderer::{Renderer, RendererOptions, SequenceKind, StopCondition},
};

/// 2^9 strata.
const FILM: FilmOptions = FilmOptions::equirect(32, 16);
const PER_PIXEL: u32 = 64;

/// Root mean square error of the pixels' means of three numbers whose mean is a half: the first number of the second pair (the place
/// in the pixel), of the third, and whether a point of the fourth lies below the diagonal.
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
    let place = next_random_2(&random);
    let second = next_random_2(&random);
    let third = next_random_2(&random);
    radiance = vec3f(place.x, second.x, select(0.0, 1.0, third.x < third.y));";
    let imports = "import package::sampling::random::{start_random, first_random_2, next_random_2};
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
