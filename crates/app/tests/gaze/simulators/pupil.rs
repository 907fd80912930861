//! Pupil Capture: Pupil Remote as a REP socket, and a publisher of surface messages.

use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use fovea_app::gaze::parse::trace::{Row, Trace};
use fovea_app::gaze::parse::zmtp::{self, Peer};

use super::{Stop, linger, paced, serve, write};

/// Gaze of one frame of the world camera comes in one message.
const BATCH: usize = 4;
/// Pupil's clock minus ours, seconds.
const AHEAD_SECS: f64 = 5000.0;

pub struct PupilCapture {
    /// Pupil Remote's.
    pub port: u16,
    stop: Stop,
}

impl PupilCapture {
    pub fn start(trace: Trace, surface: &str) -> Self {
        let stop = Stop::default();
        let epoch = Instant::now();
        let (trace, surface) = (Arc::new(trace), surface.to_owned());
        let publisher = serve(&stop, move |stream, stop| publish(stream, &trace, &surface, epoch, stop));
        let port = serve(&stop, move |stream, _| remote(stream, publisher, || clock(epoch)));
        Self { port, stop }
    }
}

impl Drop for PupilCapture {
    fn drop(&mut self) {
        self.stop.set();
    }
}

/// Pupil's clock.
fn clock(epoch: Instant) -> f64 {
    epoch.elapsed().as_secs_f64() + AHEAD_SECS
}

/// The next message, or `None` when the client leaves.
fn receive(stream: &mut TcpStream, peer: &mut Peer) -> Option<zmtp::Message> {
    use std::io::Read;
    let mut buffer = [0; 1024];
    loop {
        if let Some(message) = peer.next_message().ok()? {
            return Some(message);
        }
        match stream.read(&mut buffer) {
            Ok(0) | Err(_) => return None,
            Ok(count) => peer.push(&buffer[..count]),
        }
    }
}

/// Pupil Remote, until the client leaves.
pub fn remote(mut stream: TcpStream, publisher: u16, clock: impl Fn() -> f64) {
    write(&mut stream, &[&zmtp::greeting()[..], &zmtp::ready("REP")].concat());
    let mut peer = Peer::default();
    while let Some(message) = receive(&mut stream, &mut peer) {
        let answer = match message.last().map(Vec::as_slice) {
            Some(b"SUB_PORT") => publisher.to_string(),
            Some(b"t") => clock().to_string(),
            _ => "Unknown command.".into(),
        };
        write(&mut stream, &[zmtp::frame(b"", true), zmtp::frame(answer.as_bytes(), false)].concat());
    }
}

fn publish(mut stream: TcpStream, trace: &Trace, surface: &str, epoch: Instant, stop: &Stop) {
    write(&mut stream, &[&zmtp::greeting()[..], &zmtp::ready("PUB")].concat());
    let mut peer = Peer::default();
    let Some(subscription) = receive(&mut stream, &mut peer) else { return };
    let topic = format!("surfaces.{surface}");
    let wanted = subscription[0].strip_prefix(&[1]).is_some_and(|prefix| topic.as_bytes().starts_with(prefix));
    if !wanted {
        return linger(&mut stream, stop);
    }
    let (start, first) = (clock(epoch), trace.rows[0].time_secs);
    let mut batch: Vec<(f64, Row)> = Vec::new();
    let rows = trace.rows.len();
    let mut seen = 0;
    paced(trace, stop, |row| {
        seen += 1;
        batch.push((start + row.time_secs - first, *row));
        if batch.len() < BATCH && seen < rows {
            return true;
        }
        let payload = message(surface, &batch);
        batch.clear();
        write(&mut stream, &[zmtp::frame(topic.as_bytes(), true), zmtp::frame(&payload, false)].concat())
    });
    std::thread::sleep(Duration::from_millis(10));
    linger(&mut stream, stop);
}

fn text(text: &str) -> Vec<u8> {
    [&[0xd9, text.len() as u8][..], text.as_bytes()].concat()
}

fn number(value: f64) -> Vec<u8> {
    [&[0xcb][..], &value.to_be_bytes()].concat()
}

/// As Pupil Capture packs it, with what the program does not read.
pub fn message(surface: &str, rows: &[(f64, Row)]) -> Vec<u8> {
    let point = |(time, row): &(f64, Row)| {
        let [x, y] = row.point;
        [
            vec![0x86],
            text("topic"),
            text("gaze.3d.0._on_surface"),
            text("norm_pos"),
            vec![0x92],
            number(x),
            number(1.0 - y),
            text("confidence"),
            number(if row.valid { 0.95 } else { 0.1 }),
            text("on_surf"),
            vec![if row.valid { 0xc3 } else { 0xc2 }],
            text("base_data"),
            vec![0x92],
            text("gaze.3d.0."),
            number(*time),
            text("timestamp"),
            number(*time),
        ]
        .concat()
    };
    let points: Vec<u8> = rows.iter().flat_map(point).collect();
    [
        vec![0x84],
        text("topic"),
        text(&format!("surfaces.{surface}")),
        text("name"),
        text(surface),
        text("surf_to_img_trans"),
        [vec![0x93], [vec![0x93], number(1.0), number(0.0), number(0.0)].concat().repeat(3)].concat(),
        text("gaze_on_surfaces"),
        vec![0xdc, 0, rows.len() as u8],
        points,
    ]
    .concat()
}
