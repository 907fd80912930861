//! Both schedules beside each other, of what `modes` measured.

use serde_json::Value;

use super::modes::MODES;
use super::page::{Found, batches, middle, row, rows, spread, table};
use crate::commands::study::statistics::{geometric_mean, median};

/// Seconds that this run's schedule took for a batch over those of the other one: the rate of the other over this one's. By the
/// clock, since a batch of many passes costs the host time too.
fn other_over_own(batch: &Value) -> f64 {
    middle(&batch["wall_s"]) / middle(&batch["other_wall_s"])
}

/// The same over all modes and gazes of a scene; `None` where the other one was not measured.
pub fn mean_ratio(found: &Value) -> Option<f64> {
    let ratios = rows(found, "batches").iter().map(other_over_own).filter(|ratio| ratio.is_finite());
    geometric_mean(ratios)
}

/// A table of both; empty where only one was measured.
pub fn table_of(scenes: &Found<'_>) -> String {
    let known: Vec<_> = scenes.iter().filter(|(_, found)| mean_ratio(found).is_some()).collect();
    if known.is_empty() {
        return String::new();
    }
    let mut text = "\nSchedules, the same batches in turn, milliseconds of the device, medians over the gazes. The wavefront's kernels \
                    are summed over its rounds; what its trace has beyond them is between passes. Rates are by the clock, with what \
                    the host does.\n\n"
        .to_owned();
    text += &table(&[
        "scene",
        "mode",
        "schedule",
        "trace",
        "other schedule",
        "trace",
        "other's rate over this one's",
        "wavefront: start",
        "extend",
        "shade",
    ]);
    for (name, found) in known {
        let label = |what: &str| found[what].as_str().unwrap_or("-").to_owned();
        for mode in MODES.map(|mode| mode.name()) {
            let here = batches(found, mode);
            let ms = |what: &str| {
                let all =
                    here.iter().map(|batch| middle(&batch[what]) * 1e3).filter(|value| value.is_finite()).collect();
                median(all).map_or("-".into(), |value| format!("{value:.1}"))
            };
            let ratios: Vec<f64> = here.iter().copied().map(other_over_own).collect();
            let mean = geometric_mean(ratios.iter().copied()).unwrap_or(f64::NAN);
            let mut cells = vec![(*name).to_owned(), mode.to_uppercase()];
            cells.extend([label("schedule"), ms("trace_s"), label("other_schedule"), ms("other_trace_s")]);
            cells.push(format!("{}; mean {mean:.2}", spread(&ratios, 2)));
            cells.extend(["start_s", "extend_s", "shade_s"].map(ms));
            row(&mut text, &cells);
        }
    }
    text
}
