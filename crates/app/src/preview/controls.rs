//! What a person can set in the window, and what the window tells them.

use std::time::{Duration, Instant};

use tracer::view::DebugView;

use super::compare::Comparison;
use super::seeing::Seen;
use crate::attention::Attention;
use crate::cli::PreviewArgs;
use crate::cli::choices::{Clip, EccentricityAt, Mode, Switch, ToneMapping};
use crate::cli::values::EXPOSURE_EV;
use crate::convergence::Convergence;
use crate::sampling::Acuity;
use crate::screen::ScreenGeometry;

/// Settings of the window. None of them restarts the film.
#[derive(Clone, Debug, PartialEq)]
pub struct Controls {
    /// How samples are distributed.
    pub mode: Mode,
    /// What the foveated mode goes by.
    pub acuity: Acuity,
    /// More samples to where the film is visibly noisy; not in a headset.
    pub adaptive: bool,
    /// Whether foveated samples are clipped to the view.
    pub clip: Clip,
    /// Where eccentricity is measured.
    pub eccentricity: EccentricityAt,
    /// The screen before the eye.
    pub screen: ScreenGeometry,
    /// Stops by which the picture is brightened.
    pub exposure_ev: f32,
    /// From radiance to display values.
    pub tone_map: ToneMapping,
    /// What one key goes back to from false colour.
    pub usual_tone_map: ToneMapping,
    /// The picture is reconstructed with guides as soon as they are known.
    pub denoise: bool,
    /// What the picture shows.
    pub shown: DebugView,
    /// What one key shows in the picture's place.
    pub inspected: DebugView,
    /// The histogram is looked at.
    pub histogram: bool,
    /// A second mode that is shown beside the first.
    pub comparison: Option<Comparison>,
    /// No tracing while true.
    pub paused: bool,
    /// The trial of split times that is shown: its picture starts empty and is of its samples alone.
    pub trial: Option<u64>,
    /// Where else samples are wanted.
    pub attention: Attention,
}

impl From<&PreviewArgs> for Controls {
    fn from(args: &PreviewArgs) -> Self {
        Self {
            mode: args.sampling.mode,
            acuity: args.sampling.acuity(),
            adaptive: args.sampling.adaptive == Switch::On,
            clip: args.clip,
            eccentricity: args.eccentricity,
            screen: args.sampling.screen(),
            exposure_ev: args.picture.exposure,
            tone_map: args.picture.tonemap,
            usual_tone_map: Some(args.picture.tonemap)
                .filter(|map| *map != ToneMapping::FalseColor)
                .unwrap_or(ToneMapping::Agx),
            denoise: args.picture.denoise == Switch::On,
            shown: args.picture.show.into(),
            inspected: Some(args.picture.show.into())
                .filter(|shown| *shown != DebugView::Beauty)
                .unwrap_or(DebugView::SampleDensity),
            histogram: false,
            comparison: None,
            paused: false,
            trial: None,
            attention: Attention::default(),
        }
    }
}

impl Controls {
    /// Brightens the picture by so many stops, as far as `--exposure` goes.
    pub fn brighten(&mut self, stops: f32) {
        self.exposure_ev = (self.exposure_ev + stops).clamp(*EXPOSURE_EV.start(), *EXPOSURE_EV.end());
    }
}

/// Figures of a running preview.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readout {
    /// Samples in the film.
    pub samples: u64,
    /// Samples a second over the last second or so, while tracing.
    pub samples_per_s: f64,
    /// Samples in the film pixel at the gaze, averaged over its neighbourhood.
    pub spp_at_gaze: f32,
    /// How far the picture at the gaze has come.
    pub convergence: Convergence,
    /// Time spent tracing since the film started.
    pub elapsed: Duration,
    /// Time spent tracing since the window opened.
    pub traced: Duration,
    /// When that was read; `None` before the first picture.
    pub read_at: Option<Instant>,
    /// Samples that were not finite and were dropped.
    pub non_finite_dropped: u64,
    /// What is known about the picture as it was last shown.
    pub seen: Seen,
}

/// Short names and explanations of the modes, in the order of their buttons.
pub const MODES: [(Mode, &str, &str); 4] = [
    (Mode::Fv, "Foveated", "Samples where the eye sees sharply: about the gaze, by visual acuity"),
    (Mode::Vp, "Viewport", "Samples uniform over the visible view"),
    (Mode::VpRegion, "Region", "Samples uniform over the film's pixels inside the view"),
    (Mode::Od, "Panorama", "Samples uniform over the whole panorama"),
];

/// Names of the tone maps.
pub const TONE_MAPS: [(ToneMapping, &str); 4] = [
    (ToneMapping::Agx, "AgX"),
    (ToneMapping::PbrNeutral, "PBR Neutral"),
    (ToneMapping::Linear, "Linear"),
    (ToneMapping::FalseColor, "False colour"),
];

/// A count with a metric prefix and three digits: `1.23 M`.
pub fn metric(value: f64) -> String {
    let prefixes = [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k"), (1.0, "")];
    let (scale, prefix) = prefixes.into_iter().find(|(scale, _)| value.abs() >= *scale).unwrap_or((1.0, ""));
    let scaled = value / scale;
    let digits = match scaled.abs() {
        magnitude if magnitude >= 100.0 => 0,
        magnitude if magnitude >= 10.0 => 1,
        _ => 2,
    };
    // Whole numbers below a thousand need no decimals.
    let digits = if prefix.is_empty() && scaled.fract() == 0.0 { 0 } else { digits };
    format!("{scaled:.digits$}{prefix}")
}

/// `4.2 s`, `3:07` or `1:02:03`.
pub fn clock(elapsed: Duration) -> String {
    let seconds = elapsed.as_secs();
    match seconds {
        0..60 => format!("{:.1} s", elapsed.as_secs_f64()),
        60..3600 => format!("{}:{:02}", seconds / 60, seconds % 60),
        _ => format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[test]
    fn counts_have_three_digits_and_a_prefix() {
        for (value, text) in
            [(0.0, "0"), (7.0, "7"), (7.25, "7.25"), (1234.0, "1.23 k"), (45_678.0, "45.7 k"), (3.21e8, "321 M")]
        {
            assert_eq!(metric(value), text);
        }
    }

    #[test]
    fn times_read_like_a_clock() {
        for (seconds, text) in [(4.25, "4.2 s"), (187.0, "3:07"), (3723.9, "1:02:03")] {
            assert_eq!(clock(Duration::from_secs_f64(seconds)), text);
        }
    }

    #[test]
    fn the_picture_is_brightened_as_far_as_the_option_goes() {
        let mut controls = Controls::from(&crate::cli::Cli::parse_from(["fovea", "--exposure", "19.75"]).preview);
        controls.brighten(-0.5);
        assert_eq!(controls.exposure_ev, 19.25);
        (0..3).for_each(|_| controls.brighten(0.5));
        assert_eq!(controls.exposure_ev, 20.0);
        (0..100).for_each(|_| controls.brighten(-0.5));
        assert_eq!(controls.exposure_ev, -20.0);
    }

    #[test]
    fn every_mode_has_a_button() {
        let mut modes: Vec<_> = MODES.iter().map(|entry| format!("{:?}", entry.0)).collect();
        modes.sort();
        modes.dedup();
        assert_eq!(modes.len(), 4);
    }
}
