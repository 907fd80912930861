//! Moving about: turning the view by dragging, zooming, flying, and jumping to the file's cameras.

use egui::{Key, PointerButton, Pos2, Rect};
use glam::{Quat, Vec2, Vec3};

use crate::view::View;

/// Stops of the wheel after which the image plane is half as wide.
const SCROLL_POINTS_TO_HALVE: f32 = 400.0;
/// Seconds in which flying crosses the scene at normal speed.
const SECONDS_ACROSS: f32 = 12.0;
/// Factor of flying with Shift held.
const FAST: f32 = 4.0;

/// Where the viewer stands and looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standpoint {
    /// Metres, in the scene's space.
    pub position: Vec3,
    /// Direction and angle of the view. Film space has the scene's axes.
    pub view: View,
}

/// Turns input into a [`Standpoint`].
#[derive(Clone, Debug)]
pub struct Navigation {
    /// Where the viewer is now.
    pub standpoint: Standpoint,
    /// The direction held by the pointer while it drags.
    held: Option<Vec3>,
    /// Metres a second.
    speed: f32,
}

impl Navigation {
    /// Starts at a camera, in a scene of the given diagonal (metres).
    pub fn new(position: Vec3, rotation: Quat, vfov: f32, aspect: f32, diagonal: f32) -> Self {
        Self {
            standpoint: Standpoint { position, view: View::along(rotation, vfov, aspect) },
            held: None,
            speed: diagonal.max(1e-3) / SECONDS_ACROSS,
        }
    }

    /// Flies at a speed that suits a scene of the given diagonal (metres).
    pub fn set_scale(&mut self, diagonal: f32) {
        self.speed = diagonal.max(1e-3) / SECONDS_ACROSS;
    }

    /// Goes to a camera, keeping the window's proportions.
    pub fn jump(&mut self, position: Vec3, rotation: Quat, vfov: f32) {
        let tan_half = self.standpoint.view.tan_half;
        self.standpoint = Standpoint { position, view: View::along(rotation, vfov, tan_half.x / tan_half.y) };
        self.held = None;
    }

    /// Takes one frame's input into account. `response` covers the picture; keys count unless a widget wants them.
    pub fn update(&mut self, ui: &egui::Ui, response: &egui::Response) {
        let rect = response.rect;
        let aspect = rect.width() / rect.height().max(1.0);
        self.standpoint.view = self.standpoint.view.with_aspect(aspect);
        self.drag(response);
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

    fn drag(&mut self, response: &egui::Response) {
        let buttons = [PointerButton::Primary, PointerButton::Middle, PointerButton::Secondary];
        let dragged = buttons.iter().any(|&button| response.dragged_by(button));
        let Some(pointer) = response.interact_pointer_pos().filter(|_| dragged) else {
            self.held = None;
            return;
        };
        let view = self.standpoint.view;
        let start = pointer - response.drag_delta();
        let held = *self.held.get_or_insert_with(|| view.direction_at(point_in_view(response.rect, start)));
        self.standpoint.view = view.dragged(held, point_in_view(response.rect, pointer));
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
        let metres = self.speed * if fast { FAST } else { 1.0 } * seconds.min(0.1);
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
    fn a_jump_keeps_the_proportions() {
        let mut navigation = Navigation::new(Vec3::ZERO, Quat::IDENTITY, 1.0, 2.0, 10.0);
        navigation.jump(Vec3::ONE, Quat::from_rotation_y(1.0), 0.5);
        let view = navigation.standpoint.view;
        assert!((view.tan_half.x / view.tan_half.y - 2.0).abs() < 1e-5);
        assert!((view.yaw + 1.0).abs() < 1e-5 && (view.vfov() - 0.5).abs() < 1e-5);
        assert_eq!(navigation.standpoint.position, Vec3::ONE);
    }
}
