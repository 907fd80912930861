//! How long it takes from the eye to a batch that is traced for it, and to the picture that shows it.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::SampleTimes;

/// Over how long figures are taken, and over how many measurements at most.
const KEPT: Duration = Duration::from_secs(3);
const MOST: usize = 8192;
/// Samples that may wait for one batch; more than come in a second at 2,000 Hz.
const WAITING: usize = 4096;
/// Above this the age of the sample is too much (R. Albert et al., ACM Transactions on Applied Perception 14(4), 2017: 50
/// to 70 ms go unnoticed, 80 to 150 ms more do not).
pub const TOO_OLD: Duration = Duration::from_millis(70);

/// Figures over the last three seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TimingReport {
    /// From the arrival of a sample to the first batch that goes by it or a newer one: median and largest, over all samples.
    pub arrival_to_batch: Option<(Duration, Duration)>,
    /// From the eye to the picture: median.
    pub age: Option<Duration>,
    /// From the beginning of one frame of the tracing thread, whether or not it asks for the gaze, to the batch of the next: largest.
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
    waits: Recent,
    ages: Recent,
    frames: Recent,
    /// When the last frame began that traced a batch.
    last_frame: Option<Instant>,
    /// Arrivals of the samples that no batch has gone by, oldest first.
    waiting: VecDeque<Instant>,
}

impl Timing {
    /// A sample has become the gaze.
    pub fn arrived(&mut self, sample: SampleTimes) {
        // Before the first batch there is nothing to wait for.
        if sample.is_eye && self.last_frame.is_some() && self.waiting.len() < WAITING {
            self.waiting.push_back(sample.arrived);
        }
    }

    /// A batch begins now, in a frame that began at `frame`, and goes by a sample, or by none that came.
    pub fn batch(&mut self, frame: Instant, now: Instant, sample: Option<SampleTimes>) {
        if let Some(last) = self.last_frame.replace(frame) {
            self.frames.keep(now, now.saturating_duration_since(last));
        }
        let Some(sample) = sample else { return self.waiting.clear() };
        while let Some(arrived) = self.waiting.pop_front_if(|arrived| *arrived <= sample.arrived) {
            self.waits.keep(now, now.saturating_duration_since(arrived));
        }
    }

    /// A frame traces nothing, so that no sample waits for it.
    pub fn rests(&mut self) {
        self.last_frame = None;
        self.waiting.clear();
    }

    /// A picture is done, whose newest batch was traced for a sample.
    pub fn shown(&mut self, now: Instant, sample: Option<SampleTimes>) {
        match sample.filter(|sample| sample.is_eye) {
            Some(sample) => self.ages.keep(now, now.saturating_duration_since(sample.captured)),
            // A pointer has no age worth telling.
            None => self.ages = Recent::default(),
        }
    }

    /// The figures.
    pub fn report(&self) -> TimingReport {
        TimingReport {
            arrival_to_batch: self.waits.median().zip(self.waits.largest()),
            age: self.ages.median(),
            longest_frame: self.frames.largest(),
        }
    }
}

/// Measurements with the times at which they were made.
#[derive(Clone, Debug, Default)]
struct Recent(VecDeque<(Instant, Duration)>);

impl Recent {
    fn keep(&mut self, now: Instant, value: Duration) {
        self.0.push_back((now, value));
        let old = |(at, _): &(Instant, Duration)| now.saturating_duration_since(*at) > KEPT;
        while self.0.len() > MOST || self.0.front().is_some_and(old) {
            self.0.pop_front();
        }
    }

    fn median(&self) -> Option<Duration> {
        let mut sorted: Vec<Duration> = self.0.iter().map(|(_, value)| *value).collect();
        sorted.sort_unstable();
        sorted.get(sorted.len() / 2).copied()
    }

    fn largest(&self) -> Option<Duration> {
        self.0.iter().map(|(_, value)| *value).max()
    }
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
        timing.batch(at(11), at(12), None);
        [20, 24, 29].into_iter().filter_map(|ms| eye(ms - 10, ms)).for_each(|sample| timing.arrived(sample));
        timing.batch(at(26), at(30), eye(14, 24));
        timing.batch(at(42), at(45), eye(19, 29));
        timing.shown(at(60), eye(10, 20));
        timing.batch(at(61), at(62), eye(19, 29));
        let report = timing.report();
        let ms = Duration::from_millis;
        // Ten, six, and sixteen of that which the first batch did not go by.
        assert_eq!(report.arrival_to_batch, Some((ms(10), ms(16))));
        assert_eq!(report.age, Some(ms(50)));
        assert_eq!(report.longest_frame, Some(ms(20)));
        assert!(!report.is_too_old());
        (0..300).for_each(|_| timing.shown(at(200), eye(100, 120)));
        assert!(timing.report().is_too_old());
        timing.shown(at(4000), eye(3960, 3970));
        assert_eq!(timing.report().age, Some(Duration::from_millis(40)), "older ones are forgotten");
        let pointer = SampleTimes {
            is_eye: false,
            ..eye(0, 0).unwrap_or(SampleTimes { captured: start, arrived: start, is_eye: false })
        };
        timing.shown(at(4100), Some(pointer));
        assert_eq!(timing.report().age, None);
        // What comes while nothing is traced waits for nothing.
        eye(4100, 4110).into_iter().for_each(|sample| timing.arrived(sample));
        timing.rests();
        eye(4190, 4200).into_iter().for_each(|sample| timing.arrived(sample));
        timing.batch(at(9000), at(9001), eye(4190, 4200));
        assert_eq!(timing.report().arrival_to_batch, report.arrival_to_batch);
        assert_eq!(timing.report().longest_frame, report.longest_frame);
    }
}
