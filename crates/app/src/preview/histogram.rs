//! The histogram in the panel.

use egui::{Align2, Color32, Pos2, Rect, RichText, Role, Sense, Stroke, Ui, Vec2, WidgetInfo};
use tracer::view::Histogram;
use tracer::view::colors::{MIDDLE_GREY, false_color};
use tracer::view::histogram::{HISTOGRAM_BINS, HISTOGRAM_BINS_PER_STOP};

/// Height of the bars, points.
const HEIGHT: f32 = 64.0;

/// Draws the histogram, or says that there is none yet.
pub fn panel(ui: &mut Ui, histogram: Option<&Histogram>) {
    let Some(histogram) = histogram else {
        ui.label(RichText::new("No picture yet").small().weak());
        return;
    };
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), HEIGHT + 14.0), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "Histogram of the luminance"));
    let bars = Rect::from_min_size(rect.min, Vec2::new(rect.width(), HEIGHT));
    let painter = ui.painter();
    painter.rect_filled(bars, 3.0, Color32::from_black_alpha(110));
    let width = bars.width() / HISTOGRAM_BINS as f32;
    let x_of = |stops: f32| bars.left() + (stops - Histogram::stops_at(0)) * HISTOGRAM_BINS_PER_STOP as f32 * width;
    for stops in [-8, -4, 0, 4, 8_i8] {
        let x = x_of(f32::from(stops));
        painter.vline(x, bars.y_range(), Stroke::new(1.0, Color32::from_white_alpha(if stops == 0 { 70 } else { 28 })));
        let text = if stops > 0 { format!("+{stops}") } else { stops.to_string() };
        let font = egui::TextStyle::Small.resolve(ui.style());
        painter.text(Pos2::new(x, bars.bottom() + 1.0), Align2::CENTER_TOP, text, font, ui.visuals().weak_text_color());
    }
    // The ends hold all that lies beyond, which would dwarf the rest.
    let inner = &histogram.bins[1..HISTOGRAM_BINS - 1];
    let highest = inner.iter().copied().max().unwrap_or(0).max(1) as f32;
    for (bin, count) in histogram.bins.iter().enumerate().filter(|(_, count)| **count > 0) {
        // The root shows small counts beside large ones.
        let height = (*count as f32 / highest).min(1.0).sqrt() * (HEIGHT - 2.0);
        let left = bars.left() + bin as f32 * width;
        let bar = Rect::from_min_max(Pos2::new(left, bars.bottom() - height), Pos2::new(left + width, bars.bottom()));
        let middle = Histogram::stops_at(bin) + 0.5 / HISTOGRAM_BINS_PER_STOP as f32;
        let [r, g, b] = false_color(MIDDLE_GREY * middle.exp2());
        painter.rect_filled(bar, 0.0, Color32::from_rgb(r, g, b));
    }
    ui.horizontal(|ui| {
        let share = |share: f32| format!("{:.1} %", 100.0 * share);
        for (name, value, hint) in [
            ("Black", share(histogram.black_share()), "Pixels that the tone map shows as black"),
            (
                "Clipped",
                share(histogram.clipped_share()),
                "Pixels of which the tone map shows a channel at its largest value",
            ),
        ] {
            ui.label(RichText::new(name).weak()).on_hover_text(hint);
            ui.label(RichText::new(value).monospace());
        }
    });
    ui.label(RichText::new("Luminance in stops about middle grey, exposed").small().weak());
}
