//! Reddy's fit to the contrast sensitivity data, and its square.

use super::AcuityModel;
use crate::special::log_plus_reciprocal_inverse;
use crate::{Angle, Eccentricity};

/// Radius of the plateau, in degrees.
const FOVEA_DEG: f64 = 5.79;
/// Numerator beyond the plateau.
const FALL_OFF: f64 = 7.49;
/// Growth of the minimum angle of resolution, per degree.
const SLOPE_PER_DEG: f64 = 0.3;

/// Reddy's relative acuity, the model of Koskela et al. 2017 and this crate's default.
///
/// # Definition
/// `m(e) = 1` for `e <= 5.79` degrees, `7.49 / (0.3 e + 1)^2` beyond, `e` in degrees.
///
/// The two pieces do not quite meet: `m` falls by 1.56e-4 at 5.79 degrees (it is continuous at 5.78928812). The constants
/// are kept as printed.
///
/// # Domain
/// The data behind the fit reach about 80 degrees, the paper's cap; beyond, the formula extrapolates.
///
/// # Reference
/// M. Reddy, *Perceptually optimized 3D graphics*, IEEE Computer Graphics and Applications 21(5), 2001;
/// M. Koskela et al., *Foveated Instant Preview for Progressive Rendering*, SIGGRAPH Asia 2017 Technical Briefs, Eq. 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reddy2001;

/// Reddy's acuity at `e` in degrees.
fn acuity_at(e_deg: f64) -> f64 {
    if e_deg <= FOVEA_DEG {
        1.0
    } else {
        let w = SLOPE_PER_DEG * e_deg + 1.0;
        FALL_OFF / (w * w)
    }
}

impl AcuityModel for Reddy2001 {
    fn name(&self) -> &str {
        "reddy"
    }

    fn citation(&self) -> &str {
        "M. Reddy, IEEE CG&A 21(5), 2001; as in M. Koskela et al., SIGGRAPH Asia 2017 TB, Eq. 1; 0 to 80 degrees"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        acuity_at(e.degrees())
    }

    fn breakpoints(&self) -> Vec<Eccentricity> {
        vec![Angle::from_degrees(FOVEA_DEG)]
    }

    /// Lambert's W: beyond the fovea the mass is `K (1/w + ln w) + C` with `w = 0.3 e + 1`.
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        use core::f64::consts::PI;
        let fovea_mass = PI * FOVEA_DEG * FOVEA_DEG;
        if mass_square_degrees <= fovea_mass {
            return Some(Angle::from_degrees((mass_square_degrees / PI).sqrt()));
        }
        let k = 2.0 * PI * FALL_OFF / (SLOPE_PER_DEG * SLOPE_PER_DEG);
        let joint = SLOPE_PER_DEG * FOVEA_DEG + 1.0;
        let delta = (joint.ln() + 1.0 / joint - 1.0) + (mass_square_degrees - fovea_mass) / k;
        let log_w = log_plus_reciprocal_inverse(delta);
        Some(Angle::from_degrees(log_w.exp_m1() / SLOPE_PER_DEG))
    }
}

/// The square of [`Reddy2001`]: Reddy's acuity is a highest spatial frequency along a line, and the number of samples that
/// a plane needs grows with its square.
///
/// # Definition
/// `m(e)^2`, with `m` of [`Reddy2001`].
///
/// # Reference
/// As [`Reddy2001`]; the Nyquist density of a two-dimensional signal is the square of its one-dimensional band limit.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReddySquared;

impl AcuityModel for ReddySquared {
    fn name(&self) -> &str {
        "reddy-squared"
    }

    fn citation(&self) -> &str {
        "square of M. Reddy, IEEE CG&A 21(5), 2001 (two-dimensional Nyquist density); 0 to 80 degrees"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        acuity_at(e.degrees()).powi(2)
    }

    fn breakpoints(&self) -> Vec<Eccentricity> {
        vec![Angle::from_degrees(FOVEA_DEG)]
    }

    /// Elementary: with `y = 1/w` the mass beyond the fovea is a cubic in `y`, `K (y^3/3 - y^2/2)` up to a constant, whose
    /// middle root is `1/2 - sin(asin(1 - 2 x)/3)`.
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        use core::f64::consts::PI;
        let fovea_mass = PI * FOVEA_DEG * FOVEA_DEG;
        if mass_square_degrees <= fovea_mass {
            return Some(Angle::from_degrees((mass_square_degrees / PI).sqrt()));
        }
        let k = 2.0 * PI * (FALL_OFF / SLOPE_PER_DEG).powi(2);
        let joint = 1.0 / (SLOPE_PER_DEG * FOVEA_DEG + 1.0);
        // x = 3 y^2 - 2 y^3, the smoothstep of y.
        let x = joint * joint * (3.0 - 2.0 * joint) - 6.0 * (mass_square_degrees - fovea_mass) / k;
        let y = 0.5 - ((1.0 - 2.0 * x.clamp(0.0, 1.0)).asin() / 3.0).sin();
        Some(Angle::from_degrees((1.0 / y - 1.0) / SLOPE_PER_DEG))
    }
}
