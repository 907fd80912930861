//! What a direction costs on one core of this machine.

use std::fmt::Write;
use std::hint::black_box;
use std::time::Instant;

use fovea_sampler::report::Entry;
use fovea_sampler::{GazeWarp, Geometry, RadialDistribution, sequence, uniform_disc_batch};

/// Directions a run; the numbers fit the second-level cache.
const DRAWS: u32 = 1 << 15;
/// Runs, of which the fastest counts: others lost time to something else.
const RUNS: u32 = 100;

/// Samplers without foveation, for comparison.
pub(super) struct Baselines {
    disc_ns: f64,
}

impl Baselines {
    pub(super) fn measure() -> Self {
        let mut directions = vec![[0.0; 3]; DRAWS as usize];
        Self {
            disc_ns: fastest_ns(DRAWS, &numbers(DRAWS), |numbers| {
                uniform_disc_batch(numbers, &mut directions);
                black_box(&mut directions);
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

/// Nanoseconds a direction in a batch, by the f32 twin of the shader.
pub(super) fn direction_ns(warp: &GazeWarp) -> f64 {
    let mut directions = vec![[0.0; 3]; DRAWS as usize];
    fastest_ns(DRAWS, &numbers(DRAWS), |numbers| {
        warp.sample_local_batch(numbers, &mut directions);
        black_box(&mut directions);
    })
}

/// Nanoseconds a radius by root finding in f64.
pub(super) fn exact_ns(distribution: &RadialDistribution) -> f64 {
    let draws = DRAWS / 64;
    fastest_ns(draws, &numbers(draws), |numbers| {
        black_box(numbers.iter().map(|[u, _]| distribution.quantile(f64::from(*u)).radians()).sum::<f64>());
    })
}

fn numbers(count: u32) -> Vec<[f32; 2]> {
    let number = |i, dimension| sequence::to_unit_f32(sequence::sobol_owen(i, dimension, 1));
    (0..count).map(|i| [number(i, 0), number(i, 1)]).collect()
}

/// Of `draw`, a draw.
fn fastest_ns(draws: u32, numbers: &[[f32; 2]], mut draw: impl FnMut(&[[f32; 2]])) -> f64 {
    let run = |_| {
        let start = Instant::now();
        draw(black_box(numbers));
        start.elapsed().as_secs_f64()
    };
    (0..RUNS).map(run).fold(f64::INFINITY, f64::min) * 1e9 / f64::from(draws)
}
