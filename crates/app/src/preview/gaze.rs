//! Where in the picture one looks: the pointer over it, the window's place on the desktop, and the ring at the fovea.

use egui::{Color32, Pos2, Rect, Shape, Stroke};
use glam::Vec2;

use super::navigation::{point_in_view, point_in_window};
use crate::gaze::geometry::{RectPx, WindowPlace};
use crate::screen::{FOVEA_DEG, ScreenGeometry};

/// Where one looks, in the view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gaze {
    /// A point of the view: +-1 at the edges, y up.
    pub point: Vec2,
}

/// The pointer while it is over the picture: +-1 at its edges, y up.
pub fn pointer(response: &egui::Response) -> Option<[f64; 2]> {
    let pointer = response.hover_pos().or_else(|| response.interact_pointer_pos());
    let inside = pointer.filter(|pointer| response.rect.contains(*pointer))?;
    Some(point_in_view(response.rect, inside).as_dvec2().to_array())
}

/// A screen of the desktop, and where the window's content begins on it, physical pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Desktop {
    /// The screen that the window is on.
    pub monitor: RectPx,
    /// What the system calls that screen, with its size.
    pub monitor_name: String,
    /// Top left of the window's content; `None` where the system does not tell, as under Wayland.
    pub content_origin: Option<[f64; 2]>,
}

impl Desktop {
    /// From the window system; `None` when it names no screen.
    pub fn of(frame: &eframe::Frame) -> Option<Self> {
        let window = frame.winit_window()?;
        let monitor = window.current_monitor().or_else(|| window.primary_monitor())?;
        let (position, size) = (monitor.position(), monitor.size());
        if size.width == 0 || size.height == 0 {
            return None;
        }
        let content = window.inner_position().ok();
        Some(Self {
            monitor: RectPx {
                origin: [position.x.into(), position.y.into()],
                size: [size.width.into(), size.height.into()],
            },
            monitor_name: format!("{} {}x{}", monitor.name().unwrap_or_default(), size.width, size.height),
            content_origin: content.map(|origin| [origin.x.into(), origin.y.into()]),
        })
    }

    /// Where a picture at `rect` (points of the window) is. A window whose place is not known counts as centred, which is
    /// right when it fills the screen.
    pub fn place(&self, rect: Rect, pixels_per_point: f32, screen: ScreenGeometry) -> WindowPlace {
        let px = |points: f32| f64::from(points * pixels_per_point);
        let size = [px(rect.width()).max(1.0), px(rect.height()).max(1.0)];
        let centre = self.monitor.centre();
        let origin = match self.content_origin {
            Some(origin) => [origin[0] + px(rect.min.x), origin[1] + px(rect.min.y)],
            None => [centre[0] - 0.5 * size[0], centre[1] - 0.5 * size[1]],
        };
        WindowPlace {
            monitor: self.monitor,
            picture: RectPx { origin, size },
            screen,
            position_known: self.content_origin.is_some(),
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
    fn the_picture_is_where_the_window_is() {
        let monitor = RectPx { origin: [1920.0, 0.0], size: [2560.0, 1440.0] };
        let mut desktop = Desktop { monitor, monitor_name: String::new(), content_origin: Some([2000.0, 100.0]) };
        let rect = Rect::from_min_size(egui::pos2(10.0, 20.0), egui::vec2(640.0, 360.0));
        let place = desktop.place(rect, 2.0, ScreenGeometry::default());
        assert_eq!(place.picture, RectPx { origin: [2020.0, 140.0], size: [1280.0, 720.0] });
        desktop.content_origin = None;
        let place = desktop.place(rect, 2.0, ScreenGeometry::default());
        assert_eq!((place.picture.centre(), place.position_known), (monitor.centre(), false));
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
