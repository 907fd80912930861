//! Saving the picture and the film.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;

use anyhow::Context;

use super::{Message, Worker, lock};
use crate::output::{exr, free_name, png};

/// Where a file is saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Destination {
    /// Here; what is there is replaced.
    File(PathBuf),
    /// In a folder, by the first name of a scene that is free when the file is written: what was asked for before has its own.
    Free {
        /// The folder.
        folder: PathBuf,
        /// The scene.
        scene: String,
    },
}

impl Destination {
    fn path(self, extension: &str) -> PathBuf {
        match self {
            Self::File(path) => path,
            Self::Free { folder, scene } => free_name(&folder, &scene, extension),
        }
    }
}

/// A film that is being written; no end of the engine cuts it short.
#[derive(Default)]
pub(super) struct Saving(Option<JoinHandle<()>>);

impl Saving {
    fn finish(&mut self) {
        if let Some(thread) = self.0.take() {
            // A panic of the thread has been reported by the panic hook.
            let _ = thread.join();
        }
    }
}

impl Drop for Saving {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Worker {
    /// The picture as it is shown: the headset's mirror while there is one.
    pub(super) fn save_png(&self, to: Destination) -> anyhow::Result<Option<String>> {
        let path = to.path("png");
        self.busy(Some(format!("saving {}", path.display())));
        if self.headset.is_some() {
            let ([width, height], texels) = self.screen.texels()?;
            png::write(&path, width, height, &texels)?;
        } else {
            let ([width, height], texels) = self.tracing.texels()?;
            png::write(&path, width, height, &texels)?;
        }
        Ok(Some(saved(&path)))
    }

    /// Reads the film back here and writes the file elsewhere: compressing a large film takes seconds. The film before it is
    /// awaited: its name is not taken until its file is there, and a film is large.
    pub(super) fn save_exr(&mut self, to: Destination) -> anyhow::Result<Option<String>> {
        if self.saving.0.is_some() {
            self.busy(Some("saving the film before".into()));
            self.saving.finish();
        }
        let path = to.path("exr");
        self.busy(Some(format!("saving {}", path.display())));
        let look = lock(&self.shared.look).clone().context("there is no picture yet")?;
        let film = self.tracing.film(&look)?;
        let (shared, repaint) = (Arc::clone(&self.shared), Arc::clone(&self.repaint));
        let thread = std::thread::Builder::new().name("save".into()).spawn(move || {
            let message = match exr::write(&path, &film) {
                Ok(()) => Message::now(saved(&path), false),
                Err(error) => Message::now(error.to_string(), true),
            };
            lock(&shared.state).message = Some(message);
            repaint();
        })?;
        self.saving = Saving(Some(thread));
        Ok(None)
    }
}

fn saved(path: &Path) -> String {
    format!("saved {}", path.display())
}
