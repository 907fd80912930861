//! Dots to look at one after the other, for a drift correction (one dot) or a validation (nine), and what they tell.

use std::time::{Duration, Instant};

use super::drift::{DriftCorrection, DriftRefused, FEWEST_SAMPLES};
use super::geometry::angle_between_deg;

/// How long the eye has to get to a dot.
const SETTLE: Duration = Duration::from_millis(800);
/// How long samples are collected at a dot.
const COLLECT: Duration = Duration::from_millis(1000);
/// After so long without enough samples a dot is given up.
const GIVE_UP: Duration = Duration::from_secs(5);

/// What a run of dots is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// One dot at the centre.
    Drift,
    /// Nine dots over the picture.
    Validation,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// A correction, or why there is none.
    Drift(Result<DriftCorrection, DriftRefused>),
    /// Accuracy and precision.
    Validation(Accuracy),
}

/// How far the gaze lies from where somebody looked, and how much it trembles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// Mean over the dots of the angle between the dot and the mean of its samples, degrees.
    pub accuracy_deg: f64,
    /// The same at the worst dot, degrees.
    pub worst_deg: f64,
    /// Root mean square of the angle between successive samples, degrees.
    pub precision_deg: f64,
    /// Mean offset, measured minus true, degrees.
    pub offset_deg: [f64; 2],
    /// Dots at which there were samples enough.
    pub dots: usize,
}

/// A run of dots.
#[derive(Clone, Debug)]
pub struct DotRun {
    /// What it is for.
    pub purpose: Purpose,
    /// Dots as points of the picture: +-1 at its edges, y up.
    dots: Vec<[f64; 2]>,
    current: usize,
    since: Instant,
    samples: Vec<[f64; 2]>,
    results: Vec<Dot>,
}

#[derive(Clone, Debug)]
struct Dot {
    target_deg: [f64; 2],
    samples: Vec<[f64; 2]>,
}

impl DotRun {
    /// Begins with the first dot.
    pub fn start(purpose: Purpose, now: Instant) -> Self {
        const SIDE: f64 = 0.8;
        let dots = match purpose {
            Purpose::Drift => vec![[0.0, 0.0]],
            Purpose::Validation => {
                [SIDE, 0.0, -SIDE].iter().flat_map(|y| [-SIDE, 0.0, SIDE].map(|x| [x, *y])).collect()
            }
        };
        Self { purpose, dots, current: 0, since: now, samples: Vec::new(), results: Vec::new() }
    }

    /// The dot to be shown, as a point of the picture.
    pub fn dot(&self) -> [f64; 2] {
        self.dots.get(self.current).copied().unwrap_or_default()
    }

    /// Dots done and dots in all.
    pub fn progress(&self) -> (usize, usize) {
        (self.current, self.dots.len())
    }

    /// How much of the time at this dot has passed, 0..=1.
    pub fn fraction(&self, now: Instant) -> f32 {
        let passed = now.saturating_duration_since(self.since).as_secs_f32();
        (passed / (SETTLE + COLLECT).as_secs_f32()).clamp(0.0, 1.0)
    }

    /// Takes samples (degrees) that came with their times since the last call. `target_deg` is where the shown dot is.
    pub fn update(&mut self, now: Instant, target_deg: [f64; 2], samples: &[(Instant, [f64; 2])]) -> Option<Outcome> {
        let from = self.since + SETTLE;
        self.samples.extend(samples.iter().filter(|(at, _)| *at >= from).map(|(_, point)| *point));
        let passed = now.saturating_duration_since(self.since);
        let enough = self.samples.len() >= FEWEST_SAMPLES && passed >= SETTLE + COLLECT;
        if !enough && passed < GIVE_UP {
            return None;
        }
        self.results.push(Dot { target_deg, samples: std::mem::take(&mut self.samples) });
        self.current += 1;
        self.since = now;
        (self.current >= self.dots.len()).then(|| self.outcome())
    }

    fn outcome(&self) -> Outcome {
        match (self.purpose, self.results.first()) {
            (Purpose::Drift, Some(dot)) => Outcome::Drift(DriftCorrection::measure(dot.target_deg, &dot.samples)),
            (Purpose::Drift, None) => Outcome::Drift(Err(DriftRefused::NoGaze)),
            (Purpose::Validation, _) => Outcome::Validation(self.accuracy()),
        }
    }

    fn accuracy(&self) -> Accuracy {
        let mut result = Accuracy::default();
        let (mut steps, mut squares) = (0.0, 0.0);
        for dot in self.results.iter().filter(|dot| dot.samples.len() >= FEWEST_SAMPLES) {
            let count = dot.samples.len() as f64;
            let mean =
                dot.samples.iter().fold([0.0; 2], |sum, point| [sum[0] + point[0] / count, sum[1] + point[1] / count]);
            let error = angle_between_deg(mean, dot.target_deg);
            result.accuracy_deg += error;
            result.worst_deg = result.worst_deg.max(error);
            let [x, y] = result.offset_deg;
            result.offset_deg = [x + mean[0] - dot.target_deg[0], y + mean[1] - dot.target_deg[1]];
            result.dots += 1;
            for pair in dot.samples.windows(2) {
                squares += angle_between_deg(pair[0], pair[1]).powi(2);
                steps += 1.0;
            }
        }
        if result.dots > 0 {
            let dots = result.dots as f64;
            result.accuracy_deg /= dots;
            result.offset_deg = result.offset_deg.map(|sum| sum / dots);
            result.precision_deg = (squares / f64::max(steps, 1.0)).sqrt();
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_SIZE_DEG: f64 = 15.0;

    /// Runs the dots at 120 Hz against a gaze that is off and trembles; `None` samples where `blind` says so.
    fn run(purpose: Purpose, off: [f64; 2], tremble: f64, blind: impl Fn(usize) -> bool) -> (Outcome, Duration) {
        let start = Instant::now();
        let mut dots = DotRun::start(purpose, start);
        for step in 1..100_000_u32 {
            let now = start + Duration::from_micros(8333) * step;
            let target = dots.dot().map(|value| value * HALF_SIZE_DEG);
            let sign = if step % 2 == 0 { 1.0 } else { -1.0 };
            let sample = (now, [target[0] + off[0] + tremble * sign, target[1] + off[1]]);
            let seen = if blind(dots.progress().0) { vec![] } else { vec![sample] };
            if let Some(outcome) = dots.update(now, target, &seen) {
                return (outcome, now - start);
            }
        }
        panic!("never done");
    }

    #[test]
    fn nine_dots_report_accuracy_and_precision_in_degrees() {
        let (outcome, took) = run(Purpose::Validation, [0.6, -0.8], 0.1, |_| false);
        let Outcome::Validation(result) = outcome else { panic!("{outcome:?}") };
        // At the edges a degree of yaw is less than a degree at the eye.
        assert!((result.accuracy_deg - 0.97).abs() < 0.04 && result.worst_deg < 1.001, "{result:?}");
        assert!((result.precision_deg - 0.2).abs() < 0.01, "{result:?}");
        assert!((result.offset_deg[0] - 0.6).abs() < 0.01 && (result.offset_deg[1] + 0.8).abs() < 0.01);
        assert_eq!(result.dots, 9);
        assert!(took < Duration::from_secs(20), "{took:?}");
    }

    #[test]
    fn dots_without_gaze_are_left_out_and_said() {
        let (outcome, _) = run(Purpose::Validation, [0.0; 2], 0.0, |dot| dot == 4);
        assert!(matches!(outcome, Outcome::Validation(Accuracy { dots: 8, .. })), "{outcome:?}");
        let (outcome, took) = run(Purpose::Drift, [0.0; 2], 0.0, |_| true);
        assert_eq!(outcome, Outcome::Drift(Err(DriftRefused::NoGaze)));
        assert!(took < Duration::from_secs(6));
    }

    #[test]
    fn one_dot_measures_the_drift() {
        let (outcome, took) = run(Purpose::Drift, [1.5, 0.5], 0.1, |_| false);
        let Outcome::Drift(Ok(drift)) = outcome else { panic!("{outcome:?}") };
        assert!((drift.offset_deg[0] - 1.5).abs() < 0.11 && (drift.offset_deg[1] - 0.5).abs() < 1e-9, "{drift:?}");
        assert!(took < Duration::from_secs(2));
    }

    #[test]
    fn what_was_looked_at_before_the_dot_does_not_count() {
        let start = Instant::now();
        let mut dots = DotRun::start(Purpose::Drift, start);
        let early = (start + Duration::from_millis(100), [30.0, 30.0]);
        assert_eq!(dots.update(start + Duration::from_millis(200), [0.0; 2], &[early; 50]), None);
        assert!(dots.samples.is_empty());
    }
}
