//! A 20 kg mecanum robot on four M3508 drives a square and spins, on the simulator, through the public API.
//!
//! ```text
//! cargo run --release --example chassis -- [--seconds S] [--output FILE.svg] [--csv FILE] [--justfloat FILE]
//!                                          [--candump FILE] [--seed N] [--fault silent-motor|lost-frames|bus-off]
//!                                          [--serial FILE]
//!                                          [--mode follow|rotor|independent|relax] [--power-limit W]
//! ```
//!
//! With a mode or a power limit, a pilot drives it under a gimbal instead; it fails when that does not do what it is for.

#[path = "../arguments/mod.rs"]
mod arguments;
#[path = "../console/mod.rs"]
mod console;
mod justfloat;
mod log;
mod modes;
mod modes_plot;
mod options;
mod plot;
mod report;
mod scenario;
mod serial;
mod silence;
mod verdict;

use drivetrain::chassis::ChassisMode;
use log::Log;
use modes::Drive;
use options::{Options, Request};
use scenario::Scenario;
use serial::Script;
use std::error::Error;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::time::Instant;
use verdict::Verdict;

fn main() -> ExitCode {
    match Options::parse(arguments::of("chassis")) {
        Ok(Request::Run(options)) => {
            let outcome = match options.mode {
                Some(mode) => run_mode(&options, mode),
                None => run(&options),
            };
            match outcome {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => {
                    _ = writeln!(std::io::stderr(), "chassis: {error}");
                    ExitCode::FAILURE
                }
            }
        }
        Ok(Request::Help) => {
            console::line(format_args!("{}", options::USAGE));
            ExitCode::SUCCESS
        }
        Err(message) => arguments::refuse("chassis", format_args!("{message}\n{}", options::USAGE)),
    }
}

fn run(options: &Options) -> Result<(), Box<dyn Error>> {
    let show_progress = std::io::stderr().is_terminal();
    let start = Instant::now();
    let script = |path| Ok::<_, Box<dyn Error>>(Script::parse(&std::fs::read_to_string(path)?)?);
    let scenario = Scenario {
        seconds: options.seconds,
        seed: options.seed,
        fault: options.fault,
        serial: options.serial.as_ref().map(script).transpose()?,
    };
    let mut log = Log::create(options.candump.as_deref())?;
    let show = |share| {
        if show_progress {
            progress(share);
        }
    };
    let run = scenario.run(show, |record| log.write(record))?;
    log.finish()?;
    let elapsed = start.elapsed();
    if show_progress {
        _ = writeln!(std::io::stderr());
    }
    plot::write(&options.output, &run)?;
    if let Some(path) = &options.csv {
        report::write_csv(path, &run)?;
    }
    if let Some(path) = &options.justfloat {
        std::fs::write(path, justfloat::stream(&run.samples)?)?;
    }
    console::line(format_args!("{}", report::table(&run).trim_end()));
    console::line(format_args!("plot: {}", options.output.display()));
    let ticks = run.samples.len().max(1);
    _ = writeln!(
        std::io::stderr(),
        "host: {:.2} s for {:.1} s simulated, {:.2} us a tick with the whole simulation",
        elapsed.as_secs_f64(),
        options.seconds,
        elapsed.as_secs_f64() * 1e6 / ticks as f64
    );
    Ok(())
}

fn run_mode(options: &Options, mode: ChassisMode) -> Result<(), Box<dyn Error>> {
    let show_progress = std::io::stderr().is_terminal();
    let drive = Drive {
        mode,
        power_limit_w: options.power_limit_w,
        seconds: options.seconds,
        seed: options.seed,
    };
    let mut log = Log::create(options.candump.as_deref())?;
    let show = |share| {
        if show_progress {
            progress(share);
        }
    };
    let outcome = drive.run(show, |record| log.write(record))?;
    log.finish()?;
    if show_progress {
        _ = writeln!(std::io::stderr());
    }
    modes_plot::write(&options.output, &drive, &outcome)?;
    let Verdict { text, faults } = Verdict::of(&drive, &outcome);
    console::line(format_args!("{}", text.trim_end()));
    console::line(format_args!("plot         {}", options.output.display()));
    if faults.is_empty() { Ok(()) } else { Err(faults.join("; ").into()) }
}

fn progress(share: f32) {
    const WIDTH: usize = 50;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 1")]
    let done = (share * WIDTH as f32) as usize;
    _ = write!(
        std::io::stderr(),
        "\r[{}{}] {:3.0} %",
        "#".repeat(done),
        " ".repeat(WIDTH.saturating_sub(done)),
        share * 100.0
    );
    _ = std::io::stderr().flush();
}
