//! Lights that are surfaces: what covers them in part, what lies over them and where they coincide, by closed forms.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::{f64::consts::PI, sync::Arc};

use fovea_tests::{
    device,
    known::{SAMPLES, assert_is, corner_form_factor, floor, measure_by},
    scenes::{Builder, emitter},
};
use glam::{Vec3, Vec4};
use tracer::{
    gpu::Gpu,
    renderer::SamplingTechnique,
    scene::{AlphaMode, Material, Scene, TexelEncoding},
};

/// Of the floor.
const ALBEDO: f32 = 0.8;
/// From the floor straight up to the middle of the lamp, and half its side.
const HEIGHT: f32 = 1.0;
const HALF: f32 = 1.0;
/// A camera between floor and lamp.
const RAY: [Vec3; 2] = [Vec3::new(0.3, 0.5, 0.1), Vec3::ZERO];

/// A lamp whose front looks down.
fn lamp(builder: &mut Builder, material: u32) {
    builder.quad(Vec3::new(-HALF, HEIGHT, -HALF), Vec3::X * (2.0 * HALF), Vec3::Z * (2.0 * HALF), material);
}

/// Of the floor below a lamp of radiance 1.
fn below_the_lamp() -> f64 {
    f64::from(ALBEDO) * 4.0 * corner_form_factor(HALF.into(), HALF.into(), HEIGHT.into())
}

/// Of a floor below what `add` builds, by light sampling, BSDF sampling and both.
fn assert_floor(gpu: &Gpu, what: &str, expected: f64, scene: &Scene) {
    for technique in [SamplingTechnique::Lights, SamplingTechnique::Bsdf, SamplingTechnique::Both] {
        let value = measure_by(gpu, scene, RAY, 1, (technique, 2 * SAMPLES));
        assert_is(&format!("{what}, {technique:?}"), value, expected);
    }
}

/// Of what alpha leaves of a lamp, light arrives in proportion: by a factor, by a texture, by vertices.
#[test]
fn alpha_takes_from_what_a_lamp_sends() {
    let gpu = device::gpu();
    let mask = AlphaMode::Mask { cutoff: 0.5 };
    for (what, alpha_mode, alpha, texels, share) in [
        ("opaque, whatever its alpha", AlphaMode::Opaque, 0.2, None, 1.0),
        ("half blended", AlphaMode::Blend, 0.5, None, 0.5),
        ("blended away", AlphaMode::Blend, 0.0, None, 0.0),
        ("kept by a mask", mask, 0.6, None, 1.0),
        ("cut out", mask, 0.2, None, 0.0),
        ("blended by a texture", AlphaMode::Blend, 1.0, Some([51, 204]), 0.5),
        ("cut out by a texture", mask, 1.0, Some([0, 255]), 0.5),
    ] {
        let mut builder = Builder::new(Vec3::ZERO);
        floor(&mut builder, ALBEDO);
        let base_color_texture =
            texels.map(|texels| builder.texture(2, TexelEncoding::Srgb, texels.map(|a| [0, 0, 0, a]).to_vec()));
        let base_color = Vec4::new(0.0, 0.0, 0.0, alpha);
        let material = Material { alpha_mode, base_color, base_color_texture, ..emitter(Vec3::ONE) };
        let material = builder.material(material);
        lamp(&mut builder, material);
        assert_floor(&gpu, what, share * below_the_lamp(), &builder.build());
    }
    // From nothing at -X to all at +X.
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, ALBEDO);
    let material = builder.material(Material { alpha_mode: AlphaMode::Blend, ..emitter(Vec3::ONE) });
    lamp(&mut builder, material);
    let mut scene = builder.build();
    let mesh = Arc::make_mut(scene.meshes.last_mut().unwrap());
    mesh.colors = mesh.positions.iter().map(|p| Vec4::new(1.0, 1.0, 1.0, 0.5 + 0.5 * p.x / HALF)).collect();
    assert_floor(&gpu, "blended by its vertices", 0.5 * below_the_lamp(), &scene);
}

/// A lamp that is there twice lights once, whichever way its corners go round, zeros are signed and its sides emit.
#[test]
fn lamps_in_the_same_place_are_one() {
    let gpu = device::gpu();
    let expected = f64::from(ALBEDO) * 2.0 * corner_form_factor(2.0 * f64::from(HALF), HALF.into(), HEIGHT.into());
    let (x, z) = (Vec3::X * (2.0 * HALF), Vec3::Z * (2.0 * HALF));
    let corner = Vec3::new(0.0, HEIGHT, -HALF);
    let same = (corner, x, z);
    let negative_zero = (Vec3::new(-0.0, HEIGHT, -HALF), x, z);
    let from_the_other_end = (corner + x + z, -x, -z);
    let turned_over = (corner, z, x);
    for (what, (corner, edge_1, edge_2), double_sided, is_first) in [
        ("the same", same, false, false),
        ("another zero", negative_zero, false, false),
        ("from the other end", from_the_other_end, false, false),
        ("both sides", same, true, false),
        ("both sides, before", same, true, true),
        ("both sides, turned over", turned_over, true, false),
    ] {
        let mut builder = Builder::new(Vec3::ZERO);
        floor(&mut builder, ALBEDO);
        let one_side = builder.material(emitter(Vec3::ONE));
        let copy = builder.material(Material { double_sided, ..emitter(Vec3::ONE) });
        if is_first {
            builder.quad(corner, edge_1, edge_2, copy);
        }
        builder.quad(same.0, same.1, same.2, one_side);
        if !is_first {
            builder.quad(corner, edge_1, edge_2, copy);
        }
        assert_floor(&gpu, what, expected, &builder.build());
    }
}

/// Reflectance of a boundary between air and an index of 1.5.
fn fresnel(cosine: f64) -> f64 {
    let inside = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
    let s = (cosine - 1.5 * inside) / (cosine + 1.5 * inside);
    let p = (1.5 * cosine - inside) / (1.5 * cosine + inside);
    0.5 * (s * s + p * p)
}

/// A coat lets through what it does not reflect: seen under an angle, and on the floor by quadrature over the lamp.
#[test]
fn a_clearcoat_lies_over_what_a_lamp_sends() {
    let gpu = device::gpu();
    let clearcoat = 0.8;
    let let_through = |cosine: f64| 1.0 - f64::from(clearcoat) * fresnel(cosine);
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, ALBEDO);
    let coated = builder.material(Material { clearcoat, ..emitter(Vec3::ONE) });
    lamp(&mut builder, coated);
    let scene = builder.build();
    for below in [0.9f32, 0.2] {
        let eye = Vec3::new(-1.0, HEIGHT - below, 0.0);
        let value = measure_by(&gpu, &scene, [eye, Vec3::Y * HEIGHT], 0, (SamplingTechnique::Both, SAMPLES));
        assert_is("seen", value, let_through(f64::from(below / (1.0 + below * below).sqrt())));
    }
    const CELLS: u32 = 400;
    let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(CELLS) * 2.0 - 1.0) * f64::from(HALF);
    let area = (2.0 * f64::from(HALF) / f64::from(CELLS)).powi(2);
    let irradiance: f64 = (0..CELLS * CELLS)
        .map(|cell| {
            let distance2 = at(cell % CELLS).powi(2) + f64::from(HEIGHT).powi(2) + at(cell / CELLS).powi(2);
            let cosine = f64::from(HEIGHT) / distance2.sqrt();
            let_through(cosine) * cosine * cosine / distance2 * area
        })
        .sum();
    assert_floor(&gpu, "coated lamp", f64::from(ALBEDO) * irradiance / PI, &scene);
}
