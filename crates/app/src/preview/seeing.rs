//! What the picture shows, and how: debug views, false colour, a second mode beside the first.

use egui::{ComboBox, Context, Key, Modifiers, RichText, Slider, Ui};
use tracer::view::{DebugScale, DebugView, Histogram};

use super::compare::{BesideReadout, Comparison};
use super::controls::{Controls, MODES};
use crate::cli::choices::{Mode, ToneMapping};

/// What is known about a picture as it was shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Its pixels by luminance, while somebody looks at that.
    pub histogram: Option<Histogram>,
    /// What the ends of a debug view's colours stand for.
    pub scale: Option<DebugScale>,
    /// Figures of the film beside the first.
    pub beside: Option<BesideReadout>,
}

/// Names and explanations of what can be shown.
pub const VIEWS: [(DebugView, &str, &str); 8] = [
    (DebugView::Beauty, "Picture", "What is rendered"),
    (DebugView::SampleDensity, "Sample density", "Samples per pixel of the view"),
    (DebugView::Error, "Noise", "Standard error of the film's pixels over their brightness; black: too few samples"),
    (DebugView::Stale, "Stale", "Orange: still the picture from before the last change"),
    (DebugView::Albedo, "Base colour", "Of what a pixel's centre shows first"),
    (DebugView::Normal, "Normals", "Shading normals in the scene's axes"),
    (DebugView::Depth, "Depth", "Distance from the viewer"),
    (DebugView::TraversalSteps, "Traversal steps", "Nodes and triangles that a ray visits: what is slow to trace"),
];

/// The rows of the panel's table that say what is shown.
pub fn rows(ui: &mut Ui, controls: &mut Controls) {
    let label = ui.label(RichText::new("Show").weak());
    let combo =
        ComboBox::from_id_salt("shown").width(126.0).selected_text(view_name(controls.shown)).show_ui(ui, |ui| {
            for (view, name, hint) in VIEWS {
                if ui.selectable_value(&mut controls.shown, view, name).on_hover_text(hint).clicked() {
                    remember(controls);
                }
            }
        });
    combo.response.labelled_by(label.id);
    ui.end_row();

    let label = ui.label(RichText::new("Compare").weak()).on_hover_text("With another mode, at the same time each");
    let mut other = controls.comparison.map(|comparison| comparison.mode);
    let combo = ComboBox::from_id_salt("compare").width(126.0).selected_text(mode_name(other)).show_ui(ui, |ui| {
        ui.selectable_value(&mut other, None, mode_name(None));
        for (mode, name, hint) in MODES {
            ui.selectable_value(&mut other, Some(mode), name).on_hover_text(hint);
        }
    });
    combo.response.labelled_by(label.id);
    let wipe = controls.comparison.unwrap_or_default().wipe;
    controls.comparison = other.map(|mode| Comparison { mode, wipe });
    ui.end_row();

    if let Some(comparison) = &mut controls.comparison {
        let label = ui.label(RichText::new("Wipe").weak());
        let mut percent = 100.0 * comparison.wipe;
        let slider = Slider::new(&mut percent, 0.0..=100.0).suffix(" %").max_decimals(0);
        if ui.add(slider).labelled_by(label.id).changed() {
            comparison.wipe = percent / 100.0;
        }
        ui.end_row();
    }
}

/// What the keys do that change what is shown.
pub fn keys(ctx: &Context, controls: &mut Controls) {
    let pressed = |modifiers, key| ctx.input_mut(|input| input.consume_key(modifiers, key));
    if pressed(Modifiers::SHIFT, Key::X) {
        controls.shown = next_view(controls.shown);
        remember(controls);
    }
    if pressed(Modifiers::NONE, Key::X) {
        let is_picture = controls.shown == DebugView::Beauty;
        controls.shown = if is_picture { controls.inspected } else { DebugView::Beauty };
    }
    if pressed(Modifiers::NONE, Key::K) {
        if controls.tone_map == ToneMapping::FalseColor {
            controls.tone_map = controls.usual_tone_map;
        } else {
            controls.usual_tone_map = controls.tone_map;
            controls.tone_map = ToneMapping::FalseColor;
        }
    }
    if pressed(Modifiers::SHIFT, Key::C)
        && let Some(comparison) = &mut controls.comparison
    {
        comparison.mode = next_mode(comparison.mode);
    }
    if pressed(Modifiers::NONE, Key::C) {
        let other = if controls.mode == Mode::Fv { Mode::Vp } else { Mode::Fv };
        let begun = Comparison { mode: other, ..Comparison::default() };
        controls.comparison = if controls.comparison.is_some() { None } else { Some(begun) };
    }
}

/// The mode after this one.
pub fn next_mode(mode: Mode) -> Mode {
    let place = MODES.iter().position(|entry| entry.0 == mode).unwrap_or(0);
    MODES[(place + 1) % MODES.len()].0
}

/// The debug view after this one; the picture is none.
fn next_view(view: DebugView) -> DebugView {
    let place = VIEWS.iter().position(|entry| entry.0 == view).unwrap_or(0);
    VIEWS[1 + place % (VIEWS.len() - 1)].0
}

fn remember(controls: &mut Controls) {
    if controls.shown != DebugView::Beauty {
        controls.inspected = controls.shown;
    }
}

fn view_name(view: DebugView) -> &'static str {
    VIEWS.iter().find(|entry| entry.0 == view).map_or("", |entry| entry.1)
}

fn mode_name(mode: Option<Mode>) -> &'static str {
    MODES.iter().find(|entry| Some(entry.0) == mode).map_or("with nothing", |entry| entry.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_debug_view_is_reached_and_the_picture_is_none() {
        let mut view = DebugView::Beauty;
        let mut reached = Vec::new();
        for _ in 1..VIEWS.len() {
            view = next_view(view);
            reached.push(view);
        }
        assert_eq!(reached, VIEWS[1..].iter().map(|entry| entry.0).collect::<Vec<_>>());
        assert_eq!(next_view(view), VIEWS[1].0);
    }
}
