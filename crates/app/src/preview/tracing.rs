//! What the engine's thread does with the renderer.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use fovea_sampler::Inverse;
use glam::{UVec2, Vec2, Vec3};
use tracer::distribution::{Distribution, View as TracerView};
use tracer::film::{FilmMapping, FilmSnapshot};
use tracer::gpu::Gpu;
use tracer::renderer::{FilmPose, RenderError, Renderer, RendererOptions, SceneReport};
use tracer::scene::Scene;
use tracer::view::{ViewProjection, ViewSettings};

use super::engine::{Look, Picture};
use crate::attention::{Attention, Cover};
use crate::cli::PreviewArgs;
use crate::cli::choices::{EccentricityAt, Mode};
use crate::convergence::{AROUND_RADIUS_PX, Block};
use crate::film::FilmPlan;
use crate::output::exr::FilmFile;
use crate::readback;
use crate::sampling::{Acuity, Aim, GazePoint};
use crate::settings::RunSettings;
use crate::tev::TevPicture;
use crate::view::View;
use compare::Side;
use rehearsal::Rehearsals;
use seeing::Seeing;

mod compare;
mod rehearsal;
mod seeing;
mod sketch;

/// Samples at which a pixel counts as much as what is around it and what was there before, while the picture moves. With 1 up to 2.2 %
/// of a moving picture of the built-in scene were black, with 16 up to 0.22 %, with 32 none (`tests/films/moving.rs`).
pub const SMOOTHING_WHILE_MOVING: f32 = 32.0;

/// Pixels of the view for a texel, along each axis, of a picture that has to come soon where drawing is slow: a sketch on an adapter
/// that computes on the CPU, and what moves.
pub const COARSENESS: u32 = 2;

/// Where a head looks.
#[derive(Clone, Copy, Debug)]
pub struct HeadAim {
    /// What both eyes see together.
    pub view: TracerView,
    /// Unit vector of the world in which the eyes look.
    pub gaze: Vec3,
    /// How far off that may be, degrees.
    pub gaze_error_deg: f64,
    /// Pixels of an eye's picture.
    pub size_px: UVec2,
}

/// A film on its way to another device.
#[derive(Clone, Debug)]
pub struct Moved {
    /// As it is on the host; `None` when it was empty.
    pub film: Option<Arc<FilmSnapshot>>,
    /// Whether it is what the old device had last.
    pub is_newest: bool,
}

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
    /// A renderer that has the geometry of the scene to come, and an empty film.
    sketched: Option<Renderer>,
    target: Option<Target>,
    generations: u64,
    inverse: Option<(Acuity, Arc<Inverse>)>,
    aim: Option<Aim>,
    /// What the lists below were made for.
    attention: Option<(Attention, FilmPlan)>,
    painted: Cover,
    wanted_pixels: Vec<Arc<[u32]>>,
    view: Option<View>,
    traced: Duration,
    /// The film was taken over: it stays as long as it covers the view, however coarse it is.
    keeps_film: bool,
    /// The other film of a comparison.
    beside: Option<Side>,
    /// The trial of split times that the film is of.
    trial: Option<u64>,
    seeing: Seeing,
    /// What the last version of the scene took, and how long altogether.
    scene_report: Option<(SceneReport, Duration)>,
    rehearsals: Rehearsals,
}

impl Tracing {
    /// Nothing is open at first.
    pub fn new(gpu: Gpu, args: PreviewArgs) -> Self {
        Self {
            gpu,
            args,
            open: None,
            sketched: None,
            target: None,
            generations: 0,
            inverse: None,
            aim: None,
            attention: None,
            painted: Cover::default(),
            wanted_pixels: Vec::new(),
            view: None,
            traced: Duration::ZERO,
            keeps_film: false,
            beside: None,
            trial: None,
            seeing: Seeing::default(),
            scene_report: None,
            rehearsals: Rehearsals::default(),
        }
    }

    /// Whether the device is gone, and all that was on it.
    pub fn is_lost(&self) -> bool {
        self.gpu.is_lost()
    }

    /// Whether there is a scene to trace.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Shows a version of a scene; the last one stays if that fails.
    pub fn set_scene(&mut self, scene: Arc<Scene>) -> anyhow::Result<()> {
        match &mut self.open {
            Some(Open { renderer: Some(renderer), scene: shown, .. }) => {
                self.scene_report = Some(timed_set_scene(renderer, &scene)?);
                *shown = scene;
                if let Some(side) = &mut self.beside {
                    side.follow_scene(renderer)?;
                }
            }
            _ => self.open = Some(Open { scene, renderer: None, plan: None }),
        }
        self.traced = Duration::ZERO;
        Ok(())
    }

    /// Puts a film that was taken before in the place of the present one, and goes on with it; the present one stays if
    /// that fails.
    pub fn go_on(&mut self, film: &FilmSnapshot) -> anyhow::Result<()> {
        let inverse = self.inverse(self.args.sampling.acuity())?;
        self.sketched = None;
        let open = self.open.as_mut().context("no scene is open")?;
        let everywhere = Distribution::omnidirectional(inverse);
        let mut renderer = Renderer::new(&self.gpu, &film.header.renderer_options(), everywhere)?;
        renderer.set_schedule(self.args.sampling.schedule.on(&self.gpu))?;
        self.scene_report = Some(timed_set_scene(&mut renderer, &open.scene)?);
        renderer.set_pose(film.header.pose);
        renderer.restore(film)?;
        let world_from_film = film.header.pose.world_from_film;
        open.plan = Some(FilmPlan { options: film.header.options, world_from_film });
        open.renderer = Some(renderer);
        // The next look says where samples go, and whether another film would suit it better.
        (self.aim, self.view, self.keeps_film) = (None, None, true);
        self.beside = None;
        self.traced = Duration::ZERO;
        Ok(())
    }

    /// The film's sums; `None` while there is nothing in it.
    pub fn snapshot(&self) -> anyhow::Result<Option<FilmSnapshot>> {
        let renderer = self.open.as_ref().and_then(|open| open.renderer.as_ref());
        Ok(renderer.filter(|renderer| renderer.samples() > 0).map(Renderer::snapshot).transpose()?)
    }

    /// The linear radiance of the picture that is shown, for a viewer.
    pub fn radiance(&mut self) -> anyhow::Result<TevPicture> {
        let (size, texels) = self.renderer()?.presented_radiance()?;
        Ok(TevPicture { size, rgb: texels.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect() })
    }

    /// The film's size, such as `4096x2048`; empty before there is a film.
    pub fn film_words(&self) -> String {
        let plan = self.open.as_ref().and_then(|open| open.plan);
        plan.map(|plan| format!("{}x{}", plan.options.width, plan.options.height)).unwrap_or_default()
    }

    /// How kernels share the work of a path; empty before there is a film.
    pub fn schedule(&self) -> &'static str {
        let renderer = self.open.as_ref().and_then(|open| open.renderer.as_ref());
        renderer.map_or("", |renderer| renderer.schedule().name())
    }

    /// Bytes of the film on the device; 0 before there is one.
    pub fn film_bytes(&self) -> u64 {
        self.open.as_ref().and_then(|open| open.plan).map_or(0, |plan| plan.options.bytes())
    }

    /// What a film may take.
    fn film_memory_bytes(&self) -> u64 {
        u64::from(self.args.film_memory) << 20
    }

    /// Whether [`Tracing::follow`] will take long: it makes a film and puts the scene on the device.
    pub fn must_prepare(&self, look: &Look) -> bool {
        let plan = self.open.as_ref().and_then(|open| open.plan);
        !self.is_good(plan, &look.standpoint.view, look.size_px.as_vec2())
    }

    fn is_good(&self, plan: Option<FilmPlan>, view: &View, size_px: Vec2) -> bool {
        plan.is_some_and(|plan| {
            plan.suits(view, size_px, self.film_memory_bytes()) || self.keeps_film && plan.covers(view)
        })
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
        let size = size_px.as_vec2();
        if self.must_prepare(look) {
            let plan = FilmPlan::new(&view, size, self.film_memory_bytes());
            if self.open.as_ref().context("no scene is open")?.plan != Some(plan) {
                self.set_plan(plan, aim, &inverse)?;
            }
        }
        let moved = self.set_pose_and_aim(look, aim, &inverse)?;
        self.renderer()?.set_adaptive(controls.adaptive);
        self.follow_comparison(look, aim, &inverse)?;
        let turned = self.view != Some(view);
        self.view = Some(view);
        Ok(moved || turned)
    }

    /// Starts film and picture anew, with nothing of what was there before, when another trial of split times begins. True when one does.
    pub fn begin_trial(&mut self, trial: Option<u64>) -> bool {
        let begins = trial.is_some() && self.trial != trial;
        self.trial = trial;
        if let Some(Open { renderer: Some(renderer), .. }) = self.open.as_mut().filter(|_| begins) {
            renderer.restart_clean();
            self.traced = Duration::ZERO;
        }
        begins
    }

    /// Puts an empty film of another plan in the place of the present one, if there is one.
    fn set_plan(&mut self, plan: FilmPlan, aim: Aim, inverse: &Arc<Inverse>) -> anyhow::Result<()> {
        let open = self.open.as_mut().context("no scene is open")?;
        let distribution = aim.distribution(&plan.options, plan.world_from_film, inverse);
        match &mut open.renderer {
            Some(renderer) => {
                renderer.set_film(plan.options)?;
                renderer.set_distribution(distribution)?;
            }
            None => {
                let mut renderer = match self.sketched.take() {
                    Some(mut renderer) => {
                        renderer.set_film(plan.options)?;
                        renderer.set_distribution(distribution)?;
                        renderer
                    }
                    None => Renderer::new(&self.gpu, &renderer_options(&self.args, plan), distribution)?,
                };
                renderer.set_schedule(self.args.sampling.schedule.on(&self.gpu))?;
                self.scene_report = Some(timed_set_scene(&mut renderer, &open.scene)?);
                open.renderer = Some(renderer);
            }
        }
        open.plan = Some(plan);
        self.keeps_film = false;
        self.aim = Some(aim);
        self.traced = Duration::ZERO;
        Ok(())
    }

    /// True when the film starts anew because it is seen from elsewhere.
    fn set_pose_and_aim(&mut self, look: &Look, aim: Aim, inverse: &Arc<Inverse>) -> anyhow::Result<bool> {
        let (position, attention) = (look.standpoint.position, &look.controls.attention);
        let Some(Open { renderer: Some(renderer), plan: Some(plan), .. }) = &mut self.open else { return Ok(false) };
        let plan = *plan;
        let pose = FilmPose { position, world_from_film: plan.world_from_film };
        let moved = renderer.pose() != pose;
        if moved {
            renderer.set_pose(pose);
            self.traced = Duration::ZERO;
        }
        let wants = self.attention.as_ref().is_none_or(|(last, of)| last != attention || *of != plan);
        if wants {
            self.wanted_pixels = attention.lists(&plan.options, plan.world_from_film, &mut self.painted);
            self.attention = Some((attention.clone(), plan));
        }
        let aims = self.aim.is_none_or(|last| last.differs(&aim));
        if wants || aims || !Arc::ptr_eq(renderer.distribution().inverse(), inverse) {
            let mode = aim.distribution(&plan.options, plan.world_from_film, inverse);
            renderer.set_distribution(attention.mixed(mode, &self.wanted_pixels))?;
            self.aim = Some(aim);
        }
        Ok(moved)
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

    /// Brings film, pose and distribution in line with a head that turns in a panorama. True when the film is another.
    pub fn follow_head(&mut self, look: &Look, head: &HeadAim) -> anyhow::Result<bool> {
        let HeadAim { view, gaze, gaze_error_deg, size_px } = *head;
        let controls = &look.controls;
        let inverse = self.inverse(Acuity { gaze_error_deg, ..controls.acuity })?;
        let aim = Aim {
            mode: controls.mode,
            view,
            gaze: GazePoint::towards(gaze, &view),
            clip: controls.clip,
            // Before the eyes, the angle in the scene is the angle at the eye.
            eccentricity: EccentricityAt::Scene,
            screen_half_extent: Vec2::ONE,
        };
        let widest = self.gpu.device.limits().max_texture_dimension_2d;
        let fits = |plan: FilmPlan| plan.options.mapping == FilmMapping::Equirect && plan.options.width <= widest;
        let plan = self.open.as_ref().context("no scene is open")?.plan;
        let mut changed = false;
        if !plan.is_some_and(fits) {
            let memory = self.film_memory_bytes();
            let [hfov, vfov] = view.half_extent.to_array().map(|tangent| 2.0 * tangent.atan());
            let plan = FilmPlan::panorama(&View::new(0.0, 0.0, hfov, vfov), size_px.as_vec2(), memory, widest);
            self.set_plan(plan, aim, &inverse)?;
            changed = true;
        }
        let moved = self.set_pose_and_aim(look, aim, &inverse)?;
        // Judging the noise waits for the device; a headset's frames do not.
        self.renderer()?.set_adaptive(false);
        Ok(moved || changed)
    }

    /// Goes on with scene and film on another device. Where the old one does not give its film back, the film is the one
    /// that was kept, if one was. Where the scene does not fit the new device, all stays as it is.
    pub fn move_to(&mut self, gpu: Gpu, kept: Option<Arc<FilmSnapshot>>) -> anyhow::Result<Moved> {
        let newest = self.snapshot();
        let is_newest = newest.is_ok();
        let film = newest.map_or(kept, |film| film.map(Arc::new));
        let before = std::mem::replace(&mut self.gpu, gpu);
        match &film {
            Some(film) => {
                if let Err(error) = self.go_on(film) {
                    self.gpu = before;
                    return Err(error);
                }
            }
            None => self.give_up_film(),
        }
        self.target = None;
        Ok(Moved { film, is_newest })
    }

    /// Gives the present film up; the next one is made on this device.
    pub fn start_anew_on(&mut self, gpu: Gpu) {
        self.gpu = gpu;
        self.target = None;
        self.give_up_film();
    }

    fn give_up_film(&mut self) {
        if let Some(open) = &mut self.open {
            (open.renderer, open.plan) = (None, None);
        }
        self.sketched = None;
        self.keeps_film = false;
        self.beside = None;
    }

    /// A number that no picture has had.
    pub fn next_generation(&mut self) -> u64 {
        self.generations += 1;
        self.generations
    }

    /// Traces a batch of at most so many samples and waits for it. How many there were, and how long they took. While two modes
    /// are compared the batch is of the one that has had less time.
    pub fn trace(&mut self, samples: u32) -> anyhow::Result<(u32, Duration)> {
        if let Some(side) = self.beside.as_mut().filter(|side| side.traced() < self.traced) {
            return side.trace(samples);
        }
        let start = Instant::now();
        let traced = self.renderer()?.trace(samples)?;
        self.gpu.wait()?;
        let took = start.elapsed();
        self.traced += took;
        Ok((traced, took))
    }

    /// Draws the picture, with one texel for `coarseness` by `coarseness` pixels, and waits for it.
    pub fn show(&mut self, look: &Look, coarseness: u32) -> anyhow::Result<Picture> {
        let size = self.picture_size(look, coarseness);
        let picture = self.target(size)?;
        let settings = view_settings(look, size);
        self.find_first_hits(&settings)?;
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("show") });
        self.renderer()?.present(&mut encoder, &settings, &picture.texture, readback::PICTURE_FORMAT)?;
        self.present_beside(&mut encoder, look, &settings, &picture)?;
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.wait()?;
        self.look_at_picture(look, &settings)?;
        Ok(picture)
    }

    /// What a picture of so many texels is drawn to.
    fn target(&mut self, size: [u32; 2]) -> anyhow::Result<Picture> {
        if self.target.as_ref().is_none_or(|target| [target.texture.width(), target.texture.height()] != size) {
            self.generations += 1;
            let texture = readback::picture_texture(&self.gpu, size);
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            self.target = Some(Target { texture, picture: Picture::drawn(view, self.generations) });
        }
        Ok(self.target.as_ref().context("made above")?.picture.clone())
    }

    fn picture_size(&self, look: &Look, coarseness: u32) -> [u32; 2] {
        let limit = self.gpu.device.limits().max_texture_dimension_2d;
        (look.size_px / coarseness.max(1)).clamp(UVec2::ONE, UVec2::splat(limit)).to_array()
    }

    /// How strongly pixels with few samples are smoothed from now on; see [`Renderer::set_smoothing`].
    pub fn set_smoothing(&mut self, samples: f32) {
        if let Some(Open { renderer: Some(renderer), .. }) = &mut self.open {
            renderer.set_smoothing(samples);
        }
        if let Some(side) = &mut self.beside {
            side.set_smoothing(samples);
        }
    }

    /// Empties the film.
    pub fn restart(&mut self) {
        if let Some(Open { renderer: Some(renderer), .. }) = &mut self.open {
            renderer.restart();
            self.traced = Duration::ZERO;
        }
        if let Some(side) = &mut self.beside {
            side.restart();
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
        self.read_beside(direction)?;
        Ok(Block::new(&self.renderer()?.pixels_near(direction, AROUND_RADIUS_PX)?))
    }

    /// The picture as it is shown: its size and texels. Waits for the device.
    pub fn texels(&self) -> anyhow::Result<([u32; 2], Vec<[u8; 4]>)> {
        let texture = &self.target.as_ref().context("there is no picture yet")?.texture;
        Ok(([texture.width(), texture.height()], readback::read_texture(&self.gpu, texture)?))
    }

    /// What the version of the scene that is traced took to prepare, and how long that was altogether.
    pub fn scene_report(&self) -> Option<(&SceneReport, Duration)> {
        self.scene_report.as_ref().map(|(report, took)| (report, *took))
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

    /// The renderer, once a film is planned.
    pub fn renderer(&mut self) -> anyhow::Result<&mut Renderer> {
        self.open.as_mut().and_then(|open| open.renderer.as_mut()).context("no scene is open")
    }
}

fn renderer_options(args: &PreviewArgs, plan: FilmPlan) -> RendererOptions {
    let sampling = &args.sampling;
    RendererOptions {
        film: plan.options,
        max_bounces: sampling.max_bounces,
        seed: sampling.seed,
        sequence: sampling.sequence.into(),
    }
}

fn timed_set_scene(renderer: &mut Renderer, scene: &Scene) -> Result<(SceneReport, Duration), RenderError> {
    let start = Instant::now();
    Ok((renderer.set_scene(scene)?, start.elapsed()))
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
        debug_view: look.controls.shown,
        fill: true,
        // Modes are compared by what they have sampled.
        denoise: look.controls.denoise && look.controls.comparison.is_none() && look.controls.trial.is_none(),
        ring: None,
    }
}
