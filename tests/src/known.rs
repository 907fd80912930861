//! Radiance that is known in closed form, and what is measured held against it.

use std::f64::consts::PI;

use glam::Vec3;
use tracer::{gpu::Gpu, renderer::SamplingTechnique, scene::Scene};

use crate::{
    pencil,
    scenes::{Builder, lambert},
};

/// Of a value that is held against a closed form.
pub const SAMPLES: u64 = 1 << 17;
/// Where light sampling, BSDF sampling and both are compared.
pub const COMPARED_SAMPLES: u64 = 1 << 20;
/// Relative rounding of a path's arithmetic in f32.
pub const ROUNDING: f64 = 2e-5;

/// Mean luminance of a pencil of rays from `eye` to `target`, and its standard error; nothing is dropped or clamped.
///
/// # Panics
/// As [`measure_by`].
pub fn measure(gpu: &Gpu, scene: &Scene, [eye, target]: [Vec3; 2], max_bounces: u32) -> (f64, f64) {
    measure_by(gpu, scene, [eye, target], max_bounces, (SamplingTechnique::Both, SAMPLES))
}

/// The same by one way of sampling, from so many samples.
///
/// # Panics
/// When something is dropped or clamped, or the device refuses.
pub fn measure_by(
    gpu: &Gpu,
    scene: &Scene,
    ray: [Vec3; 2],
    max_bounces: u32,
    (technique, samples): (SamplingTechnique, u64),
) -> (f64, f64) {
    let found = pencil::measure(gpu, scene, ray, max_bounces, samples, |renderer| {
        renderer.set_technique(technique).expect("nothing is compiled yet");
    });
    assert_eq!((found.statistics.non_finite, found.statistics.clamped), (0, 0));
    (found.mean, found.error)
}

/// Within 3 standard errors, of at most 0.5 %.
///
/// # Panics
/// When it is not.
pub fn assert_is(what: &str, (mean, error): (f64, f64), expected: f64) {
    eprintln!("{what}: {mean:.6} +- {error:.6}, expected {expected:.6}");
    assert!(error <= 0.005 * expected, "{what}: too noisy for a claim");
    assert!((mean - expected).abs() <= 3.0 * error + ROUNDING * expected, "{what}");
}

/// Floor at y = 0, 40 metres wide.
pub fn floor(builder: &mut Builder, albedo: f32) {
    let material = builder.material(lambert(Vec3::splat(albedo)));
    builder.quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, material);
}

/// Form factor from a point to a parallel rectangle whose corner is straight above (Howell's catalogue, B-3).
pub fn corner_form_factor(a: f64, b: f64, height: f64) -> f64 {
    let (a, b) = (a / height, b / height);
    let part = |p: f64, q: f64| {
        let root = (1.0 + p * p).sqrt();
        p / root * (q / root).atan()
    };
    (part(a, b) + part(b, a)) / (2.0 * PI)
}

/// Light sampling, BSDF sampling and both give the closed form within 3 standard errors of at most 0.2 %; both together have
/// at most 1.1 times the variance of the better one, unless that one has none (a constant environment by BSDF sampling).
///
/// # Panics
/// When they do not.
pub fn assert_techniques_agree(gpu: &Gpu, what: &str, scene: &Scene, ray: [Vec3; 2], max_bounces: u32, expected: f64) {
    let variances = [SamplingTechnique::Lights, SamplingTechnique::Bsdf, SamplingTechnique::Both].map(|technique| {
        let value = measure_by(gpu, scene, ray, max_bounces, (technique, COMPARED_SAMPLES));
        assert_is(&format!("{what}, {technique:?}"), value, expected);
        assert!(value.1 <= 0.002 * expected, "{what}, {technique:?}: too noisy for a comparison");
        value.1 * value.1
    });
    let better = variances[0].min(variances[1]);
    if better > (ROUNDING * expected).powi(2) {
        eprintln!("{what}: variance of both over the better one {:.3}", variances[2] / better);
        assert!(variances[2] <= 1.1 * better, "{what}: both have more variance");
    }
}
