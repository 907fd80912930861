//! How samples are spread over the film: a mixture of layers, each of which chooses film pixels.
//!
//! The density chooses the pixel; the position inside it is drawn afresh and uniform, so every distribution converges
//! to the same value in every pixel that it gives density to.

use std::{f64::consts::PI, ops::Range, sync::Arc};

use fovea_sampler::Inverse;
use glam::{Mat3, Quat, Vec2, Vec3};
use rayon::prelude::*;

mod fovea;
mod guided;

pub(crate) use fovea::TableWords;
use fovea::{Fovea, range_within};
use guided::{Extent, guided, tabled_share};

use crate::{
    film::{FilmMapping, FilmOptions},
    guide::Guide,
    kernels::layout::{self, MAX_LAYERS, SampleLayer, codes},
};

/// Candidates drawn before a clipped layer accepts one outside.
const CLIP_TRIES: u32 = 16;

/// Z of directions from the eye above which they are too nearly parallel to the screen to meet it anywhere of use.
const ALONG_THE_SCREEN: f32 = -1e-3;

/// Strata that make up a pixel where most samples fall: with one the gain in the fovea is two thirds of that with four or eight
/// (docs/reports/sequence.md).
const STRATA_OF_A_PIXEL: f64 = 4.0;

/// A perspective view: where it looks and what its image plane spans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World from view; the view looks along -Z, +Y is up.
    pub world_from_view: Quat,
    /// tan of half the horizontal and vertical angles of view.
    pub half_extent: Vec2,
}

impl View {
    /// A view with these full angles in radians, each below pi.
    pub fn new(world_from_view: Quat, hfov: f32, vfov: f32) -> Self {
        Self { world_from_view, half_extent: Vec2::new((hfov * 0.5).tan(), (vfov * 0.5).tan()) }
    }

    /// Unit direction in the world of a point of the image plane in -1..1 (x right, y up).
    pub fn direction(&self, point: Vec2) -> Vec3 {
        self.world_from_view * (point * self.half_extent).extend(-1.0).normalize()
    }

    /// Point of the image plane in units of its half extents, for a direction in front of the view.
    pub fn project(&self, direction: Vec3) -> Option<Vec2> {
        let d = self.world_from_view.inverse() * direction;
        (d.z < -1e-6).then(|| d.truncate() / -d.z / self.half_extent)
    }
}

/// Where the eye looks, and where eccentricity is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gaze {
    /// A direction in the world; eccentricity is the angle in the scene.
    Scene {
        /// Unit vector.
        direction: Vec3,
    },
    /// A point on a flat screen that shows a view; eccentricity is the angle at the eye in front of its centre.
    Eye {
        /// Gaze in units of the screen's half width and half height, y up.
        on_screen: Vec2,
        /// Half width and half height of the view on the screen, over the viewing distance.
        screen_half_extent: Vec2,
        /// What the screen shows.
        view: View,
    },
}

impl Gaze {
    /// Where the eye looks, in the frame in which eccentricity is measured: the world's or the screen's. A unit vector.
    fn axis(&self) -> Vec3 {
        match self {
            Self::Scene { direction } => *direction,
            Self::Eye { on_screen, screen_half_extent, .. } => at_eye(*on_screen, *screen_half_extent),
        }
    }

    /// In that frame, the direction in which the eye sees a direction in the world, both unit vectors; `None` behind the view.
    fn seen(&self, direction: Vec3) -> Option<Vec3> {
        match self {
            Self::Scene { .. } => Some(direction),
            Self::Eye { screen_half_extent, view, .. } => Some(at_eye(view.project(direction)?, *screen_half_extent)),
        }
    }

    /// Versine, 1 - cos, of the eccentricity of a view's corner that is farthest from the gaze. `None` where some place inside may
    /// be farther: that takes a corner at more than a right angle.
    fn farthest_corner(&self, clip: &View) -> Option<f32> {
        let corners = [Vec2::new(1.0, 1.0), Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0), Vec2::new(-1.0, -1.0)];
        let cosine = |corner: Vec2| Some(self.axis().dot(self.seen(clip.direction(corner))?));
        let least = corners.into_iter().map(cosine).try_fold(1.0f32, |least, cosine| Some(least.min(cosine?)))?;
        (least > 0.0).then_some(1.0 - least)
    }
}

/// Keeps most samples of a layer inside a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    /// The view.
    pub view: View,
    /// How much farther than the view's edge samples may fall, as a fraction of its half extent.
    pub margin: f32,
    /// Share of samples that ignore the clip, in 0..=1.
    pub unclipped_share: f32,
}

/// One component of a mixture.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer {
    /// Uniform over the film's pixels.
    Film,
    /// Uniform over directions.
    Sphere,
    /// Uniform over the image plane of a view.
    ImagePlane(View),
    /// Uniform over a list of film pixels.
    Pixels(Arc<[u32]>),
    /// By visual acuity about the gaze.
    Acuity {
        /// Where the eye looks.
        gaze: Gaze,
        /// Keep to a view.
        clip: Option<View>,
        /// Part of the radial inverse's range to use, in 0..=1: below 1 leaves its floor out.
        radius_scale: f32,
    },
}

/// A mixture of layers by weight, with the radial inverse that its acuity layers use.
#[derive(Clone, Debug)]
pub struct Distribution {
    layers: Vec<(f32, Layer)>,
    inverse: Arc<Inverse>,
}

impl Distribution {
    /// Omnidirectional (OD): uniform over the film's pixels.
    pub fn omnidirectional(inverse: Arc<Inverse>) -> Self {
        Self { layers: vec![(1.0, Layer::Film)], inverse }
    }

    /// Viewport (VP): uniform over the image plane of a view.
    pub fn viewport(view: View, inverse: Arc<Inverse>) -> Self {
        Self { layers: vec![(1.0, Layer::ImagePlane(view))], inverse }
    }

    /// Uniform over the film pixels whose centre is inside a view, as a rectangle-selection tool does; over the one in its middle
    /// where none is, and over the film where that shows nothing of the view.
    pub fn region(view: View, film: &FilmOptions, world_from_film: Quat, inverse: Arc<Inverse>) -> Self {
        Self { layers: vec![(1.0, Layer::Pixels(pixels_in_view(film, world_from_film, &view)))], inverse }
    }

    /// Foveated (FV): by visual acuity about the gaze.
    pub fn foveated(gaze: Gaze, clip: Option<Clip>, inverse: Arc<Inverse>) -> Self {
        let capped = inverse.share_within_cap();
        let mut layers = Vec::new();
        let mut push = |weight: f64, view: Option<View>| {
            if weight <= 0.0 {
                return;
            }
            match gaze {
                Gaze::Scene { .. } => {
                    layers.push((weight as f32, Layer::Acuity { gaze, clip: view, radius_scale: 1.0 }));
                }
                // The floor stays in scene directions, so it is a layer of its own.
                Gaze::Eye { .. } => {
                    let radius_scale = capped as f32;
                    layers.push(((weight * capped) as f32, Layer::Acuity { gaze, clip: view, radius_scale }));
                    if capped < 1.0 {
                        layers.push(((weight * (1.0 - capped)) as f32, Layer::Sphere));
                    }
                }
            }
        };
        match clip {
            None => push(1.0, None),
            Some(clip) => {
                let widened = View { half_extent: clip.view.half_extent * (1.0 + clip.margin), ..clip.view };
                push(f64::from(1.0 - clip.unclipped_share), Some(widened));
                push(f64::from(clip.unclipped_share), None);
            }
        }
        Self { layers, inverse }
    }

    /// A mixture by weights, which need not sum to one. `None` when there is no layer with a positive weight, or more
    /// than the kernels hold.
    pub fn mixture(layers: Vec<(f32, Layer)>, inverse: Arc<Inverse>) -> Option<Self> {
        let layers: Vec<_> = layers.into_iter().filter(|(weight, _)| *weight > 0.0).collect();
        (1..=MAX_LAYERS).contains(&layers.len()).then_some(Self { layers, inverse })
    }

    /// The mixture's layers with their weights.
    pub fn layers(&self) -> &[(f32, Layer)] {
        &self.layers
    }

    /// The radial inverse of the acuity layers.
    pub fn inverse(&self) -> &Arc<Inverse> {
        &self.inverse
    }

    /// Strata of the unit square, 2^x columns of 2^y, within which the kernels' further numbers are a sequence of their own. In a
    /// film whose sides are powers of two they are its pixels. Elsewhere pixels cut through strata, and a part of a sequence is
    /// not well spread: there a pixel that gets most samples consists of [`STRATA_OF_A_PIXEL`].
    pub(crate) fn stratum_bits(&self, film: &FilmOptions) -> [u32; 2] {
        let (share, layer) = self.densest_layer(film);
        let bits = (STRATA_OF_A_PIXEL / share).log2().round().clamp(2.0, 30.0) as u32;
        match layer {
            Layer::Film if film.width.is_power_of_two() && film.height.is_power_of_two() => {
                [film.width, film.height].map(|side| side.ilog2().max(1))
            }
            // The first number alone chooses the pixel.
            Layer::Pixels(_) => [bits - 1, 1],
            _ => [bits.div_ceil(2), bits / 2],
        }
    }

    /// Share of all samples that falls on the pixel which gets most of them.
    pub(crate) fn peak_share(&self, film: &FilmOptions) -> f64 {
        self.densest_layer(film).0.clamp(1e-12, 1.0)
    }

    /// The layer that gives most samples to a single pixel, with the share of all samples that falls there.
    fn densest_layer(&self, film: &FilmOptions) -> (f64, &Layer) {
        let sum: f32 = self.layers.iter().map(|(weight, _)| weight).sum();
        let shares = self.layers.iter().map(|(weight, layer)| {
            let share = f64::from(weight / sum) * self.largest_share(layer, film);
            (share, layer)
        });
        shares.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((1.0, &Layer::Film))
    }

    /// Film pixels that the eye does not tell apart, about samples whose first number is `u`: the solid angle that a sample of an
    /// acuity layer stands for, over that at the gaze; 1 in other layers.
    pub(crate) fn element_pixels(&self, u: f32) -> f32 {
        /// Part of a layer over which its density is taken as one.
        const STEP: f32 = 1e-3;
        let sum: f32 = self.layers.iter().map(|(weight, _)| weight).sum();
        let mut lower = 0.0;
        for (weight, layer) in &self.layers {
            let share = weight / sum;
            if u < lower + share {
                let Layer::Acuity { .. } = layer else { return 1.0 };
                let reach = self.radius_of_interest(layer);
                let radius = |x: f32| self.inverse.eval_versine(x * reach);
                let x = ((u - lower) / share).clamp(STEP, 1.0 - STEP);
                return ((radius(x + STEP) - radius(x - STEP)) / (2.0 * radius(STEP))).max(1.0);
            }
            lower += share;
        }
        1.0
    }

    /// Share of a layer's samples that falls on the pixel which gets most of them.
    fn largest_share(&self, layer: &Layer, film: &FilmOptions) -> f64 {
        let pixels = film.pixels() as f64;
        let pixel = match film.mapping {
            FilmMapping::Equirect => 2.0 * PI * PI / pixels,
            FilmMapping::Perspective { half_extent: [x, y] } => 4.0 * f64::from(x) * f64::from(y) / pixels,
        };
        match layer {
            Layer::Film => 1.0 / pixels,
            Layer::Sphere => pixel / (4.0 * PI),
            Layer::ImagePlane(view) => pixel / (4.0 * f64::from(view.half_extent.x) * f64::from(view.half_extent.y)),
            Layer::Pixels(list) => 1.0 / list.len().max(1) as f64,
            Layer::Acuity { .. } => {
                // About the gaze the density is flat.
                let u = 1e-3;
                let radius = self.inverse.eval_versine(u * self.radius_of_interest(layer));
                pixel * f64::from(u) / (2.0 * PI * f64::from(radius))
            }
        }
    }

    /// The mixture as the kernels consume it. With `has_fovea`, pixels about the gaze get a table where there can be one.
    pub(crate) fn encode(&self, film: FilmFrame<'_>, has_fovea: bool, guide: Option<&Guide>) -> Encoded {
        let mut foveas = if has_fovea { self.foveas(film) } else { Vec::new() };
        let extents = self.extents(&foveas);
        let guided = guide.map(|guide| guided(guide, &mut foveas, &extents, &self.inverse, film));
        let film_from_world = Mat3::from_quat(film.world_from_film.inverse());
        let mut encoded = Encoded {
            layers: bytemuck::Zeroable::zeroed(),
            layer_count: self.layers.len().min(MAX_LAYERS) as u32,
            pixels: Vec::new(),
            fovea: Vec::new(),
            fovea_end: 0,
            guide: None,
        };
        let mut tabled = 0.0;
        for (at, of_gaze) in foveas.iter().enumerate() {
            let own = tabled_share(of_gaze, &extents) * guided.as_ref().map_or(1.0, |guided| guided.tables[at]);
            encoded.fovea.extend(of_gaze.pixels.intervals(tabled, own));
            tabled += own;
        }
        encoded.guide = guided.map(|guided| guided.rest);
        // A multiple of 2^8: floats of 24 bits tell the table from the layers.
        encoded.fovea_end = (tabled * 2f64.powi(24)).round() as u32 * 256;
        let mut cumulative = f64::from(encoded.fovea_end) * 2f64.powi(-32);
        let kept: f64 = extents.iter().map(|extent| extent.kept).sum();
        let rest = (1.0 - cumulative) / kept;
        for (((_, layer), extent), out) in self.layers.iter().zip(&extents).zip(&mut encoded.layers) {
            let own = extent.kept * rest;
            cumulative += own;
            let reach = extent.taken as f32..extent.reach_end as f32;
            *out = encode_layer(layer, reach, film_from_world, &mut encoded.pixels);
            out.share = own as f32;
            out.cumulative = cumulative as f32;
        }
        encoded
    }

    /// Where the layers lie along the first number, and what tables have taken of them.
    fn extents(&self, foveas: &[Fovea]) -> Vec<Extent> {
        let sum: f32 = self.layers.iter().map(|(weight, _)| weight).sum();
        let mut lower = 0.0;
        let extent = |(at, (weight, layer)): (usize, &(f32, Layer))| {
            let part = foveas.iter().flat_map(|of_gaze| &of_gaze.parts).find(|part| part.layer == at);
            let size = f64::from(weight / sum);
            let tabled = size * part.map_or(0.0, |part| part.share);
            let reach_end = f64::from(self.radius_of_interest(layer));
            let taken = part.map_or(0.0, |part| f64::from(part.radius_end));
            lower += size;
            Extent { lower: lower - size, size, reach_end, taken, tabled, kept: size - tabled }
        };
        self.layers.iter().enumerate().map(extent).collect()
    }

    /// Where a layer's part of the radial inverse's range ends, 1 of others than acuity layers: candidates beyond the farthest corner of
    /// a clip would all be drawn again.
    fn radius_of_interest(&self, layer: &Layer) -> f32 {
        /// What rounding may move a corner by, of the range.
        const MARGIN: f32 = 1e-4;
        let Layer::Acuity { gaze, clip, radius_scale } = layer else { return 1.0 };
        let Some(farthest) = clip.as_ref().and_then(|view| gaze.farthest_corner(view)) else { return *radius_scale };
        (range_within(&self.inverse, farthest) + MARGIN).min(*radius_scale)
    }

    /// The foveas of the mixture's acuity layers, one a gaze.
    fn foveas(&self, film: FilmFrame<'_>) -> Vec<Fovea> {
        let mut foveas: Vec<Fovea> = Vec::new();
        for (at, (_, layer)) in self.layers.iter().enumerate() {
            let Layer::Acuity { gaze, clip, radius_scale } = layer else { continue };
            let known = foveas.iter().position(|fovea| fovea.gaze == *gaze);
            let Some(fovea) = known.or_else(|| {
                foveas.push(Fovea::new(*gaze, &self.inverse, film)?);
                Some(foveas.len() - 1)
            }) else {
                continue;
            };
            foveas[fovea].take_from(at, clip.as_ref(), *radius_scale, &self.inverse);
        }
        foveas.retain(|fovea| !fovea.parts.is_empty());
        foveas
    }
}

/// A film, and how it is turned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilmFrame<'a> {
    pub options: &'a FilmOptions,
    pub world_from_film: Quat,
}

/// A mixture as the kernels consume it.
#[derive(Debug)]
pub(crate) struct Encoded {
    pub layers: [SampleLayer; MAX_LAYERS],
    pub layer_count: u32,
    /// The layers' lists.
    pub pixels: Vec<u32>,
    /// Lower ends of intervals of the first random number, fractions of 2^32 and multiples of 2^8, with the pixels about the gaze.
    pub fovea: Vec<(u32, u32)>,
    /// Where the last of those intervals ends; 0 without.
    pub fovea_end: u32,
    /// Of the unit square beyond.
    pub guide: Option<Guide>,
}

/// `reach`: of an acuity layer, the part of the radial inverse's range that it draws from.
fn encode_layer(layer: &Layer, reach: Range<f32>, film_from_world: Mat3, pixels: &mut Vec<u32>) -> SampleLayer {
    /// A product of two unit vectors that none exceeds.
    const NO_LIMIT: f32 = 2.0;
    let mut out: SampleLayer = bytemuck::Zeroable::zeroed();
    out.clip_tries = 1;
    out.off_screen[3] = NO_LIMIT;
    match layer {
        Layer::Film => out.kind = codes::LAYER_FILM,
        Layer::Sphere => {
            out.kind = codes::LAYER_SPHERE;
            out.film_from_layer = layout::columns(film_from_world);
        }
        Layer::ImagePlane(view) => {
            out.kind = codes::LAYER_IMAGE_PLANE;
            out.film_from_layer = layout::columns(film_from_world * world_from_image_plane(view, Vec2::ONE));
        }
        Layer::Pixels(list) => {
            out.kind = codes::LAYER_PIXEL_LIST;
            out.list_first = pixels.len() as u32;
            out.list_count = list.len() as u32;
            pixels.extend_from_slice(list);
        }
        Layer::Acuity { gaze, clip, .. } => {
            out.kind = codes::LAYER_ACUITY;
            (out.radius_first, out.radius_size) = (reach.start, reach.end - reach.start);
            let about_gaze = gaze_frame(gaze.axis());
            let world_from_gaze = match gaze {
                Gaze::Scene { .. } => about_gaze,
                // Gaze and sample are points on the screen: warp about the eye, then through the view.
                Gaze::Eye { screen_half_extent, view, .. } => {
                    out.off_screen = about_gaze.row(2).extend(ALONG_THE_SCREEN).to_array();
                    world_from_image_plane(view, *screen_half_extent) * about_gaze
                }
            };
            out.film_from_layer = layout::columns(film_from_world * world_from_gaze);
            if let Some(view) = clip {
                out.clip_tries = CLIP_TRIES;
                let world_from_clip = world_from_image_plane(view, Vec2::ONE);
                out.clip_from_film = layout::columns((film_from_world * world_from_clip).inverse());
            }
        }
    }
    out
}

/// Direction from the eye, in the screen's frame, to a point of the screen in units of its half extent.
fn at_eye(on_screen: Vec2, screen_half_extent: Vec2) -> Vec3 {
    (on_screen * screen_half_extent).extend(-1.0).normalize()
}

/// To the world, up to a positive factor, from (x, y, -1) for a point of a view's image plane; `edge` is the view's edge there.
fn world_from_image_plane(view: &View, edge: Vec2) -> Mat3 {
    Mat3::from_quat(view.world_from_view) * Mat3::from_diagonal((view.half_extent / edge).extend(1.0))
}

/// Orthonormal frame with +Z along `n` (Duff et al. 2017).
pub fn gaze_frame(n: Vec3) -> Mat3 {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    Mat3::from_cols(
        Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3::new(b, sign + n.y * n.y * a, -n.y),
        n,
    )
}

/// Film pixels whose centre is inside a view; when none is, that in its middle, or all where the film shows nothing of it.
fn pixels_in_view(film: &FilmOptions, world_from_film: Quat, view: &View) -> Arc<[u32]> {
    let inside = |index: u32| {
        let d = world_from_film * film_direction(film, index % film.width, index / film.width);
        view.project(d).is_some_and(|p| p.abs().max_element() <= 1.0)
    };
    let list: Vec<u32> = (0..film.pixels() as u32).into_par_iter().filter(|&index| inside(index)).collect();
    if !list.is_empty() {
        return list.into();
    }
    match film.pixel_of(world_from_film.inverse() * view.direction(Vec2::ZERO)) {
        Some([x, y]) => Arc::new([y * film.width + x]),
        None => (0..film.pixels() as u32).collect(),
    }
}

/// Direction, in the film's frame, of a pixel's centre.
pub fn film_direction(film: &FilmOptions, x: u32, y: u32) -> Vec3 {
    place_direction(film, f64::from(x) + 0.5, f64::from(y) + 0.5)
}

/// Direction, in the film's frame, of a place on it in pixels from its top left corner.
fn place_direction(film: &FilmOptions, x: f64, y: f64) -> Vec3 {
    direction_of_parts(film, column_part(film, x), row_part(film, y))
}

/// What a column's directions have in common: sine and cosine of the longitude, or where it is on the image plane.
fn column_part(film: &FilmOptions, x: f64) -> [f64; 2] {
    let u = x / f64::from(film.width);
    match film.mapping {
        FilmMapping::Equirect => (std::f64::consts::TAU * (u - 0.5)).sin_cos().into(),
        FilmMapping::Perspective { half_extent } => [(2.0 * u - 1.0) * f64::from(half_extent[0]), 0.0],
    }
}

/// The same of a row: of the latitude.
fn row_part(film: &FilmOptions, y: f64) -> [f64; 2] {
    let v = y / f64::from(film.height);
    match film.mapping {
        FilmMapping::Equirect => (PI * (0.5 - v)).sin_cos().into(),
        FilmMapping::Perspective { half_extent } => [(1.0 - 2.0 * v) * f64::from(half_extent[1]), 0.0],
    }
}

/// Direction, in the film's frame, where a column crosses a row.
fn direction_of_parts(film: &FilmOptions, column: [f64; 2], row: [f64; 2]) -> Vec3 {
    match film.mapping {
        FilmMapping::Equirect => {
            let ([sin_lon, cos_lon], [sin_lat, cos_lat]) = (column, row);
            glam::DVec3::new(cos_lat * sin_lon, sin_lat, -cos_lat * cos_lon).as_vec3()
        }
        FilmMapping::Perspective { .. } => Vec3::new(column[0] as f32, row[0] as f32, -1.0).normalize(),
    }
}

#[cfg(test)]
mod tests {
    use fovea_sampler::{Angle, Geometry, RadialDistribution, Reddy2001};

    use super::*;

    fn foveated(view: Option<View>) -> Distribution {
        let acuity = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002);
        let inverse = Arc::new(Inverse::default_for(&acuity.expect("valid constants")));
        let clip = view.map(|view| Clip { view, margin: 0.0, unclipped_share: 0.0 });
        Distribution::foveated(Gaze::Scene { direction: Vec3::NEG_Z }, clip, inverse)
    }

    fn encoded(view: View) -> Encoded {
        let foveated = foveated(Some(view));
        let film = FilmOptions::equirect(256, 128);
        foveated.encode(FilmFrame { options: &film, world_from_film: Quat::IDENTITY }, true, None)
    }

    /// Of the layer only corners beyond the table lie in a view that just holds the rim: most samples are the table's, not all.
    #[test]
    fn a_view_that_just_holds_the_table_leaves_the_layer_a_share() {
        let encoded = encoded(View::new(Quat::IDENTITY, 11.7f32.to_radians(), 11.7f32.to_radians()));
        let share = f64::from(encoded.fovea_end) / 2f64.powi(32);
        assert!(share > 0.7 && share < 1.0 && encoded.layers[0].share > 0.0, "{share}");
        assert!((encoded.layers[0].cumulative - 1.0).abs() < 1e-6);
        assert!(encoded.fovea.is_sorted_by_key(|(bound, _)| *bound));
    }

    /// A clip leaves a layer its beginning: what is said of it is said of that.
    #[test]
    fn a_clipped_layer_is_the_beginning_of_the_whole_one() {
        let view = View::new(Quat::IDENTITY, 40f32.to_radians(), 30f32.to_radians());
        let (clipped, whole) = (foveated(Some(view)), foveated(None));
        let reach = clipped.radius_of_interest(&clipped.layers[0].1);
        assert!((0.1..0.95).contains(&reach), "{reach}");
        for u in [0.1, 0.5, 0.9] {
            let ratio = clipped.element_pixels(u) / whole.element_pixels(u * reach);
            assert!((ratio - 1.0).abs() < 0.02, "{u}: {ratio}");
        }
        let film = FilmOptions::equirect(256, 128);
        let ratio = clipped.peak_share(&film) / whole.peak_share(&film) * f64::from(reach);
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }

    /// A view whose edge cuts through the disc has no table, nor the words of one.
    #[test]
    fn a_view_that_cuts_the_disc_has_no_table() {
        let encoded = encoded(View::new(Quat::IDENTITY, 8f32.to_radians(), 8f32.to_radians()));
        assert!(encoded.fovea.is_empty() && encoded.fovea_end == 0);
        assert_eq!(encoded.layers[0].share, 1.0);
    }
}
