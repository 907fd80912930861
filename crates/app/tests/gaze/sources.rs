//! One trace through every source gives the same gaze.

use std::time::{Duration, Instant};

use fovea_app::gaze::filter::{FilterSettings, GazeFilter};
use fovea_app::gaze::parse::trace::Trace;
use fovea_app::gaze::sample::{GazeSample, Point};
use fovea_app::gaze::source::{Calibration, GazeSource, SourceState};
use fovea_app::gaze::spec::SourceSpec;

use crate::simulators::lsl::{self, LslOutlet};
use crate::simulators::opengaze::OpenGazeServer;
use crate::simulators::pupil::PupilCapture;
use crate::synthetic::{Synthetic, place};

/// Polls until `done` or the time is up.
pub fn collect(source: &mut dyn GazeSource, secs: f64, done: impl Fn(&[GazeSample]) -> bool) -> Vec<GazeSample> {
    let start = Instant::now();
    let mut samples = Vec::new();
    while start.elapsed().as_secs_f64() < secs && !done(&samples) {
        source.poll(Instant::now(), &mut samples);
        std::thread::sleep(Duration::from_millis(2));
    }
    samples
}

pub fn open(spec: &str) -> Box<dyn GazeSource> {
    spec.parse::<SourceSpec>().unwrap().open().unwrap()
}

/// All samples of a source that sends a whole trace.
fn whole(spec: &str, rows: usize) -> (Vec<GazeSample>, Box<dyn GazeSource>) {
    let mut source = open(spec);
    let samples = collect(source.as_mut(), 15.0, |samples| samples.len() >= rows);
    (samples, source)
}

/// Filtered gaze in degrees.
fn filtered(times: impl Iterator<Item = (f64, Option<[f64; 2]>)>) -> Vec<[f64; 2]> {
    let mut filter = GazeFilter::new(FilterSettings::default());
    let deg = |point| place().deg_from_screen(point, None);
    times.filter_map(|(time, point)| filter.update(time, point.map(deg))).map(|answer| answer.point_deg).collect()
}

#[test]
fn one_trace_through_every_protocol_gives_the_same_gaze() {
    let eye = Synthetic::new(120.0, 4.0, 0.3, 11).trace;
    let rows = eye.rows.len();
    let path = std::env::temp_dir().join(format!("fovea-same-{}.csv", std::process::id()));
    std::fs::write(&path, eye.write()).unwrap();
    let tracker = OpenGazeServer::start(eye.clone());
    let _stamped = LslOutlet::start(eye.clone(), lsl::Options::new("FoveaStamped"));
    let deduced = lsl::Options { deduced_stamps: true, ..lsl::Options::new("FoveaDeduced") };
    let _deduced = LslOutlet::start(eye.clone(), deduced);
    let capture = PupilCapture::start(eye.clone(), "screen");

    // Precision of point and of time: five digits of text, 32-bit floats and a rate, 64-bit floats; six digits of a file.
    let specs = [
        (format!("opengaze::{}", tracker.port), 6e-6, 6e-6),
        ("lsl:host=127.0.0.1,name=FoveaStamped".into(), 1e-6, 1e-9),
        ("lsl:host=127.0.0.1,name=FoveaDeduced".into(), 1e-6, 1e-9),
        (format!("pupil::{}/screen", capture.port), 1e-12, 1e-9),
        (format!("trace:{}", path.display()), 6e-7, 1.1e-6),
    ];
    let expected = filtered(eye.rows.iter().map(|row| (row.time_secs, row.valid.then_some(row.point))));
    let threads: Vec<_> = specs
        .into_iter()
        .map(|(spec, precision, time_precision)| {
            let (eye, expected) = (eye.clone(), expected.clone());
            std::thread::spawn(move || {
                let (samples, source) = whole(&spec, rows);
                let status = source.status();
                assert_eq!((samples.len(), status.dropped), (rows, 0), "{spec}: {status:?}");
                same(&spec, &samples, &eye, precision, time_precision);
                let first = samples[0].device_secs;
                let gaze = filtered(samples.iter().map(|sample| {
                    let Point::Screen01(point) = sample.point else { panic!("{sample:?}") };
                    (sample.device_secs - first, sample.valid.then_some(point))
                }));
                let apart = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
                let worst = gaze.iter().zip(&expected).map(apart).fold(0.0, f64::max);
                eprintln!("{spec}: filtered gaze within {worst:.1e} degrees");
                // A fraction of 6e-6 of 44 degrees, twice for the two axes, plus the smoothing's dependence on the time.
                assert!(gaze.len() == expected.len() && worst < 2e-3, "{spec}: {worst} degrees");
            })
        })
        .collect();
    threads.into_iter().for_each(|thread| thread.join().unwrap());
    std::fs::remove_file(path).unwrap();
}

fn same(spec: &str, samples: &[GazeSample], trace: &Trace, precision: f64, time_precision: f64) {
    let (first, first_row) = (samples[0].device_secs, trace.rows[0].time_secs);
    for (sample, row) in samples.iter().zip(&trace.rows) {
        let Point::Screen01(point) = sample.point else { panic!("{sample:?}") };
        assert_eq!(sample.valid, row.valid, "{spec} at {}", row.time_secs);
        let apart = |axis: usize| (point[axis] - row.point[axis]).abs();
        assert!(!row.valid || apart(0) <= precision && apart(1) <= precision, "{spec}: {point:?} for {row:?}");
        let late = (sample.device_secs - first) - (row.time_secs - first_row);
        assert!(late.abs() <= time_precision, "{spec}: {late} s at {}", row.time_secs);
        assert!(sample.captured <= sample.arrived);
    }
}

#[test]
fn synchronised_clocks_give_whole_ages() {
    let eye = Synthetic::new(120.0, 3.0, 0.1, 5).trace;
    let _outlet = LslOutlet::start(eye.clone(), lsl::Options::new("FoveaClock"));
    let capture = PupilCapture::start(eye, "screen");
    // Samples are sent when they are due; Pupil's wait for their batch of four, 25 ms at most.
    for (spec, most) in
        [("lsl:host=127.0.0.1,name=FoveaClock".to_owned(), 12.0), (format!("pupil::{}", capture.port), 37.0)]
    {
        let mut source = open(&spec);
        let samples = collect(source.as_mut(), 10.0, |samples| samples.len() >= 300);
        assert!(source.status().synchronised, "{spec}");
        let mut ages: Vec<f64> = samples[60..].iter().map(|s| (s.arrived - s.captured).as_secs_f64() * 1e3).collect();
        ages.sort_by(f64::total_cmp);
        let median = ages[ages.len() / 2];
        eprintln!("{spec}: age {median:.2} ms median");
        assert!(median < most, "{spec}: {median} ms");
    }
}

#[test]
fn a_gazepoint_tracker_calibrates_on_request_and_says_how_well() {
    let tracker = OpenGazeServer::start(Synthetic::new(60.0, 5.0, 0.1, 3).trace);
    let mut source = open(&format!("opengaze::{}", tracker.port));
    collect(source.as_mut(), 5.0, |samples| samples.len() > 10);
    assert_eq!(source.status().calibration, Calibration::None);
    assert_eq!(source.status().screen.unwrap().size_px, [1920.0, 1080.0]);
    assert!(source.calibrate());
    let start = Instant::now();
    let summary = loop {
        match source.status().calibration {
            Calibration::Done(summary) => break summary,
            Calibration::Failed(why) => panic!("{why}"),
            _ => assert!(start.elapsed() < Duration::from_secs(5)),
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    assert_eq!((summary.mean_error_px, summary.valid_points), (17.25, 5));
    // The stream goes on meanwhile and afterwards.
    assert!(collect(source.as_mut(), 3.0, |samples| samples.len() > 30).len() > 30);
    assert_eq!(source.status().state, SourceState::Connected);
}

#[test]
fn two_clients_are_served_alike() {
    let eye = Synthetic::new(60.0, 1.5, 0.1, 9).trace;
    let tracker = OpenGazeServer::start(eye.clone());
    let spec = format!("opengaze::{}", tracker.port);
    let (mut one, mut two) = (open(&spec), open(&spec));
    let rows = eye.rows.len();
    let first = collect(one.as_mut(), 5.0, |samples| samples.len() >= rows);
    let second = collect(two.as_mut(), 5.0, |samples| samples.len() >= rows);
    assert_eq!((first.len(), second.len()), (rows, rows));
    assert!(first.iter().zip(&second).all(|(a, b)| a.point == b.point && a.device_secs == b.device_secs));
}

#[test]
fn a_stream_that_starts_anew_is_found_again() {
    let eye = Synthetic::new(120.0, 20.0, 0.1, 5).trace;
    let options = lsl::Options::new("FoveaAgain");
    let outlet = LslOutlet::start(eye.clone(), options.clone());
    let mut source = open("lsl:host=127.0.0.1,name=FoveaAgain");
    assert!(collect(source.as_mut(), 8.0, |samples| samples.len() > 50).len() > 50);
    drop(outlet);
    let start = Instant::now();
    while !matches!(source.status().state, SourceState::Lost(_)) {
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", source.status());
        std::thread::sleep(Duration::from_millis(10));
    }
    let mut rest = Vec::new();
    source.poll(Instant::now(), &mut rest);
    let _again = LslOutlet::start(eye, lsl::Options { uid: "another run".into(), ..options });
    assert!(collect(source.as_mut(), 10.0, |samples| samples.len() > 50).len() > 50, "{:?}", source.status());
}
