//! What the benches and reports share.

use std::{path::Path, process::ExitCode, sync::Arc};

use glam::{Affine3A, DVec3, Quat, Vec3};
use tracer::{
    builtin,
    import::{ImportError, ImportOptions, load_gltf},
    renderer::FilmPose,
    scene::{Backdrop, ContentHash, Environment, Instance, Material, Mesh, Scene},
};

pub mod family;

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
        backdrop: Backdrop::default(),
        origin_in_file: DVec3::ZERO,
    }
}

/// Whatever ends a report.
pub type AnyError = Box<dyn std::error::Error>;

/// Runs a report with the command line's words; an error is one line and exit status 2.
pub fn report_main(run: impl FnOnce(&[String]) -> Result<(), AnyError>) -> ExitCode {
    match run(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// A scene as the reports show it, and where its film is.
#[derive(Debug)]
pub struct Subject {
    /// The file's name without extension, or `built-in`.
    pub name: String,
    /// With the background of the reference images: 1 where the scene is open.
    pub scene: Scene,
    /// At the reference images' camera: 0, or 2 for bmw and sponza.
    pub pose: FilmPose,
}

impl Subject {
    /// Reads a file, or the built-in scene.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(file: Option<&Path>) -> Result<Self, ImportError> {
        let (mut scene, _) = match file {
            Some(file) => load_gltf(file, &ImportOptions::default())?,
            None => builtin::scene()?,
        };
        let name = file.and_then(Path::file_stem).map_or("built-in".into(), |s| s.to_string_lossy().into_owned());
        if ["bmw", "sibenik", "sibenik_lambert", "sponza"].contains(&name.as_str()) {
            scene.environment = Environment::Constant(Vec3::ONE);
        }
        let camera = if ["bmw", "sponza"].contains(&name.as_str()) { 2 } else { 0 };
        let position = scene.cameras.get(camera).map_or(Vec3::ZERO, |camera| camera.position);
        Ok(Self { name, scene, pose: FilmPose { position, world_from_film: Quat::IDENTITY } })
    }
}
