//! Films that go on, and films that are added: `fovea render --resume`, `--first-sample`, `fovea merge`.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::path::{Path, PathBuf};

use fovea_app::output::exr;
use support::{Folder, SQUARE, fovea, json, refuses, text};
use tracer::film::FilmPixel;

#[path = "films/lost.rs"]
mod lost;
#[path = "films/moving.rs"]
mod moving;
#[path = "films/saving.rs"]
mod saving;
#[path = "films/sketched.rs"]
mod sketched;
mod support;
#[path = "films/tev.rs"]
mod tev;

/// The square with a camera that is turned, so that the film's orientation shows.
fn scene(folder: &Folder) -> PathBuf {
    let path = folder.path("turned.gltf");
    let turned = SQUARE.replace(r#""camera": 0,"#, r#""camera": 0, "rotation": [0, 0.6, 0, 0.8],"#);
    std::fs::write(&path, turned).unwrap();
    path
}

/// Renders the scene to a small film of this name. Of a repeated option, the first counts.
fn render(folder: &Folder, name: &str, options: &str) -> PathBuf {
    let (scene, out) = (scene(folder), folder.path(name));
    let mut words: Vec<&str> = vec!["render", text(&scene), "-o", text(&out)];
    words.extend(options.split_whitespace());
    for (option, value) in [("--film", "equirect:32x16"), ("--max-bounces", "2"), ("--background", "0.5,0.75,1")] {
        if !words.contains(&option) {
            words.extend([option, value]);
        }
    }
    succeeds(&words);
    out
}

fn succeeds(arguments: &[&str]) {
    let output = fovea(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn bytes(path: impl AsRef<Path>) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

#[test]
fn a_render_in_pieces_is_byte_for_byte_the_render_in_one_go() {
    let folder = Folder::new("pieces");
    let scene = scene(&folder);
    let whole = render(&folder, "whole.exr", "--samples 30000 --seed 9");

    // Going on: with the same command, and with none of what the film says itself.
    let part = render(&folder, "part.exr", "--samples 11111 --seed 9");
    let again = render(&folder, "again.exr", &format!("--samples 30000 --seed 9 --resume {}", text(&part)));
    assert_eq!(bytes(&again), bytes(&whole));
    let go_on = |film: &Path, samples: &str| {
        let film = text(film);
        let sky = ["--background", "0.5,0.75,1"];
        let options = ["render", text(&scene), "--resume", film, "-o", film, "--samples", samples, "--json"];
        json(&[options.as_slice(), &sky].concat())
    };
    let report = go_on(&part, "30000");
    assert_eq!(bytes(&part), bytes(&whole));
    assert_eq!(report["samples"], 30_000);
    // It has enough samples already.
    assert_eq!(go_on(&part, "20000")["samples_per_s"], 0.0);
    assert_eq!(bytes(&part), bytes(&whole));

    // Three machines.
    let piece = |name: &str, first: u32, count: u32| {
        render(&folder, name, &format!("--samples {count} --seed 9 --first-sample {first}"))
    };
    let pieces = [piece("a.exr", 0, 10_000), piece("b.exr", 10_000, 3), piece("c.exr", 10_003, 19_997)];
    let out = folder.path("sum.exr");
    for order in [[0, 1, 2], [2, 0, 1]] {
        let [a, b, c] = order.map(|i| text(&pieces[i]));
        succeeds(&["merge", a, b, c, "-o", text(&out)]);
        assert_eq!(bytes(&out), bytes(&whole), "{order:?}");
    }
    // A film with a hole goes on after its end.
    succeeds(&["merge", text(&pieces[0]), text(&pieces[2]), "-o", text(&out)]);
    go_on(&out, "30000");
    let film = exr::read(&out).unwrap().film;
    let ranges: Vec<_> = film.header.ranges.iter().map(|range| (range.first, range.count)).collect();
    assert_eq!(ranges, [(0, 10_000), (10_003, 20_000)]);
}

#[test]
fn what_does_not_belong_together_is_refused_and_nothing_is_written() {
    let folder = Folder::new("refused");
    let (scene, out) = (scene(&folder), folder.path("out.exr"));
    let film = render(&folder, "film.exr", "--samples 500");
    std::fs::write(&out, "precious").unwrap();
    let others = [
        ("--film equirect:16x8", "film size: 16x8 instead of 32x16"),
        ("--max-bounces 3", "max bounces: 3 instead of 2"),
        ("--sequence independent", "sequence: Independent instead of Sobol"),
        ("--orient camera", "orientation"),
        ("--background 0,0,1", "scene"),
        ("--first-sample 450", "450..500 of seed 1"),
    ];
    for (number, (option, part)) in others.iter().enumerate() {
        let name = format!("other-{number}.exr");
        let other = render(&folder, &name, &format!("{option} --samples 100"));
        refuses(&["merge", text(&film), text(&other), "-o", text(&out)], &[part, &name]);
    }
    let before = folder.names();
    refuses(&["merge", text(&film), text(&film), "-o", text(&out)], &["0..500 of seed 1"]);
    refuses(&["merge", text(&film), "-o", text(&folder.path("out.png"))], &["out.png", ".exr"]);
    refuses(&["merge", text(&film), text(&out), "-o", text(&out)], &["out.exr", "not a readable OpenEXR file"]);
    refuses(&["merge", text(&film), text(&folder.path("missing.exr")), "-o", text(&out)], &["missing.exr"]);
    let resume = |options: &[&str], parts: &[&str]| {
        let line = ["render", text(&scene), "--resume", text(&film), "-o", text(&out), "--samples", "600"];
        refuses(&[line.as_slice(), options].concat(), parts);
    };
    resume(&["--seed", "2"], &["--seed is 2", "with is 1"]);
    resume(&["--max-bounces", "8"], &["--max-bounces is 8", "with is 2"]);
    resume(&["--film", "perspective:32x16"], &["--film is perspective:32x16 of", "with is equirect:32x16"]);
    // Twice the arc sine of 0.6.
    resume(&["--orient", "camera"], &["--orient is camera", "with is 73.7 degrees from it"]);
    resume(&["--sequence", "independent"], &["--sequence is independent", "with is sobol"]);
    resume(&["--background", "0,0,1"], &["film.exr", "turned.gltf", "scene"]);
    resume(&["--first-sample", "7"], &["--first-sample"]);
    assert_eq!(bytes(&out), b"precious");
    assert_eq!(folder.names(), before);
}

#[test]
fn an_adaptive_film_is_the_same_every_time_and_says_what_it_is() {
    let folder = Folder::new("adaptive");
    let options = "--samples 30000 --adaptive --film equirect:64x32";
    let first = render(&folder, "first.exr", options);
    assert_eq!(bytes(render(&folder, "second.exr", options)), bytes(&first));
    let plain = render(&folder, "plain.exr", "--samples 30000 --seed 2 --film equirect:64x32");
    let steered = |path: &Path| exr::read(path).unwrap().film.header.statistics.steered;
    assert!((1..30_000).contains(&steered(&first)), "the first samples are placed by acuity alone");
    assert_eq!(steered(&plain), 0);
    let sum = folder.path("sum.exr");
    succeeds(&["merge", text(&first), text(&plain), "-o", text(&sum)]);
    assert_eq!(steered(&sum), steered(&first));
}

/// Films of other seeds and lengths add up to a film whose mean and stated variance are right: a chi-squared test of
/// the pixels that are noisy against a longer render, at a significance of 0.2 %, two-sided.
#[test]
fn films_of_different_seeds_merge_to_a_valid_estimate() {
    let folder = Folder::new("seeds");
    let film = |name: &str, spp: u32, seed: u32| {
        render(&folder, name, &format!("--mode od --sequence independent --spp {spp} --seed {seed}"))
    };
    let truth = exr::read(&film("truth.exr", 4096, 1000)).unwrap().film;
    let parts = [film("1.exr", 64, 1), film("2.exr", 128, 2), film("3.exr", 256, 3)];
    let out = folder.path("sum.exr");
    succeeds(&["merge", text(&parts[0]), text(&parts[1]), text(&parts[2]), "-o", text(&out)]);
    let sum = exr::read(&out).unwrap();
    assert_eq!(sum.settings["seed"], serde_json::json!([1, 2, 3]));
    assert_eq!(sum.film.header.samples(), (64 + 128 + 256) * 32 * 16);

    let luminance = |mean: [f64; 3]| 0.2126 * mean[0] + 0.7152 * mean[1] + 0.0722 * mean[2];
    let difference = |(ours, truth): (FilmPixel, FilmPixel)| {
        (luminance(ours.mean) - luminance(truth.mean), ours.variance_of_mean + truth.variance_of_mean)
    };
    let pixels: Vec<(f64, f64)> = sum.film.pixels().zip(truth.pixels()).map(difference).collect();
    // Pixels that see the sky alone have no variance but the rounding of its square.
    let (noisy, even): (Vec<_>, Vec<_>) = pixels.into_iter().partition(|(_, variance)| *variance > 1e-8);
    assert!(even.iter().all(|(difference, _)| difference.abs() < 1e-5), "{even:?}");
    let chi_squared: f64 = noisy.iter().map(|(difference, variance)| difference * difference / variance).sum();
    eprintln!("chi-squared {chi_squared:.1} of {} pixels", noisy.len());
    assert!(noisy.len() >= 12, "the square and its edges are noisy");
    // Wilson and Hilferty's quantiles; 3.09 standard deviations leave 0.1 % on each side.
    let degrees = noisy.len() as f64;
    let spread = 2.0 / (9.0 * degrees);
    let quantile = degrees * (1.0 - spread + 3.09 * spread.sqrt()).powi(3);
    let low = degrees * (1.0 - spread - 3.09 * spread.sqrt()).powi(3);
    assert!((low..quantile).contains(&chi_squared), "{chi_squared} of {low}..{quantile}");
}
