//! How the overlay looks: dark or light, compact, and quiet beside the picture.

use egui::{
    Color32, Context, CornerRadius, FontFamily, FontId, Frame, InnerResponse, Margin, Stroke, TextStyle, Theme,
    ThemePreference, Ui, Visuals,
};

/// What is active or selected, on the picture: it shows on every picture, with a dark line about it.
pub const ACCENT: Color32 = Color32::from_rgb(238, 176, 84);
/// Behind marks that lie on the picture, in any theme.
pub const BACKDROP: Color32 = Color32::from_rgba_premultiplied(17, 18, 20, 228);

/// Names of what can be chosen.
pub const THEMES: [(ThemePreference, &str); 3] =
    [(ThemePreference::System, "As the system"), (ThemePreference::Light, "Light"), (ThemePreference::Dark, "Dark")];

/// The colours of a theme.
struct Palette {
    /// Behind text that lies on the picture; the picture shows through a little.
    backdrop: Color32,
    menu: Color32,
    text: Color32,
    /// Of what the pointer is over.
    strong: Color32,
    accent: Color32,
    notice: Color32,
    error: Color32,
    selection: Color32,
    /// Widgets are lighter than a dark panel and darker than a light one: what they are tinted with, and how strongly at
    /// rest, under the pointer, pressed, and open.
    tint: fn(u8) -> Color32,
    strengths: [u8; 4],
    line: u8,
}

const DARK: Palette = Palette {
    backdrop: BACKDROP,
    menu: Color32::from_rgb(28, 29, 32),
    text: Color32::from_rgb(214, 216, 220),
    strong: Color32::from_rgb(244, 245, 247),
    accent: ACCENT,
    notice: Color32::from_rgb(240, 200, 120),
    error: Color32::from_rgb(244, 128, 110),
    selection: Color32::from_rgb(92, 68, 30),
    tint: Color32::from_white_alpha,
    strengths: [16, 34, 48, 28],
    line: 22,
};

const LIGHT: Palette = Palette {
    // 90 % of white, premultiplied.
    backdrop: Color32::from_rgba_premultiplied(226, 227, 229, 232),
    menu: Color32::from_rgb(250, 251, 252),
    text: Color32::from_rgb(46, 48, 53),
    strong: Color32::from_rgb(12, 13, 15),
    accent: Color32::from_rgb(140, 84, 4),
    notice: Color32::from_rgb(132, 84, 0),
    error: Color32::from_rgb(176, 34, 18),
    selection: Color32::from_rgb(248, 214, 152),
    tint: Color32::from_black_alpha,
    strengths: [20, 38, 56, 32],
    line: 34,
};

/// Sets colours, text sizes and spacing for the whole window, which follows the system's theme until told otherwise.
pub fn apply(ctx: &Context) {
    ctx.set_theme(ThemePreference::System);
    for (theme, palette) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        ctx.style_mut_of(theme, |style| style.visuals = visuals(theme, palette));
    }
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
    });
}

/// A panel that lies on the picture.
pub struct Panel;

/// The frame of a panel that lies on the picture.
pub fn panel() -> Panel {
    Panel
}

impl Panel {
    /// Draws the frame in the colours of the theme, with contents.
    pub fn show<R>(self, ui: &mut Ui, contents: impl FnOnce(&mut Ui) -> R) -> InnerResponse<R> {
        let frame = Frame::new().fill(ui.visuals().panel_fill);
        frame.corner_radius(CornerRadius::same(7)).inner_margin(Margin::same(10)).show(ui, contents)
    }
}

/// What is active or selected, on a panel.
pub fn accent(ui: &Ui) -> Color32 {
    ui.visuals().hyperlink_color
}

/// Something to know about, on a panel.
pub fn notice(ui: &Ui) -> Color32 {
    ui.visuals().warn_fg_color
}

/// Something that went wrong, on a panel.
pub fn error(ui: &Ui) -> Color32 {
    ui.visuals().error_fg_color
}

fn visuals(theme: Theme, palette: &Palette) -> Visuals {
    let mut visuals = theme.default_visuals();
    visuals.override_text_color = None;
    // Menus lie on panels: what is below must not show.
    visuals.window_fill = palette.menu;
    visuals.panel_fill = palette.backdrop;
    visuals.window_stroke = Stroke::NONE;
    visuals.window_corner_radius = CornerRadius::same(7);
    visuals.menu_corner_radius = CornerRadius::same(5);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.notice;
    visuals.error_fg_color = palette.error;
    visuals.selection.bg_fill = palette.selection;
    visuals.selection.stroke = Stroke::new(1.0, palette.accent);
    visuals.slider_trailing_fill = true;
    let [rest, over, pressed, open] = palette.strengths.map(palette.tint);
    let widgets = &mut visuals.widgets;
    for (state, fill, text) in [
        (&mut widgets.noninteractive, Color32::TRANSPARENT, palette.text),
        (&mut widgets.inactive, rest, palette.text),
        (&mut widgets.hovered, over, palette.strong),
        (&mut widgets.active, pressed, palette.strong),
        (&mut widgets.open, open, palette.strong),
    ] {
        state.bg_fill = fill;
        state.weak_bg_fill = fill;
        state.bg_stroke = Stroke::NONE;
        state.fg_stroke = Stroke::new(1.0, text);
        state.corner_radius = CornerRadius::same(4);
        state.expansion = 0.0;
    }
    widgets.noninteractive.bg_stroke = Stroke::new(1.0, (palette.tint)(palette.line));
    visuals
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of sRGB, as WCAG 2.2 has it.
    fn luminance(color: Color32) -> f32 {
        let linear = |channel: u8| {
            let c = f32::from(channel) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
    }

    fn contrast(a: Color32, b: Color32) -> f32 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    /// Over a black or white picture, which shows through.
    fn over(backdrop: Color32, picture: u8) -> Color32 {
        let rest = (255 - u32::from(backdrop.a())) * u32::from(picture) / 255;
        let [r, g, b] = [backdrop.r(), backdrop.g(), backdrop.b()].map(|c| (u32::from(c) + rest).min(255) as u8);
        Color32::from_rgb(r, g, b)
    }

    #[test]
    fn text_can_be_read_in_both_themes_over_any_picture() {
        for (palette, name) in [(&DARK, "dark"), (&LIGHT, "light")] {
            for picture in [0, 255] {
                let behind = over(palette.backdrop, picture);
                for (color, what) in [
                    (palette.text, "text"),
                    (palette.strong, "strong"),
                    (palette.accent, "accent"),
                    (palette.notice, "notice"),
                    (palette.error, "error"),
                ] {
                    let found = contrast(color, behind);
                    // WCAG's level AA.
                    assert!(found >= 4.5, "{name} {what} over {picture}: {found:.2}");
                }
            }
            assert!(contrast(palette.accent, palette.selection) >= 3.0, "{name} selection");
        }
    }
}
