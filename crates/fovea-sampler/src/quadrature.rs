//! Gauss-Legendre quadrature.

/// Number of nodes; 2 N - 1 = 39 is the degree that is integrated exactly.
const NODES: usize = 20;

/// A Gauss-Legendre rule on `[-1, 1]`.
#[derive(Clone, Debug)]
pub(crate) struct GaussLegendre {
    nodes_and_weights: [(f64, f64); NODES],
}

impl GaussLegendre {
    /// Computes the rule: roots of the Legendre polynomial by Newton's iteration from Tricomi's estimate.
    pub(crate) fn new() -> Self {
        let mut nodes_and_weights = [(0.0, 0.0); NODES];
        for (i, slot) in nodes_and_weights.iter_mut().enumerate() {
            let mut x = (core::f64::consts::PI * (i as f64 + 0.75) / (NODES as f64 + 0.5)).cos();
            let mut derivative = 1.0;
            for _ in 0..10 {
                let (value, slope) = legendre(x);
                derivative = slope;
                x -= value / slope;
            }
            *slot = (x, 2.0 / ((1.0 - x * x) * derivative * derivative));
        }
        Self { nodes_and_weights }
    }

    /// The integral of `f` over `[lo, hi]`. The ends are not evaluated, so `f` may jump there.
    pub(crate) fn integrate(&self, lo: f64, hi: f64, f: impl Fn(f64) -> f64) -> f64 {
        let (centre, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
        half * self.nodes_and_weights.iter().map(|&(x, w)| w * f(centre + half * x)).sum::<f64>()
    }
}

/// The Legendre polynomial of degree `NODES` and its derivative.
fn legendre(x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for n in 2..=NODES {
        let n = n as f64;
        (previous, current) = (current, ((2.0 * n - 1.0) * x * current - (n - 1.0) * previous) / n);
    }
    let n = NODES as f64;
    (current, n * (x * current - previous) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_for_degree_39_and_not_for_a_jump() {
        let rule = GaussLegendre::new();
        for degree in 0..40 {
            let integral = rule.integrate(0.0, 2.0, |x| x.powi(degree));
            let exact = 2f64.powi(degree + 1) / f64::from(degree + 1);
            assert!((integral / exact - 1.0).abs() < 1e-13, "degree {degree}: {integral} against {exact}");
        }
        assert!((rule.integrate(0.0, 1.0, |x| f64::from(u8::from(x > 0.3))) - 0.7).abs() > 1e-6);
    }
}
