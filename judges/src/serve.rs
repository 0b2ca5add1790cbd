//! A motor and simulated drives, by lines of text.
//!
//! ```text
//! motor MODEL ID MODE        a new motor                                          ok
//! read NUMBER                asks for a register; the frame that it sends         ID DATA
//! write NUMBER VALUE         the same                                             ID DATA
//! store                      the same                                             ID DATA
//! session MODEL ID MODE      a motor and a simulated drive: reads, arms, drives, loses the drive to an error, disarms; the frames
//!                            that ask for something or switch the drive, each once ID DATA ...
//! drive ID MASTER P V T      a new simulated drive, beside others                 ok
//! hear ID DATA               a frame for all drives; the answers                  ID DATA ...
//! step SECONDS               moves all drives on                                  ok
//! fail ID ERROR              an error of a drive                                  ok
//! supply ID                  a drive loses its supply                             ok
//! shaft ID                   of a drive                                           ANGLE VELOCITY TORQUE ENABLED ERROR
//! ```
//! Ids and data are hexadecimal, but for the ids of motors and drives.

use crate::{Defect, Outcome, model_named, register_of};
use drivetrain::damiao::{Mode, Model, Motor};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, AngleDrive, Devices, ImpedanceControl, VelocityDrive};
use drivetrain::sim::{DamiaoDrive, Drive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::mit;
use std::fmt::Write as _;
use std::io::{BufRead, Write};

pub fn serve(defect: Defect, input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let mut motor: Option<Box<dyn Station>> = None;
    let mut drives: Vec<(u8, DamiaoDrive)> = Vec::new();
    for line in input.lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut answer = String::new();
        match words.as_slice() {
            ["motor", model, id, mode] => {
                motor = Some(station(model_named(model)?, id.parse()?, mode)?);
                answer.push_str("ok");
            }
            [verb @ ("read" | "write" | "store"), rest @ ..] => {
                let motor = motor.as_mut().ok_or("no motor")?;
                let mut frame = motor.request(verb, rest)?;
                if defect == Defect::Kind && *verb == "write" {
                    frame = CanFrame::standard(0x7FF, as_float(*frame.bytes(), rest[1].parse()?))
                        .ok_or("no id")?;
                }
                tell(&mut answer, &planted(&frame, defect));
            }
            ["session", model, id, mode] => {
                for frame in station(model_named(model)?, id.parse()?, mode)?.session()? {
                    tell(&mut answer, &planted(&frame, defect));
                }
            }
            ["drive", id, master, p, v, t] => {
                let id = id.parse()?;
                let mut drive = DamiaoDrive::of(Model::J4310, id);
                for (register, value) in [(7, master), (21, p), (22, v), (23, t)] {
                    drive = drive.with_register(register, value.parse()?);
                }
                drives.retain(|(other, _)| *other != id);
                drives.push((id, drive));
                answer.push_str("ok");
            }
            ["hear", id, data] => {
                let mut data = bytes(data)?;
                let id = u16::from_str_radix(id, 16)?;
                let is_inquiry = id == 0x7FF && data[2] != 0xCC;
                if defect == Defect::Ear && id != 0x7FF && data[0] != 0xFF {
                    data.swap(0, 1);
                }
                let frame = CanFrame::standard(id, data).ok_or("no id")?;
                for answered in drives.iter_mut().filter_map(|(_, drive)| drive.hear(&frame)) {
                    let mut data = *answered.bytes();
                    match defect {
                        Defect::Drive if !is_inquiry => data.swap(3, 4),
                        Defect::Answer if is_inquiry => data.swap(4, 7),
                        _ => {}
                    }
                    let header = u16::try_from(answered.header())?;
                    tell(&mut answer, &CanFrame::standard(header, data).ok_or("no id")?);
                }
            }
            ["step", seconds] => {
                // In steps that are short beside the loops of a drive.
                let seconds: f32 = seconds.parse()?;
                let steps = (seconds / 1e-4).ceil().max(1.0);
                for _ in 0..steps as u32 {
                    drives.iter_mut().for_each(|(_, drive)| drive.step(seconds / steps));
                }
                answer.push_str("ok");
            }
            [verb @ ("fail" | "supply" | "shaft"), id, rest @ ..] => {
                let id: u8 = id.parse()?;
                let drive = drives.iter_mut().find(|(other, _)| *other == id);
                let (_, drive) = drive.ok_or("no such drive")?;
                match (*verb, rest) {
                    ("fail", [error]) => drive.fail(error.parse()?),
                    ("supply", []) => drive.lose_supply(),
                    ("shaft", []) => {
                        let (angle, velocity) =
                            (drive.shaft().angle_rad(), drive.shaft().velocity_rad_per_s());
                        let (torque, error) = (drive.shaft().torque_nm(), drive.error());
                        let enabled = u8::from(drive.is_enabled());
                        write!(answer, "{angle} {velocity} {torque} {enabled} {error}")?;
                    }
                    _ => return Err(format!("what is {line:?}?").into()),
                }
                if answer.is_empty() {
                    answer.push_str("ok");
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

fn bytes(data: &str) -> Outcome<[u8; 8]> {
    Ok(u64::from_str_radix(data, 16)?.to_be_bytes())
}

fn planted(frame: &CanFrame, defect: Defect) -> CanFrame {
    let (mut header, mut data) = (frame.header() as u16, *frame.bytes());
    match defect {
        Defect::Id if header != 0x7FF => header += 1,
        Defect::Number if header == 0x7FF => data[0] += 1,
        _ => {}
    }
    CanFrame::standard(header, data).unwrap_or(*frame)
}

fn as_float([a, b, c, d, ..]: [u8; 8], value: f32) -> [u8; 8] {
    let [e, f, g, h] = value.to_le_bytes();
    [a, b, c, d, e, f, g, h]
}

/// A motor in any mode, and the drive that it talks with.
trait Station {
    fn request(&mut self, verb: &str, arguments: &[&str]) -> Outcome<CanFrame>;

    fn session(&mut self) -> Outcome<Vec<CanFrame>>;
}

fn station(model: &Model, id: u8, mode: &str) -> Outcome<Box<dyn Station>> {
    let velocity = AngularVelocity::from_rad_per_s(model.vmax_rad_per_s().min(20.0));
    Ok(match mode {
        "mit" => Bench::boxed(
            model,
            id,
            1,
            ImpedanceControl::new(model.tmax_nm())?.with_gains(20.0, 1.0)?,
        )?,
        "position-velocity" => Bench::boxed(model, id, 2, Mode::position_velocity(velocity))?,
        "velocity" => Bench::boxed(model, id, 3, Mode::velocity(velocity))?,
        "force-position" => {
            Bench::boxed(model, id, 4, Mode::force_position(velocity, model.tmax_nm()))?
        }
        _ => return Err(format!("no mode {mode}").into()),
    })
}

struct Bench {
    own: Actuator<Motor>,
    drive: DamiaoDrive,
    now_us: u64,
    /// What the motor has sent in the last step.
    sent: Vec<CanFrame>,
}

impl Bench {
    fn boxed(
        model: &Model,
        id: u8,
        number: u8,
        mode: impl Into<Mode>,
    ) -> Outcome<Box<dyn Station>> {
        let own = Actuator::new(Motor::new(*model, id, mode)?);
        let drive = DamiaoDrive::of(*model, id).with_register(10, number.into());
        Ok(Box::new(Self { own, drive, now_us: 1_000, sent: Vec::new() }))
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    fn step(&mut self) {
        self.now_us += 1_000;
        let now = self.now();
        self.own.update(Tick::new(now, 0.001));
        self.sent.clear();
        while let Some(frame) = self.own.next_frame(0) {
            self.sent.push(frame);
            if let Some(answer) = self.drive.hear(&frame) {
                _ = Devices::ingest(&mut self.own, &answer, now);
            }
        }
        self.drive.step(0.001);
    }
}

impl Station for Bench {
    fn request(&mut self, verb: &str, arguments: &[&str]) -> Outcome<CanFrame> {
        let motor = self.own.motor_mut();
        let (code, number) = match (verb, arguments) {
            ("read", [number]) => {
                let register = register_of(number.parse()?)?;
                motor.read(register);
                (0x33, Some(register.number()))
            }
            ("write", [number, value]) => {
                let register = register_of(number.parse()?)?;
                motor.write(register, value.parse()?)?;
                (0x55, Some(register.number()))
            }
            ("store", []) => {
                motor.store();
                (0xAA, None)
            }
            _ => return Err(format!("what is {verb} {arguments:?}?").into()),
        };
        // The drive is not there, so that what is written here changes nothing.
        for _ in 0..100 {
            self.now_us += 1_000;
            let now = self.now();
            self.own.update(Tick::new(now, 0.001));
            while let Some(frame) = self.own.next_frame(0) {
                let [_, _, verb, register, ..] = *frame.bytes();
                let is_asked = number.is_none_or(|number| number == register);
                if frame.header() == 0x7FF && verb == code && is_asked {
                    return Ok(frame);
                }
            }
        }
        Err(format!("{verb} {arguments:?} is not sent").into())
    }

    fn session(&mut self) -> Outcome<Vec<CanFrame>> {
        let mut seen: Vec<CanFrame> = Vec::new();
        let mut note = |sent: &[CanFrame]| {
            for frame in sent {
                let is_special =
                    matches!(frame.bytes(), [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, _]);
                let is_inquiry = frame.header() == 0x7FF;
                if (is_special || is_inquiry) && !seen.contains(frame) {
                    seen.push(*frame);
                }
            }
        };
        for step in 0..1_000 {
            self.step();
            note(&self.sent);
            match step {
                100 => self.own.arm(self.now()).map_err(|error| error.to_string())?,
                600 => self.drive.fail(14),
                900 => self.own.disarm(),
                _ => {}
            }
            _ = self.own.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
            _ = self.own.set_angle((), Angle::from_radians(1.0));
        }
        // No motor sends it: a program does, to the same id.
        let enable = seen.iter().find(|frame| frame.bytes() == &mit::ENABLE);
        let id = enable.ok_or("the motor is never enabled")?.header() as u16;
        seen.push(CanFrame::standard(id, mit::SET_ZERO).ok_or("no id")?);
        Ok(seen)
    }
}
