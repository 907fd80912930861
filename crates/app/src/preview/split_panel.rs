//! The split times in the window: a panel to start a run, keys while it goes on, files when it ends.

use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use egui::{Align2, Area, Context, DragValue, Id, Key, Modifiers, RichText, Ui, Vec2};
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

/// A run with what it is measured on.
#[derive(Clone, Debug)]
struct Measured {
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
    measured: Option<Measured>,
    /// When the film of the present trial was emptied.
    started: Option<Instant>,
    /// Trials that were shown, of all runs.
    shown: u64,
    /// The picture's size, points.
    size: Option<Vec2>,
    /// The last run's medians.
    summary: Vec<String>,
    /// Runs whose results are on their way to their files, and those that could be written nowhere.
    writing: Option<JoinHandle<(Message, Vec<Measured>)>>,
    unwritten: Vec<Measured>,
}

impl Drop for SplitTimes {
    /// A window that closes waits for the results: nobody can repeat them.
    fn drop(&mut self) {
        self.end();
        // A panic of the thread has been reported by the panic hook.
        if let Some(Ok((_, left))) = self.writing.take().map(JoinHandle::join) {
            self.unwritten.extend(left);
        }
        if !self.unwritten.is_empty() {
            let (told, _) = write_all(&self.folders, std::mem::take(&mut self.unwritten));
            eprintln!("{}", told.text);
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
            measured: None,
            started: None,
            shown: 0,
            size: None,
            summary: Vec::new(),
            writing: None,
            unwritten: Vec::new(),
        }
    }
}

impl SplitTimes {
    /// Whether a run goes on whose mode the person must not see.
    pub fn hides_mode(&self) -> bool {
        self.run().is_some_and(|run| run.plan().blind)
    }

    /// What the picture is to show: while a run goes on the mode of its trial alone, whatever else is set.
    pub fn controls(&self, set: &Controls) -> Controls {
        match self.run().and_then(Run::mode) {
            Some(mode) => Controls { mode, comparison: None, paused: false, trial: Some(self.shown), ..set.clone() },
            None => set.clone(),
        }
    }

    fn run(&self) -> Option<&Run> {
        self.measured.as_ref().map(|measured| &measured.run)
    }

    /// Draws the panel's part; `selected` names what is selected in the scene.
    pub fn show(&mut self, ui: &mut Ui, selected: &str, scene: &Scene<'_>, now: Instant) -> Option<Message> {
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
        let hint = "Looks at what is selected: O when its outline is visible, P when its material is; Esc ends the run and keeps \
                    the trials that are done";
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
        self.start(seed, scene, now)
    }

    /// Starts a run, unless its results could be written nowhere; what there is to tell.
    pub fn start(&mut self, seed: u64, scene: &Scene<'_>, now: Instant) -> Option<Message> {
        let told = match somewhere(&self.folders, |[csv, _]| check_writable(csv)) {
            (None, error) => return Some(Message::now(format!("no split times: {}", reason(error)), true)),
            (Some(_), None) => None,
            (Some([csv, _]), error) => Some(format!("{}; split times will be {}", reason(error), csv.display())),
        };
        let [scene, adapter] = [scene.name, scene.adapter].map(ToOwned::to_owned);
        self.measured = Run::new(self.plan.clone(), seed).map(|run| Measured { run, scene, adapter });
        self.begin_trial(now);
        told.map(|text| Message::now(text, true))
    }

    fn begin_trial(&mut self, now: Instant) {
        self.started = Some(now);
        self.shown += 1;
    }

    /// Whether a run goes on.
    pub fn is_running(&self) -> bool {
        self.measured.is_some()
    }

    /// The film was lost or replaced: the present trial begins again.
    pub fn begin_trial_again(&mut self, now: Instant) {
        if let Some(measured) = &mut self.measured {
            measured.run.begin_trial_again();
            self.begin_trial(now);
        }
    }

    /// Says how large the picture is, in points; one of another size may be of another film.
    pub fn follow_size(&mut self, size: Vec2, now: Instant) {
        if self.size.replace(size).is_some_and(|before| before != size) {
            self.begin_trial_again(now);
        }
    }

    /// Ends the run; the trials that are done are its results.
    pub fn stop(&mut self) -> Option<Message> {
        // Results that are being written come back before others go.
        if self.end() && self.writing.is_none() { self.write() } else { None }
    }

    /// The same without writing anything; whether there are results.
    fn end(&mut self) -> bool {
        let Some(measured) = self.measured.take().filter(|measured| !measured.run.trials().is_empty()) else {
            return false;
        };
        let line = |(mode, count, outline, material)| {
            format!("{}: outline {outline:.1} s, material {material:.1} s ({count})", name(mode))
        };
        self.summary = measured.run.medians().into_iter().map(line).collect();
        self.unwritten.push(measured);
        true
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
    pub fn keys(&mut self, ctx: &Context, now: Instant, moment: (u64, [f64; 2])) -> Option<Message> {
        let Measured { run, .. } = self.measured.as_mut()?;
        // Letters of a text are no answers.
        if ctx.egui_wants_keyboard_input() {
            return None;
        }
        let pressed = |key| ctx.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        if pressed(Key::Escape) {
            return self.stop();
        }
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
                self.begin_trial(now);
                None
            }
            After::Done => self.stop(),
        }
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
        let Some(run) = self.run() else { return };
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
fn write_all(folders: &[PathBuf], runs: Vec<Measured>) -> (Message, Vec<Measured>) {
    let (mut told, mut wrong, mut left) = (Vec::new(), false, Vec::new());
    for measured in runs {
        let Measured { run, scene, adapter } = &measured;
        let texts = [run.csv(scene, &Provenance::without_gpu(adapter)), run.svg()];
        let (names, error) = somewhere(folders, |names| write(names, &texts));
        wrong |= error.is_some();
        let elsewhere = error.map(|error| format!("{error}; ")).unwrap_or_default();
        match names {
            Some([csv, _]) => told.push(format!("{elsewhere}{} and its .svg", csv.display())),
            None => {
                told.push(format!("{elsewhere}the results are kept until they can be written (Split times)"));
                left.push(measured);
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
