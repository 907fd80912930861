//! Where somebody looks now: sources in order of preference, fallback, drift, filter, and the view at the sample's time.
//!
//! Window and tracing thread share a [`GazeHub`]. Every call takes the time, so that tests need no clock.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::{Vec2, Vec3};

use super::filter::{FilterSettings, Filtered, GazeFilter, LOST_SECS, Phase};
use super::geometry::{ViewHistory, WindowPlace};
use super::parse::trace::Header;
use super::profile::Profile;
use super::recorder::Recorder;
use super::sample::{GazeSample, Point};
use super::source::{GazeSource, SourceStatus};
use super::spec::SourceSpec;
use crate::view::View;
use timing::Timing;

pub mod timing;

/// A source that comes back must deliver for so long before it is preferred again, so that gaze does not flap.
const BACK_FOR_GOOD: Duration = Duration::from_millis(200);
/// Samples kept for dots that somebody looks at.
const MAX_RAW: usize = 8192;
/// What trackers are taken to be off by until somebody states or measures it, degrees.
pub const USUAL_ACCURACY_DEG: f64 = 1.0;
/// Accuracy is rounded to this, so that the sampler is not fitted anew for every hundredth of a degree.
const ACCURACY_STEP_DEG: f64 = 0.1;

/// Where somebody looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// A point of the view: +-1 at the edges, y up.
    pub point: Vec2,
    /// The sample behind it; `None` before the first one.
    pub sample: Option<SampleTimes>,
    /// How far off the tracker may be, degrees; 0 when only a pointer is asked for.
    pub accuracy_deg: f64,
}

/// When the sample behind a target was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleTimes {
    /// When the eye was there.
    pub captured: Instant,
    /// When the sample came.
    pub arrived: Instant,
    /// Whether it is that of an eye.
    pub is_eye: bool,
}

/// One source in the list.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceReport {
    /// As it was named.
    pub name: String,
    /// What it says about itself.
    pub status: SourceStatus,
    /// Whether it is the gaze now.
    pub active: bool,
    /// Whether it is an eye's.
    pub is_eye: bool,
}

/// What the window shows about gaze.
#[derive(Clone, Debug, PartialEq)]
pub struct HubReport {
    /// In order of preference.
    pub sources: Vec<SourceReport>,
    /// What changed last, such as a fallback, and when.
    pub note: Option<(String, Instant)>,
    /// What the eye does; `None` for a pointer.
    pub phase: Option<Phase>,
    /// Times from eye to picture.
    pub timing: timing::TimingReport,
    /// Rows of the running recording.
    pub recording: Option<u64>,
    /// How the last recording ended.
    pub recorded: Option<String>,
}

struct Entry {
    spec: SourceSpec,
    source: Box<dyn GazeSource>,
    last_valid: Option<Instant>,
    /// Since when valid samples have come without a long gap.
    valid_since: Option<Instant>,
    last_sample: Option<Instant>,
    /// Smoothed time between samples, seconds.
    interval_secs: f64,
}

impl Entry {
    fn open(spec: SourceSpec) -> anyhow::Result<Self> {
        let source = spec.open()?;
        Ok(Self { spec, source, last_valid: None, valid_since: None, last_sample: None, interval_secs: 0.0 })
    }

    /// Longer for trackers slower than 5 Hz.
    fn patience(&self) -> Duration {
        Duration::from_secs_f64(LOST_SECS.max(2.5 * self.interval_secs).min(10.0))
    }

    fn take(&mut self, sample: &GazeSample) {
        if let Some(last) = self.last_sample {
            let interval = sample.captured.saturating_duration_since(last).as_secs_f64().min(10.0);
            self.interval_secs += 0.1 * (interval - self.interval_secs);
        }
        self.last_sample = Some(sample.captured);
        if sample.valid {
            let gap =
                self.last_valid.is_none_or(|last| sample.captured.saturating_duration_since(last) > self.patience());
            if gap {
                self.valid_since = Some(sample.captured);
            }
            self.last_valid = Some(sample.captured);
        }
    }

    /// Whether gaze can be had from here. One that is not active yet must have delivered for a while.
    fn usable(&self, now: Instant, active: bool) -> bool {
        if !self.source.is_eye() {
            return true;
        }
        let (Some(last), Some(since)) = (self.last_valid, self.valid_since) else { return false };
        let fresh = now.saturating_duration_since(last) <= self.patience();
        fresh && (active || last.saturating_duration_since(since) >= BACK_FOR_GOOD)
    }
}

struct Live {
    /// In film space.
    direction: Vec3,
    times: SampleTimes,
}

struct Hub {
    entries: Vec<Entry>,
    active: usize,
    note: Option<(String, Instant)>,
    filter: GazeFilter,
    /// Start of the filter's clock.
    epoch: Instant,
    phase: Option<Phase>,
    place: WindowPlace,
    views: ViewHistory,
    profile: Profile,
    stated_accuracy_deg: Option<f64>,
    live: Option<Live>,
    raw: VecDeque<(Instant, [f64; 2])>,
    /// The source's place in the list, and its recording.
    recording: Option<(usize, Recorder)>,
    /// How the last recording ended.
    recorded: Option<String>,
    timing: Timing,
}

/// The gaze, for whoever wants it.
pub struct GazeHub(Mutex<Hub>);

impl GazeHub {
    /// Opens sources in order of preference; the pointer comes last unless it is named. `accuracy_deg` is what the tracker
    /// is stated to be off by.
    ///
    /// # Errors
    /// A recording that cannot be read.
    pub fn new(specs: &[SourceSpec], accuracy_deg: Option<f64>) -> anyhow::Result<Self> {
        let now = Instant::now();
        Ok(Self(Mutex::new(Hub {
            entries: open_all(specs)?,
            active: 0,
            note: None,
            filter: GazeFilter::new(FilterSettings::default()),
            epoch: now,
            phase: None,
            place: WindowPlace::default(),
            views: ViewHistory::default(),
            profile: Profile::default(),
            stated_accuracy_deg: accuracy_deg,
            live: None,
            raw: VecDeque::new(),
            recording: None,
            recorded: None,
            timing: Timing::default(),
        })))
    }

    /// Plain data, valid whether or not another holder panicked.
    fn lock(&self) -> MutexGuard<'_, Hub> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Uses other sources from now on; a recording ends.
    ///
    /// # Errors
    /// A recording that cannot be read; the sources are then as they were.
    pub fn choose(&self, specs: &[SourceSpec], now: Instant) -> anyhow::Result<()> {
        let mut hub = self.lock();
        let mut wanted = Vec::new();
        for spec in with_pointer(specs) {
            // A source that stays keeps its connection.
            match hub.entries.iter().position(|entry| entry.spec == spec) {
                Some(known) => wanted.push(Ok(known)),
                None => wanted.push(Err(Entry::open(spec)?)),
            }
        }
        // A trace is of one source: another has another clock.
        let ended = hub.end_recording().map(|how| format!("; the recording has ended: {how}")).unwrap_or_default();
        let mut old: Vec<Option<Entry>> = std::mem::take(&mut hub.entries).into_iter().map(Some).collect();
        for entry in wanted {
            hub.entries.extend(entry.map_or_else(Some, |known| old.get_mut(known).and_then(Option::take)));
        }
        let last = hub.entries.len().saturating_sub(1);
        hub.active = last;
        hub.restart_filter();
        hub.note = Some((format!("gaze: {}{ended}", hub.name(0)), now));
        Ok(())
    }

    /// What is preferred, in order.
    pub fn specs(&self) -> Vec<SourceSpec> {
        self.lock().entries.iter().map(|entry| entry.spec.clone()).collect()
    }

    /// Says what the window shows from now on, and where the pointer is over it.
    pub fn frame(&self, now: Instant, place: WindowPlace, view: View, pointer: Option<[f64; 2]>) {
        let mut hub = self.lock();
        hub.place = place;
        hub.views.push(now, view);
        if let Some(point) = pointer {
            hub.entries.iter_mut().for_each(|entry| entry.source.pointer(point, now));
        }
    }

    /// Where somebody looks, in a view.
    pub fn target(&self, now: Instant, view: &View) -> Target {
        let mut hub = self.lock();
        hub.update(now);
        hub.target(view)
    }

    /// Says that a batch begins now, in a frame that began at `frame`, whose samples go where this one looked; `None` when they
    /// go by no sample.
    pub fn batch(&self, frame: Instant, now: Instant, sample: Option<SampleTimes>) {
        self.lock().timing.batch(frame, now, sample);
    }

    /// Says that a frame goes by without a batch.
    pub fn rests(&self) {
        self.lock().timing.rests();
    }

    /// Says that a picture with samples of a batch is on its way to the screen.
    pub fn shown(&self, now: Instant, sample: Option<SampleTimes>) {
        self.lock().timing.shown(now, sample);
    }

    /// Samples of the eye since the last call, in degrees without drift correction, for dots that somebody looks at.
    pub fn take_raw(&self, now: Instant) -> Vec<(Instant, [f64; 2])> {
        let mut hub = self.lock();
        hub.update(now);
        hub.raw.drain(..).collect()
    }

    /// Remembers what is known of the person.
    pub fn set_profile(&self, profile: Profile) {
        let mut hub = self.lock();
        hub.profile = profile;
        hub.restart_filter();
    }

    /// Asks a source's device to calibrate itself; `false` when it cannot be asked.
    pub fn calibrate(&self, index: usize) -> bool {
        self.lock().entries.get_mut(index).is_some_and(|entry| entry.source.calibrate())
    }

    /// Records the preferred source, also while another stands in for it.
    ///
    /// # Errors
    /// When the file exists or cannot be written.
    pub fn record(&self, path: &Path) -> anyhow::Result<()> {
        let mut hub = self.lock();
        let source = hub.preferred();
        let screen = hub.place.screen;
        let header = Header {
            source: hub.name(source),
            screen_mm: Some([screen.width_mm.into(), screen.height_mm.into()]),
            distance_mm: Some(screen.distance_mm.into()),
            ..Header::default()
        };
        hub.recording = Some((source, Recorder::create(path, header)?));
        hub.recorded = None;
        Ok(())
    }

    /// Ends the recording and says what it came to; `None` when none ran.
    pub fn stop_recording(&self) -> Option<String> {
        self.lock().end_recording()
    }

    /// What the window shows about gaze.
    pub fn report(&self, now: Instant) -> HubReport {
        let mut hub = self.lock();
        hub.update(now);
        let active = hub.active;
        let sources = hub.entries.iter().enumerate().map(|(index, entry)| SourceReport {
            name: entry.spec.to_string(),
            status: entry.source.status(),
            active: index == active,
            is_eye: entry.source.is_eye(),
        });
        HubReport {
            sources: sources.collect(),
            note: hub.note.clone(),
            phase: hub.phase,
            timing: hub.timing.report(),
            recording: hub.recording.as_ref().map(|(_, recorder)| recorder.rows()),
            recorded: hub.recorded.clone(),
        }
    }
}

/// The sources with the pointer at the end unless it is among them.
fn with_pointer(specs: &[SourceSpec]) -> Vec<SourceSpec> {
    let pointer = (!specs.iter().any(SourceSpec::is_mouse)).then_some(SourceSpec::Mouse);
    specs.iter().cloned().chain(pointer).collect()
}

fn open_all(specs: &[SourceSpec]) -> anyhow::Result<Vec<Entry>> {
    with_pointer(specs).into_iter().map(Entry::open).collect()
}

impl Hub {
    fn name(&self, index: usize) -> String {
        self.entries.get(index).map(|entry| entry.spec.to_string()).unwrap_or_default()
    }

    /// The first tracker before any pointer, of those that have shown an eye if any has.
    fn preferred(&self) -> usize {
        let mut trackers = self.entries.iter().take_while(|entry| entry.source.is_eye());
        trackers.position(|entry| entry.last_valid.is_some()).unwrap_or(0)
    }

    fn end_recording(&mut self) -> Option<String> {
        let (_, recorder) = self.recording.take()?;
        let how = recorder.finish().map_or_else(|error| format!("{error:#}"), |recorded| recorded.to_string());
        self.recorded = Some(how.clone());
        Some(how)
    }

    fn restart_filter(&mut self) {
        self.filter = GazeFilter::new(FilterSettings::default());
        self.phase = None;
    }

    /// Takes in what the sources have, and falls back or returns where that is due.
    fn update(&mut self, now: Instant) {
        let mut batches: Vec<Vec<GazeSample>> = Vec::with_capacity(self.entries.len());
        for entry in &mut self.entries {
            let mut samples = Vec::new();
            entry.source.poll(now, &mut samples);
            samples.iter().for_each(|sample| entry.take(sample));
            batches.push(samples);
        }
        let usable = |(index, entry): (usize, &Entry)| entry.usable(now, index == self.active).then_some(index);
        let best = self.entries.iter().enumerate().find_map(usable).unwrap_or(self.active);
        if best != self.active {
            self.switch(best, now);
        }
        if let Some((source, _)) = self.recording {
            self.write(batches.get(source).map_or(&[], Vec::as_slice), now);
        }
        for sample in batches.get(self.active).into_iter().flatten() {
            self.take(sample);
        }
    }

    fn switch(&mut self, to: usize, now: Instant) {
        let (from, to_name) = (self.name(self.active), self.name(to));
        let first = self.live.is_none();
        let text = if to > self.active {
            format!("{from} is lost: gaze from {to_name}")
        } else {
            format!("gaze from {to_name}")
        };
        // Before anything has been seen there is nothing to fall back from.
        self.note = (!first || to < self.active).then_some((text, now));
        self.active = to;
        self.restart_filter();
    }

    fn take(&mut self, sample: &GazeSample) {
        let Some(entry) = self.entries.get(self.active) else { return };
        let times = SampleTimes { captured: sample.captured, arrived: sample.arrived, is_eye: entry.source.is_eye() };
        let Some(view) = self.views.at(sample.captured).copied() else { return };
        if !times.is_eye {
            let deg = self.place.deg(sample.point, None);
            self.live = Some(Live { direction: self.place.direction(deg, sample.point, &view), times });
            return;
        }
        let tracked = entry.source.status().screen;
        let deg = sample.valid.then(|| self.place.deg(sample.point, tracked));
        if let Some(deg) = deg {
            self.raw.push_back((sample.captured, deg));
            if self.raw.len() > MAX_RAW {
                self.raw.pop_front();
            }
        }
        let time_secs = sample.captured.saturating_duration_since(self.epoch).as_secs_f64();
        let corrected = deg.map(|deg| self.profile.drift.apply(deg));
        let Some(Filtered { point_deg, phase, .. }) = self.filter.update(time_secs, corrected) else { return };
        let before = self.phase.replace(phase);
        // What holds through a blink is a direction of the scene, taken when the lid closes.
        if matches!(phase, Phase::Fixation | Phase::Saccade) || before != Some(Phase::Blink) && phase == Phase::Blink {
            self.live = Some(Live { direction: self.place.direction(point_deg, sample.point, &view), times });
            self.timing.arrived(times);
        }
    }

    fn target(&self, view: &View) -> Target {
        // The same while the pointer stands in for a tracker: another width would be another kernel, for moments.
        let accuracy_deg =
            if self.entries.iter().any(|entry| entry.source.is_eye()) { self.accuracy_deg() } else { 0.0 };
        let Some(live) = &self.live else { return Target { point: Vec2::ZERO, sample: None, accuracy_deg } };
        // A direction behind the view is kept at its edge until the eye follows.
        let point =
            view.point_of(live.direction).map_or(Vec2::ZERO, |point| point.clamp(Vec2::splat(-4.0), Vec2::splat(4.0)));
        Target { point, sample: Some(live.times), accuracy_deg }
    }

    fn accuracy_deg(&self) -> f64 {
        let known = self.stated_accuracy_deg.or(self.profile.accuracy_deg).unwrap_or(USUAL_ACCURACY_DEG);
        (known / ACCURACY_STEP_DEG).round() * ACCURACY_STEP_DEG
    }

    fn write(&mut self, samples: &[GazeSample], now: Instant) {
        let place = self.place;
        let Some((_, recorder)) = &mut self.recording else { return };
        for sample in samples {
            let point = match sample.point {
                Point::Picture(point) => Point::Screen01(place.screen_from_picture(point)),
                other => other,
            };
            if let Err(error) = recorder.write(&GazeSample { point, ..*sample }) {
                let how = self.end_recording().unwrap_or_default();
                let text = format!("the recording has ended: {error:#}; {how}");
                self.recorded = Some(text.clone());
                self.note = Some((text, now));
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests;
