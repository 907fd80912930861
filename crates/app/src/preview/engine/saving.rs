//! Saving the picture and the film.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;

use super::{Message, Worker, lock};
use crate::output::{exr, png};

impl Worker {
    /// The picture as it is shown: the headset's mirror while there is one.
    pub(super) fn save_png(&self, path: &Path) -> anyhow::Result<()> {
        if self.headset.is_some() {
            let ([width, height], texels) = self.screen.texels()?;
            return Ok(png::write(path, width, height, &texels)?);
        }
        let ([width, height], texels) = self.tracing.texels()?;
        Ok(png::write(path, width, height, &texels)?)
    }

    /// Reads the film back here and writes the file elsewhere: compressing a large film takes seconds.
    pub(super) fn save_exr(&mut self, path: PathBuf) -> anyhow::Result<Option<String>> {
        let look = lock(&self.shared.look).clone().context("there is no picture yet")?;
        let film = self.tracing.film(&look)?;
        let shared = Arc::clone(&self.shared);
        std::thread::Builder::new().name("save".into()).spawn(move || {
            let message = match exr::write(&path, &film) {
                Ok(()) => Message::now(format!("saved {}", path.display()), false),
                Err(error) => Message::now(error.to_string(), true),
            };
            lock(&shared.state).message = Some(message);
        })?;
        Ok(None)
    }
}
