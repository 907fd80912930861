//! Gazepoint trackers by the Open Gaze API, version 2.

use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::clock::DeviceClock;
use super::feed::{Ended, FeedSource, Link, Outlet};
use super::parse::excerpt;
use super::parse::opengaze::{CalibrationSummary, Splitter, Tag};
use super::sample::Point;
use super::source::{Calibration, TrackedScreen};

/// Where Gazepoint Control listens.
pub const DEFAULT_PORT: u16 = 4242;
/// What is asked for, in this order; the last one starts the stream.
const ENABLED: [&str; 5] =
    ["ENABLE_SEND_TIME", "ENABLE_SEND_COUNTER", "ENABLE_SEND_POG_BEST", "ENABLE_SEND_BLINK", "ENABLE_SEND_DATA"];
/// A calibration that says nothing for so long is given up.
const CALIBRATION: Duration = Duration::from_secs(60);

/// Starts a source.
pub fn source(host: &str, port: u16) -> FeedSource {
    FeedSource::start("gaze: opengaze", OpenGaze { host: host.to_owned(), port }, true)
}

struct OpenGaze {
    host: String,
    port: u16,
}

impl Link for OpenGaze {
    fn session(&mut self, outlet: &Outlet) -> Ended {
        match self.run(outlet) {
            Ok(never) => match never {},
            Err(ended) => ended,
        }
    }
}

impl OpenGaze {
    fn run(&self, outlet: &Outlet) -> Result<std::convert::Infallible, Ended> {
        let mut stream = outlet.connect(&self.host, self.port)?;
        stream.write_all(b"<GET ID=\"SCREEN_SIZE\" />\r\n")?;
        for id in ENABLED {
            stream.write_all(format!("<SET ID=\"{id}\" STATE=\"1\" />\r\n").as_bytes())?;
        }
        outlet.update(|status| status.detail = format!("{}:{}", self.host, self.port));
        let mut session =
            Session { clock: DeviceClock::new(Instant::now()), splitter: Splitter::default(), calibrating: None };
        let (mut buffer, mut heard) = ([0; 4096], Instant::now());
        loop {
            let count = outlet.read(&mut stream, &mut buffer, &mut heard)?;
            session.splitter.push(&buffer[..count]);
            while let Some(tag) = session.splitter.next_tag() {
                match tag {
                    Ok(tag) => session.handle(&tag, &mut stream, outlet)?,
                    Err(error) => outlet.update(|status| {
                        status.dropped += 1;
                        status.detail = format!("unreadable data: {error}");
                    }),
                }
            }
            session.calibration(&mut stream, outlet)?;
        }
    }
}

struct Session {
    clock: DeviceClock,
    splitter: Splitter,
    /// Since when a calibration runs.
    calibrating: Option<Instant>,
}

impl Session {
    fn handle(&mut self, tag: &Tag, stream: &mut TcpStream, outlet: &Outlet) -> Result<(), Ended> {
        if let Some(gaze) = tag.gaze() {
            // A tracker that was not told to send its time still sends at a steady rate; arrival has to do.
            let time = gaze.time_secs.unwrap_or_else(|| self.clock.local_secs(Instant::now()));
            outlet.send(&mut self.clock, time, Point::Screen01(gaze.point), gaze.valid, 1.0);
            return Ok(());
        }
        match (tag.name.as_str(), tag.get("ID")) {
            ("ACK", Some("SCREEN_SIZE")) => {
                let number = |key| tag.number(key);
                let size =
                    number("WIDTH").zip(number("HEIGHT")).filter(|(width, height)| *width > 0.0 && *height > 0.0);
                if let (Some(x), Some(y), Some((width, height))) = (number("X"), number("Y"), size) {
                    let screen = TrackedScreen { origin_px: [x, y], size_px: [width, height] };
                    outlet.update(|status| status.screen = Some(screen));
                }
            }
            ("ACK", Some("ENABLE_SEND_DATA")) => outlet.connected(),
            ("NACK", Some(id)) if ENABLED.contains(&id) => {
                return Err(Ended::Failed(format!("the tracker refuses {id}")));
            }
            ("NACK", Some(id)) if id.starts_with("CALIBRATE") => {
                self.calibrated(outlet, Calibration::Failed(excerpt(id)));
            }
            ("CAL", Some("CALIB_RESULT")) if self.calibrating.is_some() => {
                stream.write_all(
                    b"<SET ID=\"CALIBRATE_SHOW\" STATE=\"0\" />\r\n<GET ID=\"CALIBRATE_RESULT_SUMMARY\" />\r\n",
                )?;
            }
            ("ACK", Some("CALIBRATE_RESULT_SUMMARY")) if self.calibrating.is_some() => {
                let result = CalibrationSummary::from_tag(tag)
                    .map_or_else(|| Calibration::Failed("no summary".into()), Calibration::Done);
                self.calibrated(outlet, result);
            }
            _ => {}
        }
        Ok(())
    }

    /// Starts a calibration that was asked for, and gives up one that does not end.
    fn calibration(&mut self, stream: &mut TcpStream, outlet: &Outlet) -> Result<(), Ended> {
        if outlet.take_calibration() {
            self.calibrating = Some(Instant::now());
            for id in ["CALIBRATE_SHOW", "CALIBRATE_START"] {
                stream.write_all(format!("<SET ID=\"{id}\" STATE=\"1\" />\r\n").as_bytes())?;
            }
        }
        if self.calibrating.is_some_and(|since| since.elapsed() > CALIBRATION) {
            stream.write_all(b"<SET ID=\"CALIBRATE_SHOW\" STATE=\"0\" />\r\n")?;
            self.calibrated(outlet, Calibration::Failed("no result within a minute".into()));
        }
        Ok(())
    }

    fn calibrated(&mut self, outlet: &Outlet, result: Calibration) {
        self.calibrating = None;
        outlet.update(|status| status.calibration = result);
    }
}
