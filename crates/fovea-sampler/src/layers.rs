//! Distributions over directions as layers: a mixture of sources, times factors, accepted at pixel level.
//!
//! # Definition
//! [`Layers`] holds sources with weights `w_i` (normalised here) and densities `p_i`, and factors `f_j` in `[0, 1]`. Its
//! density is proportional to `sum w_i p_i(d) * product f_j(d)`. Drawing: choose a source, draw a direction from it, find the
//! film's pixel, accept with the product of the factors **at the pixel's centre**, otherwise draw again. All samples of a
//! pixel have therefore the same acceptance, and the position in the pixel can be drawn afresh and uniformly.
//!
//! [`FilmDensity`] is a set of layers on a film: it knows the share of draws that are accepted, and with it the normalised
//! density and the expected count of samples of every pixel.
//!
//! ```
//! use fovea_sampler::layers::{Factor, FilmDensity, Layers, Region, Source};
//! use fovea_sampler::{Angle, Film, GazeWarp, Geometry, RadialDistribution, Reddy2001};
//!
//! let cap = Angle::from_degrees(80.0);
//! let warp = GazeWarp::new(RadialDistribution::new(Reddy2001, Geometry::Sphere, cap, 0.0)?);
//! let gaze = [0.0, 0.0, -1.0];
//! let region = Region::rectangle([Angle::from_degrees(-60.0), Angle::from_degrees(60.0)],
//!     [Angle::from_degrees(-30.0), Angle::from_degrees(30.0)])?;
//! let layers = Layers::new(vec![(0.9, Source::Acuity { warp, gaze }), (0.1, Source::Uniform)])?
//!     .with_factor(Factor::Inside { region, outside: 0.05 })?;
//! let density = FilmDensity::new(layers, Film::equirectangular(256, 128)?)?;
//! let at_gaze = density.expected_count([128, 64], 1e6);
//! let behind = density.expected_count([0, 64], 1e6);
//! assert!(at_gaze > 1000.0 * behind && behind > 0.0);
//! # Ok::<(), fovea_sampler::SamplerError>(())
//! ```

mod film_density;
mod mask;
mod region;
mod source;

pub use film_density::FilmDensity;
pub use mask::Mask;
pub use region::Region;
pub use source::Source;

use crate::frame::Direction;
use crate::{SamplerError, warp};

/// Something that the density is multiplied by, between 0 and 1.
#[derive(Clone, Debug)]
pub enum Factor {
    /// 1 inside a region, `outside` elsewhere.
    Inside {
        /// The region.
        region: Region,
        /// The factor outside, in `[0, 1]`; 0 gives no samples there at all.
        outside: f64,
    },
    /// `outside` within a region, 1 elsewhere: spares what is known.
    Outside {
        /// The region.
        region: Region,
        /// The factor inside, in `[0, 1]`.
        inside: f64,
    },
    /// A painted image's value, divided by its largest.
    Mask(Mask),
}

impl Factor {
    /// The factor at a unit direction.
    #[must_use]
    pub fn at(&self, direction: Direction) -> f64 {
        match self {
            Self::Inside { region, outside } if !region.contains(direction) => *outside,
            Self::Outside { region, inside } if region.contains(direction) => *inside,
            Self::Inside { .. } | Self::Outside { .. } => 1.0,
            Self::Mask(mask) => mask.relative(direction),
        }
    }

    fn check(&self) -> Result<(), SamplerError> {
        match self {
            Self::Inside { outside: value, .. } | Self::Outside { inside: value, .. }
                if !(0.0..=1.0).contains(value) =>
            {
                Err(SamplerError::Parameter { what: "a region's factor", value: *value, requirement: "in [0, 1]" })
            }
            _ => Ok(()),
        }
    }
}

/// A mixture of sources times factors; see the module's documentation.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Normalised weights.
    sources: Vec<(f64, Source)>,
    factors: Vec<Factor>,
}

impl Layers {
    /// A mixture of sources with positive weights, which are normalised to a sum of 1.
    ///
    /// # Errors
    /// If there is no source or a weight is not a positive number.
    pub fn new(sources: Vec<(f64, Source)>) -> Result<Self, SamplerError> {
        let requirement = "positive and finite";
        for (weight, _) in &sources {
            if !(*weight > 0.0 && weight.is_finite()) {
                return Err(SamplerError::Parameter { what: "a source's weight", value: *weight, requirement });
            }
        }
        let total: f64 = sources.iter().map(|(weight, _)| weight).sum();
        if !(total > 0.0 && total.is_finite()) {
            return Err(SamplerError::Parameter { what: "the sum of the sources' weights", value: total, requirement });
        }
        let sources = sources.into_iter().map(|(weight, source)| (weight / total, source)).collect();
        Ok(Self { sources, factors: Vec::new() })
    }

    /// Multiplies the density by a factor.
    ///
    /// # Errors
    /// If the factor is not in `[0, 1]`.
    pub fn with_factor(mut self, factor: Factor) -> Result<Self, SamplerError> {
        factor.check()?;
        self.factors.push(factor);
        Ok(self)
    }

    /// The density per steradian of the mixture before the factors.
    #[must_use]
    pub fn mixture_pdf(&self, direction: Direction) -> f64 {
        let direction = warp::unit(direction);
        self.sources.iter().map(|(weight, source)| weight * source.pdf(direction)).sum()
    }

    /// The product of the factors at a direction.
    #[must_use]
    pub fn acceptance(&self, direction: Direction) -> f64 {
        self.factors.iter().map(|factor| factor.at(direction)).product()
    }

    /// A direction of the mixture: `u[0]` chooses the source and is used again, with `u[1]`, for the direction.
    #[must_use]
    pub fn sample_mixture(&self, u: [f64; 2]) -> Direction {
        let mut rest = if u[0] > 0.0 { u[0].min(1.0) } else { 0.0 };
        let (last, others) = self.sources.split_last().expect("there is at least one source");
        for (weight, source) in others {
            if rest < *weight {
                return source.sample([rest / weight, u[1]]);
            }
            rest -= weight;
        }
        last.1.sample([(rest / last.0).min(1.0), u[1]])
    }
}
