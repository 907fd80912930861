//! The other film of a comparison: the same scene from the same place in another mode, with as much time.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use fovea_sampler::Inverse;
use tracer::distribution::Distribution;
use tracer::renderer::Renderer;
use tracer::view::{ViewSettings, ViewTarget};

use super::super::compare::BesideReadout;
use super::super::engine::{Look, Picture};
use super::{Open, Tracing};
use crate::attention::Attention;
use crate::cli::choices::Mode;
use crate::convergence::{AROUND_RADIUS_PX, Block};
use crate::film::FilmPlan;
use crate::readback;
use crate::sampling::Aim;

/// A film beside the first.
pub(super) struct Side {
    renderer: Renderer,
    /// The first film's mode and this one's; `None` before the comparison begins.
    modes: Option<[Mode; 2]>,
    /// What the distribution was made for.
    aimed: Option<(Aim, Option<(Attention, FilmPlan)>)>,
    traced: Duration,
    block: Block,
}

impl Side {
    /// Time spent tracing since the film started.
    pub fn traced(&self) -> Duration {
        self.traced
    }

    /// As [`Tracing::trace`].
    pub fn trace(&mut self, samples: u32) -> anyhow::Result<(u32, Duration)> {
        let start = Instant::now();
        let traced = self.renderer.trace(samples)?;
        self.renderer.gpu().wait()?;
        let took = start.elapsed();
        self.traced += took;
        Ok((traced, took))
    }

    /// Goes on with the scene that the first film's renderer has now.
    pub fn follow_scene(&mut self, first: &Renderer) -> anyhow::Result<()> {
        self.traced = Duration::ZERO;
        Ok(self.renderer.share_scene_of(first)?)
    }

    /// As [`Renderer::set_smoothing`].
    pub fn set_smoothing(&mut self, samples: f32) {
        self.renderer.set_smoothing(samples);
    }

    /// Empties the film.
    pub fn restart(&mut self) {
        self.renderer.restart();
        self.traced = Duration::ZERO;
    }

    /// Brings film and pose in line with the first film's.
    fn follow(&mut self, first: &Renderer) -> anyhow::Result<()> {
        if self.renderer.options().film != first.options().film {
            self.renderer.set_film(first.options().film)?;
            self.traced = Duration::ZERO;
        }
        if self.renderer.pose() != first.pose() {
            self.renderer.set_pose(first.pose());
            self.traced = Duration::ZERO;
        }
        Ok(())
    }
}

impl Tracing {
    /// Brings the comparison in line with what the window shows. Both films start anew when it begins and when one of the modes
    /// changes, so that each holds samples of its mode alone, of equal time.
    pub(super) fn follow_comparison(&mut self, look: &Look, aim: Aim, inverse: &Arc<Inverse>) -> anyhow::Result<()> {
        let Some(comparison) = look.controls.comparison else {
            self.beside = None;
            return Ok(());
        };
        let Some(Open { renderer: Some(first), plan: Some(plan), .. }) = &mut self.open else { return Ok(()) };
        let modes = Some([look.controls.mode, comparison.mode]);
        let aim = Aim { mode: comparison.mode, ..aim };
        let side = match &mut self.beside {
            Some(side) => side,
            none => {
                let renderer = first.beside(Distribution::omnidirectional(Arc::clone(inverse)))?;
                none.insert(Side {
                    renderer,
                    modes: None,
                    aimed: None,
                    traced: Duration::ZERO,
                    block: Block::default(),
                })
            }
        };
        side.follow(first)?;
        side.renderer.set_adaptive(look.controls.adaptive);
        if side.modes != modes {
            side.modes = modes;
            first.restart_clean();
            side.renderer.restart_clean();
            (self.traced, side.traced) = (Duration::ZERO, Duration::ZERO);
        }
        let is_aimed = side.aimed.as_ref().is_some_and(|(last, with)| !last.differs(&aim) && *with == self.attention);
        if !is_aimed || !Arc::ptr_eq(side.renderer.distribution().inverse(), inverse) {
            let mode = aim.distribution(&plan.options, plan.world_from_film, inverse);
            side.renderer.set_distribution(look.controls.attention.mixed(mode, &self.wanted_pixels))?;
            side.aimed = Some((aim, self.attention.clone()));
        }
        Ok(())
    }

    /// Draws the other film's picture over its part of the first one's. What is not of a film is the same in both.
    pub(super) fn present_beside(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        look: &Look,
        settings: &ViewSettings,
        picture: &Picture,
    ) -> anyhow::Result<()> {
        let (Some(side), Some(comparison)) = (&mut self.beside, look.controls.comparison) else { return Ok(()) };
        let [width, height] = settings.size;
        let left = comparison.first_pixel(width);
        if left >= width || settings.debug_view.shows_first_hits() {
            return Ok(());
        }
        let part = Some([left, 0, width - left, height]);
        let target = ViewTarget { view: &picture.texture, format: readback::PICTURE_FORMAT, part };
        Ok(side.renderer.present_to(encoder, settings, &target)?)
    }

    /// Reads the other film about a direction.
    pub(super) fn read_beside(&mut self, direction: glam::Vec3) -> anyhow::Result<()> {
        if let Some(side) = &mut self.beside {
            side.block = Block::new(&side.renderer.pixels_near(direction, AROUND_RADIUS_PX)?);
        }
        Ok(())
    }

    /// Figures of the other film.
    pub(super) fn beside_readout(&self) -> Option<BesideReadout> {
        let side = self.beside.as_ref()?;
        Some(BesideReadout {
            mode: side.modes?[1],
            samples: side.renderer.samples(),
            traced: side.traced,
            error: side.block.error,
        })
    }

    /// Samples in all films that are traced.
    pub fn samples_of_all(&self) -> u64 {
        self.samples() + self.beside.as_ref().map_or(0, |side| side.renderer.samples())
    }

    /// The renderer of the other film, while two are compared.
    ///
    /// # Errors
    /// When none are.
    pub fn renderer_beside(&mut self) -> anyhow::Result<&mut Renderer> {
        self.beside.as_mut().map(|side| &mut side.renderer).context("nothing is compared")
    }
}
