//! An edit uploads what it changes and no more, and what is rendered then is what a fresh renderer shows of the edited scene.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_tests::device;
use glam::{Quat, Vec3};
use tracer::{
    builtin,
    distribution::Distribution,
    film::{FilmOptions, FilmSnapshot},
    gpu::Gpu,
    kernels::Kernel,
    renderer::{FilmPose, Query, RayKind, Renderer, RendererOptions},
    scene::{Environment, Scene},
};

const FILM: FilmOptions = FilmOptions::equirect(32, 16);
const SAMPLES: u64 = 1 << 14;

fn renderer(gpu: &Gpu, scene: &Scene) -> Renderer {
    let options = RendererOptions { film: FILM, max_bounces: 3, ..Default::default() };
    let mut renderer = Renderer::new(gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    renderer.set_scene(scene).unwrap();
    renderer.set_pose(FilmPose { position: scene.cameras[0].position, world_from_film: Quat::IDENTITY });
    renderer
}

fn picture(renderer: &mut Renderer) -> FilmSnapshot {
    device::trace(renderer, SAMPLES).unwrap()
}

/// Share of the pixels whose means differ by more than a thousandth, and their mean difference over the mean.
fn difference(a: &FilmSnapshot, b: &FilmSnapshot) -> (f64, f64) {
    let (mut differing, mut sum, mut total) = (0, 0.0, 0.0);
    for (a, b) in a.pixels().zip(b.pixels()) {
        let off = (a.mean[1] - b.mean[1]).abs();
        differing += usize::from(off > 1e-3 * a.mean[1].abs());
        sum += off;
        total += a.mean[1];
    }
    (differing as f64 / FILM.pixels() as f64, sum / total)
}

/// The instance that the panorama's centre shows, and its nearest distance.
fn at_the_centre(renderer: &mut Renderer, scene: &Scene) -> (usize, f32) {
    let ray =
        Query { origin: scene.cameras[0].position, direction: Vec3::NEG_Z, t_max: f32::MAX, kind: RayKind::Closest };
    let (answers, _) = renderer.query(&[ray]).unwrap();
    let answer = answers[0].unwrap();
    (answer.instance as usize, answer.t)
}

#[test]
fn a_material_or_a_light_uploads_itself_alone() {
    let _time = device::Stopwatch::start("edits");
    let gpu = device::gpu();
    let (mut scene, _) = builtin::scene().unwrap();
    let mut edited = renderer(&gpu, &scene);
    let before = picture(&mut edited);
    let (instance, _) = at_the_centre(&mut edited, &scene);

    let material = scene.instances[instance].material as usize;
    Arc::make_mut(&mut scene.materials[material]).base_color = Vec3::new(0.9, 0.1, 0.1).extend(1.0);
    let report = edited.set_scene(&scene).unwrap().upload;
    eprintln!("material: {} of {} bytes uploaded", report.uploaded_bytes, report.device_bytes);
    assert!(report.uploaded_bytes < 1 << 18, "{report:?}");
    assert!(report.uploaded_bytes * 10 < report.device_bytes, "{report:?}");
    let after = picture(&mut edited);
    assert_eq!(after.words, picture(&mut renderer(&gpu, &scene)).words, "not the picture of a fresh renderer");
    assert!(difference(&before, &after).0 > 0.1, "the edit is not to be seen");

    scene.environment = Environment::Constant(Vec3::new(0.5, 1.0, 2.0));
    for light in &mut scene.lights {
        light.intensity *= 2.0;
    }
    let report = edited.set_scene(&scene).unwrap().upload;
    assert!(report.uploaded_bytes * 10 < report.device_bytes, "{report:?}");
    let lit = picture(&mut edited);
    assert_eq!(lit.words, picture(&mut renderer(&gpu, &scene)).words, "not the picture of a fresh renderer");
    assert!(difference(&after, &lit).0 > 0.1, "the edit is not to be seen");
}

/// What moves leaves the static mesh, so its second move is cheap. The picture is that of a fresh renderer but for rounding:
/// there the object is part of the static mesh.
#[test]
fn a_move_uploads_places_alone_from_the_second_on() {
    let _time = device::Stopwatch::start("edits");
    let gpu = device::gpu();
    let (mut scene, _) = builtin::scene().unwrap();
    let mut edited = renderer(&gpu, &scene);
    let before = picture(&mut edited);
    let (instance, t) = at_the_centre(&mut edited, &scene);

    for step in 1..=3 {
        scene.instances[instance].world_from_mesh.translation += glam::Vec3A::new(0.1, 0.05, 0.0);
        let report = edited.set_scene(&scene).unwrap().upload;
        eprintln!("move {step}: {} of {} bytes uploaded", report.uploaded_bytes, report.device_bytes);
        if step > 1 {
            assert!(report.uploaded_bytes * 10 < report.device_bytes, "{report:?}");
        }
    }
    let moved = picture(&mut edited);
    let mut fresh = renderer(&gpu, &scene);
    let (off, mean_off) = difference(&picture(&mut fresh), &moved);
    eprintln!("moved: {:.2} % of the pixels differ, by {:.4} % of the mean", off * 100.0, mean_off * 100.0);
    assert!(mean_off < 1e-3 && off < 0.1, "not the picture of a fresh renderer");
    let (changed, _) = difference(&before, &moved);
    assert!(changed > 0.1, "the move is not to be seen: {changed}");

    scene.instances[instance].visible = false;
    let report = edited.set_scene(&scene).unwrap().upload;
    assert!(report.uploaded_bytes * 10 < report.device_bytes, "{report:?}");
    let (behind, farther) = at_the_centre(&mut edited, &scene);
    assert!(behind != instance && farther > t, "a hidden instance is hit");
    let (off, mean_off) = difference(&picture(&mut renderer(&gpu, &scene)), &picture(&mut edited));
    assert!(mean_off < 1e-3 && off < 0.1, "not the picture of a fresh renderer");

    scene.instances[instance].visible = true;
    edited.set_scene(&scene).unwrap();
    assert_eq!(picture(&mut edited).words, moved.words, "shown again, and nothing else has changed");

    // Another object leaves the static mesh, and the kernels stay.
    let kernel = edited.key(Kernel::Trace);
    let other = (0..scene.instances.len()).find(|&other| other != instance).unwrap();
    scene.instances[other].world_from_mesh.translation.x += 0.01;
    edited.set_scene(&scene).unwrap();
    assert_eq!(edited.key(Kernel::Trace), kernel, "the second object compiles a kernel");
}
