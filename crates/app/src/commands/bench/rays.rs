//! Rays a second without shading: the kernels' traversal of both hierarchies and obvhs on the CPU, the same rays in turn.
//!
//! Primary rays are those of the modes OD and, at every gaze, FV, as the device makes them and in its order. From what they hit
//! start as many cosine-distributed rays, and as many shadow rays to random points of the scene. Alpha and transmission are left
//! out: obvhs does not look at them.

use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use serde_json::{Value, json};
use tracer::bvh::HierarchyKind;
use tracer::gpu::Gpu;
use tracer::renderer::{Query, Renderer};
use tracer::scene::AlphaMode;

use super::baseline::{Baseline, secondary_rays};
use super::subject::Subject;
use super::{direction_json, finite};
use crate::cli::bench::BenchArgs;
use crate::commands::study::plan::Method;
use crate::process::cpu_secs;

/// Kinds of rays by name.
pub const KINDS: [&str; 3] = ["primary", "diffuse", "shadow"];

/// Measures the traversal.
///
/// # Errors
/// When the scene does not fit the adapter or the device is lost.
pub fn measure(gpu: &Gpu, args: &BenchArgs, subject: &Subject) -> anyhow::Result<Value> {
    let mut scene = (*subject.scene).clone();
    for material in &mut scene.materials {
        let material = Arc::make_mut(material);
        material.alpha_mode = AlphaMode::Opaque;
        material.transmission = 0.0;
    }
    let (mut renderer, report) = subject.renderer(gpu, args, &scene)?;
    let own = renderer.hierarchy();
    let other_kind = match own {
        HierarchyKind::Wide => HierarchyKind::Binary,
        HierarchyKind::Binary => HierarchyKind::Wide,
    };
    let (mut other, _) = subject.renderer_with(gpu, args, &scene, Some(other_kind))?;
    let baseline = Baseline::build(&scene);
    let everywhere = subject.places.first().map(|place| ("od".to_owned(), Method::Od, place));
    let looks = subject.places.iter().map(|place| (format!("fv {}", place.name()), Method::Fv, place));
    let mut rows = Vec::new();
    for (name, method, place) in everywhere.into_iter().chain(looks) {
        renderer.set_distribution(subject.distribution(method, place))?;
        let primary = renderer.primary_rays(args.rays)?;
        let [diffuse, shadow] = secondary_rays(&scene, &baseline, &primary);
        for (kind, rays) in KINDS.iter().zip([&primary, &diffuse, &shadow]) {
            // Where one looks past the scene, nothing starts from what is hit.
            if rays.len() < args.rays as usize / 16 {
                continue;
            }
            let mut row = time([&mut renderer, &mut other], &baseline, rays, args.rounds)?;
            row["gaze"] = name.as_str().into();
            row["direction"] = direction_json(place.gaze.direction);
            row["rays"] = (*kind).into();
            rows.push(row);
        }
    }
    Ok(
        json!({ "triangles": report.upload.triangles, "hierarchy": name(own), "other_hierarchy": name(other_kind), "sets": rows }),
    )
}

/// A hierarchy in raw numbers.
fn name(kind: HierarchyKind) -> &'static str {
    match kind {
        HierarchyKind::Wide => "CWBVH",
        HierarchyKind::Binary => "BVH2",
    }
}

/// Seconds of both hierarchies on the device and of obvhs for a set of rays, in turn.
fn time(
    [renderer, other]: [&mut Renderer; 2],
    baseline: &Baseline,
    rays: &[Query],
    rounds: u32,
) -> anyhow::Result<Value> {
    let (answers, _) = renderer.query(rays)?;
    let differs = |(answer, ray): &(&Option<_>, &Query)| answer.is_some() != baseline.hits(ray);
    let differing = answers.par_iter().zip(rays).filter(differs).count();
    let hits = answers.iter().flatten().count();
    other.query(rays)?;
    let device_secs = |renderer: &mut Renderer| -> anyhow::Result<f64> {
        let started = Instant::now();
        let (_, seconds) = renderer.query(rays)?;
        Ok(seconds.unwrap_or_else(|| started.elapsed().as_secs_f64()))
    };
    let (mut device_s, mut other_s, mut cpu_s) = (Vec::new(), Vec::new(), Vec::new());
    // Of the process; a device that is the CPU works in it.
    let mut cpu_time = [0.0; 2];
    for _ in 0..rounds {
        let before = cpu_secs();
        device_s.push(device_secs(renderer)?);
        let between = cpu_secs();
        cpu_s.push(baseline.time(rays));
        cpu_time[0] += between - before;
        cpu_time[1] += cpu_secs() - between;
        other_s.push(device_secs(other)?);
    }
    Ok(json!({
        "count": rays.len(), "hits": hits, "hit_or_miss_differs": differing,
        "device_s": device_s, "other_s": other_s, "obvhs_s": cpu_s,
        "device_process_cpu_s": finite(cpu_time[0]), "obvhs_process_cpu_s": finite(cpu_time[1]),
    }))
}
