//! `fovea bench` as a person or script calls it.

use std::process::{Command, Stdio};

use serde_json::Value;

use crate::support::{Folder, fovea, refuses, text};

/// Every value of a list is a number above 0.
fn all_positive(list: &Value, count: usize) -> bool {
    let values = list.as_array().unwrap();
    values.len() == count && values.iter().all(|value| value.as_f64().is_some_and(|value| value > 0.0))
}

#[test]
fn the_built_in_scene_is_measured_part_by_part() {
    let folder = Folder::new("bench");
    let (file, pages) = (folder.path("speed.json"), folder.path("pages"));
    let small = ["--samples", "1024", "--rays", "1024", "--film", "256x128", "--json", text(&file)];
    let run = |options: &[&str]| {
        let output = fovea(&[&["bench"], options, small.as_slice()].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let raw: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        (String::from_utf8(output.stdout).unwrap(), raw["scenes"]["builtin"].clone())
    };
    // A reader that is gone loses nothing.
    let edits = ["bench", "--only", "edits", "--gazes", "1", "--rounds", "1"];
    let mut gone = Command::new(env!("CARGO_BIN_EXE_fovea"));
    let mut child = gone.args(edits).args(small).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(2));
    assert!(std::fs::read_to_string(&file).unwrap().contains("first_move_s"));
    std::fs::remove_file(&file).unwrap();
    let (printed, measured) = run(&["--only", "rays,modes,edits", "--gazes", "2", "--rounds", "2"]);
    assert!(["Rays", "Modes", "Edits"].iter().all(|heading| printed.contains(heading)), "{printed}");
    // Another part is added to what the file holds.
    let (printed, scene) = run(&["--only", "start", "--gazes", "1", "--rounds", "1", "--report", text(&pages)]);
    assert!(printed.contains("Start") && !printed.contains("Rays"), "{printed}");
    for part in ["rays", "modes", "edits"] {
        assert_eq!(scene[part], measured[part]);
    }
    for part in ["rays", "modes", "edits", "start"] {
        for key in ["machine", "adapter", "commit"] {
            assert!(scene[part][key].as_str().is_some_and(|value| !value.is_empty()), "{part} {key}");
        }
        assert!(scene[part]["took_s"].as_f64().unwrap() > 0.0);
    }

    // Three kinds of rays of OD and two gazes; in a closed room nearly all of them meet something.
    let sets = scene["rays"]["sets"].as_array().unwrap();
    assert_eq!(sets.len(), 9);
    assert_ne!(scene["rays"]["hierarchy"], scene["rays"]["other_hierarchy"]);
    for set in sets {
        assert!(
            all_positive(&set["device_s"], 2) && all_positive(&set["obvhs_s"], 2) && all_positive(&set["other_s"], 2),
            "{set}"
        );
        let [count, hits, differs] = ["count", "hits", "hit_or_miss_differs"].map(|key| set[key].as_u64().unwrap());
        assert!((900..=1024).contains(&count) && differs <= count / 100, "{set}");
        assert!(set["rays"] == "shadow" || hits * 10 >= count * 9, "{set}");
    }

    let batches = scene["modes"]["batches"].as_array().unwrap();
    assert_eq!(batches.len(), 6);
    for batch in batches {
        let [samples, segments, shadow] =
            ["samples", "segments", "shadow_rays"].map(|key| batch[key].as_u64().unwrap());
        assert_eq!(samples, 1024);
        assert!(segments >= samples && segments <= samples * 20 && shadow <= segments, "{batch}");
        for pass in ["generate_s", "trace_s", "accumulate_s", "reconstruct_s", "wall_s"] {
            assert!(all_positive(&batch[pass], 2), "{pass}: {batch}");
        }
        for pass in ["other_trace_s", "other_wall_s", "start_s", "extend_s", "shade_s"] {
            assert!(all_positive(&batch[pass], 2), "{pass}: {batch}");
        }
    }
    assert_ne!(scene["modes"]["schedule"], scene["modes"]["other_schedule"]);
    let [geometry, scene_bytes, triangles] =
        ["geometry_bytes", "scene_bytes", "triangles"].map(|key| scene["modes"][key].as_u64().unwrap());
    assert!(geometry > triangles * 36 && geometry < scene_bytes);

    let edits = &scene["edits"];
    assert!(all_positive(&edits["material_s"], 2) && all_positive(&edits["move_s"], 2));
    assert!(all_positive(&edits["first_move_s"], 2) && all_positive(&edits["gaze_s"], 2));
    let in_fovea = edits["samples_in_foveal_disc"].as_u64().unwrap();
    assert!(in_fovea > 0 && in_fovea < edits["samples"].as_u64().unwrap());

    for state in ["cold", "cached"] {
        for run in scene["start"][state].as_array().unwrap() {
            let process = run["process_s"].as_f64().unwrap();
            let stages = ["device_s", "import_s", "sketch_s", "upload_s", "kernels_s", "first_batch_s", "picture_s"];
            let sum: f64 = stages.iter().map(|stage| run[stage].as_f64().unwrap()).sum();
            assert!(sum > 0.0 && sum < process, "{run}");
            let sketched = run["until_sketch_s"].as_f64().unwrap();
            assert!(sketched > run["device_s"].as_f64().unwrap() && sketched < process, "{run}");
        }
    }
    let page = std::fs::read_to_string(pages.join("speed.md")).unwrap();
    assert!(page.contains("What was asked for") && !page.contains("NaN"), "{page}");
    // The same page again, of the numbers alone.
    std::fs::remove_file(pages.join("speed.md")).unwrap();
    assert!(fovea(&["bench", "--only", "report", "--json", text(&file), "--report", text(&pages)]).status.success());
    assert_eq!(std::fs::read_to_string(pages.join("speed.md")).unwrap(), page);
    assert!(["speed-rays.svg", "speed-modes.svg"].iter().all(|plot| pages.join(plot).exists()));
    // It speaks of other machines and measurements only where there are notes beside the numbers.
    assert!(["sponza", "bmw", "sequence.md", "at hand"].iter().all(|theirs| !page.contains(theirs)), "{page}");
    std::fs::write(folder.path("speed.notes.md"), "Measured on the abacus.\n").unwrap();
    assert!(fovea(&["bench", "--only", "report", "--json", text(&file), "--report", text(&pages)]).status.success());
    let noted = std::fs::read_to_string(pages.join("speed.md")).unwrap();
    assert_eq!(noted.replacen("\nMeasured on the abacus.\n", "", 1), page);
}

#[test]
fn a_bench_of_what_is_not_there_is_refused() {
    let folder = Folder::new("bench-refused");
    let other = folder.path("other.json");
    std::fs::write(&other, "[1, 2]").unwrap();
    refuses(&["bench", text(&folder.path("missing.glb"))], &["missing.glb", "No such file"]);
    refuses(&["bench", &format!("{}@7", text(&folder.path("square.gltf")))], &["--camera 7", "eye"]);
    refuses(&["bench", "--gazes", "0"], &["--gazes"]);
    refuses(&["bench", "--rays", "1000000"], &["--rays"]);
    refuses(&["bench", "--only", "everything"], &["--only"]);
    refuses(&["bench", "--report", "here"], &["--json"]);
    refuses(&["bench", "--only", "report"], &["--report"]);
    refuses(&["bench", "--adapter", "abacus"], &["abacus"]);
    for not_of_bench in [r#"{"scenes":{"builtin":7}}"#, r#"{"scenes":{"builtin":{"rays":[1]}}}"#, "[1, 2]"] {
        std::fs::write(&other, not_of_bench).unwrap();
        refuses(&["bench", "--json", text(&other)], &["other.json", "fovea bench"]);
        assert_eq!(std::fs::read_to_string(&other).unwrap(), not_of_bench);
    }
    let (json, pages) = (folder.path("speed.json"), folder.path("pages"));
    let report = ["bench", "--json", text(&json), "--report", text(&pages), "--only"];
    refuses(&[report.as_slice(), &["report,rays"]].concat(), &["--only report"]);
    refuses(&[report.as_slice(), &["report"]].concat(), &["speed.json", "no measurement"]);
    let within_a_file = folder.path("square.gltf").join("pages");
    refuses(&["bench", "--json", text(&json), "--report", text(&within_a_file)], &["square.gltf", "cannot be made"]);
    assert!(!json.exists() && !pages.exists());
}
