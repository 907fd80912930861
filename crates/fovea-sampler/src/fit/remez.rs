//! Remez' second algorithm on a fine Chebyshev grid, for polynomials and rationals with a weight.
//!
//! Reference: E. W. Cheney, *Introduction to Approximation Theory*, 1966, chapters 3 and 5.

use super::linear::solve;

/// What to fit: `target` and `weight` on `[lo, hi]`; the weighted error `(fit - target) weight` is made as small as it can be.
pub(crate) struct Problem {
    mid: f64,
    half: f64,
    /// Position in `[-1, 1]`, target, weight.
    grid: Vec<(f64, f64, f64)>,
}

/// A fitted rational (a polynomial if `denominator` is `[1]`), coefficients ascending, `denominator[0] == 1`.
#[derive(Clone, Debug)]
pub(crate) struct Minimax {
    pub(crate) numerator: Vec<f64>,
    pub(crate) denominator: Vec<f64>,
    /// Largest weighted error on the grid.
    pub(crate) error: f64,
}

/// Points of the grid. An extremum lies within 1e-3 of the interval of a point, where the error is within 1e-4 of it.
const GRID: usize = 1200;
const EXCHANGES: usize = 40;

impl Problem {
    /// Samples `target` and `weight` on `[lo, hi]`.
    pub(crate) fn new(lo: f64, hi: f64, mut target_and_weight: impl FnMut(f64) -> (f64, f64)) -> Self {
        let (mid, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        let point = |i: usize| {
            let t = -(core::f64::consts::PI * i as f64 / (GRID - 1) as f64).cos();
            let (target, weight) = target_and_weight((mid + half * t).clamp(lo, hi));
            (t, target, weight)
        };
        Self { mid, half, grid: (0..GRID).map(point).collect() }
    }
}

/// Fits numerator degree `n` over denominator degree `m`. `None` if the iteration breaks down (a pole, a singular system),
/// which happens when the target is simpler than the form.
pub(crate) fn minimax(problem: &Problem, n: usize, m: usize) -> Option<Minimax> {
    let unknowns = n + m + 2;
    let last = (GRID - 1) as f64;
    let mut reference: Vec<usize> =
        (0..unknowns).map(|i| (last * i as f64 / (unknowns - 1) as f64).round() as usize).collect();
    let mut level = 0.0;
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..EXCHANGES {
        let (coefficients, new_level) = level_on_reference(problem, &reference, n, m, level)?;
        level = new_level;
        let errors: Vec<f64> =
            problem.grid.iter().map(|&(t, f, w)| (evaluate(&coefficients, n, t).0 - f) * w).collect();
        if problem.grid.iter().any(|&(t, ..)| evaluate(&coefficients, n, t).1 <= 0.0) {
            return None;
        }
        let largest = errors.iter().fold(0.0, |a: f64, e| a.max(e.abs()));
        if best.as_ref().is_none_or(|(error, _)| largest < *error) {
            best = Some((largest, coefficients));
        }
        if largest <= level.abs() * (1.0 + 1e-5) {
            break;
        }
        match exchange(&errors, unknowns) {
            Some(next) if next != reference => reference = next,
            _ => break,
        }
    }
    let (error, coefficients) = best?;
    let numerator = to_monomials(&coefficients[..=n], problem);
    let mut chebyshev_q = vec![1.0];
    chebyshev_q.extend_from_slice(&coefficients[n + 1..]);
    let denominator = to_monomials(&chebyshev_q, problem);
    let scale = 1.0 / denominator[0];
    let scaled = |c: Vec<f64>| c.into_iter().map(|x| x * scale).collect::<Vec<f64>>();
    let fit = Minimax { numerator: scaled(numerator), denominator: scaled(denominator), error };
    fit.numerator.iter().chain(&fit.denominator).all(|x| x.is_finite()).then_some(fit)
}

/// The coefficients (numerator's `n + 1`, then the denominator's without its leading 1; Chebyshev basis) and the level that
/// alternates on the reference. For a rational the equations are bilinear in level and denominator: fixed-point iteration.
fn level_on_reference(
    problem: &Problem,
    reference: &[usize],
    n: usize,
    m: usize,
    level: f64,
) -> Option<(Vec<f64>, f64)> {
    let mut level = level;
    let mut solution = Vec::new();
    for iteration in 0..30 {
        let rows = reference.iter().enumerate().map(|(i, &at)| {
            let (t, target, weight) = problem.grid[at];
            let signed = if i % 2 == 0 { 1.0 / weight } else { -1.0 / weight };
            // P - (f + s E / w) (Q - 1) - s E' / w = f, with E from the last round in the product.
            let shifted = target + signed * level;
            let mut row: Vec<f64> = (0..=n).map(|k| chebyshev(k, t)).collect();
            row.extend((1..=m).map(|k| -shifted * chebyshev(k, t)));
            row.push(-signed);
            row.push(target);
            row
        });
        solution = solve(rows.collect())?;
        let new_level = solution.pop()?;
        let change = (new_level - level).abs();
        level = new_level;
        if m == 0 || (iteration > 0 && change <= 1e-9 * level.abs()) {
            break;
        }
    }
    Some((solution, level))
}

/// The next reference: one extremum of each run of equal sign, the smaller end dropped while there are too many.
fn exchange(errors: &[f64], wanted: usize) -> Option<Vec<usize>> {
    let mut extrema: Vec<usize> = Vec::new();
    for (i, e) in errors.iter().enumerate() {
        match extrema.last_mut() {
            Some(last) if (errors[*last] > 0.0) == (*e > 0.0) => {
                if e.abs() > errors[*last].abs() {
                    *last = i;
                }
            }
            _ => extrema.push(i),
        }
    }
    while extrema.len() > wanted {
        let (first, last) = (errors[extrema[0]].abs(), errors[extrema[extrema.len() - 1]].abs());
        // Dropping an end keeps the signs alternating.
        if first < last {
            extrema.remove(0);
        } else {
            extrema.pop();
        }
    }
    (extrema.len() == wanted).then_some(extrema)
}

/// Value and denominator at `t`.
fn evaluate(coefficients: &[f64], n: usize, t: f64) -> (f64, f64) {
    let p: f64 = coefficients[..=n].iter().enumerate().map(|(k, c)| c * chebyshev(k, t)).sum();
    let q: f64 = 1.0 + coefficients[n + 1..].iter().enumerate().map(|(k, c)| c * chebyshev(k + 1, t)).sum::<f64>();
    (p / q, q)
}

/// The Chebyshev polynomial of the first kind.
fn chebyshev(k: usize, t: f64) -> f64 {
    let (mut previous, mut current) = (1.0, t);
    if k == 0 {
        return 1.0;
    }
    for _ in 1..k {
        (previous, current) = (current, 2.0 * t * current - previous);
    }
    current
}

/// Chebyshev coefficients in `t` to monomial coefficients in `x = mid + half t`, ascending (Clenshaw on polynomials).
fn to_monomials(chebyshev_coefficients: &[f64], problem: &Problem) -> Vec<f64> {
    let size = chebyshev_coefficients.len();
    // t as a polynomial in x: (x - mid) / half.
    let times_t = |p: &[f64]| {
        let mut result = vec![0.0; size];
        for (k, &c) in p.iter().enumerate() {
            result[k] -= c * problem.mid / problem.half;
            if k + 1 < size {
                result[k + 1] += c / problem.half;
            }
        }
        result
    };
    let (mut b1, mut b2) = (vec![0.0; size], vec![0.0; size]);
    for &c in chebyshev_coefficients[1..].iter().rev() {
        let t_b1 = times_t(&b1);
        let next: Vec<f64> = (0..size).map(|k| 2.0 * t_b1[k] - b2[k] + if k == 0 { c } else { 0.0 }).collect();
        (b2, b1) = (b1, next);
    }
    let t_b1 = times_t(&b1);
    (0..size).map(|k| t_b1[k] - b2[k] + if k == 0 { chebyshev_coefficients[0] } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(fit: &Minimax, x: f64) -> f64 {
        let horner = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        horner(&fit.numerator) / horner(&fit.denominator)
    }

    /// Known minimax errors on [-1, 1]: x^3 by a quadratic, 1/4; 1/(2 - x) by degree n, (2 - sqrt 3)^n / 3 (Chebyshev).
    #[test]
    fn known_best_approximations() {
        let cubic = minimax(&Problem::new(-1.0, 1.0, |x| (x * x * x, 1.0)), 2, 0).expect("fits");
        assert!((cubic.error - 0.25).abs() < 1e-5, "{cubic:?}");
        for n in 1..6 {
            let fit = minimax(&Problem::new(-1.0, 1.0, |x| (1.0 / (2.0 - x), 1.0)), n, 0).expect("fits");
            let exact = (2.0 - 3f64.sqrt()).powi(n as i32) / 3.0;
            assert!((fit.error / exact - 1.0).abs() < 2e-5, "degree {n}: {} against {exact}", fit.error);
        }
    }

    /// exp on [-1, 1]: the best (2, 2) rational has the error 8.6899e-5 (Meinardus' table, also in Cody's surveys).
    #[test]
    fn best_rational_of_exp_equioscillates() {
        let problem = Problem::new(-1.0, 1.0, |x| (x.exp(), 1.0));
        let fit = minimax(&problem, 2, 2).expect("fits");
        let mut signs = Vec::new();
        for i in 0..=20_000 {
            let x = -1.0 + f64::from(i) / 10_000.0;
            let e = value(&fit, x) - x.exp();
            assert!(e.abs() <= fit.error * 1.001);
            if e.abs() > 0.98 * fit.error && signs.last() != Some(&(e > 0.0)) {
                signs.push(e > 0.0);
            }
        }
        assert_eq!(signs.len(), 6, "a best approximation alternates n + m + 2 times");
        assert!((8.6e-5..8.8e-5).contains(&fit.error), "{}", fit.error);
    }
}
