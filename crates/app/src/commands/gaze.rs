//! `fovea gaze`: which sources there are, what one sends, and recording it.

use std::collections::VecDeque;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use serde_json::{Value, json};

use super::{print_json, print_text};
use crate::cli::gaze::GazeArgs;
use crate::gaze::lsl::resolve;
use crate::gaze::parse::trace::Header;
use crate::gaze::recorder::Recorder;
use crate::gaze::sample::{GazeSample, Point};
use crate::gaze::source::{GazeSource, SourceState, SourceStatus};
use crate::gaze::spec::{SourceSpec, is_gaze};

/// How long sources are waited for by `--list`.
const LISTING: Duration = Duration::from_millis(2500);
/// How often a source is looked at.
const LOOK: Duration = Duration::from_millis(5);
/// How often the line on a terminal changes.
const SAY: Duration = Duration::from_millis(500);
/// A recording waits for its source this long.
const PATIENCE: Duration = Duration::from_secs(20);
/// Ages that the figures are taken over.
const AGES: usize = 1 << 16;

/// Lists, watches or records.
///
/// # Errors
/// A source that cannot be opened, or a file that cannot be written.
pub fn run(args: &GazeArgs) -> anyhow::Result<()> {
    match &args.source {
        None => list(args.json),
        Some(source) => watch(source, args),
    }
}

fn list(as_json: bool) -> anyhow::Result<()> {
    let [open_gaze, _, pupil] = SourceSpec::usual_trackers();
    let opened: Vec<_> =
        [open_gaze, pupil].into_iter().map(|spec| Ok((spec.open()?, spec))).collect::<anyhow::Result<_>>()?;
    // One stream may be what somebody looks for, so all are waited for.
    let streams = resolve::resolve(None, LISTING, |_| false).unwrap_or_default();
    let mut rows = vec![json!({ "source": "mouse", "state": "connected", "detail": "" })];
    for (source, spec) in &opened {
        let SourceStatus { state, detail, .. } = source.status();
        rows.push(json!({ "source": spec.to_string(), "state": state.to_string(), "detail": detail }));
    }
    for stream in streams {
        let info = &stream.info;
        let note = if is_gaze(&info.kind) { "" } else { ", perhaps no gaze" };
        let detail = format!(
            "{} channels of type {}, {} Hz, on {}{note}",
            info.channel_count, info.kind, info.nominal_rate_hz, stream.address
        );
        rows.push(json!({ "source": format!("lsl:name={}", info.name), "state": "found", "detail": detail }));
    }
    if as_json {
        return print_json(&json!({ "sources": rows }));
    }
    let text = |row: &Value, key: &str| row[key].as_str().unwrap_or_default().to_owned();
    let lines = rows.iter().map(|row| {
        let (name, state, detail) = (text(row, "source"), text(row, "state"), text(row, "detail"));
        format!("{name:28}  {state}{}{detail}\n", if detail.is_empty() { "" } else { "; " })
    });
    print_text(&lines.collect::<String>())
}

/// Figures of what a source sends.
#[derive(Default)]
struct Figures {
    samples: u64,
    valid: u64,
    first_secs: Option<f64>,
    last_secs: f64,
    /// Milliseconds from the eye to this program, newest last.
    ages_ms: VecDeque<f64>,
    /// How often the time between samples was more than half as long again as usual.
    gaps: u64,
    longest_gap_secs: f64,
    interval_secs: f64,
    /// Times that the connection was found again.
    reconnections: u64,
    connected: bool,
    /// Sums of the coordinates of valid samples.
    sum: [f64; 2],
}

impl Figures {
    fn take(&mut self, sample: &GazeSample) {
        if self.first_secs.is_some() {
            let interval = sample.device_secs - self.last_secs;
            if self.interval_secs > 0.0 && interval > 1.5 * self.interval_secs {
                self.gaps += 1;
                self.longest_gap_secs = self.longest_gap_secs.max(interval);
            } else {
                let weight = if self.interval_secs > 0.0 { 0.05 } else { 1.0 };
                self.interval_secs += weight * (interval - self.interval_secs);
            }
        }
        self.first_secs.get_or_insert(sample.device_secs);
        self.last_secs = sample.device_secs;
        self.samples += 1;
        if sample.valid {
            self.valid += 1;
            let (Point::Screen01(point) | Point::ViewDeg(point) | Point::Picture(point)) = sample.point;
            self.sum = [self.sum[0] + point[0], self.sum[1] + point[1]];
        }
        self.ages_ms.push_back(sample.arrived.saturating_duration_since(sample.captured).as_secs_f64() * 1e3);
        if self.ages_ms.len() > AGES {
            self.ages_ms.pop_front();
        }
    }

    /// Counts a connection that was lost and found again.
    fn state(&mut self, state: &SourceState) {
        let connected = matches!(state, SourceState::Connected);
        if connected && !self.connected && self.samples > 0 {
            self.reconnections += 1;
        }
        // A stall is the same connection.
        if !matches!(state, SourceState::Stalled) {
            self.connected = connected;
        }
    }

    fn rate_hz(&self) -> f64 {
        if self.interval_secs > 0.0 { 1.0 / self.interval_secs } else { 0.0 }
    }

    fn to_json(&self, status: &SourceStatus, seconds: f64) -> Value {
        let mut ages: Vec<f64> = self.ages_ms.iter().copied().collect();
        ages.sort_by(f64::total_cmp);
        let age = |share: f64| ages.get(((ages.len() as f64 - 1.0) * share).max(0.0) as usize);
        let mean = |axis: usize| (self.valid > 0).then(|| self.sum[axis] / self.valid as f64);
        json!({
            "state": status.state.to_string(),
            "detail": status.detail,
            "seconds": seconds,
            "samples": self.samples,
            "valid": self.valid,
            "dropped": status.dropped,
            "rate_hz": self.rate_hz(),
            "device_seconds": self.first_secs.map(|first| self.last_secs - first),
            "gaps": self.gaps,
            "longest_gap_s": self.longest_gap_secs,
            "reconnections": self.reconnections,
            "clock_synchronised": status.synchronised,
            "age_ms": { "median": age(0.5), "p95": age(0.95), "max": age(1.0) },
            "mean_point": [mean(0), mean(1)],
        })
    }
}

fn watch(spec: &SourceSpec, args: &GazeArgs) -> anyhow::Result<()> {
    if spec.is_mouse() {
        bail!("the mouse is a gaze source of the window only; there the gaze panel records it");
    }
    let mut source = spec.open()?;
    let start = Instant::now();
    let (mut figures, mut recorder, mut samples) = (Figures::default(), None, Vec::new());
    let mut said = start;
    let until = args.seconds.map(Duration::from_secs_f64);
    if let Some(path) = args.record.as_deref().filter(|path| path.exists()) {
        bail!("{}: exists already; a recording overwrites nothing", path.display());
    }
    loop {
        std::thread::sleep(LOOK);
        let now = Instant::now();
        source.poll(now, &mut samples);
        let status = source.status();
        figures.state(&status.state);
        for sample in samples.drain(..) {
            figures.take(&sample);
            record(&sample, spec, args, &mut recorder)?;
        }
        if said.elapsed() >= SAY && std::io::stderr().is_terminal() {
            said = now;
            // Nothing is lost when standard error is closed.
            let _ = write!(
                std::io::stderr(),
                "\r{}: {}, {} samples, {:.0} Hz   ",
                spec,
                status.state,
                figures.samples,
                figures.rate_hz()
            );
        }
        let over = matches!(spec, SourceSpec::Trace(..)) && matches!(status.state, SourceState::Lost(_));
        let hopeless = args.record.is_some() && figures.samples == 0 && start.elapsed() > PATIENCE;
        if over || hopeless || until.is_some_and(|until| start.elapsed() >= until) {
            break;
        }
    }
    finish(source.as_ref(), spec, args, &figures, recorder, start.elapsed())
}

fn record(
    sample: &GazeSample,
    spec: &SourceSpec,
    args: &GazeArgs,
    recorder: &mut Option<Recorder>,
) -> anyhow::Result<()> {
    let Some(path) = &args.record else { return Ok(()) };
    if recorder.is_none() {
        let header = Header { source: spec.to_string(), ..Header::default() };
        *recorder = Some(Recorder::create(path, header)?);
    }
    recorder.as_mut().map_or(Ok(()), |recorder| recorder.write(sample))
}

fn finish(
    source: &dyn GazeSource,
    spec: &SourceSpec,
    args: &GazeArgs,
    figures: &Figures,
    recorder: Option<Recorder>,
    took: Duration,
) -> anyhow::Result<()> {
    if std::io::stderr().is_terminal() {
        eprintln!();
    }
    let status = source.status();
    let recorded = recorder.map(Recorder::finish).transpose()?;
    if figures.samples == 0 {
        return Err(anyhow::anyhow!("{}", status.state)).with_context(|| spec.to_string());
    }
    let report = figures.to_json(&status, took.as_secs_f64());
    if args.json {
        return print_json(&report);
    }
    let recorded = recorded.map(|recorded| format!("{recorded}\n")).unwrap_or_default();
    print_text(&format!(
        "{recorded}{} samples, {} valid, {:.1} Hz, {} gaps, {} reconnections\n",
        figures.samples,
        figures.valid,
        figures.rate_hz(),
        figures.gaps,
        figures.reconnections
    ))
}
