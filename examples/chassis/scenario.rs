//! The robot, its tasks, and the result of a run.

use super::serial::{Script, SerialPort};
use super::silence::{CommandWatch, Silence};
use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::{Heading, Pose2, Twist, Vec2, World as WorldFrame};
use drivetrain::motor::VelocityDrive;
use drivetrain::runner::{Nb, Runner, Statistics};
use drivetrain::sim::{
    ChassisConfig, Controller, Fault, Line, MotorConfig, MotorKey, Simulation, Traffic,
    Transmission, Wheel,
};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use drivetrain::wire::Counts;
use std::error::Error;

pub(crate) const WHEEL_RADIUS_M: f32 = 0.076;
pub(crate) const FRONT_LEFT_M: Vec2 = Vec2::new(0.20, 0.18);
/// A per rad/s and A per rad of the output shaft. Twice what `WheelTuning` reckons for 20 kg, and more of the integral, for a plan
/// that has to be kept: a step overshoots by some 9 %.
pub(crate) const SPEED: PidConfig = PidConfig::new(4.0, 24.0, 0.0);
const CRUISE_M_S: f32 = 1.0;
const SPIN_RAD_S: f32 = 3.0;
/// The motors on the right are mounted the other way around.
const AHEAD: MecanumWheels<f32> =
    MecanumWheels { front_left: 1.0, front_right: -1.0, rear_left: 1.0, rear_right: -1.0 };
/// Everything speeds up and slows down within this time.
const RAMP_S: f32 = 0.3;
/// After this time of constant velocity the wheels have to be where they belong.
const SETTLING_S: f32 = 0.3;

pub(crate) type Robot<'w> = Runner<Nb<Controller<'w>>, &'w Simulation, Bus>;
pub(crate) type Wheels = MecanumWheels<Handle<M3508>>;

/// Faults that a scenario can plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Trouble {
    SilentMotor,
    LostFrames,
    BusOff,
}

impl Trouble {
    pub(crate) const ALL: [Self; 3] = [Self::SilentMotor, Self::LostFrames, Self::BusOff];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::SilentMotor => "silent-motor",
            Self::LostFrames => "lost-frames",
            Self::BusOff => "bus-off",
        }
    }

    fn schedule(
        self,
        world: &Simulation,
        wheel: MotorKey,
        seconds: f32,
    ) -> Result<(Instant, Instant), Box<dyn Error>> {
        let (fault, length_s) = match self {
            Self::SilentMotor => (Fault::Silent(wheel), 0.4),
            Self::LostFrames => {
                (Fault::LostFrames { line: Line::Can1, id: None, probability: 0.3 }, 0.3 * seconds)
            }
            Self::BusOff => (Fault::BusOff(Line::Can1), 0.3),
        };
        let window = (at(0.3 * seconds), at(0.3 * seconds + length_s));
        world.fault(fault, window.0..window.1)?;
        Ok(window)
    }
}

pub(crate) struct Scenario {
    pub(crate) seconds: f32,
    pub(crate) seed: u64,
    pub(crate) fault: Option<Trouble>,
    /// Lines of a PC for the serial port.
    pub(crate) serial: Option<Script>,
}

/// One millisecond.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) time_s: f32,
    pub(crate) target_rpm: MecanumWheels<f32>,
    pub(crate) measured_rpm: MecanumWheels<f32>,
    /// The true current of each motor, also while nothing is heard of it, in A; positive drives the wheel ahead.
    pub(crate) current_a: MecanumWheels<f32>,
    pub(crate) armed: bool,
    /// Where the robot is, and where it was to be: x and y in m.
    pub(crate) position_m: (f32, f32),
    pub(crate) planned_m: (f32, f32),
    pub(crate) heading_rad: f32,
}

pub(crate) struct Run {
    pub(crate) samples: Vec<Sample>,
    /// The largest error of a wheel, as a share of the largest target, from 300 ms into each segment of constant body
    /// twist on.
    pub(crate) settled_error: f32,
    pub(crate) traffic: Traffic,
    pub(crate) statistics: Statistics,
    pub(crate) refused_to_arm: u32,
    pub(crate) trouble: Option<(Trouble, f32, f32)>,
    /// The longest time in which the trouble kept all commands from the ESCs.
    pub(crate) silence: Option<Silence>,
    /// The answers of the robot over the serial port, and the number of lines taken.
    pub(crate) serial: Option<(String, Counts)>,
}

impl Scenario {
    /// Shows its progress, 0 to 1, and every frame on the wire.
    pub(crate) fn run(
        &self,
        mut progress: impl FnMut(f32),
        mut record: impl FnMut(&Transmission),
    ) -> Result<Run, Box<dyn Error>> {
        let world = Simulation::new(self.seed);
        let motors = attach_motors(&world)?;
        let trouble = match self.fault {
            Some(fault) => {
                let (from, until) = fault.schedule(&world, motors.front_left, self.seconds)?;
                Some((fault, seconds_of(from), seconds_of(until)))
            }
            None => None,
        };
        let mut commands = trouble.map(|(_, from_s, until_s)| CommandWatch::new(from_s, until_s));
        let (mut robot, wheels) = robot(&world)?;
        let mecanum = Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M)?;
        let plan = Plan::new(self.seconds);
        let end = at(self.seconds);
        let mut run = Run {
            samples: Vec::new(),
            settled_error: 0.0,
            traffic: Traffic::default(),
            statistics: Statistics::default(),
            refused_to_arm: 0,
            trouble,
            silence: None,
            serial: None,
        };
        let mut serial = match &self.serial {
            Some(script) => Some(SerialPort::new(script, self.seed)?),
            None => None,
        };
        let mut planned = (0.0, 0.0);
        while world.now() < end {
            world.advance_with(Duration::from_micros(100), |frame| {
                record(frame);
                if let Some(commands) = &mut commands {
                    commands.note(frame);
                }
            });
            robot.poll(16);
            let Some(tick) = robot.due() else { continue };
            let time_s = seconds_of(tick.now());
            let heading = heading(&world);
            let mut wanted = plan.twist(time_s);
            if let Some(serial) = &mut serial {
                let turn = serial.poll(robot.device_mut(), wheels, tick.now())?;
                wanted = wanted.with_wz(wanted.wz_rad_s + turn);
            }
            planned =
                (planned.0 + wanted.vx_m_s * tick.dt_s(), planned.1 + wanted.vy_m_s * tick.dt_s());
            let targets = mecanum.inverse(wanted.to_body(heading));
            run.refused_to_arm += u32::from(!drive(&mut robot, wheels, targets, tick));
            let sample = observe(&world, &mut robot, (motors, wheels), targets, time_s, planned);
            if plan.is_settled(time_s) && sample.armed {
                run.settled_error = run.settled_error.max(share_of_error(&sample));
            }
            run.samples.push(sample);
            if run.samples.len().is_multiple_of(250) {
                progress(time_s / self.seconds);
            }
        }
        progress(1.0);
        run.silence = commands.and_then(|commands| commands.finish(end, &run.samples));
        run.serial = serial.map(SerialPort::finish);
        run.traffic = world.traffic(Line::Can1);
        run.statistics = robot.statistics();
        Ok(run)
    }
}

/// Four M3508 under a chassis of 20 kg.
pub(crate) fn attach_motors(world: &Simulation) -> Result<MecanumWheels<MotorKey>, Box<dyn Error>> {
    let motor = |id| world.attach(MotorConfig::m3508(id));
    let keys = MecanumWheels { front_left: 2, front_right: 1, rear_left: 3, rear_right: 4 }
        .try_map(motor)?;
    let (x, y) = (FRONT_LEFT_M.x, FRONT_LEFT_M.y);
    let wheel = |motor, x, y| Wheel::mecanum(motor, WHEEL_RADIUS_M, Vec2::new(x, y));
    world.attach_chassis(ChassisConfig::new(&[
        wheel(keys.front_left, x, y),
        wheel(keys.front_right, x, -y).reversed(),
        wheel(keys.rear_left, -x, y),
        wheel(keys.rear_right, -x, -y).reversed(),
    ]))?;
    Ok(keys)
}

/// The code that would run on the microcontroller.
pub(crate) fn robot(world: &Simulation) -> Result<(Robot<'_>, Wheels), Box<dyn Error>> {
    let mut bus = Bus::new();
    let wheel = |id| Config::<M3508>::new(id).speed_loop(SPEED);
    let wheels = MecanumWheels {
        front_left: bus.attach(wheel(2))?,
        front_right: bus.attach(wheel(1).reversed())?,
        rear_left: bus.attach(wheel(3))?,
        rear_right: bus.attach(wheel(4).reversed())?,
    };
    Ok((Runner::new(Nb(world.controller()), world.clock(), bus), wheels))
}

/// Drives all wheels, or none: a wheel that is lost stops the others until all can be armed again.
///
/// An operator presses the arming key each 110 ms as long as the robot is not armed. Returns whether it is armed.
fn drive(
    robot: &mut Robot<'_>,
    wheels: Wheels,
    targets: MecanumWheels<AngularVelocity>,
    tick: Tick,
) -> bool {
    let is_pressed = (tick.now().as_micros() / 1_000).is_multiple_of(110);
    let armed = robot.is_armed() || (is_pressed && robot.arm(tick).is_ok());
    let targets = if armed { targets } else { MecanumWheels::splat(AngularVelocity::ZERO) };
    _ = robot.device_mut().drive(wheels.zip(targets).into_array());
    robot.tick(tick);
    armed
}

fn observe(
    world: &Simulation,
    robot: &mut Robot<'_>,
    (motors, wheels): (MecanumWheels<MotorKey>, Wheels),
    targets: MecanumWheels<AngularVelocity>,
    time_s: f32,
    planned_m: (f32, f32),
) -> Sample {
    let armed = robot.is_armed();
    let bus = robot.device();
    let pose = world.chassis().map_or(Pose2::ORIGIN, |(pose, _)| pose);
    Sample {
        time_s,
        target_rpm: targets.map(AngularVelocity::as_rpm),
        measured_rpm: wheels
            .map(|wheel| bus.state(wheel).map_or(0.0, |state| state.velocity.as_rpm())),
        current_a: motors.zip(AHEAD).map(|(motor, ahead)| {
            world.motor(motor).map_or(0.0, |state| ahead * state.current.as_amperes())
        }),
        armed,
        position_m: (pose.x_m, pose.y_m),
        planned_m,
        heading_rad: pose.angle.as_radians(),
    }
}

/// Stands for the IMU.
fn heading(world: &Simulation) -> Heading {
    world.chassis().map_or(Heading::ZERO, |(pose, _)| pose.heading())
}

fn share_of_error(sample: &Sample) -> f32 {
    let largest =
        sample.target_rpm.into_array().iter().fold(0.0_f32, |most, rpm| most.max(rpm.abs()));
    let error = |(target, measured): (f32, f32)| (target - measured).abs();
    let errors = sample.target_rpm.zip(sample.measured_rpm).map(error).into_array();
    errors.iter().fold(0.0_f32, |most, error| most.max(*error)) / largest
}

pub(crate) fn at(seconds: f32) -> Instant {
    Instant::START + Duration::from_secs_f32(seconds).unwrap_or(Duration::ZERO)
}

pub(crate) fn seconds_of(instant: Instant) -> f32 {
    instant.since(Instant::START).as_secs_f32()
}

/// A rest, four sides of a square, a spin on the spot, a rest; each part a share of the whole time.
struct Plan {
    part_s: f32,
}

impl Plan {
    const REST: f32 = 0.5;

    fn new(seconds: f32) -> Self {
        Self { part_s: (seconds - 2.0 * Self::REST) / 5.0 }
    }

    /// Returns the number of the part, and the time since its start.
    fn part(&self, time_s: f32) -> (i32, f32) {
        let moving = time_s - Self::REST;
        if moving < 0.0 {
            return (-1, moving);
        }
        #[expect(clippy::cast_possible_truncation, reason = "at most 600 s")]
        let part = (moving / self.part_s) as i32;
        (part, moving - part as f32 * self.part_s)
    }

    fn twist(&self, time_s: f32) -> Twist<WorldFrame> {
        let (part, within) = self.part(time_s);
        let rise = (within / RAMP_S).min((self.part_s - within) / RAMP_S).clamp(0.0, 1.0);
        let (v, w) = (CRUISE_M_S * rise, SPIN_RAD_S * rise);
        match part {
            0 => Twist::new(v, 0.0, 0.0),
            1 => Twist::new(0.0, v, 0.0),
            2 => Twist::new(-v, 0.0, 0.0),
            3 => Twist::new(0.0, -v, 0.0),
            4 => Twist::new(0.0, 0.0, w),
            _ => Twist::new(0.0, 0.0, 0.0),
        }
    }

    /// Tells whether the twist has been constant, and not zero, for 300 ms.
    fn is_settled(&self, time_s: f32) -> bool {
        let (part, within) = self.part(time_s);
        (0..=4).contains(&part) && within > RAMP_S + SETTLING_S && within < self.part_s - RAMP_S
    }
}
