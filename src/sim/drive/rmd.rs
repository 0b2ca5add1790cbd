//! A simulated MyActuator drive with its shaft, written from the manual. Fields are extracted from the frame as one 64-bit number, low byte
//! first.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "fields of a frame, which wrap as the drive's do"
)]

use super::{Drive, DriveShaft};
use crate::frame::CanFrame;
use embedded_can::{Frame, Id, StandardId};

const RESET: u64 = 0x76;
const RELEASE: u64 = 0x77;
const LOCK: u64 = 0x78;
const OFF: u64 = 0x80;
const STOP: u64 = 0x81;
const ANGLE: u64 = 0x92;
const STATE: u64 = 0x9A;
const FEEDBACK: u64 = 0x9C;
const TORQUE: u64 = 0xA1;
const VELOCITY: u64 = 0xA2;
const POSITION: u64 = 0xA4;
const TIMEOUT: u64 = 0xB3;
const EXPIRED: u64 = 0xF1;

/// The id of commands for all drives.
const ALL: u16 = 0x280;

/// Time for the brake to open, and for a reset, in s: measured by users.
const OPENING_S: f64 = 0.1;
const STARTING_S: f64 = 1.12;

/// Errors that stay until a reset.
const LASTING: u16 = 0x0092;

/// A MyActuator drive (protocol V4) with its shaft, for tests: takes frames, answers them, and moves.
///
/// The drive follows any command at once, and holds its last command until the time-out; a new drive has no time-out. "Off" ends the
/// command and locks the holding brake. A velocity or a position releases the brake, a torque does not. After the time-out the output is
/// off and the brake locked. The next frame is echoed without effect, and the command before the time-out holds again: the worst case, as
/// the manual does not say whether the command holds. The drive reports an expired time-out by itself, at once and then each second. With an
/// error the torque is zero. Frames of the manual that the family does not send are not answered.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::{Drive, RmdDrive};
///
/// let mut drive = RmdDrive::new(1, 2.4); // Nm/A
/// let torque = [0xA1, 0, 0, 0, 100, 0, 0, 0];
/// let answer = CanFrame::standard(0x141, torque).and_then(|frame| drive.hear(&frame)).ok_or("no answer")?;
/// assert_eq!((answer.header(), answer.bytes()[0]), (0x241, 0xA1));
/// drive.step(1e-3);
/// assert!((drive.shaft().torque_nm() - 2.4).abs() < 1e-5);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct RmdDrive {
    id: u8,
    torque_constant: f64,
    command: Command,
    errors: u16,
    /// Errors whose cause persists.
    reasons: u16,
    temperature_c: i8,
    /// The angle of the shaft at the zero of the drive, in °.
    zero_deg: f64,
    /// In ms, 0 for none.
    timeout_ms: u32,
    silent_s: f64,
    is_expired: bool,
    /// Time since the last report of an expired time-out.
    unreported_s: f64,
    /// Whether there is a holding brake, and the time until the brake is open; `None` while it is locked.
    has_brake: bool,
    off_locks: bool,
    opening_s: Option<f64>,
    /// The time until the program runs.
    starting_s: f64,
    takes_timeout: bool,
    shaft: DriveShaft,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Command {
    None,
    /// In A.
    Torque(f64),
    /// In °/s.
    Velocity(f64),
    /// In °, and °/s, 0 for no limit.
    Position(f64, f64),
}

impl RmdDrive {
    /// Makes a drive with an id, 1 to 32, and the torque constant in Nm/A at the output shaft. The drive has no command, no time-out and no
    /// holding brake, and an inertia of 0.01 kg m².
    #[must_use]
    pub fn new(id: u8, torque_constant: f32) -> Self {
        Self {
            id,
            torque_constant: torque_constant.into(),
            command: Command::None,
            errors: 0,
            reasons: 0,
            temperature_c: 30,
            zero_deg: 0.0,
            timeout_ms: 0,
            silent_s: 0.0,
            is_expired: false,
            unreported_s: 0.0,
            has_brake: false,
            off_locks: true,
            opening_s: Some(0.0),
            starting_s: 0.0,
            takes_timeout: true,
            shaft: DriveShaft::new(0.01, 0.01),
        }
    }

    /// Replaces the shaft.
    #[must_use]
    pub const fn with_shaft(self, shaft: DriveShaft) -> Self {
        Self { shaft, ..self }
    }

    /// Adds a holding brake, locked.
    #[must_use]
    pub const fn with_brake(self) -> Self {
        Self { has_brake: true, opening_s: None, ..self }
    }

    /// Makes "off" leave the holding brake as it is: the manual does not say whether "off" locks the brake.
    #[must_use]
    pub const fn keeping_brake(self) -> Self {
        Self { off_locks: false, ..self }
    }

    /// Makes the drive answer a time-out with zeros and ignore it.
    #[must_use]
    pub const fn refusing_timeouts(self) -> Self {
        Self { takes_timeout: false, ..self }
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

    /// Makes the drive report errors, one bit each. Errors that only a reset clears stay.
    pub const fn fail(&mut self, errors: u16) {
        self.errors |= errors;
    }

    /// Sets the errors whose cause persists, one bit each.
    pub const fn set_reasons(&mut self, errors: u16) {
        self.reasons = errors;
        self.errors = self.errors & LASTING | errors;
    }

    /// Interrupts the supply: the drive is silent while its program starts, and its angle is within a turn again.
    pub fn lose_supply(&mut self) {
        let (constant, reasons) = (self.torque_constant as f32, self.reasons);
        let turns = floor((self.shaft.angle_rad.to_degrees() - self.zero_deg) / 360.0);
        *self = Self {
            errors: reasons,
            reasons,
            temperature_c: self.temperature_c,
            zero_deg: self.zero_deg + 360.0 * turns,
            timeout_ms: self.timeout_ms,
            has_brake: self.has_brake,
            off_locks: self.off_locks,
            opening_s: (!self.has_brake).then_some(0.0),
            starting_s: STARTING_S,
            takes_timeout: self.takes_timeout,
            shaft: self.shaft,
            ..Self::new(self.id, constant)
        };
    }

    /// Returns whether the drive follows a command.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.command != Command::None && !self.is_expired && self.errors == 0
    }

    /// Returns whether the holding brake keeps the shaft.
    #[must_use]
    pub fn is_locked(&self) -> bool {
        self.opening_s.is_none_or(|left| left > 0.0)
    }

    /// Returns the errors, one bit each.
    #[must_use]
    pub const fn errors(&self) -> u16 {
        self.errors
    }

    /// Returns the time-out in ms, 0 for none.
    #[must_use]
    pub const fn timeout_ms(&self) -> u32 {
        self.timeout_ms
    }

    fn wanted_nm(&self) -> f64 {
        match self.command {
            Command::None => 0.0,
            Command::Torque(amperes) => amperes * self.torque_constant,
            Command::Velocity(velocity) => self.shaft.following_nm(velocity.to_radians()),
            Command::Position(angle, limit) => {
                let velocity = 5.0 * (angle - self.degrees());
                let limited = if limit > 0.0 { velocity.clamp(-limit, limit) } else { velocity };
                self.shaft.following_nm(limited.to_radians())
            }
        }
    }

    fn lock(&mut self) {
        if self.has_brake {
            self.opening_s = None;
        }
    }

    fn answer(&self, bits: u64) -> Option<CanFrame> {
        let id = StandardId::new(0x240 + u16::from(self.id))?;
        Some(CanFrame::of(Id::Standard(id), bits.to_le_bytes()))
    }

    /// Returns bytes 1 to 7 of a feedback frame.
    fn feedback(&self) -> u64 {
        let current = (self.shaft.torque_nm / self.torque_constant * 100.0) as i16;
        let velocity = self.shaft.velocity_rad_per_s.to_degrees() as i16;
        let degrees = floor(self.degrees()) as i64 as i16;
        u64::from(self.temperature_c as u8) << 8
            | u64::from(current as u16) << 16
            | u64::from(velocity as u16) << 32
            | u64::from(degrees as u16) << 48
    }

    fn degrees(&self) -> f64 {
        self.shaft.angle_rad.to_degrees() - self.zero_deg
    }
}

impl Drive for RmdDrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let own = StandardId::new(0x140 + u16::from(self.id))?;
        let is_for_it = [Some(own), StandardId::new(ALL)]
            .into_iter()
            .flatten()
            .any(|id| frame.id() == Id::Standard(id));
        let is_whole = frame.is_data_frame() && frame.length() == 8;
        if !is_for_it || !is_whole || self.starting_s > 0.0 {
            return None;
        }
        let bits = u64::from_le_bytes(*frame.bytes());
        self.silent_s = 0.0;
        if core::mem::take(&mut self.is_expired) {
            return self.answer(bits);
        }
        let (code, middle, high) = (bits & 0xFF, bits >> 16 & 0xFFFF, (bits >> 32) as i32);
        let hundredths = f64::from(high) / 100.0;
        let command = match code {
            TORQUE => Command::Torque(f64::from(high as i16) / 100.0),
            VELOCITY => Command::Velocity(hundredths),
            STOP => Command::Velocity(0.0),
            POSITION => Command::Position(hundredths, middle as f64),
            OFF => Command::None,
            _ => self.command,
        };
        // With an error, control commands are not run.
        self.command = if self.errors == 0 { command } else { Command::None };
        match code {
            RESET => {
                self.lose_supply();
                return None;
            }
            OFF if self.off_locks => self.lock(),
            LOCK => self.lock(),
            RELEASE | VELOCITY | POSITION => {
                self.opening_s = Some(self.opening_s.unwrap_or(OPENING_S));
            }
            TIMEOUT if self.takes_timeout => self.timeout_ms = high as u32,
            _ => {}
        }
        match code {
            // The release is confirmed once the brake is open.
            RELEASE if self.is_locked() => None,
            TIMEOUT if !self.takes_timeout => self.answer(code),
            RELEASE | LOCK | OFF | STOP | TIMEOUT => self.answer(bits),
            ANGLE => {
                self.answer(code | u64::from(floor(self.degrees() * 100.0) as i32 as u32) << 32)
            }
            STATE => {
                let brake = u64::from(self.opening_s.is_some()) << 24;
                let supply = 480 << 32 | u64::from(self.errors) << 48;
                self.answer(code | u64::from(self.temperature_c as u8) << 8 | brake | supply)
            }
            FEEDBACK | TORQUE | VELOCITY | POSITION => self.answer(code | self.feedback()),
            _ => None,
        }
    }

    fn step(&mut self, dt_s: f32) {
        let dt_s = f64::from(dt_s);
        self.starting_s -= dt_s;
        self.silent_s += dt_s;
        self.unreported_s += dt_s;
        let has_timeout = self.timeout_ms > 0 && self.starting_s <= 0.0;
        if has_timeout && !self.is_expired && self.silent_s * 1e3 > f64::from(self.timeout_ms) {
            (self.is_expired, self.unreported_s) = (true, 1.0);
            self.lock();
        }
        self.opening_s = self.opening_s.map(|left| left - dt_s);
        let torque_nm = if self.is_on() { self.wanted_nm() } else { 0.0 };
        self.shaft.step(torque_nm, dt_s);
        if self.is_locked() {
            self.shaft.angle_rad -= self.shaft.velocity_rad_per_s * dt_s;
            self.shaft.velocity_rad_per_s = 0.0;
        }
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        if !self.is_expired || self.unreported_s < 1.0 {
            return None;
        }
        self.unreported_s = 0.0;
        self.answer(EXPIRED)
    }
}

fn floor(value: f64) -> f64 {
    let whole = value as i64 as f64;
    if whole > value { whole - 1.0 } else { whole }
}
