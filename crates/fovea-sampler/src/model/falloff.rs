//! Piecewise linear fall-off and the static disc.

use super::{AcuityModel, check};
use crate::{Angle, Eccentricity, SamplerError};

/// Full density within `r0`, falling linearly to `p_min` at `r1`, `p_min` beyond.
///
/// # Reference
/// K. Vaidyanathan et al., *Coarse Pixel Shading*, HPG 2014; M. Stengel et al., *Adaptive Image-Space Sampling for
/// Gaze-Contingent Real-time Rendering*, CGF 35(4), 2016; M. Weier et al., *Foveated Real-Time Ray Tracing for
/// Head-Mounted Displays*, CGF 35(7), 2016. The authors' constants differ, so they are parameters here;
/// [`Self::DEFAULT`] lies within their range and is this crate's choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearFalloff {
    r0_deg: f64,
    r1_deg: f64,
    p_min: f64,
}

impl LinearFalloff {
    /// Full density to 10 degrees, 5 % from 30 degrees on.
    pub const DEFAULT: Self = Self { r0_deg: 10.0, r1_deg: 30.0, p_min: 0.05 };

    /// From the two radii and the least relative density.
    ///
    /// # Errors
    /// Unless `0 <= r0 < r1 <= 180` degrees and `0 < p_min <= 1`.
    pub fn new(r0: Angle, r1: Angle, p_min: f64) -> Result<Self, SamplerError> {
        const NAME: &str = "linear-falloff";
        let (r0_deg, r1_deg) = (r0.degrees(), r1.degrees());
        check(NAME, "r0 in degrees", r0_deg, "in [0, 180)", |x| (0.0..180.0).contains(&x))?;
        check(NAME, "r1 in degrees", r1_deg, "above r0 and at most 180", |x| x > r0_deg && x <= 180.0)?;
        check(NAME, "p_min", p_min, "in (0, 1]", |x| x > 0.0 && x <= 1.0)?;
        Ok(Self { r0_deg, r1_deg, p_min })
    }
}

impl AcuityModel for LinearFalloff {
    fn name(&self) -> &str {
        "linear-falloff"
    }

    fn citation(&self) -> &str {
        "K. Vaidyanathan et al., HPG 2014; M. Stengel et al., CGF 35(4), 2016; M. Weier et al., CGF 35(7), 2016"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        let e_deg = e.degrees();
        if e_deg <= self.r0_deg {
            1.0
        } else if e_deg >= self.r1_deg {
            self.p_min
        } else {
            1.0 - (1.0 - self.p_min) * (e_deg - self.r0_deg) / (self.r1_deg - self.r0_deg)
        }
    }

    fn breakpoints(&self) -> Vec<Eccentricity> {
        vec![Angle::from_degrees(self.r0_deg), Angle::from_degrees(self.r1_deg)]
    }

    /// A quadratic in the plateaus and, between them, the middle root of a cubic by the trigonometric formula.
    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        use core::f64::consts::PI;
        let (r0, r1, p_min) = (self.r0_deg, self.r1_deg, self.p_min);
        let inner = PI * r0 * r0;
        if mass_square_degrees <= inner {
            return Some(Angle::from_degrees((mass_square_degrees / PI).sqrt()));
        }
        // Between the plateaus the density is b - s e, so the mass is pi b e^2 - 2/3 pi s e^3 up to a constant.
        let s = (1.0 - p_min) / (r1 - r0);
        let b = 1.0 + s * r0;
        let ramp = |e: f64| PI * e * e * (b - 2.0 / 3.0 * s * e);
        let outer = inner + (ramp(r1) - ramp(r0));
        if s == 0.0 || mass_square_degrees >= outer {
            let (mass, start) = if s == 0.0 { (inner, r0) } else { (outer, r1) };
            return Some(Angle::from_degrees((start * start + (mass_square_degrees - mass) / (PI * p_min)).sqrt()));
        }
        // With e = (b/s) y the cubic is the smoothstep 3 y^2 - 2 y^3 = x.
        let x = 3.0 * s * s / (PI * b * b * b) * (mass_square_degrees - inner + ramp(r0));
        let y = 0.5 - ((1.0 - 2.0 * x.clamp(0.0, 1.0)).asin() / 3.0).sin();
        Some(Angle::from_degrees(b / s * y))
    }
}

/// Full density within a disc, none outside: the simplest foveation.
///
/// # Reference
/// D. Pohl, X. Zhang, A. Bulling, *Combining Eye Tracking with Optimizations for Lens Astigmatism in Modern Wide-Angle
/// HMDs*, IEEE VR 2016.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticDisc {
    radius_deg: f64,
}

impl StaticDisc {
    /// A radius of 30 degrees.
    pub const DEFAULT: Self = Self { radius_deg: 30.0 };

    /// From the radius.
    ///
    /// # Errors
    /// Unless the radius lies in (0, 180] degrees.
    pub fn new(radius: Angle) -> Result<Self, SamplerError> {
        let radius_deg = radius.degrees();
        check("static-disc", "radius in degrees", radius_deg, "in (0, 180]", |x| x > 0.0 && x <= 180.0)?;
        Ok(Self { radius_deg })
    }
}

impl AcuityModel for StaticDisc {
    fn name(&self) -> &str {
        "static-disc"
    }

    fn citation(&self) -> &str {
        "D. Pohl, X. Zhang, A. Bulling, IEEE VR 2016"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        f64::from(u8::from(e.degrees() <= self.radius_deg))
    }

    fn breakpoints(&self) -> Vec<Eccentricity> {
        vec![self.support()]
    }

    fn support(&self) -> Eccentricity {
        Angle::from_degrees(self.radius_deg)
    }

    fn planar_mass_inverse(&self, mass_square_degrees: f64) -> Option<Eccentricity> {
        Some(Angle::from_degrees((mass_square_degrees / core::f64::consts::PI).sqrt()))
    }
}
