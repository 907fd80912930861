//! Radiance that is known in closed form, each within 3 standard errors (plus f32's rounding) at fixed seeds, with standard
//! errors of at most 0.5 %. Right values fail one of these checks with probability 0.3 %; the seeds make that a fact, once.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f64::consts::PI;

use fovea_tests::{
    device,
    known::{
        COMPARED_SAMPLES, ROUNDING, SAMPLES, assert_is, assert_techniques_agree, corner_form_factor, floor, measure,
        measure_by,
    },
    scenes::{Builder, emitter, even_image, image, lambert},
};
use glam::{Affine3A, DVec3, Quat, Vec3};
use tracer::{
    distribution::{Distribution, Gaze},
    film::FilmOptions,
    renderer::{FilmPose, Renderer, RendererOptions, SamplingTechnique},
    scene::{AlphaMode, Backdrop, Material, PunctualKind, PunctualLight, Scene, TexelEncoding},
};

/// White surfaces in an environment of 1 are 1, convex or concave.
#[test]
fn white_furnace() {
    let gpu = device::gpu();
    for concave in [false, true] {
        let mut builder = Builder::new(Vec3::ONE);
        let white = builder.material(lambert(Vec3::ONE));
        if concave {
            // An open box seen from above.
            let (x, y, z) = (Vec3::X * 2.0, Vec3::Y, Vec3::Z * 2.0);
            let low = Vec3::new(-1.0, 0.0, -1.0);
            builder.quad(low, z, x, white);
            builder.quad(low, x, y, white);
            builder.quad(low + z, y, x, white);
            builder.quad(low, y, z, white);
            builder.quad(low + x, z, y, white);
        } else {
            builder.room(Vec3::splat(-0.5), Vec3::splat(0.5), [white; 6]);
        }
        let scene = builder.build();
        for target in [Vec3::new(0.1, 0.2, 0.3), Vec3::new(-0.4, 0.0, -0.2)] {
            let value = measure(&gpu, &scene, [Vec3::new(1.5, 4.0, 1.0), target], 10_000);
            assert_is(if concave { "open white box" } else { "white cube" }, value, 1.0);
        }
        // The whole picture in FV mode: no pixel is above 1.
        let options = RendererOptions { film: FilmOptions::equirect(32, 16), max_bounces: 64, ..Default::default() };
        let gaze = Gaze::Scene { direction: Vec3::NEG_Y };
        let distribution = Distribution::foveated(gaze, None, device::inverse());
        let mut renderer = Renderer::new(&gpu, &options, distribution).unwrap();
        renderer.set_scene(&scene).unwrap();
        renderer.set_pose(FilmPose { position: Vec3::Y * 4.0, world_from_film: Quat::IDENTITY });
        let film = device::trace(&mut renderer, SAMPLES).unwrap();
        assert_eq!(renderer.statistics().unwrap().non_finite, 0);
        for pixel in film.pixels().filter(|pixel| pixel.samples > 1) {
            let limit = 1.0 + 5.0 * pixel.variance_of_mean.sqrt() + ROUNDING;
            assert!(pixel.mean[1] <= limit, "{pixel:?} is above 1");
        }
    }
}

/// A closed room whose walls have albedo a and emit E: E (1 - a^(B + 1)) / (1 - a) after B bounces.
#[test]
fn closed_furnace_by_every_number_of_bounces() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let wall = builder.material(Material { emission: Vec3::splat(0.5), ..lambert(Vec3::splat(0.6)) });
    builder.room(Vec3::new(-1.0, -1.0, -1.5), Vec3::new(1.2, 1.1, 1.0), [wall; 6]);
    let scene = builder.build();
    for bounces in [0, 1, 2, 6, 40] {
        let ray = [Vec3::ZERO, Vec3::new(1.0, 0.3, -0.2)];
        let value = measure(&gpu, &scene, ray, bounces);
        let expected = 0.5 * (1.0 - 0.6f64.powi(bounces as i32 + 1)) / 0.4;
        assert_is(&format!("closed furnace, {bounces} bounces"), value, expected);
    }
}

#[test]
fn an_emissive_rectangle_by_each_way_of_sampling() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, 0.7);
    let lamp = builder.material(emitter(Vec3::splat(3.0)));
    // Its front looks down: z x x would look up.
    builder.quad(Vec3::new(-0.5, 1.5, -1.0), Vec3::X * 2.0, Vec3::Z * 3.0, lamp);
    let ray = [Vec3::new(6.0, 1.0, 0.0), Vec3::ZERO];
    let factor: f64 =
        [(0.5, 1.0), (1.5, 1.0), (0.5, 2.0), (1.5, 2.0)].iter().map(|&(a, b)| corner_form_factor(a, b, 1.5)).sum();
    assert_techniques_agree(&gpu, "rectangle over a plane", &builder.build(), ray, 1, 0.7 * 3.0 * factor);
}

/// A convex body shows its albedo times the radiance about it.
#[test]
fn a_sphere_in_a_constant_environment_by_each_way_of_sampling() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let material = builder.material(lambert(Vec3::splat(0.6)));
    let sphere = builder.faceted_sphere(8);
    builder.place(sphere, material, Affine3A::IDENTITY);
    let mut scene = builder.build();
    scene.environment = even_image(1.0);
    for (what, target) in [("front", Vec3::new(0.1, 0.05, 0.0)), ("rim", Vec3::new(0.0, 0.55, 0.76))] {
        let ray = [Vec3::new(5.0, 0.3, 0.2), target];
        assert_techniques_agree(&gpu, &format!("sphere, {what}"), &scene, ray, 1, 0.6);
    }
}

/// As `even_image`, with a sun of 6 x 6 texels that has half of the power: as many cells to choose from as a random number has
/// few bits left for the choice.
#[test]
fn a_small_sun_in_a_large_environment_image() {
    const WIDTH: u32 = 1024;
    const HEIGHT: u32 = 512;
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, 0.5);
    let mut scene = builder.build();
    let radiance = |x: u32, y: u32| {
        let is_sun = (300..306).contains(&x) && (150..156).contains(&y);
        let sky = if y < HEIGHT / 2 { 0.3 + 0.1 * (x % 7) as f32 } else { 0.1 };
        if is_sun { 5000.0 } else { sky }
    };
    let texels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| [radiance(x, y); 3])).collect();
    scene.environment = image(WIDTH, HEIGHT, texels);
    // Irradiance by quadrature of what the kernels interpolate, a texel in 4 x 4.
    let texel = |x: i64, y: i64| {
        f64::from(radiance(x.rem_euclid(i64::from(WIDTH)) as u32, y.clamp(0, i64::from(HEIGHT) - 1) as u32))
    };
    let mut irradiance = 0.0;
    for row in 0..2 * HEIGHT {
        let v = (f64::from(row) + 0.5) / 4.0 - 0.5;
        let latitude = PI * (0.5 - (v + 0.5) / f64::from(HEIGHT));
        let mut sum = 0.0;
        for column in 0..4 * WIDTH {
            let u = (f64::from(column) + 0.5) / 4.0 - 0.5;
            let (x, y, fu, fv) = (u.floor() as i64, v.floor() as i64, u - u.floor(), v - v.floor());
            let along = |y: i64| texel(x, y) * (1.0 - fu) + texel(x + 1, y) * fu;
            sum += along(y) * (1.0 - fv) + along(y + 1) * fv;
        }
        let solid_angle = 2.0 * PI * PI / (16.0 * f64::from(WIDTH) * f64::from(HEIGHT)) * latitude.cos();
        irradiance += sum * latitude.sin() * solid_angle;
    }
    let ray = [Vec3::new(1.0, 2.0, 0.5), Vec3::ZERO];
    for technique in [SamplingTechnique::Lights, SamplingTechnique::Both] {
        let value = measure_by(&gpu, &scene, ray, 1, (technique, COMPARED_SAMPLES));
        assert_is(&format!("floor under a small sun, {technique:?}"), value, 0.5 * irradiance / PI);
    }
}

/// A closed cube: a glowing ceiling, black walls, and a floor that sees the ceiling by a known form factor; and one whose
/// faces all glow and reflect.
#[test]
fn enclosures_by_each_way_of_sampling() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let wall = builder.material(lambert(Vec3::ZERO));
    let ground = builder.material(lambert(Vec3::splat(0.8)));
    let ceiling = builder.material(emitter(Vec3::splat(2.0)));
    builder.room(Vec3::ZERO, Vec3::ONE, [wall, wall, ground, ceiling, wall, wall]);
    let ray = [Vec3::new(0.9, 0.5, 0.2), Vec3::new(0.3, 0.0, 0.4)];
    let corners = [(0.3, 0.4), (0.7, 0.4), (0.3, 0.6), (0.7, 0.6)];
    let factor: f64 = corners.iter().map(|&(a, b)| corner_form_factor(a, b, 1.0)).sum();
    assert_techniques_agree(&gpu, "cube with a glowing ceiling", &builder.build(), ray, 1, 0.8 * 2.0 * factor);

    let mut builder = Builder::new(Vec3::ZERO);
    let wall = builder.material(Material { emission: Vec3::splat(0.5), ..lambert(Vec3::splat(0.6)) });
    builder.room(Vec3::ZERO, Vec3::ONE, [wall; 6]);
    // The other faces' form factors sum to 1.
    assert_techniques_agree(&gpu, "glowing cube", &builder.build(), ray, 1, 0.5 * 1.6);
}

/// Irradiance of punctual lights: candela over squared distance, and lux, times the cosine.
#[test]
fn punctual_lights() {
    let gpu = device::gpu();
    let (position, target) = (Vec3::new(1.0, 2.0, -0.5), Vec3::new(0.2, 0.0, 0.3));
    let to_light = position - target;
    let distance = f64::from(to_light.length());
    let cosine = f64::from(to_light.y) / distance;
    let rotation = Quat::from_rotation_arc(Vec3::NEG_Z, -to_light.normalize());
    let at_distance = 5.0 * cosine / (distance * distance);
    for (what, kind, irradiance) in [
        ("point", PunctualKind::Point, at_distance),
        ("spot", PunctualKind::Spot { inner_angle: 0.2, outer_angle: 0.4 }, at_distance),
        ("directional", PunctualKind::Directional { angular_diameter: 0.0 }, 5.0 * cosine),
    ] {
        let mut builder = Builder::new(Vec3::ZERO);
        floor(&mut builder, 0.4);
        builder.light(PunctualLight { name: String::new(), kind, intensity: Vec3::splat(5.0), position, rotation });
        let value = measure(&gpu, &builder.build(), [Vec3::new(-3.0, 2.0, 0.0), target], 1);
        assert_is(what, value, 0.4 / PI * irradiance);
    }
    // Near a lamp it is far brighter than at a metre: the film holds that.
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, 0.4);
    let position = target + Vec3::new(0.0, 0.05, 0.0);
    let (name, kind, intensity) = (String::new(), PunctualKind::Point, Vec3::splat(5.0));
    builder.light(PunctualLight { name, kind, intensity, position, rotation });
    let (near, _) = measure(&gpu, &builder.build(), [Vec3::new(-3.0, 2.0, 0.0), target], 1);
    let expected = 0.4 / PI * 5.0 / (0.05 * 0.05);
    eprintln!("five centimetres below a lamp: {near:.3}, expected {expected:.3}");
    // Shadow rays begin up to two micrometres nearer to the lamp.
    assert!((near / expected - 1.0).abs() < 1e-4);
    // Beside the outer cone there is nothing.
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, 0.4);
    let kind = PunctualKind::Spot { inner_angle: 0.2, outer_angle: 0.4 };
    let intensity = Vec3::splat(5.0);
    builder.light(PunctualLight { name: String::new(), kind, intensity, position: target + to_light, rotation });
    let beside = target + Vec3::new(0.0, 0.0, 4.0);
    assert_eq!(measure(&gpu, &builder.build(), [Vec3::new(-3.0, 2.0, 0.0), beside], 1), (0.0, 0.0));
}

/// A map that tilts the normal by a constant: Lambert's cosine to the mapped normal, masked as by bumps of that tilt.
#[test]
fn a_tilted_normal_map_under_a_sun() {
    let gpu = device::gpu();
    // Red and green are along +X and -Z here; the blue is what makes it a unit vector, to 8 bits.
    let texel = [204u8, 128, 230, 255];
    let [x, y, z] = [0, 1, 2].map(|channel| f64::from(texel[channel]) / 255.0 * 2.0 - 1.0);
    let mapped = DVec3::new(x, z, -y).normalize();
    let tan2_tilt = mapped.y.powi(-2) - 1.0;
    for (elevation_deg, azimuth_deg) in [(80.0f64, 0.0f64), (30.0, 0.0), (10.0, 30.0), (40.0, 180.0), (5.0, 0.0)] {
        let (elevation, azimuth) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
        let to_sun = DVec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin());
        let tan2_light = to_sun.y.powi(-2) - 1.0;
        let unmasked = 2.0 / (1.0 + (1.0 + (tan2_tilt / 8.0).min(1.0) * tan2_light).sqrt());
        let expected = 5.0 * 0.4 / PI * mapped.dot(to_sun).max(0.0) * unmasked;

        let mut builder = Builder::new(Vec3::ZERO);
        let map = builder.texture(1, TexelEncoding::Linear, vec![texel]);
        let material = builder.material(Material { normal_texture: Some(map), ..lambert(Vec3::splat(0.4)) });
        builder.quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, material);
        builder.light(PunctualLight {
            name: String::new(),
            kind: PunctualKind::Directional { angular_diameter: 0.0 },
            intensity: Vec3::splat(5.0),
            position: Vec3::ZERO,
            rotation: Quat::from_rotation_arc(Vec3::NEG_Z, -to_sun.as_vec3()),
        });
        let value = measure(&gpu, &builder.build(), [Vec3::new(-3.0, 2.0, 0.0), Vec3::ZERO], 1);
        assert_is(&format!("sun at {elevation_deg}, {azimuth_deg} degrees"), value, expected);
    }
}

/// A sun of any size lights a surface that faces it with its lux; seen directly and in a mirror it has their radiance.
#[test]
fn a_sun_with_an_angular_size() {
    let gpu = device::gpu();
    let mirror = Material { metallic: 1.0, roughness: 0.0, ..Default::default() };
    for degrees in [0.01f32, 0.53, 20.0] {
        let radius = f64::from(degrees.to_radians()) * 0.5;
        let to_sun = Vec3::new(0.6, 0.8, 0.0);
        let sun = PunctualLight {
            name: String::new(),
            kind: PunctualKind::Directional { angular_diameter: degrees.to_radians() },
            intensity: Vec3::splat(5.0),
            position: Vec3::ZERO,
            rotation: Quat::from_rotation_arc(Vec3::NEG_Z, -to_sun),
        };
        let scene = |material: Material| {
            let mut builder = Builder::new(Vec3::ZERO);
            let material = builder.material(material);
            builder.quad(Vec3::new(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0, material);
            builder.light(sun.clone());
            builder.build()
        };
        let on_the_floor = measure(&gpu, &scene(lambert(Vec3::splat(0.4))), [Vec3::Y, Vec3::ZERO], 1);
        assert_is(&format!("floor under {degrees} degrees"), on_the_floor, 0.4 / PI * 5.0 * 0.8);
        let radiance = 5.0 / (PI * radius.sin().powi(2));
        let directly = measure(&gpu, &scene(mirror.clone()), [Vec3::Y, Vec3::Y + to_sun], 0);
        assert_is(&format!("{degrees} degrees, seen"), directly, radiance);
        let mirrored = Vec3::new(-to_sun.x, to_sun.y, to_sun.z);
        let in_mirror = measure(&gpu, &scene(mirror.clone()), [mirrored, Vec3::ZERO], 1);
        assert_is(&format!("{degrees} degrees, in a mirror"), in_mirror, radiance);
        // A glossy surface is reached by both ways of sampling: the lights' and the BSDF's.
        let glossy = Material { roughness: 0.35, ..mirror.clone() };
        let both = measure(&gpu, &scene(glossy.clone()), [mirrored, Vec3::ZERO], 1);
        let by_bsdf = measure_by(&gpu, &scene(glossy), [mirrored, Vec3::ZERO], 1, (SamplingTechnique::Bsdf, SAMPLES));
        eprintln!("{degrees} degrees, glossy: {both:?}, by BSDF sampling alone {by_bsdf:?}");
        assert!(both.1 <= 0.01 * both.0);
        if degrees > 1.0 {
            // A smaller one is hit too seldom for a comparison.
            assert!((both.0 - by_bsdf.0).abs() <= 3.0 * f64::hypot(both.1, by_bsdf.1));
        }
    }
}

/// Light samples go where light comes from: not to a sky outside a closed room, hardly to a lamp under an open sky. The mean
/// does not depend on it.
#[test]
fn light_samples_are_split_by_what_reaches_the_scene() {
    let gpu = device::gpu();
    let share = |scene: &Scene| {
        let options = RendererOptions { film: FilmOptions::equirect(32, 16), ..Default::default() };
        let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(device::inverse())).unwrap();
        renderer.set_scene(scene).unwrap().environment_share
    };
    let mut closed = Builder::new(Vec3::ZERO);
    let wall = closed.material(lambert(Vec3::splat(0.5)));
    closed.room(Vec3::NEG_ONE, Vec3::ONE, [wall; 6]);
    let lamp = closed.material(emitter(Vec3::splat(5.0)));
    closed.quad(Vec3::new(-0.3, 0.9, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6, lamp);
    let mut closed = closed.build();
    closed.environment = even_image(100.0);
    let mut open = Builder::new(Vec3::ZERO);
    floor(&mut open, 0.7);
    let lamp = open.material(emitter(Vec3::splat(0.3)));
    open.quad(Vec3::new(-0.5, 1.5, -1.0), Vec3::X * 2.0, Vec3::Z * 3.0, lamp);
    let mut open = open.build();
    open.environment = even_image(1.0);
    let shares = [share(&closed), share(&open)];
    eprintln!("share of the environment: closed {:.3}, open {:.3}", shares[0], shares[1]);
    assert!(shares[0] <= 0.11 && shares[1] >= 0.8, "{shares:?}");
    let factor: f64 =
        [(0.5, 1.0), (1.5, 1.0), (0.5, 2.0), (1.5, 2.0)].iter().map(|&(a, b)| corner_form_factor(a, b, 1.5)).sum();
    // The lamp's back, which does not emit, hides as much sky as it lights.
    let expected = 0.7 * (0.3 * factor + 1.0 - factor);
    assert_is("a lamp under a sky", measure(&gpu, &open, [Vec3::new(6.0, 1.0, 0.0), Vec3::ZERO], 1), expected);
}

/// A fine chequered pattern: from far its mean, whatever the phase, and from near the texel's own value.
#[test]
fn textures_do_not_alias_and_are_not_blurred() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let texels = [0u8, 255, 255, 0].map(|level| [level, level, level, 255]);
    let mut pattern = builder.texture(2, TexelEncoding::Srgb, texels.to_vec());
    // Squares of 4 / 8192 metres.
    pattern.texture_from_uv = [[4096.0, 0.0, 0.0], [0.0, 4096.0, 0.0]];
    let glow = builder.material(Material { emissive_texture: Some(pattern), ..emitter(Vec3::ONE) });
    builder.quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0, glow);
    let scene = builder.build();
    for shift in [0.0, 1e-4, 2.5e-4] {
        // The pixel of 1e-4 radians is 1 m wide there: thousands of squares.
        let target = Vec3::new(shift, 0.1, 0.0);
        let far = measure(&gpu, &scene, [target + Vec3::new(0.0, 0.0, 1e4), target], 0);
        assert_is("a pattern from afar", far, 0.5);
    }
    let square = 4.0 / 8192.0;
    let values = [0.5f32, 1.5].map(|squares| {
        let target = Vec3::new(squares * square, 0.5 * square, 0.0);
        measure(&gpu, &scene, [target + Vec3::new(0.0, 0.0, 0.1), target], 0)
    });
    eprintln!("neighbouring squares from near: {values:?}");
    assert!(values.iter().all(|value| value.1 == 0.0), "no texel bleeds into its neighbour");
    assert!((values[0].0 - values[1].0).abs() > 1.0 - ROUNDING, "black and white stay so");
}

/// A clear sheet of half grey between lamps and floor halves their light, by every way of sampling; a sun shines through it.
/// A texture makes it as smooth as the factor does.
#[test]
fn light_through_a_clear_sheet() {
    let gpu = device::gpu();
    let ray = [Vec3::new(6.0, 0.5, 0.0), Vec3::ZERO];
    let with_sheet = |is_smooth_by_texture: bool, add_light: &dyn Fn(&mut Builder)| {
        let mut builder = Builder::new(Vec3::ZERO);
        floor(&mut builder, 0.7);
        let smooth = is_smooth_by_texture.then(|| builder.texture(1, TexelEncoding::Linear, vec![[255, 0, 0, 255]]));
        let sheet = builder.material(Material {
            base_color: Vec3::splat(0.5).extend(1.0),
            metallic: 0.0,
            roughness: if is_smooth_by_texture { 1.0 } else { 0.0 },
            metallic_roughness_texture: smooth,
            ior: 1.0,
            specular: 0.0,
            transmission: 1.0,
            double_sided: true,
            ..Default::default()
        });
        builder.quad(Vec3::new(-15.0, 1.0, -15.0), Vec3::Z * 30.0, Vec3::X * 30.0, sheet);
        add_light(&mut builder);
        builder.build()
    };
    let lamp = |builder: &mut Builder| {
        let lamp = builder.material(emitter(Vec3::splat(3.0)));
        builder.quad(Vec3::new(-0.5, 1.5, -1.0), Vec3::X * 2.0, Vec3::Z * 3.0, lamp);
    };
    let factor: f64 =
        [(0.5, 1.0), (1.5, 1.0), (0.5, 2.0), (1.5, 2.0)].iter().map(|&(a, b)| corner_form_factor(a, b, 1.5)).sum();
    let sun = |builder: &mut Builder| {
        builder.light(PunctualLight {
            name: String::new(),
            kind: PunctualKind::Directional { angular_diameter: 0.0 },
            intensity: Vec3::splat(5.0),
            position: Vec3::ZERO,
            rotation: Quat::from_rotation_arc(Vec3::NEG_Z, Vec3::new(-0.6, -0.8, 0.0)),
        });
    };
    for is_smooth_by_texture in [false, true] {
        let sheet = if is_smooth_by_texture { "a sheet smooth by texture" } else { "a sheet" };
        let lit = with_sheet(is_smooth_by_texture, &lamp);
        for technique in [SamplingTechnique::Both, SamplingTechnique::Lights, SamplingTechnique::Bsdf] {
            let value = measure_by(&gpu, &lit, ray, 1, (technique, 2 * SAMPLES));
            assert_is(&format!("a lamp behind {sheet}, {technique:?}"), value, 0.5 * 0.7 * 3.0 * factor);
        }
        let lit = with_sheet(is_smooth_by_texture, &sun);
        assert_is(&format!("a sun behind {sheet}"), measure(&gpu, &lit, ray, 1), 0.5 * 0.7 / PI * 5.0 * 0.8);
    }
}

/// A backdrop is what camera rays see that leave the scene, through cut-outs and clear sheets too; what is lit is so to the
/// last bit as without it. A mirror shows the environment.
#[test]
fn a_backdrop_is_seen_and_lights_nothing() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    floor(&mut builder, 0.7);
    let plain = Material { metallic: 0.0, double_sided: true, ..Default::default() };
    let cut_out = builder.material(Material {
        base_color: Vec3::ONE.extend(0.25),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..plain.clone()
    });
    let sheet = builder.material(Material {
        base_color: Vec3::splat(0.5).extend(1.0),
        roughness: 0.0,
        ior: 1.0,
        specular: 0.0,
        transmission: 1.0,
        ..plain
    });
    let mirror = builder.material(Material { roughness: 0.0, ..Default::default() });
    // Four walls side by side, 2 m wide, at z = -2; the last place is empty.
    for (place, material) in [cut_out, sheet, mirror].into_iter().enumerate() {
        builder.quad(Vec3::new(2.0 * place as f32, 0.5, -2.0), Vec3::X * 2.0, Vec3::Y * 2.0, material);
    }
    let mut plain = builder.build();
    plain.environment = even_image(1.0);
    let with = |color: Vec3| Scene { backdrop: Backdrop::Color(color), ..plain.clone() };
    let color = Vec3::new(0.25, 0.5, 0.125);
    let luminance = f64::from(color.dot(Vec3::new(0.2126, 0.7152, 0.0722)));
    let ray = |x: f32, y: f32| [Vec3::new(x, 1.5, 2.0), Vec3::new(x, y, -2.0)];
    let backdropped = with(color);
    for (what, ray, expected) in [
        ("the backdrop", ray(7.0, 1.5), luminance),
        ("the backdrop through a cut-out", ray(1.0, 1.5), luminance),
        ("the backdrop through a sheet", ray(3.0, 1.5), 0.5 * luminance),
    ] {
        assert_is(what, measure(&gpu, &backdropped, ray, 4), expected);
    }
    for (what, ray) in [("a mirror", ray(5.0, 1.5)), ("the floor", ray(1.0, -1.5))] {
        let (before, after) = (measure(&gpu, &plain, ray, 4), measure(&gpu, &backdropped, ray, 4));
        eprintln!("{what}: {before:?}, {after:?} with a backdrop");
        assert_eq!(before, after, "{what}");
        assert!(before.0 > 0.1, "{what} is lit");
    }
    // Black and white with the same samples differ by the empty part of a pixel: here half of one, at the mirror's edge.
    let edge = [Vec3::new(6.0, 1.5, 2.0), Vec3::new(6.0, 1.5, -2.0)];
    let [black, white] = [Vec3::ZERO, Vec3::ONE].map(|color| measure(&gpu, &with(color), edge, 4).0);
    assert!((white - black - 0.5).abs() < 0.01, "{white} {black}");
}

/// A slab of smooth glass before a glowing wall: T = (1 - R) / (1 + R) with Fresnel's R, all internal reflections summed.
#[test]
fn a_glass_slab() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let glass = builder.material(Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 0.1,
        ior: 1.5,
        ..Default::default()
    });
    let glow = builder.material(emitter(Vec3::ONE));
    let (x, y) = (Vec3::X * 200.0, Vec3::Y * 200.0);
    let corner = Vec3::new(-100.0, -100.0, 0.0);
    builder.quad(corner, x, y, glass);
    builder.quad(corner - Vec3::Z * 0.1, y, x, glass);
    builder.quad(corner - Vec3::Z * 2.0, x, y, glow);
    let scene = builder.build();
    for degrees in [0.0f64, 30.0, 60.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let cos_inside = (1.0 - sin * sin / 2.25).sqrt();
        let s = (cos - 1.5 * cos_inside) / (cos + 1.5 * cos_inside);
        let p = (1.5 * cos - cos_inside) / (1.5 * cos + cos_inside);
        // The shader's Fresnel term is the mean of both polarisations at each surface.
        let reflectance = 0.5 * (s * s + p * p);
        let eye = Vec3::new(sin as f32, 0.0, cos as f32) * 2.0;
        let value = measure(&gpu, &scene, [eye, Vec3::ZERO], 64);
        assert_is(&format!("glass at {degrees} degrees"), value, (1.0 - reflectance) / (1.0 + reflectance));
    }
}

/// Tinted water of index 1, so that rays go straight: after a metre half is left.
fn water() -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        thickness: 1.0,
        ior: 1.0,
        attenuation_color: Vec3::splat(0.5),
        attenuation_distance: 1.0,
        ..Default::default()
    }
}

/// What shines in a box of water, below an open surface and behind the box, seen from outside and inside.
#[test]
fn what_shines_in_a_medium_is_seen_through_it() {
    let gpu = device::gpu();
    let mut builder = Builder::new(Vec3::ZERO);
    let water = builder.material(water());
    let glow = builder.material(emitter(Vec3::ONE));
    // Corners the other way round: fronts outside.
    builder.room(Vec3::ONE, Vec3::NEG_ONE, [water; 6]);
    builder.quad(Vec3::new(0.0, -0.5, 0.5), Vec3::X * 0.5, Vec3::Y, glow);
    builder.quad(Vec3::new(-3.0, -3.0, -3.0), Vec3::X * 3.0, Vec3::Y * 6.0, glow);
    builder.quad(Vec3::new(-2.0, 2.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, water);
    builder.quad(Vec3::new(-2.0, 1.5, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, glow);
    let scene = builder.build();
    for (what, eye, target, metres) in [
        ("in the box", Vec3::new(0.2, 0.1, 5.0), Vec3::new(0.2, 0.1, 0.0), 0.5),
        ("behind the box", Vec3::new(-0.5, 0.1, 5.0), Vec3::new(-0.5, 0.1, 0.0), 2.0),
        ("behind the box, from inside", Vec3::new(-0.5, 0.1, 0.25), Vec3::new(-0.5, 0.1, 0.0), 1.25),
        ("below open water", Vec3::Y * 4.0, Vec3::Y, 0.5),
    ] {
        assert_is(what, measure(&gpu, &scene, [eye, target], 8), 0.5f64.powf(metres));
    }
}

/// A floor in a box of water, below a lamp in the same water, by every way of sampling; and below a light without size.
#[test]
fn lamps_in_a_medium_light_through_it() {
    let gpu = device::gpu();
    let in_water = |add_light: &dyn Fn(&mut Builder)| {
        let mut builder = Builder::new(Vec3::ZERO);
        let water = builder.material(water());
        builder.room(Vec3::new(4.0, 3.0, 4.0), Vec3::new(-4.0, -1.0, -4.0), [water; 6]);
        // Small, so that the offsets of rays are: they shorten ways through the water.
        let floor = builder.material(lambert(Vec3::splat(0.7)));
        builder.quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0, floor);
        add_light(&mut builder);
        builder.build()
    };
    let eye = Vec3::Y * 8.0;
    let to_the_floor = 0.5f64.powi(3);
    let lamp = in_water(&|builder| {
        let lamp = builder.material(emitter(Vec3::splat(3.0)));
        builder.quad(Vec3::new(0.5, 1.5, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, lamp);
    });
    // By quadrature over the lamp.
    const CELLS: u32 = 400;
    let at = |i: u32| (f64::from(i) + 0.5) * 2.0 / f64::from(CELLS);
    let area = (2.0 / f64::from(CELLS)).powi(2);
    let irradiance_share: f64 = (0..CELLS * CELLS)
        .map(|cell| {
            let distance2 = (0.5 + at(cell % CELLS)).powi(2) + 1.5f64.powi(2) + (at(cell / CELLS) - 1.0).powi(2);
            (1.5 / distance2).powi(2) / PI * area * 0.5f64.powf(distance2.sqrt())
        })
        .sum();
    let expected = to_the_floor * 0.7 * 3.0 * irradiance_share;
    for technique in [SamplingTechnique::Lights, SamplingTechnique::Bsdf, SamplingTechnique::Both] {
        let value = measure_by(&gpu, &lamp, [eye, Vec3::ZERO], 2, (technique, COMPARED_SAMPLES));
        assert_is(&format!("a lamp in water, {technique:?}"), value, expected);
    }
    let point = in_water(&|builder| {
        builder.light(PunctualLight {
            name: String::new(),
            kind: PunctualKind::Point,
            intensity: Vec3::splat(5.0),
            position: Vec3::new(1.5, 2.0, 0.0),
            rotation: Quat::IDENTITY,
        });
    });
    let expected = to_the_floor * 0.7 / PI * 5.0 * 0.8 / 6.25 * 0.5f64.powf(2.5);
    assert_is("a point in water", measure(&gpu, &point, [eye, Vec3::ZERO], 2), expected);
}
