//! Order of a batch's samples: threads that are neighbours get points of the sequence that are neighbours in the unit
//! square of dimensions 0 and 1, so that they trace neighbouring rays (in FV: along the polar strata about the gaze).
//!
//! Among 2^k consecutive points of the Sobol sequence, aligned to 2^k, each cell of a 2^ceil(k/2) x 2^floor(k/2) grid
//! holds exactly one, and the map from the k low index bits to the cell is linear over GF(2). Its inverse turns a
//! Morton-ordered cell number, the thread, into an index. Owen scrambling keeps cells together, so it can be ignored.

use fovea_sampler::sequence::sobol;

/// Index bits that a batch may permute: batches have at most 2^20 samples.
pub const ORDER_BITS: usize = 20;

/// Cells of the unit square, as powers of two along its axes, in which samples of one block of the sequence share what Russian roulette
/// goes by.
///
/// Eight threads beside each other have all of it in common in batches of 2^14 and 2^15 samples, and half of it in batches of half or
/// twice as many: where some of a software adapter's eight lanes have paths that go on, the others wait. It follows from a sample's
/// number and its point alone, so that films do not depend on how the samples were cut into batches.
pub const ROULETTE_CELL_BITS: [u32; 2] = [6, 5];
/// Blocks are 2^this samples, where samples share.
pub const ROULETTE_BLOCK_BITS: u32 = 15;

/// Bits of a block in which samples share what roulette goes by, where the pixel that gets most samples gets `peak_share` of all;
/// 0 where each sample has its own: with more than one sample of a block in a pixel, a pixel's samples would not be independent of
/// each other, and its variance not what the film says.
pub fn roulette_block_bits(peak_share: f64) -> u32 {
    if peak_share * f64::from(1u32 << ROULETTE_BLOCK_BITS) <= 1.0 { ROULETTE_BLOCK_BITS } else { 0 }
}

/// Columns of the matrix from thread bits to index bits, for a batch of 2^`log2_size` samples.
///
/// # Panics
/// When `log2_size` exceeds [`ORDER_BITS`], which is a bug in this crate.
pub fn order_columns(log2_size: u32) -> [u32; ORDER_BITS] {
    let k = log2_size as usize;
    assert!(k <= ORDER_BITS, "batches are at most 2^{ORDER_BITS} samples");
    // Column i: thread bits of the cell that index bit i alone moves to; thread bit k-1 is the first bit of x.
    let cell_of_bit = |i: usize| {
        (0..k).fold(0u32, |cell, bit| {
            let digit = sobol(1 << i, bit as u32 % 2) >> (31 - bit / 2) & 1;
            cell | digit << (k - 1 - bit)
        })
    };
    let mut rows: Vec<(u32, u32)> = (0..k).map(|i| (cell_of_bit(i), 1 << i)).collect();
    // Gauss-Jordan over GF(2): each pair says that a set of index bits moves to a set of thread bits.
    for bit in 0..k {
        let pivot =
            (bit..k).find(|&r| rows[r].0 >> bit & 1 == 1).expect("Sobol dimensions 0 and 1 are a (0,2)-sequence");
        rows.swap(bit, pivot);
        let (cell, index) = rows[bit];
        for (r, row) in rows.iter_mut().enumerate() {
            if r != bit && row.0 >> bit & 1 == 1 {
                row.0 ^= cell;
                row.1 ^= index;
            }
        }
    }
    let mut columns = [0; ORDER_BITS];
    for (column, row) in columns.iter_mut().zip(rows) {
        *column = row.1;
    }
    columns
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::sync::Arc;

    use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
    use glam::Vec3;

    use super::*;
    use crate::{
        distribution::{Distribution, Gaze},
        film::FilmOptions,
    };

    fn index_of_thread(columns: &[u32; ORDER_BITS], thread: u32) -> u32 {
        columns
            .iter()
            .enumerate()
            .filter(|(bit, _)| thread >> bit & 1 == 1)
            .fold(0, |index, (_, column)| index ^ column)
    }

    /// Eight threads beside each other share the number of their roulette, and no more than 16 samples do.
    #[test]
    fn neighbours_share_their_roulette() {
        let group_of = |index: u32| {
            let [x, y] = [0, 1].map(|d| sobol(index, d as u32) >> (32 - ROULETTE_CELL_BITS[d]));
            (index >> ROULETTE_BLOCK_BITS, x, y)
        };
        for (k, most_in_eight) in [(13, 2), (14, 1), (15, 1), (16, 2)] {
            let columns = order_columns(k);
            let mut sharing = std::collections::HashMap::new();
            for first in (0..1 << k).step_by(8) {
                let eight: Vec<_> =
                    (first..first + 8).map(|thread| group_of(index_of_thread(&columns, thread))).collect();
                let distinct: std::collections::HashSet<_> = eight.iter().collect();
                assert!(
                    distinct.len() <= most_in_eight,
                    "2^{k} samples, threads from {first}: {} groups",
                    distinct.len()
                );
                eight.into_iter().for_each(|group| *sharing.entry(group).or_insert(0) += 1);
            }
            assert!(sharing.values().all(|&samples| samples <= 16), "2^{k} samples: {:?}", sharing.values().max());
        }
    }

    /// The film that the window has shares, and what tests/tests/roulette.rs has; a quarter of it does not about a gaze.
    #[test]
    fn films_share_where_a_pixel_has_one_sample_of_a_block() {
        let acuity = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002).unwrap();
        let inverse = Arc::new(Inverse::default_for(&acuity));
        let everywhere = Distribution::omnidirectional(inverse.clone());
        let foveated = Distribution::foveated(Gaze::Scene { direction: Vec3::NEG_Z }, None, inverse);
        let bits = |distribution: &Distribution, width| {
            roulette_block_bits(distribution.peak_share(&FilmOptions::equirect(width, width / 2)))
        };
        assert_eq!([bits(&everywhere, 2048), bits(&foveated, 2048)], [ROULETTE_BLOCK_BITS; 2]);
        assert_eq!(bits(&everywhere, 256), ROULETTE_BLOCK_BITS);
        assert_eq!([bits(&everywhere, 1024), bits(&foveated, 1024)], [ROULETTE_BLOCK_BITS, 0]);
    }

    /// A permutation, and the first `2^(k-6)` parts of 64 threads each stay in a cell of their own.
    #[test]
    fn threads_visit_every_index_once_and_stay_in_small_cells() {
        for k in [1, 2, 5, 6, 11, 14, 17] {
            let columns = order_columns(k);
            let mut seen = vec![false; 1 << k];
            for thread in 0..1u32 << k {
                seen[index_of_thread(&columns, thread) as usize] = true;
            }
            assert!(seen.iter().all(|&s| s), "2^{k} threads are not a permutation");
            if k < 6 {
                continue;
            }
            for group in [0, 1, (1u32 << (k - 6)) - 1] {
                let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
                for thread in group * 64..group * 64 + 64 {
                    let index = index_of_thread(&columns, thread) + (5 << k);
                    for d in 0..2 {
                        let x = sobol(index, d);
                        (low[d as usize], high[d as usize]) = (low[d as usize].min(x), high[d as usize].max(x));
                    }
                }
                // 64 of 2^k cells: 2^-((k-6)/2) along each axis, one of the two a factor 2 longer when k is odd.
                let widest = f64::from((high[0] - low[0]).max(high[1] - low[1])) / 2f64.powi(32);
                assert!(widest <= 2f64.powf(-(f64::from(k) - 7.0) / 2.0), "group {group} of 2^{k} spans {widest}");
            }
        }
    }
}
