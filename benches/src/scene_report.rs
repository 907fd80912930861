//! `scene-report OUT_DIR [SECONDS] SCENE...`: what a person waits for and gets, by scene.
//!
//! For the built-in scene and each file: start to first picture (import, hierarchies, upload, kernels, a batch of 2^14
//! samples and its presentation at 1280x720), edits (until a picture of 2^13 samples made after them), then samples/s and segments/s in OD and FV over SECONDS each, and memory.
//! Writes `scenes.json` (raw numbers) and `scenes.md` (the table). Camera and background per scene are those of the
//! reference images: camera 0 (2 for bmw and sponza), sky 1 where the scene is open.

use std::{path::Path, process::ExitCode, sync::Arc, time::Instant};

use fovea_benches::{AnyError, Subject, report_main};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::{Quat, Vec3};
use serde_json::{Value, json};
use tracer::{
    distribution::{Distribution, Gaze, View},
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
    renderer::{FIRST_BATCH, Renderer, RendererOptions, StopCondition},
    scene::Scene,
    view::{DebugView, ToneMap, ViewProjection, ViewSettings},
};

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, rest @ ..] = args else { return Err("usage: scene-report OUT_DIR [SECONDS] SCENE...".into()) };
    let (seconds, files) = match rest.first().and_then(|first| first.parse::<f64>().ok()) {
        Some(seconds) => (seconds, &rest[1..]),
        None => (10.0, rest),
    };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut rows = vec![measure(&gpu, None, seconds)?];
    for file in files {
        rows.push(measure(&gpu, Some(Path::new(file)), seconds)?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({ "machine": machine, "seconds_per_mode": seconds, "scenes": rows });
    std::fs::create_dir_all(out)?;
    std::fs::write(Path::new(out).join("scenes.json"), format!("{raw:#}\n"))?;
    std::fs::write(Path::new(out).join("scenes.md"), table(&raw))?;
    Ok(())
}

fn measure(gpu: &Gpu, file: Option<&Path>, seconds: f64) -> Result<Value, AnyError> {
    let started = Instant::now();
    let Subject { name: stem, scene, pose } = Subject::open(file)?;
    let import = started.elapsed().as_secs_f64();
    eprintln!("{stem} ...");
    let distribution = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let inverse = Arc::new(Inverse::default_for(&distribution));
    let foveated = Distribution::foveated(Gaze::Scene { direction: Vec3::NEG_Z }, None, inverse.clone());
    let mut renderer = Renderer::new(gpu, &RendererOptions::default(), foveated.clone())?;
    let report = renderer.set_scene(&scene)?;
    renderer.set_pose(pose);
    renderer.trace(FIRST_BATCH)?;
    present(gpu, &mut renderer)?;
    let first_picture = started.elapsed().as_secs_f64();

    let mut row = json!({
        "scene": stem,
        "triangles": report.upload.triangles,
        "import_s": import,
        "bvh_build_s": report.upload.bvh_build_secs,
        "upload_s": report.upload.upload_secs,
        "kernel_compile_s": report.kernel_compile_secs,
        "first_picture_s": first_picture,
        "scene_device_bytes": report.upload.device_bytes,
        "film_bytes": renderer.options().film.bytes(),
        "resident_bytes": resident_bytes(),
    });
    for (mode, distribution) in [("od", Distribution::omnidirectional(inverse)), ("fv", foveated)] {
        renderer.set_distribution(distribution)?;
        renderer.restart();
        let seconds = renderer.render(StopCondition::Seconds(seconds), |_| true)?;
        let statistics = renderer.statistics()?;
        let per_second = |count: u64| count as f64 / seconds;
        row[format!("{mode}_samples_per_s")] = per_second(statistics.samples).into();
        row[format!("{mode}_segments_per_s")] = per_second(statistics.segments).into();
        row[format!("{mode}_mean_path_length")] = (statistics.segments as f64 / statistics.samples as f64).into();
    }
    let edits = edit_latency(gpu, &mut renderer, scene)?;
    for (edit, seconds) in ["material_edit_s", "first_move_s", "move_s"].iter().zip(edits) {
        row[*edit] = seconds.into();
    }
    Ok(row)
}

/// Samples between an edit and the picture: in FV at least a thousand of them fall into the foveal disc.
const EDIT_SAMPLES: u32 = 1 << 13;

/// Seconds from an edit to a presented picture of samples traced after it: of a material, of an object's first move, and of
/// its further ones; medians of five but for the first move.
fn edit_latency(gpu: &Gpu, renderer: &mut Renderer, mut scene: Scene) -> Result<[f64; 3], AnyError> {
    let mut shown = |edit: &dyn Fn(&mut Scene), times: usize| -> Result<f64, AnyError> {
        let mut seconds = Vec::new();
        for _ in 0..times {
            edit(&mut scene);
            let started = Instant::now();
            renderer.set_scene(&scene)?;
            renderer.trace(EDIT_SAMPLES)?;
            present(gpu, renderer)?;
            seconds.push(started.elapsed().as_secs_f64());
        }
        seconds.sort_by(f64::total_cmp);
        Ok(seconds[times / 2])
    };
    let tint = |scene: &mut Scene| {
        if let Some(material) = scene.materials.first_mut() {
            Arc::make_mut(material).base_color.x *= 0.9;
        }
    };
    let shift = |scene: &mut Scene| {
        if let Some(instance) = scene.instances.first_mut() {
            instance.world_from_mesh.translation.x += 1e-3;
        }
    };
    Ok([shown(&tint, 5)?, shown(&shift, 1)?, shown(&shift, 5)?])
}

/// Presents once to a texture of 1280x720 and waits.
fn present(gpu: &Gpu, renderer: &mut Renderer) -> Result<(), AnyError> {
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let target = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width: 1280, height: 720, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let settings = ViewSettings {
        projection: ViewProjection::Perspective(View::new(Quat::IDENTITY, 1.6, 1.0)),
        size: [1280, 720],
        exposure_ev: 0.0,
        tone_map: ToneMap::AgX,
        debug_view: DebugView::Beauty,
        fill: true,
        ring: None,
    };
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    renderer.present(&mut encoder, &settings, &target.create_view(&Default::default()), format)?;
    gpu.queue.submit([encoder.finish()]);
    gpu.wait()?;
    Ok(())
}

/// Resident memory of this process; on a software adapter it holds the device's memory too. 0 where it is not known.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok()).unwrap_or(0) * 1024
}

fn table(raw: &Value) -> String {
    let mut text = String::from("# Scenes: start, speed, memory\n\n");
    if let Some(machine) = raw["machine"].as_object() {
        for (name, value) in machine {
            text += &format!("- {name}: {}\n", value.as_str().unwrap_or_default());
        }
    }
    text += &format!(
        "- {} s a mode; film 2048x1024; 8 bounces; Sobol; gaze at the panorama's centre\n- made by `cargo run --release \
         -p fovea-benches --bin scene-report -- docs/reports 20 SCENE...`; raw numbers in scenes.json\n\n",
        raw["seconds_per_mode"]
    );
    text += "| scene | triangles | import s | BVH s | upload s | kernels s | first picture s | edit of a material / first move / next moves, ms | OD k samples/s | OD k segments/s \
             | FV k samples/s | FV k segments/s | path length OD / FV | scene MB | resident MB |\n";
    text += &format!("|{}\n", "---|".repeat(15));
    for row in raw["scenes"].as_array().into_iter().flatten() {
        let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
        text += &format!(
            "| {} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.0} / {:.0} / {:.0} | {:.1} | {:.1} | {:.1} | {:.1} | {:.2} / {:.2} | {:.0} | {:.0} |\n",
            row["scene"].as_str().unwrap_or_default(),
            row["triangles"],
            number("import_s"),
            number("bvh_build_s"),
            number("upload_s"),
            number("kernel_compile_s"),
            number("first_picture_s"),
            number("material_edit_s") * 1e3,
            number("first_move_s") * 1e3,
            number("move_s") * 1e3,
            number("od_samples_per_s") / 1e3,
            number("od_segments_per_s") / 1e3,
            number("fv_samples_per_s") / 1e3,
            number("fv_segments_per_s") / 1e3,
            number("od_mean_path_length"),
            number("fv_mean_path_length"),
            number("scene_device_bytes") / 1e6,
            number("resident_bytes") / 1e6,
        );
    }
    text
}
