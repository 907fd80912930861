//! How much is traced beside the headset's frames: what is left of each, and never more.

use std::time::Duration;

/// Smallest batch, samples; a smaller one is all overhead.
const SMALLEST: u32 = 1 << 8;
/// Share of a frame that stays free, for the runtime's own work and for what was not foreseen.
const RESERVE: f64 = 0.15;
/// Share of the measured rate that is counted on, since the next samples may be dearer.
const CAUTION: f64 = 0.7;
/// Weight of the newest measurement.
const NEWEST: f64 = 0.25;

/// Rates of work, by measurement.
#[derive(Clone, Copy, Debug, Default)]
pub struct FramePacing {
    samples_per_s: Option<f64>,
    texels_per_s: Option<f64>,
}

impl FramePacing {
    /// What is left of a frame of `period` after `used` of it.
    pub fn left(period: Duration, used: Duration) -> Duration {
        period.mul_f64(1.0 - RESERVE).saturating_sub(used)
    }

    /// Samples of a batch that takes at most `left`; `None` when even the smallest would take longer.
    pub fn batch(&self, left: Duration) -> Option<u32> {
        // Before anything is known the smallest is tried.
        let Some(rate) = self.samples_per_s else { return (!left.is_zero()).then_some(SMALLEST) };
        let affordable = rate * CAUTION * left.as_secs_f64();
        // The cast saturates.
        (affordable >= f64::from(SMALLEST)).then_some(affordable as u32)
    }

    /// Texels of the panorama that can be refreshed in `left`, at least `least`.
    pub fn texels(&self, left: Duration, least: u64) -> u64 {
        let affordable = self.texels_per_s.unwrap_or(0.0) * CAUTION * left.as_secs_f64();
        (affordable as u64).max(least)
    }

    /// Takes in how long a batch took.
    pub fn traced(&mut self, samples: u32, took: Duration) {
        self.samples_per_s = Some(smoothed(self.samples_per_s, f64::from(samples) / took.as_secs_f64().max(1e-6)));
    }

    /// Takes in how long a part of the panorama took.
    pub fn refreshed(&mut self, texels: u64, took: Duration) {
        self.texels_per_s = Some(smoothed(self.texels_per_s, texels as f64 / took.as_secs_f64().max(1e-6)));
    }

    /// Forgets the rate of samples, after a change of what is traced.
    pub fn restart(&mut self) {
        self.samples_per_s = None;
    }
}

/// Slower counts at once, faster by and by.
fn smoothed(last: Option<f64>, newest: f64) -> f64 {
    match last {
        Some(last) if newest > last => last + NEWEST * (newest - last),
        _ => newest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_planned_fits_what_is_left() {
        let period = Duration::from_micros(11_111);
        let mut pacing = FramePacing::default();
        let left = FramePacing::left(period, Duration::from_millis(3));
        assert_eq!(pacing.batch(left), Some(SMALLEST), "the first is small");
        for rate in [4e7, 2e7, 6e7] {
            for _ in 0..50 {
                let samples = pacing.batch(left).unwrap_or(SMALLEST);
                pacing.traced(samples, Duration::from_secs_f64(f64::from(samples) / rate));
            }
            let seconds = f64::from(pacing.batch(left).unwrap_or(0)) / rate;
            assert!(seconds < left.as_secs_f64() && seconds > 0.5 * left.as_secs_f64(), "{rate}: {seconds}");
        }
    }

    #[test]
    fn a_frame_that_is_full_gets_no_batch() {
        let mut pacing = FramePacing::default();
        assert_eq!(pacing.batch(FramePacing::left(Duration::from_millis(10), Duration::from_millis(9))), None);
        pacing.traced(1000, Duration::from_millis(10));
        assert_eq!(pacing.batch(Duration::from_millis(2)), None, "256 samples take 2.6 ms");
        assert!(pacing.batch(Duration::from_millis(5)).is_some());
        pacing.restart();
        assert_eq!(pacing.batch(Duration::from_millis(2)), Some(SMALLEST));
        assert_eq!(pacing.texels(Duration::ZERO, 64), 64);
    }

    #[test]
    fn one_slow_batch_makes_the_next_small() {
        let mut pacing = FramePacing::default();
        (0..20).for_each(|_| pacing.traced(100_000, Duration::from_millis(5)));
        let before = pacing.batch(Duration::from_millis(5));
        pacing.traced(100_000, Duration::from_millis(50));
        assert!(pacing.batch(Duration::from_millis(5)) < before.map(|samples| samples / 5));
    }
}
