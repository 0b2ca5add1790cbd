//! A simulated Damiao drive with its shaft, written from the manual. Fields are extracted from the frame as one 64-bit number.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "fields of a frame and of its registers, which saturate"
)]

use super::{Drive, DriveShaft, float, within, wrapped};
use crate::damiao::Model;
use crate::frame::CanFrame;
use core::f64::consts::PI;
use embedded_can::{Frame, Id, StandardId};

const ENABLE: u64 = 0xFFFF_FFFF_FFFF_FFFC;
const DISABLE: u64 = 0xFFFF_FFFF_FFFF_FFFD;
const SET_ZERO: u64 = 0xFFFF_FFFF_FFFF_FFFE;
const CLEAR_ERROR: u64 = 0xFFFF_FFFF_FFFF_FFFB;

/// Error of a drive that receives no commands.
const COMMUNICATION_LOST: u8 = 0xD;

/// Register numbers of the drive, in the order of their places.
const REGISTERS: [u8; 7] = [7, 8, 9, 10, 21, 22, 23];
const TIMEOUT: usize = 2;
const MODE: usize = 3;
const PMAX: usize = 4;
const VMAX: usize = 5;
const TMAX: usize = 6;

/// A Damiao drive with its shaft, for tests: takes frames, answers them, and moves.
///
/// [`Simulation::advance_drives`](crate::sim::Simulation::advance_drives) puts the drive on a bus. Enabling, errors, the four control
/// modes, registers and the time-out are as in the manual. A frame to the id of another control mode is discarded without an answer. The
/// shaft is an inertia with viscous friction; the drive's loop of the velocity is proportional alone, and gives way to a load.
///
/// # Examples
/// ```
/// use drivetrain::damiao::Model;
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::{DamiaoDrive, Drive};
///
/// let mut drive = DamiaoDrive::of(Model::J4310, 1);
/// let enable = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
/// let answer = CanFrame::standard(1, enable).and_then(|frame| drive.hear(&frame)).ok_or("no answer")?;
/// assert_eq!((answer.header(), answer.bytes()[0]), (0x11, 0x11)); // enabled, id 1
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct DamiaoDrive {
    id: u8,
    values: [f64; REGISTERS.len()],
    stored: [f64; REGISTERS.len()],
    is_enabled: bool,
    error: u8,
    /// Time since the last frame to this drive.
    silence_s: f64,
    command: Command,
    shaft: DriveShaft,
}

#[derive(Debug, Clone, Copy)]
enum Command {
    None,
    Mit {
        position: f64,
        velocity: f64,
        kp: f64,
        kd: f64,
        torque: f64,
    },
    /// Position, velocity limit, torque limit.
    Position(f64, f64, f64),
    Velocity(f64),
}

impl DamiaoDrive {
    /// Makes a drive of a model with a command id, 1 to 15. The feedback id is the command id plus 16, and the registers PMAX, VMAX and TMAX
    /// have the values of the model; [`with_register`](Self::with_register) sets others. The drive is in MIT mode, without a time-out, with
    /// an inertia of 0.01 kg m².
    #[must_use]
    pub fn of(model: Model, id: u8) -> Self {
        let [pmax, vmax, tmax] = [model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm()];
        let master_id = 16.0 + f64::from(id);
        let values = [master_id, id.into(), 0.0, 1.0, pmax.into(), vmax.into(), tmax.into()];
        Self {
            id,
            values,
            stored: values,
            is_enabled: false,
            error: 0,
            silence_s: 0.0,
            command: Command::None,
            shaft: DriveShaft::new(0.01, 0.01),
        }
    }

    /// Sets and stores a register: the value survives a loss of the supply. An unknown register is ignored.
    #[must_use]
    pub fn with_register(mut self, number: u8, value: f32) -> Self {
        self.write(number, value.into());
        self.stored = self.values;
        self
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

    /// Makes the drive report an error, 8 to 14, and disable itself.
    pub fn fail(&mut self, error: u8) {
        self.error = error & 0xF;
        self.is_enabled = false;
    }

    /// Interrupts the supply: the drive is disabled, and its turns and values written but not stored are lost: the angle is within half a turn.
    pub fn lose_supply(&mut self) {
        self.values = self.stored;
        self.shaft.angle_rad = wrapped(self.shaft.angle_rad, PI);
        (self.is_enabled, self.error, self.command) = (false, 0, Command::None);
    }

    /// Returns whether the drive follows commands.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.is_enabled
    }

    /// Returns the reported error, 8 to 14; 0 for none.
    #[must_use]
    pub const fn error(&self) -> u8 {
        self.error
    }

    fn wanted_nm(&self) -> f64 {
        let shaft = &self.shaft;
        match self.command {
            Command::None => 0.0,
            Command::Mit { position, velocity, kp, kd, torque } => {
                kp * (position - shaft.angle_rad)
                    + kd * (velocity - shaft.velocity_rad_per_s)
                    + torque
            }
            Command::Position(position, most, limit) => {
                let velocity = within(5.0 * (position - shaft.angle_rad), most);
                within(shaft.following_nm(velocity), limit)
            }
            Command::Velocity(velocity) => shaft.following_nm(velocity),
        }
    }

    fn switch(&mut self, bits: u64) {
        match bits {
            ENABLE => self.is_enabled = self.error == 0,
            DISABLE => self.is_enabled = false,
            CLEAR_ERROR => self.error = 0,
            _ => self.shaft.angle_rad = 0.0,
        }
    }

    fn read(&self, mode: u16, data: &[u8; 8]) -> Command {
        let [a, b, c, d, e, f, g, h] = *data;
        let (first, second) =
            (float(u32::from_le_bytes([a, b, c, d])), float(u32::from_le_bytes([e, f, g, h])));
        match mode {
            1 => Command::Position(first, second.abs(), f64::MAX),
            2 => Command::Velocity(first),
            3 => {
                let (velocity, share) = (u16::from_le_bytes([e, f]), u16::from_le_bytes([g, h]));
                let limit = f64::from(share) / 10_000.0 * self.value(TMAX);
                Command::Position(first, f64::from(velocity) / 100.0, limit)
            }
            _ => {
                let bits = u64::from_be_bytes(*data);
                let field = |lowest: u32, width: u32, least: f64, most: f64| {
                    let top = (1_u64 << width) - 1;
                    (bits >> lowest & top) as f64 * (most - least) / top as f64 + least
                };
                let (pmax, vmax, tmax) = (self.value(PMAX), self.value(VMAX), self.value(TMAX));
                Command::Mit {
                    position: field(48, 16, -pmax, pmax),
                    velocity: field(36, 12, -vmax, vmax),
                    kp: field(24, 12, 0.0, 500.0),
                    kd: field(12, 12, 0.0, 5.0),
                    torque: field(0, 12, -tmax, tmax),
                }
            }
        }
    }

    fn feedback(&self) -> CanFrame {
        let field = |value: f64, most: f64, width: u32| {
            let top = ((1_u64 << width) - 1) as f64;
            ((within(value, most) + most) * top / (2.0 * most)) as u64
        };
        let status = if self.error > 0 { self.error } else { u8::from(self.is_enabled) };
        let bits = u64::from(status << 4 | self.id & 0xF) << 56
            | field(self.shaft.angle_rad, self.value(PMAX), 16) << 40
            | field(self.shaft.velocity_rad_per_s, self.value(VMAX), 12) << 28
            | field(self.shaft.torque_nm, self.value(TMAX), 12) << 16
            | 35 << 8
            | 30;
        self.answer(bits.to_be_bytes())
    }

    fn answer(&self, data: [u8; 8]) -> CanFrame {
        let master_id = StandardId::new(self.value(0) as u16).unwrap_or(StandardId::ZERO);
        CanFrame::of(Id::Standard(master_id), data)
    }

    fn hear_inquiry(&mut self, data: &[u8; 8]) -> Option<CanFrame> {
        let [low, high, verb, number, a, b, c, d] = *data;
        if (low, high) != (self.id, 0) {
            return None;
        }
        let is_float = number >= 21;
        match verb {
            0x33 => {}
            0x55 if is_float => self.write(number, f32::from_le_bytes([a, b, c, d]).into()),
            0x55 => self.write(number, u32::from_le_bytes([a, b, c, d]).into()),
            0xAA if !self.is_enabled => self.stored = self.values,
            0xCC => return Some(self.feedback()),
            _ => return None,
        }
        let value = REGISTERS.iter().position(|register| *register == number);
        let value = value.map(|place| self.value(place));
        let [a, b, c, d] = match value {
            Some(value) if is_float => single(value).to_le_bytes(),
            Some(value) => (value as u32).to_le_bytes(),
            None if verb == 0xAA => [0; 4],
            None => return None,
        };
        Some(self.answer([self.id, 0, verb, number, a, b, c, d]))
    }

    fn value(&self, place: usize) -> f64 {
        self.values.get(place).copied().unwrap_or_default()
    }

    fn write(&mut self, number: u8, value: f64) {
        for (register, place) in REGISTERS.iter().zip(&mut self.values) {
            if *register == number {
                *place = value;
            }
        }
    }
}

impl Drive for DamiaoDrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let id = standard(frame)?;
        if id == 0x7FF {
            return self.hear_inquiry(frame.bytes());
        }
        let mode = (self.value(MODE) as u16).saturating_sub(1);
        let own = u16::from(self.id);
        let bits = u64::from_be_bytes(*frame.bytes());
        let is_for_mode = id == own + (mode << 8);
        match bits {
            ENABLE | DISABLE | SET_ZERO | CLEAR_ERROR if is_for_mode || id == own => {
                self.switch(bits);
            }
            _ if is_for_mode => self.command = self.read(mode, frame.bytes()),
            _ => return None,
        }
        self.silence_s = 0.0;
        Some(self.feedback())
    }

    fn step(&mut self, dt_s: f32) {
        let dt_s = f64::from(dt_s);
        self.silence_s += dt_s;
        let timeout_s = self.value(TIMEOUT) * 50e-6;
        if self.is_enabled && timeout_s > 0.0 && self.silence_s > timeout_s {
            self.fail(COMMUNICATION_LOST);
        }
        let most = self.value(TMAX);
        let wanted = if self.is_enabled { self.wanted_nm() } else { 0.0 };
        self.shaft.step(within(wanted, most), dt_s);
    }
}

fn standard(frame: &CanFrame) -> Option<u16> {
    match frame.id() {
        Id::Standard(id) if frame.is_data_frame() && frame.length() == 8 => Some(id.as_raw()),
        _ => None,
    }
}

fn single(value: f64) -> f32 {
    value as f32
}
