//! `sequence-report OUT_DIR SCENE...`: what Owen-scrambled Sobol points gain over independent ones where the eye looks.
//!
//! FV, 8 bounces, a film of 512x256, the gaze at its centre; 16 seeds of each sequence. At 16, 64 and 256 samples a pixel of the
//! foveal disc (5.79 degrees): the variance of the pixels' luminance over the seeds, relative to its square, mean over the disc's
//! pixels; and the ratio of the two sequences with its standard error (jackknife over the seeds). Neither depends on the
//! machine's speed. Writes `sequence.json` (raw numbers) and `sequence.md` (the table).

use std::{path::Path, process::ExitCode, sync::Arc};

use fovea_benches::{AnyError, Subject, report_main};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::Vec3;
use serde_json::{Value, json};
use tracer::{
    distribution::{Distribution, Gaze, film_direction},
    film::FilmOptions,
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
    renderer::{Renderer, RendererOptions, SequenceKind, StopCondition},
};

const FILM: FilmOptions = FilmOptions::equirect(512, 256);
const SEEDS: u32 = 16;
/// Samples a pixel of the foveal disc.
const DEPTHS: [u32; 3] = [16, 64, 256];
/// Samples of FV that fall on a pixel of the disc for each on a pixel of OD (facts of the default distribution: 63.4 at
/// the gaze, 60.5 with the floor).
const DENSITY: f64 = 60.5;
const FOVEA_DEG: f32 = 5.79;

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, files @ ..] = args else { return Err("usage: sequence-report OUT_DIR SCENE...".into()) };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut scenes = Vec::new();
    for file in files {
        scenes.push(measure(&gpu, &Subject::open(Some(Path::new(file)))?)?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({ "machine": machine, "seeds": SEEDS, "scenes": scenes });
    std::fs::create_dir_all(out)?;
    std::fs::write(Path::new(out).join("sequence.json"), format!("{raw:#}\n"))?;
    std::fs::write(Path::new(out).join("sequence.md"), table(&raw))?;
    Ok(())
}

/// Luminance of each pixel of the disc.
type Disc = Vec<f64>;

/// The discs at each depth, and the mean samples a pixel there.
fn trace(gpu: &Gpu, subject: &Subject, sequence: SequenceKind, seed: u32) -> Result<Vec<(Disc, f64)>, AnyError> {
    let acuity = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let gaze = Gaze::Scene { direction: Vec3::NEG_Z };
    let foveated = Distribution::foveated(gaze, None, Arc::new(Inverse::default_for(&acuity)));
    let options = RendererOptions { film: FILM, seed, sequence, ..Default::default() };
    let mut renderer = Renderer::new(gpu, &options, foveated)?;
    renderer.set_scene(&subject.scene)?;
    renderer.set_pose(subject.pose);
    let mut discs = Vec::new();
    for depth in DEPTHS {
        let samples = f64::from(depth) / DENSITY * FILM.pixels() as f64;
        renderer.render(StopCondition::Samples(samples as u64), |_| true)?;
        let film = renderer.snapshot()?;
        let inside = film.pixels().enumerate().filter(|(index, _)| {
            let (x, y) = (*index as u32 % FILM.width, *index as u32 / FILM.width);
            film_direction(&FILM, x, y).angle_between(Vec3::NEG_Z) < FOVEA_DEG.to_radians()
        });
        let pixels: Vec<_> = inside.map(|(_, pixel)| pixel).collect();
        let count = pixels.iter().map(|pixel| f64::from(pixel.samples)).sum::<f64>() / pixels.len() as f64;
        let luminance = |rgb: [f64; 3]| 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        discs.push((pixels.iter().map(|pixel| luminance(pixel.mean)).collect(), count));
    }
    Ok(discs)
}

/// Variance over the seeds relative to the mean's square, mean over the pixels; seed `left_out` does not take part.
fn relative_variance(discs: &[&Disc], left_out: Option<usize>) -> f64 {
    let used: Vec<&Disc> = discs.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, d)| *d).collect();
    let n = used.len() as f64;
    let pixels = used[0].len();
    let of_pixel = |p: usize| {
        let mean = used.iter().map(|disc| disc[p]).sum::<f64>() / n;
        let variance = used.iter().map(|disc| (disc[p] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (variance, mean)
    };
    let (variance, square) = (0..pixels).map(of_pixel).fold((0.0, 0.0), |(v, s), (a, b)| (v + a, s + b * b));
    variance / square
}

fn measure(gpu: &Gpu, subject: &Subject) -> Result<Value, AnyError> {
    eprintln!("{} ...", subject.name);
    let mut runs = Vec::new();
    for sequence in [SequenceKind::Independent, SequenceKind::Sobol] {
        let seeds = (1..=SEEDS).map(|seed| trace(gpu, subject, sequence, seed)).collect::<Result<Vec<_>, _>>()?;
        runs.push(seeds);
    }
    let mut rows = Vec::new();
    for (level, depth) in DEPTHS.iter().enumerate() {
        let discs: Vec<Vec<&Disc>> = runs.iter().map(|seeds| seeds.iter().map(|run| &run[level].0).collect()).collect();
        let variances = [relative_variance(&discs[0], None), relative_variance(&discs[1], None)];
        let ratio = variances[1] / variances[0];
        // Seeds of the two sequences are independent: the relative errors add in squares.
        let relative_error = |discs: &[&Disc], whole: f64| {
            let n = discs.len() as f64;
            let spread =
                (0..discs.len()).map(|i| (relative_variance(discs, Some(i)) / whole - 1.0).powi(2)).sum::<f64>();
            ((n - 1.0) / n * spread).sqrt()
        };
        let error = ratio * relative_error(&discs[0], variances[0]).hypot(relative_error(&discs[1], variances[1]));
        let counts: Vec<f64> =
            runs.iter().map(|seeds| seeds.iter().map(|run| run[level].1).sum::<f64>() / seeds.len() as f64).collect();
        rows.push(json!({
            "depth": depth, "mean_samples": counts, "independent": variances[0], "sobol": variances[1], "ratio": ratio,
            "standard_error": error,
        }));
    }
    Ok(json!({ "scene": subject.name, "rows": rows }))
}

fn table(raw: &Value) -> String {
    let mut text = String::from("# Sobol points against independent ones, in the fovea\n\n");
    if let Some(machine) = raw["machine"].as_object() {
        for (name, value) in machine {
            text += &format!("- {name}: {}\n", value.as_str().unwrap_or_default());
        }
    }
    text += &format!(
        "- FV, film 512x256, 8 bounces, foveal disc of {FOVEA_DEG} degrees, {SEEDS} seeds of each sequence\n- made by `cargo run \
         -p fovea-benches --bin sequence-report -- docs/reports SCENE...`; raw numbers in sequence.json\n\n"
    );
    text += "| scene | samples a foveal pixel | relative variance, independent | Sobol | Sobol / independent |\n";
    text += "|---|---|---|---|---|\n";
    for scene in raw["scenes"].as_array().into_iter().flatten() {
        for row in scene["rows"].as_array().into_iter().flatten() {
            let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
            text += &format!(
                "| {} | {:.1} | {:.3e} | {:.3e} | {:.3} +- {:.3} |\n",
                scene["scene"].as_str().unwrap_or_default(),
                row["mean_samples"][0].as_f64().unwrap_or(f64::NAN),
                number("independent"),
                number("sobol"),
                number("ratio"),
                number("standard_error")
            );
        }
    }
    text
}
