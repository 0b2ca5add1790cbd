//! Reads a log of candump and tells what the motors in it did.
//!
//! `cargo run --example candump -- --motors "m3508:1-4,gm6020:1" drive.log`, or `candump can0 | .. candump`; `--help`
//! lists the options.

#[path = "../arguments/mod.rs"]
mod arguments;
mod motor;
#[path = "../motors/mod.rs"]
mod motors;
mod options;
mod replay;
mod report;

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::process::ExitCode;

use options::{Asked, Options};

fn main() -> ExitCode {
    let options = match options::parse(arguments::of("candump")) {
        Ok(Asked::Run(options)) => options,
        Ok(Asked::Help) => return finish(writeln!(io::stdout(), "{}", options::help())),
        Err(message) => {
            arguments::refuse("candump", format_args!("{message}\n\n{}", options::help()))
        }
    };
    let input: Box<dyn BufRead> = match options.file.as_deref() {
        None | Some("-") => Box::new(io::stdin().lock()),
        Some(path) => match File::open(path) {
            Ok(file) => Box::new(BufReader::new(file)),
            Err(error) => {
                let _ = writeln!(io::stderr(), "candump: cannot open {path}: {error}");
                return ExitCode::FAILURE;
            }
        },
    };
    finish(run(options, input))
}

fn run(options: Options, input: impl BufRead) -> io::Result<()> {
    let mut output = io::BufWriter::new(io::stdout().lock());
    report::run(options, input, &mut output, &mut io::stderr())?;
    output.flush()
}

/// A reader that has seen enough (`| head`) is no error.
fn finish(result: io::Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "candump: {error}");
            ExitCode::FAILURE
        }
    }
}
