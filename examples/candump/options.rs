//! What was asked for on the command line.

use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Facts, Gm6020Current, Gm6020Voltage, M2006, M3508, Model,
};
use drivetrain::time::Duration;

pub(crate) const HELP: &str = "\
usage: candump [--motors LIST] [--interface NAME] [--gap MS] [--csv] [FILE]

Reads what candump printed, from FILE or standard input, and decodes DJI motors.

  --motors LIST     model:ids, for instance \"m3508:1-4,gm6020:1\"
                    models: m2006 or c610, m3508 or c620, gm6020, gm6020-current
                    (default: m3508:1-8, those that are heard)
  --interface NAME  only frames of this interface (default: the first one in the log)
  --gap MS          a silence longer than this is a gap (default: 10)
  --csv             one row a frame instead of one row a motor";

/// A motor to look for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motor {
    pub(crate) facts: &'static Facts,
    pub(crate) id: u8,
    attach: fn(&mut Bus, u8) -> Result<AnyHandle, AttachError>,
}

impl Motor {
    pub(crate) fn attach(&self, bus: &mut Bus) -> Result<AnyHandle, AttachError> {
        (self.attach)(bus, self.id)
    }

    fn of<M: Model>(id: u8) -> Self {
        let attach =
            |bus: &mut Bus, id| bus.attach(Config::<M>::new(id)).map(|motor| motor.erase());
        Self { facts: M::FACTS, id, attach }
    }
}

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) motors: Vec<Motor>,
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
        motors: (1..=8).map(Motor::of::<M3508>).collect(),
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
fn motors(list: &str) -> Result<Vec<Motor>, String> {
    let mut motors = Vec::new();
    let mut bus = Bus::new();
    for item in list.split(',') {
        let example = "as in m3508:1-4";
        let (model, ids) = item
            .trim()
            .split_once(':')
            .ok_or(format!("--motors {item}: not model:ids, {example}"))?;
        let of = of_model(model).ok_or(format!(
            "--motors {item}: no model {model}; there are m2006, m3508, gm6020 and gm6020-current"
        ))?;
        let (first, last) = ids.split_once('-').unwrap_or((ids, ids));
        let range = first.trim().parse::<u8>().ok().zip(last.trim().parse::<u8>().ok());
        let (first, last) = range
            .filter(|(first, last)| first <= last)
            .ok_or(format!("--motors {item}: {ids} is no id or range of ids, {example}"))?;
        for id in first..=last {
            let motor = of(id);
            motor.attach(&mut bus).map_err(|error| format!("--motors {item}: {error}"))?;
            motors.push(motor);
        }
    }
    Ok(motors)
}

fn of_model(name: &str) -> Option<fn(u8) -> Motor> {
    match name.trim().to_ascii_lowercase().as_str() {
        "m2006" | "c610" => Some(Motor::of::<M2006>),
        "m3508" | "c620" => Some(Motor::of::<M3508>),
        "gm6020" | "gm6020-voltage" => Some(Motor::of::<Gm6020Voltage>),
        "gm6020-current" => Some(Motor::of::<Gm6020Current>),
        _ => None,
    }
}
