//! A film outlives its device: what of it is kept on the host now and then, since a lost device's film cannot be read.

use std::time::{Duration, Instant};

/// Shortest time between two snapshots.
const SHORTEST_INTERVAL: Duration = Duration::from_secs(5);
/// Snapshots take at most this share of the time.
const LARGEST_SHARE: f64 = 0.02;

/// What a snapshot costs until one was taken: 0.34 to 0.5 s for 84 MB and 1 to 1.5 s for 335 MB on lavapipe.
const EXPECTED_SECS_PER_BYTE: f64 = 4e-9;

/// Says when the film should be kept.
#[derive(Clone, Copy, Debug)]
pub struct Keeper {
    /// The last snapshot, or the film's start.
    since: Instant,
    /// What the last snapshot took for each byte of the film.
    secs_per_byte: f64,
    /// Samples in it.
    samples: u64,
}

impl Keeper {
    /// A film starts.
    pub fn new(now: Instant) -> Self {
        Self { since: now, secs_per_byte: EXPECTED_SECS_PER_BYTE, samples: 0 }
    }

    /// Whether a snapshot of a film of so many samples and bytes is due.
    pub fn is_due(&self, now: Instant, samples: u64, film_bytes: u64) -> bool {
        let cost_secs = self.secs_per_byte * film_bytes as f64;
        let interval_secs = SHORTEST_INTERVAL.as_secs_f64().max(cost_secs / LARGEST_SHARE);
        samples != self.samples && now.duration_since(self.since).as_secs_f64() >= interval_secs
    }

    /// A snapshot of so many samples and bytes was taken from `start` to `end`.
    pub fn taken(&mut self, start: Instant, end: Instant, samples: u64, film_bytes: u64) {
        let secs_per_byte = end.duration_since(start).as_secs_f64() / film_bytes.max(1) as f64;
        *self = Self { since: end, secs_per_byte, samples };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapshots_take_a_small_share_of_the_time_whatever_they_cost() {
        let bytes = 335 << 20;
        for cost_ms in [1, 40, 900] {
            let cost = Duration::from_millis(cost_ms);
            let start = Instant::now();
            let (mut now, mut keeper, mut spent, mut count) = (start, Keeper::new(start), Duration::ZERO, 0);
            let mut first = None;
            // Ten minutes from the first one on.
            while now < first.unwrap_or(now) + Duration::from_secs(600) {
                if keeper.is_due(now, count + 1, bytes) {
                    keeper.taken(now, now + cost, count + 1, bytes);
                    first.get_or_insert(now);
                    (now, spent, count) = (now + cost, spent + cost, count + 1);
                }
                now += Duration::from_millis(50);
            }
            let share = spent.as_secs_f64() / 600.0;
            assert!(!keeper.is_due(now + Duration::from_secs(99), count, bytes), "nothing has changed since");
            // The first one is not taken at its whole cost right after the start.
            assert!(first.is_some_and(|first| (first - start).as_secs_f64() >= 0.9 / LARGEST_SHARE));
            assert!(share < 0.021 && count >= 12, "{cost_ms} ms: {count} snapshots, {share}");
        }
    }
}
