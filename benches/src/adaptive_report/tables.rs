//! The page of the report.

use serde_json::Value;

use super::statistics::EDGES_DEG;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

/// Every row: scene, samples in all with the number of seeds, the plain way's figures, the way's figures.
fn rows(raw: &Value) -> impl Iterator<Item = (&str, String, &Value, &Value)> {
    list(&raw["scenes"]).flat_map(|scene| {
        list(&scene["stops"]).flat_map(move |stop| {
            let ways = &stop["ways"];
            let samples = format!("{} ({})", stop["samples"], stop["seeds"]);
            list(ways).map(move |way| (text(&scene["scene"]), samples.clone(), &ways[0], way))
        })
    })
}

const INTRODUCTION: &str = "- FV, film 512x256, 8 bounces, Sobol, the gaze at the film's centre
- made by `cargo run --release -p fovea-benches --bin adaptive-report -- docs/reports SCENE...`; raw numbers in adaptive.json

Each way has the same number of samples in all. *One buffer*: the film's own noise steers; this is what `--adaptive` does. *Two buffers*:
half of the samples steer, only the other half is shown.

## Error

Variances over the seeds (their number in brackets after the samples), mean over the pixels by solid angle: *relative*, over the squared
luminance plus the square of a tenth of the mean; *displayed*, of luminance after the tone map x / (1 + x) about the median, over the
square of that value and 0.05. The outer region is compared in squares of 4 x 4 pixels. Only what has samples in every run counts. Seconds
are medians, the ways in turn. First the error, then its ratio to that of plain FV with as many samples; in brackets the ratio of error
times seconds.

";

const BIAS: &str = "
## Bias

Against plain FV, differences taken seed by seed. *Of the mean*: of the region's mean luminance, with its standard error. *Of pixels*:
mean squared bias of single pixels over the mean squared error of one render; noise is subtracted, so that it can be below 0. Two buffers
are unbiased by construction.

";

const COST: &str = "
## Cost

Judging the noise on a film of 2048x1024 (4096 cells of 16 points), median of 9, against tracing the samples after which it is first
done; from then on it is done when there are four times as many, so that its share falls to a quarter each time. The
table of the pixels about the gaze, which the host makes anew then, is not in it.

";

/// The whole page.
pub fn page(raw: &Value) -> String {
    let mut page = String::from("# Adaptive sampling: what it gains, costs and biases\n\n");
    for (name, value) in raw["machine"].as_object().into_iter().flatten() {
        page += &format!("- {name}: {}\n", text(value));
    }
    page += INTRODUCTION;
    page += "| scene | samples | way | s | samples a foveal pixel | fovea, relative | fovea, displayed |";
    for edges in EDGES_DEG.windows(2) {
        page += &format!(" {:.0} - {:.0} deg, displayed |", edges[0], edges[1]);
    }
    page += "\n|---|---|---|---|---|---|---|---|---|\n";
    for (scene, samples, plain, way) in rows(raw) {
        let seconds = [&plain["seconds"], &way["seconds"]].map(number);
        let cell = |region: usize, key: &str| {
            let [reference, own] = [plain, way].map(|row| number(&row["regions"][region][key]));
            let ratio = own / reference;
            format!("{own:.2e}, {ratio:.2} ({:.2})", ratio * seconds[1] / seconds[0])
        };
        page += &format!(
            "| {scene} | {samples} | {} | {:.2} | {:.0} | {} | {} | {} | {} |\n",
            text(&way["way"]),
            seconds[1],
            number(&way["regions"][0]["samples_a_pixel"]),
            cell(0, "relative_squared_error"),
            cell(0, "displayed_squared_error"),
            cell(1, "displayed_squared_error"),
            cell(2, "displayed_squared_error"),
        );
    }
    page += BIAS;
    page += "| scene | samples | way | fovea, of the mean | 6 - 15 deg, of the mean | fovea, of pixels |\n|---|---|---|---|---|---|\n";
    for (scene, samples, _, way) in rows(raw).filter(|row| row.3["way"] != "plain") {
        let of_mean = |region: usize| {
            let region = &way["regions"][region];
            let [bias, error] = ["bias_of_mean", "bias_of_mean_standard_error"].map(|key| 100.0 * number(&region[key]));
            format!("{bias:+.2} % +- {error:.2} %")
        };
        let fovea = &way["regions"][0];
        let [bias, error] = ["pixel_bias_squared", "pixel_bias_squared_standard_error"]
            .map(|key| number(&fovea[key]) / number(&fovea["relative_squared_error"]));
        page += &format!(
            "| {scene} | {samples} | {} | {} | {} | {bias:+.4} +- {error:.4} |\n",
            text(&way["way"]),
            of_mean(0),
            of_mean(1),
        );
    }
    page += COST;
    page += "| scene | judging, ms | tracing 262144 samples, s | share |\n|---|---|---|---|\n";
    for scene in list(&raw["scenes"]) {
        let [judging, tracing] = ["seconds", "traced_seconds"].map(|key| number(&scene["guide"][key]));
        page += &format!(
            "| {} | {:.1} | {tracing:.2} | {:.2} % |\n",
            text(&scene["scene"]),
            1e3 * judging,
            100.0 * judging / tracing
        );
    }
    page
}
