//! Errors and biases over the runs of the ways to place samples.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use tracer::film::{FilmOptions, FilmSnapshot};

/// Outer edges of the regions about the gaze, degrees; the first is the foveal disc.
pub const EDGES_DEG: [f64; 3] = [5.79, 15.0, 40.0];
/// Film pixels along the side of what is compared in each region: single ones where each has samples.
const SIDES: [u32; 3] = [1, 1, 4];
/// Part of the mean luminance that is added in the divisor of relative errors, as in the study.
const DARK_FLOOR: f64 = 0.1;
/// Part of the largest displayed luminance that the eye adds to what it sees.
const GLARE: f64 = 0.05;

/// What is compared: a pixel or a square of them.
struct Element {
    region: usize,
    /// Solid angle, in any unit.
    weight: f64,
    /// In the film.
    pixels: Vec<usize>,
}

/// All that is compared.
pub struct Elements(Vec<Element>);

impl Elements {
    /// All within the last region.
    pub fn new(film: &FilmOptions) -> Self {
        let mut elements: BTreeMap<(usize, u32, u32), Element> = BTreeMap::new();
        for index in 0..film.pixels() as u32 {
            let (degrees, weight) = super::place(film, index);
            let Some(region) = EDGES_DEG.iter().position(|edge| degrees < *edge) else { continue };
            let (x, y) = (index % film.width / SIDES[region], index / film.width / SIDES[region]);
            let element = || Element { region, weight: 0.0, pixels: Vec::new() };
            let element = elements.entry((region, y, x)).or_insert_with(element);
            element.weight += weight;
            element.pixels.push(index as usize);
        }
        Self(elements.into_values().collect())
    }
}

/// Runs of different seeds.
#[derive(Default)]
pub struct Runs {
    /// Of each run, the elements' luminance; NaN without a sample.
    pictures: Vec<Vec<f32>>,
    /// Of each run, mean samples of a pixel in each region.
    samples: Vec<[f64; 3]>,
    seconds: Vec<f64>,
}

/// The elements that all runs of all ways know, with what is true there.
pub struct Truth {
    /// Place among the elements, mean luminance over the plain runs.
    known: Vec<(usize, f64)>,
    /// Median luminance, to which the eye is adapted.
    adaptation: f64,
    dark: f64,
}

impl Truth {
    /// From the plain way's runs and the others'.
    pub fn new(plain: &Runs, all: &[Runs]) -> Self {
        let elements = plain.pictures.first().map_or(0, Vec::len);
        let is_known = |element: usize| all.iter().all(|way| way.values(element).all(f64::is_finite));
        let known: Vec<_> =
            (0..elements).filter(|e| is_known(*e)).map(|e| (e, mean_and_variance(plain.values(e)).0)).collect();
        let means: Vec<f64> = known.iter().map(|(_, mean)| *mean).collect();
        let dark = (DARK_FLOOR * mean_and_variance(means.iter().copied()).0).powi(2);
        Self { adaptation: median(&means), known, dark }
    }

    /// Luminance as it is displayed, in 0..1.
    fn displayed(&self, luminance: f64) -> f64 {
        let x = luminance / self.adaptation;
        x / (1.0 + x)
    }
}

/// Mean, and variance of a single value.
fn mean_and_variance(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let (sum, count) = values.clone().fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    let mean = sum / count;
    (mean, values.map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0))
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

impl Runs {
    /// Adds a run.
    pub fn push(&mut self, elements: &Elements, film: &FilmSnapshot, seconds: f64) {
        let of = |element: &Element| {
            let pixels = element.pixels.iter().map(|index| film.pixel(*index)).filter(|pixel| pixel.samples > 0);
            let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), p| (sum + p.luminance(), count + 1.0));
            (sum / count) as f32
        };
        self.pictures.push(elements.0.iter().map(of).collect());
        let mut counts = [(0.0, 0.0); 3];
        for element in &elements.0 {
            let (sum, pixels) = &mut counts[element.region];
            *sum += element.pixels.iter().map(|index| f64::from(film.pixel(*index).samples)).sum::<f64>();
            *pixels += element.pixels.len() as f64;
        }
        self.samples.push(counts.map(|(sum, pixels)| sum / pixels));
        self.seconds.push(seconds);
    }

    /// Of every run.
    fn values(&self, element: usize) -> impl Iterator<Item = f64> + Clone + '_ {
        self.pictures.iter().map(move |picture| f64::from(picture[element]))
    }

    /// The figures of this way beside the plain one.
    pub fn to_json(&self, name: &str, plain: &Self, elements: &Elements, truth: &Truth) -> Value {
        let regions: Vec<Value> =
            (0..EDGES_DEG.len()).map(|region| self.region(region, plain, elements, truth)).collect();
        json!({ "way": name, "seconds": median(&self.seconds), "regions": regions })
    }

    fn region(&self, region: usize, plain: &Self, elements: &Elements, truth: &Truth) -> Value {
        let known: Vec<(&Element, usize, f64)> = truth
            .known
            .iter()
            .map(|(index, mean)| (&elements.0[*index], *index, *mean))
            .filter(|(element, _, _)| element.region == region)
            .collect();
        let (mut weight, mut relative, mut displayed) = (0.0, 0.0, 0.0);
        let mut biases = Vec::new();
        for (element, index, expected) in &known {
            let divisor = expected * expected + truth.dark;
            let (_, variance) = mean_and_variance(self.values(*index));
            // Films of one seed have samples in common: their differences are taken seed by seed.
            let differences = self.values(*index).zip(plain.values(*index)).map(|(own, plain)| own - plain);
            let (difference, spread) = mean_and_variance(differences);
            let shown = truth.displayed(*expected);
            weight += element.weight;
            relative += element.weight * variance / divisor;
            displayed += element.weight * mean_and_variance(self.values(*index).map(|v| truth.displayed(v))).1
                / (shown + GLARE).powi(2);
            biases.push((difference * difference - spread / self.pictures.len() as f64) / divisor);
        }
        let (bias_squared, spread) = mean_and_variance(biases.iter().copied());
        let of_run = |picture: &Vec<f32>| -> f64 {
            known.iter().map(|(element, index, _)| element.weight * f64::from(picture[*index])).sum()
        };
        let differences = self.pictures.iter().zip(&plain.pictures).map(|(own, plain)| of_run(own) - of_run(plain));
        let (difference, difference_variance) = mean_and_variance(differences);
        let (of_plain, _) = mean_and_variance(plain.pictures.iter().map(of_run));
        json!({
            "within_deg": EDGES_DEG[region],
            "elements": known.len(),
            "pixels_of_an_element": SIDES[region] * SIDES[region],
            "samples_a_pixel": mean_and_variance(self.samples.iter().map(|run| run[region])).0,
            "relative_squared_error": relative / weight,
            "displayed_squared_error": displayed / weight,
            "bias_of_mean": difference / of_plain,
            "bias_of_mean_standard_error": (difference_variance / self.pictures.len() as f64).sqrt() / of_plain,
            "pixel_bias_squared": bias_squared,
            "pixel_bias_squared_standard_error": (spread / biases.len() as f64).sqrt(),
        })
    }
}
