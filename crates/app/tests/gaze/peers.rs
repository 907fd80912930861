//! The real libraries on the other side: liblsl (pylsl) and libzmq with msgpack (pyzmq, msgpack), both ways.
//!
//! `FOVEA_PEERS` names a Python that has them; scripts/test makes one. Without it these tests say that they did not run.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use fovea_app::gaze::sample::{GazeSample, Point};
use fovea_app::gaze::source::{GazeSource, SourceState};
use serde_json::Value;

use crate::simulators::lsl::{self, LslOutlet};
use crate::simulators::pupil::PupilCapture;
use crate::sources::{collect, open};
use crate::synthetic::Synthetic;

/// A running peer; ended when dropped.
struct Peer {
    process: Child,
    output: BufReader<ChildStdout>,
}

impl Peer {
    /// `None`, said aloud, when there is no Python with the libraries.
    fn start(test: &str, script: &str, arguments: &[&str]) -> Option<Self> {
        let Some(python) = std::env::var_os("FOVEA_PEERS") else {
            eprintln!("SKIP {test}: FOVEA_PEERS is not set");
            return None;
        };
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gaze/peers");
        // liblsl asks this machine by unicast only when it is told to; containers often have no multicast.
        let settings = std::env::temp_dir().join("fovea-lsl-api.cfg");
        std::fs::write(&settings, "[lab]\nKnownPeers = {127.0.0.1}\n").unwrap();
        let mut command = Command::new(python);
        command.arg(folder.join(script)).args(arguments).env("LSLAPICFG", settings);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let output = BufReader::new(process.stdout.take().unwrap());
        Some(Self { process, output })
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        line.trim().to_owned()
    }

    fn json(&mut self) -> Value {
        serde_json::from_str(&self.line()).unwrap()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself; either way it must not outlive the test.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn x_of(sample: &GazeSample) -> f64 {
    match sample.point {
        Point::Screen01([x, _]) => x,
        other => panic!("{other:?}"),
    }
}

/// Samples at 120 Hz whose x counts up by thousandths, none missing, with ages that only clocks in step give.
fn check_counting(samples: &[GazeSample], source: &dyn GazeSource) {
    for pair in samples.windows(2) {
        let step = ((x_of(&pair[1]) - x_of(&pair[0])) * 1000.0).round() as i32;
        assert!(step == 1 || step == -999, "{step}: {pair:?}");
    }
    let status = source.status();
    assert!(status.synchronised && status.dropped == 0, "{status:?}");
    // liblsl stamps by the monotonic clock of this machine: an age is the way through both libraries, never negative.
    let mut ages: Vec<f64> =
        samples.iter().rev().take(240).map(|s| (s.arrived - s.captured).as_secs_f64() * 1e3).collect();
    ages.sort_by(f64::total_cmp);
    eprintln!("age {:.2} ms median, {:.2} ms largest", ages[ages.len() / 2], ages[ages.len() - 1]);
    assert!(ages[ages.len() / 2] < 20.0, "{ages:?}");
}

#[test]
fn liblsl_streams_are_found_read_and_found_again() {
    let name = format!("FoveaPeer{}", std::process::id());
    let test = "liblsl_streams_are_found_read_and_found_again";
    let Some(mut outlet) = Peer::start(test, "lsl_outlet.py", &[&name, "120", "60"]) else { return };
    assert_eq!(outlet.line(), "ready");
    let mut source = open(&format!("lsl:name={name}"));
    let samples = collect(source.as_mut(), 20.0, |samples| samples.len() >= 480);
    assert!(samples.len() >= 480, "{:?}", source.status());
    check_counting(&samples, source.as_ref());

    drop(outlet);
    let start = Instant::now();
    while !matches!(source.status().state, SourceState::Lost(_)) {
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", source.status());
        std::thread::sleep(Duration::from_millis(10));
    }
    collect(source.as_mut(), 0.1, |_| false);
    let mut again = Peer::start(test, "lsl_outlet.py", &[&name, "120", "60"]).unwrap();
    assert_eq!(again.line(), "ready");
    let samples = collect(source.as_mut(), 20.0, |samples| samples.len() >= 240);
    assert!(samples.len() >= 240, "{:?}", source.status());
}

#[test]
fn liblsl_reads_the_simulated_outlet() {
    let eye = Synthetic::new(120.0, 6.0, 0.2, 4).trace;
    let outlet = LslOutlet::start(eye.clone(), lsl::Options::new("FoveaSimulated"));
    let Some(mut inlet) = Peer::start("liblsl_reads_the_simulated_outlet", "lsl_inlet.py", &["FoveaSimulated", "360"])
    else {
        return;
    };
    let found = inlet.json();
    assert_eq!(found["labels"], serde_json::json!(["BPOGX", "BPOGY", "BPOGV"]));
    let values = found["values"].as_array().unwrap();
    assert_eq!(values.len(), 360);
    for (value, row) in values.iter().zip(&eye.rows) {
        let near = |index: usize, expected: f64| (value[index].as_f64().unwrap() - expected).abs() < 1e-6;
        assert!(
            near(0, row.point[0]) && near(1, row.point[1]) && near(2, f64::from(u8::from(row.valid))),
            "{value} {row:?}"
        );
    }
    // The clocks were compared: the source's is 1000 s ahead.
    let age = found["median_age"].as_f64().unwrap();
    assert!(age.abs() < 0.03, "{age} s");
    drop(outlet);
}

#[test]
fn libzmq_and_msgpack_publish_surface_gaze() {
    let Some(mut capture) = Peer::start("libzmq_and_msgpack_publish_surface_gaze", "pupil_publisher.py", &["30"])
    else {
        return;
    };
    let ready = capture.line();
    let port = ready.strip_prefix("ready ").unwrap();
    let mut source = open(&format!("pupil::{port}/screen"));
    let samples = collect(source.as_mut(), 10.0, |samples| samples.len() >= 200);
    assert!(samples.len() >= 200, "{:?}", source.status());
    let valid = samples.iter().filter(|sample| sample.valid).count();
    assert!((valid as f64 / samples.len() as f64 - 0.75).abs() < 0.03, "{valid} of {}", samples.len());
    assert!(samples.iter().all(|sample| sample.point == Point::Screen01([0.25, 0.25])), "y from the top");
    let status = source.status();
    assert!(status.synchronised && status.dropped == 0, "{status:?}");
    // Points are 0 to 24 ms old when they are sent.
    let mut ages: Vec<f64> = samples.iter().map(|s| (s.arrived - s.captured).as_secs_f64() * 1e3).collect();
    ages.sort_by(f64::total_cmp);
    assert!((5.0..40.0).contains(&ages[ages.len() / 2]), "{}", ages[ages.len() / 2]);
}

#[test]
fn libzmq_reads_the_simulated_publisher() {
    let eye = Synthetic::new(120.0, 4.0, 0.2, 4).trace;
    let capture = PupilCapture::start(eye.clone(), "screen");
    let port = capture.port.to_string();
    let Some(mut client) = Peer::start("libzmq_reads_the_simulated_publisher", "pupil_client.py", &[&port, "240"])
    else {
        return;
    };
    let points = client.json();
    for (point, row) in points.as_array().unwrap().iter().zip(&eye.rows) {
        let [x, y] = [0, 1].map(|axis| point[axis].as_f64().unwrap());
        assert!((x - row.point[0]).abs() < 1e-12 && (y - (1.0 - row.point[1])).abs() < 1e-12, "{point} {row:?}");
    }
    assert!(points.as_array().unwrap().len() >= 240);
}
