//! The picture while the view moves or an object is dragged: no black places, no flicker, whatever the mode.

use std::ffi::OsString;
use std::sync::Arc;

use egui::{Rect, pos2};
use fovea_app::cli::{self, PreviewArgs};
use fovea_app::preview::controls::Controls;
use fovea_app::preview::engine::Look;
use fovea_app::preview::gaze::{Gaze, ScreenMapping};
use fovea_app::preview::navigation::Navigation;
use fovea_app::preview::tracing::{SMOOTHING_WHILE_MOVING, Tracing};
use fovea_app::session::{self, Source};
use glam::{UVec2, Vec2, Vec3};
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::renderer::FIRST_BATCH;
use tracer::scene::Scene;

const SIZE: [f32; 2] = [480.0, 270.0];
/// Frames of a movement.
const FRAMES: u32 = 16;

fn args(line: &str) -> PreviewArgs {
    cli::parse(line.split_whitespace().map(OsString::from)).unwrap().preview
}

fn look(scene: &Scene, args: &PreviewArgs) -> Look {
    let camera = &session::viewpoints(scene)[0];
    let controls = Controls::from(args);
    let rect = Rect::from_min_max(pos2(0.0, 0.0), SIZE.into());
    let mapping = ScreenMapping::new(controls.screen, rect, None);
    let navigation = Navigation::new(camera.position, camera.rotation, camera.vfov, SIZE[0] / SIZE[1], 4.0);
    let size_px = UVec2::new(SIZE[0] as u32, SIZE[1] as u32);
    // In a corner, as when one looks where one goes: the rest of the picture gets little.
    let gaze = Gaze { point: Vec2::new(-0.7, 0.6) };
    Look { standpoint: navigation.standpoint, gaze, controls, mapping, size_px, pointer: None }
}

/// What is shown, by its share of black pixels and its mean brightness, 0 to 255.
fn judged(tracing: &mut Tracing, look: &Look, coarseness: u32) -> (f64, f64) {
    tracing.show(look, coarseness).unwrap();
    let (_, texels) = tracing.texels().unwrap();
    let count = texels.len() as f64;
    let black = texels.iter().filter(|texel| texel[..3].iter().all(|channel| *channel <= 1)).count();
    let sum: f64 = texels.iter().flat_map(|texel| &texel[..3]).map(|channel| f64::from(*channel)).sum();
    (black as f64 / count, sum / (3.0 * count))
}

#[test]
fn a_moving_picture_has_no_holes_and_does_not_flicker() {
    let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
    for mode in ["fv", "vp", "od"] {
        let args = args(&format!("fovea --mode {mode} --seed 5 --max-bounces 2 --film-memory 64"));
        let scene = session::load(&Source::BuiltIn, &args.scene).unwrap().scene;
        let mut look = look(&scene, &args);
        let mut tracing = Tracing::new(gpu.clone(), args);
        tracing.set_scene(Arc::clone(&scene)).unwrap();
        let (low, high) = scene.bounds().unwrap();
        let pivot = (low + high) * 0.5;
        let mut last: Option<f64> = None;
        let (mut largest_change, mut most_black) = (0.0f64, 0.0f64);
        for frame in 0..FRAMES {
            // It starts with nothing but a first batch. The view goes about the scene, then forwards, and then an object is
            // dragged, each of which starts the film anew.
            match frame {
                0 => {}
                1..6 => look.standpoint = look.standpoint.orbited(pivot, Vec2::new(0.02, -0.005)),
                6..11 => look.standpoint.position += look.standpoint.view.direction_at(Vec2::ZERO) * 0.05,
                _ => {
                    let mut version = (*scene).clone();
                    let moved = Vec3::X * 0.02 * (frame - 10) as f32;
                    version.instances[0].world_from_mesh.translation += glam::Vec3A::from(moved);
                    tracing.set_scene(Arc::new(version)).unwrap();
                }
            }
            tracing.follow(&look).unwrap();
            tracing.trace(FIRST_BATCH).unwrap();
            tracing.set_smoothing(SMOOTHING_WHILE_MOVING);
            let (black, brightness) = judged(&mut tracing, &look, 2);
            let change = last.map_or(0.0, |last| (brightness / last - 1.0).abs());
            eprintln!("{mode} frame {frame}: {:.3} % black, brightness {brightness:.1}", 100.0 * black);
            largest_change = largest_change.max(change);
            most_black = most_black.max(black);
            last = Some(brightness);
        }
        eprintln!("{mode}: at most {:.3} % black, {:.2} % change", 100.0 * most_black, 100.0 * largest_change);
        // Samples that found no light may lie together where there are few. Without smoothing FV has 2.2 % at most, 1.1 % on average,
        // and its brightness changes by 4 %.
        assert!(most_black <= 5e-4, "{mode}: {most_black}");
        assert!(largest_change < 0.02, "{mode}: {largest_change}");

        // Without a sample, as while tracing is paused, the last picture stands in, also where it does not reach.
        look.standpoint.view.yaw += 0.3;
        tracing.follow(&look).unwrap();
        tracing.restart();
        let (black, brightness) = judged(&mut tracing, &look, 1);
        eprintln!("{mode} turned without a sample: {:.3} % black, brightness {brightness:.1}", 100.0 * black);
        assert_eq!(black, 0.0, "{mode}");
    }
}
