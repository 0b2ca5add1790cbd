//! The program of the robot, as for a microcontroller, in any layout.

use crate::delay::Delayed;
use drivetrain::chassis::{
    Chassis, ChassisLimits, Differential, Kinematics, Mecanum, MecanumWheels, Omni,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::error::ConfigError;
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::motor::{ArmError, ArmingSwitch, Condition, Link, MotorName, SwitchOrder};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, MotorConfig, MotorKey, Simulation, Wheel};
use drivetrain::time::{Duration, Edge, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use std::error::Error;

/// Radius of each wheel in m.
const WHEEL_RADIUS_M: f32 = 0.076;
/// Front left wheel from the centre, in m.
const CORNER: Vec2 = Vec2::new(0.20, 0.18);
/// Omni wheels from the centre, in m; where they stand, in degrees counter-clockwise from ahead.
const OMNI_DISTANCE_M: f32 = 0.22;
const OMNI_DEGREES: [f32; 3] = [60.0, -60.0, 180.0];
const FASTEST_RPM: f32 = 450.0;

/// Where the wheels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Four mecanum wheels.
    Mecanum,
    /// Three omni wheels.
    Omni,
    /// Two driven wheels; castors carry the rest.
    Differential,
}

impl Layout {
    /// All layouts, with the word of a script for each.
    pub const ALL: [(&'static str, Self); 3] =
        [("mecanum", Self::Mecanum), ("omni", Self::Omni), ("differential", Self::Differential)];

    pub(crate) fn of_word(word: &str) -> Option<Self> {
        Self::ALL.iter().find(|(one, _)| *one == word).map(|(_, layout)| *layout)
    }

    pub(crate) fn word(self) -> &'static str {
        Self::ALL.iter().find(|(_, one)| *one == self).map_or("", |(word, _)| word)
    }
}

/// Age of the last command at which the motors of [`Watchdogs::Both`] stop.
const MOTOR_TIMEOUT: Duration = Duration::from_millis(50);

/// The watchdog that stops the motors when frames do not come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Watchdogs {
    /// The program stops them 10 ms after their last feedback; a motor stops 50 ms after its last command.
    Both,
    /// The program alone: a motor keeps its last command. DJI does not say what its ESCs do; this is the worst case.
    Program,
}

impl Watchdogs {
    /// All of them, with the word of a script for each.
    pub const ALL: [(&'static str, Self); 2] = [("program", Self::Program), ("both", Self::Both)];

    pub(crate) fn of_word(word: &str) -> Option<Self> {
        Self::ALL.iter().find(|(one, _)| *one == word).map(|(_, watchdogs)| *watchdogs)
    }

    pub(crate) fn word(self) -> &'static str {
        Self::ALL.iter().find(|(_, one)| *one == self).map_or("", |(word, _)| word)
    }
}

/// Inputs of the pilot in a tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pilot {
    /// The position of the arming switch; turning it on arms.
    pub(crate) is_switch_on: bool,
    /// In m/s and rad/s, in the frame of the robot.
    pub(crate) twist: Twist<Body>,
}

/// Values of a wheel on the page: rad/s of the wheel, A of its motor; `None` without fresh feedback.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct WheelView {
    pub(crate) target: f32,
    pub(crate) measured: Option<f32>,
    pub(crate) current_a: Option<f32>,
}

/// A robot of any layout.
pub(crate) trait Robot {
    /// Receives, and returns the step that is due.
    fn due(&mut self) -> Option<Tick>;
    /// One cycle of 1 kHz; why the robot is not armed where the pilot asked for it.
    fn cycle(&mut self, tick: Tick, pilot: Pilot) -> Result<(), ArmError>;
    fn is_armed(&self) -> bool;
    /// Changes the gains of all wheels while they run; why the first wheel that refuses them does.
    fn set_gains(&mut self, speed: PidConfig) -> Result<(), ConfigError>;
    fn wheels(&self) -> Vec<WheelView>;
    /// An edge of a motor: a fault that begins or ends.
    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>>;
    /// An edge of the bus itself, with its time.
    fn next_bus_edge(&mut self) -> Option<(Instant, String)>;
}

/// A robot, and the motors of the world that turn its wheels.
pub(crate) type Built = (Box<dyn Robot>, Vec<MotorKey>);

/// Puts a robot into a world; also the motors that turn its wheels, front left first.
pub(crate) fn build(
    layout: Layout,
    world: &'static Simulation,
    can: Delayed,
    mass_kg: f32,
    speed: PidConfig,
    watchdogs: Watchdogs,
) -> Result<Built, Box<dyn Error>> {
    let bus = Bus::new();
    let mut parts = Parts { world, bus, floor: Vec::new(), keys: Vec::new(), speed, watchdogs };
    let robot: Box<dyn Robot> = match layout {
        Layout::Mecanum => {
            let place = |x: f32, y: f32| Vec2::new(x * CORNER.x, y * CORNER.y);
            let wheel = |key, place| Wheel::mecanum(key, WHEEL_RADIUS_M, place);
            let wheels = MecanumWheels {
                front_left: parts.wheel(2, false, |key| wheel(key, place(1.0, 1.0)))?,
                front_right: parts.wheel(1, true, |key| wheel(key, place(1.0, -1.0)))?,
                rear_left: parts.wheel(3, false, |key| wheel(key, place(-1.0, 1.0)))?,
                rear_right: parts.wheel(4, true, |key| wheel(key, place(-1.0, -1.0)))?,
            };
            parts.finish(can, mass_kg, Mecanum::new(WHEEL_RADIUS_M, CORNER)?, wheels)?
        }
        Layout::Omni => {
            let mut wheel = |id, degrees: f32| {
                let direction = Angle::from_degrees(degrees).as_radians();
                let place = Vec2::new(direction.cos(), direction.sin()) * OMNI_DISTANCE_M;
                let rolls = Angle::from_degrees(degrees + 90.0);
                parts.wheel(id, false, |key| Wheel::omni(key, WHEEL_RADIUS_M, place, rolls))
            };
            let [left, right, rear] = OMNI_DEGREES;
            let wheels = [wheel(1, left)?, wheel(2, right)?, wheel(3, rear)?];
            parts.finish(can, mass_kg, Omni::three(WHEEL_RADIUS_M, OMNI_DISTANCE_M)?, wheels)?
        }
        Layout::Differential => {
            let wheel = |key, y| Wheel::plain(key, WHEEL_RADIUS_M, Vec2::new(0.0, y));
            let wheels = [
                parts.wheel(1, false, |key| wheel(key, CORNER.y))?,
                parts.wheel(2, true, |key| wheel(key, -CORNER.y))?,
            ];
            parts.finish(can, mass_kg, Differential::new(WHEEL_RADIUS_M, CORNER.y)?, wheels)?
        }
    };
    Ok((robot, parts.keys))
}

/// Parts that all layouts have while they are built.
struct Parts {
    world: &'static Simulation,
    bus: Bus,
    floor: Vec<Wheel>,
    keys: Vec<MotorKey>,
    speed: PidConfig,
    watchdogs: Watchdogs,
}

impl Parts {
    /// Attaches a motor with its wheel to the world, and its driver to the bus. A motor that is mounted the other way round is reversed.
    fn wheel(
        &mut self,
        id: u8,
        reversed: bool,
        stand: impl FnOnce(MotorKey) -> Wheel,
    ) -> Result<Handle<M3508>, Box<dyn Error>> {
        let motor = MotorConfig::m3508(id);
        let motor = match self.watchdogs {
            Watchdogs::Both => motor.with_command_timeout(MOTOR_TIMEOUT),
            Watchdogs::Program => motor,
        };
        let key = self.world.attach(motor)?;
        let wheel = stand(key);
        self.floor.push(if reversed { wheel.reversed() } else { wheel });
        self.keys.push(key);
        let config = Config::<M3508>::new(id).speed_loop(self.speed);
        Ok(self.bus.attach(if reversed { config.reversed() } else { config })?)
    }

    /// Sets the robot on its wheels.
    fn finish<K>(
        &mut self,
        can: Delayed,
        mass_kg: f32,
        kinematics: K,
        wheels: K::Wheels<Handle<M3508>>,
    ) -> Result<Box<dyn Robot>, Box<dyn Error>>
    where
        K: Kinematics<Speed = AngularVelocity> + 'static,
    {
        self.world.attach_chassis(ChassisConfig::new(&self.floor).with_mass_kg(mass_kg))?;
        let mut chassis = Chassis::new(kinematics);
        let limits = ChassisLimits::new()
            .with_acceleration(4.0, 20.0)
            .with_wheel_speed(AngularVelocity::from_rpm(FASTEST_RPM));
        chassis.set_limits(limits)?;
        let bus = std::mem::take(&mut self.bus);
        let runner = Runner::new(Nb(can), self.world, bus);
        Ok(Box::new(OnWheels {
            runner,
            chassis,
            wheels,
            targets: Vec::new(),
            switch: ArmingSwitch::new(),
            is_armed: false,
        }))
    }
}

/// A chassis, its wheels, and the runner of their bus.
struct OnWheels<K: Kinematics> {
    runner: Runner<Nb<Delayed>, &'static Simulation, Bus>,
    chassis: Chassis<K>,
    wheels: K::Wheels<Handle<M3508>>,
    targets: Vec<f32>,
    switch: ArmingSwitch,
    is_armed: bool,
}

impl<K: Kinematics<Speed = AngularVelocity>> Robot for OnWheels<K> {
    fn due(&mut self) -> Option<Tick> {
        self.runner.poll(16);
        self.runner.due()
    }

    fn cycle(&mut self, tick: Tick, pilot: Pilot) -> Result<(), ArmError> {
        let mut armed = Ok(());
        match self.switch.read(Some(pilot.is_switch_on), pilot.twist == Twist::ZERO, tick) {
            SwitchOrder::Arm => armed = self.runner.arm(tick),
            SwitchOrder::Keep | SwitchOrder::Brake => {}
            SwitchOrder::Disarm => self.runner.device_mut().disarm(),
        }
        self.is_armed = self.runner.is_armed();
        if self.is_armed {
            self.chassis.set_body(pilot.twist);
        } else {
            self.chassis.stop();
        }
        let targets = self.chassis.drive(self.runner.device_mut(), self.wheels, tick);
        self.runner.tick(tick);
        self.targets.clear();
        K::map(targets, |target| self.targets.push(target.as_rad_per_s()));
        armed
    }

    fn is_armed(&self) -> bool {
        self.is_armed
    }

    fn set_gains(&mut self, speed: PidConfig) -> Result<(), ConfigError> {
        let (bus, mut outcome) = (self.runner.device_mut(), Ok(()));
        K::map(self.wheels, |wheel| outcome = outcome.and(bus.set_speed_loop(wheel, speed)));
        outcome
    }

    fn wheels(&self) -> Vec<WheelView> {
        let (bus, mut views) = (self.runner.device(), Vec::new());
        let mut targets = self.targets.iter();
        K::map(self.wheels, |wheel| {
            let heard = bus.link(wheel) == Some(Link::Online);
            let state = bus.state(wheel).filter(|_| heard);
            views.push(WheelView {
                target: targets.next().copied().unwrap_or_default(),
                measured: state.map(|state| state.velocity.as_rad_per_s()),
                current_a: state.map(|state| state.current.as_amperes()),
            });
        });
        views
    }

    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.runner.device_mut().next_edge()
    }

    fn next_bus_edge(&mut self) -> Option<(Instant, String)> {
        let edge = self.runner.next_edge()?;
        let phase = if edge.began { "began" } else { "ended" };
        Some((edge.at, format!("{} {phase}", edge.condition)))
    }
}
