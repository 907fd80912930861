//! What the window's keys do.

use egui::{Context, Event, InputState, Key, Modifiers};

use super::Window;
use crate::preview::dialogs::Purpose;
use crate::preview::editor;
use crate::preview::engine::Request;
use crate::preview::overlay::Action;
use crate::preview::{file_menu, seeing};

impl Window {
    pub(super) fn keys(&mut self, ctx: &Context, in_headset: bool) {
        if ctx.egui_wants_keyboard_input() || self.unsaved.is_asking() {
            return;
        }
        // Nothing else may change what somebody is timed on.
        if self.split.is_running() {
            return;
        }
        const NUMBERS: [Key; 9] =
            [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];
        let pressed = |modifiers, key| ctx.input_mut(|input| input.consume_key(modifiers, key));
        let saves = |modifiers, key| ctx.input_mut(|input| consume_press(input, modifiers, key));
        if let Some(editor) = &mut self.editor {
            // Several may come in one frame where frames are long.
            let count = |modifiers, key| ctx.input_mut(|input| input.count_and_consume_key(modifiers, key));
            let redo = count(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z) + count(Modifiers::COMMAND, Key::Y);
            let undo = count(Modifiers::COMMAND, Key::Z);
            (0..undo).for_each(|_| editor.act(editor::panel::Action::Undo));
            (0..redo).for_each(|_| editor.act(editor::panel::Action::Redo));
            if saves(Modifiers::COMMAND, Key::E) {
                editor.act(editor::panel::Action::Save);
            }
            if pressed(Modifiers::COMMAND, Key::H) {
                editor.hide_selected();
            }
            if pressed(Modifiers::SHIFT, Key::H) {
                editor.toggle_solo();
            }
            if pressed(Modifiers::ALT, Key::H) {
                editor.show_all();
            }
            if pressed(Modifiers::NONE, Key::T) {
                editor.panel.gizmo = editor.panel.gizmo.next();
            }
        }
        seeing::keys(ctx, &mut self.controls);
        let exr = saves(Modifiers::COMMAND | Modifiers::SHIFT, Key::S);
        let png = saves(Modifiers::COMMAND, Key::S);
        let plain = |key| pressed(Modifiers::NONE, key);
        let camera = NUMBERS.iter().position(|key| plain(*key)).or_else(|| plain(Key::Home).then_some(self.camera));
        // A film is emptied without a question: not by a key that means something else in other programs.
        let restart = saves(Modifiers::COMMAND, Key::R);
        if plain(Key::Space) {
            self.controls.paused = !self.controls.paused;
        }
        if plain(Key::M) {
            self.controls.mode = seeing::next_mode(self.controls.mode);
        }
        if pressed(Modifiers::SHIFT, Key::F) {
            self.visibility.eccentricity = !self.visibility.eccentricity;
        }
        if plain(Key::F) {
            if in_headset {
                self.engine.request(Request::ToggleMarker);
            } else {
                self.visibility.ring = !self.visibility.ring;
            }
        }
        if plain(Key::Period)
            && let (Some((_, navigation)), Some(editor)) = (&mut self.scene, &self.editor)
        {
            let (centre, radius) = editor.focus();
            navigation.frame(centre, radius);
        }
        if plain(Key::V) {
            self.act(if in_headset { Action::LeaveHeadset } else { Action::EnterHeadset });
        }
        if plain(Key::CloseBracket) {
            self.controls.brighten(0.5);
        }
        if plain(Key::OpenBracket) {
            self.controls.brighten(-0.5);
        }
        if plain(Key::G) {
            self.visibility.gaze = !self.visibility.gaze;
        }
        if plain(Key::L) {
            let locked = &mut self.controls.attention.locked_gaze;
            *locked = if locked.is_some() { None } else { self.gaze_direction };
        }
        if plain(Key::N) {
            self.visibility.editor = !self.visibility.editor;
        }
        if plain(Key::H) {
            self.visibility.panel = !self.visibility.panel;
        }
        if pressed(Modifiers::COMMAND, Key::O) {
            self.act_on_file(file_menu::Action::Choose(Purpose::Scene));
        }
        if pressed(Modifiers::SHIFT, Key::Slash) || pressed(Modifiers::NONE, Key::Questionmark) {
            self.visibility.keys = !self.visibility.keys;
        }
        if pressed(Modifiers::NONE, Key::Escape) {
            let open = self.visibility.keys || self.gaze.shows_dots();
            self.visibility.keys = false;
            self.gaze.stop_dots();
            if let Some(editor) = self.editor.as_mut().filter(|_| !open) {
                editor.act(editor::panel::Action::Select(None));
            }
        }
        let actions = [(exr, Action::SaveExr), (png, Action::SavePng), (restart, Action::Restart)];
        actions.into_iter().filter(|(asked, _)| *asked).for_each(|(_, action)| self.act(action));
        if let Some(index) = camera {
            self.jump(index);
        }
    }
}

/// As [`InputState::consume_key`], but a key that is held down counts once: each file wants a press of its own.
fn consume_press(input: &mut InputState, modifiers: Modifiers, key: Key) -> bool {
    let repeats = |event: &Event| {
        matches!(event, Event::Key { key: other, repeat: true, modifiers: held, .. }
            if *other == key && held.matches_logically(modifiers))
    };
    input.events.retain(|event| !repeats(event));
    input.consume_key(modifiers, key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_is_held_down_saves_once() {
        let ctx = Context::default();
        let mut saves = |pressed: bool| {
            let key = Key::S;
            let event = Event::Key { key, physical_key: None, pressed, repeat: false, modifiers: Modifiers::COMMAND };
            let mut saves = false;
            let input = egui::RawInput { events: vec![event], ..egui::RawInput::default() };
            let mut output = ctx.run_ui(input, |ui| {
                saves |= ui.input_mut(|input| consume_press(input, Modifiers::COMMAND, Key::S));
            });
            output.textures_delta.clear();
            saves
        };
        assert_eq!([true, true, true, false, true].map(&mut saves), [true, false, false, false, true]);
    }
}
