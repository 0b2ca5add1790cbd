//! Options of the command line.

use drivetrain::time::Duration;
use lexopt::prelude::*;
use std::error::Error;

use super::motor::{self, Listener};
use super::motors;

pub(crate) const HELP: &str = "\
usage: candump [--motors LIST] [--interface NAME] [--gap MS] [--csv] [FILE]

Reads what candump printed, from FILE or standard input, and decodes motors of DJI, Damiao, LK-TECH, MyActuator and
RobStride, and those at an ODrive or a VESC.

  --motors LIST     model:ids, for instance \"m3508:1-4,gm6020:1\"; the models are below
                    (default: m3508:1-8, those that are heard)
  --interface NAME  only frames of this interface (default: the first one in the log)
  --gap MS          a silence longer than this is a gap (default: 10)
  --csv             one row a frame instead of one row a motor";

/// Returns the help with the models.
pub(crate) fn help() -> String {
    format!("{HELP}\n\n  models            {}", motors::MODELS)
}

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

pub(crate) fn parse(mut arguments: lexopt::Parser) -> Result<Asked, Box<dyn Error>> {
    let mut options = Options {
        motors: listeners("m3508:1-8")?,
        show_silent: false,
        interface: None,
        gap: Duration::from_millis(10),
        csv: false,
        file: None,
    };
    while let Some(argument) = arguments.next()? {
        match argument {
            Short('h') | Long("help") => return Ok(Asked::Help),
            Long("csv") => options.csv = true,
            Long("interface") => options.interface = Some(arguments.value()?.string()?),
            Long("gap") => {
                let text = arguments.value()?.string()?;
                let ms = text.parse().ok().filter(|ms| *ms > 0);
                let ms = ms.ok_or(format!("--gap {text}: not a number of milliseconds above 0"))?;
                options.gap = Duration::from_millis(ms);
            }
            Long("motors") => {
                options.motors = listeners(&arguments.value()?.string()?)?;
                options.show_silent = true;
            }
            Value(file) if options.file.is_none() => options.file = Some(file.string()?),
            Value(file) => {
                return Err(format!("one file at a time: what is {}?", file.string()?).into());
            }
            other => return Err(other.unexpected().into()),
        }
    }
    Ok(Asked::Run(options))
}

/// Makes the motors of a list, no two of which have one id.
fn listeners(list: &str) -> Result<Vec<Box<dyn Listener>>, String> {
    let mut listeners: Vec<Box<dyn Listener>> = Vec::new();
    for spec in motors::parse(list)? {
        let refused = |error: String| format!("--motors {list}: {error}");
        let motor = motor::listener(spec).map_err(refused)?;
        for claim in motor.feedback() {
            let mut others = listeners.iter().flat_map(|other| other.feedback());
            if let Some(other) = others.find(|other| claim.clashes_with(other)) {
                return Err(refused(format!("{claim}, which is {other}")));
            }
        }
        listeners.push(motor);
    }
    Ok(listeners)
}
