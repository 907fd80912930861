//! What was asked of the speed, beside what was measured.

use serde_json::Value;

use super::modes::MODES;
use super::page::{Found, batch_secs, batches, middle, per_second, ratio, row, rows, scenes, table};
use super::rays::KINDS;
use super::schedules;
use crate::cli::bench::Part;
use crate::commands::study::statistics::{geometric_mean, median};

/// Most of a batch that ray generation may take.
const GENERATION_SHARE: f64 = 0.03;
/// Rays a second over those of obvhs.
const TRAVERSAL: f64 = 0.9;
/// Segments a second of FV over those of OD.
const SEGMENTS: f64 = 0.95;
/// Seconds from an edit to its picture, in the scene that it was asked for.
const EDIT_SECS: f64 = 0.1;
/// Samples of that picture in the foveal disc.
const EDIT_SAMPLES: f64 = 1000.0;
/// Seconds to the first picture, kernels cached and cold, in the scene that it was asked for.
const START_SECS: [f64; 2] = [1.0, 2.5];
/// That scene.
const SPONZA: &str = "sponza";

/// A table of goals; empty where nothing was measured that one is about.
pub fn text(raw: &Value) -> String {
    let mut text = String::new();
    let mut line = |goal: &str, found: String, is_met: bool| {
        row(&mut text, &[goal.to_owned(), found, if is_met { "yes" } else { "**no**" }.to_owned()]);
    };
    let modes = scenes(raw, Part::Modes);
    let shares = generation(&modes);
    let largest = |of: fn(&Share<'_>) -> f64| shares.iter().max_by(|a, b| of(a).total_cmp(&of(b)));
    if let (Some(most), Some(usual)) = (largest(|share| share.most), largest(|share| share.usual)) {
        let name = |share: &Share<'_>| format!("{}, {}", share.scene, share.mode.to_uppercase());
        let found = format!(
            "at most {:.2} % ({}); median of the gazes at most {:.2} % ({})",
            most.most * 100.0,
            name(most),
            usual.usual * 100.0,
            name(usual)
        );
        line("ray generation at most 3 % of a batch", found, most.most <= GENERATION_SHARE);
    }
    let traversal = scenes(raw, Part::Rays);
    if !traversal.is_empty() {
        for (kind, is_asked) in KINDS.into_iter().zip([true, true, false]) {
            let ratios: Vec<(f64, &str)> =
                traversal.iter().map(|(name, found)| (mean_ratio(found, kind), *name)).collect();
            let found = ratios.iter().map(|(ratio, name)| format!("{name} {ratio:.2}")).collect::<Vec<_>>().join(", ");
            let is_met = ratios.iter().all(|(ratio, _)| *ratio >= TRAVERSAL);
            let asked = if is_asked { "at least 0.9" } else { "0.9 as well (not asked for)" };
            line(&format!("{kind} rays/s over obvhs on the CPU, mean over OD and the gazes: {asked}"), found, is_met);
        }
    }
    if !modes.is_empty() {
        let ratios: Vec<(f64, &str)> = modes.iter().map(|(name, found)| (fv_over_od(found), *name)).collect();
        let found = ratios.iter().map(|(ratio, name)| format!("{name} {ratio:.2}")).collect::<Vec<_>>().join(", ");
        let is_met = ratios.iter().all(|(ratio, _)| *ratio >= SEGMENTS);
        line("segments/s of FV over OD, mean over the gazes: at least 0.95", found, is_met);
        let others: Vec<(f64, &str)> =
            modes.iter().filter_map(|(name, found)| Some((schedules::mean_ratio(found)?, *name))).collect();
        if !others.is_empty() {
            let found = others.iter().map(|(ratio, name)| format!("{name} {ratio:.2}")).collect::<Vec<_>>().join(", ");
            let is_met = others.iter().all(|(ratio, _)| *ratio <= 1.0);
            line(
                "rate of the other schedule over the one that is used, mean over modes and gazes: at most 1",
                found,
                is_met,
            );
        }
    }
    let edits = scenes(raw, Part::Edits);
    for (name, found) in edits.iter().filter(|(name, _)| *name == SPONZA) {
        let [material, first, moves] = ["material_s", "first_move_s", "move_s"].map(|what| middle(&found[what]));
        let in_fovea = found["samples_in_foveal_disc"].as_f64().unwrap_or(0.0);
        let times = format!(
            "material {:.0}, first move {:.0}, further moves {:.0} ms",
            material * 1e3,
            first * 1e3,
            moves * 1e3
        );
        let is_met = material.max(first).max(moves) <= EDIT_SECS && in_fovea >= EDIT_SAMPLES;
        let goal = format!("edit to a picture of later samples, 1,000 in the foveal disc, {name}: at most 100 ms");
        line(&goal, format!("{times}; {in_fovea} samples"), is_met);
    }
    for (name, found) in scenes(raw, Part::Start).iter().filter(|(name, _)| *name == SPONZA) {
        for (state, limit) in ["cached", "cold"].into_iter().zip(START_SECS) {
            let until =
                |what: &str| middle(&Value::Array(rows(found, state).iter().map(|run| run[what].clone()).collect()));
            let [sketch, traced] = ["until_sketch_s", "process_s"].map(until);
            let goal = format!("process start to first picture, {name}, kernels {state}: at most {limit:.1} s");
            let found =
                format!("{sketch:.2} s for a grey sketch of first hits, {traced:.2} s for one that is path-traced");
            line(&goal, found, sketch <= limit);
        }
    }
    if text.is_empty() {
        text
    } else {
        format!("\n## What was asked for\n\n{}{text}", table(&["goal", "found", "met"]))
    }
}

/// What ray generation takes of a batch, over the gazes.
struct Share<'a> {
    scene: &'a str,
    mode: &'a str,
    most: f64,
    /// Median.
    usual: f64,
}

fn generation<'a>(modes: &Found<'a>) -> Vec<Share<'a>> {
    let share = |batch: &Value| middle(&batch["generate_s"]) / batch_secs(batch);
    let each = modes.iter().flat_map(|(scene, found)| {
        MODES.iter().filter_map(move |mode| {
            let mode = mode.name();
            let shares: Vec<f64> = batches(found, mode).into_iter().map(share).filter(|s| s.is_finite()).collect();
            let most = shares.iter().copied().reduce(f64::max)?;
            Some(Share { scene, mode, most, usual: median(shares)? })
        })
    });
    each.collect()
}

/// Geometric mean over OD and all gazes.
fn mean_ratio(found: &Value, kind: &str) -> f64 {
    let sets = rows(found, "sets").iter().filter(|set| set["rays"] == kind);
    geometric_mean(sets.map(ratio)).unwrap_or(f64::NAN)
}

fn fv_over_od(found: &Value) -> f64 {
    let pairs = batches(found, "fv").into_iter().zip(batches(found, "od"));
    geometric_mean(pairs.map(|(fv, od)| per_second(fv, "segments") / per_second(od, "segments"))).unwrap_or(f64::NAN)
}
