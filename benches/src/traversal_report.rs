//! `traversal-report OUT_DIR SCENE...`: rays a second of the kernels' traversal and of obvhs on the CPU, the same rays.
//!
//! For each scene (its alpha left out: obvhs does not look at it): 2^20 primary rays from the camera, neighbours together, as
//! many cosine-distributed rays from what they hit, and as many shadow rays towards random points of the scene. The device's time
//! is of the kernel alone, by timestamps; obvhs traces on all cores, with the same build of the same triangles. They take turns;
//! the fastest of five counts, since other work can only slow them. On Linux the CPU time of both is compared too, which says
//! more where the device is the CPU and other work shares it. Writes `traversal.json` (raw numbers) and `traversal.md` (the tables).

use std::{path::Path, process::ExitCode, sync::Arc, time::Instant};

use fovea_benches::{AnyError, Subject, report_main};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001, sequence::hash};
use glam::{Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    cwbvh::{CwBvh, builder::build_cwbvh},
    ray::{Ray, RayHit},
    triangle::Triangle,
};
use rayon::prelude::*;
use serde_json::{Value, json};
use tracer::{
    distribution::Distribution,
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
    renderer::{Query, QueryAnswer, RayKind, Renderer, RendererOptions},
    scene::{AlphaMode, Scene},
};

/// Columns and rows of the panorama of primary rays.
const FILM: [u32; 2] = [1448, 724];
const ROUNDS: u32 = 5;

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, files @ ..] = args else { return Err("usage: traversal-report OUT_DIR SCENE...".into()) };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut scenes = Vec::new();
    for file in files {
        let subject = Subject::open(Some(Path::new(file)))?;
        scenes.push(measure(&gpu, &subject.name, subject.scene, subject.pose.position)?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({ "machine": machine, "rounds": ROUNDS, "scenes": scenes });
    std::fs::create_dir_all(out)?;
    std::fs::write(Path::new(out).join("traversal.json"), format!("{raw:#}\n"))?;
    std::fs::write(Path::new(out).join("traversal.md"), table(&raw))?;
    Ok(())
}

/// obvhs on the CPU.
struct Baseline {
    bvh: CwBvh,
    /// In leaf order.
    triangles: Vec<Triangle>,
}

impl Baseline {
    fn build(scene: &Scene) -> Self {
        let world: Vec<Triangle> = scene
            .instances
            .iter()
            .filter(|instance| instance.visible)
            .flat_map(|instance| {
                let mesh = &scene.meshes[instance.mesh as usize];
                mesh.triangles.iter().map(|corners| {
                    let [v0, v1, v2] =
                        corners.map(|v| instance.world_from_mesh.transform_point3a(mesh.positions[v as usize].into()));
                    Triangle { v0, v1, v2 }
                })
            })
            .collect();
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 3, ..BvhBuildParams::medium_build() };
        let bvh = build_cwbvh(&world, params, &mut std::time::Duration::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| world[i as usize]).collect();
        Self { bvh, triangles }
    }

    fn closest(&self, query: &Query) -> Option<(f32, Vec3A)> {
        let ray = Ray::new(query.origin.into(), query.direction.into(), 0.0, query.t_max);
        let mut hit = RayHit::none();
        let found = self.bvh.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray));
        found.then(|| (hit.t, self.triangles[hit.primitive_id as usize].compute_normal()))
    }

    fn is_occluded(&self, query: &Query) -> bool {
        let ray = Ray::new(query.origin.into(), query.direction.into(), 0.0, query.t_max);
        !self.bvh.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }

    /// Rays a second on all cores.
    fn time(&self, rays: &[Query]) -> f64 {
        let started = Instant::now();
        let hits = rays
            .par_chunks(1 << 12)
            .map(|chunk| match chunk.first().map(|ray| ray.kind) {
                Some(RayKind::Any) => chunk.iter().filter(|ray| self.is_occluded(ray)).count(),
                _ => chunk.iter().filter(|ray| self.closest(ray).is_some()).count(),
            })
            .sum::<usize>();
        std::hint::black_box(hits);
        rays.len() as f64 / started.elapsed().as_secs_f64()
    }
}

/// A number in 0..1 by index and dimension.
fn random(index: u32, dimension: u32) -> f32 {
    (hash(index.wrapping_mul(8).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
}

/// Through the middles of a panorama's pixels, in tiles of 8x8.
fn primary_rays(eye: Vec3) -> Vec<Query> {
    let tiles = (0..FILM[1] / 8).flat_map(|y| (0..FILM[0] / 8).map(move |x| (x, y)));
    tiles
        .flat_map(|(tx, ty)| (0..64).map(move |i| (tx * 8 + i % 8, ty * 8 + i / 8)))
        .map(|(x, y)| {
            let yaw = ((x as f32 + 0.5) / FILM[0] as f32 - 0.5) * std::f32::consts::TAU;
            let pitch = (0.5 - (y as f32 + 0.5) / FILM[1] as f32) * std::f32::consts::PI;
            let direction = Vec3::new(yaw.sin() * pitch.cos(), pitch.sin(), -yaw.cos() * pitch.cos());
            Query { origin: eye, direction, t_max: f32::MAX, kind: RayKind::Closest }
        })
        .collect()
}

/// From what the primary rays hit: cosine-distributed directions, and segments to random points of the scene's bounds.
fn secondary_rays(scene: &Scene, baseline: &Baseline, primary: &[Query]) -> [Vec<Query>; 2] {
    let (low, high) = scene.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
    let origins: Vec<(u32, Vec3, Vec3)> = primary
        .par_iter()
        .enumerate()
        .filter_map(|(i, ray)| {
            let (t, normal) = baseline.closest(ray)?;
            let normal = Vec3::from(normal).try_normalize()?;
            let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
            let origin = ray.origin + ray.direction * t;
            Some((i as u32, origin + normal * (1e-4 * (1.0 + origin.abs().max_element())), normal))
        })
        .collect();
    let diffuse = origins.iter().map(|&(i, origin, normal)| {
        let z = 1.0 - 2.0 * random(i, 0);
        let (sin, cos) = (random(i, 1) * std::f32::consts::TAU).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        let direction = (normal + Vec3::new(r * cos, r * sin, z)).try_normalize().unwrap_or(normal);
        Query { origin, direction, t_max: f32::MAX, kind: RayKind::Closest }
    });
    let shadow = origins.iter().map(|&(i, origin, _)| {
        let end = low + (high - low) * Vec3::new(random(i, 2), random(i, 3), random(i, 4));
        Query { origin, direction: end - origin, t_max: 1.0, kind: RayKind::Any }
    });
    [diffuse.collect(), shadow.collect()]
}

fn measure(gpu: &Gpu, name: &str, mut scene: Scene, eye: Vec3) -> Result<Value, AnyError> {
    eprintln!("{name} ...");
    for material in &mut scene.materials {
        let material = Arc::make_mut(material);
        material.alpha_mode = AlphaMode::Opaque;
        material.transmission = 0.0;
    }
    let distribution = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let everywhere = Distribution::omnidirectional(Arc::new(Inverse::default_for(&distribution)));
    let film = tracer::film::FilmOptions::equirect(64, 32);
    let mut renderer = Renderer::new(gpu, &RendererOptions { film, ..Default::default() }, everywhere)?;
    let report = renderer.set_scene(&scene)?;
    let baseline = Baseline::build(&scene);
    let primary = primary_rays(eye);
    let [diffuse, shadow] = secondary_rays(&scene, &baseline, &primary);
    let mut rows = Vec::new();
    for (kind, rays) in [("primary", &primary), ("diffuse", &diffuse), ("shadow", &shadow)] {
        let differing = disagreements(&mut renderer, &baseline, rays)?;
        let (mut device, mut cpu) = (0.0f64, 0.0f64);
        // Of the process; a device that is the CPU works in it.
        let mut cpu_secs = [0.0; 2];
        for _ in 0..ROUNDS {
            let before = cpu_time();
            let (_, seconds) = renderer.query(rays)?;
            let seconds = seconds.ok_or("the adapter has no timestamps")?;
            device = device.max(rays.len() as f64 / seconds);
            let between = cpu_time();
            cpu = cpu.max(baseline.time(rays));
            cpu_secs[0] += between - before;
            cpu_secs[1] += cpu_time() - between;
        }
        let per_cpu_second = cpu_secs.map(|s| f64::from(ROUNDS) * rays.len() as f64 / s);
        rows.push(json!({
            "rays": kind, "count": rays.len(), "device_rays_per_s": device, "obvhs_rays_per_s": cpu, "ratio": device / cpu,
            "device_rays_per_cpu_s": per_cpu_second[0], "obvhs_rays_per_cpu_s": per_cpu_second[1],
            "cpu_ratio": per_cpu_second[0] / per_cpu_second[1],
            "hit_or_miss_differs": differing,
        }));
    }
    Ok(json!({ "scene": name, "triangles": report.upload.triangles, "rays": rows }))
}

/// Seconds of CPU that this process has used; 0 where that is not known.
fn cpu_time() -> f64 {
    // Fields 14 and 15 of proc_pid_stat(5), in ticks of 10 ms; the second field ends with the last parenthesis.
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() * 0.01
}

/// Rays that hit on one side and miss on the other.
fn disagreements(renderer: &mut Renderer, baseline: &Baseline, rays: &[Query]) -> Result<usize, AnyError> {
    let (answers, _): (Vec<Option<QueryAnswer>>, _) = renderer.query(rays)?;
    Ok(answers
        .par_iter()
        .zip(rays)
        .filter(|(answer, ray)| {
            let expected =
                if ray.kind == RayKind::Any { baseline.is_occluded(ray) } else { baseline.closest(ray).is_some() };
            answer.is_some() != expected
        })
        .count())
}

fn table(raw: &Value) -> String {
    let mut text = String::from("# Traversal: the kernels against obvhs on the CPU\n\n");
    if let Some(machine) = raw["machine"].as_object() {
        for (name, value) in machine {
            text.push_str(&format!("- {name}: {}\n", value.as_str().unwrap_or("")));
        }
    }
    text.push_str("\n| scene | triangles | rays | device, M rays/s | obvhs on all cores, M rays/s | device / obvhs | the same per CPU second |\n|---|---|---|---|---|---|---|\n");
    for scene in raw["scenes"].as_array().into_iter().flatten() {
        for row in scene["rays"].as_array().into_iter().flatten() {
            let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
            text.push_str(&format!(
                "| {} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} / {:.2} = {:.2} |\n",
                scene["scene"].as_str().unwrap_or(""),
                scene["triangles"],
                row["rays"].as_str().unwrap_or(""),
                number("device_rays_per_s") * 1e-6,
                number("obvhs_rays_per_s") * 1e-6,
                number("ratio"),
                number("device_rays_per_cpu_s") * 1e-6,
                number("obvhs_rays_per_cpu_s") * 1e-6,
                number("cpu_ratio")
            ));
        }
    }
    text
}
