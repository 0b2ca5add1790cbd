//! Codecs and algorithms of drivetrain, for judges that are written in Python.
//!
//! ```text
//! drivetrain-judges models                one a line: name, PMAX, VMAX, TMAX
//! drivetrain-judges registers             one a line: number, kind, access
//! drivetrain-judges encode MODEL MODE     five f32 a command in, the 8 bytes of a frame out
//! drivetrain-judges decode MODEL          the 8 bytes of a frame in, 20 bytes out: see `decode`
//! drivetrain-judges robstride ...         the family `robstride`: see `robstride`
//! drivetrain-judges serve                 text, a line in and a line out: see `serve`
//! drivetrain-judges lk ...                the same of motors of LK-TECH: see `lk`
//! drivetrain-judges rmd ...               the same of motors of MyActuator: see `rmd`
//! drivetrain-judges vesc ...              of the family `vesc`: see `vesc`
//! drivetrain-judges odrive VERB           see `odrive`
//! drivetrain-judges motion ...            plans of `control::Motion`: see `motion`
//! drivetrain-judges state-space ...       gains and filters of `control::state_space`: see `state_space`
//! drivetrain-judges power STEPS           fits of the power model of a chassis: see `power`
//! drivetrain-judges manipulator ...       efforts that hold an arm: see `manipulator`
//! drivetrain-judges simulator             runs of the simulator: see `simulator`
//! drivetrain-judges balance               the program of a robot that balances: see `balance`
//! ```
//! A last argument `--plant DEFECT` makes a mistake that a judge has to find.

mod balance;
mod codec;
mod defect;
mod floats;
mod lk;
mod manipulator;
mod motion;
mod odrive;
mod power;
mod rmd;
mod robstride;
mod serve;
mod simulator;
mod state_space;
mod vesc;

use defect::Defect;
use drivetrain::damiao::{Model, Register};
use std::io::{self, BufRead, BufWriter, Write};
use std::process::ExitCode;

/// A result whose error is a text for a person.
type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The registers that the family has. `judges/damiao.py` compares them with the source and with the judges.
const REGISTERS: &[Register] = &[
    Register::UnderVoltage,
    Register::TorqueConstant,
    Register::OverTemperature,
    Register::OverCurrent,
    Register::Acceleration,
    Register::Deceleration,
    Register::MaxSpeed,
    Register::MasterId,
    Register::Id,
    Register::Timeout,
    Register::ControlMode,
    Register::Damping,
    Register::Inertia,
    Register::SoftwareVersion,
    Register::PolePairs,
    Register::PhaseResistance,
    Register::PhaseInductance,
    Register::Flux,
    Register::GearRatio,
    Register::PositionRange,
    Register::VelocityRange,
    Register::TorqueRange,
    Register::CurrentBandwidth,
    Register::SpeedKp,
    Register::SpeedKi,
    Register::PositionKp,
    Register::PositionKi,
    Register::OverVoltage,
    Register::GearEfficiency,
    Register::SpeedDamping,
    Register::SpeedFilter,
    Register::BitRate,
    Register::SubVersion,
    Register::SupplyVoltage,
    Register::DriverTemperature,
    Register::MotorTemperature,
    Register::RotorPosition,
    Register::ShaftPosition,
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("drivetrain-judges: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[&str]) -> Outcome<()> {
    let mut output = BufWriter::new(io::stdout().lock());
    let input = io::stdin().lock();
    match arguments {
        ["vesc", rest @ ..] => vesc::run(rest, input, &mut output)?,
        ["odrive", rest @ ..] => odrive::run(rest, input, &mut output)?,
        ["motion", rest @ ..] => motion::run(rest, input, &mut output)?,
        ["state-space", rest @ ..] => state_space::run(rest, input, &mut output)?,
        ["power", rest @ ..] => power::run(rest, input, &mut output)?,
        ["manipulator", rest @ ..] => manipulator::run(rest, input, &mut output)?,
        ["simulator", rest @ ..] => simulator::run(rest, input, &mut output)?,
        ["balance", rest @ ..] => balance::run(rest, input, &mut output)?,
        _ => planted(arguments, input, &mut output)?,
    }
    Ok(output.flush()?)
}

/// The verbs whose mistakes are those of [`Defect`].
fn planted(arguments: &[&str], input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = Defect::split(arguments)?;
    match arguments {
        ["models"] => {
            for model in Model::ALL {
                let (pmax, vmax, tmax) =
                    (model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm());
                writeln!(output, "{} {pmax} {vmax} {tmax}", model.name())?;
            }
        }
        ["registers"] => {
            for register in REGISTERS {
                let kind = if register.is_float() { "float" } else { "uint32" };
                let access = if register.is_writable() { "RW" } else { "RO" };
                writeln!(output, "{} {kind} {access}", register.number())?;
            }
        }
        ["encode", model, mode] => {
            codec::encode(model_named(model)?, mode, defect, input, output)?;
        }
        ["decode", model] => {
            codec::decode(model_named(model)?, defect, input, output)?;
        }
        ["lk", rest @ ..] => lk::run(rest, defect, input, output)?,
        ["rmd", rest @ ..] => rmd::run(rest, defect, input, output)?,
        ["robstride", rest @ ..] => {
            robstride::run(rest, defect, input, output)?;
        }
        ["serve"] => serve::serve(defect, input, output)?,
        _ => return Err("see the head of judges/src/main.rs for the arguments".into()),
    }
    Ok(())
}

fn model_named(name: &str) -> Outcome<&'static Model> {
    let model = Model::ALL.iter().find(|model| model.name() == name);
    Ok(model.ok_or_else(|| format!("no model {name}"))?)
}

fn register_of(number: u8) -> Outcome<Register> {
    let register = REGISTERS.iter().find(|register| register.number() == number);
    Ok(*register.ok_or_else(|| format!("no register {number}"))?)
}
