//! What a mixture is made of.

use super::{Mask, Region};
use crate::frame::Direction;
use crate::warp::{GazeWarp, to_world};
use crate::{Film, SamplerError};

/// A distribution over directions that can be drawn from directly.
#[derive(Clone, Debug)]
pub enum Source {
    /// Acuity about a gaze.
    Acuity {
        /// The warp.
        warp: GazeWarp,
        /// The gaze, a unit vector.
        gaze: Direction,
    },
    /// Uniform over the sphere: a floor.
    Uniform,
    /// Uniform over the pixels of an equirectangular film: `1 / (2 pi^2 cos(latitude))` per steradian.
    Panorama,
    /// Uniform over the image plane of a perspective view.
    View {
        /// A perspective film; its size does not matter, its angles do.
        film: Film,
        /// The view's axes (right, up, backward) in the frame of directions.
        axes: [Direction; 3],
    },
    /// Uniform in a region.
    Region(Region),
    /// Uniform in small caps of equal weight about pinned points.
    Pins(Vec<Region>),
    /// A painted mask or an estimate of the error.
    Mask(Mask),
}

impl Source {
    /// Pinned points: directions that keep getting samples, each in a cap of this radius.
    ///
    /// # Errors
    /// If there is no point or the radius is not in (0, 180] degrees.
    pub fn pins(points: &[Direction], radius: crate::Angle) -> Result<Self, SamplerError> {
        if points.is_empty() {
            return Err(SamplerError::Parameter { what: "the number of pins", value: 0.0, requirement: "at least 1" });
        }
        points.iter().map(|p| Region::cap(*p, radius)).collect::<Result<_, _>>().map(Self::Pins)
    }

    /// The density per steradian at a unit direction.
    #[must_use]
    pub fn pdf(&self, direction: Direction) -> f64 {
        match self {
            Self::Acuity { warp, gaze } => warp.pdf(direction, *gaze),
            Self::Uniform => 1.0 / Region::SPHERE.solid_angle(),
            Self::Panorama => {
                let cos_latitude = direction[0].hypot(direction[2]);
                // At the poles the density diverges; half a pixel of a 2^20 film keeps it finite.
                1.0 / (2.0 * core::f64::consts::PI.powi(2) * cos_latitude.max(1e-6))
            }
            Self::View { film, axes } => {
                let local = axes.map(|axis| crate::warp::dot(axis, direction));
                let [width, height] = film.size_px();
                film.position(local).map_or(0.0, |position| {
                    1.0 / (film.steradians_per_pixel(position) * f64::from(width) * f64::from(height))
                })
            }
            Self::Region(region) => uniform_pdf(region, direction),
            Self::Pins(caps) => caps.iter().map(|cap| uniform_pdf(cap, direction)).sum::<f64>() / caps.len() as f64,
            Self::Mask(mask) => mask.pdf(direction),
        }
    }

    /// A unit direction of this density for uniform `u`.
    #[must_use]
    pub fn sample(&self, u: [f64; 2]) -> Direction {
        let u = u.map(|x| if x > 0.0 { x.min(1.0) } else { 0.0 });
        match self {
            Self::Acuity { warp, gaze } => warp.sample(u, *gaze).direction,
            Self::Uniform => Region::SPHERE.sample(u),
            Self::Panorama => {
                let ((sin_lat, cos_lat), (sin, cos)) = (
                    (core::f64::consts::PI * (0.5 - u[0])).sin_cos(),
                    (core::f64::consts::TAU * (u[1] - 0.5)).sin_cos(),
                );
                [cos_lat * sin, sin_lat, -cos_lat * cos]
            }
            Self::View { film, axes } => {
                let [width, height] = film.size_px().map(f64::from);
                to_world(*axes, film.direction([u[0] * width, u[1] * height]))
            }
            Self::Region(region) => region.sample(u),
            Self::Pins(caps) => {
                let scaled = u[0] * caps.len() as f64;
                let index = (scaled as usize).min(caps.len() - 1);
                caps[index].sample([scaled - index as f64, u[1]])
            }
            Self::Mask(mask) => mask.sample(u),
        }
    }
}

fn uniform_pdf(region: &Region, direction: Direction) -> f64 {
    if region.contains(direction) { 1.0 / region.solid_angle() } else { 0.0 }
}
