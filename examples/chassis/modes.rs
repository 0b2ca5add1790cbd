//! The same robot under a gimbal and a pilot: each mode moves by the same stick, and a power limit cuts the torques.

use super::scenario::{
    FRONT_LEFT_M, Robot, WHEEL_RADIUS_M, Wheels, at, attach_motors, robot, seconds_of,
};
use drivetrain::chassis::{
    Chassis, ChassisLimits, ChassisMode, Mecanum, MecanumWheels, ModeConfig, Modes, PowerBuffer,
    PowerFit, PowerModel,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::Bus;
use drivetrain::geometry::Twist;
use drivetrain::sim::{MotorKey, Simulation, Transmission};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::error::Error;

/// The stick is pushed to one side for this long, then to the next.
const PUSH_S: f32 = 1.5;
pub(crate) const ROTOR_RAD_S: f32 = 4.0;
/// The energy of the referee's buffer, and the reserve of the robot.
pub(crate) const BUFFER_J: f32 = 60.0;
const RESERVE_J: f32 = 20.0;
/// V s/rad and Ω of an M3508, from its data sheet: where the fit starts, some of it wrong.
const START: [f32; 4] = [0.0, 0.475, 0.1, 0.0];

pub(crate) struct Drive {
    pub(crate) mode: ChassisMode,
    pub(crate) power_limit_w: Option<f32>,
    pub(crate) seconds: f32,
    pub(crate) seed: u64,
}

/// One millisecond.
pub(crate) struct Sample {
    pub(crate) time_s: f32,
    pub(crate) acting: ChassisMode,
    pub(crate) position_m: (f32, f32),
    /// Of the chassis and of the gimbal in the world, in degrees.
    pub(crate) heading_deg: f32,
    pub(crate) gimbal_deg: f32,
    pub(crate) wz_rad_s: f32,
    pub(crate) speed_m_s: f32,
    pub(crate) wheel_rpm: MecanumWheels<f32>,
    /// The four motors together.
    pub(crate) power_w: f32,
    pub(crate) buffer_j: f32,
    pub(crate) scale: f32,
    /// Whether every motor is told to do nothing.
    pub(crate) is_quiet: bool,
}

pub(crate) struct Outcome {
    pub(crate) samples: Vec<Sample>,
    pub(crate) fitted: PowerModel,
}

impl Drive {
    /// Shows its progress, 0 to 1, and every frame on the wire.
    pub(crate) fn run(
        &self,
        mut progress: impl FnMut(f32),
        mut record: impl FnMut(&Transmission),
    ) -> Result<Outcome, Box<dyn Error>> {
        let world = Simulation::new(self.seed);
        let motors = attach_motors(&world)?;
        let (mut robot, wheels) = robot(&world)?;
        let mut chassis = Chassis::new(Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M)?);
        let fastest = AngularVelocity::from_rpm(450.0);
        chassis.set_limits(
            ChassisLimits::new().with_acceleration(4.0, 20.0).with_wheel_speed(fastest),
        )?;
        let follow = PidConfig::new(8.0, 0.0, 0.0).with_output_limit(6.0);
        let mut modes = Modes::new(ModeConfig::new(follow).with_rotor(ROTOR_RAD_S, 1.0, 3.0))?;
        let mut limiter = self.power_limit_w.map(Limiter::new).transpose()?;
        let mut outcome = Outcome { samples: Vec::new(), fitted: start()? };
        let end = at(self.seconds);
        while world.now() < end {
            world.advance_with(Duration::from_micros(100), &mut record);
            robot.poll(16);
            let Some(tick) = robot.due() else { continue };
            // This robot arms by itself, which only a simulated one may.
            let _not_yet = robot.is_armed() || robot.arm(tick).is_ok();
            let time_s = seconds_of(tick.now());
            let (pose, twist) = world.chassis().ok_or("no chassis")?;
            let gimbal = gimbal(time_s, self.seconds);
            let yaw = gimbal - pose.angle;

            modes.set_mode(self.mode_at(time_s));
            match modes.update(stick(time_s, self.seconds), Some(yaw), tick.dt_s()) {
                Some(twist) => {
                    chassis.set_body(twist);
                    chassis.drive(robot.device_mut(), wheels, tick);
                }
                None => relax(&mut robot, &mut chassis, wheels, tick),
            }
            let power_w = power_w(&world, motors);
            robot.tick_limited(tick, |bus| {
                if let Some(limiter) = &mut limiter {
                    limiter.limit(bus, wheels, power_w, tick.dt_s());
                }
            });

            let device = robot.device();
            let rpm = |wheel| device.state(wheel).map_or(0.0, |state| state.velocity.as_rpm());
            let commands = wheels.map(|wheel| device.commanded_current(wheel));
            outcome.samples.push(Sample {
                time_s,
                acting: modes.acting(),
                position_m: (pose.x_m, pose.y_m),
                heading_deg: pose.angle.as_degrees(),
                gimbal_deg: gimbal.as_degrees(),
                wz_rad_s: twist.wz_rad_s,
                speed_m_s: twist.linear().norm(),
                wheel_rpm: wheels.map(rpm),
                power_w,
                buffer_j: limiter.as_ref().map_or(BUFFER_J, |limiter| limiter.energy_j),
                scale: limiter.as_ref().map_or(1.0, |limiter| limiter.scale),
                is_quiet: commands.into_iter().flatten().all(|current| current.as_amperes() == 0.0),
            });
            if outcome.samples.len().is_multiple_of(250) {
                progress(time_s / self.seconds);
            }
        }
        progress(1.0);
        if let Some(limiter) = limiter {
            outcome.fitted = limiter.fit.model();
        }
        Ok(outcome)
    }

    /// To relax means something only after having driven.
    fn mode_at(&self, time_s: f32) -> ChassisMode {
        match self.mode {
            ChassisMode::Relax if time_s < 0.5 * self.seconds => ChassisMode::Independent,
            mode => mode,
        }
    }
}

/// The pilot drives a square as the gimbal sees it, and rests at the end.
fn stick<F>(time_s: f32, seconds: f32) -> Twist<F> {
    if time_s < 0.2 || time_s > seconds - 0.7 {
        return Twist::ZERO;
    }
    #[expect(clippy::cast_possible_truncation, reason = "at most 600 s")]
    match (time_s / PUSH_S) as i32 % 4 {
        0 => Twist::new(1.5, 0.0, 0.0),
        1 => Twist::new(0.0, 1.5, 0.0),
        2 => Twist::new(-1.5, 0.0, 0.0),
        _ => Twist::new(0.0, -1.5, 0.0),
    }
}

/// The gimbal holds its direction in the world while the chassis turns. After a third of the time, the gimbal turns to the left.
fn gimbal(time_s: f32, seconds: f32) -> Angle {
    let turned = ((time_s - seconds / 3.0) / 0.5).clamp(0.0, 1.0);
    Angle::from_degrees(60.0 * turned)
}

/// Lets all wheels roll, and has the chassis take over from there without a jump.
fn relax(robot: &mut Robot<'_>, chassis: &mut Chassis<Mecanum>, wheels: Wheels, tick: Tick) {
    let bus = robot.device_mut();
    let measured = wheels.map(|wheel| bus.state(wheel).map(|state| state.velocity));
    let _targets = chassis.update(measured, tick);
    chassis.restart();
    for wheel in wheels {
        bus.relax(wheel);
    }
}

fn start() -> Result<PowerModel, Box<dyn Error>> {
    let [k0, k1, k2, k3] = START;
    Ok(PowerModel::new(k0, k1, k2, k3)?)
}

/// What the referee measures: the electric power of the four motors.
fn power_w(world: &Simulation, motors: MecanumWheels<MotorKey>) -> f32 {
    motors.into_iter().filter_map(|motor| world.motor(motor)).map(|state| state.power_w).sum()
}

/// Keeps the referee's buffer from running empty, and learns the motors' losses while driving.
struct Limiter {
    limit_w: f32,
    buffer: PowerBuffer,
    fit: PowerFit,
    energy_j: f32,
    scale: f32,
}

impl Limiter {
    fn new(limit_w: f32) -> Result<Self, Box<dyn Error>> {
        let spend = PidConfig::new(4.0, 0.0, 0.0).with_output_limit(120.0);
        Ok(Self {
            limit_w,
            buffer: PowerBuffer::new(RESERVE_J, spend)?,
            fit: PowerFit::new(start()?, 0.999),
            energy_j: BUFFER_J,
            scale: 1.0,
        })
    }

    /// Between the update of the loops and the frames: the currents are known, and not yet on the wire.
    fn limit(&mut self, bus: &mut Bus, wheels: Wheels, measured_w: f32, dt_s: f32) {
        self.energy_j = (self.energy_j + (self.limit_w - measured_w) * dt_s).clamp(0.0, BUFFER_J);
        let states = wheels.map(|wheel| bus.state(wheel));
        let loads = wheels.zip(states).map(|(wheel, state)| {
            (
                bus.commanded_current(wheel).map_or(0.0, |current| current.as_amperes()),
                state.map_or(AngularVelocity::ZERO, |state| state.velocity),
            )
        });
        if let Some(states) = states.all() {
            let present = states.map(|state| (state.current.as_amperes(), state.velocity));
            self.fit.learn(present, measured_w);
        }
        let allowed_w = self.buffer.allowance_w(self.limit_w, Some(self.energy_j), dt_s);
        (self.scale, _) = self.fit.model().cut(loads, allowed_w);
        bus.scale_outputs(wheels, self.scale);
    }
}
