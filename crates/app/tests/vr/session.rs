//! A session from its beginning to its end.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use image::RgbImage;

use crate::monado::{Monado, said};

/// Turns on the validation layers of Vulkan and OpenXR, which write into `folder`.
fn validate(command: &mut Command, folder: &Path) {
    let settings = folder.join("vk_layer_settings.txt");
    let text = format!(
        "khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n\
         khronos_validation.report_flags = error,warn,info\n\
         khronos_validation.log_filename = {}\n",
        folder.join("vulkan.txt").display()
    );
    std::fs::write(&settings, text).unwrap();
    command
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_SETTINGS_PATH", &settings)
        .env("XR_ENABLE_API_LAYERS", "XR_APILAYER_LUNARG_core_validation")
        .env("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
        .env("XR_CORE_VALIDATION_FILE_NAME", folder.join("openxr.txt"));
}

#[test]
fn a_session_shows_three_hundred_frames() {
    let name = "a_session_shows_three_hundred_frames";
    let Some(mut monado) = Monado::find(name) else { return };
    monado.start(None);
    let mut command = monado.inner(name);
    validate(&mut command, monado.place());
    let output = command.output().unwrap();
    let text = said(&output);
    let read = |file: &str| std::fs::read_to_string(monado.place().join(file)).unwrap_or_default();
    let (vulkan, openxr) = (read("vulkan.txt"), read("openxr.txt"));
    // Silence counts only where the layers were there.
    assert!(vulkan.contains("Khronos Validation Layer Active"), "{vulkan}");
    assert!(openxr.contains("Core Validation Layer is initialized"), "{openxr}");
    let vulkan: Vec<&str> = vulkan.lines().filter(|line| line.starts_with("Validation")).collect();
    let wrong: Vec<&&str> = vulkan.iter().filter(|line| !line.starts_with("Validation Information")).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let wrong: Vec<&str> =
        openxr.lines().filter(|line| !line.contains("[VALID_DEBUG") && line.contains("[VALID_")).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let figures = text.lines().find(|line| line.contains("frames drawn")).unwrap_or_default();
    eprintln!("{figures}, no validation message");
}

#[test]
fn each_eye_sees_what_a_headless_render_of_its_pose_shows() {
    let name = "each_eye_sees_what_a_headless_render_of_its_pose_shows";
    let Some(mut monado) = Monado::find(name) else { return };
    monado.start(None);
    let text = said(&monado.inner(name).output().unwrap());
    text.lines().filter(|line| line.contains("mean difference")).for_each(|line| eprintln!("{line}"));
}

/// An X server without a screen, whose picture is a file; stopped when dropped.
struct Display(Child);

impl Drop for Display {
    fn drop(&mut self) {
        // It may have ended by itself; either way it must not outlive the test.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Display {
    /// As large as the runtime's window, with its name; `None` when Xvfb is not installed.
    fn start(folder: &Path) -> Option<(Self, String)> {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "640x360x24", "-nolisten", "tcp", "-noreset", "-fbdir"])
            .arg(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Some((Self(server), format!(":{}", number.trim())))
    }
}

/// The picture of an X window dump with 32 bits a pixel.
fn dumped(file: &[u8]) -> RgbImage {
    let word = |index: usize| u32::from_be_bytes(file[4 * index..][..4].try_into().unwrap()) as usize;
    let (header, width, height, bits, stride, colours) = (word(0), word(4), word(5), word(11), word(12), word(19));
    assert_eq!(bits, 32, "bits a pixel");
    let pixels = &file[header + 12 * colours..];
    RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let at = y as usize * stride + 4 * x as usize;
        // Xvfb's is little-endian: blue first.
        image::Rgb([pixels[at + 2], pixels[at + 1], pixels[at]])
    })
}

/// Mean brightness and its standard deviation over a part of a picture.
fn brightness(picture: &RgbImage, columns: std::ops::Range<u32>) -> (f64, f64) {
    let values: Vec<f64> = columns
        .flat_map(|x| (0..picture.height()).map(move |y| (x, y)))
        .map(|(x, y)| picture.get_pixel(x, y).0.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0)
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

#[test]
fn both_eyes_pictures_are_on_the_headsets_display() {
    let name = "both_eyes_pictures_are_on_the_headsets_display";
    let Some(mut monado) = Monado::find(name) else { return };
    let Some((_display, display)) = Display::start(monado.place()) else {
        eprintln!("SKIP {name}: Xvfb or xdotool is missing");
        return;
    };
    monado.start(Some(&display));
    let mut session = monado.inner(name).stdin(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    // It goes on until its standard input ends.
    let watched = session.stdin.take();
    let start = Instant::now();
    let picture = loop {
        let picture = dumped(&std::fs::read(monado.place().join("Xvfb_screen0")).unwrap());
        let middle = picture.width() / 2;
        let (left, right) = (brightness(&picture, 0..middle), brightness(&picture, middle..picture.width()));
        // One panorama from one point: the same in both.
        let same = (left.0 - right.0).abs() < 0.1 * left.0;
        let seen = left.0 > 20.0 && left.1 > 10.0 && right.0 > 20.0 && right.1 > 10.0 && same;
        if seen {
            let seconds = start.elapsed().as_secs_f64();
            eprintln!(
                "after {seconds:.1} s: left eye: brightness {left:.1?} (mean, deviation), right eye: {right:.1?}"
            );
            break picture;
        }
        assert_eq!(session.try_wait().unwrap(), None, "the session ended");
        assert!(start.elapsed() < Duration::from_secs(120), "left eye {left:?}, right eye {right:?}: {}", monado.log());
        std::thread::sleep(Duration::from_millis(200));
    };
    drop(watched);
    assert!(session.wait().unwrap().success());
    if let Some(path) = std::env::var_os("FOVEA_VR_SCREENSHOT") {
        picture.save(path).unwrap();
    }
}
