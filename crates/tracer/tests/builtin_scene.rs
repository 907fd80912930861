//! The built-in scene is what its program makes, loads without a word, and keeps its promises.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../examples/make_builtin_scene/set/mod.rs"]
mod set;

use std::collections::HashSet;

use glam::Vec3;
use tracer::scene::{Environment, Scene};

const MAX_BYTES: usize = 3_000_000;

#[test]
fn committed_file_is_what_the_program_makes() {
    let made = set::glb();
    assert!(made.len() <= MAX_BYTES, "{} bytes", made.len());
    assert!(
        made == tracer::builtin::BYTES,
        "run `cargo run -p tracer --example make_builtin_scene` and commit the file"
    );
}

#[test]
fn loads_without_warnings_and_shows_what_it_should() {
    let (scene, report) = tracer::builtin::scene().unwrap();
    assert_eq!(report.warnings, []);
    assert_eq!(report.extensions_unsupported, <[String; 0]>::default());
    assert_eq!(scene.name, "built-in");
    let triangles: usize = scene.instances.iter().map(|i| scene.meshes[i.mesh as usize].triangles.len()).sum();
    assert!((50_000..300_000).contains(&triangles), "{triangles}");
    assert!(scene.cameras.len() >= 4);
    let centre = &scene.cameras[0];
    assert!(centre.position.abs_diff_eq(Vec3::new(0.0, 1.6, 0.0), 1e-5));
    assert!((centre.rotation * Vec3::NEG_Z).abs_diff_eq(Vec3::NEG_Z, 1e-5));
    assert!(matches!(scene.environment, Environment::Constant(Vec3::ZERO)), "its lamps light it");

    let has = |test: &dyn Fn(&tracer::scene::Material) -> bool| scene.materials.iter().any(|m| test(m));
    assert!(has(&|m| m.metallic == 0.0 && m.roughness > 0.8), "diffuse");
    assert!(has(&|m| m.metallic == 1.0 && m.roughness < 0.1), "polished metal");
    assert!(has(&|m| m.metallic == 1.0 && m.roughness > 0.4), "rough metal");
    assert!(has(&|m| m.transmission == 1.0 && m.thickness > 0.0), "glass");
    assert!(
        has(&|m| m.metallic == 0.0 && m.transmission == 0.0 && m.roughness < 0.05)
            && has(&|m| m.base_color_texture.is_some())
            && has(&|m| m.normal_texture.is_some())
    );
    assert!(has(&|m| m.emission.max_element() > 1.0 && m.emissive_texture.is_some()));
    for material in scene.materials.iter().filter(|m| m.transmission == 0.0) {
        let color = material.base_color.truncate();
        let is_textured = material.base_color_texture.is_some();
        assert!(is_textured || (color.max_element() <= 0.851 && color.min_element() >= 0.039), "{}", material.name);
    }
}

#[test]
fn every_quarter_of_the_panorama_has_something_to_look_at() {
    let (scene, _) = tracer::builtin::scene().unwrap();
    let mut kinds: [HashSet<u32>; 4] = Default::default();
    for instance in &scene.instances {
        let centre = world_centre(&scene, instance.mesh, instance.world_from_mesh);
        let from_eye = centre - scene.cameras[0].position;
        let quarter = match (from_eye.x.abs() > from_eye.z.abs(), from_eye.x > 0.0, from_eye.z > 0.0) {
            (false, _, false) => 0,
            (true, true, _) => 1,
            (false, _, true) => 2,
            (true, false, _) => 3,
        };
        kinds[quarter].insert(instance.material);
    }
    assert!(kinds.iter().all(|k| k.len() >= 8), "{:?}", kinds.map(|k| k.len()));
}

fn world_centre(scene: &Scene, mesh: u32, world_from_mesh: glam::Affine3A) -> Vec3 {
    let positions = &scene.meshes[mesh as usize].positions;
    let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), &p| (l.min(p), h.max(p)));
    world_from_mesh.transform_point3((low + high) / 2.0)
}
