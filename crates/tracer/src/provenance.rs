//! Where a measurement was made: what goes with every number of a report or a bench.

use std::{fmt, process::Command};

use crate::gpu::Gpu;

/// Machine, adapter and revision.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Processor, hardware threads, operating system, build profile.
    pub machine: String,
    /// Graphics adapter, backend and driver, or why there is none.
    pub adapter: String,
    /// Revision of the source tree that the program is run in, and whether it has changes.
    pub commit: String,
}

impl Provenance {
    /// Of this process, measuring on `gpu`.
    #[must_use]
    pub fn on(gpu: &Gpu) -> Self {
        let info = gpu.info();
        let driver = format!("{} {}", info.driver, info.driver_info);
        Self::without_gpu(&format!("{} ({}, {})", info.name, info.backend, driver.trim()))
    }

    /// Of this process, measuring on the CPU alone; `reason` says why there is no adapter.
    #[must_use]
    pub fn without_gpu(reason: &str) -> Self {
        Self { machine: machine(), adapter: reason.to_owned(), commit: commit() }
    }

    /// Names and values, for JSON.
    #[must_use]
    pub fn fields(&self) -> [(&'static str, &str); 3] {
        [("machine", &self.machine), ("adapter", &self.adapter), ("commit", &self.commit)]
    }
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value) in self.fields() {
            writeln!(f, "{:<9}{value}", format!("{name}:"))?;
        }
        Ok(())
    }
}

fn machine() -> String {
    // Only Linux has this file; elsewhere the architecture must do.
    let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let cpu = cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let profile = if cfg!(debug_assertions) { "dev" } else { "release" };
    format!("{cpu}, {threads} threads, {}, {profile}", std::env::consts::OS)
}

fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    match (git(&["rev-parse", "--short=12", "HEAD"]), git(&["status", "--porcelain", "--untracked-files=no"])) {
        (Some(head), Some(changes)) if changes.is_empty() => head,
        (Some(head), _) => format!("{head} with changes"),
        (None, _) => "unknown (not run in a git checkout)".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_says_something() {
        let provenance = Provenance::without_gpu("none asked for");
        for (name, value) in provenance.fields() {
            assert!(!value.is_empty(), "{name}");
            assert!(provenance.to_string().contains(value), "{provenance}");
        }
    }
}
