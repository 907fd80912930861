//! Painted masks and error images: a weight for every pixel of an equirectangular image.

use crate::frame::Direction;
use crate::{Film, SamplerError};

/// Weights on an equirectangular grid: a painted mask, or an estimate of each pixel's error.
///
/// As a source its density is proportional to the weight per solid angle; as a factor it multiplies by the weight relative
/// to the largest.
#[derive(Clone, Debug)]
pub struct Mask {
    film: Film,
    weights: Vec<f64>,
    largest: f64,
    /// Cumulative weight times solid angle up to and including each row, and within each row.
    rows: Vec<f64>,
    columns: Vec<f64>,
}

impl Mask {
    /// From a row-major image, top row first.
    ///
    /// # Errors
    /// If the number of weights is not `width_px * height_px`, a weight is negative or not finite, or all are zero.
    pub fn new(width_px: u32, height_px: u32, weights: &[f32]) -> Result<Self, SamplerError> {
        let film = Film::equirectangular(width_px, height_px)?;
        if weights.len() as u64 != u64::from(width_px) * u64::from(height_px) {
            let value = weights.len() as f64;
            return Err(SamplerError::Parameter {
                what: "a mask's number of weights",
                value,
                requirement: "width x height",
            });
        }
        let weights: Vec<f64> = weights.iter().map(|w| f64::from(*w)).collect();
        if let Some(&value) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
            return Err(SamplerError::Parameter {
                what: "a mask's weight",
                value,
                requirement: "finite and not negative",
            });
        }
        let largest = weights.iter().fold(0.0, |a: f64, w| a.max(*w));
        if largest == 0.0 {
            return Err(SamplerError::Parameter {
                what: "a mask's largest weight",
                value: 0.0,
                requirement: "positive",
            });
        }
        let (mut rows, mut columns, mut total) = (Vec::new(), Vec::with_capacity(weights.len()), 0.0);
        for (y, row) in weights.chunks_exact(width_px as usize).enumerate() {
            let solid_angle = film.pixel_solid_angle([0, y as u32]);
            let mut in_row = 0.0;
            for weight in row {
                in_row += weight;
                columns.push(in_row);
            }
            total += in_row * solid_angle;
            rows.push(total);
        }
        Ok(Self { film, weights, largest, rows, columns })
    }

    fn weight(&self, direction: Direction) -> f64 {
        let [width, _] = self.film.size_px();
        self.film.pixel(direction).map_or(0.0, |[x, y]| self.weights[y as usize * width as usize + x as usize])
    }

    /// The weight at a unit direction relative to the largest, in `[0, 1]`.
    #[must_use]
    pub fn relative(&self, direction: Direction) -> f64 {
        self.weight(direction) / self.largest
    }

    /// The density per steradian.
    pub(super) fn pdf(&self, direction: Direction) -> f64 {
        self.weight(direction) / self.rows[self.rows.len() - 1]
    }

    /// A direction of this density for uniform `u`: a row, a column, and the place inside the pixel, uniform in solid angle.
    pub(super) fn sample(&self, u: [f64; 2]) -> Direction {
        let [width, height] = self.film.size_px();
        let (y, in_row) = pick(&self.rows, u[0]);
        let (x, in_column) = pick(&self.columns[y * width as usize..(y + 1) * width as usize], u[1]);
        let sine = |row: f64| (core::f64::consts::PI * (0.5 - row / f64::from(height))).sin();
        let (top, bottom) = (sine(y as f64), sine(y as f64 + 1.0));
        let sin_latitude = top + (bottom - top) * in_row;
        let cos_latitude = (1.0 - sin_latitude * sin_latitude).max(0.0).sqrt();
        let turns = (x as f64 + in_column) / f64::from(width) - 0.5;
        let (sin, cos) = (core::f64::consts::TAU * turns).sin_cos();
        [cos_latitude * sin, sin_latitude, -cos_latitude * cos]
    }
}

/// The entry of a cumulative table that `u` of its total falls in (never one of weight zero), and the place within.
fn pick(cumulative: &[f64], u: f64) -> (usize, f64) {
    let total = cumulative[cumulative.len() - 1];
    let target = u * total;
    // `<=` steps over entries of weight zero; the total itself belongs to the last entry of positive weight.
    let first_above = cumulative.partition_point(|c| *c <= target);
    let index = if first_above < cumulative.len() { first_above } else { cumulative.partition_point(|c| *c < total) };
    let start = if index == 0 { 0.0 } else { cumulative[index - 1] };
    (index, ((target - start) / (cumulative[index] - start)).clamp(0.0, 1.0))
}
