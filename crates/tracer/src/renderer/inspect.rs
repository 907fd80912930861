//! What can be known about a view beside its colours: first hits and a histogram.

use glam::Mat3;

use super::{RenderError, Renderer, batch::scene_group};
use crate::{
    film::{FilmMapping, read_buffer},
    kernels::{
        Kernel, TILE_SIZE,
        layout::{self, FirstHit, FirstHitParams, codes},
    },
    view::{DebugScale, DebugView, FilmSource, FirstHits, Histogram, HitsOf, ViewProjection, ViewSettings, check_size},
};

impl Renderer {
    /// Goes on with tracing one ray through the centre of each pixel of a view: as many rows as have about `most_pixels` pixels,
    /// at least one. Waits for the device. Begins anew where view, place or scene are others than the last time. True when all
    /// rows are done. What was found stays until a view that does not show it is presented.
    ///
    /// # Errors
    /// When there is no scene, the view has more pixels than fit a binding, the kernel does not compile, or the device is lost.
    pub fn trace_first_hits(&mut self, settings: &ViewSettings, most_pixels: u32) -> Result<bool, RenderError> {
        let of = self.hits_of(settings);
        let gpu = self.gpu.clone();
        check_size(&gpu, of.size, size_of::<FirstHit>() as u64)?;
        let key = self.key(Kernel::FirstHit);
        let kernel = self.pipelines.compute(&gpu.device, &key)?;
        let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
        let hits = match self.view.hits.take() {
            Some(hits) if hits.of == of => hits,
            Some(hits) if hits.of.size == of.size => hits.anew(&gpu, of),
            _ => FirstHits::new(&gpu, of),
        };
        let hits = self.view.hits.insert(hits);
        let [width, height] = of.size;
        let rows = (most_pixels / width.max(1)).max(1).min(height - hits.rows);
        if rows == 0 {
            return Ok(true);
        }
        let params = first_hit_params(&of, hits.rows, rows);
        let params = gpu.buffer("first hits", bytemuck::bytes_of(&params), wgpu::BufferUsages::UNIFORM);
        let group = kernel.bind(
            &gpu.device,
            0,
            &[
                (0, params.as_entire_binding()),
                (1, hits.buffer.as_entire_binding()),
                (2, hits.ends.as_entire_binding()),
            ],
        );
        let scene_group = scene_group(&gpu.device, &kernel, scene);
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("first hits") });
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(kernel.label()),
                timestamp_writes: None,
            });
            let tiles = [width.div_ceil(TILE_SIZE), rows.div_ceil(TILE_SIZE)];
            kernel.dispatch(&mut pass, &[&group, &scene_group], tiles);
        }
        gpu.queue.submit([encoder.finish()]);
        hits.advance(&gpu, rows)?;
        Ok(hits.rows == height)
    }

    /// What [`Renderer::trace_first_hits`] has found, row by row from the top, as far as it has come. Waits for the device.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn first_hits(&self) -> Result<Vec<FirstHit>, RenderError> {
        let Some(hits) = &self.view.hits else { return Ok(Vec::new()) };
        let mut all: Vec<FirstHit> = read_buffer(&self.gpu, &hits.buffer)?;
        all.truncate(hits.rows as usize * hits.of.size[0] as usize);
        Ok(all)
    }

    /// Whether a view shows first hits, or uses them as guides and the adapter can bind as many.
    pub fn wants_first_hits(&self, settings: &ViewSettings) -> bool {
        let fits = check_size(&self.gpu, settings.size, size_of::<FirstHit>() as u64).is_ok();
        settings.debug_view.shows_first_hits() || settings.uses_guides() && fits
    }

    /// Whether [`Renderer::trace_first_hits`] has found all that there is for a view.
    pub fn knows_first_hits(&self, settings: &ViewSettings) -> bool {
        let of = self.hits_of(settings);
        self.view.hits.as_ref().is_some_and(|hits| hits.of == of && hits.rows == of.size[1])
    }

    /// What the ends of a debug view's colours stand for, as it was presented last; `None` where it has no such scale, or nothing
    /// is known yet.
    pub fn debug_scale(&self, debug_view: DebugView) -> Option<DebugScale> {
        self.view.scale(debug_view)
    }

    /// Counts the pixels of the view that was presented last by luminance, with the exposure and tone map of `settings`; waits
    /// for the device. All counts are 0 before a view was presented.
    ///
    /// # Errors
    /// When the kernel does not compile or the device is lost.
    pub fn histogram(&mut self, settings: &ViewSettings) -> Result<Histogram, RenderError> {
        let key = self.key(Kernel::Histogram);
        let source = FilmSource::new(&self.film, self.pose.world_from_film, self.film_scales());
        self.view.histogram(&mut self.pipelines, &key, &source, settings)
    }

    /// First hits of another view than this are of no use to it.
    pub(super) fn drop_other_hits(&mut self, settings: &ViewSettings) {
        let of = self.hits_of(settings);
        self.view.hits.take_if(|hits| hits.of != of);
    }

    pub(super) fn hits_of(&self, settings: &ViewSettings) -> HitsOf {
        HitsOf {
            projection: settings.projection,
            size: settings.size,
            position: self.pose.position,
            world_from_film: self.pose.world_from_film,
            film: self.options.film,
            scene: self.scene_version,
        }
    }
}

/// Of a band of rows.
pub(super) fn first_hit_params(of: &HitsOf, first_row: u32, rows: u32) -> FirstHitParams {
    let (rotation, half_extent) = match of.projection {
        ViewProjection::Perspective(view) => (view.world_from_view, view.half_extent.to_array()),
        ViewProjection::Film => (of.world_from_film, of.film.half_extent()),
    };
    let is_panorama = of.projection == ViewProjection::Film && of.film.mapping == FilmMapping::Equirect;
    FirstHitParams {
        world_from_view: layout::columns(Mat3::from_quat(rotation)),
        half_extent,
        size: of.size,
        origin: of.position.to_array(),
        first_row,
        end_row: first_row + rows,
        kind: if is_panorama { codes::VIEW_EQUIRECT } else { codes::VIEW_PERSPECTIVE },
        pad_0: [0; 2],
    }
}
