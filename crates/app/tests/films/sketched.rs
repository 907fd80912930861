//! A scene that is still being read can be seen and walked about in, and what comes of it is the film of any other.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fovea_app::gaze::hub::GazeHub;
use fovea_app::preview::engine::Engine;
use fovea_app::preview::tracing::Tracing;
use fovea_app::reload::rule::Timing;
use fovea_app::reload::{LoadEvent, Loader, Sketchable};
use fovea_app::session::Source;

use super::lost::{LINE, args, gpu, look, scene, wait_for};
use crate::support::Folder;

fn until<T>(mut wanted: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = wanted() {
            return found;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "nothing came");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The shapes that come before the scene, and the loader that reads it.
fn shapes(folder: &Folder) -> (Sketchable, Loader) {
    let loader = Loader::start(args(LINE).scene, Timing::default(), || {}).unwrap();
    loader.open(Source::File(folder.path("square.gltf")));
    let shapes = until(|| match loader.poll()? {
        LoadEvent::Shapes(_, sketchable) => Some(sketchable),
        other => panic!("{other:?} came first"),
    });
    (shapes, loader)
}

#[test]
fn a_scene_that_is_being_read_is_sketched_from_wherever_one_goes() {
    let folder = Folder::new("sketched");
    let args = args(LINE);
    let (sketchable, loader) = shapes(&folder);
    let mut look = look(&sketchable.shapes.scene, &args);
    let hub = Arc::new(GazeHub::new(&args.gaze.sources, None).unwrap());
    let repaints = Arc::new(AtomicU32::new(0));
    let count = Arc::clone(&repaints);
    let engine = Engine::start(gpu(), &args, hub, move || _ = count.fetch_add(1, Ordering::Relaxed)).unwrap();
    engine.look(look.clone());
    engine.sketch(sketchable);
    wait_for(&engine, "a sketch", |state| state.picture.is_some() && state.is_sketch);
    // Nothing is drawn again for nothing.
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(repaints.load(Ordering::Relaxed), 1);
    look.standpoint.position.x += 0.1;
    engine.look(look.clone());
    until(|| (repaints.load(Ordering::Relaxed) == 2).then_some(()));
    assert!(engine.state().is_sketch && engine.state().readout.samples == 0);

    // With the sketch the reading of images goes on.
    let loaded = until(|| match loader.poll()? {
        LoadEvent::Opened(_, loaded) => Some(loaded),
        other => panic!("{other:?} came first"),
    });
    engine.set_scene(loaded.scene);
    let traced = wait_for(&engine, "a picture", |state| state.picture.is_some() && !state.is_sketch);
    assert!(traced.message.is_none() && traced.readout.samples > 0, "{:?}", traced.message);
}

#[test]
fn the_film_is_the_same_after_sketches_of_other_places() {
    let folder = Folder::new("sketched-film");
    let args = args(LINE);
    let scene = scene(&folder, &args);
    let look = look(&scene, &args);
    let film = |sketches: bool| {
        let mut tracing = Tracing::new(gpu(), args.clone());
        if sketches {
            let mut elsewhere = look.clone();
            elsewhere.size_px *= 2;
            elsewhere.standpoint.position.z += 0.5;
            tracing.sketch(&shapes(&folder).0.shapes.scene, &elsewhere).unwrap();
            tracing.sketch(&scene, &look).unwrap();
        }
        tracing.set_scene(Arc::clone(&scene)).unwrap();
        tracing.follow(&look).unwrap();
        tracing.trace(1 << 12).unwrap();
        tracing.snapshot().unwrap().unwrap()
    };
    let [plain, after] = [false, true].map(film);
    assert_eq!(plain.header, after.header);
    assert!(plain.words == after.words);
}
