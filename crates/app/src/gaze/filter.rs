//! From noisy gaze to steady gaze that still jumps when the eye jumps. Works in degrees at the eye.
//!
//! A One Euro filter (G. Casiez, N. Roussel, D. Vogel, *1 Euro Filter*, CHI 2012) that starts anew at every saccade, and
//! begins each fixation as a plain mean, which converges faster than any fixed smoothing. Blinks hold the last fixation.

use std::collections::VecDeque;

/// Parameters, in the order of how much they matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSettings {
    /// Cut-off while the eye rests, Hz. Lower is steadier and follows slow drifts later.
    pub min_cutoff_hz: f64,
    /// How much the cut-off rises with speed, Hz per deg/s. Higher follows pursuit sooner and lets more noise through.
    pub beta: f64,
    /// Cut-off of the speed that `beta` goes by, Hz.
    pub derivative_cutoff_hz: f64,
    /// Speed that is a saccade at any noise, deg/s.
    pub saccade_deg_per_s: f64,
    /// Speed that is a saccade, in multiples of the measured noise of the speed. Lower lands sooner after small saccades
    /// and takes more noise for one.
    pub saccade_noises: f64,
    /// Distance from the filtered gaze that is a small saccade, in multiples of the noise of that distance.
    pub step_noises: f64,
}

impl Default for FilterSettings {
    fn default() -> Self {
        Self {
            min_cutoff_hz: 1.0,
            beta: 0.05,
            derivative_cutoff_hz: 1.0,
            saccade_deg_per_s: 100.0,
            saccade_noises: 6.0,
            step_noises: 5.0,
        }
    }
}

/// Over how long speed is measured, seconds.
const SPEED_SECS: f64 = 0.02;
/// Samples of the longest mean that tells a small saccade from noise.
const STEP_SAMPLES: u32 = 3;
/// A step smaller than this is left to smoothing, degrees.
const SMALLEST_STEP_DEG: f64 = 0.3;
/// For so long after a jump a slower movement still belongs to it, seconds.
const STILL_JUMPING_SECS: f64 = 0.04;
/// How much slower, as a share of a saccade's speed.
const STILL_JUMPING: f64 = 0.5;
/// Times are compared with so much slack, seconds, so that rounded time stamps of one trace give one answer.
const SLACK_SECS: f64 = 1e-4;
/// A gap longer than this is a blink, a shorter one a dropout, seconds.
const BLINK_SECS: f64 = 0.03;
/// What lies so shortly before a blink is the lid's work, seconds.
const BEFORE_BLINK_SECS: f64 = 0.05;
/// What lies so shortly after a blink is the lid's work, seconds.
const AFTER_BLINK_SECS: f64 = 0.1;
/// After so long without a valid sample the eye is lost, seconds.
pub const LOST_SECS: f64 = 0.5;
/// Samples that are kept at most, whatever their times: those of a source whose clock is set wrongly stand still or run back.
const MOST_KEPT: usize = 1024;
/// Speeds by which noise is measured.
const SPEEDS: usize = 128;
/// Speeds that are needed before they say anything.
const FEWEST_SPEEDS: usize = 24;
/// Median of a Rayleigh distribution in multiples of its parameter.
const RAYLEIGH_MEDIAN: f64 = 1.177_41;

/// What the eye does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It rests or pursues something.
    Fixation,
    /// It jumps.
    Saccade,
    /// It is closed, or opens; the point is that of the last fixation.
    Blink,
    /// Nothing valid has come for [`LOST_SECS`].
    Lost,
}

/// The filter's answer to one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtered {
    /// Degrees.
    pub point_deg: [f64; 2],
    /// What the eye does.
    pub phase: Phase,
    /// Whether smoothing began anew with this sample.
    pub restarted: bool,
}

/// Filters one person's gaze.
#[derive(Clone, Debug)]
pub struct GazeFilter {
    settings: FilterSettings,
    /// Valid samples of the last 100 ms or so.
    recent: VecDeque<(f64, [f64; 2])>,
    /// Answers of the last 200 ms and their times.
    outputs: VecDeque<(f64, [f64; 2])>,
    speeds: VecDeque<f64>,
    current: Option<Current>,
    last_valid_secs: Option<f64>,
    blink: Blink,
    /// When the eye last jumped for certain.
    jumped_secs: Option<f64>,
    /// Smoothed time between samples, seconds.
    interval_secs: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Current {
    time_secs: f64,
    point_deg: [f64; 2],
    velocity: [f64; 2],
    /// Samples since smoothing began.
    count: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Blink {
    /// The eye is open.
    No,
    /// It is closed; the point that holds.
    Closed([f64; 2]),
    /// It opened at a time; the point that holds a little longer.
    Opened(f64, [f64; 2]),
}

impl GazeFilter {
    /// A filter that has seen nothing.
    pub fn new(settings: FilterSettings) -> Self {
        Self {
            settings,
            recent: VecDeque::new(),
            outputs: VecDeque::new(),
            speeds: VecDeque::new(),
            current: None,
            last_valid_secs: None,
            blink: Blink::No,
            jumped_secs: None,
            interval_secs: None,
        }
    }

    /// Takes a sample; `None` for one that is not valid. Times must increase. No answer before the first valid sample.
    pub fn update(&mut self, time_secs: f64, point_deg: Option<[f64; 2]>) -> Option<Filtered> {
        match point_deg {
            Some(point) => Some(self.valid(time_secs, point)),
            None => self.invalid(time_secs),
        }
    }

    /// How long nothing valid may come before the eye is lost, seconds: longer for trackers slower than 5 Hz.
    pub fn patience_secs(&self) -> f64 {
        self.interval_secs.map_or(LOST_SECS, |interval| LOST_SECS.max(2.5 * interval))
    }

    fn invalid(&mut self, time_secs: f64) -> Option<Filtered> {
        let (current, last) = self.current.zip(self.last_valid_secs)?;
        let gap = time_secs - last;
        if gap >= BLINK_SECS - SLACK_SECS {
            self.blink = match self.blink {
                Blink::No => Blink::Closed(self.before_blink(last).unwrap_or(current.point_deg)),
                Blink::Closed(point) | Blink::Opened(_, point) => Blink::Closed(point),
            };
        }
        let point_deg = match self.blink {
            Blink::No => current.point_deg,
            Blink::Closed(point) | Blink::Opened(_, point) => point,
        };
        let phase = match self.blink {
            _ if gap > self.patience_secs() => Phase::Lost,
            Blink::No => Phase::Fixation,
            _ => Phase::Blink,
        };
        Some(Filtered { point_deg, phase, restarted: false })
    }

    /// The last output that the closing lid did not touch.
    fn before_blink(&self, last_valid_secs: f64) -> Option<[f64; 2]> {
        let clean = |(time_secs, _): &&(f64, _)| *time_secs <= last_valid_secs - BEFORE_BLINK_SECS + SLACK_SECS;
        self.outputs.iter().rev().find(clean).map(|(_, point)| *point)
    }

    fn valid(&mut self, time_secs: f64, point: [f64; 2]) -> Filtered {
        let since_last = self.last_valid_secs.map(|last| time_secs - last);
        self.last_valid_secs = Some(time_secs);
        if let Blink::Closed(held) = self.blink {
            self.blink = Blink::Opened(time_secs, held);
        }
        if let Blink::Opened(at, held) = self.blink {
            if time_secs - at < AFTER_BLINK_SECS - SLACK_SECS {
                return Filtered { point_deg: held, phase: Phase::Blink, restarted: false };
            }
            self.blink = Blink::No;
            self.recent.clear();
            return self.restart(time_secs, point, 1.0, Phase::Fixation);
        }
        if let Some(interval) = since_last.filter(|interval| *interval < 5.0) {
            self.interval_secs = Some(self.interval_secs.map_or(interval, |known| known + 0.1 * (interval - known)));
        }
        push_recent(&mut self.recent, (time_secs, point), 0.1);
        let Some(current) = self.current else { return self.restart(time_secs, point, 1.0, Phase::Fixation) };
        if let Some(speed) = self.speed(time_secs, point) {
            let noise = self.speed_noise();
            self.speeds.push_back(speed);
            if self.speeds.len() > SPEEDS {
                self.speeds.pop_front();
            }
            let saccade = self.settings.saccade_deg_per_s.max(self.settings.saccade_noises * noise.unwrap_or(0.0));
            let jumping = self.jumped_secs.is_some_and(|at| time_secs - at < STILL_JUMPING_SECS);
            if speed > if jumping { STILL_JUMPING * saccade } else { saccade } {
                if speed > saccade {
                    self.jumped_secs = Some(time_secs);
                }
                return self.restart(time_secs, point, 1.0, Phase::Saccade);
            }
            if let Some((mean, count)) = noise.and_then(|noise| self.step(current, noise)) {
                self.jumped_secs = Some(time_secs);
                return self.restart(time_secs, mean, count, Phase::Saccade);
            }
        }
        self.smooth(time_secs, point, current)
    }

    /// Speed over the last 20 ms or the interval next to that, deg/s.
    fn speed(&self, time_secs: f64, point: [f64; 2]) -> Option<f64> {
        let earlier = self.recent.iter().rev().skip(1);
        let (time, from) = earlier
            .min_by(|a, b| (time_secs - a.0 - SPEED_SECS).abs().total_cmp(&(time_secs - b.0 - SPEED_SECS).abs()))?;
        Some(distance(*from, point) / (time_secs - time).max(1e-4))
    }

    /// Standard deviation of the speed along an axis while the eye rests, deg/s. The median does not mind saccades.
    fn speed_noise(&self) -> Option<f64> {
        if self.speeds.len() < FEWEST_SPEEDS {
            return None;
        }
        let mut speeds: Vec<f64> = self.speeds.iter().copied().collect();
        let middle = speeds.len() / 2;
        let (_, median, _) = speeds.select_nth_unstable_by(middle, f64::total_cmp);
        Some(*median / RAYLEIGH_MEDIAN)
    }

    /// The mean of the last one, two or three samples and their number, when it lies farther from the filtered gaze than
    /// the noise of both puts it. One sample tells a large jump at once, three a small one soon.
    fn step(&self, current: Current, speed_noise: f64) -> Option<([f64; 2], f64)> {
        let interval = self.interval_secs.unwrap_or(SPEED_SECS).max(1e-4);
        // Noise of one sample from that of the difference of two that lie about 20 ms apart.
        let span = (SPEED_SECS / interval).round().max(1.0) * interval;
        let noise = speed_noise * span / std::f64::consts::SQRT_2;
        // A first-order low-pass is as noisy as a mean of so many.
        let smoothed = (2.0 / smoothing(self.settings.min_cutoff_hz, interval) - 1.0).min(current.count);
        let mut sum = [0.0; 2];
        for (count, (_, point)) in (1..=STEP_SAMPLES).zip(self.recent.iter().rev()) {
            sum = [sum[0] + point[0], sum[1] + point[1]];
            let count = f64::from(count);
            let mean = sum.map(|axis| axis / count);
            let expected = noise * (1.0 / count + 1.0 / smoothed).sqrt();
            // Later samples are part of the filtered gaze already when smoothing has just begun.
            let known = current.count >= 2.0 * count;
            if known
                && distance(mean, current.point_deg) > (self.settings.step_noises * expected).max(SMALLEST_STEP_DEG)
            {
                return Some((mean, count));
            }
        }
        None
    }

    fn restart(&mut self, time_secs: f64, point_deg: [f64; 2], count: f64, phase: Phase) -> Filtered {
        self.current = Some(Current { time_secs, point_deg, velocity: [0.0; 2], count });
        self.keep(time_secs, point_deg);
        Filtered { point_deg, phase, restarted: true }
    }

    fn smooth(&mut self, time_secs: f64, point: [f64; 2], current: Current) -> Filtered {
        let dt = (time_secs - current.time_secs).max(1e-4);
        let settings = self.settings;
        let slow = smoothing(settings.derivative_cutoff_hz, dt);
        let velocity = [0, 1].map(|axis| {
            let now = (point[axis] - current.point_deg[axis]) / dt;
            current.velocity[axis] + slow * (now - current.velocity[axis])
        });
        let cutoff = settings.min_cutoff_hz + settings.beta * velocity[0].hypot(velocity[1]);
        let count = current.count + 1.0;
        let weight = smoothing(cutoff, dt).max(1.0 / count);
        let point_deg = [0, 1].map(|axis| current.point_deg[axis] + weight * (point[axis] - current.point_deg[axis]));
        self.current = Some(Current { time_secs, point_deg, velocity, count });
        self.keep(time_secs, point_deg);
        Filtered { point_deg, phase: Phase::Fixation, restarted: false }
    }

    fn keep(&mut self, time_secs: f64, point_deg: [f64; 2]) {
        push_recent(&mut self.outputs, (time_secs, point_deg), 0.2);
    }
}

/// Adds the newest and takes away what is older than so many seconds.
fn push_recent(kept: &mut VecDeque<(f64, [f64; 2])>, newest: (f64, [f64; 2]), secs: f64) {
    kept.push_back(newest);
    while kept.len() > MOST_KEPT || kept.front().is_some_and(|(time, _)| newest.0 - time > secs) {
        kept.pop_front();
    }
}

/// Weight of a new sample in a first-order low-pass.
fn smoothing(cutoff_hz: f64, dt_secs: f64) -> f64 {
    let decay_secs = 1.0 / (std::f64::consts::TAU * cutoff_hz);
    dt_secs / (dt_secs + decay_secs)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const DT: f64 = 1.0 / 120.0;

    fn filter() -> GazeFilter {
        GazeFilter::new(FilterSettings::default())
    }

    /// Feeds a steady point for so many samples from a time on; the last answer.
    fn rest(filter: &mut GazeFilter, from: f64, count: u32, point: [f64; 2]) -> Filtered {
        (0..count).map(|step| filter.update(from + f64::from(step) * DT, Some(point)).unwrap()).last().unwrap()
    }

    #[test]
    fn a_jump_is_followed_with_the_first_sample_after_it() {
        let mut filter = filter();
        rest(&mut filter, 0.0, 60, [0.0, 0.0]);
        let landed = filter.update(0.5, Some([8.0, 0.0])).unwrap();
        assert_eq!((landed.point_deg, landed.phase, landed.restarted), ([8.0, 0.0], Phase::Saccade, true));
        let resting = rest(&mut filter, 0.5 + DT, 30, [8.0, 0.0]);
        assert_eq!((resting.point_deg, resting.phase), ([8.0, 0.0], Phase::Fixation));
    }

    #[test]
    fn pursuit_at_10_degrees_a_second_is_followed_within_one() {
        let mut filter = filter();
        let mut last = 0.0;
        for step in 0..240 {
            let x = f64::from(step) * DT * 10.0;
            let answer = filter.update(f64::from(step) * DT, Some([x, 0.0])).unwrap();
            last = x - answer.point_deg[0];
        }
        assert!((0.0..1.0).contains(&last), "lags by {last} deg at 10 deg/s");
    }

    #[test]
    fn a_clock_that_stands_still_fills_no_memory() {
        let mut filter = filter();
        filter.update(5.0, Some([0.0; 2]));
        for step in 0..20_000 {
            filter.update(0.0, Some([f64::from(step % 7) * 0.01, 0.0]));
        }
        assert!(filter.recent.len() <= MOST_KEPT && filter.outputs.len() <= MOST_KEPT);
    }

    #[test]
    fn a_blink_holds_what_was_before_the_lid_moved() {
        let mut filter = filter();
        rest(&mut filter, 0.0, 60, [3.0, 1.0]);
        // The lid drags the point down for 40 ms, closes for 200 ms, and drags it up again.
        for step in 0..4 {
            filter.update(0.5 + f64::from(step) * DT, Some([3.0, 1.0 - 0.4 * f64::from(step)])).unwrap();
        }
        let mut held = Vec::new();
        for step in 4..28 {
            held.push(filter.update(0.5 + f64::from(step) * DT, None).unwrap());
        }
        for step in 28..39 {
            held.push(filter.update(0.5 + f64::from(step) * DT, Some([3.0, -2.0])).unwrap());
        }
        for answer in &held[5..] {
            assert_eq!((answer.phase, answer.restarted), (Phase::Blink, false));
            assert!(distance(answer.point_deg, [3.0, 1.0]) < 1e-6, "{answer:?}");
        }
        let open = rest(&mut filter, 0.5 + 41.0 * DT, 5, [3.2, 1.1]);
        assert_eq!((open.phase, open.point_deg), (Phase::Fixation, [3.2, 1.1]));
    }

    #[test]
    fn a_dropout_of_one_sample_changes_nothing() {
        let mut filter = filter();
        rest(&mut filter, 0.0, 60, [3.0, 1.0]);
        let gone = filter.update(0.5, None).unwrap();
        assert_eq!((gone.phase, gone.point_deg), (Phase::Fixation, [3.0, 1.0]));
        let back = filter.update(0.5 + DT, Some([3.0, 1.0])).unwrap();
        assert_eq!((back.phase, back.restarted), (Phase::Fixation, false));
    }

    #[test]
    fn the_eye_is_lost_after_half_a_second_unless_the_tracker_is_slow() {
        let mut fast = filter();
        assert_eq!(fast.update(0.0, None), None, "nothing is known yet");
        rest(&mut fast, 0.0, 60, [0.0, 0.0]);
        assert_eq!(fast.update(0.5 + 0.45, None).unwrap().phase, Phase::Blink);
        assert_eq!(fast.update(0.5 + 0.55, None).unwrap().phase, Phase::Lost);
        let mut slow = filter();
        for step in 0..10 {
            slow.update(f64::from(step), Some([0.0, 0.0]));
        }
        assert!(slow.patience_secs() > 2.0 && fast.patience_secs() == LOST_SECS);
    }

    #[test]
    fn rates_from_1_to_2000_hz_give_finite_answers() {
        for rate in [1.0, 10.0, 60.0, 500.0, 2000.0] {
            let mut filter = filter();
            for step in 0..4000 {
                let point = [f64::from(step % 97) * 0.01, f64::from(step / 500)];
                let answer = filter.update(f64::from(step) / rate, Some(point)).unwrap();
                assert!(answer.point_deg.iter().all(|value| value.is_finite()), "{rate} Hz: {answer:?}");
                assert!(filter.recent.len() <= 202 && filter.outputs.len() <= 402);
            }
        }
    }
}
