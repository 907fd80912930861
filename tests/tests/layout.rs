//! Composed kernels: every permutation validates, structures lie as the host lays them out, constants agree, and a kernel
//! contains only what its scene needs.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use fovea_tests::{device, plant::exchanged, scenes};
use glam::Vec3;
use naga::{
    AddressSpace, TypeInner,
    valid::{Capabilities, ValidationFlags, Validator},
};
use tracer::{
    distribution::Distribution,
    features::{Feature, SceneFeatures},
    film::FilmOptions,
    gpu::GeometryPlace,
    kernels::{
        Kernel, KernelConstants, KernelKey, ShaderSources, compose,
        layout::{StructLayout, codes, shared_layouts},
        pipelines::KernelError,
    },
    renderer::RenderError,
    view::DebugView,
};

/// SwiftShader has no more a stage.
const MOST_STORAGE_BUFFERS: usize = 10;

fn sources() -> Arc<ShaderSources> {
    Arc::new(ShaderSources::new(&device::inverse()))
}

fn key(kernel: Kernel, features: SceneFeatures, sources: &Arc<ShaderSources>) -> KernelKey {
    let constants = KernelConstants { stack_size: 16, environment_cells: [64, 32] };
    KernelKey { kernel, features, constants, sources: sources.clone() }
}

/// Two tables at one binding pass the parser, and no driver.
#[test]
fn what_a_driver_refuses_leaves_the_last_kernels() {
    let film = FilmOptions::equirect(16, 8);
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut room = scenes::Builder::new(Vec3::ONE);
    let grey = room.material(scenes::lambert(Vec3::splat(0.5)));
    room.quad(Vec3::new(-1.0, -1.0, -3.0), 2.0 * Vec3::X, 2.0 * Vec3::Y, grey);
    let mut renderer = device::independent(&device::gpu(), film, 1, 1, everywhere, &room.build());
    let faulty = exchanged(
        renderer.shaders(),
        "path_bindings",
        &[("@group(1) @binding(5) var<storage, read> materials", "@group(1) @binding(4) var<storage, read> materials")],
    );
    let error = renderer.set_shaders(faulty).unwrap_err();
    assert!(matches!(error, RenderError::Kernel(KernelError::Driver { .. })), "{error}");
    assert_eq!(device::trace(&mut renderer, 1 << 10).unwrap().header.samples(), 1 << 10);
}

/// What a module's header calls its twin is there.
#[test]
fn twins_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let modules = walk(&root.join("shaders"));
    let mut named = 0;
    for module in modules {
        let text = std::fs::read_to_string(&module).unwrap();
        for word in text.split(|c: char| c.is_whitespace() || "(),;".contains(c)) {
            let path = word.trim_end_matches('.');
            if path.contains("/src/") && path.ends_with(".rs") {
                assert!(root.join("crates").join(path).exists(), "{}: {path}", module.display());
                named += 1;
            }
        }
    }
    assert!(named > 30, "{named}");
}

fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}

/// None, each alone, each one left out, and all.
fn permutations() -> Vec<SceneFeatures> {
    let without =
        |left_out: Feature| -> SceneFeatures { Feature::ALL.iter().copied().filter(|&f| f != left_out).collect() };
    let mut sets = vec![SceneFeatures::default(), SceneFeatures::all()];
    sets.extend(Feature::ALL.iter().map(|&feature| SceneFeatures::default().with(feature, true)));
    sets.extend(Feature::ALL.iter().map(|&feature| without(feature)));
    // What the paper's scenes need.
    let room = SceneFeatures::default().with(Feature::Emission, true).with(Feature::Lights, true);
    let glazed = room.with(Feature::Transmission, true).with(Feature::Textures, true);
    let painted = room.with(Feature::Clearcoat, true).with(Feature::Specular, true).with(Feature::Transmission, true);
    let cloister = SceneFeatures::default()
        .with(Feature::Lights, true)
        .with(Feature::Textures, true)
        .with(Feature::NormalMaps, true)
        .with(Feature::Alpha, true);
    sets.extend([room, room.with(Feature::Textures, true), glazed, glazed.with(Feature::Instances, true), cloister]);
    sets.extend([painted, cloister.with(Feature::Specular, true), cloister.with(Feature::Clearcoat, true)]);
    sets.into_iter().map(closed).collect()
}

/// With what a feature never occurs without: see [`SceneFeatures::of`].
fn closed(mut features: SceneFeatures) -> SceneFeatures {
    for (feature, implied) in [
        (Feature::CoatedEmission, Feature::Clearcoat),
        (Feature::CoatedEmission, Feature::Emission),
        (Feature::EmissiveAlpha, Feature::Alpha),
        (Feature::EmissiveAlpha, Feature::Emission),
        (Feature::Emission, Feature::Lights),
        (Feature::ClearSheets, Feature::Transmission),
        (Feature::SunDiscs, Feature::Lights),
        (Feature::Dispersion, Feature::Solid),
        (Feature::Solid, Feature::Transmission),
        (Feature::Transmission, Feature::Specular),
        (Feature::Anisotropy, Feature::Specular),
        (Feature::Iridescence, Feature::Specular),
        (Feature::NormalMaps, Feature::Textures),
        (Feature::SpecularTextures, Feature::Textures),
    ] {
        features = features.with(implied, features.contains(feature));
    }
    features
}

fn parsed_and_valid(key: &KernelKey) -> naga::Module {
    let text = compose(key).unwrap();
    let module =
        naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{key}: {}", error.emit_to_string(&text)));
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    if let Err(error) = validator.validate(&module) {
        panic!("{key}: {}", error.emit_to_string(&text));
    }
    module
}

/// Compares a structure of a module with its twin on the host.
fn assert_same(module: &naga::Module, name: &str, inner: &TypeInner, twin: &StructLayout, label: &str) {
    let TypeInner::Struct { members, span } = inner else { panic!("{name} is no structure") };
    let of_shader: Vec<(String, usize)> =
        members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
    let of_host: Vec<(String, usize)> = twin
        .fields
        .iter()
        .filter(|(field, _)| !field.starts_with("pad"))
        .map(|(field, offset)| (field.to_string(), *offset))
        .collect();
    assert_eq!(of_shader, of_host, "{name} in {label}");
    assert_eq!(*span as usize, twin.size, "size of {name} in {label}");
    for (_, ty) in module.types.iter() {
        if let TypeInner::Array { base, stride, .. } = ty.inner
            && module.types[base].name.as_deref() == Some(name)
        {
            assert_eq!(stride as usize, twin.size, "stride of {name} in {label}");
        }
    }
}

#[test]
fn permutations_validate_and_structures_lie_as_on_the_host() {
    let _time = device::Stopwatch::start("composing and validating");
    let sources = sources();
    let twins = shared_layouts();
    let mut seen = BTreeSet::new();
    let (mut count, mut most_buffers) = (0, 0);
    for kernel in Kernel::ALL {
        for features in permutations() {
            // Only the path kernels look at the scene's features, and all at the film's; the gathering looks for guides.
            let scene_matters = kernel.reads_scene();
            let film_only = SceneFeatures::default().with(Feature::PerspectiveFilm, true);
            let guided_only = SceneFeatures::default().with(Feature::Guided, true);
            if !scene_matters && ![SceneFeatures::default(), film_only, guided_only].contains(&features) {
                continue;
            }
            let key = key(kernel, features, &sources);
            let module = parsed_and_valid(&key);
            count += 1;
            let is_storage = |variable: &naga::GlobalVariable| matches!(variable.space, AddressSpace::Storage { .. });
            let buffers = module.global_variables.iter().filter(|(_, variable)| is_storage(variable)).count();
            assert!(buffers <= MOST_STORAGE_BUFFERS, "{key} binds {buffers} storage buffers");
            most_buffers = most_buffers.max(buffers);
            for (_, ty) in module.types.iter() {
                let Some(name) = &ty.name else { continue };
                let own = name.rsplit('_').next().unwrap();
                if let Some(twin) = twins.iter().find(|twin| twin.name == own) {
                    assert_same(&module, name, &ty.inner, twin, &key.to_string());
                    seen.insert(twin.name);
                }
            }
        }
    }
    eprintln!("{count} kernels; at most {most_buffers} storage buffers");
    // Else the count would say nothing.
    assert_eq!(most_buffers, MOST_STORAGE_BUFFERS);
    let all: BTreeSet<_> = twins.iter().map(|twin| twin.name).collect();
    assert_eq!(seen, all, "some shared structure occurs in no kernel");
}

/// The comparison itself notices a moved, renamed or resized field.
#[test]
#[should_panic(expected = "BatchParams")]
fn a_shifted_field_is_noticed() {
    let sources = sources();
    let key = key(Kernel::Trace, SceneFeatures::default(), &sources);
    let module = parsed_and_valid(&key);
    let mut twin = shared_layouts().into_iter().find(|twin| twin.name == "BatchParams").unwrap();
    twin.fields.last_mut().unwrap().1 += 4;
    let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("package_types_BatchParams")).unwrap();
    assert_same(&module, "package_types_BatchParams", &ty.inner, &twin, "BatchParams");
}

/// `const NAME: u32 = value;` of a shader module.
fn constants(text: &str) -> Vec<(String, u32)> {
    text.lines()
        .filter_map(|line| {
            let (name, value) = line.strip_prefix("const ")?.split_once(": u32 = ")?;
            let value = value.trim_end_matches(';').trim_end_matches('u');
            let number = value.strip_prefix("0x").map_or_else(|| value.parse(), |hex| u32::from_str_radix(hex, 16));
            Some((name.to_string(), number.unwrap_or_else(|_| panic!("{name} is not a number: {value}"))))
        })
        .collect()
}

macro_rules! host {
    ($($name:ident,)*) => { vec![$((stringify!($name).to_string(), codes::$name),)*] };
}

#[test]
fn constants_are_those_of_the_host() {
    let sources = sources();
    let mut shader = constants(sources.module("types").unwrap());
    shader.extend(constants(sources.module("view::bindings").unwrap()));
    shader.extend(constants(sources.module("scene::traverse").unwrap()));
    let host = host![
        LAYER_FILM,
        LAYER_SPHERE,
        LAYER_IMAGE_PLANE,
        LAYER_PIXEL_LIST,
        LAYER_ACUITY,
        RAY_CLOSEST,
        RAY_ANY,
        NONE,
        INSTANCE_MIRRORED,
        INSTANCE_STATIC,
        TRIANGLE_ALPHA,
        MATERIAL_DOUBLE_SIDED,
        MATERIAL_ALPHA_MASK,
        MATERIAL_ALPHA_BLEND,
        MATERIAL_UNLIT,
        MATERIAL_SOLID,
        MATERIAL_CLEAR_SHEET,
        TEXTURE_LINEAR_FILTER,
        TEXTURE_UV1,
        WRAP_REPEAT,
        WRAP_MIRROR,
        WRAP_CLAMP,
        LIGHT_TRIANGLE,
        LIGHT_POINT,
        LIGHT_SPOT,
        LIGHT_DIRECTIONAL,
        VIEW_EQUIRECT,
    ];
    for (name, value) in &host {
        let twin = shader.iter().find(|(other, _)| other == name);
        assert_eq!(twin.map(|(_, v)| v), Some(value), "{name}");
    }
    for (name, view) in [
        ("DEBUG_SAMPLE_DENSITY", DebugView::SampleDensity),
        ("DEBUG_ERROR", DebugView::Error),
        ("DEBUG_STALE", DebugView::Stale),
        ("DEBUG_ALBEDO", DebugView::Albedo),
        ("DEBUG_NORMAL", DebugView::Normal),
        ("DEBUG_DEPTH", DebugView::Depth),
        ("DEBUG_TRAVERSAL_STEPS", DebugView::TraversalSteps),
    ] {
        let twin = shader.iter().find(|(other, _)| other == name);
        assert_eq!(twin.map(|(_, v)| *v), Some(view as u32), "{name}");
    }
    let of_types = constants(sources.module("types").unwrap());
    for (name, _) in of_types {
        assert!(host.iter().any(|(other, _)| *other == name), "{name} of types.wesl has no twin on the host");
    }
}

#[test]
fn a_diffuse_scene_has_a_kernel_without_lights_textures_and_lobes_that_it_lacks() {
    // Elsewhere the geometry may be in textures.
    let gpu = device::gpu().with_geometry_in(GeometryPlace::Buffers);
    let film = FilmOptions::equirect(16, 8);
    let distribution = Distribution::omnidirectional(device::inverse());
    let renderer = device::independent(&gpu, film, 1, 4, distribution, &scenes::empty(Vec3::ONE));
    let plain = compose(&renderer.key(Kernel::Trace)).unwrap();
    let full = compose(&key(Kernel::Trace, SceneFeatures::all(), &sources())).unwrap();
    // Each word must be in the kernel of everything, else its absence here would say nothing.
    for word in [
        "texture_2d",
        "texture_slots",
        "lights",
        "environment_image",
        "sample_light",
        "emitter_density",
        "is_transparent",
        "sample_color",
        "fresnel_dielectric",
        "world_from_mesh[",
        "power_heuristic",
        "lobe_tables",
        "sample_visible_normal",
    ] {
        // Mangled names escape their underscores by a count in front.
        assert!(full.contains(word), "the kernel of everything does not contain {word}");
        assert!(!plain.contains(word), "the kernel of a diffuse scene contains {word}");
    }
    let bindings = |text: &str| text.matches("@binding(").count();
    eprintln!(
        "diffuse: {} lines, {} bindings; everything: {} lines, {} bindings",
        plain.lines().count(),
        bindings(&plain),
        full.lines().count(),
        bindings(&full)
    );
    assert!(bindings(&plain) < bindings(&full));
    // The text says what is bound; a scene's features follow from its data, and one from the adapter.
    let of_adapter = SceneFeatures::default().with(Feature::DealtGroups, gpu.info().driver == "llvmpipe");
    assert_eq!(renderer.key(Kernel::Trace).features, of_adapter);
}

/// Each lobe is in the kernel when its flag is set, and only then.
#[test]
fn lobes_are_compiled_in_by_their_flags() {
    let sources = sources();
    for (feature, word) in [
        (Feature::Specular, "specular_fresnel"),
        (Feature::Clearcoat, "coat_of"),
        (Feature::Sheen, "charlie_value"),
        (Feature::Anisotropy, "is_tangent_needed"),
        (Feature::Iridescence, "fresnel_film"),
        (Feature::DiffuseTransmission, "diffuse_transmission_of"),
        (Feature::Transmission, "transmitted_delta"),
        (Feature::Solid, "refracted"),
        (Feature::ClearSheets, "sheet_transmittance"),
        (Feature::SunDiscs, "sun_discs_radiance"),
        (Feature::Absorption, "absorption * "),
        (Feature::Dispersion, "etas"),
    ] {
        let with =
            compose(&key(Kernel::Trace, closed(SceneFeatures::default().with(feature, true)), &sources)).unwrap();
        assert!(with.contains(word), "the kernel with {} lacks {word}", feature.name());
        let needs: Vec<Feature> = Feature::ALL
            .iter()
            .copied()
            .filter(|&other| !closed(SceneFeatures::default().with(other, true)).contains(feature))
            .filter(|&other| !(feature == Feature::Anisotropy && other == Feature::NormalMaps))
            .collect();
        let without = compose(&key(Kernel::Trace, needs.into_iter().collect(), &sources)).unwrap();
        assert!(!without.contains(word), "the kernel without {} contains {word}", feature.name());
    }
}
