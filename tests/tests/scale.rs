//! Geometry in texture pages against the same in storage buffers, scenes of many instances, and what is too large.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_app::readback;
use fovea_tests::{
    device,
    plant::exchanged,
    scenes::{Builder, emitter, lambert},
};
use glam::{Affine3A, Vec2, Vec3};
use tracer::{
    distribution::Distribution,
    features::Feature,
    film::FilmOptions,
    gpu::{GeometryPlace, Gpu},
    kernels::Kernel,
    renderer::{Query, RayKind, Renderer, RendererOptions},
    scene::{AlphaMode, Material, Scene, TexelEncoding},
    view::{DebugView, ToneMap, ViewProjection, ViewSettings},
};

const FILM: FilmOptions = FilmOptions::equirect(64, 32);

fn renderer(gpu: Gpu, place: GeometryPlace, scene: &Scene) -> Renderer {
    let options = RendererOptions { film: FILM, ..Default::default() };
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut renderer = Renderer::new(&gpu.with_geometry_in(place), &options, everywhere).unwrap();
    renderer.set_scene(scene).unwrap();
    let in_textures = renderer.key(Kernel::Trace).features.contains(Feature::GeometryTextures);
    assert_eq!(in_textures, place == GeometryPlace::Textures);
    renderer
}

/// Spheres that are placed often, a floor with a hole by alpha, textured light: everything that reads the tables.
fn all_sorts() -> Scene {
    let mut scene = Builder::new(Vec3::splat(0.2));
    let texels = vec![[255, 255, 255, 255], [40, 90, 200, 10], [90, 200, 40, 10], [255, 255, 255, 255]];
    let pattern = scene.texture(2, TexelEncoding::Srgb, texels);
    let white = scene.material(lambert(Vec3::splat(0.7)));
    let mirror = scene.material(Material { metallic: 1.0, roughness: 0.2, ..Default::default() });
    let holed = Material { base_color_texture: Some(pattern), ..lambert(Vec3::ONE) };
    let holed = scene.material(Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, double_sided: true, ..holed });
    let shining = Material { emission: Vec3::splat(4.0), emissive_texture: Some(pattern), ..lambert(Vec3::ONE) };
    let shining = scene.material(shining);
    let [a, b, c] = [Vec3::new(-1.0, 3.0, -1.0), Vec3::new(1.0, 3.0, -1.0), Vec3::new(0.0, 3.0, 1.0)];
    let lamp = scene.triangles(&[[a, b, c]], &[[Vec2::ZERO, Vec2::X, Vec2::Y]]);
    scene.place(lamp, shining, Affine3A::IDENTITY);
    scene.quad(Vec3::new(-4.0, -1.5, 4.0), Vec3::X * 8.0, Vec3::NEG_Z * 8.0, holed);
    let smooth = scene.sphere(60);
    let faceted = scene.faceted_sphere(8);
    for i in 0..6 {
        let turns = i as f32 / 6.0;
        let (sin, cos) = (turns * std::f32::consts::TAU).sin_cos();
        let at = Affine3A::from_translation(Vec3::new(2.5 * sin, 0.3 * sin, 2.5 * cos));
        scene.place(smooth, if i % 2 == 0 { white } else { mirror }, at);
        scene.place(faceted, white, Affine3A::from_translation(Vec3::Y * -0.5) * at);
    }
    scene.build()
}

/// The film's words after a few samples a pixel, and again after an instance was moved.
fn films(place: GeometryPlace, fault: Option<(&str, &str)>) -> [Vec<u32>; 2] {
    let mut scene = all_sorts();
    let mut renderer = renderer(device::gpu(), place, &scene);
    if let Some(exchange) = fault {
        let faulty = exchanged(renderer.shaders(), "scene::tables", &[exchange]);
        renderer.set_shaders(faulty).unwrap();
    }
    assert!(renderer.key(Kernel::Trace).features.contains(Feature::Instances));
    let before = device::trace(&mut renderer, 4 * FILM.pixels()).unwrap().words;
    let moved = scene.instances.last_mut().unwrap();
    moved.world_from_mesh = Affine3A::from_translation(Vec3::Y * 0.7) * moved.world_from_mesh;
    renderer.set_scene(&scene).unwrap();
    [before, device::trace(&mut renderer, 4 * FILM.pixels()).unwrap().words]
}

#[test]
fn films_do_not_depend_on_where_the_geometry_is() {
    let expected = films(GeometryPlace::Buffers, None);
    assert!(expected[0] != expected[1], "the move is not seen");
    assert!(films(GeometryPlace::Textures, None) == expected);
    // The comparison notices a word that is read in the wrong place, whichever table it is of.
    for fault in [
        ("textureLoad(nodes, at.xy", "textureLoad(nodes, at.xy ^ vec2u(1u, 0u)"),
        ("texel_address(3u * triangle + index)", "texel_address(3u * triangle + (index & 1u))"),
        ("textureLoad(triangles, at.xy", "textureLoad(triangles, vec2u(at.x & 0x3ffu, at.y)"),
        ("vertex_words(vertex, 0u).xy;", "vertex_words(vertex, 1u).xy;"),
        ("vertex_words(vertex, 0u).zw,", "vertex_words(vertex, 0u).wz,"),
        ("vertex_words(vertex, 2u).x", "(vertex_words(vertex, 2u).x ^ 1u)"),
    ] {
        assert!(films(GeometryPlace::Textures, Some(fault)) != expected, "{fault:?} is not noticed");
    }
}

/// More texels than one page has: every ray meets the triangle of a plane that it aims at, on every page.
#[test]
fn triangles_on_later_pages_are_met() {
    const SIDE: u32 = 920;
    let corner = |x: u32, z: u32| Vec3::new(x as f32, 0.0, z as f32);
    let cells = (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE));
    let triangles: Vec<[Vec3; 3]> = cells
        .flat_map(|(x, z)| {
            let [a, b, c, d] = [corner(x, z), corner(x, z + 1), corner(x + 1, z + 1), corner(x + 1, z)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let count = triangles.len() as u32;
    assert!(3 * u64::from(count) > 1 << 22, "positions fit one page");
    let mut scene = Builder::new(Vec3::ONE);
    let grey = scene.material(lambert(Vec3::splat(0.5)));
    let plane = scene.triangles(&triangles, &[]);
    scene.place(plane, grey, Affine3A::IDENTITY);
    let mut scene = scene.build();
    let mut renderer = renderer(device::gpu(), GeometryPlace::Textures, &scene);
    let aimed: Vec<u32> = (0..count).step_by(97).collect();
    let rays: Vec<Query> = aimed
        .iter()
        .map(|&i| {
            let middle = triangles[i as usize].iter().sum::<Vec3>() / 3.0;
            Query { origin: middle + Vec3::Y, direction: Vec3::NEG_Y, t_max: 2.0, kind: RayKind::Closest }
        })
        .collect();
    let wrong = |renderer: &mut Renderer| {
        let (answers, _) = renderer.query(&rays).unwrap();
        answers.iter().zip(&aimed).filter(|(answer, aimed)| answer.map(|a| a.triangle) != Some(**aimed)).count()
    };
    assert_eq!(wrong(&mut renderer), 0, "of {}", rays.len());
    // As many lights are more than some adapters bind: refused with the figures, and the scene from before stays.
    let (needed, limit) = (u64::from(count) * 80, renderer.gpu().largest_binding());
    scene.materials[0] = Arc::new(emitter(Vec3::ONE));
    match renderer.set_scene(&scene) {
        Ok(_) => assert!(needed <= limit),
        Err(error) => {
            let message = error.to_string();
            assert!(needed > limit && [needed, limit].iter().all(|n| message.contains(&n.to_string())), "{message}");
        }
    }
    assert_eq!(wrong(&mut renderer), 0, "of {}", rays.len());
    let one_page = ("index >> (2u * TEXEL_PAGE_BITS))", "0u)");
    renderer.set_shaders(exchanged(renderer.shaders(), "scene::tables", &[one_page])).unwrap();
    assert!(wrong(&mut renderer) > 0, "a lost page is not noticed");
}

#[test]
fn a_film_that_memory_cannot_hold_is_refused_with_the_figures() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(65_535, 65_535);
    if gpu.free_memory().is_none_or(|free| free >= film.bytes()) {
        eprintln!(
            "SKIP a_film_that_memory_cannot_hold_is_refused_with_the_figures: the adapter has memory for every film"
        );
        return;
    }
    let options = RendererOptions { film, ..Default::default() };
    let error =
        Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap_err().to_string();
    assert!(error.contains(&film.bytes().to_string()) && error.contains("bytes are free"), "{error}");
}

/// A binding holds the finest level of the largest view; the others lie beside it.
#[test]
fn a_view_as_large_as_a_binding_is_shown_and_larger_ones_are_refused() {
    let gpu = device::gpu();
    let mut renderer = device::painted(&gpu, FILM, |_, _| Some(Vec3::splat(0.25)));
    let height = (gpu.largest_binding() / 16 / 4096).min(2048) as u32;
    let view = |size, debug_view| ViewSettings {
        projection: ViewProjection::Film,
        size,
        exposure_ev: 0.0,
        tone_map: ToneMap::Linear,
        debug_view,
        fill: true,
        denoise: true,
        ring: None,
    };
    let texels = readback::draw(&mut renderer, &view([4096, height], DebugView::Beauty)).unwrap();
    let grey = texels[0][0];
    assert!(grey.abs_diff(137) <= 1, "0.25 is 137 in sRGB, not {grey}");
    assert!(texels.iter().all(|texel| texel[..3] == [grey; 3]));
    let limit = gpu.largest_binding();
    let refused = |renderer: &mut Renderer, size, debug_view| {
        let error = readback::draw(renderer, &view(size, debug_view)).unwrap_err().to_string();
        assert!(error.contains("pixels binds") && error.contains(&limit.to_string()), "{error}");
    };
    // Where the limit is that of a software adapter; graphics cards bind whatever a texture's sides allow.
    if limit <= 1 << 27 {
        refused(&mut renderer, [4096, height + 1], DebugView::Beauty);
        refused(&mut renderer, [4096, height], DebugView::Depth);
    }
}

/// A square of small spheres seen from above: each ray meets the instance that it aims at.
#[test]
fn each_of_many_instances_is_met() {
    const SIDE: u32 = 64;
    let mut scene = Builder::new(Vec3::ONE);
    let grey = scene.material(lambert(Vec3::splat(0.5)));
    let shining = scene.material(Material { emission: Vec3::ONE, ..lambert(Vec3::ZERO) });
    let sphere = scene.sphere(6);
    let place = |i: u32| Vec3::new((i % SIDE) as f32, 0.1 * (i % 7) as f32, (i / SIDE) as f32);
    for i in 0..SIDE * SIDE {
        let size = Vec3::splat(0.3 + 0.1 * (i % 3) as f32);
        let at = Affine3A::from_scale(size) * Affine3A::IDENTITY;
        scene.place(sphere, if i % 100 == 0 { shining } else { grey }, Affine3A::from_translation(place(i)) * at);
    }
    let mut renderer = renderer_of_instances(&scene.build());
    let rays: Vec<Query> = (0..SIDE * SIDE)
        .map(|i| Query {
            origin: place(i) + Vec3::new(0.05, 5.0, 0.02),
            direction: Vec3::NEG_Y,
            t_max: 10.0,
            kind: RayKind::Closest,
        })
        .collect();
    let (answers, _) = renderer.query(&rays).unwrap();
    let met: Vec<Option<u32>> = answers.iter().map(|answer| answer.map(|a| a.instance)).collect();
    let aimed: Vec<Option<u32>> = (0..SIDE * SIDE).map(Some).collect();
    assert_eq!(met, aimed);
}

/// Also checks that each shining instance has its triangles in the light table.
fn renderer_of_instances(scene: &Scene) -> Renderer {
    let options = RendererOptions { film: FILM, ..Default::default() };
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut renderer = Renderer::new(&device::gpu(), &options, everywhere).unwrap();
    let report = renderer.set_scene(scene).unwrap();
    let lights = scene.instances.len().div_ceil(100) * scene.meshes[0].triangles.len();
    assert_eq!(report.upload.lights as usize, lights);
    assert_eq!(report.upload.triangles as usize, scene.meshes[0].triangles.len(), "the mesh is there once");
    renderer
}
