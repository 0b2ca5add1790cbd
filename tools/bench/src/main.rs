//! The bench: motors over CAN in a terminal. `drivetrain-bench --help` says what it does; without options the robot is simulated.
//!
//! The data path is [`session`]: a device ([`robot`]) over a link ([`link`]) with what records both. The window draws a
//! [`snapshot`] of it and sends [`window`]'s actions; the [`commands`] lead it by a task each.

mod commands;
mod drive;
mod end;
mod guess;
mod help;
mod identifying;
mod ledger;
mod link;
#[path = "../../../examples/motors/mod.rs"]
mod motors;
mod options;
mod outcome;
mod outlet;
#[path = "../../../examples/motors/own.rs"]
mod own;
mod pace;
mod program;
mod record;
mod robot;
mod session;
mod snapshot;
mod tap;
mod text;
mod time;
mod traffic;
mod tuning;
mod window;

use options::{Asked, Command};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = std::env::args_os().skip(1).collect();
    let options = match options::parse(arguments) {
        Ok(Asked::Run(options)) => options,
        Ok(Asked::Help) => {
            commands::println(&help::text());
            return ExitCode::SUCCESS;
        }
        Err(error) => return refuse(&error, 2),
    };
    if let Err(error) = commands::check(&options) {
        return refuse(&error, 2);
    }
    let end = match end::End::new() {
        Ok(end) => end,
        Err(error) => return refuse(&error.to_string(), 1),
    };
    let done = match options.command {
        Command::Window => window::run(&options, &end),
        _ => commands::run(&options, &end),
    };
    done.unwrap_or_else(|error| refuse(&error, 1))
}

/// Says on standard error what is wrong.
fn refuse(error: &str, code: u8) -> ExitCode {
    _ = writeln!(std::io::stderr(), "bench: {error}");
    ExitCode::from(code)
}
