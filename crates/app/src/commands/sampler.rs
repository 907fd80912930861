//! `fovea sampler`: the sampler's inverses, error against speed, as a table, CSV and plot; or one of them evaluated.

mod adapter;
mod cost;
pub(super) mod raster;

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
use crate::output::{png, write_text};

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
    anyhow::ensure!(args.inverse != Evaluated::Eq6 || args.floor == 0.0, "--floor: the printed Eq. 6 has none");
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
    let cap = Angle::from_degrees(80.0);
    let mut candidates = Vec::new();
    for geometry in Geometry::ALL {
        let distribution = RadialDistribution::new(Reddy2001, geometry, cap, 0.0)?;
        for form in report::forms(geometry) {
            let inverse = Inverse::with_form(&distribution, form)?;
            candidates.push((form, GazeWarp::with_inverse(distribution.clone(), inverse)));
        }
    }
    let warps: Vec<GazeWarp> = candidates.iter().map(|(_, warp)| warp.clone()).collect();
    let costs = cost::Costs::measure(&warps);
    let launched: Vec<&Inverse> =
        candidates.iter().filter(|(form, _)| form.suits_shaders()).map(|(_, warp)| warp.inverse()).collect();
    let launches = gpu.as_ref().ok().map(|gpu| adapter::Launches::measure(gpu, &launched)).transpose()?;
    let mut launched_ms = launches.iter().flat_map(|launches| launches.foveated_ms.iter().copied());
    let mut entries: Vec<Entry> = candidates
        .iter()
        .zip(&costs.warps_ns)
        .map(|((form, warp), &cpu_ns)| Entry {
            geometry: warp.inverse().geometry(),
            name: form.name(),
            errors: Some(warp.inverse().measure(warp.distribution(), MEASURED)),
            cpu_ns,
            gpu_ms: form.suits_shaders().then(|| launched_ms.next()).flatten(),
        })
        .collect();
    for geometry in Geometry::ALL {
        let cpu_ns = cost::exact_ns(&RadialDistribution::new(Reddy2001, geometry, cap, 0.0)?);
        entries.push(Entry { geometry, name: "exact".into(), errors: None, cpu_ns, gpu_ms: None });
    }
    let mut text = report::table(&entries, &provenance);
    text.push_str(&costs.text(&entries));
    if let Some(launches) = &launches {
        text.push_str(&launches.text(&entries));
    }
    let chart = Chart::error_against_cost(&entries, &provenance);
    write_text(&args.output.join("sampler.csv"), &report::csv(&entries, &provenance))?;
    write_text(&args.output.join("sampler.svg"), &chart.svg())?;
    let ([width, height], texels) = raster::draw(&chart);
    png::write(&args.output.join("sampler.png"), width, height, &texels)?;
    // A reader that is gone loses nothing that was measured.
    print_text(&text)?;
    print_text(&format!("wrote sampler.csv, sampler.svg and sampler.png to {}\n", args.output.display()))
}

/// The adapter, or why there is none; a name that matches nothing is an error.
fn gpu(name: Option<&str>) -> anyhow::Result<Result<Gpu, String>> {
    match name {
        Some(name) => Ok(Ok(Gpu::headless(&AdapterSelect::Named(name.to_owned()))?)),
        None => Ok(Gpu::headless(&AdapterSelect::Auto).map_err(|error| error.to_string())),
    }
}
