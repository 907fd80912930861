//! The picture that the artist sees, in the fovea: outlines, colour and shading, and FLIP against the reference's.

use super::error::Regions;
use super::flip::{self, Prepared};

/// Pixels about the gaze that are compared, across and up: the fovea with what FLIP's filters reach.
const CROP: usize = 48;

/// What is measured in a picture's fovea.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureMeasures {
    /// Cosine between the gradient fields of lightness, picture and reference: 1 when outlines agree, and the root of the
    /// scene's part of the gradients' energy when the rest is noise.
    pub outline: f64,
    /// Mean CIE 1976 colour difference.
    pub colour: f64,
    /// Mean FLIP.
    pub flip: f64,
}

/// The part of a display-encoded picture about the gaze.
#[derive(Clone, Debug)]
pub struct Crop {
    side: usize,
    lab: Vec<[f64; 3]>,
    flip: Prepared,
}

impl Crop {
    /// The middle of a square picture.
    pub fn middle(picture: &flip::Encoded, side: usize) -> Self {
        let cropped = CROP.min(side);
        let first = (side - cropped) / 2;
        let rows = first..first + cropped;
        let texels: Vec<[u8; 3]> =
            rows.flat_map(|y| picture[y * side + first..y * side + first + cropped].iter().copied()).collect();
        let lab = texels.iter().map(|texel| flip::lab(flip::xyz(flip::linear(*texel)))).collect();
        Self { side: cropped, lab, flip: Prepared::new(&texels, cropped) }
    }

    /// Compares it with the reference's, over the pixels of the fovea.
    pub fn measure(&self, reference: &Self, fovea: &Fovea) -> PictureMeasures {
        let (mut both, mut own, mut theirs) = (0.0, 0.0, 0.0);
        for &pixel in &fovea.0 {
            let (a, b) = (self.gradient(pixel), reference.gradient(pixel));
            both += a[0] * b[0] + a[1] * b[1];
            own += a[0] * a[0] + a[1] * a[1];
            theirs += b[0] * b[0] + b[1] * b[1];
        }
        let difference = self.flip.difference(&reference.flip);
        let mean = |value: &dyn Fn(usize) -> f64| {
            fovea.0.iter().map(|&pixel| value(pixel)).sum::<f64>() / fovea.0.len().max(1) as f64
        };
        let colour = |pixel: usize| {
            let (a, b) = (self.lab[pixel], reference.lab[pixel]);
            ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
        };
        PictureMeasures {
            outline: if own * theirs > 0.0 { both / (own * theirs).sqrt() } else { 0.0 },
            colour: mean(&colour),
            flip: mean(&|pixel| difference[pixel]),
        }
    }

    /// Sobel's gradient of lightness; edges repeat.
    fn gradient(&self, pixel: usize) -> [f64; 2] {
        let last = self.side as i64 - 1;
        let at = |dx: i64, dy: i64| {
            let x = ((pixel % self.side) as i64 + dx).clamp(0, last);
            let y = ((pixel / self.side) as i64 + dy).clamp(0, last);
            self.lab[(y * self.side as i64 + x) as usize][0]
        };
        let across = |dy| at(1, dy) - at(-1, dy);
        let down = |dx| at(dx, 1) - at(dx, -1);
        [across(-1) + 2.0 * across(0) + across(1), down(-1) + 2.0 * down(0) + down(1)]
    }
}

/// The fovea's pixels in a crop.
#[derive(Clone, Debug)]
pub struct Fovea(Vec<usize>);

impl Fovea {
    /// Of a square picture with these regions.
    pub fn new(regions: &Regions, side: usize) -> Self {
        let cropped = CROP.min(side);
        let first = (side - cropped) / 2;
        let within = |c: usize| (first..first + cropped).contains(&c);
        let inside =
            regions.fovea().map(|pixel| [pixel % side, pixel / side]).filter(|at| at.iter().all(|c| within(*c)));
        Self(inside.map(|[x, y]| (y - first) * cropped + x - first).collect())
    }
}

/// Mean of two display-encoded pictures.
pub fn mean(a: &flip::Encoded, b: &flip::Encoded) -> Vec<[u8; 3]> {
    let texel = |(a, b): (&[u8; 3], &[u8; 3])| [0, 1, 2].map(|c| (u16::from(a[c]) + u16::from(b[c])).div_ceil(2) as u8);
    a.iter().zip(b).map(texel).collect()
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::cli::values::GazeAngles;
    use crate::commands::study::plan::Place;

    const SIDE: usize = 192;

    fn fovea() -> Fovea {
        let place = Place::new(GazeAngles { yaw_deg: 0.0, pitch_deg: 0.0 }, Quat::IDENTITY);
        Fovea::new(&Regions::of_view(SIDE as u32, &place), SIDE)
    }

    fn crop(grey: impl Fn(usize, usize) -> f64) -> Crop {
        let picture: Vec<[u8; 3]> = (0..SIDE * SIDE).map(|i| [grey(i % SIDE, i / SIDE) as u8; 3]).collect();
        Crop::middle(&picture, SIDE)
    }

    fn noise(x: usize, y: usize) -> f64 {
        let mixed = ((x * 374_761_393) ^ (y * 668_265_263)).wrapping_mul(1_274_126_177);
        ((mixed >> 16) & 0xff) as f64 / 255.0 - 0.5
    }

    #[test]
    fn outlines_agree_with_themselves_and_not_with_noise() {
        let edges = crop(|x, y| if (x / 5 + y / 7).is_multiple_of(2) { 90.0 } else { 150.0 });
        let same = edges.measure(&edges, &fovea());
        assert!((same.outline - 1.0).abs() < 1e-12 && same.colour == 0.0 && same.flip == 0.0);
        let only_noise = crop(|x, y| 120.0 + 60.0 * noise(x, y));
        assert!(only_noise.measure(&edges, &fovea()).outline.abs() < 0.25);
    }

    #[test]
    fn noise_of_the_scenes_energy_halves_the_squared_agreement() {
        let scene = |x: usize, y: usize| if (x / 5 + y / 7).is_multiple_of(2) { 100.0 } else { 140.0 };
        let energy =
            |c: &Crop| fovea().0.iter().map(|&p| c.gradient(p).map(|g| g * g).iter().sum::<f64>()).sum::<f64>();
        let clean = crop(scene);
        let flat = |amplitude: f64| crop(move |x, y| 120.0 + amplitude * noise(x, y));
        let amplitude = 60.0 * (energy(&clean) / energy(&flat(60.0))).sqrt();
        let noisy = crop(|x, y| scene(x, y) + amplitude * noise(x, y));
        let found = noisy.measure(&clean, &fovea()).outline;
        assert!((found - 0.5f64.sqrt()).abs() < 0.08, "{found}");
    }

    #[test]
    fn a_brighter_picture_keeps_its_outline_and_changes_its_colour() {
        let edges = |lift: f64| crop(move |x, _| if x % 8 < 4 { 90.0 + lift } else { 150.0 + lift });
        let measures = edges(12.0).measure(&edges(0.0), &fovea());
        assert!(measures.outline > 0.999 && measures.colour > 3.0 && measures.flip > 0.02, "{measures:?}");
    }
}
