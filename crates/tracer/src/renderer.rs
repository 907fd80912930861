//! The renderer that every consumer drives: desktop, headset, command line, tests and benches.

use std::{sync::Arc, time::Instant};

use glam::Vec3;

mod adaptive;
mod batch;
mod beside;
mod error;
mod generation;
mod inspect;
mod options;
mod panorama;
mod query;
mod rehearsal;
mod restore;
mod sampling;
mod schedule;
mod sketch;
mod split;
mod timing;
mod wavefront;

use batch::BoundKernels;
pub use error::RenderError;
pub use options::{
    FilmPose, RenderStatistics, RendererOptions, SamplingTechnique, SceneReport, SequenceKind, StopCondition,
};
pub use panorama::Refreshed;
pub use query::{Query, QueryAnswer, RayKind};
pub use rehearsal::{Rehearsal, RehearsalError, Rehearsed};
pub use restore::RestoreError;
pub use schedule::Schedule;
pub use timing::{BatchSeconds, StageSeconds};

use crate::{
    bvh::HierarchyKind,
    distribution::Distribution,
    features::{Feature, SceneFeatures},
    film::{Film, FilmMapping, FilmOptions, FilmPixel, LAST_SAMPLE, PixelsNear, SampleRange},
    gpu::Gpu,
    kernels::{
        self, Kernel, KernelConstants, KernelKey, ShaderSources,
        layout::{BatchParams, SampleRecord},
        pipelines::{KernelError, PipelineCache},
    },
    scene::{ContentHash, Scene},
    upload::{SceneCache, SceneOnGpu},
    view::{FilmSource, ViewRenderer, ViewSettings, ViewTarget},
};

/// Largest batch, in samples.
pub const LARGEST_BATCH: u32 = 1 << 18;
/// First batch after a change, in samples.
pub const FIRST_BATCH: u32 = 1 << 14;

/// Traces a scene progressively into a film.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    options: RendererOptions,
    film: Film,
    cache: SceneCache,
    scene: Option<SceneOnGpu>,
    pose: FilmPose,
    distribution: Distribution,
    pixel_list: wgpu::Buffer,
    sources: Arc<ShaderSources>,
    technique: SamplingTechnique,
    spare_features: SceneFeatures,
    pipelines: PipelineCache,
    bound: Option<BoundKernels>,
    /// One per slab of the film: they differ in the slab alone.
    params: Vec<wgpu::Buffer>,
    records: wgpu::Buffer,
    schedule: Schedule,
    /// Of the wavefront schedule, once it was asked for.
    path_buffers: Option<wavefront::PathBuffers>,
    /// In the film.
    samples: u64,
    first_sample: u64,
    next_sample: u64,
    /// What the film held when it was restored from a snapshot.
    restored: Vec<SampleRange>,
    scene_hash: ContentHash,
    /// Counts the scenes that were set.
    scene_version: u64,
    adaptive: adaptive::Adaptive,
    sampling: sampling::Sampling,
    view: ViewRenderer,
}

impl Renderer {
    /// Allocates the film and what does not depend on a scene.
    ///
    /// # Errors
    /// When the film is no picture or does not fit the device.
    pub fn new(gpu: &Gpu, options: &RendererOptions, distribution: Distribution) -> Result<Self, RenderError> {
        let (film, params) = allocate_film(gpu, options.film)?;
        let buffer = |label, size: u64, usage| {
            let usage = usage | wgpu::BufferUsages::COPY_DST;
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let records = buffer(
            "sample records",
            u64::from(LARGEST_BATCH) * size_of::<SampleRecord>() as u64,
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        );
        let sources = Arc::new(ShaderSources::new(distribution.inverse()));
        Ok(Self {
            view: ViewRenderer::new(gpu),
            pixel_list: buffer("pixel list", 16, wgpu::BufferUsages::STORAGE),
            gpu: gpu.clone(),
            options: *options,
            film,
            cache: SceneCache::new(HierarchyKind::preferred_on(gpu)),
            scene: None,
            pose: FilmPose::default(),
            distribution,
            sources,
            technique: SamplingTechnique::default(),
            spare_features: SceneFeatures::default(),
            pipelines: PipelineCache::default(),
            bound: None,
            params,
            records,
            schedule: Schedule::preferred_on(gpu),
            path_buffers: None,
            samples: 0,
            first_sample: 0,
            next_sample: 0,
            restored: Vec::new(),
            scene_hash: ContentHash::default(),
            scene_version: 0,
            adaptive: adaptive::Adaptive::default(),
            sampling: sampling::Sampling::default(),
        })
    }

    /// Builds hierarchies of another kind than what measured faster on the adapter, from the next scene on.
    pub fn set_hierarchy(&mut self, kind: HierarchyKind) {
        if self.cache.hierarchy() != kind {
            self.cache = SceneCache::new(kind);
        }
    }

    /// What the hierarchies are.
    pub fn hierarchy(&self) -> HierarchyKind {
        self.cache.hierarchy()
    }

    /// Uploads a scene version, compiles its kernels and restarts the film.
    ///
    /// # Errors
    /// When the scene does not fit the device or a kernel does not compile; the last scene then stays.
    pub fn set_scene(&mut self, scene: &Scene) -> Result<SceneReport, RenderError> {
        let (uploaded, edit) = SceneOnGpu::upload(&self.gpu, scene, &mut self.cache)?;
        let upload = uploaded.report;
        let before = self.scene.replace(uploaded);
        let started = Instant::now();
        if let Err(error) = self.bind().and_then(|()| self.warm_up()) {
            self.scene = before;
            self.bound = None;
            self.cache.forget_device();
            if self.scene.is_some() {
                self.bind()?;
            }
            return Err(error);
        }
        edit.write(&self.gpu);
        let kernel_compile_secs = started.elapsed().as_secs_f64();
        self.scene_hash = scene.content_hash();
        self.scene_version += 1;
        self.split_light_samples(scene)?;
        let environment_share = self.scene.as_ref().map_or(0.0, |scene| scene.environment_probability);
        self.restart();
        Ok(SceneReport { upload, kernel_compile_secs, environment_share })
    }

    /// Puts an empty film of another size or mapping in the place of the present one. What is shown meanwhile is the old
    /// picture. A distribution over a list of film pixels is to be set anew, since their numbers differ.
    ///
    /// # Errors
    /// When the film is no picture, does not fit the device, or a kernel for it does not compile; the last film then stays.
    pub fn set_film(&mut self, options: FilmOptions) -> Result<(), RenderError> {
        if options == self.options.film {
            return Ok(());
        }
        let (film, params) = allocate_film(&self.gpu, options)?;
        self.view.keep_as_stale(&self.gpu);
        let last = (
            std::mem::replace(&mut self.film, film),
            std::mem::replace(&mut self.params, params),
            std::mem::replace(&mut self.options.film, options),
        );
        if self.scene.is_some()
            && let Err(error) = self.bind().and_then(|()| self.warm_up())
        {
            (self.film, self.params, self.options.film) = last;
            self.bind()?;
            return Err(error);
        }
        self.forget_samples();
        Ok(())
    }

    /// Moves or turns the film; restarts it when that is a change.
    pub fn set_pose(&mut self, pose: FilmPose) {
        if self.pose != pose {
            self.pose = pose;
            self.restart();
        }
    }

    /// The film's pose.
    pub fn pose(&self) -> FilmPose {
        self.pose
    }

    /// Changes how samples are spread. Nothing restarts.
    ///
    /// # Errors
    /// When the kernel of a new radial inverse does not compile; the last distribution then stays.
    pub fn set_distribution(&mut self, distribution: Distribution) -> Result<(), RenderError> {
        let before = std::mem::replace(&mut self.distribution, distribution);
        if !Arc::ptr_eq(before.inverse(), self.distribution.inverse()) {
            let sources = (*self.sources).clone().with_inverse(self.distribution.inverse());
            if let Err(error) = self.set_shaders(sources) {
                self.distribution = before;
                return Err(error);
            }
        }
        self.drop_guide();
        self.sampling.forget();
        Ok(())
    }

    /// How samples are spread.
    pub fn distribution(&self) -> &Distribution {
        &self.distribution
    }

    /// The estimates of the film's pixels about a direction of the world, at most `radius` columns and rows away. Waits for
    /// the device.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn pixels_near(&self, direction: Vec3, radius: u32) -> Result<PixelsNear, RenderError> {
        let in_film = self.pose.world_from_film.inverse() * direction;
        let Some(pixel) = self.options.film.pixel_of(in_film) else { return Ok(PixelsNear::default()) };
        let (radiance, luminance) = self.film_scales();
        let estimate = |words: &[u32]| FilmPixel::from_words(words, radiance.into(), luminance.into());
        Ok(self.film.pixels_near(&self.gpu, pixel, radius, estimate)?)
    }

    /// The texts that the kernels are composed of.
    pub fn shaders(&self) -> &ShaderSources {
        &self.sources
    }

    /// Composes the kernels of other texts from now on. The film goes on.
    ///
    /// # Errors
    /// When they do not compose or compile; the last good kernels then stay.
    pub fn set_shaders(&mut self, sources: ShaderSources) -> Result<(), RenderError> {
        if sources == *self.sources {
            return Ok(());
        }
        let before = std::mem::replace(&mut self.sources, Arc::new(sources));
        let result = if self.scene.is_some() { self.bind() } else { Ok(()) };
        if result.is_err() {
            self.sources = before;
        }
        result
    }

    /// Finds light by other means from now on. The film goes on.
    ///
    /// # Errors
    /// When the kernels do not compose or compile; the last technique then stays.
    pub fn set_technique(&mut self, technique: SamplingTechnique) -> Result<(), RenderError> {
        let before = std::mem::replace(&mut self.technique, technique);
        let result = if self.scene.is_some() { self.bind() } else { Ok(()) };
        if result.is_err() {
            self.technique = before;
        }
        result
    }

    /// Compiles these features in although the scene does not need them: what a flag costs is measured so. Only features of
    /// materials and lights ([`Feature::may_be_spare`]) have an effect. The film goes on.
    ///
    /// # Errors
    /// When the kernels do not compose or compile; the last ones then stay.
    pub fn set_spare_features(&mut self, features: SceneFeatures) -> Result<(), RenderError> {
        let allowed = Feature::ALL.iter().copied().filter(|f| f.may_be_spare() && features.contains(*f)).collect();
        let before = std::mem::replace(&mut self.spare_features, allowed);
        let result = if self.scene.is_some() { self.bind() } else { Ok(()) };
        if result.is_err() {
            self.spare_features = before;
        }
        result
    }

    /// Starts the film anew; what is shown meanwhile is the old picture.
    pub fn restart(&mut self) {
        self.view.keep_as_stale(&self.gpu);
        let mut encoder = self.encoder("restart");
        self.film.clear(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        self.forget_samples();
    }

    fn forget_samples(&mut self) {
        self.samples = 0;
        self.next_sample = self.first_sample;
        self.restored.clear();
        self.adaptive.steered = 0;
        self.drop_guide();
    }

    /// Starts the film anew with other random numbers; nothing of the old picture is shown.
    pub fn set_randomness(&mut self, seed: u32, sequence: SequenceKind) {
        (self.options.seed, self.options.sequence) = (seed, sequence);
        self.restart_clean();
    }

    /// Samples in the film: traced since the last restart, and those of the snapshot that it was restored from.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Index of the first sample of an empty film, at most 2^62: renders of disjoint ranges of one seed can be merged. A
    /// film that has samples goes on as it was until it restarts.
    pub fn set_first_sample(&mut self, first: u64) {
        self.first_sample = first.min(LAST_SAMPLE);
        if self.samples == 0 {
            self.next_sample = self.first_sample;
        }
    }

    /// The options that this renderer was made with.
    pub fn options(&self) -> &RendererOptions {
        &self.options
    }

    /// The device that this renderer draws on.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Records and submits one batch of at most `samples` samples and returns how many; does not wait, unless noise is judged
    /// ([`Renderer::set_adaptive`]), or paths may outlive the rounds of [`Schedule::Wavefront`]: through clear sheets, or with more
    /// than 31 bounces.
    ///
    /// Batches are powers of two, aligned in the sequence, up to [`LARGEST_BATCH`]: the first after a restart can have
    /// any such size, the next at most as many as are done already, and so on.
    ///
    /// # Errors
    /// When there is no scene, a distribution's pixel lists do not fit the device, or it is lost while it is waited for.
    pub fn trace(&mut self, samples: u32) -> Result<u32, RenderError> {
        self.follow_noise()?;
        let samples = self.next_batch(samples);
        self.write_params(samples)?;
        self.submit_batch(self.path_batch(samples))?;
        self.samples += u64::from(samples);
        self.next_sample += u64::from(samples);
        self.count_steered(samples);
        Ok(samples)
    }

    fn next_batch(&self, wanted: u32) -> u32 {
        let first = self.next_sample;
        let aligned = if first == 0 { LARGEST_BATCH } else { 1 << first.trailing_zeros().min(LARGEST_BATCH.ilog2()) };
        let wanted = u64::from(wanted.clamp(1, LARGEST_BATCH)).min(self.samples_until_judged());
        aligned.min(1 << wanted.ilog2())
    }

    /// Traces until `stop`, in batches of about a tenth of a second; `progress` hears the fraction done after each and
    /// returns false to stop early. Returns the seconds of tracing.
    ///
    /// # Errors
    /// As [`Renderer::trace`].
    pub fn render(&mut self, stop: StopCondition, mut progress: impl FnMut(f64) -> bool) -> Result<f64, RenderError> {
        let target = 0.1;
        let started = Instant::now();
        let mut batch = FIRST_BATCH;
        loop {
            let fraction = match stop {
                StopCondition::Samples(total) => {
                    let left = total.saturating_sub(self.samples);
                    batch = batch.min(left.min(u64::from(LARGEST_BATCH)) as u32);
                    if left == 0 { 1.0 } else { self.samples as f64 / total as f64 }
                }
                StopCondition::Seconds(seconds) => started.elapsed().as_secs_f64() / seconds.max(1e-9),
            };
            let wants_more = progress(fraction.min(1.0));
            if fraction >= 1.0 || !wants_more {
                return Ok(started.elapsed().as_secs_f64());
            }
            let batch_started = Instant::now();
            let traced = self.trace(batch)?;
            self.gpu.wait().map_err(|_| RenderError::DeviceLost)?;
            let growth = (target / batch_started.elapsed().as_secs_f64().max(1e-6)).clamp(0.5, 2.0);
            batch = ((f64::from(traced) * growth) as u32).clamp(1 << 10, LARGEST_BATCH);
        }
    }

    /// Reconstructs the view from the film and presents it to a target of the view's size.
    ///
    /// # Errors
    /// When the view has more pixels than fit a binding, or a kernel does not compile for the target's format.
    pub fn present(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        settings: &ViewSettings,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Result<(), RenderError> {
        self.present_to(encoder, settings, &ViewTarget { view: target, format, part: None })
    }

    /// As [`Renderer::present`], to a part of a target where it says so.
    ///
    /// # Errors
    /// When the view has more pixels than fit a binding, or a kernel does not compile for the target's format.
    pub fn present_to(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        settings: &ViewSettings,
        target: &ViewTarget<'_>,
    ) -> Result<(), RenderError> {
        self.drop_other_hits(settings);
        let keys = Kernel::ALL.map(|kernel| self.key(kernel));
        let key = |kernel| keys.iter().find(|key| key.kernel == kernel).expect("every kernel has a key").clone();
        let source = FilmSource::new(&self.film, self.pose.world_from_film, self.film_scales());
        self.view.record(encoder, &mut self.pipelines, &key, &source, settings, target)
    }

    /// From now on a pixel of the view with so many samples (1 at first, at least 0.01) is half its own mean and half its
    /// neighbourhood's, or the picture's from before a restart. Higher is smoother and blurred; what the film holds stays.
    pub fn set_smoothing(&mut self, samples: f32) {
        self.view.smoothing_samples = samples.max(0.01);
    }

    /// The present kernels' text by their label.
    ///
    /// # Errors
    /// When a kernel does not compose.
    pub fn kernel_texts(&self) -> Result<Vec<(String, String)>, RenderError> {
        Kernel::ALL
            .iter()
            .map(|&kernel| {
                let key = self.key(kernel);
                Ok((key.to_string(), kernels::compose(&key).map_err(KernelError::from)?))
            })
            .collect()
    }

    /// Key of a kernel for the present scene, film and distribution.
    pub fn key(&self, kernel: Kernel) -> KernelKey {
        let perspective = matches!(self.options.film.mapping, FilmMapping::Perspective { .. });
        let scene = self.scene.as_ref();
        let own = scene.map(|s| s.features).unwrap_or_default();
        let features = if matches!(kernel, Kernel::Query | Kernel::Identify | Kernel::FirstHit) {
            own
        } else if kernel.traces_paths() {
            own.union(self.spare_features)
                .with(Feature::LightSamplingOnly, self.technique == SamplingTechnique::Lights)
                .with(Feature::BsdfSamplingOnly, self.technique == SamplingTechnique::Bsdf)
        } else {
            Default::default()
        };
        KernelKey {
            kernel,
            features: features
                .with(Feature::PerspectiveFilm, perspective)
                .with(Feature::DealtGroups, self.gpu.takes_runs_of_workgroups() && kernel.has_uneven_workgroups()),
            constants: if kernel.traces_paths() || matches!(kernel, Kernel::Query | Kernel::FirstHit) {
                scene.map(|s| s.constants).unwrap_or_default()
            } else {
                KernelConstants::default()
            },
            sources: self.sources.clone(),
        }
    }

    fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
    }
}

/// A film with the parameter buffers of its slabs.
fn allocate_film(gpu: &Gpu, options: FilmOptions) -> Result<(Film, Vec<wgpu::Buffer>), RenderError> {
    let too_large = || RenderError::FilmTooLarge {
        width: options.width,
        height: options.height,
        bytes: options.bytes(),
        adapter: gpu.info().name.clone(),
        free: gpu.free_memory(),
    };
    if !options.is_picture() {
        let FilmOptions { width, height, .. } = options;
        return Err(RenderError::NoPicture { width, height, half_extent: options.half_extent() });
    }
    if options.pixels() > u64::from(u32::MAX) || u64::from(options.width) * 40 > gpu.largest_binding() {
        return Err(too_large());
    }
    let film = Film::new(gpu, options).ok_or_else(too_large)?;
    let params = || {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("batch parameters"),
            size: size_of::<BatchParams>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    };
    let params = film.slabs.iter().map(|_| params()).collect();
    Ok((film, params))
}
