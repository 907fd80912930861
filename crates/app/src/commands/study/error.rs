//! Relative squared error against two independent references, by region.
//!
//! With x an estimate and r1, r2 two references of one true value, all independent and unbiased, the mean of
//! (x - r1)(x - r2) is the variance of x: the references' own noise drops out. Each pixel's is divided by the square of its
//! reference luminance (mean of 3 x 3 pixels) plus the square of a tenth of the film's mean luminance, so that dark pixels
//! count no more than they are seen; pixels are weighted by solid angle. The divisor is the same for all that is compared.

use glam::Vec3;
use tracer::distribution::{View, film_direction};
use tracer::film::{FilmOptions, FilmSnapshot};

use super::plan::{Place, RING_EDGES_DEG};

/// Part of the film's mean luminance that is added to a pixel's in the divisor.
const DARK_FLOOR: f64 = 0.1;
/// Rings of eccentricity, the foveal disc included.
pub const RINGS: usize = RING_EDGES_DEG.len();

/// A linear colour.
pub type Rgb = [f32; 3];

/// Luminance of linear Rec. 709.
pub fn luminance(rgb: Rgb) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

/// Two independent pictures of one true one, with each pixel's divisor.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Linear.
    pub pictures: [Vec<Rgb>; 2],
    /// Divisors of the squared error.
    pub divisors: Vec<f64>,
}

impl Reference {
    /// From two pictures of a width. `mean_luminance` is the film's.
    pub fn new(pictures: [Vec<Rgb>; 2], width: usize, mean_luminance: f64) -> Self {
        let both: Vec<f64> =
            pictures[0].iter().zip(&pictures[1]).map(|(a, b)| 0.5 * (luminance(*a) + luminance(*b))).collect();
        let height = both.len() / width.max(1);
        let floor = (DARK_FLOOR * mean_luminance).powi(2).max(f64::MIN_POSITIVE);
        let mut divisors = Vec::with_capacity(both.len());
        for y in 0..height {
            for x in 0..width {
                let (mut sum, mut count) = (0.0, 0.0);
                for row in y.saturating_sub(1)..(y + 2).min(height) {
                    for column in x.saturating_sub(1)..(x + 2).min(width) {
                        sum += both[row * width + column];
                        count += 1.0;
                    }
                }
                let mean: f64 = sum / count;
                divisors.push(mean * mean + floor);
            }
        }
        Self { pictures, divisors }
    }

    /// A pixel's squared error relative to its luminance: unbiased, and of either sign when it is small.
    pub fn relative_square(&self, pixel: usize, x: [f64; 3]) -> f64 {
        let [a, b] = [self.pictures[0][pixel], self.pictures[1][pixel]];
        let product: f64 = (0..3).map(|c| (x[c] - f64::from(a[c])) * (x[c] - f64::from(b[c]))).sum();
        product / 3.0 / self.divisors[pixel]
    }
}

/// Which pixels lie where, seen from a gaze.
#[derive(Clone, Debug)]
pub struct Regions {
    /// Ring of eccentricity; [`RINGS`] beyond the last.
    pub ring: Vec<u8>,
    /// Whether the pixel's centre lies in the view.
    pub in_view: Vec<bool>,
    /// Solid angle, in any unit.
    pub weight: Vec<f64>,
}

impl Regions {
    /// Of a panorama's pixels.
    pub fn of_film(film: &FilmOptions, place: &Place) -> Self {
        let mut regions = Self { ring: Vec::new(), in_view: Vec::new(), weight: Vec::new() };
        for y in 0..film.height {
            for x in 0..film.width {
                let in_film = film_direction(film, x, y);
                let world = place.world_from_film * in_film;
                let in_view = place.view.project(world).is_some_and(|point| point.abs().max_element() <= 1.0);
                regions.push(ring(world, place), in_view, f64::from(in_film.x.hypot(in_film.z)));
            }
        }
        regions
    }

    /// Of the pixels of a picture of the place's view, `side` across and up.
    pub fn of_view(side: u32, place: &Place) -> Self {
        let mut regions = Self { ring: Vec::new(), in_view: Vec::new(), weight: Vec::new() };
        for y in 0..side {
            for x in 0..side {
                let world = view_direction(&place.view, x, y, side);
                let cosine = f64::from(world.dot(place.gaze.direction).max(0.0));
                regions.push(ring(world, place), true, cosine.powi(3));
            }
        }
        regions
    }

    fn push(&mut self, ring: u8, in_view: bool, weight: f64) {
        self.ring.push(ring);
        self.in_view.push(in_view);
        self.weight.push(weight);
    }

    /// Pixels of the foveal disc.
    pub fn fovea(&self) -> impl Iterator<Item = usize> + '_ {
        self.ring.iter().enumerate().filter(|(_, ring)| **ring == 0).map(|(pixel, _)| pixel)
    }
}

fn view_direction(view: &View, x: u32, y: u32, side: u32) -> Vec3 {
    let at = |pixel: u32| (2.0 * (f64::from(pixel) + 0.5) / f64::from(side) - 1.0) as f32;
    view.direction(glam::Vec2::new(at(x), -at(y)))
}

fn ring(world: Vec3, place: &Place) -> u8 {
    // The chord keeps its precision near the gaze, where the cosine does not.
    let chord = f64::from(world.distance(place.gaze.direction));
    let eccentricity_deg = (2.0 * (0.5 * chord).min(1.0).asin()).to_degrees();
    RING_EDGES_DEG.iter().position(|edge| eccentricity_deg <= *edge).unwrap_or(RINGS) as u8
}

/// Weighted means by region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// By ring; NaN without a pixel.
    pub rings: [f64; RINGS],
    /// In the view.
    pub view: f64,
    /// Everywhere.
    pub whole: f64,
}

/// Means of a pixel's errors by region. Pixels without a value are left out.
pub fn by_region(regions: &Regions, error: impl Fn(usize) -> Option<f64>) -> Errors {
    let (mut rings, mut view, mut whole) = ([[0.0; 2]; RINGS], [0.0; 2], [0.0; 2]);
    for (pixel, weight) in regions.weight.iter().enumerate() {
        let Some(error) = error(pixel) else { continue };
        let add = |sums: &mut [f64; 2]| {
            sums[0] += weight * error;
            sums[1] += weight;
        };
        if let Some(ring) = rings.get_mut(regions.ring[pixel] as usize) {
            add(ring);
        }
        if regions.in_view[pixel] {
            add(&mut view);
        }
        add(&mut whole);
    }
    let mean = |sums: [f64; 2]| sums[0] / sums[1];
    Errors { rings: rings.map(mean), view: mean(view), whole: mean(whole) }
}

/// A film's estimates with what its own second moments say of their error.
#[derive(Clone, Debug)]
pub struct Film {
    /// Mean, samples, variance of the mean's luminance.
    pixels: Vec<tracer::film::FilmPixel>,
}

/// What is measured in the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmMeasures {
    /// Over pixels that have a sample.
    pub errors: Errors,
    /// Share of the fovea's pixels without a sample.
    pub empty: f64,
    /// The fovea's relative variance of luminance by the film's second moments, over pixels with at least two samples; no
    /// reference is used.
    pub variance: f64,
}

impl Film {
    /// Of a film at one moment.
    pub fn new(snapshot: &FilmSnapshot) -> Self {
        Self { pixels: snapshot.pixels().collect() }
    }

    /// Linear means.
    pub fn means(&self) -> Vec<Rgb> {
        self.pixels.iter().map(|pixel| pixel.mean.map(|c| c as f32)).collect()
    }

    /// Measures it.
    pub fn measure(&self, reference: &Reference, regions: &Regions) -> FilmMeasures {
        let pixels = &self.pixels;
        let errors = by_region(regions, |pixel| {
            (pixels[pixel].samples > 0).then(|| reference.relative_square(pixel, pixels[pixel].mean))
        });
        let [mut empty, mut all] = [0.0; 2];
        for pixel in regions.fovea() {
            all += regions.weight[pixel];
            empty += if pixels[pixel].samples == 0 { regions.weight[pixel] } else { 0.0 };
        }
        let variance = by_region(regions, |pixel| {
            (regions.ring[pixel] == 0 && pixels[pixel].samples > 1)
                .then(|| pixels[pixel].variance_of_mean / reference.divisors[pixel])
        });
        FilmMeasures { errors, empty: empty / all, variance: variance.whole }
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::cli::values::GazeAngles;
    use crate::commands::study::statistics::SplitMix;

    const SIDE: usize = 64;

    fn place() -> Place {
        Place::new(GazeAngles { yaw_deg: 20.0, pitch_deg: 10.0 }, Quat::IDENTITY)
    }

    fn picture(truth: f64, sigma: f64, stream: u32) -> Vec<Rgb> {
        // Uniform, of variance one.
        let mut random = SplitMix(u64::from(stream));
        let mut noise = || 12f64.sqrt() * (random.uniform() - 0.5);
        (0..SIDE * SIDE).map(|_| [0; 3].map(|_| (truth + sigma * noise()) as f32)).collect()
    }

    /// Mean of the error of a picture of noise 0.1 against references as noisy, truth 2.
    fn measured(references: [Vec<Rgb>; 2]) -> f64 {
        let reference = Reference::new(references, SIDE, 2.0);
        let x = picture(2.0, 0.1, 1);
        let regions = Regions::of_view(SIDE as u32, &place());
        by_region(&regions, |i| Some(reference.relative_square(i, x[i].map(f64::from)))).whole
    }

    #[test]
    fn a_known_variance_is_found_whatever_the_references_noise() {
        // 0.1^2 over 2^2 + 0.2^2.
        let expected = 0.01 / 4.04;
        for sigma in [0.0, 0.1, 0.3] {
            let found = measured([picture(2.0, sigma, 2), picture(2.0, sigma, 3)]);
            // Three standard errors of the products of noises, over 3 x 64 x 64 values.
            let tolerance = 0.04 + 3.0 * sigma * sigma / 0.01 / 12_288f64.sqrt();
            assert!((found / expected - 1.0).abs() < tolerance, "sigma {sigma}: {found} is not {expected}");
        }
        // The fault that two references are there to avoid: one reference's noise counts as error.
        let one = picture(2.0, 0.1, 2);
        let faulty = measured([one.clone(), one]);
        assert!((faulty / expected - 2.0).abs() < 0.12, "{faulty}");
    }

    #[test]
    fn a_bias_counts_by_its_square() {
        let reference = Reference::new([picture(1.0, 0.0, 1), picture(1.0, 0.0, 2)], SIDE, 1.0);
        let found = reference.relative_square(5, [1.5; 3]);
        assert!((found - 0.25 / 1.01).abs() < 1e-6);
    }

    #[test]
    fn regions_cover_their_solid_angles() {
        let film = FilmOptions::equirect(512, 256);
        let place = place();
        let regions = Regions::of_film(&film, &place);
        let all: f64 = regions.weight.iter().sum();
        let share = |inside: &dyn Fn(usize) -> bool| {
            (0..regions.weight.len()).filter(|i| inside(*i)).map(|i| regions.weight[i]).sum::<f64>() / all
        };
        let mut inner = 0.0;
        for (ring, edge) in RING_EDGES_DEG.iter().enumerate() {
            let cap = 0.5 * (1.0 - edge.to_radians().cos());
            let found = share(&|i| regions.ring[i] as usize == ring);
            assert!((found / (cap - inner) - 1.0).abs() < 0.05, "ring {ring}: {found}");
            inner = cap;
        }
        // A square pyramid of 100 degrees: 4 asin(sin^2 50) sr.
        let expected = 4.0 * (50f64.to_radians().sin().powi(2)).asin() / (4.0 * std::f64::consts::PI);
        assert!((share(&|i| regions.in_view[i]) / expected - 1.0).abs() < 0.01);
        let view = Regions::of_view(192, &place);
        assert!((view.fovea().count() as f64 - 211.0).abs() < 8.0);
    }
}
