//! The only argument of an example that draws: where the picture goes.

#[path = "../arguments/mod.rs"]
mod arguments;
#[path = "../console/mod.rs"]
pub(crate) mod console;

use lexopt::Arg::{Long, Short, Value};

/// Returns the file for the picture, `example` with the ending `.svg` by default.
///
/// If there is anything else, says how the example is called, and ends it.
pub(crate) fn path(example: &str) -> String {
    let usage = format!("usage: {example} [FILE.svg]");
    let (mut arguments, mut path) = (arguments::of(example), None);
    loop {
        match arguments.next() {
            Ok(Some(Value(file))) if path.is_none() => path = file.into_string().ok(),
            Ok(Some(Short('h') | Long("help"))) => {
                console::line(format_args!("{usage}"));
                std::process::exit(0);
            }
            Ok(None) => return path.unwrap_or_else(|| format!("{example}.svg")),
            Ok(Some(_)) | Err(_) => arguments::refuse(example, usage),
        }
    }
}
