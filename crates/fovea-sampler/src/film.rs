//! Films: how pixels and directions correspond, and how many steradians a pixel covers.
//!
//! Conventions: right-handed, +Y up, the film's centre is -Z. Equirectangular: right is +X at three quarters of the width,
//! the left edge is +Z, the top is +Y. Perspective: looks along -Z, +X right. Pixel (0, 0) is the top left.

use core::f64::consts::{PI, TAU};

use crate::frame::Direction;
use crate::warp::unit;
use crate::{Angle, SamplerError};

/// A film in its own frame of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    mapping: Mapping,
    width_px: u32,
    height_px: u32,
}

/// The correspondence of a film's plane with directions.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mapping {
    Equirectangular,
    /// Tangents of half the angles of view.
    Perspective {
        tan_half_x: f64,
        tan_half_y: f64,
    },
}

impl Film {
    /// The whole sphere, longitude across, latitude down.
    ///
    /// # Errors
    /// If a side is 0 or above 2^20 pixels.
    pub fn equirectangular(width_px: u32, height_px: u32) -> Result<Self, SamplerError> {
        check_size(width_px, height_px)?;
        Ok(Self { mapping: Mapping::Equirectangular, width_px, height_px })
    }

    /// A pinhole image with square pixels and the given vertical angle of view.
    ///
    /// # Errors
    /// If a side is 0 or above 2^20 pixels, or the angle is not in (0, 180) degrees.
    pub fn perspective(width_px: u32, height_px: u32, vertical_fov: Angle) -> Result<Self, SamplerError> {
        check_size(width_px, height_px)?;
        let degrees = vertical_fov.degrees();
        if !(degrees > 0.0 && degrees < 180.0) {
            let (what, requirement) = ("the vertical angle of view in degrees", "in (0, 180)");
            return Err(SamplerError::Parameter { what, value: degrees, requirement });
        }
        let tan_half_y = (0.5 * vertical_fov.radians()).tan();
        let tan_half_x = tan_half_y * f64::from(width_px) / f64::from(height_px);
        Ok(Self { mapping: Mapping::Perspective { tan_half_x, tan_half_y }, width_px, height_px })
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size_px(&self) -> [u32; 2] {
        [self.width_px, self.height_px]
    }

    /// The unit direction at a position in pixels, `(0, 0)` the top left corner, pixel centres at halves.
    #[must_use]
    pub fn direction(&self, position_px: [f64; 2]) -> Direction {
        let [s, t] = [position_px[0] / f64::from(self.width_px), position_px[1] / f64::from(self.height_px)];
        match self.mapping {
            Mapping::Equirectangular => {
                let ((sin_lon, cos_lon), (sin_lat, cos_lat)) =
                    ((TAU * (s - 0.5)).sin_cos(), (PI * (0.5 - t)).sin_cos());
                [cos_lat * sin_lon, sin_lat, -cos_lat * cos_lon]
            }
            Mapping::Perspective { tan_half_x, tan_half_y } => {
                unit([(2.0 * s - 1.0) * tan_half_x, (1.0 - 2.0 * t) * tan_half_y, -1.0])
            }
        }
    }

    /// The unit direction at a pixel's centre.
    #[must_use]
    pub fn pixel_direction(&self, [x, y]: [u32; 2]) -> Direction {
        self.direction([f64::from(x) + 0.5, f64::from(y) + 0.5])
    }

    /// The position in pixels of a direction; `None` outside a perspective film. An equirectangular column wraps at the seam,
    /// a row is clamped at the nadir.
    #[must_use]
    pub fn position(&self, direction: Direction) -> Option<[f64; 2]> {
        let [x, y, z] = direction;
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let [s, t] = match self.mapping {
            Mapping::Equirectangular => {
                // atan2 of the latitude keeps its digits near the poles, where asin loses half of them.
                let (longitude, latitude) = (x.atan2(-z), y.atan2(x.hypot(z)));
                [longitude / TAU + 0.5, 0.5 - latitude / PI]
            }
            Mapping::Perspective { tan_half_x, tan_half_y } => {
                if z.is_nan() || z >= 0.0 {
                    return None;
                }
                [0.5 - 0.5 * x / (z * tan_half_x), 0.5 + 0.5 * y / (z * tan_half_y)]
            }
        };
        if !(0.0..=1.0).contains(&s) || !(0.0..=1.0).contains(&t) {
            return None;
        }
        let wrapped = if self.mapping == Mapping::Equirectangular && s >= 1.0 { 0.0 } else { s };
        Some([wrapped * width, t * height])
    }

    /// The pixel that a direction falls in; `None` outside a perspective film.
    #[must_use]
    pub fn pixel(&self, direction: Direction) -> Option<[u32; 2]> {
        let [x, y] = self.position(direction)?;
        Some([(x as u32).min(self.width_px - 1), (y as u32).min(self.height_px - 1)])
    }

    /// Steradians per square pixel at a position: the Jacobian of directions by film position.
    #[must_use]
    pub fn steradians_per_pixel(&self, position_px: [f64; 2]) -> f64 {
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let [s, t] = [position_px[0] / width, position_px[1] / height];
        match self.mapping {
            Mapping::Equirectangular => TAU * PI / (width * height) * (PI * (0.5 - t)).cos(),
            Mapping::Perspective { tan_half_x, tan_half_y } => {
                let (x, y) = ((2.0 * s - 1.0) * tan_half_x, (1.0 - 2.0 * t) * tan_half_y);
                4.0 * tan_half_x * tan_half_y / (width * height) * (1.0 + x * x + y * y).powf(-1.5)
            }
        }
    }

    /// The exact solid angle of a pixel, steradians.
    #[must_use]
    pub fn pixel_solid_angle(&self, [x, y]: [u32; 2]) -> f64 {
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let [x, y] = [f64::from(x), f64::from(y)];
        match self.mapping {
            Mapping::Equirectangular => {
                // Difference of the sines of the edges' latitudes.
                2.0 * (PI * (0.5 - (y + 0.5) / height)).cos() * (0.5 * PI / height).sin() * TAU / width
            }
            Mapping::Perspective { tan_half_x, tan_half_y } => {
                let plane_x = |x: f64| (2.0 * x / width - 1.0) * tan_half_x;
                let plane_y = |y: f64| (1.0 - 2.0 * y / height) * tan_half_y;
                // The solid angle of the rectangle between the axis and a corner.
                let corner = |x: f64, y: f64| (x * y / (1.0 + x * x + y * y).sqrt()).atan();
                let (x0, x1, y0, y1) = (plane_x(x), plane_x(x + 1.0), plane_y(y + 1.0), plane_y(y));
                corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
            }
        }
    }

    /// Whether it covers every direction.
    #[must_use]
    pub fn covers_sphere(&self) -> bool {
        self.mapping == Mapping::Equirectangular
    }
}

fn check_size(width_px: u32, height_px: u32) -> Result<(), SamplerError> {
    for (what, side) in [("the film's width in pixels", width_px), ("the film's height in pixels", height_px)] {
        if side == 0 || side > 1 << 20 {
            return Err(SamplerError::Parameter { what, value: side.into(), requirement: "in [1, 2^20]" });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn films() -> [Film; 2] {
        let fov = Angle::from_degrees(70.0);
        [Film::equirectangular(96, 48).expect("valid"), Film::perspective(80, 50, fov).expect("valid")]
    }

    #[test]
    fn positions_and_directions_are_inverse() {
        for film in films() {
            for y in 0..film.height_px {
                for x in 0..film.width_px {
                    assert_eq!(film.pixel(film.pixel_direction([x, y])), Some([x, y]));
                    let p = [f64::from(x) + 0.13, f64::from(y) + 0.87];
                    let back = film.position(film.direction(p)).expect("inside");
                    assert!((back[0] - p[0]).abs() < 1e-9 && (back[1] - p[1]).abs() < 1e-9, "{p:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn solid_angles_sum_up_and_match_the_jacobian() {
        let [panorama, view] = films();
        let sum = |film: &Film| -> f64 {
            (0..film.height_px)
                .flat_map(|y| (0..film.width_px).map(move |x| [x, y]))
                .map(|p| film.pixel_solid_angle(p))
                .sum()
        };
        assert!((sum(&panorama) / (2.0 * TAU) - 1.0).abs() < 1e-12);
        // The pyramid of 70 degrees by its horizontal angle: 4 asin(sin(a) sin(b)) with the half angles of view.
        let half_y = Angle::from_degrees(35.0).radians();
        let half_x = (half_y.tan() * 1.6).atan();
        let pyramid = 4.0 * (half_x.sin() * half_y.sin()).asin();
        assert!((sum(&view) / pyramid - 1.0).abs() < 1e-12);
        for film in [panorama, view] {
            for p in [[0, 0], [7, 13], [40, 24], [79, 47]] {
                let centre = [f64::from(p[0]) + 0.5, f64::from(p[1]) + 0.5];
                let ratio = film.steradians_per_pixel(centre) / film.pixel_solid_angle(p);
                assert!((ratio - 1.0).abs() < 2e-3, "{p:?}: {ratio}");
            }
        }
    }

    #[test]
    fn conventions_and_seams() {
        let film = Film::equirectangular(8, 4).expect("valid");
        assert_eq!(film.position([0.0, 0.0, -1.0]), Some([4.0, 2.0]));
        assert_eq!(film.position([1.0, 0.0, 0.0]), Some([6.0, 2.0]));
        assert_eq!(film.position([0.0, 1.0, 0.0]).map(|p| p[1]), Some(0.0));
        // Both sides of the seam at +Z, and the seam itself with either zero.
        assert_eq!(film.pixel([-1e-300, 0.0, 1.0]), Some([0, 2]));
        assert_eq!(film.pixel([-0.0, 0.0, 1.0]), Some([0, 2]));
        assert_eq!(film.pixel([0.0, 0.0, 1.0]), Some([0, 2]));
        assert_eq!(film.pixel([0.0, -1.0, 0.0]).map(|p| p[1]), Some(3));
        assert_eq!(film.pixel([f64::NAN, 0.0, 1.0]), None);
        let view = Film::perspective(8, 4, Angle::from_degrees(60.0)).expect("valid");
        assert_eq!(view.pixel([0.0, 0.0, 1.0]), None);
        assert_eq!(view.pixel([0.0, 1.0, -1.0]), None);
    }

    #[test]
    fn impossible_films_are_refused() {
        assert!(Film::equirectangular(0, 4).is_err());
        for degrees in [0.0, 180.0, -1.0, f64::NAN] {
            assert!(Film::perspective(4, 4, Angle::from_degrees(degrees)).is_err());
        }
    }
}
