//! Gaze that an API layer gives to the runtime, which has no eye tracker of its own.

use std::path::Path;
use std::process::Command;

use glam::Vec3;
use tracer::distribution::film_direction;
use tracer::film::FilmOptions;

use crate::monado::{Monado, said};

/// Puts the layer before the runtime, with a recording of `rows` (seconds, yaw and pitch in degrees, or a closed eye).
fn inject(command: &mut Command, folder: &Path, rows: impl Iterator<Item = (f64, Option<[f64; 2]>)>) {
    // Cargo puts the library of a crate that this binary depends on beside it.
    let library = std::env::current_exe().unwrap().with_file_name("libfovea_gaze_layer.so");
    assert!(library.exists(), "{} is missing", library.display());
    let layers = folder.join("layers");
    std::fs::create_dir_all(&layers).unwrap();
    std::fs::write(layers.join("gaze.json"), fovea_gaze_layer::manifest(library.to_str().unwrap())).unwrap();
    let text: String = rows
        .map(|(time, point)| match point {
            Some([yaw, pitch]) => format!("{time},{yaw},{pitch},1\n"),
            None => format!("{time},0,0,0\n"),
        })
        .collect();
    let trace = folder.join("trace.csv");
    std::fs::write(&trace, text).unwrap();
    command
        .env("XR_API_LAYER_PATH", layers)
        .env("XR_ENABLE_API_LAYERS", fovea_gaze_layer::NAME)
        .env(fovea_gaze_layer::TRACE, trace);
}

#[test]
fn samples_gather_where_the_eyes_look() {
    let name = "samples_gather_where_the_eyes_look";
    let Some(mut monado) = Monado::find(name) else { return };
    monado.start(None);
    let mut command = monado.inner(name);
    let rows = (0..120).map(|step| (f64::from(step) / 120.0, Some([10.0, 5.0])));
    inject(&mut command, monado.place(), rows);
    let text = said(&command.output().unwrap());
    text.lines()
        .filter(|line| line.contains("densest") || line.contains("samples a"))
        .for_each(|line| eprintln!("{line}"));
}

#[test]
fn saccades_are_followed_and_blinks_are_held() {
    let name = "saccades_are_followed_and_blinks_are_held";
    let Some(mut monado) = Monado::find(name) else { return };
    monado.start(None);
    let mut command = monado.inner(name);
    // Three and a half seconds at 120 Hz, over and over: three places, and a blink of 200 ms within the second.
    let rows = (0..420).map(|step| {
        let time = f64::from(step) / 120.0;
        let point = match time {
            0.0..1.0 => Some([0.0, 0.0]),
            1.8..2.0 => None,
            1.0..2.6 => Some([12.0, -6.0]),
            _ => Some([-8.0, 4.0]),
        };
        (time, point)
    });
    inject(&mut command, monado.place(), rows);
    let text = said(&command.output().unwrap());
    text.lines().filter(|line| line.contains("saccades followed")).for_each(|line| eprintln!("{line}"));
}

/// The film of an EXR file and the number of samples of each pixel.
pub fn samples_of(path: &Path) -> (FilmOptions, Vec<f32>) {
    let image = exr::prelude::read_all_flat_layers_from_file(path).unwrap();
    let layer = &image.layer_data[0];
    let channel = layer.channel_data.list.iter().find(|channel| channel.name.eq("samples")).unwrap();
    let (width, height) = (layer.size.width() as u32, layer.size.height() as u32);
    (FilmOptions::equirect(width, height), channel.sample_data.values_as_f32().collect())
}

/// The middle of where samples are dense, how dense, and the density anywhere: samples a square degree, over three degrees.
pub fn peak<'a>(film: &'a FilmOptions, counts: &'a [f32]) -> (Vec3, f64, impl Fn(Vec3) -> f64 + 'a) {
    let directions: Vec<Vec3> =
        (0..counts.len() as u32).map(|i| film_direction(film, i % film.width, i / film.width)).collect();
    let seen: Vec<(Vec3, f32)> =
        directions.iter().copied().zip(counts.iter().copied()).filter(|(_, n)| *n > 0.0).collect();
    let radius = 1.5_f32.to_radians();
    let area = std::f64::consts::PI * 1.5 * 1.5;
    let density = move |d: Vec3| {
        let limit = radius.cos();
        seen.iter().filter(|(at, _)| at.dot(d) > limit).map(|(_, n)| f64::from(*n)).sum::<f64>() / area
    };
    // Every degree or so.
    let step = (film.width / 360).max(1) as usize;
    let columns = film.width as usize;
    let candidates = directions
        .iter()
        .enumerate()
        .filter(|(i, _)| (i / columns).is_multiple_of(step) && (i % columns).is_multiple_of(step));
    let densities: Vec<(Vec3, f64)> = candidates.map(|(_, d)| (*d, density(*d))).collect();
    let most = densities.iter().map(|(_, density)| *density).fold(0.0, f64::max);
    // Acuity is flat about its centre, which is the middle of all that is at least half as dense as the densest place.
    let middle: Vec3 = densities.iter().filter(|(_, density)| *density > 0.5 * most).map(|(d, _)| *d).sum();
    let middle = middle.normalize();
    (middle, density(middle), density)
}
