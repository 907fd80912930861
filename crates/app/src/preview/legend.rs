//! What the colours in the picture stand for, in its corner.

use egui::{Align2, Area, Color32, Context, Id, Mesh, Pos2, Rect, RichText, Sense, Shape, Ui, Vec2};
use tracer::view::colors::{FALSE_COLORS, STALE_COLOR, ramp};
use tracer::view::{DebugScale, DebugView};

use super::controls::{Controls, metric};
use super::theme;
use crate::cli::choices::ToneMapping;

/// Size of a bar of colours, points.
const BAR: Vec2 = Vec2::new(234.0, 12.0);
/// Colours of normals along the axes.
const AXES: [([u8; 3], &str); 3] = [([255, 128, 128], "+X"), ([128, 255, 128], "+Y"), ([128, 128, 255], "+Z")];
/// Steps in which a ramp is drawn.
const RAMP_STEPS: u8 = 48;

/// Draws the legend of what is shown, `offset` points from the window's right edge; nothing where the picture speaks for itself.
pub fn draw(ctx: &Context, controls: &Controls, scale: Option<DebugScale>, offset: f32) {
    let is_false_color = controls.shown == DebugView::Beauty && controls.tone_map == ToneMapping::FalseColor;
    let caption = match controls.shown {
        DebugView::Beauty if is_false_color => "Stops about middle grey",
        DebugView::Beauty => return,
        DebugView::SampleDensity => "Samples per pixel of the view; black: none",
        DebugView::Error => "Standard error over brightness; black: unknown",
        DebugView::Stale => "Still from before the last change",
        DebugView::Albedo => "Base colour",
        DebugView::Normal => "Normals, in the scene's axes",
        DebugView::Depth => "Distance; black: nothing",
        DebugView::TraversalSteps => "Nodes and triangles that a ray visits",
    };
    let area = Area::new(Id::unique("legend")).anchor(Align2::RIGHT_BOTTOM, Vec2::new(-10.0 - offset, -10.0));
    area.interactable(false).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            match (controls.shown, scale) {
                (DebugView::Beauty, _) => stops(ui),
                (DebugView::Stale, _) => swatches(ui, &[(STALE_COLOR, caption)]),
                (DebugView::Normal, _) => swatches(ui, &AXES),
                (shown, Some(scale)) => bar(ui, scale, |value| words(shown, value)),
                (_, None) => {}
            }
            if controls.shown != DebugView::Stale {
                ui.add(egui::Label::new(RichText::new(caption).small().weak()).extend());
            }
        });
    });
}

/// A value with its unit.
fn words(shown: DebugView, value: f32) -> String {
    match shown {
        DebugView::Depth => format!("{} m", metric(value.into())),
        DebugView::Error => format!("{} %", metric(f64::from(value) * 100.0)),
        DebugView::SampleDensity if value < 1.0 => format!("1/{:.0}", 1.0 / value),
        DebugView::SampleDensity | DebugView::TraversalSteps => format!("{value:.0}"),
        _ => metric(value.into()),
    }
}

fn color([r, g, b]: [u8; 3]) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// One colour a stop, with the number of each.
fn stops(ui: &mut Ui) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(BAR.x, BAR.y + 14.0), Sense::hover());
    let width = BAR.x / FALSE_COLORS.len() as f32;
    let middle = FALSE_COLORS.len() as i32 / 2;
    for (index, band) in FALSE_COLORS.into_iter().enumerate() {
        let left = rect.left() + width * index as f32;
        let cell = Rect::from_min_size(Pos2::new(left, rect.top()), Vec2::new(width, BAR.y));
        ui.painter().rect_filled(cell, 0.0, color(band));
        let stop = index as i32 - middle;
        let text = if stop > 0 { format!("+{stop}") } else { stop.to_string() };
        number(ui, Pos2::new(cell.center().x, cell.bottom() + 2.0), Align2::CENTER_TOP, text);
    }
}

/// The ramp with the values at its ends and between.
fn bar(ui: &mut Ui, scale: DebugScale, words: impl Fn(f32) -> String) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(BAR.x, BAR.y + 14.0), Sense::hover());
    let mut mesh = Mesh::default();
    for step in 0..=RAMP_STEPS {
        let place = f32::from(step) / f32::from(RAMP_STEPS);
        let x = rect.left() + place * BAR.x;
        for y in [rect.top(), rect.top() + BAR.y] {
            mesh.colored_vertex(Pos2::new(x, y), color(ramp(place)));
        }
        if step > 0 {
            let first = 2 * u32::from(step) - 2;
            mesh.add_triangle(first, first + 1, first + 2);
            mesh.add_triangle(first + 1, first + 2, first + 3);
        }
    }
    ui.painter().add(Shape::mesh(mesh));
    for (place, anchor) in [(0.0, Align2::LEFT_TOP), (0.5, Align2::CENTER_TOP), (1.0, Align2::RIGHT_TOP)] {
        let at = Pos2::new(rect.left() + place * BAR.x, rect.top() + BAR.y + 2.0);
        number(ui, at, anchor, words(scale.value(place)));
    }
}

fn number(ui: &Ui, at: Pos2, anchor: Align2, text: String) {
    let font = egui::TextStyle::Small.resolve(ui.style());
    ui.painter().text(at, anchor, text, font, ui.visuals().text_color());
}

fn swatches(ui: &mut Ui, entries: &[([u8; 3], &str)]) {
    ui.horizontal(|ui| {
        for (swatch, name) in entries {
            let (rect, _) = ui.allocate_exact_size(Vec2::splat(BAR.y), Sense::hover());
            ui.painter().rect_filled(rect, 2.0, color(*swatch));
            ui.label(RichText::new(*name).small());
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_their_units() {
        for (shown, value, text) in [
            (DebugView::Depth, 0.25, "0.25 m"),
            (DebugView::Depth, 12.34, "12.3 m"),
            (DebugView::Error, 0.001, "0.10 %"),
            (DebugView::Error, 1.0, "100 %"),
            (DebugView::SampleDensity, 1.0 / 16.0, "1/16"),
            (DebugView::SampleDensity, 4096.0, "4096"),
            (DebugView::TraversalSteps, 57.4, "57"),
        ] {
            assert_eq!(words(shown, value), text);
        }
    }
}
