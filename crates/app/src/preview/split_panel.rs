//! The split times in the window: a panel to start a run, keys while it goes on, files when it is done.

use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use egui::{Align2, Area, Context, DragValue, Id, Key, Modifiers, RichText, Ui};
use tracer::provenance::Provenance;

use super::controls::{Controls, MODES};
use super::engine::Message;
use super::theme;
use crate::cli::choices::Mode;
use crate::config;
use crate::output::{OutputError, check_writable, free_names, write_text};
use crate::split_times::{After, Moment, Plan, Run};

/// How long until the window looks whether results are written.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// A run that is done.
#[derive(Clone, Debug)]
struct Finished {
    run: Run,
    scene: String,
    adapter: String,
}

/// The panel and the run that goes on.
pub struct SplitTimes {
    /// The next run's plan.
    pub plan: Plan,
    /// Where results go: the first that can be written counts.
    pub folders: Vec<PathBuf>,
    run: Option<Run>,
    /// When the film of the present trial was emptied.
    started: Option<Instant>,
    /// Trials that were shown, of all runs.
    shown: u64,
    /// The last run's medians.
    summary: Vec<String>,
    /// Runs whose results are on their way to their files, and those that could be written nowhere.
    writing: Option<JoinHandle<(Message, Vec<Finished>)>>,
    unwritten: Vec<Finished>,
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
        let folders = [Some(PathBuf::new()), config::folder(), Some(std::env::temp_dir())];
        Self {
            plan,
            folders: folders.into_iter().flatten().collect(),
            run: None,
            started: None,
            shown: 0,
            summary: Vec::new(),
            writing: None,
            unwritten: Vec::new(),
        }
    }
}

impl SplitTimes {
    /// Whether a run goes on whose mode the person must not see.
    pub fn hides_mode(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.plan().blind)
    }

    /// What the picture is to show: while a run goes on the mode of its trial alone, whatever else is set.
    pub fn controls(&self, set: &Controls) -> Controls {
        match self.run.as_ref().and_then(Run::mode) {
            Some(mode) => Controls { mode, comparison: None, paused: false, trial: Some(self.shown), ..set.clone() },
            None => set.clone(),
        }
    }

    /// Draws the panel's part; `selected` names what is selected in the scene.
    pub fn show(&mut self, ui: &mut Ui, selected: &str, now: Instant) -> Option<Message> {
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
        if self.writing.is_none() && !self.unwritten.is_empty() && ui.button("Write results again").clicked() {
            return self.write();
        }
        if !started.on_hover_text(hint).clicked() {
            return None;
        }
        selected.clone_into(&mut self.plan.object);
        let seed = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(1, |time| time.as_nanos() as u64);
        self.start(seed, now)
    }

    /// Starts a run, unless its results could be written nowhere; what there is to tell.
    pub fn start(&mut self, seed: u64, now: Instant) -> Option<Message> {
        let told = match somewhere(&self.folders, |[csv, _]| check_writable(csv)) {
            (None, error) => return Some(Message::now(format!("no split times: {}", reason(error)), true)),
            (Some(_), None) => None,
            (Some([csv, _]), error) => Some(format!("{}; split times will be {}", reason(error), csv.display())),
        };
        self.run = Run::new(self.plan.clone(), seed);
        self.started = Some(now);
        self.shown += 1;
        told.map(|text| Message::now(text, true))
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
    pub fn written(&mut self, ctx: &Context) -> Option<Message> {
        if self.writing.as_ref().is_some_and(|writing| !writing.is_finished()) {
            ctx.request_repaint_after(LOOK_AGAIN);
            return None;
        }
        // As when the window closes.
        let (told, left) = self.writing.take()?.join().ok()?;
        // A run may have ended meanwhile.
        let told = if self.unwritten.is_empty() { told } else { self.write().unwrap_or(told) };
        self.unwritten.extend(left);
        Some(told)
    }

    /// Takes the run's keys. `samples` and `gaze_deg` are those of this moment.
    pub fn keys(&mut self, ctx: &Context, now: Instant, moment: (u64, [f64; 2]), scene: &Scene<'_>) -> Option<Message> {
        let run = self.run.as_mut()?;
        // Letters of a text are no answers.
        if ctx.egui_wants_keyboard_input() {
            return None;
        }
        let pressed = |key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        let elapsed = self.started.map_or(Duration::ZERO, |started| now.saturating_duration_since(started));
        let moment = Moment { elapsed, samples: moment.0, gaze_deg: moment.1 };
        if pressed(Key::O) {
            run.outline(moment);
        }
        if !pressed(Key::P) {
            return None;
        }
        match run.material(moment) {
            After::Nothing | After::Kept => None,
            After::NextTrial => {
                self.started = Some(now);
                self.shown += 1;
                None
            }
            After::Done => self.finish(scene),
        }
    }

    fn finish(&mut self, scene: &Scene<'_>) -> Option<Message> {
        let run = self.run.take()?;
        let line = |(mode, count, outline, material)| {
            format!("{}: outline {outline:.1} s, material {material:.1} s ({count})", name(mode))
        };
        self.summary = run.medians().into_iter().map(line).collect();
        let [scene, adapter] = [scene.name, scene.adapter].map(ToOwned::to_owned);
        self.unwritten.push(Finished { run, scene, adapter });
        // Results that are being written come back before others go.
        if self.writing.is_some() { None } else { self.write() }
    }

    /// Writes the results of all runs that are not written yet; why that cannot begin.
    fn write(&mut self) -> Option<Message> {
        let (folders, runs) = (self.folders.clone(), self.unwritten.clone());
        let thread = std::thread::Builder::new().name("write split times".into());
        match thread.spawn(move || write_all(&folders, runs)) {
            Ok(writing) => {
                self.writing = Some(writing);
                self.unwritten.clear();
                None
            }
            Err(error) => Some(Message::now(format!("split times are not written: {error}"), true)),
        }
    }

    /// Says what is waited for, at the top of the window.
    pub fn banner(&self, ctx: &Context) {
        let Some(run) = &self.run else { return };
        let (trial, all) = run.progress();
        let mode = run.mode().filter(|_| !run.plan().blind).map_or("", name);
        let wanted = if run.waits_for_outline() { "O: the outline is visible" } else { "P: the material is visible" };
        let area = Area::new(Id::unique("split times")).anchor(Align2::CENTER_TOP, egui::vec2(0.0, 10.0));
        area.order(egui::Order::Foreground).interactable(false).show(ctx, |ui| {
            theme::panel().show(ui, |ui| {
                let object = &run.plan().object;
                let object = if object.is_empty() { String::new() } else { format!("Look at {object}.  ") };
                ui.label(RichText::new(format!("{object}{wanted}")).color(theme::accent(ui)));
                let mode = if mode.is_empty() { String::new() } else { format!("{mode}, ") };
                ui.label(RichText::new(format!("{mode}{trial} of {all}; Esc ends the run")).small().weak());
            });
        });
    }
}

fn name(mode: Mode) -> &'static str {
    MODES.iter().find(|entry| entry.0 == mode).map_or("", |entry| entry.1)
}

/// Does something with names in the first folder where that can be done; these names, and why not in a folder before.
fn somewhere(
    folders: &[PathBuf],
    mut put: impl FnMut(&[PathBuf; 2]) -> Result<(), OutputError>,
) -> (Option<[PathBuf; 2]>, Option<OutputError>) {
    let mut trouble = None;
    for folder in folders {
        let names = free_names(folder, "split-times", ["csv", "svg"]);
        match put(&names) {
            Ok(()) => return (Some(names), trouble),
            Err(error) => trouble = trouble.or(Some(error)),
        }
    }
    (None, trouble)
}

fn reason(error: Option<OutputError>) -> String {
    error.map(|error| error.to_string()).unwrap_or_default()
}

/// Writes results where that can be done; what there is to tell, and the runs whose results could be written nowhere.
fn write_all(folders: &[PathBuf], runs: Vec<Finished>) -> (Message, Vec<Finished>) {
    let (mut told, mut wrong, mut left) = (Vec::new(), false, Vec::new());
    for finished in runs {
        let Finished { run, scene, adapter } = &finished;
        let texts = [run.csv(scene, &Provenance::without_gpu(adapter)), run.svg()];
        let (names, error) = somewhere(folders, |names| write(names, &texts));
        wrong |= error.is_some();
        let elsewhere = error.map(|error| format!("{error}; ")).unwrap_or_default();
        match names {
            Some([csv, _]) => told.push(format!("{elsewhere}{} and its .svg", csv.display())),
            None => {
                told.push(format!("{elsewhere}the results are kept until they can be written (Split times)"));
                left.push(finished);
            }
        }
    }
    (Message::now(told.join("; "), wrong), left)
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
}
