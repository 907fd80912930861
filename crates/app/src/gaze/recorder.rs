//! Writes gaze to a trace file.

use std::fmt;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};

use super::clock::RESTART_SECS;
use super::parse::trace::{Header, MAX_SECS, MIN_STEP_SECS, Row, Space};
use super::sample::{GazeSample, Point};

/// A recording that runs. Every row is written at once, so that a program that ends in the middle leaves a whole trace; so does a
/// disc that is full, of which half a row is taken back.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    file: File,
    header: Header,
    /// Bytes of whole rows.
    length: u64,
    last: Option<Last>,
    /// The trace's time minus the device's: of a device that has started again, times go on where they were.
    offset_secs: f64,
    rows: u64,
    restarts: u64,
    left_out: u64,
}

/// The last row.
#[derive(Clone, Copy, Debug)]
struct Last {
    /// In the trace.
    secs: f64,
    device_secs: f64,
    arrived: Instant,
    /// When the last sample came, in the trace or not.
    heard: Instant,
}

impl Recorder {
    /// Begins a recording, whose space is that of its first sample. A file that exists is not overwritten.
    ///
    /// # Errors
    /// When the file exists or cannot be written.
    pub fn create(path: &Path, header: Header) -> anyhow::Result<Self> {
        let file = File::options().append(true).create_new(true).open(path);
        let file = file.with_context(|| format!("{}: cannot be written", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            file,
            header,
            length: 0,
            last: None,
            offset_secs: 0.0,
            rows: 0,
            restarts: 0,
            left_out: 0,
        })
    }

    /// Writes a sample. One whose time does not increase, or whose point is of another kind than the first, is left out and
    /// counted; so is a point of the picture, which is nowhere on the screen without the window's place. Where the device's
    /// clock has started again, times go on by when samples came.
    ///
    /// # Errors
    /// When the disk is full, or the time is beyond what a trace holds.
    pub fn write(&mut self, sample: &GazeSample) -> anyhow::Result<()> {
        let (space, point) = match sample.point {
            Point::Screen01(point) => (Space::Screen01, point),
            Point::ViewDeg(point) => (Space::ViewDeg, point),
            Point::Picture(_) => {
                self.left_out += 1;
                return Ok(());
            }
        };
        let restart_secs = self.last.and_then(|last| restarted(&last, sample));
        let offset_secs = restart_secs.map_or(self.offset_secs, |secs| secs - sample.device_secs);
        // Rows are written to the microsecond and must increase there too.
        let time_secs = ((sample.device_secs + offset_secs) * 1e6).round() / 1e6;
        if time_secs.abs() > MAX_SECS {
            bail!("{}: the time {time_secs:e} s is beyond +-{MAX_SECS:e} s", self.path.display());
        }
        if let Some(last) = self.last.as_mut().filter(|last| time_secs <= last.secs || space != self.header.space) {
            last.heard = sample.arrived;
            self.left_out += 1;
            return Ok(());
        }
        let finite = point.iter().all(|value| value.is_finite());
        let row = Row {
            time_secs,
            point: if finite { point } else { [0.0; 2] },
            valid: sample.valid && finite,
            confidence: sample.confidence.clamp(0.0, 1.0),
        };
        let mut text = row.write(space);
        if self.rows == 0 {
            self.header.space = space;
            text.insert_str(0, &self.header.write());
        }
        if restart_secs.is_some() {
            text.insert_str(0, "# the tracker's clock has started again: times go on by when rows came\n");
            self.restarts += 1;
        }
        if let Err(error) = self.file.write_all(text.as_bytes()) {
            // The first error is the one to report; half a row that cannot be taken back is passed over by who reads the trace.
            let _ = self.file.set_len(self.length);
            return Err(error).with_context(|| self.path.display().to_string());
        }
        self.length += text.len() as u64;
        self.offset_secs = offset_secs;
        let GazeSample { device_secs, arrived, .. } = *sample;
        self.last = Some(Last { secs: time_secs, device_secs, arrived, heard: arrived });
        self.rows += 1;
        Ok(())
    }

    /// Rows written.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// When nothing was recorded: then no file is left.
    pub fn finish(mut self) -> anyhow::Result<Recorded> {
        if self.rows == 0 {
            bail!("no gaze came, so nothing was recorded");
        }
        let Self { rows, restarts, left_out, .. } = self;
        Ok(Recorded { rows, restarts, left_out, path: std::mem::take(&mut self.path) })
    }
}

/// The time in the trace of a sample whose device has started again since the last row: far back in time, or back in time
/// after a silence.
fn restarted(last: &Last, sample: &GazeSample) -> Option<f64> {
    let back_secs = last.device_secs - sample.device_secs;
    let since = |then| sample.arrived.saturating_duration_since(then).as_secs_f64();
    let is_restart = back_secs >= RESTART_SECS || back_secs > 0.0 && since(last.heard) >= RESTART_SECS;
    is_restart.then(|| last.secs + since(last.arrived).max(MIN_STEP_SECS))
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if self.rows == 0 {
            // Where that fails an empty file is left, which says as much.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// What a recording came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Rows written.
    pub rows: u64,
    /// How often the device's clock started again.
    pub restarts: u64,
    /// Samples that are not in it.
    pub left_out: u64,
    /// The file.
    pub path: PathBuf,
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rows in {}", self.rows, self.path.display())?;
        if self.restarts > 0 {
            write!(f, "; restarts of the tracker's clock: {}", self.restarts)?;
        }
        if self.left_out > 0 {
            write!(f, "; left out, as times do not increase or points are of another kind: {}", self.left_out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::time::Instant;

    use super::*;
    use crate::gaze::parse::trace::Trace;

    fn sample(device_secs: f64, point: Point, valid: bool) -> GazeSample {
        let now = Instant::now();
        GazeSample { device_secs, captured: now, arrived: now, point, valid, confidence: 0.75 }
    }

    #[test]
    fn a_recording_reads_back_as_a_trace() {
        let path = std::env::temp_dir().join(format!("fovea-recorder-{}.csv", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let header = Header { source: "test".into(), rate_hz: Some(100.0), ..Header::default() };
        let mut recorder = Recorder::create(&path, header.clone()).unwrap();
        assert!(Recorder::create(&path, header.clone()).is_err(), "nothing is overwritten");
        for (time, point, valid) in [
            (1.0, Point::Screen01([0.25, 0.5]), true),
            (1.01, Point::Screen01([f64::NAN, 0.5]), true),
            (1.01, Point::Screen01([0.25, 0.5]), true),
            (0.5, Point::Screen01([0.25, 0.5]), true),
            (1.02, Point::ViewDeg([0.25, 0.5]), true),
            (1.03, Point::Screen01([0.75, 0.5]), false),
        ] {
            recorder.write(&sample(time, point, valid)).unwrap();
        }
        let recorded = recorder.finish().unwrap();
        assert_eq!(recorded, Recorded { rows: 3, restarts: 0, left_out: 3, path: path.clone() });
        assert!(recorded.to_string().ends_with("of another kind: 3"), "{recorded}");
        let trace = Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(trace.header, header);
        let rows: Vec<_> = trace.rows.iter().map(|row| (row.time_secs, row.point[0], row.valid)).collect();
        assert_eq!(rows, [(1.0, 0.25, true), (1.01, 0.0, false), (1.03, 0.75, false)]);
        std::fs::remove_file(&path).unwrap();

        let empty = Recorder::create(&path, header).unwrap();
        assert!(empty.finish().is_err() && !path.exists());
    }

    #[test]
    fn a_recording_goes_on_when_the_clock_starts_again() {
        let path = std::env::temp_dir().join(format!("fovea-recorder-again-{}.csv", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let mut recorder = Recorder::create(&path, Header::default()).unwrap();
        let start = Instant::now();
        // Device time, and when the sample came: a tracker that starts again, one that does twice in a short time, and a sample
        // that is merely late.
        for (device_secs, arrived_ms) in
            [(50.0, 0), (50.01, 10), (0.5, 2510), (0.52, 2530), (0.51, 2540), (0.3, 4530), (0.31, 4540)]
        {
            let arrived = start + std::time::Duration::from_millis(arrived_ms);
            let sample = GazeSample { arrived, ..sample(device_secs, Point::Screen01([0.5; 2]), true) };
            recorder.write(&sample).unwrap();
        }
        let recorded = recorder.finish().unwrap();
        assert_eq!((recorded.rows, recorded.restarts, recorded.left_out), (6, 2, 1));
        assert!(
            recorded.to_string().contains("clock: 2; left out") && recorded.to_string().ends_with(": 1"),
            "{recorded}"
        );
        let trace = Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let times: Vec<f64> = trace.rows.iter().map(|row| row.time_secs).collect();
        assert_eq!(times, [50.0, 50.01, 52.51, 52.53, 54.53, 54.54]);
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn the_first_sample_says_in_which_space_a_recording_is() {
        let path = std::env::temp_dir().join(format!("fovea-recorder-space-{}.csv", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let mut recorder = Recorder::create(&path, Header::default()).unwrap();
        for (time, point) in [
            (0.5, Point::Picture([0.0; 2])),
            (1.0, Point::ViewDeg([-5.0, 2.5])),
            (1.01, Point::Screen01([0.5, 0.5])),
            (1.02, Point::ViewDeg([-6.0, 2.5])),
        ] {
            recorder.write(&sample(time, point, true)).unwrap();
        }
        let late = recorder.write(&sample(1.7e12, Point::ViewDeg([0.0; 2]), true)).unwrap_err();
        assert!(late.to_string().contains("1.7e12 s"), "milliseconds since 1970: {late}");
        recorder.finish().unwrap();
        let trace = Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(trace.header.space, Space::ViewDeg);
        assert_eq!(trace.rows.iter().map(|row| row.point[0]).collect::<Vec<_>>(), [-5.0, -6.0]);
        std::fs::remove_file(&path).unwrap();
    }
}
