//! What the window does about files: dialogs, drops, recent ones, films to go on with, and its settings from run to run.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use egui::{Context, ThemePreference};
use tracer::film::FilmHeader;
use tracer::scene::Scene;

use super::Window;
use crate::cli::PreviewArgs;
use crate::document::sidecar;
use crate::output::exr::{self, FilmFile};
use crate::output::{OutputError, free_name};
use crate::preferences::{Preferences, Store, WindowPlace};
use crate::preview::background::Background;
use crate::preview::controls::Controls;
use crate::preview::dialogs::{Answer, Dialogs, Purpose};
use crate::preview::editor::Editor;
use crate::preview::engine::{Destination, Message, Request};
use crate::preview::overlay::Visibility;
use crate::preview::{file_menu, place};
use crate::recent::RecentFiles;
use crate::session::Source;

/// What was found in a file that may be a film.
enum FilmRead {
    /// A film, or why it cannot be read.
    Film(PathBuf, Result<Box<FilmFile>, OutputError>),
    /// Another image.
    Image(PathBuf),
}

/// A film to go on with.
pub(super) struct GoingOn {
    /// What its file is called.
    name: String,
    file: Box<FilmFile>,
    /// The view was brought to where it was taken.
    is_seen: bool,
}

impl GoingOn {
    pub(super) fn new(path: &Path, file: Box<FilmFile>) -> Self {
        Self { name: name_of(path), file, is_seen: false }
    }

    pub(super) fn header(&self) -> &FilmHeader {
        &self.file.film.header
    }
}

/// The window's files and settings.
pub(super) struct Files {
    store: Store,
    /// Opened before.
    pub recent: RecentFiles,
    /// Why settings could not be read, until it is said.
    pub trouble: Option<String>,
    dialogs: Dialogs,
    asked: Option<Purpose>,
    films: Background<FilmRead>,
    /// For the scene that is on its way.
    waiting: Vec<(Purpose, PathBuf)>,
    /// For the one that was opened just now.
    due: Vec<(Purpose, PathBuf)>,
    folder: Option<PathBuf>,
    theme: ThemePreference,
    place: Option<WindowPlace>,
    /// The window's place has been looked at since it opened.
    is_placed: bool,
}

impl Files {
    pub(super) fn new(store: Store, trouble: Option<String>) -> Self {
        let kept = store.kept();
        let recent = RecentFiles::new(kept.recent.iter().cloned());
        // Without a thread none counts as missing.
        let _ = recent.look();
        Self {
            recent,
            trouble,
            dialogs: Dialogs::default(),
            asked: None,
            films: Background::default(),
            waiting: Vec::new(),
            due: Vec::new(),
            folder: kept.folder.clone(),
            theme: kept.theme,
            place: kept.window,
            is_placed: false,
            store,
        }
    }

    /// Takes a file when the scene that is on its way is open.
    fn wait(&mut self, purpose: Purpose, path: PathBuf) {
        self.waiting.push((purpose, path));
    }

    /// What waits has its scene.
    pub(super) fn scene_is_open(&mut self) {
        self.due.append(&mut self.waiting);
    }

    /// The scene on its way does not come, or is another. Where there is none at all, what waits goes with the first that comes.
    pub(super) fn forget_waiting(&mut self, is_open: bool) {
        if is_open {
            self.waiting.clear();
        }
    }
}

/// What was kept counts where the command line says nothing.
pub(super) fn prefer(args: &PreviewArgs, kept: &Preferences, controls: &mut Controls, visibility: &mut Visibility) {
    let stated = |option: &str| args.stated.contains(&option);
    controls.mode = kept.mode.filter(|_| !stated("mode")).unwrap_or(controls.mode);
    controls.adaptive = kept.adaptive.filter(|_| !stated("adaptive")).unwrap_or(controls.adaptive);
    controls.exposure_ev = kept.exposure_ev.filter(|_| !stated("exposure")).unwrap_or(controls.exposure_ev);
    controls.tone_map = kept.tone_map.filter(|_| !stated("tonemap")).unwrap_or(controls.tone_map);
    controls.denoise = kept.denoise.filter(|_| !stated("denoise")).unwrap_or(controls.denoise);
    if let Some(panels) = kept.panels {
        *visibility = Visibility { gaze: visibility.gaze || panels.gaze, ..panels };
    }
}

impl Window {
    /// Light, dark, or as the system has it.
    pub fn theme(&self) -> ThemePreference {
        self.files.theme
    }

    /// Where the window was last.
    pub fn place(&self) -> Option<WindowPlace> {
        self.files.place
    }

    /// Keeps at once what is to be kept: the window closes.
    ///
    /// # Errors
    /// When the settings cannot be written.
    pub fn close(&mut self) -> anyhow::Result<()> {
        self.files.store.flush()
    }

    /// Carries out what the menu of files asks for; dialogs open with the next frame.
    pub(super) fn act_on_file(&mut self, action: file_menu::Action) {
        match action {
            file_menu::Action::Choose(purpose) => self.files.asked = Some(purpose),
            file_menu::Action::Open(path) => self.open_scene(Source::File(path)),
        }
    }

    /// Takes dropped files, answers of dialogs, films that were read, and what has changed of the settings.
    pub(super) fn follow_files(&mut self, ctx: &Context, frame: &eframe::Frame) {
        if !self.unsaved.is_asking() && !self.split.is_running() {
            self.take_files(ctx, frame);
        }
        self.remember(ctx, frame);
    }

    fn take_files(&mut self, ctx: &Context, frame: &eframe::Frame) {
        self.take_dropped_files(ctx);
        for (purpose, path) in std::mem::take(&mut self.files.due) {
            self.take_file(ctx, purpose, path);
        }
        if let Some(purpose) = self.files.asked.take() {
            let scene = self.scene.as_ref().map_or("picture", |(scene, _)| scene.name.as_str());
            let sidecar = self.editor.as_ref().map(Editor::sidecar);
            let (folder, name) = suggestion(purpose, self.files.folder.as_deref(), scene, sidecar);
            if let Err(error) = self.files.dialogs.ask(ctx, frame, purpose, folder.as_deref(), &name) {
                self.note = Some(Message::now(error.to_string(), true));
            }
        }
        match self.files.dialogs.poll() {
            Some(Answer::Chosen(purpose, path)) => self.take_file(ctx, purpose, path),
            Some(Answer::Unavailable) => {
                let text = "the system opened no dialog for files; drop the file onto the window instead";
                self.note = Some(Message::now(text.into(), true));
            }
            Some(Answer::Cancelled) | None => {}
        }
        if let Some(read) = self.files.films.poll() {
            self.take_film(read);
        }
    }

    /// Takes what was dropped: a scene first, and what is for it with that.
    fn take_dropped_files(&mut self, ctx: &Context) {
        let dropped: Vec<PathBuf> =
            ctx.input(|input| input.raw.dropped_files.iter().map(|file| file.path().to_owned()).collect());
        let (taken, left) = one_of_each(dropped);
        let brings_scene = taken.first().is_some_and(|(purpose, _)| *purpose == Purpose::Scene);
        for (purpose, path) in taken {
            if purpose != Purpose::Scene && brings_scene {
                self.files.wait(purpose, path);
            } else {
                self.take_file(ctx, purpose, path);
            }
        }
        if !left.is_empty() {
            let text = format!("only one file of a kind is taken at a time; left: {}", left.join(", "));
            self.note = Some(Message::now(text, true));
        }
    }

    /// Does with a file what it was chosen for.
    fn take_file(&mut self, ctx: &Context, purpose: Purpose, path: PathBuf) {
        self.files.folder = path.parent().filter(|folder| folder.is_absolute()).map(Path::to_owned);
        match purpose {
            Purpose::Scene => self.open_scene(Source::File(path)),
            Purpose::Environment => match &mut self.editor {
                Some(editor) => editor.set_environment(path),
                None => self.wait_for_scene(purpose, path),
            },
            Purpose::Film => {
                self.note = Some(Message::now(format!("reading {}", path.display()), false));
                let started = self.files.films.start(ctx, "read film", move || read_film(path));
                if let Err(error) = started {
                    self.note = Some(Message::now(error.to_string(), true));
                }
            }
            Purpose::Edits => match &mut self.editor {
                Some(editor) => editor.open_edits(&path),
                None => self.wait_for_scene(purpose, path),
            },
            Purpose::SavePicture => self.engine.request(Request::SavePng(Destination::File(path))),
            Purpose::SaveFilm => self.engine.request(Request::SaveExr(Destination::File(path))),
            Purpose::SaveEdits => {
                if let Some(editor) = &mut self.editor {
                    editor.save_as(&path);
                }
            }
        }
    }

    fn wait_for_scene(&mut self, purpose: Purpose, path: PathBuf) {
        self.note = Some(Message::now(format!("{} is taken when its scene is open", name_of(&path)), false));
        self.files.wait(purpose, path);
    }

    fn take_film(&mut self, read: FilmRead) {
        self.note = None;
        match read {
            FilmRead::Film(path, Ok(file)) => self.resume(&path, file),
            FilmRead::Film(_, Err(error)) => self.note = Some(Message::now(error.to_string(), true)),
            FilmRead::Image(path) => match &mut self.editor {
                Some(editor) => editor.set_environment(path),
                None => self.wait_for_scene(Purpose::Environment, path),
            },
        }
    }

    /// Has the engine go on with a film once the scene has the environment that its edits name: a film is of both. What the window
    /// looks at is told before: a film that is looked at from elsewhere starts anew.
    pub(super) fn go_on_with_film(&mut self, ctx: &Context) {
        let (Some((_, navigation)), Some(editor)) = (&mut self.scene, &self.editor) else { return };
        let Some(film) = self.film.as_mut().filter(|_| !editor.awaits_environment()) else { return };
        ctx.request_repaint();
        let lacks = editor.document().wanted_environment();
        if let Err(reason) = belongs(&film.file, editor.document().version(), lacks) {
            self.note = Some(Message::now(format!("{}: {reason}", film.name), true));
            self.film = None;
        } else if !std::mem::replace(&mut film.is_seen, true) {
            let view = navigation.standpoint.view;
            let aspect = view.tan_half.x / view.tan_half.y;
            let here = (view.film_from_view(), view.vfov());
            let (rotation, vfov) = super::opening::looking_at(film.header(), here, aspect);
            navigation.jump(film.header().pose.position, rotation, vfov);
        } else if let Some(film) = self.film.take() {
            self.engine.request(Request::GoOn(Arc::new(film.file.film)));
        }
    }

    /// A scene was opened.
    pub(super) fn add_recent(&mut self, source: &Source) {
        if let Source::File(path) = source {
            self.files.recent.add(path);
        }
        // As in `Files::new`.
        let _ = self.files.recent.look();
    }

    fn remember(&mut self, ctx: &Context, frame: &eframe::Frame) {
        if !std::mem::replace(&mut self.files.is_placed, true) {
            place::bring_back(ctx, frame);
        }
        let files = &mut self.files;
        files.theme = ctx.options(|options| options.theme_preference);
        files.place = place::of(ctx, files.place);
        let preferences = Preferences {
            theme: files.theme,
            mode: Some(self.controls.mode),
            adaptive: Some(self.controls.adaptive),
            exposure_ev: Some(self.controls.exposure_ev),
            tone_map: Some(self.controls.tone_map),
            denoise: Some(self.controls.denoise),
            panels: Some(Visibility { keys: false, ..self.visibility }),
            window: files.place,
            folder: files.folder.clone(),
            recent: files.recent.paths().to_vec(),
        };
        match files.store.remember(preferences, Instant::now()) {
            Ok(Some(wait)) => ctx.request_repaint_after(wait),
            Ok(None) => {}
            Err(error) => self.note = Some(Message::now(format!("settings are not kept: {error:#}"), true)),
        }
    }
}

/// The folder that a dialog opens in, and a name for a file that is to be written.
fn suggestion(purpose: Purpose, last: Option<&Path>, scene: &str, sidecar: Option<&Path>) -> (Option<PathBuf>, String) {
    let folder = last.unwrap_or(Path::new(""));
    let path = match purpose {
        Purpose::SavePicture => free_name(folder, scene, "png"),
        Purpose::SaveFilm => free_name(folder, scene, "exr"),
        // Where they are read again with the scene.
        Purpose::SaveEdits => sidecar.and_then(|path| std::path::absolute(path).ok()).unwrap_or_default(),
        Purpose::Scene | Purpose::Environment | Purpose::Film | Purpose::Edits => PathBuf::new(),
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let beside = path.parent().filter(|folder| folder.is_absolute()).map(Path::to_owned);
    (beside.or(last.map(Path::to_owned)), name)
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// The first of each kind of dropped files, a scene before what is for it, and the names of the others.
fn one_of_each(dropped: Vec<PathBuf>) -> (Vec<(Purpose, PathBuf)>, Vec<String>) {
    let (mut taken, mut left) = (Vec::<(Purpose, PathBuf)>::new(), Vec::new());
    for path in dropped {
        let purpose = purpose_of(&path);
        if taken.iter().any(|(other, _)| *other == purpose) {
            left.push(name_of(&path));
        } else {
            taken.push((purpose, path));
        }
    }
    // Edits name an environment of their own: one that is dropped beside them comes after.
    let order = [Purpose::Scene, Purpose::Edits, Purpose::Environment];
    taken.sort_by_key(|(purpose, _)| order.iter().position(|other| other == purpose).unwrap_or(order.len()));
    (taken, left)
}

/// What a dropped file is for, by its name, and by what is in it where edits have a name of their own.
fn purpose_of(path: &Path) -> Purpose {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let is = |ending: &str| name.ends_with(ending);
    if is(sidecar::ENDING) || is(".json") && sidecar::is_edits(path) {
        Purpose::Edits
    } else if is(".hdr") {
        Purpose::Environment
    } else if is(".exr") {
        // A film of fovea, or an environment.
        Purpose::Film
    } else {
        Purpose::Scene
    }
}

fn read_film(path: PathBuf) -> FilmRead {
    if exr::is_film(&path) {
        let result = exr::read(&path).map(Box::new);
        FilmRead::Film(path, result)
    } else {
        FilmRead::Image(path)
    }
}

/// Whether a film is of this version of the scene, which `lacks` an environment image that could not be read. Size, place, bounces
/// and seed are taken from the film.
fn belongs(file: &FilmFile, scene: &Scene, lacks: Option<&Path>) -> Result<(), String> {
    if file.film.header.scene == scene.content_hash() {
        return Ok(());
    }
    let name = file.settings.get("scene").and_then(|name| name.as_str()).unwrap_or("another scene");
    Err(if let Some(lacks) = lacks.filter(|_| name == scene.name) {
        format!("scene: its edits name an environment that could not be read, {}", lacks.display())
    } else if name == scene.name {
        format!("scene: another version of {name} (geometry, materials, lights, environment or cameras differ)")
    } else {
        format!("scene: {name} instead of {}", scene.name)
    })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::ffi::OsString;

    use tracer::film::FilmSnapshot;

    use super::*;
    use crate::cli;
    use crate::cli::choices::{Mode, ToneMapping};

    fn args(line: &str) -> PreviewArgs {
        cli::parse(format!("fovea {line}").split_whitespace().map(OsString::from)).unwrap().preview
    }

    #[test]
    fn what_is_kept_counts_where_the_command_line_says_nothing() {
        let kept = Preferences {
            mode: Some(Mode::Od),
            adaptive: Some(true),
            exposure_ev: Some(2.0),
            tone_map: Some(ToneMapping::Linear),
            denoise: Some(false),
            panels: Some(Visibility { editor: true, ring: false, ..Visibility::default() }),
            ..Preferences::default()
        };
        let preferred = |line: &str| {
            let args = args(line);
            let (mut controls, mut visibility) = (Controls::from(&args), Visibility::default());
            prefer(&args, &kept, &mut controls, &mut visibility);
            assert_eq!(controls.denoise, line.contains("denoise"), "{line}");
            let picture = (controls.exposure_ev, controls.tone_map);
            (controls.mode, controls.adaptive, picture, visibility.editor, visibility.ring)
        };
        assert_eq!(preferred(""), (Mode::Od, true, (2.0, ToneMapping::Linear), true, false));
        // A default that is asked for is asked for.
        let asked = preferred("--mode fv --exposure 0 --tonemap agx --denoise on");
        assert_eq!(asked, (Mode::Fv, true, (0.0, ToneMapping::Agx), true, false));
    }

    #[test]
    fn edits_are_proposed_to_be_saved_where_they_are_read_again() {
        let folder = std::path::absolute("scenes").unwrap();
        let last = std::path::absolute("elsewhere").unwrap();
        let beside = folder.join("room.glb.fovea.json");
        let proposed = |purpose: Purpose| suggestion(purpose, Some(&last), "room.glb", Some(&beside));
        assert_eq!(proposed(Purpose::SaveEdits), (Some(folder), "room.glb.fovea.json".into()));
        assert_eq!(proposed(Purpose::SavePicture), (Some(last.clone()), "room-1.png".into()));
        assert_eq!(proposed(Purpose::Edits), (Some(last.clone()), String::new()));
        for (name, purpose) in [
            ("room.glb.FOVEA.json", Purpose::Edits),
            ("room.gltf", Purpose::Scene),
            ("sky.HDR", Purpose::Environment),
            ("room-1.exr", Purpose::Film),
            ("hdr", Purpose::Scene),
        ] {
            assert_eq!(purpose_of(&last.join(name)), purpose, "{name}");
        }
    }

    #[test]
    fn of_dropped_files_the_scene_comes_first_and_one_of_each_kind_is_taken() {
        let folder = std::env::temp_dir().join(format!("fovea-dropped-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("night.json"), r#"{ "format": "fovea-edits", "version": 1 }"#).unwrap();
        std::fs::write(folder.join("scene.json"), r#"{ "asset": {} }"#).unwrap();
        let dropped = ["sky.hdr", "night.json", "scene.json", "other.hdr", "room.glb"].map(|name| folder.join(name));
        let (taken, left) = one_of_each(dropped.to_vec());
        let wanted = [(Purpose::Scene, 2), (Purpose::Edits, 1), (Purpose::Environment, 0)];
        assert_eq!(taken, wanted.map(|(purpose, index): (_, usize)| (purpose, dropped[index].clone())));
        assert_eq!(left, ["other.hdr", "room.glb"]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_film_of_another_scene_is_named() {
        let mut scene = tracer::builtin::scene().unwrap().0;
        let mut header = crate::output::header::tests::header(tracer::film::FilmMapping::Equirect);
        header.scene = scene.content_hash();
        let film = FilmSnapshot { header, words: Vec::new() };
        let mut file = FilmFile { film, settings: serde_json::Map::new() };
        file.settings.insert("scene".into(), scene.name.clone().into());
        assert_eq!(belongs(&file, &scene, None), Ok(()));
        scene.backdrop = tracer::scene::Backdrop::Color(glam::Vec3::ONE);
        assert!(belongs(&file, &scene, None).unwrap_err().contains("another version"));
        let sky = Path::new("sky.hdr");
        assert!(belongs(&file, &scene, Some(sky)).unwrap_err().contains("sky.hdr"));
        scene.name = "room.glb".into();
        let reason = belongs(&file, &scene, None).unwrap_err();
        assert!(reason.starts_with("scene: ") && reason.contains("room.glb"), "{reason}");
    }
}
