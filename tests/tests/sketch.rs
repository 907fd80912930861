//! The sketch of a scene before it can be traced: its colours against spheres in closed form, and that nothing of it stays.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_app::readback::{PICTURE_FORMAT, picture_texture, read_texture};
use fovea_tests::{device, plant, scenes};
use glam::{Affine3A, Quat, Vec2, Vec3};
use tracer::{
    distribution::{Distribution, View},
    film::FilmOptions,
    renderer::{Renderer, RendererOptions},
    scene::{Material, Scene, TexelEncoding},
    view::{DebugView, ToneMap, ViewProjection, ViewSettings},
};

const SIDE: u32 = 96;
const RADIUS: f32 = 1.0;
/// A plain sphere, and one whose texture is half red and half blue.
const CENTRES: [Vec3; 2] = [Vec3::new(-1.3, 0.2, -4.0), Vec3::new(1.3, -0.4, -4.5)];
const PLAIN: Vec3 = Vec3::new(0.6, 0.3, 0.1);
const MEAN_OF_TEXTURE: Vec3 = Vec3::new(0.5, 0.0, 0.5);
/// As in `shaders/view/sketch.wesl`.
const EDGE: f32 = 0.2;
const BACKGROUND: f32 = 0.05;

/// With `rings` = 200 the spheres have too many triangles to be copied, and keep a hierarchy of their own under an upper level.
fn spheres(rings: u32) -> Scene {
    let mut builder = scenes::Builder::new(Vec3::ONE);
    let plain = builder.material(scenes::lambert(PLAIN));
    let texels = vec![[255, 0, 0, 255], [0, 0, 255, 255]];
    let texture = Some(builder.texture(2, TexelEncoding::Srgb, texels));
    let painted = builder.material(Material { base_color_texture: texture, ..scenes::lambert(Vec3::ONE) });
    let sphere = builder.sphere(rings);
    for (centre, material) in CENTRES.into_iter().zip([plain, painted]) {
        builder.place(sphere, material, Affine3A::from_translation(centre));
    }
    builder.build()
}

fn settings() -> ViewSettings {
    let view = View { world_from_view: Quat::IDENTITY, half_extent: Vec2::ONE };
    ViewSettings {
        projection: ViewProjection::Perspective(view),
        size: [SIDE; 2],
        // Neither counts for a sketch.
        exposure_ev: 5.0,
        tone_map: ToneMap::AgX,
        debug_view: DebugView::Beauty,
        fill: true,
        denoise: true,
        ring: None,
    }
}

fn renderer() -> Renderer {
    let options = RendererOptions { film: FilmOptions::equirect(64, 32), ..Default::default() };
    Renderer::new(&device::gpu(), &options, Distribution::omnidirectional(device::inverse())).unwrap()
}

fn sketched(renderer: &mut Renderer, scene: &Scene) -> Vec<[u8; 4]> {
    let gpu = renderer.gpu().clone();
    let texture = picture_texture(&gpu, [SIDE; 2]);
    renderer.sketch(scene, &settings(), &texture.create_view(&Default::default()), PICTURE_FORMAT).unwrap();
    read_texture(&gpu, &texture).unwrap()
}

/// Linear colour of a pixel; `None` within a hundredth of a radius of an outline.
fn expected(x: u32, y: u32) -> Option<Vec3> {
    let at = (Vec2::new(x as f32, y as f32) + 0.5) / SIDE as f32 * 2.0 - 1.0;
    let direction = Vec3::new(at.x, -at.y, -1.0).normalize();
    for (centre, color) in CENTRES.into_iter().zip([PLAIN, MEAN_OF_TEXTURE]) {
        let along = centre.dot(direction);
        let miss = (centre - along * direction).length() / RADIUS;
        if (miss - 1.0).abs() < 0.01 {
            return None;
        }
        if miss < 1.0 {
            let facing = (1.0 - miss * miss).sqrt();
            return Some(color * (EDGE + (1.0 - EDGE) * facing));
        }
    }
    Some(Vec3::splat(BACKGROUND))
}

/// Largest difference in any channel of any pixel, of 255, and pixels of the spheres that were compared.
fn error(picture: &[[u8; 4]]) -> (f32, usize) {
    let encode = |linear: f32| {
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    };
    let (mut most, mut on_spheres) = (0.0f32, 0);
    for (index, texel) in picture.iter().enumerate() {
        let Some(color) = expected(index as u32 % SIDE, index as u32 / SIDE) else { continue };
        on_spheres += usize::from(color != Vec3::splat(BACKGROUND));
        for (channel, linear) in color.to_array().into_iter().enumerate() {
            most = most.max((f32::from(texel[channel]) - 255.0 * encode(linear)).abs());
        }
    }
    (most, on_spheres)
}

#[test]
fn a_sketch_has_the_mean_colours_darker_where_surfaces_turn_away() {
    for rings in [60, 200] {
        let (error, compared) = error(&sketched(&mut renderer(), &spheres(rings)));
        eprintln!("{rings} rings: at most {error:.2} of 255 off at {compared} pixels");
        // Facets are flat: at 60 rings their normals are up to 1.5 degrees off.
        assert!(compared > 700 && error < if rings < 100 { 5.0 } else { 2.0 }, "{rings} rings: {error}");
    }
    let mut faulty = renderer();
    let fault = plant::exchanged(faulty.shaders(), "view::sketch", &[("mix(EDGE, 1.0, facing)", "1.0")]);
    faulty.set_shaders(fault).unwrap();
    assert!(error(&sketched(&mut faulty, &spheres(200))).0 > 50.0);
}

#[test]
fn what_is_traced_after_a_sketch_is_what_is_traced_without_one() {
    for rings in [60, 200] {
        let scene = spheres(rings);
        let mut plain = renderer();
        let of_plain = plain.set_scene(&scene).unwrap().upload;
        let mut after = renderer();
        sketched(&mut after, &scene);
        let of_after = after.set_scene(&scene).unwrap().upload;
        assert_eq!(of_plain.device_bytes, of_after.device_bytes);
        assert!(of_after.uploaded_bytes + of_after.geometry_bytes / 2 < of_plain.uploaded_bytes, "{of_after:?}");
        let films = [&mut plain, &mut after].map(|renderer| device::trace(renderer, 1 << 13).unwrap());
        assert!(films[0].words == films[1].words && films[0].pixels().any(|pixel| pixel.samples > 0));
    }
}

/// The sketch of another version is not written into the tables of the scene that is traced.
#[test]
fn a_sketch_beside_a_scene_leaves_it_as_it_is() {
    let mut builder = scenes::Builder::new(Vec3::ONE);
    let plain = builder.material(scenes::lambert(PLAIN));
    // The smaller one finds room in the tables when it moves.
    for (rings, centre) in [60, 8].into_iter().zip(CENTRES) {
        let sphere = builder.sphere(rings);
        builder.place(sphere, plain, Affine3A::from_translation(centre));
    }
    let scene = builder.build();
    let mut moved = scene.clone();
    moved.instances[1].world_from_mesh.translation.y += 1.0;
    let film = |sketched_first: &[&Scene]| {
        let mut renderer = renderer();
        renderer.set_scene(&scene).unwrap();
        let sketches: Vec<_> = sketched_first.iter().map(|scene| sketched(&mut renderer, scene)).collect();
        assert!(sketches.windows(2).all(|pair| pair[0] != pair[1]), "the move is not to be seen");
        device::trace(&mut renderer, 1 << 13).unwrap().words
    };
    assert!(film(&[]) == film(&[&scene, &moved]));
}
