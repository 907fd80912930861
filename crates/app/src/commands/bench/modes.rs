//! Samples and path segments a second of every mode at every gaze, and the time of every pass.

use std::time::Instant;

use serde_json::{Value, json};
use tracer::gpu::Gpu;

use super::subject::{PICTURE_PX, Picture, Subject};
use super::{direction_json, finite};
use crate::cli::bench::BenchArgs;
use crate::commands::study::plan::Method;
use crate::process::{cpu_secs, resident_bytes};

/// The modes that are compared.
pub const MODES: [Method; 3] = [Method::Od, Method::Vp, Method::Fv];

/// Seconds of a mode's passes at a gaze, a value a round.
#[derive(Default)]
struct Passes {
    generate: Vec<Option<f64>>,
    trace: Vec<Option<f64>>,
    accumulate: Vec<Option<f64>>,
    reconstruct: Vec<Option<f64>>,
    /// By the clock, of trace and accumulate.
    wall: Vec<f64>,
    /// Of the process, of trace and accumulate.
    cpu: Vec<Value>,
    samples: u64,
    segments: u64,
    shadow_rays: u64,
}

/// Measures the modes.
///
/// # Errors
/// When the scene does not fit the adapter or the device is lost.
pub fn measure(gpu: &Gpu, args: &BenchArgs, subject: &Subject) -> anyhow::Result<Value> {
    let (mut renderer, report) = subject.renderer(gpu, args, &subject.scene)?;
    let mut rows = Vec::new();
    for (number, place) in subject.places.iter().enumerate() {
        let picture = Picture::new(gpu, place, PICTURE_PX);
        let mut passes: [Passes; MODES.len()] = Default::default();
        // The first round compiles the kernels.
        let untimed = u32::from(number == 0);
        for round in 0..args.rounds + untimed {
            for (mode, passes) in MODES.into_iter().zip(&mut passes) {
                renderer.set_distribution(subject.distribution(mode, place))?;
                renderer.restart();
                let generate = renderer.time_ray_generation(args.samples)?;
                let (started, cpu) = (Instant::now(), cpu_secs());
                let (samples, seconds) = renderer.trace_timed(args.samples)?;
                let (wall, cpu) = (started.elapsed().as_secs_f64(), cpu_secs() - cpu);
                let reconstruct = picture.draw(&mut renderer)?;
                if round < untimed {
                    continue;
                }
                let counted = renderer.statistics()?;
                passes.generate.push(generate);
                passes.trace.push(seconds.map(|seconds| seconds.trace));
                passes.accumulate.push(seconds.map(|seconds| seconds.accumulate));
                passes.reconstruct.push(reconstruct);
                passes.wall.push(wall);
                passes.cpu.push(finite(cpu));
                (passes.samples, passes.segments) = (u64::from(samples), counted.segments);
                passes.shadow_rays = counted.shadow_rays;
            }
        }
        for (mode, passes) in MODES.into_iter().zip(passes) {
            rows.push(json!({
                "mode": mode.name(), "gaze": place.name(), "direction": direction_json(place.gaze.direction),
                "samples": passes.samples, "segments": passes.segments, "shadow_rays": passes.shadow_rays,
                "generate_s": passes.generate, "trace_s": passes.trace, "accumulate_s": passes.accumulate,
                "reconstruct_s": passes.reconstruct, "wall_s": passes.wall, "process_cpu_s": passes.cpu,
            }));
        }
    }
    let upload = report.upload;
    Ok(json!({
        "film": [subject.film.width, subject.film.height], "picture": PICTURE_PX, "max_bounces": args.max_bounces,
        "triangles": upload.triangles, "geometry_bytes": upload.geometry_bytes, "scene_bytes": upload.device_bytes,
        "film_bytes": subject.film.bytes(), "resident_bytes": resident_bytes(),
        "import_s": subject.import_secs, "bvh_build_s": upload.bvh_build_secs, "upload_s": upload.upload_secs,
        "kernel_compile_s": report.kernel_compile_secs, "kernel": renderer.key(tracer::kernels::Kernel::Trace).to_string(),
        "batches": rows,
    }))
}
