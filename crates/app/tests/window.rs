//! The real window, on a display of its own (Xvfb), driven as a person drives it (xdotool).
//!
//! Needs Linux with `Xvfb` and `xdotool`, which scripts/test installs; elsewhere the test says that it did not run.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![cfg(target_os = "linux")]

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use image::RgbImage;
use serde_json::Value;

#[path = "window/exports.rs"]
mod exports;
#[path = "support/figures.rs"]
mod figures;
#[path = "support/glb.rs"]
mod glb;
#[path = "window/slider.rs"]
mod slider;

/// Two windows on one CPU adapter would measure each other.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// An X server without a screen; stopped when dropped.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// `None` when Xvfb or xdotool is not installed.
    fn start() -> Option<Self> {
        Command::new("xdotool").arg("version").output().ok()?;
        let mut server = Command::new("Xvfb")
            // Without -noreset the server starts anew whenever the last client leaves, and refuses clients meanwhile.
            .args(["-displayfd", "1", "-screen", "0", "1280x720x24", "-nolisten", "tcp", "-noreset"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Some(Self { server, name: format!(":{}", number.trim()) })
    }

    /// Runs xdotool; its standard output.
    fn xdotool(&self, arguments: &str) -> String {
        let output = Command::new("xdotool").env("DISPLAY", &self.name).args(arguments.split(' ')).output().unwrap();
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// Waits until a window has this in its title: its scene is open.
    fn wait_for_title(&self, title: &str) {
        let start = Instant::now();
        while self.xdotool(&format!("search --name {title}")).is_empty() {
            assert!(start.elapsed() < Duration::from_secs(120), "the scene does not open");
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    /// Opens the built-in scene, does `actions` once there is a window, and returns what the window showed and said.
    fn session(&self, seconds: u32, options: &[&str], actions: impl Fn(&Self)) -> (RgbImage, Value) {
        let settings = self.settings("usual");
        let shown = self.session_with(&settings, seconds, options, actions);
        std::fs::remove_dir_all(settings).unwrap();
        shown
    }

    /// An empty folder for the settings of windows: what somebody has set for their own screen is not the test's.
    fn settings(&self, name: &str) -> PathBuf {
        let number = self.name.trim_start_matches(':');
        let name = format!("fovea-window-settings-{name}-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// The same with settings that another window may have left.
    fn session_with(
        &self,
        settings: &Path,
        seconds: u32,
        options: &[&str],
        actions: impl Fn(&Self),
    ) -> (RgbImage, Value) {
        let picture = std::env::temp_dir().join(format!(
            "fovea-window-{}-{}.png",
            std::process::id(),
            self.name.trim_start_matches(':')
        ));
        let mut window = Command::new(env!("CARGO_BIN_EXE_fovea"))
            .env("DISPLAY", &self.name)
            .env_remove("WAYLAND_DISPLAY")
            .env("XDG_CONFIG_HOME", settings)
            .args(options)
            .args(["--screenshot-after", &seconds.to_string(), "--screenshot", picture.to_str().unwrap()])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let start = Instant::now();
        let id = loop {
            let id = self.xdotool("search --onlyvisible --name Fovea");
            if !id.is_empty() {
                break id;
            }
            if window.try_wait().unwrap().is_some() {
                let output = window.wait_with_output().unwrap();
                panic!("no window: {}", String::from_utf8_lossy(&output.stderr));
            }
            assert!(start.elapsed() < Duration::from_secs(120), "no window after two minutes");
            std::thread::sleep(Duration::from_millis(100));
        };
        // There is no window manager to give the window the keyboard.
        self.xdotool(&format!("windowfocus --sync {id}"));
        actions(self);
        let output = window.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let shown = image::open(&picture).unwrap().to_rgb8();
        std::fs::remove_file(picture).unwrap();
        (shown, serde_json::from_slice(&output.stdout).unwrap())
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // It may have ended by itself; either way it must not outlive the test.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// An empty folder of this test.
fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("fovea-window-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Mean of all channels in a square of 81 pixels a side.
fn brightness(picture: &RgbImage, x: u32, y: u32) -> f64 {
    let square = (x - 40..=x + 40).flat_map(|x| (y - 40..=y + 40).map(move |y| (x, y)));
    let values = square.flat_map(|(x, y)| picture.get_pixel(x, y).0.map(f64::from));
    values.sum::<f64>() / f64::from(81 * 81 * 3)
}

#[test]
fn the_fovea_follows_the_pointer_and_most_of_the_time_goes_into_tracing() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!(
            "SKIP the_fovea_follows_the_pointer_and_most_of_the_time_goes_into_tracing: Xvfb or xdotool is missing"
        );
        return;
    };
    let (left, right, y) = (480, 1060, 420);
    for (gaze, other) in [(left, right), (right, left)] {
        let (shown, figures) = display.session(12, &[], |display| {
            display.xdotool(&format!("mousemove {gaze} {y}"));
            std::thread::sleep(Duration::from_millis(500));
            // The film starts again, so that nothing in it is older than the gaze; the picture shows its density.
            display.xdotool("key ctrl+r");
            display.xdotool("key x");
        });
        assert_eq!(shown.dimensions(), (1280, 720));
        let ratio = brightness(&shown, gaze, y) / brightness(&shown, other, y);
        assert!(ratio > 1.2, "gaze at {gaze}: density {ratio} times that at {other}; {figures}");
        let number = |key: &str| figures[key].as_f64().unwrap();
        assert!(number("samples") > 0.0 && number("spp_at_gaze") > 0.0, "{figures}");
        assert_eq!(figures["mode"], "fv");
        // What is left for the window: the picture, the overlay, and what other programs take from both.
        assert!(number("tracing_share") > 0.6, "{figures}");
        eprintln!("gaze at {gaze}: density ratio {ratio:.2}, {figures}");
    }
}

#[test]
fn a_trackers_gaze_reaches_the_next_batch_wherever_the_pointer_is() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!("SKIP a_trackers_gaze_reaches_the_next_batch_wherever_the_pointer_is: Xvfb or xdotool is missing");
        return;
    };
    // Two seconds at 120 Hz at a point of the screen, which the window fills; the pointer is elsewhere.
    let (gaze_x, pointer_x, y) = (1060, 480, 420);
    let rows = (0..240).map(|step| {
        let time = f64::from(step) / 120.0;
        format!("{time:.6},{:.6},{:.6},1,1\n", f64::from(gaze_x) / 1280.0, f64::from(y) / 720.0)
    });
    let text = format!("# gaze-trace v1; space=screen01; rate_hz=120\n{}", rows.collect::<String>());
    let trace = std::env::temp_dir().join(format!("fovea-window-gaze-{}.csv", std::process::id()));
    std::fs::write(&trace, text).unwrap();
    let source = format!("trace:{},loop", trace.display());
    let (shown, figures) = display.session(8, &["--gaze", &source], |display| {
        display.xdotool(&format!("mousemove {pointer_x} {y}"));
        std::thread::sleep(Duration::from_millis(1500));
        display.xdotool("key ctrl+r");
        display.xdotool("key x");
        display.xdotool("key g");
    });
    std::fs::remove_file(trace).unwrap();
    let gaze = &figures["gaze"];
    assert_eq!(
        (gaze["sources"][0]["active"].as_bool(), gaze["position_known"].as_bool()),
        (Some(true), Some(true)),
        "{gaze}"
    );
    let ratio = brightness(&shown, gaze_x, y) / brightness(&shown, pointer_x, y);
    assert!(ratio > 1.2, "density {ratio} times that at the pointer; {figures}");
    // A sample waits for the frame that is under way, with its batch and picture, never longer. Frames are counted whether or not they
    // ask for the gaze.
    let ms = |key: &str| gaze[key].as_f64().unwrap();
    let (longest, frame) = (ms("longest_arrival_to_batch_ms"), ms("longest_frame_ms"));
    assert!(ms("arrival_to_batch_ms") <= longest && longest <= frame, "{gaze}");
    assert!(longest > 8.4, "samples that come during a batch count too: {gaze}");
    assert!(ms("age_ms") > 0.0, "{gaze}");
    eprintln!("density ratio {ratio:.2}, {figures}");
}

#[test]
fn a_window_opens_as_it_was_left_and_survives_every_size() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!("SKIP a_window_opens_as_it_was_left_and_survives_every_size: Xvfb or xdotool is missing");
        return;
    };
    let settings = display.settings("kept");
    let size_of = |display: &Display, size: &str| {
        let id = display.xdotool("search --onlyvisible --name Fovea");
        display.xdotool(&format!("windowsize --sync {id} {size}"));
        display.xdotool("sleep 0.5");
        id
    };
    let (shown, figures) = display.session_with(&settings, 12, &[], |display| {
        // As small as a window can get, out of sight and back.
        let id = size_of(display, "1 1");
        display.xdotool(&format!("windowunmap --sync {id} sleep 0.5 windowmap --sync {id} sleep 0.5"));
        size_of(display, "900 640");
        display.xdotool(&format!("windowfocus --sync {id}"));
        display.xdotool("mousemove 450 500 sleep 0.5 key m sleep 0.5 key bracketright sleep 0.5 key n sleep 0.5");
    });
    assert_eq!((shown.dimensions(), &figures["mode"]), ((900, 640), &Value::from("vp")), "{figures}");
    let kept: Value = serde_json::from_slice(&std::fs::read(settings.join("fovea/settings.json")).unwrap()).unwrap();
    assert_eq!((&kept["mode"], &kept["exposure_ev"]), (&Value::from("vp"), &Value::from(0.5)), "{kept}");
    assert_eq!((&kept["panels"]["scene"], &kept["theme"]), (&Value::from(true), &Value::from("system")), "{kept}");

    let (shown, figures) = display.session_with(&settings, 3, &[], |_| {});
    assert_eq!((shown.dimensions(), &figures["mode"]), ((900, 640), &Value::from("vp")), "{figures}");
    // The command line says more, and a broken file does no harm.
    std::fs::write(settings.join("fovea/settings.json"), "{").unwrap();
    let (shown, figures) = display.session_with(&settings, 3, &["--window", "800x600"], |_| {});
    assert_eq!((shown.dimensions(), &figures["mode"]), ((800, 600), &Value::from("fv")), "{figures}");
    std::fs::remove_dir_all(settings).unwrap();
}

#[test]
fn a_window_whose_device_is_lost_opens_again_and_its_film_goes_on() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!("SKIP a_window_whose_device_is_lost_opens_again_and_its_film_goes_on: Xvfb or xdotool is missing");
        return;
    };
    // Long enough for the film to have been kept, also where starting takes long.
    let (_, figures) = display.session(26, &["--lose-device-after", "18", "--film-memory", "64"], |_| {});
    let number = |key: &str| figures[key].as_u64().unwrap();
    assert!(number("taken_over") > 0, "nothing was kept, or the device was never lost: {figures}");
    assert!(number("samples") > number("taken_over"), "{figures}");
}

#[test]
fn a_window_goes_on_with_a_film_and_shows_it_to_a_viewer() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!("SKIP a_window_goes_on_with_a_film_and_shows_it_to_a_viewer: Xvfb or xdotool is missing");
        return;
    };
    let film = std::env::temp_dir().join(format!("fovea-window-film-{}.exr", std::process::id()));
    let rendered = Command::new(env!("CARGO_BIN_EXE_fovea"))
        .args(["render", "-o", film.to_str().unwrap(), "--film", "equirect:512x256", "--samples", "1000000"])
        .args(["--max-bounces", "0"])
        .output()
        .unwrap();
    assert!(rendered.status.success(), "{}", String::from_utf8_lossy(&rendered.stderr));
    let viewer = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = viewer.local_addr().unwrap().to_string();
    let received = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // The window may close in the middle of a packet.
        let _ = std::io::Read::read_to_end(&mut viewer.accept().unwrap().0, &mut bytes);
        bytes
    });
    let (_, figures) = display.session(4, &["--resume", film.to_str().unwrap(), "--tev", &address], |_| {});
    std::fs::remove_file(film).unwrap();
    // The film is coarse for this window, and stays all the same.
    assert_eq!(figures["film"], "512x256", "{figures}");
    assert_eq!(figures["taken_over"], 1_000_000, "{figures}");
    assert!(figures["samples"].as_u64().unwrap() > 1_000_000, "{figures}");
    // One picture of 1280x720 pixels of three floats at least.
    let received = received.join().unwrap();
    assert!(received.len() > 1280 * 720 * 12, "{} bytes", received.len());
}

/// Mean of a channel over mean green in a square of 31 pixels a side.
fn over_green(channel: usize, picture: &RgbImage, x: u32, y: u32) -> f64 {
    let square = || (x - 15..=x + 15).flat_map(|x| (y - 15..=y + 15).map(move |y| picture.get_pixel(x, y).0));
    let mean = |channel: usize| square().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
    mean(channel) / mean(1).max(1.0)
}

/// Mean red over mean green.
fn redness(picture: &RgbImage, x: u32, y: u32) -> f64 {
    over_green(0, picture, x, y)
}

#[test]
fn an_object_is_picked_moved_undone_and_saved_and_its_file_broken_and_mended() {
    const NAME: &str = "an_object_is_picked_moved_undone_and_saved_and_its_file_broken_and_mended";
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!("SKIP {NAME}: Xvfb or xdotool is missing");
        return;
    };
    let folder = scratch("scene");
    let (scene, sidecar) = (folder.join("room.glb"), folder.join("room.glb.fovea.json"));
    std::fs::write(&scene, tracer::builtin::BYTES).unwrap();
    let wait = |seconds: f64| std::thread::sleep(Duration::from_secs_f64(seconds));
    let saved = || -> Value { serde_json::from_slice(&std::fs::read(&sidecar).unwrap()).unwrap() };

    // Few bounces and plain colours: much is to be seen after few samples.
    let options = [scene.to_str().unwrap(), "--max-bounces", "1", "--tonemap", "linear"];
    // The red vase, its handle along X, its material in the panel, that one's colour, blue in the colour's window, and a
    // place of the panel where there is nothing to press.
    let (vase, handle, moved_to) = ((340, 560), (400, 533), (460, 533));
    let (material, colour, blue, nothing) = ((1080, 513), (1119, 422), (1040, 396), (1200, 380));
    let (shown, figures) = display.session(50, &options, |display| {
        let click = |(x, y): (u32, u32)| display.xdotool(&format!("mousemove {x} {y} sleep 0.8 click 1 sleep 1.2"));
        // A press and release within one frame are missed, and frames are long on a CPU.
        let press = |(x, y): (u32, u32)| {
            display.xdotool(&format!("mousemove {x} {y} sleep 0.8 mousedown 1 sleep 1.0 mouseup 1 sleep 1.0"))
        };
        display.wait_for_title("room.glb");
        wait(1.5);
        click(vase);
        display.xdotool("key n sleep 1.2");
        display.xdotool(&format!("mousemove {} {} sleep 0.8 mousedown 1 sleep 1.0", handle.0, handle.1));
        for step in 1..=4 {
            let x = handle.0 + (moved_to.0 - handle.0) * step / 4;
            display.xdotool(&format!("mousemove {x} {} sleep 0.3", handle.1));
        }
        display.xdotool("mouseup 1 sleep 1.0");
        // On a busy machine a press may fall between two frames; pressing twice changes nothing more.
        for attempt in 1.. {
            click(material);
            click(colour);
            press(blue);
            click(nothing);
            display.xdotool("key ctrl+e");
            wait(2.0);
            if sidecar.exists() && saved()["materials"].as_array().is_some_and(|materials| materials.len() == 1) {
                break;
            }
            assert!(attempt < 4, "the colour does not change");
        }
        display.xdotool("key ctrl+z sleep 0.8 key ctrl+shift+z sleep 0.8 key ctrl+e sleep 2.0");
        let edits = saved();
        let moved = edits["nodes"][0]["translation_m"][0].as_f64().unwrap_or_default();
        assert_eq!(
            (edits["nodes"][0]["name"].as_str(), edits["materials"].as_array().unwrap().len()),
            (Some("vase"), 1)
        );
        assert!((0.1..0.4).contains(&moved), "{edits}");
        let [red, blue] = [0, 2].map(|channel: usize| edits["materials"][0]["base_color"][channel].as_f64().unwrap());
        assert!(red < 0.1 && blue > 0.4, "{edits}");
        display.xdotool("key ctrl+z sleep 0.8 key ctrl+z sleep 0.8");
        std::fs::write(&scene, &tracer::builtin::BYTES[..tracer::builtin::BYTES.len() / 2]).unwrap();
        display.xdotool("mousemove 340 540");
    });
    let editor = &figures["editor"];
    assert!(figures["broken"].as_str().unwrap_or_default().contains("room.glb"), "{figures}");
    assert_eq!(editor["edits"]["nodes"].as_array().unwrap().len(), 0, "{editor}");
    assert_eq!((editor["can_undo"].as_bool(), editor["unsaved"].as_bool()), (Some(false), Some(true)), "{editor}");
    // The scene is still on screen, with the vase where it was at first.
    let red = |shown: &RgbImage| [330, 410].map(|x| redness(shown, x, 540));
    let [at_first, moved] = red(&shown);
    assert!(at_first > 1.1 * moved, "{at_first} {moved}");

    // Opened again, the edits are there, and they outlive a file that is broken and then replaced by one with green walls.
    std::fs::write(&scene, tracer::builtin::BYTES).unwrap();
    let green = glb::with_json(tracer::builtin::BYTES, |document| {
        let walls = glb::material(document, "plaster");
        walls["pbrMetallicRoughness"]["baseColorFactor"] = serde_json::json!([0.1, 0.6, 0.1, 1.0]);
    });
    let wall = (500, 500);
    assert!(redness(&shown, wall.0, wall.1) > 0.8, "the wall is grey at first");
    let (shown, figures) = display.session(16, &options, |display| {
        display.wait_for_title("room.glb");
        display.xdotool("mousemove 410 540");
        wait(3.0);
        std::fs::write(&scene, b"glTF").unwrap();
        wait(1.5);
        std::fs::write(&scene, &green).unwrap();
    });
    assert_eq!(figures["broken"], Value::Null, "{figures}");
    assert!(figures["editor"]["message"].as_str().unwrap_or_default().contains("read again"), "{figures}");
    let [at_first, moved] = [330, 410].map(|x| over_green(2, &shown, x, 540));
    assert!(moved > 1.2 * at_first, "no blue vase where it was moved to: {at_first} {moved}");
    let walls = redness(&shown, wall.0, wall.1);
    assert!(walls < 0.7, "the walls are not green: {walls}");
    if let Some(folder) = std::env::var_os("FOVEA_SHOTS") {
        shown.save(Path::new(&folder).join("replaced.png")).unwrap();
    }
    std::fs::remove_dir_all(folder).unwrap();
}
