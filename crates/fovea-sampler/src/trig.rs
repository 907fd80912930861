//! Sine and cosine in f32 that do not depend on a platform's: Vulkan's may be off by 2^-11, 0.03 degrees.

/// `sin(2 pi r) / r` in `r^2`, for `|r| <= 1/8`: minimax in the relative error (see the test that recomputes it).
pub(crate) const SIN_TURN: [f32; 4] = [core::f32::consts::TAU, -41.341_63, 81.594_37, -74.558_45];
/// `cos(2 pi r)` in `r^2`, for `|r| <= 1/8`.
pub(crate) const COS_TURN: [f32; 5] = [1.0, -19.739_21, 64.939_17, -85.440_51, 58.810_4];
/// `sin(h) / h` in `h^2`, for `0 <= h <= pi/2`.
pub(crate) const SIN_HALF: [f32; 6] = [1.0, -0.166_666_67, 0.008_333_33, -0.000_198_407_8, 2.752_397e-6, -2.384e-8];

/// Horner's rule, highest power first, with a multiplication and an addition that round separately.
pub(crate) fn horner(coefficients: &[f32], x: f32) -> f32 {
    let mut reversed = coefficients.iter().rev();
    let highest = reversed.next().copied().unwrap_or(0.0);
    reversed.fold(highest, |sum, &c| sum * x + c)
}

/// `[cos, sin]` of `2 pi turns` for `turns` in `[0, 1]`, absolute error below 1.2e-7.
///
/// The reduction to `[-1/8, 1/8]` turns is exact.
#[must_use]
pub fn cos_sin_turn(turns: f32) -> [f32; 2] {
    let quarter = (4.0 * turns + 0.5).floor();
    let r = turns - 0.25 * quarter;
    let r2 = r * r;
    let s = r * horner(&SIN_TURN, r2);
    let c = horner(&COS_TURN, r2);
    match quarter as i32 & 3 {
        0 => [c, s],
        1 => [-s, c],
        2 => [-c, -s],
        _ => [s, -c],
    }
}

/// `1 - cos(e)` for `e` in `[0, pi]`, relative error below 3e-7.
#[must_use]
pub fn versine(e: f32) -> f32 {
    let half = 0.5 * e;
    let sine = half * horner(&SIN_HALF, half * half);
    2.0 * sine * sine
}
