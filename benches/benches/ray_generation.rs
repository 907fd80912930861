//! Launching primary rays on the device, timed by timestamp queries: OD, VP and FV, and FV by each inverse.
//!
//! `cargo bench -p fovea-benches --bench ray_generation`. Koskela et al. 2017 report 0.17 ms for 65,536 rays in each of
//! their three modes on a Fury X. Only the choice of the pixel and the ray are timed; nothing is traced.

use std::{sync::Arc, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fovea_benches::one_triangle;
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001, report};
use glam::{Quat, Vec3};
use tracer::{
    distribution::{Distribution, Gaze, View},
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
    renderer::{Renderer, RendererOptions},
};

/// As in the paper.
const RAYS: u32 = 65_536;

fn launch(criterion: &mut Criterion) {
    let gpu = Gpu::headless(&AdapterSelect::Auto).expect("an adapter");
    eprint!("{}", Provenance::on(&gpu));
    let cap = Angle::from_degrees(80.0);
    let default = |floor| RadialDistribution::new(Reddy2001, Geometry::Sphere, cap, floor).expect("valid constants");
    let inverse = Arc::new(Inverse::default_for(&default(0.002)));
    let view = View::new(Quat::IDENTITY, 100f32.to_radians(), 100f32.to_radians());
    let gaze = Gaze::Scene { direction: Vec3::NEG_Z };
    let mut modes = vec![
        ("OD".to_string(), Distribution::omnidirectional(inverse.clone())),
        ("VP".into(), Distribution::viewport(view, inverse.clone())),
        ("FV".into(), Distribution::foveated(gaze, None, inverse.clone())),
    ];
    for geometry in Geometry::ALL {
        let distribution = RadialDistribution::new(Reddy2001, geometry, cap, 0.0).expect("valid constants");
        for form in report::forms(geometry).into_iter().filter(|form| form.suits_shaders()) {
            let inverse = Inverse::with_form(&distribution, form).expect("a form of the report");
            let name = format!("FV {} {}", geometry.name(), form.name());
            modes.push((name, Distribution::foveated(gaze, None, Arc::new(inverse))));
        }
    }
    let mut renderer =
        Renderer::new(&gpu, &RendererOptions::default(), modes[0].1.clone()).expect("a film of the default size");
    renderer.set_scene(&one_triangle()).expect("one triangle fits");
    let mut group = criterion.benchmark_group("launch 65536 rays");
    group.throughput(Throughput::Elements(RAYS.into()));
    for (name, distribution) in modes {
        renderer.set_distribution(distribution).expect("a kernel of the report");
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            bencher.iter_custom(|iterations| {
                (0..iterations)
                    .map(|_| {
                        let seconds = renderer.time_ray_generation(RAYS).expect("the device answers");
                        Duration::from_secs_f64(seconds.expect("the adapter has timestamps"))
                    })
                    .sum()
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).measurement_time(Duration::from_secs(2));
    targets = launch
}
criterion_main!(benches);
