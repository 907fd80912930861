//! `fovea adapters`: what wgpu finds, which one would be used, and the headset's runtime.

use serde_json::{Value, json};
use tracer::gpu::{AdapterDescription, Gpu};

use super::{print_json, print_text};
use crate::cli::AdaptersArgs;

/// Prints the list; an empty one is no error.
///
/// # Errors
/// When standard output is closed.
pub fn run(args: &AdaptersArgs) -> anyhow::Result<()> {
    let adapters = Gpu::adapters();
    if args.json {
        let adapters: Vec<Value> = adapters.iter().map(describe).collect();
        let openxr = match headset() {
            Ok(Headset { runtime, system, eye_gaze }) => {
                json!({ "runtime": runtime, "system": system, "eye_gaze": eye_gaze })
            }
            Err(error) => json!({ "error": error }),
        };
        return print_json(&json!({ "adapters": adapters, "openxr": openxr }));
    }
    let mut text: String = adapters.iter().map(line).collect();
    if adapters.is_empty() {
        text.push_str("no graphics adapter found\n");
    }
    text.push_str(&match headset() {
        Ok(Headset { runtime, system, eye_gaze }) => {
            format!("OpenXR: {runtime}, {system}, {} eye gaze\n", if eye_gaze { "with" } else { "without" })
        }
        Err(error) => format!("OpenXR: {error}\n"),
    });
    print_text(&text)
}

/// A headset that VR would use.
struct Headset {
    runtime: String,
    system: String,
    eye_gaze: bool,
}

#[cfg(any(target_os = "linux", target_os = "windows"))]
fn headset() -> Result<Headset, String> {
    let runtime = crate::vr::runtime::Runtime::find().map_err(|error| error.to_string())?;
    let crate::vr::runtime::Facts { runtime, system, eye_gaze } = runtime.facts().clone();
    Ok(Headset { runtime, system, eye_gaze })
}

#[cfg(not(any(target_os = "linux", target_os = "windows")))]
fn headset() -> Result<Headset, String> {
    Err("headsets are supported on Linux and Windows only".into())
}

fn describe(adapter: &AdapterDescription) -> Value {
    let info = &adapter.info;
    json!({
        "name": info.name,
        "backend": info.backend.to_string(),
        "kind": format!("{:?}", info.device_type),
        "driver": info.driver,
        "driver_info": info.driver_info,
        "shortfalls": adapter.shortfalls,
        "default": adapter.is_default,
    })
}

fn line(adapter: &AdapterDescription) -> String {
    let info = &adapter.info;
    let marker = if adapter.is_default { '*' } else { ' ' };
    let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ");
    let fitness = match adapter.shortfalls.as_slice() {
        [] => String::new(),
        shortfalls => format!(" - cannot be used: {}", shortfalls.join("; ")),
    };
    format!("{marker} {} ({}, {:?}, {}){fitness}\n", info.name, info.backend, info.device_type, driver.trim())
}
