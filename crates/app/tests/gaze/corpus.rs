//! The corpora of the fuzz targets as a normal test.

use std::path::Path;
use std::time::{Duration, Instant};

use fovea_app::gaze::feed::MAX_SAMPLES;
use fovea_app::gaze::parse::trace::Trace;
use fovea_app::gaze::replay::Replay;
use fovea_app::gaze::source::GazeSource;

/// What the properties call the parsers' module.
mod parse {
    pub use fovea_app::gaze::parse::*;
}

#[path = "../../fuzz/src/properties.rs"]
mod properties;

#[test]
fn every_input_that_fuzzing_found_keeps_the_parsers_properties() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    let mut inputs = 0;
    for target in ["opengaze", "lsl_info", "lsl_feed", "zmtp", "pupil", "trace", "edid"] {
        let entries = std::fs::read_dir(folder.join(target)).unwrap();
        let mut of_target = 0;
        for entry in entries {
            let path = entry.unwrap().path();
            assert!(properties::run(target, &std::fs::read(&path).unwrap()), "{target}");
            of_target += 1;
        }
        assert!(of_target >= 2, "{target} has {of_target} inputs");
        inputs += of_target;
    }
    eprintln!("{inputs} inputs");
}

#[test]
fn every_trace_that_fuzzing_found_can_be_played() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/trace");
    let texts = std::fs::read_dir(folder).unwrap().map(|entry| std::fs::read_to_string(entry.unwrap().path()));
    let traces: Vec<Trace> = texts.filter_map(|text| Trace::parse(&text.ok()?).ok()).collect();
    assert!(traces.len() >= 2, "{}", traces.len());
    let start = Instant::now();
    for trace in traces {
        for repeats in [false, true] {
            let mut replay = Replay::new("corpus".into(), trace.clone(), repeats);
            for wait in [0, 1, 16, 1000, 100_000_000_000] {
                let mut samples = Vec::new();
                let now = start + Duration::from_millis(wait);
                replay.poll(now, &mut samples);
                assert!(samples.len() <= MAX_SAMPLES && samples.iter().all(|sample| sample.captured <= now));
            }
        }
    }
}
