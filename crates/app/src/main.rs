//! `fovea`: foveated progressive preview of glTF scenes.

use std::io::Write;
use std::process::ExitCode;

use fovea_app::cli::{self, Stop};
use fovea_app::{commands, session};

/// Exit status of everything that a person can mend.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let outcome = match cli::parse(std::env::args_os()) {
        Ok(cli) => commands::run(cli).map_err(|error| session::one_line(&error)),
        Err(Stop::Asked(text)) => commands::print_text(&text).map_err(|error| session::one_line(&error)),
        Err(Stop::Wrong(message)) => Err(message),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            // Nothing is left to be told when standard error is closed as well.
            let _ = writeln!(std::io::stderr(), "error: {message}");
            ExitCode::from(BAD_INPUT)
        }
    }
}
