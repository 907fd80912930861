//! `fovea study` on the built-in scene, small: all outputs are there, finished parts are not repeated, and its numbers agree
//! with one another.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use fovea_app::{cli, commands, readback};
use fovea_tests::device;
use glam::Quat;
use serde_json::Value;
use tracer::distribution::{Distribution, View};
use tracer::film::FilmOptions;
use tracer::renderer::{Renderer, SequenceKind};
use tracer::view::{DebugView, ToneMap, ViewProjection, ViewSettings};

const SEEDS: usize = 2;
const METHODS: [&str; 7] = ["od", "vp", "vp-region", "fv", "fv-eq6", "fv-clip", "fv-best"];

fn study(folder: &Path, more: &str) -> Result<(), String> {
    let line = format!(
        "fovea study --film 64x32 --seeds {SEEDS} --spp 4 --reference-spp 2 --max-bounces 1 --gaze 0,0 --gaze 20,-30 {more} --out"
    );
    let words = line.split_whitespace().map(OsString::from).chain([folder.into()]);
    let parsed = cli::parse(words).map_err(|stop| format!("{stop:?}"))?;
    commands::run(parsed).map_err(|error| format!("{error:#}"))
}

fn scratch() -> PathBuf {
    let folder = std::env::temp_dir().join(format!("fovea-study-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

/// Film and reconstructed view after a few samples, so that most of the view is filled from elsewhere.
fn look(renderer: &mut Renderer) -> (Vec<u32>, Vec<[f32; 4]>) {
    let words = device::trace(renderer, 256).unwrap().words;
    let view = View::new(Quat::IDENTITY, 1.5, 1.5);
    let settings = ViewSettings {
        projection: ViewProjection::Perspective(view),
        size: [24, 24],
        exposure_ev: 0.0,
        tone_map: ToneMap::Linear,
        debug_view: DebugView::Beauty,
        fill: true,
        denoise: false,
        ring: None,
    };
    readback::draw(renderer, &settings).unwrap();
    (words, renderer.presented_radiance().unwrap().1)
}

#[test]
fn other_random_numbers_leave_nothing_of_the_picture_before() {
    let gpu = device::gpu();
    let (scene, _) = tracer::builtin::scene().unwrap();
    let film = FilmOptions::equirect(64, 32);
    let with_seed = |seed| {
        let distribution = Distribution::omnidirectional(device::inverse());
        device::independent(&gpu, film, seed, 1, distribution, &scene)
    };
    let mut reused = with_seed(1);
    let first = look(&mut reused);
    reused.set_randomness(2, SequenceKind::Independent);
    let second = look(&mut reused);
    assert_eq!(second, look(&mut with_seed(2)));
    assert_ne!(first.0, second.0);
    assert_eq!(second.1.len(), 24 * 24);
    assert!(second.1.iter().flatten().all(|value| value.is_finite()));
}

/// Samples and mean error in the fovea of a method at the first gaze, where at most a fifth of its pixels are empty.
fn curve(rows: &str, method: &str) -> Vec<(f64, f64)> {
    let mut lines = rows.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let column = |name: &str| head.iter().position(|field| *field == name).unwrap();
    let [samples, error, empty] = ["samples", "film_fovea", "empty"].map(column);
    let number = |row: &Vec<&str>, column: usize| row[column].parse::<f64>().unwrap_or(f64::NAN);
    let here: Vec<_> = lines.filter(|row| row[1] == "0_0" && row[2] == method).collect();
    let (first, second) = here.split_at(here.len() / SEEDS);
    let mean = |a: &Vec<&str>, b: &Vec<&str>, column| 0.5 * (number(a, column) + number(b, column));
    let points = first.iter().zip(second).filter(|(a, b)| mean(a, b, empty) <= 0.2 && mean(a, b, error).is_finite());
    points.map(|(a, b)| (number(a, samples), mean(a, b, error))).collect()
}

/// Samples at which a falling curve first has an error, between logarithms.
fn samples_at(curve: &[(f64, f64)], error: f64) -> Option<f64> {
    curve.windows(2).find_map(|pair| {
        let [(n0, e0), (n1, e1)] = [pair[0], pair[1]];
        let is_within = e0 >= error && error >= e1 && e1 > 0.0 && e0 > e1;
        is_within.then(|| n0 * (n1 / n0).powf((e0 / error).ln() / (e0 / e1).ln()))
    })
}

/// Median over the rounds at the first gaze.
fn seconds_a_sample(rates: &str, method: &str) -> f64 {
    let rows = rates.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let here = rows.filter(|row| row[1] == "0_0" && row[2] == method);
    let mut all: Vec<f64> = here.map(|row| row[5].parse::<f64>().unwrap() / row[4].parse::<f64>().unwrap()).collect();
    all.sort_by(f64::total_cmp);
    assert_eq!(all.len() % 2, 1, "a middle one");
    all[all.len() / 2]
}

#[test]
fn a_small_study_leaves_all_its_outputs_and_goes_on_from_them() {
    let folder = scratch();
    study(&folder, "").unwrap();
    let plots = ["samples", "time", "rings", "whole"].map(|name| format!("{name}-builtin"));
    let pictures =
        plots.iter().map(String::as_str).chain(["splits"]).flat_map(|n| [format!("{n}.svg"), format!("{n}.png")]);
    let others = ["study.md", "study.json", "curves.csv", "rates.csv", "provenance.json", "figure-builtin.png"];
    for name in pictures.chain(others.map(String::from)) {
        assert!(folder.join(&name).metadata().is_ok_and(|file| file.len() > 100), "{name}");
    }
    let page = std::fs::read_to_string(folder.join("study.md")).unwrap();
    assert!(!page.contains('{'), "a place of the page was not filled");

    // Rows: every method, gaze and seed, each with its schedule.
    let rows = std::fs::read_to_string(folder.join("curves.csv")).unwrap();
    for method in METHODS {
        for gaze in ["0_0", "20_-30"] {
            for seed in 1..=SEEDS {
                let prefix = format!("builtin,{gaze},{method},{seed},");
                assert!(rows.lines().filter(|line| line.starts_with(&prefix)).count() >= 7, "{prefix}");
            }
        }
    }
    let summary: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("study.json")).unwrap()).unwrap();
    assert_eq!(summary["sights"].as_array().unwrap().len(), 2);
    assert_eq!(summary["settings"]["builtin"]["film"], serde_json::json!([64, 32]));

    // One ratio of the summary, from the raw rows.
    let found = &summary["sights"][0]["ratios"]["fv_over_vp"];
    assert_eq!(summary["sights"][0]["gaze"], "0_0");
    let (vp, fv) = (curve(&rows, "vp"), curve(&rows, "fv"));
    let from_vp = vp.iter().filter_map(|&(n, e)| Some((n / samples_at(&fv, e)?).ln()));
    let from_fv = fv.iter().filter_map(|&(n, e)| Some((samples_at(&vp, e)? / n).ln()));
    let logs: Vec<f64> = from_vp.chain(from_fv).collect();
    let samples = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
    let rates = std::fs::read_to_string(folder.join("rates.csv")).unwrap();
    let rate = seconds_a_sample(&rates, "vp") / seconds_a_sample(&rates, "fv");
    let near = |found: &Value, expected: f64| {
        assert!((found.as_f64().unwrap() / expected - 1.0).abs() < 1e-9, "{found} instead of {expected}");
    };
    near(&found["samples"]["value"], samples);
    near(&found["rate"], rate);
    near(&found["time"], samples * rate);

    // A lost run is rendered again to the same bytes, the others are left.
    let lost = folder.join("runs").join("builtin_0_0_fv_2.csv");
    let kept = folder.join("runs").join("builtin_0_0_vp_1.csv");
    let bytes = std::fs::read(&lost).unwrap();
    let written = kept.metadata().unwrap().modified().unwrap();
    std::fs::remove_file(&lost).unwrap();
    study(&folder, "--only curves").unwrap();
    assert_eq!(std::fs::read(&lost).unwrap(), bytes);
    assert_eq!(kept.metadata().unwrap().modified().unwrap(), written);

    // Rates that an interruption left out are measured, the others are left.
    let path = folder.join("rates.csv");
    let rates = std::fs::read_to_string(&path).unwrap();
    let (there, lost): (Vec<&str>, Vec<&str>) = rates.split_inclusive('\n').partition(|row| !row.contains("20_-30"));
    assert!(!lost.is_empty());
    std::fs::write(&path, there.concat()).unwrap();
    study(&folder, "").unwrap();
    let again = std::fs::read_to_string(&path).unwrap();
    assert!(again.starts_with(&there.concat()), "{again}");
    assert_eq!(again.lines().filter(|row| row.contains("20_-30")).count(), lost.len());

    // Other settings do not mix with these, nor another recording with one that came later.
    let refused = study(&folder, "--only curves --background 1,0,0").unwrap_err();
    assert!(refused.contains("other settings"), "{refused}");
    let along = |yaw: u8| {
        let trace = folder.join(format!("{yaw}.csv"));
        std::fs::write(&trace, format!("# gaze-trace v1; space=view_deg\n0,0,0,1\n1,{yaw},0,1\n")).unwrap();
        study(&folder, &format!("--only curves --gaze-trace {}", trace.display()))
    };
    along(10).unwrap();
    assert!(folder.join("runs").join("builtin_0_0_fv-wander_2.csv").exists());
    along(10).unwrap();
    let refused = along(20).unwrap_err();
    assert!(refused.contains("other settings"), "{refused}");
    study(&folder, "--only curves").unwrap();

    // Curves of two revisions say so.
    let path = folder.join("provenance.json");
    let mut provenance: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    let here = provenance["curves"]["commit"].clone();
    provenance["curves"]["commit"] = "another".into();
    std::fs::write(&path, provenance.to_string()).unwrap();
    std::fs::remove_file(folder.join("runs").join("builtin_0_0_fv_2.csv")).unwrap();
    study(&folder, "--only curves").unwrap();
    let provenance: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(
        (&provenance["curves"]["commit"], &provenance["curves"]["later"][0]["commit"]),
        (&"another".into(), &here)
    );
    std::fs::remove_dir_all(folder).unwrap();
}
