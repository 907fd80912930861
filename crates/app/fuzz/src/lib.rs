//! The gaze parsers of the application, and what holds for each of them on any input.
//!
//! Every function here panics when a property fails; the fuzz targets call them, and so does the application's test that
//! replays the corpus.

#[path = "../../src/gaze/parse/mod.rs"]
pub mod parse;

pub mod properties;
