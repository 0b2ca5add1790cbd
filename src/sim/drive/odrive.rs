//! A simulated ODrive axis with its shaft, written from the firmware 0.5.6 and the documentation of 0.6. Fields are extracted from the
//! frame as one 64-bit number, low byte first.

#![expect(clippy::cast_possible_truncation, reason = "fields of a frame, which saturate")]

use super::{Drive, DriveShaft, float, within};
use crate::frame::CanFrame;
use crate::math::sqrt;
use core::f64::consts::TAU;
use embedded_can::{Frame, Id, StandardId};

const IDLE: u8 = 1;
const CLOSED_LOOP: u8 = 8;
const TORQUE: u32 = 1;
const VELOCITY: u32 = 2;

/// An ODrive axis with its shaft, for tests: takes frames, answers remote ones, sends cyclic frames, and moves.
///
/// [`Simulation::advance_drives`](crate::sim::Simulation::advance_drives) puts the axis on a bus. A command has no answer. States, modes,
/// limits, errors and the watchdog are as in the firmware: if an axis in closed loop receives another request for closed loop, the axis drops
/// the torque and begins anew. The endpoints of 0.6 have the numbers 1 to 4: control mode, input mode, watchdog time-out, watchdog enabled.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::sim::{Drive, OdriveDrive};
///
/// let mut drive = OdriveDrive::new(1, false, 0.05, 1.0); // node 1, firmware 0.5, 0.05 Nm/A, no gear
/// let closed_loop = CanFrame::standard(0x027, [8, 0, 0, 0, 0, 0, 0, 0]).ok_or("an id")?;
/// drive.hear(&closed_loop);
/// assert_eq!(drive.state(), 8);
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct OdriveDrive {
    node: u8,
    is_0_6: bool,
    torque_constant: f64,
    /// Turns of the motor per turn of the shaft.
    gear: f64,
    state: u8,
    error: u32,
    disarm_reason: u32,
    procedure_result: u8,
    /// Procedure result that ends a request for closed loop; 0 for a calibrated axis.
    refusal: u8,
    control_mode: u32,
    input_mode: u32,
    /// Position in turns, velocity in turns/s, torque in Nm of the motor.
    input: [f64; 3],
    setpoint: [f64; 2],
    velocity_limit: f64,
    current_limit: f64,
    acceleration: f64,
    trajectory_velocity: f64,
    is_watched: bool,
    watchdog_s: f64,
    silence_s: f64,
    /// Time until the firmware runs.
    boot_s: f64,
    /// Periods of heartbeat and estimates, 0 for never, and the time since each was sent.
    periods_s: [f64; 2],
    since_s: [f64; 2],
    shaft: DriveShaft,
}

impl OdriveDrive {
    /// Makes an axis with a node id, the firmware 0.6 or 0.5, the torque constant of the motor in Nm/A and the gear ratio (turns of the
    /// motor per turn of the shaft). The axis is idle, in position mode as at delivery, with limits of 2 turns/s and 10 A, no watchdog, a
    /// heartbeat each 100 ms, estimates each 10 ms, and an inertia of 0.01 kg m² at the shaft.
    #[must_use]
    pub fn new(node: u8, is_0_6: bool, torque_constant: f32, gear: f32) -> Self {
        Self {
            node,
            is_0_6,
            torque_constant: torque_constant.into(),
            gear: gear.into(),
            state: IDLE,
            error: 0,
            disarm_reason: 0,
            procedure_result: 0,
            refusal: 0,
            control_mode: 3,
            input_mode: 1,
            input: [0.0; 3],
            setpoint: [0.0; 2],
            velocity_limit: 2.0,
            current_limit: 10.0,
            acceleration: 0.5,
            trajectory_velocity: 2.0,
            is_watched: false,
            watchdog_s: 0.0,
            silence_s: 0.0,
            boot_s: 0.0,
            periods_s: [0.1, 0.01],
            since_s: [0.0; 2],
            shaft: DriveShaft::new(0.01, 0.01),
        }
    }

    /// Sets the periods of heartbeat and estimates in s, 0 for never.
    #[must_use]
    pub fn with_periods(self, heartbeat_s: f32, estimates_s: f32) -> Self {
        Self { periods_s: [heartbeat_s.into(), estimates_s.into()], ..self }
    }

    /// Sets the watchdog time-out in s, as over USB.
    #[must_use]
    pub fn with_watchdog(self, time_s: f32) -> Self {
        Self { is_watched: true, watchdog_s: time_s.into(), ..self }
    }

    /// Replaces the shaft.
    #[must_use]
    pub const fn with_shaft(self, shaft: DriveShaft) -> Self {
        Self { shaft, ..self }
    }

    /// Makes the axis refuse closed loop with a procedure result, 14 for an uncalibrated axis. With 0, the axis follows the request.
    pub const fn refuse(&mut self, procedure_result: u8) {
        self.refusal = procedure_result;
    }

    /// Makes the axis report errors, one bit each, and disarm.
    pub const fn fail(&mut self, errors: u32) {
        self.error |= errors;
        self.disarm_reason = errors;
        self.state = IDLE;
    }

    /// Interrupts the supply: the axis is idle, with modes, limits and watchdog as at delivery. For 200 ms the axis neither receives nor
    /// sends.
    pub fn lose_supply(&mut self) {
        let new = Self::new(self.node, self.is_0_6, 1.0, 1.0);
        *self = Self {
            torque_constant: self.torque_constant,
            gear: self.gear,
            refusal: self.refusal,
            periods_s: self.periods_s,
            shaft: self.shaft,
            boot_s: 0.2,
            ..new
        };
    }

    /// Puts the axis into a state, as over USB.
    pub const fn set_state(&mut self, state: u8) {
        self.state = state;
    }

    /// Returns the state of the axis: 1 idle, 8 closed loop.
    #[must_use]
    pub const fn state(&self) -> u8 {
        self.state
    }

    /// Returns the errors of the axis, one bit each.
    #[must_use]
    pub const fn error(&self) -> u32 {
        self.error
    }

    /// Returns control mode and input mode.
    #[must_use]
    pub const fn modes(&self) -> (u32, u32) {
        (self.control_mode, self.input_mode)
    }

    /// Returns the limits of velocity, in turns/s, and current, in A.
    #[must_use]
    pub const fn limits(&self) -> (f32, f32) {
        (self.velocity_limit as f32, self.current_limit as f32)
    }

    /// Returns the watchdog time-out in s; `None` if the watchdog is off.
    #[must_use]
    pub fn watchdog_s(&self) -> Option<f32> {
        self.is_watched.then_some(self.watchdog_s as f32)
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

    /// Returns the torque of the shaft that the loops demand.
    fn wanted_nm(&mut self, dt_s: f64) -> f64 {
        let [position, velocity, torque] = self.input;
        let limit = self.velocity_limit.abs();
        let direct = torque * self.gear;
        if self.control_mode == TORQUE {
            return direct;
        }
        let wanted = if self.control_mode == VELOCITY {
            velocity
        } else {
            let (goal, feed) = self.followed(position, velocity, dt_s);
            feed + 20.0 * (goal - self.turns())
        };
        direct + self.shaft.following_nm(within(wanted, limit) * TAU / self.gear)
    }

    /// Moves the setpoint to a position by the input mode; returns position and velocity of the setpoint.
    fn followed(&mut self, position: f64, velocity: f64, dt_s: f64) -> (f64, f64) {
        let [at, speed] = self.setpoint;
        self.setpoint = match self.input_mode {
            3 => {
                // A critically damped filter with a bandwidth of 20 /s.
                let speed = speed + dt_s * (400.0 * (position - at) - 40.0 * speed);
                [at + dt_s * speed, speed]
            }
            5 => {
                let way = position - at;
                let fastest = f64::from(sqrt((2.0 * self.acceleration * way.abs()) as f32));
                let wanted = fastest.min(self.trajectory_velocity).copysign(way);
                let change = self.acceleration * dt_s;
                let speed = speed + within(wanted - speed, change);
                [at + dt_s * speed, speed]
            }
            _ => [position, velocity],
        };
        let [at, speed] = self.setpoint;
        (at, speed)
    }

    /// Returns the position of the motor in turns.
    fn turns(&self) -> f64 {
        self.shaft.angle_rad * self.gear / TAU
    }

    fn request(&mut self, state: u32) {
        match state {
            8 if self.refusal > 0 || self.error > 0 => {
                self.state = IDLE;
                self.procedure_result = self.refusal.max(3);
                if !self.is_0_6 {
                    self.error |= 1;
                }
            }
            8 => {
                (self.state, self.procedure_result) = (CLOSED_LOOP, 1);
                self.setpoint = [self.turns(), 0.0];
                if self.control_mode == 3 {
                    self.input[0] = self.turns();
                }
            }
            1 => (self.state, self.procedure_result) = (IDLE, 0),
            other => self.state = other as u8,
        }
    }

    fn message(&self, number: u16) -> Option<CanFrame> {
        let bits = match number {
            0x01 if self.is_0_6 => {
                u64::from(self.error)
                    | u64::from(self.state) << 32
                    | u64::from(self.procedure_result) << 40
            }
            0x01 => u64::from(self.error) | u64::from(self.state) << 32 | 1 << 63,
            0x03 if self.is_0_6 => u64::from(self.error) | u64::from(self.disarm_reason) << 32,
            0x09 => {
                let velocity = self.shaft.velocity_rad_per_s * self.gear / TAU;
                word(self.turns()) | word(velocity) << 32
            }
            _ => return None,
        };
        Some(self.frame(number, bits.to_le_bytes()))
    }

    fn hear_endpoint(&mut self, bits: u64) -> Option<CanFrame> {
        let (verb, number, word) = (bits as u8, (bits >> 8) as u16, (bits >> 32) as u32);
        match (verb, number) {
            (1, 1) => self.control_mode = word & 0xFF,
            (1, 2) => self.input_mode = word & 0xFF,
            (1, 3) => self.watchdog_s = f32::from_bits(word).into(),
            (1, 4) => self.is_watched = word & 0xFF != 0,
            _ => {}
        }
        let value = match number {
            1 => self.control_mode,
            2 => self.input_mode,
            3 => (self.watchdog_s as f32).to_bits(),
            4 => u32::from(self.is_watched),
            _ => return None,
        };
        let bits = u64::from(number) << 8 | u64::from(value) << 32;
        (verb == 0).then(|| self.frame(0x05, bits.to_le_bytes()))
    }

    fn frame(&self, number: u16, data: [u8; 8]) -> CanFrame {
        let id = StandardId::new(u16::from(self.node) << 5 | number).unwrap_or(StandardId::ZERO);
        CanFrame::of(Id::Standard(id), data)
    }
}

impl Drive for OdriveDrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let Id::Standard(id) = frame.id() else { return None };
        let (node, number) = (id.as_raw() >> 5, id.as_raw() & 0x1F);
        if node != u16::from(self.node) || self.boot_s > 0.0 {
            return None;
        }
        self.silence_s = 0.0;
        if frame.is_remote_frame() {
            return self.message(number);
        }
        let bits = u64::from_le_bytes(*frame.bytes());
        let (low, high) = (bits as u32, (bits >> 32) as u32);
        let milli = |shift: u32| f64::from(((bits >> shift) as u16).cast_signed()) / 1_000.0;
        match number {
            0x02 => self.fail(if self.is_0_6 { 0x0200_0000 } else { 0x4000 }),
            0x04 if self.is_0_6 => return self.hear_endpoint(bits),
            0x07 => self.request(low),
            0x0B => (self.control_mode, self.input_mode) = (low, high),
            0x0C => self.input = [float(low), milli(32), milli(48)],
            0x0D => self.input = [self.input[0], float(low), float(high)],
            0x0E => self.input[2] = float(low),
            0x0F => (self.velocity_limit, self.current_limit) = (float(low), float(high)),
            0x11 => self.trajectory_velocity = float(low),
            0x12 => self.acceleration = float(low),
            0x18 => (self.error, self.disarm_reason, self.procedure_result) = (0, 0, 0),
            _ => {}
        }
        None
    }

    fn step(&mut self, dt_s: f32) {
        let dt_s = f64::from(dt_s);
        self.silence_s += dt_s;
        self.boot_s = (self.boot_s - dt_s).max(0.0);
        for since in &mut self.since_s {
            *since += dt_s;
        }
        if self.is_watched && self.silence_s > self.watchdog_s {
            self.fail(if self.is_0_6 { 0x0100_0000 } else { 0x0800 });
        }
        let most = self.current_limit * self.torque_constant * self.gear.abs();
        let wanted = if self.state == CLOSED_LOOP { self.wanted_nm(dt_s) } else { 0.0 };
        self.shaft.step(within(wanted, most), dt_s);
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        if self.boot_s > 0.0 {
            return None;
        }
        let messages = [0x01, 0x09];
        for ((since, period), number) in self.since_s.iter_mut().zip(self.periods_s).zip(messages) {
            if period > 0.0 && *since >= period - 1e-9 {
                *since = 0.0;
                return self.message(number);
            }
        }
        None
    }
}

fn word(value: f64) -> u64 {
    u64::from((value as f32).to_bits())
}
