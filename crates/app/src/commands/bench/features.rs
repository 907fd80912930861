//! What every compile-time feature of the path kernel costs where a scene does not need it, and all of them together.

use std::time::Instant;

use serde_json::{Value, json};
use tracer::features::{Feature, SceneFeatures};
use tracer::gpu::Gpu;
use tracer::kernels::{Kernel, compose};

use super::subject::Subject;
use crate::cli::bench::BenchArgs;
use crate::commands::study::plan::Method;

/// Measures the scene's own kernel, one with each further feature, and one with all of them, in turn.
///
/// # Errors
/// When the scene does not fit the adapter, a kernel does not compile, or the device is lost.
pub fn measure(gpu: &Gpu, args: &BenchArgs, subject: &Subject) -> anyhow::Result<Value> {
    let (mut renderer, _) = subject.renderer(gpu, args, &subject.scene)?;
    if let Some(place) = subject.places.first() {
        renderer.set_distribution(subject.distribution(Method::Od, place))?;
    }
    let own = renderer.key(Kernel::Trace).features;
    // Lobes that mirror read tables, which are uploaded only where the scene needs them.
    let can_run = |f: Feature| own.contains(Feature::Specular) || !with_what_it_needs(f).contains(Feature::Specular);
    let absent: Vec<Feature> =
        Feature::ALL.iter().copied().filter(|&f| f.may_be_spare() && !own.contains(f) && can_run(f)).collect();
    let mut kernels = vec![("own".to_owned(), SceneFeatures::default())];
    kernels.extend(absent.iter().map(|&f| (f.name().to_lowercase(), with_what_it_needs(f))));
    kernels.push(("all".into(), absent.iter().copied().collect()));
    let mut rows = Vec::new();
    for (name, spare) in &kernels {
        let started = Instant::now();
        renderer.set_spare_features(*spare)?;
        renderer.trace(1)?;
        gpu.wait()?;
        let first_dispatch = started.elapsed().as_secs_f64();
        let lines = compose(&renderer.key(Kernel::Trace))?.lines().count();
        rows.push(json!({ "kernel": name, "lines": lines, "first_dispatch_s": first_dispatch, "trace_s": [] }));
    }
    for _ in 0..args.rounds {
        for ((_, spare), row) in kernels.iter().zip(&mut rows) {
            renderer.set_spare_features(*spare)?;
            renderer.restart();
            gpu.wait()?;
            let started = Instant::now();
            let (_, seconds) = renderer.trace_timed(args.samples)?;
            let seconds = seconds.map_or_else(|| started.elapsed().as_secs_f64(), |seconds| seconds.trace);
            if let Some(list) = row["trace_s"].as_array_mut() {
                list.push(seconds.into());
            }
        }
    }
    Ok(json!({ "needs": own.to_string(), "samples": args.samples, "kernels": rows }))
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
