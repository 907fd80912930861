//! One-point drift correction: somebody looks at a dot, and what the tracker says differently is taken off from then on.

use super::geometry::angle_between_deg;

/// A correction larger than this is a tracker that needs calibrating, degrees.
pub const LARGEST_DEG: f64 = 8.0;
/// Samples scattered wider than this are no fixation, degrees.
const WIDEST_DEG: f64 = 1.5;
/// Samples that are needed.
pub const FEWEST_SAMPLES: usize = 10;

/// What is taken off every sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriftCorrection {
    /// Degrees, measured minus true.
    pub offset_deg: [f64; 2],
}

/// Why no correction was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriftRefused {
    /// Too few valid samples.
    NoGaze,
    /// The gaze moved, by so many degrees.
    Restless(f64),
    /// So many degrees are beyond a drift.
    TooFar(f64),
}

impl std::fmt::Display for DriftRefused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoGaze => f.write_str("no valid gaze while the dot was shown"),
            Self::Restless(deg) => write!(f, "the gaze wandered by {deg:.1} degrees; look at the dot"),
            Self::TooFar(deg) => write!(f, "the gaze was {deg:.1} degrees from the dot; calibrate the tracker instead"),
        }
    }
}

impl DriftCorrection {
    /// From samples without correction, of somebody who looked at `target_deg`.
    ///
    /// # Errors
    /// Too few samples, a gaze that did not rest, or one too far away.
    pub fn measure(target_deg: [f64; 2], samples_deg: &[[f64; 2]]) -> Result<Self, DriftRefused> {
        if samples_deg.len() < FEWEST_SAMPLES {
            return Err(DriftRefused::NoGaze);
        }
        let centre = [median(samples_deg, 0), median(samples_deg, 1)];
        let mut distances: Vec<f64> = samples_deg.iter().map(|sample| angle_between_deg(*sample, centre)).collect();
        distances.sort_by(f64::total_cmp);
        let spread = distances[distances.len() * 3 / 4];
        if spread > WIDEST_DEG {
            return Err(DriftRefused::Restless(spread));
        }
        let distance = angle_between_deg(centre, target_deg);
        if distance > LARGEST_DEG {
            return Err(DriftRefused::TooFar(distance));
        }
        Ok(Self { offset_deg: [centre[0] - target_deg[0], centre[1] - target_deg[1]] })
    }

    /// A sample without the drift, degrees.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x - self.offset_deg[0], y - self.offset_deg[1]]
    }
}

fn median(samples: &[[f64; 2]], axis: usize) -> f64 {
    let mut values: Vec<f64> = samples.iter().map(|sample| sample[axis]).collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn samples(centre: [f64; 2], spread: f64) -> Vec<[f64; 2]> {
        let around = |step: i32| [centre[0] + spread * f64::from(step % 3), centre[1] + spread * f64::from(step % 5)];
        (-7..=7).map(around).collect()
    }

    #[test]
    fn the_offset_is_taken_off_and_single_outliers_do_not_matter() {
        let mut seen = samples([2.5, -1.0], 0.05);
        seen.push([40.0, 40.0]);
        let drift = DriftCorrection::measure([1.0, -2.0], &seen).unwrap();
        let corrected = drift.apply([2.5, -1.0]);
        assert!((corrected[0] - 1.0).abs() < 0.1 && (corrected[1] + 2.0).abs() < 0.15, "{corrected:?}");
        assert_eq!(DriftCorrection::default().apply([3.0, 4.0]), [3.0, 4.0]);
    }

    #[test]
    fn what_is_no_drift_is_refused_with_the_reason() {
        assert_eq!(DriftCorrection::measure([0.0; 2], &samples([0.0; 2], 0.1)[..5]), Err(DriftRefused::NoGaze));
        let restless = DriftCorrection::measure([0.0; 2], &samples([0.0; 2], 3.0)).unwrap_err();
        assert!(matches!(restless, DriftRefused::Restless(deg) if deg > 1.5), "{restless}");
        let far = DriftCorrection::measure([0.0; 2], &samples([12.0, 0.0], 0.01)).unwrap_err();
        assert!(matches!(far, DriftRefused::TooFar(deg) if (deg - 12.0).abs() < 0.1), "{far}");
    }
}
