//! How long it takes from the eye to a batch that is traced for it, and to the picture that shows it.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::SampleTimes;

/// Measurements that a figure is taken over.
const KEPT: usize = 256;
/// Above this the age of the sample is too much (R. Albert et al., ACM Transactions on Applied Perception 14(4), 2017: 50
/// to 70 ms go unnoticed, 80 to 150 ms more do not).
pub const TOO_OLD: Duration = Duration::from_millis(70);

/// Figures over the last [`KEPT`] samples and pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TimingReport {
    /// From the arrival of a sample to the batch that used it: median and largest.
    pub arrival_to_batch: Option<(Duration, Duration)>,
    /// From the eye to the picture: median.
    pub age: Option<Duration>,
    /// From one batch to the next: largest. No sample can wait longer than that.
    pub longest_frame: Option<Duration>,
}

impl TimingReport {
    /// Whether the age is worth a warning.
    pub fn is_too_old(&self) -> bool {
        self.age.is_some_and(|age| age > TOO_OLD)
    }
}

/// Gathers them.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    waits: VecDeque<Duration>,
    ages: VecDeque<Duration>,
    frames: VecDeque<Duration>,
    last_batch: Option<Instant>,
    last_sample: Option<Instant>,
}

impl Timing {
    /// A batch begins, for a sample. Only the first batch of a sample says how long that waited.
    pub fn batch(&mut self, now: Instant, sample: Option<SampleTimes>) {
        if let Some(last) = self.last_batch.replace(now) {
            keep(&mut self.frames, now.saturating_duration_since(last));
        }
        let Some(sample) = sample.filter(|sample| sample.is_eye) else { return };
        if self.last_sample.replace(sample.arrived) != Some(sample.arrived) {
            keep(&mut self.waits, now.saturating_duration_since(sample.arrived));
        }
    }

    /// A picture is done, whose newest batch was traced for a sample.
    pub fn shown(&mut self, now: Instant, sample: Option<SampleTimes>) {
        match sample.filter(|sample| sample.is_eye) {
            Some(sample) => keep(&mut self.ages, now.saturating_duration_since(sample.captured)),
            // A pointer has no age worth telling.
            None => self.ages.clear(),
        }
    }

    /// The figures.
    pub fn report(&self) -> TimingReport {
        TimingReport {
            arrival_to_batch: median(&self.waits).zip(self.waits.iter().max().copied()),
            age: median(&self.ages),
            longest_frame: self.frames.iter().max().copied(),
        }
    }
}

fn keep(values: &mut VecDeque<Duration>, value: Duration) {
    values.push_back(value);
    if values.len() > KEPT {
        values.pop_front();
    }
}

fn median(values: &VecDeque<Duration>) -> Option<Duration> {
    let mut sorted: Vec<Duration> = values.iter().copied().collect();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_ages_and_frames_are_those_of_the_eyes_samples() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let eye = |captured, arrived| Some(SampleTimes { captured: at(captured), arrived: at(arrived), is_eye: true });
        let mut timing = Timing::default();
        timing.batch(at(30), eye(10, 20));
        timing.batch(at(45), eye(10, 20));
        timing.shown(at(60), eye(10, 20));
        timing.batch(at(62), eye(50, 58));
        let report = timing.report();
        assert_eq!(report.arrival_to_batch, Some((Duration::from_millis(10), Duration::from_millis(10))));
        assert_eq!(report.age, Some(Duration::from_millis(50)));
        assert_eq!(report.longest_frame, Some(Duration::from_millis(17)));
        assert!(!report.is_too_old());
        (0..300).for_each(|_| timing.shown(at(200), eye(100, 120)));
        assert!(timing.report().is_too_old() && timing.ages.len() == KEPT);
        let pointer = SampleTimes {
            is_eye: false,
            ..eye(0, 0).unwrap_or(SampleTimes { captured: start, arrived: start, is_eye: false })
        };
        timing.shown(at(300), Some(pointer));
        assert_eq!(timing.report().age, None);
    }
}
