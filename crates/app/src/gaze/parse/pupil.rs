//! Pupil Core's surface messages: gaze on a surface that the world camera sees, batched per camera frame.

use super::ParseError;
use super::msgpack::{Reader, Value};

/// Points of gaze that a message may hold; a world frame of 30 Hz has about 8.
pub const MAX_POINTS: usize = 4096;

/// One point of gaze.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceGaze {
    /// Seconds by Pupil's clock.
    pub time_secs: f64,
    /// Fractions of the surface from its *bottom left*.
    pub norm_pos: [f64; 2],
    /// 0..=1.
    pub confidence: f64,
    /// Whether it lies on the surface.
    pub on_surface: bool,
}

/// A message of topic `surfaces.<name>`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMessage {
    /// The surface's name.
    pub name: String,
    /// In the message's order.
    pub gaze: Vec<SurfaceGaze>,
}

impl SurfaceMessage {
    /// From msgpack. Keys and types that are not known are passed over.
    ///
    /// # Errors
    /// Not msgpack, or not a map.
    pub fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let mut reader = Reader::new(bytes);
        let mut message = Self::default();
        let Value::Map(pairs) = reader.next_value()? else {
            return Err(ParseError::malformed("a surface message is no map"));
        };
        for _ in 0..pairs {
            match key(&mut reader)? {
                Some(b"name") => {
                    if let Some(text) = text(&mut reader)? {
                        message.name = String::from_utf8_lossy(text).chars().take(200).collect();
                    }
                }
                Some(b"gaze_on_surfaces") => message.read_gaze(&mut reader)?,
                _ => reader.skip()?,
            }
        }
        Ok(message)
    }

    fn read_gaze(&mut self, reader: &mut Reader<'_>) -> Result<(), ParseError> {
        let mut ahead = reader.clone();
        let Value::Array(count) = ahead.next_value()? else { return reader.skip() };
        if count > MAX_POINTS {
            return Err(ParseError::Unsupported(format!("{count} points of gaze in one message")));
        }
        *reader = ahead;
        for _ in 0..count {
            self.gaze.extend(point(reader)?);
        }
        // A message may name the list twice; both together stay within the bound.
        self.gaze.truncate(MAX_POINTS);
        Ok(())
    }
}

/// A point with a position and a time; `None` when either is missing or not finite.
fn point(reader: &mut Reader<'_>) -> Result<Option<SurfaceGaze>, ParseError> {
    let mut ahead = reader.clone();
    let Value::Map(pairs) = ahead.next_value()? else { return reader.skip().map(|()| None) };
    *reader = ahead;
    let (mut time_secs, mut norm_pos, mut confidence, mut on_surface) = (None, None, 0.0, false);
    for _ in 0..pairs {
        match key(reader)? {
            Some(b"timestamp") => time_secs = reader.number()?,
            Some(b"norm_pos") => norm_pos = pair(reader)?,
            Some(b"confidence") => confidence = reader.number()?.unwrap_or(0.0),
            Some(b"on_surf") => {
                let mut ahead = reader.clone();
                on_surface = ahead.next_value()? == Value::Bool(true);
                reader.skip()?;
            }
            _ => reader.skip()?,
        }
    }
    let finite = |value: &f64| value.is_finite();
    let norm_pos = norm_pos.filter(|[x, y]: &[f64; 2]| x.is_finite() && y.is_finite());
    // NaN confidence is no confidence.
    let confidence = if confidence >= 0.0 { confidence.min(1.0) } else { 0.0 };
    Ok(time_secs.filter(finite).zip(norm_pos).map(|(time_secs, norm_pos)| SurfaceGaze {
        time_secs,
        norm_pos,
        confidence,
        on_surface,
    }))
}

/// Two numbers.
fn pair(reader: &mut Reader<'_>) -> Result<Option<[f64; 2]>, ParseError> {
    let mut ahead = reader.clone();
    if ahead.next_value()? != Value::Array(2) {
        return reader.skip().map(|()| None);
    }
    *reader = ahead;
    Ok(reader.number()?.zip(reader.number()?).map(<[f64; 2]>::from))
}

/// A map's key; one that is not text is passed over and gives `None`.
fn key<'a>(reader: &mut Reader<'a>) -> Result<Option<&'a [u8]>, ParseError> {
    text(reader)
}

fn text<'a>(reader: &mut Reader<'a>) -> Result<Option<&'a [u8]>, ParseError> {
    let mut ahead = reader.clone();
    if let Value::Text(text) = ahead.next_value()? {
        *reader = ahead;
        return Ok(Some(text));
    }
    reader.skip().map(|()| None)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn text_bytes(text: &str) -> Vec<u8> {
        [&[0xa0 | text.len() as u8], text.as_bytes()].concat()
    }

    fn number(value: f64) -> Vec<u8> {
        [&[0xcb][..], &value.to_be_bytes()].concat()
    }

    fn gaze_bytes(time: f64, position: &[u8], extra: &[u8], extra_pairs: u8) -> Vec<u8> {
        let fixed = [
            text_bytes("timestamp"),
            number(time),
            text_bytes("norm_pos"),
            position.to_vec(),
            text_bytes("confidence"),
            number(0.9),
            text_bytes("on_surf"),
            vec![0xc3],
        ];
        [&[0x84 + extra_pairs][..], &fixed.concat(), extra].concat()
    }

    fn message(points: &[Vec<u8>]) -> Vec<u8> {
        let list = [&[0x90 | points.len() as u8][..], &points.concat()].concat();
        [&[0x83][..], &text_bytes("name"), &text_bytes("screen"), &text_bytes("gaze_on_surfaces"), &list, &[7, 0xc0]]
            .concat()
    }

    #[test]
    fn points_are_read_and_what_is_unknown_is_passed_over() {
        let position = [vec![0x92], number(0.25), number(0.75)].concat();
        let extra = [text_bytes("base_data"), vec![0x92, 0xd4, 1, 2, 0x80]].concat();
        let bytes = message(&[gaze_bytes(1.5, &position, &[], 0), gaze_bytes(1.6, &position, &extra, 1)]);
        let parsed = SurfaceMessage::parse(&bytes).unwrap();
        assert_eq!(parsed.name, "screen");
        let expected = SurfaceGaze { time_secs: 1.5, norm_pos: [0.25, 0.75], confidence: 0.9, on_surface: true };
        assert_eq!(parsed.gaze, [expected, SurfaceGaze { time_secs: 1.6, ..expected }]);
    }

    #[test]
    fn points_that_are_none_are_left_out() {
        let good = [vec![0x92], number(0.5), number(0.5)].concat();
        let not_finite = [vec![0x92], number(f64::NAN), number(0.5)].concat();
        let three = [vec![0x93], number(0.5), number(0.5), number(0.5)].concat();
        let bytes = message(&[
            gaze_bytes(1.0, &not_finite, &[], 0),
            gaze_bytes(1.0, &three, &[], 0),
            gaze_bytes(1.0, &[0xc0], &[], 0),
            gaze_bytes(f64::INFINITY, &good, &[], 0),
            vec![0xc3],
            gaze_bytes(2.0, &good, &[], 0),
        ]);
        let parsed = SurfaceMessage::parse(&bytes).unwrap();
        assert_eq!(parsed.gaze.iter().map(|gaze| gaze.time_secs).collect::<Vec<_>>(), [2.0]);
    }

    #[test]
    fn what_is_no_message_is_refused_at_every_length() {
        let position = [vec![0x92], number(0.25), number(0.75)].concat();
        let bytes = message(&[gaze_bytes(1.5, &position, &[], 0)]);
        for length in 0..bytes.len() {
            assert!(SurfaceMessage::parse(&bytes[..length]).is_err(), "{length}");
        }
        assert!(SurfaceMessage::parse(&[0x93, 1, 2, 3]).is_err());
        let many = [&[0x81][..], &text_bytes("gaze_on_surfaces"), &[0xdd, 255, 255, 255, 255]].concat();
        assert!(matches!(SurfaceMessage::parse(&many), Err(ParseError::Unsupported(_))));
    }
}
