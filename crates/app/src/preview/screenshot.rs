//! `--screenshot-after SECONDS --screenshot FILE`: how tests and the documentation look at the window.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use egui::{ColorImage, Context, ViewportCommand};
use serde_json::{Value, json};

use super::engine::{Message, State};
use super::frame_times::FrameTimes;
use crate::output::png;
use crate::settings::mode_name;

/// How often the clock is looked at; every frame costs a CPU adapter time that it does not trace.
const LOOK_INTERVAL: Duration = Duration::from_millis(250);

/// While a button is held: that somebody moves the pointer slowly is not the window's fault.
const HELD_INTERVAL: Duration = Duration::from_millis(10);

/// Where the outcome of a screenshot is left for whoever opened the window.
pub type Outcome = Arc<Mutex<Option<anyhow::Result<Value>>>>;

/// Waits for its time, saves what the window shows, and closes it.
pub struct Screenshot {
    after: Duration,
    path: PathBuf,
    outcome: Outcome,
    /// When the first picture came.
    since: Option<Instant>,
    /// The first reading after halfway from there to the screenshot, when shaders are compiled and rates have settled: when it was,
    /// and the time spent tracing until then.
    halfway: Option<(Instant, Duration)>,
    asked: bool,
    /// Since then.
    frames: FrameTimes,
    sender: Sender<Arc<ColorImage>>,
    receiver: Receiver<Arc<ColorImage>>,
}

impl Screenshot {
    /// Counts from the window's first picture.
    pub fn new(after_secs: f64, path: PathBuf, outcome: Outcome) -> Self {
        let (sender, receiver) = channel();
        let after = Duration::try_from_secs_f64(after_secs).unwrap_or_default();
        Self {
            after,
            path,
            outcome,
            since: None,
            halfway: None,
            asked: false,
            frames: FrameTimes::default(),
            sender,
            receiver,
        }
    }

    /// To be called every frame.
    pub fn update(&mut self, ctx: &Context, state: &State, trouble: Option<&Message>, more: impl FnOnce() -> Value) {
        ctx.request_repaint_after(LOOK_INTERVAL);
        if let Ok(image) = self.receiver.try_recv() {
            let texels: Vec<[u8; 4]> = image.pixels.iter().map(|pixel| pixel.to_array()).collect();
            let size = image.size.map(|side| side as u32);
            let written = png::write(&self.path, size[0], size[1], &texels);
            self.leave(ctx, written.map(|()| self.figures(state, more())).map_err(Into::into));
            return;
        }
        let waits = state.picture.is_none() || state.is_sketch;
        let failed = waits && state.busy.is_none();
        let reason = match trouble.or(state.message.as_ref()) {
            _ if state.dead => Some("the renderer has stopped"),
            Some(message) if message.wrong && failed => Some(message.text.as_str()),
            _ => None,
        };
        if let Some(reason) = reason {
            self.leave(ctx, Err(anyhow::anyhow!("{reason}")));
            return;
        }
        if waits {
            return;
        }
        let now = Instant::now();
        let since = *self.since.get_or_insert(now);
        if since.elapsed() >= self.after / 2 {
            self.halfway = self.halfway.or(state.readout.read_at.map(|at| (at, state.readout.traced)));
        }
        let held = ctx.input(|input| input.pointer.any_down());
        self.frames.frame(now, held);
        if held {
            ctx.request_repaint_after(HELD_INTERVAL);
        }
        if !self.asked && since.elapsed() >= self.after {
            self.asked = true;
            let (sender, ctx_of_reply) = (self.sender.clone(), ctx.clone());
            let callback = egui::ScreenshotCallback::new(move |image| {
                // The window may be closed by then; the picture is of no use to anybody else.
                let _ = sender.send(image);
                ctx_of_reply.request_repaint();
            });
            ctx.send_viewport_cmd(ViewportCommand::Screenshot(callback));
        }
    }

    /// Whether the window is closed on its account.
    pub fn is_done(&self) -> bool {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn leave(&self, ctx: &Context, outcome: anyhow::Result<Value>) {
        *self.outcome.lock().unwrap_or_else(PoisonError::into_inner) = Some(outcome);
        ctx.send_viewport_cmd(ViewportCommand::Close);
    }

    fn figures(&self, state: &State, more: Value) -> Value {
        let readout = &state.readout;
        let now = Instant::now();
        // Readings are as far apart as pictures, so that the share is of the time between two of them.
        let (halfway, traced) = self.halfway.unwrap_or((now, readout.traced));
        let read = readout.read_at.map_or(Duration::ZERO, |at| at.saturating_duration_since(halfway));
        let tracing = readout.traced.saturating_sub(traced).as_secs_f64();
        let mut figures = json!({
            "samples": readout.samples,
            "taken_over": state.taken_over,
            "samples_per_s": readout.samples_per_s,
            "spp_at_gaze": readout.spp_at_gaze,
            "elapsed_s": readout.elapsed.as_secs_f64(),
            "tracing_share": tracing / read.as_secs_f64().max(1e-9),
            "shown_s": self.since.map_or(0.0, |since| (now - since).as_secs_f64()),
            "frames": self.frames.figures(),
            "film": state.film,
            "schedule": state.schedule,
            "mode": state.mode.map(mode_name),
            "headset": state.headset.as_ref().map(|headset| json!({
                "runtime": headset.runtime,
                "system": headset.system,
                "state": headset.words,
                "eye_tracker": headset.has_eye_tracker,
                "gaze_from": headset.gaze_from,
                "gaze_age_ms": headset.gaze_age.map(|age| age.as_secs_f64() * 1e3),
                "frames": headset.frames,
                "missed": headset.missed,
                "refreshes": headset.refreshes,
            })),
            "message": state.message.as_ref().map(|message| &message.text),
        });
        if let (Value::Object(figures), Value::Object(more)) = (&mut figures, more) {
            figures.extend(more);
        }
        figures
    }
}
