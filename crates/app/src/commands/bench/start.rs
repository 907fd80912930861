//! From the start of a process to its first pictures, without a window: device, shapes, hierarchies and a sketch of first hits, as
//! coarse as the window's; then images and tangents, upload, kernels, a first batch, and its reconstruction at 1280x720. Timed from
//! outside, so that loading the program counts.

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Instant, SystemTime};

use anyhow::{Context, ensure};
use clap::ValueEnum;
use serde_json::{Value, json};
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::renderer::FIRST_BATCH;

use super::subject::{PICTURE_PX, Picture, Subject};
use crate::cli::bench::BenchArgs;
use crate::commands::print_json;
use crate::preview::tracing::COARSENESS;

/// Shows the scene once: what the process that is timed does.
///
/// # Errors
/// Bad input, or an adapter that cannot do it.
pub fn show(args: &BenchArgs) -> anyhow::Result<()> {
    let started = Instant::now();
    let mut last = 0.0;
    let mut since = || {
        let now = started.elapsed().as_secs_f64();
        now - std::mem::replace(&mut last, now)
    };
    let gpu = Gpu::headless(&args.adapter.clone().map_or(AdapterSelect::Auto, AdapterSelect::Named))?;
    let device = since();
    let mut sketched = None;
    let sketch = |subject: Subject| -> anyhow::Result<()> {
        let shapes = since();
        let place = subject.places.first().context("no gaze")?;
        let mut renderer = subject.empty_renderer(&gpu, args)?;
        let coarseness = if gpu.is_software() { COARSENESS } else { 1 };
        Picture::new(&gpu, place, PICTURE_PX.map(|pixels| pixels / coarseness))
            .sketch(&mut renderer, &subject.scene)?;
        sketched = Some((renderer, shapes, since(), unix_secs()?));
        Ok(())
    };
    let subject = Subject::open_showing(args, sketch)?;
    let (mut renderer, shapes, sketch, sketched_at) = sketched.context("no sketch")?;
    let import = since();
    let place = subject.places.first().context("no gaze")?;
    let report = renderer.set_scene(&subject.scene)?;
    let set = since();
    renderer.trace(FIRST_BATCH)?;
    gpu.wait()?;
    let batch = since();
    Picture::new(&gpu, place, PICTURE_PX).draw(&mut renderer)?;
    let picture = since();
    let compile = report.kernel_compile_secs;
    print_json(&json!({
        "device_s": device, "shapes_s": shapes, "sketch_s": sketch, "sketched_at_unix_s": sketched_at, "import_s": import,
        "upload_s": report.upload.bvh_build_secs + report.upload.upload_secs, "kernels_s": compile,
        "rest_of_scene_s": set - report.upload.bvh_build_secs - report.upload.upload_secs - compile,
        "first_batch_s": batch, "picture_s": picture,
    }))
}

/// What two processes can compare.
fn unix_secs() -> anyhow::Result<f64> {
    Ok(SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).context("the clock is before 1970")?.as_secs_f64())
}

/// Times processes of this program: each first with an empty folder for the driver's cache, then with what it left there.
///
/// # Errors
/// When the program cannot be started.
pub fn measure(args: &BenchArgs) -> anyhow::Result<Value> {
    let (mut cold, mut cached) = (Vec::new(), Vec::new());
    for round in 0..args.rounds {
        let folder = std::env::temp_dir().join(format!("fovea-bench-cache-{}-{round}", std::process::id()));
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let times = first_picture(args, &folder).and_then(|first| Ok((first, first_picture(args, &folder)?)));
        // What stays in the folder for temporary files harms nothing.
        let _ = std::fs::remove_dir_all(&folder);
        let (first, second) = times?;
        cold.push(first);
        cached.push(second);
    }
    Ok(json!({ "cold": cold, "cached": cached }))
}

/// One process, with its shader cache in `folder` where the driver is Mesa's.
fn first_picture(args: &BenchArgs, folder: &Path) -> anyhow::Result<Value> {
    let mut command = Command::new(std::env::current_exe().context("the program's own file")?);
    command.args(words(args)).stderr(Stdio::null());
    command.env("MESA_SHADER_CACHE_DIR", folder).env_remove("MESA_SHADER_CACHE_DISABLE");
    let (started, started_at) = (Instant::now(), unix_secs()?);
    let output = command.output().context("the program itself")?;
    let seconds = started.elapsed().as_secs_f64();
    ensure!(output.status.success(), "the process that shows the scene failed");
    let mut stages: Value = serde_json::from_slice(&output.stdout).context("what that process says")?;
    stages["process_s"] = seconds.into();
    stages["until_sketch_s"] = stages["sketched_at_unix_s"].as_f64().map(|at| at - started_at).into();
    Ok(stages)
}

/// The command line of that process.
fn words(args: &BenchArgs) -> Vec<OsString> {
    let mut words: Vec<OsString> = ["bench", "--first-picture"].map(OsString::from).to_vec();
    if let Some(scene) = &args.scene {
        let camera = scene.camera.as_ref().map(|camera| format!("@{camera}")).unwrap_or_default();
        let mut file = scene.path.clone().into_os_string();
        file.push(camera);
        words.push(file);
    }
    let mut option = |name: &str, value: String| words.extend([name.into(), value.into()]);
    option("--film", format!("{}x{}", args.film.width, args.film.height));
    option("--max-bounces", args.max_bounces.to_string());
    if let Some(background) = args.background {
        let [r, g, b] = background.0;
        option("--background", format!("{r},{g},{b}"));
    }
    if let Some(schedule) = args.schedule.to_possible_value() {
        option("--schedule", schedule.get_name().to_owned());
    }
    if let Some(adapter) = &args.adapter {
        option("--adapter", adapter.clone());
    }
    words
}
