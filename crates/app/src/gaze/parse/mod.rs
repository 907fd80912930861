//! What trackers send, from bytes to values: pure functions with bounded memory, none of which panics.
//!
//! This folder uses the standard library and `roxmltree` only, so that the fuzz targets compile it by path; that is why this
//! file is called `mod.rs`.

use std::fmt;

pub mod edid;
pub mod lsl_feed;
pub mod lsl_info;
pub mod msgpack;
pub mod opengaze;
pub mod pupil;
pub mod trace;
pub mod zmtp;

/// Why bytes were refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ParseError {
    /// More bytes than the format ever needs.
    TooLong {
        /// What was too long.
        what: &'static str,
        /// Bytes that would have been accepted.
        limit: usize,
    },
    /// Not in the format.
    Malformed(String),
    /// In the format, but of a kind that is not understood.
    Unsupported(String),
}

impl ParseError {
    pub(crate) fn malformed(what: impl Into<String>) -> Self {
        Self::Malformed(what.into())
    }
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong { what, limit } => write!(f, "{what} is longer than {limit} bytes"),
            Self::Malformed(what) => f.write_str(what),
            Self::Unsupported(what) => write!(f, "not supported: {what}"),
        }
    }
}

impl std::error::Error for ParseError {}

/// At most 60 characters of foreign text, for a message: control characters become `?`.
pub(crate) fn excerpt(text: &str) -> String {
    text.chars().take(60).map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// A finite number; NaN and infinities are refused like text.
pub(crate) fn finite(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|value: &f64| value.is_finite())
}
