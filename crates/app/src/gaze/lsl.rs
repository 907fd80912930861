//! Lab Streaming Layer: finding streams, reading one, and making gaze of its channels. Protocol 1.10, no C library.

pub mod inlet;
pub mod mapping;
pub mod resolve;

use super::feed::FeedSource;
use super::spec::LslSpec;

/// Starts a source for the first stream that fits.
pub fn source(spec: &LslSpec) -> FeedSource {
    FeedSource::start("gaze: lsl", inlet::Inlet::new(spec.clone()), false)
}
