//! Seeded low-discrepancy points by global index: Owen-scrambled Sobol, and independent points for statistics.
//!
//! A point is a pure function of `(index, dimension, seed)`, so that a sample does not depend on how the work was cut into
//! batches. Use: dimensions 0 and 1 choose the direction about the gaze; the place inside the pixel is a [`shuffled_pair`] and the path
//! comes from [`vertex_numbers`] of the sample's pixel or stratum, since the samples of one pixel are far apart in the sequence of all.
//!
//! # Numerics
//! Values are `u32` fractions of 2^32; [`to_unit_f32`] keeps the top 24 bits, so that the f32 is exact and below 1. The
//! index is a `u32`: a stream of more than 2^32 samples changes its seed with the index's high word,
//! `hash_combine(seed, (index >> 32) as u32)`, which gives a new, independent scramble of the same sequence.
//!
//! # Reference
//! I. M. Sobol, *On the distribution of points in a cube*, 1967; S. Joe, F. Y. Kuo, *Constructing Sobol sequences with
//! better two-dimensional projections*, SIAM J. Sci. Comput. 30, 2008 (primitive polynomials and initial numbers of
//! `new-joe-kuo-6`); B. Burley, *Practical hash-based Owen scrambling*, JCGT 9(4), 2020, after S. Laine, T. Karras 2011.

/// Dimensions with direction numbers of their own. Higher dimensions reuse them, on a re-shuffled index.
pub const DIMENSIONS: usize = 32;

/// Bits of an index and of a value.
const BITS: usize = 32;
/// Bits of a number that make an f32 in [0, 1).
const FRACTION_BITS: u32 = 24;

/// Degree, inner coefficients and initial numbers of dimensions 1.. (dimension 0 is van der Corput's), from Joe and Kuo 2008.
/// Bit `degree - 1 - k` of the coefficients belongs to `x^k` for `0 < k < degree`; the outer coefficients are 1.
const JOE_KUO: [(u32, u32, &[u32]); DIMENSIONS - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, 7, &[1, 1, 3, 13, 7, 35, 63]),
    (7, 8, &[1, 3, 5, 9, 1, 25, 53]),
    (7, 14, &[1, 3, 1, 13, 9, 35, 107]),
    (7, 19, &[1, 3, 1, 5, 27, 61, 31]),
    (7, 21, &[1, 1, 5, 11, 19, 41, 61]),
    (7, 28, &[1, 3, 5, 3, 3, 13, 69]),
    (7, 31, &[1, 1, 7, 13, 1, 19, 1]),
    (7, 32, &[1, 3, 7, 5, 13, 19, 59]),
    (7, 37, &[1, 1, 3, 9, 25, 29, 41]),
    (7, 41, &[1, 3, 5, 13, 23, 1, 55]),
    (7, 42, &[1, 3, 7, 3, 13, 59, 17]),
];

/// The direction numbers of every dimension, row-major: `[dimension * 32 + bit of the index]`, most significant bit first.
#[must_use]
pub fn direction_numbers() -> Vec<u32> {
    let mut numbers = Vec::with_capacity(DIMENSIONS * BITS);
    numbers.extend((0..BITS).map(|bit| 1u32 << (31 - bit)));
    for (degree, coefficients, initial) in JOE_KUO {
        let degree = degree as usize;
        let start = numbers.len();
        for bit in 0..BITS {
            let number = if bit < degree {
                initial[bit] << (31 - bit)
            } else {
                let before = |k: usize| numbers[start + bit - k];
                (1..degree)
                    .filter(|k| (coefficients >> (degree - 1 - k)) & 1 == 1)
                    .fold(before(degree) ^ (before(degree) >> degree), |number, k| number ^ before(k))
            };
            numbers.push(number);
        }
    }
    numbers
}

/// The matrix, computed once.
fn matrix() -> &'static [u32] {
    static MATRIX: std::sync::OnceLock<Vec<u32>> = std::sync::OnceLock::new();
    MATRIX.get_or_init(direction_numbers)
}

/// The unscrambled Sobol value, a fraction of 2^32. `dimension` is taken modulo [`DIMENSIONS`].
#[must_use]
pub fn sobol(index: u32, dimension: u32) -> u32 {
    let row = (dimension as usize % DIMENSIONS) * BITS;
    let mut rest = index;
    let mut value = 0;
    for number in &matrix()[row..row + BITS] {
        value ^= number & 0u32.wrapping_sub(rest & 1);
        rest >>= 1;
    }
    value
}

/// The Owen-scrambled Sobol value of `dimension` at `index`, a fraction of 2^32.
///
/// Dimensions below [`DIMENSIONS`] are those of one sequence. Block `b = dimension / DIMENSIONS` above uses the same
/// sequence on the index scrambled by `b`: well distributed within a block, independent between blocks.
#[must_use]
pub fn sobol_owen(index: u32, dimension: u32, seed: u32) -> u32 {
    let block = dimension / DIMENSIONS as u32;
    // A nested permutation of the index keeps every aligned power-of-two run together as a set.
    let index = if block == 0 { index } else { owen_scramble(index, hash_combine(seed, !block)) };
    owen_scramble(sobol(index, dimension), hash_combine(seed, dimension))
}

/// Dimensions 0 and 1 of the unscrambled sequence, `sobol(index, 0)` and `sobol(index, 1)`, without the matrix: the first is the
/// index's bits reversed; the second's matrix is Pascal's triangle modulo 2, a Kronecker power of `[[1, 1], [0, 1]]`.
#[must_use]
pub fn sobol_pair(index: u32) -> [u32; 2] {
    let x = index.reverse_bits();
    let mut y = x;
    y ^= (y & 0x5555_5555) << 1;
    y ^= (y & 0x3333_3333) << 2;
    y ^= (y & 0x0f0f_0f0f) << 4;
    y ^= (y & 0x00ff_00ff) << 8;
    y ^= y << 16;
    [x, y]
}

/// Numbers `2 pair` and `2 pair + 1` of the point `index`, fractions of 2^32: [`sobol_pair`] on the index in an order of the pair's
/// own, scrambled. Each pair is a (0, 2)-sequence in base 2, pairs are independent, and there is no end of them (Burley 2020).
#[must_use]
pub fn shuffled_pair(index: u32, pair: u32, seed: u32) -> [u32; 2] {
    let seed = hash_combine(seed, pair);
    // A nested permutation of the index keeps every aligned power-of-two run together as a set.
    let [x, y] = sobol_pair(owen_scramble(index, seed));
    [owen_scramble(x, hash(seed ^ 0x68bc_21eb)), owen_scramble(y, hash(seed ^ 0x02e5_be93))]
}

/// Four dimensions that are well distributed together: of every aligned run of `4^k` points one lies in each box whose sides are `4^-a`,
/// `4^-b`, `4^-c` and `4^-d` with `a + b + c + d = k`. No base 2 sequence of four dimensions has this.
///
/// # Formula
/// Faure's sequence over the field of four elements: digit `i` of dimension `alpha` is the sum over `j` of
/// `binomial(j, i) alpha^(j - i)` times digit `j` of the index, in base 4. By Lucas the matrix is a Kronecker power of
/// `[[1, alpha], [0, 1]]`, so a dimension takes four steps and no table.
///
/// # Numerics
/// Fractions of 2^32, exact.
///
/// # Reference
/// H. Faure, *Discrépance de suites associées à un système de numération (en dimension s)*, Acta Arithmetica 41, 1982;
/// H. Niederreiter, *Point sets and sequences with small discrepancy*, Monatshefte für Mathematik 104, 1987 (prime powers).
#[must_use]
pub fn faure_quad(index: u32) -> [u32; 4] {
    /// Places whose number has bit 0, 1, 2 and 3, from the lowest digit, which is place 15.
    const PLACES: [u32; 4] = [0x3333_3333, 0x0f0f_0f0f, 0x00ff_00ff, 0x0000_ffff];
    // Elements 2 and 3 of the field, times each of 16 digits.
    let twice = |x: u32| {
        let (high, low) = (x >> 1 & 0x5555_5555, x & 0x5555_5555);
        (high ^ low) << 1 | high
    };
    let thrice = |x: u32| x ^ twice(x);
    let x = index.reverse_bits();
    let mut point = [x; 4];
    for (step, places) in PLACES.into_iter().enumerate() {
        let (shift, is_squared) = (2 << step, step % 2 == 1);
        point[1] ^= (point[1] & places) << shift;
        let [third, fourth] = [point[2] & places, point[3] & places];
        // Powers of either element take turns with the other.
        let factors = if is_squared { [thrice(third), twice(fourth)] } else { [twice(third), thrice(fourth)] };
        point[2] ^= factors[0] << shift;
        point[3] ^= factors[1] << shift;
    }
    point
}

/// Numbers for the vertex of a path, fractions of 2^32: two to choose a point on a light and two to choose a direction.
///
/// Vertices go in twos: both numbers of the first are well distributed together with either's of the second ([`faure_quad`] on the
/// index in an order of the two vertices' own, Owen-scrambled), since the light that reaches a pixel over a vertex depends on the one
/// before. At one vertex the point on the light and the direction have the same point of the sequence, with scrambles of their own: over seeds
/// they are uncorrelated, and each is stratified. Pairs of vertices are independent, and there is no end of them.
#[must_use]
pub fn vertex_numbers(index: u32, vertex: u32, seed: u32) -> [u32; 4] {
    let shuffle = hash_combine(seed, 0x5eed_0000 + vertex / 2);
    let point = faure_quad(owen_scramble(index, shuffle));
    let [a, b] = if vertex.is_multiple_of(2) { [point[0], point[1]] } else { [point[2], point[3]] };
    let scramble = hash_combine(shuffle, vertex % 2);
    [
        owen_scramble(a, hash(scramble ^ 0x68bc_21eb)),
        owen_scramble(b, hash(scramble ^ 0x02e5_be93)),
        owen_scramble(a, hash(scramble ^ 0x967a_889b)),
        owen_scramble(b, hash(scramble ^ 0x368c_c8b7)),
    ]
}

/// Independent points: a hash of `(index, dimension, seed)`, a fraction of 2^32. For statistics and as the baseline.
#[must_use]
pub fn independent(index: u32, dimension: u32, seed: u32) -> u32 {
    hash_combine(hash_combine(seed, dimension), index)
}

/// Nested uniform scrambling in base 2: bit `k` is flipped by a hash of the bits above it, so that every elementary
/// interval stays one.
#[must_use]
pub fn owen_scramble(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits();
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// The inverse of [`owen_scramble`]: the value whose scramble by `seed` this is.
#[must_use]
pub fn owen_unscramble(value: u32, seed: u32) -> u32 {
    let [x] = unscramble_but_for_the_seed([value], u32::BITS);
    x.wrapping_sub(seed).reverse_bits()
}

/// What [`owen_scramble`] has added the seed to make of the reversed bits: right in its lowest `bits`. Each turn waits for the last, so
/// several values at once take little longer than one.
fn unscramble_but_for_the_seed<const N: usize>(values: [u32; N], bits: u32) -> [u32; N] {
    [0x8d22_f6e6u32, 0xc7af_e638, 0xb82f_1e52, 0x6c50_b47c].into_iter().fold(
        values.map(u32::reverse_bits),
        |y, factor| {
            // `factor` is even: each turn makes one more low bit right at least, and as many as the factor has zeros at its end.
            (0..bits / factor.trailing_zeros())
                .fold(y, |x, _| std::array::from_fn(|i| y[i] ^ x[i].wrapping_mul(factor)))
        },
    )
}

/// An end of an interval of first numbers, made ready for [`count_between`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntervalEnd {
    /// A fraction of 2^32, a multiple of 2^8.
    pub value: u32,
    /// Once a sequence's seed is subtracted, the index at which it takes the value, modulo 2^24.
    pub root: u32,
}

impl IntervalEnd {
    /// The end at `value`, whose low 8 bits are dropped.
    #[must_use]
    pub fn new(value: u32) -> Self {
        let [end] = Self::several([value]);
        end
    }

    /// Several ends, which take little longer than one.
    #[must_use]
    pub fn several<const N: usize>(values: [u32; N]) -> [Self; N] {
        let values = values.map(|value| value & !0xff);
        let roots = unscramble_but_for_the_seed(values, FRACTION_BITS);
        std::array::from_fn(|i| Self { value: values[i], root: roots[i] & 0x00ff_ffff })
    }

    /// Of the first `index` numbers those that share its first `bit` bits and have a 0 where it has a 1 next.
    fn count_at(self, bit: u32, index: u32, seed: u32) -> u32 {
        let lower = u32::MAX >> (31 - bit);
        let residue = (self.root.wrapping_sub(seed) ^ (1 << bit)) & lower;
        // Whole periods of 2^(bit + 1) indices hold one each.
        let count = (u64::from(index) >> (bit + 1)) as u32 + u32::from(index & lower > residue);
        if self.value >> (31 - bit) & 1 == 1 { count } else { 0 }
    }
}

/// How many of the first points of a scrambled sequence have a first number in an interval: which number a point has among those there,
/// without having seen the others.
///
/// # Definition
/// The `i`-th first number is `owen_scramble(sobol(i, 0), seed)`. This is the number of `i < index` with a first number from `low` on
/// and below `high`.
///
/// # Formula
/// The numbers below a bound share its first `k` bits for some `k` and have a 0 where it has a 1. In van der Corput's sequence, scrambled
/// or not, they are those whose indices have one residue modulo `2^(k + 1)`; the residues are read off the index at which the
/// sequence takes the bound itself. Bits that both ends begin with count for neither.
///
/// # Numerics
/// Integers: exact.
#[must_use]
pub fn count_between(index: u32, low: IntervalEnd, high: IntervalEnd, seed: u32) -> u32 {
    let first_bit = (low.value ^ high.value).leading_zeros();
    (first_bit..FRACTION_BITS).fold(0u32, |count, bit| {
        count.wrapping_add(high.count_at(bit, index, seed)).wrapping_sub(low.count_at(bit, index, seed))
    })
}

/// A hash of two words.
#[must_use]
pub fn hash_combine(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b.wrapping_add(0x9e37_79b9)))
}

/// A bijective integer hash with low bias (constants of C. Wellons' search, 2018, public domain).
#[must_use]
pub fn hash(value: u32) -> u32 {
    let mut x = value;
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The f32 in `[0, 1)` of a fraction of 2^32: its top 24 bits, exactly.
#[must_use]
pub fn to_unit_f32(value: u32) -> f32 {
    (value >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The index offset that thread `thread` of a batch of `2^log2_batch` samples should trace, so that neighbouring threads lie
/// in neighbouring strata of dimension 0 (rings about the gaze): the bit reversal of `thread` in `log2_batch` bits.
///
/// The batch must start at a multiple of its size; the set of indices is the batch's whatever the order.
#[must_use]
pub fn strata_order(thread: u32, log2_batch: u32) -> u32 {
    if log2_batch == 0 { 0 } else { thread.reverse_bits() >> (32 - log2_batch.min(32)) }
}
