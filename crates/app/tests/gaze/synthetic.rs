//! A synthetic eye: fixations that drift, saccades on the main sequence, blinks with the lid's artefact, white noise.
//!
//! Main sequence: a saccade of A degrees lasts 2.2 A + 21 ms (R. Carpenter, Movements of the Eyes, 1988) along a
//! minimum-jerk profile, whose peak speed is 1.875 times the mean.

use fovea_app::gaze::geometry::WindowPlace;
use fovea_app::gaze::parse::trace::{Header, Row, Space, Trace};
use fovea_app::screen::ScreenGeometry;

/// What the eye does at a row, and where it truly looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truth {
    /// It rests, for so many seconds by now.
    Fixation(f64),
    /// It jumps.
    Saccade,
    /// It is closed, or the lid covers part of it.
    Blink,
}

/// A trace and the truth behind it.
pub struct Synthetic {
    pub trace: Trace,
    /// One for each row.
    pub truth: Vec<(Truth, [f64; 2])>,
}

/// SplitMix64 (G. Steele et al., OOPSLA 2014).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    /// 0..1.
    pub fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Box-Muller.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// The default screen filled by the picture, so that the conversions are those of the program.
pub fn place() -> WindowPlace {
    WindowPlace { screen: ScreenGeometry::default(), ..WindowPlace::default() }
}

/// A time line: where the eye looks from when to when.
enum Piece {
    Rest { at: [f64; 2], drift_deg_per_s: [f64; 2], secs: f64 },
    Jump { from: [f64; 2], to: [f64; 2], secs: f64 },
    Blink { at: [f64; 2], secs: f64 },
}

/// The lid moves the measured pupil for so long before and after it covers it, seconds.
const LID_SECS: f64 = 0.04;

impl Synthetic {
    /// `noise_deg` is the standard deviation along each axis.
    pub fn new(rate_hz: f64, secs: f64, noise_deg: f64, seed: u64) -> Self {
        let pieces = time_line(secs, &mut Random(seed));
        // The noise has a stream of its own: the same eye at every rate and noise.
        let mut noise = Random(seed ^ 0xabcd);
        let mut rows = Vec::new();
        let mut truth = Vec::new();
        let (mut start, mut piece) = (0.0, 0);
        for step in 0..(secs * rate_hz) as u32 {
            let time_secs = f64::from(step) / rate_hz;
            while piece + 1 < pieces.len() && time_secs >= start + pieces[piece].secs() {
                start += pieces[piece].secs();
                piece += 1;
            }
            let (state, true_deg, seen_deg) = pieces[piece].at(time_secs - start);
            let noisy = seen_deg.map(|deg| deg.map(|axis| axis + noise_deg * noise.normal()));
            let row = match noisy {
                Some(deg) => Row { time_secs, point: screen_from_deg(deg), valid: true, confidence: 1.0 },
                None => Row { time_secs, point: [0.0; 2], valid: false, confidence: 0.0 },
            };
            rows.push(row);
            truth.push((state, true_deg));
        }
        let header = Header {
            space: Space::Screen01,
            source: "synthetic".into(),
            screen_mm: Some([531.0, 299.0]),
            distance_mm: Some(650.0),
            rate_hz: Some(rate_hz),
        };
        Self { trace: Trace { header, rows, is_cut_off: false }, truth }
    }
}

fn screen_from_deg(deg: [f64; 2]) -> [f64; 2] {
    place().screen_from_picture(place().picture_from_deg(deg))
}

fn time_line(secs: f64, random: &mut Random) -> Vec<Piece> {
    let (mut pieces, mut at, mut passed, mut next_blink) = (Vec::new(), [0.0, 0.0], 0.0, 2.0);
    while passed < secs + 1.0 {
        let rest = 0.2 + 0.3 * random.uniform();
        let drift_deg_per_s = [0.3 * random.normal(), 0.3 * random.normal()];
        pieces.push(Piece::Rest { at, drift_deg_per_s, secs: rest });
        at = [0, 1].map(|axis| at[axis] + drift_deg_per_s[axis] * rest);
        passed += rest;
        if passed > next_blink {
            let closed = 0.1 + 0.1 * random.uniform();
            pieces.push(Piece::Blink { at, secs: closed + 2.0 * LID_SECS });
            // The eye rests after a blink as before it.
            pieces.push(Piece::Rest { at, drift_deg_per_s: [0.0; 2], secs: 0.3 });
            passed += closed + 2.0 * LID_SECS + 0.3;
            next_blink = passed + 2.0 + 3.0 * random.uniform();
        }
        let to = loop {
            let (amplitude, angle) = (1.5 + 12.0 * random.uniform().powi(2), std::f64::consts::TAU * random.uniform());
            let to = [at[0] + amplitude * angle.cos(), at[1] + amplitude * angle.sin()];
            if to[0].abs() < 18.0 && to[1].abs() < 10.0 {
                break to;
            }
        };
        let amplitude = (to[0] - at[0]).hypot(to[1] - at[1]);
        let jump = 0.0022 * amplitude + 0.021;
        pieces.push(Piece::Jump { from: at, to, secs: jump });
        passed += jump;
        at = to;
    }
    pieces
}

impl Piece {
    fn secs(&self) -> f64 {
        match self {
            Self::Rest { secs, .. } | Self::Jump { secs, .. } | Self::Blink { secs, .. } => *secs,
        }
    }

    /// What the eye does, where it truly looks, and where the tracker sees it look.
    fn at(&self, time: f64) -> (Truth, [f64; 2], Option<[f64; 2]>) {
        match self {
            Self::Rest { at, drift_deg_per_s, .. } => {
                let point = [0, 1].map(|axis| at[axis] + drift_deg_per_s[axis] * time);
                (Truth::Fixation(time), point, Some(point))
            }
            Self::Jump { from, to, secs } => {
                let s = (time / secs).clamp(0.0, 1.0);
                let share = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
                let point = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
                (Truth::Saccade, point, Some(point))
            }
            Self::Blink { at, secs } => {
                let edge = time.min(secs - time);
                let pulled = [at[0], at[1] - 3.0 * (1.0 - edge / LID_SECS)];
                let seen = (edge < LID_SECS).then_some(if time < LID_SECS {
                    [at[0], at[1] - 3.0 * time / LID_SECS]
                } else {
                    pulled
                });
                (Truth::Blink, *at, seen)
            }
        }
    }
}
