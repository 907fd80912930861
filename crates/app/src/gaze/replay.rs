//! A recording as a source.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context;

use super::feed::MAX_SAMPLES;
use super::parse::trace::{Space, Trace};
use super::sample::{GazeSample, Point};
use super::source::{GazeSource, SourceState, SourceStatus};

/// Plays a trace at the speed at which it was recorded, by the clock that [`GazeSource::poll`] is given.
#[derive(Debug)]
pub struct Replay {
    name: String,
    trace: Trace,
    repeats: bool,
    /// When the current round began.
    start: Option<Instant>,
    next: usize,
    /// Device seconds of all rounds before this one.
    before_secs: f64,
    received: u64,
}

impl Replay {
    /// Reads a trace.
    ///
    /// # Errors
    /// When the file cannot be read or is no trace.
    pub fn open(path: &Path, repeats: bool) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let trace = Trace::parse(&text).with_context(|| path.display().to_string())?;
        let mut name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        if trace.is_cut_off {
            name += ", whose last row is cut off";
        }
        Ok(Self::new(name, trace, repeats))
    }

    /// Plays a trace that is at hand.
    pub fn new(name: String, trace: Trace, repeats: bool) -> Self {
        Self { name, trace, repeats, start: None, next: 0, before_secs: 0.0, received: 0 }
    }

    /// From the first row to the first of the next round, seconds.
    fn round_secs(&self) -> f64 {
        let rows = self.trace.rows.len();
        let duration = self.trace.duration_secs();
        // One interval more than between the first row and the last; a single row comes once a second.
        if rows > 1 { duration * rows as f64 / (rows - 1) as f64 } else { 1.0 }
    }
}

/// A time so many seconds later; `None` beyond what the clock counts.
fn later(start: Instant, secs: f64) -> Option<Instant> {
    start.checked_add(Duration::try_from_secs_f64(secs).ok()?)
}

/// The point of a trace's row as a sample has it.
pub fn point(space: Space, point: [f64; 2]) -> Point {
    match space {
        Space::Screen01 => Point::Screen01(point),
        Space::ViewDeg => Point::ViewDeg(point),
    }
}

impl GazeSource for Replay {
    fn status(&self) -> SourceStatus {
        let over = !self.repeats && self.next >= self.trace.rows.len();
        SourceStatus {
            state: if over { SourceState::Lost("the recording is over".into()) } else { SourceState::Connected },
            detail: self.name.clone(),
            synchronised: true,
            received: self.received,
            ..SourceStatus::default()
        }
    }

    fn poll(&mut self, now: Instant, samples: &mut Vec<GazeSample>) {
        let mut start = *self.start.get_or_insert(now);
        let Some(first) = self.trace.rows.first().map(|row| row.time_secs) else { return };
        // A program that was suspended skips what it missed instead of playing hours at once.
        if self.repeats && now.saturating_duration_since(start).as_secs_f64() > 2.0 * self.round_secs() + 1.0 {
            start = now;
            (self.start, self.next) = (Some(now), 0);
            self.before_secs += self.round_secs();
        }
        // What is more than a busy reader gets from a tracker comes with the next call, so that no trace holds the reader up.
        let most = samples.len() + MAX_SAMPLES;
        while samples.len() < most {
            let Some(row) = self.trace.rows.get(self.next) else {
                if !self.repeats {
                    return;
                }
                let round = self.round_secs();
                let Some(next) = later(start, round) else { return };
                start = next;
                self.start = Some(start);
                self.before_secs += round;
                self.next = 0;
                continue;
            };
            let Some(due) = later(start, row.time_secs - first).filter(|due| *due <= now) else { return };
            samples.push(GazeSample {
                device_secs: self.before_secs + row.time_secs,
                captured: due,
                arrived: due,
                point: point(self.trace.header.space, row.point),
                valid: row.valid,
                confidence: row.confidence,
            });
            self.received += 1;
            self.next += 1;
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::gaze::parse::trace::Row;

    const TEXT: &str = "# gaze-trace v1; space=screen01\n10,0.1,0.1,1,1\n10.5,0.2,0.2,0,0\n11,0.3,0.3,1,1\n";

    fn times(replay: &mut Replay, now: Instant) -> Vec<f64> {
        let mut samples = Vec::new();
        replay.poll(now, &mut samples);
        assert!(samples.iter().all(|sample| sample.captured <= now));
        samples.iter().map(|sample| sample.device_secs).collect()
    }

    #[test]
    fn rows_come_at_their_time_and_then_it_is_over() {
        let start = Instant::now();
        let mut replay = Replay::new("t".into(), Trace::parse(TEXT).unwrap(), false);
        assert_eq!(times(&mut replay, start), [10.0]);
        assert_eq!(times(&mut replay, start + Duration::from_millis(400)), [0.0; 0]);
        assert_eq!(replay.status().state, SourceState::Connected);
        assert_eq!(times(&mut replay, start + Duration::from_secs(60)), [10.5, 11.0]);
        assert!(matches!(replay.status().state, SourceState::Lost(_)));
    }

    #[test]
    fn a_loop_goes_on_with_increasing_times() {
        let start = Instant::now();
        let mut replay = Replay::new("t".into(), Trace::parse(TEXT).unwrap(), true);
        let mut all = Vec::new();
        for step in 0..40 {
            all.extend(times(&mut replay, start + Duration::from_millis(100) * step));
        }
        assert_eq!(all, [10.0, 10.5, 11.0, 11.5, 12.0, 12.5, 13.0, 13.5]);
        let late = times(&mut replay, start + Duration::from_secs(3600));
        assert!(late.len() <= 1 && late.iter().all(|time| *time > 13.5), "{late:?}");
    }

    #[test]
    fn a_trace_of_any_times_neither_panics_nor_holds_up_the_reader() {
        let start = Instant::now();
        for secs in [[0.0, 1e19], [0.0, 1e-10], [0.0, 0.0], [f64::MIN, f64::MAX], [1.0, 0.0], [f64::NAN, 0.0]] {
            let row = |time_secs| Row { time_secs, point: [0.5; 2], valid: true, confidence: 1.0 };
            let trace = Trace { rows: secs.map(row).to_vec(), ..Trace::default() };
            for repeats in [false, true] {
                let mut replay = Replay::new("t".into(), trace.clone(), repeats);
                for wait in [0, 1, 1_000_000, 1_000_000_000] {
                    let mut samples = Vec::new();
                    replay.poll(start + Duration::from_micros(wait), &mut samples);
                    assert!(samples.len() <= MAX_SAMPLES, "{secs:?}: {}", samples.len());
                }
            }
        }
    }

    #[test]
    fn what_is_left_over_by_one_call_comes_with_the_next() {
        let start = Instant::now();
        let rows = (0..10_000).map(|step| format!("{},0.1,0.1,1,1\n", f64::from(step) * 1e-3));
        let text = format!("# gaze-trace v1; space=screen01\n{}", rows.collect::<String>());
        let mut replay = Replay::new("t".into(), Trace::parse(&text).unwrap(), false);
        times(&mut replay, start);
        let after_a_minute = start + Duration::from_secs(60);
        let counts = [0; 3].map(|_| times(&mut replay, after_a_minute).len());
        assert_eq!(counts, [MAX_SAMPLES, MAX_SAMPLES, 9_999 - 2 * MAX_SAMPLES]);
    }
}
