//! The filter's figures on synthetic eyes at the trackers' rates.

use fovea_app::gaze::filter::{FilterSettings, GazeFilter};

use crate::synthetic::{Synthetic, Truth, place};

/// Figures of one filter at one rate.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    /// Root mean square of the distance from the truth, from 50 ms after landing, degrees: both axes together.
    rms_deg: f64,
    /// The same along one axis.
    axis_rms_deg: f64,
    /// The raw gaze's, both axes together.
    raw_rms_deg: f64,
    /// Median and 95th percentile of the time from landing to within 1 degree, milliseconds.
    landing_ms: [f64; 2],
    /// Restarts in fixations, from 50 ms after landing, a second of fixation.
    false_resets_per_s: f64,
    /// Saccades.
    saccades: usize,
}

/// The filter's settings were chosen on seed 7; the figures are of another.
const SEED: u64 = 2026;

fn measure(rate_hz: f64, noise_deg: f64, secs: f64, settings: FilterSettings) -> Figures {
    let eye = Synthetic::new(rate_hz, secs, noise_deg, SEED);
    let mut filter = GazeFilter::new(settings);
    let (mut squares, mut raw_squares, mut count) = (0.0, 0.0, 0_u32);
    let (mut landings, mut landed_at, mut resets) = (Vec::new(), None, 0_u32);
    let mut before = Truth::Fixation(0.0);
    let mut since_blink = f64::INFINITY;
    for (row, (truth, true_deg)) in eye.trace.rows.iter().zip(&eye.truth) {
        let deg = place().deg_from_screen(row.point, None);
        let answer = filter.update(row.time_secs, row.valid.then_some(deg));
        since_blink = if *truth == Truth::Blink { 0.0 } else { since_blink + 1.0 / rate_hz };
        let Some(answer) = answer else { continue };
        let error = (answer.point_deg[0] - true_deg[0]).hypot(answer.point_deg[1] - true_deg[1]);
        let after_blink = since_blink < 0.3;
        if let Truth::Fixation(resting) = truth {
            if before == Truth::Saccade {
                landed_at = Some(row.time_secs - resting);
            }
            if let Some(landed) = landed_at.filter(|_| error < 1.0) {
                landings.push((row.time_secs - landed) * 1e3);
                landed_at = None;
            }
            if *resting > 0.05 && !after_blink && row.time_secs > 1.0 {
                squares += error * error;
                raw_squares += (deg[0] - true_deg[0]).powi(2) + (deg[1] - true_deg[1]).powi(2);
                count += 1;
                resets += u32::from(answer.restarted);
            }
        } else if let Some(landed) = landed_at.take() {
            // The next saccade began before the filter arrived.
            landings.push((row.time_secs - landed) * 1e3);
        }
        before = *truth;
    }
    landings.sort_by(f64::total_cmp);
    let share = |share: f64| landings[((landings.len() - 1) as f64 * share) as usize];
    let mean = squares / f64::from(count);
    Figures {
        rms_deg: mean.sqrt(),
        axis_rms_deg: (mean / 2.0).sqrt(),
        raw_rms_deg: (raw_squares / f64::from(count)).sqrt(),
        landing_ms: [share(0.5), share(0.95)],
        false_resets_per_s: f64::from(resets) / (f64::from(count) / rate_hz),
        saccades: landings.len(),
    }
}

#[test]
fn the_filter_is_steady_in_fixation_and_lands_with_the_eye() {
    eprintln!(
        "| rate Hz | noise deg | rms deg, 2-D | rms deg, axis | raw rms deg, 2-D | landing ms, median | landing ms, p95 | false resets/s | saccades |"
    );
    eprintln!("|---|---|---|---|---|---|---|---|---|");
    for (rate_hz, noise_deg) in [(60.0, 0.3), (120.0, 0.3), (150.0, 0.3), (250.0, 0.3), (120.0, 0.1), (120.0, 1.0)] {
        let found = measure(rate_hz, noise_deg, 600.0, FilterSettings::default());
        let Figures { rms_deg, axis_rms_deg, raw_rms_deg, landing_ms: [median, p95], false_resets_per_s, saccades } =
            found;
        eprintln!(
            "| {rate_hz} | {noise_deg} | {rms_deg:.3} | {axis_rms_deg:.3} | {raw_rms_deg:.3} | {median:.1} | {p95:.1} | \
             {false_resets_per_s:.4} | {saccades} |"
        );
        assert!(saccades > 800, "{found:?}");
        if noise_deg == 0.3 {
            // 0.13 degrees along an axis and one sample's time to land, at every rate; a sample lands half an interval
            // after the eye in the mean, and one in five noisy ones at 0.3 degrees needs a second.
            assert!(axis_rms_deg <= 0.13, "{rate_hz} Hz: {found:?}");
            assert!(median <= 0.6 * 1e3 / rate_hz, "{rate_hz} Hz: {found:?}");
            assert!(false_resets_per_s <= 0.05, "{rate_hz} Hz: {found:?}");
        }
    }
}

#[test]
fn the_saccade_reset_is_what_lands_with_the_eye() {
    // Without resets the same filter needs an order of magnitude longer: the figures can tell a filter that is broken.
    let never = FilterSettings { saccade_deg_per_s: 1e9, step_noises: 1e9, ..FilterSettings::default() };
    let slow = measure(120.0, 0.3, 120.0, never);
    let fast = measure(120.0, 0.3, 120.0, FilterSettings::default());
    assert!(slow.landing_ms[0] > 6.0 * fast.landing_ms[0], "{slow:?} {fast:?}");
}
