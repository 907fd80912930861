//! The window's device and the one that traces, and the picture on its way from this to that.
//!
//! A device's queue does one thing after the other: the window's frames would wait behind a batch, and behind a kernel that
//! the driver compiles at its first dispatch. On a graphics card a batch takes a frame or less, and kernels are compiled on the
//! engine's thread. On a CPU adapter a batch takes up to a quarter of a second and a kernel seconds, so the film has a device
//! of its own there, and pictures are copied.

use std::sync::{Arc, Mutex};

use anyhow::Context;
use tracer::gpu::{AdapterSelect, Gpu};

use super::lock;
use super::priority::give_way;
use crate::readback;

/// The devices of a preview.
#[derive(Clone, Debug)]
pub struct Devices {
    /// Draws the window.
    pub window: Gpu,
    /// Has the film; the same one where frames need not wait for it.
    pub tracing: Gpu,
    /// Devices of two instances of wgpu may compare as equal.
    are_two: bool,
}

impl Devices {
    /// For a window's device: on a CPU adapter with a second one, if there can be one.
    pub fn beside(window: Gpu) -> Self {
        let select = AdapterSelect::Named(window.info().name.clone());
        let make = move || {
            // The adapter's threads inherit this.
            give_way();
            Gpu::headless(&select).ok()
        };
        let own = || std::thread::spawn(make).join().ok().flatten();
        // Without a second device frames wait, and all else works.
        let own = if window.is_software() { own() } else { None };
        Self { are_two: own.is_some(), tracing: own.unwrap_or_else(|| window.clone()), window }
    }

    /// Whether pictures must be copied from the one that traces to the window's.
    pub fn are_two(&self) -> bool {
        self.are_two
    }

    /// Whether one of them is gone, and all that was on it.
    pub fn is_lost(&self) -> bool {
        if self.are_two {
            // A device tells of its loss when it is polled, which tracing does of its own alone.
            let _ = self.window.device.poll(wgpu::PollType::Poll);
        }
        self.window.is_lost() || self.tracing.is_lost()
    }
}

impl From<Gpu> for Devices {
    /// One device for everything.
    fn from(gpu: Gpu) -> Self {
        Self { window: gpu.clone(), tracing: gpu, are_two: false }
    }
}

/// The picture on the window's device.
#[derive(Clone, Debug)]
pub struct Picture {
    /// 8-bit texels, encoded for the display.
    pub texture: wgpu::TextureView,
    /// Changes with the texture.
    pub generation: u64,
    /// Where it was made on another device.
    brought: Option<Arc<Brought>>,
}

/// Texels of another device, and the texture that they are for.
#[derive(Debug)]
struct Brought {
    texture: wgpu::Texture,
    waiting: Mutex<Option<Texels>>,
}

/// Row by row, shared.
type Texels = Arc<Vec<[u8; 4]>>;

impl Picture {
    /// One that was drawn on the window's device.
    pub(in super::super) fn drawn(texture: wgpu::TextureView, generation: u64) -> Self {
        Self { texture, generation, brought: None }
    }

    /// Fills the texture with what has come since the last time. For the window's thread: another one, which gives way to it, would
    /// hold the device's locks while it waits for its turn.
    pub fn bring(&self, queue: &wgpu::Queue) {
        let Some(brought) = &self.brought else { return };
        if let Some(texels) = lock(&brought.waiting).take() {
            readback::write_texture(queue, &brought.texture, &texels);
        }
    }
}

/// Hands pictures of other devices to the window's.
pub(super) struct Screen {
    gpu: Gpu,
    shown: Option<(Picture, Arc<Brought>, Texels)>,
}

impl Screen {
    pub(super) fn new(window: Gpu) -> Self {
        Self { gpu: window, shown: None }
    }

    /// Texels as a picture of the window's device; `generation` is asked for a number where the texture is another.
    pub(super) fn show(&mut self, size: [u32; 2], texels: Vec<[u8; 4]>, generation: impl FnOnce() -> u64) -> Picture {
        let fits = |(_, brought, _): &(Picture, Arc<Brought>, Texels)| {
            [brought.texture.width(), brought.texture.height()] == size
        };
        let (picture, brought) = match self.shown.take().filter(fits) {
            Some((picture, brought, _)) => (picture, brought),
            None => {
                let texture = readback::upload_texture(&self.gpu, size);
                let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
                let brought = Arc::new(Brought { texture, waiting: Mutex::new(None) });
                let picture = Picture { texture: view, generation: generation(), brought: Some(Arc::clone(&brought)) };
                (picture, brought)
            }
        };
        let texels = Arc::new(texels);
        *lock(&brought.waiting) = Some(Arc::clone(&texels));
        self.shown = Some((picture.clone(), brought, texels));
        picture
    }

    /// What was shown last: its size and texels.
    pub(super) fn texels(&self) -> anyhow::Result<([u32; 2], Texels)> {
        let (_, brought, texels) = self.shown.as_ref().context("there is no picture yet")?;
        Ok(([brought.texture.width(), brought.texture.height()], Arc::clone(texels)))
    }
}
