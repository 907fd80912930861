//! Sampling by visual acuity: densities, exact and fitted inverses with certified error, warps and layers for foveated
//! rendering.

#![forbid(unsafe_code)]

mod angle;
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
pub use warp::{GazeWarp, WarpSample};
