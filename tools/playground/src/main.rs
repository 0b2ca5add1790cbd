//! Runs a script of the playground on this machine, and prints the hash of all frames on the bus.
//!
//! ```text
//! cargo run --release -p drivetrain-playground -- [FILE]
//! ```
//!
//! Without a file: the tour that the page runs too. The page prints the script of what was done in it, and its hash.

use drivetrain_playground::tour;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = match std::env::args_os().nth(1) {
        None => tour::run(tour::TOUR),
        Some(path) => std::fs::read_to_string(&path)
            .map_err(|error| format!("{}: {error}", path.display()))
            .and_then(|script| tour::run(&script)),
    };
    let (line, code) = match outcome {
        Ok(session) => {
            (format!("{:016x} after {} ms", session.hash(), session.millis()), ExitCode::SUCCESS)
        }
        Err(why) => (why, ExitCode::FAILURE),
    };
    // A closed pipe is no reason to panic.
    _ = writeln!(std::io::stdout(), "{line}");
    code
}
