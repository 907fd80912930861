//! Tables and plots of the raw numbers: for a terminal, and for the report.

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use fovea_sampler::report::{Chart, Mark};
use serde_json::Value;

use super::goals;
use super::modes::MODES;
use super::rays::KINDS;
use super::schedules;
use crate::cli::bench::Part;
use crate::commands::study::plan::Method;
use crate::commands::study::plot::{self, Axis, Scale, Series};
use crate::commands::study::statistics::{geometric_mean, median};
use crate::output::{check_writable, write_text};

/// The report's name.
const PAGE: &str = "speed.md";

/// All tables of what was measured.
pub fn text(raw: &Value) -> String {
    let mut text = String::new();
    for part in [Part::Rays, Part::Modes, Part::Edits, Part::Start, Part::Features] {
        let scenes = scenes(raw, part);
        if scenes.is_empty() {
            continue;
        }
        text += match part {
            Part::Rays => "\n## Rays without shading, beside obvhs on the CPU\n\n",
            Part::Modes => "\n## Modes\n\n",
            Part::Edits => "\n## Edits and looks\n\n",
            Part::Start => "\n## Start to the first picture\n\n",
            Part::Features => "\n## Features that a scene does not need\n\n",
            Part::Report => "",
        };
        text += &provenance(&scenes);
        text += &match part {
            Part::Rays => rays(&scenes),
            Part::Modes => modes(&scenes) + &passes(&scenes) + &schedules::table_of(&scenes) + &memory(&scenes),
            Part::Edits => edits(&scenes),
            Part::Start => start(&scenes),
            Part::Features => features(&scenes),
            Part::Report => String::new(),
        };
    }
    text
}

/// Finds out, before the work is done, whether the report could be written.
///
/// # Errors
/// When the folder cannot be made, or nothing can be written into it.
pub fn check(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    Ok(check_writable(&folder.join(PAGE))?)
}

/// Writes `speed.md`, with notes of the one who measured, and its plots.
///
/// # Errors
/// When a file cannot be written.
pub fn write(folder: &Path, raw: &Value, notes: &str) -> anyhow::Result<()> {
    let mut page = String::from(include_str!("page.md"));
    if !notes.is_empty() {
        page += &format!("\n{}\n", notes.trim());
    }
    page += "\n![Traversal by gaze](speed-rays.svg)\n\n![Path segments by gaze](speed-modes.svg)\n";
    page += &goals::text(raw);
    page += &text(raw);
    write_text(&folder.join(PAGE), &page)?;
    plot::write(folder, "speed-rays", &rays_chart(raw))?;
    plot::write(folder, "speed-modes", &modes_chart(raw))
}

/// Scenes with what was found in them.
pub(super) type Found<'a> = Vec<(&'a str, &'a Value)>;

/// Scenes in which a part was measured.
pub(super) fn scenes(raw: &Value, part: Part) -> Found<'_> {
    let all = raw["scenes"].as_object().into_iter().flatten();
    all.map(|(name, parts)| (name.as_str(), &parts[part.name()])).filter(|(_, found)| found.is_object()).collect()
}

/// Where the part was measured; once where it is the same for all scenes.
fn provenance(scenes: &Found<'_>) -> String {
    let line = |found: &Value| {
        let field = |name: &str| found[name].as_str().unwrap_or("unknown").to_owned();
        format!(
            "{}; {}; commit {}; medians of {}",
            field("machine"),
            field("adapter"),
            field("commit"),
            found["rounds"]
        )
    };
    let mut lines: Vec<String> = scenes.iter().map(|(_, found)| line(found)).collect();
    lines.dedup();
    let loads: Vec<f64> = scenes.iter().filter_map(|(_, found)| found["load_before"].as_f64()).collect();
    let most = loads.iter().copied().fold(0.0, f64::max);
    format!("{}; load average before at most {most:.1}.\n\n", lines.join(". "))
}

/// Median of a list of numbers; NaN without one.
pub(super) fn middle(list: &Value) -> f64 {
    let values = list.as_array().map(|list| list.iter().filter_map(Value::as_f64).collect()).unwrap_or_default();
    median(values).unwrap_or(f64::NAN)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

pub(super) fn rows<'a>(found: &'a Value, list: &str) -> &'a [Value] {
    found[list].as_array().map_or(&[], Vec::as_slice)
}

pub(super) fn table(head: &[&str]) -> String {
    format!("| {} |\n|{}\n", head.join(" | "), "---|".repeat(head.len()))
}

pub(super) fn row(text: &mut String, cells: &[String]) {
    // Writing to a string does not fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

/// `middle (least - most)`.
pub(super) fn spread(values: &[f64], digits: usize) -> String {
    let known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let (low, high) = known.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    match median(known) {
        Some(value) if high > low => format!("{value:.digits$} ({low:.digits$} - {high:.digits$})"),
        Some(value) => format!("{value:.digits$}"),
        None => "-".into(),
    }
}

/// Device over obvhs of a set of rays.
pub(super) fn ratio(set: &Value) -> f64 {
    middle(&set["obvhs_s"]) / middle(&set["device_s"])
}

fn rays(scenes: &Found<'_>) -> String {
    let mut text = table(&[
        "scene",
        "triangles",
        "rays",
        "OD: device, M/s",
        "obvhs, M/s",
        "device / obvhs",
        "FV, all gazes: device, M/s",
        "obvhs, M/s",
        "device / obvhs",
        "by gaze",
        "other hierarchy over this one",
    ]);
    for (name, found) in scenes {
        for kind in KINDS {
            let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<&Value> {
                let here = |set: &&Value| set["rays"] == kind && wanted(set["gaze"].as_str().unwrap_or_default());
                rows(found, "sets").iter().filter(here).collect()
            };
            let rate = |sets: &[&Value], side: &str| {
                let count: f64 = sets.iter().map(|set| number(&set["count"])).sum();
                count / sets.iter().map(|set| middle(&set[side])).sum::<f64>() * 1e-6
            };
            let [od, fv] = [of(&|gaze| gaze == "od"), of(&|gaze| gaze != "od")];
            let mut cells = vec![(*name).to_owned(), found["triangles"].to_string(), kind.to_owned()];
            for sets in [&od, &fv] {
                let (device, cpu) = (rate(sets, "device_s"), rate(sets, "obvhs_s"));
                cells.extend([format!("{device:.2}"), format!("{cpu:.2}"), format!("{:.2}", device / cpu)]);
            }
            cells.push(spread(&fv.iter().map(|set| ratio(set)).collect::<Vec<_>>(), 2));
            let over = |set: &&Value| middle(&set["device_s"]) / middle(&set["other_s"]);
            let other = found["other_hierarchy"].as_str().unwrap_or("-");
            let all: Vec<f64> = od.iter().chain(&fv).map(over).collect();
            cells.push(format!("{other} {}", spread(&all, 2)));
            row(&mut text, &cells);
        }
    }
    text
}

/// Batches of a mode at all gazes.
pub(super) fn batches<'a>(found: &'a Value, mode: &str) -> Vec<&'a Value> {
    rows(found, "batches").iter().filter(|batch| batch["mode"] == mode).collect()
}

/// Of trace and accumulate, by timestamps, else by the clock.
pub(super) fn batch_secs(batch: &Value) -> f64 {
    let device = middle(&batch["trace_s"]) + middle(&batch["accumulate_s"]);
    if device.is_finite() { device } else { middle(&batch["wall_s"]) }
}

pub(super) fn per_second(batch: &Value, what: &str) -> f64 {
    number(&batch[what]) / batch_secs(batch)
}

fn modes(scenes: &Found<'_>) -> String {
    let mut text = table(&[
        "scene",
        "mode",
        "k samples/s (over the gazes)",
        "k segments/s",
        "k rays/s with shadow rays",
        "segments a sample",
        "segments/s over OD's",
        "process CPU s over wall s",
    ]);
    for (name, found) in scenes {
        let od = batches(found, "od");
        for mode in MODES.map(Method::name) {
            let here = batches(found, mode);
            let all = |what: &str| here.iter().map(|batch| per_second(batch, what) * 1e-3).collect::<Vec<_>>();
            let rays: Vec<f64> = all("segments").iter().zip(all("shadow_rays")).map(|(a, b)| a + b).collect();
            let lengths: Vec<f64> = here.iter().map(|b| number(&b["segments"]) / number(&b["samples"])).collect();
            let over: Vec<f64> =
                here.iter().zip(&od).map(|(a, b)| per_second(a, "segments") / per_second(b, "segments")).collect();
            let cpu: Vec<f64> = here.iter().map(|b| middle(&b["process_cpu_s"]) / middle(&b["wall_s"])).collect();
            row(
                &mut text,
                &[
                    (*name).to_owned(),
                    mode.to_uppercase(),
                    spread(&all("samples"), 0),
                    spread(&all("segments"), 0),
                    spread(&rays, 0),
                    spread(&lengths, 2),
                    format!(
                        "{}; mean {:.2}",
                        spread(&over, 2),
                        geometric_mean(over.iter().copied()).unwrap_or(f64::NAN)
                    ),
                    format!("{:.2}", median(cpu).unwrap_or(f64::NAN)),
                ],
            );
        }
    }
    text
}

fn passes(scenes: &Found<'_>) -> String {
    let mut text = "\nPasses, milliseconds of the device, medians over the gazes. Tracing, shading and connecting are one figure, \
                    which holds the generation of rays too; ray generation alone is a kernel of its own for this bench.\n\n"
        .to_owned();
    text += &table(&[
        "scene",
        "mode",
        "samples",
        "generate",
        "trace and shade",
        "accumulate",
        "reconstruct the picture",
        "generate over the batch, %",
        "generate over OD's",
    ]);
    for (name, found) in scenes {
        let od = batches(found, "od");
        for mode in MODES.map(Method::name) {
            let here = batches(found, mode);
            let pass = |what: &str| here.iter().map(|batch| middle(&batch[what]) * 1e3).collect::<Vec<_>>();
            let share: Vec<f64> = here.iter().map(|b| middle(&b["generate_s"]) / batch_secs(b) * 100.0).collect();
            let over: Vec<f64> =
                here.iter().zip(&od).map(|(a, b)| middle(&a["generate_s"]) / middle(&b["generate_s"])).collect();
            let mut cells = vec![
                (*name).to_owned(),
                mode.to_uppercase(),
                here.first().map_or("-".into(), |batch| batch["samples"].to_string()),
            ];
            for what in ["generate_s", "trace_s", "accumulate_s", "reconstruct_s"] {
                cells.push(median(pass(what)).map_or("-".into(), |value| format!("{value:.2}")));
            }
            cells.extend([spread(&share, 2), spread(&over, 2)]);
            row(&mut text, &cells);
        }
    }
    text
}

fn memory(scenes: &Found<'_>) -> String {
    let mut text = "\nMemory, and what setting the scene took.\n\n".to_owned();
    text += &table(&[
        "scene",
        "triangles",
        "geometry, bytes a triangle",
        "scene, MB",
        "film, MB",
        "process, MB",
        "import s",
        "hierarchies s",
        "rest s",
        "kernels s",
    ]);
    for (name, found) in scenes {
        let mega = |what: &str| format!("{:.0}", number(&found[what]) * 1e-6);
        let seconds = |what: &str| format!("{:.2}", number(&found[what]));
        row(
            &mut text,
            &[
                (*name).to_owned(),
                found["triangles"].to_string(),
                format!("{:.0}", number(&found["geometry_bytes"]) / number(&found["triangles"])),
                mega("scene_bytes"),
                mega("film_bytes"),
                mega("resident_bytes"),
                seconds("import_s"),
                seconds("bvh_build_s"),
                seconds("upload_s"),
                seconds("kernel_compile_s"),
            ],
        );
    }
    text
}

fn edits(scenes: &Found<'_>) -> String {
    let mut text = table(&[
        "scene",
        "material, ms",
        "first move of an object, ms",
        "further moves, ms",
        "look elsewhere, ms",
        "samples in the picture",
        "of them in the foveal disc",
    ]);
    for (name, found) in scenes {
        let ms = |what: &str| {
            let all: Vec<f64> = rows(found, what).iter().map(|value| number(value) * 1e3).collect();
            spread(&all, 0)
        };
        row(
            &mut text,
            &[
                (*name).to_owned(),
                ms("material_s"),
                ms("first_move_s"),
                ms("move_s"),
                ms("gaze_s"),
                found["samples"].to_string(),
                found["samples_in_foveal_disc"].to_string(),
            ],
        );
    }
    text
}

fn start(scenes: &Found<'_>) -> String {
    let mut text = table(&[
        "scene",
        "kernels",
        "until the sketch, s",
        "until the end, s",
        "device",
        "shapes",
        "hierarchies and sketch",
        "images and tangents",
        "upload of the rest",
        "kernels",
        "light split and film",
        "first 2^14 samples",
        "picture",
    ]);
    for (name, found) in scenes {
        for state in ["cold", "cached"] {
            let all = rows(found, state);
            let of = |what: &str| all.iter().map(|run| number(&run[what])).collect::<Vec<_>>();
            let mut cells = vec![
                (*name).to_owned(),
                state.to_owned(),
                spread(&of("until_sketch_s"), 2),
                spread(&of("process_s"), 2),
            ];
            for stage in [
                "device_s",
                "shapes_s",
                "sketch_s",
                "import_s",
                "upload_s",
                "kernels_s",
                "rest_of_scene_s",
                "first_batch_s",
                "picture_s",
            ] {
                cells.push(median(of(stage)).map_or("-".into(), |value| format!("{value:.2}")));
            }
            row(&mut text, &cells);
        }
    }
    text
}

fn features(scenes: &Found<'_>) -> String {
    let mut text = "OD; a feature is compiled in with those that it never occurs without.\n".to_owned();
    for (name, found) in scenes {
        let needs = found["needs"].as_str().unwrap_or_default();
        let _ = write!(text, "\n{name} needs {needs}.\n\n");
        text += &table(&["kernel", "trace, ms", "over the scene's own", "lines of WGSL", "first dispatch, s"]);
        let own = rows(found, "kernels").first().map_or(f64::NAN, |row| middle(&row["trace_s"]));
        for kernel in rows(found, "kernels") {
            let seconds = middle(&kernel["trace_s"]);
            row(
                &mut text,
                &[
                    kernel["kernel"].as_str().unwrap_or_default().to_owned(),
                    format!("{:.1}", seconds * 1e3),
                    format!("{:.3}", seconds / own),
                    kernel["lines"].to_string(),
                    format!("{:.2}", number(&kernel["first_dispatch_s"])),
                ],
            );
        }
    }
    text
}

const GAZE_AXIS: Axis<'_> = Axis { title: "gaze, from the highest to the lowest", scale: Scale::Linear };

fn caption(scenes: &Found<'_>) -> String {
    let first = scenes.first().map_or(&Value::Null, |(_, found)| *found);
    let field = |name: &str| first[name].as_str().unwrap_or("unknown").to_owned();
    format!("{} / {} / {}", field("machine"), field("adapter"), field("commit"))
}

/// Diffuse rays a second over those of obvhs, gaze by gaze.
fn rays_chart(raw: &Value) -> Chart {
    let scenes = scenes(raw, Part::Rays);
    let one = |(index, (name, found)): (usize, &(&str, &Value))| {
        let looks = rows(found, "sets").iter().filter(|set| set["rays"] == "diffuse" && set["gaze"] != "od");
        let points = looks.enumerate().map(|(i, set)| [i as f64 + 1.0, ratio(set)]).collect();
        Series { name: (*name).to_owned(), mark: Mark::Series(index as u8), points }
    };
    let series: Vec<Series> = scenes.iter().enumerate().map(one).collect();
    let up = Axis { title: "diffuse rays/s, device over obvhs on the CPU", scale: Scale::Linear };
    plot::lines("Traversal by gaze", &caption(&scenes), GAZE_AXIS, up, &series)
}

/// Segments a second of FV over those of OD, gaze by gaze.
fn modes_chart(raw: &Value) -> Chart {
    let scenes = scenes(raw, Part::Modes);
    let one = |(index, (name, found)): (usize, &(&str, &Value))| {
        let pairs = batches(found, "fv").into_iter().zip(batches(found, "od"));
        let over = pairs.map(|(fv, od)| per_second(fv, "segments") / per_second(od, "segments"));
        let points = over.enumerate().map(|(i, over)| [i as f64 + 1.0, over]).collect();
        Series { name: (*name).to_owned(), mark: Mark::Series(index as u8), points }
    };
    let series: Vec<Series> = scenes.iter().enumerate().map(one).collect();
    let up = Axis { title: "segments/s, FV over OD", scale: Scale::Linear };
    plot::lines("Path segments by gaze", &caption(&scenes), GAZE_AXIS, up, &series)
}
