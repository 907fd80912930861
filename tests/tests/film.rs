//! The film's integers: independent of batches and slabs, exact against a twin in u128, closed to what is not finite.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_sampler::sequence;
use fovea_tests::{device, plant::instead_of_paths, scenes};
use glam::Vec3;
use tracer::{
    distribution::Distribution,
    film::{FilmOptions, FilmSnapshot},
    gpu::Gpu,
    kernels::FILM_WORDS,
    renderer::{LARGEST_BATCH, Renderer, RendererOptions, SequenceKind},
};

/// Quanta per unit of radiance and of luminance in a scene whose brightest source is 1.
const RADIANCE_SCALE: f64 = 17_179_869_184.0;
const LUMINANCE_SCALE: f64 = 268_435_456.0;
/// The largest sample: 2^38 quanta; the largest luminance as the shader states it.
const LARGEST_SAMPLE: f32 = 274_877_906_944.0;
const LARGEST_LUMINANCE: f32 = 4_294_967_040.0;
/// Below it the square is rounded instead of the luminance.
const SMALL_LUMINANCE: f32 = 4096.0;

fn renderer(gpu: &Gpu, film: FilmOptions, sequence: SequenceKind) -> Renderer {
    let options = RendererOptions { film, max_bounces: 4, seed: 7, sequence };
    Renderer::new(gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap()
}

fn planted(gpu: &Gpu, film: FilmOptions, imports: &str, items: &str, body: &str) -> Renderer {
    let mut renderer = renderer(gpu, film, SequenceKind::Sobol);
    instead_of_paths(&mut renderer, Clone::clone, [imports, items, body]);
    renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
    renderer
}

#[test]
fn bytes_do_not_depend_on_batches_or_runs() {
    let _time = device::Stopwatch::start("batch sizes");
    let gpu = device::gpu();
    let scene = scenes::textured_room();
    let samples = 3 << 15;
    for sequence in [SequenceKind::Sobol, SequenceKind::Independent] {
        let render = |batch: u32| {
            let mut renderer = renderer(&gpu, FilmOptions::equirect(64, 32), sequence);
            renderer.set_scene(&scene).unwrap();
            let mut batches = 0;
            while renderer.samples() < samples {
                renderer.trace(batch.min((samples - renderer.samples()) as u32)).unwrap();
                batches += 1;
            }
            (renderer.snapshot().unwrap(), renderer.statistics().unwrap(), batches)
        };
        let reference = render(LARGEST_BATCH);
        assert!(reference.0.pixels().all(|p| p.samples > 0), "the comparison would say little");
        for batch in [LARGEST_BATCH, 1 << 13, 1 << 10] {
            let other = render(batch);
            eprintln!("{sequence:?}: {} batches", other.2);
            assert_eq!(other.0.words, reference.0.words, "{sequence:?}, batches of {batch}");
            assert_eq!(other.1, reference.1);
        }
        // Another seed does change it.
        let options = RendererOptions { seed: 8, ..*renderer(&gpu, FilmOptions::equirect(64, 32), sequence).options() };
        let mut other = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
        other.set_scene(&scene).unwrap();
        assert_ne!(device::trace(&mut other, samples).unwrap().words, reference.0.words);
    }
}

/// What the shader adds, in exact arithmetic.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
struct Sums {
    rgb: [u128; 3],
    samples: u32,
    squares: u128,
}

impl Sums {
    fn add(&mut self, radiance: [f32; 3], index: u32, seed: u32) {
        let unit = |d: u32| sequence::to_unit_f32(sequence::independent(index, 0x40000 + d, seed));
        let quanta = |value: f32, dither: f32| {
            if value < 8_388_608.0 {
                (value.floor() as u128) + u128::from(dither < value - value.floor())
            } else {
                value as u128
            }
        };
        for (i, (sum, value)) in self.rgb.iter_mut().zip(radiance).enumerate() {
            *sum += quanta((value * RADIANCE_SCALE as f32).min(LARGEST_SAMPLE), unit(i as u32));
        }
        // Exact on every adapter while two of the three channels are zero.
        let luminance = 0.2126 * radiance[0] + 0.7152 * radiance[1] + 0.0722 * radiance[2];
        let scaled = luminance * LUMINANCE_SCALE as f32;
        self.samples += 1;
        self.squares += if scaled < SMALL_LUMINANCE {
            quanta(scaled * scaled, unit(3))
        } else {
            quanta(scaled.min(LARGEST_LUMINANCE), unit(3)).pow(2)
        };
    }

    fn of(snapshot: &FilmSnapshot, pixel: usize) -> Self {
        let words = &snapshot.words[pixel * FILM_WORDS as usize..][..FILM_WORDS as usize];
        let join = |parts: &[u32]| parts.iter().rev().fold(0u128, |sum, &word| sum << 32 | u128::from(word));
        Self {
            rgb: [join(&words[0..2]), join(&words[2..4]), join(&words[4..6])],
            samples: words[6],
            squares: join(&words[7..10]),
        }
    }
}

/// Two samples in three go to one pixel and are as large as the film holds, so that every carry happens; the others are
/// spread over all pixels and all magnitudes, so that dithering does.
#[test]
fn sums_are_exact_in_64_and_96_bits() {
    let _time = device::Stopwatch::start("exact sums");
    let gpu = device::gpu();
    let film = FilmOptions::equirect(64, 32);
    let mut renderer = planted(
        &gpu,
        film,
        "import package::sampler::hash_u32;",
        "// 2^(-13 - n) for n below 32, without the adapter's exp2.
fn power_of_two(n: u32) -> f32 {
    return bitcast<f32>((114u - n) << 23u);
}",
        "
    let h = hash_u32(index);
    var value = f32(h & 0xffffu) * power_of_two(h >> 27u);
    pixel = (h >> 16u) & 2047u;
    if index % 3u != 0u {
        pixel = 77u;
        value = 15.999999;
    }
    radiance[h % 3u] = value;
    rays = 2u | (1u << 16u);",
    );
    let samples = 3u32 << 19;
    let snapshot = device::trace(&mut renderer, u64::from(samples)).unwrap();
    assert_eq!((snapshot.header.radiance_scale, snapshot.header.luminance_scale), (RADIANCE_SCALE, LUMINANCE_SCALE));

    let mut expected = vec![Sums::default(); film.pixels() as usize];
    for index in 0..samples {
        let h = sequence::hash(index);
        let mut value = (h & 0xffff) as f32 * f32::from_bits((114 - (h >> 27)) << 23);
        let mut pixel = h >> 16 & 2047;
        if index % 3 != 0 {
            (pixel, value) = (77, 15.999_999);
        }
        let mut radiance = [0.0; 3];
        radiance[(h % 3) as usize] = value;
        expected[pixel as usize].add(radiance, index, 7);
    }
    for (pixel, expected) in expected.iter().enumerate() {
        assert_eq!(Sums::of(&snapshot, pixel), *expected, "pixel {pixel}");
    }
    let brightest = expected[77];
    eprintln!("largest sums: 2^{} and 2^{}", brightest.rgb[1].ilog2(), brightest.squares.ilog2());
    assert!(brightest.samples > 1_000_000 && brightest.rgb[1] >> 32 > 1 << 16 && brightest.squares >> 64 > 1 << 12);
    // The pixel's estimate follows from the words.
    let pixel = snapshot.pixel(77);
    let mean = brightest.rgb[1] as f64 / RADIANCE_SCALE / f64::from(brightest.samples);
    assert!((pixel.mean[1] / mean - 1.0).abs() < 1e-12 && pixel.samples == brightest.samples);
    let statistics = renderer.statistics().unwrap();
    assert_eq!((statistics.segments, statistics.shadow_rays), (2 * u64::from(samples), u64::from(samples)));
    assert_eq!((statistics.non_finite, statistics.clamped), (0, 0));
}

/// An error of the library, and the film that was there stays.
#[test]
fn a_film_that_is_no_picture_is_refused() {
    let gpu = device::gpu();
    let small = FilmOptions::equirect(8, 4);
    let mut renderer = renderer(&gpu, small, SequenceKind::Sobol);
    for (film, said) in [
        (FilmOptions::equirect(0, 8), "0x8 pixels"),
        (FilmOptions::equirect(8, 0), "8x0 pixels"),
        (FilmOptions::perspective(8, 0, 1.0), "8x0 pixels"),
        (FilmOptions::perspective(8, 8, 4.0), "half extents [-2.18"),
        (FilmOptions::perspective(8, 8, 0.0), "half extents [0.0, 0.0]"),
    ] {
        let options = RendererOptions { film, ..*renderer.options() };
        let distribution = renderer.distribution().clone();
        let made = Renderer::new(&gpu, &options, distribution).map(|_| ()).unwrap_err().to_string();
        let set = renderer.set_film(film).unwrap_err().to_string();
        assert!(made == set && made.contains(said), "{film:?}: {made}; {set}");
    }
    assert_eq!(renderer.options().film, small);
}

#[test]
fn what_is_not_finite_is_dropped_and_counted_and_what_is_too_bright_is_clamped() {
    let gpu = device::gpu();
    let mut renderer = planted(
        &gpu,
        FilmOptions::equirect(8, 4),
        "",
        "",
        "
    // Quiet and signalling NaN, both infinities, in each channel; then values beyond the film's range, and negative ones.
    pixel = index & 31u;
    radiance = vec3f(1.0);
    let kind = (index >> 5u) & 15u;
    if kind < 12u {
        let bits = array<u32, 4>(0x7fc00000u, 0x7f800001u, 0x7f800000u, 0xff800000u);
        radiance[kind % 3u] = bitcast<f32>(bits[kind & 3u]);
    } else if kind == 12u {
        radiance = vec3f(1e30, 0.0, 0.0);
    } else if kind == 13u {
        radiance = vec3f(-1.0, 1.0, 1.0);
    }",
    );
    let samples = 1u32 << 14;
    let snapshot = device::trace(&mut renderer, u64::from(samples)).unwrap();
    let statistics = renderer.statistics().unwrap();
    assert_eq!(statistics.samples, u64::from(samples));
    assert_eq!(statistics.non_finite, samples / 16 * 12);
    assert_eq!(statistics.clamped, samples / 16);
    let per_kind = f64::from(samples) / 32.0 / 16.0;
    for pixel in snapshot.pixels() {
        assert_eq!(f64::from(pixel.samples), 4.0 * per_kind);
        // 16 is the largest sample; a negative channel counts as 0.
        assert_eq!(pixel.mean, [(16.0 + 0.0 + 2.0) / 4.0, 3.0 / 4.0, 3.0 / 4.0]);
        assert!(pixel.variance_of_mean.is_finite());
    }
}

/// A film of three slabs on an adapter that binds 128 MiB; every sample finds its slab, also beside the cuts.
#[test]
fn a_film_of_several_slabs_is_one_film() {
    let _time = device::Stopwatch::start("slabs");
    let gpu = device::gpu();
    let film = FilmOptions::equirect(4096, 2048);
    let slabs = film.bytes().div_ceil(gpu.largest_binding());
    let rows_per_slab = gpu.largest_binding() / (u64::from(film.width) * u64::from(FILM_WORDS) * 4);
    eprintln!("{slabs} slabs of at most {rows_per_slab} rows");
    if gpu.is_software() {
        assert!(slabs >= 2, "the software adapter no longer cuts this film");
    }
    // The first 2^12 samples go to the pixels about the cuts, the others anywhere.
    let imports = "import package::sampler::hash_u32;";
    let body = format!(
        "
    let h = hash_u32(index);
    pixel = h % 8388608u;
    if index < 4096u {{
        let cut = {rows_per_slab}u * 4096u * (1u + (index & 1u));
        pixel = min(cut - 1024u + (index >> 1u), 8388607u);
    }}
    radiance = vec3f(f32(h >> 20u) * 0.00390625, 0.0, 0.0);"
    );
    let mut renderer = planted(&gpu, film, imports, "", &body);
    let samples = 1u32 << 18;
    let snapshot = device::trace(&mut renderer, u64::from(samples)).unwrap();
    let mut expected = vec![Sums::default(); film.pixels() as usize];
    for index in 0..samples {
        let h = sequence::hash(index);
        let mut pixel = h % 8_388_608;
        if index < 4096 {
            let cut = rows_per_slab as u32 * 4096 * (1 + (index & 1));
            pixel = (cut - 1024 + (index >> 1)).min(8_388_607);
        }
        expected[pixel as usize].add([(h >> 20) as f32 * 0.003_906_25, 0.0, 0.0], index, 7);
    }
    let wrong = (0..expected.len()).find(|&pixel| Sums::of(&snapshot, pixel) != expected[pixel]);
    assert_eq!(wrong, None);
    assert_eq!(snapshot.words.len() as u64 * 4, film.bytes());
}
