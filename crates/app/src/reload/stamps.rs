//! What a set of files looks like from outside: when two looks are equal, nobody wrote in between.

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Most entries of a folder that are looked at; beyond that a folder's own time must do.
const MOST_ENTRIES: usize = 4096;

/// One file's length, time of the last write, and identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Bytes.
    pub length: u64,
    /// When it was last written to; `None` where the system does not say.
    pub modified: Option<SystemTime>,
    /// Tells a file from another that took its name: the inode, 0 where there is none.
    pub identity: u64,
}

impl Stamp {
    fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        let identity = std::os::unix::fs::MetadataExt::ino(metadata);
        #[cfg(not(unix))]
        let identity = 0;
        Self { length: metadata.len(), modified: metadata.modified().ok(), identity }
    }
}

/// The stamps of several files; a missing file has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stamps(BTreeMap<PathBuf, Option<Stamp>>);

impl Stamps {
    /// Looks at files.
    pub fn of(files: &[PathBuf]) -> Self {
        let stamp = |path: &PathBuf| (path.clone(), path.metadata().ok().as_ref().map(Stamp::of));
        Self(files.iter().map(stamp).collect())
    }

    /// Looks at files and at all that lies beside them: what an unreadable scene lacks may be a file that no scene has
    /// named yet.
    pub fn with_neighbours(files: &[PathBuf]) -> Self {
        let mut stamps = Self::of(files);
        for folder in folders(files) {
            let Ok(entries) = std::fs::read_dir(&folder) else { continue };
            for entry in entries.flatten().take(MOST_ENTRIES) {
                let stamp = entry.metadata().ok().filter(Metadata::is_file);
                stamps.0.insert(entry.path(), stamp.as_ref().map(Stamp::of));
            }
        }
        stamps
    }

    /// Whether a file was written to after `time`, or may have been.
    pub fn written_since(&self, time: SystemTime) -> bool {
        self.0.values().flatten().any(|stamp| stamp.modified.is_none_or(|modified| modified > time))
    }

    /// Stamps that somebody else has read.
    #[cfg(test)]
    pub fn made(stamps: impl IntoIterator<Item = (PathBuf, Option<Stamp>)>) -> Self {
        Self(stamps.into_iter().collect())
    }
}

/// The folders that files lie in, each once.
pub fn folders(files: &[PathBuf]) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = files
        .iter()
        .map(|file| match file.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        })
        .collect();
    folders.sort();
    folders.dedup();
    folders
}
