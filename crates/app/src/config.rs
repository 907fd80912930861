//! The folder for this program's settings, and small JSON files in it.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::Value;

use crate::output::write_atomically;

/// Where the system keeps a program's settings; `None` when it names no such place.
pub fn folder() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let base = if cfg!(windows) {
        variable("APPDATA")
    } else if cfg!(target_os = "macos") {
        variable("HOME").map(|home| home.join("Library/Application Support"))
    } else {
        variable("XDG_CONFIG_HOME").or_else(|| variable("HOME").map(|home| home.join(".config")))
    };
    base.map(|base| base.join("fovea"))
}

/// A file's value; `Null` when there is no file.
///
/// # Errors
/// One line that names the file, when it cannot be read or is no JSON.
pub fn read(path: &Path) -> Result<Value, String> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Value::Null),
        Err(error) => return Err(format!("{}: {error}", path.display())),
    };
    serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Names for other versions of a file, in order: `NAME.word.json`, `NAME.word-2.json` and so on.
pub fn names_beside(path: &Path, word: &str) -> impl Iterator<Item = PathBuf> {
    let endings =
        std::iter::once(format!("{word}.json")).chain((2_u32..).map(move |number| format!("{word}-{number}.json")));
    endings.map(|ending| path.with_extension(ending))
}

/// Renames a file that makes no sense to this program, so that whoever wrote it still has it; its new name, which no other
/// file had.
///
/// # Errors
/// When it cannot be renamed.
pub fn put_aside(path: &Path) -> std::io::Result<PathBuf> {
    let aside = names_beside(path, "broken").find(|name| !name.exists()).ok_or(std::io::ErrorKind::AlreadyExists)?;
    std::fs::rename(path, &aside).map(|()| aside)
}

/// Puts a value in the file's place in one step, so that an interrupted write leaves the old file.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, value: &Value) -> anyhow::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    Ok(write_atomically(path, |writer| writeln!(writer, "{value:#}").map_err(|error| error.to_string()))?)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn what_another_window_is_writing_is_left_alone() {
        let folder = std::env::temp_dir().join(format!("fovea-config-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let path = folder.join("settings.json");
        write(&path, &Value::from(1)).unwrap();
        // Whatever another process calls its half-written file.
        let others = ["settings.json.new", ".settings.json.0.part"].map(|name| folder.join(name));
        others.iter().for_each(|other| std::fs::write(other, "half").unwrap());
        write(&path, &Value::from(2)).unwrap();
        assert_eq!(read(&path).unwrap(), Value::from(2));
        others.iter().for_each(|other| assert_eq!(std::fs::read_to_string(other).unwrap(), "half"));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 3);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
