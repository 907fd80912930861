//! The thread that loads, traces and draws the picture, so that the window never waits for any of it.
//!
//! The window says what it wants to see ([`Engine::look`], the last word counts) and asks for things to be done
//! ([`Engine::request`], in order). The thread answers with a [`State`] and asks the window to repaint.

use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use glam::{UVec2, Vec2};
use tracer::film::FilmSnapshot;
use tracer::scene::Scene;

use super::attention_tools;
use super::controls::{Controls, Readout};
use super::gaze::{Gaze, ScreenMapping};
use super::keeper::Keeper;
use super::navigation::Standpoint;
use super::pacing::Pacing;
use super::tracing::Tracing;
use crate::cli::PreviewArgs;
use crate::cli::choices::Mode;
use crate::convergence::{Convergence, Follower};
use crate::gaze::hub::{GazeHub, SampleTimes};
use crate::reload::Sketchable;
use crate::session::one_line;
use crate::tev::TevLink;

#[cfg(any(target_os = "linux", target_os = "windows"))]
mod headset;
#[cfg(not(any(target_os = "linux", target_os = "windows")))]
#[path = "engine/no_headset.rs"]
mod headset;

mod devices;
mod motion;
mod priority;
mod rate;
mod readout;
mod saving;
mod shown;
mod sketch;

use devices::Screen;
pub use devices::{Devices, Picture};
use motion::Motion;
pub(super) use priority::give_way;
use rate::Rate;
pub use readout::{HeadsetReadout, Message, ShownVersion};
pub use saving::Destination;
use saving::Saving;
use shown::Shown;
use sketch::Sketched;

/// How long a thread with nothing to trace sleeps between looks at what the window wants.
const IDLE: Duration = Duration::from_millis(10);
/// How often figures are read from the device.
const READ_INTERVAL: Duration = Duration::from_millis(500);
/// From this tracing time of a film on its picture is denoised.
const GUIDES_AFTER: Duration = Duration::from_millis(500);

/// What the window shows, as the person has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Where the viewer is.
    pub standpoint: Standpoint,
    /// Where the viewer looked when the window was drawn; a batch goes by the newest gaze instead.
    pub gaze: Gaze,
    /// Settings.
    pub controls: Controls,
    /// The picture on the screen.
    pub mapping: ScreenMapping,
    /// Physical pixels of the picture.
    pub size_px: UVec2,
    /// The pointer while it is over the picture, as a point of the view.
    pub pointer: Option<Vec2>,
}

/// Something to be done once.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Empty the film.
    Restart,
    /// Save the picture as it is shown.
    SavePng(Destination),
    /// Save the whole film.
    SaveExr(Destination),
    /// Go on with a film of the newest version of the scene, or of the first that comes.
    GoOn(Arc<FilmSnapshot>),
    /// Show the scene in the headset; the window shows a mirror.
    EnterHeadset,
    /// Show it in the window alone.
    LeaveHeadset,
    /// Turn the marker of the fovea in the headset on or off.
    ToggleMarker,
}

/// What the thread is up to.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// What takes long at the moment, such as `preparing the scene`.
    pub busy: Option<String>,
    /// Since when.
    pub busy_since: Option<Instant>,
    /// The last thing to tell.
    pub message: Option<Message>,
    /// The picture, once there is one.
    pub picture: Option<Picture>,
    /// That is a sketch of a scene that is not traced yet.
    pub is_sketch: bool,
    /// Figures.
    pub readout: Readout,
    /// The film's size, such as `4096x2048`.
    pub film: String,
    /// How kernels share the work of a path.
    pub schedule: &'static str,
    /// The mode of the last batch.
    pub mode: Option<Mode>,
    /// Samples of the film that were taken over from a file or a lost device.
    pub taken_over: u64,
    /// The device is gone, and all that was on it; another engine can go on with [`Engine::survivors`].
    pub lost: bool,
    /// The headset while it is in use.
    pub headset: Option<HeadsetReadout>,
    /// How often the next mode was asked for in the headset.
    pub mode_presses: u64,
    /// The version of the scene that the picture shows.
    pub version: ShownVersion,
    /// The thread has stopped for good, by a panic; standard error has the reason.
    pub dead: bool,
}

#[derive(Default)]
struct Shared {
    look: Mutex<Option<Look>>,
    /// The newest version of the scene, until the thread takes it.
    version: Mutex<Option<Arc<Scene>>>,
    /// Shapes of a scene that is still being read, until the thread takes them.
    shapes: Mutex<Option<Sketchable>>,
    state: Mutex<State>,
    /// What another device needs when this one is lost.
    survivors: Mutex<Survivors>,
}

/// What is on the host of a session.
#[derive(Clone, Debug, Default)]
pub struct Survivors {
    /// The newest version of the scene.
    pub scene: Option<Arc<Scene>>,
    /// The film as it was when it was last kept.
    pub film: Option<Arc<FilmSnapshot>>,
}

/// Handle of the thread; dropping it stops the thread, after what was asked for and the film that is being saved.
pub struct Engine {
    shared: Arc<Shared>,
    devices: Devices,
    requests: Option<Sender<Request>>,
    thread: Option<JoinHandle<()>>,
}

impl Engine {
    /// Starts the thread. `repaint` is called whenever there is something new to show, from any thread.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(
        devices: impl Into<Devices>,
        args: &PreviewArgs,
        gaze: Arc<GazeHub>,
        repaint: impl Fn() + Send + Sync + 'static,
    ) -> std::io::Result<Self> {
        let devices = devices.into();
        let shared = Arc::new(Shared::default());
        let tev = args.tev.clone().map(|address| {
            let tells = Arc::clone(&shared);
            TevLink::start(address, "fovea", move |line| lock(&tells.state).message = Some(Message::now(line, false)))
        });
        let (requests, inbox) = mpsc::channel();
        let worker = Worker {
            shared: Arc::clone(&shared),
            inbox,
            pacing: Pacing::new(devices.tracing.is_software()),
            screen: Screen::new(devices.window.clone()),
            headset: None,
            untold: None,
            tracing: Tracing::new(devices.tracing.clone(), args.clone()),
            devices: devices.clone(),
            versions: 0,
            gaze,
            sample: None,
            repaint: Arc::new(repaint),
            saving: Saving::default(),
            shown: None,
            show_time: Duration::ZERO,
            motion: Motion::default(),
            rate: Rate::default(),
            traced: Duration::ZERO,
            read_at: None,
            convergence: Convergence::default(),
            follower: Follower::default(),
            non_finite_dropped: 0,
            failed: None,
            keeper: Keeper::new(Instant::now()),
            awaits_scene: None,
            sketched: None,
            tev: tev.transpose()?,
        };
        let thread = std::thread::Builder::new().name("engine".into()).spawn(move || worker.run())?;
        Ok(Self { shared, devices, requests: Some(requests), thread: Some(thread) })
    }

    /// Says what the window shows.
    pub fn look(&self, look: Look) {
        *lock(&self.shared.look) = Some(look);
    }

    /// Shows a version of the scene from now on. The last word counts: versions that come while one is prepared are
    /// skipped.
    pub fn set_scene(&self, version: Arc<Scene>) {
        lock(&self.shared.survivors).scene = Some(Arc::clone(&version));
        *lock(&self.shared.version) = Some(version);
    }

    /// Sketches a scene that is still being read, until there is one to trace.
    pub fn sketch(&self, shapes: Sketchable) {
        *lock(&self.shared.shapes) = Some(shapes);
    }

    /// What another engine can go on with.
    pub fn survivors(&self) -> Survivors {
        lock(&self.shared.survivors).clone()
    }

    /// Asks for something to be done; a thread that has stopped does nothing.
    pub fn request(&self, request: Request) {
        if let Some(requests) = &self.requests {
            // A closed channel means that the thread has stopped, which `state` reports.
            let _ = requests.send(request);
        }
    }

    /// What the thread is up to.
    pub fn state(&self) -> State {
        let mut state = lock(&self.shared.state).clone();
        state.lost = self.devices.is_lost();
        state.dead |= self.thread.as_ref().is_none_or(JoinHandle::is_finished);
        state
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported by the panic hook.
            let _ = thread.join();
        }
    }
}

/// Locks, whether or not another holder panicked: the values are plain data, valid at any time.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Worker {
    shared: Arc<Shared>,
    inbox: Receiver<Request>,
    /// Those of the window; a headset has its own.
    devices: Devices,
    screen: Screen,
    headset: Option<headset::HeadsetRun>,
    /// What went wrong before there was a picture.
    untold: Option<String>,
    tracing: Tracing,
    /// Versions of the scene that were prepared.
    versions: u64,
    gaze: Arc<GazeHub>,
    /// The gaze sample that the last batch went by.
    sample: Option<SampleTimes>,
    pacing: Pacing,
    repaint: Arc<dyn Fn() + Send + Sync>,
    saving: Saving,
    shown: Option<Shown>,
    /// How long drawing the picture in full takes.
    show_time: Duration,
    motion: Motion,
    rate: Rate,
    /// Time spent tracing since the window opened.
    traced: Duration,
    /// When the two figures below were last read from the device, which waits for it.
    read_at: Option<Instant>,
    convergence: Convergence,
    follower: Follower,
    non_finite_dropped: u64,
    /// What could not be shown; not tried again until the window shows something else.
    failed: Option<Look>,
    keeper: Keeper,
    /// A film to go on with as soon as there is a scene.
    awaits_scene: Option<Arc<FilmSnapshot>>,
    sketched: Option<Sketched>,
    tev: Option<TevLink>,
}

impl Worker {
    /// Until the window closes.
    fn run(mut self) {
        if self.devices.are_two() {
            give_way();
        }
        loop {
            match self.next_request() {
                Ok(Some(request)) => self.carry_out(request),
                Ok(None) => {}
                Err(Closed) => return,
            }
            if self.headset.is_none() && self.tracing.is_lost() {
                // The window finds out by the state, and nothing else can be done here.
                (self.repaint)();
                std::thread::sleep(IDLE);
                continue;
            }
            self.take_version();
            let Some(look) = lock(&self.shared.look).clone() else { continue };
            if !self.tracing.is_open() {
                self.sketch_shapes(&look);
                continue;
            }
            // Whatever became of the window's picture: a headset has its own.
            if self.headset.is_some() {
                self.failed = None;
                if let Err(error) = self.headset_frame(&look) {
                    self.tell(one_line(&error), true);
                }
                continue;
            }
            if self.failed.as_ref() == Some(&look) {
                continue;
            }
            self.failed = None;
            let done = self.frame(&look).and_then(|()| self.keep());
            if let Err(error) = done
                && !self.tracing.is_lost()
            {
                self.tell(one_line(&error), true);
                self.failed = Some(look);
            }
        }
    }

    /// One batch, and a picture when it is time for one.
    fn frame(&mut self, look: &Look) -> anyhow::Result<()> {
        let prepares = self.tracing.must_prepare(look);
        if prepares {
            self.busy(Some("preparing the scene".into()));
            // What stands in a sketch's way stands in the scene's too, and is told with that.
            let _ = self.sketch_scene(look);
        }
        // The window may have been drawn long ago; the eye has moved since.
        let began = Instant::now();
        let target = self.gaze.target(began, &look.standpoint.view);
        let followed = Gaze { point: target.point };
        let gaze = attention_tools::gaze(&look.controls.attention, &look.standpoint, followed);
        self.sample = target.sample.filter(|_| gaze == followed);
        let look = &Look { gaze, ..look.clone() };
        let changed = self.tracing.follow(look);
        if prepares {
            self.busy(None);
        }
        if changed? {
            self.pacing.restart();
            self.motion.moves(Instant::now());
        }
        if self.tracing.begin_trial(look.controls.trial) {
            self.start_film();
        }
        if look.controls.paused || self.tracing.is_unfinished() {
            self.gaze.rests();
        } else {
            self.gaze.batch(began, Instant::now(), self.sample);
            let (samples, took) = self.tracing.trace(self.pacing.batch())?;
            self.traced += took;
            self.pacing.measured(samples, took, self.show_time);
            self.rate.add(self.tracing.samples_of_all(), Instant::now());
        }
        if self.is_due(look) {
            self.show(look)?;
        }
        // A film that was emptied just now may be emptied again, by a slider's next step.
        let rests = look.controls.paused || self.tracing.elapsed() > GUIDES_AFTER;
        if rests && !self.motion.goes_on(Instant::now()) {
            self.tracing.find_guides(look)?;
            self.tracing.rehearse();
        }
        Ok(())
    }

    /// Keeps the film on the host, and sends the picture to a viewer, when it is time for that.
    fn keep(&mut self) -> anyhow::Result<()> {
        let start = Instant::now();
        let samples = self.tracing.samples();
        let moving = self.motion.goes_on(start);
        let bytes = self.tracing.film_bytes();
        if !moving && self.keeper.is_due(start, samples, bytes) {
            lock(&self.shared.survivors).film = self.tracing.snapshot()?.map(Arc::new);
            self.keeper.taken(start, Instant::now(), samples, bytes);
        }
        if let Some(tev) = self.tev.as_mut().filter(|tev| self.shown.is_some() && tev.is_due()) {
            tev.push(|| self.tracing.radiance())?;
        }
        Ok(())
    }

    fn show(&mut self, look: &Look) -> anyhow::Result<()> {
        let start = Instant::now();
        let coarseness = self.motion.coarseness(start, self.show_time);
        let smoothing = self.motion.smoothing(start, self.tracing.samples(), look.size_px);
        self.tracing.set_smoothing(smoothing);
        let mut picture = self.tracing.show(look, coarseness)?;
        if self.devices.are_two() {
            let (size, texels) = self.tracing.texels()?;
            picture = self.screen.show(size, texels, || self.tracing.next_generation());
        }
        if coarseness == 1 {
            self.show_time = start.elapsed();
        }
        let (samples, is_guided) = (self.tracing.samples(), self.tracing.is_guided(look));
        self.gaze.shown(Instant::now(), self.sample);
        self.shown = Some(Shown { look: look.clone(), samples, coarseness, smoothing, is_guided, at: Instant::now() });
        if self.read_at.is_none_or(|at| at.elapsed() >= READ_INTERVAL) {
            let direction = look.standpoint.view.direction_at(look.gaze.point);
            let block = self.tracing.block_at(direction)?;
            self.convergence = self.follower.update(direction, block, self.tracing.elapsed());
            self.non_finite_dropped = self.tracing.non_finite_dropped()?;
            self.read_at = Some(Instant::now());
        }
        let (readout, film) = (self.readout(), self.tracing.film_words());
        let version = self.tracing.scene_report().map(|(report, took)| ShownVersion::new(self.versions, report, took));
        let mut state = lock(&self.shared.state);
        (state.picture, state.is_sketch) = (Some(picture), false);
        state.version = version.unwrap_or_default();
        state.readout = readout;
        (state.film, state.schedule) = (film, self.tracing.schedule());
        state.mode = Some(look.controls.mode);
        drop(state);
        match self.untold.take() {
            Some(text) => self.tell(text, true),
            None => (self.repaint)(),
        }
        Ok(())
    }

    fn readout(&self) -> Readout {
        Readout {
            samples: self.tracing.samples(),
            samples_per_s: self.rate.per_second(),
            spp_at_gaze: self.convergence.block.samples as f32,
            convergence: self.convergence,
            elapsed: self.tracing.elapsed(),
            traced: self.traced,
            read_at: Some(Instant::now()),
            non_finite_dropped: self.non_finite_dropped,
            seen: self.tracing.seen(),
        }
    }

    /// The next request, waiting a little for one when there is nothing to trace.
    fn next_request(&self) -> Result<Option<Request>, Closed> {
        let up_to_date = |look: &Look| self.failed.as_ref() == Some(look) || look.controls.paused && !self.is_due(look);
        let is_still = |look: &Look| self.headset.is_none() && up_to_date(look);
        let nothing_to_show = !self.tracing.is_open() || lock(&self.shared.look).as_ref().is_none_or(is_still);
        let idle = nothing_to_show && lock(&self.shared.version).is_none();
        if idle {
            match self.inbox.recv_timeout(IDLE) {
                Ok(request) => Ok(Some(request)),
                Err(RecvTimeoutError::Timeout) => Ok(None),
                Err(RecvTimeoutError::Disconnected) => Err(Closed),
            }
        } else {
            match self.inbox.try_recv() {
                Ok(request) => Ok(Some(request)),
                Err(TryRecvError::Empty) => Ok(None),
                Err(TryRecvError::Disconnected) => Err(Closed),
            }
        }
    }

    fn carry_out(&mut self, request: Request) {
        let enters_headset = request == Request::EnterHeadset;
        let result = match request {
            Request::Restart => {
                self.tracing.restart();
                self.start_film();
                Ok(None)
            }
            Request::EnterHeadset => self.enter_headset(),
            Request::LeaveHeadset => self.leave_headset(),
            Request::ToggleMarker => {
                self.toggle_marker();
                Ok(None)
            }
            Request::SavePng(to) => self.save_png(to),
            Request::SaveExr(to) => self.save_exr(to),
            Request::GoOn(film) => {
                self.take_version();
                self.go_on(film).map(|()| None)
            }
        };
        self.busy(None);
        match result {
            Ok(Some(text)) => self.tell(text, false),
            Ok(None) => {}
            // Without a headset the window goes on; until it has a picture there is nothing to say it over.
            Err(error) if enters_headset && self.shown.is_none() => self.untold = Some(one_line(&error)),
            Err(error) => self.tell(one_line(&error), true),
        }
    }

    /// Puts the newest version of the scene in the place of the last.
    fn take_version(&mut self) {
        let Some(version) = lock(&self.shared.version).take() else { return };
        self.busy(Some("preparing the scene".into()));
        self.forget_film();
        // A first scene has come to rest; another version is an edit that may go on.
        if self.tracing.is_open() {
            self.motion.moves(Instant::now());
        }
        let result = self.tracing.set_scene(version);
        self.busy(None);
        self.failed = None;
        self.pacing.restart();
        self.rate = Rate::default();
        let result = result.and_then(|()| {
            self.versions += 1;
            self.shown = None;
            self.awaits_scene.take().map_or(Ok(()), |film| self.go_on(film))
        });
        if let Err(error) = result {
            self.tell(one_line(&error), true);
        }
    }

    /// Goes on with a film, or waits for its scene with that.
    fn go_on(&mut self, film: Arc<FilmSnapshot>) -> anyhow::Result<()> {
        if !self.tracing.is_open() {
            self.awaits_scene = Some(film);
            return Ok(());
        }
        self.busy(Some("preparing the film".into()));
        self.pacing.restart();
        self.rate = Rate::default();
        let result = self.tracing.go_on(&film);
        self.busy(None);
        result?;
        lock(&self.shared.state).taken_over = film.header.samples();
        lock(&self.shared.survivors).film = Some(film);
        Ok(())
    }

    /// The film has been emptied.
    fn start_film(&mut self) {
        self.forget_film();
        self.pacing.restart();
        self.rate = Rate::default();
    }

    /// The film is about to start anew.
    fn forget_film(&mut self) {
        lock(&self.shared.survivors).film = None;
        lock(&self.shared.state).taken_over = 0;
        self.keeper = Keeper::new(Instant::now());
    }

    fn busy(&self, text: Option<String>) {
        let mut state = lock(&self.shared.state);
        state.busy_since = text.as_ref().map(|_| Instant::now());
        state.busy = text;
        drop(state);
        (self.repaint)();
    }

    fn tell(&self, text: String, wrong: bool) {
        lock(&self.shared.state).message = Some(Message::now(text, wrong));
        (self.repaint)();
    }
}

/// The window is gone.
struct Closed;
