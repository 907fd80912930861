//! The properties of what is selected, as fields, sliders and colours.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::sync::{Arc, Weak};

use egui::{DragValue, Grid, Response, RichText, Slider, SliderClamping, Ui};
use glam::{Affine3A, EulerRot, Mat3A, Quat, Vec3};
use tracer::scene::{Backdrop, Environment, PunctualKind, Scene};

use super::gizmo::GizmoMode;
use super::panel::{Action, PanelState, node_name, part_name};
use crate::document::edits::{Edit, EnvironmentEdit, LightEdit, Move, Part};
use crate::document::parameters::{MaterialParameter, Value};
use crate::document::{Document, Gesture};

/// Names of the axes.
const AXES: [&str; 3] = ["X", "Y", "Z"];
/// The row of the angles among those of a place.
const ROTATION: usize = 1;
/// The first colour behind a scene whose environment is hidden: a middle grey.
const BACKDROP: Vec3 = Vec3::splat(0.18);

/// Draws the properties of a part.
pub fn show(ui: &mut Ui, document: &Document, part: Part, state: &mut PanelState, actions: &mut Vec<Action>) {
    ui.add(egui::Label::new(RichText::new(title(document, part)).heading()).truncate());
    ui.horizontal(|ui| {
        if ui.button("As in the file").on_hover_text("Takes all edits of this back").clicked() {
            actions.push(Action::Edit(Edit::Reset(part), Gesture::Once));
        }
        if ui.button("Deselect").on_hover_text("Esc").clicked() {
            actions.push(Action::Select(None));
        }
    });
    match part {
        Part::Node(node) => show_node(ui, document, node, state, actions),
        Part::Material(material) => show_material(ui, document, material, &mut state.dark, actions),
        Part::Light(light) => show_light(ui, document, light, &mut state.dark, actions),
        Part::Environment => show_environment(ui, document, state, actions),
    }
}

/// What a part is called.
pub fn title(document: &Document, part: Part) -> String {
    let version = document.version();
    match part {
        Part::Node(node) => node_name(document, node),
        Part::Material(index) => {
            part_name(version.materials.get(index as usize).map_or("", |part| &part.name), "material", index)
        }
        Part::Light(index) => {
            part_name(version.lights.get(index as usize).map_or("", |part| &part.name), "light", index)
        }
        Part::Environment => "Environment".into(),
    }
}

/// A change that goes on while the pointer holds the widget.
fn gesture(response: &Response) -> Gesture {
    if response.dragged() || response.is_pointer_button_down_on() { Gesture::GoesOn } else { Gesture::Once }
}

/// A field for a number. What is typed counts when it is done: half a number is another one.
fn number_field(value: &mut f32) -> DragValue<'_> {
    DragValue::new(value).update_while_editing(false)
}

/// A slider with such a field. What the file says is shown as it is, also outside of the slider's range.
fn number_slider(value: &mut f32, range: RangeInclusive<f32>) -> Slider<'_> {
    Slider::new(value, range).update_while_editing(false).clamping(SliderClamping::Edits)
}

fn show_node(ui: &mut Ui, document: &Document, node: u32, state: &mut PanelState, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for (mode, name) in GizmoMode::LIST {
            ui.selectable_value(&mut state.gizmo, mode, name).on_hover_text("What the handles do; T: next");
        }
        ui.separator();
        let solo = document.solo() == Some(node);
        if ui.selectable_label(solo, "Solo").on_hover_text("Shows it alone; Shift H").clicked() {
            actions.push(Action::Solo((!solo).then_some(node)));
        }
    });
    let place = Place::of(document, node);
    let rows: [(&str, &str, f64, usize); 3] =
        [("Location", " m", place.step_m(), 4), ("Rotation", " °", 0.5, 2), ("Scale", "", 0.01, 4)];
    Grid::new("transform").num_columns(4).spacing([5.0, 4.0]).show(ui, |ui| {
        for (kind, (name, suffix, speed, decimals)) in rows.into_iter().enumerate() {
            ui.label(RichText::new(name).weak());
            let mut values = if kind == ROTATION { shown_angles(&place, node, state) } else { place.get(kind) };
            let (mut edited, mut held) = (None, false);
            for axis in 0..3 {
                let field = number_field(&mut values[axis]).speed(speed).max_decimals(decimals).suffix(suffix);
                let response = ui.add_sized([58.0, 20.0], field);
                name_field(&response, format!("{name} {}", AXES[axis]));
                held |= gesture(&response) == Gesture::GoesOn || response.has_focus();
                if response.changed() {
                    edited = Some(gesture(&response));
                }
            }
            let moved = edited.map_or(place.moved, |_| place.with(kind, values));
            if let Some(gesture) = edited {
                actions.push(Action::Edit(Edit::Move(node, moved), gesture));
            }
            if kind == ROTATION {
                let rotation = Place { moved, ..place }.rotation();
                state.angles = held.then_some(HeldAngles { node, rotation, degrees: values });
            }
            ui.end_row();
        }
    });
    materials_of(ui, document, node, state, actions);
}

/// The angles of a rotation while a person sets them: other angles mean the same rotation, and those would take their place
/// in the middle of a drag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldAngles {
    node: u32,
    /// What they mean; when the node's is another, they count no more.
    rotation: Quat,
    /// About X, Y and Z.
    degrees: Vec3,
}

fn shown_angles(place: &Place, node: u32, state: &PanelState) -> Vec3 {
    let held = state.angles.filter(|held| held.node == node && held.rotation == place.rotation());
    held.map_or_else(|| place.get(ROTATION), |held| held.degrees)
}

/// The name that a screen reader tells.
fn name_field(response: &Response, name: String) {
    response.ctx.accesskit_node_builder(response.id, |node| node.set_label(name));
}

/// The materials of all that hangs on a node, found once for a version: a group may hold a hundred thousand objects.
#[derive(Clone, Debug)]
pub struct MaterialsOf {
    version: Weak<Scene>,
    node: u32,
    /// By index, each once.
    materials: Vec<u32>,
}

impl MaterialsOf {
    fn new(document: &Document, node: u32) -> Self {
        let version = document.version();
        let below: BTreeSet<u32> = document.tree().below(node).into_iter().collect();
        let instances = version.instances.iter().filter(|instance| below.contains(&instance.node));
        let materials: BTreeSet<u32> = instances.map(|instance| instance.material).collect();
        Self { version: Arc::downgrade(version), node, materials: materials.into_iter().collect() }
    }

    fn is_of(&self, document: &Document, node: u32) -> bool {
        self.node == node && std::ptr::eq(self.version.as_ptr(), Arc::as_ptr(document.version()))
    }
}

fn materials_of(ui: &mut Ui, document: &Document, node: u32, state: &mut PanelState, actions: &mut Vec<Action>) {
    let version = document.version();
    let known = state.materials.take().filter(|known| known.is_of(document, node));
    let found = state.materials.insert(known.unwrap_or_else(|| MaterialsOf::new(document, node)));
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new("Materials").weak());
        for index in found.materials.iter().copied().take(12) {
            let Some(material) = version.materials.get(index as usize) else { continue };
            if ui.button(part_name(&material.name, "material", index)).clicked() {
                actions.push(Action::Select(Some(Part::Material(index))));
            }
        }
    });
}

/// A node's place as numbers: location, rotation (degrees about X, Y and Z), scale.
#[derive(Clone, Copy)]
struct Place {
    moved: Move,
    /// In the file.
    world_from_node: Affine3A,
    above: Affine3A,
}

impl Place {
    fn of(document: &Document, node: u32) -> Self {
        Self {
            moved: document.edits().nodes.get(&node).map(|edit| edit.moved).unwrap_or_default(),
            world_from_node: document.nodes().get(node as usize).map(|node| node.world_from_node).unwrap_or_default(),
            above: document.world_from_file_above(node),
        }
    }

    fn file_rotation(&self) -> (Quat, Vec3) {
        let (scale, rotation, _) = self.world_from_node.to_scale_rotation_translation();
        let fine = rotation.is_finite() && scale.is_finite();
        if fine { (rotation, scale) } else { (Quat::IDENTITY, Vec3::ONE) }
    }

    fn rotation(&self) -> Quat {
        self.moved.rotation * self.file_rotation().0
    }

    /// A change of the location per point of dragging, metres.
    fn step_m(&self) -> f64 {
        f64::from(self.get(0).abs().max_element().max(1.0)) * 0.005
    }

    fn get(&self, kind: usize) -> Vec3 {
        match kind {
            0 => self.above.transform_point3(Vec3::from(self.world_from_node.translation) + self.moved.translation),
            ROTATION => {
                let (z, y, x) = self.rotation().to_euler(EulerRot::ZYX);
                // Adding 0 makes -0 a plain 0.
                Vec3::new(x, y, z).map(|angle| angle.to_degrees() + 0.0)
            }
            _ => self.file_rotation().1 * self.moved.scale,
        }
    }

    fn with(&self, kind: usize, values: Vec3) -> Move {
        let (rotation, scale) = self.file_rotation();
        let moved = match kind {
            0 => {
                let in_file = self.above.inverse().transform_point3(values);
                let translation = in_file - Vec3::from(self.world_from_node.translation);
                Move { translation, ..self.moved }
            }
            ROTATION => {
                let angles = values.map(f32::to_radians);
                let wanted = Quat::from_euler(EulerRot::ZYX, angles.z, angles.y, angles.x);
                Move { rotation: wanted * rotation.inverse(), ..self.moved }
            }
            _ => Move { scale: values / scale, ..self.moved },
        };
        moved.sane()
    }
}

fn show_material(ui: &mut Ui, document: &Document, index: u32, dark: &mut Vec<DarkColor>, actions: &mut Vec<Action>) {
    let Some(material) = document.version().materials.get(index as usize) else { return };
    Grid::new("material").num_columns(2).spacing([8.0, 4.0]).show(ui, |ui| {
        for parameter in MaterialParameter::ALL {
            let label = ui.label(RichText::new(parameter.name()).weak());
            let edited = match parameter.get(material) {
                Value::Number(number) => number_row(ui, &label, parameter, number),
                Value::Color(color) if parameter == MaterialParameter::Emission => {
                    let strong = StrongColor { of: (Part::Material(index), "emission"), value: color };
                    strong.show(ui, &label, dark).map(|(color, gesture)| (Value::Color(color), gesture))
                }
                Value::Color(color) => {
                    let mut rgb = color.to_array();
                    let response = ui.color_edit_button_rgb(&mut rgb).labelled_by(label.id);
                    response.changed().then(|| (Value::Color(Vec3::from_array(rgb)), Gesture::GoesOn))
                }
            };
            ui.end_row();
            if let Some((value, gesture)) = edited {
                actions.push(Action::Edit(Edit::Material(index, parameter, value), gesture));
            }
        }
    });
}

fn number_row(
    ui: &mut Ui,
    label: &Response,
    parameter: MaterialParameter,
    mut number: f32,
) -> Option<(Value, Gesture)> {
    ui.spacing_mut().slider_width = 84.0;
    let response = ui.add(number_slider(&mut number, parameter.range()).max_decimals(3)).labelled_by(label.id);
    response.changed().then(|| (Value::Number(number), gesture(&response)))
}

/// What a colour belongs to.
type ColorOf = (Part, &'static str);

/// The colour of something whose strength is 0, for when it has one again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DarkColor {
    of: ColorOf,
    color: Vec3,
}

/// A colour and its strength; the strength is the largest channel.
struct StrongColor {
    of: ColorOf,
    value: Vec3,
}

impl StrongColor {
    fn show(self, ui: &mut Ui, label: &Response, dark: &mut Vec<DarkColor>) -> Option<(Vec3, Gesture)> {
        let mut strength = self.value.max_element();
        let remembered = dark.iter().find(|dark| dark.of == self.of).map_or(Vec3::ONE, |dark| dark.color);
        let color = if strength > 0.0 { self.value / strength } else { remembered };
        let mut edited = None;
        ui.horizontal(|ui| {
            let mut rgb = color.to_array();
            if ui.color_edit_button_rgb(&mut rgb).labelled_by(label.id).changed() {
                let strength = if strength > 0.0 { strength } else { 1.0 };
                edited = Some((Vec3::from_array(rgb) * strength, Gesture::GoesOn));
            }
            let speed = f64::from(strength.max(0.1)) * 0.01;
            let response = ui.add(number_field(&mut strength).range(0.0..=1e6).speed(speed).max_decimals(3));
            name_field(&response, "Strength".into());
            if response.changed() {
                edited = Some((color * strength, gesture(&response)));
            }
        });
        if edited.is_some_and(|(value, _)| value == Vec3::ZERO) {
            dark.retain(|dark| dark.of != self.of);
            dark.push(DarkColor { of: self.of, color });
        }
        edited
    }
}

fn show_light(ui: &mut Ui, document: &Document, index: u32, dark: &mut Vec<DarkColor>, actions: &mut Vec<Action>) {
    let Some(light) = document.version().lights.get(index as usize) else { return };
    let edit = document.edits().lights.get(&index).copied().unwrap_or_default();
    let (kind, unit, size) = match light.kind {
        PunctualKind::Point => ("Point light", "candela", None),
        PunctualKind::Spot { outer_angle, .. } => ("Spot light", "candela", Some(("Cone", outer_angle, 0.1..=90.0))),
        PunctualKind::Directional { angular_diameter } => {
            ("Directional light", "lux", Some(("Size", angular_diameter, 0.0..=90.0)))
        }
    };
    ui.label(RichText::new(kind).small().weak());
    let mut set = |edit: LightEdit, gesture| actions.push(Action::Edit(Edit::Light(index, edit), gesture));
    Grid::new("light").num_columns(2).spacing([8.0, 4.0]).show(ui, |ui| {
        let label = ui.label(RichText::new("Colour").weak()).on_hover_text(format!("Colour, and strength in {unit}"));
        let strong = StrongColor { of: (Part::Light(index), "intensity"), value: light.intensity };
        if let Some((intensity, gesture)) = strong.show(ui, &label, dark) {
            set(LightEdit { intensity: Some(intensity), ..edit }, gesture);
        }
        ui.end_row();
        if let Some((name, angle, range)) = size {
            let label = ui.label(RichText::new(name).weak());
            let mut degrees = angle.to_degrees();
            ui.spacing_mut().slider_width = 84.0;
            let response =
                ui.add(number_slider(&mut degrees, range).suffix(" °").max_decimals(2)).labelled_by(label.id);
            if response.changed() {
                set(LightEdit { angle: Some(degrees.to_radians()), ..edit }, gesture(&response));
            }
            ui.end_row();
        }
        if !matches!(light.kind, PunctualKind::Directional { .. }) {
            ui.label(RichText::new("Location").weak());
            ui.horizontal(|ui| {
                for axis in 0..3 {
                    let mut value = light.position[axis];
                    let field = number_field(&mut value).speed(0.01).max_decimals(3).suffix(" m");
                    let response = ui.add_sized([54.0, 20.0], field);
                    name_field(&response, format!("Location {}", AXES[axis]));
                    if response.changed() {
                        let mut translation = edit.translation;
                        translation[axis] += value - light.position[axis];
                        set(LightEdit { translation, ..edit }, gesture(&response));
                    }
                }
            });
            ui.end_row();
        }
    });
}

fn show_environment(ui: &mut Ui, document: &Document, state: &mut PanelState, actions: &mut Vec<Action>) {
    let edit = document.edits().environment.clone();
    ui.horizontal(|ui| {
        let label = ui.label(RichText::new("Image").weak());
        let field =
            egui::TextEdit::singleline(&mut state.environment).hint_text("FILE.hdr or .exr").desired_width(150.0);
        let response = ui.add(field).labelled_by(label.id);
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        if (ui.button("Load").on_hover_text("Or drop the file on the window").clicked() || entered)
            && !state.environment.trim().is_empty()
        {
            actions.push(Action::LoadEnvironment(state.environment.trim().into()));
        }
    });
    let mut set = |edit: EnvironmentEdit, gesture| actions.push(Action::Edit(Edit::Environment(edit), gesture));
    Grid::new("environment").num_columns(2).spacing([8.0, 4.0]).show(ui, |ui| match &document.version().environment {
        Environment::Constant(radiance) => {
            let label = ui.label(RichText::new("Radiance").weak());
            let strong = StrongColor { of: (Part::Environment, "radiance"), value: *radiance };
            if let Some((radiance, gesture)) = strong.show(ui, &label, &mut state.dark) {
                set(EnvironmentEdit { radiance: Some(radiance), ..edit.clone() }, gesture);
            }
            ui.end_row();
        }
        Environment::Image { rotation_deg, intensity, .. } => {
            ui.spacing_mut().slider_width = 84.0;
            let label = ui.label(RichText::new("Rotation").weak());
            let mut degrees = *rotation_deg;
            let slider = number_slider(&mut degrees, -180.0..=180.0).suffix(" °").max_decimals(1);
            let response = ui.add(slider).labelled_by(label.id);
            if response.changed() {
                set(EnvironmentEdit { rotation_deg: Some(degrees), ..edit.clone() }, gesture(&response));
            }
            ui.end_row();
            let label = ui.label(RichText::new("Intensity").weak());
            let mut factor = *intensity;
            let slider = number_slider(&mut factor, 0.0..=100.0).logarithmic(true).max_decimals(3);
            let response = ui.add(slider).labelled_by(label.id);
            if response.changed() {
                set(EnvironmentEdit { intensity: Some(factor), ..edit.clone() }, gesture(&response));
            }
            ui.end_row();
        }
    });
    let backdrop = document.version().backdrop;
    let mut visible = backdrop == Backdrop::Environment;
    let response = ui.checkbox(&mut visible, "Visible to the camera");
    if response.on_hover_text("Off: a plain colour behind the scene; the light stays as it is").changed() {
        let backdrop = Some(if visible { Backdrop::Environment } else { Backdrop::Color(BACKDROP) });
        set(EnvironmentEdit { backdrop, ..edit.clone() }, Gesture::Once);
    }
    if let Backdrop::Color(color) = backdrop {
        ui.horizontal(|ui| {
            let label = ui.label(RichText::new("Backdrop").weak());
            let strong = StrongColor { of: (Part::Environment, "backdrop"), value: color };
            if let Some((color, gesture)) = strong.show(ui, &label, &mut state.dark) {
                set(EnvironmentEdit { backdrop: Some(Backdrop::Color(color)), ..edit }, gesture);
            }
        });
    }
}

/// The object's own axes in the world, for handles that scale along them.
pub fn own_axes(document: &Document, node: u32) -> (Vec3, Mat3A) {
    let place = Place::of(document, node);
    let turned = place.above.matrix3 * Mat3A::from_quat(place.rotation());
    (place.get(0), turned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_what_is_shown() {
        let world_from_node = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 2.0, 0.5),
            Quat::from_euler(EulerRot::XYZ, 0.3, -0.4, 1.0),
            Vec3::new(3.0, -1.0, 2.0),
        );
        let above = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.7), Vec3::X);
        let mut place = Place { moved: Move::default(), world_from_node, above };
        for (kind, values) in [(0, [1.0, 2.5, -3.0]), (1, [10.0, -20.0, 35.0]), (2, [0.5, 1.0, 4.0]), (0, [0.0; 3])] {
            let wanted = Vec3::from_array(values);
            place.moved = place.with(kind, wanted);
            assert!(place.get(kind).distance(wanted) < 1e-3, "{kind}: {} for {wanted}", place.get(kind));
        }
        // Each kind of number leaves the others alone.
        assert!(place.get(1).distance(Vec3::new(10.0, -20.0, 35.0)) < 1e-3);
        assert!(place.get(2).distance(Vec3::new(0.5, 1.0, 4.0)) < 1e-3);
    }
}
