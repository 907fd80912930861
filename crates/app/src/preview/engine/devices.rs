//! The window's device and the one that traces, and the picture on its way from this to that.
//!
//! A device's queue does one thing after the other: the window's frames would wait behind a batch, and behind a kernel that
//! the driver compiles at its first dispatch. On a graphics card a batch takes a frame or less, and kernels are compiled on the
//! engine's thread. On a CPU adapter a batch takes up to a quarter of a second and a kernel seconds, so the film has a device
//! of its own there, and pictures are copied.

use anyhow::Context;
use tracer::gpu::{AdapterSelect, Gpu};

use super::Picture;
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

/// Puts pictures of other devices onto the window's.
pub(super) struct Screen {
    gpu: Gpu,
    shown: Option<(wgpu::Texture, Picture)>,
}

impl Screen {
    pub(super) fn new(window: Gpu) -> Self {
        Self { gpu: window, shown: None }
    }

    /// Texels as a picture of the window's device; `generation` is asked for a number where the texture is another.
    pub(super) fn show(
        &mut self,
        size: [u32; 2],
        texels: &[[u8; 4]],
        generation: impl FnOnce() -> u64,
    ) -> anyhow::Result<Picture> {
        let fits = |(texture, _): &(wgpu::Texture, Picture)| [texture.width(), texture.height()] == size;
        if !self.shown.as_ref().is_some_and(fits) {
            let texture = readback::upload_texture(&self.gpu, size);
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            self.shown = Some((texture, Picture { texture: view, generation: generation() }));
        }
        let (texture, picture) = self.shown.as_ref().context("made above")?;
        readback::write_texture(&self.gpu, texture, texels);
        Ok(picture.clone())
    }

    /// What was shown last: its size and texels. Waits for the window's device.
    pub(super) fn texels(&self) -> anyhow::Result<([u32; 2], Vec<[u8; 4]>)> {
        let (texture, _) = self.shown.as_ref().context("there is no picture yet")?;
        Ok(([texture.width(), texture.height()], readback::read_texture(&self.gpu, texture)?))
    }
}
