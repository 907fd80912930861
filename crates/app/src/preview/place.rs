//! Where the window is, so that it opens there again.

use egui::{Context, ViewportCommand};

use crate::gaze::geometry::RectPx;
use crate::preferences::WindowPlace;

/// A window of which less than this can be seen, along an axis, cannot be taken hold of.
const GRIP_PX: f64 = 64.0;
/// From the corner of a screen to a window that is brought back, points.
const CORNER: f32 = 40.0;

/// The window's place as it is; a maximised, minimised or full-screen one goes back to where it was before.
pub fn of(ctx: &Context, before: Option<WindowPlace>) -> Option<WindowPlace> {
    // A window opens without zoom, and points are larger with it.
    let zoom = ctx.zoom_factor();
    ctx.input(|input| {
        let viewport = input.viewport();
        let is = |state: Option<bool>| state == Some(true);
        if is(viewport.minimized) || is(viewport.fullscreen) {
            return before;
        }
        if is(viewport.maximized) {
            return before.map(|place| WindowPlace { maximized: true, ..place });
        }
        // Halves of points are the window system's, not a person's.
        let pair = |x: f32, y: f32| [x, y].map(|points| (points * zoom).round());
        // Wayland tells no window where it is, but how large it is.
        let size = viewport.inner_rect.unwrap_or_else(|| input.viewport_rect()).size();
        let position = viewport.outer_rect.map(|rect| pair(rect.min.x, rect.min.y));
        Some(WindowPlace { size: pair(size.x, size.y), position, maximized: false })
    })
}

/// Brings a window back that opened where no screen is any more.
pub fn bring_back(ctx: &Context, frame: &eframe::Frame) {
    let Some(window) = frame.winit_window() else { return };
    let Ok(position) = window.outer_position() else { return };
    let rect = |x: i32, y: i32, width: u32, height: u32| RectPx {
        origin: [x.into(), y.into()],
        size: [width.into(), height.into()],
    };
    let size = window.outer_size();
    let monitors: Vec<RectPx> = window
        .available_monitors()
        .map(|monitor| rect(monitor.position().x, monitor.position().y, monitor.size().width, monitor.size().height))
        .collect();
    let own = rect(position.x, position.y, size.width, size.height);
    if let Some(first) = monitors.first().filter(|_| !can_be_seen(own, &monitors)) {
        let points = ctx.pixels_per_point();
        let corner = egui::pos2(first.origin[0] as f32, first.origin[1] as f32) / points;
        ctx.send_viewport_cmd(ViewportCommand::OuterPosition(corner + egui::Vec2::splat(CORNER)));
    }
}

/// Whether enough of a window lies on some screen.
fn can_be_seen(window: RectPx, monitors: &[RectPx]) -> bool {
    let shared = |monitor: &RectPx, axis: usize| {
        let low = window.origin[axis].max(monitor.origin[axis]);
        let high = (window.origin[axis] + window.size[axis]).min(monitor.origin[axis] + monitor.size[axis]);
        high - low >= GRIP_PX.min(window.size[axis])
    };
    monitors.iter().any(|monitor| (0..2).all(|axis| shared(monitor, axis)))
}

#[cfg(test)]
mod tests {
    use egui::{RawInput, Rect, ViewportId, ViewportInfo, pos2, vec2};

    use super::*;

    /// The place of a window of 1200x800 points of the system's, zoomed; `is_told`: the system says where it is.
    fn placed(zoom: f32, is_told: bool) -> Option<WindowPlace> {
        let ctx = Context::default();
        let rect = |x: f32, y: f32| Rect::from_min_size(pos2(x, y), vec2(1200.0, 800.0)) / zoom;
        let viewport = ViewportInfo {
            native_pixels_per_point: Some(2.0),
            inner_rect: is_told.then(|| rect(100.0, 60.0)),
            outer_rect: is_told.then(|| rect(96.0, 30.0)),
            ..ViewportInfo::default()
        };
        let mut place = None;
        // A zoom begins with the frame after it was set, which egui scales by itself.
        for _ in 0..3 {
            let viewports = [(ViewportId::ROOT, viewport.clone())].into_iter().collect();
            let input = RawInput { screen_rect: Some(rect(0.0, 0.0)), viewports, ..RawInput::default() };
            let mut output = ctx.run_ui(input, |ui| {
                ui.ctx().set_zoom_factor(zoom);
                place = of(ui.ctx(), None);
            });
            output.textures_delta.clear();
        }
        place
    }

    #[test]
    fn a_window_is_as_large_whatever_its_zoom_and_where_nobody_says_where_it_is() {
        for zoom in [0.5, 1.0, 1.25] {
            let size = [1200.0, 800.0];
            let told = WindowPlace { size, position: Some([96.0, 30.0]), maximized: false };
            assert_eq!(placed(zoom, true), Some(told), "{zoom}");
            assert_eq!(placed(zoom, false), Some(WindowPlace { position: None, ..told }), "{zoom}");
        }
    }

    #[test]
    fn a_window_beside_all_screens_is_noticed() {
        let rect = |x: f64, y: f64, width: f64, height: f64| RectPx { origin: [x, y], size: [width, height] };
        let monitors = [rect(0.0, 0.0, 1920.0, 1080.0), rect(-1280.0, 0.0, 1280.0, 1024.0)];
        for seen in [rect(100.0, 100.0, 800.0, 600.0), rect(-1200.0, 900.0, 800.0, 600.0), rect(0.0, 0.0, 20.0, 20.0)] {
            assert!(can_be_seen(seen, &monitors), "{seen:?}");
        }
        for lost in [rect(1900.0, 10.0, 800.0, 600.0), rect(3000.0, 0.0, 800.0, 600.0), rect(0.0, -580.0, 800.0, 600.0)]
        {
            assert!(!can_be_seen(lost, &monitors), "{lost:?}");
        }
    }
}
