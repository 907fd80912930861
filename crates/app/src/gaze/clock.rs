//! From a device's clock to ours.

use std::time::{Duration, Instant};

/// How long the shortest way of a sample is remembered; clocks drift apart by less than a millisecond in that time.
const MEMORY: Duration = Duration::from_secs(10);
/// A device time this far back means that the device has started again.
pub const RESTART_SECS: f64 = 1.0;

/// When a sample was taken, by our clock.
///
/// With a measured offset between the clocks that is exact to the error of the measurement. Without, the sample that came
/// fastest within the last seconds is taken to have come at once: the age is then what queues and jitter add, a lower bound.
#[derive(Clone, Debug)]
pub struct DeviceClock {
    epoch: Instant,
    last_secs: Option<f64>,
    /// Ours minus the device's, seconds, as measured.
    measured: Option<f64>,
    /// Smallest differences of the current and the last stretch of time, and when the current one began.
    smallest: Option<(f64, f64, Instant)>,
}

impl DeviceClock {
    /// A clock that nothing is known of.
    pub fn new(epoch: Instant) -> Self {
        Self { epoch, last_secs: None, measured: None, smallest: None }
    }

    /// Seconds of our clock, as [`DeviceClock::set_offset`] counts them.
    pub fn local_secs(&self, at: Instant) -> f64 {
        at.saturating_duration_since(self.epoch).as_secs_f64()
    }

    /// Says by how much our clock is ahead of the device's, seconds.
    pub fn set_offset(&mut self, ours_minus_device_secs: f64) {
        if ours_minus_device_secs.is_finite() {
            self.measured = Some(ours_minus_device_secs);
        }
    }

    /// Whether the offset was measured rather than estimated.
    pub fn is_synchronised(&self) -> bool {
        self.measured.is_some()
    }

    /// When a sample was taken. `None` for a time that is not after the last one, which is to be dropped; a time far back
    /// is a device that has started again.
    pub fn captured(&mut self, device_secs: f64, arrived: Instant) -> Option<Instant> {
        if !device_secs.is_finite() {
            return None;
        }
        match self.last_secs {
            // What was measured was of the clock before.
            Some(last) if device_secs <= last - RESTART_SECS => (self.smallest, self.measured) = (None, None),
            Some(last) if device_secs <= last => return None,
            _ => {}
        }
        self.last_secs = Some(device_secs);
        let difference = self.local_secs(arrived) - device_secs;
        let (current, last, since) = match self.smallest {
            None => (difference, difference, arrived),
            Some((current, _, since)) if arrived.saturating_duration_since(since) > MEMORY => {
                (difference, current, arrived)
            }
            Some((current, last, since)) => (current.min(difference), last, since),
        };
        self.smallest = Some((current, last, since));
        let age_secs = difference - self.measured.unwrap_or(current.min(last));
        let age = Duration::try_from_secs_f64(age_secs.max(0.0)).unwrap_or_default();
        Some(arrived.checked_sub(age).unwrap_or(arrived))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn ms(value: u64) -> Duration {
        Duration::from_millis(value)
    }

    #[test]
    fn without_synchronisation_the_age_is_what_the_fastest_sample_did_not_need() {
        let epoch = Instant::now();
        let mut clock = DeviceClock::new(epoch);
        for step in 0..100_u64 {
            let jitter = [5, 12, 30, 7][step as usize % 4];
            let arrived = epoch + ms(1000 + step * 10 + jitter);
            let captured = clock.captured(77.0 + step as f64 * 0.01, arrived).unwrap();
            let age = arrived.duration_since(captured);
            if step >= 4 {
                assert!(age.abs_diff(ms(jitter - 5)) < Duration::from_micros(2), "{step}: {age:?}");
            }
        }
    }

    #[test]
    fn with_a_measured_offset_the_age_is_all_of_it() {
        let epoch = Instant::now();
        let mut clock = DeviceClock::new(epoch);
        clock.set_offset(-100.0);
        let arrived = epoch + ms(540);
        let age = arrived.duration_since(clock.captured(100.5, arrived).unwrap());
        assert!(clock.is_synchronised() && age.abs_diff(ms(40)) < Duration::from_micros(2), "{age:?}");
        // An offset that is wrong by more than the age cannot put a sample into the future.
        clock.set_offset(-99.0);
        assert_eq!(clock.captured(100.6, arrived), Some(arrived));
    }

    #[test]
    fn an_offset_that_was_measured_before_a_restart_does_not_count_after_it() {
        let epoch = Instant::now();
        let mut clock = DeviceClock::new(epoch);
        clock.set_offset(-100.0);
        assert!(clock.captured(100.5, epoch + ms(540)).is_some());
        let arrived = epoch + ms(1000);
        assert_eq!(clock.captured(0.5, arrived), Some(arrived), "taken for the fastest, not for 100.5 s old");
        assert!(!clock.is_synchronised());
        clock.set_offset(0.48);
        let age = (epoch + ms(1020)).duration_since(clock.captured(0.51, epoch + ms(1020)).unwrap());
        assert!(age.abs_diff(ms(30)) < Duration::from_micros(2), "{age:?}");
    }

    #[test]
    fn a_clock_that_drifts_is_followed() {
        let epoch = Instant::now();
        let mut clock = DeviceClock::new(epoch);
        let mut age = Duration::ZERO;
        for step in 0..6000_u64 {
            let arrived = epoch + ms(1000 + step * 10);
            // 200 ppm slow: 12 ms a minute.
            let captured = clock.captured(step as f64 * 0.01 * (1.0 - 2e-4), arrived).unwrap();
            age = arrived.duration_since(captured);
        }
        assert!(age < ms(5), "{age:?}");
    }

    #[test]
    fn times_that_do_not_increase_are_dropped_and_a_restart_is_accepted() {
        let epoch = Instant::now();
        let mut clock = DeviceClock::new(epoch);
        let at = |step: u64| epoch + ms(1000 + step * 10);
        assert!(clock.captured(50.0, at(0)).is_some());
        for wrong in [50.0, 49.9, f64::NAN, f64::INFINITY] {
            assert_eq!(clock.captured(wrong, at(1)), None, "{wrong}");
        }
        assert_eq!(clock.captured(1.0, at(2)), Some(at(2)), "started again");
        assert!(clock.captured(1.01, at(3)).is_some());
    }
}
