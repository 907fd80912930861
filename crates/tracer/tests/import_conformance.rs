//! Every file of the scene folder that `FOVEA_SCENES` names loads with the expected triangles and instances.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};

use tracer::import::{ImportOptions, ImportWarning, load_gltf};
use tracer::scene::Environment;

/// Path, triangles (summed over instances, degenerate ones included) and instances of the default scene. Counted from the
/// files' JSON by a script that shares nothing with the importer.
const FILES: [(&str, usize, usize); 40] = [
    ("khronos/AlphaBlendModeTest.glb", 61, 9),
    ("khronos/AnisotropyStrengthTest.glb", 97240, 50),
    ("khronos/Box With Spaces/Box With Spaces.gltf", 12, 1),
    ("khronos/Box.glb", 12, 1),
    ("khronos/BoxAnimated.glb", 254, 2),
    ("khronos/BoxInterleaved.glb", 12, 1),
    ("khronos/BoxTextured.glb", 12, 1),
    ("khronos/Cameras.gltf", 2, 1),
    ("khronos/ClearCoatTest.glb", 37116, 27),
    ("khronos/DamagedHelmet.glb", 15452, 1),
    ("khronos/Duck.glb", 4212, 1),
    ("khronos/EmissiveStrengthTest.glb", 90, 6),
    ("khronos/GlassHurricaneCandleHolder.glb", 4126, 2),
    ("khronos/InterpolationTest.glb", 110, 10),
    ("khronos/LightsPunctualLamp/LightsPunctualLamp.gltf", 6000, 3),
    ("khronos/MeshPrimitiveModes.gltf", 16, 3),
    ("khronos/MeshoptCubeTest/MeshoptCubeTest.gltf", 320, 35),
    ("khronos/MetalRoughSpheresNoTextures.glb", 1040409, 123),
    ("khronos/MorphPrimitivesTest.glb", 32, 2),
    ("khronos/NegativeScaleTest.glb", 7724, 11),
    ("khronos/NormalTangentTest.glb", 7774, 1),
    ("khronos/OrientationTest.glb", 524, 13),
    ("khronos/RiggedSimple.glb", 188, 1),
    ("khronos/SimpleInstancing.glb", 1500, 125),
    ("khronos/SimpleMeshes/SimpleMeshes.gltf", 2, 2),
    ("khronos/SimpleSkin.gltf", 8, 1),
    ("khronos/TextureCoordinateTest.glb", 10, 5),
    ("khronos/TextureEncodingTest.glb", 3844, 14),
    ("khronos/TextureSettingsTest.glb", 72, 10),
    ("khronos/TextureTransformTest/TextureTransformTest.gltf", 24, 12),
    ("khronos/TransmissionRoughnessTest.glb", 77792, 9),
    ("khronos/TransmissionTest.glb", 128775, 22),
    ("khronos/UnlitTest.glb", 88, 2),
    ("khronos/VertexColorTest.glb", 36, 2),
    ("paper/bmw.glb", 699580, 142),
    ("paper/classroom.glb", 677280, 1240),
    ("paper/classroom_lambert.glb", 677280, 1240),
    ("paper/sibenik.glb", 67572, 22),
    ("paper/sibenik_lambert.glb", 67572, 22),
    ("paper/sponza.glb", 220044, 106),
];

/// Cameras, punctual lights, and the images decoded for the paper's scenes.
const PAPER: [(&str, usize, usize, usize); 4] = [
    ("paper/bmw.glb", 5, 0, 3),
    ("paper/classroom.glb", 3, 0, 23),
    ("paper/sibenik.glb", 3, 0, 2),
    ("paper/sponza.glb", 3, 1, 45),
];

fn scenes(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("FOVEA_SCENES").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIP {test}: FOVEA_SCENES is not set");
    }
    folder
}

#[test]
fn every_file_has_the_expected_triangles_and_instances() {
    let Some(folder) = scenes("every_file_has_the_expected_triangles_and_instances") else { return };
    for (file, triangles, instances) in FILES {
        let (scene, report) = load_gltf(&folder.join(file), &ImportOptions::default()).unwrap();
        // Degenerate triangles are counted once per mesh; each instance of the mesh lacks them.
        let dropped: usize = if scene.meshes.len() == scene.instances.len() {
            report.degenerate_triangles
        } else {
            report.degenerate_triangles * scene.instances.iter().filter(|i| i.mesh == 0).count()
        };
        let found: usize = scene.instances.iter().map(|i| scene.meshes[i.mesh as usize].triangles.len()).sum();
        assert_eq!((found + dropped, scene.instances.len()), (triangles, instances), "{file}");
        assert_eq!(report.extensions_unsupported, <[String; 0]>::default(), "{file}");
        for mesh in &scene.meshes {
            assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3), "{file}: {}", mesh.name);
            assert_eq!(mesh.normals.len(), mesh.positions.len(), "{file}: {}", mesh.name);
        }
        assert!(report.files.iter().all(|f| f.exists()), "{file}: {:?}", report.files);
        let skipped = report.warnings.iter().filter(|w| matches!(w, ImportWarning::PrimitiveSkipped { .. })).count();
        assert_eq!(skipped, if file.contains("MeshPrimitiveModes") { 4 } else { 0 }, "{file}");
        let replaced = |w: &ImportWarning| matches!(w, ImportWarning::ImageReplaced { .. });
        assert!(!report.warnings.iter().any(replaced), "{file}: {:?}", report.warnings);
    }
}

#[test]
fn paper_scenes_have_their_cameras_lights_and_textures() {
    let Some(folder) = scenes("paper_scenes_have_their_cameras_lights_and_textures") else { return };
    for (file, cameras, lights, images) in PAPER {
        let (scene, report) = load_gltf(&folder.join(file), &ImportOptions::default()).unwrap();
        assert_eq!(
            (scene.cameras.len(), scene.lights.len(), scene.textures.len()),
            (cameras, lights, images),
            "{file}"
        );
        assert!(matches!(scene.environment, Environment::Constant(glam::Vec3::ZERO)), "{file} has light of its own");
        assert_eq!(scene.origin_in_file, glam::DVec3::ZERO, "{file}: ordinary scenes keep their coordinates");
        eprintln!("{file}: {:?}", report.stage_seconds);
    }
    let (scene, _) = load_gltf(&folder.join("paper/bmw.glb"), &ImportOptions::default()).unwrap();
    let camera = &scene.cameras[0];
    assert_eq!(camera.name, "BMW_Camera");
    assert!(camera.position.abs_diff_eq(glam::Vec3::new(-9.237, 1.495, 4.786), 1e-3));
    let expected = glam::Quat::from_xyzw(-0.1072, -0.4934, 0.0981, 0.8576);
    assert!(camera.rotation.angle_between(expected) < 1e-3);
}

#[test]
fn environment_images_load() {
    let Some(folder) = scenes("environment_images_load") else { return };
    for file in ["env/royal_esplanade_1k.hdr", "env/spiaggia_di_mondello_1k.hdr"] {
        let loaded = tracer::environment::load(&folder.join(file)).unwrap();
        assert_eq!((loaded.image.width, loaded.image.height, loaded.repaired_texels), (1024, 512, 0), "{file}");
        let mean = loaded.image.pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / (1024.0 * 512.0);
        assert!((0.01..100.0).contains(&mean), "{file}: mean green {mean}");
    }
}

#[test]
fn openexr_images_load() {
    let Some(folder) = std::env::var_os("FOVEA_REFERENCE").map(PathBuf::from) else {
        return eprintln!("SKIP openexr_images_load: FOVEA_REFERENCE is not set");
    };
    let loaded = tracer::environment::load(&folder.join(Path::new("cycles/sibenik.exr"))).unwrap();
    assert!(loaded.image.width == 2 * loaded.image.height, "{:?}", loaded.image);
}
