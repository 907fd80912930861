//! What runs where the runtime is found. Each test here is started by the one of the same name.

use std::io::Read;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fovea_app::cli::choices::{Geometry, Model};
use fovea_app::gaze::filter::Phase;
use fovea_app::preview::engine::{Destination, Request, State};
use fovea_app::readback;
use fovea_app::sampling::Acuity;
use fovea_app::view::{direction, yaw_pitch};
use fovea_app::vr::gaze::EyeGaze;
use fovea_app::vr::headset::Headset;
use fovea_app::vr::pacing::FramePacing;
use glam::{Quat, Vec2, Vec3};
use tracer::distribution::{Distribution, View};
use tracer::film::FilmOptions;
use tracer::panorama::{EyeSettings, Panorama};
use tracer::renderer::{FilmPose, Renderer, RendererOptions};
use tracer::view::{DebugView, ToneMap, ViewProjection, ViewSettings};

use crate::preview::Preview;

/// Waits until the session runs.
pub fn wait_until_running(headset: &mut Headset) {
    let start = Instant::now();
    while !headset.lifecycle().is_running() {
        assert!(headset.poll().is_none(), "the session ended before it began");
        assert!(start.elapsed() < Duration::from_secs(120), "{}", headset.lifecycle().words());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A renderer of the built-in scene on the headset's device.
pub fn renderer(headset: &Headset, film: FilmOptions) -> Renderer {
    let acuity =
        Acuity { model: Model::Reddy, geometry: Geometry::Sphere, inverse: None, floor: None, gaze_error_deg: 0.0 };
    let distribution = Distribution::omnidirectional(acuity.inverse().unwrap());
    let options = RendererOptions { film, max_bounces: 3, ..RendererOptions::default() };
    let mut renderer = Renderer::new(headset.gpu(), &options, distribution).unwrap();
    renderer.set_scene(&Arc::new(tracer::builtin::scene().unwrap().0)).unwrap();
    // Where somebody stands in the room.
    renderer.set_pose(FilmPose { position: Vec3::new(0.0, 1.6, 0.0), ..FilmPose::default() });
    renderer
}

#[test]
#[ignore = "started by session::a_session_shows_three_hundred_frames"]
fn a_session_shows_three_hundred_frames() {
    // A small film: the runtime draws on the same CPU.
    let preview = Preview::start(&["--film-memory", "16"]);
    preview.engine.request(Request::EnterHeadset);
    // Kernels have compiled by then.
    let first = preview.wait("a panorama", |state| state.headset.as_ref().is_some_and(|it| it.refreshes > 0));
    let from = first.headset.unwrap();
    let state = preview.wait("frames", |state| state.headset.as_ref().is_some_and(|it| it.frames >= from.frames + 300));
    let headset = state.headset.unwrap();
    let (drawn, missed) = (headset.frames - from.frames, headset.missed - from.missed);
    let samples = state.readout.samples - first.readout.samples;
    eprintln!("{drawn} frames drawn, {missed} missed, {samples} samples; {}", headset.words);
    assert_eq!(headset.words, "in the headset");
    assert!(samples > 10_000, "{samples} samples beside the frames");
    assert!(2 * missed <= drawn, "{missed} frames missed beside {drawn}");
    preview.engine.request(Request::LeaveHeadset);
    let says = |state: &State| state.message.as_ref().is_some_and(|message| message.text == "left the headset");
    preview.wait("the desktop", |state| state.headset.is_none() && says(state));
}

#[test]
#[ignore = "started by session::each_eye_sees_what_a_headless_render_of_its_pose_shows"]
fn each_eye_sees_what_a_headless_render_of_its_pose_shows() {
    let mut headset = Headset::enter().unwrap();
    let film = FilmOptions::equirect(256, 128);
    let mut renderer = renderer(&headset, film);
    let gpu = headset.gpu().clone();
    // 48 samples a pixel: holes and noise are filled in differently by the two.
    while renderer.samples() < 48 * film.pixels() {
        renderer.trace(1 << 16).unwrap();
        gpu.wait().unwrap();
    }
    let mut panorama = Panorama::new(&gpu, &film).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    renderer.refresh_panorama(&mut encoder, &mut panorama, u64::MAX).unwrap();
    gpu.queue.submit([encoder.finish()]);
    wait_until_running(&mut headset);
    let mut compared = 0;
    while compared < 6 {
        assert!(headset.poll().is_none());
        let frame = headset.begin_frame().unwrap();
        let mut views = Vec::new();
        headset
            .submit(frame, |eyes| -> anyhow::Result<()> {
                views = eyes.iter().map(|eye| (eye.view, eye.size, eye.format)).collect();
                Ok(())
            })
            .unwrap();
        // The headset wobbles, so the poses differ from frame to frame.
        for (view, size, format) in views {
            let f = view.frustum;
            let settings = EyeSettings {
                world_from_eye: view.local_from_eye,
                frustum: f,
                size,
                exposure_ev: 0.0,
                tone_map: ToneMap::AgX,
                marker: None,
            };
            assert_eq!(format, wgpu::TextureFormat::Rgba8UnormSrgb);
            // As the runtime's, but one that can be read.
            let texture = readback::picture_texture_in(&gpu, size, format);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let target = texture.create_view(&Default::default());
            renderer.draw_eye(&mut encoder, &panorama, &settings, &target, format).unwrap();
            gpu.queue.submit([encoder.finish()]);
            let seen = readback::read_texture(&gpu, &texture).unwrap();
            // The view is symmetric: one that holds the eye's picture, in pixels as large, of which that picture is a part.
            let pixel = Vec2::new((f.right - f.left) / size[0] as f32, (f.up - f.down) / size[1] as f32);
            let columns = [(-f.left / pixel.x).round() as u32, (f.right / pixel.x).round() as u32];
            let rows = [(f.up / pixel.y).round() as u32, (-f.down / pixel.y).round() as u32];
            let half = [columns[0].max(columns[1]), rows[0].max(rows[1])];
            let view = View {
                world_from_view: view.local_from_eye,
                half_extent: Vec2::new(half[0] as f32, half[1] as f32) * pixel,
            };
            let settings = ViewSettings {
                projection: ViewProjection::Perspective(view),
                size: half.map(|side| 2 * side),
                exposure_ev: 0.0,
                tone_map: ToneMap::AgX,
                debug_view: DebugView::Beauty,
                fill: true,
                denoise: false,
                ring: None,
            };
            let corner = [half[0] - columns[0], half[1] - rows[0]];
            let mut differences = |projection| {
                let settings = ViewSettings { projection, ..settings };
                let whole = readback::draw(&mut renderer, &settings).unwrap();
                let mut off: Vec<u8> = Vec::new();
                for (index, texel) in seen.iter().enumerate() {
                    let at = [index as u32 % size[0] + corner[0], index as u32 / size[0] + corner[1]];
                    let expected = whole[(at[1] * settings.size[0] + at[0]) as usize];
                    off.extend((0..3).map(|channel| texel[channel].abs_diff(expected[channel])));
                }
                off.sort_unstable();
                (off.iter().map(|value| f64::from(*value)).sum::<f64>() / off.len() as f64, off[off.len() * 99 / 100])
            };
            let (mean, p99) = differences(ViewProjection::Perspective(view));
            // A pixel of the film to the side.
            let turned = view.world_from_view * Quat::from_rotation_y(std::f32::consts::TAU / film.width as f32);
            let (mean_turned, _) = differences(ViewProjection::Perspective(View { world_from_view: turned, ..view }));
            eprintln!(
                "{f:?}: mean difference {mean:.2} of 255, 99 % below {p99}; turned by 1.4 degrees {mean_turned:.2}"
            );
            assert!(mean < 1.0 && p99 <= 8, "mean {mean}, 99 % below {p99}");
            assert!(mean_turned > 4.0 * mean.max(0.25), "a pose that is 1.4 degrees off is not told: {mean_turned}");
            compared += 1;
        }
    }
}

#[test]
#[ignore = "started by session::both_eyes_pictures_are_on_the_headsets_display"]
fn both_eyes_pictures_are_on_the_headsets_display() {
    // A small film: the compositor draws on the same CPU.
    let preview = Preview::start(&["--mode", "od", "--film-memory", "16"]);
    preview.engine.request(Request::EnterHeadset);
    let start = Instant::now();
    preview.wait("panorama", |state| state.headset.as_ref().is_some_and(|headset| headset.refreshes > 0));
    eprintln!("a panorama after {:.1} s", start.elapsed().as_secs_f64());
    // Until the other side has seen it.
    std::io::stdin().read_to_end(&mut Vec::new()).unwrap();
    eprintln!("{:?}", preview.engine.state().readout);
}

#[test]
#[ignore = "started by the tests in failures"]
fn the_preview_goes_on_without_a_headset() {
    let preview = Preview::start(&[]);
    preview.wait("a picture", |state| state.picture.is_some() && state.readout.samples > 10_000);
    let before = preview.engine.state().readout.samples;
    preview.engine.request(Request::EnterHeadset);
    let state = preview.wait("a message", |state| state.message.as_ref().is_some_and(|message| message.wrong));
    eprintln!("MESSAGE {}", state.message.unwrap().text);
    let state = preview.wait("more samples", |state| state.readout.samples > before + 10_000);
    assert!(state.headset.is_none() && !state.dead);
}

#[test]
#[ignore = "started by failures::a_killed_runtime_takes_neither_preview_nor_film_with_it"]
fn a_killed_runtime_takes_neither_preview_nor_film_with_it() {
    let preview = Preview::start(&[]);
    let enter = |least: u64| {
        preview.engine.request(Request::EnterHeadset);
        let in_use = |frames: u64| frames > 10;
        let state =
            preview.wait("frames", |state| state.headset.as_ref().is_some_and(|headset| in_use(headset.frames)));
        assert!(state.readout.samples >= least, "{} samples of {least} came along", state.readout.samples);
        state.readout.samples
    };
    let before = preview.wait("a film", |state| state.readout.samples > 50_000).readout.samples;
    let inside = enter(before);
    preview.engine.request(Request::LeaveHeadset);
    let says = |state: &State, words| state.message.as_ref().is_some_and(|message| message.text.contains(words));
    preview.wait("the desktop", |state| state.headset.is_none() && says(state, "left the headset"));
    let outside = preview.wait("samples", |state| state.readout.samples > inside).readout.samples;
    let inside = enter(outside);
    eprintln!("KILL");
    let state = preview.wait("the loss", |state| state.headset.is_none() && says(state, "lost"));
    let message = state.message.unwrap();
    assert!(message.wrong, "{}", message.text);
    eprintln!("MESSAGE {}", message.text);
    let state = preview.wait("samples", |state| state.readout.samples > inside && state.picture.is_some());
    assert!(!state.dead);
    eprintln!("{before}, {outside}, {inside}, {} samples", state.readout.samples);
}

#[test]
#[ignore = "started by gaze::samples_gather_where_the_eyes_look"]
fn samples_gather_where_the_eyes_look() {
    // The window looks elsewhere; what it has ahead is ahead of the wearer.
    let yaw = 0.5;
    let preview = Preview::looking(&[], yaw, 0.3);
    preview.engine.request(Request::EnterHeadset);
    let by_eyes = |state: &State| state.headset.as_ref().is_some_and(|it| it.gaze_from.contains("eye tracker"));
    // So many that a film which starts anew has fewer when it is first told, on a loaded machine too.
    let before = preview.wait("eyes", |state| by_eyes(state) && state.readout.samples > 200_000).readout.samples;
    preview.engine.request(Request::Restart);
    preview.wait("another film", |state| state.readout.samples < before);
    let state = preview.wait("samples", |state| state.readout.samples > 60_000);
    eprintln!("{:?}", state.headset.unwrap());
    let path = std::path::PathBuf::from(std::env::var_os("XDG_RUNTIME_DIR").unwrap()).join("film.exr");
    preview.engine.request(Request::SaveExr(Destination::File(path.clone())));
    preview.wait("a file", |state| state.message.as_ref().is_some_and(|message| message.text.starts_with("saved")));
    let (film, counts) = crate::gaze::samples_of(&path);
    let (towards, peak, density) = crate::gaze::peak(&film, &counts);
    let expected = direction(yaw + 10_f32.to_radians(), 5_f32.to_radians());
    let off = towards.angle_between(expected).to_degrees();
    let [far, ahead] = [direction(yaw - 40_f32.to_radians(), 0.0), direction(yaw, 0.0)].map(&density);
    let degrees = |d: Vec3| {
        let (yaw_found, pitch) = yaw_pitch(d);
        [(yaw_found - yaw).to_degrees(), pitch.to_degrees()]
    };
    eprintln!(
        "densest at {:?} degrees, {off:.2} from where the eyes look; {peak:.0} samples a square degree there, {ahead:.0} \
         straight ahead, {far:.1} at 50 degrees from it",
        degrees(towards)
    );
    assert!(off < 0.3, "{off} degrees");
    assert!(peak > 1.5 * ahead && peak > 20.0 * far, "{peak}, {ahead}, {far}");
}

#[test]
#[ignore = "started by gaze::saccades_are_followed_and_blinks_are_held"]
fn saccades_are_followed_and_blinks_are_held() {
    let mut headset = Headset::enter().unwrap();
    wait_until_running(&mut headset);
    let mut eyes = EyeGaze::new(Instant::now());
    let (mut ages, mut polls) = (Vec::new(), Vec::new());
    let (mut saccades, mut blinks, mut worst) = (0, 0, 0.0_f32);
    let (mut last_raw, mut last_poll, mut held): (Option<Vec3>, Option<Instant>, Option<Vec3>) = (None, None, None);
    let mut blinking = false;
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(9) {
        assert!(headset.poll().is_none());
        let frame = headset.begin_frame().unwrap();
        headset.submit(frame, |_| anyhow::Ok(())).unwrap();
        if !headset.lifecycle().is_focused() {
            continue;
        }
        headset.input().unwrap();
        // As beside a frame: before every batch.
        while FramePacing::left(frame.period, frame.started.elapsed()) > Duration::ZERO {
            std::thread::sleep(Duration::from_millis(4));
            let sample = headset.gaze().unwrap().unwrap();
            let now = Instant::now();
            if let Some(last) = last_poll.replace(now) {
                polls.push((now - last).as_secs_f64() * 1e3);
            }
            eyes.take(sample, Quat::IDENTITY);
            let raw = sample.local_from_gaze.map(|gaze| gaze * Vec3::NEG_Z);
            let Some(found) = eyes.direction(now) else { continue };
            match raw {
                Some(raw) => {
                    let jumped = last_raw.is_some_and(|last| last.angle_between(raw) > 0.05);
                    if blinking && eyes.phase() != Some(Phase::Blink) {
                        blinking = false;
                    }
                    if !blinking {
                        if jumped {
                            saccades += 1;
                        }
                        worst = worst.max(found.angle_between(raw).to_degrees());
                        ages.push(eyes.age(now).unwrap().as_secs_f64() * 1e3);
                        held = Some(found);
                    }
                    last_raw = Some(raw);
                }
                None => {
                    blinks += u32::from(!blinking);
                    blinking = true;
                    let moved = held.map_or(0.0, |held| held.angle_between(found).to_degrees());
                    assert!(moved < 0.5, "a blink moved the gaze by {moved} degrees");
                }
            }
        }
    }
    let quantile = |values: &mut Vec<f64>, share: f64| {
        values.sort_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * share) as usize]
    };
    let figures = (quantile(&mut ages, 0.5), quantile(&mut ages, 0.95), quantile(&mut polls, 0.5));
    let longest_look = quantile(&mut polls, 0.95);
    eprintln!(
        "{saccades} saccades followed with their first sample, {blinks} blinks held; at most {worst:.2} degrees off; age \
         {:.1} ms in the median, {:.1} ms at 95 %; asked every {:.1} ms",
        figures.0, figures.1, figures.2
    );
    assert!(saccades >= 5 && blinks >= 2, "{saccades} saccades, {blinks} blinks");
    assert!(worst < 1.0, "{worst} degrees off");
    // The recording's delay, and at most a row of it and the time between two looks.
    assert!(figures.0 >= 20.0 && figures.0 < 20.0 + 8.4 + figures.2 + 2.0, "{figures:?}");
    assert!(figures.1 < 20.0 + 8.4 + longest_look + 2.0, "{figures:?}, {longest_look}");
}
