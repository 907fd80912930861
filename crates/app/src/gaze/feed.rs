//! The thread of a source on the network: connecting, back-off, and handing samples over without ever blocking the reader.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::clock::DeviceClock;
use super::sample::{GazeSample, Point};
use super::source::{Calibration, GazeSource, SourceState, SourceStatus};

/// Samples kept for a reader that is busy; two seconds at 2,000 Hz.
pub const MAX_SAMPLES: usize = 4096;
/// Without a byte for so long a connection counts as stalled.
pub const STALLED: Duration = Duration::from_secs(1);
/// A connection stalled for so long is given up and made anew.
pub const GIVEN_UP: Duration = Duration::from_secs(10);
/// How often a waiting thread looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(50);
/// How long a connection may take to come about.
const CONNECT: Duration = Duration::from_secs(2);
const FIRST_BACK_OFF: Duration = Duration::from_millis(250);
const LONGEST_BACK_OFF: Duration = Duration::from_secs(8);

/// Why a session ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Try again.
    Lost(String),
    /// Trying again is of no use until somebody changes something; it is done all the same, seldom.
    Failed(String),
    /// Nobody wants the samples any more.
    Unwanted,
}

impl From<std::io::Error> for Ended {
    fn from(error: std::io::Error) -> Self {
        Self::Lost(error.to_string())
    }
}

/// A way to a device.
pub trait Link: Send + 'static {
    /// Connects and hands samples to the outlet until the connection ends.
    fn session(&mut self, outlet: &Outlet) -> Ended;
}

#[derive(Default)]
struct Shared {
    samples: Mutex<VecDeque<GazeSample>>,
    status: Mutex<SourceStatus>,
    unwanted: AtomicBool,
    calibrate: AtomicBool,
    /// The session's handshake is over.
    connected: AtomicBool,
}

/// Plain data, valid whether or not another holder panicked.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The thread's side.
pub struct Outlet {
    shared: Arc<Shared>,
}

impl Outlet {
    /// Whether the thread is to end.
    pub fn unwanted(&self) -> bool {
        self.shared.unwanted.load(Ordering::Relaxed)
    }

    /// Changes what the source says about itself.
    pub fn update(&self, change: impl FnOnce(&mut SourceStatus)) {
        change(&mut lock(&self.shared.status));
    }

    /// Says that the device is there and speaks as it should, whether or not it has samples to send.
    pub fn connected(&self) {
        self.shared.connected.store(true, Ordering::Relaxed);
        self.update(|status| status.state = SourceState::Connected);
    }

    /// Whether a calibration has been asked for since the last call.
    pub fn take_calibration(&self) -> bool {
        self.shared.calibrate.swap(false, Ordering::Relaxed)
    }

    /// Hands a sample over; the oldest goes when the reader is too slow. Points that are not finite become invalid.
    pub fn send(&self, clock: &mut DeviceClock, device_secs: f64, point: Point, valid: bool, confidence: f64) {
        let arrived = Instant::now();
        let Some(captured) = clock.captured(device_secs, arrived) else {
            self.update(|status| {
                status.dropped += 1;
                status.detail = "time stamps run backwards".into();
            });
            return;
        };
        let (Point::Screen01([x, y]) | Point::ViewDeg([x, y]) | Point::Picture([x, y])) = point;
        let valid = valid && x.is_finite() && y.is_finite() && confidence > 0.0;
        let sample = GazeSample {
            device_secs,
            captured,
            arrived,
            point,
            valid,
            confidence: if valid { confidence } else { 0.0 },
        };
        let mut samples = lock(&self.shared.samples);
        let full = samples.len() >= MAX_SAMPLES;
        if full {
            samples.pop_front();
        }
        samples.push_back(sample);
        drop(samples);
        self.update(|status| {
            status.received += 1;
            status.dropped += u64::from(full);
            status.state = SourceState::Connected;
            status.synchronised = clock.is_synchronised();
        });
    }

    /// Sleeps unless the source is dropped meanwhile.
    pub fn sleep(&self, duration: Duration) {
        let until = Instant::now() + duration;
        while !self.unwanted() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            std::thread::sleep(left.min(LOOK));
        }
    }

    /// Opens a connection whose reads wait a moment only.
    ///
    /// # Errors
    /// When there is nobody at the address.
    pub fn connect(&self, host: &str, port: u16) -> Result<TcpStream, Ended> {
        let wrong = |error: std::io::Error| Ended::Lost(format!("{host}:{port}: {error}"));
        let mut last = Ended::Lost(format!("{host}: no such host"));
        for address in (host, port).to_socket_addrs().map_err(wrong)? {
            match TcpStream::connect_timeout(&address, CONNECT) {
                Ok(stream) => {
                    stream.set_read_timeout(Some(LOOK))?;
                    stream.set_write_timeout(Some(CONNECT))?;
                    stream.set_nodelay(true)?;
                    return Ok(stream);
                }
                Err(error) => last = wrong(error),
            }
        }
        Err(last)
    }

    /// Reads what has come; 0 when nothing has for a moment. `heard` is when the last byte came.
    ///
    /// # Errors
    /// The connection ended, nothing came for too long, or the source is not wanted any more.
    pub fn read(&self, stream: &mut TcpStream, buffer: &mut [u8], heard: &mut Instant) -> Result<usize, Ended> {
        if self.unwanted() {
            return Err(Ended::Unwanted);
        }
        match stream.read(buffer) {
            Ok(0) => Err(Ended::Lost("the connection was closed".into())),
            Ok(count) => {
                *heard = Instant::now();
                Ok(count)
            }
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) =>
            {
                let silence = heard.elapsed();
                if silence > GIVEN_UP {
                    return Err(Ended::Lost(format!("nothing came for {} s", silence.as_secs())));
                }
                if silence > STALLED {
                    self.update(|status| status.state = SourceState::Stalled);
                }
                Ok(0)
            }
            Err(error) => Err(error.into()),
        }
    }
}

/// A source whose samples come from a thread; dropping it lets the thread end by itself.
pub struct FeedSource {
    shared: Arc<Shared>,
    calibrates: bool,
}

impl FeedSource {
    /// Starts the thread. `calibrates` says whether the device can be asked to.
    pub fn start(name: &str, mut link: impl Link, calibrates: bool) -> Self {
        let shared = Arc::new(Shared::default());
        let outlet = Outlet { shared: Arc::clone(&shared) };
        let spawned = std::thread::Builder::new().name(name.to_owned()).spawn(move || keep_up(&mut link, &outlet));
        if let Err(error) = spawned {
            lock(&shared.status).state = SourceState::Failed(format!("no thread: {error}"));
        }
        Self { shared, calibrates }
    }
}

/// Session after session, with longer and longer pauses while none comes about.
fn keep_up(link: &mut impl Link, outlet: &Outlet) {
    let mut back_off = FIRST_BACK_OFF;
    while !outlet.unwanted() {
        let before = lock(&outlet.shared.status).received;
        let ended = link.session(outlet);
        let delivered = lock(&outlet.shared.status).received > before;
        if outlet.shared.connected.swap(false, Ordering::Relaxed) || delivered {
            back_off = FIRST_BACK_OFF;
        }
        let state = match ended {
            Ended::Unwanted => return,
            Ended::Lost(why) => SourceState::Lost(why),
            Ended::Failed(why) => {
                back_off = LONGEST_BACK_OFF;
                SourceState::Failed(why)
            }
        };
        outlet.update(|status| {
            status.state = state;
            if status.calibration == Calibration::Running {
                status.calibration = Calibration::Failed("the connection was lost".into());
            }
        });
        outlet.sleep(back_off);
        back_off = (back_off * 2).min(LONGEST_BACK_OFF);
    }
}

impl Drop for FeedSource {
    fn drop(&mut self) {
        self.shared.unwanted.store(true, Ordering::Relaxed);
    }
}

impl GazeSource for FeedSource {
    fn status(&self) -> SourceStatus {
        lock(&self.shared.status).clone()
    }

    fn poll(&mut self, _now: Instant, samples: &mut Vec<GazeSample>) {
        samples.extend(lock(&self.shared.samples).drain(..));
    }

    fn calibrate(&mut self) -> bool {
        if self.calibrates {
            self.shared.calibrate.store(true, Ordering::Relaxed);
            lock(&self.shared.status).calibration = Calibration::Running;
        }
        self.calibrates
    }
}
