//! Every bound that an inverse states: of the f32 evaluation at all u = k 2^-24 against the exact quantile, of density and CDF at
//! points other than those that it was made from.

use fovea_sampler::{Angle, ErrorReport, Form, Geometry, Inverse, RadialDistribution, Reddy2001};

const ALL: u32 = 1 << 24;

fn reddy(geometry: Geometry, floor: f64) -> RadialDistribution {
    RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(80.0), floor).expect("valid constants")
}

/// Measures everywhere and holds the inverse to its own bound.
fn certify(what: &str, inverse: &Inverse, distribution: &RadialDistribution) -> ErrorReport {
    let report = inverse.measure(distribution, ALL);
    let bound = inverse.bound();
    let what = format!("{what} {}: {report:?} against {bound:?}", inverse.name());
    assert!(report.relative_e <= bound.relative_e, "{what}");
    assert!(report.relative_chord <= bound.relative_chord, "{what}");
    assert!(report.relative_density <= bound.relative_density, "{what}");
    assert!(report.cdf <= bound.cdf, "{what}");
    report
}

/// The accuracies that the documentation claims.
#[test]
fn forms_of_reddys_acuity_meet_their_claims() {
    use Geometry::{Plane, Sphere};
    // Form, largest relative error in e and of the density without floor.
    let claims = [
        (Sphere, Form::SquaredPolynomial(5), 7.3e-4, 2.1e-2),
        (Sphere, Form::SquaredPolynomial(7), 7.4e-5, 3.7e-3),
        (Sphere, Form::Rational(3, 3), 1.8e-5, 9.8e-4),
        (Sphere, Form::Table(64), 3.0e-7, 1.7e-5),
        (Sphere, Form::Table(256), 1.6e-7, 4e-7),
        (Plane, Form::Eq6, 2.22e-3, 2.5e-2),
        (Plane, Form::Polynomial(4), 6.9e-4, 1.4e-2),
        (Plane, Form::Polynomial(5), 3.7e-5, 1.4e-3),
        (Plane, Form::Polynomial(7), 8.3e-6, 4e-4),
        (Plane, Form::Polynomial(8), 3.3e-6, 1.8e-4),
        (Plane, Form::Rational(4, 3), 5.8e-7, 1.6e-4),
        (Plane, Form::Table(64), 1.7e-7, 1.5e-6),
    ];
    for (geometry, form, relative_e, density) in claims {
        let distribution = reddy(geometry, 0.0);
        let inverse = Inverse::with_form(&distribution, form).expect("on offer");
        let report = certify("reddy", &inverse, &distribution);
        assert!(report.relative_e <= relative_e, "{}: {report:?}", inverse.name());
        assert!(report.relative_density <= density, "{}: {report:?}", inverse.name());
    }
}

/// The defaults: 2e-5 on the sphere and 4e-5 on the plane, with and without floor.
#[test]
fn defaults_meet_their_claims() {
    for (geometry, claim, name) in [(Geometry::Sphere, 2e-5, "rational3/3"), (Geometry::Plane, 4e-5, "poly5")] {
        for floor in [0.0, 0.002, 0.005] {
            let distribution = reddy(geometry, floor);
            let inverse = Inverse::default_for(&distribution);
            assert_eq!(inverse.name(), name);
            let report = certify(&format!("reddy {geometry:?} floor {floor}"), &inverse, &distribution);
            assert!(report.relative_e <= claim, "{report:?}");
            assert!(inverse.bound().relative_e <= claim, "{:?}", inverse.bound());
        }
    }
}

/// The other models' defaults and a table each.
#[test]
fn other_models_meet_their_bounds() {
    for (name, distribution) in crate::common::distributions().iter().filter(|(name, _)| !name.starts_with("reddy ")) {
        certify(name, &Inverse::default_for(distribution), distribution);
    }
}
