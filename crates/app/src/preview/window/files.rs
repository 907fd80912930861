//! What the window does about files: dialogs, drops, recent ones, films to go on with, and its settings from run to run.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use egui::{Context, ThemePreference};
use tracer::film::FilmSnapshot;
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
    /// To go on with as soon as the window stands where it was taken.
    film: Option<Arc<FilmSnapshot>>,
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
            film: None,
            folder: kept.folder.clone(),
            theme: kept.theme,
            place: kept.window,
            is_placed: false,
            store,
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
        if !self.unsaved.is_asking() {
            self.take_files(ctx, frame);
        }
        self.remember(ctx, frame);
    }

    fn take_files(&mut self, ctx: &Context, frame: &eframe::Frame) {
        self.open_dropped_file(ctx);
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

    fn open_dropped_file(&mut self, ctx: &Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if let Some(path) = dropped {
            self.take_file(ctx, purpose_of(&path), path);
        }
    }

    /// Does with a file what it was chosen for.
    fn take_file(&mut self, ctx: &Context, purpose: Purpose, path: PathBuf) {
        self.files.folder = path.parent().filter(|folder| folder.is_absolute()).map(Path::to_owned);
        match purpose {
            Purpose::Scene => self.open_scene(Source::File(path)),
            Purpose::Environment => {
                if let Some(editor) = &mut self.editor {
                    editor.set_environment(path);
                }
            }
            Purpose::Film => {
                self.note = Some(Message::now(format!("reading {}", path.display()), false));
                let started = self.files.films.start(ctx, "read film", move || read_film(path));
                if let Err(error) = started {
                    self.note = Some(Message::now(error.to_string(), true));
                }
            }
            Purpose::Edits => match &mut self.editor {
                Some(editor) => editor.open_edits(&path),
                None => self.note = Some(Message::now("edits are opened after their scene".into(), true)),
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

    fn take_film(&mut self, read: FilmRead) {
        let (path, result) = match read {
            FilmRead::Film(path, result) => (path, result),
            FilmRead::Image(path) => {
                self.note = None;
                if let Some(editor) = &mut self.editor {
                    editor.set_environment(path);
                }
                return;
            }
        };
        self.note = None;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        match (result, &mut self.scene, &self.editor) {
            (Err(error), ..) => self.note = Some(Message::now(error.to_string(), true)),
            (Ok(file), Some((_, navigation)), Some(editor)) => match belongs(&file, editor.document().version()) {
                Ok(()) => {
                    let view = navigation.standpoint.view;
                    let aspect = view.tan_half.x / view.tan_half.y;
                    let here = (view.film_from_view(), view.vfov());
                    let (rotation, vfov) = super::opening::looking_at(&file.film.header, here, aspect);
                    navigation.jump(file.film.header.pose.position, rotation, vfov);
                    self.files.film = Some(Arc::new(file.film));
                }
                Err(reason) => self.note = Some(Message::now(format!("{name}: {reason}"), true)),
            },
            // The scene is still on its way.
            (Ok(file), ..) => self.resume(file.film),
        }
    }

    /// Has the engine go on with a film. What the window looks at must have been told before: a film that is looked at from
    /// elsewhere starts anew.
    pub(super) fn go_on_with_film(&mut self) {
        if let Some(film) = self.files.film.take() {
            self.engine.request(Request::GoOn(film));
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

/// What a dropped file is for, by its name.
fn purpose_of(path: &Path) -> Purpose {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let is = |ending: &str| name.ends_with(ending);
    if is(sidecar::ENDING) {
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

/// Whether a film is of this version of the scene. Size, place, bounces and seed are taken from the film.
fn belongs(file: &FilmFile, scene: &Scene) -> Result<(), String> {
    if file.film.header.scene == scene.content_hash() {
        return Ok(());
    }
    let name = file.settings.get("scene").and_then(|name| name.as_str()).unwrap_or("another scene");
    Err(if name == scene.name {
        format!("scene: another version of {name} (geometry, materials, lights, environment or cameras differ)")
    } else {
        format!("scene: {name} instead of {}", scene.name)
    })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::ffi::OsString;

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
    fn a_film_of_another_scene_is_named() {
        let mut scene = tracer::builtin::scene().unwrap().0;
        let mut header = crate::output::header::tests::header(tracer::film::FilmMapping::Equirect);
        header.scene = scene.content_hash();
        let film = FilmSnapshot { header, words: Vec::new() };
        let mut file = FilmFile { film, settings: serde_json::Map::new() };
        file.settings.insert("scene".into(), scene.name.clone().into());
        assert_eq!(belongs(&file, &scene), Ok(()));
        scene.backdrop = tracer::scene::Backdrop::Color(glam::Vec3::ONE);
        assert!(belongs(&file, &scene).unwrap_err().contains("another version"));
        scene.name = "room.glb".into();
        let reason = belongs(&file, &scene).unwrap_err();
        assert!(reason.starts_with("scene: ") && reason.contains("room.glb"), "{reason}");
    }
}
