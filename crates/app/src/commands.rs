//! What `fovea` does without a window, a module a command.

use std::io::Write;

use anyhow::Context;
use serde_json::Value;

use crate::cli::{Cli, Command};

pub mod adapters;
pub mod bench;
mod edits;
pub mod gaze;
pub mod info;
pub mod merge;
pub mod render;
pub mod sampler;
pub mod study;

/// Carries out a command line.
///
/// # Errors
/// Whatever keeps the command from doing what it was asked for.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        None => crate::preview::run(&cli.preview),
        Some(Command::Render(args)) => render::run(&args),
        Some(Command::Merge(args)) => merge::run(&args),
        Some(Command::Info(args)) => info::run(&args),
        Some(Command::Adapters(args)) => adapters::run(&args),
        Some(Command::Gaze(args)) => gaze::run(&args),
        Some(Command::Sampler(args)) => sampler::run(&args),
        Some(Command::Study(args)) => study::run(&args),
        Some(Command::Bench(args)) => bench::run(&args),
    }
}

/// Prints one JSON object on standard output.
///
/// # Errors
/// When standard output is closed.
pub fn print_json(value: &Value) -> anyhow::Result<()> {
    print_text(&format!("{value:#}\n"))
}

/// Prints text on standard output.
///
/// # Errors
/// When standard output is closed.
pub fn print_text(text: &str) -> anyhow::Result<()> {
    std::io::stdout().lock().write_all(text.as_bytes()).context("standard output")
}
