//! Each feature of the importer on a glTF made by hand, against values worked out by hand.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod import_support;

use std::f32::consts::FRAC_1_SQRT_2;

use glam::{DVec3, Vec2, Vec3, Vec4};
use import_support::{File, floats, png};
use serde_json::json;
use tracer::import::{ImportOptions, ImportWarning, load_gltf, load_gltf_showing};
use tracer::scene::{AlphaMode, Projection, PunctualKind, Scene, TexelEncoding, TextureRef, WrapMode};

fn world_positions(scene: &Scene, instance: usize) -> Vec<Vec3> {
    let instance = &scene.instances[instance];
    let mesh = &scene.meshes[instance.mesh as usize];
    mesh.positions.iter().map(|&p| instance.world_from_mesh.transform_point3(p)).collect()
}

fn at_time(file: &File, time_secs: f32) -> Scene {
    file.load_with(&ImportOptions { time_secs: Some(time_secs), ..ImportOptions::default() }).unwrap().0
}

fn assert_close(found: &[Vec3], expected: &[Vec3]) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!(f.abs_diff_eq(*e, 1e-5), "{found:?}, expected {expected:?}");
    }
}

#[test]
fn strips_fans_and_lists_without_indices() {
    let square = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
    for (mode, expected) in [(4, vec![[0, 1, 2]]), (5, vec![[0, 1, 2], [1, 3, 2]]), (6, vec![[1, 2, 0], [2, 3, 0]])] {
        let mut file = File::empty();
        let positions = file.accessor(&floats(&square), 5126, "VEC3", 4);
        let normals = file.accessor(&floats(&[0., 0., 1.].repeat(4)), 5126, "VEC3", 4);
        file.mesh(json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "mode": mode}));
        file.node(json!({"mesh": 0}));
        assert_eq!(file.scene().meshes[0].triangles, expected, "mode {mode}");
    }
}

#[test]
fn missing_normals_are_flat() {
    let mut file = File::empty();
    // Two faces of a tent that share an edge.
    let positions = file.accessor(&floats(&[0., 1., 0., 0., 1., 1., 1., 0., 0., -1., 0., 0.]), 5126, "VEC3", 4);
    let indices = file.accessor(&[0, 1, 2, 0, 3, 1], 5121, "SCALAR", 6);
    file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
    file.node(json!({"mesh": 0}));
    let mesh = file.scene().meshes[0].clone();
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]], "nothing is shared");
    let (right, left) = (Vec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0), Vec3::new(-FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0));
    assert_close(&mesh.normals, &[right, right, right, left, left, left]);
}

#[test]
fn integers_strides_and_sparse_accessors() {
    // KHR_mesh_quantization: i16 normalised positions in elements of 8 bytes, u8 texture coordinates.
    let mut file = File::empty();
    let raw: Vec<u8> =
        [[0i16, 0, 0, 7], [32767, 0, 0, 7], [0, -32768, 0, 7]].concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    let positions = file.accessor(&raw, 5122, "VEC3", 3);
    file.json["accessors"][positions]["normalized"] = json!(true);
    file.json["bufferViews"][0]["byteStride"] = json!(8);
    let uvs = file.accessor(&[0, 0, 0, 0, 255, 0, 0, 0, 51, 255, 0, 0], 5121, "VEC2", 3);
    file.json["accessors"][uvs]["normalized"] = json!(true);
    file.json["bufferViews"][1]["byteStride"] = json!(4);
    let colors = file.accessor(&[255, 0, 51, 255, 0, 51, 255, 0, 51], 5121, "VEC3", 3);
    file.json["accessors"][colors]["normalized"] = json!(true);
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    file.mesh(json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs, "COLOR_0": colors}}));
    file.node(json!({"mesh": 0}));
    let mesh = file.scene().meshes[0].clone();
    assert_close(&mesh.positions, &[Vec3::ZERO, Vec3::X, -Vec3::Y]);
    assert_eq!(mesh.uvs[0], [Vec2::ZERO, Vec2::X, Vec2::new(0.2, 1.0)]);
    assert_eq!(mesh.colors, [Vec4::new(1.0, 0.0, 0.2, 1.0); 3]);

    let mut file = File::triangle();
    let at = file.view(&[2]);
    let values = file.view(&floats(&[5., 6., 0.]));
    file.json["accessors"][0]["sparse"] =
        json!({"count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}});
    assert_close(&file.scene().meshes[0].positions, &[Vec3::ZERO, Vec3::X, Vec3::new(5.0, 6.0, 0.0)]);
    // Without a buffer view the rest is zero.
    let at = file.view(&[1, 2]);
    let values = file.view(&floats(&[1., 0., 0., 0., 1., 0.]));
    file.json["accessors"][0] = json!({"componentType": 5126, "count": 3, "type": "VEC3", "sparse":
        {"count": 2, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}}});
    assert_close(&file.scene().meshes[0].positions, &[Vec3::ZERO, Vec3::X, Vec3::Y]);
}

/// Version 0 of the attribute codec, every delta stored as a full byte: no compression, but a valid stream.
fn meshopt_stream(data: &[u8], stride: usize) -> Vec<u8> {
    let count = data.len() / stride;
    assert!(count <= 16, "one group");
    let mut stream = vec![0xA0];
    for byte in 0..stride {
        stream.push(3);
        let mut previous = 0u8;
        for element in 0..16 {
            let value = if element < count { data[element * stride + byte] } else { previous };
            let delta = value.wrapping_sub(previous) as i8;
            stream.push(((delta << 1) ^ (delta >> 7)) as u8);
            previous = value;
        }
    }
    stream.resize(stream.len() + 32.max(stride), 0);
    stream
}

#[test]
fn meshopt_compressed_views() {
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let mut file = File::triangle();
        let stream = meshopt_stream(&file.bin[..36], 12);
        let (length, offset) = (stream.len(), file.bin.len());
        file.bin.extend(stream);
        file.bin.resize(file.bin.len().next_multiple_of(4), 0);
        // The uncompressed form is in a buffer that exists in name only.
        let placeholder = json!({"byteLength": 36, "extensions": {name: {"fallback": true}}});
        file.json["buffers"] = json!([{"byteLength": file.bin.len()}, placeholder]);
        let mut compressed = json!({"buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"});
        let view = |compressed: &serde_json::Value| json!({"buffer": 1, "byteLength": 36, "byteStride": 12, "extensions": {name: compressed}});
        file.json["bufferViews"][0] = view(&compressed);
        file.json["extensionsRequired"] = json!([name]);
        assert_close(&file.scene().meshes[0].positions, &[Vec3::ZERO, Vec3::X, Vec3::Y]);
        compressed["byteLength"] = json!(length - 1);
        file.json["bufferViews"][0] = view(&compressed);
        assert!(file.error().contains("buffer view 0: the compressed stream"), "{}", file.error());
        compressed["count"] = json!(1u64 << 40);
        file.json["bufferViews"][0] = view(&compressed);
        assert!(file.error().contains("buffer view 0: 1099511627776 elements of 12 bytes exceed the limit"));
        compressed["byteStride"] = json!(6);
        file.json["bufferViews"][0] = view(&compressed);
        assert!(file.error().contains("buffer view 0: property 'byteStride' is 6"), "{}", file.error());
    }
}

#[test]
fn hierarchy_instancing_and_sharing() {
    let mut file = File::triangle();
    let root = file.node(json!({"translation": [10, 0, 0], "scale": [2, 2, 2], "children": []}));
    // A quarter turn about +Y and a matrix that mirrors x.
    let child = file.push("nodes", json!({"mesh": 0, "rotation": [0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2]}));
    let mirror = file.push("nodes", json!({"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 3, 0, 1]}));
    file.json["nodes"][root]["children"] = json!([child, mirror]);
    let offsets = file.accessor(&floats(&[0., 0., 0., 0., 0., 5.]), 5126, "VEC3", 2);
    let scales = file.accessor(&floats(&[1., 1., 1., 3., 3., 3.]), 5126, "VEC3", 2);
    let attributes = json!({"TRANSLATION": offsets, "SCALE": scales});
    file.node(json!({"mesh": 0, "translation": [0, 1, 0], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}));
    let scene = file.scene();
    assert_eq!(scene.meshes.len(), 1, "all share one mesh");
    assert_close(&world_positions(&scene, 0), &[Vec3::ZERO, Vec3::X, Vec3::Y]);
    let at = Vec3::new(10.0, 0.0, 0.0);
    assert_close(&world_positions(&scene, 1), &[at, at + Vec3::new(0.0, 0.0, -2.0), at + Vec3::new(0.0, 2.0, 0.0)]);
    let up = at + Vec3::new(0.0, 6.0, 0.0);
    assert_close(&world_positions(&scene, 2), &[up, up - 2.0 * Vec3::X, up + 2.0 * Vec3::Y]);
    assert!(scene.instances[2].world_from_mesh.matrix3.determinant() < 0.0, "mirrored, winding as in the file");
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert_close(&world_positions(&scene, 3), &[Vec3::Y, Vec3::new(1.0, 1.0, 0.0), 2.0 * Vec3::Y]);
    let last = Vec3::new(0.0, 1.0, 5.0);
    assert_close(&world_positions(&scene, 4), &[last, last + 3.0 * Vec3::X, last + 3.0 * Vec3::Y]);
    assert_eq!(scene.instances.iter().map(|i| i.node).collect::<Vec<_>>(), [0, 2, 3, 4, 4]);
}

#[test]
fn far_scenes_are_stored_relative_to_their_centre() {
    let mut file = File::triangle();
    file.json["nodes"][0]["translation"] = json!([1e7, 0, 0]);
    file.node(json!({"mesh": 0, "translation": [1e7, 0, 0.001]}));
    file.node(json!({"camera": 0, "translation": [1e7, 1, 2]}));
    file.push(
        "cameras",
        json!({"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1, "zfar": 9, "znear": 0}}),
    );
    let scene = file.scene();
    assert_eq!(scene.origin_in_file, DVec3::new(1e7 + 0.5, 0.5, 0.0005));
    assert_close(&world_positions(&scene, 0)[..1], &[Vec3::new(-0.5, -0.5, -0.0005)]);
    assert_close(&world_positions(&scene, 1)[..1], &[Vec3::new(-0.5, -0.5, 0.0005)]);
    assert!(scene.cameras[0].position.abs_diff_eq(Vec3::new(-0.5, 0.5, 1.9995), 1e-6));
    assert_eq!(scene.cameras[0].projection, Projection::Orthographic { xmag: 2.0, ymag: 1.0 });

    // The same with the distance in the vertices: the mesh moves to its own centre.
    let mut file = File::empty();
    let positions = file.accessor(&floats(&[1e6, 0., 0., 1e6 + 1.0, 0., 0., 1e6, 1., 0.]), 5126, "VEC3", 3);
    file.mesh(json!({"attributes": {"POSITION": positions}}));
    file.node(json!({"mesh": 0}));
    let scene = file.scene();
    assert!(scene.meshes[0].positions.iter().all(|p| p.length() < 1.0), "{:?}", scene.meshes[0].positions);
    assert_close(&world_positions(&scene, 0)[1..2], &[Vec3::new(0.5, -0.5, 0.0)]);
    // Ten diagonals away is still ordinary.
    let mut file = File::triangle();
    file.json["nodes"][0]["translation"] = json!([14, 0, 0]);
    assert_eq!(file.scene().origin_in_file, DVec3::ZERO);
}

#[test]
fn scenes_variants_and_visibility() {
    let mut file = File::triangle();
    for color in [[1, 0, 0, 1], [0, 1, 0, 1]] {
        file.push("materials", json!({"pbrMetallicRoughness": {"baseColorFactor": color}}));
    }
    file.json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "plain"}, {"name": "green"}]}});
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    file.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}});
    let hidden = file.node(json!({"extensions": {"KHR_node_visibility": {"visible": false}}, "children": []}));
    let child = file.push("nodes", json!({"mesh": 0}));
    file.json["nodes"][hidden]["children"] = json!([child]);
    file.push("scenes", json!({"name": "other", "nodes": [0]}));
    let color = |variant: Option<&str>| {
        let options = ImportOptions { variant: variant.map(str::to_owned), ..ImportOptions::default() };
        let (scene, report) = file.load_with(&options).unwrap();
        assert_eq!(report.variants, ["plain", "green"]);
        scene.materials[scene.instances[0].material as usize].base_color
    };
    assert_eq!(color(None), Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert_eq!(color(Some("plain")), Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert_eq!(color(Some("green")), Vec4::new(0.0, 1.0, 0.0, 1.0));
    let (scene, report) = file.load().unwrap();
    assert_eq!(report.scenes, ["", "other"]);
    assert_eq!(scene.instances.iter().map(|i| i.visible).collect::<Vec<_>>(), [true, false]);
    let (scene, report) = file.load_with(&ImportOptions { scene: Some(1), ..ImportOptions::default() }).unwrap();
    assert_eq!((scene.instances.len(), report.scene), (1, 1));
}

#[test]
fn morph_targets_and_their_animation() {
    let mut file = File::triangle();
    let lift = file.accessor(&floats(&[0., 0., 0., 0., 0., 0., 0., 0., 2.]), 5126, "VEC3", 3);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": lift}]);
    let tip = |scene: &Scene| scene.meshes[0].positions.iter().map(|p| p.z).fold(0.0, f32::max);
    assert_eq!(tip(&file.scene()), 0.0);
    file.json["meshes"][0]["weights"] = json!([0.25]);
    assert_eq!(tip(&file.scene()), 0.5);
    file.json["nodes"][0]["weights"] = json!([1]);
    assert_eq!(tip(&file.scene()), 2.0, "a node's weights go before its mesh's");
    let times = file.accessor(&floats(&[1., 2.]), 5126, "SCALAR", 2);
    let weights = file.accessor(&floats(&[0., 4.]), 5126, "SCALAR", 2);
    file.push(
        "animations",
        json!({"samplers": [{"input": times, "output": weights}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}),
    );
    for (time, expected) in [(0.0, 0.0), (1.5, 4.0), (9.0, 8.0)] {
        assert_eq!(tip(&at_time(&file, time)), expected, "at {time} s");
    }
    assert_eq!(tip(&file.scene()), 2.0, "without a time nothing is animated");
    assert_eq!(file.load().unwrap().1.animation_secs, 2.0);
}

#[test]
fn node_animation_interpolates_as_asked() {
    let animated = |interpolation: &str, path: &str, kind: &str, values: &[f32]| {
        let mut file = File::triangle();
        let times = file.accessor(&floats(&[0., 2.]), 5126, "SCALAR", 2);
        let width = if kind == "VEC4" { 4 } else { 3 };
        let output = file.accessor(&floats(values), 5126, kind, values.len() / width);
        file.push(
            "animations",
            json!({"samplers": [{"input": times, "output": output, "interpolation": interpolation}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}]}),
        );
        file
    };
    let origin = |file: &File, time: f32| world_positions(&at_time(file, time), 0)[0];
    let linear = animated("LINEAR", "translation", "VEC3", &[0., 0., 0., 4., 0., 0.]);
    for (time, x) in [(-1.0, 0.0), (0.5, 1.0), (2.0, 4.0), (3.0, 4.0)] {
        assert_eq!(origin(&linear, time), Vec3::new(x, 0.0, 0.0), "linear at {time} s");
    }
    let step = animated("STEP", "translation", "VEC3", &[1., 0., 0., 4., 0., 0.]);
    assert_eq!((origin(&step, 1.9).x, origin(&step, 2.0).x), (1.0, 4.0));
    // In-tangent, value, out-tangent: leaves 0 at speed 1 m/s, arrives at 4 at rest.
    let cubic = animated(
        "CUBICSPLINE",
        "translation",
        "VEC3",
        &[9., 9., 9., 0., 0., 0., 1., 0., 0., 0., 0., 0., 4., 0., 0., 9., 9., 9.],
    );
    // Hermite at s = 1/2: (p0 + p1) / 2 + (m0 - m1) span / 8.
    assert!((origin(&cubic, 1.0).x - (2.0 + 0.25)).abs() < 1e-6);
    let turn = animated("LINEAR", "rotation", "VEC4", &[0., 0., 0., 1., 0., 0., 1., 0.]);
    // Half way through half a turn about z.
    assert_close(&world_positions(&at_time(&turn, 1.0), 0)[1..2], &[Vec3::Y]);
    assert_close(&world_positions(&at_time(&turn, 0.5), 0)[1..2], &[Vec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0)]);
}

#[test]
fn skins_place_vertices_by_their_joints_alone() {
    let mut file = File::triangle();
    let joints = file.accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 5121, "VEC4", 3);
    let weights = file.accessor(&floats(&[1., 0., 0., 0., 1., 0., 0., 0., 0.5, 0.5, 0., 0.]), 5126, "VEC4", 3);
    let identity = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    let mut back = identity;
    back[12] = -1.0;
    let bind = file.accessor(&floats(&[identity, back].concat()), 5126, "MAT4", 2);
    let normals = file.accessor(&floats(&[0., 0., 1.].repeat(3)), 5126, "VEC3", 3);
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    attributes["NORMAL"] = json!(normals);
    file.json["nodes"][0]["skin"] = json!(0);
    file.json["nodes"][0]["translation"] = json!([100, 100, 100]);
    let first = file.node(json!({"translation": [0, 0, 3]}));
    // A quarter turn about x at (5, 0, 0); its bind pose was a shift by -1 in x.
    let second = file.node(json!({"translation": [5, 0, 0], "rotation": [FRAC_1_SQRT_2, 0, 0, FRAC_1_SQRT_2]}));
    file.push("skins", json!({"joints": [first, second], "inverseBindMatrices": bind}));
    let scene = file.scene();
    assert_eq!(scene.instances[0].world_from_mesh, glam::Affine3A::IDENTITY);
    // Vertex 2 = (0, 1, 0): half way between (0, 1, 3) and the turned (-1, 1, 0) = (4, 0, 1).
    let mesh = &scene.meshes[0];
    assert_close(&mesh.positions, &[Vec3::new(0.0, 0.0, 3.0), Vec3::new(5.0, 0.0, 0.0), Vec3::new(2.0, 0.5, 2.0)]);
    assert_close(&mesh.normals[..2], &[Vec3::Z, Vec3::NEG_Y]);
    file.bin[file.json["bufferViews"][2]["byteOffset"].as_u64().unwrap() as usize] = 9;
    assert!(file.error().contains("vertex 0 is bound to joint 9, but the skin has 2"), "{}", file.error());
}

#[test]
fn punctual_lights_and_cameras_take_their_node_s_pose() {
    let mut file = File::triangle();
    let lights = json!([
        {"type": "spot", "color": [1, 0.5, 0], "intensity": 20, "spot": {"outerConeAngle": 0.6, "innerConeAngle": 0.2}},
        {"type": "directional", "intensity": 3, "name": "sun"},
        {"type": "laser"},
    ]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    // A quarter turn about x: -Z becomes -Y... seen from the axis, -Z goes to +Y.
    let turn = [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2];
    let light = |index: usize| json!({"KHR_lights_punctual": {"light": index}});
    file.node(json!({"extensions": light(0), "translation": [1, 2, 3], "rotation": turn, "scale": [2, 3, 4]}));
    file.node(json!({"extensions": light(1)}));
    file.node(json!({"extensions": light(2)}));
    file.push(
        "cameras",
        json!({"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}}),
    );
    file.node(json!({"camera": 0, "name": "eye", "rotation": turn, "scale": [-1, 1, 1], "translation": [0, 0, 9]}));
    let (scene, report) = file.load().unwrap();
    let spot = &scene.lights[0];
    assert_eq!(spot.kind, PunctualKind::Spot { inner_angle: 0.2, outer_angle: 0.6 });
    assert_eq!((spot.intensity, spot.position), (Vec3::new(20.0, 10.0, 0.0), Vec3::new(1.0, 2.0, 3.0)));
    assert!((spot.rotation * Vec3::NEG_Z).abs_diff_eq(Vec3::Y, 1e-6));
    let sun = &scene.lights[1];
    assert_eq!((sun.name.as_str(), sun.intensity), ("sun", Vec3::splat(3.0)));
    assert_eq!(sun.kind, PunctualKind::Directional { angular_diameter: 0.0 });
    let eye = &scene.cameras[0];
    assert_eq!((eye.name.as_str(), eye.position), ("eye", Vec3::new(0.0, 0.0, 9.0)));
    assert_eq!(eye.projection, Projection::Perspective { yfov: 0.7, aspect: Some(1.5) });
    assert!(
        (eye.rotation * Vec3::NEG_Z).abs_diff_eq(Vec3::Y, 1e-6) && (eye.rotation * Vec3::Y).abs_diff_eq(Vec3::Z, 1e-6)
    );
    let unknown = |w: &ImportWarning| matches!(w, ImportWarning::UnknownKind { value, .. } if value == "laser");
    assert!(report.warnings.iter().any(unknown));
}

#[test]
fn all_material_extensions_are_read() {
    let mut file = File::triangle().with_uvs();
    let texture = file.texture(2, 2, [10, 20, 30, 40]);
    file.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    file.json["textures"][texture]["sampler"] = json!(0);
    let slot = || json!({"index": texture});
    file.material(json!({
        "name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [0.5, 0.25, 1],
        "normalTexture": {"index": texture, "scale": 0.5},
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.6, "roughnessFactor": 0.7,
            "baseColorTexture": slot(), "metallicRoughnessTexture": slot()},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_ior": {"ior": 1.7},
            "KHR_materials_specular": {"specularFactor": 0.9, "specularColorFactor": [2, 1, 0.5]},
            "KHR_materials_transmission": {"transmissionFactor": 0.8},
            "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [0.5, 0.6, 0.7]},
            "KHR_materials_dispersion": {"dispersion": 0.3},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.35, "diffuseTransmissionColorFactor": [0.9, 0.8, 0.7]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.45, "clearcoatRoughnessFactor": 0.15, "clearcoatNormalTexture": {"index": texture, "scale": 0.2}},
            "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.3, 0.2], "sheenRoughnessFactor": 0.55},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.65, "anisotropyRotation": 1.5},
            "KHR_materials_iridescence": {"iridescenceFactor": 0.75, "iridescenceIor": 1.4, "iridescenceThicknessMinimum": 150, "iridescenceThicknessMaximum": 500},
        },
    }));
    let scene = file.scene();
    let m = &scene.materials[0];
    assert_eq!((m.base_color, m.metallic, m.roughness), (Vec4::new(0.1, 0.2, 0.3, 0.4), 0.6, 0.7));
    assert_eq!((m.double_sided, m.unlit, m.alpha_mode), (true, false, AlphaMode::Mask { cutoff: 0.25 }));
    assert_eq!((m.emission, m.normal_scale), (Vec3::new(4.0, 2.0, 8.0), 0.5));
    assert_eq!((m.ior, m.specular, m.specular_color), (1.7, 0.9, Vec3::new(2.0, 1.0, 0.5)));
    assert_eq!((m.transmission, m.thickness, m.attenuation_distance), (0.8, 0.1, 2.0));
    assert_eq!((m.attenuation_color, m.dispersion), (Vec3::new(0.5, 0.6, 0.7), 0.3));
    assert_eq!((m.diffuse_transmission, m.diffuse_transmission_color), (0.35, Vec3::new(0.9, 0.8, 0.7)));
    assert_eq!((m.clearcoat, m.clearcoat_roughness, m.clearcoat_normal_scale), (0.45, 0.15, 0.2));
    assert_eq!((m.sheen_color, m.sheen_roughness), (Vec3::new(0.1, 0.3, 0.2), 0.55));
    assert_eq!((m.anisotropy, m.anisotropy_rotation), (0.65, 1.5));
    assert_eq!((m.iridescence, m.iridescence_ior, m.iridescence_thickness_nm), (0.75, 1.4, [150.0, 500.0]));
    assert_eq!(scene.meshes[0].tangents.len(), scene.meshes[0].positions.len(), "the normal map needs tangents");

    let color = m.base_color_texture.unwrap();
    assert_eq!((color.wrap, color.linear_filter), ([WrapMode::ClampToEdge, WrapMode::MirroredRepeat], false));
    let encodings: Vec<_> = scene.textures.iter().map(|t| (t.encoding, t.texels[0])).collect();
    assert_eq!(scene.distinct_textures().len(), 2, "one texture for each reading of the image");
    assert!(encodings.contains(&(TexelEncoding::Srgb, [10, 20, 30, 40])));
    assert!(encodings.contains(&(TexelEncoding::Linear, [10, 20, 30, 40])));
    assert_eq!(scene.textures[color.texture as usize].encoding, TexelEncoding::Srgb);
    assert_eq!(scene.textures[m.normal_texture.unwrap().texture as usize].encoding, TexelEncoding::Linear);
    let hash = |slot: Option<TextureRef>| scene.textures[slot.unwrap().texture as usize].hash;
    assert_ne!(hash(m.base_color_texture), hash(m.normal_texture));
}

#[test]
fn values_out_of_range_are_clamped_and_reported() {
    let mut file = File::triangle();
    file.material(json!({
        "pbrMetallicRoughness": {"roughnessFactor": 1.5, "metallicFactor": -1}, "alphaMode": "MASK", "alphaCutoff": 1.5,
        "extensions": {"KHR_materials_ior": {"ior": 0}},
    }));
    let (scene, report) = file.load().unwrap();
    assert_eq!(
        scene.materials[0].alpha_mode,
        AlphaMode::Mask { cutoff: 1.5 },
        "above 1 nothing is present, as specified"
    );
    assert_eq!((scene.materials[0].roughness, scene.materials[0].metallic), (1.0, 0.0));
    let f0 = ((scene.materials[0].ior - 1.0) / (scene.materials[0].ior + 1.0)).powi(2);
    assert!(f0 > 0.999, "an ior of 0 means total reflection");
    let clamped = report.warnings.iter().filter(|w| matches!(w, ImportWarning::ValueClamped { .. })).count();
    assert_eq!(clamped, 2);
}

#[test]
fn texture_transforms_follow_the_specification_s_example() {
    let mut file = File::triangle().with_uvs();
    let texture = file.texture(1, 1, [255; 4]);
    // "utilizes only the lower left quadrant of the source image, rotated clockwise 90 degrees"
    let transform = json!({"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5]});
    let slot = json!({"index": texture, "extensions": {"KHR_texture_transform": transform}});
    file.material(json!({"pbrMetallicRoughness": {"baseColorTexture": slot}}));
    let scene = file.scene();
    let [u, v] = scene.materials[0].base_color_texture.unwrap().texture_from_uv;
    let apply = |x: f32, y: f32| [u[0] * x + u[1] * y + u[2], v[0] * x + v[1] * y + v[2]];
    // The image's v axis points down: its lower left quadrant is u in 0..0.5, v in 0.5..1.
    for ((x, y), expected) in
        [((0.0, 0.0), [0.0, 1.0]), ((1.0, 0.0), [0.0, 0.5]), ((0.0, 1.0), [0.5, 1.0]), ((1.0, 1.0), [0.5, 0.5])]
    {
        let found = apply(x, y);
        assert!(
            (found[0] - expected[0]).abs() < 1e-6 && (found[1] - expected[1]).abs() < 1e-6,
            "{found:?} {expected:?}"
        );
    }
}

#[test]
fn specular_glossiness_keeps_its_reflectance() {
    let mut file = File::triangle().with_uvs();
    let texture = file.texture(1, 1, [255, 128, 0, 51]);
    file.material(json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.2, 0.3, 0.4, 1], "specularFactor": [0.8, 0.04, 0], "glossinessFactor": 0.5,
        "specularGlossinessTexture": {"index": texture}}}}));
    let (scene, report) = file.load().unwrap();
    let m = &scene.materials[0];
    assert_eq!((m.base_color, m.metallic, m.roughness), (Vec4::new(0.2, 0.3, 0.4, 1.0), 0.0, 1.0));
    assert!((0.04 * m.specular_color).abs_diff_eq(Vec3::new(0.8, 0.04, 0.0), 1e-6), "F0 = 0.04 specular_color");
    // Alpha 51 / 255 times glossiness 0.5 is 0.1: roughness 0.9 in green, no metal in blue.
    let roughness = &scene.textures[m.metallic_roughness_texture.unwrap().texture as usize];
    assert_eq!((roughness.texels[0], roughness.encoding), ([255, 230, 0, 255], TexelEncoding::Linear));
    let color = &scene.textures[m.specular_color_texture.unwrap().texture as usize];
    assert_eq!((color.texels[0], color.encoding), ([255, 128, 0, 51], TexelEncoding::Srgb));
    assert!(report.warnings.iter().any(|w| matches!(w, ImportWarning::SpecularGlossinessConverted { .. })));
}

#[test]
fn sixteen_bit_images_are_rounded_with_a_word() {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::ImageBuffer::<image::Rgb<u16>, _>::from_pixel(2, 1, image::Rgb([32768, 32768, 65535]));
    image::DynamicImage::ImageRgb16(image).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let mut file = File::triangle().with_uvs();
    let view = file.view(bytes.get_ref());
    for image in 0..3 {
        file.push("images", json!({"bufferView": view}));
        file.push("textures", json!({"source": image}));
    }
    let [normal, color, data] = [0, 1, 2].map(|texture| json!({"index": texture}));
    let maps = json!({"baseColorTexture": color, "metallicRoughnessTexture": data});
    file.material(json!({"normalTexture": normal, "pbrMetallicRoughness": maps}));
    let (scene, report) = file.load().unwrap();
    assert_eq!(scene.textures[0].texels, [[128, 128, 255, 255]; 2]);
    assert!(report.warnings.iter().any(|w| matches!(w, ImportWarning::NormalMapRounded { .. })));
    let said: Vec<_> = report.warnings.iter().map(ToString::to_string).filter(|w| w.contains("16 bits")).collect();
    assert_eq!(said, ["2 images of 16 bits a channel were rounded to 8 bits"]);
}

#[test]
fn what_has_no_effect_is_said_once_a_kind() {
    let mut file = File::triangle().with_uvs();
    let slot = json!({"index": file.texture(1, 1, [255; 4])});
    let volume = json!({"KHR_materials_volume": {"thicknessFactor": 1, "thicknessTexture": slot}});
    let material = json!({"occlusionTexture": slot, "extensions": volume});
    file.material(material.clone());
    let second = file.push("materials", material);
    let mesh = file.mesh(json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "material": second}));
    file.node(json!({"mesh": mesh}));
    let lights = json!([{"type": "point", "range": 5}, {"type": "point"}]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    for light in 0..2 {
        file.node(json!({"extensions": {"KHR_lights_punctual": {"light": light}}}));
    }
    file.push(
        "cameras",
        json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0}}),
    );
    for _ in 0..3 {
        file.node(json!({"camera": 0}));
    }
    let (_, report) = file.load().unwrap();
    let said: Vec<_> = report.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [
            "thicknessTexture has no effect (2x): a solid is as thick as its mesh",
            "range has no effect (1x): light falls off by the square of the distance alone",
            "an orthographic projection has no effect (3x): such cameras are shown in perspective",
        ]
    );
}

#[test]
fn shared_and_unused_parts() {
    let mut file = File::triangle();
    // A second mesh with the same accessors and another material shares the geometry; an unused material is not loaded.
    for _ in 0..2 {
        file.push("materials", json!({}));
    }
    file.push("images", json!({"uri": "missing.png"}));
    file.push("textures", json!({"source": 0}));
    file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let second = file.mesh(json!({"attributes": {"POSITION": 0}, "indices": 1, "material": 1}));
    file.node(json!({"mesh": second}));
    let (scene, report) = file.load().unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.materials.len()), (1, 2, 2));
    assert_eq!(report.warnings, [ImportWarning::NoLight], "the missing image of an unused material is not looked for");
    assert_eq!(scene.materials[scene.instances[0].material as usize].name, "", "the default material");
}

#[test]
fn companions_with_spaces_and_other_letters() {
    let folder = std::env::temp_dir().join(format!("import features {}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut file = File::triangle().with_uvs();
    for uri in ["été%20%231.png", "100%.png"] {
        let image = file.push("images", json!({"uri": uri}));
        file.push("textures", json!({"source": image}));
    }
    file.material(json!({"normalTexture": {"index": 1}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    file.json["buffers"] = json!([{"byteLength": file.bin.len(), "uri": "le%20tampon.bin"}]);
    let path = folder.join("scène à tester.gltf");
    std::fs::write(&path, file.json.to_string()).unwrap();
    std::fs::write(folder.join("le tampon.bin"), &file.bin).unwrap();
    std::fs::write(folder.join("été #1.png"), png(3, 1, [1, 2, 3, 4])).unwrap();
    std::fs::write(folder.join("100%.png"), png(1, 5, [4, 3, 2, 1])).unwrap();
    let loaded = load_gltf(&path, &ImportOptions::default());
    std::fs::remove_file(folder.join("le tampon.bin")).unwrap();
    let broken = load_gltf(&path, &ImportOptions::default());
    std::fs::remove_dir_all(&folder).unwrap();
    let (scene, report) = loaded.unwrap();
    assert_eq!(scene.name, "scène à tester.gltf");
    let sizes: Vec<_> = scene.textures.iter().map(|t| (t.width, t.height)).collect();
    assert!(sizes.len() == 2 && sizes.contains(&(3, 1)) && sizes.contains(&(1, 5)), "{sizes:?}");
    assert_eq!(report.files.len(), 4, "{:?}", report.files);
    let message = broken.unwrap_err().to_string();
    assert!(message.contains("buffer 0 'le%20tampon.bin': cannot be read: "), "{message}");
}

#[test]
fn shapes_are_shown_before_images_are_read() {
    let mut file = File::triangle().with_uvs();
    let view = file.view(b"no image at all");
    file.push("images", json!({"bufferView": view}));
    file.push("textures", json!({"source": 0}));
    file.material(json!({"normalTexture": {"index": 0}, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    let path = std::env::temp_dir().join(format!("shapes-{}.glb", std::process::id()));
    std::fs::write(&path, file.glb()).unwrap();
    let mut shapes = Vec::new();
    let (scene, report) =
        load_gltf_showing(&path, &ImportOptions::default(), |scene| shapes.push(scene.clone())).unwrap();
    std::fs::remove_file(&path).unwrap();
    let [shapes] = shapes.as_slice() else { panic!("called {} times", shapes.len()) };

    let replaced = |w: &ImportWarning| matches!(w, ImportWarning::ImageReplaced { .. });
    assert!(report.warnings.iter().any(replaced), "images were read: {:?}", report.warnings);
    assert_eq!((shapes.bounds(), &shapes.instances), (scene.bounds(), &scene.instances));
    assert_eq!((shapes.meshes[0].tangents.len(), scene.meshes[0].tangents.len()), (0, 3));
    assert_ne!(shapes.meshes[0].hash, scene.meshes[0].hash);
    assert_eq!(shapes.textures.len(), scene.textures.len(), "no material refers to what is not there");
    let texel_of = |it: Option<TextureRef>| shapes.textures[it.unwrap().texture as usize].texels.clone();
    assert_eq!(texel_of(shapes.materials[0].base_color_texture), [[188, 188, 188, 255]], "half of the light");
    assert_eq!(texel_of(shapes.materials[0].normal_texture), [[128, 128, 255, 255]], "flat");
}
