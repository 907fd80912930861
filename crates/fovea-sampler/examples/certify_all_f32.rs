//! The long run: the defaults' errors at every f32 in `[2^-100, 1]` (0.84e9 numbers each). Prints the rows of
//! docs/reports/sampler-certification.md.
//!
//! `cargo run --release -p fovea-sampler --example certify_all_f32`

#![expect(clippy::print_stdout, reason = "printing is what it is for")]

use fovea_sampler::{Angle, Form, Geometry, Inverse, RadialDistribution, Reddy2001, SamplerError};

fn main() -> Result<(), SamplerError> {
    println!("| geometry | floor | inverse | relative error in e | at u | bound | numbers |");
    println!("|---|---|---|---|---|---|---|");
    let cases = [
        (Geometry::Sphere, 0.0, None),
        (Geometry::Sphere, 0.002, None),
        (Geometry::Plane, 0.0, None),
        (Geometry::Plane, 0.0, Some(Form::Eq6)),
        (Geometry::Sphere, 0.0, Some(Form::Table(256))),
    ];
    for (geometry, floor, form) in cases {
        let distribution = RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(80.0), floor)?;
        let inverse = match form {
            None => Inverse::default_for(&distribution),
            Some(form) => Inverse::with_form(&distribution, form)?,
        };
        let report = inverse.measure_every_f32(&distribution, 2f32.powi(-100));
        println!(
            "| {} | {floor} | {} | {:.4e} | {:e} | {:.4e} | {} |",
            geometry.name(),
            inverse.name(),
            report.relative_e,
            report.relative_e_at,
            inverse.bound().relative_e,
            u64::from(report.count) + 1
        );
    }
    Ok(())
}
