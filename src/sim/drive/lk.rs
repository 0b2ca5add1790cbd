//! A simulated LK-TECH drive with its shaft, written from the manual. Fields are extracted from the frame as one 64-bit number, low byte
//! first.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "fields of a frame, which wrap as the drive's do"
)]

use super::{Drive, DriveShaft, within};
use crate::frame::CanFrame;
use crate::lk::Model;
use embedded_can::{Frame, Id, StandardId};

const OFF: u64 = 0x80;
const RUN: u64 = 0x88;
const ANGLE: u64 = 0x92;
const STATE: u64 = 0x9A;
const CLEAR: u64 = 0x9B;
const FEEDBACK: u64 = 0x9C;
const TORQUE: u64 = 0xA1;
const VELOCITY: u64 = 0xA2;
const POSITION: u64 = 0xA4;

/// An LK-TECH drive with its shaft, for tests: takes frames, answers them, and moves.
///
/// The drive is on as soon as its supply is, and follows its last command for ever. "Off" clears the counted turns and the command; the
/// drive still answers. With an error the torque is zero. Frames of the manual that the family does not send are not answered. Commands and
/// answers have one id: a drive that hears its own answer answers again.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::lk::Model;
/// use drivetrain::sim::{Drive, LkDrive};
///
/// let mut drive = LkDrive::of(Model::MF9025_16T, 1); // 33/4096 A a count, 0.32 Nm/A
/// let torque = [0xA1, 0, 0, 0, 100, 0, 0, 0];
/// let answer = CanFrame::standard(0x141, torque).and_then(|frame| drive.hear(&frame)).ok_or("no answer")?;
/// assert_eq!((answer.header(), answer.bytes()[0]), (0x141, 0xA1));
/// drive.step(1e-3);
/// assert!((drive.shaft().torque_nm() - 100.0 * 33.0 / 4096.0 * 0.32).abs() < 1e-5);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct LkDrive {
    id: u8,
    torque_per_count: f64,
    gear: f64,
    encoder_bits: u8,
    is_on: bool,
    errors: u8,
    /// Errors whose cause persists.
    reasons: u8,
    temperature_c: i8,
    /// Turns of the rotor up to the last "off" or start: the drive does not count them.
    cleared: f64,
    command: Command,
    shaft: DriveShaft,
}

#[derive(Debug, Clone, Copy)]
enum Command {
    None,
    /// In counts.
    Torque(f64),
    /// In °/s of the rotor, and a limit in counts, 0 for none.
    Velocity(f64, f64),
    /// In ° of the rotor over its turns, and °/s.
    Position(f64, f64),
}

impl LkDrive {
    /// Makes a drive of a model with an id, 1 to 32. The drive is on, with an inertia of 0.01 kg m².
    #[must_use]
    pub fn of(model: Model, id: u8) -> Self {
        let amperes_per_count = f64::from(model.series().amperes_per_count());
        Self {
            id,
            torque_per_count: amperes_per_count * f64::from(model.torque_constant()),
            gear: model.gear().into(),
            encoder_bits: model.encoder_bits(),
            is_on: true,
            errors: 0,
            reasons: 0,
            temperature_c: 30,
            cleared: 0.0,
            command: Command::None,
            shaft: DriveShaft::new(0.01, 0.01),
        }
    }

    /// Replaces the shaft.
    #[must_use]
    pub const fn with_shaft(self, shaft: DriveShaft) -> Self {
        Self { shaft, ..self }
    }

    /// Returns the shaft.
    #[must_use]
    pub const fn shaft(&self) -> &DriveShaft {
        &self.shaft
    }

    /// Returns the shaft, for a load or a turn from outside.
    pub const fn shaft_mut(&mut self) -> &mut DriveShaft {
        &mut self.shaft
    }

    /// Sets the temperature in °C.
    pub const fn set_temperature(&mut self, temperature_c: i8) {
        self.temperature_c = temperature_c;
    }

    /// Makes the drive report errors, one bit each, until they are cleared.
    pub const fn fail(&mut self, errors: u8) {
        self.errors |= errors;
    }

    /// Sets the errors whose cause persists, one bit each: a command to clear leaves these errors.
    pub const fn set_reasons(&mut self, errors: u8) {
        self.reasons = errors;
        self.fail(errors);
    }

    /// Interrupts the supply: the drive is on again, without a command, and counts its turns from zero.
    pub fn lose_supply(&mut self) {
        (self.is_on, self.errors, self.command) = (true, self.reasons, Command::None);
        self.clear_turns();
    }

    /// Returns whether the drive follows commands.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.is_on
    }

    /// Returns the errors, one bit each.
    #[must_use]
    pub const fn errors(&self) -> u8 {
        self.errors
    }

    fn wanted_nm(&self) -> f64 {
        let to_shaft = core::f64::consts::PI / 180.0 / self.gear;
        match self.command {
            Command::None => 0.0,
            Command::Torque(counts) => counts * self.torque_per_count,
            Command::Velocity(velocity, limit) => {
                let most = if limit > 0.0 { limit * self.torque_per_count } else { f64::MAX };
                within(self.shaft.following_nm(velocity * to_shaft), most)
            }
            Command::Position(angle, limit) => {
                let way = angle - (self.rotor_turns() - self.cleared) * 360.0;
                self.shaft.following_nm(within(5.0 * way, limit) * to_shaft)
            }
        }
    }

    /// Returns bytes 1 to 7 of a feedback frame.
    fn feedback(&self) -> u64 {
        let current = (self.shaft.torque_nm / self.torque_per_count) as i16;
        let velocity = (self.shaft.velocity_rad_per_s * self.gear).to_degrees() as i16;
        let turns = self.rotor_turns();
        let counts = (turns - floor(turns)) * f64::from(1_u32 << self.encoder_bits);
        u64::from(self.temperature_c as u8) << 8
            | u64::from(current as u16) << 16
            | u64::from(velocity as u16) << 32
            | (counts as u64 & 0xFFFF) << 48
    }

    fn rotor_turns(&self) -> f64 {
        self.shaft.angle_rad * self.gear / core::f64::consts::TAU
    }

    /// Clears the whole turns; the angle within the turn stays.
    fn clear_turns(&mut self) {
        self.cleared = floor(self.rotor_turns());
    }
}

impl Drive for LkDrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let id = StandardId::new(0x140 + u16::from(self.id))?;
        if frame.id() != Id::Standard(id) || !frame.is_data_frame() || frame.length() != 8 {
            return None;
        }
        let bits = u64::from_le_bytes(*frame.bytes());
        let (code, middle, high) = (bits & 0xFF, bits >> 16 & 0xFFFF, (bits >> 32) as i32);
        let command = match code {
            TORQUE => Command::Torque(f64::from(high as i16)),
            VELOCITY => Command::Velocity(f64::from(high) / 100.0, middle as f64),
            POSITION => Command::Position(f64::from(high) / 100.0, middle as f64),
            OFF => {
                self.is_on = false;
                self.clear_turns();
                Command::None
            }
            RUN => {
                self.is_on = true;
                self.command
            }
            CLEAR => {
                self.errors = self.reasons;
                self.command
            }
            ANGLE | STATE | FEEDBACK => self.command,
            _ => return None,
        };
        if self.is_on || code == OFF {
            self.command = command;
        }
        let answer = match code {
            OFF | RUN => bits,
            ANGLE => {
                let angle = (self.rotor_turns() - self.cleared) * 36_000.0;
                code | (floor(angle) as i64 as u64) << 8
            }
            STATE | CLEAR => {
                let state = if self.is_on { 0 } else { 0x10 };
                let supply = 2_400 << 16 | state << 48 | u64::from(self.errors) << 56;
                code | u64::from(self.temperature_c as u8) << 8 | supply
            }
            _ => code | self.feedback(),
        };
        Some(CanFrame::of(Id::Standard(id), answer.to_le_bytes()))
    }

    fn step(&mut self, dt_s: f32) {
        let torque_nm = if self.is_on && self.errors == 0 { self.wanted_nm() } else { 0.0 };
        self.shaft.step(torque_nm, dt_s.into());
    }
}

fn floor(value: f64) -> f64 {
    let whole = value as i64 as f64;
    if whole > value { whole - 1.0 } else { whole }
}
