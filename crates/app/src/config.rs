//! The folder for this program's settings, and small JSON files in it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::Value;

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

/// Renames a file that makes no sense to this program, so that whoever wrote it still has it; its new name, which no other
/// file had.
///
/// # Errors
/// When it cannot be renamed.
pub fn put_aside(path: &Path) -> std::io::Result<PathBuf> {
    let numbered = (2_u32..).map(|number| path.with_extension(format!("broken-{number}.json")));
    let mut names = std::iter::once(path.with_extension("broken.json")).chain(numbered);
    let aside = names.find(|name| !name.exists()).ok_or(std::io::ErrorKind::AlreadyExists)?;
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
    let temporary = path.with_extension("json.new");
    std::fs::write(&temporary, format!("{value:#}\n")).with_context(|| temporary.display().to_string())?;
    std::fs::rename(&temporary, path).with_context(|| path.display().to_string())
}
