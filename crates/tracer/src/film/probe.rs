//! A few pixels of the film, read while it grows: what a read-out at the gaze shows.

use glam::Vec3;

use super::{Film, FilmMapping, FilmOptions, FilmPixel, ReadError, read_ranges};
use crate::{gpu::Gpu, kernels::FILM_WORDS};

/// The estimates of the pixels about one of the film; none where the film does not reach.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PixelsNear {
    /// Row by row.
    pub pixels: Vec<FilmPixel>,
    /// Pixels of a row; at the film's border there are fewer than twice the radius and one.
    pub columns: usize,
    /// Column and row, among these, of the pixel that was asked for.
    pub center: [usize; 2],
}

impl PixelsNear {
    /// Those at most `radius` columns and rows from the center, row by row.
    pub fn within(&self, radius: usize) -> Vec<FilmPixel> {
        let [x, y] = self.center;
        let rows = self.pixels.chunks(self.columns.max(1)).enumerate().filter(|(row, _)| row.abs_diff(y) <= radius);
        rows.flat_map(|(_, row)| row.iter().enumerate())
            .filter(|(column, _)| column.abs_diff(x) <= radius)
            .map(|(_, pixel)| *pixel)
            .collect()
    }
}

impl FilmOptions {
    /// The pixel (across, down) that a direction of the film's frame falls on; `None` where the film does not reach.
    pub fn pixel_of(&self, direction: Vec3) -> Option<[u32; 2]> {
        let (u, v) = match self.mapping {
            FilmMapping::Equirect => {
                let yaw = direction.x.atan2(-direction.z);
                let pitch = direction.y.atan2(direction.x.hypot(direction.z));
                (0.5 + yaw / std::f32::consts::TAU, 0.5 - pitch / std::f32::consts::PI)
            }
            FilmMapping::Perspective { half_extent } => {
                if direction.z > -1e-6 {
                    return None;
                }
                let plane = direction.truncate() / (-direction.z * glam::Vec2::from(half_extent));
                (0.5 + 0.5 * plane.x, 0.5 - 0.5 * plane.y)
            }
        };
        let inside = (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v);
        let pixel = |t: f32, size: u32| ((t * size as f32) as u32).min(size.saturating_sub(1));
        inside.then(|| [pixel(u, self.width), pixel(v, self.height)])
    }
}

impl Film {
    /// The pixels at most `radius` columns and rows away, made of their words by `estimate`; waits for the device.
    pub(crate) fn pixels_near(
        &self,
        gpu: &Gpu,
        pixel: [u32; 2],
        radius: u32,
        estimate: impl Fn(&[u32]) -> FilmPixel,
    ) -> Result<PixelsNear, ReadError> {
        let [first_x, first_y] = pixel.map(|p| p.saturating_sub(radius));
        let last_x = (pixel[0] + radius).min(self.options.width - 1);
        let last_y = (pixel[1] + radius).min(self.options.height - 1);
        let row_bytes = u64::from(last_x - first_x + 1) * u64::from(FILM_WORDS) * 4;
        let ranges = (first_y..=last_y).filter_map(|y| {
            let first = y * self.options.width + first_x;
            let slab = self.slabs.iter().find(|s| (s.first_pixel..s.first_pixel + s.pixel_count).contains(&first))?;
            Some((&slab.buffer, u64::from(first - slab.first_pixel) * u64::from(FILM_WORDS) * 4, row_bytes))
        });
        let words: Vec<u32> = read_ranges(gpu, &ranges.collect::<Vec<_>>())?;
        Ok(PixelsNear {
            pixels: words.chunks_exact(FILM_WORDS as usize).map(estimate).collect(),
            columns: (last_x - first_x + 1) as usize,
            center: [pixel[0] - first_x, pixel[1] - first_y].map(|distance| distance as usize),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distribution::film_direction;

    #[test]
    fn those_within_a_radius_are_the_middle_ones() {
        let pixel = |samples| FilmPixel { samples, ..FilmPixel::default() };
        // Five columns and four rows; the film ends above.
        let near = PixelsNear { pixels: (0..20).map(pixel).collect(), columns: 5, center: [2, 1] };
        let samples = |radius| near.within(radius).iter().map(|pixel| pixel.samples).collect::<Vec<_>>();
        assert_eq!(samples(0), [7]);
        assert_eq!(samples(1), [1, 2, 3, 6, 7, 8, 11, 12, 13]);
        assert_eq!(samples(9).len(), 20);
        assert_eq!(PixelsNear::default().within(3), []);
    }

    #[test]
    fn pixels_and_directions_round_trip() {
        for film in [FilmOptions::equirect(64, 32), FilmOptions::perspective(48, 27, 1.0)] {
            for (x, y) in [(0, 0), (5, 20), (film.width - 1, film.height - 1), (film.width / 2, 3)] {
                assert_eq!(film.pixel_of(film_direction(&film, x, y)), Some([x, y]));
            }
        }
        assert_eq!(FilmOptions::perspective(48, 27, 1.0).pixel_of(Vec3::Z), None);
        assert_eq!(FilmOptions::perspective(48, 27, 1.0).pixel_of(Vec3::X), None);
    }
}
