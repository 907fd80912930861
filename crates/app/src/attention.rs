//! Where else samples are wanted than at the gaze: a rectangle, painted spots, pinned points.
//!
//! Each is a list of film pixels that becomes a layer of the mixture, beside those of the mode. A film pixel's estimate is the
//! same whatever chose it, so tools can be set, moved and cleared while the film goes on.

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};
use tracer::distribution::{Distribution, Layer, View, film_direction};
use tracer::film::{FilmMapping, FilmOptions};

/// Half the angle that a pinned point covers, radians: that of sharp sight.
pub const PIN_RADIUS: f32 = 0.05;
/// A brush is softer towards its rim: so many discs, one in the other, each a step of density.
const BRUSH_STEPS: u8 = 3;

/// A disc of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Unit, in the world.
    pub direction: Vec3,
    /// Radians.
    pub radius: f32,
}

/// A rectangle of a view, as it was when it was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// The view.
    pub view: View,
    /// Opposite corners: +-1 at the view's edges, y up.
    pub corners: [Vec2; 2],
}

impl Rectangle {
    fn contains(&self, direction: Vec3) -> bool {
        let [low, high] = [self.corners[0].min(self.corners[1]), self.corners[0].max(self.corners[1])];
        self.view.project(direction).is_some_and(|point| point.cmpge(low).all() && point.cmple(high).all())
    }

    /// The directions of its corners, around it.
    pub fn outline(&self) -> [Vec3; 4] {
        let [a, b] = self.corners;
        [a, Vec2::new(b.x, a.y), b, Vec2::new(a.x, b.y)].map(|corner| self.view.direction(corner))
    }

    /// A disc around it.
    fn around(&self) -> Spot {
        let direction = self.view.direction((self.corners[0] + self.corners[1]) * 0.5);
        let radius = self.outline().into_iter().map(|corner| corner.angle_between(direction)).fold(0.0, f32::max);
        Spot { direction, radius }
    }
}

/// What a person wants to be traced beside what the mode traces.
#[derive(Clone, Debug, PartialEq)]
pub struct Attention {
    /// A rectangle.
    pub region: Option<Rectangle>,
    /// Painted spots; where they overlap there are more samples.
    pub painted: Vec<Spot>,
    /// Pinned points, unit directions in the world.
    pub pins: Vec<Vec3>,
    /// Part of all samples that goes there, 0..1; the rest is the mode's.
    pub share: f32,
    /// A direction that counts as the gaze, wherever the eyes or the pointer are.
    pub locked_gaze: Option<Vec3>,
}

impl Default for Attention {
    fn default() -> Self {
        Self { region: None, painted: Vec::new(), pins: Vec::new(), share: 0.6, locked_gaze: None }
    }
}

impl Attention {
    /// Whether samples go elsewhere by it.
    pub fn is_empty(&self) -> bool {
        self.region.is_none() && self.painted.is_empty() && self.pins.is_empty()
    }

    /// The film's pixels of each tool that is used.
    pub fn lists(&self, film: &FilmOptions, world_from_film: Quat) -> Vec<Arc<[u32]>> {
        let film_from_world = world_from_film.inverse();
        let in_film = |spot: &Spot| Spot { direction: film_from_world * spot.direction, ..*spot };
        let region = self.region.iter().map(|region| {
            let mut pixels = Vec::new();
            spot_pixels(film, in_film(&region.around()), &mut pixels);
            let direction =
                |index: &u32| world_from_film * film_direction(film, index % film.width, index / film.width);
            pixels.retain(|index| region.contains(direction(index)));
            pixels
        });
        let spots = |spots: &[Spot]| {
            let mut pixels = Vec::new();
            for (spot, step) in spots.iter().flat_map(|spot| (1..=BRUSH_STEPS).map(move |step| (spot, step))) {
                let radius = spot.radius * f32::from(step) / f32::from(BRUSH_STEPS);
                spot_pixels(film, Spot { radius, ..in_film(spot) }, &mut pixels);
            }
            pixels
        };
        let pins: Vec<Spot> = self.pins.iter().map(|pin| Spot { direction: *pin, radius: PIN_RADIUS }).collect();
        let lists = region.chain([spots(&self.painted), spots(&pins)]);
        lists.filter(|pixels| !pixels.is_empty()).map(Into::into).collect()
    }

    /// A mode's distribution with these tools' layers.
    pub fn mixed(&self, mode: Distribution, lists: &[Arc<[u32]>]) -> Distribution {
        if lists.is_empty() || self.share <= 0.0 {
            return mode;
        }
        let share = self.share.min(0.99);
        let whole: f32 = mode.layers().iter().map(|(weight, _)| weight).sum();
        let of_mode = mode.layers().iter().map(|(weight, layer)| (weight / whole * (1.0 - share), layer.clone()));
        let each = share / lists.len() as f32;
        let of_tools = lists.iter().map(|list| (each, Layer::Pixels(Arc::clone(list))));
        // More layers than the kernels hold: the mode alone goes on.
        Distribution::mixture(of_mode.chain(of_tools).collect(), Arc::clone(mode.inverse())).unwrap_or(mode)
    }
}

/// Adds the pixels whose centre lies in a disc about a direction of the film's frame; at least the one in its middle.
fn spot_pixels(film: &FilmOptions, spot: Spot, pixels: &mut Vec<u32>) {
    let before = pixels.len();
    let cos_radius = spot.radius.cos();
    match film.mapping {
        FilmMapping::Perspective { .. } => {
            let inside = |index: &u32| {
                film_direction(film, index % film.width, index / film.width).dot(spot.direction) >= cos_radius
            };
            pixels.extend((0..film.pixels() as u32).filter(inside));
        }
        FilmMapping::Equirect => {
            let latitude = spot.direction.y.clamp(-1.0, 1.0).asin();
            let longitude = spot.direction.x.atan2(-spot.direction.z);
            let row = |latitude: f32| (0.5 - latitude / std::f32::consts::PI) * film.height as f32;
            let first = row(latitude + spot.radius).floor().max(0.0) as u32;
            let last = row(latitude - spot.radius).ceil().min(film.height as f32) as u32;
            for y in first..last {
                let row_latitude = std::f32::consts::PI * (0.5 - (y as f32 + 0.5) / film.height as f32);
                let (sin, cos) = row_latitude.sin_cos();
                // cos radius = sin sin + cos cos cos(difference of longitude)
                let cos_half = (cos_radius - sin * spot.direction.y) / (cos * latitude.cos()).max(1e-12);
                if cos_half > 1.0 {
                    continue;
                }
                let half = cos_half.max(-1.0).acos() / std::f32::consts::TAU * film.width as f32;
                let centre = (0.5 + longitude / std::f32::consts::TAU) * film.width as f32 - 0.5;
                let start = (centre - half).ceil() as i64;
                let end = ((centre + half).floor() as i64).min(start + i64::from(film.width) - 1);
                let column = |x: i64| x.rem_euclid(i64::from(film.width)) as u32;
                pixels.extend((start..=end).map(|x| y * film.width + column(x)));
            }
        }
    }
    if pixels.len() == before
        && let Some([x, y]) = film.pixel_of(spot.direction)
    {
        pixels.push(y * film.width + x);
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::collections::BTreeSet;

    use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};

    use super::*;

    fn brute(film: &FilmOptions, inside: impl Fn(Vec3) -> bool) -> BTreeSet<u32> {
        let direction = |index: u32| film_direction(film, index % film.width, index / film.width);
        (0..film.pixels() as u32).filter(|index| inside(direction(*index))).collect()
    }

    #[test]
    fn a_disc_has_the_pixels_that_lie_in_it() {
        for film in [FilmOptions::equirect(256, 128), FilmOptions::perspective(96, 64, 1.2)] {
            for (x, y, z) in [(0.3, 0.2, -1.0), (0.01, 1.0, 0.02), (0.1, -0.4, 1.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.1)]
            {
                let direction = Vec3::new(x, y, z).normalize();
                for radius in [0.02, 0.3, 1.4] {
                    let mut pixels = Vec::new();
                    spot_pixels(&film, Spot { direction, radius }, &mut pixels);
                    let found: BTreeSet<u32> = pixels.iter().copied().collect();
                    assert_eq!(found.len(), pixels.len(), "each pixel once");
                    let sure = |margin: f32| brute(&film, |d| d.angle_between(direction) <= radius + margin);
                    assert!(found.is_superset(&sure(-2e-3)), "{direction} {radius}");
                    let allowed = sure(2e-3);
                    assert!(found.len() <= 1 || found.is_subset(&allowed), "{direction} {radius}");
                }
            }
        }
    }

    #[test]
    fn a_rectangle_has_the_pixels_that_the_view_shows_there() {
        let film = FilmOptions::equirect(256, 128);
        let turn = Quat::from_rotation_y(0.4);
        let view = View::new(Quat::from_rotation_y(3.0) * Quat::from_rotation_x(0.4), 1.4, 0.9);
        let region = Rectangle { view, corners: [Vec2::new(0.8, -0.5), Vec2::new(-0.2, 0.7)] };
        let attention = Attention { region: Some(region), ..Attention::default() };
        let found: BTreeSet<u32> = attention.lists(&film, turn)[0].iter().copied().collect();
        assert_eq!(found, brute(&film, |d| region.contains(turn * d)));
        assert!(found.len() > 100);
    }

    #[test]
    fn tools_take_their_share_and_leave_the_rest_to_the_mode() {
        let radial = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002).unwrap();
        let inverse = Arc::new(Inverse::default_for(&radial));
        let film = FilmOptions::equirect(128, 64);
        let spot = Spot { direction: Vec3::X, radius: 0.3 };
        let attention =
            Attention { painted: vec![spot], pins: vec![Vec3::Z, Vec3::Y], share: 0.5, ..Default::default() };
        let lists = attention.lists(&film, Quat::IDENTITY);
        assert_eq!(lists.len(), 2);
        let mixed = attention.mixed(Distribution::omnidirectional(Arc::clone(&inverse)), &lists);
        let weights: Vec<f32> = mixed.layers().iter().map(|(weight, _)| *weight).collect();
        assert_eq!(weights, [0.5, 0.25, 0.25]);
        // The brush is denser in its middle: a pixel there is listed once for every step.
        let middle = film.pixel_of(Vec3::X).map(|[x, y]| y * film.width + x).unwrap();
        assert_eq!(lists[0].iter().filter(|index| **index == middle).count(), usize::from(BRUSH_STEPS));
        let none = Attention::default();
        let plain = none.mixed(Distribution::omnidirectional(inverse), &none.lists(&film, Quat::IDENTITY));
        assert_eq!(plain.layers().len(), 1);
    }
}
