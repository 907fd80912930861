//! Broken files end in one-line errors that name the file, the place and the cause; lesser trouble in warnings.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod import_support;

use std::sync::Arc;

use glam::Vec3;
use import_support::{File, floats, one_line_error, png};
use serde_json::json;
use tracer::bvh::{Blas, HierarchyKind, Tlas, TlasEntry};
use tracer::import::{ImportError, ImportOptions, ImportWarning, load_glb_bytes, load_gltf};
use tracer::scene::{Environment, Projection, Scene};

fn load_bytes(bytes: &[u8]) -> String {
    one_line_error(load_glb_bytes("test.glb", bytes, &ImportOptions::default()))
}

#[test]
fn files_that_are_not_gltf() {
    let missing = load_gltf("no/such file.glb".as_ref(), &ImportOptions::default());
    assert!(matches!(missing, Err(ImportError::Read { .. })));
    assert!(missing.unwrap_err().to_string().starts_with("no/such file.glb: cannot be read: "));

    assert!(load_bytes(b"").contains("it is empty"));
    assert!(load_bytes(b"PK\x03\x04").contains("not a glTF 2.0 file: JSON"));
    assert!(load_bytes(b"{}").contains("no asset.version"));
    assert!(load_bytes(br#"{"asset":{"version":"1.0"}}"#).contains("its version is '1.0'"));
    assert!(load_bytes(b"glTF\x01\0\0\0\x0c\0\0\0").contains("container has version 1"));
    assert!(load_bytes(b"glTF\x02\0\0\0\x0c\0\0\0").contains("no JSON chunk"));
    assert!(load_bytes(b"glTF\x02\0\0\0").contains("binary container: needs 12 bytes"));
    let whole = File::triangle().glb();
    assert!(load_bytes(&whole[..whole.len() - 8]).contains("binary container: needs"));
    let nested = [b"{\"asset\":".as_slice(), &b"[".repeat(100_000)].concat();
    assert!(load_bytes(&nested).contains("recursion"), "deep nesting must not overflow the stack");
}

type Edit<'a> = &'a dyn Fn(&mut File);

#[test]
fn buffers_and_accessors_out_of_range() {
    let with = |edit: &dyn Fn(&mut File)| {
        let mut file = File::triangle();
        edit(&mut file);
        file.error()
    };
    let cases: [(Edit<'_>, &str); 15] = [
        (&|f| f.json["buffers"] = json!([{"byteLength": 1u64 << 60}]), "buffer 0: needs 1152921504606846976 bytes"),
        (
            &|f| f.json["bufferViews"][0]["byteLength"] = json!(1u64 << 40),
            "buffer view 0: needs 1099511627776 bytes of buffer 0",
        ),
        (&|f| f.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "buffer view 0: needs"),
        (
            &|f| f.json["bufferViews"][0]["buffer"] = json!(7),
            "buffer view 0: 'buffer' refers to buffer 7, but the file has 1",
        ),
        (
            &|f| f.json["accessors"][0]["count"] = json!(4_000_000_000u64),
            "accessor 0: needs 48000000000 bytes of buffer view 0",
        ),
        (
            &|f| f.json["accessors"][0]["byteOffset"] = json!(4),
            "accessor 0: needs 40 bytes of buffer view 0, which has 36",
        ),
        (&|f| f.json["accessors"][0]["bufferView"] = json!(9), "accessor 0: 'bufferView' refers to buffer view 9"),
        (&|f| f.json["accessors"][0]["type"] = json!("VEC9"), "accessor 0: property 'type' is 'VEC9'"),
        (&|f| f.json["accessors"][0]["componentType"] = json!(1), "accessor 0: property 'componentType' is 1"),
        (&|f| f.json["accessors"][0]["count"] = json!(-3), "accessor 0: property 'count' is not a whole number"),
        (&|f| f.json["accessors"][0]["type"] = json!("VEC2"), "accessor 0: POSITION needs 3 components, but it has 2"),
        (
            &|f| f.json["bufferViews"][0]["byteStride"] = json!(8),
            "accessor 0: elements of 12 bytes do not fit a stride of 8",
        ),
        (
            &|f| {
                let accessor = &mut f.json["accessors"][0];
                accessor.as_object_mut().unwrap().remove("bufferView");
                accessor["count"] = json!(1u64 << 40);
            },
            "accessor 0: 1099511627776 elements without data exceed the limit",
        ),
        (&|f| f.json["accessors"][1]["componentType"] = json!(5126), "accessor 1: indices must be unsigned integers"),
        (
            &|f| f.json["buffers"] = json!([{"byteLength": 4, "uri": "data:;base64,!!"}]),
            "buffer 0: cannot be read: the data URI is not valid base64",
        ),
    ];
    for (i, (edit, expected)) in cases.into_iter().enumerate() {
        let message = with(edit);
        assert!(message.contains(expected), "case {i}: {message}");
    }
}

#[test]
fn references_and_graphs() {
    let cases = [
        (json!({"mesh": 3}), "node 1: 'mesh' refers to mesh 3, but the file has 1"),
        (json!({"children": [1]}), "node 1: is its own ancestor"),
        (json!({"children": [0]}), "node 0: is its own ancestor or the child of two nodes"),
        (json!({"matrix": [1, 2, 3]}), "node 1: property 'matrix' is not an array of 16 numbers"),
        (json!({"translation": "up"}), "node 1: property 'translation' is not an array"),
        (json!({"camera": 0}), "node 1: 'camera' refers to camera 0, but the file has 0"),
        (json!({"skin": 0}), "node 1: 'skin' refers to skin 0"),
    ];
    for (node, expected) in cases {
        let mut file = File::triangle();
        file.node(node.clone());
        let message = file.error();
        assert!(message.contains(expected), "{node}: {message}");
    }
    // A node may be named once in the scene's list only.
    let mut file = File::triangle();
    file.json["scenes"][0]["nodes"] = json!([0, 0]);
    assert!(file.error().contains("node 0: is its own ancestor or the child of two nodes"));
    let mut file = File::triangle();
    file.json["scene"] = json!(4);
    assert!(file.error().contains("document: 'scene' refers to scene 4, but the file has 1"));
    let file = File::triangle();
    let asked = |options| one_line_error(file.load_with(&options));
    let message = asked(ImportOptions { scene: Some(2), ..ImportOptions::default() });
    assert!(message.contains("scene 2 was asked for, but the file has 1"), "{message}");
    let message = asked(ImportOptions { variant: Some("red".into()), ..ImportOptions::default() });
    assert!(message.contains("no material variant 'red'; the file has: none"), "{message}");
}

#[test]
fn geometry_that_cannot_be_rendered() {
    for (bad, vertex) in [(f32::NAN, 1), (f32::INFINITY, 2)] {
        let mut file = File::triangle();
        file.bin[vertex * 12..][..4].copy_from_slice(&bad.to_le_bytes());
        let expected = format!("mesh 0 'm' primitive 0: vertex {vertex} has a position that is not finite");
        assert!(file.error().contains(&expected), "{}", file.error());
    }
    let mut file = File::triangle();
    file.bin[36 + 4] = 3;
    assert!(file.error().contains("mesh 0 'm' primitive 0: vertex index 3 is out of range: there are 3 vertices"));
    let mut file = File::triangle();
    file.json["scenes"][0]["nodes"] = json!([]);
    assert!(file.error().contains("scene 0: has no triangles to render"));
    let mut file = File::triangle();
    file.json["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(file.error().contains("scene 0: has no triangles to render"));
    let mut file = File::triangle();
    file.json["meshes"][0]["primitives"][0]["attributes"] = json!({});
    assert!(file.error().contains("mesh 0 'm' primitive 0: property 'attributes' has no POSITION"));
    let mut file = File::triangle();
    let normals = file.accessor(&floats(&[0., 0., 1.]), 5126, "VEC3", 1);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    assert!(file.error().contains("NORMAL has 1 entries where POSITION has 3"));
}

/// Both ways in which a renderer may place each instance: in the world, and by a hierarchy of its own.
fn build_hierarchies(scene: &Scene, kind: HierarchyKind) {
    let mut entries = Vec::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        let world_from_mesh = instance.world_from_mesh;
        let in_world: Vec<Vec3> = mesh.positions.iter().map(|&p| world_from_mesh.transform_point3(p)).collect();
        assert!(Blas::build(kind, &in_world, &mesh.triangles).bounds.min.is_finite());
        let blas = Arc::new(Blas::build(kind, &mesh.positions, &mesh.triangles));
        entries.push(TlasEntry { world_from_mesh, blas, source: None });
    }
    assert_eq!(Tlas::build(kind, &entries).order.len(), entries.len());
}

/// A vertex that nobody means, or a node that throws things out of the world, costs what hangs on it and not the scene.
#[test]
fn what_lies_beyond_all_measure_is_left_out() {
    // Twenty triangles; a corner of the eighth and its neighbour is far away.
    let with_corner = |corner: [f32; 3]| {
        let mut file = File::empty();
        let mut points: Vec<[f32; 3]> = (0..22u16).map(|i| [f32::from(i % 2), f32::from(i), 0.0]).collect();
        points.push(corner);
        let triangle = |i: u8| if i / 2 == 4 { [i, i + 1, 22] } else { [i, i + 1, i + 2] };
        let indices: Vec<u8> = (0..20).flat_map(triangle).collect();
        let positions = file.accessor(&floats(points.as_flattened()), 5126, "VEC3", 23);
        let indices = file.accessor(&indices, 5121, "SCALAR", 60);
        let normals = file.accessor(&floats(&[0., 0., 1.].repeat(23)), 5126, "VEC3", 23);
        file.mesh(json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices}));
        file.node(json!({"mesh": 0}));
        file
    };
    for corner in [[f32::MAX; 3], [2e38, -2e38, 0.0], [0.0, -1e17, 0.0]] {
        let (scene, report) = with_corner(corner).load().unwrap();
        assert_eq!(scene.meshes[0].triangles.len(), 18, "{corner:?}");
        assert_eq!(scene.bounds(), Some((Vec3::ZERO, Vec3::new(1.0, 21.0, 0.0))), "{corner:?}");
        let said = "mesh 0 'm' primitive 0: dropped 2 triangles with corners beyond 1e15 m";
        assert!(report.warnings.iter().any(|w| w.to_string() == said), "{:?}", report.warnings);
        build_hierarchies(&scene, HierarchyKind::Wide);
    }
    let far = 1e12;
    let (scene, _) = with_corner([0.0, far, 0.0]).load().unwrap();
    assert_eq!(scene.meshes[0].triangles.len(), 20, "far, but within measure");

    let mut file = File::triangle();
    file.node(json!({"mesh": 0, "scale": [1e30, 1e30, 1e30], "name": "vast"}));
    file.node(json!({"mesh": 0, "translation": [0, -1e20, 0], "name": "off"}));
    let (scene, report) = file.load().unwrap();
    assert_eq!((scene.instances.len(), scene.bounds()), (1, Some((Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)))));
    for node in ["node 1 'vast'", "node 2 'off'"] {
        let said = format!("{node}: what it places reaches beyond 1e15 m and was dropped");
        assert!(report.warnings.iter().any(|w| w.to_string() == said), "{:?}", report.warnings);
    }
    file.json["scenes"][0]["nodes"] = json!([1]);
    assert!(file.error().contains("scene 0: has no triangles to render"));
}

#[test]
fn angles_of_view_that_no_lens_has_are_clamped() {
    let mut file = File::triangle();
    for yfov in [4.0, 45.0, 3.0, 2.9, 0.7] {
        let camera = file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.1}}));
        file.node(json!({"camera": camera}));
    }
    let (scene, report) = file.load().unwrap();
    let largest = 170f32.to_radians();
    let expected = [largest, largest, largest, 2.9, 0.7].map(|yfov| Projection::Perspective { yfov, aspect: None });
    assert_eq!(scene.cameras.iter().map(|camera| camera.projection).collect::<Vec<_>>(), expected);
    let said: Vec<_> = report.warnings.iter().map(ToString::to_string).filter(|w| w.contains("'yfov'")).collect();
    assert_eq!(said.len(), 3, "{said:?}");
    assert_eq!(said[1], "camera 1: 'yfov' = 45 is out of range and was clamped");
    file.json["cameras"][1]["perspective"]["yfov"] = json!(0);
    assert!(file.error().contains("camera 1: property 'yfov' is not above 0"), "{}", file.error());
}

/// The strongest light that a film holds; products of factors that are finite need not be so.
#[test]
fn light_without_measure_is_clamped() {
    let mut file = File::triangle();
    let strength = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 1e30}});
    file.material(json!({"emissiveFactor": [1e30, 0, 0], "extensions": strength}));
    let lights = json!([{"type": "point", "intensity": 1e30}, {"type": "point", "intensity": 2}]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    for light in 0..2 {
        file.node(json!({"extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    let (scene, report) = file.load().unwrap();
    assert_eq!(scene.materials[0].emission, Vec3::new(1e18, 0.0, 0.0));
    assert_eq!(scene.lights.iter().map(|light| light.intensity.x).collect::<Vec<_>>(), [1e18, 2.0]);
    let clamped = report.warnings.iter().filter(|w| matches!(w, ImportWarning::ValueClamped { .. }));
    assert_eq!(clamped.count(), 2, "{:?}", report.warnings);
}

#[test]
fn names_cannot_break_the_line() {
    let mut file = File::triangle();
    file.json["meshes"][0]["name"] = json!("two\nlines");
    file.bin[36 + 4] = 3;
    assert!(file.error().contains(r"mesh 0 'two\nlines' primitive 0"), "{}", file.error());
}

#[test]
fn required_extensions_are_named() {
    for name in ["KHR_draco_mesh_compression", "KHR_texture_basisu", "VENDOR_unheard_of"] {
        let mut file = File::triangle();
        file.json["extensionsUsed"] = json!([name]);
        file.json["extensionsRequired"] = json!([name]);
        assert!(file.error().contains(&format!("the required extension {name} is not supported")));
        // Merely used, it is reported and the import goes on.
        file.json["extensionsRequired"] = json!([]);
        let (_, report) = file.load().unwrap();
        assert_eq!(report.extensions_unsupported, [name]);
        assert!(report.warnings.contains(&ImportWarning::ExtensionIgnored { name: name.to_owned() }));
    }
    // Draco without a fallback, although not declared as required.
    let mut file = File::triangle();
    file.json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {}});
    file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(file.error().contains("its data is stored only by the extension KHR_draco_mesh_compression"));
}

/// A PNG header that claims a size, and nothing behind it.
fn png_claiming(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = png(1, 1, [0; 4]);
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let mut crc = u32::MAX;
    for byte in &bytes[12..29] {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    bytes
}

#[test]
fn absurd_images_are_refused_and_missing_ones_replaced() {
    let with_image = |bytes: &[u8]| {
        let mut file = File::triangle().with_uvs();
        let view = file.view(bytes);
        file.push("images", json!({"bufferView": view, "name": "x.png"}));
        file.push("textures", json!({"source": 0}));
        let slot = json!({"index": 0});
        file.material(json!({"pbrMetallicRoughness": {"baseColorTexture": slot}, "normalTexture": slot, "emissiveTexture": slot, "emissiveFactor": [1, 1, 1]}));
        file
    };
    let message = with_image(&png_claiming(2_000_000_000, 10)).error();
    assert!(message.contains("image 0 'x.png': 2000000000x10 pixels exceed the limit of 16384 per side"), "{message}");

    let neutral = |file: &File| {
        let (scene, report) = file.load().unwrap();
        let replaced = |w: &&ImportWarning| matches!(w, ImportWarning::ImageReplaced { .. });
        assert_eq!(report.warnings.iter().filter(replaced).count(), 1, "{:?}", report.warnings);
        let material = &scene.materials[0];
        [material.base_color_texture, material.normal_texture, material.emissive_texture]
            .map(|slot| scene.textures[slot.unwrap().texture as usize].texels.clone())
    };
    // One image, and each slot has what is neutral there.
    let expected = [[[255; 4]], [[128, 128, 255, 255]], [[0, 0, 0, 255]]];
    let file = with_image(b"not an image");
    assert_eq!(neutral(&file), expected);
    let truncated = png(64, 64, [9, 200, 31, 255]);
    assert!(!neutral(&with_image(&truncated[..truncated.len() / 2])).is_empty());
    let mut file = with_image(b"x");
    file.json["images"] = json!([{"uri": "gone.png"}]);
    assert!(!neutral(&file).is_empty());
}

#[test]
#[cfg(unix)]
fn pipes_and_devices_are_not_read() {
    let folder = std::env::temp_dir().join(format!("fovea-pipes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    // Nobody writes to it: whoever opens it waits for ever.
    assert!(std::process::Command::new("mkfifo").arg(folder.join("pipe")).status().unwrap().success());
    let to_root = "../".repeat(folder.components().count());
    let load = |file: &File| {
        let path = folder.join("scene.glb");
        std::fs::write(&path, file.glb()).unwrap();
        load_gltf(&path, &ImportOptions::default())
    };
    let endless = format!("{to_root}dev/zero");
    for (uri, cause) in [("pipe", "no regular file"), (&endless, "no regular file"), ("/dev/zero", "relative")] {
        let mut file = File::triangle();
        file.push("buffers", json!({"uri": uri, "byteLength": 4}));
        let message = load(&file).map(|(scene, _)| scene.name).unwrap_err().to_string();
        assert!(message.contains("cannot be read") && message.contains(cause), "{uri}: {message}");
        let mut file = File::triangle().with_uvs();
        file.push("images", json!({"uri": uri}));
        file.push("textures", json!({"source": 0}));
        file.material(json!({"normalTexture": {"index": 0}}));
        let (_, report) = load(&file).unwrap();
        let said = report.warnings.iter().find(|w| matches!(w, ImportWarning::ImageReplaced { .. })).unwrap();
        assert!(said.to_string().contains(cause), "{uri}: {said}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_missing_emissive_texture_gives_no_light() {
    let mut file = File::triangle().with_uvs();
    file.push("images", json!({"uri": "gone.png"}));
    file.push("textures", json!({"source": 0}));
    file.material(json!({"emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 1]}));
    let scene = file.scene();
    assert_eq!(scene.textures[0].texels, [[0, 0, 0, 255]]);
    // The same where only an unsupported extension has the image.
    file.json["textures"] = json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
    let (scene, report) = file.load().unwrap();
    assert_eq!((scene.textures.len(), scene.materials[0].emission), (0, Vec3::ZERO));
    let dropped =
        |w: &ImportWarning| matches!(w, ImportWarning::TextureDropped { slot, .. } if slot == "emissiveTexture");
    assert!(report.warnings.iter().any(dropped), "{:?}", report.warnings);
}

#[test]
fn lightless_scenes_get_a_sky_and_lit_ones_none() {
    let (scene, report) = File::triangle().load().unwrap();
    assert!(report.warnings.contains(&ImportWarning::NoLight));
    assert!(matches!(scene.environment, Environment::Constant(sky) if sky == Vec3::splat(0.8)));

    let mut emissive = File::triangle();
    emissive.material(json!({"emissiveFactor": [0, 1, 0]}));
    let mut hidden = emissive.clone();
    hidden.json["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": false}});
    // What is unlit shows its base colour and lights nothing.
    let mut unlit = File::triangle();
    unlit.material(json!({"emissiveFactor": [0, 1, 0], "extensions": {"KHR_materials_unlit": {}}}));
    let mut punctual = File::triangle();
    punctual.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    punctual.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    let sky = Vec3::splat(0.8);
    for (file, expected) in [(emissive, Vec3::ZERO), (hidden, sky), (unlit, sky), (punctual, Vec3::ZERO)] {
        assert!(matches!(file.scene().environment, Environment::Constant(sky) if sky == expected));
    }
}

#[test]
fn repairs_are_counted() {
    let mut file = File::empty();
    // Vertices 3 and 4 coincide with others; the normals of vertices 0 and 1 are unusable.
    let points = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 0., 2., 0., 0.];
    let positions = file.accessor(&floats(&points), 5126, "VEC3", 5);
    let mut normals = [0., 0., 1.].repeat(5);
    normals[..6].copy_from_slice(&[0., 0., 0., f32::NAN, 0., 0.]);
    let normals = file.accessor(&floats(&normals), 5126, "VEC3", 5);
    // The second repeats a vertex, the third a position, the fourth is collinear.
    let indices = file.accessor(&[0, 1, 2, 1, 1, 2, 0, 3, 2, 0, 1, 4], 5121, "SCALAR", 12);
    file.mesh(json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices}));
    file.node(json!({"mesh": 0}));
    file.node(json!({"mesh": 0, "scale": [1, 0, 1], "name": "flat"}));
    let (scene, report) = file.load().unwrap();
    let place = || "mesh 0 'm' primitive 0".to_owned();
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert_eq!(report.degenerate_triangles, 3);
    assert_eq!(scene.meshes[0].normals, [Vec3::Z; 5]);
    assert_eq!(scene.instances.len(), 1);
    for expected in [
        ImportWarning::DegenerateTriangles { place: place(), count: 3 },
        ImportWarning::NormalsRepaired { place: place(), count: 2 },
        ImportWarning::SingularTransform { place: "node 1 'flat'".to_owned() },
    ] {
        assert!(report.warnings.contains(&expected), "{expected} in {:?}", report.warnings);
    }
}

/// A xorshift generator: fixed seeds, no dependency.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, bound: usize) -> usize {
        ((self.next() >> 33) as usize) % bound.max(1)
    }
}

/// A file that uses most of what the importer reads, so that mutations reach most of it.
fn rich_file() -> File {
    let mut file = File::triangle().with_uvs();
    let texture = file.texture(4, 4, [200, 90, 30, 255]);
    file.material(json!({
        "normalTexture": {"index": texture},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": texture, "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}}},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatTexture": {"index": texture}}},
    }));
    let targets = file.accessor(&floats(&[0., 0., 1., 0., 0., 0., 0., 0., 0.]), 5126, "VEC3", 3);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": targets}]);
    file.json["meshes"][0]["weights"] = json!([0.5]);
    let joints = file.accessor(&[0, 1, 0, 0].repeat(3), 5121, "VEC4", 3);
    let weights = file.accessor(&floats(&[0.5, 0.5, 0., 0.].repeat(3)), 5126, "VEC4", 3);
    let bind = file.accessor(
        &floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.].repeat(2)),
        5126,
        "MAT4",
        2,
    );
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    let joint = file.node(json!({"translation": [0, 1, 0]}));
    let other = file.node(json!({"rotation": [0, 0.6, 0, 0.8]}));
    file.push("skins", json!({"joints": [joint, other], "inverseBindMatrices": bind}));
    file.json["nodes"][0]["skin"] = json!(0);
    let times = file.accessor(&floats(&[0., 1.]), 5126, "SCALAR", 2);
    let turns = file.accessor(&floats(&[0., 0., 0., 1., 0., 1., 0., 0.]), 5126, "VEC4", 2);
    file.push(
        "animations",
        json!({
            "samplers": [{"input": times, "output": turns}],
            "channels": [{"sampler": 0, "target": {"node": other, "path": "rotation"}}],
        }),
    );
    let sparse_at = file.view(&[1, 0]);
    let sparse_values = file.view(&floats(&[2., 0., 0.]));
    file.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": sparse_at, "componentType": 5123}, "values": {"bufferView": sparse_values},
    });
    file.node(json!({"camera": 0}));
    file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}));
    let offsets = file.accessor(&floats(&[0., 0., 0., 3., 0., 0.]), 5126, "VEC3", 2);
    let plain = file.mesh(json!({"attributes": {"POSITION": 0}, "indices": 1}));
    file.node(
        json!({"mesh": plain, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": offsets}}}}),
    );
    file
}

#[test]
fn mutated_files_never_panic() {
    let options = ImportOptions { time_secs: Some(0.4), ..ImportOptions::default() };
    let file = rich_file();
    let intact = file.glb();
    let (scene, _) = load_glb_bytes("test.glb", &intact, &options).unwrap();
    assert_eq!(scene.instances.len(), 3, "the file to be mutated is fine");
    let mut random = Random(0x5EED_F0FE_A001);
    let (mut failed, mut passed) = (0, 0);
    for round in 0..2000 {
        let mut bytes = intact.clone();
        match round % 4 {
            // Digits in the JSON: indices, counts, offsets, types.
            0 | 1 => {
                let digits: Vec<usize> = (20..bytes.len()).filter(|&i| bytes[i].is_ascii_digit()).collect();
                for _ in 0..=random.below(3) {
                    bytes[digits[random.below(digits.len())]] = b"0123456789-.e"[random.below(13)];
                }
            }
            2 => {
                for _ in 0..=random.below(8) {
                    let at = random.below(bytes.len());
                    bytes[at] = random.next() as u8;
                }
            }
            _ => bytes.truncate(random.below(bytes.len())),
        }
        match load_glb_bytes("test.glb", &bytes, &options) {
            Ok((scene, _)) => {
                passed += 1;
                for mesh in &scene.meshes {
                    assert!(mesh.positions.iter().all(|p| p.is_finite()), "round {round}");
                    assert!(mesh.triangles.as_flattened().iter().all(|&v| (v as usize) < mesh.positions.len()));
                }
                assert!(scene.instances.iter().all(|i| i.world_from_mesh.inverse().is_finite()), "round {round}");
                build_hierarchies(&scene, HierarchyKind::Wide);
            }
            Err(error) => {
                failed += 1;
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
    assert!(
        failed > 500 && passed > 100,
        "the mutations neither break all nor nothing: {failed} failed, {passed} passed"
    );
}
