//! Guided reconstruction of a view, of films whose noise is known: it keeps what is even, keeps the edges that the guides know, fills
//! holes, beats the film's own means at few samples, and becomes them with many. Faults that are planted are noticed.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_app::readback;
use fovea_tests::{device, plant::exchanged, scenes};
use glam::{Quat, Vec3};
use tracer::{
    distribution::{Distribution, View},
    film::{FilmOptions, SampleRange},
    kernels::layout::FirstHit,
    renderer::{FilmPose, Renderer},
    scene::Scene,
    view::{DebugView, ToneMap, ViewProjection, ViewSettings},
};

const SIZE: [u32; 2] = [96, 64];
const YFOV: f32 = 1.2;

fn settings(denoise: bool) -> ViewSettings {
    let half_height = 0.5 * YFOV;
    let half_width = (half_height.tan() * SIZE[0] as f32 / SIZE[1] as f32).atan();
    ViewSettings {
        projection: ViewProjection::Perspective(View::new(Quat::IDENTITY, 2.0 * half_width, 2.0 * half_height)),
        size: SIZE,
        exposure_ev: 0.0,
        tone_map: ToneMap::Linear,
        debug_view: DebugView::Beauty,
        fill: true,
        denoise,
        ring: None,
    }
}

/// A wall whose halves have different colours, and a floor.
fn room() -> Renderer {
    let mut scene = scenes::Builder::new(Vec3::ONE);
    let colors = [Vec3::new(0.8, 0.6, 0.4), Vec3::new(0.1, 0.2, 0.3), Vec3::splat(0.5)];
    let [light, dark, floor] = colors.map(|color| scene.material(scenes::lambert(color)));
    scene.quad(Vec3::new(-20.0, -1.0, -3.0), 20.0 * Vec3::X, 20.0 * Vec3::Y, light);
    scene.quad(Vec3::new(0.0, -1.0, -3.0), 20.0 * Vec3::X, 20.0 * Vec3::Y, dark);
    scene.quad(Vec3::new(-20.0, -1.0, 3.0), 40.0 * Vec3::X, -6.0 * Vec3::Z, floor);
    with_first_hits(&scene.build(), FilmOptions::perspective(SIZE[0], SIZE[1], YFOV))
}

fn with_first_hits(scene: &Scene, film: FilmOptions) -> Renderer {
    let distribution = Distribution::omnidirectional(device::inverse());
    let mut renderer = device::independent(&device::gpu(), film, 1, 1, distribution, scene);
    renderer.set_pose(FilmPose::default());
    while !renderer.trace_first_hits(&settings(true), u32::MAX).unwrap() {}
    renderer
}

/// Numbers in 0..1 (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Puts a film into the renderer. Of a pixel's samples, `lit` in 1 have all its light and the others none.
fn expose(renderer: &mut Renderer, truth: &[Vec3], lit: f64, mut samples: impl FnMut(&mut Random) -> u32) {
    let mut film = renderer.snapshot().unwrap();
    let mut random = Random(7);
    let mut total = 0;
    for (words, truth) in film.words.chunks_exact_mut(10).zip(truth) {
        let count = samples(&mut random);
        let lit_count = (0..count).filter(|_| random.next() < lit).count() as f64;
        let value = truth.as_dvec3() / lit;
        let sums = value.to_array().map(|channel| (channel * lit_count * film.header.radiance_scale).round() as u64);
        let luminance = value.dot(glam::DVec3::new(0.2126, 0.7152, 0.0722)) * film.header.luminance_scale;
        let squares = (luminance * luminance * lit_count).round() as u128;
        for (words, sum) in words.chunks_exact_mut(2).zip(sums) {
            words.copy_from_slice(&[sum as u32, (sum >> 32) as u32]);
        }
        words[6] = count;
        words[7..].copy_from_slice(&[squares as u32, (squares >> 32) as u32, (squares >> 64) as u32]);
        total += u64::from(count);
    }
    film.header.ranges = vec![SampleRange { seed: 1, first: 0, count: total.max(1) }];
    renderer.restore(&film).unwrap();
}

/// The view, linear.
fn shown(renderer: &mut Renderer, settings: &ViewSettings) -> Vec<Vec3> {
    readback::draw(renderer, settings).unwrap();
    let (size, texels) = renderer.presented_radiance().unwrap();
    assert_eq!(size, settings.size);
    texels.into_iter().map(|[r, g, b, _]| Vec3::new(r, g, b)).collect()
}

fn colors(renderer: &Renderer) -> Vec<Vec3> {
    renderer.first_hits().unwrap().iter().map(|hit| Vec3::from(hit.albedo)).collect()
}

/// Root mean square of the differences over the root mean square of the truth.
fn error(picture: &[Vec3], truth: &[Vec3]) -> f32 {
    let sum: f32 = picture.iter().zip(truth).map(|(a, b)| a.distance_squared(*b)).sum();
    (sum / truth.iter().map(|b| b.length_squared()).sum::<f32>()).sqrt()
}

/// With the passage of a module exchanged. A picture without guides drops what was made with the good one.
fn plant(renderer: &mut Renderer, module: &str, passage: (&str, &str)) {
    let sources = exchanged(renderer.shaders(), module, &[passage]);
    renderer.set_shaders(sources).unwrap();
    shown(renderer, &settings(false));
}

/// About a third of the pixels have samples.
fn sparse(random: &mut Random) -> u32 {
    u32::from(random.next() < 0.35)
}

#[test]
fn even_light_stays_even_whatever_it_falls_on() {
    let _time = device::Stopwatch::start("even light");
    let mut renderer = room();
    let truth = colors(&renderer);
    expose(&mut renderer, &truth, 1.0, sparse);
    let farthest = |renderer: &mut Renderer| {
        let picture = shown(renderer, &settings(true));
        picture.iter().zip(&truth).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
    };
    let difference = farthest(&mut renderer);
    eprintln!("even light: off by at most {difference:.1e}");
    assert!(difference < 1e-3, "{difference}");
    // The same film without guides bleeds over the edges, and so does one that is not divided by the colours.
    let plain = error(&shown(&mut renderer, &settings(false)), &truth);
    assert!(plain > 0.01, "{plain}");
    plant(&mut renderer, "view::tint", ("max(hit.albedo + hit.coat, vec3f(LEAST_TINT))", "vec3f(0.5)"));
    assert!(farthest(&mut renderer) > 0.05);
}

#[test]
fn light_does_not_leak_from_one_surface_to_another() {
    let _time = device::Stopwatch::start("edges");
    let mut renderer = room();
    let hits = renderer.first_hits().unwrap();
    let is_floor = |hit: &FirstHit| hit.world_normal().y > 0.5;
    // The floor is ten times as bright as its colour says, the wall half as bright.
    let truth: Vec<Vec3> =
        hits.iter().map(|hit| Vec3::from(hit.albedo) * if is_floor(hit) { 10.0 } else { 0.5 }).collect();
    expose(&mut renderer, &truth, 1.0, sparse);
    // Two rows of the wall above the floor.
    let width = SIZE[0] as usize;
    let edge: Vec<usize> =
        (0..hits.len() - 2 * width).filter(|&i| !is_floor(&hits[i]) && is_floor(&hits[i + 2 * width])).collect();
    assert_eq!(edge.len(), 2 * width);
    let leak = |renderer: &mut Renderer| {
        let picture = shown(renderer, &settings(true));
        edge.iter().map(|&i| (picture[i].y / truth[i].y - 1.0).abs()).sum::<f32>() / edge.len() as f32
    };
    let guided = leak(&mut renderer);
    eprintln!("light at the wall's foot is off by {:.1} % on average", 100.0 * guided);
    assert!(guided < 0.15, "{guided}");
    plant(&mut renderer, "view::guides", ("select(max(exp(-turn - lift), UNLIKE), 1.0, kind == KIND_NOTHING)", "1.0"));
    assert!(leak(&mut renderer) > 1.0);
}

#[test]
fn few_samples_are_smoothed_and_many_are_the_film() {
    let _time = device::Stopwatch::start("convergence");
    let mut renderer = room();
    // A pattern of light that no guide knows.
    let pattern = |index: usize| {
        let (x, y) = (index % SIZE[0] as usize, index / SIZE[0] as usize);
        if (x / 5 + y / 5) % 2 == 0 { 1.5 } else { 0.5 }
    };
    let truth: Vec<Vec3> = colors(&renderer).into_iter().enumerate().map(|(i, c)| c * pattern(i)).collect();
    let raw = ViewSettings { fill: false, ..settings(false) };
    let ratio = |renderer: &mut Renderer, samples: u32| {
        expose(renderer, &truth, 0.5, |_| samples);
        let guided = error(&shown(renderer, &settings(true)), &truth);
        let raw = error(&shown(renderer, &raw), &truth);
        eprintln!("{samples} samples a pixel: error {guided:.4} guided, {raw:.4} raw");
        guided / raw
    };
    let ratios: Vec<f32> = [1, 16, 64, 256, 4096, 1 << 14].map(|samples| ratio(&mut renderer, samples)).to_vec();
    assert!(ratios[0] < 0.65, "{ratios:?}");
    assert!(ratios.iter().all(|ratio| *ratio < 1.15), "{ratios:?}");
    assert!((0.9..1.01).contains(&ratios[5]), "{ratios:?}");
    // Without the detail of what is around, a pattern that is about as strong as the noise is taken for noise.
    plant(&mut renderer, "view::guided_push", ("max(around.detail, 0.0)", "0.0"));
    assert!(ratio(&mut renderer, 64) > 1.2);
    plant(&mut renderer, "view::guided_push", ("mix(around.light, own.xyz, share)", "around.light"));
    assert!(ratio(&mut renderer, 1 << 14) > 10.0);
}

/// Where one sample in fifty has all the light, most places have met none, and their samples agree that it is dark.
#[test]
fn rare_light_leaves_few_dark_places() {
    let _time = device::Stopwatch::start("rare light");
    let mut renderer = room();
    let truth = colors(&renderer);
    expose(&mut renderer, &truth, 0.02, |_| 4);
    let dark_share = |renderer: &mut Renderer| {
        let picture = shown(renderer, &settings(true));
        let dark = picture.iter().zip(&truth).filter(|(shown, truth)| shown.y < 0.5 * truth.y).count();
        dark as f32 / truth.len() as f32
    };
    let dark = dark_share(&mut renderer);
    plant(&mut renderer, "view::guided_push", ("view.level != 0u && n * around.variance > scatter", "false"));
    let planted = dark_share(&mut renderer);
    eprintln!(
        "less than half of the light: {:.1} % of the pixels; by their own variance {:.1} %",
        100.0 * dark,
        100.0 * planted
    );
    assert!(dark < 0.15 && planted > 0.2, "{dark}, {planted}");
}

/// Where many pixels of the view show one of the film, its samples are not as many for each of them.
#[test]
fn samples_of_a_film_that_is_coarser_than_the_view_count_once() {
    let _time = device::Stopwatch::start("coarse film");
    let mut scene = scenes::Builder::new(Vec3::ONE);
    let grey = scene.material(scenes::lambert(Vec3::splat(0.5)));
    scene.quad(Vec3::new(-20.0, -20.0, -3.0), 40.0 * Vec3::X, 40.0 * Vec3::Y, grey);
    let mut renderer = with_first_hits(&scene.build(), FilmOptions::perspective(SIZE[0] / 4, SIZE[1] / 4, YFOV));
    let even = |pixels: u32| vec![Vec3::splat(0.5); pixels as usize];
    expose(&mut renderer, &even(SIZE[0] * SIZE[1] / 16), 0.2, |_| 8);
    let noise = |renderer: &mut Renderer| error(&shown(renderer, &settings(true)), &even(SIZE[0] * SIZE[1]));
    let once = noise(&mut renderer);
    plant(&mut renderer, "view::gather", ("sum *= footprint.share;\n        squares *= footprint.share;", ""));
    let often = noise(&mut renderer);
    eprintln!("noise of an even wall: {once:.3}; with its samples counted by each pixel {often:.3}");
    assert!(once < 0.25 * often, "{once}, {often}");
}

#[test]
fn guides_are_of_the_picture_alone() {
    let mut renderer = room();
    let truth = colors(&renderer);
    expose(&mut renderer, &truth, 0.5, sparse);
    let film = renderer.snapshot().unwrap();
    let guided = shown(&mut renderer, &settings(true));
    assert_eq!(renderer.snapshot().unwrap(), film, "the film is only read");
    // Means as they are, and views of what is known, are not denoised.
    for debug_view in [DebugView::SampleDensity, DebugView::Error, DebugView::Stale] {
        let [with, without] = [true, false].map(|denoise| ViewSettings { debug_view, ..settings(denoise) });
        assert_eq!(readback::draw(&mut renderer, &with).unwrap(), readback::draw(&mut renderer, &without).unwrap());
    }
    let raw = ViewSettings { fill: false, ..settings(true) };
    assert!(!raw.uses_guides() && shown(&mut renderer, &raw) != guided);
    // Without guides the picture is what it is without denoising.
    let plain = shown(&mut renderer, &settings(false));
    assert!(renderer.first_hits().unwrap().is_empty() && plain != guided);
    // A film without a sample is black, and finite.
    expose(&mut renderer, &truth, 1.0, |_| 0);
    assert!(shown(&mut renderer, &settings(true)).iter().all(|color| *color == Vec3::ZERO));
}
