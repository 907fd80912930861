//! The engine while somebody wears the headset: the film lives on the headset's device, the runtime's frames come first,
//! and the window shows a mirror of what is seen.

use std::time::{Duration, Instant};

use anyhow::Context;
use glam::{Quat, UVec2, Vec2, Vec3};
use tracer::distribution::View as TracerView;
use tracer::gpu::Gpu;
use tracer::panorama::{EyeSettings, Frustum, Panorama};

use super::super::tracing::{HeadAim, Tracing};
use super::{HeadsetReadout, Look, Request, Worker, lock};
use crate::readback;
use crate::screen::FOVEA_DEG;
use crate::view::View;
use crate::vr::gaze::{EyeGaze, GazeFrom};
use crate::vr::headset::{Frame, Headset};
use crate::vr::input::Press;
use crate::vr::lifecycle::Ended;
use crate::vr::pacing::FramePacing;

/// How long the runtime has to end the session after it was asked to.
const PATIENCE: Duration = Duration::from_secs(3);
/// Texels of the panorama that every frame refreshes, whatever else there is to do.
const LEAST_REFRESH: u64 = 1 << 16;
/// Share of what is left of a frame that goes into the panorama rather than into samples.
const REFRESH_SHARE: f64 = 0.3;
/// How often the window's mirror is drawn.
const MIRROR_INTERVAL: Duration = Duration::from_millis(100);
/// Pixels of the mirror along its longer side, at most.
const MIRROR_SIDE: u32 = 1280;
/// For so long after it last moved, the pointer over the mirror is a gaze.
const POINTER_HOLDS: Duration = Duration::from_secs(5);
/// What a headset's eye tracker is taken to be off by, degrees.
const TRACKER_ACCURACY_DEG: f64 = 1.0;

/// A headset in use.
pub(super) struct HeadsetRun {
    headset: Headset,
    panorama: Option<Panorama>,
    pacing: FramePacing,
    eyes: EyeGaze,
    /// Film from LOCAL: what the wearer has ahead is what the window had when the headset was put on.
    film_from_local: Quat,
    anchor: Vec3,
    local_from_head: Quat,
    /// Half extents that hold both eyes' pictures.
    half_extent: Vec2,
    pointer: Option<(Vec2, Instant)>,
    marker: bool,
    leaving_since: Option<Instant>,
    mirror: Option<wgpu::Texture>,
    mirrored: Option<Instant>,
    readout: HeadsetReadout,
}

impl Worker {
    /// Puts scene and film on the headset's device and begins a session.
    pub(super) fn enter_headset(&mut self) -> anyhow::Result<Option<String>> {
        if self.headset.is_some() {
            return Ok(None);
        }
        self.busy(Some("looking for the headset".into()));
        let headset = Headset::enter()?;
        self.busy(Some("moving the scene to the headset's device".into()));
        let moved = self.tracing.move_to(headset.gpu().clone(), None)?;
        // What is left when the headset's device is lost; reading it back now and then would cost frames.
        lock(&self.shared.survivors).film = moved.film;
        let look = lock(&self.shared.look).clone();
        let facts = headset.facts().clone();
        let text = format!("{}: a panorama seen from one point, without parallax", facts.system);
        let mut run = HeadsetRun {
            panorama: None,
            pacing: FramePacing::default(),
            eyes: EyeGaze::new(Instant::now()),
            film_from_local: Quat::IDENTITY,
            anchor: Vec3::NAN,
            local_from_head: Quat::IDENTITY,
            half_extent: Vec2::ONE,
            pointer: None,
            marker: false,
            leaving_since: None,
            mirror: None,
            mirrored: None,
            readout: HeadsetReadout {
                runtime: facts.runtime,
                system: facts.system,
                has_eye_tracker: facts.eye_gaze,
                ..HeadsetReadout::default()
            },
            headset,
        };
        if let Some(look) = look {
            run.follow_window(&look)?;
        }
        self.headset = Some(run);
        self.shown = None;
        Ok(Some(text))
    }

    /// Asks the runtime to end the session; without one that runs, the headset is left at once.
    pub(super) fn leave_headset(&mut self) -> anyhow::Result<Option<String>> {
        let Some(run) = &mut self.headset else { return Ok(None) };
        if run.leaving_since.is_none() && run.headset.lifecycle().is_running() && run.headset.request_exit().is_ok() {
            run.leaving_since = Some(Instant::now());
            return Ok(None);
        }
        self.back_to_the_desktop()?;
        Ok(Some("left the headset".into()))
    }

    /// Turns the marker of the fovea on or off.
    pub(super) fn toggle_marker(&mut self) {
        if let Some(run) = &mut self.headset {
            run.marker = !run.marker;
        }
    }

    fn back_to_the_desktop(&mut self) -> anyhow::Result<()> {
        let Some(run) = self.headset.take() else { return Ok(()) };
        self.busy(Some("moving the scene to the window's device".into()));
        let kept = lock(&self.shared.survivors).film.clone();
        let moved = self.tracing.move_to(self.devices.tracing.clone(), kept);
        match &moved {
            Ok(moved) => lock(&self.shared.survivors).film.clone_from(&moved.film),
            // Whatever went wrong, the window needs a film.
            Err(_) => self.tracing.start_anew_on(self.devices.tracing.clone()),
        }
        // Not before the film has left its device.
        drop(run);
        self.busy(None);
        lock(&self.shared.state).headset = None;
        self.shown = None;
        self.pacing.restart();
        anyhow::ensure!(moved?.is_newest, "the headset's device was lost; the film goes on as it went in");
        Ok(())
    }

    /// One of the runtime's frames, or a batch while nobody wears the headset.
    pub(super) fn headset_frame(&mut self, look: &Look) -> anyhow::Result<()> {
        let Some(run) = &mut self.headset else { return Ok(()) };
        let overdue = run.leaving_since.is_some_and(|since| since.elapsed() > PATIENCE);
        let ended = run.headset.poll().or(overdue.then_some(Ended::Asked));
        let failed = match ended {
            Some(Ended::Asked) => None,
            Some(Ended::Lost(error)) => Some(error.into()),
            None => match self.one_frame(look) {
                Ok(()) => return Ok(()),
                Err(error) => Some(error),
            },
        };
        self.back_to_the_desktop()?;
        match failed {
            Some(error) => Err(error),
            None => {
                self.tell("left the headset".into(), false);
                Ok(())
            }
        }
    }

    fn one_frame(&mut self, look: &Look) -> anyhow::Result<()> {
        let run = self.headset.as_mut().context("no headset")?;
        run.follow_window(look)?;
        // Not within a frame: a new film takes its time.
        if self.tracing.follow_head(look, &run.aim())? {
            run.pacing.restart();
        }
        if self.tracing.begin_trial(look.controls.trial) {
            // The next one is black.
            run.panorama = None;
            self.start_film();
        }
        let run = self.headset.as_mut().context("no headset")?;
        let frame = if run.headset.lifecycle().is_running() { Some(run.headset.begin_frame()?) } else { None };
        if let Some(frame) = frame {
            run.draw(frame, look, &mut self.tracing)?;
        }
        let presses = run.follow_gaze()?;
        for press in presses {
            match press {
                Press::NextMode => lock(&self.shared.state).mode_presses += 1,
                // The film of a trial has begun with its clock.
                Press::Restart if look.controls.trial.is_some() => {}
                Press::Restart => self.carry_out(Request::Restart),
                Press::Marker => self.toggle_marker(),
            }
        }
        self.mirror(frame, look)?;
        self.trace_beside(frame, look)
    }

    /// Samples and panorama in what is left of the frame.
    fn trace_beside(&mut self, frame: Option<Frame>, look: &Look) -> anyhow::Result<()> {
        let run = self.headset.as_mut().context("no headset")?;
        let period = frame.map_or(MIRROR_INTERVAL, |frame| frame.period);
        let started = frame.map_or_else(Instant::now, |frame| frame.started);
        let left = || FramePacing::left(period, started.elapsed());
        run.refresh(left().mul_f64(REFRESH_SHARE), &mut self.tracing)?;
        // Several batches a frame, so that each goes by the newest gaze.
        while !look.controls.paused
            && let Some(batch) = run.pacing.batch(left())
        {
            let (samples, took) = self.tracing.trace(batch)?;
            run.pacing.traced(samples, took);
            self.traced += took;
            self.rate.add(self.tracing.samples(), Instant::now());
            if left().is_zero() || frame.is_none() {
                break;
            }
            run.follow_gaze_only()?;
            self.tracing.follow_head(look, &run.aim())?;
        }
        Ok(())
    }

    /// Draws the window's mirror, where the frame leaves time for it.
    fn mirror(&mut self, frame: Option<Frame>, look: &Look) -> anyhow::Result<()> {
        let run = self.headset.as_mut().context("no headset")?;
        let now = Instant::now();
        if run.mirrored.is_some_and(|last| now.duration_since(last) < MIRROR_INTERVAL) {
            if frame.is_none() && look.controls.paused {
                std::thread::sleep(MIRROR_INTERVAL);
            }
            return Ok(());
        }
        run.mirrored = Some(now);
        let texture = run.draw_mirror(look, &mut self.tracing)?;
        let texels = readback::read_texture(run.headset.gpu(), &texture)?;
        let size = [texture.width(), texture.height()];
        let picture = self.screen.show(size, texels, || self.tracing.next_generation());
        let run = self.headset.as_mut().context("no headset")?;
        run.say(now);
        let (readout, gaze) = (run.readout.clone(), run.gaze().0);
        let block = self.tracing.block_at(gaze)?;
        self.convergence = self.follower.update(gaze, block, self.tracing.elapsed());
        let figures = self.readout();
        let film = self.tracing.film_words();
        let mut state = lock(&self.shared.state);
        state.picture = Some(picture);
        state.readout = figures;
        (state.film, state.schedule) = (film, self.tracing.schedule());
        state.mode = Some(look.controls.mode);
        state.headset = Some(readout);
        drop(state);
        (self.repaint)();
        Ok(())
    }
}

impl HeadsetRun {
    /// A jump of the window's viewer turns the wearer with it; the head alone does not move the window's view.
    fn follow_window(&mut self, look: &Look) -> anyhow::Result<()> {
        if self.anchor != look.standpoint.position {
            self.anchor = look.standpoint.position;
            // Level, whatever the window's pitch: only the head tilts the horizon.
            self.film_from_local = View { pitch: 0.0, ..look.standpoint.view }.film_from_view();
        }
        let moved = self.pointer.map(|(point, _)| point) != look.pointer;
        self.pointer = match look.pointer {
            Some(point) if moved => Some((point, Instant::now())),
            Some(_) => self.pointer,
            None => None,
        };
        if self.headset.lifecycle().is_running()
            && let Some(head) = self.headset.head()?
        {
            self.local_from_head = head;
        }
        Ok(())
    }

    /// What both eyes see together, about the head.
    fn view(&self) -> TracerView {
        TracerView { world_from_view: self.film_from_local * self.local_from_head, half_extent: self.half_extent }
    }

    /// What the fovea goes by, in film space.
    fn gaze(&self) -> (Vec3, GazeFrom) {
        if let Some(direction) = self.eyes.direction(Instant::now()) {
            return (direction, GazeFrom::Eyes);
        }
        match self.pointer {
            Some((point, moved)) if moved.elapsed() < POINTER_HOLDS => {
                (self.mirror_view().direction(point), GazeFrom::Pointer)
            }
            _ => (self.view().world_from_view * Vec3::NEG_Z, GazeFrom::Head),
        }
    }

    fn aim(&self) -> HeadAim {
        HeadAim {
            view: self.view(),
            gaze: self.gaze().0,
            // The same while the eyes are lost for a moment: another width is another kernel.
            gaze_error_deg: if self.readout.has_eye_tracker { TRACKER_ACCURACY_DEG } else { 0.0 },
            size_px: UVec2::from(self.headset.eye_sizes()[0]),
        }
    }

    fn draw(&mut self, frame: Frame, look: &Look, tracing: &mut Tracing) -> anyhow::Result<()> {
        self.readout.frames += 1;
        self.readout.missed += u64::from(frame.missed);
        self.prepare(tracing)?;
        let marker = self.marker.then(|| (self.gaze().0, FOVEA_DEG.to_radians()));
        let (film_from_local, panorama) = (self.film_from_local, self.panorama.as_ref());
        let mut half_extent = self.half_extent;
        let gpu = self.headset.gpu().clone();
        self.headset.submit(frame, |eyes| -> anyhow::Result<()> {
            let Some(panorama) = panorama else { return Ok(()) };
            let mut encoder = encoder(&gpu, "eyes");
            for eye in eyes {
                let frustum = eye.view.frustum;
                let reach = Vec2::new(frustum.right.max(-frustum.left), frustum.up.max(-frustum.down));
                half_extent = half_extent.max(reach.min(Vec2::splat(10.0)));
                let settings = EyeSettings {
                    world_from_eye: film_from_local * eye.view.local_from_eye,
                    frustum,
                    size: eye.size,
                    exposure_ev: look.controls.exposure_ev,
                    tone_map: look.controls.tone_map.into(),
                    marker,
                };
                tracing.renderer()?.draw_eye(&mut encoder, panorama, &settings, eye.target, eye.format)?;
            }
            gpu.queue.submit([encoder.finish()]);
            Ok(())
        })?;
        gpu.wait().context("the headset's graphics device was lost")?;
        self.half_extent = half_extent;
        Ok(())
    }

    /// The panorama of the present film.
    fn prepare(&mut self, tracing: &mut Tracing) -> anyhow::Result<()> {
        let film = tracing.renderer()?.options().film;
        if self.panorama.as_ref().is_none_or(|panorama| !panorama.fits(&film)) {
            let panorama = Panorama::new(self.headset.gpu(), &film);
            self.panorama = Some(panorama.context("the panorama does not fit the headset's graphics device")?);
        }
        Ok(())
    }

    fn refresh(&mut self, left: Duration, tracing: &mut Tracing) -> anyhow::Result<()> {
        self.prepare(tracing)?;
        let Some(panorama) = &mut self.panorama else { return Ok(()) };
        let gpu = self.headset.gpu();
        let start = Instant::now();
        let mut encoder = encoder(gpu, "panorama");
        let wanted = self.pacing.texels(left, LEAST_REFRESH);
        let done = tracing.renderer()?.refresh_panorama(&mut encoder, panorama, wanted)?;
        gpu.queue.submit([encoder.finish()]);
        gpu.wait().context("the headset's graphics device was lost")?;
        self.pacing.refreshed(done.texels, start.elapsed());
        self.readout.refreshes += u64::from(done.round_is_done);
        Ok(())
    }

    fn follow_gaze(&mut self) -> anyhow::Result<Vec<Press>> {
        if !self.headset.lifecycle().is_focused() {
            return Ok(Vec::new());
        }
        let (presses, sample) = self.headset.input()?;
        if let Some(sample) = sample {
            self.eyes.take(sample, self.film_from_local);
        }
        Ok(presses)
    }

    /// The newest gaze, leaving presses to the next frame.
    fn follow_gaze_only(&mut self) -> anyhow::Result<()> {
        if self.headset.lifecycle().is_focused()
            && let Some(sample) = self.headset.gaze()?
        {
            self.eyes.take(sample, self.film_from_local);
        }
        Ok(())
    }

    /// The head's view, as high as an eye's picture, in the window's proportions.
    fn mirror_view(&self) -> TracerView {
        let view = self.view();
        let aspect = self.readout.mirror_aspect.max(0.1);
        TracerView { half_extent: Vec2::new(view.half_extent.y * aspect, view.half_extent.y), ..view }
    }

    fn draw_mirror(&mut self, look: &Look, tracing: &mut Tracing) -> anyhow::Result<wgpu::Texture> {
        let gpu = self.headset.gpu().clone();
        let wanted = look.size_px.as_vec2().max(Vec2::ONE);
        self.readout.mirror_aspect = wanted.x / wanted.y;
        let scale = (MIRROR_SIDE as f32 / wanted.max_element()).min(1.0);
        let size = (wanted * scale).max(Vec2::ONE).as_uvec2().to_array();
        let texture = match self.mirror.take().filter(|texture| [texture.width(), texture.height()] == size) {
            Some(texture) => texture,
            None => readback::picture_texture(&gpu, size),
        };
        self.mirror = Some(texture.clone());
        let view = self.mirror_view();
        let settings = EyeSettings {
            world_from_eye: view.world_from_view,
            frustum: Frustum::symmetric(view.half_extent.x, view.half_extent.y),
            size,
            exposure_ev: look.controls.exposure_ev,
            tone_map: look.controls.tone_map.into(),
            marker: Some((self.gaze().0, FOVEA_DEG.to_radians())),
        };
        let Some(panorama) = &self.panorama else { return Ok(texture) };
        let mut encoder = encoder(&gpu, "mirror");
        let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
        tracing.renderer()?.draw_eye(&mut encoder, panorama, &settings, &target, readback::PICTURE_FORMAT)?;
        gpu.queue.submit([encoder.finish()]);
        Ok(texture)
    }

    /// What the window shows about the headset.
    fn say(&mut self, now: Instant) {
        let from = self.gaze().1;
        self.readout.words = self.headset.lifecycle().words().to_owned();
        self.readout.gaze_from = from.to_string();
        self.readout.gaze_age = if from == GazeFrom::Eyes { self.eyes.age(now) } else { None };
    }
}

fn encoder(gpu: &Gpu, label: &str) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
}
