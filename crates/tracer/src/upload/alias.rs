//! Alias tables (Walker 1977, Vose 1991): constant-time sampling of a discrete distribution.

/// Probabilities with their alias rows.
#[derive(Clone, Debug, PartialEq)]
pub struct AliasTable {
    /// Probability of each entry; they sum to one.
    pub probabilities: Vec<f32>,
    /// Below this fraction of its cell an entry stands for itself.
    pub thresholds: Vec<f32>,
    /// Above it, for this entry.
    pub aliases: Vec<u32>,
}

impl AliasTable {
    /// Builds the table of weights that are finite and not negative. All zero counts as all equal.
    pub fn build(weights: &[f64]) -> Self {
        let n = weights.len();
        let sum: f64 = weights.iter().sum();
        let scaled: Vec<f64> =
            if sum > 0.0 { weights.iter().map(|w| w * n as f64 / sum).collect() } else { vec![1.0; n] };
        let probabilities = scaled.iter().map(|w| (w / n as f64) as f32).collect();
        let mut rest = scaled;
        let mut thresholds = vec![1.0; n];
        let mut aliases: Vec<u32> = (0..n as u32).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| rest[i] < 1.0);
        while let (Some(&less), Some(&more)) = (small.last(), large.last()) {
            small.pop();
            thresholds[less] = rest[less] as f32;
            aliases[less] = more as u32;
            rest[more] -= 1.0 - rest[less];
            if rest[more] < 1.0 {
                large.pop();
                small.push(more);
            }
        }
        Self { probabilities, thresholds, aliases }
    }
}

#[cfg(test)]
mod tests {
    use super::AliasTable;

    /// Summing each entry's own share and what others pass to it gives back the probabilities.
    #[test]
    fn rows_add_up_to_the_probabilities() {
        let weights: Vec<f64> = (0..1000).map(|i| f64::from(i % 37) * f64::from(i % 5) + 1e-3).collect();
        let table = AliasTable::build(&weights);
        let n = weights.len() as f64;
        let mut mass = vec![0.0; weights.len()];
        for (i, (&threshold, &alias)) in table.thresholds.iter().zip(&table.aliases).enumerate() {
            mass[i] += f64::from(threshold) / n;
            mass[alias as usize] += (1.0 - f64::from(threshold)) / n;
        }
        let sum: f64 = weights.iter().sum();
        for (m, w) in mass.iter().zip(&weights) {
            assert!((m - w / sum).abs() < 1e-9, "{m} instead of {}", w / sum);
        }
    }

    #[test]
    fn zero_weights_are_uniform() {
        assert_eq!(AliasTable::build(&[0.0; 4]).probabilities, vec![0.25; 4]);
        assert!(AliasTable::build(&[]).aliases.is_empty());
    }
}
