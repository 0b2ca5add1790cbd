//! What was asked for on the command line.

use drivetrain::dji::{Gm6020Current, Gm6020Voltage, M2006, M3508};
use drivetrain::time::Duration;

use super::motor::{self, Listener};

pub(crate) const HELP: &str = "\
usage: candump [--motors LIST] [--interface NAME] [--gap MS] [--csv] [FILE]

Reads what candump printed, from FILE or standard input, and decodes motors of DJI, Damiao, LK-TECH and RobStride,
and those at an ODrive or a VESC.

  --motors LIST     model:ids, for instance \"m3508:1-4,gm6020:1\"
                    models: m2006 or c610, m3508 or c620, gm6020, gm6020-current; damiao and the number of the model, as
                    in damiao4310:1-4, whose master id is that of the motor and 0x10; mf9025-16t, mf9025-35t, mg4005e-i10,
                    mg5010e-i10; rs00 to rs06, cybergear; odrive0.5, odrive0.6; vesc and the number of pole pairs, as in
                    vesc7:23; the shaft of the two last is that of the motor
                    (default: m3508:1-8, those that are heard)
  --interface NAME  only frames of this interface (default: the first one in the log)
  --gap MS          a silence longer than this is a gap (default: 10)
  --csv             one row a frame instead of one row a motor";

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) motors: Vec<Box<dyn Listener>>,
    /// Show motors that were not heard, because they were asked for.
    pub(crate) show_silent: bool,
    pub(crate) interface: Option<String>,
    pub(crate) gap: Duration,
    pub(crate) csv: bool,
    pub(crate) file: Option<String>,
}

#[derive(Debug)]
pub(crate) enum Asked {
    Run(Options),
    Help,
}

pub(crate) fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Asked, String> {
    let mut options = Options {
        motors: motors("m3508:1-8")?,
        show_silent: false,
        interface: None,
        gap: Duration::from_millis(10),
        csv: false,
        file: None,
    };
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "-h" | "--help" => return Ok(Asked::Help),
            "--csv" => options.csv = true,
            "--interface" => options.interface = Some(value()?),
            "--gap" => {
                let text = value()?;
                let ms = text.parse().ok().filter(|ms| *ms > 0);
                let ms = ms.ok_or(format!("--gap {text}: not a number of milliseconds above 0"))?;
                options.gap = Duration::from_millis(ms);
            }
            "--motors" => {
                options.motors = motors(&value()?)?;
                options.show_silent = true;
            }
            option if option.starts_with('-') && option != "-" => {
                return Err(format!("no option {option}"));
            }
            file if options.file.is_none() => options.file = Some(file.to_owned()),
            file => return Err(format!("one file at a time: what is {file}?")),
        }
    }
    Ok(Asked::Run(options))
}

/// Reads `m3508:1-4,gm6020:1`.
fn motors(list: &str) -> Result<Vec<Box<dyn Listener>>, String> {
    let mut motors: Vec<Box<dyn Listener>> = Vec::new();
    for item in list.split(',') {
        let example = "as in m3508:1-4";
        let (model, ids) = item
            .trim()
            .split_once(':')
            .ok_or(format!("--motors {item}: not model:ids, {example}"))?;
        let (first, last) = ids.split_once('-').unwrap_or((ids, ids));
        let range = first.trim().parse::<u8>().ok().zip(last.trim().parse::<u8>().ok());
        let (first, last) = range
            .filter(|(first, last)| first <= last)
            .ok_or(format!("--motors {item}: {ids} is no id or range of ids, {example}"))?;
        for id in first..=last {
            let motor = motor(model, id).map_err(|error| format!("--motors {item}: {error}"))?;
            let others = motors.iter().flat_map(|other| other.feedback());
            for (claim, other) in others
                .flat_map(|other| motor.feedback().into_iter().map(move |claim| (claim, other)))
            {
                if claim.clashes_with(&other) {
                    return Err(format!("--motors {item}: {claim}, which is {other}"));
                }
            }
            motors.push(motor);
        }
    }
    Ok(motors)
}

/// Makes the motor of a model, as the command line calls it.
fn motor(model: &str, id: u8) -> Result<Box<dyn Listener>, String> {
    let model = model.trim().to_ascii_lowercase();
    match model.as_str() {
        "m2006" | "c610" => motor::dji::<M2006>(id),
        "m3508" | "c620" => motor::dji::<M3508>(id),
        "gm6020" | "gm6020-voltage" => motor::dji::<Gm6020Voltage>(id),
        "gm6020-current" => motor::dji::<Gm6020Current>(id),
        other => motor::of_family(other, id)
            .unwrap_or_else(|| Err(format!("no model {other}; --help lists them"))),
    }
}
