//! Foveated progressive preview of glTF scenes: the desktop window and the headless commands of `fovea`.
//!
//! The renderer is the crate `tracer`; this crate turns command lines, pointers and windows into its settings, and its
//! films into pictures.
//!
//! Angles are radians unless a name ends in `_deg`; degrees appear at the command line and on screen only.

pub mod attention;
pub mod cli;
pub mod commands;
pub mod config;
pub mod convergence;
pub mod document;
pub mod film;
pub mod gaze;
pub mod output;
pub mod pick;
pub mod preferences;
pub mod preview;
pub mod process;
pub mod readback;
pub mod recent;
pub mod reload;
pub mod sampling;
pub mod screen;
pub mod session;
pub mod settings;
pub mod split_times;
pub mod tev;
pub mod view;
#[cfg(any(target_os = "linux", target_os = "windows"))]
pub mod vr;

/// The README's example compiles.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
