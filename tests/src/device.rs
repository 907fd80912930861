//! The adapter that the tests run on, and renderers on it.

use std::{path::PathBuf, sync::Arc, time::Instant};

use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, model::Reddy2001};
use glam::Vec3;
use tracer::{
    distribution::{Distribution, film_direction},
    film::{FilmOptions, FilmSnapshot, SampleRange},
    gpu::{AdapterSelect, Gpu},
    renderer::{LARGEST_BATCH, RenderError, Renderer, RendererOptions, SequenceKind},
    scene::Scene,
};

/// Opens the adapter that `WGPU_ADAPTER_NAME` names, else lavapipe, else the default one; prints it.
///
/// # Panics
/// Without an adapter, or when it is not the one asked for.
pub fn gpu() -> Gpu {
    let wanted = std::env::var("WGPU_ADAPTER_NAME").ok();
    let gpu = match wanted {
        Some(_) => Gpu::headless(&AdapterSelect::Auto),
        None => {
            Gpu::headless(&AdapterSelect::Named("llvmpipe".into())).or_else(|_| Gpu::headless(&AdapterSelect::Auto))
        }
    }
    .expect("the tests need an adapter");
    let info = gpu.info();
    eprintln!("adapter: {}, driver: {} {}, backend: {}", info.name, info.driver, info.driver_info, info.backend);
    if cfg!(target_os = "linux") {
        assert_eq!(info.backend, wgpu::Backend::Vulkan, "wgpu fell back to another backend");
    }
    if let Some(wanted) = wanted {
        assert!(info.name.to_lowercase().contains(&wanted.to_lowercase()), "{} is not {wanted}", info.name);
    }
    gpu
}

/// A file below the folder that an environment variable names; `None`, with the line that `scripts/test` looks for, when
/// the variable is not set.
///
/// # Panics
/// When the variable is set and the file is missing.
pub fn external_file(test: &str, variable: &str, relative: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os(variable) else {
        eprintln!("SKIP {test}: {variable} is not set");
        return None;
    };
    let path = PathBuf::from(folder).join(relative);
    assert!(path.exists(), "{variable} is set, but {} is missing", path.display());
    Some(path)
}

/// The default radial distribution: Reddy's acuity on the sphere, cap 80 degrees, floor 0.002.
pub fn acuity() -> RadialDistribution {
    RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002).expect("valid parameters")
}

/// The default inverse of [`acuity`].
pub fn inverse() -> Arc<Inverse> {
    Arc::new(Inverse::default_for(&acuity()))
}

/// A renderer with independent samples.
///
/// # Panics
/// When the film does not fit or the kernels do not compile.
pub fn independent(
    gpu: &Gpu,
    film: FilmOptions,
    seed: u32,
    max_bounces: u32,
    distribution: Distribution,
    scene: &Scene,
) -> Renderer {
    let options = RendererOptions { film, max_bounces, seed, sequence: SequenceKind::Independent };
    let mut renderer = Renderer::new(gpu, &options, distribution).expect("a small film");
    renderer.set_scene(scene).expect("a small scene");
    renderer
}

/// A renderer whose film holds `radiance` of each pixel's direction and column, known from 2^20 samples; nothing where that is
/// `None`.
///
/// # Panics
/// When the film does not fit the device.
pub fn painted(gpu: &Gpu, film: FilmOptions, radiance: impl Fn(Vec3, u32) -> Option<Vec3>) -> Renderer {
    let options = RendererOptions { film, ..RendererOptions::default() };
    let distribution = Distribution::omnidirectional(inverse());
    let mut renderer = Renderer::new(gpu, &options, distribution).expect("a small film");
    renderer.set_scene(&crate::scenes::empty(Vec3::ONE)).expect("a small film");
    let mut snapshot = renderer.snapshot().expect("a small film");
    let samples = 1_u32 << 20;
    for (index, words) in snapshot.words.chunks_exact_mut(10).enumerate() {
        let (x, y) = (index as u32 % film.width, index as u32 / film.width);
        let Some(value) = radiance(film_direction(&film, x, y), x) else { continue };
        for (channel, words) in value.to_array().into_iter().zip(words.chunks_exact_mut(2)) {
            let sum = (f64::from(channel) * f64::from(samples) * snapshot.header.radiance_scale) as u64;
            words.copy_from_slice(&[sum as u32, (sum >> 32) as u32]);
        }
        words[6] = samples;
    }
    snapshot.header.ranges =
        vec![SampleRange { seed: options.seed, first: 0, count: film.pixels() * u64::from(samples) }];
    renderer.restore(&snapshot).expect("a small film");
    renderer
}

/// Traces this many further samples in the largest batches that the sequence allows, and reads the film.
///
/// # Errors
/// As [`Renderer::trace`].
pub fn trace(renderer: &mut Renderer, samples: u64) -> Result<FilmSnapshot, RenderError> {
    let target = renderer.samples() + samples;
    while renderer.samples() < target {
        renderer.trace((target - renderer.samples()).min(u64::from(LARGEST_BATCH)) as u32)?;
        renderer.gpu().wait().map_err(|_| RenderError::DeviceLost)?;
    }
    renderer.snapshot()
}

/// Prints how long its scope took.
#[derive(Debug)]
pub struct Stopwatch(&'static str, Instant);

impl Stopwatch {
    /// Starts it.
    pub fn start(what: &'static str) -> Self {
        Self(what, Instant::now())
    }
}

impl Drop for Stopwatch {
    fn drop(&mut self) {
        eprintln!("{}: {:.2} s", self.0, self.1.elapsed().as_secs_f64());
    }
}
