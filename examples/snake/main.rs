//! A whole snake robot on the simulator: 12 joints and a gripper on one CAN bus, a servo and four IMUs on serial lines, and
//! the computer that leads it over a noisy one.
//!
//! ```text
//! cargo run --release --example snake -- [--seconds S] [--output FILE.svg] [--seed N]
//!     [--fault host-line-cut|corrupt-stream|silent-joint|reset-in-motion|joint-power-loss|controller-reset]
//! cargo run --release --example snake -- --robot PORT [--seconds S]      two processes,
//! cargo run --release --example snake -- --host PORT [--seconds S]       in real time
//! ```

#[path = "../arguments/mod.rs"]
mod arguments;
#[path = "../console/mod.rs"]
mod console;
mod options;
mod plot;
mod report;
mod system;

use options::{Options, Request};
use std::error::Error;
use std::io::Write;
use std::net::TcpListener;
use std::process::ExitCode;
use system::tcp;

/// The periods of the frames of host and robot.
const FRAME_PERIOD_S: f32 = 0.05;

fn main() -> ExitCode {
    let outcome = match Options::parse(arguments::of("snake")) {
        Ok(Request::Run(options)) => simulate(&options),
        Ok(Request::Robot(port, options)) => robot(port, &options),
        Ok(Request::Host(port, options)) => host(port, &options),
        Ok(Request::Help) => {
            console::line(format_args!("{}", options::USAGE));
            Ok(())
        }
        Err(message) => arguments::refuse("snake", format_args!("{message}\n{}", options::USAGE)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            _ = writeln!(std::io::stderr(), "snake: {error}");
            ExitCode::FAILURE
        }
    }
}

fn simulate(options: &Options) -> Result<(), Box<dyn Error>> {
    let start = std::time::Instant::now();
    let run = options.setup().run(|_| {})?;
    let elapsed = start.elapsed();
    let checks = system::checks::checks(&run);
    console::line(format_args!("{}", report::table(&run, &checks).trim_end()));
    plot::write(&options.output, &run)?;
    console::line(format_args!("plot: {}", options.output.display()));
    let (took_s, seconds) = (elapsed.as_secs_f64(), options.seconds);
    _ = writeln!(std::io::stderr(), "host: {took_s:.2} s for {seconds:.1} s simulated");
    let failed = checks.iter().filter(|check| !check.holds).count();
    if failed > 0 {
        return Err(format!("{failed} of {} checks failed", checks.len()).into());
    }
    Ok(())
}

fn robot(port: u16, options: &Options) -> Result<(), Box<dyn Error>> {
    let listener = TcpListener::bind(("127.0.0.1", port))?;
    console::line(format_args!("robot: waits on {}", listener.local_addr()?));
    let report = tcp::robot(&listener, options.seconds, options.seed, || {})?;
    console::line(format_args!("{}", report::side("robot", &report)));
    Ok(report.verdict(FRAME_PERIOD_S)?)
}

fn host(port: u16, options: &Options) -> Result<(), Box<dyn Error>> {
    let report = tcp::host(port, options.seconds, || {})?;
    console::line(format_args!("{}", report::side("host", &report)));
    Ok(report.verdict(FRAME_PERIOD_S)?)
}
