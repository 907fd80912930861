//! Lab Streaming Layer, protocol 1.10: the head of a sample feed and its samples.

use super::lsl_info::{ChannelFormat, MAX_CHANNELS};
use super::{ParseError, excerpt, finite};

/// Bytes of the longest head that is waited for.
pub const MAX_HEAD: usize = 1 << 14;
/// Time stamp of the two samples that open a feed.
pub const TEST_STAMP_SECS: f64 = 123_456.789;
/// Samples that open a feed, to prove that both sides agree on the format.
const TEST_SAMPLES: u8 = 2;

/// Order of the bytes of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ByteOrder {
    Little,
    Big,
}

/// One sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Seconds by the source's clock; `None` when it is to be deduced from the sample before and the rate.
    pub stamp_secs: Option<f64>,
    /// One value a channel; may hold NaN.
    pub values: Vec<f64>,
}

/// Reads a feed from its first byte.
#[derive(Debug)]
pub struct Feed {
    format: ChannelFormat,
    channels: usize,
    order: Option<ByteOrder>,
    /// Opening samples still to come.
    tests: u8,
    buffer: Vec<u8>,
    /// Bytes at the buffer's front that are done with.
    used: usize,
}

impl Feed {
    /// A feed of so many channels.
    ///
    /// # Errors
    /// No channels, or more than [`MAX_CHANNELS`].
    pub fn new(format: ChannelFormat, channels: usize) -> Result<Self, ParseError> {
        if !(1..=MAX_CHANNELS).contains(&channels) {
            return Err(ParseError::malformed(format!("a stream of {channels} channels")));
        }
        Ok(Self { format, channels, order: None, tests: TEST_SAMPLES, buffer: Vec::new(), used: 0 })
    }

    /// Adds bytes; call [`Feed::next_sample`] until it has no more before adding further ones.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.used);
        self.used = 0;
        self.buffer.extend_from_slice(bytes);
    }

    /// Bytes held.
    pub fn held(&self) -> usize {
        self.buffer.len() - self.used
    }

    /// The next whole sample. After an error the feed is of no more use: where a sample begins is not known.
    ///
    /// # Errors
    /// A refusal, a head that is none, opening samples that are wrong, or a tag that is none.
    pub fn next_sample(&mut self) -> Result<Option<Sample>, ParseError> {
        let order = match self.order {
            Some(order) => order,
            None => {
                let Some(order) = self.head()? else { return Ok(None) };
                *self.order.insert(order)
            }
        };
        while self.tests > 0 {
            let Some(sample) = self.sample(order)? else { return Ok(None) };
            if sample.stamp_secs != Some(TEST_STAMP_SECS) {
                return Err(ParseError::malformed(
                    "the feed's opening samples are wrong: the byte order is not agreed",
                ));
            }
            self.tests -= 1;
        }
        self.sample(order)
    }

    fn head(&mut self) -> Result<Option<ByteOrder>, ParseError> {
        let unread = &self.buffer[self.used..];
        let Some(end) = unread.windows(4).position(|bytes| bytes == b"\r\n\r\n") else {
            if unread.len() > MAX_HEAD {
                return Err(ParseError::TooLong { what: "the head of a feed", limit: MAX_HEAD });
            }
            // A refusal comes as one line, after which the connection ends.
            return match unread.windows(2).position(|bytes| bytes == b"\r\n") {
                Some(line) => status(&unread[..line]).map(|()| None),
                None => Ok(None),
            };
        };
        let head = std::str::from_utf8(&unread[..end])
            .map_err(|_| ParseError::malformed("the head of a feed is not text"))?
            .to_owned();
        self.used += end + 4;
        let mut lines = head.split("\r\n");
        status(lines.next().unwrap_or_default().as_bytes())?;
        // A sender that does not say sends little-endian values, as every machine in use does.
        let mut order = ByteOrder::Little;
        for line in lines {
            let Some((key, value)) = line.split_once(':') else { continue };
            let value = value.trim();
            if key.eq_ignore_ascii_case("Byte-Order") {
                order = match value {
                    "1234" | "0" => ByteOrder::Little,
                    "4321" => ByteOrder::Big,
                    other => return Err(ParseError::Unsupported(format!("byte order `{}`", excerpt(other)))),
                };
            }
            if key.eq_ignore_ascii_case("Data-Protocol-Version") && finite(value).is_none_or(|version| version < 110.0)
            {
                return Err(ParseError::Unsupported(format!("protocol version `{}`", excerpt(value))));
            }
        }
        Ok(Some(order))
    }

    fn sample(&mut self, order: ByteOrder) -> Result<Option<Sample>, ParseError> {
        let unread = &self.buffer[self.used..];
        let Some(&tag) = unread.first() else { return Ok(None) };
        let stamp_size = match tag {
            1 => 0,
            2 => 8,
            other => return Err(ParseError::malformed(format!("a sample begins with {other} instead of 1 or 2"))),
        };
        let size = self.format.size();
        let total = 1 + stamp_size + size * self.channels;
        let Some(bytes) = unread.get(1..total) else { return Ok(None) };
        let (stamp, values) = bytes.split_at(stamp_size);
        let stamp_secs = (stamp_size > 0).then(|| value(stamp, ChannelFormat::Double64, order));
        let values = values.chunks_exact(size).map(|bytes| value(bytes, self.format, order)).collect();
        self.used += total;
        Ok(Some(Sample { stamp_secs, values }))
    }
}

/// `LSL/110 200 OK`.
fn status(line: &[u8]) -> Result<(), ParseError> {
    let line = String::from_utf8_lossy(line);
    let mut words = line.split_ascii_whitespace();
    let protocol = words.next().unwrap_or_default();
    if !protocol.starts_with("LSL/") {
        return Err(ParseError::malformed(format!("a feed begins with `{}`", excerpt(&line))));
    }
    match words.next() {
        Some("200") => Ok(()),
        _ => Err(ParseError::malformed(format!("the source refuses: `{}`", excerpt(&line)))),
    }
}

/// A value of at most 8 bytes.
fn value(bytes: &[u8], format: ChannelFormat, order: ByteOrder) -> f64 {
    let mut little = [0_u8; 8];
    for (to, from) in little.iter_mut().zip(bytes) {
        *to = *from;
    }
    if order == ByteOrder::Big {
        little[..bytes.len().min(8)].reverse();
    }
    let [b0, b1, b2, b3, ..] = little;
    match format {
        ChannelFormat::Float32 => f32::from_le_bytes([b0, b1, b2, b3]).into(),
        ChannelFormat::Double64 => f64::from_le_bytes(little),
        ChannelFormat::Int8 => i8::from_le_bytes([b0]).into(),
        ChannelFormat::Int16 => i16::from_le_bytes([b0, b1]).into(),
        ChannelFormat::Int32 => i32::from_le_bytes([b0, b1, b2, b3]).into(),
        ChannelFormat::Int64 => i64::from_le_bytes(little) as f64,
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const HEAD: &[u8] = b"LSL/110 200 OK\r\nUID: u\r\nByte-Order: 1234\r\nData-Protocol-Version: 110\r\n\r\n";

    fn sample(stamp: Option<f64>, values: &[f32], big: bool) -> Vec<u8> {
        let order = |mut bytes: Vec<u8>| {
            if big {
                bytes.reverse();
            }
            bytes
        };
        let mut bytes = vec![if stamp.is_some() { 2 } else { 1 }];
        bytes.extend(stamp.into_iter().flat_map(|stamp| order(stamp.to_le_bytes().to_vec())));
        bytes.extend(values.iter().flat_map(|value| order(value.to_le_bytes().to_vec())));
        bytes
    }

    fn feed(stream: &[u8], chunk: usize) -> Result<Vec<Sample>, ParseError> {
        let mut feed = Feed::new(ChannelFormat::Float32, 2)?;
        let mut found = Vec::new();
        for bytes in stream.chunks(chunk) {
            feed.push(bytes);
            while let Some(sample) = feed.next_sample()? {
                found.push(sample);
            }
            assert!(feed.held() < MAX_HEAD + 32);
        }
        Ok(found)
    }

    fn stream(head: &[u8], big: bool) -> Vec<u8> {
        let tests = [4.0, 2.0].map(|offset| sample(Some(TEST_STAMP_SECS), &[offset, -offset - 1.0], big));
        let rest = [sample(Some(12.5), &[0.25, 0.75], big), sample(None, &[0.5, f32::NAN], big)];
        [head.to_vec(), tests.concat(), rest.concat()].concat()
    }

    #[test]
    fn samples_are_read_in_both_byte_orders_however_the_stream_is_cut() {
        let big_head = String::from_utf8(HEAD.to_vec()).unwrap().replace("1234", "4321");
        for (head, big) in [(HEAD, false), (big_head.as_bytes(), true)] {
            for chunk in [1, 3, 10, 4096] {
                let found = feed(&stream(head, big), chunk).unwrap();
                assert_eq!(found[0], Sample { stamp_secs: Some(12.5), values: vec![0.25, 0.75] });
                assert_eq!((found.len(), found[1].stamp_secs, found[1].values[0]), (2, None, 0.5));
                assert!(found[1].values[1].is_nan());
            }
        }
    }

    #[test]
    fn every_number_format_is_read() {
        for (format, bytes, expected) in [
            (ChannelFormat::Int8, &[0xFE][..], -2.0),
            (ChannelFormat::Int16, &[0x01, 0x80], -32767.0),
            (ChannelFormat::Int32, &[1, 0, 1, 0], 65537.0),
            (ChannelFormat::Int64, &[0, 0, 0, 0, 1, 0, 0, 0], 4_294_967_296.0),
            (ChannelFormat::Double64, &[0, 0, 0, 0, 0, 0, 0xF0, 0x3F], 1.0),
        ] {
            assert_eq!(bytes.len(), format.size());
            assert_eq!(value(bytes, format, ByteOrder::Little), expected);
        }
    }

    #[test]
    fn what_is_no_feed_is_refused_with_the_reason() {
        let replaced = |from: &str, to: &str| {
            let head = String::from_utf8(HEAD.to_vec()).unwrap().replace(from, to);
            feed(&stream(head.as_bytes(), false), 7).unwrap_err().to_string()
        };
        assert!(replaced("200 OK", "404 Not found").contains("404"));
        assert!(replaced("LSL/110", "HTTP/1.1").contains("HTTP"));
        assert!(replaced("1234", "2143").contains("2143"));
        assert!(replaced("1234", "4321").contains("byte order"));
        assert!(replaced("Version: 110", "Version: 100").contains("100"));
        assert!(feed(b"LSL/110 505 Version not supported\r\n", 100).is_err());
        assert!(matches!(feed(&[b'x'; MAX_HEAD + 100], 50), Err(ParseError::TooLong { .. })));
        let mut broken = stream(HEAD, false);
        broken.push(9);
        assert!(feed(&broken, 64).unwrap_err().to_string().contains('9'));
        assert!(Feed::new(ChannelFormat::Int8, 0).is_err() && Feed::new(ChannelFormat::Int8, 100_000).is_err());
    }
}
