//! What the window does about gaze: the screen it is on, who sits before it, dots to look at, recording.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Context, Rect};
use serde_json::{Value, json};

use super::controls::Controls;
use super::gaze::Desktop;
use crate::cli::PreviewArgs;
use crate::gaze::geometry::WindowPlace;
use crate::gaze::hub::{GazeHub, HubReport, Target};
use crate::gaze::profile::{self, Profile, Profiles};
use crate::gaze::source::Calibration;
use crate::gaze::spec::SourceSpec;
use crate::gaze::validation::{Accuracy, DotRun, Outcome, Purpose};
use crate::output::free_name;
use crate::screen::ScreenGeometry;
use crate::view::View;

/// How often the window's place on the desktop is asked for.
const LOOK: Duration = Duration::from_millis(500);
/// How long a note stays.
const NOTE: Duration = Duration::from_secs(5);
/// How often the window is drawn for a tracker's gaze; tracing goes by every sample all the same.
const FOLLOW: Duration = Duration::from_millis(50);
/// Dots of a validation without which it says too little about the picture: the worst places are its corners.
const FEWEST_DOTS: usize = 7;
/// Changed millimetres are kept after they have rested so long.
const RESTED: Duration = Duration::from_secs(2);

/// Where millimetres come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MmFrom {
    /// The command line.
    Asked,
    /// What was set before, for this screen and person.
    Remembered,
    /// The monitor's own data.
    Monitor,
    /// Nobody has said.
    Guessed,
}

/// Where the screen's millimetres come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScreenFrom {
    /// Width and height.
    pub size: MmFrom,
    /// From the eye to the screen.
    pub distance: MmFrom,
}

/// Gaze as the window has it.
pub struct GazeControl {
    hub: Arc<GazeHub>,
    /// What can be chosen, in the panel's order.
    pub choices: Vec<SourceSpec>,
    /// The chosen one.
    pub chosen: SourceSpec,
    profiles: Profiles,
    person: String,
    profile: Profile,
    desktop: Option<Desktop>,
    looked: Option<Instant>,
    /// Where the screen's millimetres come from.
    pub screen_from: ScreenFrom,
    /// The screen as it is kept or was found, and since when it differs from what the panel has.
    kept_screen: Option<ScreenGeometry>,
    changed: Option<(ScreenGeometry, Instant)>,
    place: WindowPlace,
    dots: Option<DotRun>,
    /// What the last dots told, one line.
    pub outcome: Option<String>,
    /// Whether the person has agreed to be recorded.
    pub consents: bool,
    note: Option<(String, Instant)>,
}

impl GazeControl {
    /// For a hub whose sources the command line named.
    pub fn new(hub: Arc<GazeHub>, args: &PreviewArgs) -> Self {
        let (profiles, trouble) = Profiles::load();
        let named = args.gaze.sources.first().cloned().unwrap_or(SourceSpec::Mouse);
        let usual = [SourceSpec::Mouse, SourceSpec::MouseDwell].into_iter().chain(SourceSpec::usual_trackers());
        let mut choices = args.gaze.sources.clone();
        usual.for_each(|spec| {
            if !choices.contains(&spec) {
                choices.push(spec);
            }
        });
        let from = |is_asked| if is_asked { MmFrom::Asked } else { MmFrom::Guessed };
        let (size, distance) = (args.sampling.screen_mm.is_some(), args.sampling.distance_mm.is_some());
        Self {
            hub,
            choices,
            chosen: named,
            profiles,
            person: args.gaze.person.clone(),
            profile: Profile::default(),
            desktop: None,
            looked: None,
            screen_from: ScreenFrom { size: from(size), distance: from(distance) },
            kept_screen: None,
            changed: None,
            place: WindowPlace::default(),
            dots: None,
            outcome: None,
            consents: false,
            note: trouble.map(|text| (text, Instant::now())),
        }
    }

    /// Whether the panel is open from the start: when a tracker was asked for.
    pub fn is_worth_showing(&self) -> bool {
        !self.chosen.is_mouse()
    }

    /// Keeps up with the screen that the window is on; a new screen brings its millimetres and the person's drift.
    pub fn follow_screen(&mut self, frame: &eframe::Frame, controls: &mut Controls, now: Instant) {
        if self.looked.is_some_and(|at| now.saturating_duration_since(at) < LOOK) {
            return;
        }
        self.looked = Some(now);
        let Some(desktop) = Desktop::of(frame) else { return };
        let known = self.desktop.as_ref().is_some_and(|last| last.monitor_name == desktop.monitor_name);
        if !known {
            self.profile = self.profiles.get(&self.person, &desktop.monitor_name);
            self.hub.set_profile(self.profile);
            let size_px = desktop.monitor.size.map(|side| side as u32);
            (controls.screen, self.screen_from) =
                screen(&self.profile, profile::monitor_mm(size_px), (controls.screen, self.screen_from));
            self.kept_screen = Some(controls.screen);
        }
        self.desktop = Some(desktop);
    }

    /// Keeps millimetres that the person has set.
    pub fn remember_screen(&mut self, controls: &Controls, now: Instant) {
        if self.kept_screen.is_none_or(|kept| kept == controls.screen) {
            self.changed = None;
            return;
        }
        match self.changed {
            Some((screen, since)) if screen == controls.screen => {
                if now.saturating_duration_since(since) >= RESTED {
                    self.accept_screen(controls.screen, now);
                }
            }
            _ => self.changed = Some((controls.screen, now)),
        }
    }

    fn accept_screen(&mut self, screen: ScreenGeometry, now: Instant) {
        self.kept_screen = Some(screen);
        self.changed = None;
        self.screen_from = ScreenFrom { size: MmFrom::Remembered, distance: MmFrom::Remembered };
        self.keep(Profile { screen: Some(screen), ..self.profile }, now);
    }

    /// Says that the millimetres shown are right, so that they are not asked for again.
    pub fn confirm_screen(&mut self, now: Instant) {
        if let Some(screen) = self.kept_screen {
            self.accept_screen(screen, now);
        }
    }

    fn keep(&mut self, profile: Profile, now: Instant) {
        self.profile = profile;
        self.hub.set_profile(profile);
        let Some(desktop) = &self.desktop else { return };
        if let Err(error) = self.profiles.set(&self.person, &desktop.monitor_name, profile) {
            self.note = Some((format!("not kept: {error:#}"), now));
        }
    }

    /// Where the picture is.
    pub fn place(&self, ctx: &Context, rect: Rect, screen: ScreenGeometry) -> WindowPlace {
        match &self.desktop {
            Some(desktop) => desktop.place(rect, ctx.pixels_per_point(), screen),
            None => WindowPlace { screen, ..WindowPlace::default() },
        }
    }

    /// One frame of the window: tells the hub what is shown, and goes on with the dots. Where somebody looks.
    pub fn frame(&mut self, now: Instant, place: WindowPlace, view: View, pointer: Option<[f64; 2]>) -> Target {
        self.place = place;
        self.hub.frame(now, place, view, pointer);
        if let Some(mut dots) = self.dots.take() {
            let target_deg = place.deg_from_picture(dots.dot());
            let validates = dots.purpose == Purpose::Validation;
            let corrected = |deg| if validates { self.profile.drift.apply(deg) } else { deg };
            let seen: Vec<_> = self.hub.take_raw(now).into_iter().map(|(at, deg)| (at, corrected(deg))).collect();
            match dots.update(now, target_deg, &seen) {
                Some(outcome) => self.conclude(&outcome, now),
                None => self.dots = Some(dots),
            }
        }
        self.hub.target(now, &view)
    }

    fn conclude(&mut self, outcome: &Outcome, now: Instant) {
        let text = match outcome {
            Outcome::Drift(Ok(drift)) => {
                self.keep(Profile { drift: *drift, ..self.profile }, now);
                format!("drift of {:.2}, {:.2} degrees is taken off", drift.offset_deg[0], drift.offset_deg[1])
            }
            Outcome::Drift(Err(refused)) => format!("no correction: {refused}"),
            Outcome::Validation(result) if result.dots == 0 => "no valid gaze at any dot".into(),
            Outcome::Validation(result) if result.dots < FEWEST_DOTS => {
                let Accuracy { accuracy_deg, dots, .. } = result;
                format!("accuracy {accuracy_deg:.2} degrees at {dots} of 9 dots: not kept, which takes {FEWEST_DOTS}")
            }
            Outcome::Validation(result) => {
                let (accuracy_deg, precision_deg) = (Some(result.accuracy_deg), Some(result.precision_deg));
                self.keep(Profile { accuracy_deg, precision_deg, ..self.profile }, now);
                format!(
                    "accuracy {:.2} degrees (worst {:.2}), precision {:.2}, {} of 9 dots",
                    result.accuracy_deg, result.worst_deg, result.precision_deg, result.dots
                )
            }
        };
        self.outcome = Some(text);
    }

    /// Shows dots to look at.
    pub fn start_dots(&mut self, purpose: Purpose, now: Instant) {
        // What was looked at before does not count.
        self.hub.take_raw(now);
        self.dots = Some(DotRun::start(purpose, now));
    }

    /// Takes the dots away.
    pub fn stop_dots(&mut self) {
        self.dots = None;
    }

    /// Whether dots are shown.
    pub fn shows_dots(&self) -> bool {
        self.dots.is_some()
    }

    /// The dots that are shown.
    pub fn dots(&self) -> Option<&DotRun> {
        self.dots.as_ref()
    }

    /// Takes the correction back.
    pub fn forget_drift(&mut self, now: Instant) {
        self.keep(Profile { drift: crate::gaze::drift::DriftCorrection::default(), ..self.profile }, now);
    }

    /// What is known of the person before this screen.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Whether the window's place on the desktop is known.
    pub fn position_known(&self) -> bool {
        self.place.position_known
    }

    /// Uses a source from now on.
    pub fn choose(&mut self, spec: SourceSpec, now: Instant) {
        match self.hub.choose(std::slice::from_ref(&spec), now) {
            Ok(()) => self.chosen = spec,
            Err(error) => self.note = Some((format!("{error:#}"), now)),
        }
    }

    /// Asks a tracker to calibrate itself.
    pub fn calibrate(&mut self, index: usize, now: Instant) {
        if !self.hub.calibrate(index) {
            self.note = Some(("calibrate this tracker with its own program".into(), now));
        }
    }

    /// Begins a recording, into a new file of the working directory.
    pub fn start_recording(&mut self, now: Instant) {
        let path = free_name(Path::new(""), "gaze", "csv");
        let text = match self.consents.then(|| self.hub.record(&path)) {
            Some(Ok(())) => format!("recording gaze to {}", path.display()),
            Some(Err(error)) => format!("{error:#}"),
            None => "a recording needs the consent of whoever looks".into(),
        };
        self.note = Some((text, now));
    }

    /// Ends it.
    pub fn stop_recording(&mut self, now: Instant) {
        let text = self.hub.stop_recording().unwrap_or_else(|| "the recording had ended before".into());
        self.note = Some((text, now));
    }

    /// What the hub has to tell.
    pub fn report(&self, now: Instant) -> HubReport {
        self.hub.report(now)
    }

    /// The newest note, while it is new.
    pub fn note(&self, now: Instant) -> Option<String> {
        let notes = [self.note.clone(), self.hub.report(now).note];
        let newest = notes.into_iter().flatten().max_by_key(|(_, at)| *at);
        newest.filter(|(_, at)| now.saturating_duration_since(*at) < NOTE).map(|(text, _)| text)
    }

    /// Whether the window is to be drawn again soon for the gaze alone.
    pub fn wants_frames(&self) -> bool {
        self.shows_dots() || !self.chosen.is_mouse() || self.chosen == SourceSpec::MouseDwell
    }

    /// How soon.
    pub fn frame_interval(&self) -> Duration {
        if self.shows_dots() { Duration::from_millis(16) } else { FOLLOW }
    }

    /// Figures for a screenshot's report.
    pub fn figures(&self, now: Instant) -> Value {
        let report = self.hub.report(now);
        let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
        let sources = report.sources.iter().map(|source| {
            json!({
                "source": source.name,
                "state": source.status.state.to_string(),
                "active": source.active,
                "received": source.status.received,
                "dropped": source.status.dropped,
                "calibrated": matches!(source.status.calibration, Calibration::Done(_)),
            })
        });
        json!({
            "sources": sources.collect::<Vec<_>>(),
            "arrival_to_batch_ms": report.timing.arrival_to_batch.map(|(median, _)| ms(median)),
            "longest_arrival_to_batch_ms": report.timing.arrival_to_batch.map(|(_, longest)| ms(longest)),
            "longest_frame_ms": report.timing.longest_frame.map(ms),
            "age_ms": report.timing.age.map(ms),
            "recorded_rows": report.recording,
            "position_known": self.place.position_known,
        })
    }
}

/// Size and distance, each for itself: what the command line asks for, else what was kept, else what the monitor says, else
/// what is set already.
fn screen(
    profile: &Profile,
    monitor_mm: Option<[f32; 2]>,
    (set, from): (ScreenGeometry, ScreenFrom),
) -> (ScreenGeometry, ScreenFrom) {
    let set_mm = [set.width_mm, set.height_mm];
    let ([width_mm, height_mm], size) = match (from.size, profile.screen, monitor_mm) {
        (MmFrom::Asked, ..) => (set_mm, MmFrom::Asked),
        (_, Some(kept), _) => ([kept.width_mm, kept.height_mm], MmFrom::Remembered),
        (_, None, Some(mm)) => (mm, MmFrom::Monitor),
        (_, None, None) => (set_mm, MmFrom::Guessed),
    };
    let (distance_mm, distance) = match (from.distance, profile.screen) {
        (MmFrom::Asked, _) => (set.distance_mm, MmFrom::Asked),
        (_, Some(kept)) => (kept.distance_mm, MmFrom::Remembered),
        (_, None) => (set.distance_mm, MmFrom::Guessed),
    };
    (ScreenGeometry { width_mm, height_mm, distance_mm }, ScreenFrom { size, distance })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::ffi::OsString;

    use super::*;
    use crate::cli;

    /// A validation with a tracker that sees the eye until `secs`; the accuracy that is kept, and what is said.
    fn validated(name: &str, secs: f64) -> (Option<f64>, String) {
        let trace = std::env::temp_dir().join(format!("fovea-validated-{name}-{}.csv", std::process::id()));
        let rows = (0..60 * 60).map(|step| f64::from(step) / 60.0);
        let rows = rows.map(|time| format!("{time:.6},1,2,{}\n", u8::from(time < secs)));
        std::fs::write(&trace, format!("# gaze-trace v1; space=view_deg\n{}", rows.collect::<String>())).unwrap();
        let line = ["fovea".into(), "--gaze".into(), OsString::from(format!("trace:{}", trace.display()))];
        let args = cli::parse(line).unwrap().preview;
        let hub = Arc::new(GazeHub::new(&args.gaze.sources, None).unwrap());
        std::fs::remove_file(trace).unwrap();
        let mut control = GazeControl::new(hub, &args);
        control.profile = Profile { accuracy_deg: Some(0.5), ..Profile::default() };
        let view = View { yaw: 0.0, pitch: 0.0, tan_half: glam::Vec2::ONE };
        let start = Instant::now();
        control.start_dots(Purpose::Validation, start);
        for step in 1..60 * 60 {
            let now = start + Duration::from_micros(16_667) * step;
            control.frame(now, WindowPlace::default(), view, None);
            if !control.shows_dots() {
                return (control.profile.accuracy_deg, control.outcome.unwrap());
            }
        }
        panic!("the dots never end");
    }

    #[test]
    fn a_validation_of_few_dots_leaves_the_accuracy_as_it_was() {
        let (kept, said) = validated("one", 2.0);
        assert_eq!(kept, Some(0.5));
        assert!(said.contains("1 of 9 dots: not kept"), "{said}");
        let (kept, said) = validated("none", 0.0);
        assert_eq!((kept, said.as_str()), (Some(0.5), "no valid gaze at any dot"));
        let (kept, said) = validated("all", 60.0);
        assert!(kept.is_some_and(|kept| kept > 1.0) && said.contains("9 of 9 dots"), "{kept:?} {said}");
    }

    #[test]
    fn what_was_set_goes_before_what_the_monitor_says() {
        let set = ScreenGeometry::default();
        let kept = ScreenGeometry { width_mm: 600.0, height_mm: 340.0, distance_mm: 800.0 };
        let profile = Profile { screen: Some(kept), ..Profile::default() };
        let from = |size, distance| ScreenFrom { size, distance };
        let guessed = (set, from(MmFrom::Guessed, MmFrom::Guessed));
        let remembered = from(MmFrom::Remembered, MmFrom::Remembered);
        assert_eq!(screen(&profile, Some([1.0, 2.0]), guessed), (kept, remembered));
        let (found, known) = screen(&Profile::default(), Some([344.0, 194.0]), guessed);
        assert_eq!((found.width_mm, found.distance_mm), (344.0, set.distance_mm));
        assert_eq!(known, from(MmFrom::Monitor, MmFrom::Guessed));
        assert_eq!(screen(&Profile::default(), None, guessed), guessed);
    }

    #[test]
    fn the_command_line_asks_for_size_and_distance_apart() {
        let kept = ScreenGeometry { width_mm: 600.0, height_mm: 340.0, distance_mm: 800.0 };
        let profile = Profile { screen: Some(kept), ..Profile::default() };
        let asked = ScreenGeometry { width_mm: 300.0, height_mm: 200.0, distance_mm: 500.0 };
        let from = |size, distance| ScreenFrom { size, distance };
        let (found, known) = screen(&profile, None, (asked, from(MmFrom::Guessed, MmFrom::Asked)));
        assert_eq!(found, ScreenGeometry { distance_mm: 500.0, ..kept });
        assert_eq!(known, from(MmFrom::Remembered, MmFrom::Asked));
        let (found, known) = screen(&profile, Some([1.0, 2.0]), (asked, from(MmFrom::Asked, MmFrom::Guessed)));
        assert_eq!(found, ScreenGeometry { distance_mm: 800.0, ..asked });
        assert_eq!(known, from(MmFrom::Asked, MmFrom::Remembered));
        let both = (asked, from(MmFrom::Asked, MmFrom::Asked));
        assert_eq!(screen(&profile, Some([1.0, 2.0]), both), both);
    }
}
