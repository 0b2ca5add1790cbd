//! The command line.

use super::system::simulation::{Setup, Trouble};
use lexopt::prelude::*;
use std::error::Error;
use std::path::PathBuf;
use std::str::FromStr;

pub(crate) const USAGE: &str = "usage: snake [options]
  --seconds S       seconds, 10 to 600 (default 10); with --host and --robot 3 to 600
  --output FILE     where the plot goes (default snake.svg)
  --seed N          chooses phases, noise and chances (default 1)
  --fault NAME      host-line-cut, corrupt-stream, silent-joint, reset-in-motion, joint-power-loss
                    or controller-reset; fails unless it ends as tests/snake_robot.rs demands
  --robot PORT      only the robot: waits for a host on 127.0.0.1
  --host PORT       only the host: connects to a robot on 127.0.0.1
  --help            shows this";

#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) seconds: f32,
    pub(crate) output: PathBuf,
    pub(crate) seed: u64,
    pub(crate) fault: Option<Trouble>,
}

#[derive(Debug)]
pub(crate) enum Request {
    Run(Options),
    Robot(u16, Options),
    Host(u16, Options),
    Help,
}

impl Options {
    pub(crate) fn setup(&self) -> Setup {
        Setup { seconds: self.seconds, seed: self.seed, trouble: self.fault }
    }

    pub(crate) fn parse(mut arguments: lexopt::Parser) -> Result<Request, Box<dyn Error>> {
        let mut options =
            Self { seconds: 10.0, output: PathBuf::from("snake.svg"), seed: 1, fault: None };
        let (mut robot, mut host) = (None, None);
        while let Some(argument) = arguments.next()? {
            match argument {
                Short('h') | Long("help") => return Ok(Request::Help),
                Long("seconds") => options.seconds = number("--seconds", &mut arguments)?,
                Long("seed") => options.seed = number("--seed", &mut arguments)?,
                Long("robot") => robot = Some(number("--robot", &mut arguments)?),
                Long("host") => host = Some(number("--host", &mut arguments)?),
                Long("output") => options.output = arguments.value()?.into(),
                Long("fault") => {
                    let text = arguments.value()?.string()?;
                    let fault = Trouble::ALL.into_iter().find(|trouble| trouble.name() == text);
                    options.fault =
                        Some(fault.ok_or_else(|| format!("--fault {text}: no such fault"))?);
                }
                other => return Err(other.unexpected().into()),
            }
        }
        let shortest = if robot.or(host).is_some() { 3.0 } else { 10.0 };
        if !(shortest..=600.0).contains(&options.seconds) {
            return Err(format!("--seconds {}: not from {shortest} to 600", options.seconds).into());
        }
        match (robot, host) {
            (None, None) => Ok(Request::Run(options)),
            (Some(port), None) => Ok(Request::Robot(port, options)),
            (None, Some(port)) => Ok(Request::Host(port, options)),
            (Some(_), Some(_)) => Err("--robot and --host are two processes".into()),
        }
    }
}

fn number<N: FromStr>(option: &str, arguments: &mut lexopt::Parser) -> Result<N, Box<dyn Error>> {
    let text = arguments.value()?.string()?;
    Ok(text.parse().map_err(|_| format!("{option} {text}: not such a number"))?)
}
