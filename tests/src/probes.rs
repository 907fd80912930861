//! Probes of model files: points of a model and what its own labels say is to be seen there.
//!
//! The list is `tests/probes.json`. A point is a place of the model (metres, the file's coordinates), seen through a lens of
//! [`VFOV_DEG`] degrees from the file's `from` towards `to`; its value is the mean radiance of a few pixels about it.

use std::{path::Path, sync::Arc};

use glam::{Mat3, Quat, Vec3};
use serde_json::Value;
use tracer::{
    distribution::{Distribution, Layer},
    film::{FilmOptions, FilmSnapshot},
    import::{ImportError, ImportOptions, load_gltf},
    renderer::{FilmPose, RenderError, Renderer},
    scene::{ContentHash, Environment, EnvironmentImage, Scene},
};

use crate::device;

/// Vertical angle of view of all probes, degrees.
pub const VFOV_DEG: f32 = 30.0;
/// Side of the film that the probes' pixels are of.
pub const FILM_PX: u32 = 256;
/// Indirect bounces: enough for the sheets of glass that stand behind one another in the models.
pub const MAX_BOUNCES: u32 = 8;

/// The film of all probes.
pub fn film(side_px: u32) -> FilmOptions {
    FilmOptions::perspective(side_px, side_px, VFOV_DEG.to_radians())
}

/// A model file, how it is looked at, and what is to be seen.
#[derive(Clone, Debug)]
pub struct Model {
    /// Below the folder of the models.
    pub file: String,
    /// Who is to be named beside a picture of it.
    pub credit: String,
    /// Licence of the model.
    pub licence: String,
    /// Whether the licence allows pictures of it here.
    pub on_sheet: bool,
    /// From where it is seen, metres.
    pub from: Vec3,
    /// What the lens points at, metres.
    pub to: Vec3,
    /// The light about it.
    pub light: Light,
    /// Seconds of the file's animation; its default pose without.
    pub time_secs: Option<f32>,
    /// What is to be seen.
    pub probes: Vec<Probe>,
}

/// The light from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Radiance 1 from everywhere.
    White,
    /// None but the file's own.
    Own,
    /// A wide lobe about this direction, 4 at its centre, and 0.05 from everywhere.
    From(Vec3),
}

/// A place and what it is to look like.
#[derive(Clone, Debug)]
pub struct Probe {
    /// What the model's label says, in words.
    pub why: String,
    /// Metres.
    pub at: Vec3,
    /// Pixels on each side of the middle one.
    pub radius_px: u32,
    /// What is expected.
    pub expect: Expectation,
}

/// What is expected of a place.
#[derive(Clone, Debug)]
pub enum Expectation {
    /// Linear radiance, each channel within an absolute distance.
    Color(Vec3, f32),
    /// As another place, each channel within an absolute distance.
    Same(Vec3, f32),
    /// Another place's luminance is at least this many times as high.
    Darker(Vec3, f32),
    /// One channel (0 red, 1 green, 2 blue) is at least this many times each of the others.
    Hue(usize, f32),
}

impl Expectation {
    /// The other place, where there is one.
    pub fn other(&self) -> Option<Vec3> {
        match *self {
            Self::Same(place, _) | Self::Darker(place, _) => Some(place),
            Self::Color(..) | Self::Hue(..) => None,
        }
    }

    /// Whether a value, beside the other place's, is as expected.
    pub fn holds(&self, value: Vec3, other: Vec3) -> bool {
        let luminance = |c: Vec3| c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        match *self {
            Self::Color(color, within) => (value - color).abs().max_element() <= within,
            Self::Same(_, within) => (value - other).abs().max_element() <= within,
            Self::Darker(_, times) => luminance(other) >= times * luminance(value) && luminance(other) > 1e-3,
            Self::Hue(channel, times) => (0..3).all(|c| c == channel || value[channel] >= times * value[c] + 1e-3),
        }
    }
}

fn number(value: &Value) -> Option<f32> {
    value.as_f64().map(|v| v as f32)
}

fn vector(value: &Value) -> Option<Vec3> {
    let [x, y, z] = value.as_array()?.as_slice() else { return None };
    Some(Vec3::new(number(x)?, number(y)?, number(z)?))
}

fn text(value: &Value) -> Option<String> {
    value.as_str().map(str::to_owned)
}

fn probe(value: &Value) -> Option<Probe> {
    let within = number(&value["within"]);
    let expect = if let Some(color) = vector(&value["is"]) {
        Expectation::Color(color, within?)
    } else if let Some(place) = vector(&value["same_as"]) {
        Expectation::Same(place, within?)
    } else if let Some(place) = vector(&value["darker_than"]) {
        Expectation::Darker(place, number(&value["times"])?)
    } else {
        let hue = value["hue"].as_str()?;
        let channel = ["red", "green", "blue"].iter().position(|name| *name == hue)?;
        Expectation::Hue(channel, number(&value["times"]).unwrap_or(2.0))
    };
    let radius_px = value["radius_px"].as_u64().unwrap_or(1) as u32;
    Some(Probe { why: text(&value["why"])?, at: vector(&value["at"])?, radius_px, expect })
}

fn model(value: &Value) -> Option<Model> {
    let light = match value["light"].as_str() {
        Some("white") => Light::White,
        Some("own") => Light::Own,
        _ => Light::From(vector(&value["light"])?.normalize()),
    };
    Some(Model {
        file: text(&value["file"])?,
        credit: text(&value["credit"])?,
        licence: text(&value["licence"])?,
        on_sheet: value["on_sheet"].as_bool().unwrap_or(true),
        from: vector(&value["from"])?,
        to: vector(&value["to"])?,
        light,
        time_secs: number(&value["time_secs"]),
        probes: value["probes"].as_array()?.iter().map(probe).collect::<Option<_>>()?,
    })
}

/// The committed list.
///
/// # Panics
/// When an entry is not as this module's types say; the message names it.
pub fn list() -> Vec<Model> {
    let json: Value = serde_json::from_str(include_str!("../probes.json")).expect("tests/probes.json is JSON");
    let files = json["files"].as_array().expect("a list of files");
    files.iter().map(|value| model(value).unwrap_or_else(|| panic!("tests/probes.json: {value}"))).collect()
}

/// A lobe of radiance about a direction, 64x32 pixels.
fn lobe(towards: Vec3) -> Environment {
    let (width, height) = (64, 32);
    let panorama = FilmOptions::equirect(width, height);
    let pixels: Vec<[f32; 3]> = (0..width * height)
        .map(|i| tracer::distribution::film_direction(&panorama, i % width, i / width))
        .map(|direction| [0.05 + 4.0 * direction.dot(towards).max(0.0).powi(4); 3])
        .collect();
    let hash = ContentHash::of(&[bytemuck::cast_slice(&pixels)]);
    let image = Arc::new(EnvironmentImage { width, height, pixels, hash });
    Environment::Image { image, rotation_deg: 0.0, intensity: 1.0 }
}

impl Model {
    /// The model in its light.
    ///
    /// # Errors
    /// When the file cannot be imported.
    pub fn load(&self, folder: &Path) -> Result<Scene, ImportError> {
        let options = ImportOptions { time_secs: self.time_secs, ..Default::default() };
        let (mut scene, _) = load_gltf(&folder.join(&self.file), &options)?;
        scene.environment = match self.light {
            Light::White => Environment::Constant(Vec3::ONE),
            Light::Own => Environment::Constant(Vec3::ZERO),
            Light::From(direction) => lobe(direction),
        };
        Ok(scene)
    }

    /// Where the film is and looks, in the scene's coordinates.
    pub fn pose(&self, scene: &Scene) -> FilmPose {
        let back = (self.from - self.to).normalize();
        let up = if back.y.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::Y };
        let right = up.cross(back).normalize();
        let world_from_film = Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back));
        FilmPose { position: self.from - scene.origin_in_file.as_vec3(), world_from_film }
    }

    /// The film's pixels about a place of the model; empty when the film does not reach it.
    fn pixels(&self, scene: &Scene, place: Vec3, radius_px: u32) -> Vec<u32> {
        let in_film = self.pose(scene).world_from_film.inverse() * (place - self.from);
        let Some([x, y]) = film(FILM_PX).pixel_of(in_film) else { return Vec::new() };
        let span = |p: u32| p.saturating_sub(radius_px)..=(p + radius_px).min(FILM_PX - 1);
        span(y).flat_map(|y| span(x).map(move |x| y * FILM_PX + x)).collect()
    }

    /// Traces the pixels of all probes, `samples` each, and returns what does not hold, one line each.
    ///
    /// # Errors
    /// As [`Renderer::trace`].
    pub fn check(&self, renderer: &mut Renderer, scene: &Scene, samples: u64) -> Result<Vec<String>, RenderError> {
        let places = self.probes.iter().flat_map(|p| [Some(p.at), p.expect.other()].map(|place| (place, p.radius_px)));
        let lists: Vec<Vec<u32>> =
            places.map(|(place, radius)| place.map_or(Vec::new(), |at| self.pixels(scene, at, radius))).collect();
        // What is not in the picture agrees with everything.
        let unseen =
            self.probes.iter().zip(lists.as_chunks().0).filter(|(probe, [value, other])| {
                value.is_empty() || other.is_empty() && probe.expect.other().is_some()
            });
        let unseen: Vec<String> =
            unseen.map(|(probe, _)| format!("{}: {}: a place is outside of the film", self.file, probe.why)).collect();
        if !unseen.is_empty() {
            return Ok(unseen);
        }
        let mut pixels: Vec<u32> = lists.concat();
        pixels.sort_unstable();
        pixels.dedup();
        let total = samples * pixels.len() as u64;
        renderer.set_scene(scene)?;
        renderer.set_pose(self.pose(scene));
        let layer = Layer::Pixels(pixels.into());
        let only_these = Distribution::mixture(vec![(1.0, layer)], renderer.distribution().inverse().clone());
        renderer.set_distribution(only_these.expect("one layer"))?;
        let film = device::trace(renderer, total)?;
        let values: Vec<Vec3> = lists.iter().map(|list| mean(&film, list)).collect();
        let pairs = self.probes.iter().zip(values.as_chunks().0);
        Ok(pairs.filter_map(|(probe, &[value, other])| self.complaint(probe, value, other)).collect())
    }

    fn complaint(&self, probe: &Probe, value: Vec3, other: Vec3) -> Option<String> {
        let Probe { why, at, expect, .. } = probe;
        let held = expect.holds(value, other);
        (!held).then(|| format!("{}: {why}: at {at} is {value:.3}, the other {other:.3}, not {expect:?}", self.file))
    }
}

fn mean(film: &FilmSnapshot, pixels: &[u32]) -> Vec3 {
    let sum: Vec3 = pixels.iter().map(|&i| Vec3::from_array(film.pixel(i as usize).mean.map(|v| v as f32))).sum();
    sum / pixels.len().max(1) as f32
}
