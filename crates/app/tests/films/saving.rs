//! Films that are saved from the window while it goes on, or closes.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use fovea_app::gaze::hub::GazeHub;
use fovea_app::output::exr;
use fovea_app::preview::engine::{Destination, Engine, Request};

use crate::lost::{LINE, args, gpu, look, scene, wait_for};
use crate::support::Folder;

#[test]
fn two_films_at_once_are_two_files_even_when_the_window_closes() {
    let folder = Folder::new("saved-films");
    let args = args(&format!("{LINE} --denoise off"));
    let scene = scene(&folder, &args);
    let mut look = look(&scene, &args);
    let gaze = Arc::new(GazeHub::new(&[], None).unwrap());
    let first = folder.path("a room-1.exr");
    // When the window was last drawn, and whether the first file was there.
    let drawn = Arc::new(Mutex::new((Instant::now(), false)));
    let repaint = {
        let (first, drawn) = (first.clone(), Arc::clone(&drawn));
        move || *drawn.lock().unwrap() = (Instant::now(), first.exists())
    };
    let engine = Engine::start(gpu(), &args, gaze, repaint).unwrap();
    engine.set_scene(scene);
    engine.look(look.clone());
    wait_for(&engine, "samples", |state| state.readout.samples > 0);
    // A paused window is drawn again for what there is to tell, and for nothing else.
    look.controls.paused = true;
    engine.look(look);
    wait_for(&engine, "a window at rest", |_| drawn.lock().unwrap().0.elapsed() > Duration::from_secs(1));
    let to = || Destination::Free { folder: folder.path("."), scene: "a room.glb".into() };
    engine.request(Request::SaveExr(to()));
    wait_for(&engine, "the window is drawn", |_| drawn.lock().unwrap().1);
    let state = wait_for(&engine, "a message", |state| state.message.is_some());
    assert!(state.message.is_some_and(|message| message.text.starts_with("saved") && !message.wrong));

    engine.request(Request::SaveExr(to()));
    engine.request(Request::SaveExr(to()));
    drop(engine);
    for number in 1..=3 {
        exr::read(&folder.path(&format!("a room-{number}.exr"))).unwrap();
    }
    assert!(!folder.names().iter().any(|name| name.ends_with(".part")), "{:?}", folder.names());
}
