//! What happens where something is missing or goes away: a clear message, and the preview goes on.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::monado::{Monado, said};

/// Runs the preview where `prepare` has taken something away; what it said.
fn message(name: &str, monado: &Monado, prepare: impl FnOnce(&mut Command)) -> String {
    let mut command = monado.inner("the_preview_goes_on_without_a_headset");
    prepare(&mut command);
    let text = said(&command.output().unwrap());
    let message = text.lines().find_map(|line| line.split_once("MESSAGE ")).unwrap().1.to_owned();
    eprintln!("{name}: {message}");
    message
}

#[test]
fn the_preview_goes_on_without_runtime_service_or_driver() {
    let Some(monado) = Monado::find("the_preview_goes_on_without_runtime_service_or_driver") else { return };
    let none = message("no runtime", &monado, |command| {
        command.env("XR_RUNTIME_JSON", monado.place().join("none.json"));
    });
    assert!(none.contains("no OpenXR runtime is set up"), "{none}");
    let down = message("service down", &monado, |_| ());
    assert!(down.contains("does not answer"), "{down}");
}

#[test]
fn a_missing_loader_is_named() {
    // This system's own libraries, among which the loader may be; then there is no runtime, or none that answers.
    let output = Command::new(env!("CARGO_BIN_EXE_fovea"))
        .args(["adapters", "--json"])
        .env("XR_RUNTIME_JSON", Path::new("/nonexistent/runtime.json"))
        .output()
        .unwrap();
    let adapters: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let error = adapters["openxr"]["error"].as_str().unwrap();
    assert!(error.contains("no OpenXR loader") || error.contains("no OpenXR runtime"), "{error}");
    eprintln!("{error}");
}

#[test]
fn a_killed_runtime_takes_neither_preview_nor_film_with_it() {
    let name = "a_killed_runtime_takes_neither_preview_nor_film_with_it";
    let Some(mut monado) = Monado::find(name) else { return };
    monado.start(None);
    let mut preview = monado.inner(name).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut rest = preview.stdout.take().unwrap();
    let rest = std::thread::spawn(move || {
        let mut text = String::new();
        rest.read_to_string(&mut text).map(|_| text)
    });
    let mut lines = Vec::new();
    for line in BufReader::new(preview.stderr.take().unwrap()).lines() {
        let line = line.unwrap();
        if line.contains("KILL") {
            monado.kill();
        }
        lines.push(line);
    }
    let status = preview.wait().unwrap();
    assert!(status.success(), "{}\n{}", lines.join("\n"), rest.join().unwrap().unwrap());
    lines
        .iter()
        .filter(|line| line.contains("MESSAGE") || line.contains("samples"))
        .for_each(|line| eprintln!("{line}"));
}
