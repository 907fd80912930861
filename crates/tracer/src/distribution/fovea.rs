//! The film pixels about a gaze as a table with each pixel's share of the samples, from which the kernels choose by one number
//! (`shaders/sampling/fovea.wesl`).
//!
//! A sample of an acuity layer that falls within [`RADIUS_DEG`] is chosen from the table instead. Pixels get what the layer's
//! density gives them: its value at their centre times their solid angle times the part of them that lies within the radius. The
//! rest of the layer is warped as ever, from the radius outwards.

use std::f64::consts::{PI, TAU};

use fovea_sampler::{Inverse, sequence::IntervalEnd};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{
    ALONG_THE_SCREEN, FilmFrame, Gaze, View, column_part, direction_of_parts, film_direction, gaze_frame,
    place_direction, row_part,
};
use crate::film::{FilmMapping, FilmOptions};

/// Eccentricity within which pixels have a table: where Reddy's acuity is flat.
const RADIUS_DEG: f32 = 5.79;
/// Larger tables cost more than a batch gains; near the poles of large films there is none.
const MOST_PIXELS: u64 = 1 << 17;
/// Rows of the film that are listed side by side, so that what is near in the table is near in the film.
const BAND_ROWS: u32 = 8;
/// Directions at which the rim is known.
const RIM_POINTS: u32 = 64;
/// Cells of equal share in which the density is taken as one.
const DENSITY_CELLS: u32 = 64;

/// A gaze's table, and what of which layers it stands for.
#[derive(Debug)]
pub(super) struct Fovea {
    pub gaze: Gaze,
    pub pixels: Table,
    pub parts: Vec<Part>,
    /// Where in the radial inverse's range the rim lies.
    radius_end: f32,
    /// In the world.
    rim: Vec<Vec3>,
}

/// What of a layer is chosen from the table.
#[derive(Debug)]
pub(super) struct Part {
    /// Its place in the mixture.
    pub layer: usize,
    /// Share of the layer's samples.
    pub share: f64,
    /// The part of the radial inverse's range that the layer keeps begins here.
    pub radius_end: f32,
}

/// Pixels, and the sums of the weights up to each.
#[derive(Debug, Default)]
pub(super) struct Table {
    pixels: Vec<u32>,
    sums: Vec<f64>,
}

impl Table {
    fn push(&mut self, pixel: u32, weight: f64) {
        self.sums.push(self.sums.last().copied().unwrap_or(0.0) + weight);
        self.pixels.push(pixel);
    }

    fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        let lower = std::iter::once(0.0).chain(self.sums.iter().copied());
        self.sums.iter().zip(lower).map(|(upper, lower)| upper - lower)
    }

    /// Mean over the samples of something that each pixel has.
    pub fn mean(&self, values: &[f64]) -> f64 {
        let sum: f64 = self.weights().zip(values).map(|(weight, value)| weight * value).sum();
        sum / self.sums.last().copied().unwrap_or(1.0)
    }

    /// Multiplies the pixels' weights.
    pub fn scale(&mut self, factors: &[f64]) {
        let mut sum = 0.0;
        let scaled = self.weights().zip(factors).map(|(weight, factor)| {
            sum += weight * factor;
            sum
        });
        self.sums = scaled.collect();
    }

    /// Lower ends of the pixels' intervals in `[from, from + size)`, fractions of 2^32 and multiples of 2^8, with the pixels.
    pub fn intervals(&self, from: f64, size: f64) -> impl Iterator<Item = (u32, u32)> + '_ {
        let scale = size / self.sums.last().copied().unwrap_or(1.0);
        let lower = std::iter::once(0.0).chain(self.sums.iter().copied());
        lower.zip(&self.pixels).map(move |(sum, &pixel)| (((from + sum * scale) * 2f64.powi(24)) as u32 * 256, pixel))
    }
}

/// A table as the kernels read it.
#[derive(Debug, Default)]
pub(crate) struct TableWords {
    /// Of each pixel the lower end of its interval, the end's root and the pixel; and one entry that ends the last interval.
    pub entries: Vec<[u32; 3]>,
    /// For cells of equal width from 0 on, and for the end of the last: the pixel in whose interval it begins. About as many as pixels, so
    /// that a search takes a step or two however many there are.
    pub cells: Vec<u32>,
    /// A cell is 2^this of 2^32 wide.
    pub cell_bits: u32,
}

impl TableWords {
    /// Of intervals by their lower ends, ascending, with pixels; the last one's upper end. Empty where there are none.
    pub fn new(intervals: &[(u32, u32)], end: u32) -> Self {
        let (count, Some(last)) = (intervals.len(), end.checked_sub(1)) else { return Self::default() };
        let mut entries: Vec<[u32; 3]> = vec![[0; 3]; count + 1];
        entries.par_chunks_mut(8).with_min_len(1 << 7).zip(intervals.par_chunks(8)).for_each(|(entries, intervals)| {
            let interval = |i: usize| intervals.get(i).copied().unwrap_or_default();
            let ends = IntervalEnd::several(std::array::from_fn::<_, 8, _>(|i| interval(i).0.min(end)));
            for (i, (entry, end)) in entries.iter_mut().zip(ends).enumerate() {
                *entry = [end.value, end.root, interval(i).1];
            }
        });
        let end = IntervalEnd::new(end);
        entries[count] = [end.value, end.root, 0];
        let cell_bits = (0..31).find(|&bits| ((last >> bits) as usize) < count).unwrap_or(31);
        let mut at = 0;
        let cells = (0..=u64::from(last >> cell_bits) + 1)
            .map(|cell| {
                while at + 1 < count && u64::from(entries[at + 1][0]) <= cell << cell_bits {
                    at += 1;
                }
                at as u32
            })
            .collect();
        Self { entries, cells, cell_bits }
    }
}

impl Fovea {
    /// The table of a gaze on a film; `None` where the rim leaves the screen or the film, or has too many pixels within.
    pub fn new(gaze: Gaze, inverse: &Inverse, film: FilmFrame<'_>) -> Option<Self> {
        let radius = RADIUS_DEG.to_radians();
        let versine = 2.0 * (0.5 * radius).sin().powi(2);
        let radius_end = range_within(inverse, versine);
        let rim: Option<Vec<Vec3>> = (0..RIM_POINTS)
            .map(|k| direction(&gaze, versine, k as f32 / RIM_POINTS as f32).filter(|d| d.is_finite()))
            .collect();
        let rim = rim?;
        let film_from_world = film.world_from_film.inverse();
        let in_film: Vec<Vec3> = rim.iter().map(|&d| film_from_world * d).collect();
        let centre = film_from_world * direction(&gaze, 0.0, 0.0)?;
        let rows = rows_within(film.options, centre, &in_film)?;
        let count: u64 = rows.iter().map(|row| u64::from(row.columns)).sum();
        if count == 0 || count > MOST_PIXELS {
            return None;
        }
        let nearest = in_film.iter().map(|d| d.angle_between(centre)).fold(f32::INFINITY, f32::min);
        // What a step of one pixel changes the eccentricity by, generously.
        let reach = 2.0 * pixel_angle(film.options) * f64::from(radius / nearest);
        let pixel = Pixels {
            gaze,
            film,
            radius: f64::from(radius),
            surely_inside: (1.0 - (f64::from(radius) - reach).max(0.0).cos()) as f32,
            surely_outside: (1.0 - (f64::from(radius) + reach).cos()) as f32,
            density: Density::within(inverse, radius_end),
        };
        let bands: Vec<Vec<(u32, f64)>> = rows.par_chunks(BAND_ROWS as usize).map(|band| pixel.of_band(band)).collect();
        let mut pixels = Table::default();
        for (number, weight) in bands.into_iter().flatten() {
            pixels.push(number, weight);
        }
        (!pixels.pixels.is_empty()).then_some(Self { gaze, pixels, parts: Vec::new(), radius_end, rim })
    }

    /// Takes a layer's share within the radius over, unless the layer's view cuts through it.
    pub fn take_from(&mut self, layer: usize, clip: Option<&View>, radius_scale: f32, inverse: &Inverse) {
        let within = f64::from(self.radius_end / radius_scale);
        let cuts = |view: &View| self.rim.iter().any(|&d| !is_inside(view, d));
        if within > 0.9 || clip.is_some_and(cuts) {
            return;
        }
        // Candidates outside a clipping view are drawn again, so what is within gets more.
        let accepted = clip.map_or(1.0, |view| self.accepted(view, radius_scale, inverse));
        let share = within / (within + (1.0 - within) * accepted);
        self.parts.push(Part { layer, share, radius_end: self.radius_end });
    }

    /// Where the pixels' centres lie: how far up in the radial inverse's range, and the azimuth in turns.
    pub fn places(&self, inverse: &Inverse, film: FilmFrame<'_>) -> Vec<[f64; 2]> {
        let axis = self.gaze.axis();
        let frame = gaze_frame(axis);
        let width = film.options.width;
        let place = |&pixel: &u32| {
            let d = film.world_from_film * film_direction(film.options, pixel % width, pixel / width);
            let seen = self.gaze.seen(d).unwrap_or(axis);
            let about = frame.transpose() * seen;
            let turns = f64::from(about.y).atan2(f64::from(about.x)) / TAU;
            [f64::from(range_within(inverse, versine(seen, axis))), turns.rem_euclid(1.0)]
        };
        self.pixels.pixels.par_iter().map(place).collect()
    }

    /// Share of a layer's candidates from the rim outwards that lie in a view; at least that of one of those that are tried.
    fn accepted(&self, view: &View, radius_scale: f32, inverse: &Inverse) -> f64 {
        const RINGS: u32 = 32;
        const AZIMUTHS: u32 = 64;
        let inside = (0..RINGS * AZIMUTHS).filter(|k| {
            let x = ((k / AZIMUTHS) as f32 + 0.5) / RINGS as f32;
            let versine = inverse.eval_versine(self.radius_end + x * (radius_scale - self.radius_end));
            direction(&self.gaze, versine, ((k % AZIMUTHS) as f32 + 0.5) / AZIMUTHS as f32)
                .is_some_and(|d| is_inside(view, d))
        });
        inside.count().max(1) as f64 / f64::from(RINGS * AZIMUTHS)
    }
}

fn is_inside(view: &View, direction: Vec3) -> bool {
    view.project(direction).is_some_and(|p| p.abs().max_element() <= 1.0)
}

/// The direction in the world at a radius (1 - cos e) and azimuth (turns) about a gaze; `None` where it misses the screen.
fn direction(gaze: &Gaze, versine: f32, turns: f32) -> Option<Vec3> {
    let sine = (versine * (2.0 - versine)).max(0.0).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * turns).sin_cos();
    let local = Vec3::new(sine * cos, sine * sin, 1.0 - versine);
    let d = gaze_frame(gaze.axis()) * local;
    match gaze {
        Gaze::Scene { .. } => Some(d),
        Gaze::Eye { screen_half_extent, view, .. } => {
            (d.z < ALONG_THE_SCREEN).then(|| view.direction(d.truncate() / (-d.z * *screen_half_extent)))
        }
    }
}

/// How much of the radial inverse's range lies within a radius.
pub(super) fn range_within(inverse: &Inverse, versine: f32) -> f32 {
    let (mut low, mut high) = (0.0f32, 1.0f32);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if inverse.eval_versine(middle) < versine { low = middle } else { high = middle }
    }
    low
}

/// A layer's density over `1 - cos e`, up to a factor: constant in cells of equal share.
#[derive(Debug)]
struct Density {
    /// Upper ends of the cells.
    ends: Vec<f32>,
    values: Vec<f64>,
}

impl Density {
    fn within(inverse: &Inverse, radius_end: f32) -> Self {
        let end = |k: u32| inverse.eval_versine(radius_end * k as f32 / DENSITY_CELLS as f32);
        let value = |k: u32| 1.0 / f64::from((end(k) - end(k - 1)).max(f32::MIN_POSITIVE));
        Self { ends: (1..=DENSITY_CELLS).map(end).collect(), values: (1..=DENSITY_CELLS).map(value).collect() }
    }

    fn at(&self, versine: f32) -> f64 {
        let cell = self.ends.partition_point(|&end| end < versine);
        self.values[cell.min(self.values.len() - 1)]
    }
}

/// What weighs a pixel.
struct Pixels<'a> {
    gaze: Gaze,
    film: FilmFrame<'a>,
    /// Of the table, radians of eccentricity.
    radius: f64,
    /// 1 - cos of the eccentricity below which, and above which, a pixel's centre is far enough from the rim for all of it.
    surely_inside: f32,
    surely_outside: f32,
    density: Density,
}

impl Pixels<'_> {
    /// Pixels of some rows, column by column, with their weights.
    fn of_band(&self, band: &[Row]) -> Vec<(u32, f64)> {
        let film = self.film.options;
        let first = band.iter().map(|row| row.first).min().unwrap_or(0);
        let last = band.iter().map(|row| row.first + i64::from(row.columns)).max().unwrap_or(0);
        let row_parts: Vec<[f64; 2]> = band.iter().map(|row| row_part(film, f64::from(row.y) + 0.5)).collect();
        let mut list = Vec::new();
        for column in first..last {
            let x = column.rem_euclid(i64::from(film.width)) as u32;
            let column_part = column_part(film, f64::from(x) + 0.5);
            for (row, row_part) in band.iter().zip(&row_parts) {
                if (row.first..row.first + i64::from(row.columns)).contains(&column) {
                    let centre = direction_of_parts(film, column_part, *row_part);
                    let weight = self.weight(x, row.y, centre);
                    if weight > 0.0 {
                        list.push((row.y * film.width + x, weight));
                    }
                }
            }
        }
        list
    }

    fn weight(&self, x: u32, y: u32, centre: Vec3) -> f64 {
        let Some((versine, eye_per_scene)) = self.seen(centre) else { return 0.0 };
        let covered = match versine {
            v if v < self.surely_inside => 1.0,
            v if v > self.surely_outside => return 0.0,
            _ => self.covered(x, y, self.radius - eccentricity(versine)),
        };
        covered * self.density.at(versine) * eye_per_scene * steradians(self.film.options, centre)
    }

    /// Part of a pixel within the rim, of which the centre lies `inwards`. The rim is taken for straight there, at the mean distance of the
    /// circle that it is.
    fn covered(&self, x: u32, y: u32, inwards: f64) -> f64 {
        let (x, y) = (f64::from(x), f64::from(y));
        let place = |x, y| self.seen(place_direction(self.film.options, x, y));
        let ecc = |x, y| place(x, y).map_or(PI, |(versine, _)| eccentricity(versine));
        let a = (ecc(x + 1.0, y + 0.5) - ecc(x, y + 0.5)).abs();
        let b = (ecc(x + 0.5, y + 1.0) - ecc(x + 0.5, y)).abs();
        let inwards = inwards - (a * a + b * b) / (24.0 * self.radius);
        // Of a unit square that a straight line cuts.
        let least = 1e-3 * (a + b).max(1e-12);
        let (a, b) = (a.max(least), b.max(least));
        let square = |t: f64| t.max(0.0).powi(2);
        let (sum, difference) = (0.5 * (a + b), 0.5 * (a - b));
        let corners =
            square(inwards + sum) - square(inwards + difference) - square(inwards - difference) + square(inwards - sum);
        (corners / (2.0 * a * b)).clamp(0.0, 1.0)
    }

    /// 1 - cos of the eccentricity of a direction in the film's frame, and steradians at the eye for one in the scene there.
    fn seen(&self, in_film: Vec3) -> Option<(f32, f64)> {
        let d = self.film.world_from_film * in_film;
        let versine = versine(self.gaze.seen(d)?, self.gaze.axis());
        let eye_per_scene = match self.gaze {
            Gaze::Scene { .. } => 1.0,
            Gaze::Eye { screen_half_extent, view, .. } => {
                let point = view.project(d)?;
                let [in_view, on_screen] = [view.half_extent, screen_half_extent].map(|half| point * half);
                let of_plane = |p: Vec2| f64::from((1.0 + p.length_squared()) * (1.0 + p.length_squared()).sqrt());
                let areas = screen_half_extent.element_product() / view.half_extent.element_product();
                f64::from(areas) * of_plane(in_view) / of_plane(on_screen)
            }
        };
        Some((versine, eye_per_scene))
    }
}

/// 1 - cos of the angle between two unit vectors, without the cancellation.
fn versine(a: Vec3, b: Vec3) -> f32 {
    0.5 * (a - b).length_squared()
}

fn eccentricity(versine: f32) -> f64 {
    2.0 * f64::from(0.5 * versine).sqrt().min(1.0).asin()
}

/// Solid angle of a pixel by the direction of its centre in the film's frame, up to a factor that is the film's.
fn steradians(film: &FilmOptions, centre: Vec3) -> f64 {
    match film.mapping {
        FilmMapping::Equirect => f64::from(centre.x.hypot(centre.z)),
        FilmMapping::Perspective { .. } => f64::from(-centre.z).powi(3),
    }
}

/// The largest angle across a pixel, radians.
fn pixel_angle(film: &FilmOptions) -> f64 {
    let side = match film.mapping {
        FilmMapping::Equirect => (TAU / f64::from(film.width)).max(PI / f64::from(film.height)),
        FilmMapping::Perspective { half_extent: [x, y] } => {
            (2.0 * f64::from(x) / f64::from(film.width)).max(2.0 * f64::from(y) / f64::from(film.height))
        }
    };
    side * std::f64::consts::SQRT_2
}

/// Pixels of a row that may lie within the rim; in a panorama columns go on beyond its edges.
struct Row {
    y: u32,
    first: i64,
    columns: u32,
}

/// Rows that the rim encloses; `None` where it leaves the film.
fn rows_within(film: &FilmOptions, centre: Vec3, rim: &[Vec3]) -> Option<Vec<Row>> {
    let (width, height) = (f64::from(film.width), f64::from(film.height));
    match film.mapping {
        FilmMapping::Equirect => {
            let farthest = rim.iter().map(|d| d.angle_between(centre)).fold(0.0, f32::max);
            let radius = f64::from(farthest) + pixel_angle(film);
            let latitude = f64::from(centre.y.clamp(-1.0, 1.0)).asin();
            let middle = (f64::from(centre.x).atan2(-f64::from(centre.z)) / TAU + 0.5) * width;
            let row = |y: u32| {
                let of_row = PI * (0.5 - (f64::from(y) + 0.5) / height);
                let cosine = (radius.cos() - latitude.sin() * of_row.sin()) / (latitude.cos() * of_row.cos()).max(1e-9);
                let half = (cosine.clamp(-1.0, 1.0).acos() / TAU * width).ceil() as i64 + 1;
                let first = middle.floor() as i64 - half;
                Row { y, first, columns: ((2 * half + 1) as u32).min(film.width) }
            };
            let y_of = |latitude: f64| ((0.5 - latitude / PI) * height).clamp(0.0, height);
            let (top, bottom) = (y_of(latitude + radius).floor() as u32, y_of(latitude - radius).ceil() as u32);
            Some((top..bottom).map(row).collect())
        }
        FilmMapping::Perspective { half_extent: [x, y] } => {
            let place = |d: &Vec3| {
                let p = (d.z < 0.0).then(|| d.truncate() / -d.z / Vec2::new(x, y))?;
                let inside = p.abs().max_element() <= 1.0;
                inside.then_some([0.5 * (1.0 + f64::from(p.x)) * width, 0.5 * (1.0 - f64::from(p.y)) * height])
            };
            let places: Vec<[f64; 2]> = rim.iter().map(place).collect::<Option<_>>()?;
            let bound = |axis: usize, size: u32| {
                let all = places.iter().map(|place| place[axis]);
                let (low, high) = all.fold((f64::INFINITY, 0.0f64), |(low, high), p| (low.min(p), high.max(p)));
                let low = (low - 1.0).max(0.0) as u32;
                (low, ((high + 2.0) as u32).min(size))
            };
            let ((left, right), (top, bottom)) = (bound(0, film.width), bound(1, film.height));
            Some((top..bottom).map(|y| Row { y, first: i64::from(left), columns: right - left }).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::TableWords;

    /// What the kernels' search finds, for the first and the last number of every interval: empty ones, one that many cells fall into,
    /// and many in one cell.
    #[test]
    fn cells_lead_to_the_interval_of_a_number() {
        let ends: Vec<u32> =
            [0, 0x100, 0x100, 0x200, 0x8000_0000].into_iter().chain((0..900).map(|i| 0x9000_0000 + 256 * i)).collect();
        let intervals: Vec<(u32, u32)> = ends.iter().zip(0..).map(|(&end, pixel)| (end, pixel)).collect();
        for end in [0xa000_0000, 0xffff_ff00] {
            let table = TableWords::new(&intervals, end);
            assert_eq!(table.entries.len(), ends.len() + 1);
            assert!(table.cells.len() <= ends.len() + 1);
            let numbers = ends.iter().flat_map(|&x| [x, x.saturating_sub(1)]).chain([end - 1]);
            for x in numbers {
                let cell = (x >> table.cell_bits) as usize;
                let expected = ends.partition_point(|&lower| lower <= x) - 1;
                let found = table.cells[cell] as usize..=table.cells[cell + 1] as usize;
                assert!(found.contains(&expected), "{x:x}: {expected} in {found:?}");
            }
        }
        assert!(TableWords::new(&[], 0).entries.is_empty());
        assert_eq!(TableWords::new(&[(0, 7)], 0x100).cells, [0, 0]);
    }
}
