//! What a direction costs on one core of this machine.

use std::fmt::Write;
use std::hint::black_box;
use std::time::Instant;

use fovea_sampler::report::Entry;
use fovea_sampler::{GazeWarp, Geometry, RadialDistribution, sequence, uniform_disc_batch};

/// Directions a run; the numbers fit the second-level cache.
const DRAWS: u32 = 1 << 15;
/// Rounds over all that is compared, and runs of each in a round. The fastest counts: others lost time to something else, and
/// what slows the machine for a while slows all alike.
const ROUNDS: u32 = 10;
const RUNS: u32 = 20;

/// Nanoseconds a direction, in batches.
pub(super) struct Costs {
    disc_ns: f64,
    /// By the f32 twin of the shader, in the order of the warps.
    pub(super) warps_ns: Vec<f64>,
}

impl Costs {
    pub(super) fn measure(warps: &[GazeWarp]) -> Self {
        let numbers = numbers(DRAWS);
        let mut directions = vec![[0.0; 3]; DRAWS as usize];
        let mut costs = Self { disc_ns: f64::INFINITY, warps_ns: vec![f64::INFINITY; warps.len()] };
        for _ in 0..ROUNDS {
            let disc_ns = fastest_ns(&numbers, |numbers| {
                uniform_disc_batch(numbers, &mut directions);
                black_box(&mut directions);
            });
            costs.disc_ns = costs.disc_ns.min(disc_ns);
            for (warp, fastest) in warps.iter().zip(&mut costs.warps_ns) {
                let warp_ns = fastest_ns(&numbers, |numbers| {
                    warp.sample_local_batch(numbers, &mut directions);
                    black_box(&mut directions);
                });
                *fastest = fastest.min(warp_ns);
            }
        }
        costs
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

/// Nanoseconds a radius by root finding in f64.
pub(super) fn exact_ns(distribution: &RadialDistribution) -> f64 {
    fastest_ns(&numbers(DRAWS / 64), |numbers| {
        black_box(numbers.iter().map(|[u, _]| distribution.quantile(f64::from(*u)).radians()).sum::<f64>());
    })
}

fn numbers(count: u32) -> Vec<[f32; 2]> {
    let number = |i, dimension| sequence::to_unit_f32(sequence::sobol_owen(i, dimension, 1));
    (0..count).map(|i| [number(i, 0), number(i, 1)]).collect()
}

/// A number's share of the fastest run.
fn fastest_ns(numbers: &[[f32; 2]], mut draw: impl FnMut(&[[f32; 2]])) -> f64 {
    let run = |_| {
        let start = Instant::now();
        draw(black_box(numbers));
        start.elapsed().as_secs_f64()
    };
    (0..RUNS).map(run).fold(f64::INFINITY, f64::min) * 1e9 / numbers.len() as f64
}
