//! The split times in the window: a panel to start a run, keys while it goes on, files when it is done.

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use egui::{Align2, Area, Context, DragValue, Id, Key, Modifiers, RichText, Ui};
use tracer::provenance::Provenance;

use super::controls::MODES;
use super::theme;
use crate::cli::choices::Mode;
use crate::output::{OutputError, free_names, write_text};
use crate::split_times::{After, Moment, Plan, Run};

/// How long until the window looks whether results are written.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// What a run asks of the window.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Show this mode from an empty film.
    Show(Mode),
    /// Tell this; true when something went wrong.
    Tell(String, bool),
}

/// The panel and the run that goes on.
pub struct SplitTimes {
    /// The next run's plan.
    pub plan: Plan,
    run: Option<Run>,
    /// When the film of the present trial was emptied.
    started: Option<Instant>,
    /// The last run's medians.
    summary: Vec<String>,
    /// The last run's results on their way to their files.
    writing: Option<JoinHandle<Action>>,
}

impl Drop for SplitTimes {
    /// A window that closes waits for the results: nobody can repeat them.
    fn drop(&mut self) {
        if let Some(writing) = self.writing.take() {
            // A panic of the thread has been reported by the panic hook.
            let _ = writing.join();
        }
    }
}

impl Default for SplitTimes {
    fn default() -> Self {
        let plan =
            Plan { modes: MODES.map(|entry| entry.0).to_vec(), repetitions: 3, blind: true, object: String::new() };
        Self { plan, run: None, started: None, summary: Vec::new(), writing: None }
    }
}

impl SplitTimes {
    /// Whether a run goes on whose mode the person must not see.
    pub fn hides_mode(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.plan().blind)
    }

    /// Draws the panel's part; `selected` names what is selected in the scene.
    pub fn show(&mut self, ui: &mut Ui, selected: &str, now: Instant) -> Option<Action> {
        for (mode, name, hint) in MODES {
            let mut wanted = self.plan.modes.contains(&mode);
            if ui.checkbox(&mut wanted, format!("Compare {name}")).on_hover_text(hint).changed() {
                self.plan.modes.retain(|other| *other != mode);
                if wanted {
                    self.plan.modes.push(mode);
                }
            }
        }
        ui.horizontal(|ui| {
            let label = ui.label(RichText::new("Times each").weak());
            ui.add(DragValue::new(&mut self.plan.repetitions).range(1..=50)).labelled_by(label.id);
            ui.checkbox(&mut self.plan.blind, "Blind").on_hover_text("The person does not see which mode it is");
        });
        let started = ui.add_enabled(!self.plan.modes.is_empty(), egui::Button::new("Start split times"));
        let hint = "Looks at what is selected: O when its outline is visible, P when its material is; Esc ends the run";
        for line in &self.summary {
            ui.label(RichText::new(line).small());
        }
        if !started.on_hover_text(hint).clicked() {
            return None;
        }
        selected.clone_into(&mut self.plan.object);
        let seed = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(1, |time| time.as_nanos() as u64);
        self.start(seed, now)
    }

    /// Starts a run.
    pub fn start(&mut self, seed: u64, now: Instant) -> Option<Action> {
        self.run = Run::new(self.plan.clone(), seed);
        self.started = Some(now);
        self.run.as_ref()?.mode().map(Action::Show)
    }

    /// Whether a run goes on.
    pub fn is_running(&self) -> bool {
        self.run.is_some()
    }

    /// Ends the run without results.
    pub fn stop(&mut self) {
        self.run = None;
    }

    /// Tells that results have been written, or why not.
    pub fn written(&mut self, ctx: &Context) -> Option<Action> {
        if self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            ctx.request_repaint_after(LOOK_AGAIN);
            return None;
        }
        // As when the window closes.
        self.writing.take()?.join().ok()
    }

    /// Takes the run's keys. `samples` and `gaze_deg` are those of this moment.
    pub fn keys(&mut self, ctx: &Context, now: Instant, moment: (u64, [f64; 2]), scene: &Scene<'_>) -> Vec<Action> {
        let Some(run) = &mut self.run else { return Vec::new() };
        // Letters of a text are no answers.
        if ctx.egui_wants_keyboard_input() {
            return Vec::new();
        }
        let pressed = |key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        let elapsed = self.started.map_or(Duration::ZERO, |started| now.saturating_duration_since(started));
        let moment = Moment { elapsed, samples: moment.0, gaze_deg: moment.1 };
        if pressed(Key::O) {
            run.outline(moment);
        }
        if !pressed(Key::P) {
            return Vec::new();
        }
        match run.material(moment) {
            After::Nothing | After::Kept => Vec::new(),
            After::NextTrial => {
                self.started = Some(now);
                run.mode().map(Action::Show).into_iter().collect()
            }
            After::Done => self.finish(scene),
        }
    }

    fn finish(&mut self, scene: &Scene<'_>) -> Vec<Action> {
        let Some(run) = self.run.take() else { return Vec::new() };
        let short = |mode| MODES.iter().find(|entry| entry.0 == mode).map_or("", |entry| entry.1);
        let line = |(mode, count, outline, material)| {
            format!("{}: outline {outline:.1} s, material {material:.1} s ({count})", short(mode))
        };
        self.summary = run.medians().into_iter().map(line).collect();
        let [name, adapter] = [scene.name, scene.adapter].map(ToOwned::to_owned);
        let folder = scene.folder.to_owned();
        let spawned = std::thread::Builder::new().name("write split times".into()).spawn(move || {
            let names = free_names(&folder, "split-times", ["csv", "svg"]);
            match write(&names, &[run.csv(&name, &Provenance::without_gpu(&adapter)), run.svg()]) {
                Ok(()) => Action::Tell(format!("{} and its .svg", names[0].display()), false),
                Err(error) => Action::Tell(error.to_string(), true),
            }
        });
        match spawned {
            Ok(writing) => {
                self.writing = Some(writing);
                Vec::new()
            }
            Err(error) => vec![Action::Tell(format!("split times are not written: {error}"), true)],
        }
    }

    /// Says what is waited for, at the top of the window.
    pub fn banner(&self, ctx: &Context) {
        let Some(run) = &self.run else { return };
        let (trial, all) = run.progress();
        let wanted = if run.waits_for_outline() { "O: the outline is visible" } else { "P: the material is visible" };
        let area = Area::new(Id::unique("split times")).anchor(Align2::CENTER_TOP, egui::vec2(0.0, 10.0));
        area.order(egui::Order::Foreground).interactable(false).show(ctx, |ui| {
            theme::panel().show(ui, |ui| {
                let object = &run.plan().object;
                let object = if object.is_empty() { String::new() } else { format!("Look at {object}.  ") };
                ui.label(RichText::new(format!("{object}{wanted}")).color(theme::accent(ui)));
                ui.label(RichText::new(format!("{trial} of {all}; Esc ends the run")).small().weak());
            });
        });
    }
}

fn write(names: &[PathBuf; 2], texts: &[String; 2]) -> Result<(), OutputError> {
    names.iter().zip(texts).try_for_each(|(path, text)| write_text(path, text))
}

/// What stands in the results.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The scene's name.
    pub name: &'a str,
    /// The adapter's.
    pub adapter: &'a str,
    /// Where the results go.
    pub folder: &'a Path,
}
