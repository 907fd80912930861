//! The panel of the scene: what there is, searched and listed, and the properties of what is selected.
//!
//! A function of the document and of what the panel remembers; what a person asks for comes back as [`Action`]s.

use std::collections::HashMap;
use std::path::PathBuf;

use egui::{
    Align2, Area, Context, Id, Response, RichText, ScrollArea, Sense, TextEdit, Ui, WidgetInfo, accesskit,
    collapsing_header,
};

use super::gizmo::GizmoMode;
use super::properties::{self, DarkColor, HeldAngles, MaterialsOf};
use crate::document::edits::{Edit, Part};
use crate::document::{Document, Gesture};
use crate::preview::theme;

/// Width of the panel, points.
pub const PANEL_WIDTH: f32 = 272.0;
/// Height of a row of a list, points.
const ROW_HEIGHT: f32 = 19.0;
/// Side of what opens and closes a branch, points.
const ICON_SIZE: f32 = 12.0;
/// A tree with more nodes than this starts with closed branches.
const OPEN_AT_FIRST: usize = 200;

/// What is listed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tab {
    /// The tree of nodes.
    #[default]
    Objects,
    /// Materials.
    Materials,
    /// Lights and the environment.
    Lights,
    /// Cameras.
    Cameras,
}

const TABS: [(Tab, &str); 4] =
    [(Tab::Objects, "Objects"), (Tab::Materials, "Materials"), (Tab::Lights, "Lights"), (Tab::Cameras, "Cameras")];

/// What the panel remembers from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct PanelState {
    /// What is listed.
    pub tab: Tab,
    /// What names must contain.
    pub search: String,
    /// Branches that somebody has opened or closed.
    pub branches: HashMap<u32, bool>,
    /// What is selected.
    pub selected: Option<Part>,
    /// What the handles in the picture do.
    pub gizmo: GizmoMode,
    /// The environment image's file as it is typed.
    pub environment: String,
    /// A rotation's angles while they are set.
    pub angles: Option<HeldAngles>,
    /// The materials of a node that was shown last.
    pub materials: Option<MaterialsOf>,
    /// Colours whose strength is 0: the scene does not know them any more.
    pub dark: Vec<DarkColor>,
    /// The list is scrolled to what is selected.
    pub scroll_to_selected: bool,
}

/// Something that a person asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Change the scene.
    Edit(Edit, Gesture),
    /// Light the scene with an image.
    LoadEnvironment(PathBuf),
    /// Select this, or nothing.
    Select(Option<Part>),
    /// Show a node alone, or all.
    Solo(Option<u32>),
    /// Take the last step back.
    Undo,
    /// Make it again.
    Redo,
    /// Save the edits.
    Save,
    /// Go to a camera.
    Camera(usize),
}

/// Draws the panel at the window's right; what is asked for is added to `actions`.
pub fn panel(
    ctx: &Context,
    document: &Document,
    cameras: &[String],
    camera: usize,
    state: &mut PanelState,
    actions: &mut Vec<Action>,
) {
    let height = ctx.content_rect().height() - 20.0;
    Area::new(Id::unique("scene")).anchor(Align2::RIGHT_TOP, egui::vec2(-10.0, 10.0)).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            ui.set_width(PANEL_WIDTH);
            history(ui, document, actions);
            tabs(ui, state);
            list(ui, document, cameras, camera, state, height * 0.38, actions);
            let Some(part) = state.selected else { return };
            ui.separator();
            let left = (height - ui.min_rect().height() - 24.0).max(80.0);
            let area = ScrollArea::vertical().id_salt("properties").max_height(left).min_scrolled_height(left);
            area.auto_shrink([false, true]).show(ui, |ui| {
                // What is typed for one part must not count for the next that is selected.
                ui.push_id(part, |ui| properties::show(ui, document, part, state, actions));
            });
        });
    });
    // A click may end typing: what was typed comes before what the click asks for.
    actions.sort_by_key(|action| !matches!(action, Action::Edit(edit, _) if !matches!(edit, Edit::Reset(_))));
}

fn history(ui: &mut Ui, document: &Document, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.label(RichText::new("Scene").heading());
        for (name, hint, enabled, action) in [
            ("Undo", "Ctrl Z", document.can_undo(), Action::Undo),
            ("Redo", "Ctrl Shift Z", document.can_redo(), Action::Redo),
            ("Save edits", "Ctrl E: beside the scene, as SCENE.fovea.json", document.is_unsaved(), Action::Save),
        ] {
            if ui.add_enabled(enabled, egui::Button::new(name)).on_hover_text(hint).clicked() {
                actions.push(action);
            }
        }
    });
}

fn tabs(ui: &mut Ui, state: &mut PanelState) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for (tab, name) in TABS {
            ui.selectable_value(&mut state.tab, tab, name);
        }
    });
    let search = TextEdit::singleline(&mut state.search).hint_text("Search").desired_width(f32::INFINITY);
    let response = ui.add(search);
    response.widget_info(|| WidgetInfo::labeled(accesskit::Role::SearchInput, true, "Search the scene"));
}

/// A line of a list.
struct Row {
    part: Option<Part>,
    name: String,
    depth: u16,
    /// Whether a branch is open; `None` for a leaf.
    open: Option<bool>,
    camera: Option<usize>,
}

impl Row {
    fn of(part: Part, name: String) -> Self {
        Self { part: Some(part), name, depth: 0, open: None, camera: None }
    }
}

fn list(
    ui: &mut Ui,
    document: &Document,
    cameras: &[String],
    camera: usize,
    state: &mut PanelState,
    height: f32,
    actions: &mut Vec<Action>,
) {
    let rows = rows(document, cameras, state);
    let mut area = ScrollArea::vertical().id_salt("list").max_height(height).auto_shrink([false, true]);
    if std::mem::take(&mut state.scroll_to_selected)
        && let Some(place) = rows.iter().position(|row| row.part.is_some() && row.part == state.selected)
    {
        area = area.vertical_scroll_offset((place as f32 * (ROW_HEIGHT + 2.0) - height * 0.4).max(0.0));
    }
    ui.spacing_mut().item_spacing.y = 2.0;
    area.show_rows(ui, ROW_HEIGHT, rows.len(), |ui, range| {
        for row in rows.get(range).unwrap_or_default() {
            ui.horizontal(|ui| {
                ui.set_height(ROW_HEIGHT);
                show_row(ui, document, row, camera, state, actions);
            });
        }
    });
    if rows.is_empty() {
        let text = if state.search.is_empty() { "There are none." } else { "No name contains that." };
        ui.label(RichText::new(text).small().weak());
    }
}

fn show_row(
    ui: &mut Ui,
    document: &Document,
    row: &Row,
    camera: usize,
    state: &mut PanelState,
    actions: &mut Vec<Action>,
) {
    ui.spacing_mut().item_spacing.x = 4.0;
    if let Some(Part::Node(node)) = row.part {
        let mut visible = document.is_visible(node);
        let response = ui.checkbox(&mut visible, "").on_hover_text("Shown");
        let name = row.name.clone();
        response.widget_info(move || {
            WidgetInfo::selected(accesskit::Role::CheckBox, true, visible, format!("Show {name}"))
        });
        if response.clicked() {
            actions.push(Action::Edit(Edit::Hide(node, !visible), Gesture::Once));
        }
        ui.add_space(12.0 * f32::from(row.depth));
        match row.open {
            Some(open) => {
                let (_, response) = ui.allocate_exact_size(egui::Vec2::splat(ICON_SIZE), Sense::click());
                collapsing_header::paint_default_icon(ui, if open { 1.0 } else { 0.0 }, &response);
                let verb = if open { "Close" } else { "Open" };
                name_button(&response, format!("{verb} {}", row.name));
                if response.clicked() {
                    state.branches.insert(node, !open);
                }
            }
            None => ui.add_space(ICON_SIZE),
        }
    }
    let selected = match row.camera {
        Some(index) => index == camera,
        None => row.part == state.selected,
    };
    let hidden = matches!(row.part, Some(Part::Node(node)) if !document.is_visible(node));
    let text = RichText::new(&row.name);
    let label = egui::Button::selectable(selected, if hidden { text.weak() } else { text }).truncate();
    if ui.add(label).clicked() {
        match row.camera {
            Some(index) => actions.push(Action::Camera(index)),
            None => actions.push(Action::Select(row.part)),
        }
    }
}

/// Gives a button without words a name.
pub(super) fn name_button(response: &Response, name: String) {
    response.widget_info(move || WidgetInfo::labeled(accesskit::Role::Button, true, name.clone()));
}

fn rows(document: &Document, cameras: &[String], state: &PanelState) -> Vec<Row> {
    let wanted = state.search.to_lowercase();
    let fits = |name: &str| name.to_lowercase().contains(&wanted);
    match state.tab {
        Tab::Objects => tree_rows(document, state, &fits),
        Tab::Materials => {
            let named = (0..).zip(&document.version().materials);
            let rows = named
                .map(|(index, material)| Row::of(Part::Material(index), part_name(&material.name, "material", index)));
            rows.filter(|row| fits(&row.name)).collect()
        }
        Tab::Lights => {
            let lights = (0..).zip(&document.version().lights);
            let rows = lights.map(|(index, light)| Row::of(Part::Light(index), part_name(&light.name, "light", index)));
            let environment = Row::of(Part::Environment, "Environment".into());
            std::iter::once(environment).chain(rows).filter(|row| fits(&row.name)).collect()
        }
        Tab::Cameras => {
            let rows = cameras.iter().enumerate().map(|(index, name)| Row {
                part: None,
                name: name.clone(),
                depth: 0,
                open: None,
                camera: Some(index),
            });
            rows.filter(|row| fits(&row.name)).collect()
        }
    }
}

fn tree_rows(document: &Document, state: &PanelState, fits: &impl Fn(&str) -> bool) -> Vec<Row> {
    let tree = document.tree();
    let name = |node: u32| node_name(document, node);
    let searching = !state.search.is_empty();
    // A branch is kept for what hangs on it.
    let mut kept = vec![!searching; document.nodes().len()];
    if searching {
        for node in tree.roots.iter().flat_map(|root| tree.below(*root)).filter(|node| fits(&name(*node))) {
            tree.line(node).for_each(|above| kept[above as usize] = true);
        }
    }
    let open_at_first = document.nodes().len() <= OPEN_AT_FIRST;
    let mut rows = Vec::new();
    let mut pending: Vec<(u32, u16)> = tree.roots.iter().rev().map(|root| (*root, 0)).collect();
    while let Some((node, depth)) = pending.pop() {
        if !kept.get(node as usize).copied().unwrap_or(false) {
            continue;
        }
        let children = tree.children(node);
        let open = searching || state.branches.get(&node).copied().unwrap_or(open_at_first);
        rows.push(Row {
            part: Some(Part::Node(node)),
            name: name(node),
            depth: depth.min(12),
            open: (!children.is_empty()).then_some(open),
            camera: None,
        });
        if open {
            pending.extend(children.iter().rev().map(|child| (*child, depth.saturating_add(1))));
        }
    }
    rows
}

/// What a node is called; one without a name by its place in the file.
pub fn node_name(document: &Document, node: u32) -> String {
    let name = document.nodes().get(node as usize).map_or("", |node| node.name.as_str());
    part_name(name, "node", node)
}

/// A part's name, or what it is and its place.
pub fn part_name(name: &str, kind: &str, index: u32) -> String {
    if name.is_empty() { format!("{kind} {index}") } else { name.to_owned() }
}
