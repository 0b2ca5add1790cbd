//! The command line.

use super::scenario::Trouble;
use drivetrain::chassis::ChassisMode;
use lexopt::prelude::*;
use std::error::Error;
use std::ops::RangeInclusive;
use std::path::PathBuf;

pub(crate) const USAGE: &str = "usage: chassis [options]
  --seconds S       simulated seconds, 2 to 600 (default 10)
  --output FILE     where the plot goes (default chassis.svg)
  --csv FILE        writes every sample as a row, too
  --justfloat FILE  writes targets and speeds (rpm) as VOFA+ JustFloat frames of 8 channels, too
  --serial FILE     sends its lines, as in '2.5 wheel_kp=1.0', to the robot at their times in s: wheel_kp, wheel_ki, turn, ?
  --candump FILE    writes every frame on the bus as a line of candump, too
  --seed N          chooses phases and chances of the simulation (default 1)
  --fault NAME      silent-motor, lost-frames or bus-off
  --mode NAME       a pilot drives under a gimbal instead: follow, rotor, independent or relax; not with
                    --fault, --csv, --justfloat and --serial
  --power-limit W   keeps a referee's limit of 10 to 500 W and its buffer of 60 J; independent without --mode
  --help            shows this";

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) seconds: f32,
    pub(crate) output: PathBuf,
    pub(crate) csv: Option<PathBuf>,
    pub(crate) justfloat: Option<PathBuf>,
    pub(crate) serial: Option<PathBuf>,
    pub(crate) candump: Option<PathBuf>,
    pub(crate) seed: u64,
    pub(crate) fault: Option<Trouble>,
    pub(crate) mode: Option<ChassisMode>,
    pub(crate) power_limit_w: Option<f32>,
}

const MODES: [(&str, ChassisMode); 4] = [
    ("follow", ChassisMode::FollowGimbal),
    ("rotor", ChassisMode::Rotor),
    ("independent", ChassisMode::Independent),
    ("relax", ChassisMode::Relax),
];

#[derive(Debug)]
pub(crate) enum Request {
    Run(Options),
    Help,
}

impl Options {
    pub(crate) fn parse(mut arguments: lexopt::Parser) -> Result<Request, Box<dyn Error>> {
        let mut options = Self {
            seconds: 10.0,
            output: PathBuf::from("chassis.svg"),
            csv: None,
            justfloat: None,
            serial: None,
            candump: None,
            seed: 1,
            fault: None,
            mode: None,
            power_limit_w: None,
        };
        while let Some(argument) = arguments.next()? {
            match argument {
                Short('h') | Long("help") => return Ok(Request::Help),
                Long("seconds") => {
                    options.seconds = within("--seconds", &mut arguments, 2.0..=600.0)?;
                }
                Long("output") => options.output = arguments.value()?.into(),
                Long("csv") => options.csv = Some(arguments.value()?.into()),
                Long("justfloat") => options.justfloat = Some(arguments.value()?.into()),
                Long("serial") => options.serial = Some(arguments.value()?.into()),
                Long("candump") => options.candump = Some(arguments.value()?.into()),
                Long("seed") => {
                    let text = arguments.value()?.string()?;
                    options.seed =
                        text.parse().map_err(|_| format!("--seed {text}: not a whole number"))?;
                }
                Long("fault") => {
                    let text = arguments.value()?.string()?;
                    let fault = Trouble::ALL.into_iter().find(|trouble| trouble.name() == text);
                    options.fault =
                        Some(fault.ok_or_else(|| format!("--fault {text}: no such fault"))?);
                }
                Long("mode") => {
                    let text = arguments.value()?.string()?;
                    let mode = MODES.into_iter().find(|(name, _)| *name == text);
                    let (_, mode) = mode.ok_or_else(|| format!("--mode {text}: no such mode"))?;
                    options.mode = Some(mode);
                }
                Long("power-limit") => {
                    let watts = within("--power-limit", &mut arguments, 10.0..=500.0)?;
                    options.power_limit_w = Some(watts);
                    options.mode = options.mode.or(Some(ChassisMode::Independent));
                }
                other => return Err(other.unexpected().into()),
            }
        }
        let of_the_square = options.fault.is_some()
            || options.csv.is_some()
            || options.justfloat.is_some()
            || options.serial.is_some();
        if options.mode.is_some() && of_the_square {
            return Err(
                "--fault, --csv, --justfloat and --serial are not for a drive with --mode".into()
            );
        }
        Ok(Request::Run(options))
    }
}

/// Reads a number within a range.
fn within(
    option: &str,
    arguments: &mut lexopt::Parser,
    range: RangeInclusive<f32>,
) -> Result<f32, Box<dyn Error>> {
    let text = arguments.value()?.string()?;
    let value = text.parse().ok().filter(|value| range.contains(value));
    let (least, most) = (range.start(), range.end());
    Ok(value.ok_or_else(|| format!("{option} {text}: not a number from {least} to {most}"))?)
}
