//! What holds for each parser on any input.

use super::parse::lsl_feed::{Feed, MAX_HEAD, Sample};
use super::parse::lsl_info::{self, ChannelFormat, ClockReply, StreamInfo};
use super::parse::opengaze::{CalibrationSummary, MAX_TAG, Splitter, Tag};
use super::parse::pupil::{MAX_POINTS, SurfaceMessage};
use super::parse::trace::{MAX_SECS, MIN_STEP_SECS, Trace};
use super::parse::zmtp::{self, MAX_FRAME, Message, Peer};
use super::parse::{ParseError, edid};

/// Sizes of the pieces in which a stream arrives.
const CHUNKS: [usize; 2] = [13, 4096];

/// Runs a property by the name of its fuzz target; `false` for a name that is none.
pub fn run(target: &str, data: &[u8]) -> bool {
    match target {
        "opengaze" => opengaze(data),
        "lsl_info" => lsl_info(data),
        "lsl_feed" => lsl_feed(data),
        "zmtp" => zmtp(data),
        "pupil" => pupil(data),
        "trace" => trace(data),
        "edid" => edid(data),
        _ => return false,
    }
    true
}

/// Memory is bounded, what is found does not depend on how the stream is cut, and points that count are finite.
pub fn opengaze(data: &[u8]) {
    let [small, large] = CHUNKS.map(|chunk| {
        let mut splitter = Splitter::default();
        let mut found: Vec<Result<Tag, ParseError>> = Vec::new();
        for bytes in data.chunks(chunk) {
            splitter.push(bytes);
            found.extend(std::iter::from_fn(|| splitter.next_tag()));
            assert!(splitter.held() <= MAX_TAG);
        }
        found
    });
    // A tag at the limit is refused early in one cut and late in another.
    if data.len() <= MAX_TAG {
        assert_eq!(small, large);
    }
    for tag in large.iter().flatten() {
        if let Some(gaze) = tag.gaze() {
            assert!(gaze.point.iter().chain(&gaze.time_secs).all(|value| value.is_finite()));
        }
        if let Some(summary) = CalibrationSummary::from_tag(tag) {
            assert!(summary.mean_error_px >= 0.0);
        }
    }
}

/// What is accepted is in range.
pub fn lsl_info(data: &[u8]) {
    if let Ok((id, info)) = lsl_info::discovery_reply(data) {
        assert!(!id.contains('\n'));
        described(&info);
    }
    if let Ok(info) =
        std::str::from_utf8(data).map_err(|_| ()).and_then(|xml| StreamInfo::from_xml(xml).map_err(|_| ()))
    {
        described(&info);
    }
    if let Ok(reply) = ClockReply::parse(data) {
        assert!([reply.t0_secs, reply.t1_secs, reply.t2_secs].iter().all(|time| time.is_finite()));
    }
}

fn described(info: &StreamInfo) {
    assert!((1..=lsl_info::MAX_CHANNELS).contains(&info.channel_count));
    assert!(info.channels.len() <= info.channel_count);
    assert!(info.data_port > 0 && info.service_port > 0 && info.nominal_rate_hz >= 0.0 && !info.uid.is_empty());
}

/// Memory is bounded, and what is found does not depend on how the stream is cut. The first byte chooses the format.
pub fn lsl_feed(data: &[u8]) {
    let Some((&choice, stream)) = data.split_first() else { return };
    let formats = [
        ChannelFormat::Float32,
        ChannelFormat::Double64,
        ChannelFormat::Int8,
        ChannelFormat::Int16,
        ChannelFormat::Int32,
        ChannelFormat::Int64,
    ];
    let (format, channels) = (formats[usize::from(choice) % formats.len()], usize::from(choice) / formats.len());
    let [small, large] = CHUNKS.map(|chunk| {
        let Ok(mut feed) = Feed::new(format, channels) else { return (Vec::new(), None) };
        let mut found: Vec<Sample> = Vec::new();
        for bytes in stream.chunks(chunk) {
            feed.push(bytes);
            loop {
                match feed.next_sample() {
                    Ok(Some(sample)) => found.push(sample),
                    Ok(None) => break,
                    Err(error) => return (found, Some(error)),
                }
            }
            assert!(feed.held() <= MAX_HEAD.max(9 + 8 * channels));
        }
        (found, None)
    });
    assert_eq!(small.0.len(), large.0.len());
    assert!(large.0.iter().all(|sample| sample.values.len() == channels));
    assert_eq!(small.1.is_some(), large.1.is_some());
}

/// Memory is bounded, what is found does not depend on how the stream is cut, and it reads the same after it was written.
pub fn zmtp(data: &[u8]) {
    let [small, large] = CHUNKS.map(|chunk| {
        let mut peer = Peer::default();
        let mut found: Vec<Message> = Vec::new();
        for bytes in data.chunks(chunk) {
            peer.push(bytes);
            loop {
                match peer.next_message() {
                    Ok(Some(message)) => found.push(message),
                    Ok(None) => break,
                    Err(error) => return (found, Some(error)),
                }
            }
            assert!(peer.held() <= 3 * MAX_FRAME);
        }
        (found, None)
    });
    assert_eq!(small.0, large.0);
    assert_eq!(small.1.is_some(), large.1.is_some());
    let frames = |message: &Message| -> Vec<u8> {
        let last = message.len() - 1;
        message.iter().enumerate().flat_map(|(index, body)| zmtp::frame(body, index < last)).collect()
    };
    let written: Vec<u8> = large.0.iter().flat_map(frames).collect();
    let mut peer = Peer::default();
    peer.push(&[&zmtp::greeting()[..], &zmtp::ready("PUB"), &written].concat());
    let read: Vec<Message> =
        std::iter::from_fn(|| peer.next_message().expect("what was written is readable")).collect();
    assert_eq!(read, large.0);
}

/// What is accepted is finite and bounded, and a message that is cut off is refused.
pub fn pupil(data: &[u8]) {
    let Ok(message) = SurfaceMessage::parse(data) else { return };
    assert!(message.gaze.len() <= MAX_POINTS && message.name.chars().count() <= 200);
    for gaze in message.gaze {
        assert!(gaze.time_secs.is_finite() && gaze.norm_pos.iter().all(|value| value.is_finite()));
        assert!((0.0..=1.0).contains(&gaze.confidence));
    }
}

/// What is accepted lies within bounds and increases in time, counts only finite points, and reads the same after it was
/// written, up to the digits that are written.
pub fn trace(data: &[u8]) {
    let Some(trace) = std::str::from_utf8(data).ok().and_then(|text| Trace::parse(text).ok()) else { return };
    assert!(trace.rows.iter().all(|row| row.time_secs.abs() <= MAX_SECS));
    // At the farthest times a number of 64 bits is rounded to half a microsecond.
    assert!(trace.rows.windows(2).all(|pair| pair[1].time_secs - pair[0].time_secs > 0.4 * MIN_STEP_SECS));
    assert!(trace.rows.iter().all(|row| row.point.iter().all(|value| value.is_finite())));
    // Times that lie a microsecond apart between written ones may be rounded to the same.
    if let Ok(again) = Trace::parse(&trace.write()) {
        assert_eq!(again.header, trace.header);
        assert_eq!(again.rows.len(), trace.rows.len());
        assert_eq!(Trace::parse(&again.write()), Ok(again));
    }
}

/// Sizes are positive.
pub fn edid(data: &[u8]) {
    if let Some(size) = edid::monitor_size(data) {
        assert!(size.size_px.iter().all(|side| *side > 0) && size.size_mm.iter().all(|side| *side > 0.0));
    }
    // The checksum keeps random bytes out; with it mended the rest is reached.
    if let Some(block) = data.first_chunk::<128>() {
        let mut block = *block;
        block[..8].copy_from_slice(&[0, 255, 255, 255, 255, 255, 255, 0]);
        block[127] = block[..127].iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
        if let Some(size) = edid::monitor_size(&block) {
            assert!(size.size_px.iter().all(|side| *side > 0) && size.size_mm.iter().all(|side| *side >= 50.0));
        }
    }
}
