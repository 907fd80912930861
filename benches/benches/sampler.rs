//! Cost of a direction about the gaze, by inverse, against a uniform disc sample: the floor that no warp can beat.
//!
//! `cargo bench -p fovea-benches --bench sampler`. Every iteration draws 4096 directions; divide by that for ns a sample.
//! `one` draws them one call each, `batch` by `sample_local_batch`; the disc sample is in the same form in each.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fovea_sampler::{
    Angle, GazeWarp, Geometry, Inverse, RadialDistribution, Reddy2001, report, sequence, trig, uniform_disc_batch,
};
use tracer::{
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
};

const DRAWS: u32 = 4096;

fn uniform_disc([u, v]: [f32; 2]) -> [f32; 3] {
    let radius = u.sqrt();
    let [cos, sin] = trig::cos_sin_turn(v);
    [radius * cos, radius * sin, 0.0]
}

fn directions(criterion: &mut Criterion) {
    // Nothing here runs on the adapter; it is named because every bench says what the machine has.
    let gpu = Gpu::headless(&AdapterSelect::Auto);
    eprint!("{}", gpu.map_or_else(|error| Provenance::without_gpu(&error.to_string()), |gpu| Provenance::on(&gpu)));
    let number = |i, dimension| sequence::to_unit_f32(sequence::sobol_owen(i, dimension, 1));
    let numbers: Vec<[f32; 2]> = (0..DRAWS).map(|i| [number(i, 0), number(i, 1)]).collect();
    one_call_each(criterion, &numbers);
    in_a_batch(criterion, &numbers);
}

/// Every warp of the report, with its name.
fn warps() -> Vec<(BenchmarkId, GazeWarp)> {
    let warps = Geometry::ALL.into_iter().flat_map(|geometry| {
        let cap = Angle::from_degrees(80.0);
        let distribution = RadialDistribution::new(Reddy2001, geometry, cap, 0.0).expect("valid constants");
        report::forms(geometry).into_iter().map(move |form| {
            let inverse = Inverse::with_form(&distribution, form).expect("a form of the report");
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            (BenchmarkId::new(geometry.name(), form.name()), warp)
        })
    });
    warps.collect()
}

fn one_call_each(criterion: &mut Criterion, numbers: &[[f32; 2]]) {
    let mut group = criterion.benchmark_group("one");
    group.throughput(Throughput::Elements(DRAWS.into()));
    let sum = |sum: f32, d: [f32; 3]| sum + d[0] + d[1] + d[2];
    group.bench_function("uniform disc", |bencher| {
        bencher.iter(|| numbers.iter().map(|u| uniform_disc(black_box(*u))).fold(0.0, sum));
    });
    for (name, warp) in warps() {
        group.bench_function(name, |bencher| {
            bencher.iter(|| numbers.iter().map(|u| warp.sample_local_f32(black_box(*u))).fold(0.0, sum));
        });
    }
    for geometry in Geometry::ALL {
        let cap = Angle::from_degrees(80.0);
        let distribution = RadialDistribution::new(Reddy2001, geometry, cap, 0.0).expect("valid constants");
        group.bench_function(BenchmarkId::new(geometry.name(), "exact"), |bencher| {
            let exact = |u: &[f32; 2]| distribution.quantile(f64::from(black_box(u[0]))).radians();
            bencher.iter(|| numbers.iter().map(exact).sum::<f64>());
        });
    }
    group.finish();
}

fn in_a_batch(criterion: &mut Criterion, numbers: &[[f32; 2]]) {
    let mut group = criterion.benchmark_group("batch");
    group.throughput(Throughput::Elements(DRAWS.into()));
    let mut directions = vec![[0.0; 3]; numbers.len()];
    group.bench_function("uniform disc", |bencher| {
        bencher.iter(|| {
            uniform_disc_batch(black_box(numbers), &mut directions);
            black_box(&mut directions);
        });
    });
    for (name, warp) in warps() {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                warp.sample_local_batch(black_box(numbers), &mut directions);
                black_box(&mut directions);
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30).measurement_time(std::time::Duration::from_secs(2));
    targets = directions
}
criterion_main!(benches);
