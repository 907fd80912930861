//! Means over seeds with bootstrap intervals, points where curves cross, and ratios of samples at equal error.

/// Resamples of the seeds.
const RESAMPLES: u32 = 1000;
/// Quantiles of the reported interval.
const INTERVAL: [f64; 2] = [0.025, 0.975];

/// Numbers for resampling (SplitMix64, Steele et al. 2014).
#[derive(Clone, Copy, Debug)]
pub struct SplitMix(pub u64);

impl SplitMix {
    /// The next number.
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0..1.
    #[cfg(test)]
    pub fn uniform(&mut self) -> f64 {
        (self.number() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// From all seeds.
    pub value: f64,
    /// From resampled seeds.
    pub interval: [f64; 2],
}

/// A measure against samples, by seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Samples, ascending.
    pub samples: Vec<f64>,
    /// By seed, then by point.
    pub seeds: Vec<Vec<f64>>,
}

impl Curve {
    /// Mean of the picked seeds at each point.
    pub fn mean_of(&self, picked: &[usize]) -> Vec<f64> {
        let mean = |point: usize| picked.iter().map(|seed| self.seeds[*seed][point]).sum::<f64>() / picked.len() as f64;
        (0..self.samples.len()).map(mean).collect()
    }

    /// Whether the curve has no point at so many samples or more.
    pub fn ends_before(&self, samples: f64) -> bool {
        // Samples of equal time are quotients, and may differ from the end's in the last digit.
        self.samples.last().is_none_or(|last| last * (1.0 + 1e-9) < samples)
    }

    /// Mean of all seeds at each point.
    pub fn mean(&self) -> Vec<f64> {
        self.mean_of(&self.every())
    }

    /// Only the points that are wanted.
    pub fn filtered(&self, wanted: &[bool]) -> Self {
        let keep = |values: &Vec<f64>| values.iter().zip(wanted).filter(|(_, w)| **w).map(|(v, _)| *v).collect();
        Self { samples: keep(&self.samples), seeds: self.seeds.iter().map(keep).collect() }
    }

    fn every(&self) -> Vec<usize> {
        (0..self.seeds.len()).collect()
    }

    fn pick(&self, random: &mut SplitMix) -> Vec<usize> {
        let count = self.seeds.len() as u64;
        (0..count).map(|_| (random.number() % count) as usize).collect()
    }
}

/// The value of every seed and the spread over resampled ones; `None` where all seeds give none. Resamples that give none
/// are left out.
pub fn bootstrap(curves: &[&Curve], value: impl Fn(&[Vec<f64>]) -> Option<f64>) -> Option<Estimate> {
    let all = value(&curves.iter().map(|curve| curve.mean()).collect::<Vec<_>>())?;
    let mut random = SplitMix(1);
    let mut values: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            let means: Vec<_> = curves.iter().map(|curve| curve.mean_of(&curve.pick(&mut random))).collect();
            value(&means)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |quantile: f64| values.get((quantile * values.len() as f64) as usize).copied();
    Some(Estimate { value: all, interval: INTERVAL.map(|quantile| at(quantile).unwrap_or(all)) })
}

/// Samples that `a` takes over those that `b` takes to one error: the geometric mean over all points of either curve whose
/// error the other reaches. `None` when there is no such point.
pub fn samples_at_equal_error(a: &Curve, b: &Curve) -> Option<Estimate> {
    bootstrap(&[a, b], |means| {
        let [a_mean, b_mean] = means else { return None };
        let from_a =
            a.samples.iter().zip(a_mean).filter_map(|(n, e)| Some(n.ln() - ln_samples(&b.samples, b_mean, *e)?));
        let from_b =
            b.samples.iter().zip(b_mean).filter_map(|(n, e)| Some(ln_samples(&a.samples, a_mean, *e)? - n.ln()));
        let logs: Vec<f64> = from_a.chain(from_b).collect();
        (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
    })
}

/// Logarithm of the samples at which a falling curve first reaches a value, interpolated between logarithms.
fn ln_samples(samples: &[f64], values: &[f64], level: f64) -> Option<f64> {
    let points: Vec<(f64, f64)> = samples.iter().zip(values).map(|(n, v)| (n.ln(), *v)).collect();
    points.windows(2).find_map(|pair| {
        let [(n0, v0), (n1, v1)] = [pair[0], pair[1]];
        let crosses = v0 >= level && level >= v1 && v1 > 0.0 && level > 0.0 && v0 > v1;
        crosses.then(|| n0 + (n1 - n0) * (v0 / level).ln() / (v0 / v1).ln())
    })
}

/// How a threshold is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// Before the curve's first point.
    Earlier,
    /// Between two points.
    Measured,
    /// Beyond the curve's end, if the squared error goes on falling as one over the samples.
    Extrapolated,
}

/// Samples at which a threshold is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Samples.
    pub samples: Estimate,
    /// How they were found.
    pub reached: Reached,
}

/// Largest factor by which a curve is extrapolated.
const FARTHEST: f64 = 64.0;

/// Where a measure reaches a threshold. `square` makes a measure into what falls as one over the samples.
pub fn crossing(curve: &Curve, square: impl Fn(f64) -> f64, threshold: f64) -> Option<Crossing> {
    let level = square(threshold);
    let find = |mean: &[f64]| -> Option<(f64, Reached)> {
        let values: Vec<f64> = mean.iter().map(|value| square(*value)).collect();
        let (first, last) = (*values.first()?, *values.last()?);
        if first <= level {
            return Some((*curve.samples.first()?, Reached::Earlier));
        }
        if let Some(found) = ln_samples(&curve.samples, &values, level) {
            return Some((found.exp(), Reached::Measured));
        }
        let factor = last / level;
        (factor.is_finite() && factor <= FARTHEST)
            .then(|| (curve.samples.last().copied().unwrap_or(0.0) * factor, Reached::Extrapolated))
    };
    let reached = find(&curve.mean())?.1;
    let samples = bootstrap(&[curve], |means| Some(find(means.first()?)?.0))?;
    Some(Crossing { samples, reached })
}

/// A measure at so many samples: interpolated between logarithms, beyond the end as one over the samples.
pub fn at_samples(curve: &Curve, samples: f64) -> Option<f64> {
    let mean = curve.mean();
    let last = curve.samples.len().checked_sub(1)?;
    if samples >= curve.samples[last] {
        return Some(mean[last] * curve.samples[last] / samples);
    }
    let next = curve.samples.iter().position(|n| *n > samples)?;
    let before = next.checked_sub(1)?;
    let t = (samples / curve.samples[before]).ln() / (curve.samples[next] / curve.samples[before]).ln();
    (mean[before] > 0.0 && mean[next] > 0.0).then(|| mean[before] * (mean[next] / mean[before]).powf(t))
}

/// A measure at so many samples: linear in the logarithm of the samples, at the ends what the ends have.
pub fn within_curve(curve: &Curve, samples: f64) -> Option<f64> {
    let mean = curve.mean();
    let next = curve.samples.iter().position(|n| *n > samples);
    match next {
        None => mean.last().copied(),
        Some(0) => mean.first().copied(),
        Some(next) => {
            let [before, after] = [curve.samples[next - 1], curve.samples[next]];
            let t = (samples / before).ln() / (after / before).ln();
            Some(mean[next - 1] + t * (mean[next] - mean[next - 1]))
        }
    }
}

/// Geometric mean; `None` of nothing.
pub fn geometric_mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let logs: Vec<f64> = values.into_iter().map(f64::ln).collect();
    (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}

/// The middle value; the mean of the two middle ones.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    let upper = *values.get(half)?;
    Some(if values.len() % 2 == 1 { upper } else { 0.5 * (upper + values[half - 1]) })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    /// Seeds of squared errors of constant `c` over the samples, each with the spread of 200 pixels.
    fn curve(c: f64, first: f64, points: u32, stream: u64) -> Curve {
        let mut random = SplitMix(stream);
        let samples: Vec<f64> = (0..points).map(|k| first * 2f64.powi(k as i32)).collect();
        let mut seed = || samples.iter().map(|n| c / n * (1.0 + 0.17 * (random.uniform() - 0.5))).collect();
        let seeds = (0..8).map(|_| seed()).collect();
        Curve { samples, seeds }
    }

    #[test]
    fn a_known_ratio_is_found_within_its_interval() {
        let (slow, fast) = (curve(60.5 * 3.0, 1024.0, 6, 1), curve(3.0, 32.0, 6, 2));
        let ratio = samples_at_equal_error(&slow, &fast).unwrap();
        assert!((ratio.value / 60.5 - 1.0).abs() < 0.03, "{ratio:?}");
        assert!(ratio.interval[0] < 60.5 && 60.5 < ratio.interval[1], "{ratio:?}");
        assert!(ratio.interval[1] / ratio.interval[0] < 1.15);
        // A fault of 20 % is outside.
        let faulty = samples_at_equal_error(&curve(1.2 * 60.5 * 3.0, 1024.0, 6, 3), &fast).unwrap();
        assert!(faulty.interval[0] > 60.5, "{faulty:?}");
        // Curves that have no error in common.
        assert_eq!(samples_at_equal_error(&curve(1e6, 1.0, 3, 1), &curve(1.0, 1.0, 3, 2)), None);
    }

    #[test]
    fn thresholds_are_reached_before_between_and_beyond() {
        let root = |v: f64| v * v;
        let curve = Curve { samples: vec![1.0, 4.0, 16.0], seeds: vec![vec![4.0, 2.0, 1.0]; 2] };
        let at = |level| crossing(&curve, root, level).map(|c| (c.samples.value, c.reached));
        assert_eq!(at(5.0), Some((1.0, Reached::Earlier)));
        let (samples, reached) = at(1.5).unwrap();
        assert!((samples - 16.0 / 2.25).abs() < 1e-9 && reached == Reached::Measured);
        let (samples, reached) = at(0.5).unwrap();
        assert!((samples - 64.0).abs() < 1e-9 && reached == Reached::Extrapolated);
        assert_eq!(at(0.01), None);
    }

    #[test]
    fn curves_are_read_anywhere() {
        let curve = Curve { samples: vec![1.0, 4.0], seeds: vec![vec![8.0, 2.0]] };
        for (samples, expected) in [(1.0, 8.0), (2.0, 4.0), (4.0, 2.0), (40.0, 0.2)] {
            assert!((at_samples(&curve, samples).unwrap() - expected).abs() < 1e-12);
        }
        assert_eq!(at_samples(&curve, 0.5), None);
        assert_eq!([3.0, 4.0, 4.0 + 1e-12, 4.1].map(|samples| curve.ends_before(samples)), [false, false, false, true]);
        for (samples, expected) in [(0.5, 8.0), (2.0, 5.0), (4.0, 2.0), (40.0, 2.0)] {
            assert!((within_curve(&curve, samples).unwrap() - expected).abs() < 1e-12);
        }
        assert!((geometric_mean([2.0, 8.0]).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0]), Some(2.5));
        assert_eq!(median(vec![]), None);
    }
}
