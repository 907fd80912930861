//! `fovea adapters`: what wgpu finds, and which one would be used.

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
        return print_json(&json!({ "adapters": adapters.iter().map(describe).collect::<Vec<_>>() }));
    }
    if adapters.is_empty() {
        return print_text("no graphics adapter found\n");
    }
    print_text(&adapters.iter().map(line).collect::<String>())
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
