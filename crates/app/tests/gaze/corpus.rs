//! The corpora of the fuzz targets as a normal test.

use std::path::Path;

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
