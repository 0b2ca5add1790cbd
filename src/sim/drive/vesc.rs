//! A simulated VESC with its shaft, written from the firmware `bldc`. Ids and values are extracted from the frame as numbers.

#![expect(
    clippy::cast_possible_truncation,
    reason = "fields of a frame, which saturate, and a tachometer, which wraps"
)]

use super::{Drive, DriveShaft, within};
use crate::frame::CanFrame;
use crate::vesc::Model;
use core::f64::consts::TAU;
use embedded_can::{ExtendedId, Frame, Id};

/// Time after a fault in which commands are ignored.
const FAULT_STOP_S: f64 = 0.5;

/// Currents below count as 0, in A.
const LEAST_CURRENT: f64 = 0.05;

/// Speeds below count as 0, in electrical rpm.
const LEAST_SPEED: f64 = 900.0;

/// Packets of the status frames that a drive sends by itself, the last one first: status 1, 4 and 5.
const STATUSES: [u8; 3] = [9, 16, 27];

/// A VESC with its shaft, for tests: takes frames, answers requests for its fault code, and moves.
///
/// [`Simulation::advance_drives`](crate::sim::Simulation::advance_drives) puts the drive on a bus. The drive sends status frames by itself
/// once [`with_status_hz`](Self::with_status_hz) sets a rate. If commands stop, the drive brakes with its time-out current. After a fault,
/// commands are ignored for half a second. The shaft is an inertia with viscous friction.
///
/// # Examples
/// ```
/// use drivetrain::encoder::GearRatio;
/// use drivetrain::sim::{Drive, VescDrive};
/// use drivetrain::units::AngularVelocity;
/// use drivetrain::vesc::Model;
///
/// let model = Model {
///     name: "wheel",
///     pole_pairs: 7,
///     gear: GearRatio::DIRECT,
///     torque_constant_nm_per_a: 0.05,
///     current_limit_a: 40.0,
///     max_velocity: AngularVelocity::from_rad_per_s(600.0),
/// };
/// let mut drive = VescDrive::of(model, 23).with_status_hz(500.0);
/// assert_eq!(drive.next_frame(), None);
/// drive.step(0.002);
/// let packets = core::iter::from_fn(|| drive.next_frame()).map(|status| status.header() >> 8 & 0xFF);
/// assert_eq!(packets.collect::<Vec<_>>(), [27, 16, 9]); // status 5, 4 and 1
/// ```
#[derive(Debug, Clone, Copy)]
pub struct VescDrive {
    id: u8,
    model: Model,
    /// The drive's own limit.
    current_max_a: f64,
    command: Command,
    fault: u8,
    /// Rest of the time in which commands are ignored.
    ignores_s: f64,
    /// Time since the last command.
    silence_s: f64,
    timeout_s: f64,
    timeout_brake_a: f64,
    /// Period of the status frames, 0 for never, and the time since the last ones.
    status_s: f64,
    since_status_s: f64,
    /// Status frames of this period that are not sent yet.
    unsent: usize,
    celsius: [f64; 2],
    /// Angle of the shaft when the tachometer had this count.
    zero: (f64, i32),
    /// Angle held by the handbrake.
    held_rad: f64,
    shaft: DriveShaft,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Command {
    Duty(f64),
    Current(f64),
    Brake(f64),
    Speed(f64),
    Position(f64),
    Handbrake(f64),
}

impl VescDrive {
    /// Makes a drive at rest at 0, with the model's current limit as its own limit, a time-out of 1 s, a time-out brake current of 0, no status frames, as at delivery, and an inertia of
    /// 0.01 kg m².
    #[must_use]
    pub fn of(model: Model, id: u8) -> Self {
        Self {
            id,
            model,
            current_max_a: model.current_limit_a.into(),
            command: Command::Current(0.0),
            fault: 0,
            ignores_s: 0.0,
            silence_s: 0.0,
            timeout_s: 1.0,
            timeout_brake_a: 0.0,
            status_s: 0.0,
            since_status_s: 0.0,
            unsent: 0,
            celsius: [30.0, 25.0],
            zero: (0.0, 0),
            held_rad: 0.0,
            shaft: DriveShaft::new(0.01, 0.001),
        }
    }

    /// Sets the drive's own current limit in A.
    #[must_use]
    pub fn with_current_max(self, current_a: f32) -> Self {
        Self { current_max_a: current_a.into(), ..self }
    }

    /// Sets the time-out in s, 0 for never, and its brake current in A.
    #[must_use]
    pub fn with_timeout(self, timeout_s: f32, brake_a: f32) -> Self {
        Self { timeout_s: timeout_s.into(), timeout_brake_a: brake_a.into(), ..self }
    }

    /// Sets the rate of status 5, 4 and 1, in this order: packets 27, 16 and 9. Any rate but a positive finite one sends none.
    #[must_use]
    pub fn with_status_hz(self, hz: f32) -> Self {
        let status_s = if hz > 0.0 { 1.0 / f64::from(hz) } else { 0.0 };
        Self { status_s, ..self }
    }

    /// Replaces the shaft.
    #[must_use]
    pub const fn with_shaft(self, shaft: DriveShaft) -> Self {
        Self { shaft, ..self }
    }

    /// Sets the count of the tachometer at the present angle of the shaft.
    pub fn set_tachometer(&mut self, count: i32) {
        self.zero = (self.shaft.angle_rad, count);
    }

    /// Sets the temperatures of driver and motor, in °C.
    pub fn set_temperatures(&mut self, driver_c: f32, motor_c: f32) {
        self.celsius = [driver_c.into(), motor_c.into()];
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

    /// Stops the drive with a fault: the shaft is free, and commands are ignored for half a second.
    pub fn fail(&mut self, fault: u8) {
        self.fault = fault;
        self.ignores_s = FAULT_STOP_S;
        self.command = Command::Current(0.0);
    }

    /// Interrupts the supply: the last command is lost, and the tachometer begins at 0.
    pub fn lose_supply(&mut self) {
        self.zero = (self.shaft.angle_rad, 0);
        (self.fault, self.ignores_s, self.silence_s) = (0, 0.0, 0.0);
        (self.since_status_s, self.unsent) = (0.0, 0);
        self.command = Command::Current(0.0);
    }

    /// Returns the fault code, 0 for none.
    #[must_use]
    pub const fn fault(&self) -> u8 {
        self.fault
    }

    fn follow(&mut self, command: Command) {
        if !matches!(self.command, Command::Handbrake(_)) {
            self.held_rad = self.shaft.angle_rad;
        }
        self.command = command;
    }

    /// Returns a status frame by its packet: 9, 14, 15, 16, 27 or 58; `None` for any other.
    #[must_use]
    pub fn report(&self, packet: u8) -> Option<CanFrame> {
        let electrical = self.gear() * f64::from(self.model.pole_pairs);
        let word = |value: f64| u64::from((value as i16).cast_unsigned());
        let wide = |value: f64| u64::from((value as i32).cast_unsigned());
        let bits = match packet {
            9 => {
                let erpm = self.shaft.velocity_rad_per_s * electrical * 60.0 / TAU;
                let current = self.shaft.torque_nm / self.nm_per_a();
                let duty = self.shaft.velocity_rad_per_s / self.no_load_rad_per_s();
                wide(erpm) << 32 | word(current * 10.0) << 16 | word(duty * 1e3)
            }
            14 | 15 => 0,
            16 => {
                let [driver, motor] = self.celsius;
                let degrees = within_turn(self.shaft.angle_rad).to_degrees();
                word(driver * 10.0) << 48 | word(motor * 10.0) << 32 | word(degrees * 50.0)
            }
            27 => {
                let way = (self.shaft.angle_rad - self.zero.0) / TAU * electrical * 6.0;
                let count = (floor(way) + i64::from(self.zero.1)) as i32;
                u64::from(count.cast_unsigned()) << 32 | word(240.0) << 16
            }
            58 => 0,
            _ => return None,
        };
        let id = extended(u32::from(packet) << 8 | u32::from(self.id))?;
        Some(CanFrame::of(id, bits.to_be_bytes()))
    }

    fn gear(&self) -> f64 {
        self.model.gear.as_f32().into()
    }

    fn no_load_rad_per_s(&self) -> f64 {
        self.model.max_velocity.as_rad_per_s().into()
    }

    fn nm_per_a(&self) -> f64 {
        self.gear() * f64::from(self.model.torque_constant_nm_per_a)
    }

    fn wanted_nm(&self) -> f64 {
        let shaft = &self.shaft;
        let erpm =
            |velocity: f64| velocity * self.gear() * f64::from(self.model.pole_pairs) * 60.0 / TAU;
        match self.command {
            Command::Current(current) | Command::Brake(current) | Command::Handbrake(current)
                if current.abs() < LEAST_CURRENT =>
            {
                0.0
            }
            Command::Current(current) => current * self.nm_per_a(),
            Command::Brake(current) => {
                let most = current.abs() * self.nm_per_a();
                within(shaft.following_nm(0.0), most)
            }
            Command::Handbrake(current) => {
                let most = current.abs() * self.nm_per_a();
                let velocity = 20.0 * (self.held_rad - shaft.angle_rad);
                within(shaft.following_nm(velocity), most)
            }
            Command::Duty(duty) => shaft.following_nm(duty * self.no_load_rad_per_s()),
            Command::Speed(speed) if speed.abs() < LEAST_SPEED => 0.0,
            Command::Speed(speed) => shaft.following_nm(speed / erpm(1.0)),
            Command::Position(degrees) => {
                let way = degrees.to_radians() - shaft.angle_rad;
                let way = within_turn(way + TAU / 2.0) - TAU / 2.0;
                shaft.following_nm(10.0 * way)
            }
        }
    }
}

impl Drive for VescDrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let Id::Extended(id) = frame.id() else { return None };
        let id = id.as_raw();
        let is_own = id & 0xFF == u32::from(self.id) || id & 0xFF == 0xFF;
        if !frame.is_data_frame() || !is_own {
            return None;
        }
        let data = frame.data();
        let packet = id >> 8;
        if packet == 8 {
            // Requested values come in a short message if they fit: the fault code alone is value 15.
            let &[host, 0, 50, 0, 0, 0x80, 0, ..] = data else { return None };
            return extended(8 << 8 | u32::from(host))
                .map(|id| CanFrame::of(id, [self.id, 1, 50, 0, 0, 0x80, 0, self.fault]));
        }
        // A current frame of six bytes or more begins with a delay.
        let from = if packet == 1 && data.len() >= 6 { 2 } else { 0 };
        let bytes = data.get(from..)?.first_chunk::<4>()?;
        let value = f64::from(i32::from_be_bytes(*bytes));
        let limit = self.current_max_a;
        let command = match packet {
            0 => Command::Duty(value / 1e5),
            1 => Command::Current(value / 1e3),
            2 => Command::Brake(value / 1e3),
            3 => Command::Speed(value),
            4 => Command::Position(value / 1e6),
            10 => Command::Current(value / 1e5 * limit),
            11 => Command::Brake(value / 1e5 * limit),
            12 => Command::Handbrake(value / 1e3),
            13 => Command::Handbrake(value / 1e5 * limit),
            _ => return None,
        };
        self.silence_s = 0.0;
        if self.ignores_s <= 0.0 {
            self.follow(command);
        }
        None
    }

    fn step(&mut self, dt_s: f32) {
        let dt_s = f64::from(dt_s);
        self.silence_s += dt_s;
        self.ignores_s -= dt_s;
        self.since_status_s += dt_s;
        if self.status_s > 0.0 && self.since_status_s >= self.status_s - 1e-9 {
            self.since_status_s = (self.since_status_s - self.status_s).max(0.0).min(self.status_s);
            self.unsent = STATUSES.len();
        }
        if self.ignores_s <= 0.0 {
            self.fault = 0;
        }
        if self.timeout_s > 0.0 && self.silence_s > self.timeout_s {
            self.follow(Command::Brake(self.timeout_brake_a));
        }
        let current = self.wanted_nm() / self.nm_per_a();
        let most = self.current_max_a;
        self.shaft.step(within(current, most) * self.nm_per_a(), dt_s);
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        self.unsent = self.unsent.checked_sub(1)?;
        self.report(*STATUSES.get(self.unsent)?)
    }
}

fn extended(raw: u32) -> Option<Id> {
    ExtendedId::new(raw).map(Id::Extended)
}

/// Returns the angle from 0 to a turn.
fn within_turn(angle_rad: f64) -> f64 {
    angle_rad - floor(angle_rad / TAU) as f64 * TAU
}

fn floor(value: f64) -> i64 {
    let whole = value as i64;
    if whole as f64 > value { whole - 1 } else { whole }
}
