//! Writes gaze to a trace file.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::parse::trace::{Header, Row, Space};
use super::sample::{GazeSample, Point};

/// A recording that runs. Every row is written at once, so that a program that ends in the middle leaves a whole trace.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    file: File,
    space: Space,
    last_secs: f64,
    rows: u64,
}

impl Recorder {
    /// Begins a recording. A file that exists is not overwritten.
    ///
    /// # Errors
    /// When the file exists or cannot be written.
    pub fn create(path: &Path, header: &Header) -> anyhow::Result<Self> {
        let mut file = File::create_new(path).with_context(|| format!("{}: cannot be written", path.display()))?;
        file.write_all(header.write().as_bytes()).with_context(|| path.display().to_string())?;
        Ok(Self { path: path.to_owned(), file, space: header.space, last_secs: f64::NEG_INFINITY, rows: 0 })
    }

    /// Writes a sample. One whose time does not increase, or whose point is of another kind, is left out.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn write(&mut self, sample: &GazeSample) -> anyhow::Result<()> {
        let point = match (self.space, sample.point) {
            (Space::Screen01, Point::Screen01(point)) | (Space::ViewDeg, Point::ViewDeg(point)) => point,
            _ => return Ok(()),
        };
        // Rows are written to the microsecond and must increase there too.
        let time_secs = (sample.device_secs * 1e6).round() / 1e6;
        if time_secs <= self.last_secs {
            return Ok(());
        }
        let finite = point.iter().all(|value| value.is_finite());
        let row = Row {
            time_secs,
            point: if finite { point } else { [0.0; 2] },
            valid: sample.valid && finite,
            confidence: sample.confidence.clamp(0.0, 1.0),
        };
        self.last_secs = time_secs;
        self.rows += 1;
        self.file.write_all(row.write(self.space).as_bytes()).with_context(|| self.path.display().to_string())
    }

    /// Rows written.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// When nothing was recorded: then the file is removed.
    pub fn finish(self) -> anyhow::Result<u64> {
        if self.rows == 0 {
            std::fs::remove_file(&self.path).with_context(|| self.path.display().to_string())?;
            bail!("no gaze came, so nothing was recorded");
        }
        Ok(self.rows)
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
        let mut recorder = Recorder::create(&path, &header).unwrap();
        assert!(Recorder::create(&path, &header).is_err(), "nothing is overwritten");
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
        assert_eq!(recorder.finish().unwrap(), 3);
        let trace = Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(trace.header, header);
        let rows: Vec<_> = trace.rows.iter().map(|row| (row.time_secs, row.point[0], row.valid)).collect();
        assert_eq!(rows, [(1.0, 0.25, true), (1.01, 0.0, false), (1.03, 0.75, false)]);
        std::fs::remove_file(&path).unwrap();

        let empty = Recorder::create(&path, &header).unwrap();
        assert!(empty.finish().is_err() && !path.exists());
    }
}
