//! The system's dialogs for files. They are open beside the window, which goes on meanwhile.

use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::time::{Duration, Instant};

use egui::Context;
use rfd::{AsyncFileDialog, FileHandle};

use super::background::Background;
use crate::output::free_name;

/// Nobody has looked at a dialog that is gone so soon: there was none.
const NO_DIALOG: Duration = Duration::from_millis(300);

/// What a file is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A scene to open.
    Scene,
    /// An environment image to light the scene with.
    Environment,
    /// A film to go on with.
    Film,
    /// Edits to put onto the scene.
    Edits,
    /// The picture is to be saved.
    SavePicture,
    /// The film is to be saved.
    SaveFilm,
    /// The edits are to be saved.
    SaveEdits,
}

impl Purpose {
    /// The dialog's title, what such files are called, their endings, and whether one is written.
    fn describe(self) -> (&'static str, &'static str, &'static [&'static str], bool) {
        match self {
            Self::Scene => ("Open a scene", "glTF scenes", &["glb", "gltf"], false),
            Self::Environment => ("Open an environment image", "HDR images", &["hdr", "exr"], false),
            Self::Film => ("Go on with a film", "Films", &["exr"], false),
            Self::Edits => ("Open edits", "Edits", &["json"], false),
            Self::SavePicture => ("Save the picture", "PNG", &["png"], true),
            Self::SaveFilm => ("Save the film", "OpenEXR", &["exr"], true),
            Self::SaveEdits => ("Save the edits", "Edits", &["json"], true),
        }
    }

    /// A name that was chosen for a new file, with the ending of what is written where it has another or none. The dialog has
    /// not asked whether that one may be replaced.
    fn complete(self, path: PathBuf) -> PathBuf {
        let (_, _, endings, writes) = self.describe();
        let has = |ending: &&str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(ending));
        let (Some(name), Some(ending)) = (path.file_name(), endings.first()) else { return path };
        if !writes || endings.iter().any(has) {
            return path;
        }
        let name = name.to_string_lossy();
        let completed = path.with_file_name(format!("{name}.{ending}"));
        if completed.exists() { free_name(path.parent().unwrap_or(Path::new("")), &name, ending) } else { completed }
    }
}

/// What came of a dialog.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A file was chosen.
    Chosen(Purpose, PathBuf),
    /// Nobody wants a file after all.
    Cancelled,
    /// The system has no dialog.
    Unavailable,
}

/// At most one dialog at a time.
#[derive(Debug, Default)]
pub struct Dialogs {
    answers: Background<Answer>,
    is_open: bool,
}

impl Dialogs {
    /// Opens a dialog in a folder, with a name for a file that is to be written.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn ask(
        &mut self,
        ctx: &Context,
        frame: &eframe::Frame,
        purpose: Purpose,
        folder: Option<&Path>,
        name: &str,
    ) -> std::io::Result<()> {
        if self.is_open {
            return Ok(());
        }
        let (title, kind, endings, writes) = purpose.describe();
        let mut dialog = AsyncFileDialog::new().set_title(title).add_filter(kind, endings).set_parent(frame);
        if let Some(folder) = folder {
            dialog = dialog.set_directory(folder);
        }
        let started = Instant::now();
        // macOS wants dialogs to be made on the window's thread; their ends can be waited for on any.
        let chosen: Pin<Box<dyn Future<Output = Option<FileHandle>> + Send>> = match writes {
            true => Box::pin(dialog.set_file_name(name).save_file()),
            false => Box::pin(dialog.pick_file()),
        };
        self.answers.start(ctx, "dialog", move || match pollster::block_on(chosen) {
            Some(file) => Answer::Chosen(purpose, purpose.complete(file.path().to_owned())),
            None if started.elapsed() < NO_DIALOG => Answer::Unavailable,
            None => Answer::Cancelled,
        })?;
        self.is_open = true;
        Ok(())
    }

    /// The answer, when there is one.
    pub fn poll(&mut self) -> Option<Answer> {
        let answer = self.answers.poll()?;
        self.is_open = false;
        Some(answer)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_new_files_name_gets_its_ending() {
        let complete = |purpose: Purpose, name: &str| purpose.complete(PathBuf::from(name));
        for (purpose, name, completed) in [
            (Purpose::SavePicture, "a", "a.png"),
            (Purpose::SavePicture, "room.v2", "room.v2.png"),
            (Purpose::SavePicture, "room.jpg", "room.jpg.png"),
            (Purpose::SavePicture, "room.PNG", "room.PNG"),
            (Purpose::SaveFilm, "room.png", "room.png.exr"),
            (Purpose::SaveEdits, "room.fovea.json", "room.fovea.json"),
            (Purpose::Scene, "room", "room"),
            (Purpose::Environment, "sky.jpg", "sky.jpg"),
        ] {
            assert_eq!(complete(purpose, name), PathBuf::from(completed), "{purpose:?}");
        }
    }

    #[test]
    fn a_file_that_nobody_was_asked_about_is_not_replaced() {
        let folder = std::env::temp_dir().join(format!("fovea-dialogs-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("room.v2.png"), "").unwrap();
        assert_eq!(Purpose::SavePicture.complete(folder.join("room.v2")), folder.join("room.v2-1.png"));
        assert_eq!(Purpose::SavePicture.complete(folder.join("room.v2.png")), folder.join("room.v2.png"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
