//! `fovea sampler`: its options.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::choices::{Geometry, Model};
use super::values;

/// `fovea sampler`.
#[derive(Clone, Debug, Args)]
pub struct SamplerArgs {
    /// Visual acuity model (with --eval)
    #[arg(long, value_enum, default_value_t = Model::Reddy, value_name = "MODEL", requires = "eval")]
    pub model: Model,
    /// A model of one's own: a CSV file of eccentricity in degrees and relative acuity (with --eval)
    #[arg(long, value_name = "FILE.csv", conflicts_with = "model", requires = "eval")]
    pub acuity_table: Option<PathBuf>,
    /// Density per solid angle on the sphere, or the planar approximation (with --eval)
    #[arg(long, value_enum, default_value_t = Geometry::Sphere, value_name = "GEOMETRY", requires = "eval")]
    pub geometry: Geometry,
    /// How the radius is found (with --eval)
    #[arg(long, value_enum, default_value_t = Evaluated::Exact, value_name = "FORM", requires = "eval")]
    pub inverse: Evaluated,
    /// Eccentricity at which the model ends, degrees, 0.001..=180 (with --eval)
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 80.0,
        value_parser = cap_deg, value_name = "DEG", requires = "eval"
    )]
    pub cap: f64,
    /// Density beyond the cap relative to the gaze's, 0..=1 (with --eval)
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 0.0,
        value_parser = values::unit_interval, value_name = "M", requires = "eval"
    )]
    pub floor: f64,
    /// Evaluate at the numbers in this file's first column and print u,e_deg,pdf_per_sr; no other measurement is made
    #[arg(long, value_name = "FILE.csv")]
    pub eval: Option<PathBuf>,
    /// Where sampler.csv, sampler.svg and sampler.png go
    #[arg(short, long, default_value = "out", value_name = "FOLDER", conflicts_with = "eval")]
    pub output: PathBuf,
    /// Graphics adapter whose name contains this [default: as `fovea adapters` says]
    #[arg(long, value_name = "NAME", conflicts_with = "eval")]
    pub adapter: Option<String>,
    /// Leave the adapter out
    #[arg(long, conflicts_with_all = ["eval", "adapter"])]
    pub cpu_only: bool,
}

/// Ways to find the radius at which the CDF is a given number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Evaluated {
    /// Closed form or root finding, f64
    Exact,
    /// The published polynomial (Reddy on the plane)
    Eq6,
    /// Minimax polynomial of degree 5
    Poly5,
    /// Minimax rational 3/3
    Rational,
    /// Cubic Hermite table of 256 cells
    Table,
}

fn cap_deg(text: &str) -> Result<f64, String> {
    let cap: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if (0.001..=180.0).contains(&cap) { Ok(cap) } else { Err(format!("{text} degrees is out of range 0.001..=180")) }
}
