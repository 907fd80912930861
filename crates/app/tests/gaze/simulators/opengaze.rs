//! Gazepoint Control: answers settings, sends records once data are enabled, calibrates.

use std::net::TcpStream;
use std::sync::{Arc, Mutex};

use fovea_app::gaze::parse::opengaze::Tag;
use fovea_app::gaze::parse::trace::{Row, Trace};

use super::{Stop, paced, read_until, serve, write};

pub struct OpenGazeServer {
    pub port: u16,
    stop: Stop,
}

impl OpenGazeServer {
    pub fn start(trace: Trace) -> Self {
        let stop = Stop::default();
        let trace = Arc::new(trace);
        let port = serve(&stop, move |stream, stop| client(stream, &trace, stop));
        Self { port, stop }
    }
}

impl Drop for OpenGazeServer {
    fn drop(&mut self) {
        self.stop.set();
    }
}

/// What a client has switched on.
#[derive(Clone, Copy, Default)]
struct Enabled {
    time: bool,
    counter: bool,
    best: bool,
    blink: bool,
}

fn client(mut stream: TcpStream, trace: &Arc<Trace>, stop: &Stop) {
    let writer = Arc::new(Mutex::new(stream.try_clone().unwrap()));
    let say = |text: &str| write(&mut writer.lock().unwrap(), format!("{text}\r\n").as_bytes());
    let mut enabled = Enabled::default();
    loop {
        let mut bytes = Vec::new();
        if !read_until(&mut stream, b"/>", &mut bytes) {
            return;
        }
        let Ok(tag) = Tag::parse(&bytes[..bytes.len() - 2]) else { continue };
        let (id, state) = (tag.get("ID").unwrap_or_default().to_owned(), tag.get("STATE") == Some("1"));
        let acknowledge = format!("<ACK ID=\"{id}\" STATE=\"{}\" />", u8::from(state));
        match (tag.name.as_str(), id.as_str()) {
            ("GET", "SCREEN_SIZE") => {
                say("<ACK ID=\"SCREEN_SIZE\" X=\"0\" Y=\"0\" WIDTH=\"1920\" HEIGHT=\"1080\" />");
            }
            ("GET", "CALIBRATE_RESULT_SUMMARY") => {
                say("<ACK ID=\"CALIBRATE_RESULT_SUMMARY\" AVE_ERROR=\"17.25\" VALID_POINTS=\"5\" />");
            }
            ("SET", "ENABLE_SEND_TIME") => (enabled.time = state, say(&acknowledge)).0,
            ("SET", "ENABLE_SEND_COUNTER") => (enabled.counter = state, say(&acknowledge)).0,
            ("SET", "ENABLE_SEND_POG_BEST") => (enabled.best = state, say(&acknowledge)).0,
            ("SET", "ENABLE_SEND_BLINK") => (enabled.blink = state, say(&acknowledge)).0,
            ("SET", "CALIBRATE_SHOW") => _ = say(&acknowledge),
            ("SET", "CALIBRATE_START") => {
                say(&acknowledge);
                for point in 1..=5 {
                    say(&format!("<CAL ID=\"CALIB_START_PT\" PT=\"{point}\" CALX=\"0.5\" CALY=\"0.5\" />"));
                    say(&format!("<CAL ID=\"CALIB_RESULT_PT\" PT=\"{point}\" CALX=\"0.5\" CALY=\"0.5\" />"));
                }
                say("<CAL ID=\"CALIB_RESULT\" CALX1=\"0.5\" CALY1=\"0.5\" LX1=\"0.49\" LY1=\"0.5\" LV1=\"1\" />");
            }
            ("SET", "ENABLE_SEND_DATA") if state => {
                say(&acknowledge);
                let (writer, trace, stop) = (Arc::clone(&writer), Arc::clone(trace), stop.clone());
                // Records come while settings are still answered.
                std::thread::spawn(move || {
                    let mut count = 0;
                    paced(&trace, &stop, |row| {
                        count += 1;
                        write(&mut writer.lock().unwrap(), record(count, row, enabled).as_bytes())
                    });
                });
            }
            ("SET", "ENABLE_SEND_DATA") => _ = say(&acknowledge),
            _ => _ = say(&format!("<NACK ID=\"{id}\" />")),
        }
    }
}

/// As the tracker writes it: five digits, and now and then no blank between attributes.
fn record(count: u32, row: &Row, enabled: Enabled) -> String {
    let blank = if count.is_multiple_of(3) { "" } else { " " };
    let mut text = String::from("<REC");
    if enabled.counter {
        text += &format!(" CNT=\"{count}\"");
    }
    if enabled.time {
        text += &format!(" TIME=\"{:.5}\"", row.time_secs);
    }
    if enabled.best {
        let [x, y] = row.point;
        text += &format!(" BPOGX=\"{x:.5}\"{blank}BPOGY=\"{y:.5}\"{blank}BPOGV=\"{}\"", u8::from(row.valid));
    }
    if enabled.blink {
        text += " BKID=\"0\" BKDUR=\"0.00000\" BKPMIN=\"12\"";
    }
    text + " />\r\n"
}
