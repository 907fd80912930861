//! The files that were opened last.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// How many are kept.
pub const MOST: usize = 10;

/// Files, the newest first, and which of them are gone.
#[derive(Clone, Debug, Default)]
pub struct RecentFiles {
    paths: Vec<PathBuf>,
    missing: Arc<Mutex<BTreeSet<PathBuf>>>,
}

impl RecentFiles {
    /// These files, as far as there is room for them; each once.
    pub fn new(paths: impl IntoIterator<Item = PathBuf>) -> Self {
        let mut recent = Self::default();
        for path in paths {
            if recent.paths.len() < MOST && !recent.paths.contains(&path) {
                recent.paths.push(path);
            }
        }
        recent
    }

    /// The newest first.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// A file was opened. Its name is made to mean the same wherever the program is started from.
    pub fn add(&mut self, path: &Path) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        self.paths.retain(|known| *known != path);
        self.paths.insert(0, path);
        self.paths.truncate(MOST);
    }

    /// Forgets a file.
    pub fn remove(&mut self, path: &Path) {
        self.paths.retain(|known| known != path);
    }

    /// Whether a file was not there at the last look.
    pub fn is_missing(&self, path: &Path) -> bool {
        self.missing.lock().unwrap_or_else(PoisonError::into_inner).contains(path)
    }

    /// Looks for the files, on a thread of its own: a drive that does not answer holds nobody up.
    pub fn look(&self) -> std::io::Result<std::thread::JoinHandle<()>> {
        let (paths, missing) = (self.paths.clone(), Arc::clone(&self.missing));
        std::thread::Builder::new().name("recent files".into()).spawn(move || {
            let gone = paths.into_iter().filter(|path| !path.exists()).collect();
            *missing.lock().unwrap_or_else(PoisonError::into_inner) = gone;
        })
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn the_newest_come_first_each_once_and_ten_at_most() {
        let name = |number: usize| PathBuf::from(format!("/scenes/{number}.glb"));
        let mut recent = RecentFiles::new((0..20).map(name).chain([name(0)]));
        assert_eq!(recent.paths().len(), MOST);
        recent.add(&name(3));
        recent.add(&name(77));
        assert_eq!(recent.paths()[..3], [77, 3, 0].map(name));
        assert_eq!(recent.paths().len(), MOST);
        assert_eq!(recent.paths().iter().filter(|path| **path == name(3)).count(), 1);
        recent.remove(&name(77));
        assert_eq!(recent.paths()[0], name(3));
    }

    #[test]
    fn missing_files_are_known_as_such() {
        let here = std::env::current_exe().unwrap();
        let gone = here.with_file_name("no such scene.glb");
        let recent = RecentFiles::new([here.clone(), gone.clone()]);
        recent.look().unwrap().join().unwrap();
        assert!(recent.is_missing(&gone) && !recent.is_missing(&here));
    }
}
