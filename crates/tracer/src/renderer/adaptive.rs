//! Adaptive sampling: when noise is judged, on the device, and what becomes of it.

use super::{FIRST_BATCH, RenderError, Renderer, batch::workgroups};
use crate::{
    film::read_buffer,
    guide::{self, GUIDE_COLUMNS_PER_ROW, Guide},
    kernels::{Kernel, layout::CellNoise},
};

/// Noise is judged again when there are so many times as many samples: each guide begins the sequences of the pixels about the gaze anew.
const JUDGED_AGAIN: u64 = 4;

/// What the renderer knows about adaptive sampling.
#[derive(Debug, Default)]
pub(super) struct Adaptive {
    is_on: bool,
    /// Samples in the film when the distribution was set.
    since: u64,
    /// Samples in the film at which noise is judged next; `None` where that is still to be decided.
    next: Option<u64>,
    guide: Option<Guide>,
    /// Whether the guide was made from this film.
    is_own: bool,
    /// Samples in the film that went by such a guide.
    pub(super) steered: u64,
}

impl Renderer {
    /// Gives more samples, from now on, to where the film is visibly noisy, or no longer does. The film goes on.
    ///
    /// Noise is judged when the film holds enough samples about the gaze and the distribution has stayed the same for
    /// [`FIRST_BATCH`] of them, and again whenever those since then are four times as many; [`Renderer::trace`] then waits for the
    /// device. What is rendered does not depend on the batches. Counts that depend on the samples bias the mean, so
    /// [`RenderStatistics::steered`](super::RenderStatistics::steered) counts the samples whose place was chosen so.
    pub fn set_adaptive(&mut self, is_on: bool) {
        if self.adaptive.is_on != is_on {
            self.adaptive.is_on = is_on;
            self.drop_guide();
        }
    }

    /// Whether samples follow the noise of the film.
    pub fn is_adaptive(&self) -> bool {
        self.adaptive.is_on
    }

    /// Gives the cells of the distribution's unit square other densities, until the film restarts or the distribution or the choice
    /// of adaptive sampling changes. As long as the guide does not depend on samples of this film, its means stay unbiased.
    pub fn set_guide(&mut self, guide: Option<Guide>) {
        (self.adaptive.guide, self.adaptive.is_own) = (guide, false);
        self.sampling.forget();
    }

    /// How samples are moved between the cells of the distribution's unit square, where they are.
    pub fn guide(&self) -> Option<&Guide> {
        self.adaptive.guide.as_ref()
    }

    /// A guide by the noise of the film, for this distribution; `None` while the film knows too little. Waits for the device.
    ///
    /// # Errors
    /// When there is no scene, the kernel does not compile, or the device is lost.
    pub fn measure_guide(&mut self) -> Result<Option<Guide>, RenderError> {
        let film = &self.options.film;
        let rows = guide::rows(self.distribution.peak_share(film));
        let columns = rows * GUIDE_COLUMNS_PER_ROW;
        self.prepare_sampling(true)?;
        self.write_guided_params(0, rows)?;
        let gpu = self.gpu.clone();
        let key = self.key(Kernel::Noise);
        let kernel = self.pipelines.compute(&gpu.device, &key)?;
        let cells = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("noise of cells"),
            size: u64::from(columns * rows) * size_of::<CellNoise>() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = self.encoder(kernel.label());
        for (slab, params) in self.film.slabs.iter().zip(&self.params) {
            let resources = [(0, params), (2, &self.pixel_list), (3, &slab.buffer), (4, &cells)];
            let group = kernel.bind(&gpu.device, 0, &resources.map(|(at, buffer)| (at, buffer.as_entire_binding())));
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(kernel.label()),
                timestamp_writes: None,
            });
            kernel.dispatch(&mut pass, &[&group], workgroups(columns * rows));
        }
        gpu.queue.submit([encoder.finish()]);
        let noise: Vec<CellNoise> = read_buffer(&gpu, &cells)?;
        let middle = |column: u32| (column as f32 + 0.5) / columns as f32;
        let elements: Vec<f32> = (0..columns).map(|column| self.distribution.element_pixels(middle(column))).collect();
        Ok(Guide::from_noise(&noise, &elements, rows))
    }

    /// Judges the noise when it is time to.
    pub(super) fn follow_noise(&mut self) -> Result<(), RenderError> {
        if !self.adaptive.is_on {
            return Ok(());
        }
        let first = guide::first_samples(self.distribution.peak_share(&self.options.film));
        let since = self.adaptive.since;
        // What the film held before says enough; but a gaze that never rests is not to be judged again and again.
        let rested = since + u64::from(FIRST_BATCH);
        let next = *self.adaptive.next.get_or_insert(if since >= first { rested } else { first });
        if self.samples < next {
            return Ok(());
        }
        let guide = self.measure_guide()?;
        (self.adaptive.guide, self.adaptive.is_own) = (guide, true);
        let done = self.samples - since;
        self.adaptive.next = Some(since + if done < first { first } else { (JUDGED_AGAIN * done).next_power_of_two() });
        self.sampling.forget();
        Ok(())
    }

    /// Samples that may be traced before noise is judged again.
    pub(super) fn samples_until_judged(&self) -> u64 {
        let next = self.adaptive.next.filter(|_| self.adaptive.is_on);
        next.map_or(u64::MAX, |next| next.saturating_sub(self.samples).max(1))
    }

    /// Counts samples that were traced.
    pub(super) fn count_steered(&mut self, samples: u32) {
        if self.adaptive.is_own && self.adaptive.guide.is_some() {
            self.adaptive.steered += u64::from(samples);
        }
    }

    /// The density is the distribution's until noise is judged anew.
    pub(super) fn drop_guide(&mut self) {
        (self.adaptive.since, self.adaptive.next) = (self.samples, None);
        if self.adaptive.guide.take().is_some() {
            self.sampling.forget();
        }
    }
}
