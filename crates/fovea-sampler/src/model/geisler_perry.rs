//! The contrast-threshold model of Geisler and Perry.

use super::{AcuityModel, check};
use crate::special::log_plus_reciprocal;
use crate::{Angle, Eccentricity, SamplerError};

/// The highest visible spatial frequency by a contrast-threshold model.
///
/// # Definition
/// `f_c(e) = e2 ln(1/CT0) / (alpha (e + e2))` cycles per degree; the relative acuity is `f_c(e) / f_c(0) = e2 / (e + e2)`.
/// `alpha` and `CT0` cancel in the density; [`Self::cutoff_cycles_per_degree`] needs them.
///
/// # Domain
/// `e2` was fitted to several studies' data, which reach about 70 degrees.
///
/// # Reference
/// W. S. Geisler, J. S. Perry, *A real-time foveated multiresolution system for low-bandwidth video communication*,
/// Proc. SPIE 3299, 1998: `alpha = 0.106`, `e2 = 2.3` degrees, `CT0 = 1/64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeislerPerry1998 {
    e2_deg: f64,
    alpha: f64,
    ct0: f64,
}

impl GeislerPerry1998 {
    /// The publication's constants.
    pub const DEFAULT: Self = Self { e2_deg: 2.3, alpha: 0.106, ct0: 1.0 / 64.0 };

    /// From the half-resolution eccentricity, the spatial decay constant `alpha` and the least contrast threshold `ct0`.
    ///
    /// # Errors
    /// Unless `e2` and `alpha` are positive and `ct0` lies in (0, 1).
    pub fn new(e2: Angle, alpha: f64, ct0: f64) -> Result<Self, SamplerError> {
        const NAME: &str = "geisler-perry";
        let e2_deg = e2.degrees();
        check(NAME, "e2 in degrees", e2_deg, "at least 1e-4", |x| x >= 1e-4)?;
        check(NAME, "alpha", alpha, "positive", |x| x > 0.0)?;
        check(NAME, "ct0", ct0, "in (0, 1)", |x| x > 0.0 && x < 1.0)?;
        Ok(Self { e2_deg, alpha, ct0 })
    }

    /// The highest visible frequency at `e`, in cycles per degree.
    #[must_use]
    pub fn cutoff_cycles_per_degree(&self, e: Eccentricity) -> f64 {
        self.e2_deg * (1.0 / self.ct0).ln() / (self.alpha * (e.degrees() + self.e2_deg))
    }
}

impl AcuityModel for GeislerPerry1998 {
    fn name(&self) -> &str {
        "geisler-perry"
    }

    fn citation(&self) -> &str {
        "W. S. Geisler, J. S. Perry, Proc. SPIE 3299, 1998; data to about 70 degrees"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        self.e2_deg / (e.degrees() + self.e2_deg)
    }

    /// With `w = 1 + e/e2` the mass is `2 pi e2^2 (w - 1 - ln w)`: Lambert's W once more, on the branch `W_-1`, found here
    /// by Newton's iteration on `L = ln w` (`exp(L) - 1 - L` is the mirror image of the form on the principal branch).
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        let delta = mass_square_degrees / (core::f64::consts::TAU * self.e2_deg * self.e2_deg);
        if delta.is_nan() || delta <= 0.0 {
            return Some(Angle::ZERO);
        }
        // exp(L) - 1 - L is convex and increasing; sqrt(2 delta) and ln(1 + delta + sqrt(2 delta)) lie right of the root.
        let mut log_w = (2.0 * delta).sqrt().min((1.0 + delta + (2.0 * delta).sqrt()).ln());
        for _ in 0..64 {
            let step = (log_plus_reciprocal(-log_w) - delta) / log_w.exp_m1();
            log_w -= step;
            if step.abs() <= 2e-16 * log_w {
                break;
            }
        }
        Some(Angle::from_degrees(self.e2_deg * log_w.exp_m1()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cutoff_at_the_gaze_and_half_of_it_at_e2() {
        let model = GeislerPerry1998::DEFAULT;
        let at_gaze = model.cutoff_cycles_per_degree(Angle::ZERO);
        assert!((at_gaze - 39.234_746).abs() < 1e-6, "{at_gaze}");
        let at_e2 = model.cutoff_cycles_per_degree(Angle::from_degrees(2.3));
        assert!((at_e2 / at_gaze - 0.5).abs() < 1e-15);
    }
}
