//! A Lab Streaming Layer outlet of three float channels: x, y, validity. Protocol 1.10.

use std::net::{TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

use fovea_app::gaze::parse::trace::{Row, Trace};

use super::{Stop, linger, paced, read_until, serve_on, write};

/// How the outlet behaves.
#[derive(Clone)]
pub struct Options {
    pub name: String,
    /// Distinguishes runs of one source.
    pub uid: String,
    pub rate_hz: f64,
    /// The source's clock minus ours, seconds.
    pub clock_ahead_secs: f64,
    /// Whether all stamps but the first are left for the reader to deduce.
    pub deduced_stamps: bool,
    /// Sent instead of the description.
    pub full_info: Option<String>,
}

impl Options {
    pub fn new(name: &str) -> Self {
        Self {
            name: name.into(),
            // liblsl compares in lower case, as its own numbers are.
            uid: format!("{}-1", name.to_lowercase()),
            rate_hz: 120.0,
            clock_ahead_secs: 1000.0,
            deduced_stamps: false,
            full_info: None,
        }
    }

    fn xml(&self, port: u16, channels: bool) -> String {
        let channel =
            |label| format!("<channel><label>{label}</label><unit>normalized</unit><type>Gaze</type></channel>");
        let list: String = ["BPOGX", "BPOGY", "BPOGV"].map(channel).concat();
        let desc = if channels { format!("<desc><channels>{list}</channels></desc>") } else { "<desc />".into() };
        let Self { name, uid, rate_hz, .. } = self;
        format!(
            "<?xml version=\"1.0\"?>\n<info><name>{name}</name><type>Gaze</type><channel_count>3</channel_count>\
             <channel_format>float32</channel_format><source_id>{name}</source_id><nominal_srate>{rate_hz:.15}\
             </nominal_srate><version>1.1000000000000001</version><created_at>1.5</created_at><uid>{uid}</uid>\
             <session_id>default</session_id><hostname>localhost</hostname><v4address />\
             <v4data_port>{port}</v4data_port><v4service_port>{port}</v4service_port><v6address />\
             <v6data_port>0</v6data_port><v6service_port>0</v6service_port>{desc}</info>\n"
        )
    }
}

pub struct LslOutlet {
    stop: Stop,
}

impl LslOutlet {
    pub fn start(trace: Trace, options: Options) -> Self {
        let stop = Stop::default();
        let bind =
            |port| Some((TcpListener::bind(("127.0.0.1", port)).ok()?, UdpSocket::bind(("127.0.0.1", port)).ok()?));
        let (listener, socket) = (16_572..=16_603).find_map(bind).expect("a free port among the outlets'");
        let port = listener.local_addr().unwrap().port();
        let epoch = Instant::now();
        let (trace, options) = (Arc::new(trace), Arc::new(options));
        let (answers, stop_answers) = (Arc::clone(&options), stop.clone());
        std::thread::spawn(move || answer(&socket, port, &answers, epoch, &stop_answers));
        serve_on(listener, &stop, move |stream, stop| client(stream, port, &trace, &options, epoch, stop));
        Self { stop }
    }
}

impl Drop for LslOutlet {
    fn drop(&mut self) {
        self.stop.set();
    }
}

fn clock(epoch: Instant, options: &Options) -> f64 {
    epoch.elapsed().as_secs_f64() + options.clock_ahead_secs
}

/// Discovery and clock probes.
fn answer(socket: &UdpSocket, port: u16, options: &Options, epoch: Instant, stop: &Stop) {
    socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    let mut datagram = [0; 2048];
    while !stop.is_set() {
        let Ok((count, from)) = socket.recv_from(&mut datagram) else { continue };
        let t1 = clock(epoch, options);
        let text = String::from_utf8_lossy(&datagram[..count]).into_owned();
        let lines: Vec<&str> = text.split("\r\n").collect();
        match lines.as_slice() {
            ["LSL:shortinfo", _query, back, ..] => {
                let (return_port, id) = back.split_once(' ').unwrap();
                let reply = format!("{id}\r\n{}", options.xml(port, false));
                socket.send_to(reply.as_bytes(), (from.ip(), return_port.trim().parse().unwrap())).unwrap();
            }
            ["LSL:timedata", probe, ..] => {
                let reply = format!(" {probe} {t1:.9} {:.9}", clock(epoch, options));
                socket.send_to(reply.as_bytes(), from).unwrap();
            }
            _ => {}
        }
    }
}

fn client(mut stream: TcpStream, port: u16, trace: &Trace, options: &Options, epoch: Instant, stop: &Stop) {
    let mut head = Vec::new();
    if !read_until(&mut stream, b"\r\n", &mut head) {
        return;
    }
    let line = String::from_utf8_lossy(&head).trim().to_owned();
    if line == "LSL:fullinfo" {
        let xml = options.full_info.clone().unwrap_or_else(|| options.xml(port, true));
        write(&mut stream, xml.as_bytes());
        return;
    }
    if line != format!("LSL:streamfeed/110 {}", options.uid) {
        write(&mut stream, b"LSL/110 404 Not found\r\n");
        return;
    }
    if !read_until(&mut stream, b"\r\n\r\n", &mut head) {
        return;
    }
    let ok = format!(
        "LSL/110 200 OK\r\nUID: {}\r\nByte-Order: 1234\r\nSuppress-Subnormals: 0\r\nData-Protocol-Version: 110\r\n\r\n",
        options.uid
    );
    write(&mut stream, ok.as_bytes());
    for offset in [4.0_f32, 2.0] {
        let pattern = [offset, -(offset + 1.0), offset + 2.0];
        write(&mut stream, &sample(Some(123_456.789), pattern));
    }
    let (start, first) = (clock(epoch, options), trace.rows[0].time_secs);
    let mut sent = 0;
    paced(trace, stop, |row: &Row| {
        sent += 1;
        let stamp = (sent == 1 || !options.deduced_stamps).then_some(start + row.time_secs - first);
        let [x, y] = row.point.map(|value| value as f32);
        write(&mut stream, &sample(stamp, [x, y, f32::from(u8::from(row.valid))]))
    });
    linger(&mut stream, stop);
}

fn sample(stamp: Option<f64>, values: [f32; 3]) -> Vec<u8> {
    let mut bytes = match stamp {
        None => vec![1],
        Some(stamp) => [&[2][..], &stamp.to_le_bytes()].concat(),
    };
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}
