//! The special functions of the closed forms, in f64.

/// `W0(-exp(-(1 + delta)))` for `delta >= 0`: the principal branch of Lambert's W on `[-1/e, 0)`.
///
/// # Formula
/// With `L = -ln(-W)`, `W exp(W) = -exp(-(1 + delta))` reads `L + exp(-L) - 1 = delta`, `L >= 0`. The left side is convex
/// and increasing, so Newton's iteration from the right of the root falls monotonically onto it.
///
/// # Numerics
/// Asking for `delta` instead of `x = -exp(-(1 + delta))` keeps the branch point `x = -1/e` (where `dW/dx` diverges) well
/// conditioned: there `L ~ sqrt(2 delta)`, and the series of the left side has no cancellation. Relative error below 1e-15.
///
/// # Domain
/// A negative or NaN `delta` gives the branch point's value, -1.
///
/// # Reference
/// R. M. Corless et al., *On the Lambert W function*, Adv. Comput. Math. 5 (1996).
#[must_use]
pub fn lambert_w0_of_neg_exp(delta: f64) -> f64 {
    -(-log_plus_reciprocal_inverse(delta)).exp()
}

/// The `L >= 0` with `L + exp(-L) - 1 = delta`, that is `ln w + 1/w - 1 = delta` with `w = exp(L) >= 1`.
#[must_use]
pub(crate) fn log_plus_reciprocal_inverse(delta: f64) -> f64 {
    // `!(>)` also catches NaN.
    if delta.is_nan() || delta <= 0.0 {
        return 0.0;
    }
    let mut log_w = (1.0 + delta).min((2.0 * delta).sqrt() + delta);
    for _ in 0..64 {
        let step = (log_plus_reciprocal(log_w) - delta) / -(-log_w).exp_m1();
        log_w -= step;
        if step.abs() <= 2e-16 * log_w {
            break;
        }
    }
    log_w
}

/// `L + exp(-L) - 1`, without cancellation near `L = 0`.
pub(crate) fn log_plus_reciprocal(log_w: f64) -> f64 {
    if log_w.abs() > 0.5 {
        return log_w + (-log_w).exp_m1();
    }
    // sum of (-1)^n L^n / n! from n = 2
    let mut term = 0.5 * log_w * log_w;
    let mut sum = 0.0;
    for n in 3..20 {
        sum += term;
        term *= -log_w / f64::from(n);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn satisfies_its_equation_from_the_branch_point_to_the_asymptote() {
        for exponent in -300..=4 {
            let delta = 10f64.powf(f64::from(exponent) / 2.0);
            let log_w = log_plus_reciprocal_inverse(delta);
            assert!((log_plus_reciprocal(log_w) / delta - 1.0).abs() < 1e-14, "delta {delta}: L {log_w}");
        }
    }

    #[test]
    fn known_values() {
        // W0(-1/e) = -1; W0(-exp(-2)) = -0.158594339563039...
        assert_eq!(lambert_w0_of_neg_exp(0.0), -1.0);
        assert!((lambert_w0_of_neg_exp(1.0) + 0.158_594_339_563_039_36).abs() < 1e-15);
        assert_eq!(lambert_w0_of_neg_exp(f64::NAN), -1.0);
    }
}
