//! Samples and path segments a second of every mode at every gaze by both schedules, and the time of every pass.

use std::time::Instant;

use serde_json::{Value, json};
use tracer::gpu::Gpu;
use tracer::renderer::{BatchSeconds, Renderer, StageSeconds};

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
    /// Of the other schedule's trace.
    other_trace: Vec<Option<f64>>,
    /// Of the wavefront schedule, whichever of both it is.
    stages: Vec<StageSeconds>,
    /// By the clock, of trace and accumulate; of the other schedule.
    wall: Vec<f64>,
    other_wall: Vec<f64>,
    /// Of the process, of trace and accumulate.
    cpu: Vec<Value>,
    samples: u64,
    segments: u64,
    shadow_rays: u64,
}

/// Samples of a batch, what they took on the device, and seconds by the clock.
fn batch(renderer: &mut Renderer, samples: u32) -> anyhow::Result<(u32, Option<BatchSeconds>, f64)> {
    renderer.restart();
    let started = Instant::now();
    let (samples, seconds) = renderer.trace_timed(samples)?;
    Ok((samples, seconds, started.elapsed().as_secs_f64()))
}

/// Measures the modes.
///
/// # Errors
/// When the scene does not fit the adapter or the device is lost.
pub fn measure(gpu: &Gpu, args: &BenchArgs, subject: &Subject) -> anyhow::Result<Value> {
    let (mut renderer, report) = subject.renderer(gpu, args, &subject.scene)?;
    let own = renderer.schedule();
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
                renderer.set_schedule(own.other())?;
                let (_, other, other_wall) = batch(&mut renderer, args.samples)?;
                renderer.set_schedule(own)?;
                let cpu = cpu_secs();
                let (samples, seconds, wall) = batch(&mut renderer, args.samples)?;
                let cpu = cpu_secs() - cpu;
                let reconstruct = picture.draw(&mut renderer)?;
                if round < untimed {
                    continue;
                }
                let counted = renderer.statistics()?;
                passes.generate.push(generate);
                passes.trace.push(seconds.map(|seconds| seconds.trace));
                passes.accumulate.push(seconds.map(|seconds| seconds.accumulate));
                passes.reconstruct.push(reconstruct);
                passes.other_trace.push(other.map(|seconds| seconds.trace));
                passes.stages.extend([seconds, other].into_iter().flatten().filter_map(|seconds| seconds.stages));
                passes.wall.push(wall);
                passes.other_wall.push(other_wall);
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
                "other_trace_s": passes.other_trace, "other_wall_s": passes.other_wall,
                "start_s": stage(&passes.stages, |stages| stages.start),
                "extend_s": stage(&passes.stages, |stages| stages.extend),
                "shade_s": stage(&passes.stages, |stages| stages.shade),
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
        "schedule": own.name(), "other_schedule": own.other().name(), "batches": rows,
    }))
}

/// Seconds of one kernel, a value a round.
fn stage(rounds: &[StageSeconds], seconds: impl Fn(&StageSeconds) -> f64) -> Vec<f64> {
    rounds.iter().map(seconds).collect()
}
