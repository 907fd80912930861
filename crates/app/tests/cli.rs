//! The program as a person or script calls it: output, exit status, and what happens to files.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};
use std::process::Command;

use fovea_app::output::exr::{self, FilmFile};
use support::{Folder, SQUARE, fovea, json, refuses, text};

#[path = "cli/bench.rs"]
mod bench;
mod support;

#[test]
fn bad_input_is_refused_in_one_line_and_no_file_is_touched() {
    let folder = Folder::new("refused");
    let (scene, out) = (folder.path("square.gltf"), folder.path("out.exr"));
    std::fs::write(&out, "precious").unwrap();
    let (scene, out) = (text(&scene), text(&out));
    let broken = folder.path("broken.glb");
    std::fs::write(&broken, "glTF, it says").unwrap();
    let demanding = folder.path("demanding.gltf");
    let extension = r#""extensionsUsed": ["EXT_unheard_of"], "extensionsRequired": ["EXT_unheard_of"], "scene": 0"#;
    std::fs::write(&demanding, SQUARE.replace(r#""scene": 0"#, extension)).unwrap();
    let before = folder.names();

    let missing = folder.path("missing.glb");
    refuses(&["render", text(&missing), "-o", out], &["missing.glb", "No such file"]);
    refuses(&["render", text(&broken), "-o", out], &["broken.glb", "glTF"]);
    refuses(&["render", text(&demanding), "-o", out], &["demanding.gltf", "EXT_unheard_of"]);
    refuses(&["render", scene, "-o", out, "--camera", "7"], &["--camera 7", "eye"]);
    refuses(&["render", scene, "-o", out, "--camera", "nose"], &["--camera nose", "eye"]);
    refuses(&["render", scene, "-o", out, "--adapter", "abacus"], &["abacus"]);
    refuses(&["render", scene, "-o", out, "--view", "0,0,200x10"], &["--view", "0.1..=170"]);
    refuses(&["render", scene, "-o", out, "--film", "equirect:65536x65536"], &["65536x65536", "bytes"]);
    for mode in ["vp", "vp-region", "fv"] {
        let beside = ["--film", "perspective:32x32", "--view", "120,0,20x20", "--mode", mode];
        refuses(&[&["render", scene, "-o", out], beside.as_slice()].concat(), &["--view", "beside the film"]);
    }
    let edits = folder.path("bad.json");
    std::fs::write(&edits, "[]").unwrap();
    refuses(&["render", scene, "-o", out, "--edits", text(&edits)], &["--edits", "bad.json", "fovea-edits"]);
    refuses(&["info", scene, "--edits", "beside"], &["--edits", "square.gltf.fovea.json", "No such file"]);
    std::fs::remove_file(edits).unwrap();
    refuses(&["render", scene, "-o", out, "--inverse", "eq6"], &["--inverse"]);
    refuses(&["render", scene, "-o", text(&folder.path("out.jpg"))], &["out.jpg", ".exr or .png"]);
    refuses(&["render", scene, "-o", text(&folder.path("no/such/folder/out.png"))], &["out.png", "cannot be written"]);
    refuses(&["render", scene], &["--output"]);
    refuses(&["info", text(&missing)], &["missing.glb"]);
    for (option, value) in [("--time", "1"), ("--variant", "beach"), ("--gltf-scene", "0")] {
        refuses(&["render", "-o", out, option, value], &[option, "built-in"]);
        refuses(&["info", option, value], &[option, "built-in"]);
        refuses(&[option, value], &[option, "built-in"]);
    }
    refuses(&["render", scene, "-o", &format!("{out}/")], &["out.exr/", "folder"]);
    let study = folder.path("study");
    refuses(&["study", scene, text(&missing), "--film", "16x8", "-o", text(&study)], &["missing.glb"]);
    let of_domain_user = folder.path("user@domain/missing.glb");
    refuses(&["study", text(&of_domain_user), "--film", "16x8", "-o", text(&study)], &["user@domain/missing.glb"]);
    refuses(&["study", "--only", "report", "-o", text(&study)], &["study", "cannot be read"]);
    let numbers = folder.path("numbers.csv");
    std::fs::write(&numbers, "u\n0.5\nhalf\n").unwrap();
    let eval = ["sampler", "--eval", text(&numbers)];
    refuses(&eval, &["numbers.csv: line 3: `half`"]);
    std::fs::write(&numbers, "0.5\n").unwrap();
    let eq6 = ["--geometry", "plane", "--inverse", "eq6"];
    refuses(&[eval.as_slice(), &eq6, &["--floor", "0.002"]].concat(), &["--floor", "Eq. 6"]);
    assert!(fovea(&[eval.as_slice(), &eq6].concat()).status.success());
    std::fs::remove_file(numbers).unwrap();
    refuses(&["render", scene, "-o", out, "--gaze-trace", text(&broken)], &["broken.glb", "gaze-trace v1"]);
    refuses(&["render", scene, "-o", out, "--gaze-trace", scene, "--mode", "od"], &["--gaze-trace", "--mode fv"]);
    refuses(&["--gaze", "trace:missing.csv"], &["missing.csv"]);
    refuses(&["--frobnicate"], &["--frobnicate"]);
    refuses(&[text(&missing)], &["missing.glb"]);

    assert_eq!(std::fs::read_to_string(out).unwrap(), "precious");
    assert_eq!(folder.names(), before);
}

#[test]
fn an_exr_holds_every_sample_and_the_same_command_gives_the_same_bytes() {
    let folder = Folder::new("exr");
    let (scene, first, second) = (folder.path("square.gltf"), folder.path("1.exr"), folder.path("2.exr"));
    let arguments = |out| {
        let film = ["--film", "equirect:64x32", "--samples", "20000", "--seed", "5", "--json"];
        [&["render", text(&scene), "-o", out], film.as_slice()].concat()
    };
    let report = json(&arguments(text(&first)));
    let FilmFile { film, settings } = exr::read(&first).unwrap();
    assert_eq!((film.header.options.width, film.header.options.height), (64, 32));
    let pixels: Vec<_> = film.pixels().collect();
    assert_eq!(pixels.iter().map(|pixel| u64::from(pixel.samples)).sum::<u64>(), 20_000);
    assert_eq!((settings["seed"].as_u64(), settings["samples"].as_u64()), (Some(5), Some(20_000)));
    assert_eq!(settings["scene"], "square.gltf");
    assert!(pixels.iter().flat_map(|pixel| pixel.mean).all(|value| value.is_finite() && value >= 0.0));
    // The gaze is the centre: the pixel there has many times the samples of the one behind.
    let count = |x: usize, y: usize| pixels[y * 64 + x].samples;
    assert!(count(32, 16) > 20 * count(0, 16).max(1), "{} {}", count(32, 16), count(0, 16));

    for key in ["adapter", "driver", "scene", "mode", "samples", "seconds", "samples_per_s", "segments_per_s"] {
        assert!(!report[key].is_null(), "{key}: {report}");
    }
    for key in ["import", "bvh_build", "upload", "kernel_compile", "trace"] {
        assert!(report["stage_seconds"][key].as_f64().unwrap() >= 0.0, "{key}: {report}");
    }
    assert_eq!((report["samples"].as_u64(), report["non_finite_dropped"].as_u64()), (Some(20_000), Some(0)));
    assert!(report["mean_path_length"].as_f64().unwrap() >= 1.0);

    json(&arguments(text(&second)));
    assert_eq!(std::fs::read(&first).unwrap(), std::fs::read(&second).unwrap());
}

/// A trace that looks left of the film's centre for a second and right of it for two.
fn trace(folder: &Folder) -> PathBuf {
    let rows = (0..300).map(|step| {
        let yaw = if step < 100 { -45 } else { 45 };
        format!("{:.2},{yaw},0,{}\n", f64::from(step) * 0.01, u8::from(step % 50 != 20))
    });
    let path = folder.path("gaze.csv");
    let text = format!("# gaze-trace v1; source=test; space=view_deg; rate_hz=100\n{}", rows.collect::<String>());
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_render_follows_a_recorded_gaze_and_is_the_same_every_time() {
    let folder = Folder::new("trace");
    let (scene, trace) = (folder.path("square.gltf"), trace(&folder));
    let render = |out: &str| {
        let film = ["--film", "equirect:64x32", "--samples", "60000", "--json", "--gaze-trace", text(&trace)];
        json(&[&["render", text(&scene), "-o", out], film.as_slice()].concat())
    };
    let (first, second) = (folder.path("1.exr"), folder.path("2.exr"));
    let report = render(text(&first));
    assert_eq!((report["samples"].as_u64(), report["gaze_trace"].as_str()), (Some(60_000), Some("gaze.csv")));
    let FilmFile { film, settings } = exr::read(&first).unwrap();
    assert_eq!(settings["gaze_trace"], "gaze.csv");
    // 45 degrees are 8 of 64 columns.
    let about = |column: usize| -> f64 {
        (12..20)
            .flat_map(|y| (column - 3..column + 3).map(move |x| (x, y)))
            .map(|(x, y)| f64::from(film.pixel(y * 64 + x).samples))
            .sum()
    };
    let (left, centre, right) = (about(24), about(32), about(40));
    assert!((right / left - 2.0).abs() < 0.4, "two thirds of the time at the right: {left} {centre} {right}");
    assert!(left > 1.5 * centre, "{left} {centre} {right}");
    render(text(&second));
    assert_eq!(std::fs::read(&first).unwrap(), std::fs::read(&second).unwrap());

    // A film that goes on gets the whole recording again, not what an empty one would have had left of it.
    let more = ["render", text(&scene), "-o", text(&second), "--resume", text(&first), "--samples", "120000"];
    assert!(fovea(&[more.as_slice(), &["--gaze-trace", text(&trace)]].concat()).status.success());
    let both = exr::read(&second).unwrap().film;
    let left_of_both = (12..20).flat_map(|y| (21..27).map(move |x| y * 64 + x));
    let left_of_both: f64 = left_of_both.map(|index| f64::from(both.pixel(index).samples)).sum();
    assert!((left_of_both / left - 2.0).abs() < 0.2, "{left} {left_of_both}");
}

#[test]
fn gaze_is_listed_watched_and_recorded() {
    let folder = Folder::new("gaze");
    let trace = trace(&folder);
    let source = format!("trace:{}", text(&trace));
    let copy = folder.path("copy.csv");
    let figures = json(&["gaze", "--source", &source, "--record", text(&copy), "--json"]);
    assert_eq!((figures["samples"].as_u64(), figures["valid"].as_u64()), (Some(300), Some(294)));
    assert!((figures["rate_hz"].as_f64().unwrap() - 100.0).abs() < 1.0, "{figures}");
    // The recording plays back as the trace: the same rows, of the same space.
    let rows = |path: &Path| -> Vec<String> {
        let text = std::fs::read_to_string(path).unwrap();
        let numbers = text.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
        numbers
            .map(|line| {
                line.split(',').map(|field| field.parse::<f64>().unwrap().to_string()).collect::<Vec<_>>().join(",")
            })
            .collect()
    };
    assert_eq!(rows(&trace), rows(&copy));
    refuses(&["gaze", "--source", &source, "--record", text(&copy)], &["copy.csv", "overwrites nothing"]);
    refuses(&["gaze", "--source", "trace:missing.csv"], &["missing.csv", "No such file"]);
    refuses(&["gaze", "--source", text(&copy)], &["no gaze source"]);
    refuses(&["gaze", "--source", "opengaze::1", "--seconds", "0.6"], &["opengaze:127.0.0.1:1", "refused"]);
    let listed = json(&["gaze", "--list", "--json"]);
    let names: Vec<_> =
        listed["sources"].as_array().unwrap().iter().map(|row| row["source"].as_str().unwrap()).collect();
    assert!(names.contains(&"mouse") && names.contains(&"opengaze:127.0.0.1:4242"), "{names:?}");
}

#[test]
fn a_png_shows_the_square_in_every_mode() {
    let folder = Folder::new("png");
    let (scene, out) = (folder.path("square.gltf"), folder.path("out.png"));
    for mode in ["od", "vp", "vp-region", "fv"] {
        let arguments = ["render", text(&scene), "-o", text(&out), "--film", "perspective:48x48", "--mode", mode];
        let output = fovea(&[arguments.as_slice(), &["--spp", "8", "--background", "0,0,4"]].concat());
        assert!(output.status.success(), "{mode}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout.is_empty());
        let picture = image::open(&out).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (48, 48));
        // The square fills the picture's middle; the camera sees 0.8 rad of it, so the corners too.
        let [r, g, b] = picture.get_pixel(24, 24).0;
        assert!(b > r && b > g && b > 30, "{mode}: {r} {g} {b}");
    }
}

#[test]
fn a_png_shows_what_is_known_about_its_pixels() {
    let folder = Folder::new("show");
    let (scene, out) = (folder.path("square.gltf"), folder.path("out.png"));
    // The square is white and looks towards the camera; about it there is nothing.
    let expected = [("albedo", [255, 255, 255], [0, 0, 0]), ("normals", [128, 128, 255], [0, 0, 0])];
    for (show, at_centre, at_edge) in expected {
        let arguments = ["render", text(&scene), "-o", text(&out), "--film", "equirect:64x32", "--samples", "64"];
        let output = fovea(&[arguments.as_slice(), &["--show", show]].concat());
        assert!(output.status.success(), "{show}: {}", String::from_utf8_lossy(&output.stderr));
        let picture = image::open(&out).unwrap().to_rgb8();
        let near =
            |x, y, wanted: [u8; 3]| picture.get_pixel(x, y).0.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= 1);
        assert!(near(32, 16, at_centre), "{show}: {:?}", picture.get_pixel(32, 16));
        assert!(near(0, 16, at_edge), "{show}: {:?}", picture.get_pixel(0, 16));
    }
}

/// The figures are of samples that the film has; by default few miss a lens.
#[test]
fn samples_beside_a_film_are_told_and_not_counted() {
    let folder = Folder::new("beside");
    let (scene, out) = (folder.path("square.gltf"), folder.path("out.exr"));
    let render = |more: &[&str]| {
        let film = ["render", text(&scene), "-o", text(&out), "--film", "perspective:48x32", "--samples", "20000"];
        let report = json(&[film.as_slice(), &["--json"], more].concat());
        let held: u64 = exr::read(&out).unwrap().film.pixels().map(|pixel| u64::from(pixel.samples)).sum();
        let [on_film, beside] = ["on", "beside"].map(|place| report[format!("samples_{place}_film")].as_u64().unwrap());
        assert_eq!((on_film, on_film + beside), (held, report["samples"].as_u64().unwrap()), "{report}");
        assert!(report["mean_path_length"].as_f64().unwrap() >= 1.0, "{report}");
        let rate = report["samples_per_s"].as_f64().unwrap() * report["seconds"].as_f64().unwrap();
        (beside, rate / on_film as f64)
    };
    let (usual, free, all) = (render(&[]), render(&["--clip", "none"]), render(&["--mode", "vp"]));
    assert!(free.0 > 5_000 && usual.0 < 3_000 && all.0 == 0, "{usual:?} {free:?} {all:?}");
    for (_, rate) in [usual, free, all] {
        assert!((rate - 1.0).abs() < 1e-6, "a rate of what is on the film: {rate}");
    }
    // A film that goes on has what was on it before.
    let first = folder.path("first.exr");
    std::fs::rename(&out, &first).unwrap();
    let (beside, rate) = render(&["--resume", text(&first)]);
    assert!(beside == 0 && rate < 1e-6, "nothing was left to be traced: {beside} {rate}");
}

/// Edits that the window saved: left out with a note, or taken, also by a render that goes on.
#[test]
fn saved_edits_are_rendered_when_they_are_asked_for() {
    let folder = Folder::new("edits");
    let scene = folder.path("square.gltf");
    let sky = folder.path("sky.hdr");
    image::save_buffer_with_format(
        &sky,
        bytemuck::cast_slice(&[[0.5f32, 1.0, 2.0]; 8]),
        4,
        2,
        image::ColorType::Rgb32F,
        image::ImageFormat::Hdr,
    )
    .unwrap();
    let edits = format!(
        r#"{{ "format": "fovea-edits", "version": 1, "nodes": [{{ "name": "gone", "occurrence": 0, "hidden": true }}],
        "environment": {{ "image": {:?} }} }}"#,
        text(&sky)
    );
    std::fs::write(folder.path("square.gltf.fovea.json"), edits).unwrap();
    let render = |out: &Path, more: &[&str]| {
        let film = ["render", text(&scene), "-o", text(out), "--film", "equirect:32x16"];
        let output = fovea(&[film.as_slice(), more].concat());
        let notes = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{notes}");
        notes
    };
    let [plain, half, whole, again] =
        ["plain", "half", "whole", "again"].map(|name| folder.path(&format!("{name}.exr")));
    let notes = render(&plain, &["--samples", "4096"]);
    assert!(notes.contains("square.gltf.fovea.json are left out; --edits beside"), "{notes}");
    assert!(!render(&plain, &["--samples", "4096", "--edits", "none"]).contains("left out"));
    let notes = render(&half, &["--samples", "4096", "--edits", "beside"]);
    assert!(notes.contains("the scene has no object 'gone'"), "{notes}");
    assert_ne!(exr::read(&half).unwrap().film.words, exr::read(&plain).unwrap().film.words);
    render(&whole, &["--samples", "8192", "--edits", "beside"]);
    render(&again, &["--samples", "8192", "--edits", "beside", "--resume", text(&half)]);
    assert_eq!(std::fs::read(&again).unwrap(), std::fs::read(&whole).unwrap());
    // Without them it is a film of another scene.
    let resume = ["render", text(&scene), "-o", text(&again), "--resume", text(&half)];
    let output = fovea(&resume);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
    let info = |more: &[&str]| json(&[&["info", text(&scene), "--json"], more].concat());
    assert!(info(&["--edits", "beside"])["environment"].as_str().unwrap().contains("image 4x2"));
    assert!(info(&[])["warnings"].to_string().contains("are left out"));
}

#[test]
fn kernels_are_dumped_one_file_each() {
    let folder = Folder::new("dump");
    let (scene, out, kernels) = (folder.path("square.gltf"), folder.path("out.exr"), folder.path("kernels"));
    let arguments = ["render", text(&scene), "-o", text(&out), "--film", "equirect:16x8", "--samples", "64"];
    json(&[arguments.as_slice(), &["--json", "--dump-kernels", text(&kernels)]].concat());
    let files: Vec<_> = std::fs::read_dir(kernels).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(files.len() >= 2 && files.iter().all(|file| file.extension().unwrap() == "wgsl"), "{files:?}");
    assert!(files.iter().any(|file| std::fs::read_to_string(file).unwrap().contains("@compute")));
}

#[test]
fn info_and_adapters_speak_json() {
    let folder = Folder::new("info");
    let info = json(&["info", text(&folder.path("square.gltf")), "--json"]);
    assert_eq!((info["triangles"].as_u64(), info["materials"].as_u64()), (Some(2), Some(1)));
    assert_eq!(info["cameras"][0]["name"], "eye");
    let adapters = json(&["adapters", "--json"]);
    let adapters = adapters["adapters"].as_array().unwrap();
    assert!(adapters.iter().filter(|adapter| adapter["default"] == true).count() <= 1);
    assert!(!adapters.is_empty(), "no graphics adapter: these tests need one, lavapipe will do");
}

#[test]
fn a_missing_display_is_one_line() {
    let folder = Folder::new("display");
    let mut command = Command::new(env!("CARGO_BIN_EXE_fovea"));
    command.arg(folder.path("square.gltf"));
    for variable in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(variable);
    }
    if !cfg!(target_os = "linux") {
        eprintln!("SKIP a_missing_display_is_one_line: only Linux can be without a display");
        return;
    }
    let output = command.output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("no display") && message.contains("fovea render"), "{message}");
    assert!(!message.contains(".rs"), "a place in the sources helps nobody: {message}");
}
