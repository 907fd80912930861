//! Where else samples are wanted than at the gaze: a rectangle, painted spots, pinned points.
//!
//! Each is a list of film pixels that becomes a layer of the mixture, beside those of the mode. A film pixel's estimate is the
//! same whatever chose it, so tools can be set, moved and cleared while the film goes on.

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;
use tracer::distribution::{Distribution, Layer, View, film_direction};
use tracer::film::{FilmMapping, FilmOptions};

/// Half the angle that a pinned point covers, radians: that of sharp sight.
pub const PIN_RADIUS: f32 = 0.05;
/// A brush is softer towards its rim: so many discs, one in the other, each a step of density.
const BRUSH_STEPS: u8 = 3;
/// So often is a pixel listed at most, however many spots lie on it: as often as under the middle of four.
const MOST_TIMES: u8 = 4 * BRUSH_STEPS;
/// Longer lists, which are copied whenever the gaze moves, list pixels less often, in proportion; each at least once.
const LONG_LIST: usize = 1 << 22;

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

    /// The film's pixels of each tool that is used. `painted` is what was made of the painted spots the last time: only what was
    /// painted since is added, unless the film is another.
    pub fn lists(&self, film: &FilmOptions, world_from_film: Quat, painted: &mut Cover) -> Vec<Arc<[u32]>> {
        let region = self.region.iter().map(|region| {
            let mut cover = Cover::of(film, world_from_film);
            cover.add(&[region.around()], 1);
            let mut pixels = cover.list();
            let direction =
                |index: &u32| world_from_film * film_direction(film, index % film.width, index / film.width);
            pixels.retain(|index| region.contains(direction(index)));
            pixels
        });
        painted.follow(film, world_from_film, &self.painted);
        let spots: Vec<Spot> = self.pins.iter().map(|pin| Spot { direction: *pin, radius: PIN_RADIUS }).collect();
        let mut pins = Cover::default();
        pins.follow(film, world_from_film, &spots);
        let lists = region.chain([painted.list(), pins.list()]);
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

/// How often spots list each pixel of a film.
#[derive(Debug, Default)]
pub struct Cover {
    film: Option<(FilmOptions, Quat)>,
    spots: Vec<Spot>,
    /// By pixel, at most [`MOST_TIMES`]; empty without spots.
    times: Vec<u8>,
}

impl Cover {
    fn of(film: &FilmOptions, world_from_film: Quat) -> Self {
        Self { film: Some((*film, world_from_film)), ..Self::default() }
    }

    /// Brings it in line with soft spots; those that it has already are not looked at again.
    fn follow(&mut self, film: &FilmOptions, world_from_film: Quat, spots: &[Spot]) {
        if self.film != Some((*film, world_from_film)) || !spots.starts_with(&self.spots) {
            *self = Self::of(film, world_from_film);
        }
        let new = &spots[self.spots.len()..];
        self.add(new, BRUSH_STEPS);
        self.spots.extend_from_slice(new);
    }

    /// Counts the pixels whose centre lies in a spot, and the one in its middle, once for each of so many discs in one another.
    fn add(&mut self, spots: &[Spot], steps: u8) {
        let Some((film, world_from_film)) = self.film.filter(|_| !spots.is_empty()) else { return };
        let film_from_world = world_from_film.inverse();
        let discs: Vec<Disc> = spots
            .iter()
            .flat_map(|spot| (1..=steps).map(move |step| (spot, f32::from(step) / f32::from(steps))))
            .map(|(spot, part)| Disc::new(&film, film_from_world * spot.direction, spot.radius * part))
            .collect();
        self.times.resize(film.pixels() as usize, 0);
        let rows = self.times.par_chunks_mut(film.width as usize);
        rows.zip(0..film.height).for_each(|(times, y)| count_row(&film, &discs, y, times));
    }

    /// The pixels, each as often as it was counted. In a long list they are fewer times in it, in proportion.
    fn list(&self) -> Vec<u32> {
        let pixels = self.times.iter().filter(|times| **times > 0).count();
        let whole: usize = self.times.iter().map(|times| usize::from(*times)).sum();
        // Each pixel's number is rounded up, which adds less than one.
        let part = (LONG_LIST.saturating_sub(pixels) as f64 / whole.max(1) as f64).min(1.0);
        let listed = |times: u8| (f64::from(times) * part).ceil().max(f64::from(times.min(1))) as usize;
        let table: [usize; MOST_TIMES as usize + 1] = std::array::from_fn(|times| listed(times as u8));
        let mut list = Vec::with_capacity(whole.min(LONG_LIST.max(pixels)));
        for (pixel, times) in (0..).zip(&self.times) {
            list.extend(std::iter::repeat_n(pixel, table[usize::from(*times)]));
        }
        list
    }
}

/// A disc of a film's directions.
struct Disc {
    /// Of the film's frame.
    direction: Vec3,
    cos_radius: f32,
    /// The pixel that its middle lies in, where the film has it.
    middle: Option<[u32; 2]>,
}

impl Disc {
    fn new(film: &FilmOptions, direction: Vec3, radius: f32) -> Self {
        Self { direction, cos_radius: radius.min(std::f32::consts::PI).cos(), middle: film.pixel_of(direction) }
    }

    /// Columns of a row of a panorama, the first of which may be negative: whole turns are left out of account.
    fn columns(&self, film: &FilmOptions, y: u32) -> std::ops::RangeInclusive<i64> {
        #[expect(clippy::reversed_empty_ranges, reason = "none")]
        const NONE: std::ops::RangeInclusive<i64> = 0..=-1;
        let latitude = self.direction.y.clamp(-1.0, 1.0).asin();
        let longitude = self.direction.x.atan2(-self.direction.z);
        let row_latitude = std::f32::consts::PI * (0.5 - (y as f32 + 0.5) / film.height as f32);
        let (sin, cos) = row_latitude.sin_cos();
        // cos radius = sin sin + cos cos cos(difference of longitude)
        let cos_half = (self.cos_radius - sin * self.direction.y) / (cos * latitude.cos()).max(1e-12);
        if cos_half > 1.0 {
            return NONE;
        }
        let half = cos_half.max(-1.0).acos() / std::f32::consts::TAU * film.width as f32;
        let centre = (0.5 + longitude / std::f32::consts::TAU) * film.width as f32 - 0.5;
        let start = (centre - half).ceil() as i64;
        start..=((centre + half).floor() as i64).min(start + i64::from(film.width) - 1)
    }
}

/// Counts a row's pixels whose centre lies in discs.
fn count_row(film: &FilmOptions, discs: &[Disc], y: u32, times: &mut [u8]) {
    let count = |times: &mut u8| *times = (*times + 1).min(MOST_TIMES);
    let is_middle = |disc: &Disc, x: u32| disc.middle == Some([x, y]);
    match film.mapping {
        FilmMapping::Perspective { .. } => {
            for (x, times) in (0..).zip(times) {
                let direction = film_direction(film, x, y);
                for disc in discs {
                    if *times == MOST_TIMES {
                        break;
                    }
                    if direction.dot(disc.direction) >= disc.cos_radius || is_middle(disc, x) {
                        count(times);
                    }
                }
            }
        }
        FilmMapping::Equirect => {
            for disc in discs {
                let columns = disc.columns(film, y);
                let column = |x: i64| x.rem_euclid(i64::from(film.width)) as u32;
                let middle = disc.middle.filter(|[_, row]| *row == y).map(|[x, _]| x);
                let beside = middle.filter(|middle| !columns.clone().any(|x| column(x) == *middle));
                for x in columns.map(column).chain(beside) {
                    count(&mut times[x as usize]);
                }
            }
        }
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
                    let mut cover = Cover::of(&film, Quat::IDENTITY);
                    cover.add(&[Spot { direction, radius }], 1);
                    let pixels = cover.list();
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
        let found: BTreeSet<u32> = attention.lists(&film, turn, &mut Cover::default())[0].iter().copied().collect();
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
        let lists = attention.lists(&film, Quat::IDENTITY, &mut Cover::default());
        assert_eq!(lists.len(), 2);
        let mixed = attention.mixed(Distribution::omnidirectional(Arc::clone(&inverse)), &lists);
        let weights: Vec<f32> = mixed.layers().iter().map(|(weight, _)| *weight).collect();
        assert_eq!(weights, [0.5, 0.25, 0.25]);
        // The brush is denser in its middle: a pixel there is listed once for every step.
        let middle = film.pixel_of(Vec3::X).map(|[x, y]| y * film.width + x).unwrap();
        assert_eq!(lists[0].iter().filter(|index| **index == middle).count(), usize::from(BRUSH_STEPS));
        let none = Attention::default();
        let plain = none
            .mixed(Distribution::omnidirectional(inverse), &none.lists(&film, Quat::IDENTITY, &mut Cover::default()));
        assert_eq!(plain.layers().len(), 1);
    }

    /// Spots over spots, at the pole of the window's own film, where a disc has most pixels: the list stays within a bound, and what
    /// was painted step by step is what was painted at once.
    #[test]
    fn painting_goes_on_for_long() {
        let film = FilmOptions::equirect(4096, 2048);
        let direction = |dab: u16| Quat::from_rotation_x(f32::from(dab) * 5e-5) * Vec3::Y;
        let spot = |dab| Spot { direction: direction(dab), radius: 20f32.to_radians() };
        let (mut attention, mut cover) = (Attention::default(), Cover::default());
        for dabs in [1, 45, 400] {
            attention.painted = (0..dabs).map(spot).collect();
            let list = attention.lists(&film, Quat::IDENTITY, &mut cover).remove(0);
            assert!(list.len() <= LONG_LIST, "{dabs}: {}", list.len());
            let whole = attention.lists(&film, Quat::IDENTITY, &mut Cover::default());
            assert_eq!(*list, *whole[0], "{dabs}");
            // Every pixel of the disc, and those in the middle more often than those at the rim, until that is full too.
            let times = |row: u32| list.iter().filter(|listed| **listed == row * film.width).count();
            assert!(times(220) > 0 && times(0) >= times(220), "{dabs}");
            assert!(dabs > 1 || times(0) > times(220));
        }
        // Where all of a film is painted, each pixel stays in the list.
        attention.painted = vec![Spot { direction: Vec3::Y, radius: 4.0 }];
        let list = attention.lists(&film, Quat::IDENTITY, &mut cover).remove(0);
        assert_eq!(list.iter().collect::<BTreeSet<_>>().len() as u64, film.pixels());
        assert_eq!(list.len() as u64, film.pixels());
    }
}
