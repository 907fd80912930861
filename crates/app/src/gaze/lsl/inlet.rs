//! Reading one stream: description, clock, samples.

use std::io::Write;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::mapping::{Channels, Mapping};
use super::resolve::{self, Found};
use crate::gaze::clock::DeviceClock;
use crate::gaze::feed::{Ended, Link, Outlet};
use crate::gaze::parse::excerpt;
use crate::gaze::parse::lsl_feed::{Feed, Sample};
use crate::gaze::parse::lsl_info::{ClockReply, StreamInfo};
use crate::gaze::source::SourceState;
use crate::gaze::spec::LslSpec;

/// How long streams are searched for at a time.
const SEARCH: Duration = Duration::from_secs(2);
/// Clock probes a measurement, of which the fastest counts.
const PROBES: u32 = 8;
const PROBE_WAIT: Duration = Duration::from_millis(200);
/// How often the clocks are compared.
const CLOCK_INTERVAL: Duration = Duration::from_secs(5);

/// A stream by what its user knows of it; found again when it starts anew.
pub struct Inlet {
    spec: LslSpec,
}

impl Inlet {
    /// For the first stream that fits.
    pub fn new(spec: LslSpec) -> Self {
        Self { spec }
    }

    fn run(&self, outlet: &Outlet) -> Result<std::convert::Infallible, Ended> {
        let fits = |found: &Found| self.spec.fits(&found.info);
        let found =
            resolve::resolve(self.spec.host.as_deref(), SEARCH, |found| outlet.unwanted() || found.iter().any(fits))?;
        let Some(found) = found.into_iter().find(fits) else {
            return Err(if outlet.unwanted() {
                Ended::Unwanted
            } else {
                Ended::Lost(format!("no stream {}", self.spec))
            });
        };
        let info = resolve::full_info(&found)?;
        let mapping = self.spec.mapping(&info);
        let channels = mapping.resolve(&info).map_err(Ended::Failed)?;
        outlet.update(|status| status.detail = describe(&info, &found, &mapping));

        let mut clock = DeviceClock::new(Instant::now());
        let comparison = Comparison::start(SocketAddr::new(found.address, info.service_port), clock.clone());
        self.read(&info, &found, &channels, &mut clock, &comparison, outlet)
    }

    fn read(
        &self,
        info: &StreamInfo,
        found: &Found,
        channels: &Channels,
        clock: &mut DeviceClock,
        comparison: &Comparison,
        outlet: &Outlet,
    ) -> Result<std::convert::Infallible, Ended> {
        let mut stream = outlet.connect(&found.address.to_string(), info.data_port)?;
        stream.write_all(request(info).as_bytes())?;
        let mut feed = Feed::new(info.format, info.channel_count).map_err(|error| Ended::Failed(error.to_string()))?;
        let (mut buffer, mut heard) = ([0; 16_384], Instant::now());
        let mut last_secs = None;
        loop {
            let count = outlet.read(&mut stream, &mut buffer, &mut heard)?;
            feed.push(&buffer[..count]);
            if let Some(offset) = comparison.source_minus_ours() {
                clock.set_offset(-offset);
            }
            while let Some(sample) = feed.next_sample().map_err(|error| Ended::Lost(error.to_string()))? {
                let stamp = stamp(&sample, last_secs, info.nominal_rate_hz).unwrap_or_else(|| clock.local_secs(heard));
                last_secs = Some(stamp);
                let (point, valid, confidence) = channels.gaze(&sample.values);
                outlet.send(clock, stamp, point, valid, confidence);
            }
        }
    }
}

impl Link for Inlet {
    fn session(&mut self, outlet: &Outlet) -> Ended {
        outlet.update(|status| status.state = SourceState::Searching);
        match self.run(outlet) {
            Ok(never) => match never {},
            Err(ended) => ended,
        }
    }
}

/// When a sample was taken by the source's clock; `None` when that cannot be known.
fn stamp(sample: &Sample, last_secs: Option<f64>, rate_hz: f64) -> Option<f64> {
    let deduced = last_secs.filter(|_| rate_hz > 0.0).map(|last| last + 1.0 / rate_hz);
    sample.stamp_secs.or(deduced)
}

fn describe(info: &StreamInfo, found: &Found, mapping: &Mapping) -> String {
    let unnamed = info.channels.iter().all(|channel| channel.label.is_empty());
    let guess = if unnamed && *mapping == Mapping::guess(info) { ", channels 0 and 1 by guess" } else { "" };
    format!(
        "{} ({}) on {}{guess}",
        excerpt(&info.name),
        excerpt(&info.kind),
        if info.hostname.is_empty() { found.address.to_string() } else { excerpt(&info.hostname) }
    )
}

/// The request for samples, in our byte order and without chunking.
fn request(info: &StreamInfo) -> String {
    let size = info.format.size();
    [
        format!("LSL:streamfeed/110 {}", info.uid),
        "Native-Byte-Order: 1234".into(),
        "Endian-Performance: 0".into(),
        "Has-IEEE754-Floats: 1".into(),
        "Supports-Subnormals: 1".into(),
        format!("Value-Size: {size}"),
        "Data-Protocol-Version: 110".into(),
        // Samples that the source may keep for us, a minute's worth. With room for one only, a liblsl 1.18 outlet was seen to hang.
        format!("Max-Buffer-Length: {}", (info.nominal_rate_hz.min(2000.0) * 60.0).max(4096.0)),
        "Max-Chunk-Length: 1".into(),
        "Hostname: ".into(),
        "Source-Id: ".into(),
        "Session-Id: default".into(),
        String::new(),
        String::new(),
    ]
    .join("\r\n")
}

/// A thread that compares the source's clock with ours while it is wanted.
struct Comparison {
    shared: Arc<(AtomicBool, Mutex<Option<f64>>)>,
}

impl Comparison {
    fn start(service: SocketAddr, clock: DeviceClock) -> Self {
        let shared = Arc::new((AtomicBool::new(false), Mutex::new(None)));
        let seen = Arc::clone(&shared);
        let run = move || {
            while !seen.0.load(Ordering::Relaxed) {
                // A source that does not answer is used without synchronised clocks.
                if let Ok(Some(offset)) = measure(service, &clock) {
                    *seen.1.lock().unwrap_or_else(PoisonError::into_inner) = Some(offset);
                }
                let measured = Instant::now();
                while measured.elapsed() < CLOCK_INTERVAL && !seen.0.load(Ordering::Relaxed) {
                    std::thread::sleep(Duration::from_millis(50));
                }
            }
        };
        // Without a thread the clocks are not compared, which the status shows.
        let _ = std::thread::Builder::new().name("gaze: lsl clock".into()).spawn(run);
        Self { shared }
    }

    /// The source's clock minus ours, seconds, once it is known.
    fn source_minus_ours(&self) -> Option<f64> {
        *self.shared.1.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Comparison {
    fn drop(&mut self) {
        self.shared.0.store(true, Ordering::Relaxed);
    }
}

/// The source's clock minus ours by the fastest of a few probes; `None` when none is answered.
fn measure(service: SocketAddr, clock: &DeviceClock) -> std::io::Result<Option<f64>> {
    let socket = UdpSocket::bind(("0.0.0.0", 0))?;
    socket.connect(service)?;
    socket.set_read_timeout(Some(PROBE_WAIT))?;
    let mut best: Option<(f64, f64)> = None;
    let mut datagram = [0; 256];
    for id in 0..PROBES {
        let t0 = clock.local_secs(Instant::now());
        socket.send(format!("LSL:timedata\r\n{id} {t0:.9}\r\n").as_bytes())?;
        let Ok(count) = socket.recv(&mut datagram) else { continue };
        let t3 = clock.local_secs(Instant::now());
        let Ok(reply) = ClockReply::parse(&datagram[..count]) else { continue };
        if reply.id != id {
            continue;
        }
        // The source may round our time when it repeats it.
        let (offset, round_trip) = ClockReply { t0_secs: t0, ..reply }.offset_and_round_trip(t3);
        if best.is_none_or(|(_, fastest)| round_trip < fastest) {
            best = Some((offset, round_trip));
        }
    }
    Ok(best.map(|(offset, _)| offset))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn what_a_stream_calls_itself_is_shown_as_a_line() {
        let long = "long name ".repeat(10_000);
        let xml = format!(
            "<info><name>a&#10;{long}</name><type>{long}</type><hostname>{long}</hostname><channel_count>1</channel_count>\
            <channel_format>int8</channel_format><nominal_srate>60</nominal_srate><uid>u</uid>\
            <v4data_port>1</v4data_port><v4service_port>1</v4service_port>\
            <desc><channels><channel><label>{long}</label></channel></channels></desc></info>"
        );
        let info = StreamInfo::from_xml(&xml).unwrap();
        let found = Found { info: info.clone(), address: std::net::Ipv4Addr::LOCALHOST.into() };
        let mapping = Mapping::guess(&info);
        let described = describe(&info, &found, &mapping);
        assert!(described.starts_with("a?long name") && described.len() < 300, "{described}");
        let missing = mapping.resolve(&info).unwrap_err();
        assert!(missing.len() < 300, "{missing}");
        let labelled = Mapping::preset("pupil").and_then(|mapping| mapping.resolve(&info).err()).unwrap();
        assert!(labelled.contains("long name") && labelled.len() < 300, "{labelled}");
    }

    #[test]
    fn a_time_that_is_not_sent_follows_from_the_rate() {
        let sample = |stamp_secs| Sample { stamp_secs, values: vec![] };
        assert_eq!(stamp(&sample(Some(5.0)), Some(1.0), 100.0), Some(5.0));
        assert_eq!(stamp(&sample(None), Some(1.0), 100.0), Some(1.01));
        assert_eq!(stamp(&sample(None), Some(1.0), 0.0), None);
        assert_eq!(stamp(&sample(None), None, 100.0), None);
    }
}
