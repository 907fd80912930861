//! How the kernels share the work of a batch's paths.

use std::{ops::Range, sync::Arc};

use super::{
    RenderError, Renderer,
    batch::{trace_groups, workgroups},
    timing::Timestamps,
    wavefront::{FURTHER_ROUNDS, MOST_ROUNDS, PathBuffers, Wavefront},
};
use crate::{
    features::Feature,
    gpu::Gpu,
    kernels::{Kernel, pipelines::Pipeline},
    upload::SceneOnGpu,
};

/// How kernels share the work of a path. The film is the same by both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Schedule {
    /// One kernel traces each path to its end: nothing lies in memory meanwhile, and lanes whose paths have ended wait for others.
    #[default]
    Megakernel,
    /// Paths advance together, a segment a round: one kernel extends them and another shades. Those that go on are queued without
    /// gaps for the next round; they lie in memory between kernels.
    Wavefront,
}

impl Schedule {
    /// What is used on adapters of this kind unless asked otherwise: the wavefront on lavapipe of Mesa 22 and the megakernel
    /// elsewhere, by what measured faster (docs/ARCHITECTURE.md has the figures). No graphics card was among the adapters.
    pub fn preferred_on(gpu: &Gpu) -> Self {
        if gpu.is_lavapipe_22() { Self::Wavefront } else { Self::Megakernel }
    }

    /// The other one.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Megakernel => Self::Wavefront,
            Self::Wavefront => Self::Megakernel,
        }
    }

    /// The kernels that trace paths.
    pub const fn kernels(self) -> &'static [Kernel] {
        match self {
            Self::Megakernel => &[Kernel::Trace],
            Self::Wavefront => &[Kernel::Start, Kernel::Extend, Kernel::Shade],
        }
    }

    /// Its name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Megakernel => "megakernel",
            Self::Wavefront => "wavefront",
        }
    }
}

/// Samples whose paths are traced, and how far.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathBatch {
    pub samples: u32,
    /// As the batch's parameters say.
    pub max_bounces: u32,
}

/// A kernel with the bind groups of the batch and the scene.
#[derive(Debug)]
pub(super) struct Stage {
    pub kernel: Arc<Pipeline>,
    groups: [Option<wgpu::BindGroup>; 2],
}

impl Stage {
    /// `batch` is parameters, records, pixel list.
    pub fn new(device: &wgpu::Device, kernel: Arc<Pipeline>, scene: &SceneOnGpu, batch: [&wgpu::Buffer; 3]) -> Self {
        let groups = trace_groups(device, &kernel, scene, batch);
        Self { kernel, groups }
    }

    pub fn rebind(&mut self, device: &wgpu::Device, scene: &SceneOnGpu, batch: [&wgpu::Buffer; 3]) {
        self.groups = trace_groups(device, &self.kernel, scene, batch);
    }

    /// An invocation for each sample.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, queues: &Option<wgpu::BindGroup>, samples: u32) {
        self.kernel.dispatch(pass, &[&self.groups[0], &self.groups[1], queues], workgroups(samples));
    }

    /// As many workgroups as `arguments` say.
    pub fn dispatch_indirect(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        queues: &Option<wgpu::BindGroup>,
        arguments: &wgpu::Buffer,
    ) {
        self.kernel.dispatch_indirect(pass, &[&self.groups[0], &self.groups[1], queues], arguments);
    }
}

/// The kernels that trace paths, by schedule.
#[derive(Debug)]
pub(super) enum PathKernels {
    Megakernel(Stage),
    Wavefront(Box<Wavefront>),
}

impl PathKernels {
    pub fn rebind(&mut self, device: &wgpu::Device, scene: &SceneOnGpu, batch: [&wgpu::Buffer; 3]) {
        match self {
            Self::Megakernel(stage) => stage.rebind(device, scene, batch),
            Self::Wavefront(wavefront) => {
                wavefront.stages_mut().for_each(|stage| stage.rebind(device, scene, batch));
            }
        }
    }

    /// Passes that [`PathKernels::record`] makes.
    pub fn passes(&self, batch: PathBatch) -> u32 {
        match self {
            Self::Megakernel(_) => 1,
            Self::Wavefront(wavefront) => 1 + Wavefront::passes(0..wavefront.first_rounds(batch)),
        }
    }

    /// Traces paths into the sample records; all of them to their ends, unless they may outlive the rounds of a wavefront.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, batch: PathBatch, timestamps: &mut Timestamps) {
        match self {
            Self::Megakernel(stage) => {
                let label = stage.kernel.label();
                stage.dispatch(&mut timestamps.next_pass(encoder, Kernel::Trace, label), &None, batch.samples);
            }
            Self::Wavefront(wavefront) => wavefront.record(encoder, batch, timestamps),
        }
    }

    /// The wavefront, where paths may be left after [`PathKernels::record`].
    pub fn unfinished(&self) -> Option<&Wavefront> {
        match self {
            Self::Wavefront(wavefront) if wavefront.may_outlive => Some(wavefront),
            _ => None,
        }
    }
}

impl Renderer {
    /// Lets the kernels share their work otherwise than what measured faster on the adapter, from now on. The film goes on: it
    /// holds the same by either.
    ///
    /// # Errors
    /// When the kernels do not compose or compile; the last schedule then stays.
    pub fn set_schedule(&mut self, schedule: Schedule) -> Result<(), RenderError> {
        if schedule == self.schedule {
            return Ok(());
        }
        let before = std::mem::replace(&mut self.schedule, schedule);
        let result = if self.scene.is_some() { self.bind() } else { Ok(()) };
        if result.is_err() {
            self.schedule = before;
        }
        result
    }

    /// How the kernels share the work.
    pub fn schedule(&self) -> Schedule {
        self.schedule
    }

    /// Kernels of the present scene and schedule.
    pub(super) fn path_kernels(&mut self) -> Result<PathKernels, RenderError> {
        if self.schedule == Schedule::Megakernel {
            return Ok(PathKernels::Megakernel(self.stage(Kernel::Trace)?));
        }
        let stages = [self.stage(Kernel::Start)?, self.stage(Kernel::Extend)?, self.stage(Kernel::Shade)?];
        let has_sheets = self.scene.as_ref().is_some_and(|scene| scene.features.contains(Feature::ClearSheets));
        let may_outlive = has_sheets || self.options.max_bounces >= MOST_ROUNDS;
        let buffers = self.path_buffers.get_or_insert_with(|| PathBuffers::new(&self.gpu));
        let wavefront = Wavefront::new(&self.gpu.device, stages, may_outlive, buffers.clone());
        Ok(PathKernels::Wavefront(Box::new(wavefront)))
    }

    fn stage(&mut self, kernel: Kernel) -> Result<Stage, RenderError> {
        let key = self.key(kernel);
        let scene = self.scene.as_ref().ok_or(RenderError::NoScene)?;
        let pipeline = self.pipelines.compute(&self.gpu.device, &key)?;
        Ok(Stage::new(&self.gpu.device, pipeline, scene, [&self.params[0], &self.records, &self.pixel_list]))
    }

    /// Submits one batch: traces it, and adds it to every slab. Waits where paths may outlive the rounds of a wavefront.
    pub(super) fn submit_batch(&self, batch: PathBatch) -> Result<(), RenderError> {
        let bound = self.bound.as_ref().ok_or(RenderError::NoScene)?;
        let mut encoder = self.encoder("batch");
        bound.paths.record(&mut encoder, batch, &mut Timestamps::none());
        if bound.paths.unfinished().is_some() {
            let traced = std::mem::replace(&mut encoder, self.encoder("batch"));
            self.gpu.queue.submit([traced.finish()]);
            self.finish_paths(batch, |wavefront, rounds| self.submit_rounds(wavefront, rounds))?;
        }
        let label = Some(bound.accumulate.label());
        let descriptor = wgpu::ComputePassDescriptor { label, timestamp_writes: None };
        bound.accumulate_in(&mut encoder.begin_compute_pass(&descriptor), batch.samples);
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Traces without adding to the film: the records are for the host.
    pub(super) fn submit_paths(&self, batch: PathBatch) -> Result<(), RenderError> {
        let bound = self.bound.as_ref().ok_or(RenderError::NoScene)?;
        let mut encoder = self.encoder("paths");
        bound.paths.record(&mut encoder, batch, &mut Timestamps::none());
        self.gpu.queue.submit([encoder.finish()]);
        self.finish_paths(batch, |wavefront, rounds| self.submit_rounds(wavefront, rounds))
    }

    fn submit_rounds(&self, wavefront: &Wavefront, rounds: Range<u32>) -> Result<(), RenderError> {
        let mut encoder = self.encoder("further rounds");
        wavefront.record_rounds(&mut encoder, rounds, &mut Timestamps::none());
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Has further rounds submitted for as long as paths are left; waits for the device to know.
    pub(super) fn finish_paths(
        &self,
        batch: PathBatch,
        mut submit: impl FnMut(&Wavefront, Range<u32>) -> Result<(), RenderError>,
    ) -> Result<(), RenderError> {
        let Some(wavefront) = self.bound.as_ref().and_then(|bound| bound.paths.unfinished()) else { return Ok(()) };
        let mut done = wavefront.first_rounds(batch);
        while wavefront.paths_left(&self.gpu, done)? > 0 {
            submit(wavefront, done..done + FURTHER_ROUNDS)?;
            done += FURTHER_ROUNDS;
        }
        Ok(())
    }
}
