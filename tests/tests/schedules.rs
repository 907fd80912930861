//! The film is the same, to the last bit, whichever schedule traces it and whatever the batches.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f32::consts::TAU;

use fovea_tests::{
    device,
    plant::exchanged,
    scenes::{Builder, emitter, even_image, lambert, textured_room},
};
use glam::{Affine3A, Quat, Vec3};
use tracer::{
    builtin,
    distribution::{Distribution, Gaze},
    film::{FilmOptions, FilmSnapshot},
    gpu::Gpu,
    kernels::ShaderSources,
    renderer::{FilmPose, Renderer, RendererOptions, Schedule, SequenceKind},
    scene::{AlphaMode, Material, PunctualKind, PunctualLight, Scene},
};

/// No power of two: batches get ever smaller towards the end, down to one sample.
const SAMPLES: u64 = 20_001;

/// What is traced.
struct Case {
    name: &'static str,
    scene: Scene,
    pose: FilmPose,
    film: FilmOptions,
    max_bounces: u32,
}

fn case(name: &'static str, scene: Scene, max_bounces: u32) -> Case {
    Case { name, scene, pose: FilmPose::default(), film: FilmOptions::equirect(64, 32), max_bounces }
}

/// Distributions that are traced: everywhere, and about a gaze off the axis.
fn distributions() -> [(&'static str, Distribution); 2] {
    let inverse = device::inverse();
    let gaze = Gaze::Scene { direction: Vec3::new(0.3, -0.2, -1.0).normalize() };
    [("OD", Distribution::omnidirectional(inverse.clone())), ("FV", Distribution::foveated(gaze, None, inverse))]
}

fn renderer(gpu: &Gpu, case: &Case, schedule: Schedule) -> Renderer {
    let [(_, distribution), _] = distributions();
    let options =
        RendererOptions { film: case.film, max_bounces: case.max_bounces, seed: 3, sequence: SequenceKind::Sobol };
    let mut renderer = Renderer::new(gpu, &options, distribution).unwrap();
    renderer.set_schedule(schedule).unwrap();
    renderer.set_scene(&case.scene).unwrap();
    renderer.set_pose(case.pose);
    renderer
}

/// A hall with all that rays pass or may see: cut-outs, blended leaves, stacks of clear sheets, glass, lamps, punctual lights and
/// an environment image behind a gap. One stack has more sheets than a batch has rounds; one ball is in the absorbing glass of another.
fn hall() -> Scene {
    let mut builder = Builder::new(Vec3::ZERO);
    let white = builder.material(lambert(Vec3::new(0.8, 0.75, 0.7)));
    let shiny = builder.material(Material { roughness: 0.3, ..lambert(Vec3::new(0.3, 0.5, 0.6)) });
    let lamp = builder.material(emitter(Vec3::new(6.0, 5.0, 4.0)));
    let thin = Material { metallic: 0.0, double_sided: true, ..Default::default() };
    let cut_out = builder.material(Material {
        base_color: Vec3::ONE.extend(0.25),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..thin.clone()
    });
    let leaf = builder.material(Material {
        base_color: Vec3::new(0.2, 0.7, 0.1).extend(0.4),
        alpha_mode: AlphaMode::Blend,
        ..thin.clone()
    });
    let sheet = builder.material(Material {
        base_color: Vec3::new(0.95, 0.97, 1.0).extend(1.0),
        roughness: 0.0,
        ior: 1.0,
        specular: 0.0,
        transmission: 1.0,
        ..thin
    });
    let glass = builder.material(Material {
        metallic: 0.0,
        roughness: 0.05,
        transmission: 1.0,
        thickness: 0.5,
        attenuation_color: Vec3::new(0.2, 0.8, 0.4),
        attenuation_distance: 0.5,
        ..Default::default()
    });
    builder.room(Vec3::new(-3.0, -1.5, -4.0), Vec3::new(3.0, 2.0, 3.0), [white, shiny, white, white, white, white]);
    builder.quad(Vec3::new(-1.0, 1.9, -2.0), Vec3::X * 0.8, Vec3::Z * 0.8, lamp);
    builder.quad(Vec3::new(-2.5, -1.0, -2.0), Vec3::X * 1.5, Vec3::Y * 2.0, cut_out);
    builder.quad(Vec3::new(1.0, -1.0, -2.5), Vec3::X * 1.5, Vec3::Y * 2.0, leaf);
    for i in 0..40 {
        let z = -1.6 - 0.05 * i as f32;
        builder.quad(Vec3::new(-0.7, -0.7, z), Vec3::X * 1.4, Vec3::Y * 1.4, sheet);
    }
    builder.quad(Vec3::new(-2.0, -1.0, 1.0), Vec3::X * 3.0, Vec3::Y * 2.0, sheet);
    let sphere = builder.sphere(12);
    let place = |x, y, z, size| {
        Affine3A::from_scale_rotation_translation(Vec3::splat(size), Quat::IDENTITY, Vec3::new(x, y, z))
    };
    builder.place(sphere, glass, place(2.0, -0.8, 0.5, 0.6));
    builder.place(sphere, shiny, place(-2.0, -0.9, 0.0, 0.5));
    builder.place(sphere, shiny, place(2.0, -0.8, 0.5, 0.2));
    let light = |kind, intensity, position| PunctualLight {
        name: String::new(),
        kind,
        intensity,
        position,
        rotation: Quat::from_rotation_arc(Vec3::NEG_Z, Vec3::NEG_Y),
    };
    builder.light(light(PunctualKind::Point, Vec3::splat(2.0), Vec3::new(2.0, 1.0, 2.0)));
    let spot = PunctualKind::Spot { inner_angle: 0.3, outer_angle: 0.8 };
    builder.light(light(spot, Vec3::new(4.0, 2.0, 1.0), Vec3::new(-2.0, 1.5, 2.0)));
    let mut scene = builder.build();
    // Without the wall at +z.
    scene.instances.remove(5);
    scene.environment = even_image(0.7);
    scene
}

/// The built-in scene at its camera, turned so that the film's edge is not a wall.
fn built_in() -> Case {
    let (scene, _) = builtin::scene().unwrap();
    let camera = scene.cameras[0].clone();
    let world_from_film = camera.rotation * Quat::from_rotation_y(0.1 * TAU);
    Case { pose: FilmPose { position: camera.position, world_from_film }, ..case("built-in", scene, 8) }
}

/// Where paths end by chance alone, most of them after more rounds than are submitted at first.
fn long_paths() -> Case {
    let mut builder = Builder::new(Vec3::ZERO);
    let white = builder.material(lambert(Vec3::splat(0.98)));
    let lamp = builder.material(emitter(Vec3::splat(3.0)));
    builder.room(Vec3::splat(-1.0), Vec3::splat(1.0), [white; 6]);
    builder.quad(Vec3::new(-0.2, 0.9, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4, lamp);
    let film = FilmOptions::perspective(48, 27, 1.0);
    Case { film, ..case("64 bounces, perspective", builder.build(), 64) }
}

fn assert_same(name: &str, found: &FilmSnapshot, expected: &FilmSnapshot) {
    let differing = found.words.iter().zip(&expected.words).filter(|(a, b)| a != b).count();
    let counts = (found.header.statistics, expected.header.statistics);
    assert_eq!(counts.0, counts.1, "{name}");
    assert_eq!(differing, 0, "{name}: {differing} of {} words differ", expected.words.len());
}

#[test]
fn both_schedules_make_the_same_film() {
    let _time = device::Stopwatch::start("schedules");
    let gpu = device::gpu();
    for case in
        [built_in(), case("hall", hall(), 8), case("textured room, no bounce", textured_room(), 0), long_paths()]
    {
        let mut renderer = renderer(&gpu, &case, Schedule::Megakernel);
        let films = distributions().map(|(mode, distribution)| {
            renderer.set_distribution(distribution.clone()).unwrap();
            renderer.restart();
            (mode, distribution, device::trace(&mut renderer, SAMPLES).unwrap())
        });
        renderer.set_schedule(Schedule::Wavefront).unwrap();
        for (mode, distribution, expected) in films {
            let name = format!("{}, {mode}", case.name);
            let seen = expected.pixels().filter(|pixel| pixel.mean[1] > 0.0).count();
            assert!(seen > 50, "{name}: {seen} lit pixels say little");
            renderer.set_distribution(distribution).unwrap();
            renderer.restart();
            let found = device::trace(&mut renderer, SAMPLES).unwrap();
            let counts = found.header.statistics;
            eprintln!("{name}: {seen} lit pixels, {} segments, {} shadow rays", counts.segments, counts.shadow_rays);
            assert_same(&name, &found, &expected);
            // Small batches, and both schedules in one film.
            renderer.restart();
            while renderer.samples() < SAMPLES {
                let batch = (SAMPLES - renderer.samples()).min(3000) as u32;
                renderer.trace(batch).unwrap();
                renderer.set_schedule(renderer.schedule().other()).unwrap();
            }
            assert_same(&format!("{name}, in turn"), &renderer.snapshot().unwrap(), &expected);
            renderer.set_schedule(Schedule::Wavefront).unwrap();
        }
    }
}

/// What a film of the hall by the wavefront schedule becomes with a passage exchanged.
fn faulty(gpu: &Gpu, module: &str, passage: (&str, &str)) -> FilmSnapshot {
    let case = case("hall", hall(), 8);
    let mut renderer = renderer(gpu, &case, Schedule::Wavefront);
    let sources: ShaderSources = exchanged(renderer.shaders(), module, &[passage]);
    renderer.set_shaders(sources).unwrap();
    device::trace(&mut renderer, SAMPLES).unwrap()
}

/// The comparison fails where a state is not kept, and where a queue loses its last path.
#[test]
fn faults_of_the_wavefront_are_noticed() {
    let _time = device::Stopwatch::start("planted faults");
    let gpu = device::gpu();
    let case = case("hall", hall(), 8);
    let expected = device::trace(&mut renderer(&gpu, &case, Schedule::Megakernel), SAMPLES).unwrap();
    for (module, passage) in [
        ("wavefront::state", ("states[number].travelled = path.travelled;", "states[number].travelled = 0.0;")),
        ("wavefront::state", ("states[number].medium = path.medium;", "states[number].medium = NONE;")),
        ("wavefront::queue", ("if place >= atomicLoad", "if place + 1u >= atomicLoad")),
    ] {
        let found = faulty(&gpu, module, passage);
        assert_ne!(found.words, expected.words, "{module} does without it: {}", passage.0);
    }
}
