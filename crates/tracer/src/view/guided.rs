//! What a guided view has beside the pyramid. Twins: `shaders/view/guide.wesl`, `tie_pull.wesl`, `tie_push.wesl` (once for a view),
//! `demodulate.wesl`, `guided_pull.wesl`, `guided_push.wesl` (for every picture).
//!
//! The method is pull-push as without guides, with four differences. What is averaged is the light on the surfaces, without their
//! colour (as in SVGF, Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering"). A coarse pixel stands for one surface, and
//! gives to and takes from places that are alike in normal and tangent plane. The variance of samples comes along, from the film's
//! second moments, pooled with that of the coarser level. And a level's own mean is weighed against its surroundings by shrinkage:
//! its weight is signal / (signal + noise), where noise is the variance over the samples, and signal is what the two differ by beyond
//! noise, what places around differ by at the next coarser level, what the surroundings are unsure of, and at least what the surface
//! may vary. So the width follows density and variance, and with many samples the view becomes the film.

use super::HitsOf;
use crate::{
    features::Feature,
    gpu::Gpu,
    kernels::{KernelKey, layout::Guide},
};

/// As large as the pyramid, level by level.
#[derive(Debug)]
pub(super) struct Guides {
    /// The first hits that they were made of.
    pub of: HitsOf,
    /// Until the ties are made.
    guides: Option<wgpu::Buffer>,
    ties: wgpu::Buffer,
    moments: wgpu::Buffer,
}

impl Guides {
    /// For a pyramid of so many texels.
    pub fn new(gpu: &Gpu, texels: u64, of: HitsOf) -> Self {
        let buffer = |label, bytes: u64| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: texels * bytes,
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let guides = Some(buffer("guides", size_of::<Guide>() as u64));
        Self { of, guides, ties: buffer("ties", 8), moments: buffer("moments", 8) }
    }

    /// The ties are still to be made.
    pub fn are_untied(&self) -> bool {
        self.guides.is_some()
    }

    /// What ties are made of, once.
    pub fn take_untied(&mut self) -> Option<wgpu::Buffer> {
        self.guides.take()
    }

    /// Ties and moments.
    pub fn buffers(&self) -> (&wgpu::Buffer, &wgpu::Buffer) {
        (&self.ties, &self.moments)
    }
}

/// The key of a kernel that does more for a guided view.
pub(super) fn with_guides(key: KernelKey, is_guided: bool) -> KernelKey {
    KernelKey { features: key.features.with(Feature::Guided, is_guided), ..key }
}
