//! The environment image that edits name: read when it is asked for, and again when its file has changed.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::rule::{Reading, Rule, Step, Timing};
use super::stamps::Stamps;

/// A watched environment image.
pub(super) struct EnvironmentFile {
    pub path: PathBuf,
    rule: Rule,
    is_being_read: bool,
}

impl EnvironmentFile {
    /// One that is about to be read.
    pub fn new(path: PathBuf, timing: Timing) -> Self {
        let rule = Rule::after(Stamps::of(std::slice::from_ref(&path)), timing, Instant::now());
        Self { path, rule, is_being_read: true }
    }

    fn stamps(&self) -> Stamps {
        Stamps::of(std::slice::from_ref(&self.path))
    }

    /// Looks at the file: whether to read it, when to look again, or neither until it has been read.
    pub fn look(&mut self, poll: Duration) -> Step {
        if self.is_being_read {
            return Step::Rest;
        }
        let step = self.rule.look(self.stamps(), Instant::now());
        self.is_being_read = step == Step::Read;
        if step == Step::Rest { Step::Wait(poll) } else { step }
    }

    /// It has been read; whether nobody wrote to it meanwhile.
    pub fn is_steady(&mut self) -> bool {
        self.is_being_read = false;
        self.rule.read(self.stamps(), Instant::now()) == Reading::Steady
    }
}
