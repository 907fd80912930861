//! The pointer as gaze: at once, or where it last rested.

use std::time::{Duration, Instant};

use super::sample::{GazeSample, Point};
use super::source::{GazeSource, SourceState, SourceStatus};

/// How long the pointer rests before the gaze goes there.
const DWELL: Duration = Duration::from_millis(300);
/// How far a resting pointer may wander, in half widths of the picture.
const RESTING: f64 = 0.03;

/// The pointer over the picture.
#[derive(Debug, Default)]
pub struct Mouse {
    dwell: Option<Dwell>,
    samples: Vec<GazeSample>,
    epoch: Option<Instant>,
    received: u64,
}

/// Where the pointer came to rest, and since when.
#[derive(Clone, Copy, Debug, Default)]
struct Dwell {
    resting: Option<([f64; 2], Instant)>,
    locked: Option<[f64; 2]>,
}

impl Mouse {
    /// The gaze stays where the pointer last rested, so that moving the pointer across the picture costs nothing.
    pub fn with_dwell_lock() -> Self {
        Self { dwell: Some(Dwell::default()), ..Self::default() }
    }

    fn push(&mut self, point: [f64; 2], at: Instant) {
        let epoch = *self.epoch.get_or_insert(at);
        self.received += 1;
        self.samples.push(GazeSample {
            device_secs: at.saturating_duration_since(epoch).as_secs_f64(),
            captured: at,
            arrived: at,
            point: Point::Picture(point),
            valid: true,
            confidence: 1.0,
        });
    }
}

impl Dwell {
    fn follow(&mut self, point: [f64; 2], at: Instant) {
        let rests = self.resting.is_some_and(|(place, _)| distance(place, point) <= RESTING);
        if !rests {
            self.resting = Some((point, at));
        }
    }

    /// A place at which the pointer has rested long enough and where the gaze is not yet.
    fn settled(&mut self, now: Instant) -> Option<[f64; 2]> {
        let (place, since) = self.resting?;
        if now.saturating_duration_since(since) < DWELL || self.locked == Some(place) {
            return None;
        }
        self.locked = Some(place);
        self.locked
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

impl GazeSource for Mouse {
    fn status(&self) -> SourceStatus {
        let detail = if self.dwell.is_some() { "follows a resting pointer" } else { "" };
        SourceStatus {
            state: SourceState::Connected,
            detail: detail.into(),
            synchronised: true,
            received: self.received,
            ..SourceStatus::default()
        }
    }

    fn poll(&mut self, now: Instant, samples: &mut Vec<GazeSample>) {
        if let Some(place) = self.dwell.as_mut().and_then(|dwell| dwell.settled(now)) {
            self.push(place, now);
        }
        samples.append(&mut self.samples);
    }

    fn pointer(&mut self, point: [f64; 2], at: Instant) {
        match &mut self.dwell {
            Some(dwell) => dwell.follow(point, at),
            None => {
                // Nobody reads while a scene loads; the last place is the only one that counts then.
                self.samples.clear();
                self.push(point, at);
            }
        }
    }

    fn is_eye(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(mouse: &mut Mouse, now: Instant) -> Vec<Point> {
        let mut samples = Vec::new();
        mouse.poll(now, &mut samples);
        samples.iter().map(|sample| sample.point).collect()
    }

    #[test]
    fn without_dwell_lock_the_gaze_is_at_the_pointer_at_once() {
        let now = Instant::now();
        let mut mouse = Mouse::default();
        assert!(points(&mut mouse, now).is_empty());
        mouse.pointer([0.1, 0.2], now);
        mouse.pointer([0.3, 0.4], now);
        assert_eq!(points(&mut mouse, now), [Point::Picture([0.3, 0.4])]);
        assert!(points(&mut mouse, now).is_empty());
    }

    #[test]
    fn with_dwell_lock_the_gaze_goes_where_the_pointer_rests() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut mouse = Mouse::with_dwell_lock();
        for step in 0..50_u32 {
            mouse.pointer([f64::from(step) * 0.0625 - 1.0, 0.0], at(u64::from(step) * 10));
        }
        assert!(points(&mut mouse, at(500)).is_empty(), "a moving pointer is not followed");
        mouse.pointer([2.07, 0.01], at(600));
        assert!(points(&mut mouse, at(780)).is_empty());
        assert_eq!(points(&mut mouse, at(800)), [Point::Picture([2.0625, 0.0])]);
        assert!(points(&mut mouse, at(2000)).is_empty(), "told once");
        mouse.pointer([0.0, 0.0], at(2100));
        assert!(points(&mut mouse, at(2200)).is_empty());
        assert_eq!(points(&mut mouse, at(2400)), [Point::Picture([0.0, 0.0])]);
    }
}
