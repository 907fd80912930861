//! Does the read-out tell the truth? Many runs with different samples and gazes, each stopped when the read-out says "ready" or at
//! MOST_SAMPLES, against a long render whose own variance is taken off:
//! `cargo run --release --example readout_report -- RUNS MOST_SAMPLES REFERENCE_SECONDS [SCENE.glb ...]` prints Markdown.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use fovea_app::convergence::{Block, MATERIAL, OUTLINE};
use fovea_app::session::{self, Source};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::{Quat, Vec3};
use tracer::distribution::{Distribution, Gaze};
use tracer::film::{FilmOptions, FilmPixel, FilmSnapshot};
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::provenance::Provenance;
use tracer::renderer::{FilmPose, Renderer, RendererOptions, StopCondition};

/// Small, so that the reference converges in reasonable time.
const FILM: FilmOptions = FilmOptions::equirect(64, 32);
/// As in the window.
const RADIUS_PX: u32 = 3;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [runs, most, seconds, scenes @ ..] = arguments.as_slice() else {
        anyhow::bail!("RUNS MOST_SAMPLES REFERENCE_SECONDS [SCENE ...] are needed")
    };
    let effort = Effort { runs: runs.parse()?, most_samples: most.parse()?, reference_secs: seconds.parse()? };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut report = format!("```text\n{}```\n\n", Provenance::on(&gpu));
    report += "| scene | threshold | runs that became ready | true error below the threshold | median true error | median spp |\n";
    report += "|---|---|---|---|---|---|\n";
    let sources = std::iter::once(Source::BuiltIn).chain(scenes.iter().map(|path| Source::from(Some(Path::new(path)))));
    for source in sources {
        for line in scene_rows(&gpu, &source, effort)? {
            report += &line;
        }
    }
    use std::io::Write;
    std::io::stdout().write_all(report.as_bytes())?;
    Ok(())
}

/// How much is traced.
#[derive(Clone, Copy)]
struct Effort {
    runs: u32,
    most_samples: u64,
    reference_secs: f64,
}

/// What was found when a threshold was said to be reached.
struct Found {
    error: f64,
    samples: f64,
}

fn scene_rows(gpu: &Gpu, source: &Source, effort: Effort) -> anyhow::Result<Vec<String>> {
    let (scene, _) = session::import(source, &Default::default())?;
    let viewpoint = session::viewpoints(&scene).into_iter().next().context("a scene has a viewpoint")?;
    let radial = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let inverse = Arc::new(Inverse::default_for(&radial));
    let pose = FilmPose { position: viewpoint.position, world_from_film: Quat::IDENTITY };
    let renderer = |seed, distribution| -> anyhow::Result<Renderer> {
        let options = RendererOptions { film: FILM, seed, ..RendererOptions::default() };
        let mut renderer = Renderer::new(gpu, &options, distribution)?;
        renderer.set_scene(&scene)?;
        renderer.set_pose(pose);
        Ok(renderer)
    };
    let mut long = renderer(9_000_001, Distribution::omnidirectional(Arc::clone(&inverse)))?;
    long.render(StopCondition::Seconds(effort.reference_secs), |_| true)?;
    let reference = long.snapshot()?;
    drop(long);

    let runs = effort.runs;
    let mut found: [Vec<Found>; 2] = Default::default();
    let mut run = renderer(1, Distribution::omnidirectional(Arc::clone(&inverse)))?;
    for number in 1..=runs {
        let direction = gaze(number);
        run.set_distribution(Distribution::foveated(Gaze::Scene { direction }, None, Arc::clone(&inverse)))?;
        // Every run has samples of its own of the sequence.
        run.set_first_sample(u64::from(number) << 24);
        run.restart();
        let mut ready = [false; 2];
        while !ready.iter().all(|ready| *ready) && run.samples() < effort.most_samples {
            // A look every tenth more samples, as the window does.
            let batch = (run.samples() / 10).clamp(1 << 8, 1 << 18) as u32;
            run.trace(batch)?;
            let block = Block::new(&run.pixels_near(direction, RADIUS_PX)?);
            for (index, threshold) in [OUTLINE, MATERIAL].into_iter().enumerate() {
                if !ready[index] && block.is_ready(threshold) {
                    ready[index] = true;
                    let error = true_error(&run, &reference, direction)?;
                    found[index].push(Found { error, samples: block.samples });
                }
            }
        }
    }
    let name = source.name();
    let rows =
        [("outline", OUTLINE), ("material", MATERIAL)].into_iter().zip(&mut found).map(|((what, threshold), found)| {
            let honest = found.iter().filter(|found| found.error <= threshold).count();
            let share = 100.0 * honest as f64 / found.len().max(1) as f64;
            let mut errors: Vec<f64> = found.iter().map(|found| found.error).collect();
            let mut samples: Vec<f64> = found.iter().map(|found| found.samples).collect();
            let median = |values: &mut Vec<f64>| {
                values.sort_by(f64::total_cmp);
                values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
            };
            format!(
                "| {name} | {what}, {:.0} % | {} of {runs} | {honest} ({share:.1} %) | {:.2} % | {:.0} |\n",
                100.0 * threshold,
                found.len(),
                100.0 * median(&mut errors),
                median(&mut samples),
            )
        });
    Ok(rows.collect())
}

/// Somewhere within 70 degrees of the horizon, by the golden angle.
fn gaze(number: u32) -> Vec3 {
    let turn = f64::from(number) * 0.618_033_988_749_895;
    let yaw = std::f64::consts::TAU * turn.fract();
    let pitch = ((f64::from(number) * 0.754_877_666_246_693).fract() * 2.0 - 1.0) * 1.2;
    fovea_app::view::direction(yaw as f32, pitch as f32)
}

/// Root mean square of the block's error, over its brightness.
fn true_error(run: &Renderer, reference: &FilmSnapshot, direction: Vec3) -> anyhow::Result<f64> {
    let found = run.pixels_near(direction, RADIUS_PX)?;
    let [x, y] = FILM.pixel_of(direction).context("a panorama has every direction")?;
    let rows = y.saturating_sub(RADIUS_PX)..=(y + RADIUS_PX).min(FILM.height - 1);
    let columns = x.saturating_sub(RADIUS_PX)..=(x + RADIUS_PX).min(FILM.width - 1);
    let truth = rows.flat_map(|y| columns.clone().map(move |x| y * FILM.width + x));
    let truth: Vec<FilmPixel> = truth.map(|index| reference.pixel(index as usize)).collect();
    let squared = |(found, truth): (&FilmPixel, &FilmPixel)| {
        (found.luminance() - truth.luminance()).powi(2) - truth.variance_of_mean
    };
    let squared: f64 = found.iter().zip(&truth).map(squared).sum();
    let brightness = truth.iter().map(FilmPixel::luminance).sum::<f64>() / truth.len() as f64;
    Ok((squared.max(0.0) / truth.len() as f64).sqrt() / brightness.max(1e-3))
}
