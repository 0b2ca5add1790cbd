//! Motors of MyActuator, for `judges/rmd.py`: the verbs of `lk`, with other commands, answers and drives.

use crate::lk::{Served, decode, encode, serve, session};
use crate::{Defect, Outcome};
use drivetrain::frame::CanFrame;
use drivetrain::motor::ImpedanceControl;
use drivetrain::rmd::{Command, Feedback, Mode, Model, Motor, State};
use drivetrain::sim::{DriveShaft, RmdDrive};
use drivetrain::units::AngularVelocity;
use std::io::{BufRead, Write};

const MODEL: Model = Model::X8_120;

pub fn run(
    arguments: &[&str],
    defect: Defect,
    input: impl BufRead,
    output: &mut impl Write,
) -> Outcome<()> {
    match arguments {
        ["encode"] => encode(data_of, defect, input, output),
        ["decode"] => decode(values_of, defect, input, output),
        ["serve"] => serve(&mut drive_of(1), frames_of, defect, input, output),
        _ => Err("see the head of judges/src/lk.rs for the arguments".into()),
    }
}

fn data_of(code: u8, limit: u16, value: i32) -> Option<[u8; 8]> {
    let command = match code {
        0x77 => Command::ReleaseBrake,
        0x80 => Command::Off,
        0x81 => Command::Stop,
        0x9C => Command::ReadFeedback,
        0xA1 => Command::Torque(i16::try_from(value).unwrap_or(i16::MAX)),
        0xA2 => Command::Velocity(value),
        0xA4 => Command::Position(value, limit),
        _ => return None,
    };
    Some(command.encode())
}

/// For feedback temperature, current, velocity and angle, for a state temperature, brake, supply in 0.1 V and errors.
#[expect(clippy::cast_possible_truncation, reason = "a rounded count")]
fn values_of(data: &[u8; 8]) -> Option<(u8, [i64; 4])> {
    if let Some(feedback) = Feedback::decode(data) {
        let Feedback { temperature_c, current, velocity_dps, angle_deg } = feedback;
        let values = [temperature_c.into(), current.into(), velocity_dps.into(), angle_deg.into()];
        return Some((1, values));
    }
    let state = State::decode(data)?;
    let supply = (state.supply_v * 10.0).round() as i64;
    Some((2, [state.temperature_c.into(), state.is_brake_open.into(), supply, state.errors.into()]))
}

fn drive_of(id: u8) -> RmdDrive {
    RmdDrive::new(id, MODEL.torque_constant())
}

impl Served for RmdDrive {
    fn fail(&mut self, errors: u16) {
        self.fail(errors);
    }
    fn shaft(&self) -> (DriveShaft, bool, u16) {
        (*self.shaft(), self.is_on(), self.errors())
    }
}

fn frames_of(id: u8, mode: &str) -> Outcome<Vec<CanFrame>> {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    let torque = ImpedanceControl::new(2.0)?.with_gains(5.0, 0.2)?;
    match mode {
        "torque" => session(Motor::new(MODEL, id, torque)?, drive_of(id)),
        "velocity" => session(Motor::new(MODEL, id, Mode::velocity(quick))?, drive_of(id)),
        _ => session(Motor::new(MODEL, id, Mode::position_velocity(quick))?, drive_of(id)),
    }
}
