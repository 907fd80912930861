//! Spike.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "spike")]
use std::sync::Arc;
use tracer::{gpu::*, renderer::*, distribution::*, film::*, import::*};
use glam::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
    println!("{} {}", gpu.info().name, gpu.info().driver_info);
    let t = std::time::Instant::now();
    let (mut scene, report) = load_gltf(std::path::Path::new(&args[1]), &ImportOptions::default()).unwrap();
    println!("import {:?} {:?}", t.elapsed(), report.warnings.len());
    let bg: f32 = args[2].parse().unwrap();
    scene.environment = tracer::scene::Environment::Constant(Vec3::splat(bg));
    let dist = fovea_sampler::RadialDistribution::new(fovea_sampler::model::Reddy2001, fovea_sampler::Geometry::Sphere, fovea_sampler::Angle::from_degrees(80.0), 0.002).unwrap();
    let inverse = Arc::new(fovea_sampler::Inverse::default_for(&dist));
    let d = if args[3] == "od" { Distribution::omnidirectional(inverse) } else { Distribution::foveated(Gaze::Scene{direction: Vec3::NEG_Z}, None, inverse) };
    let mut r = Renderer::new(&gpu, &RendererOptions { film: FilmOptions::equirect(512, 256), ..Default::default() }, d).unwrap();
    let rep = r.set_scene(&scene).unwrap();
    println!("{rep:?}");
    if let Ok(dir) = std::env::var("DUMP") { for (n, t) in r.kernel_texts().unwrap() { std::fs::write(format!("{dir}/{n}.wgsl"), t).unwrap(); } }
    let cam = &scene.cameras[args[4].parse::<usize>().unwrap()];
    r.set_pose(FilmPose { position: cam.position, world_from_film: Quat::IDENTITY });
    let spp: u64 = args[5].parse().unwrap();
    let secs = r.render(StopCondition::Samples(512*256*spp), |_| true).unwrap();
    let st = r.statistics().unwrap();
    println!("{secs} s, {:.3} Msamples/s, {:.3} Msegments/s, path {:.3} {st:?}", st.samples as f64/secs/1e6, st.segments as f64/secs/1e6, st.segments as f64/st.samples as f64);
    let snap = r.snapshot().unwrap();
    let px: Vec<_> = snap.pixels().collect();
    let mean: f64 = px.iter().map(|p| p.mean[1]).sum::<f64>()/px.len() as f64;
    println!("mean green {mean}");
    let img = image::RgbImage::from_fn(512, 256, |x, y| { let p = px[(y*512+x) as usize]; image::Rgb(p.mean.map(|c| ((c.max(0.0).powf(1.0/2.2)).min(1.0)*255.0) as u8)) });
    img.save(&args[6]).unwrap();
    if let Some(path) = args.get(7) { let f: Vec<u8> = px.iter().flat_map(|p| p.mean.map(|c| (c as f32).to_le_bytes())).flatten().collect(); std::fs::write(path, f).unwrap(); }
}
