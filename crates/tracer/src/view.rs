//! From the film to a picture: gather to the view's size, fill holes (pull-push), tone map, present.
//!
//! Cost follows the view's size, not the film's. The film is only read.

use glam::{Mat3, Quat, Vec2};
use wgpu::BufferUsages;

use crate::{
    distribution::View,
    film::{Film, ReadError, read_buffer, read_ranges},
    gpu::Gpu,
    kernels::{
        Kernel, KernelKey, TILE_SIZE, WORKGROUP_SIZE,
        layout::{self, FirstHit, ViewParams, codes},
        pipelines::{Pipeline, PipelineCache},
    },
    renderer::RenderError,
};

pub mod colors;
mod debug;
mod first_hits;
mod guided;
pub mod histogram;

pub use debug::{DebugScale, DebugView};
pub(crate) use first_hits::{FirstHits, HitsOf};
use guided::{Guides, with_guides};
pub use histogram::Histogram;

/// View transform from radiance to display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ToneMap {
    /// AgX: soft highlights that keep their hue.
    #[default]
    AgX,
    /// Khronos PBR Neutral: base colours stay as they are.
    PbrNeutral,
    /// sRGB encoding alone; clips at 1.
    Linear,
    /// A colour for each stop of luminance about middle grey ([`colors::FALSE_COLORS`]).
    FalseColor,
}

/// What part of the film is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ViewProjection {
    /// The whole film as it is.
    Film,
    /// A perspective view.
    Perspective(View),
}

/// Everything that a frame of the view depends on beside the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewSettings {
    /// What part of the film.
    pub projection: ViewProjection,
    /// Pixels of the target.
    pub size: [u32; 2],
    /// Stops; each doubles the brightness.
    pub exposure_ev: f32,
    /// View transform.
    pub tone_map: ToneMap,
    /// Picture or debug view.
    pub debug_view: DebugView,
    /// Fill pixels without samples and smooth where there are few; false shows the film's means, black without samples.
    pub fill: bool,
    /// Reconstruct the picture with guides, once all first hits of this view are known
    /// ([`Renderer::trace_first_hits`](crate::renderer::Renderer::trace_first_hits)); until then, and where it is not filled, as
    /// without. The film is only read.
    pub denoise: bool,
    /// Circle drawn at the fovea's edge: its centre on the image plane in units of the half extents, and the tangent of
    /// its radius on the image plane.
    pub ring: Option<(Vec2, f32)>,
}

impl ViewSettings {
    /// Finds out whether an adapter can show this.
    ///
    /// # Errors
    /// When the view has more pixels than fit a binding.
    pub fn check(&self, gpu: &Gpu) -> Result<(), RenderError> {
        let bytes = if self.debug_view.shows_first_hits() { size_of::<FirstHit>() as u64 } else { TEXEL_BYTES };
        check_size(gpu, self.size, bytes)
    }

    /// Whether first hits are guides of this view, as soon as they are all known.
    pub const fn uses_guides(&self) -> bool {
        self.denoise && self.fill && matches!(self.debug_view, DebugView::Beauty)
    }
}

/// Bytes of a texel of the pyramid.
const TEXEL_BYTES: u64 = 16;
/// Texels that a level's offset is a multiple of, since no adapter asks for more than 256 bytes.
const LEVEL_ALIGNMENT: u32 = 16;

/// Samples at which a pixel's own mean weighs as much as its neighbourhood's, unless told otherwise.
pub(crate) const CONFIDENCE_SAMPLES: f32 = 1.0;

/// Where a view is drawn.
#[derive(Clone, Copy, Debug)]
pub struct ViewTarget<'a> {
    /// A texture of the view's size.
    pub view: &'a wgpu::TextureView,
    /// Its format.
    pub format: wgpu::TextureFormat,
    /// Left, top, width and height of the pixels that are drawn; the others stay. `None` draws all.
    pub part: Option<[u32; 4]>,
}

/// The film that a view is of, and what its numbers mean.
pub(crate) struct FilmSource<'a> {
    pub film: &'a Film,
    pub world_from_film: Quat,
    pub quanta_to_radiance: f32,
    /// Quanta of luminance, in second moments, that one quantum of radiance is.
    pub luminance_quanta: f32,
}

impl<'a> FilmSource<'a> {
    /// `scales`: quanta per unit of radiance and of luminance.
    pub fn new(film: &'a Film, world_from_film: Quat, (radiance, luminance): (f32, f32)) -> Self {
        Self { film, world_from_film, quanta_to_radiance: 1.0 / radiance, luminance_quanta: luminance / radiance }
    }
}

/// Buffers of the view's size and the passes over them.
#[derive(Debug)]
pub(crate) struct ViewRenderer {
    gpu: Gpu,
    size: [u32; 2],
    levels: Vec<Level>,
    pyramid: Option<wgpu::Buffer>,
    stale: Option<(wgpu::Buffer, View, [u32; 2])>,
    last: Option<ViewProjection>,
    /// While a debug view shows them or they are guides.
    pub hits: Option<FirstHits>,
    guides: Option<Guides>,
    errors: Option<wgpu::Buffer>,
    /// Bound in the place of what a debug view does not read.
    nothing: wgpu::Buffer,
    /// Samples at which a pixel's own mean weighs as much as its neighbourhood's and as the picture from before a restart.
    pub smoothing_samples: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    size: [u32; 2],
    /// Texels before it.
    offset: u32,
}

impl Level {
    /// Its texels.
    fn of(self, pyramid: &wgpu::Buffer) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: pyramid,
            offset: u64::from(self.offset) * TEXEL_BYTES,
            size: wgpu::BufferSize::new(pixels(self.size) * TEXEL_BYTES),
        })
    }
}

impl ViewRenderer {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            size: [0; 2],
            levels: Vec::new(),
            pyramid: None,
            stale: None,
            last: None,
            hits: None,
            guides: None,
            errors: None,
            nothing: gpu.buffer("nothing", &[0; 64], BufferUsages::STORAGE),
            smoothing_samples: CONFIDENCE_SAMPLES,
        }
    }

    /// Keeps the finished picture, to be shown reprojected until the new film covers it.
    pub fn keep_as_stale(&mut self, gpu: &Gpu) {
        let (Some(pyramid), Some(ViewProjection::Perspective(view))) = (&self.pyramid, self.last) else { return };
        let size = pixels(self.size) * TEXEL_BYTES;
        let copy = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("stale view"),
            size,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("stale view") });
        encoder.copy_buffer_to_buffer(pyramid, 0, &copy, 0, size);
        gpu.queue.submit([encoder.finish()]);
        self.stale = Some((copy, view, self.size));
    }

    /// Shows nothing of earlier pictures from now on.
    pub fn forget(&mut self) {
        self.stale = None;
        self.last = None;
    }

    /// The view that was presented last, row by row: radiance, and the weight that it was found with.
    pub fn finished(&self, gpu: &Gpu) -> Result<([u32; 2], Vec<[f32; 4]>), ReadError> {
        let Some(pyramid) = &self.pyramid else { return Ok(([0; 2], Vec::new())) };
        let bytes = pixels(self.size) * TEXEL_BYTES;
        Ok((self.size, read_ranges(gpu, &[(pyramid, 0, bytes)])?))
    }

    fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        if self.size == size && self.pyramid.is_some() {
            return Ok(());
        }
        check_size(&self.gpu, size, TEXEL_BYTES)?;
        self.size = size;
        self.levels.clear();
        let (mut level, mut offset) = (size, 0);
        loop {
            self.levels.push(Level { size: level, offset });
            offset = (offset + level[0] * level[1]).next_multiple_of(LEVEL_ALIGNMENT);
            // The last level is one pixel: as long as there is one sample, no part of the view is without a value. A view of one pixel
            // has another, since levels are finished from the next coarser one.
            if level[0].max(level[1]) <= 1 && self.levels.len() > 1 {
                break;
            }
            level = [level[0].div_ceil(2), level[1].div_ceil(2)];
        }
        self.pyramid = Some(self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view pyramid"),
            size: u64::from(offset) * TEXEL_BYTES,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        }));
        Ok(())
    }

    /// What the ends of a debug view's colours stand for; `None` where it has no such scale or nothing is known yet.
    pub fn scale(&self, debug_view: DebugView) -> Option<DebugScale> {
        match debug_view {
            DebugView::SampleDensity => Some(DebugScale::DENSITY),
            DebugView::Error => Some(DebugScale::ERROR),
            DebugView::Depth => self.hits.as_ref().and_then(FirstHits::depths),
            DebugView::TraversalSteps => self.hits.as_ref().and_then(FirstHits::steps),
            DebugView::Beauty | DebugView::Stale | DebugView::Albedo | DebugView::Normal => None,
        }
    }

    /// Records gather, pull, push, what a debug view needs beside, and the drawing.
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &mut PipelineCache,
        key: &dyn Fn(Kernel) -> KernelKey,
        source: &FilmSource<'_>,
        settings: &ViewSettings,
        target: &ViewTarget<'_>,
    ) -> Result<(), RenderError> {
        self.resize(settings.size)?;
        let gpu = self.gpu.clone();
        let device = &gpu.device;
        let film = source.film;
        let shows_errors = settings.debug_view == DebugView::Error;
        self.make_room(settings, shows_errors);
        let is_guided = self.guides.is_some();
        let tie = match &self.guides {
            Some(guides) if guides.are_untied() => Some([
                pipelines.compute(device, &key(Kernel::Guide))?,
                pipelines.compute(device, &key(Kernel::TiePull))?,
                pipelines.compute(device, &key(Kernel::TiePush))?,
            ]),
            _ => None,
        };
        let gather = pipelines.compute(device, &with_guides(key(Kernel::Gather), is_guided))?;
        let demodulate = is_guided.then(|| pipelines.compute(device, &key(Kernel::Demodulate))).transpose()?;
        let error = shows_errors.then(|| pipelines.compute(device, &key(Kernel::Error))).transpose()?;
        let [pull, push] =
            if is_guided { [Kernel::GuidedPull, Kernel::GuidedPush] } else { [Kernel::Pull, Kernel::Push] };
        let pull = pipelines.compute(device, &key(pull))?;
        let push = pipelines.compute(device, &key(push))?;
        let is_picture = settings.debug_view == DebugView::Beauty;
        let draw = if is_picture { Kernel::Present } else { Kernel::Inspect };
        let draw = pipelines.drawn(device, &key(draw), target.format)?;
        let errors = self.errors.as_ref().unwrap_or(&self.nothing);
        let pyramid = self.pyramid.as_ref().expect("made by resize");
        // Without a stale picture another buffer stands in for it, unread; it must not be the one written to.
        let stale = self.stale.as_ref().map_or(&film.slabs[0].buffer, |(buffer, ..)| buffer);
        let hits = self.hits.as_ref().map_or(&self.nothing, |hits| &hits.buffer);
        let untied = self.guides.as_mut().and_then(Guides::take_untied);
        let guides = untied.as_ref().unwrap_or(&self.nothing);
        let (ties, moments) = self.guides.as_ref().map_or((&self.nothing, &self.nothing), Guides::buffers);
        let base = self.params(source, settings);
        let upload =
            |params: ViewParams| gpu.buffer("view parameters", bytemuck::bytes_of(&params), BufferUsages::UNIFORM);
        let tiles = |size: [u32; 2]| [size[0].div_ceil(TILE_SIZE), size[1].div_ceil(TILE_SIZE)];
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("reconstruct view"),
                timestamp_writes: None,
            });
            for slab in &film.slabs {
                let params =
                    ViewParams { first_slab_pixel: slab.first_pixel, slab_pixel_count: slab.pixel_count, ..base };
                let params = upload(params);
                let resources = [
                    (0, params.as_entire_binding()),
                    (1, slab.buffer.as_entire_binding()),
                    (2, self.levels[0].of(pyramid)),
                    (4, errors.as_entire_binding()),
                    (7, moments.as_entire_binding()),
                ];
                for kernel in std::iter::once(&gather).chain(&error) {
                    let group = kernel.bind(device, 0, &resources);
                    kernel.dispatch(&mut pass, &[&group], tiles(settings.size));
                }
            }
            // Of the fine level alone where there is no coarser one.
            let of_level = |kernel: &Pipeline, level: usize, fine: Level, coarse: Level| {
                let params = upload(ViewParams {
                    level: level as u32,
                    size: fine.size,
                    level_offset: fine.offset,
                    coarse_offset: coarse.offset,
                    coarse_size: coarse.size,
                    ..base
                });
                let resources = [
                    (0, params.as_entire_binding()),
                    (2, fine.of(pyramid)),
                    (9, coarse.of(pyramid)),
                    (3, stale.as_entire_binding()),
                    (5, hits.as_entire_binding()),
                    (6, guides.as_entire_binding()),
                    (7, moments.as_entire_binding()),
                    (8, ties.as_entire_binding()),
                ];
                kernel.bind(device, 0, &resources)
            };
            if let Some(demodulate) = &demodulate {
                let finest = self.levels[0];
                demodulate.dispatch(&mut pass, &[&of_level(demodulate, 0, finest, finest)], tiles(settings.size));
            }
            let pairs: Vec<_> = self.levels.windows(2).map(|w| (w[0], w[1])).enumerate().collect();
            if let Some([guide, tie_pull, tie_push]) = &tie {
                let finest = self.levels[0];
                guide.dispatch(&mut pass, &[&of_level(guide, 0, finest, finest)], tiles(settings.size));
                for &(level, (fine, coarse)) in &pairs {
                    let group = of_level(tie_pull, level, fine, coarse);
                    tie_pull.dispatch(&mut pass, &[&group], tiles(coarse.size));
                }
                for &(level, (fine, coarse)) in &pairs {
                    let group = of_level(tie_push, level, fine, coarse);
                    tie_push.dispatch(&mut pass, &[&group], tiles(fine.size));
                }
            }
            for &(level, (fine, coarse)) in &pairs {
                let group = of_level(&pull, level, fine, coarse);
                pull.dispatch(&mut pass, &[&group], tiles(coarse.size));
            }
            for &(level, (fine, coarse)) in pairs.iter().rev() {
                let group = of_level(&push, level, fine, coarse);
                push.dispatch(&mut pass, &[&group], tiles(fine.size));
            }
        }
        let group = draw.bind(
            device,
            0,
            &[
                (0, upload(base).as_entire_binding()),
                (1, self.levels[0].of(pyramid)),
                (4, errors.as_entire_binding()),
                (5, hits.as_entire_binding()),
            ],
        );
        draw.cover(encoder, target.view, &[&group], target.part);
        self.last = Some(settings.projection);
        Ok(())
    }

    /// Buffers that a debug view needs are there, those that it does not need are gone.
    fn make_room(&mut self, settings: &ViewSettings, shows_errors: bool) {
        let bytes = pixels(settings.size) * TEXEL_BYTES;
        if !shows_errors {
            self.errors = None;
        } else if self.errors.as_ref().is_none_or(|errors| errors.size() != bytes) {
            self.errors = Some(self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("errors in the view"),
                size: bytes,
                usage: BufferUsages::STORAGE,
                mapped_at_creation: false,
            }));
        }
        if !settings.debug_view.shows_first_hits() && !settings.uses_guides() {
            self.hits = None;
        }
        let texels = self.levels.last().map_or(0, |level| u64::from(level.offset) + pixels(level.size));
        let known = self.hits.as_ref().filter(|hits| hits.rows == settings.size[1]).map(|hits| hits.of);
        match known.filter(|_| settings.uses_guides()) {
            None => self.guides = None,
            Some(of) if self.guides.as_ref().is_some_and(|guides| guides.of == of) => {}
            Some(of) => self.guides = Some(Guides::new(&self.gpu, texels, of)),
        }
    }

    /// Counts the pixels of the view that was presented last by luminance, with the exposure and tone map of `settings`; waits
    /// for the device. All are 0 before a view was presented.
    pub fn histogram(
        &self,
        pipelines: &mut PipelineCache,
        key: &KernelKey,
        source: &FilmSource<'_>,
        settings: &ViewSettings,
    ) -> Result<Histogram, RenderError> {
        let Some(pyramid) = &self.pyramid else { return Ok(Histogram::default()) };
        let device = &self.gpu.device;
        let kernel = pipelines.compute(device, key)?;
        let params = self.params(source, &ViewSettings { size: self.size, ..*settings });
        let params = self.gpu.buffer("view parameters", bytemuck::bytes_of(&params), BufferUsages::UNIFORM);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let counts = self.gpu.buffer("histogram", &[0; 4 * histogram::HISTOGRAM_WORDS], usage);
        let group = kernel.bind(
            device,
            0,
            &[(0, params.as_entire_binding()), (1, self.levels[0].of(pyramid)), (2, counts.as_entire_binding())],
        );
        let pixels = self.size[0] * self.size[1];
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("histogram") });
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(kernel.label()),
                timestamp_writes: None,
            });
            let workgroups = pixels.div_ceil(WORKGROUP_SIZE * histogram::HISTOGRAM_PIXELS_PER_THREAD);
            kernel.dispatch(&mut pass, &[&group], [workgroups, 1]);
        }
        self.gpu.queue.submit([encoder.finish()]);
        Ok(Histogram::from_words(&read_buffer::<u32>(&self.gpu, &counts)?, pixels))
    }

    fn params(&self, source: &FilmSource<'_>, settings: &ViewSettings) -> ViewParams {
        let film = &source.film.options;
        let film_from_world = layout::columns(Mat3::from_quat(source.world_from_film.inverse()));
        let scale = self.scale(settings.debug_view).unwrap_or(DebugScale::DENSITY);
        let mut params = ViewParams {
            kind: codes::VIEW_EQUIRECT,
            size: settings.size,
            world_from_view: layout::columns(Mat3::IDENTITY),
            film_from_world,
            view_half_extent: film.half_extent(),
            film_half_extent: film.half_extent(),
            film_size: [film.width, film.height],
            quanta_to_radiance: source.quanta_to_radiance,
            confidence_samples: self.smoothing_samples,
            exposure: settings.exposure_ev.exp2(),
            tone_map: settings.tone_map as u32,
            debug_view: settings.debug_view as u32,
            fill: u32::from(settings.fill),
            debug_low: scale.low,
            debug_high: scale.high,
            is_debug_logarithmic: u32::from(scale.is_logarithmic),
            hit_rows: self.hits.as_ref().map_or(0, |hits| hits.rows),
            luminance_quanta: source.luminance_quanta,
            stale_size: [1; 2],
            stale_half_extent: [1.0; 2],
            ..bytemuck::Zeroable::zeroed()
        };
        if let ViewProjection::Perspective(view) = settings.projection {
            params.kind = codes::VIEW_PERSPECTIVE;
            params.world_from_view = layout::columns(Mat3::from_quat(view.world_from_view));
            params.view_half_extent = view.half_extent.to_array();
            if let Some((_, old, size)) = &self.stale {
                params.stale_weight = 1.0;
                params.stale_from_world = layout::columns(Mat3::from_quat(old.world_from_view.inverse()));
                params.stale_half_extent = old.half_extent.to_array();
                params.stale_size = *size;
            }
            if let Some((centre, tangent)) = settings.ring {
                params.gaze_in_view = (centre * view.half_extent).to_array();
                params.ring_tangent = tangent;
            }
        }
        params
    }
}

fn pixels([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Finds out whether the adapter can bind what a view has of so many bytes for each pixel.
pub(crate) fn check_size(gpu: &Gpu, size: [u32; 2], bytes: u64) -> Result<(), RenderError> {
    let bytes = pixels(size) * bytes;
    let limit = gpu.largest_binding();
    if bytes <= limit {
        return Ok(());
    }
    Err(RenderError::ViewTooLarge { width: size[0], height: size[1], bytes, limit, adapter: gpu.info().name.clone() })
}
