//! When a changed file is read: once nobody writes any more, and again when somebody wrote meanwhile.
//!
//! The rule sees stamps and a clock, nothing else. It reads files only after they have kept their stamps for
//! [`Timing::quiet`], which is longer than a file system's clock tick. A write during the reading therefore always shows
//! in the stamps afterwards, and what was read is dropped: no scene is made of two versions of its files, unless their
//! writer pauses for longer than that in the middle.

use std::time::{Duration, Instant};

use super::stamps::Stamps;

/// How patient the rule is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Files rest for so long before they are read. Longer: fewer half-written files are tried; shorter: changes show
    /// sooner. At least 20 ms, the coarsest clock tick of common file systems that hold scenes.
    pub quiet: Duration,
    /// How often files are looked at where the system reports no changes, as on some network drives.
    pub poll: Duration,
    /// How long an image that does not decode counts as still being written.
    pub grace: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self { quiet: Duration::from_millis(120), poll: Duration::from_secs(1), grace: Duration::from_secs(3) }
    }
}

/// What to do about the files now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing, until something happens.
    Rest,
    /// Look again after this long.
    Wait(Duration),
    /// Read them.
    Read,
}

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The files were one version from beginning to end.
    Steady,
    /// Somebody wrote meanwhile: what was read counts for nothing.
    Torn,
}

/// The rule's memory.
#[derive(Clone, Debug)]
pub struct Rule {
    timing: Timing,
    /// The stamps at which files were last read to the end.
    read: Stamps,
    /// The newest stamps, and since when they have been so.
    seen: Stamps,
    since: Instant,
}

impl Rule {
    /// After files with these stamps have been read.
    pub fn after(read: Stamps, timing: Timing, now: Instant) -> Self {
        Self { timing, seen: read.clone(), read, since: now }
    }

    /// Takes a look into account.
    pub fn look(&mut self, stamps: Stamps, now: Instant) -> Step {
        if stamps != self.seen {
            self.seen = stamps;
            self.since = now;
        }
        if self.seen == self.read {
            return Step::Rest;
        }
        let rested = now.saturating_duration_since(self.since);
        match self.timing.quiet.checked_sub(rested) {
            Some(left) if !left.is_zero() => Step::Wait(left),
            _ => Step::Read,
        }
    }

    /// Compares the stamps after a reading with those before it, the newest ones of [`Rule::look`].
    pub fn read(&mut self, after: Stamps, now: Instant) -> Reading {
        if after == self.seen {
            self.read = after;
            return Reading::Steady;
        }
        self.seen = after;
        self.since = now;
        Reading::Torn
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::time::SystemTime;

    use super::super::stamps::Stamp;
    use super::*;

    const QUIET: Duration = Duration::from_millis(100);

    fn stamps(write: u64) -> Stamps {
        let modified = SystemTime::UNIX_EPOCH + Duration::from_millis(write);
        Stamps::made([(PathBuf::from("a.glb"), Some(Stamp { length: 8, modified: Some(modified), identity: 1 }))])
    }

    fn missing() -> Stamps {
        Stamps::made([(PathBuf::from("a.glb"), None)])
    }

    fn rule() -> (Rule, impl Fn(u64) -> Instant) {
        let start = Instant::now();
        let timing = Timing { quiet: QUIET, ..Timing::default() };
        (Rule::after(stamps(0), timing, start), move |ms| start + Duration::from_millis(ms))
    }

    #[test]
    fn a_change_is_read_once_it_has_rested() {
        let (mut rule, at) = rule();
        assert_eq!(rule.look(stamps(0), at(10)), Step::Rest);
        assert_eq!(rule.look(stamps(1), at(20)), Step::Wait(QUIET));
        assert_eq!(rule.look(stamps(1), at(90)), Step::Wait(Duration::from_millis(30)));
        // Another write: the clock starts again.
        assert_eq!(rule.look(stamps(2), at(110)), Step::Wait(QUIET));
        assert_eq!(rule.look(stamps(2), at(210)), Step::Read);
        assert_eq!(rule.read(stamps(2), at(230)), Reading::Steady);
        assert_eq!(rule.look(stamps(2), at(240)), Step::Rest);
    }

    #[test]
    fn a_write_during_the_reading_drops_it() {
        let (mut rule, at) = rule();
        rule.look(stamps(1), at(0));
        assert_eq!(rule.look(stamps(1), at(100)), Step::Read);
        assert_eq!(rule.read(stamps(2), at(150)), Reading::Torn);
        assert_eq!(rule.look(stamps(2), at(160)), Step::Wait(Duration::from_millis(90)));
        assert_eq!(rule.look(stamps(2), at(250)), Step::Read);
        assert_eq!(rule.read(stamps(2), at(260)), Reading::Steady);
    }

    #[test]
    fn a_file_that_is_replaced_by_deleting_it_first_is_not_missed() {
        let (mut rule, at) = rule();
        assert_eq!(rule.look(missing(), at(0)), Step::Wait(QUIET));
        assert_eq!(rule.look(stamps(1), at(50)), Step::Wait(QUIET));
        assert_eq!(rule.look(stamps(1), at(150)), Step::Read);
    }

    #[test]
    fn what_comes_back_unchanged_is_not_read_again() {
        let (mut rule, at) = rule();
        rule.look(missing(), at(0));
        assert_eq!(rule.look(stamps(0), at(30)), Step::Rest);
    }
}
