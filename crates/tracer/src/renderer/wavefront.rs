//! The wavefront schedule: paths lie in memory between small kernels, and those that go on are queued without gaps.

use std::ops::Range;

use super::{
    LARGEST_BATCH,
    schedule::{PathBatch, Stage},
    timing::Timestamps,
};
use crate::{
    film::{ReadError, read_ranges},
    gpu::Gpu,
    kernels::{
        Kernel, QUEUE_HEADER_WORDS,
        layout::{PathState, QueueTurn},
    },
};

/// Rounds that a batch is submitted with at most. Russian roulette leaves few paths by then.
pub(super) const MOST_ROUNDS: u32 = 32;
/// Rounds beyond one a segment of the bounces, in scenes whose clear sheets make segments that are no bounces.
const ROUNDS_FOR_SHEETS: u32 = 4;
/// Rounds that are submitted together for the paths that are left.
pub(super) const FURTHER_ROUNDS: u32 = 16;

/// First word of one of the two queues.
const fn first_word(queue: u32) -> u32 {
    queue * (QUEUE_HEADER_WORDS + LARGEST_BATCH)
}

/// What lies in memory between kernels. Renderers on one device share it: their batches follow each other.
#[derive(Clone, Debug)]
pub(super) struct PathBuffers {
    states: wgpu::Buffer,
    queues: wgpu::Buffer,
    /// A queue's, copied: a buffer of a dispatch's arguments cannot be written by that dispatch.
    workgroups: wgpu::Buffer,
    /// Reading the first queue and appending to the second, and the other way round.
    turns: [wgpu::Buffer; 2],
}

impl PathBuffers {
    pub fn new(gpu: &Gpu) -> Self {
        let buffer = |label, size: u64, usage| {
            let usage = usage | wgpu::BufferUsages::STORAGE;
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let copied = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let no_workgroups = [0_u32, 1, 1];
        let arguments = wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::COPY_DST;
        let state_bytes = u64::from(LARGEST_BATCH) * size_of::<PathState>() as u64;
        Self {
            states: buffer("path states", state_bytes, wgpu::BufferUsages::empty()),
            queues: buffer("path queues", u64::from(first_word(2)) * 4, copied),
            workgroups: gpu.buffer("workgroups of a path queue", bytemuck::bytes_of(&no_workgroups), arguments),
            turns: [0, 1].map(|reads| {
                let turn = QueueTurn { read_from: first_word(reads), append_to: first_word(1 - reads) };
                gpu.buffer("turn of the path queues", bytemuck::bytes_of(&turn), wgpu::BufferUsages::UNIFORM)
            }),
        }
    }
}

/// A stage with the bind groups of the path buffers, by the queue that is read.
#[derive(Debug)]
struct QueueStage {
    stage: Stage,
    turns: [Option<wgpu::BindGroup>; 2],
}

impl QueueStage {
    fn new(device: &wgpu::Device, stage: Stage, buffers: &PathBuffers) -> Self {
        let turns = buffers.turns.each_ref().map(|turn| {
            let resources = [
                (0, turn.as_entire_binding()),
                (1, buffers.states.as_entire_binding()),
                (2, buffers.queues.as_entire_binding()),
            ];
            stage.kernel.bind(device, 2, &resources)
        });
        Self { stage, turns }
    }
}

/// The kernels of the wavefront schedule.
#[derive(Debug)]
pub(super) struct Wavefront {
    start: QueueStage,
    extend: QueueStage,
    shade: QueueStage,
    /// Paths may have more segments than there are rounds at first.
    pub may_outlive: bool,
    buffers: PathBuffers,
}

impl Wavefront {
    /// `stages` start, extend and shade.
    pub fn new(device: &wgpu::Device, stages: [Stage; 3], may_outlive: bool, buffers: PathBuffers) -> Self {
        let [start, extend, shade] = stages.map(|stage| QueueStage::new(device, stage, &buffers));
        Self { start, extend, shade, may_outlive, buffers }
    }

    pub fn stages_mut(&mut self) -> impl Iterator<Item = &mut Stage> {
        [&mut self.start, &mut self.extend, &mut self.shade].map(|stage| &mut stage.stage).into_iter()
    }

    /// Rounds that [`Wavefront::record`] records. A path without clear sheets has a segment more than bounces.
    pub fn first_rounds(&self, batch: PathBatch) -> u32 {
        let spare = if self.may_outlive { ROUNDS_FOR_SHEETS } else { 0 };
        batch.max_bounces.saturating_add(1 + spare).min(MOST_ROUNDS)
    }

    /// Passes of rounds.
    pub fn passes(rounds: Range<u32>) -> u32 {
        2 * (rounds.end - rounds.start)
    }

    /// Starts a batch, and the first rounds.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, batch: PathBatch, timestamps: &mut Timestamps) {
        self.empty(encoder, 0);
        let mut pass = timestamps.next_pass(encoder, Kernel::Start, self.start.stage.kernel.label());
        // What reads the second queue appends to the first.
        self.start.stage.dispatch(&mut pass, &self.start.turns[1], batch.samples);
        drop(pass);
        self.record_rounds(encoder, 0..self.first_rounds(batch), timestamps);
    }

    /// Extends and shades the queued paths; rounds count from a batch's start.
    pub fn record_rounds(&self, encoder: &mut wgpu::CommandEncoder, rounds: Range<u32>, timestamps: &mut Timestamps) {
        for round in rounds {
            let reads = round % 2;
            let workgroups = u64::from(first_word(reads) + 1) * 4;
            encoder.copy_buffer_to_buffer(&self.buffers.queues, workgroups, &self.buffers.workgroups, 0, 4);
            self.empty(encoder, 1 - reads);
            for (kernel, stage) in [(Kernel::Extend, &self.extend), (Kernel::Shade, &self.shade)] {
                let mut pass = timestamps.next_pass(encoder, kernel, stage.stage.kernel.label());
                stage.stage.dispatch_indirect(&mut pass, &stage.turns[reads as usize], &self.buffers.workgroups);
            }
        }
    }

    fn empty(&self, encoder: &mut wgpu::CommandEncoder, queue: u32) {
        let (first, bytes) = (u64::from(first_word(queue)) * 4, u64::from(QUEUE_HEADER_WORDS) * 4);
        encoder.clear_buffer(&self.buffers.queues, first, Some(bytes));
    }

    /// How many paths are queued for a round; waits for the device.
    pub fn paths_left(&self, gpu: &Gpu, round: u32) -> Result<u32, ReadError> {
        let count = (&self.buffers.queues, u64::from(first_word(round % 2)) * 4, 4);
        Ok(read_ranges(gpu, &[count])?.first().copied().unwrap_or(0))
    }
}
