//! Every lobe's sample, density and value agree: chi-squared of sampled directions against the integrated density (as
//! Mitsuba's chi2 tests), albedo by sampling against the integral of the value, reciprocity where it holds.
//!
//! Fixed seeds. All chi-squared tests of a group together reject a right program with probability 1 % (Šidák).

use std::f64::consts::PI;

use fovea_tests::{
    device,
    lobes::{BINS, Bench, Outgoing},
    plant::exchanged,
    scenes::lambert,
    statistics,
};
use glam::{Vec3, Vec4};
use tracer::{
    gpu::Gpu,
    kernels::ShaderSources,
    scene::{Material, TexelEncoding},
};

const SAMPLES: u32 = 1 << 17;
const FAMILY_SIGNIFICANCE: f64 = 0.01;

/// From steep to grazing, off the tangent so that no symmetry hides a fault.
const ABOVE: [Outgoing; 3] = [
    Outgoing { cosine: 0.9, turns: 0.07, is_inside: false },
    Outgoing { cosine: 0.5, turns: 0.36, is_inside: false },
    Outgoing { cosine: 0.12, turns: 0.81, is_inside: false },
];
const BOTH_SIDES: [Outgoing; 4] = [
    Outgoing { cosine: 0.9, turns: 0.07, is_inside: false },
    Outgoing { cosine: 0.3, turns: 0.36, is_inside: false },
    Outgoing { cosine: 0.9, turns: 0.64, is_inside: true },
    Outgoing { cosine: 0.5, turns: 0.81, is_inside: true },
];

fn metal(roughness: f32) -> Material {
    Material { roughness, ..Default::default() }
}

fn dielectric(roughness: f32) -> Material {
    Material { roughness, metallic: 0.0, base_color: Vec4::splat(0.6), ..Default::default() }
}

fn glass(roughness: f32, transmission: f32) -> Material {
    Material { thickness: 1.0, transmission, ..dielectric(roughness) }
}

fn named<const N: usize>(list: [(&str, Material); N]) -> Vec<(String, Material)> {
    list.map(|(name, material)| (name.to_string(), material)).into()
}

/// Least p-value over a bench's cases; checks the share of valid samples and the albedo on the way.
fn check(gpu: &Gpu, what: &str, bench: &Bench, plant: impl Fn(&ShaderSources) -> ShaderSources) -> f64 {
    let _time = device::Stopwatch::start("chi-squared");
    let sampled = bench.sample(gpu, plant, SAMPLES);
    let integrated = bench.integrate(gpu);
    let n = f64::from(SAMPLES);
    let solid_angle = 4.0 * PI / f64::from(BINS);
    let mut least: f64 = 1.0;
    for case in 0..bench.cases() {
        let bins = (case * BINS) as usize..((case + 1) * BINS) as usize;
        let (sampled, integrated) = (&sampled[bins.clone()], &integrated[bins]);
        let mut observed: Vec<f64> = sampled.iter().map(|pixel| f64::from(pixel.samples)).collect();
        let mut expected: Vec<f64> = integrated.iter().map(|pixel| n * pixel.mean[0] * solid_angle).collect();
        let valid: f64 = observed.iter().sum();
        let mass: f64 = expected.iter().sum();
        let label = format!("{what}: {}", bench.label(case));
        let share_error = (valid / n * (1.0 - valid / n) / n).sqrt();
        // What fails is a bin of its own.
        observed.push(n - valid);
        expected.push((n - mass).max(0.0));
        let (p, statistic, freedom) = statistics::chi_squared_test(&observed, &expected);
        // Mean of the weights against the integral of the value.
        let albedo: f64 = integrated.iter().map(|pixel| pixel.mean[1] * solid_angle).sum();
        let mean = sampled.iter().map(|s| f64::from(s.samples) * s.mean[1]).sum::<f64>() / n;
        let square = |s: &tracer::film::FilmPixel| {
            let count = f64::from(s.samples);
            count * (s.mean[1] * s.mean[1] + s.variance_of_mean * count)
        };
        let error = ((sampled.iter().map(square).sum::<f64>() / n - mean * mean).max(0.0) / n).sqrt();
        eprintln!(
            "{label}: p = {p:.4} ({statistic:.0} of {freedom}), valid {:.4} of {:.4}, albedo {mean:.4} +- {error:.4} of {albedo:.4}",
            valid / n,
            mass / n
        );
        least = least.min(p);
        if p > 1e-6 {
            assert!((valid - mass).abs() / n <= 5.0 * share_error + 1e-3, "{label}: share of valid samples");
            assert!((mean - albedo).abs() <= 5.0 * error + 2e-3 * albedo, "{label}: albedo");
        }
    }
    least
}

fn assert_fits(gpu: &Gpu, what: &str, bench: &Bench) {
    let least = check(gpu, what, bench, Clone::clone);
    let significance = statistics::sidak(FAMILY_SIGNIFICANCE, bench.cases() as usize);
    assert!(least > significance, "{what}: least p-value {least:.1e} is not above {significance:.1e}");
}

#[test]
fn reflection() {
    let gpu = device::gpu();
    let materials = named([
        ("metal 0.3", metal(0.3)),
        ("metal 0.5", metal(0.5)),
        ("metal 1", metal(1.0)),
        ("dielectric 0.3", dielectric(0.3)),
        ("dielectric 0.8", dielectric(0.8)),
        ("half metal", Material { metallic: 0.5, ..dielectric(0.4) }),
        ("mirror over diffuse", dielectric(0.0)),
    ]);
    assert_fits(&gpu, "reflection", &Bench::new(materials, &ABOVE));
    // Narrower than the points of the integral where it grazes.
    assert_fits(&gpu, "smooth reflection", &Bench::new(named([("metal 0.2", metal(0.2))]), &ABOVE[..2]));
    let stretched = |roughness, anisotropy| Material { anisotropy, anisotropy_rotation: 0.6, ..metal(roughness) };
    let materials = named([
        ("stretched metal 0.3, 0.3", stretched(0.3, 0.3)),
        ("stretched metal 0.4, 1", stretched(0.4, 1.0)),
        ("stretched dielectric", Material { anisotropy: 0.7, ..dielectric(0.4) }),
    ]);
    assert_fits(&gpu, "anisotropy", &Bench::new(materials, &ABOVE));
}

#[test]
fn layers() {
    let gpu = device::gpu();
    let coated = |clearcoat_roughness, below| Material { clearcoat: 0.8, clearcoat_roughness, ..below };
    let sheen = |sheen_roughness, below| Material { sheen_color: Vec3::splat(0.7), sheen_roughness, ..below };
    let materials = named([
        ("coat 0.3 over metal", coated(0.3, metal(0.6))),
        ("coat 0.6 over dielectric", coated(0.6, dielectric(0.3))),
        ("smooth coat over metal", coated(0.0, metal(0.5))),
        ("sheen 0.4 over diffuse", sheen(0.4, lambert(Vec3::splat(0.5)))),
        ("sheen 1 over dielectric", sheen(1.0, dielectric(0.5))),
        ("coat over sheen", coated(0.4, sheen(0.7, dielectric(0.5)))),
    ]);
    assert_fits(&gpu, "layers", &Bench::new(materials, &ABOVE));
    let film = |below| Material { iridescence: 1.0, iridescence_thickness_nm: [100.0, 420.0], ..below };
    let materials = named([("film on metal", film(metal(0.4))), ("film on dielectric", film(dielectric(0.3)))]);
    assert_fits(&gpu, "iridescence", &Bench::new(materials, &ABOVE));
}

/// Geometric, shading and coat normals differ.
#[test]
fn bent_normals() {
    let gpu = device::gpu();
    let coated = |below| Material { clearcoat: 1.0, clearcoat_roughness: 0.4, ..below };
    let leaf = Material { diffuse_transmission: 0.4, ..lambert(Vec3::splat(0.7)) };
    let materials = named([
        ("coated metal", coated(metal(0.5))),
        ("coated dielectric", coated(dielectric(0.4))),
        ("leaf", leaf),
        ("diffuse", lambert(Vec3::splat(0.7))),
    ]);
    let mut bench = Bench::new(materials, &ABOVE);
    bench.geometric = Vec3::new(0.35, -0.2, 1.0);
    bench.with_textures = |builder, materials| {
        let map = builder.texture(1, TexelEncoding::Linear, vec![[170, 100, 235, 255]]);
        for material in materials.iter_mut().filter(|m| m.clearcoat > 0.0) {
            material.clearcoat_normal_texture = Some(map);
        }
    };
    assert_fits(&gpu, "bent normals", &bench);
}

#[test]
fn transmission() {
    let gpu = device::gpu();
    let thin = |roughness| Material { thickness: 0.0, ..glass(roughness, 0.7) };
    let leaf = Material { diffuse_transmission: 0.6, ..dielectric(0.5) };
    let materials = named([("thin 0.3", thin(0.3)), ("thin 0.8", thin(0.8)), ("leaf", leaf)]);
    assert_fits(&gpu, "sheets", &Bench::new(materials, &ABOVE));
    let materials = named([
        ("glass 0.3", glass(0.3, 1.0)),
        ("glass 0.6", glass(0.6, 1.0)),
        ("glass 1", glass(1.0, 1.0)),
        ("half glass 0.5", glass(0.5, 0.5)),
        ("diamond 0.4", Material { ior: 2.4, ..glass(0.4, 1.0) }),
        ("glass with a metal share", Material { metallic: 0.3, ..glass(0.4, 1.0) }),
    ]);
    assert_fits(&gpu, "glass", &Bench::new(materials, &BOTH_SIDES));
    let materials = named([("dispersive glass", Material { dispersion: 5.0, ..glass(0.3, 1.0) })]);
    assert_fits(&gpu, "dispersion", &Bench::new(materials, &BOTH_SIDES));
}

/// Visible normals drawn 10 % too narrow are caught.
#[test]
fn a_planted_fault_is_caught() {
    let gpu = device::gpu();
    let bench = Bench::new(named([("metal 0.5", metal(0.5))]), &ABOVE[..1]);
    let narrow = |sources: &ShaderSources| {
        let (before, after) = ("vec3f(cap.xy * alpha, max", "vec3f(cap.xy * (0.9 * alpha), max");
        exchanged(sources, "shading::microfacet", &[(before, after)])
    };
    assert!(check(&gpu, "fault", &bench, narrow) < 1e-12);
}

/// f(o, i) = f(i, o) for what is reciprocal: Lambert, sheen over black, and microfacets once the factor that depends on the
/// outgoing direction alone (compensation, and with it the share of layers below) is divided out. Refraction is reciprocal
/// up to the squared index, by which radiance is not scaled here.
#[test]
fn reciprocity() {
    let gpu = device::gpu();
    let relative_difference = |bench: &Bench, expression: &str| -> Vec<f64> {
        let body = format!(
            "    let v = vec3f(to_unit(independent_u32(index, 3u, batch.seed)), to_unit(independent_u32(index, 4u, batch.seed)), u.z);
    let o = normalize(vec3f(sqrt(1.0 - v.z * v.z) * cos_sin_turns(v.x), 0.02 + 0.98 * v.z));
    let i = normalize(vec3f(sqrt(1.0 - v.y * v.y) * cos_sin_turns(u.y), 0.02 + 0.98 * v.y));
{expression}
    pixel = case_index;
    radiance = vec3f(abs(f.x - f.y) / max(max(f.x, f.y), 1e-6));"
        );
        bench.run(&gpu, Clone::clone, (1, 1 << 14), &body).iter().map(|pixel| pixel.mean[1]).collect()
    };
    let same_side = "    let there = case_of(case_index, o, false);
    let back = case_of(case_index, i, false);
    var f = vec2f(evaluate_bsdf(there.b, o, i).value.y / i.z, evaluate_bsdf(back.b, i, o).value.y / o.z);";
    let straight = &ABOVE[..1];
    let materials = named([
        ("diffuse", lambert(Vec3::splat(0.7))),
        ("sheen", Material { sheen_color: Vec3::ONE, sheen_roughness: 0.5, ..lambert(Vec3::ZERO) }),
    ]);
    for (difference, what) in
        relative_difference(&Bench::new(materials, straight), same_side).iter().zip(["diffuse", "sheen"])
    {
        eprintln!("{what}: mean relative difference {difference:.1e}");
        assert!(*difference < 1e-4, "{what} is not reciprocal: {difference}");
    }
    let divided = format!("{same_side}\n    f /= vec2f(there.b.f0.y, back.b.f0.y);");
    let materials = || named([("metal 0.3", metal(0.3)), ("metal 0.9", metal(0.9))]);
    for difference in relative_difference(&Bench::new(materials(), straight), &divided) {
        eprintln!("metal, compensation divided out: mean relative difference {difference:.1e}");
        assert!(difference < 1e-4, "metal is not reciprocal: {difference}");
    }
    // The oracle notices what is not reciprocal: the compensation itself.
    let with_compensation = relative_difference(&Bench::new(materials(), straight), same_side);
    assert!(with_compensation[1] > 0.01, "compensation is view dependent: {with_compensation:?}");
    // From inside the surface the frame's z axis points the other way; x and y stay.
    let through = "    let there = case_of(case_index, o, false);
    let back = case_of(case_index, i, true);
    let out = vec3f(i.xy, -i.z);
    let home = vec3f(o.xy, -o.z);
    var f = vec2f(evaluate_bsdf(there.b, o, out).value.y / i.z / there.b.solid.y,
        evaluate_bsdf(back.b, i, home).value.y / o.z / back.b.solid.y);
    f.y *= there.b.eta * there.b.eta;";
    let materials = named([("glass 0.4", glass(0.4, 1.0)), ("glass 0.9", glass(0.9, 1.0))]);
    for difference in relative_difference(&Bench::new(materials, straight), through) {
        eprintln!("glass, compensation divided out: mean relative difference {difference:.1e}");
        assert!(difference < 1e-3, "refraction is not reciprocal up to the squared index: {difference}");
    }
}
