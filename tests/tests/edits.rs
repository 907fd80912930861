//! An edit uploads what it changes and no more, and what is rendered then is what a fresh renderer shows of the edited scene.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::{Arc, atomic::AtomicBool};

use fovea_tests::{device, plant::exchanged, scenes};
use glam::{Affine3A, Quat, Vec3};
use tracer::{
    builtin,
    distribution::Distribution,
    film::{FilmOptions, FilmSnapshot},
    gpu::{GeometryPlace, Gpu},
    kernels::{Kernel, KernelKey},
    renderer::{FilmPose, Query, QueryAnswer, RayKind, Renderer, RendererOptions, Schedule},
    scene::{Environment, Scene},
};

const FILM: FilmOptions = FilmOptions::equirect(32, 16);
const SAMPLES: u64 = 1 << 14;

fn renderer(gpu: &Gpu, scene: &Scene) -> Renderer {
    let options = RendererOptions { film: FILM, max_bounces: 3, ..Default::default() };
    let mut renderer = Renderer::new(gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    renderer.set_scene(scene).unwrap();
    let position = scene.cameras.first().map_or(Vec3::ZERO, |camera| camera.position);
    renderer.set_pose(FilmPose { position, world_from_film: Quat::IDENTITY });
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
    assert!(report.uploaded_bytes < 32 << 10, "{report:?}");
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

/// What moves leaves the static mesh, which stays as it is. The picture is that of a fresh renderer but for rounding: there the
/// object is part of the static mesh.
#[test]
fn a_move_uploads_the_object_and_places_alone() {
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
        assert!(report.uploaded_bytes < 400 << 10, "{report:?}");
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

/// Tables have room for an object that moves, which is then written into them; for a larger one they become larger.
#[test]
fn an_object_that_moves_goes_into_the_room_of_the_tables() {
    let _time = device::Stopwatch::start("edits");
    for place in [GeometryPlace::Buffers, GeometryPlace::Textures] {
        let gpu = device::gpu().with_geometry_in(place);
        let mut builder = scenes::Builder::new(Vec3::ONE);
        let white = builder.material(scenes::lambert(Vec3::splat(0.8)));
        for (rings, x) in [(64, -2.5), (12, 0.0), (40, 2.5)] {
            let sphere = builder.sphere(rings);
            builder.place(sphere, white, Affine3A::from_translation(Vec3::new(x, 0.0, -4.0)));
        }
        let mut scene = builder.build();
        let [whole, small, large] = [0, 1, 2].map(|i| triangles(&scene, i));
        assert!(small * 20 < whole && large * 5 > whole, "{whole} {small} {large}");
        let mut edited = renderer(&gpu, &scene);
        let mut bytes = edited.set_scene(&scene).unwrap().upload.geometry_bytes;
        for (moved, finds_room) in [(1, true), (1, true), (2, false), (1, true), (2, true)] {
            scene.instances[moved].world_from_mesh.translation.y += 0.3;
            let after = edited.set_scene(&scene).unwrap().upload.geometry_bytes;
            eprintln!("{place:?}: {bytes} bytes, {after} after object {moved} has moved");
            assert_eq!(after == bytes, finds_room);
            bytes = after;
            let (off, mean_off) = difference(&picture(&mut renderer(&gpu, &scene)), &picture(&mut edited));
            assert!(mean_off < 1e-3 && off < 0.1, "object {moved}: not the picture of a fresh renderer");
        }
    }
}

/// An edit that is refused leaves the scene as it was, though its tables are those that the edit is to be written into.
#[test]
fn an_edit_that_does_not_compile_changes_nothing() {
    let _time = device::Stopwatch::start("edits");
    for place in [GeometryPlace::Buffers, GeometryPlace::Textures] {
        let gpu = device::gpu().with_geometry_in(place);
        let (scene, _) = builtin::scene().unwrap();
        let mut edited = renderer(&gpu, &scene);
        let before = picture(&mut edited);
        let whole = edited.shaders().clone();
        // What the first move needs and nothing does before.
        let loop_over_entries = "while instance == NONE && primitive_group.y != 0u {";
        let faulty = exchanged(&whole, "scene::traverse", &[(loop_over_entries, "while instance == 1.5 {")]);
        edited.set_shaders(faulty).unwrap();
        let mut moved = scene.clone();
        moved.instances[at_the_centre(&mut edited, &scene).0].world_from_mesh.translation.y += 0.3;
        let error = edited.set_scene(&moved).unwrap_err().to_string();
        eprintln!("{place:?}: {error}");
        edited.restart();
        assert_eq!(picture(&mut edited).words, before.words, "the refused move is to be seen");

        edited.set_shaders(whole).unwrap();
        edited.set_scene(&moved).unwrap();
        let (off, mean_off) = difference(&picture(&mut renderer(&gpu, &moved)), &picture(&mut edited));
        assert!(mean_off < 1e-3 && off < 0.1, "not the picture of a fresh renderer");
    }
}

/// What happens, and how.
type Edit<'a> = (&'a str, &'a dyn Fn(&mut Scene));

/// Rays to everywhere meet what they meet in a fresh renderer, after each of a series of edits, wherever the geometry is.
#[test]
fn what_leaves_the_static_mesh_is_met_where_it_is_now() {
    let _time = device::Stopwatch::start("edits");
    for place in [GeometryPlace::Buffers, GeometryPlace::Textures] {
        let gpu = device::gpu().with_geometry_in(place);
        let (mut scene, _) = builtin::scene().unwrap();
        let largest = (0..scene.instances.len()).max_by_key(|&i| triangles(&scene, i)).unwrap();
        let mut edited = renderer(&gpu, &scene);
        let rays = rays_to_everywhere(scene.cameras[0].position);
        let before: Vec<_> = edited.query(&rays).unwrap().0;
        let seen: Vec<u32> = before.iter().flatten().map(|answer| answer.instance).collect();
        let most_seen = |i: &usize| seen.iter().filter(|&&instance| instance as usize == *i).count();
        let mut objects: Vec<usize> = (0..scene.instances.len()).filter(|&i| i != largest).collect();
        objects.sort_by_key(|i| std::cmp::Reverse(most_seen(i)));
        let [a, b, c] = [objects[0], objects[1], objects[2]];
        let edits: [Edit<'_>; 6] = [
            ("one moves", &|scene| scene.instances[a].world_from_mesh.translation.y += 0.3),
            ("another hides", &|scene| scene.instances[b].visible = false),
            ("two move", &|scene| {
                for i in [a, c] {
                    scene.instances[i].world_from_mesh.translation.x -= 0.2;
                }
            }),
            ("one is shown again", &|scene| scene.instances[b].visible = true),
            ("the largest moves", &|scene| scene.instances[largest].world_from_mesh.translation.y += 0.01),
            ("all move", &|scene| {
                for instance in &mut scene.instances {
                    instance.world_from_mesh.translation.z += 0.05;
                }
            }),
        ];
        for (what, edit) in edits {
            edit(&mut scene);
            edited.set_scene(&scene).unwrap();
            let answers = edited.query(&rays).unwrap().0;
            let expected = renderer(&gpu, &scene).query(&rays).unwrap().0;
            let differs = |a: &Option<QueryAnswer>, b: &Option<QueryAnswer>| match (a, b) {
                (Some(a), Some(b)) => a.instance != b.instance || (a.t - b.t).abs() > 1e-4 * b.t,
                (a, b) => a.is_some() != b.is_some(),
            };
            let different = |other: &[Option<QueryAnswer>]| {
                let pairs = other.iter().zip(&expected);
                pairs.filter(|(a, b)| differs(a, b)).count()
            };
            let (off, unedited) = (different(&answers), different(&before));
            eprintln!("{place:?}, {what}: {off} of {} rays differ; {unedited} before any edit", rays.len());
            // Rays along edges: an object that is placed is rounded otherwise.
            assert!(off * 500 <= rays.len(), "{what}: {off} rays meet something else");
            assert!(unedited * 100 > rays.len(), "{what}: hardly a ray tells");
        }
    }
}

fn triangles(scene: &Scene, instance: usize) -> usize {
    scene.meshes[scene.instances[instance].mesh as usize].triangles.len()
}

/// Fibonacci's spiral over the sphere.
fn rays_to_everywhere(origin: Vec3) -> Vec<Query> {
    const COUNT: u32 = 1 << 13;
    let ray = |i: u32| {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / COUNT as f32;
        let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Query { origin, direction: Vec3::new(r * cos, z, r * sin), t_max: f32::MAX, kind: RayKind::Closest }
    };
    (0..COUNT).map(ray).collect()
}

/// A rehearsal has the driver compile what the first move needs, whatever moves.
#[test]
fn a_rehearsed_move_compiles_the_kernels_of_the_first_move() {
    let _time = device::Stopwatch::start("edits");
    for schedule in [Schedule::Megakernel, Schedule::Wavefront] {
        rehearses(schedule);
    }
}

fn rehearses(schedule: Schedule) {
    let gpu = device::gpu();
    let (mut scene, _) = builtin::scene().unwrap();
    let mut edited = renderer(&gpu, &scene);
    edited.set_schedule(schedule).unwrap();
    let keys = |renderer: &Renderer| schedule.kernels().iter().map(|&kernel| renderer.key(kernel)).collect::<Vec<_>>();
    let rehearsal = edited.rehearsal(&Arc::new(scene.clone())).unwrap();
    let before = keys(&edited);
    let rehearsed = rehearsal.run(&AtomicBool::new(false)).unwrap().unwrap();
    let compiled: Vec<KernelKey> = rehearsed.keys().cloned().collect();
    assert_ne!(compiled, before);
    assert!(rehearsal.run(&AtomicBool::new(true)).unwrap().is_none(), "does not stop");
    let (instance, _) = at_the_centre(&mut edited, &scene);
    scene.instances[instance].world_from_mesh.translation.y += 0.1;
    let mut unprepared = renderer(&gpu, &scene);
    edited.take_in(rehearsed);
    edited.set_scene(&scene).unwrap();
    assert_eq!(keys(&edited), compiled);
    let (off, mean_off) = difference(&picture(&mut unprepared), &picture(&mut edited));
    assert!(mean_off < 1e-3 && off < 0.1, "not the picture of a fresh renderer");
    assert!(edited.rehearsal(&Arc::new(scene)).is_none(), "nothing is left to rehearse");
}
