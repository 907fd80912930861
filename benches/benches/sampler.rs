//! Cost of a direction about the gaze, by inverse, against a uniform disc sample: the floor that no warp can beat.
//!
//! `cargo bench -p fovea-benches --bench sampler`. Every iteration draws 4096 directions; divide by that for ns a sample.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fovea_sampler::{Angle, GazeWarp, Geometry, Inverse, RadialDistribution, Reddy2001, report, sequence, trig};

const DRAWS: u32 = 4096;

fn uniform_disc([u, v]: [f32; 2]) -> [f32; 3] {
    let radius = u.sqrt();
    let [cos, sin] = trig::cos_sin_turn(v);
    [radius * cos, radius * sin, 0.0]
}

fn directions(criterion: &mut Criterion) {
    let number = |i, dimension| sequence::to_unit_f32(sequence::sobol_owen(i, dimension, 1));
    let numbers: Vec<[f32; 2]> = (0..DRAWS).map(|i| [number(i, 0), number(i, 1)]).collect();
    let mut group = criterion.benchmark_group("direction");
    group.throughput(Throughput::Elements(DRAWS.into()));
    group.bench_function("uniform disc", |bencher| {
        bencher.iter(|| numbers.iter().map(|u| uniform_disc(black_box(*u))).fold(0.0, |sum, d| sum + d[0] + d[1]));
    });
    for geometry in Geometry::ALL {
        let cap = Angle::from_degrees(80.0);
        let distribution = RadialDistribution::new(Reddy2001, geometry, cap, 0.0).expect("valid constants");
        for form in report::forms(geometry) {
            let inverse = Inverse::with_form(&distribution, form).expect("a form of the report");
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            group.bench_function(BenchmarkId::new(geometry.name(), form.name()), |bencher| {
                bencher.iter(|| {
                    numbers.iter().map(|u| warp.sample_local_f32(black_box(*u))).fold(0.0, |sum, d| sum + d[0] + d[2])
                });
            });
        }
        group.bench_function(BenchmarkId::new(geometry.name(), "exact"), |bencher| {
            bencher.iter(|| {
                let exact = |u: &[f32; 2]| distribution.quantile(f64::from(black_box(u[0]))).radians();
                numbers.iter().map(exact).sum::<f64>()
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
