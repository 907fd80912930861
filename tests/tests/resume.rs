//! A film that moves to another renderer, on another device, goes on there as if nothing had happened.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;

use fovea_tests::{device, scenes};
use glam::{Quat, Vec3};
use tracer::{
    distribution::{Distribution, Gaze},
    film::{FilmHeader, FilmOptions, FilmSnapshot, SampleRange},
    gpu::Gpu,
    renderer::{FilmPose, Renderer, RendererOptions, SequenceKind},
    scene::Scene,
};

const SEED: u32 = 7;
const POSE: FilmPose = FilmPose { position: Vec3::new(0.125, 0.25, -0.1), world_from_film: Quat::IDENTITY };

fn options(film: FilmOptions, sequence: SequenceKind) -> RendererOptions {
    RendererOptions { film, max_bounces: 3, seed: SEED, sequence }
}

fn renderer(gpu: &Gpu, options: &RendererOptions, scene: &Scene) -> Renderer {
    let gaze = Gaze::Scene { direction: Vec3::NEG_Z };
    let mut renderer = Renderer::new(gpu, options, Distribution::foveated(gaze, None, device::inverse())).unwrap();
    renderer.set_scene(scene).unwrap();
    renderer.set_pose(POSE);
    renderer
}

#[test]
fn a_restored_film_goes_on_to_the_same_bytes_on_another_device() {
    let _time = device::Stopwatch::start("resume");
    let scene = scenes::textured_room();
    // 20,001 is no power of two: the next batch begins inside an aligned block.
    let (first, second) = (20_001, 12_767);
    let gpu = device::gpu();
    for (film, sequence) in [
        (FilmOptions::equirect(64, 32), SequenceKind::Sobol),
        (FilmOptions::perspective(48, 27, 1.0), SequenceKind::Independent),
    ] {
        let options = options(film, sequence);
        let whole = device::trace(&mut renderer(&gpu, &options, &scene), first + second).unwrap();
        let part = device::trace(&mut renderer(&gpu, &options, &scene), first).unwrap();
        assert_eq!(part.header.ranges, [SampleRange { seed: SEED, first: 0, count: first }]);

        let other_device = device::gpu();
        let mut resumed = renderer(&other_device, &options, &scene);
        resumed.restore(&part).unwrap();
        assert_eq!(resumed.samples(), first);
        assert_eq!(resumed.snapshot().unwrap(), part);
        assert_eq!(device::trace(&mut resumed, second).unwrap(), whole);
        assert_eq!(resumed.statistics().unwrap(), whole.header.statistics);

        // A restart forgets all of it.
        resumed.restart();
        assert_eq!(device::trace(&mut resumed, first).unwrap(), part);
    }
}

#[test]
fn the_first_sample_counts_in_a_restored_film() {
    let scene = scenes::textured_room();
    let gpu = device::gpu();
    let options = options(FilmOptions::equirect(16, 8), SequenceKind::Sobol);
    let mut late = renderer(&gpu, &options, &scene);
    late.set_first_sample((1 << 33) + 96);
    let part = device::trace(&mut late, 1000).unwrap();
    assert_eq!(part.header.ranges, [SampleRange { seed: SEED, first: (1 << 33) + 96, count: 1000 }]);
    let whole = device::trace(&mut late, 500).unwrap();
    let mut resumed = renderer(&gpu, &options, &scene);
    resumed.restore(&part).unwrap();
    assert_eq!(device::trace(&mut resumed, 500).unwrap(), whole);
    resumed.restart();
    assert_eq!(
        device::trace(&mut resumed, 10).unwrap().header.ranges,
        [SampleRange { seed: SEED, first: 0, count: 10 }]
    );
}

#[test]
fn a_film_of_another_picture_is_refused_and_the_difference_named() {
    let scene = scenes::textured_room();
    let gpu = device::gpu();
    let film = FilmOptions::equirect(16, 8);
    let mut renderer = renderer(&gpu, &options(film, SequenceKind::Sobol), &scene);
    let good = device::trace(&mut renderer, 500).unwrap();
    let before = device::trace(&mut renderer, 500).unwrap();

    let mut brighter = scene.clone();
    brighter.materials[0] = Arc::new(scenes::emitter(Vec3::splat(1.5)));
    let turned = FilmPose { world_from_film: Quat::from_rotation_y(1.0), ..POSE };
    let range = |first, count| SampleRange { seed: SEED, first, count };
    let header = good.header.clone();
    let refused = [
        ("film size: 32x16 instead of 16x8", FilmHeader { options: FilmOptions::equirect(32, 16), ..header.clone() }),
        ("film mapping", FilmHeader { options: FilmOptions::perspective(16, 8, 1.0), ..header.clone() }),
        ("scene", FilmHeader { scene: brighter.content_hash(), ..header.clone() }),
        ("position", FilmHeader { pose: FilmPose { position: Vec3::X, ..POSE }, ..header.clone() }),
        ("orientation", FilmHeader { pose: turned, ..header.clone() }),
        ("max bounces: 4 instead of 3", FilmHeader { max_bounces: 4, ..header.clone() }),
        (
            "sequence: Independent instead of Sobol",
            FilmHeader { sequence: SequenceKind::Independent, ..header.clone() },
        ),
        ("radiance scale", FilmHeader { radiance_scale: header.radiance_scale * 2.0, ..header.clone() }),
        ("luminance scale", FilmHeader { luminance_scale: header.luminance_scale * 2.0, ..header.clone() }),
        (
            "seed: 8 instead of 7",
            FilmHeader { ranges: vec![SampleRange { seed: 8, ..range(0, 500) }], ..header.clone() },
        ),
        ("ranges", FilmHeader { ranges: vec![range(0, 300), range(200, 300)], ..header.clone() }),
        ("ranges", FilmHeader { ranges: vec![range(u64::MAX, 500)], ..header }),
    ];
    let half = ("has 1280 words, not 640", FilmSnapshot { words: good.words[..640].to_vec(), ..good.clone() });
    let refused = refused.map(|(part, header)| (part, FilmSnapshot { header, words: good.words.clone() }));
    for (part, snapshot) in refused.into_iter().chain([half]) {
        let message = renderer.restore(&snapshot).unwrap_err().to_string();
        assert!(message.contains(part), "{part}: {message}");
        assert_eq!(renderer.snapshot().unwrap(), before, "{part}: the film must stay as it was");
    }
    renderer.restore(&good).unwrap();
    assert_eq!(renderer.snapshot().unwrap(), good);

    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut empty = Renderer::new(&gpu, renderer.options(), everywhere).unwrap();
    assert!(empty.restore(&good).unwrap_err().to_string().contains("scene"));
}
