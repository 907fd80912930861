//! How far the picture at the gaze has come: its error, what that is good for, and how long the rest takes.
//!
//! # Definition
//! The error is the root mean square, over a block of film pixels at the gaze, of (estimate - true luminance), divided by the
//! block's mean luminance. *Outline ready* means that it is below [`OUTLINE`], *material ready* below [`MATERIAL`].
//!
//! # Estimate
//! Each pixel's variance of the mean `v` comes from its own samples. Their average over the block estimates the expected
//! squared error. Three margins turn the estimate into a statement that holds in about 95 % of all cases when it is made:
//! two standard errors of that average, from the scatter of `v` in the block (few samples know little of rare bright ones);
//! the 95 % quantile of chi squared over its degrees of freedom, one a pixel (Wilson and Hilferty 1931), since the true error of
//! a block scatters about the expected one; and the variance of a sample in the pixels around, which counts as much as
//! [`PRIOR_SAMPLES`] samples of each pixel. That is for light that none of the block's few samples has found yet: they agree with
//! each other and would call it ready, but among the nine times as many around there are some that found it. Pixels with
//! fewer than [`LEAST_SAMPLES`] samples say nothing.

use std::time::Duration;

use glam::Vec3;
use tracer::film::{FilmPixel, PixelsNear};

/// Relative error of a film pixel at which a shape can be told: noise is a fifth of the brightness.
pub const OUTLINE: f64 = 0.2;
/// Relative error at which a material can be judged.
pub const MATERIAL: f64 = 0.05;
/// A pixel's variance counts from this many samples on.
pub const LEAST_SAMPLES: u32 = 32;
/// The block's pixels are at most so many columns and rows from the gaze.
const BLOCK_RADIUS_PX: usize = 3;
/// The pixels around likewise.
pub const AROUND_RADIUS_PX: u32 = 10;
/// What is known from around is forgotten as a pixel gets many more samples than this.
pub const PRIOR_SAMPLES: f64 = 64.0;
/// Luminance below this share of 1 counts as this much: black has no relative error.
const DARKEST: f64 = 1e-3;
/// The same place, for the estimate of the time left: radians.
const SAME_PLACE: f32 = 0.01;

/// What a block of pixels says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Block {
    /// Mean radiance, linear Rec. 709.
    pub mean: [f64; 3],
    /// Mean samples of a pixel.
    pub samples: f64,
    /// Relative error with its margins; `None` while nothing can be said.
    pub error: Option<f64>,
    /// Standard error of a pixel's luminance, without margins.
    pub standard_error: Option<f64>,
}

impl Block {
    /// From the pixels within [`AROUND_RADIUS_PX`] of the gaze.
    pub fn new(near: &PixelsNear) -> Self {
        Self::of(&near.within(BLOCK_RADIUS_PX), &near.pixels)
    }

    /// From the block's own pixels and all around.
    fn of(pixels: &[FilmPixel], around: &[FilmPixel]) -> Self {
        let count = pixels.len() as f64;
        if pixels.is_empty() {
            return Self::default();
        }
        let mean_of = |value: &dyn Fn(&FilmPixel) -> f64| pixels.iter().map(value).sum::<f64>() / count;
        let mean = [0, 1, 2].map(|channel| mean_of(&|pixel| pixel.mean[channel]));
        let samples = mean_of(&|pixel| f64::from(pixel.samples));
        if pixels.len() < 2 || pixels.iter().any(|pixel| pixel.samples < LEAST_SAMPLES) {
            return Self { mean, samples, error: None, standard_error: None };
        }
        let variance = mean_of(&|pixel| pixel.variance_of_mean);
        let scatter = mean_of(&|pixel| (pixel.variance_of_mean - variance).powi(2));
        let own = variance + 2.0 * (scatter / (count - 1.0)).sqrt();
        let prior = variance_of_a_sample(around) / samples;
        let upper = (samples * own + PRIOR_SAMPLES * prior) / (samples + PRIOR_SAMPLES);
        let brightness = mean_of(&FilmPixel::luminance).max(DARKEST);
        let error = (upper * chi_squared_95(count)).sqrt() / brightness;
        Self { mean, samples, error: Some(error), standard_error: Some(variance.sqrt()) }
    }

    /// Whether the error is below a threshold.
    pub fn is_ready(&self, threshold: f64) -> bool {
        self.error.is_some_and(|error| error <= threshold)
    }
}

/// Mean over pixels by their samples; zero where there are none.
fn variance_of_a_sample(pixels: &[FilmPixel]) -> f64 {
    let known = pixels.iter().filter(|pixel| pixel.samples > 1).map(|pixel| (f64::from(pixel.samples), pixel));
    let (sum, weights) = known.fold((0.0, 0.0), |(sum, weights), (samples, pixel)| {
        (sum + samples * samples * pixel.variance_of_mean, weights + samples)
    });
    if weights > 0.0 { sum / weights } else { 0.0 }
}

/// The 95 % quantile of chi squared over its degrees of freedom.
fn chi_squared_95(degrees: f64) -> f64 {
    const NORMAL_95: f64 = 1.645;
    let spread = 2.0 / (9.0 * degrees);
    (1.0 - spread + NORMAL_95 * spread.sqrt()).powi(3)
}

/// A threshold's state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Progress {
    /// Too little is known.
    #[default]
    Unknown,
    /// Not yet, and about so long to go where that is known.
    Left(Option<Duration>),
    /// The error is below the threshold.
    Ready,
}

/// What the window shows about the place at the gaze.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Convergence {
    /// The block's figures.
    pub block: Block,
    /// Whether a shape can be told.
    pub outline: Progress,
    /// Whether a material can be judged.
    pub material: Progress,
}

/// Follows a place over time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Follower {
    last: Option<(Vec3, f64, Duration)>,
    samples_per_s: Option<f64>,
}

impl Follower {
    /// Takes in a block in a direction after so much time of tracing.
    pub fn update(&mut self, direction: Vec3, block: Block, traced: Duration) -> Convergence {
        match self.last {
            Some((place, samples, at)) if place.angle_between(direction) <= SAME_PLACE && block.samples >= samples => {
                let seconds = traced.saturating_sub(at).as_secs_f64();
                if seconds > 0.0 {
                    self.samples_per_s = Some((block.samples - samples) / seconds);
                }
            }
            _ => self.samples_per_s = None,
        }
        self.last = Some((direction, block.samples, traced));
        let progress = |threshold| match block.error {
            None => Progress::Unknown,
            Some(error) if error <= threshold => Progress::Ready,
            Some(error) => Progress::Left(self.left(block.samples, error / threshold)),
        };
        Convergence { block, outline: progress(OUTLINE), material: progress(MATERIAL) }
    }

    /// The error falls with the root of the samples.
    fn left(&self, samples: f64, error_over_threshold: f64) -> Option<Duration> {
        let rate = self.samples_per_s.filter(|rate| *rate > 0.0)?;
        let missing = samples * (error_over_threshold * error_over_threshold - 1.0);
        Duration::try_from_secs_f64(missing / rate).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// xorshift64*, uniform in 0..1.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (-2.0 * (1.0 - self.next()).ln()).sqrt() * (std::f64::consts::TAU * self.next()).cos()
        }
    }

    #[derive(Clone, Copy, Default)]
    struct Sums {
        count: u32,
        sum: f64,
        squares: f64,
    }

    impl Sums {
        fn pixel(&self) -> FilmPixel {
            let n = f64::from(self.count);
            let mean = self.sum / n;
            let variance_of_mean = (self.squares - self.sum * mean).max(0.0) / (n - 1.0) / n;
            FilmPixel { mean: [mean; 3], samples: self.count, variance_of_mean }
        }
    }

    /// Of so many runs that end when the block says that it is ready, the share whose true error is below the threshold.
    fn truth(runs: u32, threshold: f64, mean: f64, sample: impl Fn(&mut Random) -> f64) -> f64 {
        // Later samples of the pixels around change nothing any more.
        const AROUND_SAMPLES: u32 = 1000;
        let is_block = |index: usize| (index / 21).abs_diff(10) <= 3 && (index % 21).abs_diff(10) <= 3;
        let honest = (0..runs).filter(|seed| {
            let mut random = Random(0x9e37_79b9_7f4a_7c15 ^ u64::from(seed + 1) << 17);
            let mut sums = vec![Sums::default(); 441];
            let mut step = LEAST_SAMPLES;
            loop {
                for (index, sums) in sums.iter_mut().enumerate() {
                    let step = if is_block(index) || sums.count < AROUND_SAMPLES { step } else { 0 };
                    for _ in 0..step {
                        let value = sample(&mut random);
                        (sums.count, sums.sum, sums.squares) =
                            (sums.count + 1, sums.sum + value, sums.squares + value * value);
                    }
                }
                let near = PixelsNear { pixels: sums.iter().map(Sums::pixel).collect(), columns: 21, center: [10, 10] };
                if Block::new(&near).is_ready(threshold) {
                    let squared =
                        near.within(BLOCK_RADIUS_PX).iter().map(|pixel| (pixel.mean[0] - mean).powi(2)).sum::<f64>()
                            / 49.0;
                    return squared.sqrt() / mean <= threshold;
                }
                // A look every 10 % more samples, as the window does.
                step = (sums[220].count / 10).max(2);
            }
        });
        honest.count() as f64 / f64::from(runs)
    }

    #[test]
    fn when_it_says_ready_the_error_is_below_the_threshold_in_95_of_100_cases() {
        for threshold in [OUTLINE, MATERIAL] {
            // Even light, a half-shadow, a lamp that is found rarely, and one that few blocks have found when they look even.
            let uniform = truth(400, threshold, 0.5, Random::next);
            let shadow = truth(400, threshold, 0.3, |random| f64::from(u8::from(random.next() < 0.3)));
            let log_normal = truth(400, threshold, 0.5f64.exp(), |random| random.normal().exp());
            let rare = truth(400, threshold, 1.38, |random| if random.next() < 0.02 { 20.0 } else { 1.0 });
            let hidden = truth(50, threshold, 1.499, |random| if random.next() < 0.001 { 500.0 } else { 1.0 });
            eprintln!("threshold {threshold}: {uniform} {shadow} {log_normal} {rare} {hidden}");
            for share in [uniform, shadow, log_normal, rare, hidden] {
                assert!(share >= 0.95, "threshold {threshold}: {share}");
            }
        }
    }

    #[test]
    fn the_time_left_is_that_of_the_missing_samples() {
        let block = |samples: f64, error: f64| Block { samples, error: Some(error), ..Block::default() };
        let mut follower = Follower::default();
        let first = follower.update(Vec3::Z, block(10.0, 0.4), Duration::from_secs(1));
        assert_eq!((first.outline, first.material), (Progress::Left(None), Progress::Left(None)));
        // Ten samples a second; for half the error four times as many are needed.
        let second = follower.update(Vec3::Z, block(20.0, 0.4), Duration::from_secs(2));
        let Progress::Left(Some(left)) = second.outline else { panic!("{second:?}") };
        assert!((left.as_secs_f64() - 6.0).abs() < 1e-6);
        assert_eq!(follower.update(Vec3::Z, block(90.0, 0.19), Duration::from_secs(9)).outline, Progress::Ready);
        // Elsewhere nothing is known of the speed yet.
        assert_eq!(follower.update(Vec3::X, block(90.0, 0.3), Duration::from_secs(10)).outline, Progress::Left(None));
        assert_eq!(follower.update(Vec3::X, Block::default(), Duration::ZERO).outline, Progress::Unknown);
    }

    #[test]
    fn nothing_is_said_of_what_is_not_sampled() {
        assert_eq!(Block::new(&PixelsNear::default()), Block::default());
        let pixels = vec![FilmPixel { mean: [1.0; 3], samples: LEAST_SAMPLES - 1, variance_of_mean: 0.0 }; 9];
        assert_eq!(Block::of(&pixels, &pixels).error, None);
        let black = vec![FilmPixel { mean: [0.0; 3], samples: 100, variance_of_mean: 0.0 }; 9];
        assert!(Block::of(&black, &black).is_ready(MATERIAL));
    }
}
