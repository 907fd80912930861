//! `feature-report OUT_DIR SCENE...`: what each compile-time feature costs where it is not needed.
//!
//! For the built-in scene and each file: seconds to trace 2^16 samples (OD, 8 bounces) with the scene's own kernel, with each
//! further feature alone, and with all of them; the kernels take turns, the fastest of their runs counts. Also the kernels'
//! size and the time to compile them. Writes `features.json` (raw numbers) and `features.md` (the table).

use std::{path::Path, process::ExitCode, sync::Arc, time::Instant};

use fovea_benches::{AnyError, Subject, report_main};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use serde_json::{Value, json};
use tracer::{
    distribution::Distribution,
    features::{Feature, SceneFeatures},
    gpu::{AdapterSelect, Gpu},
    kernels::{Kernel, compose},
    provenance::Provenance,
    renderer::{Renderer, RendererOptions},
};

const SAMPLES: u64 = 1 << 16;
const ROUNDS: u32 = 4;

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, files @ ..] = args else { return Err("usage: feature-report OUT_DIR SCENE...".into()) };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut scenes = vec![measure(&gpu, None)?];
    for file in files {
        scenes.push(measure(&gpu, Some(Path::new(file)))?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({ "machine": machine, "samples": SAMPLES, "rounds": ROUNDS, "scenes": scenes });
    std::fs::create_dir_all(out)?;
    std::fs::write(Path::new(out).join("features.json"), format!("{raw:#}\n"))?;
    std::fs::write(Path::new(out).join("features.md"), table(&raw))?;
    Ok(())
}

fn measure(gpu: &Gpu, file: Option<&Path>) -> Result<Value, AnyError> {
    let Subject { name, scene, pose } = Subject::open(file)?;
    eprintln!("{name} ...");
    let distribution = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let everywhere = Distribution::omnidirectional(Arc::new(Inverse::default_for(&distribution)));
    let mut renderer = Renderer::new(gpu, &RendererOptions::default(), everywhere)?;
    renderer.set_scene(&scene)?;
    renderer.set_pose(pose);
    let own = renderer.key(Kernel::Trace).features;
    // Lobes that mirror read tables, which are uploaded only where the scene needs them.
    let can_run = |f: Feature| own.contains(Feature::Specular) || !with_what_it_needs(f).contains(Feature::Specular);
    let absent: Vec<Feature> =
        Feature::ALL.iter().copied().filter(|&f| f.may_be_spare() && !own.contains(f) && can_run(f)).collect();
    let mut kernels = vec![("own".to_owned(), SceneFeatures::default())];
    kernels.extend(absent.iter().map(|&f| (f.name().to_lowercase(), with_what_it_needs(f))));
    kernels.push(("all".into(), absent.iter().copied().collect()));
    let mut rows = Vec::new();
    for (kernel, spare) in &kernels {
        let started = Instant::now();
        renderer.set_spare_features(*spare)?;
        renderer.trace(1)?;
        gpu.wait()?;
        let lines = compose(&renderer.key(Kernel::Trace))?.lines().count();
        rows.push((kernel, started.elapsed().as_secs_f64(), lines, f64::INFINITY));
    }
    for _ in 0..ROUNDS {
        for ((_, spare), row) in kernels.iter().zip(&mut rows) {
            renderer.set_spare_features(*spare)?;
            renderer.restart();
            gpu.wait()?;
            let started = Instant::now();
            while renderer.samples() < SAMPLES {
                renderer.trace((SAMPLES - renderer.samples()) as u32)?;
            }
            gpu.wait()?;
            row.3 = row.3.min(started.elapsed().as_secs_f64());
        }
    }
    let own_seconds = rows[0].3;
    let rows: Vec<Value> = rows
        .into_iter()
        .map(|(kernel, compile, lines, seconds)| {
            json!({
                "kernel": kernel, "first_dispatch_s": compile, "lines": lines, "seconds": seconds,
                "over_own": seconds / own_seconds,
            })
        })
        .collect();
    Ok(json!({ "scene": name, "features": own.to_string(), "kernels": rows }))
}

/// A feature with those that it never occurs without.
fn with_what_it_needs(feature: Feature) -> SceneFeatures {
    let more: &[Feature] = match feature {
        Feature::Emission | Feature::SunDiscs => &[Feature::Lights],
        Feature::NormalMaps | Feature::SpecularTextures => &[Feature::Textures],
        Feature::Specular | Feature::Anisotropy | Feature::Iridescence | Feature::Transmission => &[Feature::Specular],
        Feature::Solid | Feature::ClearSheets => &[Feature::Transmission, Feature::Specular],
        Feature::Absorption | Feature::Dispersion => &[Feature::Solid, Feature::Transmission, Feature::Specular],
        _ => &[],
    };
    more.iter().copied().chain([feature]).collect()
}

fn table(raw: &Value) -> String {
    let mut text = String::from("# What features cost where they are not needed\n\n");
    if let Some(machine) = raw["machine"].as_object() {
        for (name, value) in machine {
            text.push_str(&format!("- {name}: {}\n", value.as_str().unwrap_or("")));
        }
    }
    text.push_str(
        "- 2^16 samples, OD, film 2048x1024, 8 bounces; the kernels take turns, the fastest of 4 runs counts\n\
         - a feature is compiled in with those that it never occurs without\n\
         - made by `cargo run -p fovea-benches --bin feature-report -- docs/reports SCENE...`; raw numbers in \
         features.json\n",
    );
    for scene in raw["scenes"].as_array().into_iter().flatten() {
        let heading = format!(
            "\n## {}\nNeeds {}.\n\n| kernel | seconds | over the scene's own | lines of WGSL | first dispatch s |\n|---|---|---|---|---|\n",
            scene["scene"].as_str().unwrap_or(""),
            scene["features"].as_str().unwrap_or("")
        );
        text.push_str(&heading);
        for row in scene["kernels"].as_array().into_iter().flatten() {
            let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
            text.push_str(&format!(
                "| {} | {:.3} | {:.3} | {} | {:.2} |\n",
                row["kernel"].as_str().unwrap_or(""),
                number("seconds"),
                number("over_own"),
                row["lines"],
                number("first_dispatch_s")
            ));
        }
    }
    text
}
