//! Working on the scene: what is selected, its outline and handles in the picture, the panel, and what all of it asks of the
//! [`Document`].

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context as _;
use egui::{Color32, Context, PointerButton, Pos2, Rect, Response, Stroke, Ui};
use glam::Vec3;
use tracer::scene::{EnvironmentImage, Scene};

use super::engine::Message;
use super::navigation::{Standpoint, point_in_view, point_in_window};
use super::theme;
use crate::config;
use crate::document::edits::{Edit, EnvironmentEdit, Part};
use crate::document::{Document, Gesture, sidecar};
use crate::output::OutputError;
use crate::pick::Picker;
use crate::session::{Loaded, Source};
use gizmo::{Drag, Gizmo, axes_of};
use outline::{Segment, Silhouette};
use panel::{Action, PanelState, Tab};

mod focus;
pub mod gizmo;
pub mod outline;
pub mod panel;
pub mod properties;

/// Points of the window per cell of the outline's grid.
const OUTLINE_CELL: f32 = 2.0;

/// What the outline was drawn for.
#[derive(Clone, Debug)]
struct OutlineOf {
    version: Arc<Scene>,
    node: u32,
    standpoint: Standpoint,
    size: [usize; 2],
}

impl OutlineOf {
    fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.version, &other.version)
            && self.node == other.node
            && self.standpoint == other.standpoint
            && self.size == other.size
    }
}

/// The document of the open scene and what a person is doing with it.
pub struct Editor {
    document: Document,
    /// What the panel remembers.
    pub panel: PanelState,
    picker: Picker,
    drag: Option<Drag>,
    outline: Option<(OutlineOf, Vec<Segment>)>,
    source: Source,
    sidecar: PathBuf,
    /// The file there could not be read: it is put aside before another is written.
    is_unreadable: bool,
    message: Option<Message>,
    /// The environment image that was last asked for, and what became of it.
    asked_environment: Option<PathBuf>,
    reading: Reading,
}

/// What became of an image that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reading {
    UnderWay,
    Done,
    Failed,
}

impl Editor {
    /// For a scene that was opened, with the edits that were saved beside it.
    pub fn open(source: &Source, loaded: &Loaded) -> Self {
        let mut editor = Self::new(source, loaded);
        if editor.sidecar.exists() {
            let taken = editor.document.load_edits(&editor.sidecar);
            editor.is_unreadable = taken.is_err();
            editor.message = Some(message_of(&editor.sidecar, taken));
        }
        if let Some(recovered) = sidecar::recovered(&editor.sidecar) {
            let name = recovered.display();
            // What is wrong with the file of edits is said as well.
            let before = editor.message.take().filter(|message| message.wrong).map(|message| message.text + "; ");
            let text = format!(
                "{}{name} has edits that were not saved when the window ended; File, Open edits takes them",
                before.unwrap_or_default()
            );
            editor.message = Some(Message::now(text, true));
        }
        editor
    }

    /// Without edits.
    fn new(source: &Source, loaded: &Loaded) -> Self {
        Self {
            document: Document::new(loaded),
            panel: PanelState::default(),
            picker: Picker::default(),
            drag: None,
            outline: None,
            message: None,
            source: source.clone(),
            sidecar: sidecar::beside(source),
            asked_environment: None,
            reading: Reading::Done,
            is_unreadable: false,
        }
    }

    /// The scene with its edits.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// Where the scene comes from.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The file beside the scene that its edits are saved to.
    pub fn sidecar(&self) -> &Path {
        &self.sidecar
    }

    /// Puts the edits of a file in place of the present ones, as one step to undo.
    pub fn open_edits(&mut self, path: &Path) {
        let taken = self.document.open_edits(path);
        self.message = Some(message_of(path, taken));
    }

    /// Keeps edits that are not saved, in a file that none had, where the window ends without a question; that file.
    pub fn rescue(&self) -> Option<Result<PathBuf, OutputError>> {
        let path = sidecar::free_rescue(&self.sidecar).filter(|_| self.document.is_unsaved())?;
        Some(self.document.copy_edits(&path).map(|()| path))
    }

    /// Goes on from a newer version of the file.
    pub fn follow_file(&mut self, loaded: &Loaded) {
        let (selected, gone) = self.document.follow_file(loaded, self.panel.selected);
        self.panel.selected = selected;
        self.drag = None;
        self.message = Some(if gone.is_empty() {
            Message::now("read again: the file has changed".into(), false)
        } else {
            Message::now(format!("read again; gone, and their edits are kept for them: {}", gone.join(", ")), true)
        });
    }

    /// The newest thing to tell.
    pub fn message(&self) -> Option<&Message> {
        self.message.as_ref()
    }

    /// Whether a handle is held: the pointer's movements are not the view's.
    pub fn holds_pointer(&self) -> bool {
        self.drag.is_some()
    }

    /// Takes clicks and drags in the picture into account.
    pub fn point(&mut self, ui: &Ui, response: &Response, standpoint: &Standpoint) {
        let rect = response.rect;
        if ui.input(|input| input.pointer.any_pressed()) {
            self.document.end_gesture();
            // What is being typed is for what is selected now.
            if response.is_pointer_button_down_on()
                && let Some(field) = ui.memory(egui::Memory::focused)
            {
                ui.memory_mut(|memory| memory.surrender_focus(field));
            }
        }
        // With Alt the drag is the view's.
        if response.drag_started_by(PointerButton::Primary) && !ui.input(|input| input.modifiers.alt) {
            let origin = ui.input(|input| input.pointer.press_origin());
            self.drag = origin.and_then(|origin| self.grab(origin, rect, standpoint));
        }
        // The pointer may have moved on in the frame in which it lets go.
        let dragged = response.dragged_by(PointerButton::Primary) || response.drag_stopped_by(PointerButton::Primary);
        match (self.drag, response.interact_pointer_pos()) {
            (Some(drag), Some(pointer)) if dragged => {
                if let Some(Part::Node(node)) = self.panel.selected {
                    let moved = drag.moved(pointer, rect, standpoint);
                    self.document.edit(&Edit::Move(node, moved), Gesture::GoesOn);
                }
            }
            _ => self.drag = None,
        }
        if response.clicked_by(PointerButton::Primary)
            && let Some(pointer) = response.interact_pointer_pos()
        {
            self.pick(pointer, rect, standpoint);
        }
    }

    fn grab(&self, pointer: Pos2, rect: Rect, standpoint: &Standpoint) -> Option<Drag> {
        let Some(Part::Node(node)) = self.panel.selected else { return None };
        let gizmo = self.gizmo(standpoint)?;
        let axis = gizmo.at(pointer, rect, standpoint)?;
        let start = self.document.edits().nodes.get(&node).map(|edit| edit.moved).unwrap_or_default();
        gizmo.grab(axis, pointer, rect, standpoint, start, self.document.world_from_file_above(node))
    }

    fn gizmo(&self, standpoint: &Standpoint) -> Option<Gizmo> {
        let Some(Part::Node(node)) = self.panel.selected else { return None };
        let (pivot, axes) = properties::own_axes(&self.document, node);
        Gizmo::new(self.panel.gizmo, pivot, axes_of(axes), standpoint)
    }

    /// Selects what lies under a point of the window.
    fn pick(&mut self, pointer: Pos2, rect: Rect, standpoint: &Standpoint) {
        let direction = standpoint.view.direction_at(point_in_view(rect, pointer));
        let version = Arc::clone(self.document.version());
        let hit = self.picker.pick(&version, standpoint.position, direction);
        let node = hit.and_then(|hit| version.instances.get(hit.instance as usize)).map(|instance| instance.node);
        self.select(node.map(Part::Node));
    }

    fn select(&mut self, part: Option<Part>) {
        self.panel.selected = part;
        self.panel.scroll_to_selected = true;
        match part {
            Some(Part::Node(node)) => {
                self.panel.tab = Tab::Objects;
                let above: Vec<u32> = self.document.tree().line(node).skip(1).collect();
                above.into_iter().for_each(|node| {
                    self.panel.branches.insert(node, true);
                });
            }
            Some(Part::Material(_)) => self.panel.tab = Tab::Materials,
            Some(Part::Light(_) | Part::Environment) => self.panel.tab = Tab::Lights,
            None => {}
        }
    }

    /// Draws outline and handles over the picture.
    pub fn draw(&mut self, ui: &Ui, rect: Rect, standpoint: &Standpoint) {
        match self.panel.selected {
            Some(Part::Node(node)) => self.draw_outline(ui, rect, standpoint, node),
            Some(Part::Light(light)) => self.draw_light(ui, rect, standpoint, light),
            _ => {}
        }
        if let Some(gizmo) = self.gizmo(standpoint) {
            let hovered = ui.input(|input| input.pointer.hover_pos());
            let lit = match self.drag {
                Some(drag) => Some(drag.axis()),
                None => hovered.and_then(|pointer| gizmo.at(pointer, rect, standpoint)),
            };
            gizmo.draw(ui.painter(), rect, standpoint, lit);
        }
    }

    fn draw_outline(&mut self, ui: &Ui, rect: Rect, standpoint: &Standpoint, node: u32) {
        let size = [rect.width(), rect.height()].map(|side| (side / OUTLINE_CELL) as usize);
        let wanted = OutlineOf { version: Arc::clone(self.document.version()), node, standpoint: *standpoint, size };
        if !self.outline.as_ref().is_some_and(|(known, _)| known.is(&wanted)) {
            let below: std::collections::BTreeSet<u32> = self.document.tree().below(node).into_iter().collect();
            let instances = (0..).zip(&wanted.version.instances).filter(|(_, i)| below.contains(&i.node));
            let instances: Vec<u32> = instances.map(|(index, _)| index).collect();
            let segments = Silhouette::new(&wanted.version, &instances, standpoint, size).outline();
            self.outline = Some((wanted, segments));
        }
        let Some((_, segments)) = &self.outline else { return };
        let lines: Vec<[Pos2; 2]> = segments.iter().map(|ends| ends.map(|end| point_in_window(rect, end))).collect();
        for (width, colour) in [(3.0, Color32::from_black_alpha(120)), (1.5, theme::ACCENT)] {
            let stroke = Stroke::new(width, colour);
            ui.painter().extend(lines.iter().map(|ends| egui::Shape::line_segment(*ends, stroke)));
        }
    }

    fn draw_light(&self, ui: &Ui, rect: Rect, standpoint: &Standpoint, light: u32) {
        let Some(light) = self.document.version().lights.get(light as usize) else { return };
        if let Some(point) = standpoint.view.point_of(light.position - standpoint.position) {
            let centre = point_in_window(rect, point);
            ui.painter().circle_stroke(centre, 10.0, Stroke::new(3.5, Color32::from_black_alpha(120)));
            ui.painter().circle_stroke(centre, 10.0, Stroke::new(1.5, theme::ACCENT));
        }
    }

    /// Draws the panel and does what it asks for; the camera that somebody wants to go to.
    pub fn show_panel(&mut self, ctx: &Context, cameras: &[String], camera: usize) -> Option<usize> {
        let mut actions = Vec::new();
        panel::panel(ctx, &self.document, cameras, camera, &mut self.panel, &mut actions);
        let wanted = actions.iter().find_map(|action| match action {
            Action::Camera(index) => Some(*index),
            _ => None,
        });
        actions.into_iter().for_each(|action| self.act(action));
        wanted
    }

    /// Does what was asked for.
    pub fn act(&mut self, action: Action) {
        match action {
            Action::Edit(Edit::Environment(edit), gesture) => self.edit_environment(edit, gesture),
            Action::Edit(edit, gesture) => self.document.edit(&edit, gesture),
            Action::Select(part) => self.select(part),
            Action::LoadEnvironment(path) => self.set_environment(path),
            Action::Solo(node) => self.document.set_solo(node),
            Action::Undo => self.document.undo(),
            Action::Redo => self.document.redo(),
            Action::Save if self.document.is_unsaved() => {
                self.save();
            }
            Action::Save | Action::Camera(_) => {}
        }
    }

    fn edit_environment(&mut self, mut edit: EnvironmentEdit, gesture: Gesture) {
        // A name that means the same wherever the program is started from.
        edit.image = edit.image.map(|path| std::path::absolute(&path).unwrap_or(path));
        self.document.edit(&Edit::Environment(edit), gesture);
    }

    /// Lights the scene with an image; what else is known of the environment stays. Its file is read, also where it was before.
    pub fn set_environment(&mut self, path: PathBuf) {
        self.asked_environment = None;
        let edit = EnvironmentEdit { image: Some(path), ..self.document.edits().environment.clone() };
        self.edit_environment(edit, Gesture::Once);
    }

    /// The environment image that is to be read, once: whoever reads it watches its file, and one that cannot be read is not tried
    /// at every frame.
    pub fn ask_for_environment(&mut self) -> Option<PathBuf> {
        let named = &self.document.edits().environment.image;
        // Undo may name another one in between, and the image is gone.
        let is_gone = self.reading == Reading::Done && self.document.wanted_environment().is_some();
        if *named == self.asked_environment && !is_gone {
            return None;
        }
        self.asked_environment.clone_from(named);
        self.reading = Reading::UnderWay;
        self.asked_environment.clone()
    }

    /// Whether the scene is without the environment image that its edits name, which is still to come.
    pub fn awaits_environment(&self) -> bool {
        let wanted = self.document.wanted_environment();
        wanted.is_some() && (wanted != self.asked_environment.as_deref() || self.reading == Reading::UnderWay)
    }

    /// Takes an environment image, or the reason why there is none. What was asked for before the last one is nobody's business.
    pub fn take_environment(&mut self, path: PathBuf, result: Result<Arc<EnvironmentImage>, String>) {
        if self.asked_environment.as_ref() != Some(&path) {
            return;
        }
        self.reading = if result.is_ok() { Reading::Done } else { Reading::Failed };
        match result {
            Ok(image) => self.document.add_environment(path, image),
            Err(reason) => self.message = Some(Message::now(reason, true)),
        }
    }

    /// Saves the edits beside the scene; whether that went well.
    pub fn save(&mut self) -> bool {
        self.save_as(&self.sidecar.clone())
    }

    /// Saves the edits to a file; only the one beside the scene is read again with it.
    pub fn save_as(&mut self, path: &Path) -> bool {
        let saved = self.write(path);
        let is_saved = saved.is_ok();
        self.message = Some(match saved {
            Ok(None) => Message::now(format!("saved {}", path.display()), false),
            Ok(Some(aside)) => {
                let aside = aside.display();
                Message::now(format!("saved {}; the file that could not be read is now {aside}", path.display()), true)
            }
            Err(error) => Message::now(format!("{error:#}"), true),
        });
        is_saved
    }

    /// Writes a file of edits; where one that could not be read is now.
    fn write(&mut self, path: &Path) -> anyhow::Result<Option<PathBuf>> {
        // A dialog names files from the root.
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        if absolute(path) != absolute(&self.sidecar) {
            self.document.copy_edits(path)?;
            return Ok(None);
        }
        let aside = (self.is_unreadable && path.exists())
            .then(|| config::put_aside(path).with_context(|| format!("{}: cannot be put aside", path.display())))
            .transpose()?;
        self.is_unreadable = false;
        self.document.save_edits(path)?;
        Ok(aside)
    }

    /// Hides what is selected.
    pub fn hide_selected(&mut self) {
        if let Some(Part::Node(node)) = self.panel.selected {
            self.document.edit(&Edit::Hide(node, true), Gesture::Once);
        }
    }

    /// Shows what is selected alone, or all again.
    pub fn toggle_solo(&mut self) {
        let solo = match (self.document.solo(), self.panel.selected) {
            (None, Some(Part::Node(node))) => Some(node),
            _ => None,
        };
        self.document.set_solo(solo);
    }

    /// Shows all that is hidden.
    pub fn show_all(&mut self) {
        self.document.set_solo(None);
        self.document.edit(&Edit::ShowAll, Gesture::Once);
    }

    /// What is selected, in words; empty for nothing.
    pub fn selected_name(&self) -> String {
        self.panel.selected.map(|part| properties::title(&self.document, part)).unwrap_or_default()
    }

    /// Figures for a screenshot's report.
    pub fn figures(&self) -> serde_json::Value {
        let pivot = match self.panel.selected {
            Some(Part::Node(node)) => properties::own_axes(&self.document, node).0,
            _ => Vec3::ZERO,
        };
        serde_json::json!({
            "selected": self.selected_name(),
            "pivot_m": pivot.to_array(),
            "edits": self.document.to_json(&self.sidecar),
            "unsaved": self.document.is_unsaved(),
            "can_undo": self.document.can_undo(),
            "message": self.message.as_ref().map(|message| message.text.as_str()),
        })
    }
}

/// What to say of a file of edits that was read.
fn message_of(path: &Path, absent: Result<Vec<String>, String>) -> Message {
    match absent {
        Ok(absent) if absent.is_empty() => Message::now(format!("with the edits of {}", path.display()), false),
        Ok(absent) => {
            let parts = absent.join(", ");
            Message::now(format!("edits of parts that the scene lacks are kept for them: {parts}"), true)
        }
        Err(reason) => Message::now(reason, true),
    }
}

#[cfg(test)]
mod tests;
