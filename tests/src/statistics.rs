//! The statistics that the tests decide by. All p-values are exact for the distribution named, to about 1e-10.

/// Natural logarithm of the gamma function for x > 0 (Lanczos' approximation, g = 7, 9 terms; relative error 1e-15).
fn ln_gamma(x: f64) -> f64 {
    const TERMS: [f64; 8] = [
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let z = x - 1.0;
    let series: f64 = TERMS.iter().zip(1..).map(|(c, k)| c / (z + f64::from(k))).sum();
    let t = z + 7.5;
    0.5 * std::f64::consts::TAU.ln() + (z + 0.5) * t.ln() - t + (0.999_999_999_999_809_9 + series).ln()
}

/// Regularised upper incomplete gamma function Q(a, x).
fn gamma_q(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        // Series of the lower function.
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-17 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    // Continued fraction 1 / (x + 1 - a - 1 (1 - a) / (x + 3 - a - ...)), by Lentz.
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for i in 1..10_000 {
        let an = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

/// Regularised incomplete beta function I_x(a, b).
fn beta_i(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_i(b, a, 1.0 - x);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (1.0 - x).ln()).exp() / a;
    let (mut c, mut d) = (1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for i in 1..10_000 {
        let m = f64::from(i);
        for numerator in [
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        ] {
            d = 1.0 / (1.0 + numerator * d);
            c = 1.0 + numerator / c;
            fraction *= c * d;
        }
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

/// Probability that chi-squared with `freedom` degrees of freedom exceeds `statistic`.
pub fn chi_squared_p(statistic: f64, freedom: usize) -> f64 {
    gamma_q(0.5 * freedom as f64, 0.5 * statistic)
}

/// Two-sided p-value of Student's t with `freedom` degrees of freedom.
pub fn student_p(t: f64, freedom: f64) -> f64 {
    beta_i(0.5 * freedom, 0.5, freedom / (freedom + t * t))
}

/// Šidák's correction: the significance of each of `tests` independent tests whose family has significance `family`.
pub fn sidak(family: f64, tests: usize) -> f64 {
    // 1 - (1 - family)^(1 / tests) without the cancellation.
    -((-family).ln_1p() / tests.max(1) as f64).exp_m1()
}

/// Mean and standard error of the mean, from the spread of at least two values.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (mean, (squares / (n - 1.0) / n).sqrt())
}

/// Two-sided p-value of Welch's test that two sets of independent values have one mean.
///
/// Equal constants agree; different ones do not.
pub fn welch_p(a: &[f64], b: &[f64]) -> f64 {
    let ((mean_a, error_a), (mean_b, error_b)) = (mean_and_error(a), mean_and_error(b));
    let (var_a, var_b) = (error_a * error_a, error_b * error_b);
    if var_a + var_b <= 0.0 {
        return if mean_a == mean_b { 1.0 } else { 0.0 };
    }
    let degrees = |n: usize| n as f64 - 1.0;
    let freedom = (var_a + var_b).powi(2) / (var_a * var_a / degrees(a.len()) + var_b * var_b / degrees(b.len()));
    student_p((mean_a - mean_b) / (var_a + var_b).sqrt(), freedom)
}

/// Pearson's test of observed counts against expected ones. Bins are merged in order until each expects at least 10.
/// Returns the p-value, the statistic and the degrees of freedom.
///
/// # Panics
/// When the expected counts do not allow two bins.
pub fn chi_squared_test(observed: &[f64], expected: &[f64]) -> (f64, f64, usize) {
    let mut bins: Vec<(f64, f64)> = Vec::new();
    let mut open = (0.0, 0.0);
    for (o, e) in observed.iter().zip(expected) {
        open = (open.0 + o, open.1 + e);
        if open.1 >= 10.0 {
            bins.push(open);
            open = (0.0, 0.0);
        }
    }
    if let Some(last) = bins.last_mut() {
        *last = (last.0 + open.0, last.1 + open.1);
    }
    assert!(bins.len() >= 2, "too few expected counts for a test");
    let statistic: f64 = bins.iter().map(|(o, e)| (o - e) * (o - e) / e).sum();
    // The counts sum to the number of samples: one degree less.
    let freedom = bins.len() - 1;
    (chi_squared_p(statistic, freedom), statistic, freedom)
}

/// The middle value (the upper of the two middle ones).
///
/// # Panics
/// On an empty slice.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-9 * b.abs(), "{a} is not {b}");
    }

    #[test]
    fn p_values_are_those_of_closed_forms() {
        // Two degrees of freedom: exp(-x/2). Four: exp(-x/2) (1 + x/2).
        for x in [0.1, 1.0, 5.0, 40.0] {
            close(chi_squared_p(x, 2), (-0.5 * x).exp());
            close(chi_squared_p(x, 4), (-0.5 * x).exp() * (1.0 + 0.5 * x));
        }
        // One degree: 1 - 2 atan(t) / pi. Two: 1 - t / sqrt(2 + t^2).
        for t in [0.1f64, 1.0, 3.0, 20.0] {
            close(student_p(t, 1.0), 1.0 - 2.0 * t.atan() / std::f64::consts::PI);
            close(student_p(t, 2.0), 1.0 - t / (2.0 + t * t).sqrt());
        }
        // 1.96 standard deviations.
        assert!((chi_squared_p(3.841_458_820_694_124, 1) - 0.05).abs() < 1e-12);
        assert!((chi_squared_p(124.342_113_404_004_07, 100) - 0.05).abs() < 1e-9);
        close(1.0 - (1.0 - sidak(0.01, 500)).powi(500), 0.01);
    }
}
