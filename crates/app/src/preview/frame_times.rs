//! How long the window's frames take, and how long they take while somebody holds a button: then every frame is wanted at
//! once, so the time between two is how long the window was busy or stood still.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Frames of which times are kept; beyond, none are added.
const MOST: usize = 1 << 16;

/// Times between frames.
#[derive(Debug, Default)]
pub struct FrameTimes {
    frames: u32,
    longest: Duration,
    last: Option<(Instant, bool)>,
    /// Between frames that both had a button held.
    held: Vec<Duration>,
}

impl FrameTimes {
    /// A frame begins; whether a button is held in it.
    pub fn frame(&mut self, now: Instant, held: bool) {
        self.frames += 1;
        if let Some((last, was_held)) = self.last.replace((now, held)) {
            let took = now.saturating_duration_since(last);
            self.longest = self.longest.max(took);
            if held && was_held && self.held.len() < MOST {
                self.held.push(took);
            }
        }
    }

    /// Figures for a screenshot's report.
    pub fn figures(&self) -> Value {
        let mut held = self.held.clone();
        held.sort_unstable();
        // The nearest rank; 0 where no button was held.
        let quantile = |share: f64| {
            let rank = (share * held.len() as f64).ceil() as usize;
            held.get(rank.max(1) - 1).map_or(0.0, |time| time.as_secs_f64() * 1e3)
        };
        json!({
            "count": self.frames,
            "longest_ms": self.longest.as_secs_f64() * 1e3,
            "held": {
                "count": held.len(),
                "median_ms": quantile(0.5),
                "p99_ms": quantile(0.99),
                "longest_ms": quantile(1.0),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_with_a_button_held_are_counted_apart() {
        let start = Instant::now();
        let mut times = FrameTimes::default();
        let mut now = start;
        let mut step = |ms, held| {
            now += Duration::from_millis(ms);
            times.frame(now, held);
        };
        step(0, false);
        step(900, true);
        (1..=100).for_each(|ms| step(ms, true));
        step(700, false);
        let figures = times.figures();
        assert_eq!((&figures["count"], &figures["longest_ms"]), (&json!(103), &json!(900.0)));
        let held = &figures["held"];
        let found = ["median_ms", "p99_ms", "longest_ms"].map(|key| held[key].as_f64().unwrap_or_default());
        assert_eq!((held["count"].as_u64(), found), (Some(100), [50.0, 99.0, 100.0]));
        assert_eq!(FrameTimes::default().figures()["held"]["p99_ms"], 0.0);
    }
}
