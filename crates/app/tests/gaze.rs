//! Gaze from synthetic eyes through every protocol's simulator, against real peers, and against bad input.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "gaze/bad_input.rs"]
mod bad_input;
#[path = "gaze/corpus.rs"]
mod corpus;
#[path = "gaze/figures.rs"]
mod figures;
#[path = "gaze/peers.rs"]
mod peers;
#[path = "gaze/simulators/mod.rs"]
mod simulators;
#[path = "gaze/sources.rs"]
mod sources;
#[path = "gaze/synthetic.rs"]
mod synthetic;
