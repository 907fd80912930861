//! The window without a display: its frames, an engine and a loader.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use egui_kittest::Harness;
use serde_json::{Map, json};
use tracer::distribution::Distribution;
use tracer::film::FilmOptions;
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::renderer::{Renderer, RendererOptions};

use super::*;
use crate::cli;
use crate::gaze::hub::GazeHub;
use crate::reload::rule::Timing;
use crate::session;

/// Of the window, points.
const SIZE: [f32; 2] = [320.0, 180.0];

/// A file as the system drops it.
#[derive(Debug)]
pub(super) struct Dropped(pub PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

/// A folder with the built-in scene twice and an environment, large enough to be read for some frames.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("fovea-frames-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    for name in ["room.glb", "other.glb"] {
        std::fs::write(folder.join(name), tracer::builtin::BYTES).unwrap();
    }
    let (width, height) = (1024, 512);
    let mut bytes = Vec::new();
    let grey = vec![image::Rgb([0.5_f32; 3]); width * height];
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&grey, width, height).unwrap();
    std::fs::write(folder.join("sky.hdr"), bytes).unwrap();
    folder
}

fn args() -> PreviewArgs {
    let line = "fovea --max-bounces 1 --film-memory 16 --mode od --denoise off";
    cli::parse(line.split(' ').map(Into::into)).unwrap().preview
}

pub(super) fn window(args: &PreviewArgs, gpu: &Gpu) -> Window {
    let gaze = Arc::new(GazeHub::new(&[], None).unwrap());
    let engine = Engine::start(gpu.clone(), args, Arc::clone(&gaze), || ()).unwrap();
    let loader = Loader::start(args.scene.clone(), Timing::default(), || ()).unwrap();
    let gaze = GazeControl::new(gaze, args);
    Window::new(engine, loader, String::new(), args, gaze, (Store::default(), None), None)
}

pub(super) fn frames(window: Window, size: [f32; 2]) -> Harness<'static, Window> {
    let mut frame = eframe::Frame::_new_kittest();
    let draw = move |ui: &mut Ui, window: &mut Window| eframe::App::ui(window, ui, &mut frame);
    Harness::builder().with_size(size).build_ui_state(draw, window)
}

pub(super) fn step_until(harness: &mut Harness<'_, Window>, what: &str, arrived: impl Fn(&Window) -> bool) {
    let start = Instant::now();
    while !arrived(harness.state()) {
        let said = harness.state().note.as_ref().map(|note| &note.text);
        assert!(start.elapsed() < Duration::from_secs(120), "{what}: {said:?}, {:?}", harness.state().engine.state());
        harness.step();
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn drop_files(harness: &mut Harness<'_, Window>, folder: &Path, names: &[&str]) {
    let files = names.iter().map(|name| Arc::new(Dropped(folder.join(name))) as egui::DroppedFileHandle);
    harness.input_mut().dropped_files = files.collect();
    harness.step();
    harness.input_mut().dropped_files.clear();
}

#[test]
fn a_film_waits_for_the_environment_that_its_edits_name() {
    let (folder, args) = (folder("film"), args());
    let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
    let (room, sky) = (Source::File(folder.join("room.glb")), folder.join("sky.hdr"));
    let lit = cli::SceneArgs { env: Some(sky), ..args.scene.clone() };
    let scene = session::load(&room, &lit).unwrap().scene;
    let options = RendererOptions { film: FilmOptions::equirect(64, 32), ..RendererOptions::default() };
    let inverse = args.sampling.acuity().inverse().unwrap();
    let mut renderer = Renderer::new(&gpu, &options, Distribution::omnidirectional(inverse)).unwrap();
    renderer.set_scene(&scene).unwrap();
    renderer.trace(1 << 12).unwrap();
    let film = renderer.snapshot().unwrap();
    drop(renderer);
    let edits = json!({ "format": "fovea-edits", "version": 1, "environment": { "image": "sky.hdr" } });
    std::fs::write(folder.join("room.glb.fovea.json"), edits.to_string()).unwrap();

    let mut window = window(&args, &gpu);
    window.loader.open(room);
    let mut settings = Map::new();
    settings.insert("scene".into(), scene.name.clone().into());
    window.resume(&folder.join("film.exr"), Box::new(FilmFile::new(film, settings)));
    let mut harness = frames(window, SIZE);
    let gone_on = |window: &Window| {
        let wrong = window.note.as_ref().is_some_and(|note| note.wrong);
        assert!(!wrong, "{:?}", window.note);
        window.engine.state().taken_over == 1 << 12
    };
    step_until(&mut harness, "the film goes on", gone_on);
    assert!(harness.state().engine.state().message.is_none());
    drop(harness);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_is_dropped_with_or_before_a_scene_is_for_that_scene() {
    let (folder, args) = (folder("dropped"), args());
    let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
    let mut harness = frames(window(&args, &gpu), SIZE);
    drop_files(&mut harness, &folder, &["sky.hdr"]);
    assert!(harness.state().note.as_ref().unwrap().text.contains("sky.hdr is taken"));
    let is_lit = |window: &Window, scene: &str| {
        let editor = window.editor.as_ref().filter(|editor| editor.source().name() == scene);
        editor.is_some_and(|editor| {
            editor.document().edits().environment.image == Some(folder.join("sky.hdr")) && !editor.awaits_environment()
        })
    };
    drop_files(&mut harness, &folder, &["room.glb"]);
    step_until(&mut harness, "the first scene", |window| is_lit(window, "room.glb"));
    harness.state_mut().editor.as_mut().unwrap().act(editor::panel::Action::Undo);
    drop_files(&mut harness, &folder, &["sky.hdr", "other.glb", "room.glb"]);
    assert!(harness.state().note.as_ref().unwrap().text.contains("room.glb"), "it says what it leaves");
    let present = harness.state().editor.as_ref().unwrap();
    assert!(present.document().edits().is_empty(), "the present scene is not lit by it");
    step_until(&mut harness, "the other scene", |window| is_lit(window, "other.glb"));
    drop(harness);
    std::fs::remove_dir_all(folder).unwrap();
}
