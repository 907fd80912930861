//! What the window shows of a picture beside its colours: false colour, histogram, noise, what is stale, first hits. Each is
//! compared with what the host knows of the same film or scene.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_app::readback;
use fovea_tests::{device, plant, scenes};
use glam::{Quat, Vec2, Vec3};
use tracer::{
    builtin,
    distribution::{Distribution, View, film_direction},
    film::{FilmOptions, FilmPixel, FilmSnapshot},
    renderer::{FilmPose, Query, RayKind, Renderer},
    scene::Scene,
    view::{
        DebugView, Histogram, ToneMap, ViewProjection, ViewSettings,
        colors::{MIDDLE_GREY, STALE_COLOR, false_color, ramp},
        histogram::{HISTOGRAM_BINS, HISTOGRAM_BINS_PER_STOP},
    },
};

const FILM: FilmOptions = FilmOptions::equirect(64, 32);

/// The film's panorama, pixel by pixel.
fn as_it_is() -> ViewSettings {
    ViewSettings {
        projection: ViewProjection::Film,
        size: [FILM.width, FILM.height],
        exposure_ev: 0.0,
        tone_map: ToneMap::Linear,
        debug_view: DebugView::Beauty,
        fill: false,
        denoise: false,
        ring: None,
    }
}

fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Coloured light from eleven stops below middle grey to eleven above, and black in the first row.
fn stops(direction: Vec3) -> Vec3 {
    let turns = direction.x.atan2(-direction.z) / std::f32::consts::TAU;
    let tint = Vec3::new(1.0, 0.8, 0.5 + 0.4 * direction.y);
    tint / luminance(tint) * MIDDLE_GREY * (22.0 * turns).exp2()
}

fn painted_stops() -> Renderer {
    let first_row = film_direction(&FILM, 0, 0).y;
    device::painted(&device::gpu(), FILM, |direction, _| {
        Some(if direction.y >= first_row - 1e-6 { Vec3::ZERO } else { stops(direction) })
    })
}

/// A pyramid of one pixel is finished like any other.
#[test]
fn a_view_of_one_pixel_shows_the_mean() {
    let film = FilmOptions::perspective(1, 1, 0.5);
    let radiance = Vec3::new(0.25, 0.5, 0.75);
    let mut renderer = device::painted(&device::gpu(), film, |_, _| Some(radiance));
    for fill in [false, true] {
        readback::draw(&mut renderer, &ViewSettings { size: [1, 1], fill, ..as_it_is() }).unwrap();
        let (_, texels) = renderer.presented_radiance().unwrap();
        let shown = Vec3::new(texels[0][0], texels[0][1], texels[0][2]);
        assert!((shown - radiance).abs().max_element() < 1e-4, "{shown}");
    }
}

#[test]
fn false_colour_is_the_tables_colour_of_the_exposed_luminance() {
    let mut renderer = painted_stops();
    for exposure_ev in [0.0, 1.3, -4.0] {
        let settings = ViewSettings { exposure_ev, tone_map: ToneMap::FalseColor, ..as_it_is() };
        let picture = readback::draw(&mut renderer, &settings).unwrap();
        let (_, radiance) = renderer.presented_radiance().unwrap();
        let mut colors = std::collections::BTreeSet::new();
        for (texel, [r, g, b, _]) in picture.iter().zip(&radiance) {
            let exposed = luminance(Vec3::new(*r, *g, *b)) * exposure_ev.exp2();
            let stops = (exposed.max(1e-10) / MIDDLE_GREY).log2();
            // Between two bands either may come out.
            if ((stops + 0.5) - (stops + 0.5).round()).abs() > 1e-3 {
                assert_eq!(texel[..3], false_color(exposed), "{stops} stops");
                colors.insert(texel[..3].to_vec());
            }
        }
        assert!(colors.len() >= 11, "{exposure_ev} EV shows {} colours", colors.len());
    }
}

#[test]
fn the_histogram_counts_what_is_shown() {
    let mut renderer = painted_stops();
    assert_eq!(renderer.histogram(&as_it_is()).unwrap(), Histogram::default(), "nothing was presented");
    for (tone_map, exposure_ev) in [
        (ToneMap::AgX, 0.0),
        (ToneMap::PbrNeutral, 0.0),
        (ToneMap::Linear, 0.0),
        (ToneMap::Linear, -2.5),
        (ToneMap::AgX, 3.0),
    ] {
        let settings = ViewSettings { exposure_ev, tone_map, ..as_it_is() };
        let picture = readback::draw(&mut renderer, &settings).unwrap();
        let histogram = renderer.histogram(&settings).unwrap();
        let (_, radiance) = renderer.presented_radiance().unwrap();
        assert_eq!(histogram.pixels, FILM.pixels() as u32);
        assert_eq!(histogram.bins.iter().sum::<u32>(), histogram.pixels);
        let mut bins = [0_i64; HISTOGRAM_BINS];
        for [r, g, b, _] in &radiance {
            let exposed = luminance(Vec3::new(*r, *g, *b)) * exposure_ev.exp2();
            let stops = (exposed.max(1e-10) / MIDDLE_GREY).log2();
            let place = (stops * HISTOGRAM_BINS_PER_STOP as f32).floor() + (HISTOGRAM_BINS / 2) as f32;
            bins[place.clamp(0.0, (HISTOGRAM_BINS - 1) as f32) as usize] += 1;
        }
        // A pixel on the line between two bins may fall into either.
        let off: i64 = bins.iter().zip(histogram.bins).map(|(host, device)| (host - i64::from(device)).abs()).sum();
        assert!(off <= 16, "{off} of {} pixels are counted elsewhere", histogram.pixels);
        let count = |test: &dyn Fn(&[u8]) -> bool| picture.iter().filter(|texel| test(&texel[..3])).count() as i64;
        let black = count(&|rgb| rgb.iter().all(|channel| *channel == 0));
        let clipped = count(&|rgb| rgb.contains(&255));
        assert!(black >= i64::from(FILM.width), "the first row is black");
        assert!((black - i64::from(histogram.black)).abs() <= 4, "{tone_map:?}: {black} {}", histogram.black);
        assert!((clipped - i64::from(histogram.clipped)).abs() <= 4, "{tone_map:?}: {clipped} {}", histogram.clipped);
        if tone_map != ToneMap::PbrNeutral {
            assert!(clipped > 0, "{tone_map:?}");
        }
    }
    let linear = renderer.histogram(&as_it_is()).unwrap();
    let false_color = ViewSettings { tone_map: ToneMap::FalseColor, ..as_it_is() };
    assert_eq!(renderer.histogram(&false_color).unwrap(), linear);
    assert_eq!(Histogram::stops_at(HISTOGRAM_BINS / 2), 0.0);
}

/// A small film of the built-in scene at its camera.
fn room(film: FilmOptions) -> (Renderer, Scene) {
    let (scene, _) = builtin::scene().unwrap();
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut renderer = device::independent(&device::gpu(), film, 1, 1, everywhere, &scene);
    renderer.set_pose(FilmPose { position: scene.cameras[0].position, world_from_film: Quat::IDENTITY });
    (renderer, scene)
}

/// The ramp's colour of a value, or black where there is none.
fn colored(renderer: &Renderer, debug_view: DebugView, value: f64) -> [i16; 3] {
    let scale = renderer.debug_scale(debug_view).unwrap();
    if value > 0.0 { ramp(scale.place(value as f32)).map(i16::from) } else { [0; 3] }
}

fn is_near(texel: [u8; 4], expected: [i16; 3], levels: i16) -> bool {
    texel.iter().zip(expected).all(|(shown, wanted)| (i16::from(*shown) - wanted).abs() <= levels)
}

/// Pixels of a picture of noise that are not what the film's pixels say, `side` by `side` of them in a pixel of the view.
fn wrong_noise(renderer: &mut Renderer, film: &FilmSnapshot, side: u32) -> usize {
    let size = [FILM.width / side, FILM.height / side];
    let settings = ViewSettings { debug_view: DebugView::Error, size, ..as_it_is() };
    let picture = readback::draw(renderer, &settings).unwrap();
    let pixels: Vec<_> = film.pixels().collect();
    let is_wrong = |(index, texel): &(u32, &[u8; 4])| {
        let (x, y) = (side * (index % size[0]), side * (index / size[0]));
        let block = || (0..side * side).map(|i| &pixels[((y + i / side) * FILM.width + x + i % side) as usize]);
        let known = || block().filter(|pixel| pixel.samples >= 2);
        let mean = |value: &dyn Fn(&FilmPixel) -> f64| known().map(value).sum::<f64>() / known().count().max(1) as f64;
        let error = mean(&|pixel| pixel.variance_of_mean).sqrt() / mean(&FilmPixel::luminance).max(1e-300);
        !is_near(**texel, colored(renderer, DebugView::Error, error), 1)
    };
    (0..).zip(&picture).filter(is_wrong).count()
}

#[test]
fn noise_is_the_standard_error_of_the_films_pixels() {
    let (mut renderer, _) = room(FILM);
    let film = device::trace(&mut renderer, 20 * FILM.pixels()).unwrap();
    for side in [1, 2] {
        let pixels = (FILM.width * FILM.height / (side * side)) as usize;
        let wrong = wrong_noise(&mut renderer, &film, side);
        assert!(wrong * 50 <= pixels, "{wrong} of {pixels} pixels have another noise");
    }
    // A wrong number of degrees of freedom is noticed.
    let faulty = plant::exchanged(renderer.shaders(), "view::error", &[("(samples - 1.0)", "samples")]);
    renderer.set_shaders(faulty).unwrap();
    let wrong = wrong_noise(&mut renderer, &film, 1);
    assert!(wrong * 10 > FILM.pixels() as usize, "the fault is noticed in {wrong} pixels alone");
}

#[test]
fn what_is_stale_is_marked_until_new_samples_cover_it() {
    let (mut renderer, _) = room(FILM);
    let view = View { world_from_view: Quat::IDENTITY, half_extent: Vec2::splat(0.8) };
    let settings = ViewSettings {
        projection: ViewProjection::Perspective(view),
        size: [24, 24],
        fill: true,
        denoise: false,
        debug_view: DebugView::Stale,
        ..as_it_is()
    };
    let is_grey = |texel: &[u8; 4]| texel[0].abs_diff(texel[1]) <= 2 && texel[1].abs_diff(texel[2]) <= 2;
    device::trace(&mut renderer, 64 * FILM.pixels()).unwrap();
    let before = readback::draw(&mut renderer, &settings).unwrap();
    assert!(before.iter().all(is_grey), "nothing has changed yet");

    renderer.restart();
    let restarted = readback::draw(&mut renderer, &settings).unwrap();
    for (texel, grey) in restarted.iter().zip(&before) {
        let expected = [0, 1, 2].map(|c| (0.2 * f32::from(grey[c]) + 0.8 * f32::from(STALE_COLOR[c])).round() as i16);
        assert!(
            is_near(*texel, expected, 3),
            "{texel:?} instead of {expected:?}: all is stale, and shows what was there"
        );
    }
    let (_, shares) = renderer.presented_radiance().unwrap();
    assert!(shares.iter().all(|pixel| pixel[3] > 0.999), "all is stale");

    // Samples about the gaze alone: what lies there is new first.
    let towards = |yaw: f32| Quat::from_rotation_y(-yaw);
    let narrow = View { world_from_view: towards(0.4), half_extent: Vec2::splat(0.2) };
    renderer.set_distribution(Distribution::viewport(narrow, device::inverse())).unwrap();
    device::trace(&mut renderer, 1 << 12).unwrap();
    readback::draw(&mut renderer, &settings).unwrap();
    let (_, shares) = renderer.presented_radiance().unwrap();
    let share_at = |direction: Vec3| {
        let point = view.project(direction).unwrap();
        let [x, y] = [0.5 + 0.5 * point.x, 0.5 - 0.5 * point.y].map(|t| (t * 24.0) as usize);
        shares[y * 24 + x][3]
    };
    let (new, old) = (share_at(towards(0.4) * Vec3::NEG_Z), share_at(towards(-0.5) * Vec3::NEG_Z));
    assert!(new < 0.02 && old > 0.5, "stale: {new} at the gaze, {old} far from it");

    renderer.set_distribution(Distribution::omnidirectional(device::inverse())).unwrap();
    device::trace(&mut renderer, 200 * FILM.pixels()).unwrap();
    assert!(readback::draw(&mut renderer, &settings).unwrap().iter().all(is_grey), "all is new");
    let beauty = ViewSettings { debug_view: DebugView::Beauty, ..settings };
    readback::draw(&mut renderer, &beauty).unwrap();
    let (_, weights) = renderer.presented_radiance().unwrap();
    assert!(weights.iter().all(|pixel| pixel[3] > 50.0), "the picture's fourth value is its samples");
}

/// Position, normal on the side of the ray, and base colour where no texture or vertex colour has a part in it.
fn hit_on_host(scene: &Scene, ray: &Query, instance: u32, triangle: u32, t: f32) -> (Vec3, Option<Vec3>) {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let material = &scene.materials[instance.material as usize];
    let corners = mesh.triangles[triangle as usize].map(|index| index as usize);
    let [a, b, c] = corners.map(|index| instance.world_from_mesh.transform_point3(mesh.positions[index]));
    let hit = ray.origin + ray.direction * t;
    let whole = (b - a).cross(c - a);
    let weight = |from: Vec3, to: Vec3| (to - from).cross(hit - from).dot(whole) / whole.length_squared();
    let (u, v) = (weight(c, a), weight(a, b));
    let [na, nb, nc] = corners.map(|index| mesh.normals[index]);
    let in_mesh = na * (1.0 - u - v) + nb * u + nc * v;
    let normal = (glam::Mat3::from(instance.world_from_mesh.matrix3).inverse().transpose() * in_mesh).normalize();
    let geometric = whole * if instance.world_from_mesh.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
    let is_back = geometric.dot(ray.direction) > 0.0;
    let plain = material.base_color_texture.is_none() && mesh.colors.is_empty();
    (if is_back { -normal } else { normal }, plain.then(|| material.base_color.truncate()))
}

#[test]
fn first_hits_are_those_of_single_rays() {
    let (mut renderer, scene) = room(FILM);
    let camera = &scene.cameras[0];
    let (width, height) = (48, 40);
    let view = View { world_from_view: camera.rotation, half_extent: Vec2::new(0.9, 0.75) };
    let debug = |debug_view| ViewSettings {
        projection: ViewProjection::Perspective(view),
        size: [width, height],
        debug_view,
        ..as_it_is()
    };
    let settings = debug(DebugView::Normal);
    // In bands: seven rows at a time.
    let mut bands = 1;
    while !renderer.trace_first_hits(&settings, 7 * width + 3).unwrap() {
        assert_eq!(renderer.first_hits().unwrap().len() as u32, 7 * width * bands);
        bands += 1;
    }
    assert_eq!(bands, 6);
    let hits = renderer.first_hits().unwrap();
    let rays: Vec<Query> = (0..width * height)
        .map(|index| {
            let uv = Vec2::new((index % width) as f32 + 0.5, (index / width) as f32 + 0.5)
                / Vec2::new(width as f32, height as f32);
            let point = Vec2::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y);
            Query { origin: camera.position, direction: view.direction(point), t_max: 1e30, kind: RayKind::Closest }
        })
        .collect();
    let (answers, _) = renderer.query(&rays).unwrap();
    let (mut same, mut plain) = (0, 0);
    for ((hit, answer), ray) in hits.iter().zip(&answers).zip(&rays) {
        assert!(hit.steps > 0);
        let Some(answer) = answer else {
            same += usize::from(hit.depth == 0.0 && hit.world_normal() == Vec3::ZERO && hit.albedo == [0.0; 3]);
            continue;
        };
        let (normal, albedo) = hit_on_host(&scene, ray, answer.instance, answer.triangle, answer.t);
        let is_same = (hit.depth - answer.t).abs() <= 1e-4 * answer.t && hit.world_normal().distance(normal) < 0.01;
        let is_colored = albedo.is_none_or(|albedo| Vec3::from(hit.albedo).distance(albedo) < 1e-5);
        same += usize::from(is_same && is_colored);
        plain += usize::from(albedo.is_some());
    }
    // A ray along an edge may find either side.
    assert!(same * 200 >= hits.len() * 199, "{same} of {} first hits are those of single rays", hits.len());
    assert!(plain > 100, "{plain} pixels of known base colour");
    eprintln!("{same} of {} first hits agree, {plain} with a known base colour", hits.len());

    // Shown as colours.
    let to_levels = |value: f32| (255.0 * value.clamp(0.0, 1.0)).round() as i16;
    let picture = readback::draw(&mut renderer, &settings).unwrap();
    for (texel, hit) in picture.iter().zip(&hits) {
        let expected =
            if hit.depth > 0.0 { hit.world_normal().to_array().map(|n| to_levels(0.5 + 0.5 * n)) } else { [0; 3] };
        assert!(is_near(*texel, expected, 1), "{texel:?} {hit:?}");
    }
    let depths = || hits.iter().map(|hit| hit.depth).filter(|depth| *depth > 0.0);
    let scale = renderer.debug_scale(DebugView::Depth).unwrap();
    assert_eq!((scale.low, scale.high), (depths().fold(f32::MAX, f32::min), depths().fold(0.0, f32::max)));
    for shown in [DebugView::Depth, DebugView::TraversalSteps] {
        let picture = readback::draw(&mut renderer, &debug(shown)).unwrap();
        for (texel, hit) in picture.iter().zip(&hits) {
            let value = if shown == DebugView::Depth { hit.depth } else { hit.steps as f32 };
            assert!(is_near(*texel, colored(&renderer, shown, value.into()), 2), "{shown:?}: {texel:?} {hit:?}");
        }
    }

    // Another scene, place or view begins anew; the picture needs none.
    let mut moved = scene.clone();
    moved.instances[answers.iter().flatten().next().unwrap().instance as usize].visible = false;
    renderer.set_scene(&moved).unwrap();
    assert!(!renderer.trace_first_hits(&settings, width).unwrap());
    assert_eq!(renderer.first_hits().unwrap().len() as u32, width);
    readback::draw(&mut renderer, &debug(DebugView::Beauty)).unwrap();
    assert!(renderer.first_hits().unwrap().is_empty());
}

/// The panorama as it is, and a leaf with holes: a ray goes on behind what is transparent.
#[test]
fn first_hits_pass_by_what_is_transparent() {
    let mut scene = scenes::Builder::new(Vec3::ONE);
    let leaf = tracer::scene::Material {
        alpha_mode: tracer::scene::AlphaMode::Mask { cutoff: 0.5 },
        base_color: Vec3::new(1.0, 0.0, 0.0).extend(0.2),
        ..scenes::lambert(Vec3::X)
    };
    let (leaf, wall) = (scene.material(leaf), scene.material(scenes::lambert(Vec3::new(0.25, 0.5, 0.75))));
    for (material, distance) in [(leaf, 1.0), (wall, 3.0)] {
        scene.quad(Vec3::new(-9.0, -9.0, -distance), 18.0 * Vec3::X, 18.0 * Vec3::Y, material);
    }
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut renderer = device::independent(&device::gpu(), FILM, 1, 1, everywhere, &scene.build());
    assert!(renderer.trace_first_hits(&as_it_is(), u32::MAX).unwrap());
    let hits = renderer.first_hits().unwrap();
    let (middle, behind) = (hits[(16 * FILM.width + 32) as usize], hits[(16 * FILM.width) as usize]);
    let ahead = film_direction(&FILM, 32, 16);
    assert!((middle.depth - 3.0 / -ahead.z).abs() < 1e-3, "{middle:?}");
    assert_eq!((middle.albedo, behind.depth), ([0.25, 0.5, 0.75], 0.0));
}

#[test]
fn two_films_of_one_scene_share_it_and_do_not_touch_each_other() {
    let (mut first, mut scene) = room(FILM);
    let everywhere = || Distribution::omnidirectional(device::inverse());
    let mut second = first.beside(everywhere()).unwrap();
    assert_eq!((second.pose(), second.options()), (first.pose(), first.options()));
    let samples = 4 * FILM.pixels();
    let of_second = device::trace(&mut second, samples).unwrap();
    assert_eq!(first.samples(), 0);
    let of_first = device::trace(&mut first, samples).unwrap();
    assert_eq!(of_second, of_first, "the same picture, bit by bit");

    // An edit of the first's scene becomes the second's by sharing.
    scene.environment = tracer::scene::Environment::Constant(Vec3::new(0.5, 1.0, 2.0));
    first.set_scene(&scene).unwrap();
    second.share_scene_of(&first).unwrap();
    let edited = device::trace(&mut first, samples).unwrap();
    assert_eq!(device::trace(&mut second, samples).unwrap(), edited);
    assert_ne!(edited.words, of_first.words);
}
