//! The arguments of an example, for `lexopt` to parse.

use std::ffi::OsString;
use std::fmt::Display;
use std::io::Write;

/// Returns a parser of the arguments of the program `example`.
///
/// If an argument is not UTF-8, names it on standard error and ends the program with exit code 2.
pub(crate) fn of(example: &str) -> lexopt::Parser {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    if let Some(argument) = arguments.iter().find(|argument| argument.to_str().is_none()) {
        refuse(example, format_args!("the argument {argument:?} is not UTF-8"));
    }
    lexopt::Parser::from_args(arguments)
}

/// Says on standard error what is wrong with the arguments of the program `example`, and ends it with exit code 2.
pub(crate) fn refuse(example: &str, message: impl Display) -> ! {
    // Nobody is left to be told when standard error is closed.
    _ = writeln!(std::io::stderr(), "{example}: {message}");
    std::process::exit(2)
}
