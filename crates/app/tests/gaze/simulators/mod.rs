//! What trackers do on the network, fed by a trace. Each serves any number of clients, each from the first row on, at the
//! trace's own pace, and stops when dropped.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use fovea_app::gaze::parse::trace::{Row, Trace};

pub mod lsl;
pub mod opengaze;
pub mod pupil;

/// Set when a simulator is dropped.
#[derive(Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Serves every client in a thread of its own; the port.
pub fn serve(stop: &Stop, client: impl Fn(TcpStream, &Stop) + Send + Sync + 'static) -> u16 {
    serve_on(TcpListener::bind(("127.0.0.1", 0)).unwrap(), stop, client)
}

pub fn serve_on(listener: TcpListener, stop: &Stop, client: impl Fn(TcpStream, &Stop) + Send + Sync + 'static) -> u16 {
    let port = listener.local_addr().unwrap().port();
    listener.set_nonblocking(true).unwrap();
    let (stop, client) = (stop.clone(), Arc::new(client));
    std::thread::spawn(move || {
        while !stop.is_set() {
            let Ok((stream, _)) = listener.accept() else {
                std::thread::sleep(Duration::from_millis(2));
                continue;
            };
            stream.set_nonblocking(false).unwrap();
            stream.set_nodelay(true).unwrap();
            let (stop, client) = (stop.clone(), Arc::clone(&client));
            std::thread::spawn(move || client(stream, &stop));
        }
    });
    port
}

/// Calls with each row when it is due; ends early when that gives false or the simulator is dropped.
pub fn paced(trace: &Trace, stop: &Stop, mut send: impl FnMut(&Row) -> bool) {
    let start = Instant::now();
    let first = trace.rows[0].time_secs;
    for row in &trace.rows {
        let due = start + Duration::from_secs_f64(row.time_secs - first);
        while Instant::now() < due {
            if stop.is_set() {
                return;
            }
            std::thread::sleep((due - Instant::now().min(due)).min(Duration::from_millis(20)));
        }
        if stop.is_set() || !send(row) {
            return;
        }
    }
}

/// Keeps a connection open until the client leaves or the simulator is dropped.
pub fn linger(stream: &mut TcpStream, stop: &Stop) {
    stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    let mut buffer = [0; 256];
    while !stop.is_set() {
        match stream.read(&mut buffer) {
            Ok(0) => return,
            Err(error)
                if error.kind() != std::io::ErrorKind::WouldBlock && error.kind() != std::io::ErrorKind::TimedOut =>
            {
                return;
            }
            _ => {}
        }
    }
}

/// Reads until the bytes end in `end`; `false` when the client leaves before.
pub fn read_until(stream: &mut TcpStream, end: &[u8], into: &mut Vec<u8>) -> bool {
    let mut byte = [0];
    while !into.ends_with(end) {
        match stream.read(&mut byte) {
            Ok(1) => into.push(byte[0]),
            _ => return false,
        }
    }
    true
}

/// Writes; `false` when the client has left.
pub fn write(stream: &mut TcpStream, bytes: &[u8]) -> bool {
    stream.write_all(bytes).is_ok()
}
