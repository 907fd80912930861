//! Opens scenes in the background and reads them again when their files change.
//!
//! A thread of its own watches a scene's files and companions; every reading runs on a further thread, so that a newer
//! wish never waits for an older one. What was read comes out as a [`LoadEvent`]; a scene that cannot be read changes
//! nothing but says why. See [`rule`] for when files are read.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use notify::{RecursiveMode, Watcher};
use tracer::scene::EnvironmentImage;

use crate::cli::SceneArgs;
use crate::session::{self, Loaded, Shapes, Source, one_line};
use environment::EnvironmentFile;
use rule::{Reading, Rule, Step, Timing};
use stamps::{Stamps, folders};

mod environment;
pub mod rule;
pub mod stamps;

/// How long a thread without a scene sleeps.
const IDLE: Duration = Duration::from_secs(3600);
/// How long the reading of images waits at most for a sketch, which needs the same cores: they would have it wait for all of them.
const SKETCH: Duration = Duration::from_secs(1);

/// What came of opening or reading again.
#[derive(Clone, Debug)]
pub enum LoadEvent {
    /// What there is to sketch of a scene that was asked for and is still being read.
    Shapes(Source, Sketchable),
    /// A scene that was asked for.
    Opened(Source, Loaded),
    /// A newer version of the scene that is open.
    Changed(Loaded),
    /// A scene that was asked for cannot be opened: one line.
    NotOpened(String),
    /// The files of the open scene cannot be read as they are now: one line. The last version stays.
    Broken(String),
    /// The scene that was to be followed again is: what comes from now on is of it.
    Followed,
    /// An environment image that was asked for, or a newer version of it, or why it cannot be had.
    Environment(PathBuf, Result<Arc<EnvironmentImage>, String>),
}

/// What is watched of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Watched {
    /// The scene.
    pub source: Source,
    /// Its files and companions.
    pub files: Vec<PathBuf>,
    /// Images that did not decode in the version that is shown.
    pub replaced_images: Vec<String>,
}

impl Watched {
    /// Of a scene that was loaded.
    pub fn new(source: &Source, loaded: &Loaded) -> Self {
        let (files, replaced_images) = (loaded.files.clone(), loaded.replaced_images.clone());
        Self { source: source.clone(), files, replaced_images }
    }
}

/// Shapes of a scene whose images are not read yet.
#[derive(Clone, Debug)]
pub struct Sketchable {
    /// The scene as far as it is known.
    pub shapes: Shapes,
    /// The reading goes on when the last of these is gone, if not before.
    _reading: Sender<()>,
}

/// What takes time at the moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loading {
    /// The scene's name.
    pub name: String,
    /// Since when.
    pub since: Instant,
}

/// Called whenever there is something new.
type Wake = Arc<dyn Fn() + Send + Sync>;

enum Note {
    Open(Source),
    Follow(Watched),
    Cancel,
    /// Something happened in a watched folder.
    Stirred,
    /// The reading of this number has got so far.
    Shapes(u64, Source, Sketchable),
    Read(Box<Finished>),
    Environment(PathBuf),
    /// What came of this reading.
    EnvironmentRead(u64, Result<Arc<EnvironmentImage>, String>),
    Close,
}

struct Finished {
    number: u64,
    source: Source,
    /// When the reading began.
    began: SystemTime,
    result: Result<Loaded, String>,
}

/// Handle of the thread; dropping it stops the thread. A reading that goes on is left to end by itself.
pub struct Loader {
    notes: Sender<Note>,
    events: Receiver<LoadEvent>,
    loading: Arc<Mutex<Option<Loading>>>,
    thread: Option<JoinHandle<()>>,
}

impl Loader {
    /// Starts the thread; `wake` is called whenever there is an event or a reading begins or ends.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(args: SceneArgs, timing: Timing, wake: impl Fn() + Send + Sync + 'static) -> std::io::Result<Self> {
        let (notes, inbox) = mpsc::channel();
        let (outbox, events) = mpsc::channel();
        let loading = Arc::new(Mutex::new(None));
        let stirred = Arc::new(AtomicBool::new(false));
        let watcher = notify::recommended_watcher({
            let (stirred, notes) = (Arc::clone(&stirred), notes.clone());
            move |event: notify::Result<notify::Event>| {
                // Reading a file stirs nothing: only what may have changed one counts. A long write stirs thousands of
                // times; one note at a time is enough.
                if !event.is_ok_and(|event| event.kind.is_access()) && !stirred.swap(true, Ordering::AcqRel) {
                    // The thread has ended: nobody is interested any more.
                    let _ = notes.send(Note::Stirred);
                }
            }
        });
        let worker = Worker {
            args,
            timing,
            notes: notes.clone(),
            inbox,
            outbox,
            stirred,
            loading: Arc::clone(&loading),
            wake: Arc::new(wake),
            // Without a watcher the files are looked at now and then, as on drives that report nothing.
            watcher: watcher.ok(),
            watched: Vec::new(),
            number: 0,
            reading: None,
            open: None,
            environment: None,
            environment_number: 0,
        };
        let thread = std::thread::Builder::new().name("loader".into()).spawn(move || worker.run())?;
        Ok(Self { notes, events, loading, thread: Some(thread) })
    }

    /// Opens a scene; an earlier wish that is not fulfilled yet is given up.
    pub fn open(&self, source: Source) {
        self.send(Note::Open(source));
    }

    /// Goes back to following a scene that was opened before; it is read again, as its files may have changed meanwhile.
    pub fn follow(&self, watched: Watched) {
        self.send(Note::Follow(watched));
    }

    /// Gives up what is being read. A changed file that is given up is read when it changes again.
    pub fn cancel(&self) {
        self.send(Note::Cancel);
    }

    /// Reads an environment image in the background, and again whenever its file changes, until another one is asked for.
    pub fn load_environment(&self, path: PathBuf) {
        self.send(Note::Environment(path));
    }

    /// The next event, if there is one.
    pub fn poll(&self) -> Option<LoadEvent> {
        self.events.try_recv().ok()
    }

    /// What is being read.
    pub fn loading(&self) -> Option<Loading> {
        self.loading.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn send(&self, note: Note) {
        // The thread ends only when this handle is dropped.
        let _ = self.notes.send(note);
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.send(Note::Close);
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported by the panic hook.
            let _ = thread.join();
        }
    }
}

/// The scene whose files are watched.
struct Open {
    watched: Watched,
    rule: Rule,
    /// The files cannot be read: what lies beside them counts too.
    broken: bool,
    /// Read, but with images that do not decode: taken if nothing changes until then.
    doubtful: Option<(Loaded, Instant)>,
}

impl Open {
    /// With files that are read again once they rest.
    fn new(watched: Watched, timing: Timing) -> Self {
        let rule = Rule::after(Stamps::default(), timing, Instant::now());
        Self { watched, rule, broken: false, doubtful: None }
    }

    fn stamps(&self) -> Stamps {
        let files = &self.watched.files;
        if self.broken { Stamps::with_neighbours(files) } else { Stamps::of(files) }
    }

    /// Files have been named that were not looked at before the reading: if one was written since it began, or just
    /// before, all are read once more.
    fn watch_anew(&mut self, began: SystemTime, timing: Timing) {
        let stamps = self.stamps();
        let unsure = stamps.written_since(began.checked_sub(timing.quiet).unwrap_or(began));
        self.rule = Rule::after(if unsure { Stamps::default() } else { stamps }, timing, Instant::now());
    }
}

/// A reading under way.
enum ReadingOf {
    /// What was asked for.
    Wish,
    /// The open scene.
    Again,
}

struct Worker {
    args: SceneArgs,
    timing: Timing,
    notes: Sender<Note>,
    inbox: Receiver<Note>,
    outbox: Sender<LoadEvent>,
    /// A note that something happened is on its way.
    stirred: Arc<AtomicBool>,
    loading: Arc<Mutex<Option<Loading>>>,
    wake: Wake,
    watcher: Option<notify::RecommendedWatcher>,
    watched: Vec<PathBuf>,
    /// Counts readings; only the newest one's result is wanted.
    number: u64,
    reading: Option<ReadingOf>,
    open: Option<Open>,
    environment: Option<EnvironmentFile>,
    /// Counts its readings.
    environment_number: u64,
}

impl Worker {
    fn run(mut self) {
        let mut pause = IDLE;
        loop {
            match self.inbox.recv_timeout(pause) {
                Ok(Note::Open(source)) => self.begin(source),
                Ok(Note::Follow(watched)) => self.follow(watched),
                Ok(Note::Cancel) => self.cancel(),
                Ok(Note::Shapes(number, source, sketchable)) => {
                    if number == self.number && matches!(self.reading, Some(ReadingOf::Wish)) {
                        self.tell(LoadEvent::Shapes(source, sketchable));
                    }
                }
                Ok(Note::Read(finished)) => self.finish(*finished),
                Ok(Note::Environment(path)) => {
                    self.environment = Some(EnvironmentFile::new(path, self.timing));
                    self.watch();
                    self.read_environment();
                }
                Ok(Note::EnvironmentRead(number, result)) => self.finish_environment(number, result),
                Ok(Note::Stirred) => self.stirred.store(false, Ordering::Release),
                Err(RecvTimeoutError::Timeout) => {}
                Ok(Note::Close) | Err(RecvTimeoutError::Disconnected) => return,
            }
            pause = self.look().min(self.look_at_environment());
        }
    }

    /// Looks at the files and reads them if it is time; how long to wait for the next look.
    fn look(&mut self) -> Duration {
        let Some(open) = &mut self.open else { return IDLE };
        if self.reading.is_some() {
            return IDLE;
        }
        let now = Instant::now();
        let stamps = open.stamps();
        let step = open.rule.look(stamps, now);
        if step != Step::Rest {
            open.doubtful = None;
        }
        let accepted = open.doubtful.take_if(|(_, until)| now >= *until);
        let until_accepted = open.doubtful.as_ref().map(|(_, until)| *until - now);
        if let Some((loaded, _)) = accepted {
            self.show_again(loaded);
        }
        match step {
            Step::Rest => until_accepted.map_or(self.timing.poll, |left| left.min(self.timing.poll)),
            Step::Wait(left) => left,
            Step::Read => {
                self.read_again();
                IDLE
            }
        }
    }

    /// The same for the environment that edits name.
    fn look_at_environment(&mut self) -> Duration {
        match self.environment.as_mut().map_or(Step::Rest, |file| file.look(self.timing.poll)) {
            Step::Rest => IDLE,
            Step::Wait(left) => left,
            Step::Read => {
                self.read_environment();
                IDLE
            }
        }
    }

    fn read_environment(&mut self) {
        let Some(path) = self.environment.as_ref().map(|file| file.path.clone()) else { return };
        self.environment_number += 1;
        let (number, notes) = (self.environment_number, self.notes.clone());
        let spawned = std::thread::Builder::new().name("read environment".into()).spawn(move || {
            let result = tracer::environment::load(&path);
            let result = result.map(|loaded| Arc::new(loaded.image)).map_err(|error| error.to_string());
            // The loader is gone: nobody wants the image any more.
            let _ = notes.send(Note::EnvironmentRead(number, result));
        });
        if let Err(error) = spawned {
            self.finish_environment(number, Err(error.to_string()));
        }
    }

    fn finish_environment(&mut self, number: u64, result: Result<Arc<EnvironmentImage>, String>) {
        if number != self.environment_number {
            return;
        }
        let Some(file) = &mut self.environment else { return };
        // What was written to meanwhile is read once more.
        if file.is_steady() {
            let event = LoadEvent::Environment(file.path.clone(), result);
            self.tell(event);
        }
    }

    fn begin(&mut self, source: Source) {
        self.reading = Some(ReadingOf::Wish);
        self.read(source);
    }

    fn read_again(&mut self) {
        if let Some(open) = &self.open {
            let source = open.watched.source.clone();
            self.reading = Some(ReadingOf::Again);
            self.read(source);
        }
    }

    fn read(&mut self, source: Source) {
        self.number += 1;
        self.say(Some(Loading { name: source.name(), since: Instant::now() }));
        let (number, args, notes, began) = (self.number, self.args.clone(), self.notes.clone(), SystemTime::now());
        let spawned = std::thread::Builder::new().name("read scene".into()).spawn({
            let source = source.clone();
            move || {
                let sketch = |shapes| {
                    let (reading, shown) = mpsc::channel();
                    let sketchable = Sketchable { shapes, _reading: reading };
                    // Where nobody wants a sketch, the other end is gone at once.
                    let _ = notes.send(Note::Shapes(number, source.clone(), sketchable));
                    let _ = shown.recv_timeout(SKETCH);
                };
                let result = session::load_showing(&source, &args, sketch).map_err(|error| one_line(&error));
                // The loader is gone: nobody wants the scene any more.
                let _ = notes.send(Note::Read(Box::new(Finished { number, source, began, result })));
            }
        });
        if let Err(error) = spawned {
            self.finish(Finished { number: self.number, source, began, result: Err(error.to_string()) });
        }
    }

    fn follow(&mut self, watched: Watched) {
        // What is being read again is of another scene.
        if matches!(self.reading, Some(ReadingOf::Again)) {
            self.give_up();
        }
        self.open = Some(Open::new(watched, self.timing));
        self.watch();
        self.tell(LoadEvent::Followed);
    }

    fn cancel(&mut self) {
        if let (Some(ReadingOf::Again), Some(open)) = (&self.reading, &mut self.open) {
            // As they are now the files are not wanted.
            open.rule = Rule::after(open.stamps(), self.timing, Instant::now());
        }
        if self.reading.is_some() {
            self.give_up();
        }
    }

    fn give_up(&mut self) {
        self.number += 1;
        self.reading = None;
        self.say(None);
    }

    fn finish(&mut self, finished: Finished) {
        if finished.number != self.number {
            return;
        }
        match self.reading.take() {
            Some(ReadingOf::Wish) => self.finish_wish(finished),
            Some(ReadingOf::Again) => self.finish_again(finished.began, finished.result),
            None => {}
        }
        if self.reading.is_none() {
            self.say(None);
        }
    }

    fn finish_wish(&mut self, Finished { source, began, result, .. }: Finished) {
        match result {
            Ok(loaded) => {
                let mut open = Open::new(Watched::new(&source, &loaded), self.timing);
                open.watch_anew(began, self.timing);
                self.open = Some(open);
                self.watch();
                self.tell(LoadEvent::Opened(source, loaded));
            }
            Err(text) => self.tell(LoadEvent::NotOpened(text)),
        }
    }

    fn finish_again(&mut self, began: SystemTime, result: Result<Loaded, String>) {
        let Some(open) = &mut self.open else { return };
        let now = Instant::now();
        if open.rule.read(open.stamps(), now) == Reading::Torn {
            return;
        }
        match result {
            Ok(loaded) => {
                if open.broken || open.watched.files != loaded.files {
                    open.broken = false;
                    open.watched.files.clone_from(&loaded.files);
                    open.watch_anew(began, self.timing);
                }
                let known = &open.watched.replaced_images;
                match loaded.replaced_images.iter().find(|image| !known.contains(image)).cloned() {
                    None => self.show_again(loaded),
                    Some(text) => {
                        open.doubtful = Some((loaded, now + self.timing.grace));
                        self.tell(LoadEvent::Broken(text));
                    }
                }
                self.watch();
            }
            Err(text) => {
                if !open.broken {
                    open.broken = true;
                    // What lies beside the files counts from now on, and may have changed since: one more try.
                    open.rule = Rule::after(Stamps::default(), self.timing, now);
                }
                self.tell(LoadEvent::Broken(text));
            }
        }
    }

    fn show_again(&mut self, loaded: Loaded) {
        if let Some(open) = &mut self.open {
            open.watched.replaced_images.clone_from(&loaded.replaced_images);
        }
        self.tell(LoadEvent::Changed(loaded));
    }

    /// Watches the folders of the open scene's files and of its environment: a file that is replaced by renaming is seen in its folder.
    fn watch(&mut self) {
        let files = self.open.iter().flat_map(|open| &open.watched.files);
        let files: Vec<PathBuf> = files.chain(self.environment.iter().map(|file| &file.path)).cloned().collect();
        let wanted = folders(&files);
        let Some(watcher) = &mut self.watcher else { return };
        for folder in self.watched.iter().filter(|folder| !wanted.contains(folder)) {
            // A folder that is gone cannot be unwatched, and need not be.
            let _ = watcher.unwatch(folder);
        }
        for folder in wanted.iter().filter(|folder| !self.watched.contains(folder)) {
            // What cannot be watched is looked at now and then all the same.
            let _ = watcher.watch(folder, RecursiveMode::NonRecursive);
        }
        self.watched = wanted;
    }

    fn tell(&self, event: LoadEvent) {
        // The handle is gone only while it waits for this thread to end.
        let _ = self.outbox.send(event);
        (self.wake)();
    }

    fn say(&self, loading: Option<Loading>) {
        *self.loading.lock().unwrap_or_else(PoisonError::into_inner) = loading;
        (self.wake)();
    }
}
