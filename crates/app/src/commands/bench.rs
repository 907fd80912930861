//! `fovea bench`: what a scene costs on an adapter, part by part, beside a tracer on the CPU.
//!
//! What is compared takes turns in one run, and medians count. Raw numbers of every scene and part go to one file, from which
//! the report is made.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail, ensure};
use glam::Vec3;
use serde_json::{Value, json};
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::provenance::Provenance;

use crate::cli::bench::{BenchArgs, Part};
use crate::commands::print_text;
use crate::output::{check_writable, write_text};
use crate::process;
use subject::Subject;

pub mod baseline;
mod edits;
mod features;
mod goals;
mod modes;
mod page;
mod rays;
mod schedules;
mod start;
mod subject;

/// Measures a scene, prints what was found, and keeps it where asked to.
///
/// # Errors
/// Bad input, an adapter that cannot do it, or a file that cannot be written.
pub fn run(args: &BenchArgs) -> anyhow::Result<()> {
    if args.first_picture {
        return start::show(args);
    }
    if let Some(path) = &args.json {
        check_writable(path)?;
    }
    let mut kept = args.json.as_deref().map_or_else(|| Ok(empty()), read)?;
    let notes = args.json.as_deref().map_or_else(|| Ok(String::new()), notes)?;
    if args.parts().contains(&Part::Report) {
        ensure!(args.parts().len() == 1, "--only report measures nothing and takes no other part");
        let (Some(folder), Some(file)) = (&args.report, &args.json) else { bail!("--only report needs --report") };
        ensure!(kept != empty(), "{}: holds no measurement", file.display());
        page::check(folder)?;
        return page::write(folder, &kept, &notes);
    }
    if let Some(folder) = &args.report {
        page::check(folder)?;
    }
    if cfg!(debug_assertions) && args.parts().contains(&Part::Rays) {
        eprintln!("obvhs on the CPU is slower in this build than in one for release, the device is not");
    }
    let gpu = Gpu::headless(&args.adapter.clone().map_or(AdapterSelect::Auto, AdapterSelect::Named))?;
    let subject = Subject::open(args)?;
    let mut here = json!({});
    for &part in args.parts() {
        eprintln!("{}: {} ...", subject.name, part.name());
        let load = process::load();
        let (started, cpu) = (Instant::now(), process::cpu_secs());
        let mut found = match part {
            Part::Rays => rays::measure(&gpu, args, &subject)?,
            Part::Modes => modes::measure(&gpu, args, &subject)?,
            Part::Edits => edits::measure(&gpu, args, &subject)?,
            Part::Start => start::measure(args)?,
            Part::Features => features::measure(&gpu, args, &subject)?,
            Part::Report => continue,
        };
        for (name, value) in Provenance::on(&gpu).fields() {
            found[name] = value.into();
        }
        found["load_before"] = load.into();
        found["rounds"] = args.rounds.into();
        found["took_s"] = started.elapsed().as_secs_f64().into();
        found["took_cpu_s"] = finite(process::cpu_secs() - cpu);
        here[part.name()] = found.clone();
        kept["scenes"][&subject.name][part.name()] = found;
    }
    if let Some(path) = &args.json {
        write_text(path, &format!("{kept:#}\n"))?;
    }
    if let Some(folder) = &args.report {
        page::write(folder, &kept, &notes)?;
    }
    // A reader that is gone loses nothing that was measured.
    print_text(&page::text(&json!({ "scenes": { subject.name.as_str(): here } })))
}

fn empty() -> Value {
    json!({ "scenes": {} })
}

/// What an earlier bench left, or nothing yet.
fn read(path: &Path) -> anyhow::Result<Value> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(empty()),
        Err(error) => return Err(error).with_context(|| path.display().to_string()),
    };
    let raw: Value = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    let holds_objects = |value: &Value| value.as_object().is_some_and(|all| all.values().all(Value::is_object));
    let is_bench = raw["scenes"].as_object().is_some_and(|scenes| scenes.values().all(holds_objects));
    ensure!(is_bench, "{} is no file of fovea bench", path.display());
    Ok(raw)
}

/// What the one who measures has to say, in a file beside the raw numbers: `speed.notes.md` for `speed.json`.
fn notes(json: &Path) -> anyhow::Result<String> {
    let path = json.with_extension("notes.md");
    match std::fs::read_to_string(&path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        text => text.with_context(|| path.display().to_string()),
    }
}

/// A number, or null where it is none.
fn finite(value: f64) -> Value {
    if value.is_finite() { value.into() } else { Value::Null }
}

/// A direction as raw numbers have it.
fn direction_json(direction: Vec3) -> Value {
    json!(direction.to_array())
}
