//! A pencil of rays through one pixel: the mean radiance along a ray, with its standard error.

use glam::{Quat, Vec3};
use tracer::{
    distribution::Distribution,
    film::FilmOptions,
    gpu::Gpu,
    renderer::{FilmPose, RenderStatistics, Renderer, RendererOptions, SequenceKind},
    scene::Scene,
};

use crate::device;

/// Mean luminance, its standard error, and what the renderer counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Mean luminance of the samples that reached the film.
    pub mean: f64,
    /// Standard error of the mean.
    pub error: f64,
    /// Samples dropped or clamped, rays traced.
    pub statistics: RenderStatistics,
}

/// Traces independent samples from `eye` to `target` through a pixel of 1e-4 radians. `prepare` may plant something.
///
/// # Panics
/// When the scene does not fit or the kernels do not compile.
pub fn measure(
    gpu: &Gpu,
    scene: &Scene,
    [eye, target]: [Vec3; 2],
    max_bounces: u32,
    samples: u64,
    prepare: impl FnOnce(&mut Renderer),
) -> Measured {
    let film = FilmOptions::perspective(1, 1, 1e-4);
    let options = RendererOptions { film, max_bounces, seed: 3, sequence: SequenceKind::Independent };
    let everywhere = Distribution::omnidirectional(device::inverse());
    let mut renderer = Renderer::new(gpu, &options, everywhere).expect("a film of one pixel");
    prepare(&mut renderer);
    renderer.set_scene(scene).expect("a small scene");
    let world_from_film = Quat::from_rotation_arc(Vec3::NEG_Z, (target - eye).normalize());
    renderer.set_pose(FilmPose { position: eye, world_from_film });
    let film = device::trace(&mut renderer, samples).expect("the device answers");
    let statistics = renderer.statistics().expect("the device answers");
    let pixel = film.pixel(0);
    let [r, g, b] = pixel.mean;
    Measured { mean: 0.2126 * r + 0.7152 * g + 0.0722 * b, error: pixel.variance_of_mean.sqrt(), statistics }
}
