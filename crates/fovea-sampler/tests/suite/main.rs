//! The crate's integration tests, one binary: references, certification, statistics, layers, sequences.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod certification;
mod common;
mod layers;
mod paper_error;
mod reference;
mod robustness;
mod sequences;
mod statistics;
