//! A film as a value on the host: what EXR files, merging and a lost device start from.

use super::FilmOptions;
use crate::kernels::FILM_WORDS;

/// A film's sums at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmSnapshot {
    /// Size and mapping.
    pub options: FilmOptions,
    /// The film's words, ten a pixel, row by row.
    pub words: Vec<u32>,
    /// Quanta per unit of radiance.
    pub radiance_scale: f64,
    /// Quanta per unit of luminance in the second moment.
    pub luminance_scale: f64,
    /// Samples traced in total.
    pub samples: u64,
}

/// A pixel's estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPixel {
    /// Mean radiance, linear Rec. 709; zero without a sample.
    pub mean: [f64; 3],
    /// Samples.
    pub samples: u32,
    /// Variance of the mean luminance; zero with fewer than two samples.
    pub variance_of_mean: f64,
}

impl FilmSnapshot {
    /// The estimate of pixel `index` (row by row), which must be below `options.pixels()`.
    pub fn pixel(&self, index: usize) -> FilmPixel {
        let words = &self.words[index * FILM_WORDS as usize..][..FILM_WORDS as usize];
        let samples = words[6];
        if samples == 0 {
            return FilmPixel::default();
        }
        let n = f64::from(samples);
        let sum = |i: usize| (u64::from(words[i]) | u64::from(words[i + 1]) << 32) as f64 / self.radiance_scale;
        let sums = [sum(0), sum(2), sum(4)];
        let mean = sums.map(|s| s / n);
        let mut variance_of_mean = 0.0;
        if samples > 1 {
            let squares = u128::from(words[7]) | u128::from(words[8]) << 32 | u128::from(words[9]) << 64;
            let squares = squares as f64 / (self.luminance_scale * self.luminance_scale);
            let luminance = 0.2126 * sums[0] + 0.7152 * sums[1] + 0.0722 * sums[2];
            variance_of_mean = ((squares - luminance * luminance / n) / (n - 1.0)).max(0.0) / n;
        }
        FilmPixel { mean, samples, variance_of_mean }
    }

    /// All estimates, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = FilmPixel> + '_ {
        (0..self.options.pixels() as usize).map(|index| self.pixel(index))
    }
}
