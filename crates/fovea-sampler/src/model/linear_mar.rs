//! The linear minimum-angle-of-resolution model.

use super::{AcuityModel, check};
use crate::special::log_plus_reciprocal_inverse;
use crate::{Angle, Eccentricity, SamplerError};

/// Density by the linear minimum angle of resolution (MAR).
///
/// # Definition
/// `omega(e) = omega0 + slope e`; the density is `(omega0 / omega(e))^2 = (1 + k e)^-2`, `k = slope / omega0` per degree.
///
/// # Domain
/// The linear model fits measurements to about 30 degrees (Strasburger et al. 2011); beyond, it extrapolates.
///
/// # Reference
/// B. Guenter, M. Finch, S. Drucker, D. Tan, J. Snyder, *Foveated 3D Graphics*, ACM TOG 31(6), 2012: `omega0 = 1/48`
/// degree, slopes 0.022 (sharp) to 0.0275.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearMar {
    k_per_deg: f64,
}

impl LinearMar {
    /// Guenter et al. 2012, the more cautious slope: `k = 48 x 0.022 = 1.056` per degree.
    pub const GUENTER_2012: Self = Self { k_per_deg: 1.056 };

    /// From the MAR at the gaze in degrees and its growth per degree of eccentricity.
    ///
    /// # Errors
    /// If either is not a positive number, or their ratio exceeds 1e4 per degree.
    pub fn new(omega0_deg: f64, slope: f64) -> Result<Self, SamplerError> {
        check("linear-mar", "omega0 in degrees", omega0_deg, "positive", |x| x > 0.0)?;
        check("linear-mar", "slope", slope, "positive", |x| x > 0.0)?;
        let k_per_deg = slope / omega0_deg;
        check("linear-mar", "slope / omega0 per degree", k_per_deg, "at least 1e-6 and at most 1e4", |k| {
            (1e-6..=1e4).contains(&k)
        })?;
        Ok(Self { k_per_deg })
    }
}

impl AcuityModel for LinearMar {
    fn name(&self) -> &str {
        "linear-mar"
    }

    fn citation(&self) -> &str {
        "B. Guenter et al., ACM TOG 31(6), 2012; measured to about 30 degrees"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        (1.0 + self.k_per_deg * e.degrees()).powi(-2)
    }

    /// Lambert's W, whose branch point lies at the gaze: the mass is `2 pi / k^2 (ln w + 1/w - 1)`, `w = 1 + k e`.
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        let delta = mass_square_degrees * self.k_per_deg * self.k_per_deg / core::f64::consts::TAU;
        Some(Angle::from_degrees(log_plus_reciprocal_inverse(delta).exp_m1() / self.k_per_deg))
    }
}
