//! Evaluation of many numbers at once: the form is chosen once for [`LANES`] of them, and the loops vectorise. Every value is
//! bit for bit that of [`Piece::eval`].

use super::form::{Argument, Core, Outer, Piece};
use crate::trig::horner;

/// Numbers evaluated together: enough to hide the choice of the form, few enough for the first-level cache.
pub(crate) const LANES: usize = 64;

/// One value a lane.
pub(crate) type Lanes = [f32; LANES];

/// `f` of every lane.
#[inline]
pub(crate) fn map(x: &Lanes, f: impl Fn(f32) -> f32) -> Lanes {
    let mut y = [0.0; LANES];
    for (y, x) in y.iter_mut().zip(x) {
        *y = f(*x);
    }
    y
}

/// `f` of every pair of lanes.
#[inline]
pub(crate) fn map2(a: &Lanes, b: &Lanes, f: impl Fn(f32, f32) -> f32) -> Lanes {
    let mut y = [0.0; LANES];
    for (y, (a, b)) in y.iter_mut().zip(a.iter().zip(b)) {
        *y = f(*a, *b);
    }
    y
}

#[inline]
fn polynomial<const N: usize>(coefficients: &[f32], t: &Lanes) -> Lanes {
    match <&[f32; N]>::try_from(coefficients) {
        Ok(coefficients) => map(t, |t| horner(coefficients, t)),
        Err(_) => map(t, |t| horner(coefficients, t)),
    }
}

/// A length that the compiler knows lets it keep the coefficients in registers.
fn horner_lanes(coefficients: &[f32], t: &Lanes) -> Lanes {
    match coefficients.len() {
        1 => polynomial::<1>(coefficients, t),
        2 => polynomial::<2>(coefficients, t),
        3 => polynomial::<3>(coefficients, t),
        4 => polynomial::<4>(coefficients, t),
        5 => polynomial::<5>(coefficients, t),
        6 => polynomial::<6>(coefficients, t),
        7 => polynomial::<7>(coefficients, t),
        8 => polynomial::<8>(coefficients, t),
        9 => polynomial::<9>(coefficients, t),
        _ => map(t, |t| horner(coefficients, t)),
    }
}

impl Piece {
    /// [`Piece::eval`] of every lane.
    pub(crate) fn eval_lanes(&self, u: &Lanes) -> Lanes {
        let argument = match self.argument {
            Argument::U => *u,
            Argument::SqrtU => map(u, f32::sqrt),
        };
        let t = map(&argument, |x| x - self.origin);
        let c = match &self.core {
            Core::Polynomial(coefficients) => horner_lanes(coefficients, &t),
            Core::Rational { numerator, denominator } => {
                map2(&horner_lanes(numerator, &t), &horner_lanes(denominator, &t), |p, q| p / q)
            }
            Core::Table { .. } => map(&t, |t| self.core.eval(t)),
        };
        match self.outer {
            Outer::Identity => c,
            Outer::Square => map(&c, |c| c * c),
            Outer::Sqrt => map(&c, |c| c.max(0.0).sqrt()),
            Outer::TimesU => map2(&c, u, |c, u| c * u),
            Outer::TimesSqrtU => map2(&c, u, |c, u| c * u.sqrt()),
        }
    }
}
