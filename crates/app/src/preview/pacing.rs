//! How many samples a batch has: small after a change, growing while the frame rate allows.

use std::time::Duration;

/// The first batch after a change: small, so that the change shows at once.
pub const FIRST_BATCH: u32 = 1 << 14;
/// The first batch of all on an adapter that renders on the CPU, where nothing is known of the scene yet.
const FIRST_BATCH_ON_CPU: u32 = 1 << 12;
/// What the first batch after a change may take, where the scene's speed is known.
const RESPONSE: Duration = Duration::from_millis(30);
/// No batch is planned to take longer: graphics drivers reset a device that seems to hang.
const LONGEST_BATCH: Duration = Duration::from_millis(220);
/// What a frame may take where the adapter can.
const FRAME: Duration = Duration::from_millis(16);
/// A batch below this many samples is mostly overhead.
const SMALLEST_BATCH: u32 = 1 << 10;
/// On an adapter that renders on the CPU, tracing gets this many times the time that showing the picture takes.
const TRACE_OVER_SHOW: f64 = 4.0;

/// Chooses batch sizes from measured times.
#[derive(Clone, Copy, Debug)]
pub struct Pacing {
    /// The adapter is a CPU: showing a picture takes time from tracing it.
    software: bool,
    batch: u32,
    /// Of the last batch.
    samples_per_s: Option<f64>,
}

impl Pacing {
    /// For an adapter that renders on the CPU (`software`) or a graphics card.
    pub fn new(software: bool) -> Self {
        Self { software, batch: if software { FIRST_BATCH_ON_CPU } else { FIRST_BATCH }, samples_per_s: None }
    }

    /// Starts small again, after a change that should show at once.
    pub fn restart(&mut self) {
        let responsive = self.samples_per_s.map_or(u32::MAX, |rate| (rate * RESPONSE.as_secs_f64()) as u32);
        self.batch = self.batch.min(FIRST_BATCH).min(responsive.max(SMALLEST_BATCH));
    }

    /// Samples of the next batch.
    pub fn batch(&self) -> u32 {
        self.batch
    }

    /// How long a picture that takes `show` stays before a newer one replaces it, if nothing but samples changes.
    pub fn show_interval(&self, show: Duration) -> Duration {
        if self.software { show.mul_f64(1.0 + TRACE_OVER_SHOW).max(FRAME) } else { FRAME }
    }

    /// Takes in that the last batch of `samples` took `trace`, and that showing a picture takes `show`.
    pub fn measured(&mut self, samples: u32, trace: Duration, show: Duration) {
        let samples_per_s = f64::from(samples) / trace.as_secs_f64().max(1e-6);
        self.samples_per_s = Some(samples_per_s);
        let wanted = samples_per_s * self.target(show).as_secs_f64();
        let ceiling = self.batch.saturating_mul(2);
        // The cast saturates; the clamp below bounds what it gives.
        self.batch = (wanted as u32).clamp(SMALLEST_BATCH, ceiling.max(SMALLEST_BATCH));
    }

    /// How long a batch should take beside a picture that takes `show`.
    fn target(&self, show: Duration) -> Duration {
        if self.software {
            show.mul_f64(TRACE_OVER_SHOW).clamp(FRAME, LONGEST_BATCH)
        } else {
            FRAME.saturating_sub(show).clamp(FRAME / 4, FRAME)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Batches on an adapter of a constant rate, after `count` batches: (samples, seconds).
    fn settle(mut pacing: Pacing, samples_per_s: f64, show: Duration, count: usize) -> (u32, f64) {
        for _ in 0..count {
            let trace = Duration::from_secs_f64(f64::from(pacing.batch()) / samples_per_s);
            pacing.measured(pacing.batch(), trace, show);
        }
        (pacing.batch(), f64::from(pacing.batch()) / samples_per_s)
    }

    #[test]
    fn a_batch_at_most_doubles() {
        let mut pacing = Pacing::new(false);
        for doubling in 1..6 {
            pacing.measured(pacing.batch(), Duration::from_nanos(1), Duration::ZERO);
            assert_eq!(pacing.batch(), FIRST_BATCH << doubling);
        }
    }

    #[test]
    fn a_graphics_card_fills_the_frame_and_no_more() {
        let (_, seconds) = settle(Pacing::new(false), 5e8, Duration::from_millis(4), 20);
        assert!((seconds - 0.012).abs() < 1e-4, "{seconds}");
    }

    #[test]
    fn a_cpu_spends_four_fifths_of_its_time_tracing() {
        let (_, seconds) = settle(Pacing::new(true), 3e5, Duration::from_millis(40), 20);
        assert!((seconds - 0.16).abs() < 1e-3, "{seconds}");
    }

    #[test]
    fn no_batch_is_planned_beyond_the_limit() {
        let (_, seconds) = settle(Pacing::new(true), 3e5, Duration::from_secs(2), 20);
        assert!(seconds <= LONGEST_BATCH.as_secs_f64() + 1e-3, "{seconds}");
        let (samples, _) = settle(Pacing::new(true), 1.0, Duration::ZERO, 3);
        assert_eq!(samples, SMALLEST_BATCH);
    }

    #[test]
    fn a_slow_scene_answers_a_change_within_a_thirtieth_of_a_second() {
        let mut pacing = Pacing::new(true);
        for _ in 0..20 {
            let trace = Duration::from_secs_f64(f64::from(pacing.batch()) / 1e5);
            pacing.measured(pacing.batch(), trace, Duration::from_millis(50));
        }
        assert!(pacing.batch() > 10_000);
        pacing.restart();
        assert!(pacing.batch().abs_diff(3000) <= 1, "{}", pacing.batch());
    }

    #[test]
    fn a_change_starts_small_again_and_extremes_do_no_harm() {
        let mut pacing = Pacing::new(false);
        for _ in 0..40 {
            pacing.measured(u32::MAX, Duration::ZERO, Duration::ZERO);
        }
        assert!(pacing.batch() > FIRST_BATCH);
        pacing.restart();
        assert_eq!(pacing.batch(), FIRST_BATCH);
        pacing.measured(1, Duration::from_secs(1_000_000), Duration::MAX / 8);
        assert_eq!(pacing.batch(), SMALLEST_BATCH);
    }
}
