//! From the film to a picture: gather to the view's size, fill holes (pull-push), tone map, present.
//!
//! Cost follows the view's size, not the film's. The film is only read.

use glam::{Mat3, Quat, Vec2};
use wgpu::BufferUsages;

use crate::{
    distribution::View,
    film::{Film, FilmOptions, ReadError, read_ranges},
    gpu::Gpu,
    kernels::{
        Kernel, KernelKey, TILE_SIZE,
        layout::{self, ViewParams, codes},
        pipelines::PipelineCache,
    },
    renderer::RenderError,
};

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
}

/// What is shown instead of, or beside, the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DebugView {
    /// The picture.
    #[default]
    Beauty,
    /// Samples per pixel of the view, logarithmic.
    SampleDensity,
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
    /// Circle drawn at the fovea's edge: its centre on the image plane in units of the half extents, and the tangent of
    /// its radius on the image plane.
    pub ring: Option<(Vec2, f32)>,
}

/// Samples at which a pixel's own mean weighs as much as its neighbourhood's.
pub(crate) const CONFIDENCE_SAMPLES: f32 = 1.0;

/// Stops of sample density from the darkest colour of its debug view, 1/16 a pixel, to white, 4096.
const DENSITY_STOPS: f32 = 16.0;

/// Buffers of the view's size and the passes over them.
#[derive(Debug)]
pub(crate) struct ViewRenderer {
    gpu: Gpu,
    size: [u32; 2],
    levels: Vec<Level>,
    pyramid: Option<wgpu::Buffer>,
    stale: Option<(wgpu::Buffer, View, [u32; 2])>,
    last: Option<ViewProjection>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    size: [u32; 2],
    offset: u32,
}

impl ViewRenderer {
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), size: [0; 2], levels: Vec::new(), pyramid: None, stale: None, last: None }
    }

    /// Keeps the finished picture, to be shown reprojected until the new film covers it.
    pub fn keep_as_stale(&mut self, gpu: &Gpu) {
        let (Some(pyramid), Some(ViewProjection::Perspective(view))) = (&self.pyramid, self.last) else { return };
        let size = u64::from(self.size[0]) * u64::from(self.size[1]) * 16;
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
        let bytes = u64::from(self.size[0]) * u64::from(self.size[1]) * 16;
        Ok((self.size, read_ranges(gpu, &[(pyramid, 0, bytes)])?))
    }

    fn resize(&mut self, size: [u32; 2]) {
        if self.size == size && self.pyramid.is_some() {
            return;
        }
        self.size = size;
        self.levels.clear();
        let (mut level, mut offset) = (size, 0);
        loop {
            self.levels.push(Level { size: level, offset });
            offset += level[0] * level[1];
            if level[0].max(level[1]) <= 2 {
                break;
            }
            level = [level[0].div_ceil(2), level[1].div_ceil(2)];
        }
        self.pyramid = Some(self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("view pyramid"),
            size: u64::from(offset) * 16,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        }));
    }

    /// Records gather, pull, push and present.
    #[expect(clippy::too_many_arguments, reason = "one call site, and each is a different thing")]
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &mut PipelineCache,
        key: &dyn Fn(Kernel) -> Option<KernelKey>,
        film: &Film,
        world_from_film: Quat,
        quanta_to_radiance: f32,
        settings: &ViewSettings,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Result<(), RenderError> {
        self.resize(settings.size);
        let gpu = self.gpu.clone();
        let device = &gpu.device;
        let compute = |pipelines: &mut PipelineCache, kernel| {
            let key = key(kernel).expect("every kernel has a key");
            pipelines.compute(device, &key)
        };
        let gather = compute(pipelines, Kernel::Gather)?;
        let pull = compute(pipelines, Kernel::Pull)?;
        let push = compute(pipelines, Kernel::Push)?;
        let present = pipelines.drawn(device, &key(Kernel::Present).expect("every kernel has a key"), format)?;
        let pyramid = self.pyramid.as_ref().expect("made by resize");
        let stale = self.stale.as_ref().map_or(pyramid, |(buffer, ..)| buffer);
        let base = self.params(&film.options, world_from_film, quanta_to_radiance, settings);
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
                let group = gather.bind(
                    device,
                    0,
                    &[
                        (0, upload(params).as_entire_binding()),
                        (1, slab.buffer.as_entire_binding()),
                        (2, pyramid.as_entire_binding()),
                    ],
                );
                gather.dispatch(&mut pass, &[&group], tiles(settings.size));
            }
            let pairs: Vec<_> = self.levels.windows(2).map(|w| (w[0], w[1])).enumerate().collect();
            let level_params = |level: usize, fine: Level, coarse: Level| ViewParams {
                level: level as u32,
                size: fine.size,
                level_offset: fine.offset,
                coarse_offset: coarse.offset,
                coarse_size: coarse.size,
                ..base
            };
            for &(level, (fine, coarse)) in &pairs {
                let params = upload(level_params(level, fine, coarse));
                let group = pull.bind(device, 0, &[(0, params.as_entire_binding()), (2, pyramid.as_entire_binding())]);
                pull.dispatch(&mut pass, &[&group], tiles(coarse.size));
            }
            for &(level, (fine, coarse)) in pairs.iter().rev() {
                let params = upload(level_params(level, fine, coarse));
                // Without a stale picture another buffer stands in for it, unread; it must not be the one written to.
                let stand_in = self.stale.is_none().then(|| &film.slabs[0].buffer);
                let group = push.bind(
                    device,
                    0,
                    &[
                        (0, params.as_entire_binding()),
                        (2, pyramid.as_entire_binding()),
                        (3, stand_in.unwrap_or(stale).as_entire_binding()),
                    ],
                );
                push.dispatch(&mut pass, &[&group], tiles(fine.size));
            }
        }
        let finished_bytes = u64::from(settings.size[0]) * u64::from(settings.size[1]) * 16;
        let finished = wgpu::BufferBinding { buffer: pyramid, offset: 0, size: wgpu::BufferSize::new(finished_bytes) };
        let group = present.bind(
            device,
            0,
            &[(0, upload(base).as_entire_binding()), (1, wgpu::BindingResource::Buffer(finished))],
        );
        present.cover(encoder, target, &group, None);
        self.last = Some(settings.projection);
        Ok(())
    }

    fn params(
        &self,
        film: &FilmOptions,
        world_from_film: Quat,
        quanta_to_radiance: f32,
        settings: &ViewSettings,
    ) -> ViewParams {
        let film_from_world = layout::columns(Mat3::from_quat(world_from_film.inverse()));
        let mut params = ViewParams {
            kind: codes::VIEW_EQUIRECT,
            size: settings.size,
            world_from_view: layout::columns(Mat3::IDENTITY),
            film_from_world,
            view_half_extent: film.half_extent(),
            film_half_extent: film.half_extent(),
            film_size: [film.width, film.height],
            quanta_to_radiance,
            confidence_samples: CONFIDENCE_SAMPLES,
            exposure: settings.exposure_ev.exp2(),
            tone_map: settings.tone_map as u32,
            debug_view: settings.debug_view as u32,
            debug_scale: 1.0 / DENSITY_STOPS,
            fill: u32::from(settings.fill),
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
