//! Gazepoint's Open Gaze API, version 2: XML-like tags over TCP.
//!
//! Tags end in `/>`; attributes are `name="value"`, sometimes with no blank between them. Point of gaze is a fraction of the
//! screen from its top left.

use super::{ParseError, excerpt, finite};

/// Bytes of the longest tag that is waited for.
pub const MAX_TAG: usize = 1 << 16;

/// Cuts a byte stream into tags.
#[derive(Debug, Default)]
pub struct Splitter {
    buffer: Vec<u8>,
    /// How much of the buffer is known to hold no end.
    searched: usize,
}

impl Splitter {
    /// Adds bytes; call [`Splitter::next_tag`] until it has no more before adding further ones.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// The next whole tag. After an error the stream goes on behind what was refused.
    pub fn next_tag(&mut self) -> Option<Result<Tag, ParseError>> {
        let from = self.searched.saturating_sub(1);
        let Some(end) = self.buffer[from..].windows(2).position(|pair| pair == b"/>").map(|at| at + from) else {
            self.searched = self.buffer.len();
            if self.buffer.len() > MAX_TAG {
                // What may be the beginning of a tag is kept.
                let start = self.buffer.iter().rposition(|byte| *byte == b'<').unwrap_or(self.buffer.len());
                let kept = self.buffer.split_off(start);
                self.buffer = if kept.len() > MAX_TAG { Vec::new() } else { kept };
                self.searched = self.buffer.len();
                return Some(Err(ParseError::TooLong { what: "a tag", limit: MAX_TAG }));
            }
            return None;
        };
        let rest = self.buffer.split_off(end + 2);
        let tag = std::mem::replace(&mut self.buffer, rest);
        self.searched = 0;
        let start = tag[..end].iter().rposition(|byte| *byte == b'<').unwrap_or(0);
        if end - start > MAX_TAG {
            return Some(Err(ParseError::TooLong { what: "a tag", limit: MAX_TAG }));
        }
        Some(Tag::parse(&tag[start..end]))
    }

    /// Bytes held.
    pub fn held(&self) -> usize {
        self.buffer.len()
    }
}

/// One tag, such as `REC` with its attributes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tag {
    /// `REC`, `ACK`, `NACK` or `CAL`.
    pub name: String,
    attributes: Vec<(String, String)>,
}

impl Tag {
    /// From `<NAME a="b" c="d"`, without the end.
    ///
    /// # Errors
    /// No name, or a value that is not closed.
    pub fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let text = std::str::from_utf8(bytes).map_err(|_| ParseError::malformed("a tag that is not text"))?;
        // What stands before `<` is the rest of a tag whose beginning was lost.
        let (_, tag) = text
            .rsplit_once('<')
            .ok_or_else(|| ParseError::malformed(format!("no tag begins in `{}`", excerpt(text.trim()))))?;
        let name_end = tag.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(tag.len());
        let (name, mut rest) = tag.split_at(name_end);
        if name.is_empty() {
            return Err(ParseError::malformed(format!("a tag without a name: `{}`", excerpt(tag))));
        }
        let mut attributes = Vec::new();
        while let Some((key, after)) = rest.split_once('=') {
            let value = after.trim_start().strip_prefix('"');
            let (value, after) = value
                .and_then(|value| value.split_once('"'))
                .ok_or_else(|| ParseError::malformed(format!("a value of {name} is not closed")))?;
            attributes.push((key.trim().to_owned(), value.to_owned()));
            rest = after;
        }
        Ok(Self { name: name.to_owned(), attributes })
    }

    /// An attribute's text.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.attributes.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }

    /// An attribute as a finite number.
    pub fn number(&self, key: &str) -> Option<f64> {
        finite(self.get(key)?)
    }

    /// The gaze in a `REC`; `None` when this is another tag or one without a point of gaze.
    pub fn gaze(&self) -> Option<Gaze> {
        if self.name != "REC" || self.get("BPOGX").is_none() {
            return None;
        }
        let point = self.number("BPOGX").zip(self.number("BPOGY"));
        let blinking = self.number("BKID").is_some_and(|id| id > 0.0);
        Some(Gaze {
            time_secs: self.number("TIME"),
            point: point.map_or([0.5, 0.5], |(x, y)| [x, y]),
            valid: point.is_some() && self.number("BPOGV") == Some(1.0) && !blinking,
        })
    }
}

/// The best point of gaze in a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaze {
    /// Seconds since the tracker started.
    pub time_secs: Option<f64>,
    /// Fractions of the screen from its top left; may lie outside 0..=1.
    pub point: [f64; 2],
    /// Whether the tracker vouches for the point.
    pub valid: bool,
}

/// How a calibration went, from `CALIBRATE_RESULT_SUMMARY`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationSummary {
    /// Mean error, pixels of the tracked screen.
    pub mean_error_px: f64,
    /// Points that the tracker could use.
    pub valid_points: u32,
}

impl CalibrationSummary {
    /// From the answer to `GET CALIBRATE_RESULT_SUMMARY`.
    pub fn from_tag(tag: &Tag) -> Option<Self> {
        if tag.name != "ACK" || tag.get("ID") != Some("CALIBRATE_RESULT_SUMMARY") {
            return None;
        }
        let points = tag.number("VALID_POINTS").filter(|points| (0.0..=1000.0).contains(points))?;
        Some(Self {
            mean_error_px: tag.number("AVE_ERROR").filter(|error| *error >= 0.0)?,
            valid_points: points as u32,
        })
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn tags(stream: &[u8], chunk: usize) -> Vec<Result<Tag, ParseError>> {
        let mut splitter = Splitter::default();
        let mut found = Vec::new();
        for bytes in stream.chunks(chunk) {
            splitter.push(bytes);
            found.extend(std::iter::from_fn(|| splitter.next_tag()));
        }
        found
    }

    #[test]
    fn records_are_read_however_the_stream_is_cut() {
        let stream = b"<ACK ID=\"ENABLE_SEND_DATA\" STATE=\"1\" />\r\n\
            <REC CNT=\"7\" TIME=\"1.25\" BPOGX=\"0.25\"BPOGY=\"-0.5\"BPOGV=\"1\" />\r\n<REC TIME=\"1.26\" BPOGX=\"nan\" BPOGY=\"0.1\" BPOGV=\"1\" />";
        for chunk in [1, 2, 3, 7, 1000] {
            let found: Vec<Tag> = tags(stream, chunk).into_iter().map(Result::unwrap).collect();
            assert_eq!(found.len(), 3, "in chunks of {chunk}");
            assert_eq!(found[0].get("STATE"), Some("1"));
            assert_eq!(found[0].gaze(), None);
            assert_eq!(found[1].gaze().unwrap(), Gaze { time_secs: Some(1.25), point: [0.25, -0.5], valid: true });
            assert!(!found[2].gaze().unwrap().valid, "a NaN is no point");
        }
    }

    #[test]
    fn a_blink_or_a_cleared_flag_makes_a_record_invalid() {
        let record = |tail: &str| {
            let text = format!("<REC TIME=\"2\" BPOGX=\"0.5\" BPOGY=\"0.5\" {tail}");
            Tag::parse(text.as_bytes()).unwrap().gaze().unwrap().valid
        };
        assert!(record("BPOGV=\"1\" BKID=\"0\""));
        assert!(!record("BPOGV=\"0\""));
        assert!(!record("BPOGV=\"1\" BKID=\"12\""));
        assert!(!record(""));
    }

    #[test]
    fn ten_megabytes_without_an_end_stay_bounded_and_the_next_record_is_read() {
        let mut splitter = Splitter::default();
        let mut errors = 0;
        for _ in 0..10_000 {
            splitter.push(&[b'x'; 1024]);
            errors += std::iter::from_fn(|| splitter.next_tag()).filter(Result::is_err).count();
            assert!(splitter.held() <= MAX_TAG + 1024);
        }
        assert!(errors >= 100, "{errors}");
        let record = b"<REC BPOGX=\"0.1\" BPOGY=\"0.2\" BPOGV=\"1\" />";
        splitter.push(record);
        let last = std::iter::from_fn(|| splitter.next_tag()).last().unwrap().unwrap();
        assert_eq!(last.gaze().unwrap().point, [0.1, 0.2]);
        // However much came before the record, and wherever a read ends within it.
        for before in MAX_TAG - 60..MAX_TAG + 2 {
            let mut splitter = Splitter::default();
            let mut found = Vec::new();
            for bytes in [&vec![b'x'; before][..], &record[..20], &record[20..]] {
                splitter.push(bytes);
                found.extend(std::iter::from_fn(|| splitter.next_tag()));
            }
            assert!(found.last().unwrap().as_ref().unwrap().gaze().is_some(), "{before}: {found:?}");
        }
    }

    #[test]
    fn garbage_is_refused_and_the_stream_goes_on() {
        let found = tags(b"\xff\xfe/> no tag/><REC A=\"1/><9 />< /><REC BPOGX=\"1\" BPOGY=\"1\" BPOGV=\"1\"/>", 5);
        assert_eq!(found.iter().filter(|tag| tag.is_err()).count(), 4, "{found:?}");
        assert!(found.last().unwrap().as_ref().unwrap().gaze().unwrap().valid);
    }

    #[test]
    fn a_calibration_is_judged_by_its_summary() {
        let tag = |text: &str| CalibrationSummary::from_tag(&Tag::parse(text.as_bytes()).unwrap());
        let summary = tag("<ACK ID=\"CALIBRATE_RESULT_SUMMARY\" AVE_ERROR=\"19.4\" VALID_POINTS=\"5\" ");
        assert_eq!(summary, Some(CalibrationSummary { mean_error_px: 19.4, valid_points: 5 }));
        assert_eq!(tag("<ACK ID=\"CALIBRATE_RESULT_SUMMARY\" AVE_ERROR=\"-1\" VALID_POINTS=\"5\" "), None);
        assert_eq!(tag("<ACK ID=\"SCREEN_SIZE\" AVE_ERROR=\"19\" VALID_POINTS=\"5\" "), None);
    }
}
