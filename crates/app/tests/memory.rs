//! Memory after many edits and reloads is what it was after the first of them.
//!
//! Judged is what is in use: bytes that were asked of the allocator, and bytes of the device; and, with a margin, resident memory, of
//! a process of its own for each test whose allocator keeps little back: by default glibc keeps blocks of up to 32 MiB for each
//! thread, and 60 reloads ended between 0.7 and 6.9 % above their beginning whether anything leaks or not. One thing still comes and
//! goes there, the last of the 32 MiB blocks that wgpu cuts the device's memory from, which is the margin.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
// Where both can be read.
#![cfg(all(target_os = "linux", target_env = "gnu"))]

use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Rect, pos2};
use fovea_app::cli;
use fovea_app::document::edits::{Edit, LightEdit, Move};
use fovea_app::document::parameters::{MaterialParameter, Value};
use fovea_app::document::{Document, Gesture};
use fovea_app::gaze::hub::GazeHub;
use fovea_app::preview::controls::Controls;
use fovea_app::preview::engine::{Engine, Look};
use fovea_app::preview::gaze::{Gaze, ScreenMapping};
use fovea_app::preview::navigation::Navigation;
use fovea_app::reload::rule::Timing;
use fovea_app::reload::{LoadEvent, Loader};
use fovea_app::session::{self, Loaded, Source};
use glam::{UVec2, Vec3};
use serde_json::json;
use tracer::gpu::{AdapterSelect, Gpu};

#[path = "support/figures.rs"]
mod figures;
#[path = "support/glb.rs"]
mod glb;

/// What makes glibc's allocator give blocks back, and take all threads' small ones from one place.
const ALLOCATOR: [(&str, &str); 3] =
    [("MALLOC_MMAP_THRESHOLD_", "131072"), ("MALLOC_TRIM_THRESHOLD_", "131072"), ("MALLOC_ARENA_MAX", "1")];

/// Runs the test of this name in a process of its own; true within it.
fn is_alone(test: &str) -> bool {
    if std::env::var_os("FOVEA_MEMORY_TEST").is_some() {
        return true;
    }
    let status = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture"])
        .env("FOVEA_MEMORY_TEST", test)
        .envs(ALLOCATOR)
        .status()
        .unwrap();
    assert!(status.success(), "{test} in a process of its own: {status}");
    false
}

/// The scene's version of this number: the built-in one with a lamp, whose colours, places and number of objects change.
fn file(number: usize) -> Vec<u8> {
    glb::with_json(tracer::builtin::BYTES, |document| {
        document["extensions"]["KHR_lights_punctual"]["lights"] = json!([{ "type": "point", "intensity": 5.0 }]);
        document["extensionsUsed"].as_array_mut().unwrap().push(json!("KHR_lights_punctual"));
        let lamp = json!({ "name": "lamp", "translation": [0.5, 2.0, 0.5],
            "extensions": { "KHR_lights_punctual": { "light": 0 } } });
        let nodes = document["nodes"].as_array_mut().unwrap();
        nodes.push(lamp);
        let index = nodes.len() - 1;
        let vase = nodes.iter_mut().find(|node| node["name"] == "vase").unwrap();
        vase["translation"] = json!([0.0, 0.0, 0.05 * (number % 3) as f64]);
        let roots = document["scenes"][0]["nodes"].as_array_mut().unwrap();
        // Every tenth version lacks an object: its geometry is another.
        if number % 10 == 9 {
            roots.remove(0);
        }
        roots.push(json!(index));
        let red = 0.1 + 0.8 * (number % 7) as f64 / 7.0;
        glb::material(document, "glazed red")["pbrMetallicRoughness"]["baseColorFactor"] = json!([red, 0.1, 0.1, 1.0]);
    })
}

/// An engine that shows a document, without a window.
struct Session {
    engine: Engine,
    gpu: Gpu,
    look: Look,
    document: Document,
    /// Versions that the engine was given.
    given: u64,
}

impl Session {
    fn open(loaded: &Loaded) -> Self {
        // Guides are found where a picture rests, which goes by the machine's load, and bring kernels of 1 to 9 MB for each kind of
        // geometry. Kernels are kept, 48 at most: that is no leak, but would be 25 % over 1,000 reloads on a busy machine.
        let line = "fovea --max-bounces 1 --film-memory 16 --mode od --denoise off";
        let args = cli::parse(line.split(' ').map(Into::into)).unwrap();
        let args = args.preview;
        let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
        let hub = Arc::new(GazeHub::new(&[], None).unwrap());
        let engine = Engine::start(gpu.clone(), &args, hub, || ()).unwrap();
        let controls = Controls::from(&args);
        let rect = Rect::from_min_max(pos2(0.0, 0.0), pos2(160.0, 90.0));
        let camera = &session::viewpoints(&loaded.scene)[0];
        let look = Look {
            standpoint: Navigation::new(camera.position, camera.rotation, camera.vfov, 16.0 / 9.0, 8.0).standpoint,
            gaze: Gaze::default(),
            mapping: ScreenMapping::new(controls.screen, rect, None),
            controls,
            size_px: UVec2::new(160, 90),
            pointer: None,
        };
        let mut session = Self { engine, gpu, look, document: Document::new(loaded), given: 0 };
        session.show();
        session
    }

    /// Gives the engine the document's version and waits for its picture.
    fn show(&mut self) {
        self.engine.set_scene(Arc::clone(self.document.version()));
        self.given += 1;
        let start = Instant::now();
        loop {
            self.engine.look(self.look.clone());
            let state = self.engine.state();
            if state.version.number == self.given {
                return;
            }
            let words = state.message.as_ref().map_or("", |message| &message.text);
            assert!(start.elapsed() < Duration::from_secs(120) && !state.dead, "version {}: {words}", self.given);
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// A change of every kind in turn, and what it changes now and then taken back.
    fn edit(&mut self, number: usize) {
        let step = number / 5;
        let share = (step % 11) as f32 / 11.0;
        let node = |name| self.document.nodes().iter().position(|node| node.name == name).unwrap() as u32;
        let material = |name| self.document.version().materials.iter().position(|m| m.name == name).unwrap() as u32;
        let edit = match number % 5 {
            0 => Edit::Move(node("vase"), Move { translation: Vec3::new(0.0, share, 0.1), ..Move::default() }),
            1 => {
                let color = Value::Color(Vec3::new(0.8, 0.2, share));
                Edit::Material(material("glazed red"), MaterialParameter::BaseColor, color)
            }
            2 => Edit::Light(0, LightEdit { intensity: Some(Vec3::splat(1.0 + share)), ..LightEdit::default() }),
            3 => Edit::Hide(node("globe"), step.is_multiple_of(2)),
            // Crosses a feature's edge.
            _ => Edit::Material(material("clay"), MaterialParameter::Clearcoat, Value::Number((step % 2) as f32)),
        };
        let before = Arc::clone(self.document.version());
        self.document.edit(&edit, Gesture::Once);
        if number.is_multiple_of(17) {
            self.document.undo();
        }
        if !Arc::ptr_eq(&before, self.document.version()) {
            self.show();
        }
    }

    fn memory(&self) -> Memory {
        let device = self.gpu.device.generate_allocator_report().unwrap();
        // A CPU adapter's memory is the allocator's.
        assert!(self.gpu.is_software());
        let allocator = mallinfo2();
        Memory {
            in_use: (allocator.uordblks + allocator.hblkhd) as f64 - device.total_reserved_bytes as f64,
            device: device.total_allocated_bytes as f64,
            resident: resident("RssAnon:") + resident("RssShmem:"),
        }
    }
}

/// Bytes.
#[derive(Clone, Copy, Default)]
struct Memory {
    /// Asked of the allocator by anything in the process, the device's blocks left out.
    in_use: f64,
    /// Of buffers and textures.
    device: f64,
    /// Pages of this process but those of files.
    resident: f64,
}

/// glibc's figures of its allocator, bytes; `man 3 mallinfo`.
#[repr(C)]
struct Mallinfo2 {
    arena: usize,
    ordblks: usize,
    smblks: usize,
    hblks: usize,
    /// In blocks that the system gave one by one.
    hblkhd: usize,
    usmblks: usize,
    fsmblks: usize,
    /// In all others that are in use.
    uordblks: usize,
    fordblks: usize,
    keepcost: usize,
}

#[expect(unsafe_code, reason = "only glibc knows; the function takes nothing and returns numbers")]
unsafe extern "C" {
    safe fn mallinfo2() -> Mallinfo2;
}

/// Resident bytes of this process of one kind, as Linux names it.
fn resident(kind: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix(kind)).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() * 1024.0
}

/// How much the memory in use and the device's grow between the first tenth and the end of so many steps; each is the mean over a
/// twentieth of the steps and over 20 at least, two rounds of the file's ten versions. Third is what is resident, without one
/// block of the device's memory.
fn growth(what: &str, count: usize, session: &mut Session, mut step: impl FnMut(&mut Session, usize)) -> [f64; 3] {
    let start = Instant::now();
    let window = (count / 20).max(20);
    let (first, last) = (count / 10..count / 10 + window, count - window..count);
    let mut means = [Memory::default(); 2];
    for number in 0..count {
        step(session, number);
        let now = session.memory();
        if number % (count / 10) == 0 {
            let [in_use, device, resident] = [now.in_use, now.device, now.resident].map(|bytes| bytes / 1e6);
            eprintln!("{what} {number}: {in_use:.2} MB in use, {device:.2} on the device, {resident:.1} resident");
        }
        for (mean, range) in means.iter_mut().zip([&first, &last]) {
            if range.contains(&number) {
                mean.in_use += now.in_use / window as f64;
                mean.device += now.device / window as f64;
                mean.resident += now.resident / window as f64;
            }
        }
    }
    let grown = |of: fn(&Memory) -> f64| of(&means[1]) / of(&means[0]) - 1.0;
    let figures = |of: fn(&Memory) -> f64| json!({ "after_first_tenth": of(&means[0]), "after_last_tenth": of(&means[1]), "growth": grown(of) });
    let figures = json!({
        "count": count,
        "seconds": start.elapsed().as_secs_f64(),
        "bytes_in_use": figures(|memory| memory.in_use),
        "device_bytes": figures(|memory| memory.device),
        "resident_bytes": figures(|memory| memory.resident),
    });
    eprintln!("{what}: {figures}");
    figures::keep(&format!("memory-{what}"), &session.gpu.info().name, figures);
    let resident = (means[1].resident - BLOCK_BYTES) / means[0].resident - 1.0;
    [grown(|memory| memory.in_use), grown(|memory| memory.device), resident]
}

/// The largest blocks that wgpu cuts the device's memory from, as resident as the process; the last of them comes and goes.
const BLOCK_BYTES: f64 = (32 << 20) as f64;

/// Growth that counts as a leak.
const LEAK: f64 = 0.02;

fn is_long() -> bool {
    std::env::var_os("FOVEA_LONG").is_some()
}

fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("fovea-memory-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn open(loader: &Loader, path: &std::path::Path) -> Loaded {
    loader.open(Source::File(path.to_owned()));
    loop {
        match wait(loader) {
            LoadEvent::Opened(_, loaded) => return loaded,
            // Nobody sketches here.
            LoadEvent::Shapes(..) => {}
            other => panic!("{other:?}"),
        }
    }
}

fn wait(loader: &Loader) -> LoadEvent {
    let start = Instant::now();
    loop {
        if let Some(event) = loader.poll() {
            return event;
        }
        assert!(start.elapsed() < Duration::from_secs(120), "nothing came");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn loader() -> Loader {
    let timing = Timing { quiet: Duration::from_millis(20), ..Timing::default() };
    Loader::start(cli::parse(["fovea".into()]).unwrap().preview.scene, timing, || {}).unwrap()
}

#[test]
fn edits_leave_no_memory_behind() {
    if !is_alone("edits_leave_no_memory_behind") {
        return;
    }
    let folder = scratch("edits");
    let path = folder.join("room.glb");
    std::fs::write(&path, file(0)).unwrap();
    let mut session = Session::open(&open(&loader(), &path));
    // All that is made once: kernels, and hierarchies of what moves.
    (0..10).for_each(|number| session.edit(number));
    let count = if is_long() { 10_000 } else { 300 };
    let growth = growth("edits", count, &mut session, |session, number| session.edit(10 + number));
    assert!(growth.iter().all(|growth| *growth <= LEAK), "memory grows: {growth:?}");
    drop(session);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn reloads_leave_no_memory_behind() {
    if !is_alone("reloads_leave_no_memory_behind") {
        return;
    }
    let folder = scratch("reloads");
    let path = folder.join("room.glb");
    std::fs::write(&path, file(0)).unwrap();
    let loader = loader();
    let mut session = Session::open(&open(&loader, &path));
    let reload = |session: &mut Session, number: usize| {
        // Beside it, then in its place: an exporter's next version is never half there.
        std::fs::write(path.with_extension("part"), file(number)).unwrap();
        std::fs::rename(path.with_extension("part"), &path).unwrap();
        match wait(&loader) {
            LoadEvent::Changed(loaded) => session.document.follow_file(&loaded, None),
            other => panic!("{other:?}"),
        };
        session.show();
    };
    (0..20).for_each(|number| reload(&mut session, number));
    let count = if is_long() { 1000 } else { 60 };
    let growth = growth("reloads", count, &mut session, |session, number| reload(session, 20 + number));
    assert!(growth.iter().all(|growth| *growth <= LEAK), "memory grows: {growth:?}");
    drop(session);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_leak_is_noticed() {
    if !is_alone("a_leak_is_noticed") {
        return;
    }
    let folder = scratch("leak");
    let path = folder.join("room.glb");
    std::fs::write(&path, file(0)).unwrap();
    let mut session = Session::open(&open(&loader(), &path));
    (0..10).for_each(|number| session.edit(number));
    let mut kept = Vec::new();
    let growth = growth("a leak", 60, &mut session, |session, number| {
        session.edit(10 + number);
        // Some 13 MB between the two windows.
        kept.push(vec![1u8; 384 << 10]);
    });
    assert!(growth[0] > LEAK, "{} kept blocks are not noticed: {growth:?}", kept.len());
    drop(session);
    std::fs::remove_dir_all(folder).unwrap();
}
