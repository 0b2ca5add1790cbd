//! A serial port through which a PC sets gains and a turn while the robot drives.

use super::scenario::{SPEED, Wheels, at};
use drivetrain::dji::Bus;
use drivetrain::sim::SerialLine;
use drivetrain::time::Instant;
use drivetrain::wire::Counts;
use drivetrain::wire::parameters::{Parameter, ParameterRequest, Parameters};
use std::error::Error;
use std::fmt::Write;

/// The parameters, by their place in the table. Every value in a range is safe on this robot.
const KP: usize = 0;
const KI: usize = 1;
const TURN: usize = 2;
const TABLE: [Parameter; 3] = [
    Parameter::setting("wheel_kp", "A per rad/s", 0.5, 8.0),
    Parameter::setting("wheel_ki", "A per rad", 0.0, 50.0),
    Parameter::target("turn", "rad/s", -1.0, 1.0),
];

/// Lines that a PC sends, each with its time in s.
#[derive(Debug, Default, Clone)]
pub(crate) struct Script(Vec<(f32, String)>);

impl Script {
    /// Reads lines of the form `2.5 wheel_kp=1.0`.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let line = |line: &str| {
            let (time, rest) = line.split_once(' ')?;
            let time_s = time.parse::<f32>().ok().filter(|time_s| *time_s >= 0.0)?;
            Some((time_s, format!("{}\n", rest.trim())))
        };
        let lines = text.lines().filter(|text| !text.trim().is_empty());
        let lines =
            lines.map(|text| line(text).ok_or(format!("{text}: no time in s, then a line")));
        lines.collect::<Result<_, _>>().map(Self)
    }
}

/// The robot's end of the line, and the line.
#[derive(Debug)]
pub(crate) struct SerialPort {
    script: std::vec::IntoIter<(f32, String)>,
    next: Option<(f32, String)>,
    line: SerialLine,
    parameters: Parameters<3>,
    /// What the robot answered.
    answers: String,
}

impl SerialPort {
    pub(crate) fn new(script: &Script, seed: u64) -> Result<Self, Box<dyn Error>> {
        let mut script = script.0.clone().into_iter();
        let next = script.next();
        let line = SerialLine::new(115_200, seed);
        Ok(Self { script, next, line, parameters: Parameters::new(TABLE)?, answers: String::new() })
    }

    /// Sends what the PC has to say by now, and takes what arrived. Returns the turn that is wanted, in rad/s.
    pub(crate) fn poll(
        &mut self,
        bus: &mut Bus,
        wheels: Wheels,
        now: Instant,
    ) -> Result<f32, Box<dyn Error>> {
        while let Some((_, text)) = self.next.take_if(|(time_s, _)| at(*time_s) <= now) {
            self.line.send(text.as_bytes(), now);
            self.next = self.script.next();
        }
        let mut buffer = [0; 64];
        let mut received = self.line.receive(now, &mut buffer);
        while let Some(request) = self.parameters.read(&mut received, now) {
            match request {
                ParameterRequest::Set { index: KP | KI, .. } => self.tune(bus, wheels, now)?,
                ParameterRequest::Set { .. } => {}
                ParameterRequest::List => self.list(now)?,
            }
        }
        Ok(self.parameters.value(TURN, now).unwrap_or(0.0))
    }

    /// Gives all four wheels the gains, without a jump of their output.
    fn tune(&mut self, bus: &mut Bus, wheels: Wheels, now: Instant) -> Result<(), Box<dyn Error>> {
        let (kp, ki, kd) = SPEED.gains();
        let kp = self.parameters.value(KP, now).unwrap_or(kp);
        let ki = self.parameters.value(KI, now).unwrap_or(ki);
        for wheel in wheels.into_array() {
            bus.set_speed_loop(wheel, SPEED.with_gains(kp, ki, kd))?;
        }
        Ok(())
    }

    fn list(&mut self, now: Instant) -> Result<(), Box<dyn Error>> {
        let mut index = 0;
        let mut buffer = [0; 64];
        while let Some(line) = self.parameters.describe(index, now, &mut buffer) {
            write!(self.answers, "serial       {}", str::from_utf8(line?)?)?;
            index += 1;
        }
        Ok(())
    }

    /// Returns the answers of the robot, and the number of lines taken.
    pub(crate) fn finish(self) -> (String, Counts) {
        (self.answers, self.parameters.counts())
    }
}
