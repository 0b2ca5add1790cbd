//! The family `vesc` on binary streams and by lines of text, and the crate `vesc` beside it, which has the serial protocol of the same
//! drives.
//!
//! ```text
//! drivetrain-judges vesc encode KIND       f32 in, the 4 bytes of each value out
//! drivetrain-judges vesc other KIND        the same by the crate `vesc`
//! drivetrain-judges vesc frames KIND VALUE the frames for each id, and the question, a line each: ID DATA
//! drivetrain-judges vesc decode            status 1 to 5 in, 40 bytes; 13 f64 out
//! drivetrain-judges vesc decode-other      the same fields by the crate `vesc`, each by a field of its kind
//! drivetrain-judges vesc fault ID          answers in, 8 bytes; the fault code of each out, 255 for none
//! drivetrain-judges vesc serve             a simulated drive by text, a line in and a line out
//! ```
//! Defects: `order` exchanges bytes of values, `scale` takes 1024 for 1000, `id` adds 1 to ids, `packet` adds 1 to packets, `answer`
//! has the simulated drive answer with another code, `ear` has it hear a brake as a current.

use crate::Outcome;
use drivetrain::encoder::GearRatio;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, CanDevice, DriveProtocol, Ingest};
use drivetrain::sim::{Drive, VescDrive};
use drivetrain::time::Instant;
use drivetrain::units::AngularVelocity;
use drivetrain::vesc::{Command, Feedback, Mode, Model, Motor};
use embedded_can::{ExtendedId, Frame};
use std::io::{BufRead, Read, Write};

const MODEL: Model = Model {
    name: "6374",
    pole_pairs: 7,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.05,
    current_limit_a: 40.0,
    max_velocity: AngularVelocity::from_rad_per_s(300.0),
};

pub fn run(arguments: &[&str], mut input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = match arguments {
        [rest @ .., "--plant", name] => (rest, *name),
        _ => (arguments, ""),
    };
    match arguments {
        ["encode", kind] => values(&mut input, output, |value| encode(kind, value, defect)),
        ["other", kind] => values(&mut input, output, |value| other(kind, value)),
        ["frames", kind, value] => frames(kind, value.parse()?, defect, output),
        ["decode"] => statuses(&mut input, output, |data| decode(data, defect)),
        ["decode-other"] => statuses(&mut input, output, decode_other),
        ["fault", id] => faults(id.parse()?, &mut input, output),
        ["serve"] => serve(defect, input, output),
        _ => Err("see the head of judges/src/vesc.rs for the arguments".into()),
    }
}

fn values(
    input: &mut impl Read,
    output: &mut impl Write,
    each: impl Fn(f32) -> Outcome<[u8; 4]>,
) -> Outcome<()> {
    let mut data = Vec::new();
    input.read_to_end(&mut data)?;
    let (values, []) = data.as_chunks::<4>() else { return Err("half a value".into()) };
    for value in values {
        output.write_all(&each(f32::from_le_bytes(*value))?)?;
    }
    Ok(())
}

fn command(kind: &str, value: f32) -> Outcome<Command> {
    Ok(match kind {
        "duty" => Command::Duty(value),
        "current" => Command::Current(value),
        "brake" => Command::Brake(value),
        "speed" => Command::Speed(value),
        "position" => Command::Position(value),
        "current-share" => Command::CurrentShare(value),
        "brake-share" => Command::BrakeShare(value),
        "handbrake" => Command::Handbrake(value),
        "handbrake-share" => Command::HandbrakeShare(value),
        _ => return Err(format!("no command {kind}").into()),
    })
}

fn encode(kind: &str, value: f32, defect: &str) -> Outcome<[u8; 4]> {
    let value = if defect == "scale" { value * 1.024 } else { value };
    let frame = command(kind, value)?.frame(23);
    let mut data = *frame.data().first_chunk().ok_or("no value")?;
    if defect == "order" {
        data.swap(1, 2);
    }
    Ok(data)
}

/// A packet of the serial protocol is 2, length, payload, two bytes of check, 3. The payload is a number and the value.
fn other(kind: &str, value: f32) -> Outcome<[u8; 4]> {
    let command = match kind {
        "duty" => ::vesc::Command::SetDuty(value),
        "current" => ::vesc::Command::SetCurrent(value),
        "brake" => ::vesc::Command::SetCurrentBrake(value),
        "speed" => ::vesc::Command::SetRpm(value as i32),
        "position" => ::vesc::Command::SetPos(value),
        "current-share" => ::vesc::Command::SetCurrentRel(value),
        "handbrake" => ::vesc::Command::SetHandbrake(value),
        _ => return Err(format!("the crate has no {kind}").into()),
    };
    let mut packet = [0; 16];
    let length = ::vesc::encode(command, &mut packet).map_err(|error| format!("{error:?}"))?;
    match &packet[..length] {
        &[2, 5, _, a, b, c, d, _, _, 3] => Ok([a, b, c, d]),
        packet => Err(format!("{packet:?}").into()),
    }
}

fn frames(kind: &str, value: f32, defect: &str, output: &mut impl Write) -> Outcome<()> {
    for id in 0..=253_u8 {
        let own = Motor::new(MODEL, id, Mode::current())?;
        let question = { own }.inquire().ok_or("no question")?;
        for frame in [command(kind, value)?.frame(id), question] {
            let mut raw = frame.header() & 0x1FFF_FFFF;
            raw += match defect {
                "id" => 1,
                "packet" => 1 << 8,
                _ => 0,
            };
            let data: String = frame.data().iter().map(|byte| format!("{byte:02x}")).collect();
            writeln!(output, "{raw:X} {data}")?;
        }
    }
    Ok(())
}

const PACKETS: [u8; 5] = [9, 14, 15, 16, 27];

fn statuses(
    input: &mut impl Read,
    output: &mut impl Write,
    each: impl Fn(&[[u8; 8]]) -> Outcome<[f64; 13]>,
) -> Outcome<()> {
    let mut data = Vec::new();
    input.read_to_end(&mut data)?;
    let (frames, []) = data.as_chunks::<8>() else { return Err("half a frame".into()) };
    for set in frames.chunks_exact(PACKETS.len()) {
        for value in each(set)? {
            output.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}

fn decode(set: &[[u8; 8]], defect: &str) -> Outcome<[f64; 13]> {
    let mut feedback = Feedback::default();
    for (packet, data) in PACKETS.into_iter().zip(set) {
        let mut data = *data;
        if defect == "order" {
            data.swap(0, 1);
        }
        if !feedback.take(packet, &data) {
            return Err(format!("packet {packet} is refused").into());
        }
    }
    let all = || -> Option<[f64; 13]> {
        let [used_ah, fed_ah] = feedback.charge_ah?;
        let [used_wh, fed_wh] = feedback.energy_wh?;
        Some([
            feedback.erpm?.into(),
            feedback.current_a?.into(),
            feedback.duty?.into(),
            used_ah.into(),
            fed_ah.into(),
            used_wh.into(),
            fed_wh.into(),
            feedback.driver_c?.into(),
            feedback.motor_c?.into(),
            feedback.input_a?.into(),
            feedback.position_deg?.into(),
            feedback.tachometer?.into(),
            feedback.supply_v?.into(),
        ])
    };
    let mut values = all().ok_or("a value is missing")?;
    if defect == "scale" {
        values[2] *= 1.024;
    }
    Ok(values)
}

/// The serial protocol has its values in fields of the same kinds. The position has none of its kind: it is sent as a temperature.
fn decode_other(set: &[[u8; 8]]) -> Outcome<[f64; 13]> {
    let [one, two, three, four, five] = set else { return Err("not five frames".into()) };
    let pack = |mask: u32, fields: &[&[u8]]| {
        let mut payload = vec![50];
        payload.extend(mask.to_be_bytes());
        fields.iter().for_each(|field| payload.extend(*field));
        read(&payload)
    };
    // temp_mosfet, temp_motor, duty_cycle, rpm, voltage_in, four charges, tachometer
    let first = pack(
        0b0011_1111_1100_0011,
        &[
            &one[4..6],
            &four[0..2],
            &one[6..8],
            &one[0..4],
            &five[4..6],
            &two[0..4],
            &two[4..8],
            &three[0..4],
            &three[4..8],
            &five[0..4],
        ],
    )?;
    // temp_mosfet, temp_motor, voltage_in
    let second = pack(0b1_0000_0011, &[&four[2..4], &four[4..6], &four[6..8]])?;
    let position = second.voltage_in * 10.0 / 50.0;
    Ok([
        first.rpm.into(),
        first.temp_mosfet.into(),
        first.duty_cycle.into(),
        first.amp_hours.into(),
        first.amp_hours_charged.into(),
        first.watt_hours.into(),
        first.watt_hours_charged.into(),
        first.temp_motor.into(),
        second.temp_mosfet.into(),
        second.temp_motor.into(),
        position.into(),
        first.tachometer.into(),
        first.voltage_in.into(),
    ])
}

/// Has the crate read the payload of a reply.
fn read(payload: &[u8]) -> Outcome<::vesc::Values> {
    let mut check = 0_u16;
    for byte in payload {
        check ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            check = if check & 0x8000 != 0 { check << 1 ^ 0x1021 } else { check << 1 };
        }
    }
    let mut packet = vec![2, u8::try_from(payload.len())?];
    packet.extend(payload);
    packet.extend(check.to_be_bytes());
    packet.push(3);
    match ::vesc::decode(&packet).map_err(|error| format!("{error:?}"))? {
        (_, ::vesc::CommandReply::GetValuesSelective(values)) => Ok(values),
        _ => Err("another reply".into()),
    }
}

/// A motor hears answers with the id of this program.
fn faults(id: u8, input: &mut impl Read, output: &mut impl Write) -> Outcome<()> {
    let mut data = Vec::new();
    input.read_to_end(&mut data)?;
    let (answers, []) = data.as_chunks::<8>() else { return Err("half an answer".into()) };
    let answered = ExtendedId::new(8 << 8 | 254).ok_or("no id")?;
    for answer in answers {
        let mut own = Actuator::new(Motor::new(MODEL, id, Mode::current())?);
        let frame = CanFrame::new(answered, answer).ok_or("no frame")?;
        let outcome = own.ingest(&frame, Instant::from_micros(1));
        let fault = own.motor().feedback().fault;
        if (outcome == Ingest::Taken) != fault.is_some() {
            return Err(format!("{answer:?}: {outcome:?} and {fault:?}").into());
        }
        output.write_all(&[fault.unwrap_or(255)])?;
    }
    Ok(())
}

/// ```text
/// drive ID        a new simulated drive                            ok
/// hear ID DATA    a frame; the answer, if there is one             ID DATA
/// fail CODE       a fault                                          ok
/// step SECONDS    moves on                                         ok
/// shaft           ANGLE VELOCITY TORQUE FAULT
/// report PACKET   a status frame                                   ID DATA
/// ```
fn serve(defect: &str, input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let mut drive = VescDrive::of(MODEL, 0);
    for line in input.lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut answer = String::from("ok");
        match words.as_slice() {
            ["drive", id] => drive = VescDrive::of(MODEL, id.parse()?),
            ["hear", id, data] => {
                let bytes =
                    (0..data.len() / 2).map(|at| u8::from_str_radix(&data[2 * at..2 * at + 2], 16));
                let bytes: Vec<u8> = bytes.collect::<Result<_, _>>()?;
                let mut raw = u32::from_str_radix(id, 16)?;
                if defect == "ear" && raw >> 8 == 2 {
                    raw -= 1 << 8;
                }
                let id = ExtendedId::new(raw).ok_or("no id")?;
                let frame = CanFrame::new(id, &bytes).ok_or("no frame")?;
                answer =
                    drive.hear(&frame).map_or_else(|| "-".into(), |frame| tell(&frame, defect));
            }
            ["fail", code] => drive.fail(code.parse()?),
            ["step", seconds] => {
                let seconds: f32 = seconds.parse()?;
                let steps = (seconds / 1e-4).ceil().max(1.0);
                for _ in 0..steps as u32 {
                    drive.step(seconds / steps);
                }
            }
            ["shaft"] => {
                let shaft = drive.shaft();
                let (angle, velocity) = (shaft.angle_rad(), shaft.velocity_rad_per_s());
                answer = format!("{angle} {velocity} {} {}", shaft.torque_nm(), drive.fault());
            }
            ["report", packet] => {
                answer = tell(&drive.report(packet.parse()?).ok_or("no such status")?, "");
            }
            _ => return Err(format!("what is {line:?}?").into()),
        }
        writeln!(output, "{answer}")?;
        output.flush()?;
    }
    Ok(())
}

fn tell(frame: &CanFrame, defect: &str) -> String {
    let mut data = *frame.bytes();
    if defect == "answer" {
        data[7] ^= 1;
    }
    format!("{:X} {:016x}", frame.header() & 0x1FFF_FFFF, u64::from_be_bytes(data))
}
