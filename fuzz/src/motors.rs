//! The motors of the observed bus: one of each model, with every kind of loop, limit and recovery.

use drivetrain::control::PidConfig;
use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Gm6020Current, Gm6020Voltage, Handle, M2006, M3508,
};
use drivetrain::encoder::Position;
use drivetrain::motor::TargetError;
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity, Current, Voltage};

/// What is written down of a motor apart from the crate.
#[derive(Debug)]
pub struct Facts {
    pub feedback_id: u16,
    pub command_id: u16,
    /// Place in the command frame.
    pub place: usize,
    pub limit: u16,
}

pub const COUNT: usize = 5;

/// In what time the output range of each motor opens after arming, in µs: at once, shorter than usual, and as it comes.
pub const OPENING_US: [u64; COUNT] = [0, 50_000, 0, 0, 200_000];

/// The motor whose loop integrates and does nothing else: it shows what an integral keeps.
pub const INTEGRATOR: usize = 2;

pub const FACTS: [Facts; COUNT] = [
    Facts { feedback_id: 0x201, command_id: 0x200, place: 0, limit: 16_384 },
    Facts { feedback_id: 0x202, command_id: 0x200, place: 1, limit: 10_000 },
    Facts { feedback_id: 0x203, command_id: 0x200, place: 2, limit: 4_096 },
    Facts { feedback_id: 0x20B, command_id: 0x2FF, place: 2, limit: 25_000 },
    Facts { feedback_id: 0x209, command_id: 0x2FE, place: 0, limit: 16_384 },
];

#[derive(Debug, Clone, Copy)]
pub enum Motor {
    M3508(Handle<M3508>),
    M2006(Handle<M2006>),
    Voltage(Handle<Gm6020Voltage>),
    Current(Handle<Gm6020Current>),
}

/// What a motor is asked for; the value may be any `f32`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    Output(f32),
    Raw(i16),
    Velocity(f32),
    Angle(f32),
    Turns(i64, f32),
}

impl Motor {
    pub fn attach(bus: &mut Bus, index: usize) -> Result<Self, AttachError> {
        let speed = PidConfig::new(2.0, 5.0, 0.01);
        let opening = Duration::from_micros(OPENING_US[index]);
        match index {
            0 => {
                bus.attach(Config::new(1).speed_loop(speed).with_opening(opening)).map(Self::M3508)
            }
            1 => {
                let config = Config::new(2).reversed().with_resume();
                bus.attach(config.with_opening(opening)).map(Self::M2006)
            }
            INTEGRATOR => {
                let config = Config::new(3).speed_loop(PidConfig::new(0.0, 50.0, 0.0));
                let config = config.with_current_limit(Current::from_amperes(5.0));
                bus.attach(config.with_opening(opening)).map(Self::M3508)
            }
            3 => {
                let config = Config::new(7).position_loop(speed, speed);
                bus.attach(config.with_opening(opening)).map(Self::Voltage)
            }
            _ => {
                let config = Config::new(5).reversed();
                bus.attach(config.position_loop(PidConfig::new(8.0, 0.5, 0.1), speed))
                    .map(Self::Current)
            }
        }
    }

    pub fn handle(self) -> AnyHandle {
        match self {
            Self::M3508(motor) => motor.into(),
            Self::M2006(motor) => motor.into(),
            Self::Voltage(motor) => motor.into(),
            Self::Current(motor) => motor.into(),
        }
    }

    pub fn set(self, bus: &mut Bus, target: Target) -> Result<(), TargetError> {
        let angle = Angle::from_radians;
        match target {
            Target::Output(value) => match self {
                Self::M3508(motor) => bus.set_current(motor, Current::from_amperes(value)),
                Self::M2006(motor) => bus.set_current(motor, Current::from_amperes(value)),
                Self::Voltage(motor) => bus.set_voltage(motor, Voltage::from_volts(value)),
                Self::Current(motor) => bus.set_current(motor, Current::from_amperes(value)),
            },
            Target::Raw(raw) => bus.set_raw(self.handle(), raw),
            Target::Velocity(value) => {
                bus.set_velocity(self.handle(), AngularVelocity::from_rad_per_s(value))
            }
            Target::Angle(value) => bus.set_angle(self.handle(), angle(value)),
            Target::Turns(turns, value) => {
                bus.set_position(self.handle(), Position::new(turns, angle(value)))
            }
        }
    }
}
