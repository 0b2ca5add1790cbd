//! The family odrive, on binary streams and by lines of text.
//!
//! ```text
//! odrive encode    16 bytes a command in: kind, node, 2 zeros, three words; 16 out: id u32, length, 3 zeros, data
//! odrive decode    12 bytes a frame in: number, firmware 5 or 6, 2 zeros, data; 16 out: see `decode`
//! odrive serve     text, a line in and a line out:
//!     session MODE FIRMWARE END   a motor and a simulated axis: armed, driven, and ended by disarm, stop, target or feedback;
//!                                 the frames before, `|`, and those from when it has to rest      ID LENGTH DATA ...
//!     drive NODE FIRMWARE         a new simulated axis with 0.05 Nm/A                              ok
//!     hear ID LENGTH DATA         a frame for the axis; length R asks for a message; the answer    ID LENGTH DATA
//!     step SECONDS                moves the axis on; what it sends by itself                       ID LENGTH DATA ...
//!     shaft                       TURNS TURNS/S TORQUE STATE ERROR
//! ```
//! Numbers in a frame are hexadecimal. A last argument `--plant DEFECT` makes a mistake that a judge has to find.

use crate::Outcome;
use crate::defect::defects;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, AngleDrive, Devices, ImpedanceControl, VelocityDrive};
use drivetrain::odrive::{Command, Feedback, Firmware, Heartbeat, Mode, Model, Motor};
use drivetrain::sim::{Drive, OdriveDrive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};
use std::fmt::Write as _;
use std::io::{BufRead, Read, Write};

defects! {
    /// The two halves of the data are exchanged.
    Halves = "halves",
    /// Thousandths are truncated.
    Truncated = "truncated",
    /// Frames have the next node.
    Node = "node",
    /// Firmware 0.5 is read as 0.6, and the other way round.
    Firmware = "firmware",
    /// The last frames of a session command a torque.
    Rest = "rest",
    /// The simulated axis answers with the halves of its data exchanged.
    Drive = "drive",
    /// The simulated axis reads commands with the halves exchanged.
    Ear = "ear",
}

pub fn run(arguments: &[&str], input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = Defect::split(arguments)?;
    match arguments {
        ["encode"] => encode(defect, input, output),
        ["decode"] => decode(defect, input, output),
        ["serve"] => serve(defect, input, output),
        _ => Err("see the head of judges/src/odrive.rs for the arguments".into()),
    }
}

fn firmware(digit: u8, defect: Defect) -> Firmware {
    let is_0_6 = (digit == 6) != (defect == Defect::Firmware);
    if is_0_6 { Firmware::V0_6 } else { Firmware::V0_5 }
}

fn swapped([a, b, c, d, e, f, g, h]: [u8; 8]) -> [u8; 8] {
    [e, f, g, h, a, b, c, d]
}

fn encode(defect: Defect, mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let mut commands = Vec::new();
    input.read_to_end(&mut commands)?;
    let (commands, []) = commands.as_chunks::<16>() else { return Err("half a command".into()) };
    for command in commands {
        let (words, _) = command.as_chunks::<4>();
        let &[[kind, node, ..], a, b, c] = words else { return Err("not four words".into()) };
        let [a, b, c] = [a, b, c].map(u32::from_le_bytes);
        let [x, y, z] = [a, b, c].map(f32::from_bits);
        let milli = |value: f32| match defect {
            Defect::Truncated => (value * 1_000.0).trunc() / 1_000.0,
            _ => value,
        };
        let command = match kind {
            0 => Command::Stop,
            1 => Command::AxisState(a),
            2 => Command::ControllerMode(a, b),
            3 => Command::Position(x, milli(y), milli(z)),
            4 => Command::Velocity(x, y),
            5 => Command::Torque(x),
            6 => Command::Limits(x, y),
            7 => Command::TrajectoryVelocity(x),
            8 => Command::TrajectoryAcceleration(x, y),
            9 => Command::ClearErrors,
            _ => return Err(format!("no kind {kind}").into()),
        };
        let frame = command.frame(node + u8::from(defect == Defect::Node));
        let data = *frame.bytes();
        let data = if defect == Defect::Halves { swapped(data) } else { data };
        output.write_all(&frame.header().to_le_bytes())?;
        output.write_all(&[frame.length(), 0, 0, 0])?;
        output.write_all(&data)?;
    }
    Ok(())
}

/// Writes for estimates turns and turns/s; for a heartbeat axis error, state and three errors. Then whether the frame was taken, procedure
/// result, whether it is done, and five zeros.
fn decode(defect: Defect, mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let mut frames = Vec::new();
    input.read_to_end(&mut frames)?;
    let (frames, []) = frames.as_chunks::<12>() else { return Err("half a frame".into()) };
    for frame in frames {
        let [number, digit, _, _, data @ ..] = *frame;
        let data = if defect == Defect::Halves { swapped(data) } else { data };
        let mut result = [0; 16];
        if number == 9 {
            if let Some(Feedback { turns, turns_per_s }) = Feedback::decode(&data) {
                result[..4].copy_from_slice(&turns.to_le_bytes());
                result[4..8].copy_from_slice(&turns_per_s.to_le_bytes());
                result[8] = 1;
            }
        } else if let Some(heartbeat) = Heartbeat::decode(&data, firmware(digit, defect)) {
            result[..4].copy_from_slice(&heartbeat.axis_error.to_le_bytes());
            result[4] = heartbeat.state;
            for (place, has_error) in result[5..8].iter_mut().zip(heartbeat.has_errors) {
                *place = has_error.into();
            }
            result[8] = 1;
            result[9] = heartbeat.procedure_result;
            result[10] = heartbeat.is_done.into();
        }
        output.write_all(&result)?;
    }
    Ok(())
}

fn serve(defect: Defect, input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let mut drive = OdriveDrive::new(0, false, 0.05, 1.0);
    for line in input.lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut answer = String::new();
        match words.as_slice() {
            ["session", mode, digit, end] => {
                answer = session(mode, digit.parse()?, end, defect)?;
            }
            ["drive", node, digit] => {
                drive = OdriveDrive::new(node.parse()?, *digit == "6", 0.05, 1.0);
                answer.push_str("ok");
            }
            ["hear", id, length, data] => {
                let id = StandardId::new(u16::from_str_radix(id, 16)?).ok_or("no id")?;
                let mut data = u64::from_str_radix(data, 16)?.to_be_bytes();
                if defect == Defect::Ear {
                    data = swapped(data);
                }
                let frame = match *length {
                    "R" => CanFrame::new_remote(id, 8),
                    length => CanFrame::new(id, &data[..length.parse()?]),
                };
                if let Some(answered) = drive.hear(&frame.ok_or("no frame")?) {
                    tell(&mut answer, &planted(answered, defect));
                }
            }
            ["step", seconds] => {
                let seconds: f32 = seconds.parse()?;
                let steps = (seconds / 1e-4).ceil().max(1.0);
                for _ in 0..steps as u32 {
                    drive.step(seconds / steps);
                    while let Some(frame) = drive.next_frame() {
                        tell(&mut answer, &planted(frame, defect));
                    }
                }
            }
            ["shaft"] => {
                let turn = std::f32::consts::TAU;
                let (turns, velocity) =
                    (drive.shaft().angle_rad() / turn, drive.shaft().velocity_rad_per_s() / turn);
                let (torque, state) = (drive.shaft().torque_nm(), drive.state());
                write!(answer, "{turns} {velocity} {torque} {state} {}", drive.error())?;
            }
            _ => return Err(format!("what is {line:?}?").into()),
        }
        writeln!(output, "{}", answer.trim_end())?;
        output.flush()?;
    }
    Ok(())
}

fn planted(frame: CanFrame, defect: Defect) -> CanFrame {
    match defect {
        Defect::Drive => CanFrame::new(frame.id(), &swapped(*frame.bytes())).unwrap_or(frame),
        _ => frame,
    }
}

fn tell(answer: &mut String, frame: &CanFrame) {
    let length = if frame.is_remote_frame() { "R".to_owned() } else { frame.length().to_string() };
    let data = u64::from_be_bytes(*frame.bytes());
    _ = write!(answer, "{:X} {length} {data:016X} ", frame.header() & 0x7FF);
}

fn session(mode: &str, digit: u8, end: &str, defect: Defect) -> Outcome<String> {
    let gains = ImpedanceControl::new(2.0)?.with_gains(20.0, 0.6)?;
    match mode {
        "torque" => bench(gains, digit, end, defect, |own| _ = own.set_torque(1.5)),
        "impedance" => bench(gains, digit, end, defect, |own| _ = own.set_angle((), ANGLE)),
        "velocity" => {
            let velocity = AngularVelocity::from_rad_per_s(6.0);
            let mode = Mode::velocity(2.0);
            bench(mode, digit, end, defect, move |own| _ = own.set_velocity((), velocity))
        }
        "position" => {
            let mode = Mode::position_with_trajectory(2.0, 20.0);
            bench(mode, digit, end, defect, |own| _ = own.set_angle((), ANGLE))
        }
        _ => Err(format!("no mode {mode}").into()),
    }
}

const ANGLE: Angle = Angle::from_radians(1.0);

fn bench(
    mode: impl Into<Mode>,
    digit: u8,
    end: &str,
    defect: Defect,
    set: impl Fn(&mut Actuator<Motor>),
) -> Outcome<String> {
    let fastest = AngularVelocity::from_rad_per_s(20.0);
    let model = Model::D6374;
    let generation = firmware(digit, Defect::None);
    let mut own = Actuator::new(Motor::new(model, generation, 3, fastest, mode)?);
    let mut drive = OdriveDrive::new(3, digit == 6, model.torque_constant(), 1.0);
    let mut answer = String::new();
    for ms in 1..1_300_u64 {
        let now = Instant::from_micros(1_000 * ms);
        let is_over = ms >= 1_000;
        match ms {
            200 => own.arm(now)?,
            201..1_000 => set(&mut own),
            1_000 => {
                match end {
                    "disarm" => own.disarm(),
                    "stop" => own.emergency_stop(),
                    _ => {}
                }
                if matches!(end, "disarm" | "stop") {
                    answer.push_str("| ");
                }
            }
            1_012 if end == "feedback" => answer.push_str("| "),
            1_102 if end == "target" => answer.push_str("| "),
            _ => {}
        }
        if is_over && end == "feedback" {
            set(&mut own);
        }
        own.update(Tick::new(now, 0.001));
        let mut frames = Vec::new();
        while let Some(frame) = own.next_frame(0) {
            tell(&mut answer, &frame);
            frames.extend(drive.hear(&frame));
        }
        drive.step(0.001);
        while let Some(frame) = drive.next_frame() {
            frames.push(frame);
        }
        for frame in frames
            .iter()
            .filter(|frame| !(is_over && end == "feedback" && frame.header() & 0x1F == 9))
        {
            _ = Devices::ingest(&mut own, frame, now);
        }
    }
    if defect == Defect::Rest {
        tell(&mut answer, &Command::Torque(0.01).frame(3));
    }
    Ok(answer)
}
