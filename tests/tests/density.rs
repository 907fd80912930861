//! Where samples go: counts of the film's `samples` channel against the densities, integrated over every pixel.
//!
//! Chi-squared tests of independent samples at fixed seeds. The file's tests together reject a right program with
//! probability 1 % (Šidák over `TESTS`).
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_sampler::{
    Angle, Direction, EyeScreen, Film, GazeWarp, Geometry, Inverse, RadialDistribution, model::Reddy2001,
};
use fovea_tests::{device, scenes, statistics};
use glam::{Quat, Vec2, Vec3};
use tracer::{
    distribution::{Clip, Distribution, Gaze, Layer, View},
    film::FilmOptions,
    gpu::Gpu,
    renderer::{Renderer, RendererOptions, SequenceKind},
};

/// Chi-squared tests in this file.
const TESTS: usize = 15;
const FAMILY_SIGNIFICANCE: f64 = 0.01;
const SAMPLES: u64 = 1 << 21;

fn unit(yaw_deg: f64, pitch_deg: f64) -> Direction {
    let ((sin_yaw, cos_yaw), (sin_pitch, cos_pitch)) =
        (yaw_deg.to_radians().sin_cos(), pitch_deg.to_radians().sin_cos());
    [cos_pitch * sin_yaw, sin_pitch, -cos_pitch * cos_yaw]
}

fn vec3(d: Direction) -> Vec3 {
    glam::DVec3::from(d).as_vec3()
}

fn angle_deg(a: Direction, b: Direction) -> f64 {
    glam::DVec3::from(a).angle_between(glam::DVec3::from(b)).to_degrees()
}

/// Samples of each pixel.
fn counts(
    gpu: &Gpu,
    film: FilmOptions,
    (sequence, seed): (SequenceKind, u32),
    samples: u64,
    distribution: Distribution,
) -> Vec<f64> {
    let options = RendererOptions { film, max_bounces: 0, seed, sequence };
    let mut renderer = Renderer::new(gpu, &options, distribution).unwrap();
    renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
    let snapshot = device::trace(&mut renderer, samples).unwrap();
    snapshot.pixels().map(|pixel| f64::from(pixel.samples)).collect()
}

/// Probability of each pixel: the density per steradian at 8x8 positions times their solid angles. A panorama holds all.
fn probabilities(film: &Film, density: impl Fn(Direction) -> f64) -> Vec<f64> {
    const SIDE: u32 = 8;
    let [width, height] = film.size_px();
    let mut list = Vec::new();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let at = |pixel: u32, k: u32| f64::from(pixel) + (f64::from(k) + 0.5) / f64::from(SIDE);
        let positions = (0..SIDE * SIDE).map(|k| [at(x, k % SIDE), at(y, k / SIDE)]);
        let mass: f64 = positions.map(|p| density(film.direction(p)) * film.steradians_per_pixel(p)).sum();
        list.push(mass / f64::from(SIDE * SIDE));
    }
    if film.covers_sphere() {
        let sum: f64 = list.iter().sum();
        assert!((sum - 1.0).abs() < 5e-4, "the density integrates to {sum}");
        list.iter_mut().for_each(|mass| *mass /= sum);
    }
    list
}

/// Sums by ring: `ring` gives each pixel's ring; the last entry is what the film does not hold of `total`.
fn by_ring(values: &[f64], total: f64, rings: &[usize]) -> Vec<f64> {
    let mut sums = vec![0.0; rings.iter().max().unwrap() + 2];
    for (value, &ring) in values.iter().zip(rings) {
        sums[ring] += value;
    }
    *sums.last_mut().unwrap() = (total - values.iter().sum::<f64>()).max(0.0);
    sums
}

/// Radially and pixel by pixel; returns both p-values.
fn compare(what: &str, counts: &[f64], probabilities: &[f64], rings: &[usize]) -> [f64; 2] {
    let expected: Vec<f64> = probabilities.iter().map(|p| p * SAMPLES as f64).collect();
    let radial = statistics::chi_squared_test(
        &by_ring(counts, SAMPLES as f64, rings),
        &by_ring(&expected, SAMPLES as f64, rings),
    );
    let pixels: Vec<usize> = (0..counts.len()).collect();
    let single = statistics::chi_squared_test(
        &by_ring(counts, SAMPLES as f64, &pixels),
        &by_ring(&expected, SAMPLES as f64, &pixels),
    );
    for (kind, (p, statistic, freedom)) in [("radially", radial), ("by pixel", single)] {
        eprintln!("{what}, {kind}: chi-squared {statistic:.1} with {freedom} degrees of freedom, p = {p:.3}");
    }
    [radial.0, single.0]
}

fn assert_fits(p_values: [f64; 2]) {
    let least = statistics::sidak(FAMILY_SIGNIFICANCE, TESTS);
    assert!(p_values.iter().all(|&p| p > least), "p-values {p_values:?} are not all above {least:.1e}");
}

/// Rings one degree wide about the gaze by the pixels' centres.
fn rings(film: &Film, eccentricity_deg: impl Fn(Direction) -> f64) -> Vec<usize> {
    let [width, height] = film.size_px();
    let centres = (0..height).flat_map(|y| (0..width).map(move |x| film.pixel_direction([x, y])));
    centres.map(|d| eccentricity_deg(d) as usize).collect()
}

#[test]
fn foveated_over_omnidirectional_is_60_and_a_half_at_the_gaze() {
    let _time = device::Stopwatch::start("ratio");
    let gpu = device::gpu();
    let film = FilmOptions::equirect(512, 256);
    let twin = Film::equirectangular(512, 256).unwrap();
    let gaze = unit(40.0, 0.0);
    let near: Vec<usize> = rings(&twin, |d| angle_deg(d, gaze))
        .iter()
        .enumerate()
        .filter_map(|(pixel, &ring)| (ring < 4).then_some(pixel))
        .collect();
    let inverse = device::inverse();
    let share = |distribution| {
        let samples = 1 << 22;
        let counts = counts(&gpu, film, (SequenceKind::Sobol, 11), samples, distribution);
        near.iter().map(|&pixel| counts[pixel]).sum::<f64>() / samples as f64
    };
    let omnidirectional = share(Distribution::omnidirectional(inverse.clone()));
    let foveated = share(Distribution::foveated(Gaze::Scene { direction: vec3(gaze) }, None, inverse));
    let ratio = foveated / omnidirectional;
    let calculated = 63.4 / (1.0 + 23.684 * 0.002);
    eprintln!("{} pixels within 4 degrees: FV/OD = {ratio:.2}, calculated {calculated:.2}", near.len());
    assert!((ratio / 60.5 - 1.0).abs() < 0.03);
}

#[test]
fn eccentricity_in_the_scene_follows_the_acuity_model() {
    let _time = device::Stopwatch::start("scene eccentricity");
    let gpu = device::gpu();
    let twin = Film::equirectangular(256, 128).unwrap();
    let acuity = device::acuity();
    let plane = RadialDistribution::new(Reddy2001, Geometry::Plane, Angle::from_degrees(80.0), 0.002).unwrap();
    for (yaw, pitch, seed) in [(20.0, 10.0, 101), (180.0, -30.0, 102), (-100.0, 86.0, 103)] {
        let gaze = unit(yaw, pitch);
        let distribution = Distribution::foveated(Gaze::Scene { direction: vec3(gaze) }, None, device::inverse());
        let counts =
            counts(&gpu, FilmOptions::equirect(256, 128), (SequenceKind::Independent, seed), SAMPLES, distribution);
        let rings = rings(&twin, |d| angle_deg(d, gaze));
        let density = |of: &RadialDistribution, d| of.pdf(Angle::from_degrees(angle_deg(d, gaze)));
        let p =
            compare(&format!("gaze {yaw}, {pitch}"), &counts, &probabilities(&twin, |d| density(&acuity, d)), &rings);
        assert_fits(p);
        // The paper's planar density, which differs by a total variation of 3 %, does not fit.
        let planar = compare("planar model", &counts, &probabilities(&twin, |d| density(&plane, d)), &rings);
        assert!(planar.iter().all(|&p| p < 1e-12));
    }
}

/// Screen, lens and gaze: a desk monitor and a small close one, through a wide and a long lens; gaze near the centre and in
/// a corner, from where part of the distribution misses the screen's plane.
#[test]
fn eccentricity_at_the_eye_follows_the_acuity_model() {
    let _time = device::Stopwatch::start("eye eccentricity");
    let gpu = device::gpu();
    let acuity = device::acuity();
    let outer = acuity.outer_ratio() / (1.0 + acuity.outer_ratio());
    let capped = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.0).unwrap();
    let warp = GazeWarp::new(capped);
    let desk = ([600.0, 340.0], 650.0);
    let close = ([300.0, 200.0], 300.0);
    for ((size_mm, distance_mm), fov_deg, on_screen) in
        [(desk, 60.0, [0.2, -0.1]), (close, 60.0, [0.9, 0.8]), (desk, 12.0, [-0.5, 0.6]), (close, 12.0, [0.1, 0.0])]
    {
        let fov = Angle::from_degrees(fov_deg);
        let eye = EyeScreen::new(size_mm, distance_mm, fov).unwrap();
        let aspect = size_mm[0] / size_mm[1];
        let half_y = (0.5 * fov.radians()).tan();
        let turn = Quat::from_rotation_y(-0.7) * Quat::from_rotation_x(0.3);
        let view = View { world_from_view: turn, half_extent: Vec2::new((half_y * aspect) as f32, half_y as f32) };
        let half_extent = Vec2::new((size_mm[0] / distance_mm / 2.0) as f32, (size_mm[1] / distance_mm / 2.0) as f32);
        let gaze = Gaze::Eye {
            on_screen: Vec2::new(on_screen[0] as f32, on_screen[1] as f32),
            screen_half_extent: half_extent,
            view,
        };
        let scene_gaze = glam::DVec3::new(on_screen[0] * half_y * aspect, on_screen[1] * half_y, -1.0).normalize();
        // A panorama, or, through the long lens, a perspective film of three times the view, whose own frame is the view's.
        let is_wide = fov_deg > 30.0;
        let film_fov = Angle::from_radians(2.0 * (3.0 * half_y).atan());
        let (film, twin, world_from_film) = if is_wide {
            (FilmOptions::equirect(512, 256), Film::equirectangular(512, 256).unwrap(), Quat::IDENTITY)
        } else {
            let film = FilmOptions::perspective(192, 108, film_fov.radians() as f32);
            (film, Film::perspective(192, 108, film_fov).unwrap(), turn)
        };
        let view_from_film = (turn.inverse() * world_from_film).as_dquat();
        let in_view = |d: Direction| (view_from_film * glam::DVec3::from(d)).to_array();

        let options = RendererOptions { film, max_bounces: 0, seed: 5, sequence: SequenceKind::Independent };
        let distribution = Distribution::foveated(gaze, None, device::inverse());
        let mut renderer = Renderer::new(&gpu, &options, distribution).unwrap();
        renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
        renderer.set_pose(tracer::renderer::FilmPose { position: Vec3::ZERO, world_from_film });
        let snapshot = device::trace(&mut renderer, SAMPLES).unwrap();
        let counts: Vec<f64> = snapshot.pixels().map(|pixel| f64::from(pixel.samples)).collect();

        let missed = eye.miss_probability(&warp, scene_gaze.to_array());
        let floor = (outer + (1.0 - outer) * missed) / (4.0 * std::f64::consts::PI);
        let density = |d| (1.0 - outer) * eye.pdf(&warp, in_view(d), scene_gaze.to_array()) + floor;
        let eccentricity = |d| eye.eccentricity(in_view(d), scene_gaze.to_array()).map_or(170.0, Angle::degrees);
        let rings = rings(&twin, eccentricity);
        let what = format!("{size_mm:?} mm at {distance_mm} mm, lens of {fov_deg} degrees, gaze {on_screen:?}");
        eprintln!("misses: {missed:.4}, inside the film: {:.4}", counts.iter().sum::<f64>() / SAMPLES as f64);
        assert_fits(compare(&what, &counts, &probabilities(&twin, density), &rings));
        // Eccentricity in the scene is something else.
        let in_scene = |d| acuity.pdf(Angle::from_degrees(angle_deg(in_view(d), scene_gaze.to_array())));
        let wrong = compare("as if in the scene", &counts, &probabilities(&twin, in_scene), &rings);
        assert!(wrong.iter().all(|&p| p < 1e-12));
    }
}

/// A layer that uses the radial inverse up to its cap leaves the rest of the sphere alone.
#[test]
fn a_layer_without_its_floor_ends_at_the_cap() {
    let gpu = device::gpu();
    let inverse = device::inverse();
    let gaze = unit(0.0, 0.0);
    let layer = Layer::Acuity {
        gaze: Gaze::Scene { direction: vec3(gaze) },
        clip: None,
        radius_scale: Inverse::share_within_cap(&inverse) as f32,
    };
    let distribution = Distribution::mixture(vec![(1.0, layer)], Arc::clone(&inverse)).unwrap();
    let film = FilmOptions::equirect(128, 64);
    let counts = counts(&gpu, film, (SequenceKind::Independent, 11), 1 << 18, distribution);
    let twin = Film::equirectangular(128, 64).unwrap();
    let rings = rings(&twin, |d| angle_deg(d, gaze));
    let beyond: f64 = counts.iter().zip(&rings).filter(|(_, ring)| **ring >= 83).map(|(count, _)| count).sum();
    let inside: f64 = counts.iter().zip(&rings).filter(|(_, ring)| (70..78).contains(*ring)).map(|(c, _)| c).sum();
    assert!(inside > 1000.0 && beyond == 0.0, "{inside} samples at 70 to 78 degrees, {beyond} beyond 83");
}

/// Lists of pixels that random numbers or the device do not reach are refused when they are to be used; the film goes on without.
#[test]
fn lists_of_pixels_that_do_not_fit_are_refused() {
    const LONGEST: usize = 1 << 24;
    let gpu = device::gpu();
    let options = RendererOptions { film: FilmOptions::equirect(64, 32), max_bounces: 0, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
    let list: Arc<[u32]> = vec![7; LONGEST].into();
    let mut trace = |lists: Vec<Arc<[u32]>>| {
        let layers = lists.into_iter().map(|list| (1.0, Layer::Pixels(list))).collect();
        renderer.set_distribution(Distribution::mixture(layers, device::inverse()).unwrap()).unwrap();
        renderer.trace(1 << 10).map_err(|error| error.to_string())
    };
    let error = trace(vec![vec![7; LONGEST + 1].into()]).unwrap_err();
    assert!(error.contains("16777217") && error.contains("16777216"), "{error}");
    trace(vec![Arc::clone(&list)]).unwrap();
    // Layers are few, and adapters may bind more than all of them.
    let too_many = (gpu.largest_binding() / (4 * LONGEST as u64) + 1) as usize;
    if too_many <= 8 {
        let error = trace(vec![list; too_many]).unwrap_err();
        assert!(error.contains(&gpu.largest_binding().to_string()), "{error}");
    }
    trace(vec![vec![7].into()]).unwrap();
}

/// A view smaller than a pixel has the one in its middle.
#[test]
fn a_region_between_pixel_centres_is_one_pixel() {
    let film = FilmOptions::equirect(64, 32);
    let view = View::new(Quat::from_rotation_y(-1.0), 1e-3, 1e-3);
    let region = Distribution::region(view, &film, Quat::IDENTITY, device::inverse());
    let [(_, Layer::Pixels(list))] = region.layers() else { panic!("{region:?}") };
    let [x, y] = film.pixel_of(view.direction(Vec2::ZERO)).unwrap();
    assert_eq!(**list, [y * film.width + x]);
}

/// A clip keeps samples in its view, where they follow the model as without one; those that ignore it have their share everywhere.
#[test]
fn a_clip_keeps_samples_in_its_view() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(256, 128);
    let twin = Film::equirectangular(256, 128).unwrap();
    let acuity = device::acuity();
    let turn = Quat::from_rotation_y(-0.7) * Quat::from_rotation_x(0.3);
    let view = View { world_from_view: turn, half_extent: Vec2::new(0.6, 0.4) };
    let direction = view.direction(Vec2::new(0.5, -0.2));
    let counted = |unclipped_share: Option<f32>| {
        let clip = unclipped_share.map(|unclipped_share| Clip { view, margin: 0.0, unclipped_share });
        let distribution = Distribution::foveated(Gaze::Scene { direction }, clip, device::inverse());
        counts(&gpu, film, (SequenceKind::Independent, 12), SAMPLES, distribution)
    };
    // By how far a pixel is inside or outside of the edge, in units of the image plane.
    let is_within = |pixel: usize, beyond_edge: f32| {
        let edge = View { half_extent: view.half_extent + beyond_edge, ..view };
        edge.project(vec3(twin.pixel_direction([pixel as u32 % 256, pixel as u32 / 256])))
            .is_some_and(|point| point.abs().max_element() <= 1.0)
    };
    let all = [Some(0.0), Some(0.25), None].map(counted);
    let [clipped, partly, free] = [0, 1, 2].map(|k| {
        let outside = all[k].iter().enumerate().filter(|(pixel, _)| !is_within(*pixel, 0.04));
        outside.map(|(_, count)| count).sum::<f64>() / SAMPLES as f64
    });
    eprintln!("outside the view: {clipped:.5} clipped, {partly:.4} with a quarter free, {free:.4} without a clip");
    assert!(clipped < 1e-3 && free > 0.2, "{clipped}, {free}");
    assert!((partly / (0.25 * free) - 1.0).abs() < 0.03, "{partly} of {free}");
    // Pixels wholly inside, up to the corner that is farthest from the gaze.
    let density = |d| acuity.pdf(Angle::from_degrees(angle_deg(d, glam::DVec3::from(direction).into())));
    let whole = probabilities(&twin, density);
    let inside: Vec<usize> = (0..whole.len()).filter(|pixel| is_within(*pixel, -0.04)).collect();
    let [seen, sum] = [&all[0], &whole].map(|values| inside.iter().map(|&pixel| values[pixel]).sum::<f64>());
    let expected: Vec<f64> = inside.iter().map(|&pixel| whole[pixel] / sum * seen).collect();
    let found: Vec<f64> = inside.iter().map(|&pixel| all[0][pixel]).collect();
    let (p, statistic, freedom) = statistics::chi_squared_test(&found, &expected);
    eprintln!("clipped, by pixel: chi-squared {statistic:.1} with {freedom} degrees of freedom, p = {p:.3}");
    assert!(p > statistics::sidak(FAMILY_SIGNIFICANCE, TESTS));
    // Two degrees off it would be seen.
    let shifted = |d: Direction| density((Quat::from_rotation_y(2f32.to_radians()) * vec3(d)).as_dvec3().into());
    let shifted = probabilities(&twin, shifted);
    let sum: f64 = inside.iter().map(|&pixel| shifted[pixel]).sum();
    let wrong: Vec<f64> = inside.iter().map(|&pixel| shifted[pixel] / sum * seen).collect();
    assert!(statistics::chi_squared_test(&found, &wrong).0 < 1e-12);
}
