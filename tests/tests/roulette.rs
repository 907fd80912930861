//! Russian roulette whose numbers neighbours share: no bias, and pixels as noisy as the film says.
//!
//! In a closed room of one albedo and one emission the radiance is known, and without samples of lights nothing of a path counts but
//! the bounce after which roulette ends it: what a shared number does to a pixel shows here most.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_tests::{
    cycles::luminance,
    device,
    plant::exchanged,
    scenes::{Builder, emitter, lambert},
    statistics,
};
use glam::Vec3;
use tracer::{
    distribution::Distribution,
    film::FilmOptions,
    gpu::Gpu,
    kernels::ShaderSources,
    renderer::{Renderer, RendererOptions, SamplingTechnique},
    scene::{Material, Scene},
};

const ALBEDO: f32 = 0.6;
const EMISSION: f32 = 0.5;
const BOUNCES: u32 = 8;
const SEEDS: u32 = 16;
/// As many pixels as a block has samples: their neighbours' numbers are shared.
const SHARING: FilmOptions = FilmOptions::equirect(256, 128);
/// Many samples of a block in a pixel: none are shared.
const SMALL: FilmOptions = FilmOptions::equirect(16, 8);
const SAMPLES: u64 = 1 << 16;

fn room() -> Scene {
    let mut builder = Builder::new(Vec3::ZERO);
    let material = Material { double_sided: true, ..lambert(Vec3::splat(ALBEDO)) };
    let material = builder.material(Material { emission: emitter(Vec3::splat(EMISSION)).emission, ..material });
    builder.room(Vec3::NEG_ONE, Vec3::ONE, [material; 6]);
    builder.build()
}

/// Means of the film's renders, a seed each; and the variance of the pixels over the seeds beside what the films say of it, means
/// over the pixels.
fn measure(gpu: &Gpu, film: FilmOptions, plant: impl Fn(&ShaderSources) -> ShaderSources) -> (Vec<f64>, f64, f64) {
    let everywhere = Distribution::omnidirectional(device::inverse());
    let options = RendererOptions { film, max_bounces: BOUNCES, ..Default::default() };
    let mut renderer = Renderer::new(gpu, &options, everywhere).unwrap();
    renderer.set_shaders(plant(renderer.shaders())).unwrap();
    renderer.set_technique(SamplingTechnique::Bsdf).unwrap();
    renderer.set_scene(&room()).unwrap();
    let mut sums = vec![[0.0; 3]; film.pixels() as usize];
    let mut means = Vec::new();
    for seed in 0..SEEDS {
        renderer.set_randomness(seed, renderer.options().sequence);
        let snapshot = device::trace(&mut renderer, SAMPLES).unwrap();
        let mut sum = 0.0;
        for ([first, second, said], pixel) in sums.iter_mut().zip(snapshot.pixels()) {
            let luminance = luminance(pixel.mean);
            *first += luminance;
            *second += luminance * luminance;
            *said += pixel.variance_of_mean;
            sum += luminance;
        }
        means.push(sum / film.pixels() as f64);
    }
    let seeds = f64::from(SEEDS);
    let pixels = film.pixels() as f64;
    let found = sums.iter().map(|[first, second, _]| (second - first * first / seeds) / (seeds - 1.0)).sum::<f64>();
    (means, found / pixels, sums.iter().map(|[_, _, said]| said / seeds).sum::<f64>() / pixels)
}

fn expected() -> f64 {
    let (albedo, emission) = (f64::from(ALBEDO), f64::from(EMISSION));
    emission * (1.0 - albedo.powi(BOUNCES as i32 + 1)) / (1.0 - albedo)
}

#[test]
fn shared_numbers_leave_no_bias_and_pixels_as_noisy_as_the_film_says() {
    let gpu = device::gpu();
    for film in [SHARING, SMALL] {
        let (means, found, said) = measure(&gpu, film, Clone::clone);
        let (mean, error) = statistics::mean_and_error(&means);
        let sigmas = (mean - expected()) / error;
        let ratio = found / said;
        eprintln!(
            "{film:?}: {mean:.6} +- {error:.1e} of {:.6} ({sigmas:+.1}), variance over what is said {ratio:.3}",
            expected()
        );
        assert!(error < 2e-3 * mean, "too noisy for a claim: {error}");
        assert!(sigmas.abs() < 4.0, "{sigmas} standard errors");
        assert!((0.9..1.1).contains(&ratio), "{ratio}");
    }
}

#[test]
fn numbers_shared_within_a_pixel_and_weights_left_out_are_noticed() {
    let gpu = device::gpu();
    let within = |sources: &ShaderSources| {
        exchanged(sources, "sampling::random", &[("global.index >> batch.roulette_block_bits", "global.index >> 15u")])
    };
    let (_, found, said) = measure(&gpu, SMALL, within);
    eprintln!("shared within a pixel: variance over what is said {:.2}", found / said);
    assert!(found / said > 1.5);
    let unweighted = |sources: &ShaderSources| {
        exchanged(
            sources,
            "path::shade",
            &[("(*path).throughput /= survival;", "(*path).throughput /= sqrt(survival);")],
        )
    };
    let (means, ..) = measure(&gpu, SHARING, unweighted);
    let (mean, error) = statistics::mean_and_error(&means);
    assert!((mean - expected()).abs() > 10.0 * error, "{mean} +- {error}");
}
