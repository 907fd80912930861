//! A film outlives its device: what of it is kept on the host now and then, since a lost device's film cannot be read.

use std::time::{Duration, Instant};

/// Shortest time between two snapshots.
const SHORTEST_INTERVAL: Duration = Duration::from_secs(5);
/// Snapshots take at most this share of the time.
const LARGEST_SHARE: f64 = 0.02;

/// Says when the film should be kept.
#[derive(Clone, Copy, Debug)]
pub struct Keeper {
    /// The last snapshot, or the film's start.
    since: Instant,
    /// What the last snapshot took.
    cost: Duration,
    /// Samples in it.
    samples: u64,
}

impl Keeper {
    /// A film starts.
    pub fn new(now: Instant) -> Self {
        Self { since: now, cost: Duration::ZERO, samples: 0 }
    }

    /// Whether a snapshot of a film of so many samples is due.
    pub fn is_due(&self, now: Instant, samples: u64) -> bool {
        let interval = SHORTEST_INTERVAL.max(self.cost.div_f64(LARGEST_SHARE));
        samples != self.samples && now.duration_since(self.since) >= interval
    }

    /// A snapshot of so many samples was taken from `start` to `end`.
    pub fn taken(&mut self, start: Instant, end: Instant, samples: u64) {
        *self = Self { since: end, cost: end.duration_since(start), samples };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapshots_take_a_small_share_of_the_time_whatever_they_cost() {
        for cost_ms in [1, 40, 900] {
            let cost = Duration::from_millis(cost_ms);
            let start = Instant::now();
            let (mut now, mut keeper, mut spent, mut count) = (start, Keeper::new(start), Duration::ZERO, 0);
            while now < start + Duration::from_secs(600) {
                if keeper.is_due(now, count + 1) {
                    keeper.taken(now, now + cost, count + 1);
                    (now, spent, count) = (now + cost, spent + cost, count + 1);
                }
                now += Duration::from_millis(50);
            }
            let share = spent.as_secs_f64() / 600.0;
            assert!(!keeper.is_due(now + Duration::from_secs(99), count), "nothing has changed since");
            assert!(share < 0.021 && count >= 12, "{cost_ms} ms: {count} snapshots, {share}");
        }
    }
}
