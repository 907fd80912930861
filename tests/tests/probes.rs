//! Every model file renders to what its own labels say is right; the list of probes is `tests/probes.json`.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::{path::Path, sync::Arc};

use fovea_tests::{
    device,
    probes::{self, Model},
};
use glam::Vec4Swizzles;
use tracer::{
    distribution::Distribution,
    renderer::{Renderer, RendererOptions},
    scene::{AlphaMode, Material, Scene, TexelEncoding, Texture, TextureRef, WrapMode},
};

/// Samples of a probed pixel. A place is at least one pixel, mostly nine; tolerances are several standard errors.
const SAMPLES: u64 = 128;

fn renderer() -> Renderer {
    let film = probes::film(probes::FILM_PX);
    let options = RendererOptions { film, max_bounces: probes::MAX_BOUNCES, ..Default::default() };
    Renderer::new(&device::gpu(), &options, Distribution::omnidirectional(device::inverse())).unwrap()
}

/// All `.glb` and `.gltf` files below a folder.
fn count_models(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .map(|path| match path.extension().and_then(|e| e.to_str()) {
            _ if path.is_dir() => count_models(&path),
            Some("glb" | "gltf") => 1,
            _ => 0,
        })
        .sum()
}

#[test]
fn every_model_is_as_its_labels_say() {
    let Some(folder) = device::external_file("probes", "FOVEA_SCENES", "khronos") else { return };
    let _time = device::Stopwatch::start("probes");
    let mut renderer = renderer();
    let models = probes::list();
    let mut files: Vec<&str> = models.iter().map(|model| model.file.as_str()).collect();
    files.sort_unstable();
    files.dedup();
    assert_eq!(files.len(), count_models(&folder), "some model has no probes");
    let mut complaints = Vec::new();
    for model in &models {
        assert!(model.probes.len() >= 3, "{} has {} probes", model.file, model.probes.len());
        let scene = model.load(&folder).unwrap();
        complaints.extend(model.check(&mut renderer, &scene, SAMPLES).unwrap());
        assert_eq!(renderer.statistics().unwrap().non_finite, 0, "{}", model.file);
    }
    eprintln!("{} places, {} not as labelled", models.iter().map(|m| m.probes.len()).sum::<usize>(), complaints.len());
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

fn change_materials(scene: &mut Scene, change: impl Fn(&mut Material)) {
    scene.materials.iter_mut().for_each(|material| change(Arc::make_mut(material)));
}

fn change_references(scene: &mut Scene, change: impl Fn(&mut TextureRef)) {
    change_materials(scene, |m| {
        let used = [&mut m.base_color_texture, &mut m.emissive_texture, &mut m.normal_texture];
        used.into_iter().flatten().for_each(&change);
    });
}

fn change_textures(scene: &mut Scene, change: impl Fn(&mut Texture)) {
    for texture in &mut scene.textures {
        let texture = Arc::make_mut(texture);
        change(texture);
        texture.hash = texture.hash.mix(b"changed");
    }
}

type Fault = (&'static str, &'static str, fn(&mut Scene));

/// What goes wrong, a file whose probes must notice, and how.
const FAULTS: [Fault; 10] = [
    ("v runs upwards", "BoxTextured.glb", |scene| {
        change_textures(scene, |t| t.texels = t.texels.chunks(t.width as usize).rev().flatten().copied().collect());
    }),
    ("red and blue are swapped", "OrientationTest.glb", |scene| {
        change_materials(scene, |m| m.base_color = m.base_color.zyxw());
    }),
    ("vertex colours are ignored", "VertexColorTest.glb", |scene| {
        for mesh in &mut scene.meshes {
            let mesh = Arc::make_mut(mesh);
            mesh.colors.clear();
            mesh.hash = mesh.hash.mix(b"changed");
        }
    }),
    ("texture transforms are ignored", "TextureTransformTest/TextureTransformTest.gltf", |scene| {
        change_references(scene, |r| r.texture_from_uv = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    }),
    ("every texture repeats", "TextureSettingsTest.glb", |scene| {
        change_references(scene, |r| r.wrap = [WrapMode::Repeat; 2]);
    }),
    ("sRGB is read as linear", "TextureEncodingTest.glb", |scene| {
        change_textures(scene, |t| t.encoding = TexelEncoding::Linear);
    }),
    ("alpha is ignored", "AlphaBlendModeTest.glb", |scene| {
        change_materials(scene, |m| m.alpha_mode = AlphaMode::Opaque);
    }),
    ("the strength of emission is ignored", "EmissiveStrengthTest.glb", |scene| {
        change_materials(scene, |m| m.emission /= m.emission.max_element().max(1.0));
    }),
    ("the normal map's green is upside down", "NormalTangentTest.glb", |scene| {
        change_textures(scene, |t| t.texels.iter_mut().for_each(|texel| texel[1] = 255 - texel[1]));
    }),
    ("highlights are isotropic", "AnisotropyStrengthTest.glb", |scene| {
        change_materials(scene, |m| m.anisotropy = 0.0);
    }),
];

#[test]
fn planted_faults_are_noticed() {
    let Some(folder) = device::external_file("probes", "FOVEA_SCENES", "khronos") else { return };
    let _time = device::Stopwatch::start("probes");
    let mut renderer = renderer();
    let models = probes::list();
    for (fault, file, plant) in FAULTS {
        let model: &Model = models.iter().find(|model| model.file == file).unwrap();
        let mut scene = model.load(&folder).unwrap();
        plant(&mut scene);
        let complaints = model.check(&mut renderer, &scene, SAMPLES).unwrap();
        assert!(!complaints.is_empty(), "{fault}: not noticed in {file}");
    }
}
