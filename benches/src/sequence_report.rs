//! `sequence-report OUT_DIR PART SCENE...`: what low-discrepancy points gain over independent ones where the eye looks and over a panorama.
//!
//! 8 bounces; see [`PARTS`] for films, samples and seeds; `all` measures all of them. The variance of the pixels' luminance over the
//! seeds, relative: in the foveal disc (5.79 degrees) to the mean square over its pixels, over the panorama each pixel's to its own
//! square. And the ratio of the two sequences with its standard error (jackknife over the seeds). Neither depends on the machine's
//! speed. Writes `sequence.json` (raw numbers; what was measured before of other scenes and parts stays) and `sequence.md`.

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

/// Where pixels are looked at.
struct Part {
    name: &'static str,
    title: &'static str,
    film: FilmOptions,
    is_foveated: bool,
    /// Samples a pixel.
    depths: &'static [u32],
    seeds: u32,
}

const PARTS: [Part; 3] = [
    Part {
        name: "fovea",
        title: "In the fovea: FV, the gaze at the film's centre",
        film: FilmOptions::equirect(512, 256),
        is_foveated: true,
        depths: &[16, 64, 256],
        seeds: 16,
    },
    Part {
        name: "seeds",
        title: "The same with more seeds",
        film: FilmOptions::equirect(512, 256),
        is_foveated: true,
        depths: &[64],
        seeds: 64,
    },
    Part {
        name: "panorama",
        title: "Over the panorama: OD",
        film: FilmOptions::equirect(256, 128),
        is_foveated: false,
        depths: &[16],
        seeds: 8,
    },
];

/// Samples of FV that fall on a pixel of the disc for each on a pixel of OD (facts of the default distribution: 63.4 at
/// the gaze, 60.5 with the floor).
const DENSITY: f64 = 60.5;
const FOVEA_DEG: f32 = 5.79;

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, wanted, files @ ..] = args else { return Err("usage: sequence-report OUT_DIR PART|all SCENE...".into()) };
    if wanted != "all" && PARTS.iter().all(|part| part.name != wanted) {
        return Err(format!("no part {wanted}").into());
    }
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let file = Path::new(out).join("sequence.json");
    let before: Option<Value> = std::fs::read(&file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut found: Vec<Value> = before.and_then(|raw| raw["parts"].as_array().cloned()).unwrap_or_default();
    for scene in files {
        let subject = Subject::open(Some(Path::new(scene)))?;
        for part in PARTS.iter().filter(|part| wanted == "all" || part.name == wanted) {
            let measured = measure(&gpu, &subject, part)?;
            found.retain(|old| old["scene"] != measured["scene"] || old["part"] != measured["part"]);
            found.push(measured);
        }
    }
    let raw = json!({ "parts": found });
    std::fs::create_dir_all(out)?;
    std::fs::write(file, format!("{raw:#}\n"))?;
    std::fs::write(Path::new(out).join("sequence.md"), table(&raw))?;
    Ok(())
}

/// Luminance of each pixel that is looked at.
type Pixels = Vec<f64>;

/// The pixels at each depth, and the mean samples there.
fn trace(
    gpu: &Gpu,
    subject: &Subject,
    part: &Part,
    sequence: SequenceKind,
    seed: u32,
) -> Result<Vec<(Pixels, f64)>, AnyError> {
    let acuity = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let inverse = Arc::new(Inverse::default_for(&acuity));
    let (distribution, density) = if part.is_foveated {
        (Distribution::foveated(Gaze::Scene { direction: Vec3::NEG_Z }, None, inverse), DENSITY)
    } else {
        (Distribution::omnidirectional(inverse), 1.0)
    };
    let options = RendererOptions { film: part.film, seed, sequence, ..Default::default() };
    let mut renderer = Renderer::new(gpu, &options, distribution)?;
    renderer.set_scene(&subject.scene)?;
    renderer.set_pose(subject.pose);
    let mut found = Vec::new();
    for &depth in part.depths {
        let samples = f64::from(depth) / density * part.film.pixels() as f64;
        renderer.render(StopCondition::Samples(samples as u64), |_| true)?;
        let film = renderer.snapshot()?;
        let inside = film.pixels().enumerate().filter(|(index, _)| {
            let (x, y) = (*index as u32 % part.film.width, *index as u32 / part.film.width);
            let from_gaze = film_direction(&part.film, x, y).angle_between(Vec3::NEG_Z);
            !part.is_foveated || from_gaze < FOVEA_DEG.to_radians()
        });
        let pixels: Vec<_> = inside.map(|(_, pixel)| pixel).collect();
        let count = pixels.iter().map(|pixel| f64::from(pixel.samples)).sum::<f64>() / pixels.len() as f64;
        let luminance = |rgb: [f64; 3]| 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        found.push((pixels.iter().map(|pixel| luminance(pixel.mean)).collect(), count));
    }
    Ok(found)
}

/// Variance over the seeds relative to the mean's square, mean over the pixels, or of each pixel to its own; seed `left_out` does not
/// take part.
fn relative_variance(part: &Part, discs: &[&Pixels], left_out: Option<usize>) -> f64 {
    let used: Vec<&Pixels> = discs.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, d)| *d).collect();
    let n = used.len() as f64;
    let pixels = used[0].len();
    let of_pixel = |p: usize| {
        let mean = used.iter().map(|disc| disc[p]).sum::<f64>() / n;
        let variance = used.iter().map(|disc| (disc[p] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (variance, mean)
    };
    if !part.is_foveated {
        let own = (0..pixels).map(of_pixel).filter(|(_, mean)| *mean > 0.0);
        return own.map(|(variance, mean)| variance / (mean * mean)).sum::<f64>() / pixels as f64;
    }
    let (variance, square) = (0..pixels).map(of_pixel).fold((0.0, 0.0), |(v, s), (a, b)| (v + a, s + b * b));
    variance / square
}

fn measure(gpu: &Gpu, subject: &Subject, part: &Part) -> Result<Value, AnyError> {
    eprintln!("{}, {} ...", subject.name, part.name);
    let mut runs = Vec::new();
    for sequence in [SequenceKind::Independent, SequenceKind::Sobol] {
        let seeds =
            (1..=part.seeds).map(|seed| trace(gpu, subject, part, sequence, seed)).collect::<Result<Vec<_>, _>>()?;
        runs.push(seeds);
    }
    let mut rows = Vec::new();
    for (level, depth) in part.depths.iter().enumerate() {
        let discs: Vec<Vec<&Pixels>> =
            runs.iter().map(|seeds| seeds.iter().map(|run| &run[level].0).collect()).collect();
        let variances = [relative_variance(part, &discs[0], None), relative_variance(part, &discs[1], None)];
        let ratio = variances[1] / variances[0];
        // Seeds of the two sequences are independent: the relative errors add in squares.
        let relative_error = |discs: &[&Pixels], whole: f64| {
            let n = discs.len() as f64;
            let spread =
                (0..discs.len()).map(|i| (relative_variance(part, discs, Some(i)) / whole - 1.0).powi(2)).sum::<f64>();
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
    let provenance: serde_json::Map<_, _> =
        Provenance::on(gpu).fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    Ok(json!({
        "scene": subject.name, "part": part.name, "seeds": part.seeds, "provenance": provenance, "rows": rows,
    }))
}

/// Where a part was measured, in a line.
fn place(provenance: &Value) -> String {
    let field = |name: &str| provenance[name].as_str().unwrap_or_default().to_owned();
    format!("{}; {}; commit {}", field("machine"), field("adapter"), field("commit"))
}

fn table(raw: &Value) -> String {
    let mut text = String::from("# A pixel's sequence against independent points\n\n");
    let parts = || raw["parts"].as_array().into_iter().flatten();
    text += "8 bounces; made by `cargo run --release -p fovea-benches --bin sequence-report -- docs/reports PART|all SCENE...`; raw \
             numbers in sequence.json.\n";
    for part in &PARTS {
        let [width, height] = [part.film.width, part.film.height];
        text += &format!("\n## {}\n\nFilm {width}x{height}, {} seeds of each sequence.\n", part.title, part.seeds);
        let of_part = || parts().filter(|found| found["part"] == part.name);
        let mut places: Vec<String> = of_part().map(|found| place(&found["provenance"])).collect();
        places.dedup();
        text += &format!("{}.\n\n", places.join("; "));
        text += "| scene | samples a pixel | relative variance, independent | sequence | sequence / independent |\n";
        text += "|---|---|---|---|---|\n";
        for found in of_part() {
            for row in found["rows"].as_array().into_iter().flatten() {
                let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
                text += &format!(
                    "| {} | {:.1} | {:.3e} | {:.3e} | {:.3} +- {:.3} |\n",
                    found["scene"].as_str().unwrap_or_default(),
                    row["mean_samples"][0].as_f64().unwrap_or(f64::NAN),
                    number("independent"),
                    number("sobol"),
                    number("ratio"),
                    number("standard_error")
                );
            }
        }
    }
    text + include_str!("sequence_notes.md")
}
