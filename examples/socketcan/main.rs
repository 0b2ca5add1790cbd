//! Motors of any family from a PC, with any CAN adapter that Linux knows (SocketCAN). Lift the wheels first.
//!
//! ```text
//! sudo ip link set can0 up type can bitrate 1000000
//! cargo run --release --example socketcan -- can0 --motors m3508:1,damiao4310:1-2
//! ```
//!
//! The program turns each output shaft at 30 rpm for 5 s with little torque; `robot.rs` has the mode, the speed and the limit of each
//! family. The smallest whole program: zeros also where it is halted, a full queue and a record are what the bench does
//! (`cargo run --release -p drivetrain-bench`).

#![cfg_attr(not(target_os = "linux"), allow(unused))]

#[path = "../arguments/mod.rs"]
mod arguments;
#[path = "../motors/mod.rs"]
mod motors;
#[path = "../motors/own.rs"]
mod own;
mod robot;

use lexopt::prelude::*;
use robot::Robot;
use std::error::Error;
use std::io::{Write as _, stderr, stdout};
use std::process::ExitCode;

const HELP: &str = "\
usage: socketcan INTERFACE [--motors LIST]

Turns motors gently for 5 s and leaves them at rest. Lift the wheels first.

  --motors LIST     model:ids, for instance \"m3508:1-4,damiao4310:1\" (default: m3508:1)";

fn main() -> ExitCode {
    let (interface, robot) = match options(arguments::of("socketcan")) {
        Ok(Some(options)) => options,
        Ok(None) => {
            _ = writeln!(stdout(), "{HELP}\n\n  models            {}", motors::MODELS);
            return ExitCode::SUCCESS;
        }
        Err(error) => arguments::refuse("socketcan", format_args!("{error}\n\n{HELP}")),
    };
    match run(&interface, robot) {
        Ok(report) => {
            _ = stdout().write_all(report.as_bytes());
            ExitCode::SUCCESS
        }
        Err(error) => {
            _ = writeln!(stderr(), "socketcan: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Returns the interface and its motors; `None` for the help.
fn options(mut arguments: lexopt::Parser) -> Result<Option<(String, Robot)>, Box<dyn Error>> {
    let (mut interface, mut list) = (None, "m3508:1".to_owned());
    while let Some(argument) = arguments.next()? {
        match argument {
            Short('h') | Long("help") => return Ok(None),
            Long("motors") => list = arguments.value()?.string()?,
            Value(name) if interface.is_none() => interface = Some(name.string()?),
            other => return Err(other.unexpected().into()),
        }
    }
    let robot = Robot::new(&motors::parse(&list)?);
    let robot = robot.map_err(|error| format!("--motors {list}: {error}"))?;
    Ok(Some((interface.ok_or("which INTERFACE?")?, robot)))
}

#[cfg(not(target_os = "linux"))]
fn run(_: &str, _: Robot) -> Result<String, Box<dyn Error>> {
    Err("SocketCAN is a part of Linux".into())
}

#[cfg(target_os = "linux")]
fn run(interface: &str, robot: Robot) -> Result<String, Box<dyn Error>> {
    use drivetrain::{runner, time};
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use socketcan::{CanSocket, Socket as _};
    use std::sync::{Arc, atomic::AtomicBool, atomic::Ordering::Relaxed};

    let socket = CanSocket::open(interface).map_err(|error| format!("{interface}: {error}"))?;
    socket.set_nonblocking(true)?;
    let end = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, end.clone())?;
    }
    let start = std::time::Instant::now();
    let clock = move || time::Instant::START + time::Duration::from(start.elapsed());
    let period = robot.period();
    let mut runner = runner::Runner::new(runner::Nb(socket), clock, robot).with_period(period);
    Ok(robot::drive(&mut runner, || {
        std::thread::sleep(std::time::Duration::from_micros(200));
        end.load(Relaxed)
    })?)
}
