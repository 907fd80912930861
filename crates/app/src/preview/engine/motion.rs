//! What is different about the picture while the view moves or an object is dragged: it is drawn coarser where drawing is slow,
//! and smoother, since there are few samples in it; both until a little after it has come to rest.

use std::time::{Duration, Instant};

use glam::UVec2;

use crate::preview::tracing::{COARSENESS, SMOOTHING_WHILE_MOVING};

/// How long after the last movement the picture is drawn in full again.
const SETTLED: Duration = Duration::from_millis(250);
/// In which time from then on the smoothing ends, if there are enough samples.
const SHARPENS: Duration = Duration::from_millis(2200);
/// Samples for each pixel of the view, on average, that are enough.
const ENOUGH: f64 = 0.5;
/// A picture that takes longer than this is drawn coarser while it moves.
const SMOOTH_ENOUGH: Duration = Duration::from_millis(30);
/// A picture that is smoother by this factor than it should be is drawn again, where nothing else asks for that.
pub(super) const SEEN_SMOOTHER: f32 = 1.1;

/// When something moved last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion(Option<Instant>);

impl Motion {
    /// Something moves.
    pub fn moves(&mut self, now: Instant) {
        self.0 = Some(now);
    }

    fn since(&self, now: Instant) -> Option<Duration> {
        self.0.map(|at| now.saturating_duration_since(at))
    }

    /// Whether the picture moves, or moved just now.
    pub fn goes_on(&self, now: Instant) -> bool {
        self.since(now).is_some_and(|since| since < SETTLED)
    }

    /// Pixels a texel, along each axis, where drawing the picture in full takes so long.
    pub fn coarseness(&self, now: Instant, show_time: Duration) -> u32 {
        if self.goes_on(now) && show_time > SMOOTH_ENOUGH { COARSENESS } else { 1 }
    }

    /// As [`tracer::renderer::Renderer::set_smoothing`] has it, with so many samples in the film and a view of this size: 1 at
    /// rest. A slow adapter has made few samples after two seconds.
    pub fn smoothing(&self, now: Instant, samples: u64, size_px: UVec2) -> f32 {
        let Some(since) = self.since(now) else { return 1.0 };
        let samples = samples as f64 / size_px.as_dvec2().element_product().max(1.0);
        let rest = since.saturating_sub(SETTLED).as_secs_f32() / SHARPENS.as_secs_f32();
        let rest = rest.min((samples / ENOUGH) as f32).min(1.0);
        SMOOTHING_WHILE_MOVING.powf(1.0 - rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEW: UVec2 = UVec2::new(10, 10);

    #[test]
    fn what_comes_to_rest_becomes_fine_at_once_and_sharp_in_a_while() {
        let (start, slow) = (Instant::now(), Duration::from_millis(100));
        let mut motion = Motion::default();
        assert_eq!(
            (motion.goes_on(start), motion.coarseness(start, slow), motion.smoothing(start, 0, VIEW)),
            (false, 1, 1.0)
        );
        motion.moves(start);
        assert!(motion.goes_on(start));
        assert_eq!((motion.coarseness(start, slow), motion.coarseness(start, Duration::ZERO)), (2, 1));
        assert_eq!(motion.smoothing(start, 900, VIEW), SMOOTHING_WHILE_MOVING);
        let at = |secs: f32| start + Duration::from_secs_f32(secs);
        assert_eq!((motion.goes_on(at(0.3)), motion.coarseness(at(0.3), slow)), (false, 1));
        let steps: Vec<f32> = (0..10).map(|step| motion.smoothing(at(0.25 + 0.25 * step as f32), 900, VIEW)).collect();
        // No step is seen as one.
        assert!(steps.windows(2).all(|pair| pair[1] <= pair[0] && pair[0] / pair[1] < 1.5), "{steps:?}");
        assert_eq!(steps.last(), Some(&1.0));
        // Without samples there is nothing to be sharp.
        assert_eq!(motion.smoothing(at(100.0), 0, VIEW), SMOOTHING_WHILE_MOVING);
        assert!((1.5..SMOOTHING_WHILE_MOVING).contains(&motion.smoothing(at(100.0), 20, VIEW)));
    }
}
