//! Which film suits a view: a panorama, or what a narrow lens sees where a panorama would be too coarse.

use glam::{Quat, Vec2};
use tracer::film::{FilmMapping, FilmOptions};

use crate::view::View;

/// Panoramas are at least this wide, pixels.
const SMALLEST_PANORAMA: u32 = 512;
/// A film this many times coarser than the view, or than a film for the lens where memory limits that, gives way to one.
const TOLERABLE_COARSENESS: f32 = 4.0;
/// A lens film reaches this much farther than the view for which it was made, so that small turns stay on it.
const LENS_MARGIN: f32 = 1.25;

/// A film and what its centre looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmPlan {
    /// Size and mapping.
    pub options: FilmOptions,
    /// World from film.
    pub world_from_film: Quat,
}

impl FilmPlan {
    /// The film for a view of `size_px` pixels, of at most `memory_bytes`.
    ///
    /// The panorama's width is the next power of two above 360 times the view's pixels per degree, or what fits.
    pub fn new(view: &View, size_px: Vec2, memory_bytes: u64) -> Self {
        let panorama = Self::panorama(view, size_px, memory_bytes, u32::MAX);
        if panorama.suits(view, size_px, memory_bytes) { panorama } else { Self::lens(view, size_px, memory_bytes) }
    }

    /// The panorama for a view of `size_px` pixels, at most `widest` pixels wide and of at most `memory_bytes`.
    pub fn panorama(view: &View, size_px: Vec2, memory_bytes: u64, widest: u32) -> Self {
        let wanted = (pixels_per_radian(view, size_px) * std::f32::consts::TAU).clamp(1.0, 65_536.0) as u32;
        let mut width = wanted.next_power_of_two().max(SMALLEST_PANORAMA);
        let too_large = |width| width > widest || FilmOptions::equirect(width, width / 2).bytes() > memory_bytes;
        while too_large(width) && width > SMALLEST_PANORAMA {
            width /= 2;
        }
        Self { options: FilmOptions::equirect(width, width / 2), world_from_film: Quat::IDENTITY }
    }

    /// Whether a view can be shown from this film without another of at most `memory_bytes` being clearly better.
    pub fn suits(&self, view: &View, size_px: Vec2, memory_bytes: u64) -> bool {
        let lens = Self::lens(view, size_px, memory_bytes).coarseness(view, size_px);
        self.coarseness(view, size_px) <= TOLERABLE_COARSENESS * lens.max(1.0) && self.covers(view)
    }

    /// Whether the film reaches to the corners of a view.
    pub fn covers(&self, view: &View) -> bool {
        let FilmMapping::Perspective { half_extent } = self.options.mapping else { return true };
        let corners = [Vec2::ONE, Vec2::new(-1.0, 1.0), Vec2::NEG_ONE, Vec2::new(1.0, -1.0)];
        corners.into_iter().all(|corner| {
            let d = self.world_from_film.inverse() * view.direction_at(corner);
            let limit = Vec2::from(half_extent) * 1.001;
            d.z < 0.0 && (d.truncate() / -d.z).abs().cmple(limit).all()
        })
    }

    /// View pixels per film pixel, along an axis at the centre.
    fn coarseness(&self, view: &View, size_px: Vec2) -> f32 {
        let film = match self.options.mapping {
            FilmMapping::Equirect => self.options.width as f32 / std::f32::consts::TAU,
            FilmMapping::Perspective { half_extent } => self.options.width as f32 / (2.0 * half_extent[0]),
        };
        pixels_per_radian(view, size_px) / film
    }

    /// As fine as the view, or as memory allows.
    fn lens(view: &View, size_px: Vec2, memory_bytes: u64) -> Self {
        let sides = (size_px * LENS_MARGIN).max(Vec2::ONE).to_array().map(|side| side.ceil() as u32);
        let yfov = 2.0 * (view.tan_half.y * LENS_MARGIN).atan();
        let wanted_bytes = FilmOptions::perspective(sides[0], sides[1], yfov).bytes();
        let share = (memory_bytes as f64 / wanted_bytes as f64).sqrt().min(1.0);
        let [width, height] = sides.map(|side| ((f64::from(side) * share) as u32).max(1));
        Self { options: FilmOptions::perspective(width, height, yfov), world_from_film: view.film_from_view() }
    }
}

/// Pixels of the view per radian, at its centre.
fn pixels_per_radian(view: &View, size_px: Vec2) -> f32 {
    size_px.y / (2.0 * view.tan_half.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Vec2 = Vec2::new(1280.0, 720.0);
    const MEMORY: u64 = 512 << 20;

    fn view(yaw_deg: f32, vfov_deg: f32) -> View {
        View::new(yaw_deg.to_radians(), 0.2, 1.0, vfov_deg.to_radians()).with_aspect(SIZE.x / SIZE.y)
    }

    #[test]
    fn a_panorama_is_as_wide_as_the_view_and_the_memory_ask() {
        // 720 pixels over 90 degrees: 360 a radian at the centre, 2262 around.
        let plan = FilmPlan::new(&view(0.0, 90.0), SIZE, MEMORY);
        assert_eq!(plan.options, FilmOptions::equirect(4096, 2048));
        assert_eq!(FilmPlan::new(&view(0.0, 90.0), SIZE, 100 << 20).options, FilmOptions::equirect(2048, 1024));
        // 16 MiB hold a panorama of 512 pixels, more than four times coarser than a lens film of 800.
        let plan = FilmPlan::new(&view(0.0, 50.0), SIZE, 16 << 20);
        assert!(matches!(plan.options.mapping, FilmMapping::Perspective { .. }), "{plan:?}");
    }

    #[test]
    fn no_film_of_a_window_is_larger_than_its_memory_or_gives_way_at_once() {
        for size in [Vec2::new(320.0, 240.0), SIZE, Vec2::new(3840.0, 2160.0), Vec2::new(1080.0, 1920.0)] {
            for memory in [16 << 20, 21_000_007, MEMORY] {
                for vfov_deg in [2.0_f32, 8.0, 25.0, 50.0, 65.0, 90.0, 120.0] {
                    let view = |yaw| View::new(yaw, 0.2, 1.0, vfov_deg.to_radians()).with_aspect(size.x / size.y);
                    let plan = FilmPlan::new(&view(0.0), size, memory);
                    assert!(plan.options.bytes() <= memory, "{plan:?}");
                    let turned = view(0.02 * vfov_deg.to_radians());
                    assert!(plan.suits(&view(0.0), size, memory) && plan.suits(&turned, size, memory), "{plan:?}");
                    // What memory there is, is used.
                    let is_lens = plan.options.mapping != FilmMapping::Equirect;
                    assert!(
                        !is_lens || plan.options.height as f32 >= size.y || plan.options.bytes() > memory / 100 * 99
                    );
                }
            }
        }
    }

    #[test]
    fn turning_stays_on_a_panorama_and_zooming_far_leaves_it() {
        let plan = FilmPlan::new(&view(0.0, 50.0), SIZE, MEMORY);
        assert!(plan.suits(&view(170.0, 50.0), SIZE, MEMORY) && plan.suits(&view(0.0, 20.0), SIZE, MEMORY));
        assert!(!plan.suits(&view(0.0, 8.0), SIZE, MEMORY));
    }

    #[test]
    fn a_narrow_lens_gets_its_own_film_until_the_view_leaves_it() {
        let plan = FilmPlan::new(&view(0.0, 8.0), SIZE, MEMORY);
        assert!(matches!(plan.options.mapping, FilmMapping::Perspective { .. }));
        assert_eq!((plan.options.width, plan.options.height), (1600, 900));
        assert!(plan.suits(&view(0.0, 8.0), SIZE, MEMORY) && plan.suits(&view(1.0, 8.0), SIZE, MEMORY));
        assert!(!plan.suits(&view(10.0, 8.0), SIZE, MEMORY) && !plan.suits(&view(0.0, 20.0), SIZE, MEMORY));
    }
}
