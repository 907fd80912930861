//! A few pixels of the film, read while it grows: what a read-out at the gaze shows.

use glam::Vec3;

use super::{Film, FilmMapping, FilmOptions, ReadError, read_ranges};
use crate::{gpu::Gpu, kernels::FILM_WORDS};

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
    /// The words of the pixels at most `radius` columns and rows away; waits for the device.
    pub fn words_near(&self, gpu: &Gpu, pixel: [u32; 2], radius: u32) -> Result<Vec<u32>, ReadError> {
        let [first_x, first_y] = pixel.map(|p| p.saturating_sub(radius));
        let last_x = (pixel[0] + radius).min(self.options.width - 1);
        let last_y = (pixel[1] + radius).min(self.options.height - 1);
        let row_bytes = u64::from(last_x - first_x + 1) * u64::from(FILM_WORDS) * 4;
        let ranges = (first_y..=last_y).filter_map(|y| {
            let first = y * self.options.width + first_x;
            let slab = self.slabs.iter().find(|s| (s.first_pixel..s.first_pixel + s.pixel_count).contains(&first))?;
            Some((&slab.buffer, u64::from(first - slab.first_pixel) * u64::from(FILM_WORDS) * 4, row_bytes))
        });
        read_ranges(gpu, &ranges.collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distribution::film_direction;

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
