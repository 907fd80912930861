//! Instances that mirror their mesh, in the static mesh and with a hierarchy of their own: fronts stay in front, textures and
//! tangents where they are, by closed forms.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f64::consts::PI;

use fovea_tests::{
    device,
    known::{assert_is, corner_form_factor, floor, measure, measure_by},
    scenes::{Builder, emitter, lambert},
};
use glam::{Affine3A, DVec3, Quat, Vec2, Vec3};
use tracer::{
    distribution::Distribution,
    features::Feature,
    film::FilmOptions,
    gpu::Gpu,
    kernels::Kernel,
    renderer::{Renderer, RendererOptions, SamplingTechnique},
    scene::{Material, PunctualKind, PunctualLight, Scene, TexelEncoding},
};

/// Cells along the edge of a grid: one of two triangles a cell, placed twice, is too large for the static mesh, and so are six of the
/// other.
const FLOOR_CELLS: u16 = 91;
const BOX_CELLS: u16 = 37;
const MIRROR: Vec3 = Vec3::new(-1.0, 1.0, 1.0);

/// A parallelogram of small ones; its front is on the side of `x` x `y`.
fn grid(corner: Vec3, x: Vec3, y: Vec3, cells: u16) -> Vec<[Vec3; 3]> {
    let at = |i: u16, j: u16| corner + (x * f32::from(i) + y * f32::from(j)) / f32::from(cells);
    let cell = |i: u16, j: u16| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
    (0..cells)
        .flat_map(|j| (0..cells).map(move |i| (i, j)))
        .map(|(i, j)| cell(i, j))
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect()
}

/// A closed box of 2 metres about the origin, fronts outside.
fn fine_box() -> Vec<[Vec3; 3]> {
    let faces = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)];
    let both = faces.into_iter().flat_map(|(x, y)| [(x, y), (y, x)]);
    both.flat_map(|(x, y)| grid(x.cross(y) - x - y, x * 2.0, y * 2.0, BOX_CELLS)).collect()
}

/// The mesh mirrored in x, and a copy far away that keeps both out of the static mesh when asked for.
fn mirrored(mut builder: Builder, mesh: u32, material: u32, is_placed: bool) -> Scene {
    builder.place(mesh, material, Affine3A::from_scale(MIRROR));
    if is_placed {
        let black = builder.material(lambert(Vec3::ZERO));
        builder.place(mesh, black, Affine3A::from_translation(Vec3::Y * -500.0));
    }
    builder.build()
}

/// Whether the kernels have two levels, as they are to.
fn assert_placed(gpu: &Gpu, scene: &Scene, is_placed: bool) {
    let everywhere = Distribution::omnidirectional(device::inverse());
    let options = RendererOptions { film: FilmOptions::equirect(2, 1), ..Default::default() };
    let mut renderer = Renderer::new(gpu, &options, everywhere).unwrap();
    renderer.set_scene(scene).unwrap();
    assert_eq!(renderer.key(Kernel::Trace).features.contains(Feature::Instances), is_placed);
}

/// A white box in a furnace is 1, one that emits from its fronts alone shows that, and light that goes straight through a box of
/// absorbing glass is what Fresnel's and Beer's laws leave, all reflections summed.
#[test]
fn boxes_are_not_inside_out() {
    let gpu = device::gpu();
    let glass = Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        ior: 1.5,
        attenuation_color: Vec3::splat(0.5),
        attenuation_distance: 2.0,
        ..Default::default()
    };
    let through_glass = 0.04 + 0.96 * 0.96 * 0.5 / (1.0 - 0.04 * 0.5);
    for (what, material, expected) in
        [("white", lambert(Vec3::ONE), 1.0), ("emits", emitter(Vec3::splat(3.0)), 3.0), ("glass", glass, through_glass)]
    {
        for is_placed in [false, true] {
            let mut builder = Builder::new(Vec3::ONE);
            let mesh = builder.triangles(&fine_box(), &[]);
            let material = builder.material(material.clone());
            let scene = mirrored(builder, mesh, material, is_placed);
            assert_placed(&gpu, &scene, is_placed);
            let value = measure(&gpu, &scene, [Vec3::new(0.3, 0.2, 5.0), Vec3::new(0.3, 0.2, 0.0)], 64);
            assert_is(&format!("{what}, placed: {is_placed}"), value, expected);
        }
    }
}

/// A map that tilts the normal along +X of the texture does so along -X of the mirrored floor, and across it as before.
#[test]
fn tangent_frames_are_mirrored() {
    let gpu = device::gpu();
    let texel = [204u8, 90, 220, 255];
    let [x, y, z] = [0, 1, 2].map(|channel| f64::from(texel[channel]) / 255.0 * 2.0 - 1.0);
    // Green is along -Z.
    let mapped = DVec3::new(-x, z, -y).normalize();
    let to_sun = DVec3::new(-0.6, 0.64, 0.48);
    let (tan2_tilt, tan2_light) = (mapped.y.powi(-2) - 1.0, to_sun.y.powi(-2) - 1.0);
    let unmasked = 2.0 / (1.0 + (1.0 + (tan2_tilt / 8.0).min(1.0) * tan2_light).sqrt());
    for is_placed in [false, true] {
        let mut builder = Builder::new(Vec3::ZERO);
        let map = builder.texture(1, TexelEncoding::Linear, vec![texel]);
        let material = builder.material(Material { normal_texture: Some(map), ..lambert(Vec3::splat(0.4)) });
        let corner = Vec3::new(-20.0, 0.0, -20.0);
        let mesh = builder.triangles(&grid(corner, Vec3::Z * 40.0, Vec3::X * 40.0, FLOOR_CELLS), &[]);
        builder.light(PunctualLight {
            name: String::new(),
            kind: PunctualKind::Directional { angular_diameter: 0.0 },
            intensity: Vec3::splat(5.0),
            position: Vec3::ZERO,
            rotation: Quat::from_rotation_arc(Vec3::NEG_Z, -to_sun.as_vec3()),
        });
        let scene = mirrored(builder, mesh, material, is_placed);
        assert_placed(&gpu, &scene, is_placed);
        let value = measure(&gpu, &scene, [Vec3::new(-3.0, 2.0, 0.1), Vec3::new(0.05, 0.0, 0.1)], 1);
        assert_is(&format!("tilted, placed: {is_placed}"), value, 5.0 * 0.4 / PI * mapped.dot(to_sun) * unmasked);
    }
}

/// A lamp whose texture is white on the half at -X lights the floor from +X when it is mirrored.
#[test]
fn textured_lamps_are_sampled_where_they_are_lit() {
    let gpu = device::gpu();
    let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x, 1.5, z));
    let [uv_a, uv_b, uv_c, uv_d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    // Dark crumbs make the mesh large enough.
    let crumbs = grid(Vec3::Y * 30.0, Vec3::X * 0.1, Vec3::Z * 0.1, FLOOR_CELLS);
    let corners = [vec![[a, b, c], [a, c, d]], crumbs].concat();
    let mut uvs = vec![[Vec2::new(0.75, 0.5); 3]; corners.len()];
    uvs[..2].copy_from_slice(&[[uv_a, uv_b, uv_c], [uv_a, uv_c, uv_d]]);
    let strip = |width: f64| 2.0 * corner_form_factor(width, 1.0, 1.5);
    for (is_placed, double_sided) in [(false, false), (true, false), (true, true)] {
        let mut builder = Builder::new(Vec3::ZERO);
        floor(&mut builder, 0.7);
        let halves = builder.texture(2, TexelEncoding::Srgb, vec![[255; 4], [0, 0, 0, 255]]);
        let lamp = Material { emissive_texture: Some(halves), double_sided, ..emitter(Vec3::splat(3.0)) };
        let lamp = builder.material(lamp);
        let mesh = builder.triangles(&corners, &uvs);
        let scene = mirrored(builder, mesh, lamp, is_placed);
        assert_placed(&gpu, &scene, is_placed);
        for (x, factor) in [(0.5, 2.0 * strip(0.5)), (-0.5, strip(1.5) - strip(0.5))] {
            for technique in [SamplingTechnique::Lights, SamplingTechnique::Both] {
                let ray = [Vec3::new(x, 1.0, 0.0), Vec3::new(x, 0.0, 0.0)];
                let value = measure_by(&gpu, &scene, ray, 1, (technique, 1 << 18));
                let what = format!("placed: {is_placed}, double-sided: {double_sided}, {technique:?}, at {x}");
                assert_is(&what, value, 0.7 * 3.0 * factor);
            }
        }
    }
}
