//! The exact quantiles against 30-digit references, closed forms and the constants of the literature.
use fovea_sampler::{Angle, Geometry, RadialDistribution, Reddy2001, model};

/// Rows of a reference file, or `None` (said aloud) if the variable is unset. The file must exist if it is set.
fn reference_rows(file: &str) -> Option<Vec<[f64; 3]>> {
    let Some(folder) = std::env::var_os("FOVEA_REFERENCE") else {
        eprintln!("SKIP {file}: FOVEA_REFERENCE is unset, so the 30-digit references were not compared");
        return None;
    };
    let text = std::fs::read_to_string(std::path::Path::new(&folder).join(file)).unwrap();
    let row = |line: &str| {
        let mut columns = line.split(',').map(|x| x.parse::<f64>().unwrap());
        [columns.next().unwrap(), columns.next().unwrap(), columns.next().unwrap()]
    };
    Some(text.lines().skip(1).map(row).collect())
}

fn assert_close(what: &str, found: f64, expected: f64, tolerance: f64) {
    let error = if expected == 0.0 { found.abs() } else { (found / expected - 1.0).abs() };
    assert!(error <= tolerance, "{what}: {found:e} against {expected:e}, error {error:e}");
}

#[test]
fn quantile_and_pdf_match_every_reference_row() {
    for (file, geometry) in [("reference_planar.csv", Geometry::Plane), ("reference_spherical.csv", Geometry::Sphere)] {
        let Some(rows) = reference_rows(file) else { continue };
        assert_eq!(rows.len(), 41);
        let distribution = RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(80.0), 0.0).unwrap();
        for [u, e_deg, pdf] in rows {
            let e = distribution.quantile(u);
            assert_close(&format!("{file} e({u:e})"), e.degrees(), e_deg, 1e-12);
            assert_close(&format!("{file} pdf({u:e})"), distribution.pdf(e), pdf, 1e-12);
            if let Some(closed) = distribution.quantile_closed_form(u) {
                assert_close(&format!("{file} closed form e({u:e})"), closed.degrees(), e_deg, 1e-12);
            }
        }
    }
}

#[test]
fn masses_match_the_constants() {
    let at = |geometry, cap| RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(cap), 0.0).unwrap();
    let radians = Angle::from_degrees(1.0).radians();
    assert_close("G(80)", at(Geometry::Plane, 80.0).capped_mass(), 1_091.849_491_882_925_7 * radians * radians, 1e-14);
    // The reciprocal of the reference density at the gaze.
    assert_close("G_s(80)", at(Geometry::Sphere, 80.0).capped_mass(), 1.0 / 3.211_727_440_342_627, 1e-14);
    assert_close("G_s(180)", at(Geometry::Sphere, 180.0).capped_mass(), 0.358_837_026_897_026, 1e-14);
}

/// The closed form of every model that has one, against root finding on the CDF.
#[test]
fn closed_forms_agree_with_the_oracle() {
    for model in model::built_in() {
        let name = model.name().to_owned();
        let distribution = RadialDistribution::new(model, Geometry::Plane, Angle::from_degrees(80.0), 0.0).unwrap();
        for i in 0..=4000 {
            let u = (f64::from(i) / 4000.0).powi(3);
            let closed = distribution.quantile_closed_form(u).unwrap();
            assert_close(&format!("{name} at {u:e}"), closed.degrees(), distribution.quantile(u).degrees(), 2e-13);
        }
    }
}

#[test]
fn quantile_inverts_cdf_for_every_model_and_geometry() {
    for geometry in Geometry::ALL {
        for floor in [0.0, 0.002, 0.3] {
            for cap in [20.0, 80.0, 180.0] {
                for model in model::built_in() {
                    let name = model.name().to_owned();
                    let d = RadialDistribution::new(model, geometry, Angle::from_degrees(cap), floor).unwrap();
                    for i in 0..=256 {
                        let u = (f64::from(i) / 256.0).powi(4);
                        let e = d.quantile(u);
                        let what = format!("{name} {geometry:?} cap {cap} floor {floor} u {u:e}");
                        assert_close(&what, d.cdf(e), u, 1e-12);
                    }
                }
            }
        }
    }
}
