//! `--tev`: what a viewer receives, and what happens when it goes away. The viewer is a small server that reads the
//! protocol as tev documents it.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use fovea_app::output::exr;
use fovea_app::tev::{TevLink, TevPicture};

use crate::support::{Folder, fovea, text};

/// An image as a viewer holds it.
#[derive(Clone, Debug, PartialEq)]
struct Image {
    size: [u32; 2],
    rgb: Vec<f32>,
    updates: u32,
}

/// The little-endian fields of a packet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (field, rest) = self.0.split_first_chunk::<N>().unwrap();
        self.0 = rest;
        *field
    }

    fn flag(&mut self) -> bool {
        self.take::<1>()[0] != 0
    }

    fn number(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }
}

/// Applies a packet to the viewer's images.
fn apply(images: &mut BTreeMap<String, Image>, packet: &[u8]) {
    let mut fields = Fields(packet);
    match fields.take::<1>()[0] {
        1 => panic!("reload is not used"),
        2 => {
            images.remove(&fields.text());
        }
        4 => {
            fields.flag();
            let name = fields.text();
            let size = [fields.number(), fields.number()];
            let channels: Vec<String> = (0..fields.number()).map(|_| fields.text()).collect();
            assert_eq!(channels, ["R", "G", "B"]);
            let rgb = vec![f32::NAN; 3 * (size[0] * size[1]) as usize];
            assert_eq!(images.insert(name, Image { size, rgb, updates: 0 }), None, "created twice");
        }
        6 => {
            fields.flag();
            let image = images.get_mut(&fields.text()).expect("updated before it was created");
            let channels: Vec<String> = (0..fields.number()).map(|_| fields.text()).collect();
            assert_eq!(channels, ["R", "G", "B"]);
            let [x, y, width, height] = [fields.number(), fields.number(), fields.number(), fields.number()];
            assert!(x + width <= image.size[0] && y + height <= image.size[1]);
            let mut longs = || [0; 3].map(|_| u64::from_le_bytes(fields.take()));
            let (offsets, strides) = (longs(), longs());
            let data: Vec<f32> = fields.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
            for pixel in 0..width * height {
                let at = ((y + pixel / width) * image.size[0] + x + pixel % width) as usize;
                for channel in 0..3 {
                    let from = offsets[channel] + u64::from(pixel) * strides[channel];
                    image.rgb[3 * at + channel] = data[from as usize];
                }
            }
            image.updates += 1;
            fields.0 = &[];
        }
        other => panic!("unknown packet {other}"),
    }
    assert!(fields.0.is_empty(), "bytes are left over");
}

/// Reads one connection to its end, reporting the images after every packet.
fn view(mut stream: TcpStream, report: &Sender<BTreeMap<String, Image>>) {
    let mut images = BTreeMap::new();
    let mut length = [0; 4];
    while stream.read_exact(&mut length).is_ok() {
        let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut packet).unwrap();
        apply(&mut images, &packet);
        // The test may have seen enough.
        let _ = report.send(images.clone());
    }
}

/// A viewer for one connection.
fn viewer(listener: TcpListener) -> Receiver<BTreeMap<String, Image>> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || view(listener.accept().unwrap().0, &sender));
    receiver
}

#[test]
fn a_viewer_ends_up_with_the_rendered_film() {
    let folder = Folder::new("tev");
    let (scene, out) = (folder.path("square.gltf"), folder.path("out.exr"));
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let images = viewer(listener);
    let options = ["--film", "equirect:64x32", "--seconds", "3", "--background", "0.5,1,2", "--tev", &address];
    let output = fovea(&[&["render", text(&scene), "-o", text(&out)], options.as_slice()].concat());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.is_empty(), "{said}");
    let last = images.iter().last().unwrap();
    let (name, image) = last.first_key_value().unwrap();
    assert_eq!((last.len(), name.as_str(), image.size), (1, "out.exr", [64, 32]));
    assert!(image.updates >= 3, "{} updates in 3 seconds", image.updates);
    let film = exr::read(&out).unwrap().film;
    let expected: Vec<f32> = film.pixels().flat_map(|pixel| pixel.mean.map(|value| value as f32)).collect();
    assert_eq!(image.rgb, expected);
}

#[test]
fn without_a_viewer_a_render_says_so_once_and_finishes() {
    let folder = Folder::new("no-tev");
    let (scene, out) = (folder.path("square.gltf"), folder.path("out.exr"));
    // A port that was free a moment ago, and that nobody listens on.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let options = ["--film", "equirect:16x8", "--seconds", "3", "--background", "1,1,1", "--tev", &address];
    let output = fovea(&[&["render", text(&scene), "-o", text(&out)], options.as_slice()].concat());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    assert!(said.lines().count() == 1 && said.contains(&address) && said.contains("refused"), "{said}");
    assert!(exr::read(&out).unwrap().film.header.samples() > 0);
}

#[test]
fn a_lost_viewer_is_said_once_and_found_again_with_a_whole_picture() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let (tell, told) = channel();
    let mut link =
        TevLink::start(address.to_string().parse().unwrap(), "a\0 view", move |line| tell.send(line).unwrap()).unwrap();
    // Two packets to a picture.
    let picture = |value: f32| {
        let size = [1500, 1000];
        Ok::<_, std::io::Error>(TevPicture { size, rgb: (0..4_500_000).map(|i| value + (i % 1009) as f32).collect() })
    };
    let deadline = Instant::now() + Duration::from_secs(60);
    let mut push_until = |stop: &mut dyn FnMut() -> bool, value: f32| {
        while !stop() {
            assert!(Instant::now() < deadline, "nothing happened for a minute");
            if link.is_due() {
                link.push(|| picture(value)).unwrap();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    };

    // A viewer that closes after the first bytes.
    push_until(&mut || listener.set_nonblocking(true).is_ok() && listener.accept().is_ok(), 1.0);
    let mut lines = Vec::new();
    push_until(&mut || told.try_recv().map(|line| lines.push(line)).is_ok(), 2.0);
    assert!(lines[0].contains(&address.to_string()) && lines[0].contains("no pictures"), "{lines:?}");

    listener.set_nonblocking(false).unwrap();
    let images = viewer(listener);
    push_until(&mut || told.try_recv().map(|line| lines.push(line)).is_ok(), 3.0);
    assert!(lines[1].contains("again"), "{lines:?}");
    drop(link);
    let last = images.iter().last().unwrap();
    let image = &last["a view"];
    assert_eq!((image.size, image.rgb.clone()), ([1500, 1000], picture(3.0).unwrap().rgb));
    assert!(image.updates >= 2 && told.try_recv().is_err());
}
