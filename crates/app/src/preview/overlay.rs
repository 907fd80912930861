//! What lies over the picture: settings, figures, notes and the list of keys.

use std::time::{Duration, Instant};

use egui::{
    Align, Align2, Area, ComboBox, Context, DragValue, Grid, Id, Layout, Order, RichText, Slider, SliderClamping, Ui,
};
use glam::Vec3;

use super::attention_tools::{self, ToolState};
use super::controls::{Controls, MODES, Readout, TONE_MAPS, clock, metric};
use super::engine::{HeadsetReadout, Message};
use super::file_menu;
use super::histogram;
use super::seeing;
use super::split_panel::{self, SplitTimes};
use super::theme;
use crate::cli::choices::{Clip, EccentricityAt, Mode, Model};
use crate::cli::values::EXPOSURE_EV;
use crate::convergence::Progress;
use crate::recent::RecentFiles;

/// Width of the panel, points.
const PANEL_WIDTH: f32 = 236.0;

const OUTLINE_HINT: &str = "Ready: at the gaze, noise is below 20 % of the brightness (95 % confidence)";
const MATERIAL_HINT: &str = "Ready: at the gaze, noise is below 5 % of the brightness (95 % confidence)";

/// What the keys do, as `?` lists them.
pub const KEYS: [(&str, &str); 38] = [
    ("Drag", "look around; on a handle: move, turn or scale"),
    ("Click", "select what is there"),
    ("Wheel", "zoom at the pointer"),
    ("Middle drag", "orbit about the selection, or what is there"),
    ("Shift + middle", "pan"),
    ("Ctrl + middle", "closer or away; Alt + drag: without middle button"),
    (".", "frame the selection, or all"),
    ("W A S D  Q E", "fly; Shift: faster"),
    ("1 - 9", "the file's cameras"),
    ("Home", "back to the camera"),
    ("N", "scene, properties, materials, lights"),
    ("T", "handles: move, rotate, scale"),
    ("Ctrl Z", "undo"),
    ("Ctrl Shift Z", "redo"),
    ("Ctrl O", "open a scene"),
    ("Ctrl E", "save the edits beside the scene"),
    ("Ctrl H", "hide what is selected"),
    ("Shift H", "show it alone, or all again"),
    ("Alt H", "show all that is hidden"),
    ("M", "next mode"),
    ("Space", "pause"),
    ("Ctrl R", "start the film again"),
    ("F", "ring at the fovea"),
    ("Shift F", "rings of eccentricity"),
    ("G", "gaze: sources, drift, recording"),
    ("V", "into the headset and out"),
    ("L", "lock the gaze where it is, or free it"),
    ("O  P", "split times: the outline, the material is visible"),
    ("X", "debug view: sample density, or what it last was"),
    ("Shift X", "next debug view"),
    ("K", "false colour"),
    ("C", "compare with another mode; drag the line"),
    ("Shift C", "next mode on the right"),
    ("[  ]", "exposure"),
    ("Ctrl S", "save the picture as PNG"),
    ("Ctrl Shift S", "save the film as EXR"),
    ("H", "hide or show the panel"),
    ("?", "this list"),
];

/// What is open and what is hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visibility {
    /// The panel.
    pub panel: bool,
    /// The list of keys.
    pub keys: bool,
    /// The ring at the fovea.
    pub ring: bool,
    /// Rings of equal eccentricity.
    pub eccentricity: bool,
    /// The panel about gaze.
    pub gaze: bool,
    /// The panel of the scene.
    pub editor: bool,
}

impl Default for Visibility {
    fn default() -> Self {
        Self { panel: true, keys: false, ring: true, eccentricity: false, gaze: false, editor: false }
    }
}

/// Something that a button or key asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Start the film again.
    Restart,
    /// Save what the window shows.
    SavePng,
    /// Save the whole film.
    SaveExr,
    /// Go to a camera of the file.
    Camera(usize),
    /// Show the scene in the headset.
    EnterHeadset,
    /// Show it in the window alone.
    LeaveHeadset,
    /// Open or save a file.
    File(file_menu::Action),
    /// Tell what came of something.
    Tell(Message),
}

/// What the panel shows and cannot change.
#[derive(Clone, Debug, Default)]
pub struct Facts<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// `212 k triangles, 4 lights`.
    pub contents: &'a str,
    /// The adapter's name.
    pub adapter: &'a str,
    /// `4096x2048`.
    pub film: &'a str,
    /// How kernels share the work of a path.
    pub schedule: &'a str,
    /// Names of the file's cameras.
    pub cameras: &'a [String],
    /// The camera last jumped to.
    pub camera: usize,
    /// What the import met and did not support.
    pub notes: &'a [String],
    /// Figures.
    pub readout: Readout,
    /// The headset while it is in use.
    pub headset: Option<&'a HeadsetReadout>,
    /// Degrees at the eye of a pixel at the centre.
    pub deg_per_px: f32,
    /// The direction that one looks in, in the scene.
    pub gaze: Option<Vec3>,
    /// What is selected, in words.
    pub selected: &'a str,
    /// Files that were opened before.
    pub recent: Option<&'a RecentFiles>,
}

/// Draws the panel.
pub fn panel(
    ctx: &Context,
    facts: &Facts<'_>,
    controls: &mut Controls,
    tools: &mut ToolState,
    split: &mut SplitTimes,
    visibility: &mut Visibility,
) -> Vec<Action> {
    let mut actions = Vec::new();
    Area::new(Id::unique("panel")).anchor(Align2::LEFT_TOP, egui::vec2(10.0, 10.0)).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            ui.set_width(PANEL_WIDTH);
            header(ui, facts, &mut actions);
            modes(ui, controls);
            figures(ui, facts, controls.paused);
            ui.separator();
            picture(ui, controls);
            cameras(ui, facts, &mut actions);
            buttons(ui, controls, &mut actions);
            headset(ui, facts.headset, &mut actions);
            ui.separator();
            let histogram = ui.collapsing("Histogram", |ui| {
                histogram::panel(ui, facts.readout.seen.histogram.as_ref());
            });
            controls.histogram = !histogram.fully_closed();
            ui.collapsing("Attention", |ui| {
                attention_tools::panel(ui, tools, &mut controls.attention, facts.gaze);
            });
            ui.collapsing("Split times", |ui| {
                // Before the first picture of a scene there is nothing to time.
                ui.add_enabled_ui(!facts.film.is_empty(), |ui| {
                    let scene = split_panel::Scene { name: facts.scene, adapter: facts.adapter };
                    actions.extend(split.show(ui, facts.selected, &scene, Instant::now()).map(Action::Tell));
                });
            });
            ui.collapsing("Pixel at the gaze", |ui| pixel(ui, facts));
            ui.collapsing("Sampling and screen", |ui| sampling(ui, facts, controls, visibility));
            notes(ui, facts.notes);
            ui.label(RichText::new("?  keys     N  scene     G  gaze     H  hide").small().weak());
        });
    });
    actions
}

fn header(ui: &mut Ui, facts: &Facts<'_>, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        actions.extend(file_menu::show(ui, facts.recent).map(Action::File));
        ui.add(egui::Label::new(RichText::new(facts.scene).heading()).truncate());
    });
    ui.add(egui::Label::new(RichText::new(facts.contents).small().weak()).truncate());
}

fn modes(ui: &mut Ui, controls: &mut Controls) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for (mode, name, explanation) in MODES {
            ui.selectable_value(&mut controls.mode, mode, name).on_hover_text(explanation);
        }
    });
}

fn figures(ui: &mut Ui, facts: &Facts<'_>, paused: bool) {
    let readout = &facts.readout;
    let rows = [
        ("Samples/s", if paused { "paused".to_owned() } else { metric(readout.samples_per_s) }, "Light paths a second"),
        ("Outline", progress(readout.convergence.outline), OUTLINE_HINT),
        ("Material", progress(readout.convergence.material), MATERIAL_HINT),
        ("At the gaze", format!("{} spp", metric(readout.spp_at_gaze.into())), "Samples per film pixel at the gaze"),
        ("In all", metric(readout.samples as f64), "Samples in the film"),
        ("Elapsed", clock(readout.elapsed), "Since the film started"),
    ];
    Grid::new("figures").num_columns(2).min_col_width(80.0).spacing([8.0, 3.0]).show(ui, |ui| {
        for (name, value, explanation) in rows {
            ui.label(RichText::new(name).weak()).on_hover_text(explanation);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(RichText::new(value).monospace()));
            ui.end_row();
        }
    });
    if readout.non_finite_dropped > 0 {
        let text = format!("{} samples were not finite", readout.non_finite_dropped);
        ui.label(RichText::new(text).small().color(theme::notice(ui)));
    }
}

/// A threshold's state in a few letters.
fn progress(progress: Progress) -> String {
    match progress {
        Progress::Unknown | Progress::Left(None) => "not yet".into(),
        Progress::Left(Some(left)) => format!("in {}", clock(left)),
        Progress::Ready => "ready".into(),
    }
}

/// The film's values about the gaze.
fn pixel(ui: &mut Ui, facts: &Facts<'_>) {
    let block = &facts.readout.convergence.block;
    let [red, green, blue] = block.mean;
    let error = block.standard_error.map_or("-".to_owned(), |error| format!("{error:.3}"));
    let relative = block.error.map_or("-".to_owned(), |error| format!("{:.1} %", 100.0 * error));
    Grid::new("pixel").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
        for (name, value, explanation) in [
            ("Radiance", format!("{red:.3} {green:.3} {blue:.3}"), "Linear Rec. 709, mean of 7 x 7 film pixels"),
            ("Samples", format!("{:.1}", block.samples), "Of a film pixel"),
            ("Standard error", error, "Of a film pixel's luminance"),
            ("Error, at most", relative, "Relative, with 95 % confidence"),
        ] {
            ui.label(RichText::new(name).weak()).on_hover_text(explanation);
            ui.label(RichText::new(value).monospace());
            ui.end_row();
        }
    });
}

const DENOISE_HINT: &str =
    "Smooths noise by the surfaces that are seen, once the picture rests; the film stays as it is";

fn picture(ui: &mut Ui, controls: &mut Controls) {
    Grid::new("picture").num_columns(2).min_col_width(72.0).spacing([8.0, 5.0]).show(ui, |ui| {
        let label = ui.label(RichText::new("Exposure").weak());
        let slider = Slider::new(&mut controls.exposure_ev, EXPOSURE_EV).step_by(0.1).fixed_decimals(1).suffix(" EV");
        ui.spacing_mut().slider_width = 84.0;
        // What the command line asks for stays as it is until somebody changes it.
        ui.add(slider.clamping(SliderClamping::Edits)).labelled_by(label.id);
        ui.end_row();

        let label = ui.label(RichText::new("Tone map").weak());
        let name = TONE_MAPS.iter().find(|entry| entry.0 == controls.tone_map).map_or("", |entry| entry.1);
        let combo = ComboBox::from_id_salt("tone map").width(126.0).selected_text(name).show_ui(ui, |ui| {
            for (tone_map, name) in TONE_MAPS {
                ui.selectable_value(&mut controls.tone_map, tone_map, name);
            }
        });
        combo.response.labelled_by(label.id);
        ui.end_row();

        let label = ui.label(RichText::new("Denoise").weak()).on_hover_text(DENOISE_HINT);
        let hint = if controls.comparison.is_some() { "Not while two modes are compared" } else { DENOISE_HINT };
        ui.add_enabled_ui(controls.comparison.is_none(), |ui| {
            ui.checkbox(&mut controls.denoise, "")
                .labelled_by(label.id)
                .on_hover_text(hint)
                .on_disabled_hover_text(hint);
        });
        ui.end_row();

        seeing::rows(ui, controls);
    });
}

fn cameras(ui: &mut Ui, facts: &Facts<'_>, actions: &mut Vec<Action>) {
    let Some(current) = facts.cameras.get(facts.camera) else { return };
    ui.horizontal(|ui| {
        let label = ui.label(RichText::new("Camera").weak());
        let combo = ComboBox::from_id_salt("camera").width(166.0).truncate().selected_text(current).show_ui(ui, |ui| {
            for (index, name) in facts.cameras.iter().enumerate() {
                if ui.selectable_label(index == facts.camera, format!("{}  {name}", index + 1)).clicked() {
                    actions.push(Action::Camera(index));
                }
            }
        });
        combo.response.labelled_by(label.id);
    });
}

fn buttons(ui: &mut Ui, controls: &mut Controls, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        if ui.button(if controls.paused { "Resume" } else { "Pause" }).on_hover_text("Space").clicked() {
            controls.paused = !controls.paused;
        }
        for (name, hint, action) in [
            ("Restart", "Ctrl R: empties the film", Action::Restart),
            ("Save PNG", "Ctrl S: the picture as shown", Action::SavePng),
            ("Save EXR", "Ctrl Shift S: the whole film, linear", Action::SaveExr),
        ] {
            if ui.button(name).on_hover_text(hint).clicked() {
                actions.push(action);
            }
        }
    });
}

fn headset(ui: &mut Ui, headset: Option<&HeadsetReadout>, actions: &mut Vec<Action>) {
    let Some(headset) = headset else {
        let hint = "V: shows the panorama in a headset, by OpenXR";
        if ui.button("Enter VR").on_hover_text(hint).clicked() {
            actions.push(Action::EnterHeadset);
        }
        return;
    };
    ui.horizontal(|ui| {
        if ui.button("Leave VR").on_hover_text("V").clicked() {
            actions.push(Action::LeaveHeadset);
        }
        ui.add(egui::Label::new(&headset.words).truncate()).on_hover_text(&headset.runtime);
    });
    let age = headset.gaze_age.map(|age| format!(", {:.0} ms old", age.as_secs_f64() * 1e3)).unwrap_or_default();
    let lines = [
        headset.system.clone(),
        format!("Gaze: {}{age}", headset.gaze_from),
        format!("{} frames, {} missed", headset.frames, headset.missed),
    ];
    for line in lines {
        ui.add(egui::Label::new(RichText::new(line).small().weak()).truncate());
    }
}

fn sampling(ui: &mut Ui, facts: &Facts<'_>, controls: &mut Controls, visibility: &mut Visibility) {
    ui.add_enabled_ui(controls.mode == Mode::Fv, |ui| {
        let label = ui.label(RichText::new("Acuity model").weak());
        let model = &mut controls.acuity.model;
        let model_name = Model::LIST.iter().find(|entry| entry.0 == *model).map_or("", |entry| entry.1);
        let combo = ComboBox::from_id_salt("model").selected_text(model_name).show_ui(ui, |ui| {
            for (choice, name) in Model::LIST {
                ui.selectable_value(model, choice, name);
            }
        });
        combo.response.labelled_by(label.id);
        let mut clipped = controls.clip == Clip::View;
        ui.checkbox(&mut clipped, "95 % of the samples in the view");
        controls.clip = if clipped { Clip::View } else { Clip::None };
        let mut at_eye = controls.eccentricity == EccentricityAt::Eye;
        ui.checkbox(&mut at_eye, "Eccentricity at the eye").on_hover_text("Off: angles in the scene, as in a headset");
        controls.eccentricity = if at_eye { EccentricityAt::Eye } else { EccentricityAt::Scene };
    });
    ui.checkbox(&mut controls.adaptive, "Adaptive sampling")
        .on_hover_text("More samples to where the picture is visibly noisy; biases it slightly. Not in a headset");
    ui.checkbox(&mut visibility.ring, "Ring at the fovea");
    ui.checkbox(&mut visibility.eccentricity, "Rings of eccentricity").on_hover_text("Shift F: degrees from the gaze");
    Grid::new("screen").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
        let screen = &mut controls.screen;
        for (name, value, range) in [
            ("Screen width", &mut screen.width_mm, 100.0..=5000.0),
            ("Screen height", &mut screen.height_mm, 100.0..=5000.0),
            ("Distance", &mut screen.distance_mm, 100.0..=10_000.0),
        ] {
            let label = ui.label(RichText::new(name).weak());
            ui.add(DragValue::new(value).range(range).suffix(" mm").speed(1.0).max_decimals(0)).labelled_by(label.id);
            ui.end_row();
        }
        ui.label(RichText::new("One pixel").weak());
        ui.label(format!("{:.4} deg", facts.deg_per_px));
        ui.end_row();
    });
    ui.label(RichText::new(format!("Film {}, {}", facts.film, facts.schedule)).small().weak());
    ui.add(egui::Label::new(RichText::new(facts.adapter).small().weak()).truncate());
}

fn notes(ui: &mut Ui, notes: &[String]) {
    if notes.is_empty() {
        return;
    }
    let title = RichText::new(format!("Import notes ({})", notes.len())).color(theme::notice(ui));
    egui::CollapsingHeader::new(title).id_salt("notes").show(ui, |ui| {
        egui::ScrollArea::vertical().max_height(160.0).show(ui, |ui| {
            for note in notes {
                ui.label(RichText::new(note).small());
            }
        });
    });
}

/// Draws the list of keys, in the middle of the window.
pub fn keys(ctx: &Context) {
    Area::new(Id::unique("keys")).anchor(Align2::CENTER_CENTER, egui::Vec2::ZERO).order(Order::Foreground).show(
        ctx,
        |ui| {
            theme::panel().show(ui, |ui| {
                // Side by side: in one column they would be higher than a small window.
                ui.horizontal_top(|ui| {
                    ui.spacing_mut().item_spacing.x = 24.0;
                    for (column, keys) in KEYS.chunks(KEYS.len().div_ceil(2)).enumerate() {
                        Grid::new(("keys", column)).num_columns(2).spacing([14.0, 4.0]).show(ui, |ui| {
                            for (key, does) in keys {
                                ui.label(RichText::new(*key).monospace().color(theme::accent(ui)));
                                ui.label(*does);
                                ui.end_row();
                            }
                        });
                    }
                });
            });
        },
    );
}

/// Draws a message at the bottom: what is going on, or what went wrong.
pub fn message(ctx: &Context, text: &str, wrong: bool) {
    let area = Area::new(Id::unique("message")).anchor(Align2::CENTER_BOTTOM, egui::vec2(0.0, -14.0));
    area.order(Order::Foreground).interactable(false).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            // As wide as the text: an area wraps it at the width that it had last.
            ui.horizontal(|ui| {
                let text = RichText::new(text);
                ui.label(if wrong { text.color(theme::error(ui)) } else { text });
            });
        });
    });
}

/// What takes time, and how long it has taken so far. Nothing turns beside it: frames of an animation would take that time on a
/// CPU adapter.
pub fn under_way(what: &str, elapsed: Duration) -> String {
    format!("{what}, {}", clock(elapsed))
}

/// Draws what is being read, at the bottom; true when it is to be given up.
pub fn loading(ctx: &Context, name: &str, elapsed: Duration, can_cancel: bool) -> bool {
    let mut cancelled = false;
    let area = Area::new(Id::unique("loading")).anchor(Align2::CENTER_BOTTOM, egui::vec2(0.0, -14.0));
    area.order(Order::Foreground).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.label(under_way(&format!("loading {name}"), elapsed));
                cancelled = can_cancel && ui.button("Cancel").clicked();
            });
        });
    });
    cancelled
}

/// Draws at the top why the scene's files cannot be read as they are; the last good version is on screen.
pub fn broken(ctx: &Context, text: &str) {
    let area = Area::new(Id::unique("broken")).anchor(Align2::CENTER_TOP, egui::vec2(0.0, 10.0));
    area.order(Order::Foreground).interactable(false).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            ui.set_max_width(0.5 * ui.ctx().content_rect().width());
            ui.label(RichText::new(text).color(theme::error(ui)));
            ui.label(RichText::new("The last good version is shown; the file is watched.").small().weak());
        });
    });
}
