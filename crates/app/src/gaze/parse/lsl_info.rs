//! Lab Streaming Layer: what a stream says about itself, and its answers to discovery and clock probes.

use super::{ParseError, excerpt, finite};

/// Bytes of the longest description that is read.
pub const MAX_XML: usize = 1 << 20;
/// Channels of the widest stream that is read.
pub const MAX_CHANNELS: usize = 512;

/// How a value is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelFormat {
    /// 32-bit floating point.
    Float32,
    /// 64-bit floating point.
    Double64,
    /// 8-bit integer.
    Int8,
    /// 16-bit integer.
    Int16,
    /// 32-bit integer.
    Int32,
    /// 64-bit integer.
    Int64,
}

impl ChannelFormat {
    /// Bytes of a value.
    pub fn size(self) -> usize {
        match self {
            Self::Int8 => 1,
            Self::Int16 => 2,
            Self::Float32 | Self::Int32 => 4,
            Self::Double64 | Self::Int64 => 8,
        }
    }

    fn from_name(name: &str) -> Result<Self, ParseError> {
        Ok(match name {
            "float32" => Self::Float32,
            "double64" => Self::Double64,
            "int8" => Self::Int8,
            "int16" => Self::Int16,
            "int32" => Self::Int32,
            "int64" => Self::Int64,
            other => return Err(ParseError::Unsupported(format!("channels of format `{}`", excerpt(other)))),
        })
    }
}

/// A channel as its stream describes it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channel {
    /// Name, often empty.
    pub label: String,
    /// Unit, often empty.
    pub unit: String,
}

/// A stream's description.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamInfo {
    /// Name that the feeder chose.
    pub name: String,
    /// Kind of content, such as `Gaze`.
    pub kind: String,
    /// Values a sample.
    pub channel_count: usize,
    /// How values are stored.
    pub format: ChannelFormat,
    /// Samples a second; 0 when irregular.
    pub nominal_rate_hz: f64,
    /// Identifies the device over restarts; may be empty.
    pub source_id: String,
    /// Identifies this run of the stream.
    pub uid: String,
    /// Host as it calls itself.
    pub hostname: String,
    /// TCP port of descriptions and samples.
    pub data_port: u16,
    /// UDP port of clock probes.
    pub service_port: u16,
    /// Channels, as far as they are described.
    pub channels: Vec<Channel>,
}

impl StreamInfo {
    /// From the XML of `LSL:shortinfo` or `LSL:fullinfo`.
    ///
    /// # Errors
    /// Not XML, not a stream, a missing field, or a format without numbers.
    pub fn from_xml(xml: &str) -> Result<Self, ParseError> {
        if xml.len() > MAX_XML {
            return Err(ParseError::TooLong { what: "a stream's description", limit: MAX_XML });
        }
        let document = roxmltree::Document::parse(xml)
            .map_err(|error| ParseError::malformed(format!("a stream's description is no XML: {error}")))?;
        let root = document.root_element();
        if root.tag_name().name() != "info" {
            return Err(ParseError::malformed(format!(
                "a stream's description begins with <{}>",
                excerpt(root.tag_name().name())
            )));
        }
        let text = |name: &str| child_text(root, name);
        let number = |name: &str| {
            finite(&text(name))
                .ok_or_else(|| ParseError::malformed(format!("{name} of a stream is `{}`", excerpt(&text(name)))))
        };
        let port = |name: &str| match number(name)? {
            port if (1.0..=65_535.0).contains(&port) => Ok(port as u16),
            port => Err(ParseError::malformed(format!("{name} of a stream is {port}"))),
        };
        let channel_count = match number("channel_count")? {
            count if (1.0..=MAX_CHANNELS as f64).contains(&count) => count as usize,
            count => return Err(ParseError::malformed(format!("a stream of {count} channels"))),
        };
        let uid = text("uid");
        if uid.is_empty() {
            return Err(ParseError::malformed("a stream without uid"));
        }
        Ok(Self {
            name: text("name"),
            kind: text("type"),
            channel_count,
            format: ChannelFormat::from_name(&text("channel_format"))?,
            nominal_rate_hz: number("nominal_srate")?.max(0.0),
            source_id: text("source_id"),
            uid,
            hostname: text("hostname"),
            data_port: port("v4data_port")?,
            service_port: port("v4service_port")?,
            channels: channels(root, channel_count),
        })
    }
}

fn child<'a, 'input>(node: roxmltree::Node<'a, 'input>, name: &str) -> Option<roxmltree::Node<'a, 'input>> {
    node.children().find(|child| child.tag_name().name() == name)
}

fn child_text(node: roxmltree::Node<'_, '_>, name: &str) -> String {
    child(node, name).and_then(|child| child.text()).unwrap_or_default().trim().to_owned()
}

fn channels(root: roxmltree::Node<'_, '_>, count: usize) -> Vec<Channel> {
    let list = child(root, "desc").and_then(|desc| child(desc, "channels"));
    let described =
        list.into_iter().flat_map(|list| list.children()).filter(|node| node.tag_name().name() == "channel");
    described
        .take(count)
        .map(|node| Channel { label: child_text(node, "label"), unit: child_text(node, "unit") })
        .collect()
}

/// A datagram that answers a discovery: the query's number and the stream.
///
/// # Errors
/// Not an answer, or a stream that [`StreamInfo::from_xml`] refuses.
pub fn discovery_reply(datagram: &[u8]) -> Result<(String, StreamInfo), ParseError> {
    let text = std::str::from_utf8(datagram).map_err(|_| ParseError::malformed("an answer that is not text"))?;
    let (id, xml) = text.split_once('\n').ok_or_else(|| ParseError::malformed("an answer without a query's number"))?;
    Ok((id.trim().to_owned(), StreamInfo::from_xml(xml)?))
}

/// A datagram that answers a clock probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockReply {
    /// The probe's number.
    pub id: u32,
    /// When the probe left, by our clock, seconds.
    pub t0_secs: f64,
    /// When it came to the source, by its clock, seconds.
    pub t1_secs: f64,
    /// When the answer left the source, by its clock, seconds.
    pub t2_secs: f64,
}

impl ClockReply {
    /// From `<id> t0 t1 t2`.
    ///
    /// # Errors
    /// Not four numbers.
    pub fn parse(datagram: &[u8]) -> Result<Self, ParseError> {
        let wrong = || ParseError::malformed("an answer to a clock probe is not four numbers");
        let text = std::str::from_utf8(datagram).map_err(|_| wrong())?;
        let mut words = text.split_ascii_whitespace();
        let id = words.next().and_then(|word| word.parse().ok()).ok_or_else(wrong)?;
        let mut time = || words.next().and_then(finite).ok_or_else(wrong);
        Ok(Self { id, t0_secs: time()?, t1_secs: time()?, t2_secs: time()? })
    }

    /// Source's clock minus ours, and the way there and back, seconds, for an answer that came at `t3_secs`.
    pub fn offset_and_round_trip(&self, t3_secs: f64) -> (f64, f64) {
        let offset = ((self.t1_secs - self.t0_secs) + (self.t2_secs - t3_secs)) * 0.5;
        (offset, (t3_secs - self.t0_secs) - (self.t2_secs - self.t1_secs))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const XML: &str = "<?xml version=\"1.0\"?><info><name>GP3</name><type>Gaze</type><channel_count>3</channel_count>\
        <channel_format>float32</channel_format><source_id>s</source_id><nominal_srate>60.000</nominal_srate>\
        <uid>u-1</uid><hostname>h</hostname><v4data_port>16572</v4data_port><v4service_port>16573</v4service_port>\
        <desc><channels><channel><label>BPOGX</label><unit>percent</unit></channel><channel/></channels></desc></info>";

    #[test]
    fn a_description_is_read() {
        let info = StreamInfo::from_xml(XML).unwrap();
        assert_eq!((info.name.as_str(), info.kind.as_str(), info.uid.as_str()), ("GP3", "Gaze", "u-1"));
        assert_eq!((info.channel_count, info.format, info.nominal_rate_hz), (3, ChannelFormat::Float32, 60.0));
        assert_eq!((info.data_port, info.service_port), (16_572, 16_573));
        assert_eq!(info.channels.len(), 2);
        assert_eq!(info.channels[0], Channel { label: "BPOGX".into(), unit: "percent".into() });
        let (id, again) = discovery_reply(format!("4711\r\n{XML}").as_bytes()).unwrap();
        assert_eq!((id.as_str(), again), ("4711", info));
    }

    #[test]
    fn wrong_descriptions_are_refused_with_the_reason() {
        for (from, to, reason) in [
            ("<info>", "<stream>", "XML"),
            ("<?xml version=\"1.0\"?>", "<!DOCTYPE a [<!ENTITY b \"c\">]>", "XML"),
            ("float32", "string", "`string`"),
            (">3<", ">0<", "0 channels"),
            (">3<", ">1e9<", "channels"),
            (">3<", ">many<", "`many`"),
            ("60.000", "NaN", "nominal_srate"),
            (">16572<", ">70000<", "v4data_port"),
            ("<uid>u-1</uid>", "", "uid"),
        ] {
            let error = StreamInfo::from_xml(&XML.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(reason), "{from} -> {to}: {error}");
        }
        let other = StreamInfo::from_xml("<html><body/></html>").unwrap_err().to_string();
        assert!(other.contains("<html>"), "{other}");
        let nested = StreamInfo::from_xml(&"<a>".repeat(MAX_XML / 3)).unwrap_err();
        assert!(nested.to_string().contains("XML"), "and the stack does not overflow: {nested}");
        let long = StreamInfo::from_xml(&" ".repeat(MAX_XML + 1)).unwrap_err();
        assert!(matches!(long, ParseError::TooLong { .. }));
        for datagram in [&b"no line"[..], b"\xff\n<info/>", b""] {
            assert!(discovery_reply(datagram).is_err());
        }
    }

    #[test]
    fn a_clock_that_is_ahead_has_a_positive_offset() {
        // 10 ms there, 2 ms inside, 30 ms back; the source is 5 s ahead.
        let reply = ClockReply::parse(b" 3 1.000 6.010 6.012\r\n").unwrap();
        let (offset, round_trip) = reply.offset_and_round_trip(1.042);
        assert!((offset - 4.99).abs() < 1e-9 && (round_trip - 0.04).abs() < 1e-9, "{offset} {round_trip}");
        for wrong in [&b"3 1 2"[..], b"x 1 2 3", b"3 1 nan 2", b"\xff"] {
            assert!(ClockReply::parse(wrong).is_err());
        }
    }
}
