//! Figures of a test that are worth reporting.

use std::path::PathBuf;

use serde_json::Value;
use tracer::provenance::Provenance;

/// Leaves figures for docs/reports/window.md where `FOVEA_FIGURES` names a folder (scripts/window_report does).
pub fn keep(name: &str, adapter: &str, mut figures: Value) {
    let Some(folder) = std::env::var_os("FOVEA_FIGURES") else { return };
    for (name, value) in Provenance::without_gpu(adapter).fields() {
        figures[name] = value.into();
    }
    // What the machine did beside: times count on a quiet one only.
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    figures["load"] = load.split(' ').next().unwrap_or_default().into();
    let path = PathBuf::from(folder).join(format!("{name}.json"));
    std::fs::write(path, serde_json::to_string_pretty(&figures).unwrap() + "\n").unwrap();
}
