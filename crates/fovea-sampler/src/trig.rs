//! Sine and cosine in f32 that do not depend on a platform's: Vulkan's may be off by 2^-11, 0.03 degrees.

/// `sin(2 pi r) / r` in `r^2`, for `|r| <= 1/8`: minimax in the relative error (see the test that recomputes it).
pub(crate) const SIN_TURN: [f32; 4] = [core::f32::consts::TAU, -41.341_663, 81.592_354, -75.393_56];
/// `cos(2 pi r)` in `r^2`, for `|r| <= 1/8`.
pub(crate) const COS_TURN: [f32; 5] = [1.0, -19.739_208, 64.939_31, -85.442_3, 59.202_797];
/// `sin(h) / h` in `h^2`, for `0 <= h <= pi/2`.
pub(crate) const SIN_HALF: [f32; 6] =
    [1.0, -0.166_666_67, 0.008_333_331, -0.000_198_408_32, 2.752_397_2e-6, -2.386_834_7e-8];

/// Horner's rule, highest power first, with a multiplication and an addition that round separately.
///
/// The usual lengths are written out: a loop over a length that is known only at run time costs twice as much.
#[inline]
pub(crate) fn horner(coefficients: &[f32], x: f32) -> f32 {
    match *coefficients {
        [c0] => c0,
        [c0, c1, c2, c3] => ((c3 * x + c2) * x + c1) * x + c0,
        [c0, c1, c2, c3, c4] => (((c4 * x + c3) * x + c2) * x + c1) * x + c0,
        [c0, c1, c2, c3, c4, c5] => ((((c5 * x + c4) * x + c3) * x + c2) * x + c1) * x + c0,
        [c0, c1, c2, c3, c4, c5, c6] => (((((c6 * x + c5) * x + c4) * x + c3) * x + c2) * x + c1) * x + c0,
        _ => {
            let mut reversed = coefficients.iter().rev();
            let highest = reversed.next().copied().unwrap_or(0.0);
            reversed.fold(highest, |sum, &c| sum * x + c)
        }
    }
}

/// `[cos, sin]` of `2 pi turns` for `turns` in `[0, 1]`, absolute error below 1.2e-7; outside, it is unspecified.
///
/// The reduction to `[-1/8, 1/8]` turns is exact.
#[inline]
#[must_use]
pub fn cos_sin_turn(turns: f32) -> [f32; 2] {
    // Truncation is floor here, and needs no call of the C library.
    let quarter = (4.0 * turns + 0.5) as i32;
    let r = turns - 0.25 * quarter as f32;
    let r2 = r * r;
    let s = r * horner(&SIN_TURN, r2);
    let c = horner(&COS_TURN, r2);
    let (c, s) = if quarter & 1 == 1 { (-s, c) } else { (c, s) };
    // The sign bit is flipped by half turns: no branch to mispredict.
    let sign = ((quarter as u32) & 2) << 30;
    [f32::from_bits(c.to_bits() ^ sign), f32::from_bits(s.to_bits() ^ sign)]
}

/// `1 - cos(e)` for `e` in `[0, pi]`, relative error below 4e-7.
#[inline]
#[must_use]
pub fn versine(e: f32) -> f32 {
    let half = 0.5 * e;
    let sine = half * horner(&SIN_HALF, half * half);
    2.0 * sine * sine
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Problem, minimax};
    use core::f64::consts::{FRAC_PI_2, TAU};

    /// Recomputes the coefficients: minimax in the relative error.
    fn recomputed() -> [Vec<f32>; 3] {
        let fit = |hi: f64, degree: usize, f: &dyn Fn(f64) -> f64| {
            let problem = Problem::new(0.0, hi, |y| (f(y), 1.0 / f(y)));
            let fit = minimax(&problem, degree, 0).expect("a smooth target");
            fit.numerator.iter().map(|c| *c as f32).collect::<Vec<f32>>()
        };
        let sinc = |k: f64| move |y: f64| if y < 1e-20 { k } else { (k * y.sqrt()).sin() / y.sqrt() };
        [
            fit(1.0 / 64.0, SIN_TURN.len() - 1, &sinc(TAU)),
            fit(1.0 / 64.0, COS_TURN.len() - 1, &|y| (TAU * y.sqrt()).cos()),
            fit(FRAC_PI_2 * FRAC_PI_2, SIN_HALF.len() - 1, &sinc(1.0)),
        ]
    }

    #[test]
    fn coefficients_are_the_minimax_ones() {
        let expected = [&SIN_TURN[..], &COS_TURN[..], &SIN_HALF[..]];
        for (found, expected) in recomputed().iter().zip(expected) {
            for (f, e) in found.iter().zip(expected) {
                // A platform's own sine may move the last digits.
                assert!((f / e - 1.0).abs() < 1e-6, "{found:?} against {expected:?}");
            }
        }
    }

    #[test]
    fn cosine_and_sine_are_accurate_and_exact_at_the_quarters() {
        let mut worst = 0.0_f64;
        for k in 0..=1 << 21 {
            let turns = k as f32 / (1 << 21) as f32;
            let [c, s] = cos_sin_turn(turns).map(f64::from);
            let (sin, cos) = (TAU * f64::from(turns)).sin_cos();
            worst = worst.max((c - cos).abs()).max((s - sin).abs());
        }
        assert!(worst < 1.2e-7, "{worst:e}");
        for (quarter, expected) in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]].iter().enumerate() {
            assert_eq!(&cos_sin_turn(quarter as f32 / 4.0), expected);
        }
    }

    #[test]
    fn versine_is_relatively_accurate() {
        for k in 1..=1 << 20 {
            let e = k as f32 / (1 << 20) as f32 * core::f32::consts::PI;
            let exact = crate::Angle::from_radians(f64::from(e)).versine();
            let error = (f64::from(versine(e)) / exact - 1.0).abs();
            assert!(error < 4e-7, "{e}: {error:e}");
        }
        assert!((versine(1e-10) / 5e-21 - 1.0).abs() < 3e-7);
    }
}
