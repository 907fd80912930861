//! What runs where the runtime is found. Each test here is started by the one of the same name.

use std::sync::Arc;
use std::time::{Duration, Instant};

use fovea_app::cli::choices::{Geometry, Model};
use fovea_app::sampling::Acuity;
use fovea_app::vr::headset::{Headset, Submitted};
use fovea_app::vr::lifecycle::Ended;
use fovea_app::vr::pacing::FramePacing;
use tracer::distribution::Distribution;
use tracer::film::FilmOptions;
use tracer::panorama::{EyeSettings, Panorama};
use tracer::renderer::{Renderer, RendererOptions};
use tracer::view::ToneMap;

/// Waits until the session runs.
pub fn wait_until_running(headset: &mut Headset) {
    let start = Instant::now();
    while !headset.lifecycle().is_running() {
        assert!(headset.poll().is_none(), "the session ended before it began");
        assert!(start.elapsed() < Duration::from_secs(20), "{}", headset.lifecycle().words());
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
    renderer
}

#[test]
#[ignore = "started by session::a_session_shows_three_hundred_frames"]
fn a_session_shows_three_hundred_frames() {
    let mut headset = Headset::enter().unwrap();
    eprintln!("{:?}, eyes of {:?}", headset.facts(), headset.eye_sizes());
    let film = FilmOptions::equirect(256, 128);
    let mut renderer = renderer(&headset, film);
    let mut panorama = Panorama::new(headset.gpu(), &film).unwrap();
    wait_until_running(&mut headset);
    let (mut drawn, mut missed, mut focused) = (0, 0, false);
    let (mut pacing, mut samples, mut spent) = (FramePacing::default(), 0, Duration::ZERO);
    while drawn < 300 {
        assert!(headset.poll().is_none());
        focused |= headset.lifecycle().is_focused();
        let frame = headset.begin_frame().unwrap();
        missed += frame.missed;
        let gpu = headset.gpu().clone();
        let submitted = headset
            .submit(frame, |eyes| -> anyhow::Result<()> {
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                renderer.refresh_panorama(&mut encoder, &mut panorama, 1 << 14)?;
                for eye in eyes {
                    let settings = EyeSettings {
                        world_from_eye: eye.view.local_from_eye,
                        frustum: eye.view.frustum,
                        size: eye.size,
                        exposure_ev: 0.0,
                        tone_map: ToneMap::AgX,
                        marker: None,
                    };
                    renderer.draw_eye(&mut encoder, &panorama, &settings, eye.target, eye.format)?;
                }
                gpu.queue.submit([encoder.finish()]);
                Ok(())
            })
            .unwrap();
        drawn += u32::from(submitted == Submitted::Drawn);
        gpu.wait().unwrap();
        let left = FramePacing::left(frame.period, frame.started.elapsed());
        if let Some(batch) = pacing.batch(left) {
            let start = Instant::now();
            let traced = renderer.trace(batch).unwrap();
            gpu.wait().unwrap();
            pacing.traced(traced, start.elapsed());
            samples += traced;
            spent += start.elapsed();
        }
    }
    assert!(focused, "the session was never focused");
    assert!(samples > 10_000, "{samples} samples beside the frames");
    eprintln!("{drawn} frames drawn, {missed} missed, {samples} samples in {spent:?}");
    headset.request_exit().unwrap();
    let ended = loop {
        if let Some(ended) = headset.poll() {
            break ended;
        }
        // The runtime goes through its states only while it gets frames.
        if headset.lifecycle().is_running() {
            let frame = headset.begin_frame().unwrap();
            headset.submit(frame, |_| anyhow::Ok(())).unwrap();
        }
    };
    assert!(matches!(ended, Ended::Asked), "{ended:?}");
}
