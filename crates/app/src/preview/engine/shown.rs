//! The picture on screen, and when it is time for another.

use std::time::Instant;

use super::motion::SEEN_SMOOTHER;
use super::{Look, Worker};

/// The picture on screen.
pub(super) struct Shown {
    pub(super) look: Look,
    /// In the film at that time.
    pub(super) samples: u64,
    /// Pixels a texel along each axis.
    pub(super) coarseness: u32,
    /// Samples at which a pixel counts as much as what is around it.
    pub(super) smoothing: f32,
    /// As [`Tracing::is_guided`] had it.
    pub(super) is_guided: Option<bool>,
    pub(super) at: Instant,
}

impl Worker {
    /// A picture is due when what it shows has changed, or when its share of the time has come.
    pub(super) fn is_due(&self, look: &Look) -> bool {
        let Some(shown) = &self.shown else { return true };
        let last = &shown.look;
        let now = Instant::now();
        shown.coarseness > self.motion.coarseness(now, self.show_time)
            || look.controls.paused
                && shown.smoothing > SEEN_SMOOTHER * self.motion.smoothing(now, self.tracing.samples(), look.size_px)
            || last.standpoint != look.standpoint
            || last.size_px != look.size_px
            || last.controls != look.controls
            || self.tracing.is_unfinished()
            || shown.is_guided != self.tracing.is_guided(look)
            || look.controls.paused && shown.is_guided == Some(false)
            || shown.samples != self.tracing.samples()
                && shown.at.elapsed() >= self.pacing.show_interval(self.show_time)
    }
}
