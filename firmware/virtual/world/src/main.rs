//! Simulated motors for the virtual board of `firmware/virtual/run`: a line in, a line out.
//!
//! ```text
//! motor m3508 1                   attaches a motor; the motors count from 0          ok
//! fault silent 0 5000 9000        from 5000 to 9000 us: silent, power, code:4        ok
//! run 1200 200#0666000000000000   takes these frames now, and goes on to 1200 us     1043 201#1FFF..., or nothing
//! state 0                         velocity in rpm, current in A, word of the ESC     12.500 0.998 819
//! ```
//! The line of the simulation takes no time here: 1 Gbit/s. The line that counts is that of the virtual board.

use drivetrain::frame::CanFrame;
use drivetrain::sim::{Fault, Line, MotorConfig, MotorKey, Sender, Simulation};
use drivetrain::time::Instant;
use std::fmt::Write as _;
use std::io::{self, BufRead, Write};
use std::process::ExitCode;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

struct World {
    simulation: Simulation,
    motors: Vec<MotorKey>,
}

impl World {
    fn answer(&mut self, line: &str) -> Outcome<String> {
        let mut words = line.split_whitespace();
        let mut next = || words.next().ok_or("a word is missing");
        match next()? {
            "motor" => self.attach(next()?, next()?.parse()?),
            "fault" => {
                let (kind, motor) = (next()?, self.motor(next()?)?);
                let window = instant(next()?)?..instant(next()?)?;
                let fault = match kind.split_once(':') {
                    None if kind == "silent" => Fault::Silent(motor),
                    None if kind == "power" => Fault::PowerLoss { motor, forgets_angle: false },
                    Some(("code", code)) => Fault::ErrorCode { motor, code: code.parse()? },
                    _ => return Err("no such fault".into()),
                };
                self.simulation.fault(fault, window)?;
                Ok("ok".into())
            }
            "run" => self.run(instant(next()?)?, words),
            "state" => {
                let motor = self.motor(next()?)?;
                let state = self.simulation.motor(motor).ok_or("no such motor")?;
                let (rpm, amperes) = (state.velocity.as_rpm(), state.current.as_amperes());
                Ok(format!("{rpm:.3} {amperes:.3} {}", state.command))
            }
            _ => Err("no such word".into()),
        }
    }

    fn attach(&mut self, model: &str, id: u8) -> Outcome<String> {
        let config = match model {
            "m2006" => MotorConfig::m2006(id),
            "m3508" => MotorConfig::m3508(id),
            "gm6020" => MotorConfig::gm6020_voltage(id),
            _ => return Err("no such motor".into()),
        };
        self.motors.push(self.simulation.attach(config)?);
        Ok("ok".into())
    }

    fn motor(&self, index: &str) -> Outcome<MotorKey> {
        Ok(*self.motors.get(index.parse::<usize>()?).ok_or("no such motor")?)
    }

    fn run<'a>(&self, until: Instant, frames: impl Iterator<Item = &'a str>) -> Outcome<String> {
        for frame in frames {
            self.simulation.inject(Line::Can1, parse(frame)?).map_err(|_| "too many frames")?;
        }
        let mut heard = String::new();
        let span = until.since(self.simulation.now());
        self.simulation.advance_with(span, |record| {
            if let (Sender::Motor(_), true) = (record.sender, record.delivered) {
                let at = record.at.as_micros();
                _ = write!(heard, "{at} {:03X}#", record.frame.header());
                for byte in &record.frame.bytes()[..usize::from(record.frame.length())] {
                    _ = write!(heard, "{byte:02X}");
                }
                heard.push(' ');
            }
        });
        Ok(heard)
    }
}

fn instant(micros: &str) -> Outcome<Instant> {
    Ok(Instant::from_micros(micros.parse()?))
}

/// Reads `200#0666000000000000`: eight bytes, as DJI's frames have them.
fn parse(text: &str) -> Outcome<CanFrame> {
    let (id, data) = text.split_once('#').ok_or("no #")?;
    let bytes = u64::from_str_radix(data, 16)?.to_be_bytes();
    Ok(CanFrame::standard(u16::from_str_radix(id, 16)?, bytes).ok_or("not an 11-bit id")?)
}

fn serve() -> Outcome<()> {
    const BITS_A_S: u32 = 1_000_000_000;
    let simulation = Simulation::new(7).with_bit_rate(Line::Can1, BITS_A_S);
    let mut world = World { simulation, motors: Vec::new() };
    let mut out = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let answer = world.answer(&line?)?;
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

fn main() -> ExitCode {
    match serve() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("world: {error}");
            ExitCode::FAILURE
        }
    }
}
