//! The panel about gaze, and the dots to look at.

use std::time::Instant;

use egui::{Align2, Area, Color32, ComboBox, Context, FontId, Id, Rect, RichText, Ui};

use super::gaze_control::{GazeControl, MmFrom};
use super::navigation::point_in_window;
use super::theme;
use crate::gaze::filter::Phase;
use crate::gaze::hub::timing::{TOO_OLD, TimingReport};
use crate::gaze::hub::{HubReport, SourceReport};
use crate::gaze::source::{Calibration, SourceState};
use crate::gaze::validation::Purpose;

/// Width of the panel, points.
const PANEL_WIDTH: f32 = 250.0;

/// Draws the panel at the window's right, so many points from where it is otherwise.
pub fn panel(ctx: &Context, gaze: &mut GazeControl, offset: f32, now: Instant) {
    let report = gaze.report(now);
    Area::new(Id::unique("gaze")).anchor(Align2::RIGHT_TOP, egui::vec2(-10.0 - offset, 10.0)).show(ctx, |ui| {
        theme::panel().show(ui, |ui| {
            ui.set_width(PANEL_WIDTH);
            ui.label(RichText::new("Gaze").heading());
            choice(ui, gaze, now);
            for (index, source) in report.sources.iter().enumerate() {
                line(ui, source);
                calibration(ui, gaze, index, source, now);
            }
            timing(ui, &report.timing, report.phase);
            let tracker = report.sources.iter().any(|source| source.is_eye);
            if tracker {
                ui.separator();
                setting_up(ui, gaze, now);
            }
            screen(ui, gaze, now);
            ui.separator();
            recording(ui, gaze, &report, now);
        });
    });
}

fn choice(ui: &mut Ui, gaze: &mut GazeControl, now: Instant) {
    ui.horizontal(|ui| {
        let label = ui.label(RichText::new("Source").weak());
        let mut chosen = gaze.chosen.clone();
        let combo = ComboBox::from_id_salt("gaze source").width(190.0).truncate().selected_text(chosen.to_string());
        let combo = combo.show_ui(ui, |ui| {
            for spec in &gaze.choices {
                ui.selectable_value(&mut chosen, spec.clone(), spec.to_string());
            }
        });
        combo.response.labelled_by(label.id);
        if chosen != gaze.chosen {
            gaze.choose(chosen, now);
        }
    });
}

fn line(ui: &mut Ui, source: &SourceReport) {
    let SourceReport { name, status, active, .. } = source;
    let colour = match status.state {
        _ if *active => theme::accent(ui),
        SourceState::Connected | SourceState::Searching => ui.visuals().weak_text_color(),
        SourceState::Stalled | SourceState::Lost(_) => theme::notice(ui),
        SourceState::Failed(_) => theme::error(ui),
    };
    let mark = if *active { ">" } else { "  " };
    ui.add(egui::Label::new(RichText::new(format!("{mark} {name}")).color(colour)).truncate());
    let mut text = status.state.to_string();
    if !status.detail.is_empty() {
        text = format!("{text}; {}", status.detail);
    }
    if status.dropped > 0 {
        text = format!("{text}; {} dropped", status.dropped);
    }
    ui.add(egui::Label::new(RichText::new(text).small().weak()).wrap());
}

fn calibration(ui: &mut Ui, gaze: &mut GazeControl, index: usize, source: &SourceReport, now: Instant) {
    if !source.name.starts_with("opengaze") {
        return;
    }
    let text = match &source.status.calibration {
        Calibration::None => None,
        Calibration::Running => Some("the tracker shows its points".to_owned()),
        Calibration::Done(summary) => {
            Some(format!("calibrated: {} points, mean error {:.0} pixels", summary.valid_points, summary.mean_error_px))
        }
        Calibration::Failed(why) => Some(format!("calibration failed: {why}")),
    };
    ui.horizontal(|ui| {
        let connected = source.status.state == SourceState::Connected;
        let idle = connected && source.status.calibration != Calibration::Running;
        if ui.add_enabled(idle, egui::Button::new("Calibrate")).on_hover_text("By the tracker's own points").clicked() {
            gaze.calibrate(index, now);
        }
        if let Some(text) = text {
            ui.add(egui::Label::new(RichText::new(text).small()).wrap());
        }
    });
}

fn timing(ui: &mut Ui, timing: &TimingReport, phase: Option<Phase>) {
    if let Some(age) = timing.age {
        let text = RichText::new(format!("Age on screen {:.0} ms", age.as_secs_f64() * 1e3)).small();
        let text = if timing.is_too_old() { text.color(theme::notice(ui)) } else { text };
        ui.label(text).on_hover_text("From the eye to the picture, median");
        if timing.is_too_old() {
            let warning = format!("above {} ms the fovea visibly trails the eye", TOO_OLD.as_millis());
            ui.label(RichText::new(warning).small().color(theme::notice(ui)));
        }
    }
    if let Some((median, _)) = timing.arrival_to_batch {
        let text = format!("Sample to batch {:.0} ms", median.as_secs_f64() * 1e3);
        ui.label(RichText::new(text).small().weak()).on_hover_text("From a sample's arrival to rays for it, median");
    }
    let word = match phase {
        Some(Phase::Fixation) => "fixation",
        Some(Phase::Saccade) => "saccade",
        Some(Phase::Blink) => "blink",
        Some(Phase::Lost) => "no eye",
        None => return,
    };
    ui.label(RichText::new(word).small().weak());
}

fn setting_up(ui: &mut Ui, gaze: &mut GazeControl, now: Instant) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        if ui.button("Look at the dot").on_hover_text("One-point drift correction").clicked() {
            gaze.start_dots(Purpose::Drift, now);
        }
        if ui.button("Nine dots").on_hover_text("Measures accuracy and precision").clicked() {
            gaze.start_dots(Purpose::Validation, now);
        }
        if ui.button("Undo").on_hover_text("Takes the drift correction back").clicked() {
            gaze.forget_drift(now);
        }
    });
    let [x, y] = gaze.profile().drift.offset_deg;
    let mut text = format!("Drift {x:.2}, {y:.2} deg");
    if let (Some(accuracy), Some(precision)) = (gaze.profile().accuracy_deg, gaze.profile().precision_deg) {
        text = format!("{text}; accuracy {accuracy:.2}, precision {precision:.2}");
    }
    ui.label(RichText::new(text).small().weak());
    if let Some(outcome) = &gaze.outcome {
        ui.add(egui::Label::new(RichText::new(outcome).small()).wrap());
    }
    if !gaze.position_known() {
        let text = "The system does not say where the window is: make it fill the screen (F11 of the desktop).";
        ui.add(egui::Label::new(RichText::new(text).small().color(theme::notice(ui))).wrap());
    }
}

fn screen(ui: &mut Ui, gaze: &mut GazeControl, now: Instant) {
    let text = match (gaze.screen_from.size, gaze.screen_from.distance) {
        (MmFrom::Guessed, MmFrom::Guessed) => "Screen size and distance are guesses.",
        (MmFrom::Guessed, _) => "The screen's size is a guess.",
        (MmFrom::Monitor, MmFrom::Guessed) => "Screen size from the monitor; the distance is a guess.",
        (_, MmFrom::Guessed) => "The distance is a guess.",
        _ => return,
    };
    ui.add(
        egui::Label::new(
            RichText::new(format!("{text} Set them under \"Sampling and screen\".")).small().color(theme::notice(ui)),
        )
        .wrap(),
    );
    if ui.small_button("They are right").clicked() {
        gaze.confirm_screen(now);
    }
}

fn recording(ui: &mut Ui, gaze: &mut GazeControl, report: &HubReport, now: Instant) {
    if let Some(rows) = report.recording {
        ui.label(RichText::new(format!("recording, {rows} rows")).color(theme::error(ui)));
        if ui.button("Stop").clicked() {
            gaze.stop_recording(now);
        }
        return;
    }
    let consent = "Whoever looks agrees that their gaze is written to a file on this computer. Gaze tells what somebody \
        is interested in, and sometimes who they are. Nothing is sent anywhere.";
    ui.checkbox(&mut gaze.consents, "Recording is agreed to").on_hover_text(consent);
    if gaze.consents {
        ui.add(egui::Label::new(RichText::new(consent).small().weak()).wrap());
    }
    if ui.add_enabled(gaze.consents, egui::Button::new("Record")).clicked() {
        gaze.start_recording(now);
    }
    if let Some(how) = &report.recorded {
        ui.add(egui::Label::new(RichText::new(how).small()).wrap());
    }
}

/// Covers the picture and shows the dot to look at, while a run of dots goes on.
pub fn dots(ui: &Ui, rect: Rect, gaze: &GazeControl, now: Instant) {
    let Some(run) = gaze.dots() else { return };
    let painter = ui.painter();
    painter.rect_filled(rect, 0.0, Color32::from_gray(26));
    let [x, y] = run.dot().map(|value| value as f32);
    let centre = point_in_window(rect, glam::Vec2::new(x, y));
    // A ring that closes in draws the eye to the dot's middle.
    let radius = 22.0 - 16.0 * run.fraction(now);
    painter.circle_stroke(centre, radius, egui::Stroke::new(1.5, theme::ACCENT));
    painter.circle_filled(centre, 5.0, Color32::WHITE);
    painter.circle_filled(centre, 1.5, Color32::BLACK);
    let (done, all) = run.progress();
    let text = match run.purpose {
        Purpose::Drift => "Look at the dot. Esc: stop".to_owned(),
        Purpose::Validation => format!("Look at each dot, {} of {all}. Esc: stop", done + 1),
    };
    let place = rect.center_bottom() - egui::vec2(0.0, 14.0);
    painter.text(place, Align2::CENTER_BOTTOM, text, FontId::proportional(12.5), Color32::from_gray(150));
}
