//! What a session's states ask of the program.

use openxr::SessionState;

use super::error::VrError;
use openxr::sys::Result as Code;

/// What is to be done on entering a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deed {
    /// Begin to hand over frames.
    Begin,
    /// Stop handing over frames; the session may be begun again.
    End,
    /// Leave the headset: its system asked for it.
    Leave,
    /// The session is lost.
    Lose,
}

/// Where a session is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lifecycle {
    state: SessionState,
    running: bool,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self { state: SessionState::IDLE, running: false }
    }
}

impl Lifecycle {
    /// Takes in a change of state, and says what it asks for.
    pub fn change(&mut self, state: SessionState) -> Option<Deed> {
        self.state = state;
        let deed = match state {
            SessionState::READY if !self.running => Deed::Begin,
            SessionState::STOPPING if self.running => Deed::End,
            SessionState::EXITING => Deed::Leave,
            SessionState::LOSS_PENDING => Deed::Lose,
            _ => return None,
        };
        self.running = deed == Deed::Begin;
        Some(deed)
    }

    /// Whether frames are to be handed over: between begin and end.
    pub fn is_running(&self) -> bool {
        self.running
    }

    /// Whether somebody looks and can press buttons.
    pub fn is_focused(&self) -> bool {
        self.state == SessionState::FOCUSED
    }

    /// The state in words.
    pub fn words(&self) -> &'static str {
        match self.state {
            SessionState::FOCUSED => "in the headset",
            SessionState::VISIBLE => "in the headset, behind its menu",
            SessionState::SYNCHRONIZED | SessionState::READY => "the headset is not being worn",
            SessionState::STOPPING | SessionState::EXITING => "leaving the headset",
            SessionState::LOSS_PENDING => "the headset is being lost",
            _ => "waiting for the headset",
        }
    }
}

/// Why a session is over.
#[derive(Debug)]
pub enum Ended {
    /// Somebody asked for it in the headset.
    Asked,
    /// The runtime is gone or going.
    Lost(VrError),
}

impl Ended {
    /// The runtime has announced that it goes.
    pub fn announced() -> Self {
        Self::Lost(VrError::Lost(Code::ERROR_INSTANCE_LOST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_begins_ends_and_begins_again() {
        let mut lifecycle = Lifecycle::default();
        let deeds = [
            (SessionState::IDLE, None, false),
            (SessionState::READY, Some(Deed::Begin), true),
            (SessionState::SYNCHRONIZED, None, true),
            (SessionState::VISIBLE, None, true),
            (SessionState::FOCUSED, None, true),
            (SessionState::VISIBLE, None, true),
            (SessionState::SYNCHRONIZED, None, true),
            (SessionState::STOPPING, Some(Deed::End), false),
            (SessionState::IDLE, None, false),
            (SessionState::READY, Some(Deed::Begin), true),
            (SessionState::FOCUSED, None, true),
            (SessionState::STOPPING, Some(Deed::End), false),
            (SessionState::IDLE, None, false),
            (SessionState::EXITING, Some(Deed::Leave), false),
        ];
        for (state, deed, running) in deeds {
            assert_eq!(lifecycle.change(state), deed, "{state:?}");
            assert_eq!(lifecycle.is_running(), running, "{state:?}");
            assert_eq!(lifecycle.is_focused(), state == SessionState::FOCUSED);
        }
    }

    #[test]
    fn repeated_and_early_states_do_nothing_twice() {
        let mut lifecycle = Lifecycle::default();
        assert_eq!(lifecycle.change(SessionState::STOPPING), None, "never begun, so nothing to end");
        assert_eq!(lifecycle.change(SessionState::READY), Some(Deed::Begin));
        assert_eq!(lifecycle.change(SessionState::READY), None);
        assert_eq!(lifecycle.change(SessionState::LOSS_PENDING), Some(Deed::Lose));
        assert!(!lifecycle.is_running());
    }
}
