//! Errors and biases over the runs of one way to place samples.

use serde_json::{Value, json};
use tracer::film::{FilmOptions, FilmSnapshot};

/// Outer edges of the regions about the gaze, degrees; the first is the foveal disc.
pub const EDGES_DEG: [f64; 3] = [5.79, 15.0, 40.0];
/// Part of the mean luminance that is added in the divisor of relative errors, as in the study.
const DARK_FLOOR: f64 = 0.1;
/// Part of the largest displayed luminance that the eye adds to what it sees.
const GLARE: f64 = 0.05;

/// The film's pixels that are looked at.
pub struct Pixels {
    /// Index in the film, region, solid angle.
    list: Vec<(usize, usize, f64)>,
}

impl Pixels {
    /// All within the last region.
    pub fn new(film: &FilmOptions) -> Self {
        let places = (0..film.pixels() as u32).map(|index| (index, super::place(film, index)));
        let list = places.filter_map(|(index, (degrees, weight))| {
            let region = EDGES_DEG.iter().position(|edge| degrees < *edge)?;
            Some((index as usize, region, weight))
        });
        Self { list: list.collect() }
    }
}

/// What the runs say together, pixel by pixel.
pub struct Truth {
    means: Vec<f64>,
    /// Median luminance, to which the eye is adapted.
    adaptation: f64,
    floor: f64,
}

/// Runs of different seeds.
#[derive(Default)]
pub struct Runs {
    /// Of each run, the pixels' luminance; NaN without a sample.
    pictures: Vec<Vec<f32>>,
    /// Of each run, mean samples of a foveal pixel.
    foveal_samples: Vec<f64>,
    seconds: Vec<f64>,
}

/// Mean over what is finite, with how many that are.
fn finite_mean(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (sum, count) = values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    (sum / count, count)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

impl Runs {
    /// Adds a run.
    pub fn push(&mut self, pixels: &Pixels, film: &FilmSnapshot, seconds: f64) {
        let of = |index: usize| {
            let pixel = film.pixel(index);
            if pixel.samples > 0 { pixel.luminance() as f32 } else { f32::NAN }
        };
        self.pictures.push(pixels.list.iter().map(|(index, _, _)| of(*index)).collect());
        let fovea = pixels.list.iter().filter(|(_, region, _)| *region == 0);
        self.foveal_samples.push(finite_mean(fovea.map(|(index, _, _)| f64::from(film.pixel(*index).samples))).0);
        self.seconds.push(seconds);
    }

    /// Means over the runs.
    pub fn truth(&self) -> Truth {
        let means: Vec<f64> =
            (0..self.pictures.first().map_or(0, Vec::len)).map(|pixel| self.of_pixel(pixel).0).collect();
        let adaptation = median(&means.iter().copied().filter(|mean| mean.is_finite()).collect::<Vec<_>>());
        let floor = (DARK_FLOOR * finite_mean(means.iter().copied()).0).powi(2);
        Truth { means, adaptation, floor }
    }

    /// Mean over the runs, variance of a run, and runs that have a sample there.
    fn of_pixel(&self, pixel: usize) -> (f64, f64, f64) {
        let values = || self.pictures.iter().map(|picture| f64::from(picture[pixel]));
        let (mean, count) = finite_mean(values());
        let squares = values().filter(|v| v.is_finite()).map(|v| (v - mean).powi(2)).sum::<f64>();
        (mean, squares / (count - 1.0), count)
    }

    /// Mean luminance of a region, run by run, over its pixels with a sample.
    fn region_means(&self, pixels: &Pixels, region: usize) -> Vec<f64> {
        let of = |picture: &Vec<f32>| {
            let known =
                pixels.list.iter().zip(picture).filter(|((_, of, _), value)| *of == region && value.is_finite());
            let (sum, weight) =
                known.fold((0.0, 0.0), |(s, w), ((_, _, weight), value)| (s + weight * f64::from(*value), w + weight));
            sum / weight
        };
        self.pictures.iter().map(of).collect()
    }

    /// The figures of this way beside the plain one.
    pub fn to_json(&self, name: &str, plain: &Self, pixels: &Pixels, truth: &Truth) -> Value {
        let regions: Vec<Value> =
            (0..EDGES_DEG.len()).map(|region| self.region(region, plain, pixels, truth)).collect();
        json!({
            "way": name,
            "seconds": median(&self.seconds),
            "samples_a_foveal_pixel": finite_mean(self.foveal_samples.iter().copied()).0,
            "regions": regions,
        })
    }

    fn region(&self, region: usize, plain: &Self, pixels: &Pixels, truth: &Truth) -> Value {
        // Sums over pixels: weight, relative squared error, the same as displayed, squared bias less its noise and its square.
        let (mut weight, mut relative, mut displayed) = (0.0, 0.0, 0.0);
        let mut biases = Vec::new();
        let chosen = pixels.list.iter().enumerate().filter(|(_, (_, of, _))| *of == region);
        for (pixel, (_, _, solid_angle)) in chosen {
            let ((mean, variance, runs), (of_plain, plain_variance, plain_runs)) =
                (self.of_pixel(pixel), plain.of_pixel(pixel));
            let expected = truth.means[pixel];
            // Pixels that some runs have no sample in are not compared.
            if runs < self.pictures.len() as f64 || plain_runs < plain.pictures.len() as f64 {
                continue;
            }
            let bright = expected / truth.adaptation;
            let shown = bright / (1.0 + bright);
            let slope = 1.0 / (truth.adaptation * (1.0 + bright).powi(2));
            weight += solid_angle;
            relative += solid_angle * variance / (expected * expected + truth.floor);
            displayed += solid_angle * variance * (slope / (shown + GLARE)).powi(2);
            let noise = variance / runs + plain_variance / plain_runs;
            biases.push(((mean - of_plain).powi(2) - noise) / (expected * expected + truth.floor));
        }
        let (bias_squared, count) = finite_mean(biases.iter().copied());
        let spread = biases.iter().map(|b| (b - bias_squared).powi(2)).sum::<f64>() / (count - 1.0);
        let (ours, theirs) = (self.region_means(pixels, region), plain.region_means(pixels, region));
        let of_mean = |values: &[f64]| {
            let (mean, n) = finite_mean(values.iter().copied());
            (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
        };
        let ((mean, mean_variance), (plain_mean, plain_variance)) = (of_mean(&ours), of_mean(&theirs));
        json!({
            "within_deg": EDGES_DEG[region],
            "pixels": count,
            "relative_squared_error": relative / weight,
            "displayed_squared_error": displayed / weight,
            "bias_of_mean": mean / plain_mean - 1.0,
            "bias_of_mean_standard_error": (mean_variance + plain_variance).sqrt() / plain_mean,
            "pixel_bias_squared": bias_squared,
            "pixel_bias_squared_standard_error": (spread / count).sqrt(),
        })
    }
}
