//! Kolmogorov-Smirnov on the radius and chi-squared on the sphere: every model, geometry and inverse, independent points,
//! fixed seeds. Significance: 1e-3 a test function, divided by its comparisons.
use crate::common::{SIGNIFICANCE, chi_squared_p, distributions, inverses, kolmogorov_smirnov_p, uniform};
use fovea_sampler::{Angle, GazeWarp, Geometry, Inverse, RadialDistribution, Reddy2001, gaze_frame};

fn radial(geometry: Geometry, e: Angle) -> f64 {
    if geometry == Geometry::Sphere { e.versine() } else { e.radians() }
}

/// The p-values themselves: textbook values.
#[test]
fn p_values_are_right() {
    // D = 1.6276 / sqrt(n) is the 1 % point, 1.3581 the 5 % point.
    assert!((kolmogorov_smirnov_p(1.6276e-4, 1e8) - 0.01).abs() < 1e-4);
    assert!((kolmogorov_smirnov_p(1.3581e-4, 1e8) - 0.05).abs() < 3e-4);
    // Chi-squared with 255 degrees of freedom: 1 % point 310.457.
    assert!((chi_squared_p(310.457, 255.0) - 0.01).abs() < 2e-4);
}

#[test]
fn radius_follows_the_implied_cdf() {
    const DRAWS: u32 = 20_000;
    let mut comparisons = Vec::new();
    for (seed, (name, distribution)) in distributions().iter().enumerate() {
        for inverse in inverses(distribution) {
            let mut at: Vec<f64> =
                (0..DRAWS).map(|i| inverse.implied_cdf(f64::from(inverse.eval(uniform(i, 0, seed as u32))))).collect();
            at.sort_by(f64::total_cmp);
            let n = f64::from(DRAWS);
            let d = at.iter().enumerate().fold(0.0, |d: f64, (i, f)| {
                let i = i as f64;
                d.max((f - i / n).abs()).max(((i + 1.0) / n - f).abs())
            });
            comparisons.push((format!("{name} {}", inverse.name()), kolmogorov_smirnov_p(d, n)));
        }
    }
    assert!(comparisons.len() > 100, "{}", comparisons.len());
    for (name, p) in &comparisons {
        assert!(*p > SIGNIFICANCE / comparisons.len() as f64, "{name}: p = {p:e}");
    }
}

/// World directions in the shader's f32 arithmetic, binned by their own angle and azimuth; expected counts are differences of
/// the implied CDF at angles that the bins fix.
#[test]
fn directions_follow_the_implied_density() {
    const DRAWS: u32 = 40_000;
    const RINGS: usize = 16;
    const SECTORS: usize = 16;
    let gazes = [[0.0, 0.0, -1.0], [0.6, 0.48, 0.64], [0.0, -1.0, 0.0]];
    let mut comparisons = Vec::new();
    for (k, (name, distribution)) in distributions().into_iter().enumerate() {
        for inverse in inverses(&distribution) {
            let name = format!("{name} {}", inverse.name());
            let geometry = inverse.geometry();
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            let gaze: [f64; 3] = gazes[k % gazes.len()];
            let [b1, b2, n] = gaze_frame(gaze);
            // Edges of equal probability under the exact distribution, so not of equal u under the inverse's.
            let edges: Vec<Angle> = (0..=RINGS).map(|i| distribution.quantile(i as f64 / RINGS as f64)).collect();
            let mut counts = vec![0_u32; RINGS * SECTORS];
            for i in 0..DRAWS {
                let u = [uniform(i, 0, 77 + k as u32), uniform(i, 1, 77 + k as u32)];
                let d = warp.sample_f32(u, gaze.map(|x| x as f32)).map(f64::from);
                let difference: [f64; 3] = core::array::from_fn(|j| d[j] - n[j]);
                let v = 0.5 * difference.iter().map(|x| x * x).sum::<f64>();
                let e = Angle::from_versine(v);
                let dot = |b: [f64; 3]| b.iter().zip(d).map(|(x, y)| x * y).sum::<f64>();
                let turns = (dot(b2).atan2(dot(b1)) / core::f64::consts::TAU).rem_euclid(1.0);
                let ring = edges.partition_point(|edge| *edge < e).clamp(1, RINGS) - 1;
                let sector = ((turns * SECTORS as f64) as usize).min(SECTORS - 1);
                counts[ring * SECTORS + sector] += 1;
            }
            let mut statistic = 0.0;
            for ring in 0..RINGS {
                let below = |i: usize| match i {
                    0 => 0.0,
                    RINGS => 1.0,
                    i => warp.inverse().implied_cdf(radial(geometry, edges[i])),
                };
                let expected = f64::from(DRAWS) * (below(ring + 1) - below(ring)) / SECTORS as f64;
                for sector in 0..SECTORS {
                    statistic += (f64::from(counts[ring * SECTORS + sector]) - expected).powi(2) / expected;
                }
            }
            comparisons.push((name, chi_squared_p(statistic, (RINGS * SECTORS - 1) as f64)));
        }
    }
    assert!(comparisons.len() > 100);
    for (name, p) in &comparisons {
        assert!(*p > SIGNIFICANCE / comparisons.len() as f64, "{name}: p = {p:e}");
    }
}

/// D of `draws` independent points of an inverse against the exact CDF, at 4096 radii: a lower bound of the full D.
fn distance_to_the_model(inverse: &Inverse, distribution: &RadialDistribution, draws: u32) -> f64 {
    const EDGES: usize = 4096;
    let last = distribution.cap().radians();
    let bin = |inverse: &Inverse, range: core::ops::Range<u32>| {
        let mut counts = vec![0_u64; EDGES];
        for i in range {
            let e = f64::from(inverse.eval(uniform(i, 0, 2017)));
            counts[((e / last * EDGES as f64) as usize).min(EDGES - 1)] += 1;
        }
        counts
    };
    let half = draws / 2;
    let (a, b) = std::thread::scope(|scope| {
        let other = scope.spawn(|| bin(inverse, half..draws));
        (bin(inverse, 0..half), other.join().unwrap())
    });
    let (mut below, mut d) = (0, 0.0_f64);
    for k in 0..EDGES {
        below += a[k] + b[k];
        let edge = Angle::from_radians(last * (k + 1) as f64 / EDGES as f64);
        d = d.max((below as f64 / f64::from(draws) - distribution.cdf(edge)).abs());
    }
    d
}

/// With 1e8 draws the statistics do tell Eq. 6 from the model it approximates, and do not tell a table.
#[test]
fn kolmogorov_smirnov_rejects_eq6_at_1e8_draws() {
    const DRAWS: u32 = 100_000_000;
    let distribution = RadialDistribution::koskela_2017();
    let eq6 = distance_to_the_model(&Inverse::eq6(), &distribution, DRAWS);
    assert!(kolmogorov_smirnov_p(eq6, f64::from(DRAWS)) < 1e-6, "D = {eq6:e}");
    let table = Inverse::with_form(&distribution, fovea_sampler::Form::Table(256)).unwrap();
    let exact = distance_to_the_model(&table, &distribution, DRAWS);
    assert!(kolmogorov_smirnov_p(exact, f64::from(DRAWS)) > SIGNIFICANCE, "D = {exact:e}");
}

/// The paper's geometry is further from the sphere than Eq. 6 is from the paper's model.
#[test]
fn the_plane_is_not_the_sphere() {
    let cap = Angle::from_degrees(80.0);
    let sphere = RadialDistribution::new(Reddy2001, Geometry::Sphere, cap, 0.0).unwrap();
    let plane = RadialDistribution::koskela_2017();
    // The CDFs cross nowhere, so the largest difference is the total variation.
    let largest = (1..8000)
        .map(|i| Angle::from_degrees(f64::from(i) / 100.0))
        .map(|e| (sphere.cdf(e) - plane.cdf(e)).abs())
        .fold(0.0, f64::max);
    assert!((largest - 0.0328).abs() < 1e-4, "{largest}");
}
