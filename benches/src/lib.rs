//! What the benches and reports share.

use std::{process::Command, sync::Arc};

use glam::{Affine3A, DVec3, Vec3};
use tracer::{
    gpu::Gpu,
    scene::{ContentHash, Environment, Instance, Material, Mesh, Scene},
};

/// A scene of one far triangle under a constant sky: almost nothing but ray generation.
pub fn one_triangle() -> Scene {
    let positions = vec![Vec3::new(0.0, 1e3, -1e3), Vec3::new(1.0, 1e3, -1e3), Vec3::new(0.0, 1e3 + 1.0, -1e3)];
    let hash = ContentHash::of(&[b"one far triangle"]);
    let mesh = Mesh {
        name: "triangle".into(),
        normals: vec![Vec3::Z; 3],
        positions,
        tangents: Vec::new(),
        uvs: Default::default(),
        colors: Vec::new(),
        triangles: vec![[0, 1, 2]],
        hash,
    };
    Scene {
        name: "one triangle".into(),
        meshes: vec![Arc::new(mesh)],
        textures: Vec::new(),
        materials: vec![Arc::new(Material::default())],
        instances: vec![Instance {
            name: "triangle".into(),
            mesh: 0,
            material: 0,
            world_from_mesh: Affine3A::IDENTITY,
            visible: true,
            node: 0,
        }],
        lights: Vec::new(),
        cameras: Vec::new(),
        environment: Environment::Constant(Vec3::ONE),
        origin_in_file: DVec3::ZERO,
    }
}

/// Processor, adapter, driver and commit: what goes with every number.
pub fn machine(gpu: &Gpu) -> Vec<(&'static str, String)> {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split(':').nth(1)?.trim().to_string())
    });
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let commit = Command::new("git").args(["rev-parse", "--short", "HEAD"]).output().ok();
    let commit = commit.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_string());
    let info = gpu.info();
    vec![
        ("processor", format!("{}, {cores} threads", cpu.unwrap_or_else(|| std::env::consts::ARCH.into()))),
        ("adapter", info.name.clone()),
        ("driver", format!("{} {}", info.driver, info.driver_info)),
        ("commit", commit.unwrap_or_else(|| "unknown".into())),
    ]
}

/// Prints [`machine`] on standard error.
pub fn print_machine(gpu: &Gpu) {
    for (name, value) in machine(gpu) {
        eprintln!("{name}: {value}");
    }
}
