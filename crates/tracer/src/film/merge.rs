//! Adding films: what several machines traced of one picture becomes one film.

use thiserror::Error;

use super::{DamagedFilm, FilmDifference, FilmSnapshot, SampleRange, joined};
use crate::kernels::FILM_WORDS;

/// Why films cannot be added. The first is then as it was.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MergeError {
    /// They are of different pictures.
    #[error("the films do not belong together; {0}")]
    Differs(#[from] FilmDifference),
    /// One is no film.
    #[error(transparent)]
    Damaged(#[from] DamagedFilm),
    /// A sample would count twice.
    #[error("both films hold samples {first}..{end} of seed {seed}")]
    Overlap {
        /// Seed.
        seed: u32,
        /// Index of the first sample that is in both.
        first: u64,
        /// Index after the last one of that run.
        end: u64,
    },
    /// A pixel's sum needs more bits than the film has.
    #[error("together the films hold more samples than a film can")]
    Full,
}

impl FilmSnapshot {
    /// Adds the samples of another film of the same picture. Films of disjoint ranges of one seed become, bit by bit, the
    /// film of both ranges; films of different seeds become a film of as many samples, whose mean is as unbiased.
    ///
    /// # Errors
    /// When the films differ in more than seed and samples, or have a sample in common.
    pub fn merge(&mut self, other: &Self) -> Result<(), MergeError> {
        self.check()?;
        other.check()?;
        self.header.matches(&other.header)?;
        for ours in &self.header.ranges {
            if let Some(theirs) = other.header.ranges.iter().find(|theirs| theirs.overlaps(ours)) {
                let (first, end) = (ours.first.max(theirs.first), ours.end().min(theirs.end()));
                return Err(MergeError::Overlap { seed: ours.seed, first, end });
            }
        }
        let words = sum(&self.words, &other.words).ok_or(MergeError::Full)?;
        let (ours, theirs) = (&mut self.header, &other.header);
        let ranges: Vec<SampleRange> = joined(ours.ranges.iter().chain(&theirs.ranges).copied().collect());
        let total = &mut ours.statistics;
        total.samples = total.samples.saturating_add(theirs.statistics.samples);
        total.segments = total.segments.saturating_add(theirs.statistics.segments);
        total.shadow_rays = total.shadow_rays.saturating_add(theirs.statistics.shadow_rays);
        total.non_finite = total.non_finite.saturating_add(theirs.statistics.non_finite);
        total.clamped = total.clamped.saturating_add(theirs.statistics.clamped);
        total.steered = total.steered.saturating_add(theirs.statistics.steered);
        ours.ranges = ranges;
        self.words = words;
        Ok(())
    }
}

/// Pixel by pixel; `None` when a sum overflows.
fn sum(ours: &[u32], theirs: &[u32]) -> Option<Vec<u32>> {
    /// First word and number of words of each sum of a pixel.
    const FIELDS: [(usize, usize); 5] = [(0, 2), (2, 2), (4, 2), (6, 1), (7, 3)];
    let mut words = ours.to_vec();
    let size = FILM_WORDS as usize;
    for (pixel, other) in words.chunks_exact_mut(size).zip(theirs.chunks_exact(size)) {
        for (first, length) in FIELDS {
            let mut carry = 0;
            for (word, added) in pixel[first..first + length].iter_mut().zip(&other[first..first + length]) {
                let sum = u64::from(*word) + u64::from(*added) + carry;
                *word = sum as u32;
                carry = sum >> 32;
            }
            if carry > 0 {
                return None;
            }
        }
    }
    Some(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_carry_within_their_field_and_overflow_is_noticed() {
        let most = u32::MAX;
        let ours = [most, 1, most, most - 1, 0, 0, 5, most, most, 7];
        let theirs = [1, 0, 1, 0, 9, 8, 6, 1, 0, 0];
        assert_eq!(sum(&ours, &theirs), Some(vec![0, 2, 0, most, 9, 8, 11, 0, 0, 8]));
        for field in [1, 3, 5, 6, 9] {
            let (mut a, mut b) = ([0; 10], [0; 10]);
            (a[field], b[field]) = (most, 1);
            assert_eq!(sum(&a, &b), None, "word {field}");
        }
    }
}
