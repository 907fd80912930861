//! The system's dialogs for files. They are open beside the window, which goes on meanwhile.

use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::time::{Duration, Instant};

use egui::Context;
use rfd::{AsyncFileDialog, FileHandle};

use super::background::Background;

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

    /// A name that was chosen for a new file, with an ending if it has none.
    fn complete(self, path: PathBuf) -> PathBuf {
        let (_, _, endings, writes) = self.describe();
        if writes && path.extension().is_none() { path.with_extension(endings[0]) } else { path }
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
mod tests {
    use super::*;

    #[test]
    fn a_new_files_name_gets_its_ending() {
        let complete = |purpose: Purpose, name: &str| purpose.complete(PathBuf::from(name));
        assert_eq!(complete(Purpose::SavePicture, "a"), PathBuf::from("a.png"));
        assert_eq!(complete(Purpose::SaveFilm, "room.v2"), PathBuf::from("room.v2"));
        assert_eq!(complete(Purpose::Scene, "room"), PathBuf::from("room"));
    }
}
