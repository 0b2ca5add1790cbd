//! What an example says on standard output, for somebody who may have stopped reading.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};

/// Writes a line, as `println!` does, which panics where nobody reads.
///
/// If standard output is closed, ends the program with exit code 0; if it fails otherwise, says so and ends it with 1. Motors of
/// the simulator end with it. A program with real ones has to send zeros first, as the bench does.
pub(crate) fn line(text: Arguments<'_>) {
    let Err(error) = writeln!(std::io::stdout(), "{text}") else { return };
    if error.kind() == ErrorKind::BrokenPipe {
        std::process::exit(0);
    }
    _ = writeln!(std::io::stderr(), "standard output: {error}");
    std::process::exit(1);
}
