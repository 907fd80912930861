//! The menu of files: open, recent ones, save as, and the window's theme.

use std::path::{Path, PathBuf};

use egui::{Button, RichText, ThemePreference, Ui};

use super::dialogs::Purpose;
use super::theme::THEMES;
use crate::recent::RecentFiles;

/// Letters of a name in the menu at most.
const LONGEST_NAME: usize = 48;

const SAVE_EDITS_HINT: &str = "Beside the scene and with the name that is proposed they are there again with it; others are opened with Open edits…";

/// What the menu asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Ask for a file.
    Choose(Purpose),
    /// Open a scene.
    Open(PathBuf),
}

/// Draws the menu's button; the menu opens below it.
pub fn show(ui: &mut Ui, recent: Option<&RecentFiles>) -> Option<Action> {
    let mut action = None;
    ui.menu_button("File", |ui| {
        ui.set_min_width(190.0);
        if ui.add(Button::new("Open scene…").shortcut_text("Ctrl O")).clicked() {
            action = Some(Action::Choose(Purpose::Scene));
        }
        for (name, hint, purpose) in [
            ("Open environment…", "An equirectangular image, .hdr or .exr", Purpose::Environment),
            ("Go on with a film…", "An EXR that fovea wrote of this scene", Purpose::Film),
            ("Open edits…", "A file of edits in place of the present ones; Ctrl Z takes that back", Purpose::Edits),
        ] {
            if ui.button(name).on_hover_text(hint).clicked() {
                action = Some(Action::Choose(purpose));
            }
        }
        if let Some(path) = recent.and_then(|recent| recent_files(ui, recent)) {
            action = Some(Action::Open(path));
        }
        ui.separator();
        for (name, hint, purpose) in [
            ("Save picture as…", "PNG, as it is shown", Purpose::SavePicture),
            ("Save film as…", "EXR: linear, with all samples; a render can go on from it", Purpose::SaveFilm),
            ("Save edits as…", SAVE_EDITS_HINT, Purpose::SaveEdits),
        ] {
            if ui.button(name).on_hover_text(hint).clicked() {
                action = Some(Action::Choose(purpose));
            }
        }
        ui.separator();
        ui.label(RichText::new("Theme").small().weak());
        theme(ui);
    });
    action
}

fn recent_files(ui: &mut Ui, recent: &RecentFiles) -> Option<PathBuf> {
    if recent.paths().is_empty() {
        return None;
    }
    ui.separator();
    ui.label(RichText::new("Recent").small().weak());
    let mut chosen = None;
    for path in recent.paths() {
        let missing = recent.is_missing(path);
        let button = ui.add_enabled(!missing, Button::new(short(path)));
        let place = path.display().to_string();
        let hint = if missing { format!("{place} is not there any more") } else { place };
        if button.on_hover_text(&hint).on_disabled_hover_text(&hint).clicked() {
            chosen = Some(path.clone());
        }
    }
    chosen
}

fn theme(ui: &mut Ui) {
    let before = ui.ctx().options(|options| options.theme_preference);
    let mut chosen: ThemePreference = before;
    for (theme, name) in THEMES {
        ui.radio_value(&mut chosen, theme, name);
    }
    if chosen != before {
        ui.ctx().set_theme(chosen);
    }
}

/// A file's name with its folder's, short enough for a menu.
fn short(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let folder = path.parent().and_then(Path::file_name).map(|folder| folder.to_string_lossy().into_owned());
    let text = folder.map_or(name.clone(), |folder| format!("{folder}/{name}"));
    let letters = text.chars().count();
    if letters <= LONGEST_NAME {
        return text;
    }
    let end: String = text.chars().skip(letters - LONGEST_NAME + 1).collect();
    format!("…{end}")
}
