//! The command line.

use super::scenario::Trouble;
use std::path::PathBuf;

pub(crate) const USAGE: &str = "usage: chassis [options]
  --seconds S       simulated seconds, 2 to 600 (default 10)
  --output FILE     where the plot goes (default chassis.svg)
  --csv FILE        writes every sample as a row, too
  --justfloat FILE  writes targets and speeds (rpm) as VOFA+ JustFloat frames of 8 channels, too
  --candump FILE    writes every frame on the bus as a line of candump, too
  --seed N          chooses phases and chances of the simulation (default 1)
  --fault NAME      silent-motor, lost-frames or bus-off
  --help            shows this";

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) seconds: f32,
    pub(crate) output: PathBuf,
    pub(crate) csv: Option<PathBuf>,
    pub(crate) justfloat: Option<PathBuf>,
    pub(crate) candump: Option<PathBuf>,
    pub(crate) seed: u64,
    pub(crate) fault: Option<Trouble>,
}

#[derive(Debug)]
pub(crate) enum Request {
    Run(Options),
    Help,
}

impl Options {
    pub(crate) fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Request, String> {
        let mut options = Self {
            seconds: 10.0,
            output: PathBuf::from("chassis.svg"),
            csv: None,
            justfloat: None,
            candump: None,
            seed: 1,
            fault: None,
        };
        let mut arguments = arguments.into_iter();
        while let Some(name) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{name} needs a value"));
            match name.as_str() {
                "--help" | "-h" => return Ok(Request::Help),
                "--seconds" => {
                    let text = value()?;
                    let seconds = text.parse::<f32>().ok().filter(|s| (2.0..=600.0).contains(s));
                    options.seconds = seconds
                        .ok_or_else(|| format!("--seconds {text}: not a number from 2 to 600"))?;
                }
                "--output" => options.output = value()?.into(),
                "--csv" => options.csv = Some(value()?.into()),
                "--justfloat" => options.justfloat = Some(value()?.into()),
                "--candump" => options.candump = Some(value()?.into()),
                "--seed" => {
                    let text = value()?;
                    options.seed =
                        text.parse().map_err(|_| format!("--seed {text}: not a whole number"))?;
                }
                "--fault" => {
                    let text = value()?;
                    let fault = Trouble::ALL.into_iter().find(|trouble| trouble.name() == text);
                    options.fault =
                        Some(fault.ok_or_else(|| format!("--fault {text}: no such fault"))?);
                }
                other => return Err(format!("unknown option {other}")),
            }
        }
        Ok(Request::Run(options))
    }
}
