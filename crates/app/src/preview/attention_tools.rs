//! The tools that say where samples are wanted: chosen in the panel, used in the picture.

use egui::{Color32, Painter, PointerButton, Rect, Response, RichText, Shape, Slider, Stroke, Ui};
use glam::Vec3;
use tracer::distribution::View as TracerView;

use super::gaze::Gaze;
use super::navigation::{Standpoint, point_in_view, point_in_window};
use super::theme;
use crate::attention::{Attention, PIN_RADIUS, Rectangle, Spot};

/// Most painted spots; more are not taken.
const MOST_SPOTS: usize = 400;
/// Most pinned points.
const MOST_PINS: usize = 16;
/// Points of a circle's outline.
const CIRCLE_STEPS: u16 = 40;

/// What the pointer does in the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// Looks around and selects.
    #[default]
    None,
    /// Draws a rectangle.
    Region,
    /// Paints.
    Brush,
    /// Pins a point, or takes one away.
    Pin,
}

const TOOLS: [(Tool, &str, &str); 4] = [
    (Tool::None, "Look", "The pointer looks around and selects"),
    (Tool::Region, "Region", "Drag a rectangle"),
    (Tool::Brush, "Brush", "Paint; the brush is soft at its rim"),
    (Tool::Pin, "Pin", "Click to pin a point, and again to take it away"),
];

/// The chosen tool and its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolState {
    /// What the pointer does.
    pub tool: Tool,
    /// Half the angle that the brush covers, degrees.
    pub brush_deg: f32,
}

impl Default for ToolState {
    fn default() -> Self {
        Self { tool: Tool::None, brush_deg: 3.0 }
    }
}

/// Draws the tools' part of the panel. `gaze` is the direction that would be locked.
pub fn panel(ui: &mut Ui, tools: &mut ToolState, attention: &mut Attention, gaze: Option<Vec3>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for (tool, name, hint) in TOOLS {
            ui.selectable_value(&mut tools.tool, tool, name).on_hover_text(hint);
        }
    });
    ui.spacing_mut().slider_width = 84.0;
    if tools.tool == Tool::Brush {
        ui.horizontal(|ui| {
            let label = ui.label(RichText::new("Brush radius").weak());
            ui.add(Slider::new(&mut tools.brush_deg, 0.2..=20.0).logarithmic(true).suffix(" °").max_decimals(1))
                .labelled_by(label.id);
        });
    }
    ui.horizontal(|ui| {
        let label = ui.label(RichText::new("Share").weak()).on_hover_text("Of all samples; the rest is the mode's");
        let mut percent = attention.share * 100.0;
        let slider = Slider::new(&mut percent, 0.0..=95.0).suffix(" %").max_decimals(0);
        if ui.add(slider).labelled_by(label.id).changed() {
            attention.share = percent / 100.0;
        }
    });
    let mut locked = attention.locked_gaze.is_some();
    let lock = ui.checkbox(&mut locked, "Gaze locked").on_hover_text("L: stays where one looks now, in the scene");
    if lock.changed() {
        attention.locked_gaze = gaze.filter(|_| locked);
    }
    if ui.add_enabled(!attention.is_empty(), egui::Button::new("Clear")).clicked() {
        *attention = Attention { share: attention.share, locked_gaze: attention.locked_gaze, ..Attention::default() };
    }
}

/// Uses the tool where the pointer is; true when the pointer's movements are the tool's.
pub fn point(response: &Response, standpoint: &Standpoint, tools: ToolState, attention: &mut Attention) -> bool {
    if tools.tool == Tool::None {
        return false;
    }
    let view = standpoint.view;
    let Some(pointer) = response.interact_pointer_pos() else { return false };
    let at = point_in_view(response.rect, pointer);
    let direction = view.direction_at(at);
    let dragged = response.dragged_by(PointerButton::Primary);
    match tools.tool {
        Tool::None => {}
        Tool::Region if response.drag_started_by(PointerButton::Primary) => {
            let view = TracerView { world_from_view: view.film_from_view(), half_extent: view.tan_half };
            // The drag is noticed some way from where the button went down.
            let origin = response.ctx.input(|input| input.pointer.press_origin());
            let start = origin.map_or(at, |origin| point_in_view(response.rect, origin));
            attention.region = Some(Rectangle { view, corners: [start, at] });
        }
        Tool::Region if dragged => {
            if let Some(region) = &mut attention.region {
                region.corners[1] = at;
            }
        }
        Tool::Brush if dragged || response.clicked_by(PointerButton::Primary) => {
            let radius = tools.brush_deg.to_radians();
            // Spots closer than a third of the brush say nothing new.
            let is_new =
                attention.painted.last().is_none_or(|last| last.direction.angle_between(direction) > radius / 3.0);
            if is_new && attention.painted.len() < MOST_SPOTS {
                attention.painted.push(Spot { direction, radius });
            }
        }
        Tool::Pin if response.clicked_by(PointerButton::Primary) => {
            match attention.pins.iter().position(|pin| pin.angle_between(direction) < PIN_RADIUS) {
                Some(place) => {
                    attention.pins.remove(place);
                }
                None if attention.pins.len() < MOST_PINS => attention.pins.push(direction),
                None => {}
            }
        }
        Tool::Region | Tool::Brush | Tool::Pin => {}
    }
    // Other buttons still look around.
    dragged || response.clicked_by(PointerButton::Primary)
}

/// Where one looks as far as tracing goes: the locked direction while it is ahead, else the eyes or the pointer.
pub fn gaze(attention: &Attention, standpoint: &Standpoint, otherwise: Gaze) -> Gaze {
    let locked = attention.locked_gaze.and_then(|direction| standpoint.view.point_of(direction));
    locked.map_or(otherwise, |point| Gaze { point })
}

/// Draws the tools' marks over the picture.
pub fn draw(painter: &Painter, rect: Rect, standpoint: &Standpoint, attention: &Attention) {
    let project = |direction: Vec3| standpoint.view.point_of(direction).map(|point| point_in_window(rect, point));
    let outline = |directions: Vec<Vec3>, width: f32, colour: Color32| {
        let points: Option<Vec<egui::Pos2>> = directions.into_iter().map(project).collect();
        if let Some(points) = points {
            painter.add(Shape::closed_line(points.clone(), Stroke::new(width + 2.0, Color32::from_black_alpha(90))));
            painter.add(Shape::closed_line(points, Stroke::new(width, colour)));
        }
    };
    if let Some(region) = &attention.region {
        outline(region.outline().to_vec(), 1.5, theme::ACCENT);
    }
    for spot in &attention.painted {
        outline(circle(spot.direction, spot.radius), 0.5, theme::ACCENT.gamma_multiply(0.5));
    }
    for pin in &attention.pins {
        outline(circle(*pin, PIN_RADIUS), 1.5, theme::ACCENT);
    }
}

fn circle(direction: Vec3, radius: f32) -> Vec<Vec3> {
    let side = direction.any_orthonormal_vector();
    let rim = glam::Quat::from_axis_angle(side, radius) * direction;
    let turn = |step: u16| std::f32::consts::TAU * f32::from(step) / f32::from(CIRCLE_STEPS);
    (0..CIRCLE_STEPS).map(|step| glam::Quat::from_axis_angle(direction, turn(step)) * rim).collect()
}
