//! A scene on the adapter, ready to be rendered by any method.

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use fovea_sampler::Inverse;
use tracer::film::FilmOptions;
use tracer::gpu::Gpu;
use tracer::renderer::{FilmPose, Renderer, RendererOptions, SequenceKind, StopCondition};
use tracer::scene::Scene;
use tracer::view::{DebugView, ToneMap, ViewProjection, ViewSettings};

use super::error::Rgb;
use super::plan::{self, Method, Place};
use crate::cli::study::{StudyArgs, StudyScene};
use crate::cli::{FileArgs, SceneArgs, values};
use crate::commands::render::follow;
use crate::readback;
use crate::session::{self, Source, Viewpoint};

/// A view's picture as the artist sees it.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Reconstructed radiance, before exposure and tone map.
    pub linear: Vec<Rgb>,
    /// As displayed.
    pub encoded: Vec<[u8; 3]>,
}

/// One scene of a study.
pub struct Bench {
    /// File name without its ending.
    pub name: String,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where one looks.
    pub places: Vec<Place>,
    /// The panorama.
    pub film: FilmOptions,
    renderer: Renderer,
    /// On the sphere, and Eq. 6 as printed.
    inverses: [Arc<Inverse>; 2],
}

impl Bench {
    /// Loads a scene and puts the film at its camera.
    ///
    /// # Errors
    /// When the scene cannot be read or does not fit the adapter.
    pub fn new(gpu: &Gpu, args: &StudyArgs, scene: Option<&StudyScene>) -> anyhow::Result<Self> {
        let Opened { name, scene: loaded, camera } = open(scene, args.background)?;
        let film = FilmOptions::equirect(args.film.width, args.film.height);
        let places = plan::gazes(args, &name).into_iter().map(|gaze| Place::new(gaze, camera.rotation)).collect();
        let inverses = [Method::Fv.inverse()?, Method::FvEq6.inverse()?];
        let options =
            RendererOptions { film, max_bounces: args.max_bounces, seed: 1, sequence: SequenceKind::Independent };
        let distribution = tracer::distribution::Distribution::omnidirectional(Arc::clone(&inverses[0]));
        let mut renderer = Renderer::new(gpu, &options, distribution)?;
        renderer.set_scene(&loaded)?;
        renderer.set_pose(FilmPose { position: camera.position, world_from_film: camera.rotation });
        Ok(Self { name, scene: loaded, places, film, renderer, inverses })
    }

    /// The adapter that it is measured on.
    pub fn gpu(&self) -> &Gpu {
        self.renderer.gpu()
    }

    /// Pose of the film in the world.
    pub fn pose(&self) -> FilmPose {
        self.renderer.pose()
    }

    /// An empty film, samples by a method about a place.
    ///
    /// # Errors
    /// When a kernel does not compile.
    pub fn begin(&mut self, method: Method, place: &Place, seed: u32, sequence: SequenceKind) -> anyhow::Result<()> {
        let inverse = &self.inverses[usize::from(method == Method::FvEq6)];
        self.renderer.set_distribution(method.distribution(place, &self.film, inverse))?;
        self.renderer.set_randomness(seed, sequence);
        Ok(())
    }

    /// Goes on until the film has so many samples; returns the seconds.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn go_on(&mut self, samples: u64) -> anyhow::Result<f64> {
        Ok(self.renderer.render(StopCondition::Samples(samples), |_| true)?)
    }

    /// Goes on along a recorded gaze whose whole length takes `whole` samples.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn follow(&mut self, steps: &[follow::Step], place: &Place, samples: u64) -> anyhow::Result<()> {
        for step in steps {
            if self.renderer.samples() >= samples {
                break;
            }
            let inverse = &self.inverses[0];
            let towards = Method::FvWander.distribution_towards(step.gaze, place, &self.film, inverse);
            if step.samples > self.renderer.samples() {
                self.renderer.set_distribution(towards)?;
                self.go_on(step.samples.min(samples))?;
            }
        }
        Ok(())
    }

    /// The film at this moment.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn film(&self) -> anyhow::Result<super::error::Film> {
        Ok(super::error::Film::new(&self.renderer.snapshot()?))
    }

    /// A place's view, `side` pixels across and up.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn view(&mut self, place: &Place, side: u32) -> anyhow::Result<Picture> {
        let encoded = self.draw(ViewProjection::Perspective(place.view), [side; 2])?;
        let (_, radiance) = self.renderer.presented_radiance()?;
        let linear = radiance.into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
        Ok(Picture { linear, encoded })
    }

    /// The whole film as a picture of its own size.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn panorama(&mut self) -> anyhow::Result<Vec<[u8; 3]>> {
        let settings =
            ViewSettings { fill: false, ..settings(ViewProjection::Film, [self.film.width, self.film.height]) };
        Ok(opaque(&readback::draw(&mut self.renderer, &settings)?))
    }

    fn draw(&mut self, projection: ViewProjection, size: [u32; 2]) -> anyhow::Result<Vec<[u8; 3]>> {
        Ok(opaque(&readback::draw(&mut self.renderer, &settings(projection, size))?))
    }
}

/// A scene and from where it is seen.
pub struct Opened {
    /// File name without its ending.
    pub name: String,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where the film is.
    pub camera: Viewpoint,
}

/// Reads a scene, or the built-in one, and finds its camera.
///
/// # Errors
/// When it cannot be read or has no such camera.
pub fn open(scene: Option<&StudyScene>, background: Option<values::Rgb>) -> anyhow::Result<Opened> {
    open_showing(scene, background, |_| Ok(()))
}

/// As [`open`], and hands on what the scene is before its images are read, which goes on when `show` returns.
///
/// # Errors
/// As [`open`], or that of `show`.
pub fn open_showing(
    scene: Option<&StudyScene>,
    background: Option<values::Rgb>,
    show: impl FnOnce(Opened) -> anyhow::Result<()>,
) -> anyhow::Result<Opened> {
    let name = scene.map_or_else(|| "builtin".into(), scene_name);
    let args = SceneArgs {
        scene: scene.map(|scene| scene.path.clone()),
        camera: scene.and_then(|scene| scene.camera.clone()),
        background,
        backdrop: None,
        env: None,
        env_rotate: 0.0,
        sun_angle: 0.0,
        file: FileArgs::default(),
        adapter: None,
    };
    let opened = |scene: Arc<Scene>| -> anyhow::Result<Opened> {
        let mut viewpoints = session::viewpoints(&scene);
        let chosen = session::choose(&viewpoints, args.camera.as_ref())?;
        Ok(Opened { name: name.clone(), scene, camera: viewpoints.swap_remove(chosen) })
    };
    let mut shown = Ok(());
    let source = Source::from(args.scene.as_deref());
    let loaded = session::load_showing(&source, &args, |shapes| shown = opened(shapes.scene).and_then(show))?;
    shown?;
    opened(loaded.scene)
}

/// How a view of the film is drawn.
pub fn settings(projection: ViewProjection, size: [u32; 2]) -> ViewSettings {
    ViewSettings {
        projection,
        size,
        exposure_ev: 0.0,
        tone_map: ToneMap::AgX,
        debug_view: DebugView::Beauty,
        fill: true,
        denoise: false,
        ring: None,
    }
}

fn opaque(texels: &[[u8; 4]]) -> Vec<[u8; 3]> {
    texels.iter().map(|&[r, g, b, _]| [r, g, b]).collect()
}

/// File name without its ending, with nothing that separates fields of raw data.
fn scene_name(scene: &StudyScene) -> String {
    let stem = scene.path.file_stem().unwrap_or(scene.path.as_os_str()).to_string_lossy();
    stem.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '-' }).collect()
}

/// A recording about a place as steps of a run of so many samples.
///
/// # Errors
/// When the file is no trace.
pub fn recorded(path: &Path, place: &Place, samples: u64) -> anyhow::Result<Vec<follow::Step>> {
    follow::within_view(path, &place.view, samples).with_context(|| path.display().to_string())
}
