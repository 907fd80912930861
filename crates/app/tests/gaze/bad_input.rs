//! Trackers that are absent, silent, broken or hostile: no source blocks, crashes or grows, each says what is wrong, and
//! each is back when its tracker is.

use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fovea_app::gaze::feed::MAX_SAMPLES;
use fovea_app::gaze::parse::trace::{Row, Trace};
use fovea_app::gaze::parse::zmtp;
use fovea_app::gaze::source::{GazeSource, SourceState};

use crate::simulators::lsl::{self, LslOutlet};
use crate::simulators::{Stop, linger, pupil, serve, write};
use crate::sources::{collect, open};
use crate::synthetic::Synthetic;

const RECORD: &str = "<REC TIME=\"{t}\" BPOGX=\"0.25000\" BPOGY=\"0.75000\" BPOGV=\"1\" />\r\n";

fn record(time_secs: f64) -> String {
    RECORD.replace("{t}", &format!("{time_secs:.5}"))
}

/// Waits until the source says something that fits; every look at it must be quick.
fn wait_for(source: &mut dyn GazeSource, secs: f64, fits: impl Fn(&fovea_app::gaze::source::SourceStatus) -> bool) {
    let start = Instant::now();
    let mut samples = Vec::new();
    loop {
        let asked = Instant::now();
        source.poll(asked, &mut samples);
        let status = source.status();
        // The window does this every frame. A busy machine may take a thread's turn away; the network must not.
        assert!(asked.elapsed() < Duration::from_millis(250), "a look took {:?}", asked.elapsed());
        if fits(&status) {
            return;
        }
        assert!(start.elapsed().as_secs_f64() < secs, "{status:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn lost(reason: &'static str) -> impl Fn(&fovea_app::gaze::source::SourceStatus) -> bool {
    move |status| matches!(&status.state, SourceState::Lost(why) | SourceState::Failed(why) if why.contains(reason))
}

/// An Open Gaze source whose server does as `client` says, and counts its connections.
fn with_server(
    client: impl Fn(&mut TcpStream, u32, &Stop) + Send + Sync + 'static,
) -> (Box<dyn GazeSource>, Arc<AtomicU32>, Stop) {
    let (stop, connections) = (Stop::default(), Arc::new(AtomicU32::new(0)));
    let counted = Arc::clone(&connections);
    let port = serve(&stop, move |mut stream, stop| {
        let number = counted.fetch_add(1, Ordering::Relaxed);
        client(&mut stream, number, stop);
    });
    (open(&format!("opengaze::{port}")), connections, stop)
}

#[cfg(unix)]
#[test]
fn a_full_disc_leaves_a_recording_of_whole_rows() {
    let folder = std::env::temp_dir().join(format!("fovea-full-disc-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let [from, to] = ["from.csv", "to.csv"].map(|name| folder.join(name));
    let eye = Synthetic::new(120.0, 0.5, 0.1, 3).trace;
    std::fs::write(&from, eye.write()).unwrap();
    // To a program that may write no file of more than a block the disc is full within a row.
    let script = "ulimit -f 1; trap '' XFSZ; exec \"$0\" gaze --source \"trace:$1\" --record \"$2\"";
    let mut command = std::process::Command::new("sh");
    let output = command.args(["-c", script, env!("CARGO_BIN_EXE_fovea")]).args([&from, &to]).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && message.contains("to.csv"), "{message}");
    let text = std::fs::read_to_string(&to).unwrap();
    assert!(text.ends_with('\n'), "{text}");
    let rows = Trace::parse(&text).unwrap().rows;
    // Six digits of the time, which begins anew with the recording.
    assert!((5..eye.rows.len()).contains(&rows.len()), "{} rows", rows.len());
    assert!(rows.iter().zip(&eye.rows).all(|(row, sent)| (row.time_secs - sent.time_secs).abs() < 2e-6));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_absent_server_is_tried_again_ever_more_slowly() {
    // A port that was just given back has nobody behind it.
    let port = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port();
    let started = Instant::now();
    let mut sources = [open(&format!("opengaze::{port}")), open(&format!("pupil::{port}"))];
    assert!(started.elapsed() < Duration::from_millis(250), "opening does not wait");
    for source in &mut sources {
        wait_for(source.as_mut(), 3.0, lost("127.0.0.1"));
    }
    let mut stream = open("lsl:host=127.0.0.1,name=NoSuchStream");
    wait_for(stream.as_mut(), 5.0, lost("no stream"));
}

#[test]
fn a_server_that_hangs_up_is_tried_again_with_longer_and_longer_pauses() {
    let (mut source, connections, stop) = with_server(|_, _, _| {});
    wait_for(source.as_mut(), 3.0, |status| matches!(status.state, SourceState::Lost(_)));
    std::thread::sleep(Duration::from_secs(4));
    // 0, 0.25, 0.75, 1.75, 3.75 s after the start.
    let tries = connections.load(Ordering::Relaxed);
    assert!((3..=6).contains(&tries), "{tries} connections in 4 s");
    stop.set();
}

#[test]
fn a_refusal_is_told() {
    let (mut source, _, stop) = with_server(|stream, _, stop| {
        write(stream, b"<NACK ID=\"ENABLE_SEND_DATA\" />\r\n");
        linger(stream, stop);
    });
    wait_for(source.as_mut(), 3.0, lost("refuses ENABLE_SEND_DATA"));
    stop.set();
}

#[test]
fn a_stall_is_told_and_ends_with_the_next_record() {
    let (mut source, _, stop) = with_server(|stream, _, stop| {
        write(stream, record(1.0).as_bytes());
        std::thread::sleep(Duration::from_secs(2));
        write(stream, record(3.0).as_bytes());
        linger(stream, stop);
    });
    wait_for(source.as_mut(), 3.0, |status| status.state == SourceState::Connected);
    wait_for(source.as_mut(), 3.0, |status| status.state == SourceState::Stalled);
    wait_for(source.as_mut(), 3.0, |status| status.state == SourceState::Connected && status.received == 2);
    stop.set();
}

#[test]
fn a_connection_that_drops_within_a_record_is_made_anew() {
    let (mut source, connections, stop) = with_server(|stream, number, stop| {
        write(stream, record(1.0 + f64::from(number)).as_bytes());
        write(stream, b"<REC TIME=\"1.5\" BPOGX=\"0.1");
        if number > 0 {
            write(stream, b"0000\" BPOGY=\"0.2\" BPOGV=\"1\" />");
            linger(stream, stop);
        }
    });
    wait_for(source.as_mut(), 5.0, |status| status.received >= 2 && status.state == SourceState::Connected);
    assert_eq!(connections.load(Ordering::Relaxed), 2);
    stop.set();
}

#[test]
fn garbage_and_ten_megabytes_without_an_end_are_told_and_survived() {
    let (mut source, _, stop) = with_server(|stream, _, stop| {
        write(stream, b"\xff\xfe\x00<<>>/>garbage/>");
        let chunk = vec![b'x'; 1 << 16];
        for _ in 0..160 {
            write(stream, &chunk);
        }
        write(stream, record(1.0).as_bytes());
        linger(stream, stop);
    });
    wait_for(source.as_mut(), 10.0, |status| status.detail.contains("unreadable") && status.dropped > 0);
    wait_for(source.as_mut(), 10.0, |status| status.received == 1);
    stop.set();
}

#[test]
fn nan_is_no_gaze_and_times_that_run_backwards_are_dropped() {
    let (mut source, _, stop) = with_server(|stream, _, stop| {
        write(stream, record(1.0).replace("0.25000", "NaN").as_bytes());
        for time in [1.1, 1.05, 1.1, 1.2] {
            write(stream, record(time).as_bytes());
        }
        write(stream, record(1.3).replace("1.30000", "inf").as_bytes());
        linger(stream, stop);
    });
    let samples = collect(source.as_mut(), 3.0, |samples| samples.len() >= 4);
    let times: Vec<_> = samples.iter().map(|sample| (sample.device_secs, sample.valid)).collect();
    assert_eq!(times[..3], [(1.0, false), (1.1, true), (1.2, true)]);
    let status = source.status();
    assert_eq!(status.dropped, 2, "{status:?}");
    assert!(status.detail.contains("backwards"), "{status:?}");
    stop.set();
}

#[test]
fn rates_from_1_to_2000_hz_are_taken_and_a_slow_reader_costs_no_memory() {
    for rate in [1.0, 60.0, 2000.0] {
        let (mut source, _, stop) = with_server(move |stream, _, stop| {
            let start = Instant::now();
            for step in 0..(2.5 * rate) as u32 {
                let due = f64::from(step) / rate;
                std::thread::sleep(Duration::from_secs_f64((due - start.elapsed().as_secs_f64()).max(0.0)));
                if !write(stream, record(due + 1.0).as_bytes()) {
                    return;
                }
            }
            linger(stream, stop);
        });
        let expected = (2.5 * rate) as usize;
        let samples = collect(source.as_mut(), 8.0, |samples| samples.len() >= expected);
        assert_eq!(samples.len(), expected, "{rate} Hz");
        stop.set();
    }
    // Nobody reads while 20,000 records come.
    let (mut source, _, stop) = with_server(|stream, _, stop| {
        for step in 0..20_000 {
            write(stream, record(f64::from(step) * 0.0005).as_bytes());
        }
        linger(stream, stop);
    });
    let start = Instant::now();
    while source.status().received < 20_000 {
        assert!(start.elapsed() < Duration::from_secs(10), "{:?}", source.status());
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut samples = Vec::new();
    source.poll(Instant::now(), &mut samples);
    assert_eq!(samples.len(), MAX_SAMPLES);
    assert_eq!(source.status().dropped, 20_000 - MAX_SAMPLES as u64);
    stop.set();
}

#[test]
fn a_stream_that_describes_itself_wrongly_is_told_with_the_reason() {
    let eye = Synthetic::new(60.0, 1.0, 0.1, 1).trace;
    for (name, xml, reason) in [
        ("FoveaNoXml", "<info><name>x</info>", "XML"),
        ("FoveaHtml", "<html></html>", "html"),
        ("FoveaCut", "<?xml version=\"1.0\"?><info><name>", "XML"),
    ] {
        let options = lsl::Options { full_info: Some(xml.into()), ..lsl::Options::new(name) };
        let _outlet = LslOutlet::start(eye.clone(), options);
        let mut source = open(&format!("lsl:host=127.0.0.1,name={name}"));
        wait_for(source.as_mut(), 6.0, lost(reason));
    }
    let _outlet = LslOutlet::start(eye, lsl::Options::new("FoveaChannels"));
    let mut source = open("lsl:host=127.0.0.1,name=FoveaChannels,x=left,y=right");
    wait_for(source.as_mut(), 6.0, lost("no channel `left`"));
}

/// A Pupil source whose publisher sends these frames after its greeting.
fn pupil_source(frames: Vec<u8>) -> (Box<dyn GazeSource>, Stop) {
    let stop = Stop::default();
    let publisher = serve(&stop, move |mut stream, stop| {
        write(&mut stream, &[&zmtp::greeting()[..], &zmtp::ready("PUB"), &frames].concat());
        linger(&mut stream, stop);
    });
    let port = serve(&stop, move |mut stream, stop| {
        let answer = [zmtp::frame(b"", true), zmtp::frame(publisher.to_string().as_bytes(), false)].concat();
        // The time is no number: the source does without a synchronised clock.
        let odd = [zmtp::frame(b"", true), zmtp::frame(b"half past", false)].concat();
        let _ = stream.write_all(&[&zmtp::greeting()[..], &zmtp::ready("REP"), &answer, &odd].concat());
        linger(&mut stream, stop);
    });
    (open(&format!("pupil::{port}")), stop)
}

#[test]
fn unknown_msgpack_types_are_told_and_the_next_message_is_read() {
    let row = Row { time_secs: 0.0, point: [0.25, 0.5], valid: true, confidence: 1.0 };
    let message = |payload: &[u8]| [zmtp::frame(b"surfaces.s", true), zmtp::frame(payload, false)].concat();
    let frames = [
        message(&[0xc1]),
        message(&[0x93, 1, 2, 3]),
        // An extension where the list of gaze belongs.
        message(&[&[0x81, 0xb0][..], b"gaze_on_surfaces", &[0xc7, 1, 5, 0]].concat()),
        message(&[0x91; 200]),
        zmtp::frame(b"a message of one frame", false),
        message(&pupil::message("s", &[(1.0, row), (f64::NAN, row), (2.0, row)])),
    ];
    let (mut source, stop) = pupil_source(frames.concat());
    let samples = collect(source.as_mut(), 3.0, |samples| samples.len() >= 2);
    assert_eq!(samples.iter().map(|sample| sample.device_secs).collect::<Vec<_>>(), [1.0, 2.0]);
    let status = source.status();
    assert!(status.dropped >= 2 && !status.synchronised, "{status:?}");
    stop.set();
}

#[test]
fn a_surface_that_is_out_of_sight_is_no_lost_connection_and_clocks_are_compared_all_the_while() {
    let (stop, started, connections) = (Stop::default(), Instant::now(), Arc::new(AtomicU32::new(0)));
    // Somebody sets Pupil's clock back while nothing comes.
    let clock = move || started.elapsed().as_secs_f64() + if started.elapsed().as_secs() < 3 { 5000.0 } else { 100.0 };
    let publisher = serve(&stop, move |mut stream, stop| {
        write(&mut stream, &[&zmtp::greeting()[..], &zmtp::ready("PUB")].concat());
        std::thread::sleep(Duration::from_millis(11_500));
        let row = Row { time_secs: 0.0, point: [0.25, 0.5], valid: true, confidence: 1.0 };
        let payload = pupil::message("s", &[(clock() - 0.08, row)]);
        write(&mut stream, &[zmtp::frame(b"surfaces.s", true), zmtp::frame(&payload, false)].concat());
        linger(&mut stream, stop);
    });
    let counted = Arc::clone(&connections);
    let port = serve(&stop, move |stream, _| {
        counted.fetch_add(1, Ordering::Relaxed);
        pupil::remote(stream, publisher, clock);
    });
    let mut source = open(&format!("pupil::{port}"));
    wait_for(source.as_mut(), 3.0, |status| status.state == SourceState::Connected);
    wait_for(source.as_mut(), 3.0, |status| status.state == SourceState::Stalled);
    let samples = collect(source.as_mut(), 12.0, |samples| !samples.is_empty());
    assert_eq!((samples.len(), connections.load(Ordering::Relaxed)), (1, 1), "{:?}", source.status());
    let age = samples[0].arrived - samples[0].captured;
    assert!((80..150).contains(&age.as_millis()), "{age:?}");
    stop.set();
}

#[test]
fn a_peer_that_answers_is_tried_again_at_once() {
    let (stop, connections) = (Stop::default(), Arc::new(AtomicU32::new(0)));
    let publisher = serve(&stop, |mut stream, _| {
        write(&mut stream, &[&zmtp::greeting()[..], &zmtp::ready("PUB")].concat());
        std::thread::sleep(Duration::from_millis(50));
    });
    let (counted, started) = (Arc::clone(&connections), Instant::now());
    let port = serve(&stop, move |stream, _| {
        counted.fetch_add(1, Ordering::Relaxed);
        pupil::remote(stream, publisher, || started.elapsed().as_secs_f64());
    });
    let _source = open(&format!("pupil::{port}"));
    std::thread::sleep(Duration::from_secs(4));
    // 0.3 s each; 0, 0.3, 0.85, 1.9 and 3.95 s after the start if pauses grew.
    let tries = connections.load(Ordering::Relaxed);
    assert!((7..=14).contains(&tries), "{tries} connections in 4 s");
    stop.set();
}

#[test]
fn a_peer_that_is_no_zeromq_or_sends_without_end_is_told() {
    let (mut endless, stop) = pupil_source([&[0x02][..], &u64::MAX.to_be_bytes()].concat());
    wait_for(endless.as_mut(), 5.0, lost("longer than"));
    stop.set();
    let stop = Stop::default();
    let port = serve(&stop, |mut stream, stop| {
        write(&mut stream, b"HTTP/1.1 400 Bad Request\r\n\r\n");
        linger(&mut stream, stop);
    });
    let mut web = open(&format!("pupil::{port}"));
    wait_for(web.as_mut(), 5.0, lost("ZeroMQ"));
    stop.set();
}

#[test]
fn dropping_a_source_ends_its_connection() {
    let closed = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&closed);
    let (mut source, _, stop) = with_server(move |stream, _, stop| {
        write(stream, record(1.0).as_bytes());
        linger(stream, stop);
        counted.fetch_add(1, Ordering::Relaxed);
    });
    wait_for(source.as_mut(), 3.0, |status| status.received == 1);
    drop(source);
    let start = Instant::now();
    while closed.load(Ordering::Relaxed) == 0 {
        assert!(start.elapsed() < Duration::from_secs(2));
        std::thread::sleep(Duration::from_millis(10));
    }
    stop.set();
}
