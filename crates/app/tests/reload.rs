//! A scene file that is rewritten while it is watched: whole, in parts, by renaming, with rubbish in between.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Parser;
use fovea_app::cli::Cli;
use fovea_app::cli::values::CameraChoice;
use fovea_app::reload::rule::Timing;
use fovea_app::reload::{LoadEvent, Loader, Watched};
use fovea_app::session::{Loaded, Source};

/// A pause that ends a version; within a version the writer never means to rest so long.
const QUIET: Duration = Duration::from_millis(60);

fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("fovea-reload-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn loader() -> Loader {
    loader_of(&["fovea"])
}

fn loader_of(line: &[&str]) -> Loader {
    let timing = Timing { quiet: QUIET, poll: Duration::from_millis(200), grace: Duration::from_millis(500) };
    Loader::start(Cli::parse_from(line).preview.scene, timing, || {}).unwrap()
}

/// Waits for an event that satisfies `wanted`, handing all others to `other`.
fn wait(loader: &Loader, mut other: impl FnMut(&LoadEvent), wanted: impl Fn(&LoadEvent) -> bool) -> LoadEvent {
    let start = Instant::now();
    loop {
        match loader.poll() {
            Some(event) if wanted(&event) => return event,
            Some(event) => other(&event),
            None => std::thread::sleep(Duration::from_millis(2)),
        }
        assert!(start.elapsed() < Duration::from_secs(120), "nothing came");
    }
}

fn loaded(event: &LoadEvent) -> &Loaded {
    match event {
        LoadEvent::Opened(_, loaded) | LoadEvent::Changed(loaded) => loaded,
        other => panic!("no scene: {other:?}"),
    }
}

/// One triangle whose positions, roughness and name all tell the version: a mixture of two shows.
fn glb(version: u16) -> Vec<u8> {
    padded_glb(version, 640)
}

/// The same, with so many bytes of JSON at least.
fn padded_glb(version: u16, length: usize) -> Vec<u8> {
    // Below 1, so that the scene is not moved to its centre.
    let v = f32::from(version) / 2000.0;
    let bin: Vec<u8> =
        [v, 0.0, 0.0, v, 1.0, 0.0, v, 0.0, 1.0].iter().flat_map(|value: &f32| value.to_le_bytes()).collect();
    // The same length for every version, so that a half of one fits the other.
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"v{version:05}"}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
"materials":[{{"pbrMetallicRoughness":{{"roughnessFactor":{:.5}}}}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[{v},0,0],"max":[{v},1,1]}}],
"bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36}}]}}"#,
        v
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4).max(length), b' ');
    let mut bytes = b"glTF".to_vec();
    let chunks = [(json.as_slice(), b"JSON"), (bin.as_slice(), b"BIN\0")];
    let total = 12 + chunks.iter().map(|(data, _)| 8 + data.len()).sum::<usize>();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((total as u32).to_le_bytes());
    for (data, kind) in chunks {
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(data);
    }
    bytes
}

/// The version of a scene; panics when it is made of two.
fn version(loaded: &Loaded) -> u16 {
    let number = |value: f32| (value * 2000.0).round() as u16;
    let found = number(loaded.scene.meshes[0].positions[0].x);
    assert_eq!(found, number(loaded.scene.materials[0].roughness), "two versions in one");
    assert_eq!(loaded.scene.instances[0].name, format!("v{found:05}"));
    found
}

/// A small generator, so that a failure can be had again.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % sides
    }
}

/// Writes a version as one program or another does. False when the writer was kept waiting so long inside the version
/// that half of it could pass for a whole.
fn rewrite(path: &Path, version: u16, dice: &mut Dice) -> bool {
    let bytes = glb(version);
    let start = Instant::now();
    let rest = Duration::from_millis(dice.roll(6));
    let cut = dice.roll(bytes.len() as u64) as usize;
    match dice.roll(4) {
        0 => std::fs::write(path, &bytes).unwrap(),
        1 => {
            let beside = path.with_extension("part");
            std::fs::write(&beside, &bytes).unwrap();
            std::fs::rename(beside, path).unwrap();
        }
        2 => {
            // In place, without emptying it first: for a while the old and the new are one file.
            let mut file = std::fs::OpenOptions::new().write(true).truncate(false).open(path).unwrap();
            file.write_all(&bytes[..cut]).unwrap();
            std::thread::sleep(rest);
            file.write_all(&bytes[cut..]).unwrap();
        }
        _ => {
            let mut file = std::fs::File::create(path).unwrap();
            file.write_all(&bytes[..cut]).unwrap();
            std::thread::sleep(rest);
            file.write_all(&bytes[cut..]).unwrap();
        }
    }
    start.elapsed() < QUIET / 2
}

#[test]
fn a_thousand_rewrites_never_show_a_broken_scene() {
    let folder = scratch("thousand");
    let path = folder.join("scene.glb");
    std::fs::write(&path, glb(1)).unwrap();
    let loader = loader();
    loader.open(Source::File(path.clone()));
    assert_eq!(version(loaded(&wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..))))), 1);
    let mut dice = Dice(0x5eed);
    let mut tolerant_until = Instant::now();
    let (mut shown, mut undecided, mut last) = (0, 0, 1);
    let take = |event: &LoadEvent, undecided: bool, shown: &mut u32, last: &mut u16| match event {
        LoadEvent::Changed(scene) if !undecided => {
            let found = version(scene);
            assert!(found >= *last, "version {found} after {last}");
            (*shown, *last) = (*shown + 1, found);
        }
        LoadEvent::Broken(text) => assert!(!text.contains('\n'), "{text}"),
        _ => {}
    };
    for version in 2..=1001_u16 {
        let quick = rewrite(&path, version, &mut dice);
        if !quick {
            undecided += 1;
            tolerant_until = Instant::now() + 5 * QUIET;
        }
        // Now and then the writer rests, and what there is is read.
        let rest = if version % 25 == 0 { 2 * QUIET } else { Duration::from_millis(dice.roll(6)) };
        std::thread::sleep(rest);
        while let Some(event) = loader.poll() {
            take(&event, Instant::now() < tolerant_until, &mut shown, &mut last);
        }
    }
    if last != 1001 {
        let end = |event: &LoadEvent| matches!(event, LoadEvent::Changed(scene) if version(scene) == 1001);
        wait(&loader, |event| take(event, false, &mut shown, &mut last), end);
    }
    eprintln!("{shown} versions shown; the writer was kept waiting within {undecided} of 1000");
    assert!(shown >= 10, "only {shown} versions were shown");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_the_command_line_says_of_its_file_counts_for_no_other() {
    let folder = scratch("others");
    let [named, other] = ["named.glb", "other.glb"].map(|name| folder.join(name));
    std::fs::write(&named, glb(1)).unwrap();
    std::fs::write(&other, glb(2)).unwrap();
    let line = ["fovea", named.to_str().unwrap(), "--variant", "red", "--camera", "1"];
    let loader = loader_of(&line);
    let open = |path: &Path| {
        loader.open(Source::File(path.to_owned()));
        wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..) | LoadEvent::NotOpened(_)))
    };
    // The file has no such variant.
    assert!(matches!(open(&named), LoadEvent::NotOpened(text) if text.contains("red")));
    let opened = open(&other);
    assert_eq!((version(loaded(&opened)), loaded(&opened).camera.is_none()), (2, true));
    // By another name it is still the one.
    assert!(matches!(open(&folder.join(".").join("named.glb")), LoadEvent::NotOpened(text) if text.contains("red")));

    let loader = loader_of(&["fovea", named.to_str().unwrap(), "--camera", "1"]);
    loader.open(Source::File(named.clone()));
    let opened = wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..)));
    assert_eq!(loaded(&opened).camera, Some(CameraChoice::Index(1)));
    std::fs::write(&named, glb(3)).unwrap();
    let changed = wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Changed(scene) if version(scene) == 3));
    assert_eq!(loaded(&changed).camera, Some(CameraChoice::Index(1)));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_broken_file_says_so_and_a_mended_one_is_shown() {
    let folder = scratch("mended");
    let path = folder.join("scene.glb");
    std::fs::write(&path, glb(3)).unwrap();
    let loader = loader();
    loader.open(Source::File(path.clone()));
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..)));
    for breakage in [&b"not a scene"[..], &glb(4)[..700]] {
        std::fs::write(&path, breakage).unwrap();
        let event = wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Broken(_)));
        let LoadEvent::Broken(text) = event else { unreachable!("waited for") };
        assert!(text.contains("scene.glb"), "{text}");
    }
    std::fs::remove_file(&path).unwrap();
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Broken(text) if text.contains("cannot be read")));
    std::fs::write(&path, glb(5)).unwrap();
    let event = wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Changed(_)));
    assert_eq!(version(loaded(&event)), 5);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_scene_that_stays_is_followed_again_after_another_was_read() {
    let folder = scratch("back");
    let [here, there] = ["here.glb", "there.glb"].map(|name| folder.join(name));
    std::fs::write(&here, glb(1)).unwrap();
    std::fs::write(&there, glb(2)).unwrap();
    let loader = loader();
    let opened = |path: &Path| {
        loader.open(Source::File(path.to_owned()));
        wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..)))
    };
    let watched = Watched::new(&Source::File(here.clone()), loaded(&opened(&here)));
    opened(&there);
    // While somebody is asked whether the first may go, its file breaks; the answer is that it stays.
    std::fs::write(&here, b"half a scene").unwrap();
    loader.follow(watched);
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Followed));
    let next = || {
        wait(
            &loader,
            |event| assert!(matches!(event, LoadEvent::Broken(_)), "{event:?}"),
            |event| matches!(event, LoadEvent::Changed(_)),
        )
    };
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Broken(text) if text.contains("here.glb")));
    std::fs::write(&there, glb(3)).unwrap();
    std::fs::write(&here, glb(4)).unwrap();
    assert_eq!(version(loaded(&next())), 4, "of the other nothing is heard");
    // A wish that fails changes nothing of that.
    loader.open(Source::File(folder.join("nowhere.glb")));
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::NotOpened(_)));
    std::fs::write(&here, glb(5)).unwrap();
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Changed(scene) if version(scene) == 5));
    std::fs::remove_dir_all(folder).unwrap();
}

/// A file whose positions are in `name`.bin and whose colour is an image.
fn gltf(name: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"material":0}}]}}],
"materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
"textures":[{{"source":0}}],"images":[{{"uri":"colour.png"}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}}],
"bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":24}}],
"buffers":[{{"byteLength":60,"uri":"{name}.bin"}}]}}"#
    )
}

#[test]
fn companions_count_and_a_half_written_image_waits_its_time() {
    let folder = scratch("companions");
    let path = folder.join("scene.gltf");
    let floats = |values: [f32; 15]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let bin = |x: f32| floats([x, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let png = |red: u8| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::RgbImage::from_pixel(8, 8, image::Rgb([red, 0, 0]))
            .write_to(&mut bytes, image::ImageFormat::Png)
            .unwrap();
        bytes.into_inner()
    };
    std::fs::write(&path, gltf("first")).unwrap();
    std::fs::write(folder.join("first.bin"), bin(1.0)).unwrap();
    std::fs::write(folder.join("colour.png"), png(10)).unwrap();
    let loader = loader();
    loader.open(Source::File(path.clone()));
    let changed = |event: &LoadEvent| matches!(event, LoadEvent::Changed(_));
    let next = || wait(&loader, |_| {}, changed);
    let red = |event: &LoadEvent| loaded(event).scene.textures[0].texels[0][0];
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..)));
    // The files are as new as the window: they may be read a second time, which is not what is waited for.
    std::thread::sleep(4 * QUIET);
    while loader.poll().is_some() {}

    std::fs::write(folder.join("first.bin"), bin(0.5)).unwrap();
    assert_eq!(loaded(&next()).scene.meshes[0].positions[0].x, 0.5);
    std::fs::write(folder.join("colour.png"), png(200)).unwrap();
    assert_eq!(red(&next()), 200);

    // Half an image is not shown at once, and a whole one that follows is shown instead.
    let whole = png(90);
    std::fs::write(folder.join("colour.png"), &whole[..whole.len() / 2]).unwrap();
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Broken(text) if text.contains("image")));
    std::fs::write(folder.join("colour.png"), &whole).unwrap();
    assert_eq!(red(&next()), 90);
    // What stays half an image is taken as it is in the end.
    std::fs::write(folder.join("colour.png"), &whole[..whole.len() / 2]).unwrap();
    assert_eq!(loaded(&next()).replaced_images.len(), 1);

    // A file that names a companion which comes only later, under a name that was never watched.
    std::fs::write(&path, gltf("second")).unwrap();
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Broken(text) if text.contains("second.bin")));
    std::fs::write(folder.join("second.bin"), bin(0.25)).unwrap();
    assert_eq!(loaded(&next()).scene.meshes[0].positions[0].x, 0.25);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn images_wait_for_the_sketch_of_their_scene_but_not_for_ever() {
    let folder = scratch("shapes");
    let [path, other] = ["scene.glb", "other.glb"].map(|name| folder.join(name));
    std::fs::write(&path, glb(7)).unwrap();
    std::fs::write(&other, glb(8)).unwrap();
    let loader = loader();
    let open = |path: &Path| {
        loader.open(Source::File(path.to_owned()));
        match wait(&loader, |event| panic!("{event:?} came first"), |event| matches!(event, LoadEvent::Shapes(..))) {
            LoadEvent::Shapes(_, sketchable) => sketchable,
            event => panic!("{event:?}"),
        }
    };
    let opened = || wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..)));
    let held = open(&path);
    assert_eq!(held.shapes.scene.instances[0].name, "v00007");
    std::thread::sleep(Duration::from_millis(200));
    assert!(loader.poll().is_none() && loader.loading().is_some(), "it waits");
    drop(held);
    assert_eq!(version(loaded(&opened())), 7);

    // Whoever keeps the shapes does not keep the scene back.
    let held = open(&other);
    assert_eq!(version(loaded(&opened())), 8);
    assert_eq!(held.shapes.scene.instances[0].name, "v00008");

    // A wish that is not the newest any more is not sketched.
    let held = open(&path);
    let newer = open(&other);
    drop((held, newer));
    assert_eq!(version(loaded(&opened())), 8);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_changed_file_that_is_given_up_is_read_when_it_changes_again() {
    let folder = scratch("given-up");
    let path = folder.join("scene.glb");
    std::fs::write(&path, glb(1)).unwrap();
    let loader = loader();
    loader.open(Source::File(path.clone()));
    wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Opened(..)));
    let start = Instant::now();
    let is_patient = || assert!(start.elapsed() < Duration::from_secs(120), "nothing can be given up");
    // A machine that is busy may read a file before it can be given up: then with the next one.
    let given_up = (2..30).find(|version| {
        std::thread::sleep(4 * QUIET);
        while loader.poll().is_some() {}
        std::fs::write(&path, padded_glb(*version, 16 << 20)).unwrap();
        while loader.loading().is_none() {
            is_patient();
            std::thread::yield_now();
        }
        loader.cancel();
        while loader.loading().is_some() {
            is_patient();
            std::thread::yield_now();
        }
        std::thread::sleep(8 * QUIET);
        loader.poll().is_none() && loader.loading().is_none()
    });
    assert!(given_up.is_some(), "what was given up is read");
    std::fs::write(&path, glb(40)).unwrap();
    let event = wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Changed(_)));
    assert_eq!(version(loaded(&event)), 40);
    std::fs::remove_dir_all(folder).unwrap();
}

/// A grey environment of one pixel.
fn hdr(level: f32) -> Vec<u8> {
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&[image::Rgb([level; 3])], 1, 1).unwrap();
    bytes
}

#[test]
fn an_environment_is_read_again_when_its_file_changes_or_it_is_asked_for_again() {
    let folder = scratch("environment");
    let [sky, other] = ["sky.hdr", "other.hdr"].map(|name| folder.join(name));
    let loader = loader();
    let next = || match wait(&loader, |_| {}, |event| matches!(event, LoadEvent::Environment(..))) {
        LoadEvent::Environment(path, result) => (path, result.map(|image| image.pixels[0][0])),
        event => panic!("{event:?}"),
    };
    loader.load_environment(sky.clone());
    assert!(matches!(next(), (path, Err(text)) if path == sky && text.contains("sky.hdr")));
    for level in [1.0, 2.0] {
        std::fs::write(&sky, hdr(level)).unwrap();
        assert_eq!(next(), (sky.clone(), Ok(level)));
    }
    // Asked for again, as it is.
    loader.load_environment(sky.clone());
    assert_eq!(next(), (sky.clone(), Ok(2.0)));
    // Of the one that was asked for before nothing is heard.
    std::fs::write(&other, hdr(4.0)).unwrap();
    loader.load_environment(other.clone());
    assert_eq!(next(), (other.clone(), Ok(4.0)));
    std::fs::write(&sky, hdr(8.0)).unwrap();
    std::thread::sleep(4 * QUIET);
    std::fs::write(&other, hdr(16.0)).unwrap();
    assert_eq!(next(), (other, Ok(16.0)));
    std::fs::remove_dir_all(folder).unwrap();
}
