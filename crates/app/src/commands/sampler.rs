//! `fovea sampler`: the sampler's inverses, error against speed, as a table, CSV and plot; or one of them evaluated.

mod adapter;
mod cost;
mod raster;

use std::path::Path;

use anyhow::Context;
use fovea_sampler::report::{self, Chart, Entry, Provenance};
use fovea_sampler::{
    AcuityModel, Angle, GazeWarp, Geometry, Inverse, RadialDistribution, Reddy2001, TabulatedAcuity, model,
};
use tracer::{
    gpu::{AdapterSelect, Gpu},
    provenance,
};

use super::print_text;
use crate::cli::choices::{self, InverseForm};
use crate::cli::sampler::{Evaluated, SamplerArgs};
use crate::output::{png, write_atomically};

/// Numbers at which errors are measured: every one that a shader can draw.
const MEASURED: u32 = 1 << 24;

/// Prints the table and writes CSV and plots, or prints an evaluation.
///
/// # Errors
/// When a file cannot be read or written, or a form does not exist for the model.
pub fn run(args: &SamplerArgs) -> anyhow::Result<()> {
    match &args.eval {
        Some(file) => evaluate(args, file),
        None => compare(args),
    }
}

fn evaluate(args: &SamplerArgs, file: &Path) -> anyhow::Result<()> {
    let numbers = report::first_column(&read(file)?).with_context(|| file.display().to_string())?;
    let model: Box<dyn AcuityModel> = match &args.acuity_table {
        Some(table) => Box::new(TabulatedAcuity::from_csv(&read(table)?).with_context(|| table.display().to_string())?),
        None => model::by_name(args.model.sampler_name()).context("the sampler lacks this model")?,
    };
    let geometry = match args.geometry {
        choices::Geometry::Sphere => Geometry::Sphere,
        choices::Geometry::Plane => Geometry::Plane,
    };
    let distribution = RadialDistribution::new(model, geometry, Angle::from_degrees(args.cap), args.floor)?;
    let form = match args.inverse {
        Evaluated::Exact => None,
        Evaluated::Eq6 => Some(InverseForm::Eq6),
        Evaluated::Poly5 => Some(InverseForm::Poly5),
        Evaluated::Rational => Some(InverseForm::Rational),
        Evaluated::Table => Some(InverseForm::Table),
    };
    let inverse = form
        .map(|form| Inverse::with_form(&distribution, form.of_sampler(geometry)))
        .transpose()
        .context("--inverse")?;
    print_text(&report::evaluate(&distribution, inverse.as_ref(), &numbers))
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("{} cannot be read", path.display()))
}

fn compare(args: &SamplerArgs) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.output).with_context(|| format!("{} cannot be made", args.output.display()))?;
    let gpu = if args.cpu_only { Err("left out".to_owned()) } else { gpu(args.adapter.as_deref())? };
    let provenance =
        gpu.as_ref().map_or_else(|reason| provenance::Provenance::without_gpu(reason), provenance::Provenance::on);
    let provenance = Provenance { machine: provenance.machine, adapter: provenance.adapter, commit: provenance.commit };
    let baselines = cost::Baselines::measure();
    let rays = gpu.as_ref().ok().map(adapter::Rays::new);
    let mut entries = Vec::new();
    for geometry in Geometry::ALL {
        let distribution = RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(80.0), 0.0)?;
        for form in report::forms(geometry) {
            let inverse = Inverse::with_form(&distribution, form)?;
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            entries.push(Entry {
                geometry,
                name: form.name(),
                errors: Some(warp.inverse().measure(&distribution, MEASURED)),
                cpu_ns: cost::direction_ns(&warp),
                gpu_ms: rays
                    .as_ref()
                    .filter(|_| form.suits_shaders())
                    .map(|rays| rays.foveated_ms(warp.inverse()))
                    .transpose()?,
            });
        }
        let cpu_ns = cost::exact_ns(&distribution);
        entries.push(Entry { geometry, name: "exact".into(), errors: None, cpu_ns, gpu_ms: None });
    }
    let mut text = report::table(&entries, &provenance);
    text.push_str(&baselines.text(&entries));
    if let Some(rays) = &rays {
        text.push_str(&rays.uniform_text(&entries)?);
    }
    print_text(&text)?;
    let chart = Chart::error_against_cost(&entries, &provenance);
    write_text(&args.output.join("sampler.csv"), &report::csv(&entries, &provenance))?;
    write_text(&args.output.join("sampler.svg"), &chart.svg())?;
    let ([width, height], texels) = raster::draw(&chart);
    png::write(&args.output.join("sampler.png"), width, height, &texels)?;
    print_text(&format!("wrote sampler.csv, sampler.svg and sampler.png to {}\n", args.output.display()))
}

/// The adapter, or why there is none; a name that matches nothing is an error.
fn gpu(name: Option<&str>) -> anyhow::Result<Result<Gpu, String>> {
    match name {
        Some(name) => Ok(Ok(Gpu::headless(&AdapterSelect::Named(name.to_owned()))?)),
        None => Ok(Gpu::headless(&AdapterSelect::Auto).map_err(|error| error.to_string())),
    }
}

fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    use std::io::Write;
    Ok(write_atomically(path, |writer| writer.write_all(text.as_bytes()).map_err(|error| error.to_string()))?)
}
