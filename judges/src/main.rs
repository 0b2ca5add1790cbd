//! What drivetrain sends and reads, for judges that are written in Python.
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
//! drivetrain-judges manipulator ...       efforts that hold an arm: see `manipulator`
//! drivetrain-judges simulator             runs of the simulator: see `simulator`
//! drivetrain-judges balance               the program of a robot that balances: see `balance`
//! ```
//! A last argument `--plant DEFECT` makes a mistake that a judge has to find.

mod balance;
mod codec;
mod defect;
mod lk;
mod manipulator;
mod motion;
mod odrive;
mod rmd;
mod robstride;
mod serve;
mod simulator;
mod state_space;
mod vesc;

use defect::Defect;
use drivetrain::damiao::{Model, Register};
use std::io::{self, BufReader, BufWriter, Write};
use std::process::ExitCode;

/// What goes wrong, as a text for a person.
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
    if let ["vesc", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        vesc::run(rest, io::stdin().lock(), &mut output)?;
        return Ok(output.flush()?);
    }
    if let ["odrive", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        odrive::run(rest, io::stdin().lock(), &mut output)?;
        return Ok(output.flush()?);
    }
    if let ["motion", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        motion::run(rest, BufReader::new(io::stdin().lock()), &mut output)?;
        return Ok(output.flush()?);
    }
    if let ["state-space", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        state_space::run(rest, BufReader::new(io::stdin().lock()), &mut output)?;
        return Ok(output.flush()?);
    }
    if let ["manipulator", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        manipulator::run(rest, BufReader::new(io::stdin().lock()), &mut output)?;
        return Ok(output.flush()?);
    }
    if let ["simulator", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        simulator::run(rest, io::stdin().lock(), &mut output)?;
        return Ok(output.flush()?);
    }
    if let ["balance", rest @ ..] = arguments {
        let mut output = BufWriter::new(io::stdout().lock());
        balance::run(rest, BufReader::new(io::stdin().lock()), &mut output)?;
        return Ok(output.flush()?);
    }
    let (arguments, defect) = match arguments {
        [rest @ .., "--plant", name] => (rest, Defect::named(name)?),
        _ => (arguments, Defect::None),
    };
    let mut output = BufWriter::new(io::stdout().lock());
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
            codec::encode(model_named(model)?, mode, defect, io::stdin().lock(), &mut output)?;
        }
        ["decode", model] => {
            codec::decode(model_named(model)?, defect, io::stdin().lock(), &mut output)?;
        }
        ["lk", rest @ ..] => lk::run(rest, defect, &mut output)?,
        ["rmd", rest @ ..] => rmd::run(rest, defect, &mut output)?,
        ["robstride", rest @ ..] => {
            robstride::run(rest, defect, io::stdin().lock(), &mut output)?;
        }
        ["serve"] => serve::serve(defect, io::stdin().lock(), &mut output)?,
        _ => return Err("see the head of judges/src/main.rs for the arguments".into()),
    }
    Ok(output.flush()?)
}

fn model_named(name: &str) -> Outcome<&'static Model> {
    let model = Model::ALL.iter().find(|model| model.name() == name);
    Ok(model.ok_or_else(|| format!("no model {name}"))?)
}

fn register_of(number: u8) -> Outcome<Register> {
    let register = REGISTERS.iter().find(|register| register.number() == number);
    Ok(*register.ok_or_else(|| format!("no register {number}"))?)
}
