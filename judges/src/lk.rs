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
use drivetrain::motor::{AngleDrive, Devices, ImpedanceControl, Own, VelocityDrive};
use drivetrain::sim::LkDrive;
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::fmt::Write as _;
use std::io::{BufRead, Read, Write};

pub fn run(arguments: &[&str], defect: Defect, output: &mut impl Write) -> Outcome<()> {
    let input = std::io::stdin().lock();
    match arguments {
        ["encode"] => encode(defect, input, output),
        ["decode"] => decode(defect, input, output),
        ["serve"] => serve(defect, input, output),
        _ => Err("see the head of judges/src/lk.rs for the arguments".into()),
    }
}

/// Reads commands of eight bytes, the low one first: the first byte of the frame, a 0, a `u16` (the limit) and an `i32` (current,
/// velocity or angle). Writes the data of their frames.
fn encode(defect: Defect, mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let mut commands = Vec::new();
    input.read_to_end(&mut commands)?;
    let (commands, []) = commands.as_chunks::<8>() else { return Err("half a command".into()) };
    for [code, _, a, b, c, d, e, f] in commands {
        let limit = u16::from_le_bytes([*a, *b]);
        let mut value = i32::from_le_bytes([*c, *d, *e, *f]);
        if defect == Defect::Scale {
            value = value.wrapping_mul(100);
        }
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
            _ => return Err(format!("no command {code:X}").into()),
        };
        let mut data = command.encode();
        if defect == Defect::Nibbles {
            data.swap(4, 5);
        }
        output.write_all(&data)?;
    }
    Ok(())
}

/// Reads the data of answers and writes 16 bytes for each, the low one first: what it is (0 nothing, 1 feedback, 2 state, 3 angle) and
/// three zeros; then for feedback temperature, current, velocity and encoder as `i16`, for a state temperature, supply in 0.01 V and
/// 0.01 A, whether it is on (1) in the low and the errors in the high byte, for an angle its `i64`; zeros follow.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded counts")]
fn decode(defect: Defect, mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let mut frames = Vec::new();
    input.read_to_end(&mut frames)?;
    let (frames, []) = frames.as_chunks::<8>() else { return Err("half a frame".into()) };
    for data in frames {
        let mut data = *data;
        if defect == Defect::Nibbles {
            data.swap(4, 5);
        }
        let mut found = [0; 16];
        let mut tell = |kind: u8, values: [i64; 4]| {
            found[0] = kind;
            for (place, value) in found[4..12].chunks_exact_mut(2).zip(values) {
                place.copy_from_slice(&(value as u16).to_le_bytes());
            }
        };
        if let Some(feedback) = Feedback::decode(&data) {
            let Feedback { temperature_c, current, velocity_dps, encoder } = feedback;
            tell(1, [temperature_c.into(), current.into(), velocity_dps.into(), encoder.into()]);
        } else if let Some(state) = State::decode(&data) {
            let hundredths = |value: f32| (value * 100.0).round() as i64;
            let last = i64::from(state.is_on) | i64::from(state.errors) << 8;
            let (volts, amperes) = (hundredths(state.supply_v), hundredths(state.supply_a));
            tell(2, [state.temperature_c.into(), volts, amperes, last]);
        } else if let Some(angle) = Feedback::decode_angle(&data) {
            found[0] = 3;
            found[4..12].copy_from_slice(&angle.to_le_bytes());
        }
        output.write_all(&found)?;
    }
    Ok(())
}

/// ```text
/// hear ID DATA       a frame for the drive, #1; the answer      ID DATA, or nothing
/// step SECONDS       moves it on                                ok
/// fail ERRORS        errors of the drive                        ok
/// shaft              of the drive                               ANGLE VELOCITY TORQUE ON ERRORS
/// session ID MODE    a motor and a drive: arms, drives, loses the drive to an error, disarms; the frames that are no control
///                    command, each once                         ID DATA ...
/// ```
fn serve(defect: Defect, input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let mut drive = drive_of(1);
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
                let shaft = drive.shaft();
                let (angle, velocity) = (shaft.angle_rad(), shaft.velocity_rad_per_s());
                let (torque, on) = (shaft.torque_nm(), u8::from(drive.is_on()));
                write!(answer, "{angle} {velocity} {torque} {on} {}", drive.errors())?;
            }
            ["session", id, mode] => {
                let (id, quick) = (id.parse()?, AngularVelocity::from_rad_per_s(10.0));
                let torque = ImpedanceControl::new(2.0)?.with_gains(5.0, 0.2)?;
                let sent = match *mode {
                    "torque" => session(id, torque, |own| _ = own.set_torque(1.0))?,
                    "velocity" => {
                        session(id, Mode::velocity(quick), |own| _ = own.set_velocity((), quick))?
                    }
                    _ => session(id, Mode::position_velocity(quick), |own| {
                        _ = own.set_angle((), Angle::from_radians(1.0));
                    })?,
                };
                for frame in sent {
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
    LkDrive::new(id, 33.0 / 4096.0, 0.32, 1.0, 16)
}

fn session(id: u8, mode: impl Into<Mode>, set: impl Fn(&mut Own<Motor>)) -> Outcome<Vec<CanFrame>> {
    let mut own = Own::new(Motor::new(Model::MF9025_16T, id, mode)?);
    let (mut drive, mut seen) = (drive_of(id), Vec::new());
    for ms in 1..1_000_u64 {
        let now = Instant::from_micros(ms * 1_000);
        match ms {
            100 => own.arm(now)?,
            600 => drive.fail(1),
            _ => {}
        }
        if ms > 100 {
            set(&mut own);
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
