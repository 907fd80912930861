//! Seconds of device time by timestamp queries.

use super::{RenderError, Renderer, Schedule, wavefront::Wavefront};
use crate::{film::read_buffer, gpu::Gpu, kernels::Kernel};

/// Seconds that the device took for one batch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchSeconds {
    /// From the first path kernel's start to the last one's end: rays are generated, traced and shaded.
    pub trace: f64,
    /// Of it, by the kernels of the wavefront schedule.
    pub stages: Option<StageSeconds>,
    /// Adding its samples to the film.
    pub accumulate: f64,
}

/// Seconds of the wavefront schedule's kernels, summed over their dispatches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageSeconds {
    /// Pixels and primary rays.
    pub start: f64,
    /// Traversal of all further rays and of those.
    pub extend: f64,
    /// Shading.
    pub shade: f64,
}

/// Timestamps in one submission; nothing where the adapter has none.
pub(super) struct Timestamps {
    set: Option<wgpu::QuerySet>,
    count: u32,
    /// Those of [`Timestamps::next_pass`], two a pass.
    passes: Vec<Kernel>,
}

impl Timestamps {
    fn new(gpu: &Gpu, label: &str, count: u32) -> Self {
        let has_timestamps = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let set = has_timestamps.then(|| {
            let ty = wgpu::QueryType::Timestamp;
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label: Some(label), ty, count })
        });
        Self { set, count, passes: Vec::new() }
    }

    /// Passes note nothing.
    pub fn none() -> Self {
        Self { set: None, count: 0, passes: Vec::new() }
    }

    /// A pass of a kernel that notes both times in the next places.
    pub fn next_pass<'a>(
        &mut self,
        encoder: &'a mut wgpu::CommandEncoder,
        kernel: Kernel,
        label: &str,
    ) -> wgpu::ComputePass<'a> {
        let first = 2 * self.passes.len() as u32;
        self.passes.push(kernel);
        self.pass(encoder, label, Some(first), Some(first + 1))
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

/// Seconds of the passes of a submission.
struct PassSeconds {
    kernels: Vec<(Kernel, f64)>,
    /// From the first one's start to the last one's end.
    whole: f64,
}

impl PassSeconds {
    /// Sum over the passes of a kernel.
    fn of(&self, kernel: Kernel) -> f64 {
        self.kernels.iter().filter(|(own, _)| *own == kernel).fold(0.0, |sum, (_, seconds)| sum + seconds)
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
        self.follow_noise()?;
        let samples = self.next_batch(samples);
        self.write_params(samples)?;
        let bound = self.bound.as_ref().ok_or(RenderError::NoScene)?;
        let batch = self.path_batch(samples);
        let mut submissions = vec![
            self.timed_passes(bound.paths.passes(batch), |encoder, times| bound.paths.record(encoder, batch, times))?,
        ];
        self.finish_paths(batch, |wavefront, rounds| {
            let passes = Wavefront::passes(rounds.clone());
            submissions
                .push(self.timed_passes(passes, |encoder, times| wavefront.record_rounds(encoder, rounds, times))?);
            Ok(())
        })?;
        let accumulated = self.timed_passes(1, |encoder, times| {
            bound.accumulate_in(&mut times.next_pass(encoder, Kernel::Accumulate, bound.accumulate.label()), samples);
        })?;
        self.samples += u64::from(samples);
        self.next_sample += u64::from(samples);
        self.count_steered(samples);
        let Some(accumulated) = accumulated else { return Ok((samples, None)) };
        let traced: Vec<PassSeconds> = submissions.into_iter().flatten().collect();
        let of = |kernel| traced.iter().fold(0.0, |sum, passes| sum + passes.of(kernel));
        let stages = || StageSeconds { start: of(Kernel::Start), extend: of(Kernel::Extend), shade: of(Kernel::Shade) };
        let seconds = BatchSeconds {
            trace: traced.iter().map(|passes| passes.whole).sum(),
            stages: (self.schedule == Schedule::Wavefront).then(stages),
            accumulate: accumulated.whole,
        };
        Ok((samples, Some(seconds)))
    }

    /// Submits passes and waits for them; `None` where the adapter has no timestamps.
    fn timed_passes(
        &self,
        passes: u32,
        record: impl FnOnce(&mut wgpu::CommandEncoder, &mut Timestamps),
    ) -> Result<Option<PassSeconds>, RenderError> {
        let mut timestamps = Timestamps::new(&self.gpu, "timed passes", 2 * passes);
        let mut encoder = self.encoder("timed passes");
        record(&mut encoder, &mut timestamps);
        let seconds = timestamps.submit(&self.gpu, encoder)?;
        Ok(seconds.map(|at| PassSeconds {
            kernels: timestamps
                .passes
                .iter()
                .zip(at.chunks_exact(2))
                .map(|(&kernel, at)| (kernel, at[1] - at[0]))
                .collect(),
            whole: at.last().copied().unwrap_or(0.0),
        }))
    }
}
