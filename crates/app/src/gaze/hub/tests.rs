#![expect(clippy::unwrap_used, reason = "a test may panic")]

use super::*;
use crate::gaze::drift::DriftCorrection;
use crate::gaze::geometry::RectPx;
use crate::gaze::parse::trace::{Space, Trace};
use crate::screen::ScreenGeometry;

const START_MS: u64 = 10_000;

/// A hub whose preferred source is a recording at 100 Hz: x 0.75 for a second, then nothing for `gap_ms`, then again.
fn hub(gap_ms: u64) -> (GazeHub, std::path::PathBuf) {
    let rows = (0..100)
        .chain(100 + gap_ms / 10..400 + gap_ms / 10)
        .map(|step| format!("{},0.75,0.5,1,1\n", step as f64 * 0.01));
    let text = format!("# gaze-trace v1; space=screen01\n{}", rows.collect::<String>());
    let path = std::env::temp_dir().join(format!("fovea-hub-{gap_ms}-{:?}.csv", std::thread::current().id()));
    std::fs::write(&path, text).unwrap();
    (GazeHub::new(&[SourceSpec::Trace(path.clone(), false)], None).unwrap(), path)
}

fn place() -> WindowPlace {
    let whole = RectPx { origin: [0.0; 2], size: [1000.0, 500.0] };
    let screen = ScreenGeometry { width_mm: 500.0, height_mm: 250.0, distance_mm: 600.0 };
    WindowPlace { monitor: whole, picture: whole, screen, position_known: true }
}

fn view() -> View {
    View::new(0.0, 0.0, 1.0, 0.5)
}

/// Runs so many milliseconds at 100 Hz; what is looked at afterwards.
fn run(hub: &GazeHub, start: Instant, from_ms: u64, to_ms: u64) -> Target {
    let mut target = hub.target(start + Duration::from_millis(from_ms), &view());
    for ms in (from_ms..=to_ms).step_by(10) {
        let now = start + Duration::from_millis(ms);
        hub.frame(now, place(), view(), Some([-0.5, 0.25]));
        target = hub.target(now, &view());
    }
    target
}

fn near(target: Target, x: f32, y: f32) -> bool {
    target.point.distance(Vec2::new(x, y)) < 1e-3
}

#[test]
fn a_lost_tracker_gives_way_to_the_pointer_and_comes_back_with_a_note() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (hub, path) = hub(1500);
    let first = run(&hub, start, 0, 900);
    assert!(near(first, 0.5, 0.0), "{first:?}");
    assert_eq!(first.accuracy_deg, USUAL_ACCURACY_DEG);

    let gap = run(&hub, start, 910, 1300);
    assert!(near(gap, 0.5, 0.0), "a short gap holds: {gap:?}");
    let lost = run(&hub, start, 1310, 1800);
    assert!(near(lost, -0.5, 0.25), "the pointer: {lost:?}");
    assert_eq!(lost.accuracy_deg, USUAL_ACCURACY_DEG, "another width would compile another kernel");
    let report = hub.report(start + Duration::from_millis(1800));
    assert!(
        report.note.as_ref().is_some_and(|(text, _)| text.contains("lost") && text.contains("mouse")),
        "{report:?}"
    );
    assert_eq!(report.sources.iter().map(|source| source.active).collect::<Vec<_>>(), [false, true]);

    let early = run(&hub, start, 2490, 2600);
    assert!(near(early, -0.5, 0.25), "not at the first sample: {early:?}");
    let back = run(&hub, start, 2610, 3500);
    assert!(near(back, 0.5, 0.0), "{back:?}");
    let report = hub.report(start + Duration::from_millis(3500));
    assert!(report.note.is_some_and(|(text, _)| text.contains("trace:")) && report.sources[0].active);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn before_anything_is_known_the_pointer_is_the_gaze() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let hub = GazeHub::new(&[SourceSpec::OpenGaze("127.0.0.1".into(), 1)], None).unwrap();
    assert_eq!(
        hub.target(start, &view()),
        Target { point: Vec2::ZERO, sample: None, accuracy_deg: USUAL_ACCURACY_DEG }
    );
    let target = run(&hub, start, 0, 50);
    assert!(near(target, -0.5, 0.25), "{target:?}");
    assert_eq!(hub.report(start).note, None, "nothing was lost");
}

#[test]
fn a_sample_goes_through_the_view_at_its_own_time() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (hub, path) = hub(0);
    run(&hub, start, 0, 500);
    // The view turns at once by 20 degrees; the samples that are there were taken before.
    let turned = View::new(20_f32.to_radians(), 0.0, 1.0, 0.5);
    hub.frame(start + Duration::from_millis(505), place(), turned, None);
    let target = hub.target(start + Duration::from_millis(506), &turned);
    let direction = view().direction_at(Vec2::new(0.5, 0.0));
    assert!(target.point.distance(turned.point_of(direction).unwrap()) < 1e-3, "{target:?}");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_sample_waits_one_frame_where_every_frame_asks_and_longer_where_every_second_does() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let ms = Duration::from_millis;
    for (asks_every, longest) in [(1, 30), (2, 60)] {
        let (hub, path) = hub(0);
        hub.frame(start, place(), view(), None);
        let mut sample = None;
        for frame in 0..30 {
            // Frames of 33 ms, each with 3 ms until its batch begins.
            let began = start + ms(33 * frame);
            if frame % asks_every == 0 {
                sample = hub.target(began, &view()).sample;
            }
            hub.batch(began, began + ms(3), sample);
        }
        let timing = hub.report(start + ms(33 * 30)).timing;
        assert_eq!(timing.longest_frame, Some(ms(36)), "frames are as long either way");
        let (_, found) = timing.arrival_to_batch.unwrap();
        assert!(found.abs_diff(ms(longest)) <= ms(10), "{found:?} where every {asks_every}. frame asks");
        assert_eq!(found <= ms(36), asks_every == 1);
        std::fs::remove_file(path).unwrap();
    }
}

#[test]
fn drift_is_taken_off_and_accuracy_widens() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (hub, path) = hub(0);
    let true_deg = place().deg_from_picture([0.3, 0.1]);
    let seen_deg = place().deg_from_screen([0.75, 0.5], None);
    let drift = DriftCorrection { offset_deg: [seen_deg[0] - true_deg[0], seen_deg[1] - true_deg[1]] };
    hub.set_profile(Profile { drift, accuracy_deg: Some(0.63), ..Profile::default() });
    let target = run(&hub, start, 0, 500);
    assert!(near(target, 0.3, 0.1), "{target:?}");
    assert!((target.accuracy_deg - 0.6).abs() < 1e-9);
    let raw = hub.take_raw(start + Duration::from_millis(500));
    assert!(raw.len() >= 45 && raw.iter().all(|(_, deg)| (deg[0] - seen_deg[0]).abs() < 1e-9), "uncorrected");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn sources_are_switched_while_running_and_a_wrong_one_changes_nothing() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (hub, path) = hub(0);
    run(&hub, start, 0, 500);
    let missing = SourceSpec::Trace("no/such/trace.csv".into(), false);
    assert!(hub.choose(&[missing], start).is_err());
    assert_eq!(hub.specs().len(), 2);
    hub.choose(&[SourceSpec::Mouse], start).unwrap();
    let pointer = run(&hub, start, 510, 600);
    assert!(near(pointer, -0.5, 0.25) && pointer.accuracy_deg == 0.0, "{pointer:?}");
    hub.choose(&[SourceSpec::Trace(path.clone(), true)], start).unwrap();
    assert!(near(run(&hub, start, 610, 1200), 0.5, 0.0));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn the_pointer_is_recorded_as_fractions_of_the_screen() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let hub = GazeHub::new(&[], None).unwrap();
    let path = std::env::temp_dir().join(format!("fovea-hub-record-{}.csv", std::process::id()));
    let _ = std::fs::remove_file(&path);
    run(&hub, start, 0, 50);
    hub.record(&path).unwrap();
    run(&hub, start, 60, 200);
    assert_eq!(hub.report(start).recording, Some(15));
    let how = hub.stop_recording();
    assert_eq!(how, Some(format!("15 rows in {}", path.display())));
    assert_eq!((hub.stop_recording(), hub.report(start).recorded), (None, how));
    let trace = Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert!(trace.rows.iter().all(|row| row.point == [0.25, 0.375] && row.valid), "{:?}", trace.rows[0]);
    assert_eq!((trace.header.source.as_str(), trace.header.distance_mm), ("mouse", Some(600.0)));
    std::fs::remove_file(path).unwrap();
}

/// A path for a recording, and what was recorded there.
fn recording(name: &str) -> (std::path::PathBuf, impl Fn() -> Trace) {
    let path = std::env::temp_dir().join(format!("fovea-hub-{name}-{}.csv", std::process::id()));
    let _ = std::fs::remove_file(&path);
    let read = path.clone();
    (path, move || {
        let text = std::fs::read_to_string(&read).unwrap();
        std::fs::remove_file(&read).unwrap();
        Trace::parse(&text).unwrap()
    })
}

#[test]
fn another_source_ends_the_recording_and_what_was_recorded_is_kept() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (hub, path) = hub(0);
    run(&hub, start, 0, 300);
    let (to, recorded) = recording("chosen");
    hub.record(&to).unwrap();
    run(&hub, start, 310, 500);
    let missing = SourceSpec::Trace("no/such/trace.csv".into(), false);
    assert!(hub.choose(&[missing], start).is_err());
    assert_eq!(hub.report(start).recording, Some(20), "what cannot be chosen ends nothing");
    hub.choose(&[SourceSpec::Mouse], start).unwrap();
    let report = hub.report(start);
    let how = format!("20 rows in {}", to.display());
    assert_eq!((report.recording, report.recorded), (None, Some(how.clone())));
    assert!(report.note.is_some_and(|(text, _)| text.contains("mouse") && text.contains(&how)));
    run(&hub, start, 510, 700);
    let trace = recorded();
    assert_eq!((trace.rows.len(), trace.rows[0].point), (20, [0.75, 0.5]));
    assert_eq!(trace.header.source, SourceSpec::Trace(path.clone(), false).to_string());
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_tracker_that_is_lost_when_the_recording_begins_is_recorded_all_the_same() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (hub, path) = hub(1500);
    let lost = run(&hub, start, 0, 1800);
    assert!(near(lost, -0.5, 0.25), "the pointer: {lost:?}");
    let (to, recorded) = recording("lost");
    hub.record(&to).unwrap();
    run(&hub, start, 1810, 3500);
    hub.stop_recording().unwrap();
    let trace = recorded();
    assert_eq!(trace.header.source, SourceSpec::Trace(path.clone(), false).to_string());
    assert!(trace.rows.len() > 90 && trace.rows.iter().all(|row| row.point == [0.75, 0.5]));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_tracker_that_never_came_leaves_the_recording_to_the_next() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let (first, path) = hub(0);
    drop(first);
    let trace = SourceSpec::Trace(path.clone(), false);
    let hub = GazeHub::new(&[SourceSpec::OpenGaze("127.0.0.1".into(), 1), trace.clone()], None).unwrap();
    run(&hub, start, 0, 300);
    let (to, recorded) = recording("absent");
    hub.record(&to).unwrap();
    run(&hub, start, 310, 400);
    hub.stop_recording().unwrap();
    assert_eq!(recorded().header.source, trace.to_string());
    std::fs::remove_file(path).unwrap();
}

#[test]
fn degrees_are_recorded_as_degrees() {
    let start = Instant::now() + Duration::from_millis(START_MS);
    let rows = (0..100).map(|step| format!("{:.2},-5,2.5,1\n", f64::from(step) * 0.01));
    let (from, played) = recording("played-deg");
    std::fs::write(&from, format!("# gaze-trace v1; space=view_deg\n{}", rows.collect::<String>())).unwrap();
    let hub = GazeHub::new(&[SourceSpec::Trace(from, false)], None).unwrap();
    let (to, recorded) = recording("deg");
    hub.record(&to).unwrap();
    run(&hub, start, 0, 500);
    hub.stop_recording().unwrap();
    let (trace, played) = (recorded(), played());
    assert_eq!(trace.header.space, Space::ViewDeg);
    assert_eq!(trace.rows, played.rows[..51]);
}
