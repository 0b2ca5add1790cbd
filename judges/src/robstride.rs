//! The family `robstride`.
//!
//! ```text
//! robstride models                    one a line: name, position, velocity, torque, kp, kd, current
//! robstride registers                 one a line: index, kind, access
//! robstride encode P V T KP KD        five f32 a command in (p, v, kp, kd, t); id u32 and the 8 bytes of a frame out
//! robstride decode P V T KP KD        the same 12 bytes in; p, v, t and temperature as f32, status, faults, id and 0 out; a status
//!                                     of 255 is refused
//! robstride serve                     text, a line in and a line out:
//!   frame HOST ID enable|disable|clear|zero|store, id NEW, read INDEX, write INDEX VALUE      ID DATA
//!   drive ID P V T KP KD              a new simulated drive, beside others                    ok
//!   hear ID DATA                      a frame for all drives; the answers                     ID DATA ...
//!   step SECONDS                      moves all drives on                                     ok
//!   fail ID FAULTS, supply ID         of a drive                                              ok
//!   shaft ID                          of a drive                                              ANGLE VELOCITY TORQUE ENABLED FAULTS
//! ```

use crate::{Defect, Outcome};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Impedance;
use drivetrain::robstride::{Command, Feedback, Model, Register};
use drivetrain::sim::{Drive, RobStrideDrive};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::mit::Ranges;
use embedded_can::ExtendedId;
use std::fmt::Write as _;
use std::io::{BufRead, Read, Write};

const HOST: u8 = 0xFD;

pub fn run(
    arguments: &[&str],
    defect: Defect,
    input: impl BufRead,
    output: &mut impl Write,
) -> Outcome<()> {
    match arguments {
        ["models"] => {
            for model in Model::ALL {
                let (kp, kd) = model.ranges().gains();
                let (p, v, t) = (model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm());
                writeln!(output, "{} {p} {v} {t} {kp} {kd} {}", model.name(), model.current_a())?;
            }
            Ok(())
        }
        ["registers"] => {
            for register in Register::ALL {
                let kind = if register.is_float() { "float" } else { "integer" };
                let access = if register.is_writable() { "RW" } else { "RO" };
                writeln!(output, "{} {kind} {access}", register.index())?;
            }
            Ok(())
        }
        ["encode", ranges @ ..] => encode(&model_of(ranges)?, defect, input, output),
        ["decode", ranges @ ..] => decode(&model_of(ranges)?, defect, input, output),
        ["serve"] => serve(defect, input, output),
        _ => Err("see the head of judges/src/robstride.rs for the arguments".into()),
    }
}

/// A model with ranges of its own: those of a judge.
fn model_of(ranges: &[&str]) -> Outcome<Model> {
    let numbers: Vec<f32> = ranges.iter().map(|number| number.parse()).collect::<Result<_, _>>()?;
    let [p, v, t, kp, kd] = numbers[..] else { return Err("five ranges are needed".into()) };
    Ok(Model::new("judged", Ranges::new(p, v, t)?.with_gains(kp, kd)?, 1.0)?)
}

fn encode(
    model: &Model,
    defect: Defect,
    mut input: impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let mut commands = Vec::new();
    input.read_to_end(&mut commands)?;
    let (commands, _) = commands.as_chunks::<20>();
    for command in commands {
        let (fields, _) = command.as_chunks::<4>();
        let [p, v, kp, kd, t] = [0, 1, 2, 3, 4].map(|place| f32::from_le_bytes(fields[place]));
        let kd = if defect == Defect::Scale { kd * 65_536.0 / 65_535.0 } else { kd };
        let up = if defect == Defect::Rounded { model.tmax_nm() / 65_535.0 } else { 0.0 };
        let command = Impedance {
            angle: Angle::from_radians(p),
            velocity: AngularVelocity::from_rad_per_s(v),
            stiffness: kp,
            damping: kd,
            torque_nm: t + up,
        };
        let frame = Command::Operation(command).encode(model, HOST, 1);
        output.write_all(&id_of(&frame).to_le_bytes())?;
        output.write_all(&planted(*frame.bytes(), defect))?;
    }
    Ok(())
}

fn decode(
    model: &Model,
    defect: Defect,
    mut input: impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let mut frames = Vec::new();
    input.read_to_end(&mut frames)?;
    let (frames, _) = frames.as_chunks::<12>();
    for frame in frames {
        let [a, b, c, d, data @ ..] = *frame;
        let frame = extended(u32::from_le_bytes([a, b, c, d]), planted(data, defect))?;
        let Some(feedback) = Feedback::decode(&frame, model) else {
            output.write_all(&[[0; 16].as_slice(), &[255, 0, 0, 0]].concat())?;
            continue;
        };
        let measured = feedback.measured;
        let scale = if defect == Defect::Scale { 65_535.0 / 65_536.0 } else { 1.0 };
        for value in [
            measured.position_rad,
            measured.velocity_rad_per_s,
            measured.torque_nm * scale,
            feedback.temperature_c,
        ] {
            output.write_all(&value.to_le_bytes())?;
        }
        output.write_all(&[feedback.status as u8, feedback.faults, feedback.id, 0])?;
    }
    Ok(())
}

/// The low byte of the velocity and the high one behind it exchanged.
fn planted(mut data: [u8; 8], defect: Defect) -> [u8; 8] {
    if defect == Defect::Nibbles {
        data.swap(3, 4);
    }
    data
}

fn extended(id: u32, data: [u8; 8]) -> Outcome<CanFrame> {
    Ok(CanFrame::of(ExtendedId::new(id).ok_or("no id of 29 bits")?, data))
}

fn id_of(frame: &CanFrame) -> u32 {
    frame.header() & 0x1FFF_FFFF
}

fn serve(defect: Defect, input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let mut drives: Vec<(u8, RobStrideDrive)> = Vec::new();
    for line in input.lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut answer = String::from("ok");
        match words.as_slice() {
            ["frame", host, id, command @ ..] => {
                let id: u8 = id.parse()?;
                let command = command_of(command)?;
                let shift = u8::from(defect == Defect::Id);
                let frame = command.encode(&Model::RS02, host.parse()?, id + shift);
                answer =
                    told(&frame, defect, matches!(command, Command::Read(_) | Command::Write(..)));
            }
            ["drive", id, ranges @ ..] => {
                let id = id.parse()?;
                let numbers: Vec<f32> =
                    ranges.iter().map(|number| number.parse()).collect::<Result<_, _>>()?;
                let &[p, v, t, kp, kd] = &numbers[..] else {
                    return Err("five ranges are needed".into());
                };
                let model = Model::new("", Ranges::new(p, v, t)?.with_gains(kp, kd)?, 1.0)?;
                drives.retain(|(other, _)| *other != id);
                drives.push((id, RobStrideDrive::of(model, id)));
            }
            ["hear", id, data] => {
                answer.clear();
                let id = u32::from_str_radix(id, 16)?;
                let mut data = u64::from_str_radix(data, 16)?.to_be_bytes();
                if defect == Defect::Ear && id >> 24 == 1 {
                    data.swap(0, 1);
                }
                let frame = extended(id, data)?;
                for heard in drives.iter_mut().filter_map(|(_, drive)| drive.hear(&frame)) {
                    let mut data = *heard.bytes();
                    match (defect, id_of(&heard) >> 24) {
                        (Defect::Drive, 2) => data.swap(2, 3),
                        (Defect::Answer, 17) => data.swap(4, 7),
                        _ => {}
                    }
                    answer += &told(&extended(id_of(&heard), data)?, Defect::None, false);
                    answer.push(' ');
                }
            }
            ["step", seconds] => {
                let seconds: f32 = seconds.parse()?;
                let steps = (seconds / 1e-4).ceil().max(1.0);
                for _ in 0..steps as u32 {
                    drives.iter_mut().for_each(|(_, drive)| drive.step(seconds / steps));
                }
            }
            [verb @ ("fail" | "supply" | "shaft"), id, rest @ ..] => {
                let id: u8 = id.parse()?;
                let drive = drives.iter_mut().find(|(other, _)| *other == id);
                let (_, drive) = drive.ok_or("no such drive")?;
                match (*verb, rest) {
                    ("fail", [faults]) => drive.fail(faults.parse()?),
                    ("supply", []) => drive.lose_supply(),
                    ("shaft", []) => {
                        let shaft = drive.shaft();
                        let (angle, velocity) = (shaft.angle_rad(), shaft.velocity_rad_per_s());
                        let (torque, faults) = (shaft.torque_nm(), drive.faults());
                        let enabled = u8::from(drive.is_enabled());
                        answer.clear();
                        write!(answer, "{angle} {velocity} {torque} {enabled} {faults}")?;
                    }
                    _ => return Err(format!("what is {line:?}?").into()),
                }
            }
            _ => return Err(format!("what is {line:?}?").into()),
        }
        writeln!(output, "{}", answer.trim_end())?;
        output.flush()?;
    }
    Ok(())
}

fn command_of(words: &[&str]) -> Outcome<Command> {
    Ok(match words {
        ["enable"] => Command::Enable,
        ["disable"] => Command::Disable,
        ["clear"] => Command::ClearFaults,
        ["zero"] => Command::SetZero,
        ["store"] => Command::Store,
        ["id", new] => Command::SetId(new.parse()?),
        ["read", index] => Command::Read(register_of(index)?),
        ["write", index, value] => Command::Write(register_of(index)?, value.parse()?),
        _ => return Err(format!("what is {words:?}?").into()),
    })
}

fn register_of(index: &str) -> Outcome<Register> {
    let index: u16 = index.parse()?;
    let register = Register::ALL.iter().find(|register| register.index() == index);
    Ok(*register.ok_or_else(|| format!("no parameter {index}"))?)
}

fn told(frame: &CanFrame, defect: Defect, is_parameter: bool) -> String {
    let mut data = *frame.bytes();
    match defect {
        Defect::Number if is_parameter => data[0] += 1,
        Defect::Kind if is_parameter => data.swap(4, 7),
        _ => {}
    }
    format!("{:X} {:016X}", id_of(frame), u64::from_be_bytes(data))
}
