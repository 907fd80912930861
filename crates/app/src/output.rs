//! Files that are written: beside their place, then renamed, so that no file is ever half written.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use thiserror::Error;

pub mod exr;
pub mod header;
pub mod png;

/// Why an image file could not be written or read. `Display` is one line that names the file.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The name ends neither in .exr nor in .png.
    #[error("{}: unknown image format; the name must end in .exr or .png", .0.display())]
    UnknownFormat(PathBuf),
    /// The place cannot be written.
    #[error("{}: cannot be written: {reason}", path.display())]
    Unwritable {
        /// The file that was asked for.
        path: PathBuf,
        /// The system's reason.
        reason: String,
    },
    /// The pixels do not fill the image.
    #[error("{}: {found} pixels for an image of {width}x{height}", path.display())]
    WrongSize {
        /// The file that was asked for.
        path: PathBuf,
        /// Pixels handed over.
        found: usize,
        /// Pixels.
        width: usize,
        /// Pixels.
        height: usize,
    },
    /// The file is no image of the expected kind.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// What kind of image file to write, by the name's ending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// Linear radiance, variance and sample counts.
    Exr,
    /// Tone-mapped, 8 bits a channel.
    Png,
}

impl ImageFormat {
    /// The format of a file name; upper and lower case are the same.
    pub fn of(path: &Path) -> Result<Self, OutputError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(OutputError::UnknownFormat(path.to_owned())),
        }
    }
}

/// Finds out, before the work is done, whether `path` could be written. Leaves nothing behind.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    let unwritable = |reason: String| OutputError::Unwritable { path: path.to_owned(), reason };
    let target = target(path)?;
    if target.metadata().is_ok_and(|metadata| metadata.permissions().readonly()) {
        return Err(unwritable("the existing file is read-only".into()));
    }
    let beside = beside(&target);
    File::create_new(&beside).map_err(|error| unwritable(error.to_string()))?;
    std::fs::remove_file(&beside).map_err(|error| unwritable(error.to_string()))
}

/// Lets `write` fill a new file beside `path`, then renames it. An error leaves what was at `path` as it was.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), OutputError> {
    let unwritable = |reason: String| OutputError::Unwritable { path: path.to_owned(), reason };
    let target = target(path)?;
    let beside = beside(&target);
    let file = File::create_new(&beside).map_err(|error| unwritable(error.to_string()))?;
    let mut writer = BufWriter::new(file);
    let written = write(&mut writer)
        .and_then(|()| writer.flush().map_err(|error| error.to_string()))
        .and_then(|()| writer.get_ref().sync_all().map_err(|error| error.to_string()));
    drop(writer);
    written.and_then(|()| std::fs::rename(&beside, &target).map_err(|error| error.to_string())).map_err(|reason| {
        // The first error is the one to report; a leftover that cannot be removed either is named nowhere else.
        let _ = std::fs::remove_file(&beside);
        unwritable(reason)
    })
}

/// A name in `folder` for a picture of `scene` that no file has yet: `scene-1.png`, `scene-2.png` and so on.
pub fn free_name(folder: &Path, scene: &str, extension: &str) -> PathBuf {
    let [path] = free_names(folder, scene, [extension]);
    path
}

/// Such names for files that belong together, which differ in their endings alone.
pub fn free_names<const N: usize>(folder: &Path, scene: &str, extensions: [&str; N]) -> [PathBuf; N] {
    let stem = scene.strip_suffix(".glb").or_else(|| scene.strip_suffix(".gltf")).unwrap_or(scene);
    // A scene's name may hold anything; a file's name may not.
    let stem: String = stem.chars().map(|c| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '_' }).collect();
    let names = |number: u64| extensions.map(|extension| folder.join(format!("{stem}-{number}.{extension}")));
    (1..).map(names).find(|names| !names.iter().any(|path| path.exists())).unwrap_or_else(|| names(0))
}

/// Writes a text as [`write_atomically`] does.
///
/// # Errors
/// When the file cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    write_atomically(path, |writer| writer.write_all(text.as_bytes()).map_err(|error| error.to_string()))
}

/// The file that is to be replaced: a link stays, and what it leads to is written. Folders are refused, and so are devices and
/// pipes, whose place a file would take.
fn target(path: &Path) -> Result<PathBuf, OutputError> {
    let unwritable = |reason: String| OutputError::Unwritable { path: path.to_owned(), reason };
    if path.file_name().is_none() {
        return Err(unwritable("it names no file".into()));
    }
    if path.to_string_lossy().ends_with(std::path::is_separator) || path.is_dir() {
        return Err(unwritable("it is a folder".into()));
    }
    if path.metadata().is_ok_and(|metadata| !metadata.is_file()) {
        return Err(unwritable("it is a device or pipe".into()));
    }
    // A link that leads nowhere is replaced.
    if path.is_symlink() && path.exists() {
        return path.canonicalize().map_err(|error| unwritable(error.to_string()));
    }
    Ok(path.to_owned())
}

/// A name in the same folder that no other write uses, of this process or another.
fn beside(path: &Path) -> PathBuf {
    static WRITES: AtomicU64 = AtomicU64::new(0);
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(path.file_name().unwrap_or_default());
    hidden.push(format!(".{}-{}.part", std::process::id(), WRITES.fetch_add(1, Ordering::Relaxed)));
    path.with_file_name(hidden)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("fovea-output-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn the_ending_decides_the_format() {
        assert_eq!(ImageFormat::of(Path::new("a/b.EXR")).unwrap(), ImageFormat::Exr);
        assert_eq!(ImageFormat::of(Path::new("b.png")).unwrap(), ImageFormat::Png);
        for name in ["b", "b.jpg", ".png", ""] {
            assert!(ImageFormat::of(Path::new(name)).is_err(), "{name}");
        }
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_nothing_beside_it() {
        let folder = scratch("failed");
        let path = folder.join("image.png");
        std::fs::write(&path, "old").unwrap();
        let error = write_atomically(&path, |writer| {
            writer.write_all(b"half").map_err(|error| error.to_string())?;
            Err("disk full".into())
        });
        assert!(error.unwrap_err().to_string().contains("disk full"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        write_atomically(&path, |writer| writer.write_all(b"new").map_err(|error| error.to_string())).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn writes_of_one_file_at_a_time_do_not_meet() {
        let folder = scratch("at-a-time");
        let path = folder.join("image.png");
        write_atomically(&path, |outer| {
            write_atomically(&path, |inner| inner.write_all(b"first").map_err(|error| error.to_string()))
                .map_err(|error| error.to_string())?;
            outer.write_all(b"second").map_err(|error| error.to_string())
        })
        .unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn names_are_free_and_fit_for_a_file() {
        let folder = scratch("names");
        assert_eq!(free_name(&folder, "a room.glb", "png"), folder.join("a room-1.png"));
        std::fs::write(folder.join("a room-1.png"), "").unwrap();
        assert_eq!(free_name(&folder, "a room.glb", "png"), folder.join("a room-2.png"));
        assert_eq!(free_names(&folder, "a room.glb", ["csv", "png"])[0], folder.join("a room-2.csv"));
        assert_eq!(free_name(&folder, "../x/y", "exr"), folder.join(".._x_y-1.exr"));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn unwritable_places_are_named_before_the_work() {
        let folder = scratch("unwritable");
        let missing = folder.join("no such folder").join("image.exr");
        let message = check_writable(&missing).unwrap_err().to_string();
        assert!(message.contains("no such folder") && !message.contains('\n'), "{message}");
        assert!(check_writable(&folder).unwrap_err().to_string().contains("folder"));
        let trailing = PathBuf::from(format!("{}/", folder.join("image.exr").display()));
        assert!(check_writable(&trailing).unwrap_err().to_string().contains("folder"));
        assert!(check_writable(&folder.join("image.exr")).is_ok());
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    #[cfg(unix)]
    fn links_stay_and_devices_are_refused() {
        let folder = scratch("links");
        let (link, film) = (folder.join("latest.exr"), folder.join("film.exr"));
        std::os::unix::fs::symlink("film.exr", &link).unwrap();
        std::fs::write(&film, "old").unwrap();
        check_writable(&link).unwrap();
        write_text(&link, "new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read_to_string(&film).unwrap(), "new");
        let device = folder.join("null.exr");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        for path in [&device, Path::new("/dev/null")] {
            assert!(check_writable(path).unwrap_err().to_string().contains("device"));
        }
        assert!(write_text(&device, "").is_err());
        std::fs::remove_dir_all(folder).unwrap();
    }
}
