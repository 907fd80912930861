//! Pictures for `tev`, the image viewer, over its TCP protocol, as they converge.
//!
//! A thread of its own sends; whoever renders never waits for the network. Without a listening viewer rendering goes on
//! as it would, and the thread tries again.

use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};
use tracer::film::FilmSnapshot;

/// Shortest time between two pictures.
const SHORTEST_INTERVAL: Duration = Duration::from_millis(500);
/// A picture is made at most this share of the time.
const LARGEST_SHARE: f64 = 0.1;
/// How long a viewer may take to answer, or to take some of a picture, before it counts as gone.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long after a failure the next try is.
const RETRY_AFTER: Duration = Duration::from_secs(2);
/// Pixels of a packet; a packet's length is 32 bits.
const PACKET_PIXELS: usize = 1 << 20;

/// Where a viewer listens: `HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TevAddress(String);

impl FromStr for TevAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let port = text.rsplit_once(':').filter(|(host, _)| !host.is_empty()).map(|(_, port)| port.parse::<u16>());
        match port {
            Some(Ok(port)) if port > 0 => Ok(Self(text.to_owned())),
            _ => Err("expected HOST:PORT, for example 127.0.0.1:14158".into()),
        }
    }
}

/// Linear radiance of Rec. 709 primaries, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct TevPicture {
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Three values a pixel.
    pub rgb: Vec<f32>,
}

impl From<&FilmSnapshot> for TevPicture {
    /// The mean of each pixel; black without samples.
    fn from(film: &FilmSnapshot) -> Self {
        let size = [film.header.options.width, film.header.options.height];
        Self { size, rgb: film.pixels().flat_map(|pixel| pixel.mean.map(|value| value as f32)).collect() }
    }
}

#[derive(Debug, Default)]
struct Slot {
    /// What to send next; a newer picture takes the place of one that was not sent.
    picture: Option<TevPicture>,
    /// Since the last failure.
    failed_at: Option<Instant>,
    closed: bool,
}

#[derive(Debug, Default)]
struct Shared {
    slot: Mutex<Slot>,
    changed: Condvar,
}

impl Shared {
    /// Locks, whether or not another holder panicked: the slot is plain data.
    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A link to a viewer. Dropping it waits, for some seconds at most, until the last picture has been sent.
#[derive(Debug)]
pub struct TevLink {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// When the last picture was made, and how long that took.
    made: Option<(Instant, Duration)>,
}

impl TevLink {
    /// Starts sending pictures by this name. `tell` hears one line whenever the link is lost or found again.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(address: TevAddress, name: &str, tell: impl Fn(String) + Send + 'static) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let worker = Worker {
            shared: Arc::clone(&shared),
            address,
            // The protocol ends texts with a zero.
            name: name.replace('\0', ""),
            tell: Box::new(tell),
            viewer: None,
            is_lost: false,
        };
        let thread = std::thread::Builder::new().name("tev".into()).spawn(move || worker.run())?;
        Ok(Self { shared, thread: Some(thread), made: None })
    }

    /// Whether it is time for another picture: the last one is on its way, and making one costs little of the time.
    pub fn is_due(&self) -> bool {
        let rested = self.made.is_none_or(|(at, cost)| {
            at.elapsed() >= SHORTEST_INTERVAL.max(cost.mul_f64(1.0 / LARGEST_SHARE)) // From the end of making it.
        });
        let slot = self.shared.lock();
        rested && slot.picture.is_none() && slot.failed_at.is_none_or(|at| at.elapsed() >= RETRY_AFTER)
    }

    /// Makes a picture and hands it over; does not wait for the network.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn push<E>(&mut self, make: impl FnOnce() -> Result<TevPicture, E>) -> Result<(), E> {
        let start = Instant::now();
        let picture = make()?;
        self.made = Some((Instant::now(), start.elapsed()));
        self.shared.lock().picture = Some(picture);
        self.shared.changed.notify_one();
        Ok(())
    }
}

impl Drop for TevLink {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported by the panic hook.
            let _ = thread.join();
        }
    }
}

struct Worker {
    shared: Arc<Shared>,
    address: TevAddress,
    name: String,
    tell: Box<dyn Fn(String) + Send>,
    /// The connection and the size of the picture that the viewer has from it.
    viewer: Option<(TevClient, Option<[u32; 2]>)>,
    /// Whether that was said.
    is_lost: bool,
}

impl Worker {
    fn run(mut self) {
        while let Some(picture) = self.next() {
            match self.send(&picture) {
                Ok(()) => {
                    self.shared.lock().failed_at = None;
                    if std::mem::take(&mut self.is_lost) {
                        (self.tell)(format!("tev at {} is there again", self.address.0));
                    }
                }
                Err(error) => {
                    self.viewer = None;
                    self.shared.lock().failed_at = Some(Instant::now());
                    if !std::mem::replace(&mut self.is_lost, true) {
                        (self.tell)(format!("tev at {} gets no pictures for now: {error}", self.address.0));
                    }
                }
            }
        }
    }

    /// Waits for a picture; `None` when there will be no more.
    fn next(&self) -> Option<TevPicture> {
        let mut slot = self.shared.lock();
        loop {
            if let Some(picture) = slot.picture.take() {
                return Some(picture);
            }
            if slot.closed {
                return None;
            }
            slot = self.shared.changed.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn send(&mut self, picture: &TevPicture) -> std::io::Result<()> {
        const CHANNELS: [&str; 3] = ["R", "G", "B"];
        let [width, height] = picture.size;
        let row = 3 * width as usize;
        if row == 0 || height == 0 || picture.rgb.len() != row * height as usize {
            return Err(std::io::Error::other("the picture has no pixels"));
        }
        let (client, shown) = match &mut self.viewer {
            Some((client, shown)) => (client, shown),
            none => {
                let (client, shown) = none.insert((TevClient::wrap(connect(&self.address)?), None));
                (client, shown)
            }
        };
        let name = self.name.as_str();
        if *shown != Some(picture.size) {
            // An image of another size must go first; one that does not exist is not missed.
            client.send(tev_client::PacketCloseImage { image_name: name })?;
            client.send(PacketCreateImage {
                image_name: name,
                grab_focus: true,
                width,
                height,
                channel_names: &CHANNELS,
            })?;
            *shown = Some(picture.size);
        }
        let rows = (PACKET_PIXELS / width as usize).max(1);
        for (y, data) in (0..height).step_by(rows).zip(picture.rgb.chunks(row * rows)) {
            client.send(PacketUpdateImage {
                image_name: name,
                grab_focus: false,
                channel_names: &CHANNELS,
                channel_offsets: &[0, 1, 2],
                channel_strides: &[3, 3, 3],
                x: 0,
                y,
                width,
                height: (data.len() / row) as u32,
                data,
            })?;
        }
        Ok(())
    }
}

fn connect(address: &TevAddress) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::other("the host has no address");
    for socket in address.0.to_socket_addrs()? {
        match TcpStream::connect_timeout(&socket, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_a_host_and_a_port() {
        for good in ["127.0.0.1:14158", "[::1]:1", "lookdev.local:65535"] {
            assert_eq!(good.parse(), Ok(TevAddress(good.into())));
        }
        for bad in ["", "localhost", ":14158", "localhost:", "localhost:0", "localhost:65536", "localhost:x"] {
            assert!(bad.parse::<TevAddress>().is_err(), "{bad}");
        }
    }
}
