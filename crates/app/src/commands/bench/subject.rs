//! The scene of a bench, and where in it one looks.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use fovea_sampler::Inverse;
use tracer::bvh::HierarchyKind;
use tracer::distribution::Distribution;
use tracer::film::FilmOptions;
use tracer::gpu::Gpu;
use tracer::renderer::{FilmPose, Renderer, RendererOptions, SceneReport};
use tracer::scene::Scene;
use tracer::view::{ViewProjection, ViewSettings};

use crate::cli::bench::BenchArgs;
use crate::cli::values::GazeAngles;
use crate::commands::study::bench::{self, Opened};
use crate::commands::study::plan::{Method, Place};
use crate::readback::{PICTURE_FORMAT, picture_texture};

/// Across and down, pixels, of the picture that is reconstructed.
pub const PICTURE_PX: [u32; 2] = [1280, 720];
/// Gazes are at most so far above or below the horizon, degrees.
const HIGHEST_GAZE_DEG: f32 = 60.0;

/// A scene at its camera.
pub struct Subject {
    /// File name without its ending.
    pub name: String,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where the film is.
    pub pose: FilmPose,
    /// The panorama.
    pub film: FilmOptions,
    /// Where one looks.
    pub places: Vec<Place>,
    /// Of the foveated mode.
    pub inverse: Arc<Inverse>,
    /// Reading the file.
    pub import_secs: f64,
}

impl Subject {
    /// Reads the scene.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(args: &BenchArgs) -> anyhow::Result<Self> {
        Self::open_showing(args, |_| Ok(()))
    }

    /// As [`Subject::open`], and hands on what the scene is before its images are read, which goes on when `show` returns.
    ///
    /// # Errors
    /// When the scene cannot be read, or that of `show`.
    pub fn open_showing(args: &BenchArgs, show: impl FnOnce(Self) -> anyhow::Result<()>) -> anyhow::Result<Self> {
        let started = Instant::now();
        let shown = |opened| show(Self::of(args, opened, started.elapsed().as_secs_f64())?);
        let opened = bench::open_showing(args.scene.as_ref(), args.background, shown)?;
        Self::of(args, opened, started.elapsed().as_secs_f64())
    }

    fn of(args: &BenchArgs, opened: Opened, import_secs: f64) -> anyhow::Result<Self> {
        let Opened { name, scene, camera } = opened;
        let places = gazes(args.gazes).into_iter().map(|gaze| Place::new(gaze, camera.rotation)).collect();
        Ok(Self {
            name,
            scene,
            pose: FilmPose { position: camera.position, world_from_film: camera.rotation },
            film: FilmOptions::equirect(args.film.width, args.film.height),
            places,
            inverse: Method::Fv.inverse()?,
            import_secs,
        })
    }

    /// How a mode spreads samples about a place.
    pub fn distribution(&self, method: Method, place: &Place) -> Distribution {
        method.distribution(place, &self.film, &self.inverse)
    }

    /// A renderer that shows a version of the scene, and what it took to set it.
    ///
    /// # Errors
    /// When the scene does not fit the adapter.
    pub fn renderer(&self, gpu: &Gpu, args: &BenchArgs, scene: &Scene) -> anyhow::Result<(Renderer, SceneReport)> {
        self.renderer_with(gpu, args, scene, None)
    }

    /// The same with hierarchies of a kind, or of the adapter's without one.
    ///
    /// # Errors
    /// When the scene does not fit the adapter.
    pub fn renderer_with(
        &self,
        gpu: &Gpu,
        args: &BenchArgs,
        scene: &Scene,
        hierarchy: Option<HierarchyKind>,
    ) -> anyhow::Result<(Renderer, SceneReport)> {
        let mut renderer = self.empty_renderer(gpu, args)?;
        if let Some(kind) = hierarchy {
            renderer.set_hierarchy(kind);
        }
        renderer.set_schedule(args.schedule.on(gpu))?;
        let report = renderer.set_scene(scene)?;
        Ok((renderer, report))
    }

    /// A renderer at the film's place, without a scene.
    ///
    /// # Errors
    /// When the film does not fit the adapter.
    pub fn empty_renderer(&self, gpu: &Gpu, args: &BenchArgs) -> anyhow::Result<Renderer> {
        let options = RendererOptions { film: self.film, max_bounces: args.max_bounces, ..Default::default() };
        let first = self.places.first().context("no gaze")?;
        let mut renderer = Renderer::new(gpu, &options, self.distribution(Method::Fv, first))?;
        renderer.set_pose(self.pose);
        Ok(renderer)
    }
}

/// Degrees from the camera's axis: a spiral that spreads them evenly over the sphere but for the caps at its poles.
pub fn gazes(count: u32) -> Vec<GazeAngles> {
    let golden_turn = 0.5 * (5f32.sqrt() - 1.0);
    let highest = HIGHEST_GAZE_DEG.to_radians().sin();
    (0..count)
        .map(|i| {
            let height = highest * (1.0 - (2.0 * i as f32 + 1.0) / count as f32);
            let turns = (i as f32 * golden_turn).fract();
            GazeAngles { yaw_deg: 360.0 * turns - 180.0, pitch_deg: height.asin().to_degrees() }
        })
        .collect()
}

/// A picture that the renderer draws again and again.
pub struct Picture {
    target: wgpu::TextureView,
    settings: ViewSettings,
}

impl Picture {
    /// Of the view about a place, so many pixels across and down.
    pub fn new(gpu: &Gpu, place: &Place, size_px: [u32; 2]) -> Self {
        let texture = picture_texture(gpu, size_px);
        let mut settings = bench::settings(ViewProjection::Perspective(place.view), size_px);
        // A view as a window has it: 90 degrees across, square pixels.
        let mut view = place.view;
        view.half_extent = glam::Vec2::new(1.0, PICTURE_PX[1] as f32 / PICTURE_PX[0] as f32);
        settings.projection = ViewProjection::Perspective(view);
        Self { target: texture.create_view(&wgpu::TextureViewDescriptor::default()), settings }
    }

    /// Draws what a scene shows first and waits.
    ///
    /// # Errors
    /// When the geometry does not fit the device or the device is lost.
    pub fn sketch(&self, renderer: &mut Renderer, scene: &Scene) -> anyhow::Result<()> {
        renderer.sketch(scene, &self.settings, &self.target, PICTURE_FORMAT)?;
        Ok(renderer.gpu().wait()?)
    }

    /// Draws it and waits. Seconds of the device where it has timestamps.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn draw(&self, renderer: &mut Renderer) -> anyhow::Result<Option<f64>> {
        Ok(renderer.timed("picture", |renderer, encoder| {
            renderer.present(encoder, &self.settings, &self.target, PICTURE_FORMAT)
        })?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gazes_are_spread_over_the_sphere() {
        let gazes = gazes(12);
        let directions: Vec<_> =
            gazes.iter().map(|g| crate::view::direction(g.yaw_deg.to_radians(), g.pitch_deg.to_radians())).collect();
        for (i, a) in directions.iter().enumerate() {
            for b in &directions[..i] {
                assert!(a.angle_between(*b).to_degrees() > 30.0, "{a} {b}");
            }
        }
        assert!(gazes.iter().all(|g| g.pitch_deg.abs() <= HIGHEST_GAZE_DEG && g.yaw_deg.abs() <= 180.0));
        let above = gazes.iter().filter(|g| g.pitch_deg > 0.0).count();
        assert_eq!(above, 6);
    }
}
