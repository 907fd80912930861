//! What a direction costs on one core of this machine.

use std::fmt::Write;
use std::hint::black_box;
use std::time::Instant;

use fovea_sampler::report::Entry;
use fovea_sampler::{GazeWarp, Geometry, RadialDistribution, sequence, trig};

/// Directions a run; the numbers fit the second-level cache.
const DRAWS: u32 = 1 << 15;
/// Runs, of which the fastest counts: others lost time to something else.
const RUNS: u32 = 25;

/// Samplers without foveation, for comparison.
pub(super) struct Baselines {
    disc_ns: f64,
}

impl Baselines {
    pub(super) fn measure() -> Self {
        Self {
            disc_ns: fastest_ns(&numbers(DRAWS), |[u, v]| {
                let radius = u.sqrt();
                let [cos, sin] = trig::cos_sin_turn(v);
                radius * cos + radius * sin
            }),
        }
    }

    /// The default inverses against a uniform disc sample.
    pub(super) fn text(&self, entries: &[Entry]) -> String {
        let mut text = format!("\nuniform disc sample: {:.2} ns on the CPU\n", self.disc_ns);
        for (geometry, name) in [(Geometry::Sphere, "rational3/3"), (Geometry::Plane, "poly5")] {
            if let Some(entry) = entries.iter().find(|e| e.geometry == geometry && e.name == name) {
                let ratio = entry.cpu_ns / self.disc_ns;
                // Writing to a string does not fail.
                let _ = writeln!(text, "default on the {}: {ratio:.2} x a uniform disc sample", geometry.name());
            }
        }
        text
    }
}

/// Nanoseconds a direction by the f32 twin of the shader.
pub(super) fn direction_ns(warp: &GazeWarp) -> f64 {
    fastest_ns(&numbers(DRAWS), |u| {
        let [x, _, z] = warp.sample_local_f32(u);
        x + z
    })
}

/// Nanoseconds a radius by root finding in f64.
pub(super) fn exact_ns(distribution: &RadialDistribution) -> f64 {
    fastest_ns(&numbers(DRAWS / 64), |[u, _]| distribution.quantile(f64::from(u)).radians() as f32)
}

fn numbers(count: u32) -> Vec<[f32; 2]> {
    let number = |i, dimension| sequence::to_unit_f32(sequence::sobol_owen(i, dimension, 1));
    (0..count).map(|i| [number(i, 0), number(i, 1)]).collect()
}

fn fastest_ns(numbers: &[[f32; 2]], sample: impl Fn([f32; 2]) -> f32) -> f64 {
    let run = |_| {
        let start = Instant::now();
        black_box(numbers.iter().map(|u| sample(black_box(*u))).sum::<f32>());
        start.elapsed().as_secs_f64()
    };
    (0..RUNS).map(run).fold(f64::INFINITY, f64::min) * 1e9 / numbers.len() as f64
}

/// Processor and operating system.
pub(super) fn machine() -> String {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let cpu = cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!(
        "{cpu}, {cores} cores, {}, {}",
        std::env::consts::OS,
        if cfg!(debug_assertions) { "dev" } else { "release" }
    )
}

/// The revision of the source tree that the program is run in.
pub(super) fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git").args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    match (git(&["rev-parse", "--short=12", "HEAD"]), git(&["status", "--porcelain", "--untracked-files=no"])) {
        (Some(head), Some(changes)) if changes.is_empty() => head,
        (Some(head), _) => format!("{head} with changes"),
        (None, _) => "unknown (not run in a git checkout)".into(),
    }
}
