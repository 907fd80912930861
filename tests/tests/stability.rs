//! Where arithmetic gets hard: scales, slivers, contacts, grazing rays, extreme emitters, long paths. Each case has a value
//! in closed form; all of them together are the table of docs/reports/stability.md:
//! `FOVEA_LONG_RUNS=1 cargo test -p fovea-tests --test stability -- --nocapture --test-threads 1 2>&1 | grep '^|'`.
//!
//! Most are a closed room whose surfaces have one albedo and one emission: the radiance is known whatever stands in it, and
//! since it stands in an environment a thousand times as bright, the smallest leak shows.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::{f64::consts::PI, time::Instant};

use fovea_tests::{
    device,
    known::corner_form_factor,
    pencil::{Measured, measure},
    plant::{exchanged, instead_of_paths},
    scenes::{self, Builder, emitter, lambert},
};
use glam::{Affine3A, Mat3A, Quat, Vec3};
use tracer::{
    distribution::{Distribution, Gaze},
    film::FilmOptions,
    gpu::Gpu,
    import::{ImportOptions, load_glb_bytes},
    kernels::FILM_WORDS,
    renderer::{Renderer, RendererOptions, SequenceKind},
    scene::{Environment, Material, Scene},
};

const SAMPLES: u64 = 1 << 15;
/// Relative rounding of a path's arithmetic in f32.
const ROUNDING: f64 = 2e-5;
const ALBEDO: f32 = 0.6;
const EMISSION: f32 = 0.5;
const BOUNCES: u32 = 6;

/// A row of the report: the found value must be within three standard errors of the expected one.
fn row(case: &str, found: Measured, expected: f64) {
    let difference = found.mean - expected;
    eprintln!(
        "| {case} | {expected:.6e} | {:.6e} | {:.1e} | {:+.1e} |",
        found.mean,
        found.error,
        difference / expected.abs().max(1e-30)
    );
    assert_eq!(found.statistics.non_finite, 0, "{case}: samples were dropped");
    assert_eq!(found.statistics.clamped, 0, "{case}: samples were clamped");
    assert!(found.error <= 0.01 * expected, "{case}: too noisy for a claim");
    assert!(difference.abs() <= 3.0 * found.error + ROUNDING * expected, "{case}");
}

fn glowing() -> Material {
    Material { emission: Vec3::splat(EMISSION), double_sided: true, ..lambert(Vec3::splat(ALBEDO)) }
}

fn closed_furnace() -> f64 {
    let (albedo, emission) = (f64::from(ALBEDO), f64::from(EMISSION));
    emission * (1.0 - albedo.powi(BOUNCES as i32 + 1)) / (1.0 - albedo)
}

/// A room about `centre` with more in it, in an environment that shows every leak.
fn room(centre: Vec3, half: f32, more: impl FnOnce(&mut Builder, u32)) -> Scene {
    let mut builder = Builder::new(Vec3::splat(1e3));
    let material = builder.material(glowing());
    builder.room(centre - half, centre + half, [material; 6]);
    more(&mut builder, material);
    builder.build()
}

fn in_room(gpu: &Gpu, scene: &Scene, centre: Vec3, half: f32) -> Measured {
    let ray = [centre + half * Vec3::new(0.1, -0.2, 0.3), centre + half * Vec3::new(0.7, 0.5, -0.4)];
    measure(gpu, scene, ray, BOUNCES, SAMPLES, |_| {})
}

#[test]
fn scales_and_distances_from_the_origin() {
    let gpu = device::gpu();
    for half in [1e-3f32, 1.0, 1e3, 1e6] {
        let scene = room(Vec3::ZERO, half, |_, _| {});
        row(&format!("room of {half:.0e} m"), in_room(&gpu, &scene, Vec3::ZERO, half), closed_furnace());
    }
    // A position far from the origin is rounded, and close to a corner may end up behind the next wall. How often?
    for (distance, largest) in [(1e3f32, 5e-5), (1e5, 5e-3)] {
        let centre = Vec3::new(distance, -0.5 * distance, 2.0 * distance);
        let found = in_room(&gpu, &room(centre, 1.0, |_, _| {}), centre, 1.0);
        let leak = (found.mean - closed_furnace()) / 1e3;
        let error = found.error / 1e3;
        eprintln!(
            "| share of paths that leave a closed room of 1 m {distance:.0e} m off | 0 | {leak:.1e} | {error:.1e} | |"
        );
        assert!(leak.abs() < largest, "{leak:e}");
    }
    // A file is moved to its centre as it is read.
    let (mut scene, _) = load_glb_bytes("far.glb", &far_room(), &ImportOptions::default()).unwrap();
    assert!(scene.origin_in_file.length() > 2e5);
    scene.environment = Environment::Constant(Vec3::splat(1e3));
    let found = in_room(&gpu, &scene, Vec3::ZERO, 1.0);
    row("the same from a file, 2e5 m from its origin", found, closed_furnace());
    // An emissive square above a floor, at every scale.
    for scale in [1e-3f32, 1e3, 1e6] {
        let mut builder = Builder::new(Vec3::ZERO);
        let material = builder.material(lambert(Vec3::splat(0.7)));
        builder.quad(Vec3::new(-20.0, 0.0, -20.0) * scale, Vec3::Z * 40.0 * scale, Vec3::X * 40.0 * scale, material);
        let lamp = builder.material(emitter(Vec3::splat(3.0)));
        builder.quad(Vec3::new(-1.0, 1.5, -1.0) * scale, Vec3::X * 2.0 * scale, Vec3::Z * 2.0 * scale, lamp);
        let ray = [Vec3::new(6.0, 1.0, 0.0) * scale, Vec3::ZERO];
        let found = measure(&gpu, &builder.build(), ray, 1, SAMPLES, |_| {});
        row(
            &format!("lamp of {:.0e} m over a floor", 2.0 * scale),
            found,
            0.7 * 3.0 * 4.0 * corner_form_factor(1.0, 1.0, 1.5),
        );
    }
}

/// A .glb file of the room: a cube of 2 m about (1e5, -5e4, 2e5).
fn far_room() -> Vec<u8> {
    let corners: Vec<[f32; 3]> =
        (0..8u32).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 1 { 1.0 } else { -1.0 })).collect();
    let quads = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5u32]];
    let indices: Vec<u32> = quads.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).collect();
    let bytes: Vec<u8> = [bytemuck::cast_slice::<_, u8>(&corners), bytemuck::cast_slice(&indices)].concat();
    let material = format!(
        r#"{{"doubleSided":true,"emissiveFactor":[{EMISSION},{EMISSION},{EMISSION}],
        "extensions":{{"KHR_materials_specular":{{"specularFactor":0}}}},
        "pbrMetallicRoughness":{{"baseColorFactor":[{ALBEDO},{ALBEDO},{ALBEDO},1],"metallicFactor":0}}}}"#
    );
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_materials_specular"],
        "scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"translation":[1e5,-5e4,2e5]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],"materials":[{material}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[-1,-1,-1],"max":[1,1,1]}},
        {{"bufferView":1,"componentType":5125,"count":36,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":144}}],
        "buffers":[{{"byteLength":240}}]}}"#
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let (json_bytes, binary_bytes) = (json.len() as u32, bytes.len() as u32);
    [
        words(&[0x4654_6C67, 2, 12 + 8 + json_bytes + 8 + binary_bytes, json_bytes, 0x4E4F_534A]),
        json,
        words(&[binary_bytes, 0x004E_4942]),
        bytes,
    ]
    .concat()
}

/// Random numbers for shapes: a linear congruential generator is good enough, and the same everywhere.
fn numbers() -> impl FnMut() -> f32 {
    let mut state = 12345u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0 * 2.0 - 1.0
    }
}

#[test]
fn triangles_of_every_bad_shape() {
    let gpu = device::gpu();
    let mut next = numbers();
    let mut point = |reach: f32| Vec3::new(next(), next(), next()) * reach;
    let slivers: Vec<[Vec3; 3]> = (0..1000)
        .map(|_| {
            let (a, b) = (point(0.9), point(0.9));
            [a, b, a.lerp(b, 0.5) + point(1e-6)]
        })
        .collect();
    let flat: Vec<[Vec3; 3]> = (0..1000)
        .map(|i| {
            let (a, b) = (point(0.9), point(0.9));
            if i % 2 == 0 { [a, b, a.lerp(b, 0.25)] } else { [a, a, a] }
        })
        .collect();
    let tiny: Vec<[Vec3; 3]> = (0..4000)
        .map(|_| {
            let a = point(0.9);
            [a, a + point(1e-6), a + point(1e-6)]
        })
        .collect();
    let cases: [(&str, f32, &[[Vec3; 3]]); 3] = [
        ("1000 slivers of 1 m by 1e-6 m", 1.0, &slivers),
        ("1000 triangles without area", 1.0, &flat),
        ("4000 triangles of 1e-12 m^2 in a room of 32 m", 16.0, &tiny),
    ];
    for (case, half, corners) in cases {
        let scene = room(Vec3::ZERO, half, |builder, material| {
            let mesh = builder.triangles(corners, &[]);
            builder.place(mesh, material, Affine3A::IDENTITY);
        });
        row(case, in_room(&gpu, &scene, Vec3::ZERO, half), closed_furnace());
    }
}

#[test]
fn coplanar_touching_and_distorted_things() {
    let gpu = device::gpu();
    let twice = room(Vec3::ZERO, 1.0, |builder, material| {
        builder.room(Vec3::NEG_ONE, Vec3::ONE, [material; 6]);
    });
    row("every wall twice, in the same place", in_room(&gpu, &twice, Vec3::ZERO, 1.0), closed_furnace());
    let boxes = room(Vec3::ZERO, 1.0, |builder, material| {
        // Boxes on the floor, on each other and in a corner: shared faces, edges and corners.
        builder.room(Vec3::new(-0.5, -1.0, -0.5), Vec3::new(0.0, -0.5, 0.0), [material; 6]);
        builder.room(Vec3::new(-0.5, -0.5, -0.5), Vec3::new(0.0, 0.0, 0.0), [material; 6]);
        builder.room(Vec3::new(0.0, -1.0, -0.5), Vec3::new(0.4, -0.6, 0.0), [material; 6]);
        builder.room(Vec3::new(-1.0, -1.0, -1.0), Vec3::new(-0.7, -0.7, -0.7), [material; 6]);
        builder.quad(Vec3::new(-0.9, -1.0, 0.2), Vec3::Z * 0.5, Vec3::X * 0.5, material);
    });
    row("boxes that touch floor, walls and each other", in_room(&gpu, &boxes, Vec3::ZERO, 1.0), closed_furnace());
    let distorted = room(Vec3::ZERO, 1.0, |builder, material| {
        let sphere = builder.sphere(16);
        let turn = Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        for (i, scale) in [
            Vec3::new(0.2, -0.2, 0.2),
            Vec3::new(1e-4, 0.5, 0.5),
            Vec3::new(1e-4, 1e-4, 0.8),
            Vec3::splat(1e-5),
            Vec3::splat(-0.1),
        ]
        .into_iter()
        .enumerate()
        {
            let at = Vec3::new(-0.6 + 0.3 * i as f32, 0.4, -0.3);
            builder.place(sphere, material, Affine3A::from_scale_rotation_translation(scale, turn, at));
        }
        let shear = Mat3A::from_cols(Vec3::X.into(), Vec3::new(30.0, 1.0, 0.0).into(), Vec3::Z.into()) * 0.02;
        builder.place(sphere, material, Affine3A { matrix3: shear, translation: Vec3::new(0.0, -0.4, 0.3).into() });
    });
    let case = "spheres mirrored, sheared, and scaled by 1e-5 to 0.8";
    row(case, in_room(&gpu, &distorted, Vec3::ZERO, 1.0), closed_furnace());
}

/// A white floor under a white sky is white at every angle.
#[test]
fn grazing_rays() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ONE);
    let white = builder.material(lambert(Vec3::ONE));
    builder.quad(Vec3::new(-2e4, 0.0, -2e4), Vec3::Z * 4e4, Vec3::X * 4e4, white);
    let scene = builder.build();
    for degrees in [89.0f64, 89.9, 89.99] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let eye = Vec3::new(sin as f32, cos as f32, 0.0) * 10.0;
        let found = measure(&gpu, &scene, [eye, Vec3::ZERO], 4, SAMPLES, |_| {});
        row(&format!("white floor at {degrees} degrees"), found, 1.0);
    }
}

/// An emissive wall that stands on the floor: the light touches the surface that it lights.
#[test]
fn a_light_that_touches_a_surface() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let material = builder.material(lambert(Vec3::splat(0.7)));
    builder.quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, material);
    let lamp = builder.material(emitter(Vec3::splat(3.0)));
    // In the plane z = 0, its front towards +z; 2 m wide, 1 m high.
    builder.quad(Vec3::new(-1.0, 0.0, 0.0), Vec3::X * 2.0, Vec3::Y, lamp);
    let scene = builder.build();
    for distance in [1e-4f64, 1e-2, 1.0] {
        // Howell B-4: from an element to a perpendicular rectangle, a corner at the foot; twice for both halves.
        let (height, width) = (1.0, 1.0);
        let root = f64::hypot(height, distance);
        let factor = ((width / distance).atan() - distance / root * (width / root).atan()) / PI;
        // From close by, so that the light hardly changes within the pencil.
        let target = Vec3::new(0.0, 0.0, distance as f32);
        let ray = [target + Vec3::new(0.0, 0.5, 1.0) * distance as f32, target];
        let found = measure(&gpu, &scene, ray, 1, SAMPLES, |_| {});
        row(&format!("floor {distance:.0e} m from a light that stands on it"), found, 0.7 * 3.0 * factor);
    }
}

#[test]
fn glass_from_inside_and_indices_of_one() {
    let gpu = device::gpu();
    let glass = |ior: f32| Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        ior,
        double_sided: true,
        ..Default::default()
    };
    let ball = |radii: &[(f32, f32)]| {
        let mut builder = Builder::new(Vec3::ONE);
        let sphere = builder.sphere(48);
        for (radius, ior) in radii {
            let material = builder.material(glass(*ior));
            builder.place(sphere, material, Affine3A::from_scale(Vec3::splat(*radius)));
        }
        builder.build()
    };
    let inside = [Vec3::new(0.1, 0.2, -0.1), Vec3::new(1.0, 0.4, 0.3)];
    for (case, radii) in [
        ("camera inside a glass ball", vec![(1.0, 1.5)]),
        ("camera inside glass (1.5) inside glass (1.33)", vec![(1.0, 1.33), (0.5, 1.5)]),
        ("camera inside glass of index 1", vec![(1.0, 1.0)]),
    ] {
        row(case, measure(&gpu, &ball(&radii), inside, 200, SAMPLES, |_| {}), 1.0);
    }
    // Glass of index 1 is not there.
    let mut builder = Builder::new(Vec3::ZERO);
    let material = builder.material(glass(1.0));
    let glow = builder.material(emitter(Vec3::ONE));
    builder.quad(Vec3::new(-10.0, -10.0, 0.0), Vec3::X * 20.0, Vec3::Y * 20.0, material);
    builder.quad(Vec3::new(-10.0, -10.0, -0.1), Vec3::Y * 20.0, Vec3::X * 20.0, material);
    builder.quad(Vec3::new(-50.0, -50.0, -1.0), Vec3::X * 100.0, Vec3::Y * 100.0, glow);
    let ray = [Vec3::new(3.0, 0.5, 1.0), Vec3::ZERO];
    row("slab of index 1 before a glow", measure(&gpu, &builder.build(), ray, 8, SAMPLES, |_| {}), 1.0);
}

#[test]
fn roughness_and_albedo_at_their_ends() {
    let gpu = device::gpu();
    let ball = |material: Material| {
        let mut builder = Builder::new(Vec3::ONE);
        let material = builder.material(material);
        let sphere = builder.sphere(48);
        builder.place(sphere, material, Affine3A::IDENTITY);
        builder.build()
    };
    let ray = [Vec3::new(0.4, 0.3, 4.0), Vec3::new(0.4, 0.3, 0.0)];
    for roughness in [0.0, 1e-4, 1e-2] {
        let metal = Material { roughness, ..Default::default() };
        let found = measure(&gpu, &ball(metal), ray, 4, SAMPLES, |_| {});
        row(&format!("white metal, roughness {roughness}"), found, 1.0);
    }
    let dielectric =
        Material { ior: 1.0, metallic: 0.0, base_color: Vec3::splat(0.5).extend(1.0), ..Default::default() };
    row("dielectric of index 1", measure(&gpu, &ball(dielectric), ray, 4, SAMPLES, |_| {}), 0.5);
    let black = measure(&gpu, &ball(lambert(Vec3::ZERO)), ray, 4, SAMPLES, |_| {});
    assert_eq!((black.mean, black.error), (0.0, 0.0), "black is black");
    for (case, albedo, expected) in [("albedo 2 counts as 1", 2.0, 1.0), ("albedo -1 counts as 0", -1.0, 0.0)] {
        let found = measure(&gpu, &ball(lambert(Vec3::splat(albedo))), ray, 4, SAMPLES, |_| {});
        assert!((found.mean - expected).abs() <= 3.0 * found.error + ROUNDING, "{case}: {found:?}");
    }
}

#[test]
fn emitters_of_every_strength() {
    let gpu = device::gpu();
    let lit_by = |radiance: f32, more: f32| {
        let mut builder = Builder::new(Vec3::ZERO);
        let floor = builder.material(lambert(Vec3::splat(0.7)));
        builder.quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, floor);
        let lamp = builder.material(emitter(Vec3::splat(radiance)));
        builder.quad(Vec3::new(-1.0, 1.5, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, lamp);
        if more > 0.0 {
            // Behind the floor: it lights nothing that is seen, but sets the film's scale and takes light samples.
            let lamp = builder.material(emitter(Vec3::splat(more)));
            builder.quad(Vec3::new(-1.0, -3.0, -1.0), Vec3::X * 1e-3, Vec3::Z * 1e-3, lamp);
        }
        builder.build()
    };
    let ray = [Vec3::new(6.0, 1.0, 0.0), Vec3::ZERO];
    let factor = 0.7 * 4.0 * corner_form_factor(1.0, 1.0, 1.5);
    for (radiance, more) in [(1e-6f32, 0.0), (1.0, 0.0), (1e9, 0.0), (1.0, 1e6)] {
        let found = measure(&gpu, &lit_by(radiance, more), ray, 1, 4 * SAMPLES, |_| {});
        let beside = if more > 0.0 { format!(" beside one of {more:.0e}") } else { String::new() };
        row(&format!("emitter of {radiance:.0e}{beside}"), found, f64::from(radiance) * factor);
    }
}

/// What is not a number never reaches the film, in any mode, and is counted.
#[test]
fn nan_from_outside_is_dropped_and_counted() {
    let gpu = device::gpu();
    let mut scene = scenes::empty(Vec3::ONE);
    scene.environment = Environment::Constant(Vec3::new(1.0, f32::NAN, 1.0));
    let gaze = Gaze::Scene { direction: Vec3::NEG_Z };
    for distribution in
        [Distribution::omnidirectional(device::inverse()), Distribution::foveated(gaze, None, device::inverse())]
    {
        let options = RendererOptions { film: FilmOptions::equirect(32, 16), ..Default::default() };
        let mut renderer = Renderer::new(&gpu, &options, distribution).unwrap();
        renderer.set_scene(&scene).unwrap();
        let film = device::trace(&mut renderer, 1 << 12).unwrap();
        assert_eq!(renderer.statistics().unwrap().non_finite, 1 << 12);
        assert!(film.pixels().all(|pixel| pixel.samples == 0));
    }
}

/// White mirrors lose nothing in 4096 bounces, and the room stays closed; grey ones end by roulette.
#[test]
fn four_thousand_bounces_between_mirrors() {
    let gpu = device::gpu();
    let mirrors = |reflectance: f32, emission: f32| {
        let mut builder = Builder::new(Vec3::splat(1e3));
        let mirror = Material {
            base_color: Vec3::splat(reflectance).extend(1.0),
            emission: Vec3::splat(emission),
            roughness: 0.0,
            double_sided: true,
            ..Default::default()
        };
        let mirror = builder.material(mirror);
        builder.room(Vec3::NEG_ONE, Vec3::new(1.2, 0.9, 1.1), [mirror; 6]);
        builder.build()
    };
    let ray = [Vec3::new(0.1, -0.2, 0.3), Vec3::new(0.7, 0.5, -0.4)];
    let found = measure(&gpu, &mirrors(1.0, 1.0 / 4097.0), ray, 4096, 256, |_| {});
    row("4096 bounces between white mirrors", found, 1.0);
    assert_eq!(found.statistics.segments, 256 * 4097, "no path ended early");
}

/// A tessellated sphere from its centre: every pixel sees the inside, edges and corners included. Beside it what the test of
/// Moeller and Trumbore would let through, and the time that both take.
#[test]
fn a_closed_mesh_has_no_gaps() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::splat(1e3));
    let material = builder.material(Material { emission: Vec3::ONE, double_sided: true, ..lambert(Vec3::ZERO) });
    let sphere = builder.sphere(64);
    builder.place(sphere, material, Affine3A::IDENTITY);
    let scene = builder.build();
    let options = RendererOptions {
        film: FilmOptions::equirect(256, 128),
        max_bounces: 0,
        sequence: SequenceKind::Sobol,
        seed: 5,
    };
    let inside = "let inside = min(u, min(v, w)) >= 0.0 || max(u, max(v, w)) <= 0.0;";
    let moeller_trumbore = "let p = cross(ray.direction, c - a);
    let q = cross(b - a, a);
    let determinant = dot(b - a, p);
    let s = -dot(a, p) / determinant;
    let r = dot(ray.direction, q) / determinant;
    let inside = determinant != 0.0 && s >= 0.0 && r >= 0.0 && s + r <= 1.0;";
    let trace = |planted: &str| {
        let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
        let sources = exchanged(renderer.shaders(), "scene::traverse", &[(inside, planted)]);
        renderer.set_shaders(sources).unwrap();
        renderer.set_scene(&scene).unwrap();
        let started = Instant::now();
        let film = device::trace(&mut renderer, 1 << 20).unwrap();
        let seconds = started.elapsed().as_secs_f64();
        let leaks: f64 = film.pixels().map(|pixel| (pixel.mean[1] - 1.0) / 999.0 * f64::from(pixel.samples)).sum();
        (leaks.round(), seconds)
    };
    for (what, planted) in [("Pluecker", inside), ("Moeller and Trumbore", moeller_trumbore)] {
        let (leaks, seconds) = trace(planted);
        eprintln!("| rays of 2^20 that leave a closed mesh, {what}, {seconds:.2} s | 0 | {leaks} | | |");
        assert!(planted != inside || leaks == 0.0);
    }
}

/// Sums of up to 2^26 samples in one pixel are exact to the rounding of each sample.
#[test]
fn many_samples_in_one_pixel() {
    let gpu = device::gpu();
    let log2: u32 = if std::env::var_os("FOVEA_LONG_RUNS").is_some() { 26 } else { 21 };
    let options = RendererOptions { film: FilmOptions::perspective(1, 1, 1.0), ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    // A third has no end in binary; every 64th sample is a thousand times as bright.
    let body = "    radiance = vec3f(select(1.0, 1000.0, index % 64u == 0u) / 3.0);\n    pixel = 0u;\n";
    instead_of_paths(&mut renderer, Clone::clone, ["", "", body]);
    renderer.set_scene(&scenes::empty(Vec3::splat(400.0))).unwrap();
    let film = device::trace(&mut renderer, 1 << log2).unwrap();
    let pixel = film.pixel(0);
    let expected = (63.0 + 1000.0) / 64.0 / 3.0;
    let square = (63.0 + 1e6) / 64.0 / 9.0;
    let error = (pixel.mean[1] - expected) / expected;
    let deviation = (square - expected * expected).sqrt() / f64::from(1u32 << log2).sqrt();
    eprintln!("| 2^{log2} samples in one pixel | {expected:.6e} | {:.6e} | | {error:+.1e} |", pixel.mean[1]);
    assert!(error.abs() < 1e-7, "{error:e}");
    assert!((pixel.variance_of_mean.sqrt() / deviation - 1.0).abs() < 1e-4, "{pixel:?}");
    compare_sums(log2, expected);
}

/// What other ways to sum would have given, and what one addition costs on one core.
fn compare_sums(log2: u32, expected: f64) {
    let value = |i: u32| if i.is_multiple_of(64) { 1000.0 } else { 1.0 } / 3.0f32;
    let count = 1u32 << log2;
    let report = |what: &str, sum: f64, started: Instant| {
        let nanoseconds = started.elapsed().as_secs_f64() * 1e9 / f64::from(count);
        let error = sum / f64::from(count) / expected - 1.0;
        eprintln!("| the same by {what}, {nanoseconds:.2} ns each on a core | {expected:.6e} | | | {error:+.1e} |");
        error.abs()
    };
    let started = Instant::now();
    let plain = (0..count).fold(0.0f32, |sum, i| sum + value(i));
    let plain = report("a plain f32 sum", plain.into(), started);
    let started = Instant::now();
    let (kahan, _) = (0..count).fold((0.0f32, 0.0f32), |(sum, lost), i| {
        let term = value(i) - lost;
        let next = sum + term;
        (next, (next - sum) - term)
    });
    let kahan = report("a compensated f32 sum", kahan.into(), started);
    let started = Instant::now();
    let integer = (0..count).fold(0u64, |sum, i| sum + (value(i) * 1_073_741_824.0) as u64);
    let integer = report("a 64-bit integer sum", integer as f64 / 1_073_741_824.0, started);
    assert!(kahan < 1e-6 && integer < 1e-6 && plain > integer);
}

/// A film of 16384x8192 pixels (5.4 GB; 4096x2048 unless long runs are asked for) takes samples everywhere and loses none.
#[test]
fn a_film_of_134_million_pixels() {
    let gpu = device::gpu();
    let is_long = std::env::var_os("FOVEA_LONG_RUNS").is_some();
    let film = if is_long { FilmOptions::equirect(16_384, 8192) } else { FilmOptions::equirect(4096, 2048) };
    let options = RendererOptions { film, max_bounces: 0, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
    renderer.set_scene(&scenes::empty(Vec3::ONE)).unwrap();
    let samples = 1u64 << 20;
    let snapshot = device::trace(&mut renderer, samples).unwrap();
    let (mut counted, mut top, mut bottom) = (0, 0, 0);
    let half = film.pixels() / 2;
    for (index, words) in (0u64..).zip(snapshot.words.chunks_exact(FILM_WORDS as usize)) {
        counted += u64::from(words[6]);
        *(if index < half { &mut top } else { &mut bottom }) += u64::from(words[6]);
    }
    eprintln!("| film of {}x{}: samples counted | {samples} | {counted} | | |", film.width, film.height);
    assert_eq!(counted, samples);
    assert!((top as f64 / bottom as f64 - 1.0).abs() < 0.01, "{top} {bottom}");
}

/// What the room shows when rays start closer to their surface than its rounding: the cases above do notice.
#[test]
fn an_offset_that_is_too_small_is_noticed() {
    let gpu = device::gpu();
    let centre = Vec3::new(1e3, -5e2, 2e3);
    let scene = room(centre, 1.0, |_, _| {});
    let ray = [centre + Vec3::new(0.1, -0.2, 0.3), centre + Vec3::new(0.7, 0.5, -0.4)];
    let offset = "s.position_error = magnitude * 1.9073486e-6;";
    for log2 in [-19i32, -21, -23, -25, -27] {
        let planted = format!("s.position_error = magnitude * {:e};", 4.0 * 2f64.powi(log2));
        let found = measure(&gpu, &scene, ray, BOUNCES, SAMPLES, |renderer| {
            if log2 != -21 {
                let sources = exchanged(renderer.shaders(), "scene::surface", &[(offset, &planted)]);
                renderer.set_shaders(sources).unwrap();
            }
        });
        let relative = found.mean / closed_furnace() - 1.0;
        eprintln!(
            "| offset of 2^{} of the coordinate, 1e3 m off | {:.6e} | {:.6e} | {:.1e} | {relative:+.1e} |",
            log2 + 2,
            closed_furnace(),
            found.mean,
            found.error
        );
        if log2 == -27 {
            assert!(relative.abs() > 0.01, "2^-25 of the coordinate is below its rounding, and nothing shows");
        }
    }
}
