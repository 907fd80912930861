//! The pointer as gaze: where on the screen one looks, and what lies there.

use egui::{Color32, Pos2, Rect, Shape, Stroke};
use glam::Vec2;

use super::navigation::{point_in_view, point_in_window};
use crate::screen::{FOVEA_DEG, ScreenGeometry};

/// Where one looks, in the view. It stays where it was while the pointer is elsewhere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gaze {
    /// A point of the view: +-1 at the edges, y up.
    pub point: Vec2,
}

impl Gaze {
    /// Follows the pointer while it is over the picture.
    pub fn update(&mut self, response: &egui::Response) {
        let pointer = response.hover_pos().or_else(|| response.interact_pointer_pos());
        if let Some(pointer) = pointer.filter(|pointer| response.rect.contains(*pointer)) {
            self.point = point_in_view(response.rect, pointer);
        }
    }
}

/// The window as the eye sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenMapping {
    /// Screen and distance.
    pub screen: ScreenGeometry,
    /// Half the picture's width and height on the screen, millimetres.
    pub half_size_mm: Vec2,
}

impl ScreenMapping {
    /// For a picture at `rect` (points) on a monitor of `monitor` points; where the system does not say how large the
    /// monitor is, full HD is assumed.
    pub fn new(screen: ScreenGeometry, rect: Rect, monitor: Option<egui::Vec2>) -> Self {
        let monitor = monitor.filter(|size| size.min_elem() > 1.0).unwrap_or(egui::vec2(1920.0, 1080.0));
        let mm_per_point = screen.mm_per_px(Vec2::new(monitor.x, monitor.y));
        Self { screen, half_size_mm: Vec2::new(rect.width(), rect.height()) * 0.5 * mm_per_point }
    }

    /// Degrees at the eye that one physical pixel spans at the centre, with so many pixels a point.
    pub fn deg_per_px(&self, rect: Rect, pixels_per_point: f32) -> f32 {
        let pixel_mm = self.half_size_mm.x * 2.0 / (rect.width() * pixels_per_point).max(1.0);
        (pixel_mm / self.screen.distance_mm).atan().to_degrees()
    }

    /// The outline of the fovea about a gaze, as points of the window.
    pub fn fovea_outline(&self, rect: Rect, gaze: Gaze) -> Vec<Pos2> {
        let ring = self.screen.ring_mm(gaze.point * self.half_size_mm, FOVEA_DEG.to_radians(), 96);
        ring.into_iter().map(|point_mm| point_in_window(rect, point_mm / self.half_size_mm)).collect()
    }
}

/// The ring at the fovea's edge: light on a dark line, so that it shows on every picture.
pub fn fovea_ring(mapping: &ScreenMapping, rect: Rect, gaze: Gaze) -> [Shape; 2] {
    let outline = mapping.fovea_outline(rect, gaze);
    [
        Shape::closed_line(outline.clone(), Stroke::new(3.0, Color32::from_black_alpha(90))),
        Shape::closed_line(outline, Stroke::new(1.0, Color32::from_white_alpha(170))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect() -> Rect {
        Rect::from_min_size(Pos2::ZERO, egui::vec2(1280.0, 720.0))
    }

    #[test]
    fn the_fovea_on_a_full_hd_monitor_is_a_circle_of_238_pixels() {
        let mapping = ScreenMapping::new(ScreenGeometry::default(), rect(), Some(egui::vec2(1920.0, 1080.0)));
        let outline = mapping.fovea_outline(rect(), Gaze::default());
        // 650 mm * tan(5.79 deg) = 65.9 mm at 0.2766 mm a pixel.
        for point in &outline {
            assert!((point.distance(rect().center()) - 238.2).abs() < 0.7, "{point:?}");
        }
        assert!((mapping.deg_per_px(rect(), 1.0) - 0.02438).abs() < 1e-4);
        assert!((mapping.deg_per_px(rect(), 2.0) - 0.01219).abs() < 1e-4);
    }

    #[test]
    fn away_from_the_centre_the_fovea_covers_more_of_the_screen() {
        let mapping = ScreenMapping::new(ScreenGeometry::default(), rect(), None);
        let width = |gaze: Vec2| {
            let outline = mapping.fovea_outline(rect(), Gaze { point: gaze });
            let xs = || outline.iter().map(|point| point.x);
            xs().fold(f32::MIN, f32::max) - xs().fold(f32::MAX, f32::min)
        };
        assert!(width(Vec2::new(0.95, 0.0)) > 1.05 * width(Vec2::ZERO));
    }
}
