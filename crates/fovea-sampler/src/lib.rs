//! Sampling by visual acuity: densities, exact and fitted inverses with certified error, warps and layers for foveated
//! rendering.
//!
//! A foveated renderer draws directions about the gaze with a density that falls as acuity does. This crate turns an acuity
//! model into that density, its CDF and an inverse that a shader can evaluate, and says how accurate each is.
//!
//! ```
//! use fovea_sampler::{Angle, GazeWarp, Geometry, RadialDistribution, Reddy2001, wgsl};
//!
//! // Reddy's acuity per solid angle to 80 degrees; beyond, a floor of 0.002 of the gaze's density.
//! let distribution = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
//! let warp = GazeWarp::new(distribution);
//! let gaze = [0.0, 0.0, -1.0];
//!
//! let sample = warp.sample([0.5, 0.25], gaze);
//! let [u, _] = warp.invert(sample.direction, gaze);
//! assert!((u - 0.5).abs() < 1e-12);
//! assert!(warp.inverse().bound().relative_e < 2e-5);
//!
//! // The same map for a shader, from the same coefficients.
//! let text = wgsl::radial_module(warp.inverse());
//! assert!(text.contains("fn warp_local(u: vec2<f32>) -> vec3<f32>"));
//! # Ok::<(), fovea_sampler::SamplerError>(())
//! ```
//!
//! # Concepts
//! - An [`AcuityModel`] gives relative acuity by eccentricity ([`model`] has the literature's).
//! - A [`RadialDistribution`] reads it as a density in a [`Geometry`], with a cap and a floor: `pdf`, `cdf`, `quantile` in f64,
//!   the oracle of everything else.
//! - An [`Inverse`] approximates the quantile by a [`Form`] in f32, with an [`ErrorBound`].
//! - A [`GazeWarp`] makes it two-dimensional: `sample`, `pdf`, `invert`; [`EyeScreen`] does so at the eye before a screen.
//! - [`layers`] mix and multiply such densities on a [`Film`]; [`sequence`] supplies the numbers; [`wgsl`] the shader.
//! - [`docs::paper_error`] examines the error claim of the paper that this method comes from.
//!
//! # Conventions
//! Angles are [`Angle`] or radians; eccentricity is the angle at the eye to the line of sight, 0 to 180 degrees. Densities
//! are per steradian. Frames are right-handed, +Y up, and a film's centre is -Z. `v` is `1 - cos e`, in which solid angle is
//! linear.
//!
//! # Non-goals
//! No rendering, no device, no clock: costs are measured elsewhere and handed to [`report`].

#![forbid(unsafe_code)]

mod angle;
pub mod docs;
mod error;
mod eye;
mod film;
mod fit;
mod frame;
mod inverse;
pub mod layers;
pub mod model;
mod quadrature;
mod radial;
pub mod report;
pub mod sequence;
pub mod special;
pub mod trig;
mod truth;
mod warp;
pub mod wgsl;

pub use angle::{Angle, Eccentricity};
pub use error::SamplerError;
pub use eye::{EyeSample, EyeScreen};
pub use film::Film;
pub use frame::{Direction, gaze_frame, gaze_frame_f32};
pub use inverse::{ErrorBound, ErrorReport, Form, Inverse, MaxRelativeError};
pub use model::{
    AcuityModel, GeislerPerry1998, LinearFalloff, LinearMar, Reddy2001, ReddySquared, StaticDisc, TabulatedAcuity,
};
pub use radial::{Geometry, RadialDistribution};
pub use warp::{GazeWarp, WarpSample, uniform_disc_batch};

/// Compiles the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExample;
