//! What the benches and reports share.

use std::sync::Arc;

use glam::{Affine3A, DVec3, Vec3};
use tracer::scene::{ContentHash, Environment, Instance, Material, Mesh, Scene};

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
