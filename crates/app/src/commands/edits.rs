//! `--edits`: what the window saved of a scene, for the commands without one.

use std::path::Path;

use anyhow::{Context, anyhow};

use crate::cli::values::EditsChoice;
use crate::document::{Document, sidecar};
use crate::session::{Loaded, Source};

/// Puts the edits that were asked for onto a scene. Where none were, but some lie beside it, a note says so.
///
/// # Errors
/// When the file of edits, or an environment image that it names, cannot be read.
pub fn apply(choice: Option<&EditsChoice>, source: &Source, loaded: &mut Loaded) -> anyhow::Result<()> {
    let beside = sidecar::beside(source);
    let path: &Path = match choice {
        Some(EditsChoice::Beside) => &beside,
        Some(EditsChoice::File(path)) => path,
        Some(EditsChoice::None) => return Ok(()),
        None => {
            if beside.exists() {
                let note = format!("the edits in {} are left out; --edits beside takes them", beside.display());
                loaded.notes.push(note);
            }
            return Ok(());
        }
    };
    let mut document = Document::new(loaded);
    let absent = document.load_edits(path).map_err(|reason| anyhow!(reason)).context("--edits")?;
    loaded.notes.extend(absent.iter().map(|part| format!("{}: the scene has no {part}", path.display())));
    if let Some(image) = document.wanted_environment().map(Path::to_owned) {
        let read = tracer::environment::load(&image).with_context(|| path.display().to_string())?;
        document.add_environment(image, read.image.into());
    }
    loaded.scene = document.version().clone();
    Ok(())
}
