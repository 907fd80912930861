//! The sequences: their structure, their scrambling, and what they gain over independent points.

use fovea_sampler::sequence::{
    DIMENSIONS, IntervalEnd, count_between, direction_numbers, faure_quad, hash_combine, independent, owen_scramble,
    owen_unscramble, shuffled_pair, sobol, sobol_owen, sobol_pair, strata_order, to_unit_f32, vertex_numbers,
};
use fovea_sampler::{Angle, Film, GazeWarp, Geometry, RadialDistribution, Reddy2001};

#[test]
fn every_dimension_is_stratified_scrambled_or_not() {
    for dimension in 0..DIMENSIONS as u32 + 3 {
        for seed in [1, 0xdead_beef] {
            for log2 in [1, 4, 8] {
                // An aligned run of 2^log2 indices that does not start at 0.
                let start = 5 << log2;
                let mut seen = vec![false; 1 << log2];
                for i in 0..1_u32 << log2 {
                    let stratum = sobol_owen(start + i, dimension, seed) >> (32 - log2);
                    assert!(!core::mem::replace(&mut seen[stratum as usize], true), "dimension {dimension} at {i}");
                }
            }
        }
    }
}

/// Dimensions 0 and 1 are a (0, 2)-sequence in base 2: one point in every elementary interval.
#[test]
fn first_two_dimensions_are_a_net_after_scrambling() {
    for log2 in [4_u32, 8, 10] {
        for split in 0..=log2 {
            let mut seen = vec![false; 1 << log2];
            for i in 0..1_u32 << log2 {
                let i = i + (3 << log2);
                let cell = |dimension, bits: u32| {
                    let value = sobol_owen(i, dimension, 42);
                    if bits == 0 { 0 } else { value >> (32 - bits) }
                };
                let index = (cell(0, split) << (log2 - split)) | cell(1, log2 - split);
                assert!(!core::mem::replace(&mut seen[index as usize], true), "2^{log2} split {split}");
            }
        }
    }
}

#[test]
fn the_pair_is_the_matrix() {
    let indices = (0..=u16::MAX.into()).chain((0..32).map(|bit| 1 << bit)).chain([u32::MAX, 0xdead_beef]);
    indices.for_each(|index| assert_eq!(sobol_pair(index), [sobol(index, 0), sobol(index, 1)], "{index:x}"));
}

/// Every aligned run of 2^k points has one in each elementary interval of a pair, and pairs do not follow one another: of two
/// pairs' first numbers the strata are paired by chance.
#[test]
fn shuffled_pairs_are_nets_and_independent_of_each_other() {
    let log2 = 8_u32;
    for pair in [0, 1, 7, 1000] {
        for split in 0..=log2 {
            let mut seen = vec![false; 1 << log2];
            for i in 0..1_u32 << log2 {
                let [x, y] = shuffled_pair(i + (5 << log2), pair, 42).map(u64::from);
                let cell = (x >> (32 - split) << (log2 - split)) | y >> (32 - (log2 - split));
                assert!(!core::mem::replace(&mut seen[cell as usize], true), "pair {pair} split {split}");
            }
        }
    }
    // A grid of 16 x 16 over the first numbers of two pairs: points of independent permutations are spread as by chance.
    let statistic: f64 = (0..64)
        .map(|seed| {
            let mut counts = [0_u32; 256];
            for i in 0..1 << 12 {
                let ([a, _], [b, _]) = (shuffled_pair(i, 3, seed), shuffled_pair(i, 4, seed));
                counts[(a >> 28 << 4 | b >> 28) as usize] += 1;
            }
            counts.iter().map(|count| (f64::from(*count) - 16.0).powi(2) / 16.0).sum::<f64>()
        })
        .sum();
    // Of 16 consecutive points both numbers lie in each sixteenth once, paired by a permutation: its squared distance from evenness
    // is 15, 256 times, over 16 expected: 240 a seed. Pairs that follow one another give 16 times that.
    let ratio = statistic / (64.0 * 240.0);
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
}

/// The recurrence's polynomials are primitive, so that no two dimensions are alike, and the first points are the published
/// ones (0.5; 0.75, 0.25; ...).
#[test]
fn direction_numbers_are_triangular_and_distinct() {
    let numbers = direction_numbers();
    assert_eq!(numbers.len(), DIMENSIONS * 32);
    for (dimension, row) in numbers.chunks(32).enumerate() {
        for (bit, number) in row.iter().enumerate() {
            assert_eq!(number.trailing_zeros(), 31 - bit as u32, "dimension {dimension} bit {bit}");
        }
        assert!(numbers.chunks(32).take(dimension).all(|other| other != row));
    }
    // Third and fourth points of dimension 2 (1-based 3), by Joe and Kuo's recurrence: 0.25, 0.75 of the Gray code's order.
    let unit = |index, dimension| f64::from(sobol(index, dimension)) / 4_294_967_296.0;
    let points: Vec<[f64; 3]> = (0..4).map(|i| [unit(i, 0), unit(i, 1), unit(i, 2)]).collect();
    assert_eq!(points, [[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.25, 0.75, 0.75], [0.75, 0.25, 0.25]]);
}

/// Over seeds the scrambled first point is uniform and seeds differ.
#[test]
fn scrambling_randomises() {
    let mut counts = [0_u32; 64];
    for seed in 0..64_000 {
        counts[(owen_scramble(0, hash_combine(seed, 7)) >> 26) as usize] += 1;
    }
    let statistic: f64 = counts.iter().map(|c| (f64::from(*c) - 1000.0).powi(2) / 1000.0).sum();
    assert!(crate::common::chi_squared_p(statistic, 63.0) > 1e-3, "{statistic}");
    assert_ne!(sobol_owen(3, 1, 1), sobol_owen(3, 1, 2));
    assert_ne!(independent(3, 1, 1), independent(3, 2, 1));
}

#[test]
fn unit_interval_is_half_open_and_exact() {
    assert_eq!(to_unit_f32(0), 0.0);
    assert_eq!(to_unit_f32(u32::MAX), 1.0 - 2f32.powi(-24));
    assert_eq!(to_unit_f32(1 << 8), 2f32.powi(-24));
}

#[test]
fn strata_order_permutes_the_batch_and_keeps_neighbours_close() {
    let log2 = 10;
    let mut seen = vec![false; 1 << log2];
    for thread in 0..1 << log2 {
        seen[strata_order(thread, log2) as usize] = true;
        // Threads of a group of 64 share a sixteenth of dimension 0.
        let group = sobol(strata_order(thread, log2), 0) >> 28;
        assert_eq!(group, thread >> 6);
    }
    assert!(seen.iter().all(|s| *s));
    assert_eq!(strata_order(0, 0), 0);
    assert_eq!(strata_order(1, 32), 1 << 31);
}

/// Variance of the number of samples a pixel near the gaze, over seeds: the sequence must beat independent points by far.
#[test]
fn sobol_evens_out_the_samples_in_the_fovea() {
    let cap = Angle::from_degrees(80.0);
    let distribution = RadialDistribution::new(Reddy2001, Geometry::Sphere, cap, 0.002).unwrap();
    let warp = GazeWarp::new(distribution);
    let film = Film::equirectangular(1024, 512).unwrap();
    let variance = |value: fn(u32, u32, u32) -> u32| {
        let (mut sum, mut squares, mut pixels) = (0.0, 0.0, 0.0);
        for seed in 0..8 {
            let mut counts = vec![0_u32; 1024 * 512];
            for index in 0..1 << 16 {
                let u = [to_unit_f32(value(index, 0, seed)), to_unit_f32(value(index, 1, seed))];
                let d = warp.sample_f32(u, [0.0, 0.0, -1.0]).map(f64::from);
                let [x, y] = film.pixel(d).unwrap();
                counts[(y * 1024 + x) as usize] += 1;
            }
            // The pixels within 4 degrees: a flat expectation, but for the pixels' own sizes (0.1 %).
            for y in 256 - 8..256 + 8 {
                for x in 512 - 8..512 + 8 {
                    let count = f64::from(counts[y * 1024 + x]);
                    (sum, squares, pixels) = (sum + count, squares + count * count, pixels + 1.0);
                }
            }
        }
        let mean: f64 = sum / pixels;
        (mean, squares / pixels - mean * mean)
    };
    let (mean, poisson) = variance(independent);
    let (sobol_mean, even) = variance(sobol_owen);
    assert!((mean / sobol_mean - 1.0).abs() < 0.02, "{mean} {sobol_mean}");
    // Independent counts are Poisson's: variance = mean, over 2048 pixels to about 3 %.
    assert!((poisson / mean - 1.0).abs() < 0.15, "{poisson} of {mean}");
    assert!(even < 0.35 * poisson, "{even} against {poisson} at {mean} samples a pixel");
}

#[test]
fn unscrambling_undoes_scrambling() {
    let values = (0..32).map(|bit| 1 << bit).chain(0..1 << 12).chain([u32::MAX, 0xdead_beef]);
    for (value, seed) in values.flat_map(|value| [0, 1, 0x9e37_79b9, u32::MAX].map(|seed| (value, seed))) {
        assert_eq!(owen_unscramble(owen_scramble(value, seed), seed), value, "{value:x} by {seed:x}");
        assert_eq!(owen_scramble(owen_unscramble(value, seed), seed), value, "{value:x} by {seed:x}");
    }
}

/// Against counting; and for large indices, whole periods and the last index there is.
#[test]
fn points_in_an_interval_are_counted_without_seeing_them() {
    let values = [0, 0x100, 0x18b2_a400, 0x18b2_a500, 0x7fff_ff00, 0x8000_0000, 0xdead_be00, 0xffff_ff00];
    let pairs = values
        .into_iter()
        .flat_map(|low| values.into_iter().filter_map(move |high| (low <= high).then_some((low, high))));
    for ((low, high), seed) in pairs.flat_map(|pair| [0, 7, 0xdead_beef].map(|seed| (pair, seed))) {
        let ends = [low, high].map(IntervalEnd::new);
        assert_eq!(ends.map(|end| end.value), [low, high]);
        let mut counted = 0;
        for index in 0..3000 {
            let found = count_between(index, ends[0], ends[1], seed);
            assert_eq!(found, counted, "{low:x} to {high:x}, seed {seed:x}, index {index}");
            counted += u32::from((low..high).contains(&sobol_owen_first(index, seed)));
        }
        // Each whole period of 2^k points has one in each interval of 2^-k.
        let cells = [low, high].map(|end| IntervalEnd::new(end & 0xfff0_0000));
        assert_eq!(count_between(5 << 12, cells[0], cells[1], seed), 5 * ((cells[1].value - cells[0].value) >> 20));
        assert!(count_between(u32::MAX, ends[0], ends[1], seed).abs_diff(high - low) <= 1);
    }
    assert_eq!(IntervalEnd::new(0x1ff), IntervalEnd::new(0x100));
}

fn sobol_owen_first(index: u32, seed: u32) -> u32 {
    owen_scramble(sobol(index, 0), seed)
}

/// Boxes of four sides `4^-digits[k]` that together have volume `4^-sum`.
fn boxes(sum: u32) -> impl Iterator<Item = [u32; 4]> {
    let all = (0..(sum + 1).pow(3)).map(move |i| [i % (sum + 1), i / (sum + 1) % (sum + 1), i / (sum + 1).pow(2)]);
    all.filter(move |d| d.iter().sum::<u32>() <= sum).map(move |[a, b, c]| [a, b, c, sum - a - b - c])
}

/// Whether 4^k points have one in each box of every shape.
fn is_net(k: u32, point: impl Fn(u32) -> [u32; 4]) -> bool {
    boxes(k).all(|digits| {
        let mut seen = vec![false; 1 << (2 * k)];
        (0..1 << (2 * k)).all(|i| {
            let cell = point(i)
                .into_iter()
                .zip(digits)
                .fold(0_u64, |cell, (x, d)| (cell << (2 * d)) | (u64::from(x) >> (32 - 2 * d)));
            !core::mem::replace(&mut seen[cell as usize], true)
        })
    })
}

#[test]
fn four_dimensions_are_a_net_in_base_4() {
    for (k, start) in [(1, 0), (2, 0), (3, 0), (3, 5), (4, 0), (4, 3), (5, 1)] {
        assert!(is_net(k, |i| faure_quad(i + (start << (2 * k)))), "4^{k} from {start}");
    }
    // Sobol's first four dimensions are none, and the test sees it.
    assert!(!is_net(2, |i| [0, 1, 2, 3].map(|d| sobol(i, d))));
    // The first point of the second run of 4^15 differs from the first of all: all digits take part.
    assert_ne!(faure_quad(1 << 30), faure_quad(0));
}

/// Directions of the first of two vertices with the light's point, or the direction, of the second.
#[test]
fn numbers_of_two_vertices_are_a_net_together() {
    for (first, seed) in [(0, 1), (2, 0xdead_beef), (1000, 7)] {
        for numbers_of_second in [0, 2] {
            let together = |i: u32| {
                let [.., a, b] = vertex_numbers(i + (3 << 6), first, seed);
                let second = vertex_numbers(i + (3 << 6), first + 1, seed);
                [a, b, second[numbers_of_second], second[numbers_of_second + 1]]
            };
            assert!(is_net(3, together), "vertices {first} and {}", first + 1);
        }
    }
}

/// Over seeds, a product of a function of the light's numbers and one of the direction's has the product of their means.
#[test]
fn light_and_direction_of_a_vertex_are_uncorrelated() {
    for vertex in [0, 1, 4] {
        let (mut sum, mut squares) = (0.0, 0.0);
        let runs = 4096;
        for seed in 0..runs {
            let covariance: f64 = (0..16)
                .map(|i| {
                    let [a, _, c, _] = vertex_numbers(i, vertex, seed).map(|x| f64::from(x) / 2f64.powi(32) - 0.5);
                    12.0 * a * c / 16.0
                })
                .sum();
            (sum, squares) = (sum + covariance, squares + covariance * covariance);
        }
        let error = squares.sqrt() / f64::from(runs);
        let mean = sum / f64::from(runs);
        // In one run both may be in much the same order, or in the opposite one; alike in every run, the mean would be 1.
        assert!(error < 0.02 && mean.abs() < 3.5 * error, "vertex {vertex}: {mean} +- {error}");
    }
}

/// Pinned: films that are to be resumed depend on every bit.
#[test]
fn numbers_of_vertices_are_stable() {
    assert_eq!([vertex_numbers(5, 0, 1), vertex_numbers(0xdead_beef, 3, 42)], PINNED);
}

const PINNED: [[u32; 4]; 2] = [
    [3_542_360_847, 2_069_833_860, 3_235_612_565, 3_534_767_642],
    [1_453_414_244, 4_103_960_274, 2_936_911_716, 816_154_599],
];
