//! The arguments of an example, as text.

use std::ffi::OsString;
use std::fmt::Display;
use std::io::Write;

/// Returns what stands behind the name of the program `example`.
///
/// If an argument is not UTF-8, names it on standard error and ends the program with exit code 2.
pub(crate) fn of(example: &str) -> std::vec::IntoIter<String> {
    let arguments = std::env::args_os().skip(1).map(OsString::into_string);
    let arguments: Result<Vec<_>, _> = arguments.collect();
    let arguments = arguments.unwrap_or_else(|argument| {
        refuse(example, format_args!("the argument {argument:?} is not UTF-8"))
    });
    arguments.into_iter()
}

/// Says on standard error what is wrong with the arguments of the program `example`, and ends it with exit code 2.
pub(crate) fn refuse(example: &str, message: impl Display) -> ! {
    // Nobody is left to be told when standard error is closed.
    _ = writeln!(std::io::stderr(), "{example}: {message}");
    std::process::exit(2)
}
