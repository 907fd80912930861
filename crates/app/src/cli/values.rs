//! Options with a syntax of their own. Angles are degrees here and become radians where they are used.

use std::convert::Infallible;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;

use crate::view::FOV_RANGE_DEG;

/// Largest width or height of a film or window, pixels.
const MAX_SIDE_PX: u32 = 65_536;

/// Pixels across and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SizePx {
    /// Pixels, 1..=65536.
    pub width: u32,
    /// Pixels, 1..=65536.
    pub height: u32,
}

impl FromStr for SizePx {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| match text.parse::<u32>() {
            Ok(side @ 1..=MAX_SIDE_PX) => Ok(side),
            Ok(side) => Err(format!("{side} pixels is out of range 1..={MAX_SIDE_PX}")),
            Err(error) => Err(format!("`{text}` is no number of pixels: {error}")),
        };
        let (width, height) = text.split_once('x').ok_or("expected WIDTHxHEIGHT, for example 1280x720")?;
        Ok(Self { width: side(width)?, height: side(height)? })
    }
}

/// Millimetres across and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeMm {
    /// Millimetres, 10..=100000.
    pub width: f32,
    /// Millimetres, 10..=100000.
    pub height: f32,
}

impl FromStr for SizeMm {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (width, height) = text.split_once('x').ok_or("expected WIDTHxHEIGHT, for example 531x299")?;
        let side = |text: &str| in_range(text, 10.0, 100_000.0, "mm");
        Ok(Self { width: side(width)?, height: side(height)? })
    }
}

/// Which saved edits of a scene are put onto it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EditsChoice {
    /// Those beside the scene.
    Beside,
    /// Those of a file.
    File(PathBuf),
    /// None, although there may be some.
    None,
}

impl FromStr for EditsChoice {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "beside" => Self::Beside,
            "none" => Self::None,
            path => Self::File(path.into()),
        })
    }
}

/// Mapping and size of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmShape {
    /// The whole sphere.
    Equirect(SizePx),
    /// What a lens sees.
    Perspective(SizePx),
}

impl FilmShape {
    /// Pixels across and down.
    pub fn size(self) -> SizePx {
        match self {
            Self::Equirect(size) | Self::Perspective(size) => size,
        }
    }
}

impl FromStr for FilmShape {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, size) = text.split_once(':').ok_or("expected KIND:WIDTHxHEIGHT, for example equirect:2048x1024")?;
        match kind {
            "equirect" => size.parse().map(Self::Equirect),
            "perspective" => size.parse().map(Self::Perspective),
            _ => Err(format!("`{kind}` is no film; expected equirect or perspective")),
        }
    }
}

/// Where one looks, degrees from the film's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GazeAngles {
    /// To the right.
    pub yaw_deg: f32,
    /// Up, -90..=90.
    pub pitch_deg: f32,
}

impl FromStr for GazeAngles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [yaw, pitch] = parts(text, "YAW,PITCH")?;
        Ok(Self { yaw_deg: yaw_deg(yaw)?, pitch_deg: in_range(pitch, -90.0, 90.0, "degrees of pitch")? })
    }
}

/// A perspective view, degrees from the film's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewAngles {
    /// To the right.
    pub yaw_deg: f32,
    /// Up, -90..=90.
    pub pitch_deg: f32,
    /// Across.
    pub hfov_deg: f32,
    /// Up.
    pub vfov_deg: f32,
}

impl FromStr for ViewAngles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [yaw, pitch, fov] = parts(text, "YAW,PITCH,HFOVxVFOV")?;
        let (hfov, vfov) =
            fov.split_once('x').ok_or_else(|| format!("`{fov}`: expected HFOVxVFOV, for example 100x100"))?;
        let fov_deg = |text: &str| in_range(text, *FOV_RANGE_DEG.start(), *FOV_RANGE_DEG.end(), "degrees of view");
        Ok(Self {
            yaw_deg: yaw_deg(yaw)?,
            pitch_deg: in_range(pitch, -90.0, 90.0, "degrees of pitch")?,
            hfov_deg: fov_deg(hfov)?,
            vfov_deg: fov_deg(vfov)?,
        })
    }
}

/// Linear radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgb(pub [f32; 3]);

impl FromStr for Rgb {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [r, g, b] = parts(text, "R,G,B")?;
        let component = |text: &str| in_range(text, 0.0, 1e9, "radiance");
        Ok(Self([component(r)?, component(g)?, component(b)?]))
    }
}

/// A camera of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CameraChoice {
    /// By its place in the file, from 0.
    Index(usize),
    /// By name.
    Name(String),
}

impl FromStr for CameraChoice {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Index))
    }
}

impl fmt::Display for CameraChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

/// A number that is neither NaN nor infinite.
pub fn finite(text: &str) -> Result<f32, String> {
    in_range(text, f32::MIN, f32::MAX, "")
}

/// 0..=1.
pub fn unit_interval(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err(format!("{value} is out of range 0..=1")) }
}

/// Stops by which a picture can be brightened.
pub const EXPOSURE_EV: RangeInclusive<f32> = -20.0..=20.0;

/// Stops, -20..=20.
pub fn exposure_ev(text: &str) -> Result<f32, String> {
    in_range(text, *EXPOSURE_EV.start(), *EXPOSURE_EV.end(), "EV")
}

/// Millimetres from the eye to a screen, 50..=100000.
pub fn distance_mm(text: &str) -> Result<f32, String> {
    in_range(text, 50.0, 100_000.0, "mm")
}

/// Degrees, 0 to 180.
pub fn sun_angle_deg(text: &str) -> Result<f32, String> {
    in_range(text, 0.0, 180.0, "degrees")
}

/// Degrees, 0..=20.
pub fn accuracy_deg(text: &str) -> Result<f64, String> {
    in_range(text, 0.0, 20.0, "degrees").map(f64::from)
}

/// Seconds, above 0 and at most 1e7.
pub fn positive_seconds(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if value > 0.0 && value <= 1e7 {
        Ok(value)
    } else {
        Err(format!("{value} s is out of range: above 0, at most 1e7"))
    }
}

/// Any yaw is a direction, so only its size is bounded, where f32 degrees become too coarse.
fn yaw_deg(text: &str) -> Result<f32, String> {
    in_range(text, -36_000.0, 36_000.0, "degrees of yaw")
}

fn in_range(text: &str, low: f32, high: f32, unit: &str) -> Result<f32, String> {
    let value: f32 = text.trim().parse().map_err(|_| format!("`{text}` is no number"))?;
    // A NaN is in no range.
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    let separator = if unit.is_empty() { "" } else { " " };
    Err(format!("{value}{separator}{unit} is out of range {low}..={high}"))
}

fn parts<'a, const N: usize>(text: &'a str, form: &str) -> Result<[&'a str; N], String> {
    let found: Vec<&str> = text.split(',').collect();
    found.try_into().map_err(|found: Vec<_>| format!("expected {form}: {N} parts, not {}", found.len()))
}
