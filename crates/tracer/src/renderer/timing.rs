//! Seconds of device time by timestamp queries.

use super::{RenderError, Renderer};
use crate::{film::read_buffer, gpu::Gpu};

/// Seconds that the device took for one batch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchSeconds {
    /// The path kernel: rays are generated, traced and shaded in one dispatch.
    pub trace: f64,
    /// Adding its samples to the film.
    pub accumulate: f64,
}

/// Timestamps in one submission; nothing where the adapter has none.
struct Timestamps {
    set: Option<wgpu::QuerySet>,
    count: u32,
}

impl Timestamps {
    fn new(gpu: &Gpu, label: &str, count: u32) -> Self {
        let has_timestamps = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let set = has_timestamps.then(|| {
            let ty = wgpu::QueryType::Timestamp;
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label: Some(label), ty, count })
        });
        Self { set, count }
    }

    /// A pass that notes the time when it begins and when it ends, where asked for.
    fn pass<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        label: &str,
        begin: Option<u32>,
        end: Option<u32>,
    ) -> wgpu::ComputePass<'a> {
        let timestamp_writes = self.set.as_ref().map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: begin,
            end_of_pass_write_index: end,
        });
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes })
    }

    /// Submits what was recorded and waits for it. Seconds from the first timestamp to each.
    fn submit(&self, gpu: &Gpu, mut encoder: wgpu::CommandEncoder) -> Result<Option<Vec<f64>>, RenderError> {
        let Some(set) = &self.set else {
            gpu.queue.submit([encoder.finish()]);
            gpu.wait().map_err(|_| RenderError::DeviceLost)?;
            return Ok(None);
        };
        let times = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: u64::from(self.count) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        encoder.resolve_query_set(set, 0..self.count, &times, 0);
        gpu.queue.submit([encoder.finish()]);
        let ticks: Vec<u64> = read_buffer(gpu, &times)?;
        let period = f64::from(gpu.queue.get_timestamp_period()) * 1e-9;
        let start = ticks.first().copied().unwrap_or(0);
        Ok(Some(ticks.iter().map(|tick| tick.saturating_sub(start) as f64 * period).collect()))
    }
}

/// The last of the seconds since the first timestamp.
fn whole(seconds: Option<Vec<f64>>) -> Option<f64> {
    seconds.and_then(|seconds| seconds.last().copied())
}

impl Renderer {
    /// Runs one compute pass alone and waits for it. Returns the seconds that the device took, `None` where the adapter has no
    /// timestamps.
    pub(super) fn timed_pass(
        &self,
        label: &str,
        record: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) -> Result<Option<f64>, RenderError> {
        let timestamps = Timestamps::new(&self.gpu, label, 2);
        let mut encoder = self.encoder(label);
        record(&mut timestamps.pass(&mut encoder, label, Some(0), Some(1)));
        Ok(whole(timestamps.submit(&self.gpu, encoder)?))
    }

    /// Runs what `record` records alone and waits for it: for example [`Renderer::present`]. Returns the seconds that the device
    /// took, `None` where the adapter has no timestamps.
    ///
    /// # Errors
    /// Those of `record`, or a lost device.
    pub fn timed(
        &mut self,
        label: &str,
        record: impl FnOnce(&mut Self, &mut wgpu::CommandEncoder) -> Result<(), RenderError>,
    ) -> Result<Option<f64>, RenderError> {
        let timestamps = Timestamps::new(&self.gpu, label, 2);
        let mut encoder = self.encoder(label);
        // Passes without work: a timestamp can be taken at a pass's edge on every adapter, between passes on some.
        drop(timestamps.pass(&mut encoder, label, None, Some(0)));
        record(self, &mut encoder)?;
        drop(timestamps.pass(&mut encoder, label, Some(1), None));
        Ok(whole(timestamps.submit(&self.gpu, encoder)?))
    }

    /// As [`Renderer::trace`], but waits, with the seconds that the device took; `None` where the adapter has no timestamps.
    ///
    /// # Errors
    /// When there is no scene or the device is lost.
    pub fn trace_timed(&mut self, samples: u32) -> Result<(u32, Option<BatchSeconds>), RenderError> {
        let samples = self.next_batch(samples);
        self.write_params(samples)?;
        let bound = self.bound.as_ref().ok_or(RenderError::NoScene)?;
        let timestamps = Timestamps::new(&self.gpu, "timed batch", 4);
        let mut encoder = self.encoder("timed batch");
        bound.trace_in(&mut timestamps.pass(&mut encoder, bound.trace.label(), Some(0), Some(1)), samples);
        bound.accumulate_in(&mut timestamps.pass(&mut encoder, "film::accumulate", Some(2), Some(3)), samples);
        let seconds = timestamps.submit(&self.gpu, encoder)?;
        self.samples += u64::from(samples);
        self.next_sample += u64::from(samples);
        let parts = seconds.as_deref().and_then(|at| match at {
            [_, traced, before, after] => Some(BatchSeconds { trace: *traced, accumulate: after - before }),
            _ => None,
        });
        Ok((samples, parts))
    }
}
