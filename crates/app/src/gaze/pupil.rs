//! Pupil Core: gaze on a surface, by Pupil Capture's network interface.
//!
//! A REQ socket asks Pupil Remote for the port of the publisher and for its time, a SUB socket reads the surface's messages.
//! Both speak ZMTP 3.0 here; no ZeroMQ library is needed for that, and frames stay bounded.

use std::collections::VecDeque;
use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::clock::DeviceClock;
use super::feed::{Ended, FeedSource, Link, Outlet};
use super::parse::excerpt;
use super::parse::pupil::SurfaceMessage;
use super::parse::zmtp::{self, Peer};
use super::sample::Point;

/// Where Pupil Remote listens.
pub const DEFAULT_PORT: u16 = 50_020;
/// Points less certain than this do not count.
const LEAST_CONFIDENCE: f64 = 0.6;
/// How long Pupil Remote may take to answer.
const ANSWER: Duration = Duration::from_secs(2);
/// Questions for the time, of which the fastest answer counts.
const CLOCK_PROBES: u32 = 5;
/// How often the time is asked for: Pupil's clock can be set while it runs, and its answer says that it is there while no surface
/// is in sight.
const CLOCK_INTERVAL: Duration = Duration::from_secs(5);

/// Starts a source for one surface, or for all.
pub fn source(host: &str, port: u16, surface: Option<&str>) -> FeedSource {
    let link = PupilCore { host: host.to_owned(), port, surface: surface.map(str::to_owned) };
    FeedSource::start("gaze: pupil", link, false)
}

struct PupilCore {
    host: String,
    port: u16,
    surface: Option<String>,
}

/// A connection and what has come over it.
struct Socket {
    stream: TcpStream,
    peer: Peer,
    ready: VecDeque<zmtp::Message>,
    heard: Instant,
}

impl Socket {
    fn open(outlet: &Outlet, host: &str, port: u16, kind: &str) -> Result<Self, Ended> {
        let mut stream = outlet.connect(host, port)?;
        stream.write_all(&zmtp::greeting())?;
        stream.write_all(&zmtp::ready(kind))?;
        let mut socket = Self { stream, peer: Peer::default(), ready: VecDeque::new(), heard: Instant::now() };
        // libzmq hangs up on a peer whose first message comes before the handshake is over.
        let asked = Instant::now();
        while !socket.peer.is_ready() {
            if asked.elapsed() > ANSWER {
                return Err(Ended::Lost(format!("{host}:{port} accepts, but does not speak ZeroMQ")));
            }
            socket.read(outlet)?;
        }
        Ok(socket)
    }

    /// Reads what has come.
    fn read(&mut self, outlet: &Outlet) -> Result<(), Ended> {
        let mut buffer = [0; 16_384];
        let count = outlet.read(&mut self.stream, &mut buffer, &mut self.heard)?;
        self.peer.push(&buffer[..count]);
        loop {
            match self.peer.next_message() {
                Ok(Some(message)) => self.ready.push_back(message),
                Ok(None) => return Ok(()),
                Err(error) => return Err(Ended::Lost(error.to_string())),
            }
        }
    }

    /// Asks and waits for the answer's text.
    fn ask(&mut self, outlet: &Outlet, question: &str) -> Result<String, Ended> {
        let request = [zmtp::frame(b"", true), zmtp::frame(question.as_bytes(), false)].concat();
        self.stream.write_all(&request)?;
        let asked = Instant::now();
        self.heard = asked;
        loop {
            if let Some(message) = self.ready.pop_front() {
                let text = message.last().map(|frame| String::from_utf8_lossy(frame).into_owned());
                return Ok(text.unwrap_or_default());
            }
            if asked.elapsed() > ANSWER {
                return Err(Ended::Lost("Pupil Remote does not answer".into()));
            }
            self.read(outlet)?;
        }
    }
}

impl Link for PupilCore {
    fn session(&mut self, outlet: &Outlet) -> Ended {
        match self.run(outlet) {
            Ok(never) => match never {},
            Err(ended) => ended,
        }
    }
}

impl PupilCore {
    fn run(&self, outlet: &Outlet) -> Result<std::convert::Infallible, Ended> {
        let mut remote = Socket::open(outlet, &self.host, self.port, "REQ")?;
        let mut clock = DeviceClock::new(Instant::now());
        let answer = remote.ask(outlet, "SUB_PORT")?;
        let port: u16 = answer
            .trim()
            .parse()
            .map_err(|_| Ended::Lost(format!("Pupil Remote names the port `{}`", excerpt(&answer))))?;
        compare_clocks(&mut remote, outlet, &mut clock)?;
        let mut compared = Instant::now();
        let topic = format!("surfaces.{}", self.surface.as_deref().unwrap_or_default());
        let mut publisher = Socket::open(outlet, &self.host, port, "SUB")?;
        // A subscription is a message of a 1 and the topic's beginning.
        publisher.stream.write_all(&zmtp::frame(&[&[1], topic.as_bytes()].concat(), false))?;
        outlet.update(|status| status.detail = format!("{}:{port}, {topic}", self.host));
        outlet.connected();
        loop {
            let was_synchronised = clock.is_synchronised();
            publisher.read(outlet)?;
            while let Some(message) = publisher.ready.pop_front() {
                let Some(payload) = message.get(1) else { continue };
                match SurfaceMessage::parse(payload) {
                    Ok(surface) => hand_over(&surface, self.surface.as_deref(), &mut clock, outlet),
                    Err(error) => outlet.update(|status| {
                        status.dropped += 1;
                        status.detail = format!("unreadable message: {error}");
                    }),
                }
            }
            if compared.elapsed() >= CLOCK_INTERVAL || was_synchronised && !clock.is_synchronised() {
                compare_clocks(&mut remote, outlet, &mut clock)?;
                compared = Instant::now();
                // A publisher without anything to say is not gone.
                publisher.heard = compared.max(publisher.heard);
            }
        }
    }
}

fn hand_over(surface: &SurfaceMessage, wanted: Option<&str>, clock: &mut DeviceClock, outlet: &Outlet) {
    // A topic is matched by its beginning: `screen` also lets `screen2` through.
    if wanted.is_some_and(|wanted| wanted != surface.name) {
        return;
    }
    let mut gaze = surface.gaze.clone();
    gaze.sort_by(|a, b| a.time_secs.total_cmp(&b.time_secs));
    for point in gaze {
        let [x, y] = point.norm_pos;
        let valid = point.on_surface && point.confidence >= LEAST_CONFIDENCE;
        outlet.send(clock, point.time_secs, Point::Screen01([x, 1.0 - y]), valid, point.confidence);
    }
}

/// Measures our clock minus Pupil's by the fastest of a few answers; one that does not tell its time is left to be estimated.
fn compare_clocks(remote: &mut Socket, outlet: &Outlet, clock: &mut DeviceClock) -> Result<(), Ended> {
    let mut best: Option<(f64, f64)> = None;
    for _ in 0..CLOCK_PROBES {
        let asked = clock.local_secs(Instant::now());
        let answer = remote.ask(outlet, "t")?;
        let round_trip = clock.local_secs(Instant::now()) - asked;
        let Some(time) = super::parse::finite(&answer) else { return Ok(()) };
        if best.is_none_or(|(fastest, _)| round_trip < fastest) {
            best = Some((round_trip, asked + round_trip * 0.5 - time));
        }
    }
    best.into_iter().for_each(|(_, offset)| clock.set_offset(offset));
    Ok(())
}
