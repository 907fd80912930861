//! Where a measurement was made: what goes with every number of a report or a bench.

use std::{fmt, path::Path, process::Command, time::SystemTime};

use crate::gpu::Gpu;

/// Machine, adapter and revision.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Processor, hardware threads, operating system, build profile.
    pub machine: String,
    /// Graphics adapter, backend and driver, or why there is none.
    pub adapter: String,
    /// Revision of the source tree that the program was built from, and whether it has changes.
    pub commit: String,
}

impl Provenance {
    /// Of this process, measuring on `gpu`.
    #[must_use]
    pub fn on(gpu: &Gpu) -> Self {
        let info = gpu.info();
        let driver = format!("{} {}", info.driver, info.driver_info);
        Self::without_gpu(&format!("{} ({}, {})", info.name, info.backend, driver.trim()))
    }

    /// Of this process, measuring on the CPU alone; `reason` says why there is no adapter.
    #[must_use]
    pub fn without_gpu(reason: &str) -> Self {
        Self { machine: machine(), adapter: reason.to_owned(), commit: commit(Path::new(env!("CARGO_MANIFEST_DIR"))) }
    }

    /// Names and values, for JSON.
    #[must_use]
    pub fn fields(&self) -> [(&'static str, &str); 3] {
        [("machine", &self.machine), ("adapter", &self.adapter), ("commit", &self.commit)]
    }
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value) in self.fields() {
            writeln!(f, "{:<9}{value}", format!("{name}:"))?;
        }
        Ok(())
    }
}

fn machine() -> String {
    // Only Linux has this file; elsewhere the architecture must do.
    let cpu = std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let cpu = cpu.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let profile = if cfg!(debug_assertions) { "dev" } else { "release" };
    format!("{cpu}, {threads} threads, {}, {profile}", std::env::consts::OS)
}

/// Revision of a crate's sources, where they still are: a revision within the program would build all that is here anew for each
/// commit.
fn commit(sources: &Path) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(sources).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    // Sources that somebody unpacked within a repository of his own are none of its files.
    let head =
        git(&["ls-files", "--error-unmatch", "Cargo.toml"]).and_then(|_| git(&["rev-parse", "--short=12", "HEAD"]));
    let Some(head) = head else { return "unknown (the sources' git checkout is not here)".into() };
    let committed = git(&["log", "-1", "--format=%ct"]).and_then(|text| text.parse().ok()).unwrap_or(0);
    let is_older = built_secs().is_some_and(|built| built < committed);
    let is_changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_none_or(|changes| !changes.is_empty());
    match (is_older, is_changed) {
        (true, _) => format!("{head} or one before it"),
        (false, true) => format!("{head} with changes"),
        (false, false) => head,
    }
}

/// When this program was built, seconds since 1970.
fn built_secs() -> Option<u64> {
    let written = std::env::current_exe().ok()?.metadata().ok()?.modified().ok()?;
    Some(written.duration_since(SystemTime::UNIX_EPOCH).ok()?.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_says_something() {
        let provenance = Provenance::without_gpu("none asked for");
        for (name, value) in provenance.fields() {
            assert!(!value.is_empty(), "{name}");
            assert!(provenance.to_string().contains(value), "{provenance}");
        }
    }

    #[test]
    fn the_commit_is_that_of_the_sources() -> std::io::Result<()> {
        let folder = std::env::temp_dir().join(format!("fovea-commit-{}", std::process::id()));
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join("Cargo.toml"), "")?;
        let git = |words: &str, date: &str| {
            let mut command = Command::new("git");
            command.arg("-C").arg(&folder).args(["-c", "user.name=a", "-c", "user.email=a@b"]);
            let output = command.args(words.split(' ')).env("GIT_COMMITTER_DATE", date).output();
            output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
        };
        let is_unknown = |commit: String| assert!(commit.starts_with("unknown"), "{commit}");
        is_unknown(commit(&folder));
        // Long before this test was built, and long after.
        let (before, after) = ("2001-01-01T00:00:00Z", "2099-01-01T00:00:00Z");
        git("init --quiet", before)?;
        git("commit --quiet --allow-empty -m a", before)?;
        is_unknown(commit(&folder));
        git("add Cargo.toml", before)?;
        git("commit --quiet -m a", before)?;
        let old = git("rev-parse --short=12 HEAD", before)?;
        assert_eq!(commit(&folder), old);
        std::fs::write(folder.join("Cargo.toml"), "changed")?;
        assert_eq!(commit(&folder), format!("{old} with changes"));
        git("commit --quiet --amend -m b", after)?;
        let new = git("rev-parse --short=12 HEAD", after)?;
        assert_eq!(commit(&folder), format!("{new} or one before it"));
        std::fs::remove_dir_all(folder)
    }
}
