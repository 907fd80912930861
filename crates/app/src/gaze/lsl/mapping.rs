//! Which channels of a stream hold the gaze, in which unit and from which corner.

use crate::gaze::parse::excerpt;
use crate::gaze::parse::lsl_info::{Channel, StreamInfo};
use crate::gaze::sample::Point;

/// Labels of a stream that a message names.
const LABELS_SAID: usize = 32;

/// A channel by its place, from 0, or by its label.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selector {
    /// Place in the sample.
    Index(usize),
    /// Label, capitals or not.
    Label(String),
}

impl Selector {
    /// From `3` or `BPOGX`.
    pub fn new(text: &str) -> Self {
        text.parse().map_or_else(|_| Self::Label(text.to_owned()), Self::Index)
    }

    fn find(&self, info: &StreamInfo) -> Result<usize, String> {
        let labels: &[Channel] = &info.channels;
        match self {
            Self::Index(index) if *index < info.channel_count => Ok(*index),
            Self::Index(index) => Err(format!("channel {index} of a stream with {}", info.channel_count)),
            Self::Label(label) => {
                labels.iter().position(|channel| channel.label.eq_ignore_ascii_case(label)).ok_or_else(|| {
                    let known: Vec<String> =
                        labels.iter().take(LABELS_SAID).map(|channel| excerpt(&channel.label)).collect();
                    format!("no channel `{label}`; there are: {}", known.join(", "))
                })
            }
        }
    }
}

/// What a coordinate counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// Fractions of the screen.
    Fraction,
    /// Pixels of a screen of this size.
    Pixels([f64; 2]),
    /// Degrees at the eye.
    Degrees,
}

/// Where a coordinate is 0, and which way y goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// y down.
    TopLeft,
    /// y up.
    BottomLeft,
    /// y up.
    Centre,
}

/// Channels, unit and origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    /// Pairs of x and y, one or one for each eye; the mean of those that are finite counts.
    pub eyes: Vec<[Selector; 2]>,
    /// Channels that are 1 for a valid sample, as many as eyes or none.
    pub valid: Vec<Selector>,
    /// Channel of the confidence, 0..=1.
    pub confidence: Option<Selector>,
    /// Unit of x and y.
    pub unit: Unit,
    /// Origin of x and y.
    pub origin: Origin,
}

impl Mapping {
    fn new(eyes: &[[&str; 2]], valid: &[&str], confidence: Option<&str>, origin: Origin) -> Self {
        Self {
            eyes: eyes.iter().map(|eye| eye.map(Selector::new)).collect(),
            valid: valid.iter().map(|label| Selector::new(label)).collect(),
            confidence: confidence.map(Selector::new),
            unit: Unit::Fraction,
            origin,
        }
    }

    /// The channels that a known feeder uses.
    pub fn preset(name: &str) -> Option<Self> {
        let tobii =
            ["left", "right"].map(|eye| ["x", "y"].map(|axis| format!("{eye}_gaze_point_on_display_area_{axis}")));
        let tobii_valid = ["left_gaze_point_validity", "right_gaze_point_validity"];
        Some(match name {
            "gazepoint" => Self::new(&[["BPOGX", "BPOGY"]], &["BPOGV"], None, Origin::TopLeft),
            "gazepoint-fixation" => Self::new(&[["FPOGX", "FPOGY"]], &["FPOGV"], None, Origin::TopLeft),
            "pupil" => Self::new(&[["norm_pos_x", "norm_pos_y"]], &[], Some("confidence"), Origin::BottomLeft),
            "tobii" => {
                let eyes = [0, 1].map(|eye| [0, 1].map(|axis| tobii[eye][axis].as_str()));
                Self::new(&eyes, &tobii_valid, None, Origin::TopLeft)
            }
            "xy" => Self::new(&[["0", "1"]], &[], None, Origin::TopLeft),
            _ => return None,
        })
    }

    /// Names that [`Mapping::preset`] knows, in the order in which [`Mapping::guess`] tries them.
    pub const PRESETS: [&str; 5] = ["gazepoint", "gazepoint-fixation", "tobii", "pupil", "xy"];

    /// The first preset whose channels the stream has; the last one takes the first two channels.
    pub fn guess(info: &StreamInfo) -> Self {
        let fits = |mapping: &Self| mapping.resolve(info).is_ok();
        let presets = Self::PRESETS.into_iter().filter_map(Self::preset);
        presets.into_iter().find(fits).unwrap_or_else(|| Self::new(&[["0", "1"]], &[], None, Origin::TopLeft))
    }

    /// Finds the channels in a stream.
    ///
    /// # Errors
    /// A channel that the stream does not have.
    pub fn resolve(&self, info: &StreamInfo) -> Result<Channels, String> {
        let find = |selector: &Selector| selector.find(info);
        let eyes = self.eyes.iter().map(|[x, y]| Ok([find(x)?, find(y)?])).collect::<Result<_, String>>()?;
        Ok(Channels {
            eyes,
            valid: self.valid.iter().map(find).collect::<Result<_, _>>()?,
            confidence: self.confidence.as_ref().map(find).transpose()?,
            unit: self.unit,
            origin: self.origin,
        })
    }
}

/// A mapping for one stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    eyes: Vec<[usize; 2]>,
    valid: Vec<usize>,
    confidence: Option<usize>,
    unit: Unit,
    origin: Origin,
}

impl Channels {
    /// The gaze in a sample, whether it is valid, and its confidence.
    pub fn gaze(&self, values: &[f64]) -> (Point, bool, f64) {
        let value = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
        // With a flag for each eye, an eye counts by its own.
        let flagged = |eye: usize| match self.valid.get(eye).or(self.valid.first()) {
            Some(channel) => value(*channel) > 0.5,
            None => true,
        };
        let eyes = self.eyes.iter().enumerate().filter(|(eye, _)| flagged(*eye));
        let points = eyes.map(|(_, [x, y])| [value(*x), value(*y)]).filter(|[x, y]| x.is_finite() && y.is_finite());
        let (sum, count) = points.fold(([0.0; 2], 0.0), |(sum, count), [x, y]| ([sum[0] + x, sum[1] + y], count + 1.0));
        let confidence = self.confidence.map_or(1.0, value);
        let valid = count > 0.0 && confidence >= 0.6;
        let mean = if count > 0.0 { sum.map(|value| value / count) } else { [0.0; 2] };
        let confidence = if confidence >= 0.0 { confidence.min(1.0) } else { 0.0 };
        (self.point(mean), valid, confidence)
    }

    fn point(&self, [x, y]: [f64; 2]) -> Point {
        let [x, y] = match self.unit {
            Unit::Fraction => [x, y],
            Unit::Pixels([width, height]) => [x / width, y / height],
            Unit::Degrees => {
                return Point::ViewDeg([x, if self.origin == Origin::TopLeft { -y } else { y }]);
            }
        };
        Point::Screen01(match self.origin {
            Origin::TopLeft => [x, y],
            Origin::BottomLeft => [x, 1.0 - y],
            Origin::Centre => [0.5 + x, 0.5 - y],
        })
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::gaze::parse::lsl_info::ChannelFormat;

    fn stream(labels: &[&str]) -> StreamInfo {
        let channel = |label: &&str| Channel { label: (*label).to_owned(), unit: String::new() };
        StreamInfo {
            name: String::new(),
            kind: String::new(),
            channel_count: labels.len(),
            format: ChannelFormat::Float32,
            nominal_rate_hz: 60.0,
            source_id: String::new(),
            uid: "u".into(),
            hostname: String::new(),
            data_port: 1,
            service_port: 1,
            channels: labels.iter().map(channel).collect(),
        }
    }

    #[test]
    fn known_feeders_are_recognised_by_their_labels() {
        for (labels, expected) in [
            (&["time", "bpogx", "BPOGY", "BPOGV"][..], "gazepoint"),
            (&["confidence", "norm_pos_x", "norm_pos_y"], "pupil"),
            (&["a", "b", "c"], "xy"),
        ] {
            assert_eq!(Mapping::guess(&stream(labels)), Mapping::preset(expected).unwrap(), "{labels:?}");
        }
        assert!(Mapping::PRESETS.iter().all(|name| Mapping::preset(name).is_some()));
        assert_eq!(Mapping::preset("unheard-of"), None);
        let missing = Mapping::preset("pupil").unwrap().resolve(&stream(&["a", "b"])).unwrap_err();
        assert!(missing.contains("norm_pos_x") && missing.contains("a, b"), "{missing}");
    }

    #[test]
    fn units_and_origins_end_at_the_top_left() {
        let gaze = |unit, origin, values: &[f64]| {
            let mapping = Mapping { unit, origin, ..Mapping::preset("xy").unwrap() };
            mapping.resolve(&stream(&["a", "b"])).unwrap().gaze(values).0
        };
        let expected = Point::Screen01([0.25, 0.125]);
        assert_eq!(gaze(Unit::Fraction, Origin::TopLeft, &[0.25, 0.125]), expected);
        assert_eq!(gaze(Unit::Fraction, Origin::BottomLeft, &[0.25, 0.875]), expected);
        assert_eq!(gaze(Unit::Fraction, Origin::Centre, &[-0.25, 0.375]), expected);
        assert_eq!(gaze(Unit::Pixels([1920.0, 1080.0]), Origin::TopLeft, &[480.0, 135.0]), expected);
        assert_eq!(gaze(Unit::Degrees, Origin::Centre, &[3.0, 4.0]), Point::ViewDeg([3.0, 4.0]));
        assert_eq!(gaze(Unit::Degrees, Origin::TopLeft, &[3.0, 4.0]), Point::ViewDeg([3.0, -4.0]));
    }

    #[test]
    fn two_eyes_are_averaged_and_one_is_enough() {
        let labels = [
            "left_gaze_point_on_display_area_x",
            "left_gaze_point_on_display_area_y",
            "left_gaze_point_validity",
            "right_gaze_point_on_display_area_x",
            "right_gaze_point_on_display_area_y",
            "right_gaze_point_validity",
        ];
        let channels = Mapping::guess(&stream(&labels)).resolve(&stream(&labels)).unwrap();
        let both = channels.gaze(&[0.25, 0.5, 1.0, 0.75, 0.75, 1.0]);
        assert_eq!(both, (Point::Screen01([0.5, 0.625]), true, 1.0));
        assert_eq!(channels.gaze(&[0.25, 0.5, 1.0, 0.75, 0.75, 0.0]).0, Point::Screen01([0.25, 0.5]));
        assert_eq!(channels.gaze(&[f64::NAN, 0.5, 1.0, 0.75, 0.75, 1.0]).0, Point::Screen01([0.75, 0.75]));
        assert!(!channels.gaze(&[0.25, 0.5, 0.0, 0.75, 0.75, 0.0]).1);
        assert!(!channels.gaze(&[]).1);
    }
}
