//! A film as a value on the host: what EXR files, merging, a headset and a lost device start from.

use super::FilmOptions;
use crate::{
    kernels::FILM_WORDS,
    renderer::{FilmPose, RenderStatistics, RendererOptions, SequenceKind},
    scene::ContentHash,
};

/// No sample has a larger index: sums of a few of them do not overflow.
pub(crate) const LAST_SAMPLE: u64 = 1 << 62;

/// Samples of one seed that follow each other in the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SampleRange {
    /// Seed.
    pub seed: u32,
    /// Index of the first.
    pub first: u64,
    /// How many.
    pub count: u64,
}

impl SampleRange {
    /// Index of the sample after the last.
    pub const fn end(&self) -> u64 {
        self.first.saturating_add(self.count)
    }

    /// Whether some sample is in both.
    pub const fn overlaps(&self, other: &Self) -> bool {
        self.seed == other.seed && self.first < other.end() && other.first < self.end()
    }
}

/// What a film's sums are sums of.
///
/// How samples were spread (mode, gaze) is no part of it: a pixel's samples have the same distribution in every mode.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmHeader {
    /// Size and mapping.
    pub options: FilmOptions,
    /// Where the film stood and looked.
    pub pose: FilmPose,
    /// [`Scene::content_hash`](crate::scene::Scene::content_hash) of what it shows.
    pub scene: ContentHash,
    /// Indirect bounces.
    pub max_bounces: u32,
    /// Where random numbers came from.
    pub sequence: SequenceKind,
    /// Quanta per unit of radiance.
    pub radiance_scale: f64,
    /// Quanta per unit of luminance in the second moment.
    pub luminance_scale: f64,
    /// Which samples are in the film, by seed and first index; none touches another.
    pub ranges: Vec<SampleRange>,
    /// What was counted while they were traced.
    pub statistics: RenderStatistics,
}

/// A film's sums at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmSnapshot {
    /// What they are sums of.
    pub header: FilmHeader,
    /// The film's words, ten a pixel, row by row: sums of R, G and B of 64 bits each, the number of samples, the sum of
    /// squared luminance of 96 bits; low words first.
    pub words: Vec<u32>,
}

/// A film value whose parts do not fit each other.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DamagedFilm {
    /// Not the words that its size needs.
    #[error("a film of {width}x{height} pixels has {expected} words, not {found}")]
    Words {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Words of such a film.
        expected: u64,
        /// Words that there are.
        found: usize,
    },
    /// Ranges out of order, in each other, or beyond 2^62.
    #[error("the film's ranges of samples contradict each other")]
    Ranges,
    /// More samples by the film's own noise than it holds.
    #[error("of the film's {samples} samples {steered} are said to be placed by its noise")]
    Steered {
        /// In the film.
        samples: u64,
        /// Of them, by the header.
        steered: u64,
    },
}

/// A setting in which two films, or a film and a renderer, differ: their samples cannot be in one film.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{setting}: {found} instead of {expected}")]
pub struct FilmDifference {
    /// Its name.
    pub setting: &'static str,
    /// The value of the film or renderer that was there first.
    pub expected: String,
    /// The value of the other film.
    pub found: String,
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

impl FilmHeader {
    /// Samples in the film.
    pub fn samples(&self) -> u64 {
        self.ranges.iter().fold(0, |sum, range| sum.saturating_add(range.count))
    }

    /// The first setting in which `other` differs so that its samples are of another picture or in other quanta.
    ///
    /// # Errors
    /// The setting with both values.
    pub fn matches(&self, other: &Self) -> Result<(), FilmDifference> {
        for ((setting, expected), (_, found)) in self.settings().into_iter().zip(other.settings()) {
            if expected != found {
                return Err(FilmDifference { setting, expected, found });
            }
        }
        Ok(())
    }

    /// What films whose samples may be added have in common.
    fn settings(&self) -> [(&'static str, String); 9] {
        [
            ("film size", format!("{}x{}", self.options.width, self.options.height)),
            ("film mapping", format!("{:?}", self.options.mapping)),
            ("scene", self.scene.to_string()),
            ("position", format!("{:?}", self.pose.position.to_array())),
            ("orientation", format!("{:?}", self.pose.world_from_film.to_array())),
            ("max bounces", self.max_bounces.to_string()),
            ("sequence", format!("{:?}", self.sequence)),
            ("radiance scale", format!("{:?}", self.radiance_scale)),
            ("luminance scale", format!("{:?}", self.luminance_scale)),
        ]
    }

    /// The options of a renderer that goes on with this film: its seed is that of the longest range.
    pub fn renderer_options(&self) -> RendererOptions {
        let longest = self.ranges.iter().max_by_key(|range| range.count);
        RendererOptions {
            film: self.options,
            max_bounces: self.max_bounces,
            seed: longest.map_or(RendererOptions::default().seed, |range| range.seed),
            sequence: self.sequence,
        }
    }
}

impl FilmSnapshot {
    /// Whether the parts of this value fit each other, as they do unless it was read from a damaged file.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self) -> Result<(), DamagedFilm> {
        let expected = self.header.options.pixels() * u64::from(FILM_WORDS);
        if self.words.len() as u64 != expected {
            let (width, height) = (self.header.options.width, self.header.options.height);
            return Err(DamagedFilm::Words { width, height, expected, found: self.words.len() });
        }
        let ranges = &self.header.ranges;
        let apart = |pair: &[SampleRange]| pair[0] < pair[1] && !pair[0].overlaps(&pair[1]);
        let in_range = |range: &SampleRange| range.end() <= LAST_SAMPLE;
        if !ranges.iter().all(in_range) || !ranges.windows(2).all(apart) || self.header.samples() > LAST_SAMPLE {
            return Err(DamagedFilm::Ranges);
        }
        let (samples, steered) = (self.header.samples(), self.header.statistics.steered);
        if steered > samples {
            return Err(DamagedFilm::Steered { samples, steered });
        }
        Ok(())
    }

    /// The estimate of pixel `index` (row by row), which must be below the film's number of pixels.
    pub fn pixel(&self, index: usize) -> FilmPixel {
        let words = &self.words[index * FILM_WORDS as usize..][..FILM_WORDS as usize];
        FilmPixel::from_words(words, self.header.radiance_scale, self.header.luminance_scale)
    }

    /// Samples that fell on the film, also those that were not finite; a perspective film may have some that fell beside it.
    pub fn samples_on_film(&self) -> u64 {
        let counts = self.words.chunks_exact(FILM_WORDS as usize).map(|words| u64::from(words[6]));
        counts.sum::<u64>() + u64::from(self.header.statistics.non_finite)
    }

    /// All estimates, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = FilmPixel> + '_ {
        (0..self.header.options.pixels() as usize).map(|index| self.pixel(index))
    }
}

impl FilmPixel {
    /// From a pixel's ten words and the quanta per unit of radiance and of luminance.
    pub(crate) fn from_words(words: &[u32], radiance_scale: f64, luminance_scale: f64) -> Self {
        let samples = words[6];
        if samples == 0 {
            return Self::default();
        }
        let n = f64::from(samples);
        let sum = |i: usize| (u64::from(words[i]) | u64::from(words[i + 1]) << 32) as f64 / radiance_scale;
        let sums = [sum(0), sum(2), sum(4)];
        let mean = sums.map(|s| s / n);
        let mut variance_of_mean = 0.0;
        if samples > 1 {
            let squares = u128::from(words[7]) | u128::from(words[8]) << 32 | u128::from(words[9]) << 64;
            let squares = squares as f64 / (luminance_scale * luminance_scale);
            let luminance = 0.2126 * sums[0] + 0.7152 * sums[1] + 0.0722 * sums[2];
            variance_of_mean = ((squares - luminance * luminance / n) / (n - 1.0)).max(0.0) / n;
        }
        Self { mean, samples, variance_of_mean }
    }

    /// Luminance of the mean, by Rec. 709.
    #[must_use]
    pub fn luminance(&self) -> f64 {
        0.2126 * self.mean[0] + 0.7152 * self.mean[1] + 0.0722 * self.mean[2]
    }
}

/// Puts ranges in order and joins those that follow each other.
pub(crate) fn joined(mut ranges: Vec<SampleRange>) -> Vec<SampleRange> {
    ranges.retain(|range| range.count > 0);
    ranges.sort_unstable();
    ranges.dedup_by(|next, last| {
        let follows = next.seed == last.seed && next.first == last.end();
        if follows {
            last.count += next.count;
        }
        follows
    });
    ranges
}
