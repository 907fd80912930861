//! The page of the denoising report.

use std::fmt::Write;

use serde_json::Value;

use crate::METHODS;

/// Tables of raw numbers.
pub fn page(raw: &Value) -> String {
    let mut text = String::from("# Guided reconstruction: FLIP against samples and seconds\n\n");
    for (name, value) in raw["machine"].as_object().into_iter().flatten() {
        let _ = writeln!(text, "- {name}: {}", value.as_str().unwrap_or_default());
    }
    let _ = write!(
        text,
        "- FV, gaze in the middle of a view of {}x{} pixels, {} degrees high, before the usual monitor; 8 bounces; Sobol; the film is \
         as fine as the view\n\
         - reference: {} samples a pixel, uniform; exposed to a mean luminance of {}, clipped at 1, encoded by sRGB; mean FLIP at \
         67 pixels a degree, in the foveal disc (5.79 degrees at the eye) and in the rest of the view\n\
         - raw: the film's means, black where there is no sample; filled: pull-push (`--denoise off`); guided: `--denoise on`; oidn: \
         Intel Open Image Denoise (HDR, highest quality, with the same base colours and normals), from raw means with holes \
         filled\n\
         - seconds are those of tracing; first hits, once for a view, and the presentation come on top and stand below each table\n\
         - load when it ended: {}; counts of samples and FLIP do not depend on it, seconds do\n\
         - made by `cargo run --release -p fovea-benches --bin denoise-report -- docs/reports WORK PYTHON SCENE...`; raw numbers in \
         denoise.json\n\n",
        raw["view"][0],
        raw["view"][1],
        raw["vfov_deg"],
        raw["reference_spp"],
        crate::EXPOSED_MEAN,
        raw["load"].as_str().unwrap_or("not known"),
    );
    for scene in raw["scenes"].as_array().into_iter().flatten() {
        add_scene(&mut text, scene);
    }
    text
}

fn add_scene(text: &mut String, scene: &Value) {
    let _ = writeln!(text, "## {}\n", scene["scene"].as_str().unwrap_or_default());
    let head = |place: &str| METHODS.map(|method| format!("{place} {method}")).join(" | ");
    let _ = writeln!(text, "| samples | seconds | {} | {} |", head("fovea"), head("periphery"));
    let _ = writeln!(text, "|{}", "---:|".repeat(2 + 2 * METHODS.len()));
    for look in scene["looks"].as_array().into_iter().flatten() {
        let cells = ["fovea", "periphery"].map(|place| {
            METHODS.map(|method| format!("{:.4}", look[method][place].as_f64().unwrap_or(f64::NAN))).join(" | ")
        });
        let seconds = look["seconds"].as_f64().unwrap_or(f64::NAN);
        let _ = writeln!(text, "| {} | {seconds:.2} | {} | {} |", look["samples"], cells[0], cells[1]);
    }
    let ms = |value: &Value| 1e3 * value.as_f64().unwrap_or(f64::NAN);
    let present = &scene["present_seconds_1280x720"];
    let _ = writeln!(
        text,
        "\nFirst hits of 1280x720 pixels: {:.0} ms, once for a view. Presenting 1280x720 pixels: {:.0} ms filled, {:.0} ms guided. \
         Open Image Denoise for this view: {:.0} ms.\n",
        ms(&scene["first_hits_seconds"]),
        ms(&present["filled"]),
        ms(&present["guided"]),
        ms(&scene["oidn_seconds"]),
    );
}
