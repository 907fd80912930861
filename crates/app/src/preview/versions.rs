//! When versions of the scene came on screen, and what went to the device for them: how the loop with a DCC is measured.

use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use super::engine::ShownVersion;

/// Most versions that are remembered; the oldest go first.
const MOST: usize = 64;

/// Follows the versions that are shown.
#[derive(Debug, Default)]
pub struct Versions {
    /// Seconds since 1970 by the system's clock, which files are stamped by.
    on_screen: VecDeque<(ShownVersion, f64)>,
    /// Painted in the last frame.
    painted: ShownVersion,
}

impl Versions {
    /// To be called when a frame begins: what the last one painted is on screen by now. True when another frame should follow
    /// at once, to find out when this one was.
    pub fn frame(&mut self, now: SystemTime, painted: ShownVersion) -> bool {
        let last = std::mem::replace(&mut self.painted, painted);
        let known = self.on_screen.back().map_or(0, |(version, _)| version.number);
        if last.number > known {
            if self.on_screen.len() == MOST {
                self.on_screen.pop_front();
            }
            let seconds = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
            self.on_screen.push_back((last, seconds));
        }
        painted.number > last.number
    }

    /// Figures for a screenshot's report.
    pub fn figures(&self) -> Value {
        let entry = |(version, seconds): &(ShownVersion, f64)| {
            json!({
                "number": version.number,
                "on_screen_unix_s": seconds,
                "uploaded_bytes": version.uploaded_bytes,
                "device_bytes": version.device_bytes,
                "kernels_ms": version.kernels.as_secs_f64() * 1e3,
                "prepared_ms": version.prepared.as_secs_f64() * 1e3,
            })
        };
        self.on_screen.iter().map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn version(number: u64) -> ShownVersion {
        ShownVersion { number, ..ShownVersion::default() }
    }

    #[test]
    fn a_version_is_on_screen_when_the_frame_after_it_begins() {
        let mut versions = Versions::default();
        let at = |ms| UNIX_EPOCH + Duration::from_millis(ms);
        assert!(!versions.frame(at(0), version(0)));
        assert!(versions.frame(at(1000), version(1)));
        assert!(!versions.frame(at(1500), version(1)));
        assert!(versions.frame(at(4000), version(3)));
        assert!(versions.frame(at(5000), version(4)));
        assert!(!versions.frame(at(6000), version(4)));
        let times: Vec<_> = versions.on_screen.iter().map(|(version, seconds)| (version.number, *seconds)).collect();
        assert_eq!(times, [(1, 1.5), (3, 5.0), (4, 6.0)]);
        assert_eq!(versions.figures()[1]["number"], 3);
    }

    #[test]
    fn only_so_many_are_remembered() {
        let mut versions = Versions::default();
        for number in 1..=10 * MOST as u64 {
            versions.frame(UNIX_EPOCH, version(number));
        }
        assert_eq!(versions.on_screen.len(), MOST);
    }
}
