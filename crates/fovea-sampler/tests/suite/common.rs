//! What the statistical tests share: distributions to try, uniform numbers, p-values.

use fovea_sampler::{Angle, Form, Geometry, Inverse, RadialDistribution, model, sequence};

/// Total significance of each test function; divided by the number of comparisons in it (Bonferroni).
pub(crate) const SIGNIFICANCE: f64 = 1e-3;

/// Every built-in model in both geometries, with and without a floor, at a cap of 80 degrees.
pub(crate) fn distributions() -> Vec<(String, RadialDistribution)> {
    distributions_to(80.0)
}

/// The same at another cap.
pub(crate) fn distributions_to(cap_deg: f64) -> Vec<(String, RadialDistribution)> {
    let mut all = Vec::new();
    for geometry in Geometry::ALL {
        for floor in [0.0, 0.002] {
            for model in model::built_in() {
                let name = format!("{} {geometry:?} floor {floor} cap {cap_deg}", model.name());
                let cap = Angle::from_degrees(cap_deg);
                all.push((name, RadialDistribution::new(model, geometry, cap, floor).expect("valid constants")));
            }
        }
    }
    all
}

/// Every form worth trying that exists for a distribution.
pub(crate) fn inverses(distribution: &RadialDistribution) -> Vec<Inverse> {
    let forms = [
        Form::Polynomial(5),
        Form::SquaredPolynomial(7),
        Form::Rational(3, 3),
        Form::Rational(4, 3),
        Form::Table(256),
        Form::Eq6,
    ];
    let mut found: Vec<Inverse> =
        forms.iter().filter_map(|form| Inverse::with_form(distribution, *form).ok()).collect();
    found.push(Inverse::default_for(distribution));
    found
}

/// Independent uniform numbers in `[0, 1)`, exact in f32.
pub(crate) fn uniform(index: u32, dimension: u32, seed: u32) -> f32 {
    sequence::to_unit_f32(sequence::independent(index, dimension, seed))
}

/// The probability that the Kolmogorov-Smirnov statistic of `n` draws exceeds `d` (Stephens' correction of the limit law).
pub(crate) fn kolmogorov_smirnov_p(d: f64, n: f64) -> f64 {
    let t = d * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    let term = |k: i32| {
        let k = f64::from(k);
        (-2.0 * k * k * t * t).exp()
    };
    (2.0 * (1..100).map(|k| if k % 2 == 1 { term(k) } else { -term(k) }).sum::<f64>()).clamp(0.0, 1.0)
}

/// The probability that chi-squared with many degrees of freedom exceeds `x` (Wilson and Hilferty's normal approximation).
pub(crate) fn chi_squared_p(x: f64, freedom: f64) -> f64 {
    let z = ((x / freedom).cbrt() - (1.0 - 2.0 / (9.0 * freedom))) / (2.0 / (9.0 * freedom)).sqrt();
    0.5 * erfc(z / core::f64::consts::SQRT_2)
}

/// Complementary error function, relative error below 1.2e-7 (W. H. Press et al., Numerical Recipes, 6.2).
fn erfc(x: f64) -> f64 {
    const C: [f64; 10] = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let t = 1.0 / (1.0 + 0.5 * x.abs());
    let exponent = C.iter().rev().fold(0.0, |sum, c| sum * t + c) - x * x;
    let tail = t * exponent.exp();
    if x >= 0.0 { tail } else { 2.0 - tail }
}
