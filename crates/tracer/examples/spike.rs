//! Spike.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "spike")]
use glam::*;
use std::sync::Arc;
use tracer::{distribution::*, film::*, gpu::*, import::*, renderer::*};
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
    println!("{} {}", gpu.info().name, gpu.info().driver_info);
    let t = std::time::Instant::now();
    let (mut scene, report) = load_gltf(std::path::Path::new(&args[1]), &ImportOptions::default()).unwrap();
    println!("import {:?} {:?}", t.elapsed(), report.warnings.len());
    let bg: f32 = args[2].parse().unwrap();
    scene.environment = tracer::scene::Environment::Constant(Vec3::splat(bg));
    let x = std::env::var("X").unwrap_or_default();
    for m in &mut scene.materials { let m = Arc::make_mut(m);
        if x.contains('a') { m.alpha_mode = tracer::scene::AlphaMode::Opaque; }
        if x.contains('n') { m.normal_texture = None; }
        if x.contains('t') { m.base_color_texture = None; m.metallic_roughness_texture = None; m.emissive_texture = None; }
        if x.contains('l') { scene.lights.clear(); }
    }
    if std::env::var("MERGE").is_ok() {
        let mut m = (*scene.meshes[0]).clone();
        m.positions.clear();
        m.normals.clear();
        m.triangles.clear();
        m.uvs = Default::default();
        m.colors.clear();
        m.tangents.clear();
        for i in &scene.instances {
            let s = &scene.meshes[i.mesh as usize];
            let b = m.positions.len() as u32;
            m.positions.extend(s.positions.iter().map(|p| i.world_from_mesh.transform_point3(*p)));
            m.normals.extend(s.normals.iter());
            m.triangles.extend(s.triangles.iter().map(|t| t.map(|v| v + b)));
        }
        scene.meshes = vec![Arc::new(m)];
        scene.instances.truncate(1);
        scene.instances[0].mesh = 0;
        scene.instances[0].world_from_mesh = Affine3A::IDENTITY;
    }
    if std::env::var("CPU").is_ok() {
        use obvhs::{ray::*, triangle::*};
        let m = &scene.meshes[0];
        let tris: Vec<Triangle> = m
            .triangles
            .iter()
            .map(|t| {
                let [v0, v1, v2] = t.map(|i| Vec3A::from(m.positions[i as usize]));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let blas = obvhs::cwbvh::builder::build_cwbvh(
            &tris,
            obvhs::BvhBuildParams { pre_split: false, max_prims_per_leaf: 3, ..obvhs::BvhBuildParams::medium_build() },
            &mut Default::default(),
        );
        let tt: Vec<Triangle> = blas.primitive_indices.iter().map(|&i| tris[i as usize]).collect();
        let cam = &scene.cameras[0];
        let film = FilmOptions::equirect(512, 256);
        let t = std::time::Instant::now();
        let mut hits = 0;
        for y in 0..256 {
            for x in 0..512 {
                let d = film_direction(&film, x, y);
                let ray = Ray::new_inf(cam.position.into(), d.into());
                let mut hit = RayHit::none();
                if blas.ray_traverse(ray, &mut hit, |r, i| tt[i].intersect(r)) {
                    hits += 1;
                }
            }
        }
        println!("cpu {:.3} Mrays/s per core, {hits} hits", 512.0 * 256.0 / t.elapsed().as_secs_f64() / 1e6);
    }
    let dist = fovea_sampler::RadialDistribution::new(
        fovea_sampler::model::Reddy2001,
        fovea_sampler::Geometry::Sphere,
        fovea_sampler::Angle::from_degrees(80.0),
        0.002,
    )
    .unwrap();
    let inverse = Arc::new(fovea_sampler::Inverse::default_for(&dist));
    let d = if args[3] == "od" {
        Distribution::omnidirectional(inverse)
    } else {
        Distribution::foveated(Gaze::Scene { direction: Vec3::NEG_Z }, None, inverse)
    };
    let mut r = Renderer::new(
        &gpu,
        &RendererOptions {
            film: FilmOptions::equirect(512, 256),
            max_bounces: std::env::var("MB").ok().and_then(|s| s.parse().ok()).unwrap_or(8),
            ..Default::default()
        },
        d,
    )
    .unwrap();
    let rep = r.set_scene(&scene).unwrap();
    println!("{rep:?}");
    if let Ok(dir) = std::env::var("DUMP") {
        for (n, t) in r.kernel_texts().unwrap() {
            std::fs::write(format!("{dir}/{n}.wgsl"), t).unwrap();
        }
    }
    let cam = &scene.cameras[args[4].parse::<usize>().unwrap()];
    r.set_pose(FilmPose { position: cam.position, world_from_film: Quat::IDENTITY });
    let spp: u64 = args[5].parse().unwrap();
    let c0 = cpu();
    let secs = r.render(StopCondition::Samples(512 * 256 * spp), |_| true).unwrap();
    let st = r.statistics().unwrap();
    let c = cpu() - c0;
    println!("CPU {c:.2} s: {:.3} Mrays per CPU-s", (st.segments + st.shadow_rays) as f64 / c / 1e6);
    println!(
        "{secs} s, {:.3} Msamples/s, {:.3} Msegments/s, path {:.3} {st:?}",
        st.samples as f64 / secs / 1e6,
        st.segments as f64 / secs / 1e6,
        st.segments as f64 / st.samples as f64
    );
    let snap = r.snapshot().unwrap();
    let px: Vec<_> = snap.pixels().collect();
    let mean: f64 = px.iter().map(|p| p.mean[1]).sum::<f64>() / px.len() as f64;
    println!("mean green {mean}");
    let img = image::RgbImage::from_fn(512, 256, |x, y| {
        let p = px[(y * 512 + x) as usize];
        image::Rgb(p.mean.map(|c| ((c.max(0.0).powf(1.0 / 2.2)).min(1.0) * 255.0) as u8))
    });
    img.save(&args[6]).unwrap();
    if let Some(path) = args.get(7) {
        let f: Vec<u8> = px.iter().flat_map(|p| p.mean.map(|c| (c as f32).to_le_bytes())).flatten().collect();
        std::fs::write(path, f).unwrap();
    }
}
