//! Writes gaze to a trace file.

use std::fmt;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::parse::trace::{Header, MAX_SECS, Row, Space};
use super::sample::{GazeSample, Point};

/// A recording that runs. Every row is written at once, so that a program that ends in the middle leaves a whole trace.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    file: File,
    header: Header,
    last_secs: f64,
    rows: u64,
}

impl Recorder {
    /// Begins a recording, whose space is that of its first sample. A file that exists is not overwritten.
    ///
    /// # Errors
    /// When the file exists or cannot be written.
    pub fn create(path: &Path, header: Header) -> anyhow::Result<Self> {
        let file = File::create_new(path).with_context(|| format!("{}: cannot be written", path.display()))?;
        Ok(Self { path: path.to_owned(), file, header, last_secs: f64::NEG_INFINITY, rows: 0 })
    }

    /// Writes a sample. One whose time does not increase, or whose point is of another kind than the first, is left out;
    /// so is a point of the picture, which is nowhere on the screen without the window's place.
    ///
    /// # Errors
    /// When the disk is full, or the time is beyond what a trace holds.
    pub fn write(&mut self, sample: &GazeSample) -> anyhow::Result<()> {
        let (space, point) = match sample.point {
            Point::Screen01(point) => (Space::Screen01, point),
            Point::ViewDeg(point) => (Space::ViewDeg, point),
            Point::Picture(_) => return Ok(()),
        };
        // Rows are written to the microsecond and must increase there too.
        let time_secs = (sample.device_secs * 1e6).round() / 1e6;
        if time_secs.abs() > MAX_SECS {
            bail!("{}: the time {time_secs:e} s is beyond +-{MAX_SECS:e} s", self.path.display());
        }
        if time_secs <= self.last_secs || self.rows > 0 && space != self.header.space {
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
        self.file.write_all(text.as_bytes()).with_context(|| self.path.display().to_string())?;
        self.last_secs = time_secs;
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
        Ok(Recorded { rows: self.rows, path: std::mem::take(&mut self.path) })
    }
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
    /// The file.
    pub path: PathBuf,
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rows in {}", self.rows, self.path.display())
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
        assert_eq!(recorder.finish().unwrap(), Recorded { rows: 3, path: path.clone() });
        let trace = Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(trace.header, header);
        let rows: Vec<_> = trace.rows.iter().map(|row| (row.time_secs, row.point[0], row.valid)).collect();
        assert_eq!(rows, [(1.0, 0.25, true), (1.01, 0.0, false), (1.03, 0.75, false)]);
        std::fs::remove_file(&path).unwrap();

        let empty = Recorder::create(&path, header).unwrap();
        assert!(empty.finish().is_err() && !path.exists());
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
