//! Moving about: turning the view by dragging, orbit, pan and dolly, zooming, flying, and jumping to the file's cameras.

use egui::{Key, Modifiers, PointerButton, Pos2, Rect};
use glam::{Quat, Vec2, Vec3};

use crate::view::View;

/// Stops of the wheel after which the image plane is half as wide.
const SCROLL_POINTS_TO_HALVE: f32 = 400.0;
/// Seconds in which flying crosses the scene at normal speed.
const SECONDS_ACROSS: f32 = 12.0;
/// Factor of flying with Shift held.
const FAST: f32 = 4.0;
/// Radians of an orbit for a drag over the picture's whole height.
const ORBIT_OVER_HEIGHT: f32 = std::f32::consts::PI;
/// A dolly over the picture's whole height doubles or halves the distance so many times.
const DOLLY_OVER_HEIGHT: f32 = 4.0;

/// Where the viewer stands and looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standpoint {
    /// Metres, in the scene's space.
    pub position: Vec3,
    /// Direction and angle of the view. Film space has the scene's axes.
    pub view: View,
}

/// What a drag does, as in Blender, whose middle button Alt stands in for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DragKind {
    /// Turns the view on the spot.
    Look,
    /// Turns about a point.
    Orbit,
    /// Moves along the image plane.
    Pan,
    /// Comes closer or goes away.
    Dolly,
}

impl DragKind {
    /// By the button that is held and the keys that were held when it went down.
    fn of(button: PointerButton, keys: Modifiers) -> Self {
        let about_a_point = button == PointerButton::Middle || button == PointerButton::Primary && keys.alt;
        match about_a_point {
            false => Self::Look,
            true if keys.shift => Self::Pan,
            true if keys.ctrl || keys.command => Self::Dolly,
            true => Self::Orbit,
        }
    }
}

/// What the pointer holds while it drags.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Held {
    button: PointerButton,
    kind: DragKind,
    /// Direction of the world for [`DragKind::Look`], else a point of it.
    anchor: Vec3,
    /// From where the pivot was to where the pointer took hold, in the view.
    offset: Vec2,
}

/// Turns input into a [`Standpoint`].
#[derive(Clone, Debug)]
pub struct Navigation {
    /// Where the viewer is now.
    pub standpoint: Standpoint,
    held: Option<Held>,
    /// Across the scene, metres.
    diagonal: f32,
}

impl Navigation {
    /// Starts at a camera, in a scene of the given diagonal (metres).
    pub fn new(position: Vec3, rotation: Quat, vfov: f32, aspect: f32, diagonal: f32) -> Self {
        Self {
            standpoint: Standpoint { position, view: View::along(rotation, vfov, aspect) },
            held: None,
            diagonal: diagonal.max(1e-3),
        }
    }

    /// Moves at a speed that suits a scene of the given diagonal (metres).
    pub fn set_scale(&mut self, diagonal: f32) {
        self.diagonal = diagonal.max(1e-3);
    }

    /// Goes where a ball of this centre and radius (metres) fills the view, without turning.
    pub fn frame(&mut self, centre: Vec3, radius: f32) {
        self.standpoint = self.standpoint.framed(centre, radius);
        self.held = None;
    }

    /// Goes to a camera, keeping the window's proportions.
    pub fn jump(&mut self, position: Vec3, rotation: Quat, vfov: f32) {
        let tan_half = self.standpoint.view.tan_half;
        self.standpoint = Standpoint { position, view: View::along(rotation, vfov, tan_half.x / tan_half.y) };
        self.held = None;
    }

    /// Takes the proportions of the picture's place.
    pub fn fit(&mut self, rect: Rect) {
        self.standpoint.view = self.standpoint.view.with_aspect(rect.width() / rect.height().max(1.0));
    }

    /// Takes one frame's input into account. `response` covers the picture; keys count unless a widget wants them. `pivot` says
    /// about which point of the world a movement that begins at a place of the window goes.
    pub fn update(&mut self, ui: &egui::Ui, response: &egui::Response, pivot: impl FnOnce(Pos2) -> Vec3) {
        let rect = response.rect;
        self.fit(rect);
        self.drag(response, pivot);
        if response.hovered() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            let factor = (-scroll / SCROLL_POINTS_TO_HALVE).exp2() / pinch.max(1e-3);
            if factor != 1.0
                && let Some(pointer) = response.hover_pos()
            {
                self.standpoint.view = self.standpoint.view.zoomed(factor, point_in_view(rect, pointer));
            }
        }
        if !ui.ctx().egui_wants_keyboard_input() {
            self.fly(ui);
        }
    }

    /// True while the pointer holds the picture.
    pub fn dragging(&self) -> bool {
        self.held.is_some()
    }

    fn drag(&mut self, response: &egui::Response, pivot: impl FnOnce(Pos2) -> Vec3) {
        let buttons = [PointerButton::Middle, PointerButton::Primary, PointerButton::Secondary];
        let dragged = buttons.into_iter().find(|&button| response.dragged_by(button));
        let Some((button, pointer)) = dragged.zip(response.interact_pointer_pos()) else {
            self.held = None;
            return;
        };
        let rect = response.rect;
        let at = point_in_view(rect, pointer);
        let held = match self.held.filter(|held| held.button == button) {
            Some(held) => held,
            None => {
                let start = pointer - response.drag_delta();
                let kind = DragKind::of(button, response.ctx.input(|input| input.modifiers));
                self.take_hold(button, kind, point_in_view(rect, start), || pivot(start))
            }
        };
        self.held = Some(held);
        let moved = response.drag_delta() / rect.height().max(1.0);
        let Standpoint { position, view } = self.standpoint;
        self.standpoint = match held.kind {
            DragKind::Look => Standpoint { position, view: view.dragged(held.anchor, at) },
            // What is in front of the pivot goes with the pointer.
            DragKind::Orbit => self.standpoint.orbited(held.anchor, Vec2::new(moved.x, -moved.y) * ORBIT_OVER_HEIGHT),
            DragKind::Pan => self.standpoint.panned(held.anchor, at + held.offset),
            DragKind::Dolly => {
                let factor = (DOLLY_OVER_HEIGHT * (moved.y - moved.x)).exp2();
                self.standpoint.dollied(held.anchor, factor, self.diagonal)
            }
        };
    }

    /// Takes hold at a point of the view.
    fn take_hold(&self, button: PointerButton, kind: DragKind, start: Vec2, pivot: impl FnOnce() -> Vec3) -> Held {
        let Standpoint { position, view } = self.standpoint;
        if kind == DragKind::Look {
            return Held { button, kind, anchor: view.direction_at(start), offset: Vec2::ZERO };
        }
        let anchor = pivot();
        // A selection need not lie under the pointer: it is taken along from where it is.
        let offset = view.point_of(anchor - position).map_or(Vec2::ZERO, |place| place - start);
        Held { button, kind, anchor, offset }
    }

    fn fly(&mut self, ui: &egui::Ui) {
        const KEYS: [(Key, Vec3); 6] = [
            (Key::W, Vec3::NEG_Z),
            (Key::S, Vec3::Z),
            (Key::A, Vec3::NEG_X),
            (Key::D, Vec3::X),
            (Key::E, Vec3::Y),
            (Key::Q, Vec3::NEG_Y),
        ];
        let (direction, seconds, fast) = ui.input(|input| {
            let held = KEYS.iter().filter(|(key, _)| input.key_down(*key)).map(|(_, direction)| *direction);
            let commands = input.modifiers.ctrl || input.modifiers.command || input.modifiers.alt;
            (if commands { Vec3::ZERO } else { held.sum::<Vec3>() }, input.stable_dt, input.modifiers.shift)
        });
        if direction == Vec3::ZERO {
            return;
        }
        let metres = self.diagonal / SECONDS_ACROSS * if fast { FAST } else { 1.0 } * seconds.min(0.1);
        self.standpoint.position += self.standpoint.view.film_from_view() * direction * metres;
        ui.ctx().request_repaint();
    }
}

/// A point of the window as a point of the view: +-1 at the edges, y up.
pub fn point_in_view(rect: Rect, pointer: Pos2) -> Vec2 {
    let offset = (pointer - rect.center()) * 2.0;
    Vec2::new(offset.x / rect.width().max(1.0), -offset.y / rect.height().max(1.0))
}

/// The inverse of [`point_in_view`].
pub fn point_in_window(rect: Rect, point: Vec2) -> Pos2 {
    rect.center() + egui::vec2(point.x * rect.width(), -point.y * rect.height()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_window_and_view_round_trip() {
        let rect = Rect::from_min_size(egui::pos2(10.0, 20.0), egui::vec2(640.0, 360.0));
        assert_eq!(point_in_view(rect, rect.left_top()), Vec2::new(-1.0, 1.0));
        assert_eq!(point_in_view(rect, rect.center()), Vec2::ZERO);
        let pointer = egui::pos2(123.0, 321.0);
        assert!(point_in_window(rect, point_in_view(rect, pointer)).distance(pointer) < 1e-3);
    }

    #[test]
    fn buttons_and_keys_are_those_of_blender() {
        let (middle, primary) = (PointerButton::Middle, PointerButton::Primary);
        let alt = |keys: Modifiers| Modifiers { alt: true, ..keys };
        for (keys, kind) in
            [(Modifiers::NONE, DragKind::Orbit), (Modifiers::SHIFT, DragKind::Pan), (Modifiers::CTRL, DragKind::Dolly)]
        {
            assert_eq!(DragKind::of(middle, keys), kind);
            assert_eq!(DragKind::of(primary, alt(keys)), kind, "Alt stands in for the middle button");
        }
        assert_eq!(DragKind::of(primary, Modifiers::SHIFT), DragKind::Look);
        assert_eq!(DragKind::of(PointerButton::Secondary, Modifiers::NONE), DragKind::Look);
    }

    #[test]
    fn a_selection_is_panned_from_where_it_is() {
        let navigation = Navigation::new(Vec3::ZERO, Quat::IDENTITY, 1.0, 1.0, 10.0);
        let selected = Vec3::new(0.5, 0.0, -4.0);
        let start = Vec2::new(-0.3, 0.2);
        let held = navigation.take_hold(PointerButton::Middle, DragKind::Pan, start, || selected);
        // A pointer that has not moved moves nothing.
        let moved = navigation.standpoint.panned(held.anchor, start + held.offset);
        assert!(moved.position.length() < 1e-5, "{}", moved.position);
    }

    #[test]
    fn a_jump_keeps_the_proportions() {
        let mut navigation = Navigation::new(Vec3::ZERO, Quat::IDENTITY, 1.0, 2.0, 10.0);
        navigation.jump(Vec3::ONE, Quat::from_rotation_y(1.0), 0.5);
        let view = navigation.standpoint.view;
        assert!((view.tan_half.x / view.tan_half.y - 2.0).abs() < 1e-5);
        assert!((view.yaw + 1.0).abs() < 1e-5 && (view.vfov() - 0.5).abs() < 1e-5);
        assert_eq!(navigation.standpoint.position, Vec3::ONE);
    }
}
