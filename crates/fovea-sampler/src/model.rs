//! Acuity models: relative acuity as a function of eccentricity.
//!
//! A model answers one question, [`AcuityModel::acuity`]; everything else (normalisation, CDF, inverse, fits, shader
//! text) is derived from it. To add a model, implement that method, name it, and list its kinks:
//!
//! ```
//! use fovea_sampler::{AcuityModel, Angle, Eccentricity, Geometry, RadialDistribution};
//!
//! #[derive(Debug)]
//! struct Gaussian;
//!
//! impl AcuityModel for Gaussian {
//!     fn name(&self) -> &str {
//!         "gaussian"
//!     }
//!     fn citation(&self) -> &str {
//!         "an example"
//!     }
//!     fn acuity(&self, e: Eccentricity) -> f64 {
//!         (-0.5 * (e.degrees() / 20.0).powi(2)).exp()
//!     }
//! }
//!
//! let distribution = RadialDistribution::new(Gaussian, Geometry::Sphere, Angle::from_degrees(80.0), 0.0)?;
//! assert!((distribution.cdf(distribution.quantile(0.25)) - 0.25).abs() < 1e-13);
//! # Ok::<(), fovea_sampler::SamplerError>(())
//! ```

mod falloff;
mod geisler_perry;
mod linear_mar;
mod reddy;
mod table;

pub use falloff::{LinearFalloff, StaticDisc};
pub use geisler_perry::GeislerPerry1998;
pub use linear_mar::LinearMar;
pub use reddy::{Reddy2001, ReddySquared};
pub use table::TabulatedAcuity;

use crate::{Angle, Eccentricity, SamplerError};

/// Acuity relative to its value at the gaze, as a function of eccentricity.
///
/// The density of samples is proportional to it: per solid angle on the sphere, per unit area of the azimuthal
/// equidistant plane in the paper's geometry ([`crate::Geometry`]).
pub trait AcuityModel: core::fmt::Debug + Send + Sync {
    /// Short lower-case name, as the command line and reports use it.
    fn name(&self) -> &str;

    /// The publication that the formula and its constants come from, and the range over which it was measured.
    fn citation(&self) -> &str;

    /// Relative acuity at `e`, in `[0, 1]`; any `e` in `[0, 180]` degrees must give a finite value that is not negative.
    fn acuity(&self, e: Eccentricity) -> f64;

    /// Where the acuity jumps or has a kink, ascending. Integration and fits are split there.
    fn breakpoints(&self) -> Vec<Eccentricity> {
        Vec::new()
    }

    /// Beyond this the acuity is zero.
    fn support(&self) -> Eccentricity {
        Angle::HALF_TURN
    }

    /// Closed form, where one exists, of the inverse of `M(e) = 2 pi * integral of x acuity(x) dx over [0, e]`, x in
    /// degrees: the plane's exact inverse.
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        let _ = mass_square_degrees;
        None
    }
}

impl AcuityModel for Box<dyn AcuityModel> {
    fn name(&self) -> &str {
        (**self).name()
    }
    fn citation(&self) -> &str {
        (**self).citation()
    }
    fn acuity(&self, e: Eccentricity) -> f64 {
        (**self).acuity(e)
    }
    fn breakpoints(&self) -> Vec<Eccentricity> {
        (**self).breakpoints()
    }
    fn support(&self) -> Eccentricity {
        (**self).support()
    }
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        (**self).planar_mass_inverse(mass_square_degrees)
    }
}

/// The built-in models with their usual constants, in the order in which reports list them.
#[must_use]
pub fn built_in() -> Vec<Box<dyn AcuityModel>> {
    vec![
        Box::new(Reddy2001),
        Box::new(ReddySquared),
        Box::new(LinearMar::GUENTER_2012),
        Box::new(LinearFalloff::DEFAULT),
        Box::new(StaticDisc::DEFAULT),
        Box::new(GeislerPerry1998::DEFAULT),
    ]
}

/// The built-in model of this name; `None` if there is none.
#[must_use]
pub fn by_name(name: &str) -> Option<Box<dyn AcuityModel>> {
    built_in().into_iter().find(|model| model.name() == name)
}

/// `Ok` if `value` is finite and satisfies `accept`.
fn check(
    model: &'static str,
    parameter: &'static str,
    value: f64,
    requirement: &'static str,
    accept: impl Fn(f64) -> bool,
) -> Result<(), SamplerError> {
    if value.is_finite() && accept(value) {
        Ok(())
    } else {
        Err(SamplerError::ModelParameter { model, parameter, value, requirement })
    }
}
