//! Two modes beside each other: a line through the picture, the first film to its left and the other to its right.

use std::time::Duration;

use egui::{Align2, Color32, CursorIcon, FontId, Id, Painter, Pos2, Rect, Sense, Stroke, Ui, Vec2};

use super::controls::{MODES, Readout, clock, metric};
use super::theme;
use crate::cli::choices::Mode;

/// The line can be taken from so far away, points.
const REACH: f32 = 6.0;

/// A second mode beside the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// The other mode.
    pub mode: Mode,
    /// Where the line is: 0 at the picture's left edge, 1 at its right.
    pub wipe: f32,
}

impl Default for Comparison {
    fn default() -> Self {
        Self { mode: Mode::Vp, wipe: 0.5 }
    }
}

impl Comparison {
    /// The first column of a picture that is the other film's.
    pub fn first_pixel(&self, width: u32) -> u32 {
        (self.wipe.clamp(0.0, 1.0) * width as f32).round() as u32
    }
}

/// Figures of the other film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BesideReadout {
    /// Its mode.
    pub mode: Mode,
    /// Samples in it.
    pub samples: u64,
    /// Time spent tracing it.
    pub traced: Duration,
    /// Relative error at the gaze, as [`Block::error`](crate::convergence::Block::error).
    pub error: Option<f64>,
}

/// Draws the line over the picture in `rect` with what is known of both sides, and follows when it is dragged.
pub fn wipe(ui: &mut Ui, rect: Rect, mode: Mode, comparison: &mut Comparison, readout: &Readout) {
    let at = |wipe: f32| rect.left() + wipe * rect.width();
    let handle = Rect::from_x_y_ranges(at(comparison.wipe) - REACH..=at(comparison.wipe) + REACH, rect.y_range());
    let response = ui.interact(handle, Id::unique("wipe"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
    if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
        comparison.wipe = ((pointer.x - rect.left()) / rect.width().max(1.0)).clamp(0.0, 1.0);
    }
    let x = at(comparison.wipe);
    let painter = ui.painter();
    let is_held = response.hovered() || response.dragged();
    painter.vline(x, rect.y_range(), Stroke::new(3.0, Color32::from_black_alpha(120)));
    let color = if is_held { theme::ACCENT } else { Color32::from_white_alpha(220) };
    painter.vline(x, rect.y_range(), Stroke::new(1.0, color));
    painter.circle(Pos2::new(x, rect.center().y), 5.0, color, Stroke::new(1.0, Color32::from_black_alpha(160)));
    let first = (mode, readout.samples, readout.elapsed, readout.convergence.block.error);
    let top = rect.top() + 14.0;
    said(painter, Pos2::new(x - 12.0, top), Align2::RIGHT_TOP, first);
    if let Some(beside) = readout.seen.beside {
        let other = (beside.mode, beside.samples, beside.traced, beside.error);
        said(painter, Pos2::new(x + 12.0, top), Align2::LEFT_TOP, other);
    }
}

/// A film in two lines, on a dark ground.
fn said(
    painter: &Painter,
    at: Pos2,
    anchor: Align2,
    (mode, samples, traced, error): (Mode, u64, Duration, Option<f64>),
) {
    let name = MODES.iter().find(|entry| entry.0 == mode).map_or("", |entry| entry.1);
    let error = error.map_or("too few to tell".to_owned(), |error| format!("{:.1} % at the gaze", 100.0 * error));
    let text = format!("{name}\n{} samples in {}\nnoise: {error}", metric(samples as f64), clock(traced));
    let galley = painter.layout_no_wrap(text, FontId::proportional(12.0), Color32::WHITE);
    let place = anchor.anchor_size(at, galley.size());
    painter.rect_filled(place.expand2(Vec2::new(7.0, 5.0)), 5.0, theme::BACKDROP);
    painter.galley(place.min, galley, Color32::WHITE);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_is_where_the_share_says() {
        for (wipe, first) in [(-1.0, 0), (0.0, 0), (0.25, 25), (0.5, 50), (1.0, 100), (7.0, 100)] {
            assert_eq!(Comparison { wipe, ..Comparison::default() }.first_pixel(100), first);
        }
    }
}
