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
    /// The part of the radial inverse's range that it draws from, from 0 on; 1 of others than acuity layers.
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
    let wished: f64 = foveas
        .iter()
        .zip(&wishes)
        .map(|(fovea, wishes)| tabled_share(fovea, extents) * fovea.pixels.mean(wishes))
        .sum();
    let of_rest = wishes_of_rest(guide, extents, kept);
    let mean = wished + kept * of_rest.iter().sum::<f64>() / of_rest.len() as f64;
    // Cells may be asked for in which no pixel's centre lies: then nothing is asked for.
    let density = |wish: f64| if mean > 0.0 { f64::from(FLOOR) + f64::from(1.0 - FLOOR) * wish / mean } else { 1.0 };
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
pub(super) fn tabled_share(fovea: &Fovea, extents: &[Extent]) -> f64 {
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
    let all = tabled_share(fovea, extents);
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fovea_sampler::{Angle, Geometry, RadialDistribution, Reddy2001};
    use glam::{Quat, Vec2, Vec3};

    use super::*;
    use crate::{
        distribution::{Clip, Distribution, Encoded, Gaze, View},
        film::FilmOptions,
    };

    const FILM: FilmOptions = FilmOptions::equirect(512, 256);
    const ROWS: u32 = 8;
    const CELLS: usize = (ROWS * ROWS * GUIDE_COLUMNS_PER_ROW) as usize;

    fn encoded(distribution: &Distribution, guide: Option<&Guide>) -> Encoded {
        distribution.encode(FilmFrame { options: &FILM, world_from_film: Quat::IDENTITY }, true, guide)
    }

    /// About a gaze in the scene; within a view; and about a gaze at the eye within a view, which has a floor of its own.
    fn distributions() -> [Distribution; 3] {
        let acuity = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002);
        let inverse = Arc::new(Inverse::default_for(&acuity.expect("valid constants")));
        let view = View::new(Quat::IDENTITY, 1.4, 0.9);
        let clip = Some(Clip { view, margin: 0.1, unclipped_share: 0.05 });
        let scene = Gaze::Scene { direction: Vec3::new(0.1, 0.05, -1.0).normalize() };
        let eye = Gaze::Eye { on_screen: Vec2::new(0.1, -0.1), screen_half_extent: Vec2::new(0.4, 0.25), view };
        [(scene, None), (scene, clip), (eye, clip)]
            .map(|(gaze, clip)| Distribution::foveated(gaze, clip, Arc::clone(&inverse)))
    }

    /// Of all samples, the share of each pixel of the table.
    fn shares(encoded: &Encoded) -> Vec<f64> {
        let ends = encoded.fovea.iter().map(|(lower, _)| *lower).chain([encoded.fovea_end]).collect::<Vec<_>>();
        ends.windows(2).map(|pair| f64::from(pair[1] - pair[0]) * 2f64.powi(-32)).collect()
    }

    #[test]
    fn every_pixel_and_cell_keeps_the_floor_and_shares_stay_whole() {
        let weights: Vec<f32> = (0..CELLS).map(|cell| ((cell * 7919 % 101) as f32 / 10.0).powi(2)).collect();
        let guide = Guide::from_weights(&weights, ROWS).expect("weights");
        for distribution in distributions() {
            let (plain, guided) = (encoded(&distribution, None), encoded(&distribution, Some(&guide)));
            assert!(plain.fovea_end > 0 && plain.fovea.len() > 100 && plain.guide.is_none());
            let layers = guided.layer_count as usize;
            assert!((guided.layers[layers - 1].cumulative - 1.0).abs() < 1e-6);
            // Ends are multiples of 2^-24: of slivers at the rim a ratio says nothing.
            let ratios: Vec<f64> = shares(&guided)
                .iter()
                .zip(shares(&plain))
                .filter(|(_, plain)| *plain > 100.0 * 2f64.powi(-24))
                .map(|(own, plain)| own / plain)
                .collect();
            let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(least > 0.98 * f64::from(FLOOR) && ratios.iter().any(|ratio| *ratio > 1.5), "{least}");
            let rest = |encoded: &Encoded| 1.0 - f64::from(encoded.fovea_end) * 2f64.powi(-32);
            let of_rest = guided.guide.as_ref().expect("a guide of the rest");
            let least = of_rest.densities().iter().copied().fold(f32::INFINITY, f32::min);
            let least = f64::from(least) * rest(&guided) / rest(&plain);
            assert!(least > 0.99 * f64::from(FLOOR) && least < 0.5, "{least}");
        }
    }

    #[test]
    fn an_even_guide_changes_nothing_and_one_that_asks_for_no_pixel_either() {
        let even = Guide::from_weights(&[1.0; CELLS], ROWS).expect("weights");
        for distribution in distributions() {
            let plain = encoded(&distribution, None);
            let same = encoded(&distribution, Some(&even));
            assert!(plain.fovea.iter().zip(&same.fovea).all(|(a, b)| a.1 == b.1 && a.0.abs_diff(b.0) <= 512));
            // All that is asked for is one cell, which about the gaze may hold no pixel's centre.
            let film = FilmOptions::equirect(64, 32);
            let frame = FilmFrame { options: &film, world_from_film: Quat::IDENTITY };
            for cell in 0..CELLS {
                let mut weights = [0.0; CELLS];
                weights[cell] = 1.0;
                let single = Guide::from_weights(&weights, ROWS).expect("weights");
                let guided = distribution.encode(frame, true, Some(&single));
                let guide = guided.guide.expect("a guide of the rest");
                assert!(guide.table().iter().all(|bound| bound.is_finite()) && guided.layers[0].share.is_finite());
            }
        }
    }
}
