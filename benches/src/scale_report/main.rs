//! `scale-report OUT_DIR SCENES_DIR [LARGEST_TRIANGLES [LARGEST_INSTANCES]]`: what scenes of 10^4 to 10^7 triangles cost, and of
//! 10^3 to 10^5 instances.
//!
//! Writes the scenes to SCENES_DIR as `.glb` files, where they stay. Triangles: a closed cave, the same surface in more or fewer
//! triangles, so that every ray hits. 2^18 primary rays of the mode OD from its middle, as the device makes them, and as many
//! cosine-distributed rays from what they hit, by the kernels' traversal and by obvhs on the CPU in turn, the median of five
//! rounds; with the geometry in storage buffers where it fits one binding, and in texture pages. Instances: one ball in many
//! places. Writes `scale.json` (raw numbers), `scale.md` (the tables) and `scale.svg` (the plot).

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::Instant,
};

use fovea_app::commands::bench::baseline::{Baseline, secondary_rays};
use fovea_benches::{
    AnyError,
    family::{write_balls, write_cave},
    report_main,
};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::{Affine3A, Vec3};
use serde_json::{Value, json};
use tracer::{
    distribution::Distribution,
    film::FilmOptions,
    gpu::{AdapterSelect, GeometryPlace, Gpu},
    import::{ImportOptions, load_gltf},
    provenance::Provenance,
    renderer::{Query, Renderer, RendererOptions},
    scene::Scene,
};

mod page;

const ROUNDS: usize = 5;
const RAYS: u32 = 1 << 18;
/// The panorama whose primary rays are taken.
const FILM: FilmOptions = FilmOptions::equirect(1024, 512);
const TRIANGLES: [u32; 5] = [10_000, 100_000, 1_000_000, 3_162_278, 10_000_000];
const INSTANCES: [u32; 3] = [1_000, 10_000, 100_000];

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let (out, scenes, limits) = match args {
        [out, scenes, limits @ ..] if limits.len() <= 2 => (PathBuf::from(out), PathBuf::from(scenes), limits),
        _ => return Err("usage: scale-report OUT_DIR SCENES_DIR [LARGEST_TRIANGLES [LARGEST_INSTANCES]]".into()),
    };
    let limit = |index: usize| limits.get(index).map_or(Ok(u32::MAX), |text| text.parse());
    let (most_triangles, most_instances) = (limit(0)?, limit(1)?);
    std::fs::create_dir_all(&out)?;
    std::fs::create_dir_all(&scenes)?;
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut of_triangles = Vec::new();
    for wanted in TRIANGLES.into_iter().filter(|&count| count <= most_triangles) {
        let file = scenes.join(format!("cave-{wanted}.glb"));
        eprintln!("{} ...", file.display());
        write_cave(&file, wanted)?;
        of_triangles.push(triangles(&gpu, &file)?);
    }
    let mut of_instances = Vec::new();
    for count in INSTANCES.into_iter().filter(|&count| count <= most_instances) {
        let file = scenes.join(format!("balls-{count}.glb"));
        eprintln!("{} ...", file.display());
        write_balls(&file, count)?;
        of_instances.push(instances(&gpu, &file)?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({
        "machine": machine, "rounds": ROUNDS, "largest_binding_bytes": gpu.largest_binding(),
        "triangles": of_triangles, "instances": of_instances,
    });
    std::fs::write(out.join("scale.json"), format!("{raw:#}\n"))?;
    std::fs::write(out.join("scale.md"), page::text(&raw))?;
    std::fs::write(out.join("scale.svg"), page::plot(&raw).svg())?;
    Ok(())
}

/// A scene and the seconds that it took to read.
fn import(file: &Path) -> Result<(Scene, f64), AnyError> {
    let started = Instant::now();
    let (scene, _) = load_gltf(file, &ImportOptions::default())?;
    Ok((scene, started.elapsed().as_secs_f64()))
}

fn renderer(gpu: &Gpu) -> Result<Renderer, AnyError> {
    let distribution = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let everywhere = Distribution::omnidirectional(Arc::new(Inverse::default_for(&distribution)));
    let options = RendererOptions { film: FILM, ..Default::default() };
    Ok(Renderer::new(gpu, &options, everywhere)?)
}

fn triangles(gpu: &Gpu, file: &Path) -> Result<Value, AnyError> {
    let (scene, import_secs) = import(file)?;
    let baseline = Baseline::build(&scene);
    let mut sides = Vec::new();
    for (name, place) in [("buffers", GeometryPlace::Buffers), ("textures", GeometryPlace::Textures)] {
        let mut renderer = renderer(&gpu.clone().with_geometry_in(place))?;
        match renderer.set_scene(&scene) {
            Ok(report) => sides.push((name, renderer, report.upload)),
            Err(error) if place == GeometryPlace::Buffers => eprintln!("not in buffers: {error}"),
            Err(error) => return Err(error.into()),
        }
    }
    let (_, last, _) = sides.last_mut().ok_or("no side")?;
    let primary = last.primary_rays(RAYS)?;
    let [diffuse, _] = secondary_rays(&scene, &baseline, &primary);
    let mut sets = Vec::new();
    for (rays_name, rays) in [("primary", &primary), ("diffuse", &diffuse)] {
        let mut device: Vec<Vec<f64>> = vec![Vec::new(); sides.len()];
        let mut cpu = Vec::new();
        let mut steps = 0.0;
        for _ in 0..ROUNDS {
            for ((_, renderer, _), seconds) in sides.iter_mut().zip(&mut device) {
                let (mean_steps, secs) = time(renderer, rays)?;
                seconds.push(secs);
                steps = mean_steps;
            }
            cpu.push(baseline.time(rays));
        }
        let device: serde_json::Map<_, _> =
            sides.iter().zip(device).map(|((name, ..), seconds)| ((*name).into(), seconds.into())).collect();
        sets.push(json!({
            "rays": rays_name, "count": rays.len(), "steps_per_ray": steps, "device_s": device, "obvhs_s": cpu,
        }));
    }
    let uploads: serde_json::Map<_, _> = sides
        .iter()
        .map(|(name, _, upload)| {
            let report = json!({
                "bvh_and_tables_s": upload.bvh_build_secs, "rest_s": upload.upload_secs, "device_bytes": upload.device_bytes,
            });
            ((*name).into(), report)
        })
        .collect();
    let count = sides.first().map_or(0, |(.., upload)| upload.triangles);
    Ok(json!({
        "triangles": count, "file_bytes": std::fs::metadata(file)?.len(), "import_s": import_secs,
        "obvhs_build_s": baseline.build_secs, "uploads": uploads, "sets": sets,
    }))
}

/// Mean number of nodes and triangles that a ray that hits looks at, and the device's seconds for all.
fn time(renderer: &mut Renderer, rays: &[Query]) -> Result<(f64, f64), AnyError> {
    let (answers, seconds) = renderer.query(rays)?;
    let steps: Vec<f64> = answers.iter().flatten().map(|answer| f64::from(answer.steps)).collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    Ok((mean, seconds.ok_or("the adapter has no timestamps")?))
}

fn instances(gpu: &Gpu, file: &Path) -> Result<Value, AnyError> {
    let (mut scene, import_secs) = import(file)?;
    let mut renderer = renderer(gpu)?;
    let started = Instant::now();
    let report = renderer.set_scene(&scene)?;
    let set_secs = started.elapsed().as_secs_f64();
    let primary = renderer.primary_rays(RAYS)?;
    let mut device = Vec::new();
    let mut steps = 0.0;
    for _ in 0..ROUNDS {
        let (mean_steps, seconds) = time(&mut renderer, &primary)?;
        device.push(seconds);
        steps = mean_steps;
    }
    let mut edits = Vec::new();
    for _ in 0..ROUNDS {
        let moved = &mut scene.instances[0];
        moved.world_from_mesh = Affine3A::from_translation(Vec3::Y * 0.01) * moved.world_from_mesh;
        let started = Instant::now();
        renderer.set_scene(&scene)?;
        edits.push(started.elapsed().as_secs_f64());
    }
    Ok(json!({
        "instances": scene.instances.len(), "triangles_of_one": report.upload.triangles,
        "file_bytes": std::fs::metadata(file)?.len(), "import_s": import_secs, "set_scene_s": set_secs,
        "kernels_s": report.kernel_compile_secs, "device_bytes": report.upload.device_bytes,
        "primary": { "count": primary.len(), "steps_per_ray": steps, "device_s": device }, "move_one_s": edits,
    }))
}
