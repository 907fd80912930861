//! The paper's claim about Eq. 6, reproduced: which definition of the error gives which number.

use fovea_sampler::{Angle, Inverse, RadialDistribution};

#[test]
fn errors_of_eq6_by_definition() {
    let (distribution, eq6) = (RadialDistribution::koskela_2017(), Inverse::eq6());

    // The supremum of the density's error lies at the lower end of the polynomial.
    let (at_joint, slope) = eq6.eval_f64(f64::from(0.0965_f32) * (1.0 + 1e-12));
    let implied = distribution.capped_mass() / (core::f64::consts::TAU * at_joint * slope);
    let supremum = (implied - distribution.model().acuity(Angle::from_radians(at_joint))).abs();
    assert!((supremum - 2.486e-2).abs() < 5e-5, "{supremum}");
    assert!((Angle::from_radians(at_joint).degrees() - 5.795).abs() < 1e-3);

    // 256 bins over [0, 80] degrees: the density averaged over a bin.
    let bins = 256;
    let edge = |k: i32| Angle::from_degrees(80.0 * f64::from(k) / f64::from(bins));
    let in_bin = |k: i32| {
        let area = core::f64::consts::PI * (edge(k + 1).radians().powi(2) - edge(k).radians().powi(2));
        let implied = eq6.implied_cdf(edge(k + 1).radians()) - eq6.implied_cdf(edge(k).radians());
        let exact = distribution.cdf(edge(k + 1)) - distribution.cdf(edge(k));
        (implied - exact) * distribution.capped_mass() / area
    };
    let histogram = (0..bins).map(|k| in_bin(k).abs()).fold(0.0, f64::max);
    assert!((histogram - 1.78e-2).abs() < 5e-5, "{histogram}");

    // The integral of the density's error over the plane, as a share of all samples, where Eq. 6 has any: with u as the
    // variable of integration (m^ 2 pi e de / G = du) it is the mean of 1 - m / m^.
    let count = 400_000;
    let (mut signed, mut absolute) = (0.0, 0.0);
    for k in 0..count {
        let (e, slope) = eq6.eval_f64((f64::from(k) + 0.5) / f64::from(count));
        let implied = distribution.capped_mass() / (core::f64::consts::TAU * e * slope);
        let error = 1.0 - distribution.model().acuity(Angle::from_radians(e)) / implied;
        signed += error / f64::from(count);
        absolute += error.abs() / f64::from(count);
    }
    assert!((signed - 3.32e-4).abs() < 1e-6, "{signed}");
    assert!((absolute - 2.51e-3).abs() < 1e-5, "{absolute}");

    // The gap at the joint and the missing rim, degrees.
    let e_deg = |u: f64| Angle::from_radians(eq6.eval_f64(u).0).degrees();
    assert!((e_deg(f64::from(0.0965_f32)) - 5.790_413).abs() < 1e-5);
    assert!((e_deg(1.0) - 79.968).abs() < 1e-4);
}
