//! A guide where the pixels about a gaze have a table. The guide's cells are of the unit square of the layers alone; what it asks for
//! there is given to the table's pixels, and to cells of the part of the unit square that the table leaves.

use fovea_sampler::Inverse;

use super::{FilmFrame, fovea::Fovea};
use crate::guide::{FLOOR, GUIDE_COLUMNS_PER_ROW, Guide};

/// Places across a column of cells at which a guide is looked up.
const LOOKUPS: usize = 8;

/// Where a layer lies in the unit square of the layers alone, along the first number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub lower: f64,
    pub size: f64,
    /// Of an acuity layer, the part of the radial inverse's range that it draws from; 0..1 of others.
    pub reach_end: f64,
    /// Of it, what the table has taken.
    pub taken: f64,
    /// Share of all samples that the table has taken from it, and that it keeps.
    pub tabled: f64,
    pub kept: f64,
}

impl Extent {
    /// The first number that stands for a place in the radial inverse's range.
    fn at(&self, radius: f64) -> f64 {
        self.lower + self.size * (radius / self.reach_end).min(1.0)
    }
}

/// What the guide asks for of the table and of the rest, and the floor: one density for all, whose mean is 1.
pub(super) struct Guided {
    /// Of each gaze's table the mean density.
    pub tables: Vec<f64>,
    /// Of what the tables leave.
    pub rest: Guide,
}

/// Weighs the pixels of tables by a guide.
pub(super) fn guided(
    guide: &Guide,
    foveas: &mut [Fovea],
    extents: &[Extent],
    inverse: &Inverse,
    film: FilmFrame<'_>,
) -> Guided {
    let kept: f64 = extents.iter().map(|extent| extent.kept).sum();
    let wishes: Vec<Vec<f64>> =
        foveas.iter().map(|fovea| wishes_of_pixels(guide, fovea, extents, inverse, film)).collect();
    let wished: f64 =
        foveas.iter().zip(&wishes).map(|(fovea, wishes)| tabled(fovea, extents) * fovea.pixels.mean(wishes)).sum();
    let of_rest = wishes_of_rest(guide, extents, kept);
    let mean = wished + kept * of_rest.iter().sum::<f64>() / of_rest.len() as f64;
    let density = |wish: f64| f64::from(FLOOR) + f64::from(1.0 - FLOOR) * wish / mean;
    let tables = foveas
        .iter_mut()
        .zip(wishes)
        .map(|(fovea, wishes)| {
            let densities: Vec<f64> = wishes.into_iter().map(density).collect();
            let mean = fovea.pixels.mean(&densities);
            fovea.pixels.scale(&densities);
            mean
        })
        .collect();
    Guided { tables, rest: guide.with_densities(|cell| density(of_rest[cell])) }
}

/// Share of all samples that a gaze's table has without a guide.
fn tabled(fovea: &Fovea, extents: &[Extent]) -> f64 {
    fovea.parts.iter().map(|part| extents[part.layer].tabled).sum()
}

/// What a guide asks for of a table's pixels, in the mean over the layers that they stand for.
fn wishes_of_pixels(
    guide: &Guide,
    fovea: &Fovea,
    extents: &[Extent],
    inverse: &Inverse,
    film: FilmFrame<'_>,
) -> Vec<f64> {
    let all = tabled(fovea, extents);
    let wish = |[radius, turns]: [f64; 2]| {
        let of_layer = |extent: &Extent| extent.tabled / all * guide.wish([extent.at(radius), turns]);
        fovea.parts.iter().map(|part| of_layer(&extents[part.layer])).sum()
    };
    fovea.places(inverse, film).into_iter().map(wish).collect()
}

/// What a guide asks for of the cells of what the tables leave, of which `kept` is the share of all samples; column by column.
fn wishes_of_rest(guide: &Guide, extents: &[Extent], kept: f64) -> Vec<f64> {
    let (rows, columns) = (guide.rows() as usize, (guide.rows() * GUIDE_COLUMNS_PER_ROW) as usize);
    let first = |place: f64| {
        let mut lower = 0.0;
        let mut layers = extents.iter().filter(|extent| extent.kept > 0.0).peekable();
        while let Some(extent) = layers.next() {
            let part = (place * kept - lower) / extent.kept;
            if part < 1.0 || layers.peek().is_none() {
                return extent.at(extent.taken + part.clamp(0.0, 1.0) * (extent.reach_end - extent.taken));
            }
            lower += extent.kept;
        }
        place
    };
    let lookups = columns * LOOKUPS;
    let places: Vec<f64> = (0..lookups).map(|i| first((i as f64 + 0.5) / lookups as f64)).collect();
    let wish = |cell: usize| {
        let row = ((cell % rows) as f64 + 0.5) / rows as f64;
        let at = cell / rows * LOOKUPS;
        places[at..at + LOOKUPS].iter().map(|&x| guide.wish([x, row])).sum::<f64>() / LOOKUPS as f64
    };
    (0..rows * columns).map(wish).collect()
}
