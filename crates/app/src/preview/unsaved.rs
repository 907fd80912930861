//! Edits that are not saved: a mark in the window's title, and a question before they are lost.

use egui::{Context, Id, Modal, RichText, ViewportCommand};

use super::editor::Editor;
use crate::document::edits::Edits;
use crate::session::{Loaded, Source};

/// What would lose the edits.
#[derive(Clone, Debug)]
pub enum Next {
    /// The window closes.
    Close,
    /// A scene is to be opened.
    Open(Source),
    /// A scene that was opened is to be shown: there were edits after it was asked for.
    Show(Box<(Source, Loaded)>),
}

/// What came of a question.
#[derive(Clone, Debug)]
pub enum Decision {
    /// It is to be done.
    GoOn(Next),
    /// It is not: the scene stays.
    Stay(Next),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Save,
    Discard,
    Cancel,
}

/// What is known of edits that are not saved.
#[derive(Debug, Default)]
pub struct Unsaved {
    /// What waits for an answer.
    waiting: Option<Next>,
    /// Edits that may be lost with the present scene.
    given_up: Option<Edits>,
    /// The window may close.
    closing: bool,
    /// As the window has it.
    title: String,
}

impl Unsaved {
    /// Whether somebody is being asked.
    pub fn is_asking(&self) -> bool {
        self.waiting.is_some()
    }

    /// What can be done at once; otherwise it is asked about.
    pub fn allow(&mut self, next: Next, editor: Option<&Editor>) -> Option<Next> {
        let document = editor.map(Editor::document).filter(|document| document.is_unsaved());
        if document.is_none_or(|document| self.given_up.as_ref() == Some(document.edits())) {
            return Some(next);
        }
        self.waiting.get_or_insert(next);
        None
    }

    /// What was given up is not: the scene stays, or another is there.
    pub fn keep(&mut self) {
        self.given_up = None;
    }

    /// Has the window stay when it is asked to close and edits would be lost.
    pub fn follow_close(&mut self, ctx: &Context, editor: Option<&Editor>) {
        let asked = ctx.input(|input| input.viewport().close_requested());
        if asked && !self.closing && (self.is_asking() || self.allow(Next::Close, editor).is_none()) {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
        }
    }

    /// Names the scene in the window's title, with a mark while there is something to save.
    pub fn follow_title(&mut self, ctx: &Context, editor: Option<&Editor>) {
        let Some(editor) = editor else { return };
        let mark = if editor.document().is_unsaved() { "• " } else { "" };
        let title = format!("{mark}{} - Fovea", editor.source().name());
        if title != self.title {
            ctx.send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    /// The window is another: it has no title yet.
    pub fn renew(&mut self) {
        self.title.clear();
    }

    /// Asks what is to be asked; what came of it.
    pub fn ask(&mut self, ctx: &Context, editor: Option<&mut Editor>) -> Option<Decision> {
        let (Some(next), Some(editor)) = (&self.waiting, editor) else { return None };
        let answer = question(ctx, &editor.source().name(), next)?;
        let next = self.waiting.take()?;
        let goes_on = match answer {
            Answer::Save => editor.save(),
            Answer::Discard => {
                self.given_up = Some(editor.document().edits().clone());
                true
            }
            Answer::Cancel => false,
        };
        if !goes_on {
            return Some(Decision::Stay(next));
        }
        if matches!(next, Next::Close) {
            self.closing = true;
            ctx.send_viewport_cmd(ViewportCommand::Close);
        }
        Some(Decision::GoOn(next))
    }
}

fn question(ctx: &Context, name: &str, next: &Next) -> Option<Answer> {
    let reason = match next {
        Next::Close => "The window is about to close.".to_owned(),
        Next::Open(source) => format!("Next is {}.", source.name()),
        Next::Show(opened) => format!("Next is {}.", opened.0.name()),
    };
    let mut answer = None;
    let modal = Modal::new(Id::unique("unsaved")).show(ctx, |ui| {
        ui.label(RichText::new(format!("{name} has edits that are not saved.")).strong());
        ui.label(RichText::new(reason).weak());
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let buttons = [("Save", Answer::Save), ("Discard", Answer::Discard), ("Cancel", Answer::Cancel)];
            let shown = buttons.map(|(name, meaning)| {
                let button = ui.button(name);
                answer = answer.or(button.clicked().then_some(meaning));
                button
            });
            // Keys are the question's, and the first is to save.
            if !shown.iter().any(egui::Response::has_focus) {
                shown[0].request_focus();
            }
        });
    });
    answer.or(modal.should_close().then_some(Answer::Cancel))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::path::PathBuf;

    use egui::{ViewportEvent, ViewportId};
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;
    use crate::document::edits::Edit;
    use crate::document::{Gesture, sidecar};
    use crate::preview::editor::panel::Action;

    /// An editor of a scene in a folder of its own, and what the window does about its edits.
    struct Open {
        unsaved: Unsaved,
        editor: Editor,
        decided: Vec<Decision>,
        folder: PathBuf,
    }

    impl Open {
        fn new(name: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("fovea-unsaved-{name}-{}", std::process::id()));
            let _ = std::fs::remove_dir_all(&folder);
            std::fs::create_dir_all(&folder).unwrap();
            let args = crate::cli::parse(["fovea".into()]).unwrap().preview;
            let loaded = crate::session::load(&Source::BuiltIn, &args.scene).unwrap();
            let editor = Editor::open(&Source::File(folder.join("room.glb")), &loaded);
            Self { unsaved: Unsaved::default(), editor, decided: Vec::new(), folder }
        }

        fn hide(&mut self, place: usize) {
            let node = self.editor.document().tree().roots[place];
            self.editor.act(Action::Edit(Edit::Hide(node, true), Gesture::Once));
        }

        fn sidecar(&self) -> PathBuf {
            sidecar::path_for(&self.folder.join("room.glb"))
        }
    }

    impl Drop for Open {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }

    fn window(open: Open) -> Harness<'static, Open> {
        let draw = |ui: &mut egui::Ui, open: &mut Open| {
            open.unsaved.follow_close(ui.ctx(), Some(&open.editor));
            open.decided.extend(open.unsaved.ask(ui.ctx(), Some(&mut open.editor)));
            open.unsaved.follow_title(ui.ctx(), Some(&open.editor));
        };
        Harness::builder().with_size([800.0, 600.0]).build_ui_state(draw, open)
    }

    fn asked(harness: &Harness<'_, Open>) -> Vec<ViewportCommand> {
        harness.output().viewport_output[&ViewportId::ROOT].commands.clone()
    }

    /// Presses the window's own button; whether the window closes.
    fn closes(harness: &mut Harness<'_, Open>) -> bool {
        let input = harness.input_mut().viewports.entry(ViewportId::ROOT).or_default();
        input.events.push(ViewportEvent::Close);
        harness.step();
        let closes = !asked(harness).contains(&ViewportCommand::CancelClose);
        harness.input_mut().viewports.entry(ViewportId::ROOT).or_default().events.clear();
        harness.run_steps(2);
        closes
    }

    /// Presses a button of the question.
    fn answer(harness: &mut Harness<'_, Open>, button: &str) {
        harness.get_by_label(button).click();
        harness.run_steps(2);
        assert!(!harness.state().unsaved.is_asking(), "{button} is an answer");
    }

    #[test]
    fn a_window_with_edits_that_are_not_saved_asks_before_it_closes() {
        let mut harness = window(Open::new("close"));
        assert!(closes(&mut harness), "there is nothing to lose");
        harness.state_mut().hide(0);
        assert!(!closes(&mut harness) && harness.state().unsaved.is_asking());
        assert!(!closes(&mut harness), "pressing again is no answer");
        answer(&mut harness, "Cancel");
        assert!(!harness.state().sidecar().exists() && harness.state().editor.document().is_unsaved());
        assert!(!closes(&mut harness));
        harness.key_press(egui::Key::Escape);
        harness.run_steps(2);
        assert!(matches!(harness.state().decided[..], [Decision::Stay(Next::Close), Decision::Stay(Next::Close)]));
        assert!(!closes(&mut harness));
        answer(&mut harness, "Save");
        assert!(harness.state().sidecar().exists() && closes(&mut harness));
    }

    #[test]
    fn edits_are_given_up_once_and_not_those_that_follow() {
        let mut harness = window(Open::new("discard"));
        harness.state_mut().hide(0);
        let other = || Next::Open(Source::File("other.glb".into()));
        let allows = |harness: &mut Harness<'_, Open>, next: Next| {
            let open = harness.state_mut();
            let allows = open.unsaved.allow(next, Some(&open.editor)).is_some();
            harness.run_steps(2);
            allows
        };
        assert!(!allows(&mut harness, other()));
        harness.get_by_label("Next is other.glb.");
        answer(&mut harness, "Discard");
        assert!(matches!(harness.state().decided[..], [Decision::GoOn(Next::Open(_))]));
        assert!(allows(&mut harness, other()), "it was said, and the scene is on its way");
        harness.state_mut().hide(1);
        assert!(!allows(&mut harness, other()), "nobody has said so of the second edit");
        answer(&mut harness, "Discard");
        // It cannot be opened.
        harness.state_mut().unsaved.keep();
        assert!(!closes(&mut harness));
        answer(&mut harness, "Discard");
        assert!(closes(&mut harness) && !harness.state().sidecar().exists());
    }

    #[test]
    fn what_cannot_be_saved_keeps_the_window_open() {
        let mut harness = window(Open::new("unwritable"));
        harness.state_mut().hide(0);
        std::fs::remove_dir_all(&harness.state().folder).unwrap();
        assert!(!closes(&mut harness));
        answer(&mut harness, "Save");
        assert!(harness.state().editor.message().unwrap().wrong);
        assert!(matches!(harness.state().decided[..], [Decision::Stay(Next::Close)]) && !closes(&mut harness));
    }

    #[test]
    fn the_title_says_whether_there_is_something_to_save() {
        let mut harness = window(Open::new("title"));
        assert_eq!(harness.state().unsaved.title, "room.glb - Fovea");
        harness.state_mut().hide(0);
        harness.step();
        assert_eq!(asked(&harness), [ViewportCommand::Title("• room.glb - Fovea".into())]);
        harness.state_mut().editor.act(Action::Undo);
        harness.step();
        assert_eq!(harness.state().unsaved.title, "room.glb - Fovea");
    }
}
