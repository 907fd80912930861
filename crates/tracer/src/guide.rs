//! Adaptive sampling: a factor on the density of a distribution, by how noisy the film is where its samples fall.
//!
//! The unit square of a sample's first two numbers is cut into cells of equal area, so that without a guide each gets as many
//! samples as any other. In FV a cell therefore holds the same number of elements that the eye tells apart, near the gaze as in
//! the periphery: equal noise in two cells is equally visible, and acuity needs no further regard. A guide gives each cell a weight
//! and moves points between cells accordingly, linearly within each (`shaders/sampling/guide.wesl`).
//!
//! **The weight** is [`FLOOR`] plus a part in proportion to the standard deviation of a single sample as it is seen, which
//! minimises the sum of the cells' variances (Neyman 1934); where the standard error has fallen below [`VISIBLE_ERROR`], by its
//! square over that of the threshold less. *As it is seen*: of luminance after a global tone map x / (1 + x) about the median cell
//! (Reinhard et al. 2002), relative to that value and 0.05, which the eye adds.

use crate::kernels::layout::CellNoise;

/// Columns of cells for each row: along the first number, the radius in FV, cells are cut finer than around the gaze.
pub const GUIDE_COLUMNS_PER_ROW: u32 = 4;
/// A cell is judged at so many points along each axis.
pub const GUIDE_POINTS: u32 = 4;
/// Weight that every cell keeps, of a mean of 1: the least density relative to that without a guide.
pub const FLOOR: f32 = 0.25;
/// Largest deviation of a cell that counts, relative to the median cell's; more would follow single bright samples.
pub const LARGEST_DEVIATION: f32 = 4.0;
/// Standard error of the displayed luminance, relative to it, below which no difference is seen: Weber's fraction in good light.
pub const VISIBLE_ERROR: f32 = 0.01;
/// Displayed luminance, of at most 1, that the eye adds to what it sees: scattered light.
const DARK: f32 = 0.05;
/// Degrees of freedom with which the median cell's relative variance counts in each.
const PRIOR_FREEDOM: f32 = 8.0;
/// Pixels of the eye's elements that a cell has at least.
const ELEMENTS_PER_CELL: f64 = 4.0;
/// Samples of an element at the gaze when noise is first judged.
const FIRST_SAMPLES: f64 = 4.0;

/// Densities of the unit square's cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Guide {
    rows: u32,
    /// Column by column, relative to a mean of 1; all positive.
    densities: Vec<f32>,
}

impl Guide {
    /// Weights column by column, [`GUIDE_COLUMNS_PER_ROW`] times `rows` columns of `rows` cells; only their ratios count: the
    /// density becomes [`FLOOR`] plus, in proportion to them, what is left. `None` when the number of weights is another, `rows`
    /// is 0, a weight is negative or not finite, or none is positive.
    pub fn from_weights(weights: &[f32], rows: u32) -> Option<Self> {
        let columns = rows.checked_mul(GUIDE_COLUMNS_PER_ROW)?;
        let cells = u64::from(columns) * u64::from(rows);
        let sum: f64 = weights.iter().map(|weight| f64::from(*weight)).sum();
        let is_weight = |weight: &f32| weight.is_finite() && *weight >= 0.0;
        if cells == 0 || weights.len() as u64 != cells || !weights.iter().all(is_weight) || sum <= 0.0 {
            return None;
        }
        let mean = sum / cells as f64;
        let floor = f64::from(FLOOR);
        let mixed = |weight: &f32| (floor + (1.0 - floor) * f64::from(*weight) / mean) as f32;
        Some(Self { rows, densities: weights.iter().map(mixed).collect() })
    }

    /// What the noise of a film's cells asks for; `elements` are, column by column, film pixels that the eye does not tell apart.
    /// `None` where the film knows nothing yet.
    pub(crate) fn from_noise(cells: &[CellNoise], elements: &[f32], rows: u32) -> Option<Self> {
        let pooled = pooled(cells, rows as usize);
        let errors = visible_errors(&pooled)?;
        let largest = match median(errors.iter().copied()) {
            Some(median) if median > 0.0 => LARGEST_DEVIATION * median,
            _ => f32::MAX,
        };
        let of_cell = |(index, error): (usize, f32)| {
            let cell = &pooled[index];
            let of_element = cell.samples / cell.points.max(1.0) * elements.get(index / rows as usize)?;
            let seen = error * error / of_element.max(1.0) / (VISIBLE_ERROR * VISIBLE_ERROR);
            Some(error.min(largest) * seen.min(1.0))
        };
        let weights: Vec<f32> = errors.into_iter().enumerate().map(of_cell).collect::<Option<_>>()?;
        Self::from_weights(&weights, rows)
    }

    /// Rows of cells.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Density of each cell relative to that without a guide, column by column.
    pub fn densities(&self) -> &[f32] {
        &self.densities
    }

    /// What is asked for at a point of the unit square beyond the floor that every cell keeps; its mean is 1.
    pub(crate) fn wish(&self, [x, y]: [f64; 2]) -> f64 {
        let columns = self.rows * GUIDE_COLUMNS_PER_ROW;
        let cell = |place: f64, count: u32| ((place * f64::from(count)) as usize).min(count as usize - 1);
        let density = self.densities[cell(x, columns) * self.rows as usize + cell(y, self.rows)];
        (f64::from(density - FLOOR) / f64::from(1.0 - FLOOR)).max(0.0)
    }

    /// As many cells of another unit square, with densities in proportion to these, which are positive.
    pub(crate) fn with_densities(&self, density: impl Fn(usize) -> f64) -> Self {
        let densities: Vec<f64> = (0..self.densities.len()).map(density).collect();
        let mean = densities.iter().sum::<f64>() / densities.len() as f64;
        Self { rows: self.rows, densities: densities.into_iter().map(|density| (density / mean) as f32).collect() }
    }

    /// As the kernels read it: a CDF over the columns, then one over the cells of each column; each begins with 0 and ends with 1.
    pub(crate) fn table(&self) -> Vec<f32> {
        let columns = || self.densities.chunks_exact(self.rows as usize);
        let densities = |column: &'_ [f32]| column.iter().copied().map(f64::from).collect::<Vec<_>>();
        let mut bounds = cdf(columns().map(|column| densities(column).iter().sum()));
        bounds.extend(columns().flat_map(|column| cdf(densities(column).into_iter())));
        bounds
    }
}

/// Rows of cells for a distribution that gives `largest_share` of its samples to one pixel.
pub(crate) fn rows(largest_share: f64) -> u32 {
    let cells = 1.0 / (largest_share * ELEMENTS_PER_CELL);
    let rows = (cells / f64::from(GUIDE_COLUMNS_PER_ROW)).sqrt().clamp(8.0, 64.0);
    1 << rows.log2() as u32
}

/// Samples after which noise is first judged: a power of two.
pub(crate) fn first_samples(largest_share: f64) -> u64 {
    ((FIRST_SAMPLES / largest_share) as u64).clamp(1, 1 << 40).next_power_of_two()
}

/// Bounds of the parts of 0..1 in proportion to positive weights.
fn cdf(weights: impl Iterator<Item = f64> + Clone) -> Vec<f32> {
    let sum: f64 = weights.clone().sum();
    let mut until = 0.0;
    let mut bounds: Vec<f32> = std::iter::once(0.0)
        .chain(weights.map(|weight| {
            until += weight / sum;
            until as f32
        }))
        .collect();
    if let Some(last) = bounds.last_mut() {
        *last = 1.0;
    }
    bounds
}

fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Each cell with its neighbours in the 3 x 3 around it, so that what chance did to one pixel does not decide how many samples
/// that pixel gets.
fn pooled(cells: &[CellNoise], rows: usize) -> Vec<CellNoise> {
    let columns = cells.len() / rows.max(1);
    let mut pooled = Vec::with_capacity(cells.len());
    for (x, y) in (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y))) {
        let mut sum = CellNoise { points: 0.0, samples: 0.0, light: 0.0, freedom: 0.0, squares: 0.0 };
        let neighbours = (x.saturating_sub(1)..(x + 2).min(columns))
            .flat_map(|x| (y.saturating_sub(1)..(y + 2).min(rows)).map(move |y| x * rows + y));
        for cell in neighbours.map(|index| cells[index]) {
            sum.points += cell.points;
            sum.samples += cell.samples;
            sum.light += cell.light;
            sum.freedom += cell.freedom;
            sum.squares += cell.squares;
        }
        pooled.push(sum);
    }
    pooled
}

/// Standard deviation of a single sample as it is seen, cell by cell. `None` where nothing is known or all is dark.
fn visible_errors(cells: &[CellNoise]) -> Option<Vec<f32>> {
    let sampled = cells.iter().filter(|cell| cell.samples > 0.0);
    let adaptation = median(sampled.map(|cell| cell.light / cell.samples)).filter(|mean| *mean > 0.0)?;
    let relative = |cell: &CellNoise| {
        let mean = cell.light / cell.samples / adaptation;
        cell.squares / cell.freedom / (adaptation * adaptation) / (mean * mean + DARK * DARK)
    };
    let known = || cells.iter().filter(|cell| cell.samples > 0.0 && cell.freedom > 0.0);
    // Variance relative to the squared mean: what a cell is taken to have before it says otherwise.
    let prior = median(known().map(relative))?;
    let error = |cell: &CellNoise| {
        let mean = if cell.samples > 0.0 { cell.light / cell.samples / adaptation } else { 1.0 };
        let of_prior = PRIOR_FREEDOM * prior * (mean * mean + DARK * DARK);
        let variance = (cell.squares / (adaptation * adaptation) + of_prior) / (cell.freedom + PRIOR_FREEDOM);
        let slope = 1.0 / ((1.0 + mean) * (1.0 + mean));
        variance.max(0.0).sqrt() * slope / (mean / (1.0 + mean) + DARK)
    };
    let errors: Vec<f32> = cells.iter().map(error).collect();
    (errors.iter().all(|error| error.is_finite()) && errors.iter().any(|error| *error > 0.0)).then_some(errors)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const ROWS: u32 = 8;
    const COLUMNS: u32 = ROWS * GUIDE_COLUMNS_PER_ROW;

    /// A film of one luminance, `samples` a pixel, with this relative standard deviation in each column.
    fn film(samples: f32, deviation: impl Fn(u32) -> f32) -> Vec<CellNoise> {
        let points = (GUIDE_POINTS * GUIDE_POINTS) as f32;
        let cell = |column: u32| CellNoise {
            points,
            samples: points * samples,
            light: points * samples * 3e9,
            freedom: points * (samples - 1.0),
            squares: points * (samples - 1.0) * (deviation(column) * 3e9).powi(2),
        };
        (0..COLUMNS).flat_map(|x| (0..ROWS).map(move |_| x)).map(cell).collect()
    }

    fn guide(cells: &[CellNoise]) -> Option<Guide> {
        Guide::from_noise(cells, &[1.0; COLUMNS as usize], ROWS)
    }

    #[test]
    fn even_noise_leaves_the_density_as_it_is() {
        for density in guide(&film(16.0, |_| 0.7)).unwrap().densities() {
            assert!((density - 1.0).abs() < 1e-3, "{density}");
        }
    }

    #[test]
    fn weights_follow_the_deviation_above_their_floor() {
        let guide = guide(&film(16.0, |x| if x < COLUMNS / 2 { 1.0 } else { 0.5 })).unwrap();
        let densities = guide.densities();
        // Neyman: 4/3 and 2/3 of the mean, with a quarter that all have; the prior draws them a little closer.
        let (first, last) = (densities[0], densities[densities.len() - 1]);
        assert!((first - 1.25).abs() < 0.03 && (last - 0.75).abs() < 0.03, "{first} {last}");
        assert!((densities.iter().sum::<f32>() / densities.len() as f32 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn what_the_eye_cannot_see_any_more_gets_the_floor() {
        // A hundredth of the threshold in one half; the noise of the other is seen.
        let cells = film(1e4, |x| if x < COLUMNS / 2 { 0.1 } else { 8.0 });
        let guide = guide(&cells).unwrap();
        let densities = guide.densities();
        assert!((densities[0] - FLOOR).abs() < 0.02, "{}", densities[0]);
        // In elements of as many pixels, both halves are done, and what is left goes where most is left.
        let wide = Guide::from_noise(&cells, &[1e4; COLUMNS as usize], ROWS).unwrap();
        assert!(wide.densities().iter().all(|density| *density > 0.9 * FLOOR));
    }

    #[test]
    fn every_cell_keeps_the_floor_whatever_is_asked_for() {
        let mut weights = vec![0.0; (COLUMNS * ROWS) as usize];
        weights[37] = 1e30;
        let single = Guide::from_weights(&weights, ROWS).unwrap();
        let densities = single.densities();
        assert!(densities.iter().all(|density| *density >= 0.99 * FLOOR), "{densities:?}");
        assert!(densities[37] > 100.0);
        let cells = film(16.0, |x| if x == 5 { 1e6 } else { 1e-6 });
        assert!(guide(&cells).unwrap().densities().iter().all(|density| *density >= 0.99 * FLOOR));
    }

    #[test]
    fn a_single_bright_sample_moves_little() {
        let mut cells = film(16.0, |_| 0.5);
        cells[100].squares *= 1e6;
        let guide = guide(&cells).unwrap();
        let densities = guide.densities();
        assert!(densities.iter().all(|density| *density <= FLOOR + (1.0 - FLOOR) * LARGEST_DEVIATION));
    }

    #[test]
    fn what_says_nothing_gives_no_guide() {
        assert_eq!(guide(&film(1.0, |_| 1.0)), None, "one sample a pixel has no variance");
        assert_eq!(guide(&film(16.0, |_| 0.0)), None, "without noise there is nothing to follow");
        let dark: Vec<_> = film(16.0, |_| 1.0).into_iter().map(|cell| CellNoise { light: 0.0, ..cell }).collect();
        assert_eq!(guide(&dark), None);
        for wrong in [f32::NAN, f32::INFINITY] {
            let odd: Vec<_> =
                film(16.0, |_| 1.0).into_iter().map(|cell| CellNoise { squares: wrong, ..cell }).collect();
            assert_eq!(guide(&odd), None);
            assert_eq!(Guide::from_weights(&[wrong; (COLUMNS * ROWS) as usize], ROWS), None);
        }
        assert_eq!(Guide::from_weights(&[1.0; 7], ROWS), None);
        assert_eq!(Guide::from_weights(&[], 0), None);
        assert_eq!(Guide::from_weights(&[0.0; (COLUMNS * ROWS) as usize], ROWS), None);
    }

    #[test]
    fn cells_and_the_first_judgement_suit_the_film() {
        // FV at the gaze on 2048x1024 and 512x256, and OD on 16384x8192.
        for (share, expected_rows, expected_samples) in
            [(60.5 / 2_097_152.0, 32, 1 << 18), (60.5 / 131_072.0, 8, 1 << 14), (1.0 / 134_217_728.0, 64, 1 << 29)]
        {
            assert_eq!((rows(share), first_samples(share)), (expected_rows, expected_samples), "{share}");
        }
    }
}
