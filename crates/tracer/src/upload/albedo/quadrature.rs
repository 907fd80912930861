//! The quadrature in f64 that the stored tables of albedos come from.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::kernels::{ALBEDO_COLUMNS, ALBEDO_ROWS, GLASS_LAYERS, GLASS_SIZE};

/// Reflection, sheen and glass, row by row, each entry a pair of directional albedos in 0..=1 or of ratios of such: GGX with
/// height-correlated masking, Charlie sheen (Estevez and Kulla 2017), rough dielectric boundaries (Walter et al. 2007). What
/// `assets/lobe_tables.bin` holds; takes half a second of two cores.
pub fn lobe_albedos() -> [Vec<[f32; 2]>; 3] {
    [reflection(), sheen(), glass()]
}

/// A Fibonacci lattice in the unit square: number of points and the generator.
#[derive(Clone, Copy)]
struct Lattice(u32, u32);

impl Lattice {
    /// The first coordinate is at midpoints, the second covers a period.
    fn points(self) -> impl Iterator<Item = (f64, f64)> {
        let n = f64::from(self.0);
        (0..self.0).map(move |i| ((f64::from(i) + 0.5) / n, f64::from(i * self.1 % self.0) / n))
    }
}

/// Errors up to 2e-4.
const FINE: Lattice = Lattice(987, 610);
/// Errors up to 4e-4.
const COARSE: Lattice = Lattice(610, 377);
/// Entries are raised by this fraction: what they divide then never gains energy through interpolation and quadrature.
const SAFETY: f64 = 2.5e-3;
/// Likewise for the coarser table of glass.
const GLASS_SAFETY: f64 = 2e-3;
/// Likewise for sheen, which bends sharply where it is smooth and grazing.
const SHEEN_SAFETY: f64 = 4e-3;
/// Smallest cosine that a table has an entry for: the shaders' outgoing directions are no flatter.
const LEAST_COSINE: f64 = 1e-4;
/// Square of `LEAST_SHEEN_ROUGHNESS` of `shaders/shading/sheen.wesl`.
const LEAST_SHEEN_ALPHA: f64 = 0.01;

/// Rows of alpha, columns of cosine: GGX with f0 = 1 and f90 = 0, then with f0 = 0 and f90 = 1.
fn reflection() -> Vec<[f32; 2]> {
    let entry = |i: u32| {
        let cosine = node(i % ALBEDO_COLUMNS, ALBEDO_COLUMNS).max(LEAST_COSINE);
        ggx_albedos(cosine, node(i / ALBEDO_COLUMNS, ALBEDO_ROWS), FINE).map(|albedo| raised(albedo, SAFETY))
    };
    (0..ALBEDO_COLUMNS * ALBEDO_ROWS).into_par_iter().map(entry).collect()
}

/// White sheen: rows of the fourth root of alpha from the least one to 1, columns of cosine; the second number is unused.
fn sheen() -> Vec<[f32; 2]> {
    let entry = |i: u32| {
        let cosine = node(i % ALBEDO_COLUMNS, ALBEDO_COLUMNS).max(LEAST_COSINE);
        let share = f64::from(i / ALBEDO_COLUMNS) / f64::from(ALBEDO_ROWS - 1);
        let least = LEAST_SHEEN_ALPHA.powf(0.25);
        let alpha = (least + share * (1.0 - least)).powi(4);
        [raised(charlie_albedo(cosine, alpha, FINE), SHEEN_SAFETY), 0.0]
    };
    (0..ALBEDO_COLUMNS * ALBEDO_ROWS).into_par_iter().map(entry).collect()
}

/// Per index a square of rows of alpha and columns of cosine: reflected, then transmitted, over the albedo of a perfect
/// reflector of the same roughness, which leaves little to interpolate.
fn glass() -> Vec<[f32; 2]> {
    let entry = |i: u32| {
        let (column, row) = (i % GLASS_SIZE, i / GLASS_SIZE);
        let cosine = node(column, GLASS_SIZE).max(LEAST_COSINE);
        let alpha = node(row % GLASS_SIZE, GLASS_SIZE);
        // The ends, where one index is infinitely above the other, only have to be finite.
        let root = 2.0 * f64::from(row / GLASS_SIZE) / f64::from(GLASS_LAYERS - 1) - 1.0;
        let z = (root * root.abs()).clamp(-0.999, 0.999);
        let white = ggx_albedos(cosine, alpha, COARSE).iter().sum::<f64>();
        let glass = glass_albedos(cosine, alpha, (1.0 + z) / (1.0 - z), COARSE);
        glass.map(|albedo| raised(albedo / white, GLASS_SAFETY))
    };
    (0..GLASS_SIZE * GLASS_SIZE * GLASS_LAYERS).into_par_iter().map(entry).collect()
}

/// Value of cosine or alpha at an entry.
fn node(index: u32, count: u32) -> f64 {
    (f64::from(index) / f64::from(count - 1)).powi(2)
}

fn raised(albedo: f64, safety: f64) -> f32 {
    (albedo * (1.0 + safety)) as f32
}

/// Smith's Lambda of isotropic GGX.
fn lambda(cosine: f64, alpha: f64) -> f64 {
    let tan2 = (1.0 - cosine * cosine) / (cosine * cosine).max(1e-20);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// A normal that is visible from an outgoing direction.
struct VisibleNormal {
    /// Cosine to the surface's normal.
    normal: f64,
    /// Cosine to the outgoing direction.
    half: f64,
    /// Its share; shares sum to about 1.
    share: f64,
}

/// Normals visible from `cosine` (Dupuy and Benyoub 2023) by a lattice, finer towards the normals near the horizon, whose
/// reflections are masked most.
fn visible_normals(cosine: f64, alpha: f64, lattice: Lattice) -> impl Iterator<Item = VisibleNormal> {
    let sine = (1.0 - cosine * cosine).sqrt();
    let length = (sine * sine * alpha * alpha + cosine * cosine).sqrt();
    let (x, z) = (sine * alpha / length, cosine / length);
    lattice.points().map(move |(rest, turns)| {
        let cap_z = rest * rest * (1.0 + z) - z;
        let radius = (1.0 - cap_z * cap_z).max(0.0).sqrt();
        let (sin, cos) = (2.0 * PI * turns).sin_cos();
        let h = [(radius * cos + x) * alpha, radius * sin * alpha, cap_z + z];
        let norm = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt().max(1e-300);
        VisibleNormal {
            normal: h[2] / norm,
            half: ((h[0] * sine + h[2] * cosine) / norm).min(1.0),
            share: 2.0 * rest / f64::from(lattice.0),
        }
    })
}

/// Albedos of GGX with height-correlated masking: Schlick's Fresnel term of (f0, f90) = (1, 0) and (0, 1).
fn ggx_albedos(cosine: f64, alpha: f64, lattice: Lattice) -> [f64; 2] {
    let own = lambda(cosine, alpha);
    let mut sums = [0.0; 2];
    for VisibleNormal { normal, half, share } in visible_normals(cosine, alpha, lattice) {
        let incident = 2.0 * half * normal - cosine;
        if incident > 0.0 {
            let weight = share * (1.0 + own) / (1.0 + own + lambda(incident, alpha));
            let grazing = (1.0 - half).powi(5);
            sums[0] += weight * (1.0 - grazing);
            sums[1] += weight * grazing;
        }
    }
    sums
}

/// Reflected and transmitted albedo of a rough dielectric boundary (Walter et al. 2007); `eta` = far over near index.
fn glass_albedos(cosine: f64, alpha: f64, eta: f64, lattice: Lattice) -> [f64; 2] {
    let own = lambda(cosine, alpha);
    let masking = |incident: f64| (1.0 + own) / (1.0 + own + lambda(incident, alpha));
    let mut sums = [0.0; 2];
    for VisibleNormal { normal, half, share } in visible_normals(cosine, alpha, lattice) {
        let fresnel = fresnel_dielectric(half, eta);
        let reflected = 2.0 * half * normal - cosine;
        if reflected > 0.0 {
            sums[0] += share * fresnel * masking(reflected);
        }
        let sin2 = (1.0 - half * half) / (eta * eta);
        if sin2 < 1.0 {
            let transmitted = cosine / eta - (half / eta - (1.0 - sin2).sqrt()) * normal;
            if transmitted > 0.0 {
                sums[1] += share * (1.0 - fresnel) * masking(transmitted);
            }
        }
    }
    sums
}

fn fresnel_dielectric(cosine: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cosine * cosine) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let transmitted = (1.0 - sin2).sqrt();
    let parallel = (eta * cosine - transmitted) / (eta * cosine + transmitted);
    let perpendicular = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Logarithm of the sheen's Lambda, as Estevez and Kulla 2017 fit it.
fn charlie_fit(x: f64, alpha: f64) -> f64 {
    let t = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f64, smooth: f64| rough + (smooth - rough) * t;
    let [a, b, c] = [mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)];
    a / (1.0 + b * x.max(1e-6).powf(c)) + mix(-1.97760, -1.27393) * x + mix(-4.32054, -4.85967)
}

fn charlie_lambda(cosine: f64, alpha: f64) -> f64 {
    let log = if cosine < 0.5 {
        charlie_fit(cosine, alpha)
    } else {
        2.0 * charlie_fit(0.5, alpha) - charlie_fit(1.0 - cosine, alpha)
    };
    log.exp()
}

/// Albedo of white sheen over the incident directions of a lattice, finer towards grazing ones.
fn charlie_albedo(cosine: f64, alpha: f64, lattice: Lattice) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt();
    let own = charlie_lambda(cosine, alpha);
    let value = |(root, turns): (f64, f64)| {
        let z = root * root;
        let radius = (1.0 - z * z).sqrt();
        let masking = 1.0 / ((1.0 + own + charlie_lambda(z, alpha)) * 4.0 * cosine);
        let (sin, cos) = (2.0 * PI * turns).sin_cos();
        let half = [radius * cos + sine, radius * sin, z + cosine];
        let horizontal = half[0] * half[0] + half[1] * half[1];
        let sin2 = horizontal / (horizontal + half[2] * half[2]);
        (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) * masking * 2.0 * root
    };
    lattice.points().map(value).sum::<f64>() / f64::from(lattice.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINEST: Lattice = Lattice(4181, 2584);

    /// As the shader interpolates; `row` in 0..=1.
    fn looked_up(table: &[[f32; 2]], cosine: f64, row: f64) -> [f64; 2] {
        let place = |share: f64, count: u32| {
            let p = share * f64::from(count - 1);
            let cell = (p as u32).min(count - 2);
            (cell, p - f64::from(cell))
        };
        let ((x, fx), (y, fy)) = (place(cosine.sqrt(), ALBEDO_COLUMNS), place(row, ALBEDO_ROWS));
        let at = |x: u32, y: u32, k: usize| f64::from(table[(y * ALBEDO_COLUMNS + x) as usize][k]);
        std::array::from_fn(|k| {
            let low = at(x, y, k) * (1.0 - fx) + at(x + 1, y, k) * fx;
            let high = at(x, y + 1, k) * (1.0 - fx) + at(x + 1, y + 1, k) * fx;
            low * (1.0 - fy) + high * fy
        })
    }

    /// Integral of the lobe over incident directions instead of visible normals: an oracle that shares only the formulas of
    /// GGX, written from their definitions.
    fn ggx_albedo_by_directions(cosine: f64, alpha: f64) -> f64 {
        const STEPS: u32 = 1000;
        let sine = (1.0 - cosine * cosine).sqrt();
        let mut sum = 0.0;
        for i in 0..STEPS {
            let z = (f64::from(i) + 0.5) / f64::from(STEPS);
            let radius = (1.0 - z * z).sqrt();
            let shadowing = 1.0 / (1.0 + lambda(cosine, alpha) + lambda(z, alpha));
            for j in 0..STEPS {
                let (sin, cos) = (PI * (f64::from(j) + 0.5) / f64::from(STEPS)).sin_cos();
                let half = [radius * cos + sine, radius * sin, z + cosine];
                let norm2 = half.iter().map(|x| x * x).sum::<f64>();
                let cos2 = half[2] * half[2] / norm2;
                let density = alpha * alpha / (PI * (cos2 * (alpha * alpha - 1.0) + 1.0).powi(2));
                sum += density * shadowing / (4.0 * cosine);
            }
        }
        sum * 2.0 * PI / f64::from(STEPS * STEPS)
    }

    #[test]
    fn albedos_are_those_of_an_integral_over_directions() {
        for (cosine, alpha) in [(1.0, 1.0), (0.7, 0.5), (0.3, 0.25), (0.1, 0.6), (0.9, 0.09)] {
            let [near, grazing] = ggx_albedos(cosine, alpha, FINE);
            let oracle = ggx_albedo_by_directions(cosine, alpha);
            assert!((near + grazing - oracle).abs() < 4e-4, "{cosine} {alpha}: {} {oracle}", near + grazing);
        }
        // A smooth mirror loses nothing; glass of index 1 only passes light on.
        assert!((ggx_albedos(0.5, 1e-9, FINE).iter().sum::<f64>() - 1.0).abs() < 1e-6);
        let [reflected, transmitted] = glass_albedos(0.6, 1e-9, 1.5, FINE);
        assert!(
            (reflected - fresnel_dielectric(0.6, 1.5)).abs() < 1e-6 && (reflected + transmitted - 1.0).abs() < 1e-6
        );
        assert!(glass_albedos(0.6, 0.3, 1.0, FINE)[0] < 1e-12);
    }

    /// Between entries, and with coarser quadrature, the tables stay above the albedo and within 1 % of it.
    #[test]
    fn interpolated_albedos_err_to_the_safe_side() {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let [reflection, sheen, _] = lobe_albedos();
        for i in 0..40 {
            for j in 0..40 {
                let cosine = ((f64::from(i) + 0.37) / 40.0).powi(2);
                let roughness = 0.04 + 0.96 * (f64::from(j) + 0.61) / 40.0;
                let alpha = roughness * roughness;
                let [near, grazing] = looked_up(&reflection, cosine, roughness);
                let [true_near, true_grazing] = ggx_albedos(cosine, alpha, FINEST);
                let white = (near + grazing) / (true_near + true_grazing) - 1.0;
                if cosine > 0.01 {
                    (least, most) = (least.min(white), most.max(white));
                }
                if alpha >= LEAST_SHEEN_ALPHA && cosine > 0.01 {
                    let truth = charlie_albedo(cosine, alpha, FINEST);
                    let least = LEAST_SHEEN_ALPHA.powf(0.25);
                    let [sheen, _] = looked_up(&sheen, cosine, (roughness.sqrt() - least) / (1.0 - least));
                    assert!(sheen > truth && sheen < 1.015 * truth + 1e-3, "sheen {cosine} {alpha}: {sheen} {truth}");
                }
            }
        }
        eprintln!("tables over truth - 1: {least:.2e} to {most:.2e}");
        assert!(least > 0.0 && most < 0.01, "{least} {most}");
    }
}
