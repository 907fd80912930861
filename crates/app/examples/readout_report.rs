//! Does the read-out tell the truth? Runs with seeds and gazes of their own, each stopped when the read-out says "ready" or at
//! MOST_SAMPLES, against a long render whose own variance is taken off:
//! `cargo run --example readout_report -- OUT_FOLDER RUNS MOST_SAMPLES REFERENCE_SECONDS SCENE...` writes `readout.md` and
//! `readout.json`; a scene is a file, or `builtin`.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use fovea_app::convergence::{AROUND_RADIUS_PX, Block, MATERIAL, OUTLINE};
use fovea_app::session::{self, Source};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::{Quat, Vec3};
use serde_json::{Value, json};
use tracer::distribution::{Distribution, Gaze};
use tracer::film::{FilmOptions, FilmPixel, FilmSnapshot};
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::provenance::Provenance;
use tracer::renderer::{FilmPose, Renderer, RendererOptions, SequenceKind, StopCondition};

/// Small, so that the reference converges in reasonable time.
const FILM: FilmOptions = FilmOptions::equirect(64, 32);
/// Few, for the same reason: what the read-out says of samples does not depend on where they come from.
const MAX_BOUNCES: u32 = 2;
/// The block whose error is said.
const RADIUS_PX: u32 = 3;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, runs, most, seconds, scenes @ ..] = arguments.as_slice() else {
        anyhow::bail!("OUT_FOLDER RUNS MOST_SAMPLES REFERENCE_SECONDS SCENE... are needed")
    };
    let effort = Effort { runs: runs.parse()?, most_samples: most.parse()?, reference_secs: seconds.parse()? };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let started = Instant::now();
    let (mut rows, mut raw) = (String::new(), Vec::new());
    let sources = scenes.iter().map(|path| Source::from(Some(Path::new(path)).filter(|_| path != "builtin")));
    for source in sources {
        let found = runs_of(&gpu, &source, effort)?;
        rows += &found.rows(&source.name());
        raw.push(found.to_json(&source.name()));
    }
    let page = format!(
        "{HEAD}\n```text\n{}```\n\n{} runs a scene, at most {} samples each, against references of {} s each; {:.0} s in all.\n\n{TABLE}{rows}",
        Provenance::on(&gpu),
        effort.runs,
        effort.most_samples,
        effort.reference_secs,
        started.elapsed().as_secs_f64(),
    );
    std::fs::write(Path::new(folder).join("readout.md"), page)?;
    std::fs::write(Path::new(folder).join("readout.json"), serde_json::to_string(&raw)? + "\n")?;
    Ok(())
}

/// What the page says before its figures.
const HEAD: &str = "# Does the read-out tell the truth?

The panel says \"ready\" when the error at the gaze is below a threshold with 95 % confidence (docs/guide.md). Here many renders,
each with a seed and a gaze of its own, are looked at after every tenth more samples, as the window does; at the first \"ready\" the
true error is taken: the root mean square over the same 7 x 7 film pixels of the difference to a long render, whose own variance is
taken off, over their mean luminance. The film is small (64x32) and
light bounces twice, so that the references converge. Raw: [readout.json](readout.json).
";

const TABLE: &str = "| scene | threshold | runs that became ready | true error below the threshold | median true error | median samples a pixel |
|---|---|---|---|---|---|
";

/// How much is traced.
#[derive(Clone, Copy)]
struct Effort {
    runs: u32,
    most_samples: u64,
    reference_secs: f64,
}

/// What was found when a threshold was said to be reached.
struct Found {
    run: u32,
    error: f64,
    samples: f64,
}

/// Of all runs on a scene, by threshold.
struct OfScene {
    runs: u32,
    found: [Vec<Found>; 2],
}

const THRESHOLDS: [(&str, f64); 2] = [("outline", OUTLINE), ("material", MATERIAL)];

impl OfScene {
    fn rows(&self, name: &str) -> String {
        let median = |values: &dyn Fn(&Found) -> f64, found: &[Found]| {
            let mut values: Vec<f64> = found.iter().map(values).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
        };
        let row = |((what, threshold), found): ((&str, f64), &Vec<Found>)| {
            let honest = found.iter().filter(|found| found.error <= threshold).count();
            format!(
                "| {name} | {what}, {:.0} % | {} of {} | {honest} ({:.1} %) | {:.2} % | {:.0} |\n",
                100.0 * threshold,
                found.len(),
                self.runs,
                100.0 * honest as f64 / found.len().max(1) as f64,
                100.0 * median(&|found| found.error, found),
                median(&|found| found.samples, found),
            )
        };
        THRESHOLDS.into_iter().zip(&self.found).map(row).collect()
    }

    fn to_json(&self, name: &str) -> Value {
        let column = |found: &[Found]| -> Value {
            found.iter().map(|found| json!([found.run, found.error, found.samples])).collect()
        };
        let [outline, material] = &self.found;
        json!({
            "scene": name,
            "runs": self.runs,
            "columns": ["run", "true error", "samples a pixel"],
            "outline": column(outline),
            "material": column(material),
        })
    }
}

fn runs_of(gpu: &Gpu, source: &Source, effort: Effort) -> anyhow::Result<OfScene> {
    let (scene, _) = session::import(source, &Default::default())?;
    let viewpoint = session::viewpoints(&scene).into_iter().next().context("a scene has a viewpoint")?;
    let radial = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let inverse = Arc::new(Inverse::default_for(&radial));
    let pose = FilmPose { position: viewpoint.position, world_from_film: Quat::IDENTITY };
    let renderer = |seed, distribution| -> anyhow::Result<Renderer> {
        let options = RendererOptions { film: FILM, seed, max_bounces: MAX_BOUNCES, ..RendererOptions::default() };
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
        run.set_randomness(number, SequenceKind::Sobol);
        let mut ready = [false; 2];
        while !ready.iter().all(|ready| *ready) && run.samples() < effort.most_samples {
            // A look every tenth more samples, as the window does.
            let batch = (run.samples() / 10).clamp(1 << 8, 1 << 18) as u32;
            run.trace(batch)?;
            let block = Block::new(&run.pixels_near(direction, AROUND_RADIUS_PX)?);
            for (index, (_, threshold)) in THRESHOLDS.into_iter().enumerate() {
                if !ready[index] && block.is_ready(threshold) {
                    ready[index] = true;
                    let error = true_error(&run, &reference, direction)?;
                    found[index].push(Found { run: number, error, samples: block.samples });
                }
            }
        }
    }
    Ok(OfScene { runs, found })
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
    let found = run.pixels_near(direction, RADIUS_PX)?.pixels;
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
