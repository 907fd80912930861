//! What the engine's thread does with the renderer.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use fovea_sampler::Inverse;
use glam::{UVec2, Vec3};
use tracer::distribution::View as TracerView;
use tracer::gpu::Gpu;
use tracer::renderer::{FilmPose, Renderer, RendererOptions};
use tracer::scene::Scene;
use tracer::view::{DebugView, ViewProjection, ViewSettings};

use super::controls::Shown;
use super::engine::{Look, Picture};
use crate::attention::Attention;
use crate::cli::PreviewArgs;
use crate::cli::choices::Mode;
use crate::convergence::Block;
use crate::film::FilmPlan;
use crate::output::exr::FilmFile;
use crate::output::png;
use crate::readback;
use crate::sampling::{Acuity, Aim, GazePoint};
use crate::settings::RunSettings;
use crate::view::View;

/// The read-out at the gaze is a mean over so many pixels to each side.
const READOUT_RADIUS_PX: u32 = 3;

struct Open {
    scene: Arc<Scene>,
    renderer: Option<Renderer>,
    plan: Option<FilmPlan>,
}

struct Target {
    texture: wgpu::Texture,
    picture: Picture,
}

/// Renderer, scene and picture.
pub struct Tracing {
    gpu: Gpu,
    args: PreviewArgs,
    open: Option<Open>,
    target: Option<Target>,
    generations: u64,
    inverse: Option<(Acuity, Arc<Inverse>)>,
    aim: Option<Aim>,
    /// What the lists below were made for.
    attention: Option<(Attention, FilmPlan)>,
    wanted_pixels: Vec<Arc<[u32]>>,
    view: Option<View>,
    traced: Duration,
}

impl Tracing {
    /// Nothing is open at first.
    pub fn new(gpu: Gpu, args: PreviewArgs) -> Self {
        Self {
            gpu,
            args,
            open: None,
            target: None,
            generations: 0,
            inverse: None,
            aim: None,
            attention: None,
            wanted_pixels: Vec::new(),
            view: None,
            traced: Duration::ZERO,
        }
    }

    /// Whether there is a scene to trace.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Shows a version of a scene; the last one stays if that fails.
    pub fn set_scene(&mut self, scene: Arc<Scene>) -> anyhow::Result<()> {
        match &mut self.open {
            Some(Open { renderer: Some(renderer), scene: shown, .. }) => {
                renderer.set_scene(&scene)?;
                *shown = scene;
            }
            _ => self.open = Some(Open { scene, renderer: None, plan: None }),
        }
        self.traced = Duration::ZERO;
        Ok(())
    }

    /// Film pixels across and down.
    pub fn film_size(&self) -> Option<[u32; 2]> {
        let plan = self.open.as_ref()?.plan?;
        Some([plan.options.width, plan.options.height])
    }

    /// Whether [`Tracing::follow`] will take long: it makes a film and puts the scene on the device.
    pub fn must_prepare(&self, look: &Look) -> bool {
        let plan = self.open.as_ref().and_then(|open| open.plan);
        plan.is_none_or(|plan| !plan.suits(&look.standpoint.view, look.size_px.as_vec2()))
    }

    /// Brings film, pose and distribution in line with what the window shows. True when the picture changes at once.
    pub fn follow(&mut self, look: &Look) -> anyhow::Result<bool> {
        let Look { standpoint, controls, size_px, mapping, .. } = look;
        let view = standpoint.view;
        let inverse = self.inverse(controls.acuity)?;
        let world_view = TracerView { world_from_view: view.film_from_view(), half_extent: view.tan_half };
        let aim = Aim {
            mode: controls.mode,
            view: world_view,
            gaze: GazePoint::at(look.gaze.point, &world_view),
            clip: controls.clip,
            eccentricity: controls.eccentricity,
            screen_half_extent: mapping.half_size_mm / mapping.screen.distance_mm,
        };
        let memory = u64::from(self.args.film_memory) << 20;
        let options = RendererOptions {
            max_bounces: self.args.sampling.max_bounces,
            seed: self.args.sampling.seed,
            sequence: self.args.sampling.sequence.into(),
            ..RendererOptions::default()
        };
        let open = self.open.as_mut().context("no scene is open")?;
        let size = size_px.as_vec2();
        if open.plan.is_none_or(|plan| !plan.suits(&view, size)) {
            let plan = FilmPlan::new(&view, size, memory);
            if open.plan != Some(plan) {
                let distribution = aim.distribution(&plan.options, plan.world_from_film, &inverse);
                match &mut open.renderer {
                    Some(renderer) => {
                        renderer.set_film(plan.options)?;
                        renderer.set_distribution(distribution)?;
                    }
                    None => {
                        let options = RendererOptions { film: plan.options, ..options };
                        let mut renderer = Renderer::new(&self.gpu, &options, distribution)?;
                        renderer.set_scene(&open.scene)?;
                        open.renderer = Some(renderer);
                    }
                }
                open.plan = Some(plan);
                self.aim = Some(aim);
                self.traced = Duration::ZERO;
            }
        }
        let (Some(renderer), Some(plan)) = (&mut open.renderer, open.plan) else { return Ok(false) };
        let pose = FilmPose { position: standpoint.position, world_from_film: plan.world_from_film };
        let moved = renderer.pose() != pose;
        if moved {
            renderer.set_pose(pose);
            self.traced = Duration::ZERO;
        }
        let wants = self.attention.as_ref().is_none_or(|(last, of)| *last != controls.attention || *of != plan);
        if wants {
            self.wanted_pixels = controls.attention.lists(&plan.options, plan.world_from_film);
            self.attention = Some((controls.attention.clone(), plan));
        }
        let aims = self.aim.is_none_or(|last| last.differs(&aim));
        if wants || aims || !Arc::ptr_eq(renderer.distribution().inverse(), &inverse) {
            let mode = aim.distribution(&plan.options, plan.world_from_film, &inverse);
            renderer.set_distribution(controls.attention.mixed(mode, &self.wanted_pixels))?;
            self.aim = Some(aim);
        }
        let turned = self.view != Some(view);
        self.view = Some(view);
        Ok(moved || turned)
    }

    fn inverse(&mut self, acuity: Acuity) -> anyhow::Result<Arc<Inverse>> {
        match &self.inverse {
            Some((known, inverse)) if *known == acuity => Ok(Arc::clone(inverse)),
            _ => {
                let inverse = acuity.inverse()?;
                self.inverse = Some((acuity, Arc::clone(&inverse)));
                Ok(inverse)
            }
        }
    }

    /// Traces a batch of at most so many samples and waits for it. How many there were, and how long they took.
    pub fn trace(&mut self, samples: u32) -> anyhow::Result<(u32, Duration)> {
        let start = Instant::now();
        let traced = self.renderer()?.trace(samples)?;
        self.gpu.wait().context("the graphics device was lost")?;
        let took = start.elapsed();
        self.traced += took;
        Ok((traced, took))
    }

    /// Draws the picture, with one texel for `coarseness` by `coarseness` pixels, and waits for it.
    pub fn show(&mut self, look: &Look, coarseness: u32) -> anyhow::Result<Picture> {
        let limit = self.gpu.device.limits().max_texture_dimension_2d;
        let size = (look.size_px / coarseness.max(1)).clamp(UVec2::ONE, UVec2::splat(limit)).to_array();
        if self.target.as_ref().is_none_or(|target| [target.texture.width(), target.texture.height()] != size) {
            self.generations += 1;
            let texture = readback::picture_texture(&self.gpu, size);
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            self.target = Some(Target { texture, picture: Picture { texture: view, generation: self.generations } });
        }
        let picture = self.target.as_ref().context("made above")?.picture.clone();
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("show") });
        self.renderer()?.present(
            &mut encoder,
            &view_settings(look, size),
            &picture.texture,
            readback::PICTURE_FORMAT,
        )?;
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.wait().context("the graphics device was lost")?;
        Ok(picture)
    }

    /// Empties the film.
    pub fn restart(&mut self) {
        if let Some(Open { renderer: Some(renderer), .. }) = &mut self.open {
            renderer.restart();
            self.traced = Duration::ZERO;
        }
    }

    /// Samples in the film.
    pub fn samples(&self) -> u64 {
        self.open.as_ref().and_then(|open| open.renderer.as_ref()).map_or(0, Renderer::samples)
    }

    /// Time spent tracing since the film started.
    pub fn elapsed(&self) -> Duration {
        self.traced
    }

    /// Samples that were not finite since the film started.
    pub fn non_finite_dropped(&mut self) -> anyhow::Result<u64> {
        Ok(self.renderer()?.statistics()?.non_finite.into())
    }

    /// What the film pixels about a direction say.
    pub fn block_at(&mut self, direction: Vec3) -> anyhow::Result<Block> {
        Ok(Block::new(&self.renderer()?.pixels_near(direction, READOUT_RADIUS_PX)?))
    }

    /// Writes the picture as it is shown.
    pub fn save_png(&mut self, path: &Path) -> anyhow::Result<()> {
        let target = self.target.as_ref().context("there is no picture yet")?;
        let texels = readback::read_texture(&self.gpu, &target.texture)?;
        png::write(path, target.texture.width(), target.texture.height(), &texels)?;
        Ok(())
    }

    /// The film as a value.
    pub fn film(&mut self, look: &Look) -> anyhow::Result<FilmFile> {
        let open = self.open.as_ref().context("there is no film yet")?;
        let renderer = open.renderer.as_ref().context("there is no film yet")?;
        let aim = self.aim.as_ref().context("there is no film yet")?;
        let film = renderer.snapshot()?;
        let acuity = look.controls.acuity;
        let settings = RunSettings { scene: &open.scene.name, film: &film.header, aim, acuity }.to_json();
        Ok(FilmFile::new(film, settings))
    }

    fn renderer(&mut self) -> anyhow::Result<&mut Renderer> {
        self.open.as_mut().and_then(|open| open.renderer.as_mut()).context("no scene is open")
    }
}

impl Aim {
    /// Whether samples fall elsewhere by `other`.
    fn differs(&self, other: &Self) -> bool {
        self.mode != other.mode
            || match self.mode {
                Mode::Od => false,
                Mode::Vp | Mode::VpRegion => self.view != other.view,
                Mode::Fv => self != other,
            }
    }
}

fn view_settings(look: &Look, size: [u32; 2]) -> ViewSettings {
    let view = look.standpoint.view;
    ViewSettings {
        projection: ViewProjection::Perspective(TracerView {
            world_from_view: view.film_from_view(),
            half_extent: view.tan_half,
        }),
        size,
        exposure_ev: look.controls.exposure_ev,
        tone_map: look.controls.tone_map.into(),
        debug_view: match look.controls.shown {
            Shown::Picture => DebugView::Beauty,
            Shown::Density => DebugView::SampleDensity,
        },
        fill: true,
        ring: None,
    }
}
