//! `fovea study`: how much sooner each mode converges where one looks, by measurement.
//!
//! Error against samples is rendered once and depends on no clock; seconds a sample are measured apart, in short alternating
//! rounds. Every part leaves files behind and is not repeated when they are there.

use anyhow::Context;
use tracer::gpu::{AdapterSelect, Gpu};

use crate::cli::study::{Part, StudyArgs};
use bench::Bench;
use rates::Rates;

mod analysis;
pub(super) mod bench;
mod curves;
mod error;
mod figure;
pub mod flip;
mod observer;
mod picture;
pub(super) mod plan;
pub mod plot;
mod rates;
mod record;
mod report;
pub mod statistics;
mod tables;

/// Carries out a study, or goes on with one.
///
/// # Errors
/// Bad input, an adapter that cannot do it, or a folder that holds another study.
pub fn run(args: &StudyArgs) -> anyhow::Result<()> {
    if args.only != Part::Report {
        measure(args)?;
    }
    if args.only != Part::Curves {
        report::write(args)?;
    }
    Ok(())
}

fn measure(args: &StudyArgs) -> anyhow::Result<()> {
    let gpu = Gpu::headless(&args.adapter.clone().map_or(AdapterSelect::Auto, AdapterSelect::Named))?;
    let scenes: Vec<_> = if args.scenes.is_empty() { vec![None] } else { args.scenes.iter().map(Some).collect() };
    // Hours into a study is too late to learn that its last scene cannot be read.
    for scene in &scenes {
        bench::open(*scene, args.background)?;
    }
    for folder in ["runs", "references"] {
        let folder = args.output.join(folder);
        std::fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    }
    let wants_curves = matches!(args.only, Part::All | Part::Curves);
    for scene in scenes {
        let mut bench = Bench::new(&gpu, args, scene)?;
        if wants_curves {
            let bar = crate::commands::render::progress_bar()?;
            curves::render_missing(&mut bench, args, &|done| bar.set_position((done * 1000.0) as u64))?;
            bar.finish_and_clear();
        }
        if args.only != Part::Curves {
            rates::measure(&mut bench, args)?;
            figure::write(&mut bench, args, &Rates::read(&args.output)?)?;
        }
    }
    Ok(())
}
