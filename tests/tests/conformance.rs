//! Every scene file renders; a file that needs an extension that is not supported says which.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};

use fovea_tests::device;
use glam::{Quat, Vec3};
use tracer::{
    distribution::Distribution,
    film::FilmOptions,
    gpu::Gpu,
    import::{ImportOptions, load_gltf},
    kernels::{Kernel, compose},
    renderer::{FilmPose, Renderer, RendererOptions},
    scene::{Environment, Scene},
};

const FILM: FilmOptions = FilmOptions::equirect(64, 32);
const SAMPLES: u64 = 1 << 14;

/// All `.glb` and `.gltf` files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// `extensionsRequired` of a file, read without the importer.
fn required_extensions(path: &Path) -> Vec<String> {
    let bytes = std::fs::read(path).unwrap();
    let json = if bytes.starts_with(b"glTF") {
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        bytes[20..20 + length].to_vec()
    } else {
        bytes
    };
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    let list = json["extensionsRequired"].as_array().cloned().unwrap_or_default();
    list.iter().map(|name| name.as_str().unwrap().to_string()).collect()
}

/// The first camera, or a place from which the whole scene is in front.
fn position(scene: &Scene) -> Vec3 {
    if let Some(camera) = scene.cameras.first() {
        return camera.position;
    }
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for instance in &scene.instances {
        for &p in &scene.meshes[instance.mesh as usize].positions {
            let p = instance.world_from_mesh.transform_point3(p);
            (low, high) = (low.min(p), high.max(p));
        }
    }
    (low + high) * 0.5 + Vec3::Z * (high - low).length()
}

fn render(gpu: &Gpu, path: &Path, mut scene: Scene) {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    // What is not lit from inside is lit from outside.
    if matches!(scene.environment, Environment::Constant(c) if c == Vec3::ZERO) {
        scene.environment = Environment::Constant(Vec3::splat(0.5));
    }
    let options = RendererOptions { film: FILM, max_bounces: 4, ..Default::default() };
    let distribution = Distribution::omnidirectional(device::inverse());
    let mut renderer = Renderer::new(gpu, &options, distribution).unwrap();
    let report = renderer.set_scene(&scene).unwrap();
    let kernel = compose(&renderer.key(Kernel::Trace)).unwrap();
    renderer.set_pose(FilmPose { position: position(&scene), world_from_film: Quat::IDENTITY });
    let film = device::trace(&mut renderer, SAMPLES).unwrap();
    let statistics = renderer.statistics().unwrap();
    let means: Vec<[f64; 3]> = film.pixels().map(|pixel| pixel.mean).collect();
    let mean = means.iter().flatten().sum::<f64>() / (3 * means.len()) as f64;
    let spread = means.iter().flatten().map(|v| (v - mean).abs()).sum::<f64>() / (3 * means.len()) as f64;
    eprintln!(
        "{name}: {} triangles, {}, {} lines, mean {mean:.3}, spread {spread:.3}, dropped {}",
        report.upload.triangles,
        renderer.key(Kernel::Trace),
        kernel.lines().count(),
        statistics.non_finite
    );
    assert_eq!(statistics.non_finite, 0, "{name}");
    assert!(means.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{name}");
    assert!(mean > 1e-3, "{name} is black");
    // Something is seen before the constant background.
    assert!(spread > 1e-4, "{name} is empty");
}

fn check_folder(folder: &str, least: usize) {
    let Some(folder) = device::external_file("conformance", "FOVEA_SCENES", folder) else { return };
    let _time = device::Stopwatch::start("conformance");
    let gpu = device::gpu();
    let files = files(&folder);
    assert!(files.len() >= least, "{} has {} scenes", folder.display(), files.len());
    for path in files {
        let required = required_extensions(&path);
        match load_gltf(&path, &ImportOptions::default()) {
            Ok((scene, _)) => render(&gpu, &path, scene),
            Err(error) => {
                let words = error.to_string();
                eprintln!("{words}");
                assert_eq!(words.lines().count(), 1, "an error is one line");
                assert!(
                    required.iter().any(|name| words.contains(name.as_str())),
                    "{words}: names no required extension"
                );
            }
        }
    }
}

#[test]
fn paper_scenes_render() {
    check_folder("paper", 6);
}

#[test]
fn khronos_scenes_render_or_name_the_extension() {
    check_folder("khronos", 34);
}
