//! Motors of LK-TECH, for `judges/lk.py`.
//!
//! ```text
//! drivetrain-judges lk encode    eight bytes a command in, the 8 bytes of its frame out: see `encode`
//! drivetrain-judges lk decode    the 8 bytes of an answer in, 16 bytes out: see `decode`
//! drivetrain-judges lk serve     a simulated drive, by lines of text: see `serve`
//! ```

use crate::{Defect, Outcome};
use drivetrain::frame::CanFrame;
use drivetrain::lk::{Command, Feedback, Mode, Model, Motor, State};
use drivetrain::motor::{
    Actuator, AngleDrive, Devices, DriveProtocol, ImpedanceControl, VelocityDrive,
};
use drivetrain::sim::{Drive, DriveShaft, LkDrive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::fmt::Write as _;
use std::io::{BufRead, Read, Write};

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
        0x80 => Command::Off,
        0x88 => Command::Run,
        0x92 => Command::ReadAngle,
        0x9A => Command::ReadState,
        0x9B => Command::ClearErrors,
        0x9C => Command::ReadFeedback,
        0xA1 => Command::Torque(i16::try_from(value).unwrap_or(i16::MAX)),
        0xA2 => Command::Velocity(value, limit),
        0xA4 => Command::Position(value, limit),
        _ => return None,
    };
    Some(command.encode())
}

/// For feedback temperature, current, velocity and encoder, for a state temperature, supply in 0.01 V and 0.01 A, whether it is on (1)
/// in the low and the errors in the high byte, for an angle its `i64`.
#[expect(clippy::cast_possible_truncation, reason = "rounded counts")]
fn values_of(data: &[u8; 8]) -> Option<(u8, [i64; 4])> {
    if let Some(feedback) = Feedback::decode(data) {
        let Feedback { temperature_c, current, velocity_dps, encoder } = feedback;
        return Some((
            1,
            [temperature_c.into(), current.into(), velocity_dps.into(), encoder.into()],
        ));
    }
    if let Some(state) = State::decode(data) {
        let hundredths = |value: f32| (value * 100.0).round() as i64;
        let last = i64::from(state.is_on) | i64::from(state.errors) << 8;
        let (volts, amperes) = (hundredths(state.supply_v), hundredths(state.supply_a));
        return Some((2, [state.temperature_c.into(), volts, amperes, last]));
    }
    let angle = Feedback::decode_angle(data)?;
    Some((3, [angle, angle >> 16, angle >> 32, angle >> 48]))
}

/// Reads commands of eight bytes, the low one first: the first byte of the frame, a 0, a `u16` (the limit) and an `i32` (current,
/// velocity or angle). Writes the data of their frames.
pub fn encode(
    data_of: impl Fn(u8, u16, i32) -> Option<[u8; 8]>,
    defect: Defect,
    mut input: impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let mut commands = Vec::new();
    input.read_to_end(&mut commands)?;
    let (commands, []) = commands.as_chunks::<8>() else { return Err("half a command".into()) };
    for [code, _, a, b, c, d, e, f] in commands {
        let limit = u16::from_le_bytes([*a, *b]);
        let mut value = i32::from_le_bytes([*c, *d, *e, *f]);
        if defect == Defect::Scale {
            value = value.wrapping_mul(100);
        }
        let mut data =
            data_of(*code, limit, value).ok_or_else(|| format!("no command {code:X}"))?;
        if defect == Defect::Nibbles {
            data.swap(4, 5);
        }
        output.write_all(&data)?;
    }
    Ok(())
}

/// Reads the data of answers and writes 16 bytes for each, the low one first: the kind (0 nothing, 1 feedback, 2 state, 3 angle) and
/// three zeros; then the four values of 16 bits each; zeros follow.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the low 16 bits")]
pub fn decode(
    values_of: impl Fn(&[u8; 8]) -> Option<(u8, [i64; 4])>,
    defect: Defect,
    mut input: impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let mut frames = Vec::new();
    input.read_to_end(&mut frames)?;
    let (frames, []) = frames.as_chunks::<8>() else { return Err("half a frame".into()) };
    for data in frames {
        let mut data = *data;
        if defect == Defect::Nibbles {
            data.swap(4, 5);
        }
        let mut found = [0; 16];
        if let Some((kind, values)) = values_of(&data) {
            found[0] = kind;
            for (place, value) in found[4..12].chunks_exact_mut(2).zip(values) {
                place.copy_from_slice(&(value as u16).to_le_bytes());
            }
        }
        output.write_all(&found)?;
    }
    Ok(())
}

/// A simulated drive that is served.
pub trait Served: Drive {
    fn fail(&mut self, errors: u16);
    fn shaft(&self) -> (DriveShaft, bool, u16);
}

impl Served for LkDrive {
    fn fail(&mut self, errors: u16) {
        self.fail(errors.to_le_bytes()[0]);
    }
    fn shaft(&self) -> (DriveShaft, bool, u16) {
        (*self.shaft(), self.is_on(), self.errors().into())
    }
}

/// ```text
/// hear ID DATA       a frame for the drive, #1; the answer      ID DATA, or nothing
/// step SECONDS       moves it on                                ok
/// fail ERRORS        errors of the drive                        ok
/// shaft              of the drive                               ANGLE VELOCITY TORQUE ON ERRORS
/// session ID MODE    a motor and a drive: arms, drives, loses the drive to an error, disarms; the frames that are no control
///                    command, each once                         ID DATA ...
/// ```
pub fn serve(
    drive: &mut impl Served,
    frames_of: impl Fn(u8, &str) -> Outcome<Vec<CanFrame>>,
    defect: Defect,
    input: impl BufRead,
    output: &mut impl Write,
) -> Outcome<()> {
    for line in input.lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut answer = String::new();
        match words.as_slice() {
            ["hear", id, data] => {
                let mut data = u64::from_str_radix(data, 16)?.to_be_bytes();
                if defect == Defect::Ear {
                    data.swap(4, 5);
                }
                let id = u16::from_str_radix(id, 16)?;
                let frame = CanFrame::standard(id, data).ok_or("no id")?;
                if let Some(answered) = drive.hear(&frame) {
                    let mut data = *answered.bytes();
                    if defect == Defect::Drive {
                        data.swap(4, 5);
                    }
                    let header = u16::try_from(answered.header())?;
                    tell(&mut answer, &CanFrame::standard(header, data).ok_or("no id")?);
                }
            }
            ["step", seconds] => {
                let seconds: f32 = seconds.parse()?;
                let steps = (seconds / 1e-4).ceil().max(1.0);
                (0..steps as u32).for_each(|_| drive.step(seconds / steps));
                answer.push_str("ok");
            }
            ["fail", errors] => {
                drive.fail(errors.parse()?);
                answer.push_str("ok");
            }
            ["shaft"] => {
                let (shaft, on, errors) = drive.shaft();
                let (angle, velocity) = (shaft.angle_rad(), shaft.velocity_rad_per_s());
                write!(
                    answer,
                    "{angle} {velocity} {} {} {errors}",
                    shaft.torque_nm(),
                    u8::from(on)
                )?;
            }
            ["session", id, mode] => {
                for frame in frames_of(id.parse()?, mode)? {
                    let (mut header, data) = (u16::try_from(frame.header())?, *frame.bytes());
                    header += u16::from(defect == Defect::Id);
                    tell(&mut answer, &CanFrame::standard(header, data).ok_or("no id")?);
                }
            }
            _ => return Err(format!("what is {line:?}?").into()),
        }
        writeln!(output, "{}", answer.trim_end())?;
        output.flush()?;
    }
    Ok(())
}

fn tell(answer: &mut String, frame: &CanFrame) {
    let data = u64::from_be_bytes(*frame.bytes());
    _ = write!(answer, "{:X} {data:016X} ", frame.header());
}

fn drive_of(id: u8) -> LkDrive {
    LkDrive::of(Model::MF9025_16T, id)
}

fn frames_of(id: u8, mode: &str) -> Outcome<Vec<CanFrame>> {
    let quick = AngularVelocity::from_rad_per_s(10.0);
    let torque = ImpedanceControl::new(2.0)?.with_gains(5.0, 0.2)?;
    let mode = match mode {
        "torque" => torque.into(),
        "velocity" => Mode::velocity(quick),
        _ => Mode::position_velocity(quick),
    };
    session(Motor::new(Model::MF9025_16T, id, mode)?, drive_of(id))
}

/// Arms a motor, drives it, loses the drive to an error and disarms; returns the frames that are no control command, each once.
pub fn session<M: DriveProtocol>(motor: M, mut drive: impl Served) -> Outcome<Vec<CanFrame>> {
    let mut own = Actuator::new(motor);
    let mut seen = Vec::new();
    for ms in 1..1_000_u64 {
        let now = Instant::from_micros(ms * 1_000);
        match ms {
            100 => own.arm(now)?,
            600 => drive.fail(1),
            _ => {}
        }
        if ms > 100 {
            _ = own.set_torque(1.0);
            _ = own.set_velocity((), AngularVelocity::from_rad_per_s(10.0));
            _ = own.set_angle((), Angle::from_radians(1.0));
        }
        own.update(Tick::new(now, 0.001));
        while let Some(frame) = own.next_frame(0) {
            let is_control = matches!(frame.bytes()[0], 0xA1 | 0xA2 | 0xA4);
            if !is_control && !seen.contains(&frame) {
                seen.push(frame);
            }
            if let Some(answer) = drive.hear(&frame) {
                _ = Devices::ingest(&mut own, &answer, now);
            }
        }
        drive.step(0.001);
    }
    Ok(seen)
}
