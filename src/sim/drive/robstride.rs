//! A simulated RobStride drive, or a CyberGear, with its shaft, written from the manual. Fields are extracted from the frame as numbers.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "fields of a frame and parameters, which saturate"
)]

use super::{Drive, DriveShaft, float, within, wrapped};
use crate::frame::CanFrame;
use crate::robstride::Model;
use core::f64::consts::PI;
use embedded_can::{ExtendedId, Frame, Id};

/// Parameter indices of the drive, in the order of their places.
const PARAMETERS: [u16; 8] = [0x7005, 0x7006, 0x700A, 0x700B, 0x7016, 0x7017, 0x7018, 0x7028];
const RUN_MODE: usize = 0;
const IQ_REF: usize = 1;
const SPD_REF: usize = 2;
const LIMIT_TORQUE: usize = 3;
const LOC_REF: usize = 4;
const LIMIT_SPD: usize = 5;
const LIMIT_CUR: usize = 6;
const TIMEOUT: usize = 7;

/// Measured parameters.
const MECH_POS: u16 = 0x7019;
const MECH_VEL: u16 = 0x701B;
const VBUS: u16 = 0x701C;

/// A RobStride drive with its shaft, for tests: takes frames, answers them, and moves.
///
/// [`Simulation::advance_drives`](crate::sim::Simulation::advance_drives) puts the drive on a bus. Run modes 0 to 3 and 5, parameters,
/// faults and the time-out are as in the manual. The torque constant is 1 Nm/A. When enabled, the drive follows the targets already set. The
/// reported position starts again at the other end of its range; a CyberGear clamps the position at the end. An operation frame names no
/// host, so the drive answers to the host of the last frame with one.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::robstride::Model;
/// use drivetrain::sim::{Drive, RobStrideDrive};
/// use embedded_can::ExtendedId;
///
/// let mut drive = RobStrideDrive::of(Model::RS02, 1);
/// let enable = CanFrame::of(ExtendedId::new(0x0300_FD01).ok_or("29 bits")?, [0; 8]);
/// let answer = drive.hear(&enable).ok_or("no answer")?;
/// assert_eq!(format!("{answer:?}"), "028001FD [8] 7F FF 7F FF 7F FF 00 FA"); // it runs, at 25.0 °C
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct RobStrideDrive {
    id: u8,
    host: u8,
    ranges: [f64; 5],
    is_cybergear: bool,
    values: [f64; PARAMETERS.len()],
    stored: [f64; PARAMETERS.len()],
    is_enabled: bool,
    is_calibrating: bool,
    faults: u32,
    /// Bit rate set by a frame; 1 for the rate of the bus.
    bit_rate: u8,
    /// Time since the last frame to this drive.
    silence_s: f64,
    /// Position, velocity, kp, kd and torque.
    operation: [f64; 5],
    shaft: DriveShaft,
}

impl RobStrideDrive {
    /// Makes a drive of a model with an id. The drive is in operation mode, without a time-out, with an inertia of 0.01 kg m². A CyberGear
    /// has position mode 1, no parameter for a time-out, and no frame that stores parameters.
    #[must_use]
    pub fn of(model: Model, id: u8) -> Self {
        let [kp, kd] = [model.most().stiffness, model.most().damping];
        let ranges = [model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm(), kp, kd];
        let ranges = ranges.map(f64::from);
        let [_, velocity, torque, ..] = ranges;
        let values = [0.0, 0.0, 0.0, torque, 0.0, velocity, torque, 0.0];
        Self {
            id,
            host: 0,
            ranges,
            is_cybergear: !model.has_timeout(),
            values,
            stored: values,
            is_enabled: false,
            is_calibrating: false,
            faults: 0,
            bit_rate: 1,
            silence_s: 0.0,
            operation: [0.0; 5],
            shaft: DriveShaft::new(0.01, 0.01),
        }
    }

    /// Sets and stores a parameter: the value survives a loss of the supply. An unknown parameter is ignored.
    #[must_use]
    pub fn with_parameter(mut self, index: u16, value: f32) -> Self {
        self.write(index, value.into());
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

    /// Returns the value of a parameter; `None` for an unknown one.
    #[must_use]
    pub fn parameter(&self, index: u16) -> Option<f32> {
        self.value_of(index).map(single)
    }

    /// Makes the drive report faults, as the bits of its report, and disable itself.
    pub const fn fail(&mut self, faults: u32) {
        self.faults = faults;
        self.is_enabled = false;
    }

    /// Starts or ends a calibration.
    pub const fn calibrate(&mut self, is_calibrating: bool) {
        self.is_calibrating = is_calibrating;
    }

    /// Returns the fault report of the drive.
    #[must_use]
    pub fn report(&self) -> CanFrame {
        self.answer(21, 0, u64::from(self.faults).to_le_bytes())
    }

    /// Interrupts the supply: the drive is disabled and in operation mode, and values written but not stored are lost. The angle is within half a
    /// turn then, as with `zero_sta` 1; that of a CyberGear is 0.
    pub fn lose_supply(&mut self) {
        self.values = self.stored;
        self.write(0x7005, 0.0);
        self.shaft.angle_rad =
            if self.is_cybergear { 0.0 } else { wrapped(self.shaft.angle_rad, PI) };
        (self.is_enabled, self.faults, self.operation) = (false, 0, [0.0; 5]);
    }

    /// Returns whether the drive follows commands.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.is_enabled
    }

    /// Returns the faults, as the bits of the report; 0 for none.
    #[must_use]
    pub const fn faults(&self) -> u32 {
        self.faults
    }

    /// Returns the number of the bit rate, 1 for 1 Mbit/s. A real drive with another rate than its bus is unreachable.
    #[must_use]
    pub const fn bit_rate(&self) -> u8 {
        self.bit_rate
    }

    fn wanted_nm(&self) -> f64 {
        let [_, _, most, ..] = self.ranges;
        let shaft = &self.shaft;
        let current = self.value(LIMIT_CUR).max(0.0).min(most);
        let torque = match self.value(RUN_MODE) as u8 {
            0 => {
                let [position, velocity, kp, kd, torque] = self.operation;
                kp * (position - shaft.angle_rad)
                    + kd * (velocity - shaft.velocity_rad_per_s)
                    + torque
            }
            2 => within(shaft.following_nm(self.value(SPD_REF)), current),
            3 => self.value(IQ_REF),
            _ => {
                let limit = self.value(LIMIT_SPD).abs();
                let velocity = within(5.0 * (self.value(LOC_REF) - shaft.angle_rad), limit);
                within(shaft.following_nm(velocity), current)
            }
        };
        let limit = self.value(LIMIT_TORQUE).max(0.0).min(most);
        within(torque, limit)
    }

    /// Returns the fields of an operation frame, whose torque is in the id.
    fn fields(&self, torque: u32, data: u64) -> [f64; 5] {
        let [pmax, vmax, tmax, kp, kd] = self.ranges;
        let share = |lowest: u32| (data >> lowest & 0xFFFF) as f64 / 65_535.0;
        [
            (2.0 * share(48) - 1.0) * pmax,
            (2.0 * share(32) - 1.0) * vmax,
            share(16) * kp,
            share(0) * kd,
            (2.0 * f64::from(torque) / 65_535.0 - 1.0) * tmax,
        ]
    }

    /// Returns mode and faults, as in bits 16 to 23 of the id.
    fn state(&self) -> u32 {
        let mode = if self.is_calibrating { 1 } else { u32::from(self.is_enabled) << 1 };
        let bit = |bits: u32, place: u32| u32::from(self.faults & bits != 0) << place;
        let faults =
            bit(1 << 2, 0) | bit(0x1_0030, 1) | bit(1, 2) | bit(1 << 14, 4) | bit(1 << 7, 5);
        mode << 6 | faults
    }

    fn feedback(&self) -> CanFrame {
        let [pmax, vmax, tmax, ..] = self.ranges;
        let field =
            |value: f64, most: f64| ((within(value, most) + most) * 65_535.0 / (2.0 * most)) as u64;
        let angle = self.shaft.angle_rad;
        let is_beyond = angle.abs() > pmax && !self.is_cybergear;
        let angle = if is_beyond { wrapped(angle, pmax) } else { angle };
        let bits = field(angle, pmax) << 48
            | field(self.shaft.velocity_rad_per_s, vmax) << 32
            | field(self.shaft.torque_nm, tmax) << 16
            | 250;
        self.answer(2, self.state(), bits.to_be_bytes())
    }

    fn answer(&self, kind: u32, state: u32, data: [u8; 8]) -> CanFrame {
        extended(kind << 24 | state << 16 | u32::from(self.id) << 8 | u32::from(self.host), data)
    }

    /// Returns the answer to an inquiry for ids: the id, and the identifier of the processor.
    fn broadcast(&self) -> CanFrame {
        extended(u32::from(self.id) << 8 | 0xFE, [self.id, 1, 2, 3, 4, 5, 6, 7])
    }

    fn read(&self, index: u16, [low, high, ..]: [u8; 8]) -> CanFrame {
        let Some(value) = self.value_of(index) else {
            return self.answer(17, 1, [low, high, 0, 0, 0, 0, 0, 0]);
        };
        let bits = match index {
            0x7005 | 0x7028 => value as u32,
            _ => single(value).to_bits(),
        };
        let [a, b, c, d] = bits.to_le_bytes();
        self.answer(17, 0, [low, high, 0, 0, a, b, c, d])
    }

    fn set(&mut self, index: u16, swapped: u32) {
        let bits = swapped.swap_bytes();
        match index {
            // The mode of a running drive stays.
            0x7005 if self.is_enabled => {}
            0x7005 => {
                let mode = bits & 0xFF;
                let is_known = mode <= 3 || mode == 5 && !self.is_cybergear;
                if is_known {
                    self.write(index, mode.into());
                }
            }
            0x7028 => self.write(index, bits.into()),
            _ => self.write(index, float(bits)),
        }
    }

    fn value_of(&self, index: u16) -> Option<f64> {
        match index {
            MECH_POS => Some(self.shaft.angle_rad),
            MECH_VEL => Some(self.shaft.velocity_rad_per_s),
            VBUS => Some(48.0),
            0x7028 if self.is_cybergear => None,
            _ => {
                let place = PARAMETERS.iter().position(|parameter| *parameter == index)?;
                Some(self.value(place))
            }
        }
    }

    fn value(&self, place: usize) -> f64 {
        self.values.get(place).copied().unwrap_or_default()
    }

    fn write(&mut self, index: u16, value: f64) {
        let is_there = index != 0x7028 || !self.is_cybergear;
        for (parameter, place) in PARAMETERS.iter().zip(&mut self.values) {
            if *parameter == index && is_there {
                *place = value;
            }
        }
    }
}

impl Drive for RobStrideDrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let Id::Extended(id) = frame.id() else { return None };
        let id = id.as_raw();
        if !frame.is_data_frame() || frame.length() != 8 || id & 0xFF != u32::from(self.id) {
            return None;
        }
        let (kind, middle) = (id >> 24, id >> 8 & 0xFFFF);
        let data = u64::from_be_bytes(*frame.bytes());
        let index = (*frame.bytes()).first_chunk().map_or(0, |index| u16::from_le_bytes(*index));
        if kind != 1 {
            self.host = middle as u8;
        }
        self.silence_s = 0.0;
        match kind {
            0 => return Some(self.broadcast()),
            1 => self.operation = self.fields(middle, data),
            3 => self.is_enabled = self.faults == 0 && !self.is_calibrating,
            4 => {
                self.is_enabled = false;
                self.is_calibrating = false;
                if data >> 56 == 1 {
                    self.faults = 0;
                } else if data >> 48 == 0x00C4 {
                    return Some(self.answer(2, self.state(), [0, 0xC4, 0x56, 0, 0, 3, 6, 0]));
                }
            }
            6 if data >> 56 == 1 => {
                self.shaft.angle_rad = 0.0;
            }
            7 => {
                self.id = (middle >> 8) as u8;
                return Some(self.broadcast());
            }
            17 => return Some(self.read(index, *frame.bytes())),
            18 => self.set(index, data as u32),
            22 if self.is_cybergear => self.bit_rate = (data >> 56) as u8,
            22 if data == 0x0102_0304_0506_0708 => self.stored = self.values,
            _ => return None,
        }
        Some(self.feedback())
    }

    fn step(&mut self, dt_s: f32) {
        let dt_s = f64::from(dt_s);
        self.silence_s += dt_s;
        let timeout_s = self.value(TIMEOUT) * 50e-6;
        if timeout_s > 0.0 && self.silence_s > timeout_s {
            self.is_enabled = false;
        }
        let wanted = if self.is_enabled { self.wanted_nm() } else { 0.0 };
        self.shaft.step(wanted, dt_s);
    }
}

fn extended(raw: u32, data: [u8; 8]) -> CanFrame {
    CanFrame::of(ExtendedId::new(raw).unwrap_or(ExtendedId::MAX), data)
}

fn single(value: f64) -> f32 {
    value as f32
}
