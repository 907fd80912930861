//! The panorama that a headset's eyes are drawn from, against functions of the direction that are known exactly.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f32::consts::{FRAC_PI_2, PI};

use fovea_tests::device;
use glam::{Quat, Vec3};
use tracer::{
    film::FilmOptions,
    panorama::{EyeSettings, Frustum, Panorama},
    renderer::Renderer,
    view::ToneMap,
};

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Brings a panorama up to date in parts of so many texels; how many parts it took.
fn refresh(renderer: &mut Renderer, panorama: &mut Panorama, texels: u64) -> usize {
    let gpu = renderer.gpu().clone();
    (1..)
        .find(|_| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let done = renderer.refresh_panorama(&mut encoder, panorama, texels).unwrap();
            gpu.queue.submit([encoder.finish()]);
            done.round_is_done
        })
        .unwrap()
}

fn eye(renderer: &mut Renderer, panorama: &Panorama, settings: &EyeSettings) -> Vec<[u8; 4]> {
    eye_in(FORMAT, renderer, panorama, settings)
}

/// What a target of a format holds, byte for byte.
fn eye_in(
    format: wgpu::TextureFormat,
    renderer: &mut Renderer,
    panorama: &Panorama,
    settings: &EyeSettings,
) -> Vec<[u8; 4]> {
    let gpu = renderer.gpu().clone();
    let texture = fovea_app::readback::picture_texture_in(&gpu, settings.size, format);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let target = texture.create_view(&Default::default());
    renderer.draw_eye(&mut encoder, panorama, settings, &target, format).unwrap();
    gpu.queue.submit([encoder.finish()]);
    fovea_app::readback::read_texture(&gpu, &texture).unwrap()
}

fn settings(world_from_eye: Quat, frustum: Frustum) -> EyeSettings {
    EyeSettings { world_from_eye, frustum, size: [96, 80], exposure_ev: 0.0, tone_map: ToneMap::Linear, marker: None }
}

/// Unit direction in the eye's frame through a pixel's centre.
fn ray(settings: &EyeSettings, index: usize) -> Vec3 {
    let [width, height] = settings.size;
    let (x, y) = (index as u32 % width, index as u32 / width);
    let f = settings.frustum;
    let across = (x as f32 + 0.5) / width as f32;
    let down = (y as f32 + 0.5) / height as f32;
    Vec3::new(f.left + across * (f.right - f.left), f.up + down * (f.down - f.up), -1.0).normalize()
}

fn srgb(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    if c <= 0.0031308 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// Straight ahead, the seam, both poles, a rolled head.
fn poses() -> [Quat; 6] {
    [
        Quat::IDENTITY,
        Quat::from_rotation_y(PI),
        Quat::from_rotation_x(FRAC_PI_2),
        Quat::from_rotation_x(-FRAC_PI_2),
        Quat::from_euler(glam::EulerRot::YXZ, 0.7, -0.4, 0.9),
        Quat::from_euler(glam::EulerRot::YXZ, 2.9, 1.3, -2.0),
    ]
}

#[test]
fn every_pixel_of_an_eye_shows_its_direction() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(512, 256);
    let smooth = |d: Vec3| 0.5 + 0.45 * d;
    let mut renderer = device::painted(&gpu, film, |d, _| Some(smooth(d)));
    let mut panorama = Panorama::new(&gpu, &film).unwrap();
    // In parts, as beside a headset's frames, and in one.
    assert!(refresh(&mut renderer, &mut panorama, 1) > 8);
    assert_eq!(refresh(&mut renderer, &mut panorama, u64::MAX), 1);
    // As an eye's: wider towards the temple, and lower than high.
    let frustum = Frustum { left: -1.3, right: 0.9, down: -1.2, up: 0.8 };
    let mut largest = 0.0_f32;
    for pose in poses() {
        let settings = settings(pose, frustum);
        for (index, texel) in eye(&mut renderer, &panorama, &settings).iter().enumerate() {
            let expected = smooth(pose * ray(&settings, index)).to_array().map(srgb);
            for (found, expected) in texel.iter().zip(expected) {
                largest = largest.max((f32::from(*found) - 255.0 * expected).abs());
            }
        }
    }
    // One for rounding to 8 bits and half floats, two for the filter, which is three degrees wide at the picture's middle.
    assert!(largest < 3.0, "{largest} of 255");
    eprintln!("largest difference {largest:.2} of 255");
}

#[test]
fn a_target_that_encodes_for_the_display_holds_what_one_that_does_not_is_given() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(512, 256);
    // From black, so that both pieces of the display's curve are met.
    let mut renderer = device::painted(&gpu, film, |d, _| Some((0.3 + 0.6 * d).max(Vec3::ZERO)));
    let mut panorama = Panorama::new(&gpu, &film).unwrap();
    refresh(&mut renderer, &mut panorama, u64::MAX);
    let symmetric = Frustum::symmetric(1.2, 1.0);
    let mut seen = 0;
    for (pose, tone_map) in poses().into_iter().zip([ToneMap::Linear, ToneMap::AgX].into_iter().cycle()) {
        let settings = EyeSettings { tone_map, ..settings(pose, symmetric) };
        // The first choice of a headset's swapchain.
        let encoding = eye_in(wgpu::TextureFormat::Rgba8UnormSrgb, &mut renderer, &panorama, &settings);
        let plain = eye(&mut renderer, &panorama, &settings);
        for (found, expected) in encoding.as_flattened().iter().zip(plain.as_flattened()) {
            assert!(found.abs_diff(*expected) <= 1, "{found} instead of {expected}");
        }
        seen |= plain.iter().map(|texel| if texel[0] == 0 { 1 } else { 2 }).fold(0, std::ops::BitOr::bitor);
    }
    assert_eq!(seen, 3, "black and lighter pixels");
}

#[test]
fn columns_that_meet_at_the_poles_neither_flicker_nor_show() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(512, 256);
    // Every other column is white: a texel at the pole is 160 times narrower than high.
    let mut renderer = device::painted(&gpu, film, |_, x| Some(Vec3::splat((x % 2) as f32)));
    let mut panorama = Panorama::new(&gpu, &film).unwrap();
    refresh(&mut renderer, &mut panorama, u64::MAX);
    let narrow = Frustum::symmetric(0.06, 0.05);
    for up in [1.0_f32, -1.0] {
        let mut last: Option<Vec<[u8; 4]>> = None;
        for step in 0..12 {
            // A head that trembles by a twentieth of a pixel of the film.
            let tremble = Quat::from_rotation_y(0.0006 * step as f32);
            let texels =
                eye(&mut renderer, &panorama, &settings(tremble * Quat::from_rotation_x(up * FRAC_PI_2), narrow));
            let grey = srgb(0.5) * 255.0;
            for (index, texel) in texels.iter().enumerate() {
                // A pixel so close to the pole covers 19 columns or more, which leaves a 19th of their contrast at most.
                if ray(&settings(Quat::IDENTITY, narrow), index).angle_between(Vec3::NEG_Z) < 0.3_f32.to_radians() {
                    let off = (f32::from(texel[0]) - grey).abs();
                    assert!(off < 6.0, "{off} of 255 at the pole");
                    let before = last.as_ref().map_or(texel, |last| &last[index]);
                    assert!(texel[0].abs_diff(before[0]) <= 4, "flickers: {before:?} {texel:?}");
                }
            }
            last = Some(texels);
        }
    }
}

#[test]
fn holes_are_filled_from_what_is_around_them_and_stay_when_the_head_turns() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(256, 128);
    let colour = Vec3::new(0.6, 0.3, 0.1);
    // One pixel in 23 is known.
    let mut count = 0;
    let known = std::cell::RefCell::new(&mut count);
    let mut renderer = device::painted(&gpu, film, |_, _| {
        let mut count = known.borrow_mut();
        **count += 1;
        (**count % 23 == 0).then_some(colour)
    });
    let mut panorama = Panorama::new(&gpu, &film).unwrap();
    refresh(&mut renderer, &mut panorama, u64::MAX);
    let expected = colour.to_array().map(|value| srgb(value) * 255.0);
    for pose in poses() {
        for texel in eye(&mut renderer, &panorama, &settings(pose, Frustum::symmetric(1.0, 0.8))) {
            let off = (0..3).map(|i| (f32::from(texel[i]) - expected[i]).abs()).fold(0.0, f32::max);
            assert!(off <= 1.5, "{texel:?} instead of {expected:?}");
        }
    }
}

#[test]
fn the_marker_lies_about_the_gaze() {
    let gpu = device::gpu();
    let film = FilmOptions::equirect(256, 128);
    let mut renderer = device::painted(&gpu, film, |_, _| Some(Vec3::ZERO));
    let mut panorama = Panorama::new(&gpu, &film).unwrap();
    refresh(&mut renderer, &mut panorama, u64::MAX);
    let pose = Quat::from_euler(glam::EulerRot::YXZ, 0.7, -0.4, 0.9);
    let (gaze, radius) = (pose * Vec3::new(0.2, -0.1, -1.0).normalize(), 0.09);
    let frustum = Frustum { left: -0.6, right: 0.5, down: -0.4, up: 0.5 };
    let settings = EyeSettings { marker: Some((gaze, radius)), ..settings(pose, frustum) };
    let texels = eye(&mut renderer, &panorama, &settings);
    let pixel = 0.9 / 80.0;
    let marked: Vec<f32> = texels
        .iter()
        .enumerate()
        .filter(|(_, texel)| texel[0] > 60)
        .map(|(index, _)| (pose * ray(&settings, index)).angle_between(gaze))
        .collect();
    assert!(marked.len() > 40, "{} pixels", marked.len());
    assert!(marked.iter().all(|angle| (angle - radius).abs() < 1.5 * pixel), "{marked:?}");
}
