//! Gaze traces: `# gaze-trace v1; key=value; ...`, then rows of comma-separated numbers.
//!
//! `space=screen01`: `t_s,x,y,valid,conf`, fractions of the screen from its top left. `space=view_deg`:
//! `t_s,yaw_deg,pitch_deg,valid`, + to the right and + up. Times lie within [`MAX_SECS`] and increase by
//! [`MIN_STEP_SECS`] or more; rows that are not valid are kept.

use std::fmt::Write;

use super::{ParseError, excerpt, finite};

/// Rows of the longest trace that is read: a day at 300 Hz.
pub const MAX_ROWS: usize = 26_000_000;
/// Bytes of the longest row that is read.
pub const MAX_ROW: usize = 4096;
/// Farthest time from 0, either way, seconds: clocks that count from 1970 reach it in 2096, and up to there a number of 64
/// bits tells microseconds apart.
pub const MAX_SECS: f64 = 4e9;
/// Shortest time between two rows, seconds: the last digit that is written.
pub const MIN_STEP_SECS: f64 = 1e-6;

/// What the two coordinates of a row are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Space {
    /// Fractions of the screen from its top left.
    #[default]
    Screen01,
    /// Degrees from the view's centre, + to the right and + up.
    ViewDeg,
}

impl Space {
    fn name(self) -> &'static str {
        match self {
            Self::Screen01 => "screen01",
            Self::ViewDeg => "view_deg",
        }
    }

    fn columns(self) -> &'static str {
        match self {
            Self::Screen01 => "t_s,x,y,valid,conf",
            Self::ViewDeg => "t_s,yaw_deg,pitch_deg,valid",
        }
    }
}

/// A trace's first line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// What the coordinates are.
    pub space: Space,
    /// Where the trace comes from.
    pub source: String,
    /// Width and height of the screen, millimetres.
    pub screen_mm: Option<[f64; 2]>,
    /// From the eye to the screen, millimetres.
    pub distance_mm: Option<f64>,
    /// Rows a second, as the tracker states it.
    pub rate_hz: Option<f64>,
}

impl Header {
    /// From the first line.
    ///
    /// # Errors
    /// Another format, another version, no or an unknown space, or a number that is none. Unknown keys are passed over.
    pub fn parse(line: &str) -> Result<Self, ParseError> {
        let mut parts = line.trim_start_matches('\u{feff}').split(';').map(str::trim);
        let first = parts.next().unwrap_or_default();
        match first.strip_prefix('#').map(str::trim) {
            Some("gaze-trace v1") => {}
            Some(other) if other.starts_with("gaze-trace") => {
                return Err(ParseError::Unsupported(format!("`{}`; this reads gaze-trace v1", excerpt(other))));
            }
            _ => return Err(ParseError::malformed("no gaze trace: line 1 must begin with `# gaze-trace v1`")),
        }
        let mut header = Self::default();
        let mut space = None;
        for part in parts.filter(|part| !part.is_empty()) {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| ParseError::malformed(format!("line 1: `{}` is not key=value", excerpt(part))))?;
            let positive = |text: &str| {
                finite(text)
                    .filter(|value| *value > 0.0)
                    .ok_or_else(|| ParseError::malformed(format!("line 1: {key}=`{}`", excerpt(value))))
            };
            match key.trim() {
                "space" => {
                    let known =
                        [Space::Screen01, Space::ViewDeg].into_iter().find(|known| known.name() == value.trim());
                    space = Some(known.ok_or_else(|| {
                        ParseError::Unsupported(format!("space `{}`; known are screen01 and view_deg", excerpt(value)))
                    })?);
                }
                "source" => header.source = one_field(value),
                "distance_mm" => header.distance_mm = Some(positive(value)?),
                "rate_hz" => header.rate_hz = Some(positive(value)?),
                "screen_mm" => {
                    let (width, height) = value.split_once('x').unwrap_or((value, ""));
                    header.screen_mm = Some([positive(width)?, positive(height)?]);
                }
                _ => {}
            }
        }
        header.space = space.ok_or_else(|| ParseError::malformed("line 1 names no space"))?;
        Ok(header)
    }

    /// The first two lines of a file.
    pub fn write(&self) -> String {
        let mut text = format!("# gaze-trace v1; source={}; space={}", one_field(&self.source), self.space.name());
        let mut add = |key: &str, value: Option<String>| {
            if let Some(value) = value {
                // Writing to a string cannot fail.
                let _ = write!(text, "; {key}={value}");
            }
        };
        add("screen_mm", self.screen_mm.map(|[width, height]| format!("{width}x{height}")));
        add("distance_mm", self.distance_mm.map(|value| value.to_string()));
        add("rate_hz", self.rate_hz.map(|value| value.to_string()));
        text + "\n" + self.space.columns() + "\n"
    }
}

/// Text without what would end its field in the first line.
fn one_field(text: &str) -> String {
    let kept: String = text.chars().filter(|c| !c.is_control() && *c != ';').collect();
    kept.trim().to_owned()
}

/// One sample of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Seconds by the tracker's clock.
    pub time_secs: f64,
    /// In the trace's space.
    pub point: [f64; 2],
    /// Whether the tracker vouches for the point.
    pub valid: bool,
    /// 0..=1.
    pub confidence: f64,
}

impl Row {
    fn parse(line: &str, space: Space) -> Result<Self, String> {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let expected = if space == Space::Screen01 { 5 } else { 4 };
        if fields.len() != expected {
            return Err(format!("{} fields instead of {expected}", fields.len()));
        }
        let number = |text: &str| text.parse::<f64>().map_err(|_| format!("`{}` is no number", excerpt(text)));
        let valid = match fields[3] {
            "0" => false,
            "1" => true,
            other => return Err(format!("valid is `{}`, not 0 or 1", excerpt(other))),
        };
        let time_secs = number(fields[0])?;
        if !time_secs.is_finite() {
            return Err("the time is not finite".into());
        }
        if time_secs.abs() > MAX_SECS {
            return Err(format!("the time {time_secs:e} s is beyond +-{MAX_SECS:e} s"));
        }
        let point = [number(fields[1])?, number(fields[2])?];
        let finite = point.iter().all(|value| value.is_finite());
        if valid && !finite {
            return Err("a valid row whose point is not finite".into());
        }
        let confidence = if space == Space::Screen01 { number(fields[4])? } else { f64::from(u8::from(valid)) };
        if !(0.0..=1.0).contains(&confidence) {
            return Err(format!("conf {confidence} is out of range 0..=1"));
        }
        Ok(Self { time_secs, point: if finite { point } else { [0.0; 2] }, valid, confidence })
    }

    /// The row's line.
    pub fn write(&self, space: Space) -> String {
        let Self { time_secs, point: [x, y], valid, confidence } = self;
        let valid = u8::from(*valid);
        match space {
            Space::Screen01 => format!("{time_secs:.6},{x:.6},{y:.6},{valid},{confidence:.3}\n"),
            Space::ViewDeg => format!("{time_secs:.6},{x:.5},{y:.5},{valid}\n"),
        }
    }
}

/// A whole trace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The first line.
    pub header: Header,
    /// In order of time, at least one.
    pub rows: Vec<Row>,
    /// The file ends within a row, which is left out: whoever wrote it was stopped.
    pub is_cut_off: bool,
}

impl Trace {
    /// From a file's text.
    ///
    /// # Errors
    /// The first line or row that is wrong, by its number.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        let mut lines = text.lines().enumerate().peekable();
        let header = Header::parse(lines.next().map_or("", |(_, line)| line))?;
        let (mut rows, mut is_cut_off): (Vec<Row>, _) = (Vec::new(), false);
        while let Some((index, line)) = lines.next() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') || line == header.space.columns() {
                continue;
            }
            let wrong = |reason: String| ParseError::malformed(format!("line {}: {reason}", index + 1));
            if line.len() > MAX_ROW || rows.len() >= MAX_ROWS {
                return Err(wrong("longer than any trace".into()));
            }
            let row = match Row::parse(line, header.space) {
                Err(_) if lines.peek().is_none() && !text.ends_with('\n') => {
                    is_cut_off = true;
                    break;
                }
                row => row.map_err(wrong)?,
            };
            if let Some(last) = rows.last() {
                let step = row.time_secs - last.time_secs;
                // Two decimal times a microsecond apart can be a little less as binary ones.
                let rounding = f64::EPSILON * row.time_secs.abs().max(last.time_secs.abs());
                if step <= 0.0 || step + rounding < MIN_STEP_SECS {
                    return Err(wrong(format!("the time does not increase by {MIN_STEP_SECS:e} s or more")));
                }
            }
            rows.push(row);
        }
        if rows.is_empty() {
            return Err(ParseError::malformed("a gaze trace without rows"));
        }
        Ok(Self { header, rows, is_cut_off })
    }

    /// From the first row to the last, seconds.
    pub fn duration_secs(&self) -> f64 {
        self.rows.last().zip(self.rows.first()).map_or(0.0, |(last, first)| last.time_secs - first.time_secs)
    }

    /// The file's text.
    pub fn write(&self) -> String {
        let rows = self.rows.iter().map(|row| row.write(self.header.space));
        rows.fold(self.header.write(), |text, row| text + &row)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const TEXT: &str = "# gaze-trace v1; source=gazepoint; space=screen01; screen_mm=531x299; distance_mm=650; rate_hz=120\n\
        t_s,x,y,valid,conf\n0.000000,0.500000,0.250000,1,0.900\n0.008333,nan,0.250000,0,0.000\n";

    #[test]
    fn both_spaces_are_read_and_written() {
        let trace = Trace::parse(TEXT).unwrap();
        assert_eq!(trace.header.screen_mm, Some([531.0, 299.0]));
        assert_eq!((trace.header.distance_mm, trace.header.rate_hz), (Some(650.0), Some(120.0)));
        assert_eq!(trace.rows[0], Row { time_secs: 0.0, point: [0.5, 0.25], valid: true, confidence: 0.9 });
        assert_eq!(trace.rows[1], Row { time_secs: 0.008333, point: [0.0; 2], valid: false, confidence: 0.0 });
        assert_eq!(Trace::parse(&trace.write()).unwrap(), trace);
        assert!((trace.duration_secs() - 0.008333).abs() < 1e-9);

        let angles = "# gaze-trace v1; space=view_deg; odd=1\nt_s,yaw_deg,pitch_deg,valid\n\n# note\n1,-5,2.5,1\n";
        let trace = Trace::parse(angles).unwrap();
        assert_eq!(trace.rows, [Row { time_secs: 1.0, point: [-5.0, 2.5], valid: true, confidence: 1.0 }]);
        assert_eq!(Trace::parse(&trace.write()).unwrap(), trace);
    }

    #[test]
    fn wrong_traces_are_refused_by_line() {
        for (from, to, reason) in [
            ("v1", "v2", "v1"),
            ("# gaze", "gaze", "line 1"),
            ("screen01", "moon", "moon"),
            ("space=", "spice=", "space"),
            ("531x299", "531", "screen_mm"),
            ("650", "-650", "distance_mm"),
            ("; source=gazepoint", "; source", "key=value"),
            (",1,0.900", ",2,0.900", "line 3"),
            (",0.900", ",1.900", "conf"),
            (",0.900", "", "4 fields"),
            ("0.500000", "far", "`far`"),
            ("0.500000", "inf", "not finite"),
            ("0.008333", "-1", "line 4"),
            ("0.008333", "NaN", "time"),
            ("0.008333", "1e19", "line 4: the time 1e19 s"),
            ("0.000000", "-4.1e9", "line 3: the time"),
            ("0.008333", "1e-10", "line 4: the time does not increase by"),
        ] {
            let error = Trace::parse(&TEXT.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(reason), "{from} -> {to}: {error}");
        }
        for (from, to) in [("0.000000", "0.008332"), ("0.008333", "4e9")] {
            assert!(Trace::parse(&TEXT.replace(from, to)).is_ok(), "{from} -> {to}");
        }
        let latest = TEXT.replace("0.000000,", "3999999999.999998,").replace("0.008333,", "3999999999.999999,");
        let latest = Trace::parse(&latest).unwrap();
        assert_eq!(Trace::parse(&latest.write()).unwrap(), latest, "microseconds are told apart");
        assert!(Trace::parse("").is_err());
        assert!(Trace::parse("# gaze-trace v1; space=screen01\n").unwrap_err().to_string().contains("without rows"));
        assert!(Trace::parse(&format!("{TEXT}{}", "9".repeat(MAX_ROW + 1))).is_err());
    }

    #[test]
    fn a_last_row_that_is_cut_off_is_left_out() {
        let whole = Trace::parse(TEXT).unwrap();
        for half in ["0.", "0.016667,0.1", "0.016667,0.100000,0.250000,1"] {
            let trace = Trace::parse(&format!("{TEXT}{half}")).unwrap();
            assert_eq!((trace.rows.as_slice(), trace.is_cut_off), (whole.rows.as_slice(), true), "{half}");
            assert!(Trace::parse(&format!("{TEXT}{half}\n")).is_err(), "{half}: a line that somebody has ended");
        }
        assert_eq!(Trace::parse(TEXT.trim_end()), Ok(whole), "a whole row needs no end of line");
    }
}
