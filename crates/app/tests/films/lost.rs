//! A preview whose device is lost goes on over another with the film that was kept, and one that resumes a file with that.

use std::ffi::OsString;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Rect, pos2};
use fovea_app::cli::{self, PreviewArgs};
use fovea_app::gaze::hub::GazeHub;
use fovea_app::preview::controls::Controls;
use fovea_app::preview::engine::{Engine, Look, Request, State};
use fovea_app::preview::gaze::{Gaze, ScreenMapping};
use fovea_app::preview::navigation::Navigation;
use fovea_app::preview::tracing::Tracing;
use fovea_app::session::{self, Source};
use glam::UVec2;
use tracer::distribution::Distribution;
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::renderer::Renderer;
use tracer::scene::Scene;

use crate::support::Folder;

pub fn args(line: &str) -> PreviewArgs {
    cli::parse(line.split_whitespace().map(OsString::from)).unwrap().preview
}

pub fn gpu() -> Gpu {
    Gpu::headless(&AdapterSelect::Auto).unwrap()
}

pub fn scene(folder: &Folder, args: &PreviewArgs) -> Arc<Scene> {
    session::load(&Source::File(folder.path("square.gltf")), &args.scene).unwrap().scene
}

/// A window of 160x90 pixels at the scene's camera.
pub fn look(scene: &Scene, args: &PreviewArgs) -> Look {
    let camera = &session::viewpoints(scene)[0];
    let controls = Controls::from(args);
    let rect = Rect::from_min_max(pos2(0.0, 0.0), pos2(160.0, 90.0));
    let mapping = ScreenMapping::new(controls.screen, rect, None);
    let navigation = Navigation::new(camera.position, camera.rotation, camera.vfov, 160.0 / 90.0, 4.0);
    let size_px = UVec2::new(160, 90);
    Look { standpoint: navigation.standpoint, gaze: Gaze::default(), controls, mapping, size_px, pointer: None }
}

pub const LINE: &str = "fovea --mode od --seed 3 --max-bounces 2 --film-memory 16 --background 0.5,0.75,1";

#[test]
fn a_film_goes_on_over_another_device_to_the_same_bytes() {
    let folder = Folder::new("lost-bytes");
    let args = args(LINE);
    let scene = scene(&folder, &args);
    let look = look(&scene, &args);
    let first_device = gpu();
    let mut first = Tracing::new(first_device.clone(), args.clone());
    first.set_scene(Arc::clone(&scene)).unwrap();
    first.follow(&look).unwrap();
    first.trace(1 << 14).unwrap();
    let kept = first.snapshot().unwrap().unwrap();
    first.trace(1 << 14).unwrap();
    first_device.lose();
    assert!(first.trace(1 << 14).is_err() && first.snapshot().is_err(), "a lost device answers with errors");
    drop(first);

    let second_device = gpu();
    let mut second = Tracing::new(second_device.clone(), args);
    assert!(second.go_on(&kept).unwrap_err().to_string().contains("no scene"));
    second.set_scene(Arc::clone(&scene)).unwrap();
    second.go_on(&kept).unwrap();
    assert!(!second.must_prepare(&look), "the film suits the window that it was made for");
    second.follow(&look).unwrap();
    assert_eq!(second.samples(), 1 << 14);
    second.trace(1 << 14).unwrap();
    let film = second.snapshot().unwrap().unwrap();
    assert_eq!(film.header.samples(), 1 << 15);

    // The same in one go, without a window.
    let everywhere = Distribution::omnidirectional(look.controls.acuity.inverse().unwrap());
    let mut plain = Renderer::new(&second_device, &film.header.renderer_options(), everywhere).unwrap();
    plain.set_scene(&scene).unwrap();
    plain.set_pose(film.header.pose);
    plain.trace(1 << 14).unwrap();
    plain.trace(1 << 14).unwrap();
    assert!(plain.snapshot().unwrap() == film);
}

/// Waits for a state; panics after a minute.
pub fn wait_for(engine: &Engine, what: &str, mut arrived: impl FnMut(&State) -> bool) -> State {
    let start = Instant::now();
    loop {
        let state = engine.state();
        if arrived(&state) {
            return state;
        }
        assert!(!state.dead && start.elapsed() < Duration::from_secs(60), "{what}: {state:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn an_engine_says_that_its_device_is_lost_and_hands_over_what_it_kept() {
    let folder = Folder::new("lost-engine");
    let args = args(LINE);
    let scene = scene(&folder, &args);
    let look = look(&scene, &args);
    let gaze = Arc::new(GazeHub::new(&args.gaze.sources, None).unwrap());
    let device = gpu();
    let engine = Engine::start(device.clone(), &args, Arc::clone(&gaze), || {}).unwrap();
    engine.set_scene(Arc::clone(&scene));
    engine.look(look.clone());
    let kept = |engine: &Engine| engine.survivors().film.map_or(0, |film| film.header.samples());
    wait_for(&engine, "a film is kept", |_| kept(&engine) > 100_000);
    device.lose();
    let state = wait_for(&engine, "the loss is noticed", |state| state.lost);
    assert!(!state.dead && state.message.is_none(), "{state:?}");
    let survivors = engine.survivors();
    drop(engine);

    let film = survivors.film.unwrap();
    let kept = film.header.samples();
    let engine = Engine::start(gpu(), &args, gaze, || {}).unwrap();
    // A film that comes first waits for its scene.
    engine.request(Request::GoOn(film));
    std::thread::sleep(Duration::from_millis(200));
    engine.set_scene(survivors.scene.unwrap());
    engine.look(look);
    let state = wait_for(&engine, "the picture", |state| state.picture.is_some());
    eprintln!("kept {kept} samples, {} in the first picture after it", state.readout.samples);
    assert!((kept + 1..2 * kept).contains(&state.readout.samples), "{state:?}");
    assert!(!state.lost && state.message.is_none(), "{state:?}");
}

/// As when a film is dropped onto a window that stands elsewhere.
#[test]
fn a_running_engine_goes_on_with_a_film_from_where_it_was_taken() {
    let folder = Folder::new("dropped-film");
    let args = args(LINE);
    let scene = scene(&folder, &args);
    let look = look(&scene, &args);
    let device = gpu();
    let mut tracing = Tracing::new(device.clone(), args.clone());
    tracing.set_scene(Arc::clone(&scene)).unwrap();
    tracing.follow(&look).unwrap();
    tracing.trace(1 << 14).unwrap();
    let film = Arc::new(tracing.snapshot().unwrap().unwrap());
    drop(tracing);

    let gaze = Arc::new(GazeHub::new(&args.gaze.sources, None).unwrap());
    let engine = Engine::start(device, &args, gaze, || {}).unwrap();
    engine.set_scene(scene);
    let mut elsewhere = look.clone();
    elsewhere.standpoint.position.z += 0.5;
    engine.look(elsewhere);
    wait_for(&engine, "a picture from elsewhere", |state| state.readout.samples > 0);
    // The window says where it looks before it asks. Paused, the film stays as it was taken.
    let mut there = look;
    there.controls.paused = true;
    engine.look(there.clone());
    engine.request(Request::GoOn(film));
    let state = wait_for(&engine, "the film", |state| state.taken_over == 1 << 14 && state.readout.samples == 1 << 14);
    assert!(state.message.is_none(), "{state:?}");
    there.controls.paused = false;
    engine.look(there);
    wait_for(&engine, "it goes on", |state| state.readout.samples > 1 << 14);
}
