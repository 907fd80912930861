//! How fast samples come.

use std::time::{Duration, Instant};

/// Over how long a rate is averaged.
const RATE_WINDOW: Duration = Duration::from_millis(800);

/// Samples a second over a sliding window.
#[derive(Debug, Default)]
pub(super) struct Rate {
    history: std::collections::VecDeque<(u64, Instant)>,
}

impl Rate {
    pub fn add(&mut self, samples: u64, now: Instant) {
        if self.history.back().is_some_and(|(last, _)| samples < *last) {
            self.history.clear();
        }
        self.history.push_back((samples, now));
        while self.history.len() > 2 && now.duration_since(self.history[1].1) > RATE_WINDOW {
            self.history.pop_front();
        }
    }

    pub fn per_second(&self) -> f64 {
        match (self.history.front(), self.history.back()) {
            (Some((first, start)), Some((last, end))) if end > start => {
                (last - first) as f64 / end.duration_since(*start).as_secs_f64()
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Rate;
    use std::time::{Duration, Instant};

    #[test]
    fn the_rate_follows_the_last_second_and_a_restart() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut rate = Rate::default();
        assert_eq!(rate.per_second(), 0.0);
        for step in 0..=20 {
            rate.add(step * 1000, at(step * 100));
        }
        assert!((rate.per_second() - 10_000.0).abs() < 1e-6);
        for step in 1..=20 {
            rate.add(20_000 + step * 3000, at(2000 + step * 100));
        }
        assert!((rate.per_second() - 30_000.0).abs() < 1e-6);
        rate.add(10, at(5000));
        rate.add(20, at(6000));
        assert!((rate.per_second() - 10.0).abs() < 1e-6);
    }
}
