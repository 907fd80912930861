//! How the overlay looks: dark, compact, and quiet beside the picture.

use egui::{Color32, CornerRadius, FontFamily, FontId, Frame, Margin, Stroke, TextStyle, Visuals};

/// What is active or selected.
pub const ACCENT: Color32 = Color32::from_rgb(238, 176, 84);
/// Something to know about.
pub const NOTICE: Color32 = Color32::from_rgb(240, 200, 120);
/// Something that went wrong.
pub const ERROR: Color32 = Color32::from_rgb(244, 128, 110);
/// Behind text that lies on the picture; the picture shows through a little.
pub const BACKDROP: Color32 = Color32::from_rgba_premultiplied(17, 18, 20, 228);
const TEXT: Color32 = Color32::from_rgb(214, 216, 220);
const BRIGHT: Color32 = Color32::from_rgb(244, 245, 247);

/// Sets colours, text sizes and spacing for the whole window.
pub fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| {
        style.text_styles = [
            (TextStyle::Heading, FontId::new(15.0, FontFamily::Proportional)),
            (TextStyle::Body, FontId::new(12.5, FontFamily::Proportional)),
            (TextStyle::Button, FontId::new(12.5, FontFamily::Proportional)),
            (TextStyle::Small, FontId::new(11.0, FontFamily::Proportional)),
            (TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace)),
        ]
        .into();
        style.spacing.item_spacing = egui::vec2(6.0, 5.0);
        style.spacing.button_padding = egui::vec2(7.0, 3.0);
        style.spacing.interact_size.y = 20.0;
        style.spacing.slider_width = 128.0;
        style.visuals = visuals();
    });
}

/// The frame of a panel that lies on the picture.
pub fn panel() -> Frame {
    Frame::new().fill(BACKDROP).corner_radius(CornerRadius::same(7)).inner_margin(Margin::same(10))
}

fn visuals() -> Visuals {
    let mut visuals = Visuals::dark();
    visuals.override_text_color = None;
    visuals.window_fill = BACKDROP;
    visuals.panel_fill = Color32::from_rgb(17, 18, 20);
    visuals.window_stroke = Stroke::NONE;
    visuals.window_corner_radius = CornerRadius::same(7);
    visuals.menu_corner_radius = CornerRadius::same(5);
    visuals.warn_fg_color = NOTICE;
    visuals.error_fg_color = ERROR;
    visuals.selection.bg_fill = Color32::from_rgb(92, 68, 30);
    visuals.selection.stroke = Stroke::new(1.0, ACCENT);
    visuals.slider_trailing_fill = true;
    let widgets = &mut visuals.widgets;
    for (state, fill, text) in [
        (&mut widgets.noninteractive, Color32::TRANSPARENT, TEXT),
        (&mut widgets.inactive, Color32::from_white_alpha(16), TEXT),
        (&mut widgets.hovered, Color32::from_white_alpha(34), BRIGHT),
        (&mut widgets.active, Color32::from_white_alpha(48), BRIGHT),
        (&mut widgets.open, Color32::from_white_alpha(28), BRIGHT),
    ] {
        state.bg_fill = fill;
        state.weak_bg_fill = fill;
        state.bg_stroke = Stroke::NONE;
        state.fg_stroke = Stroke::new(1.0, text);
        state.corner_radius = CornerRadius::same(4);
        state.expansion = 0.0;
    }
    widgets.noninteractive.bg_stroke = Stroke::new(1.0, Color32::from_white_alpha(22));
    visuals
}
