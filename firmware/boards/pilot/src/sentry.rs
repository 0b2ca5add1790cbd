//! A sentry: a mecanum chassis, a gimbal of two axes on an IMU, a shooter. Neither board nor tasks.
//!
//! | part | motors | bus |
//! |---|---|---|
//! | chassis | four M3508, ids 1 to 4 | first |
//! | gimbal | GM6020, id 1: yaw | first |
//! | | GM6020, id 2: pitch | second |
//! | shooter | two M3508 without gearbox, ids 1 and 2: friction wheels | second |
//! | | M2006, id 3: loader | second |
//!
//! The right switch arms when it is turned to the top while both sticks are at rest and the left switch is in its middle; elsewhere
//! the robot rests. The right stick moves the robot to where the gimbal looks, the left one turns the gimbal. The left switch shoots
//! at the top, and spins the chassis at the bottom. Arming holds the gimbal where it looks, and the chassis turns to there with both
//! sticks at rest too.

use crate::gesture::Gesture;
use crate::loader::Loader;
use crate::{CURRENT_LIMIT, chassis_of, wheels_of};
use drivetrain::chassis::{Chassis, ChassisMode, Mecanum, MecanumWheels, ModeConfig, Modes};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M2006, M3508};
use drivetrain::encoder::GearRatio;
use drivetrain::geometry::{Body, Twist};
use drivetrain::motor::{Measured, SwitchOrder};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};
use drivetrain::wire::dbus::{Remote, Switch};
use drivetrain::wire::hipnuc::Imu;

/// A motion that is older stops the chassis.
const MOTION_DEADLINE: Duration = Duration::from_millis(20);
const FASTEST_M_S: f32 = 1.5;
const FASTEST_RAD_S: f32 = 3.0;
const FURTHEST_PITCH_RAD: f32 = 0.4;
/// rad/s per rad.
const FOLLOW: PidConfig = PidConfig::new(5.0, 0.0, 0.0).with_output_limit(4.0);
const ROTOR: (f32, f32, f32) = (4.0, 1.0, 3.0);

/// rad/s per rad, at most 6 rad/s; V per rad/s and V per rad, for 0.02 kg m² and an IMU at 500 Hz.
const ANGLE: PidConfig = PidConfig::new(12.0, 0.0, 0.0).with_output_limit(6.0);
const RATE: PidConfig = PidConfig::new(2.0, 20.0, 0.0);
/// A per rad/s and A per rad, of a wheel on the rotor itself.
const FLYWHEEL: PidConfig = PidConfig::new(0.05, 0.1, 0.0);
const FLYWHEEL_SPEED: AngularVelocity = AngularVelocity::from_rpm(4_000.0);
/// A per rad/s and A per rad.
const LOADER: PidConfig = PidConfig::new(0.5, 2.0, 0.0);

/// Where the gimbal looks in the world, by its IMU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// About z.
    pub yaw: Measured<Angle>,
    /// About y: the muzzle goes down when it is positive.
    pub pitch: Measured<Angle>,
}

impl Attitude {
    /// Takes what an IMU sent, whose frame was complete at `at`.
    pub fn new(imu: &Imu, at: Instant) -> Self {
        let (_, pitch, yaw) = imu.euler_roll_x();
        let [_, pitch_rate, yaw_rate] = imu.angular_velocity;
        Self {
            yaw: Measured { angle: yaw, velocity: yaw_rate, at },
            pitch: Measured { angle: pitch, velocity: pitch_rate, at },
        }
    }
}

/// Where the gimbal is to look, with the measurement that the target was made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// In the world.
    pub yaw: Angle,
    /// Against the horizon.
    pub pitch: Angle,
    /// What is measured.
    pub seen: Attitude,
}

/// What the shooter's motors are to do.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Shot {
    /// The friction wheels turn against each other so fast.
    pub flywheels: AngularVelocity,
    /// Of the loader, forward positive; `None` if it is to take no current.
    pub loader: Option<AngularVelocity>,
}

/// What the shooter's motors do.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Barrel {
    /// The slower friction wheel.
    pub flywheels: AngularVelocity,
    /// Of the loader, forward positive.
    pub loader: AngularVelocity,
    /// Of the loader.
    pub current: Current,
}

/// What happened, for whoever listens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// Both buses are armed.
    Armed,
    /// Arming was refused.
    Refused,
    /// The robot rests, whatever the reason.
    Rests,
    /// The loader gave up.
    Jammed,
}

/// The task of the chassis: from sticks to a motion.
#[derive(Debug)]
pub struct Steering(Modes);

impl Steering {
    /// Follows the gimbal at first.
    pub fn new() -> Result<Self, &'static str> {
        let config = ModeConfig::new(FOLLOW).with_rotor(ROTOR.0, ROTOR.1, ROTOR.2);
        Modes::new(config).map(Self).map_err(|_| "a mode's value is not above zero")
    }

    /// Returns how the chassis is to move. `yaw` is that of the gimbal in the chassis; `None` when it is not known.
    pub fn update(&mut self, remote: &Remote, yaw: Option<Angle>, dt_s: f32) -> Twist<Body> {
        let is_rotor = remote.left_switch == Switch::Down;
        self.0.set_mode(if is_rotor { ChassisMode::Rotor } else { ChassisMode::FollowGimbal });
        let (vx, vy) = (remote.right_y * FASTEST_M_S, -remote.right_x * FASTEST_M_S);
        self.0.update(Twist::new(vx, vy, 0.0), yaw, dt_s).unwrap_or(Twist::ZERO)
    }
}

/// The task of the gimbal: from sticks to a place to look at.
#[derive(Debug, Default)]
pub struct Aiming {
    /// Yaw and pitch in rad; none while nothing is armed, so that arming holds the gimbal where it looks.
    held: Option<(f32, f32)>,
}

impl Aiming {
    /// Returns where to look.
    pub fn update(&mut self, remote: &Remote, seen: Attitude, is_armed: bool, dt_s: f32) -> Aim {
        let (yaw, pitch) = self
            .held
            .filter(|_| is_armed)
            .unwrap_or((seen.yaw.angle.as_radians(), seen.pitch.angle.as_radians()));
        let yaw = yaw - remote.left_x * FASTEST_RAD_S * dt_s;
        // A gimbal hangs without torque: beyond its limit it is held, and the stick leads it inward only.
        let (low, high) = (pitch.min(-FURTHEST_PITCH_RAD), pitch.max(FURTHEST_PITCH_RAD));
        let pitch = (pitch - remote.left_y * FASTEST_RAD_S * dt_s).clamp(low, high);
        self.held = Some((yaw, pitch));
        Aim { yaw: Angle::from_radians(yaw), pitch: Angle::from_radians(pitch), seen }
    }
}

/// The task of the shooter: the loader feeds once the friction wheels have their speed.
#[derive(Debug, Default)]
pub struct Shooter(Loader);

impl Shooter {
    /// Returns what the motors are to do.
    pub fn update(&mut self, remote: &Remote, barrel: Barrel, now: Instant) -> Shot {
        let is_wanted = remote.left_switch == Switch::Up;
        let flywheels = if is_wanted { FLYWHEEL_SPEED } else { AngularVelocity::ZERO };
        let fast = barrel.flywheels.as_rpm() > 0.9 * FLYWHEEL_SPEED.as_rpm();
        let loader = self.0.update(is_wanted && fast, barrel.loader, barrel.current, now);
        Shot { flywheels, loader }
    }

    /// Tells whether the loader gave up.
    pub fn is_jammed(&self) -> bool {
        self.0.is_jammed()
    }
}

/// The motors, and the gesture that arms them.
#[derive(Debug)]
pub struct Sentry {
    chassis: Chassis<Mecanum>,
    wheels: MecanumWheels<Handle<M3508>>,
    yaw: Handle<Gm6020Voltage>,
    pitch: Handle<Gm6020Voltage>,
    flywheels: [Handle<M3508>; 2],
    loader: Handle<M2006>,
    gesture: Gesture,
}

impl Sentry {
    /// Attaches everything.
    ///
    /// # Errors
    /// When an id is taken, or a value makes no sense.
    pub fn new() -> Result<(Self, Bus, Bus), &'static str> {
        const TAKEN: &str = "an id is taken";
        let (mut first, mut second) = (Bus::new(), Bus::new());
        let wheels = wheels_of(&mut first)?;
        let axis = |id| Config::<Gm6020Voltage>::new(id).position_loop(ANGLE, RATE);
        let flywheel = |id| {
            Config::<M3508>::new(id)
                .with_gear(GearRatio::DIRECT)
                .speed_loop(FLYWHEEL)
                .with_current_limit(CURRENT_LIMIT)
        };
        let loader = Config::<M2006>::new(3).speed_loop(LOADER);
        let sentry = Self {
            chassis: chassis_of()?,
            wheels,
            yaw: first.attach(axis(1)).map_err(|_| TAKEN)?,
            pitch: second.attach(axis(2)).map_err(|_| TAKEN)?,
            flywheels: [
                second.attach(flywheel(1)).map_err(|_| TAKEN)?,
                second.attach(flywheel(2).reversed()).map_err(|_| TAKEN)?,
            ],
            loader: second.attach(loader).map_err(|_| TAKEN)?,
            gesture: Gesture::default(),
        };
        Ok((sentry, first, second))
    }

    /// Returns what the remote control asks for; to be called once a tick.
    pub fn order(&mut self, remote: &Remote, tick: Tick) -> SwitchOrder {
        let order = self.gesture.read(remote, true, tick);
        if order == SwitchOrder::Arm {
            self.chassis.restart();
        }
        order
    }

    /// Drives the wheels by the newest motion, and says when it was made.
    pub fn roll(&mut self, first: &mut Bus, motion: Option<(Twist<Body>, Instant)>, tick: Tick) {
        let fresh = motion.filter(|(_, at)| tick.now().since(*at) <= MOTION_DEADLINE);
        self.chassis.set_body(fresh.map_or(Twist::ZERO, |(twist, _)| twist));
        self.chassis.drive(first, self.wheels, tick);
    }

    /// Sets the targets of the gimbal. A measurement that is older than 20 ms is refused, and the axis rests.
    pub fn aim(&self, first: &mut Bus, second: &mut Bus, aim: &Aim) {
        _ = first.set_angle_measured(self.yaw, aim.yaw, aim.seen.yaw);
        _ = second.set_angle_measured(self.pitch, aim.pitch, aim.seen.pitch);
    }

    /// Sets the targets of the shooter; to be called for each new one, so that they grow old when its task is dead.
    pub fn shoot(&self, second: &mut Bus, shot: Shot) {
        for flywheel in self.flywheels {
            _ = second.set_velocity(flywheel, shot.flywheels);
        }
        match shot.loader {
            Some(velocity) => _ = second.set_velocity(self.loader, velocity),
            None => second.relax(self.loader),
        }
    }

    /// Returns the yaw of the gimbal in the chassis; `None` when it is not known. The encoder shows 0 when it looks ahead.
    pub fn gimbal_yaw(&self, first: &Bus) -> Option<Angle> {
        first.state(self.yaw).map(|state| state.position.as_angle())
    }

    /// Returns what the shooter's motors do.
    pub fn barrel(&self, second: &Bus) -> Barrel {
        let speeds = self
            .flywheels
            .map(|wheel| second.state(wheel).map_or(AngularVelocity::ZERO, |state| state.velocity));
        let [one, other] = speeds;
        let loader = second.state(self.loader);
        Barrel {
            flywheels: if one < other { one } else { other },
            loader: loader.map_or(AngularVelocity::ZERO, |state| state.velocity),
            current: loader.map_or(Current::ZERO, |state| state.current),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::sim::{Fault, MotorConfig, Simulation};
    use embedded_can::nb::Can;

    const TRIGGER_MS: u64 = 50;
    const JAM_MS: u64 = 800;
    const END_MS: u64 = 2_800;

    #[test]
    fn a_sentry_whose_left_switch_would_shoot_or_spin_is_not_armed() {
        use Switch::{Absent, Down, Middle, Up};
        let remote =
            |right_switch, left_switch| Remote { right_switch, left_switch, ..Remote::default() };
        let order = |left| {
            let (mut sentry, ..) = Sentry::new().unwrap();
            let tick = Tick::new(Instant::from_micros(1_000), 0.001);
            _ = sentry.order(&remote(Middle, left), tick);
            let turned = sentry.order(&remote(Up, left), tick);
            // Let go later, it does not arm: the right switch has to be turned anew.
            assert_eq!(sentry.order(&remote(Up, Middle), tick), SwitchOrder::Keep);
            turned
        };
        let (arm, keep) = (SwitchOrder::Arm, SwitchOrder::Keep);
        assert_eq!([Up, Down, Absent, Middle].map(order), [keep, keep, keep, arm]);
    }

    /// The targets of the pitch, of so many seconds each in which the left stick is there; armed where the gimbal looks.
    fn pitches(looks_at: f32, sticks: &[(f32, f32)]) -> Vec<f32> {
        let measured = |radians| Measured {
            angle: Angle::from_radians(radians),
            velocity: AngularVelocity::ZERO,
            at: Instant::START,
        };
        let seen = Attitude { yaw: measured(0.0), pitch: measured(looks_at) };
        let mut aiming = Aiming::default();
        aiming.update(&Remote::default(), seen, false, 0.001);
        let pitch_after = |(left_y, seconds): &(f32, f32)| {
            let remote = Remote { left_y: *left_y, ..Remote::default() };
            let mut pitch = f32::NAN;
            for _ in 0..(seconds * 1_000.0) as u32 {
                pitch = aiming.update(&remote, seen, true, 0.001).pitch.as_radians();
            }
            (pitch * 100.0).round() / 100.0
        };
        sticks.iter().map(pitch_after).collect()
    }

    #[test]
    fn arming_holds_a_gimbal_that_hangs_beyond_its_limit_where_it_looks() {
        for looks_at in [-1.2, -0.4, 0.1, 0.8] {
            assert_eq!(pitches(looks_at, &[(0.0, 0.01), (0.0, 1.0)]), [looks_at; 2]);
        }
    }

    #[test]
    fn a_gimbal_beyond_its_limit_follows_the_stick_inward_and_stays_inside() {
        // 3 rad/s; the muzzle goes down when the stick is pulled.
        assert_eq!(pitches(0.8, &[(-1.0, 0.5), (1.0, 0.1), (-1.0, 0.5)]), [0.8, 0.5, 0.5]);
        assert_eq!(pitches(0.8, &[(1.0, 0.2), (-1.0, 0.5), (1.0, 1.0)]), [0.2, 0.4, -0.4]);
        assert_eq!(pitches(-0.8, &[(1.0, 0.5), (-1.0, 0.2), (1.0, 0.5)]), [-0.8, -0.2, -0.4]);
    }

    #[test]
    fn a_loader_that_stays_blocked_turns_back_twice_and_then_takes_no_current() {
        let world = Simulation::new(1);
        world.attach(MotorConfig::gm6020_voltage(2)).unwrap();
        world.attach(MotorConfig::m3508(1)).unwrap();
        world.attach(MotorConfig::m3508(2)).unwrap();
        let loader = world.attach(MotorConfig::m2006(3)).unwrap();
        let at = |ms| Instant::START + Duration::from_millis(ms);
        world.fault(Fault::BlockedShaft(loader), at(JAM_MS)..at(END_MS)).unwrap();
        let (sentry, _, mut second) = Sentry::new().unwrap();
        let (mut shooter, mut can) = (Shooter::default(), world.controller());
        let (mut turned_back, mut was_back, mut rested_ms) = (0, false, None);
        for ms in 1..END_MS {
            world.advance(Duration::from_millis(1));
            let now = world.now();
            while let Ok(frame) = can.receive() {
                _ = second.ingest(&frame, now);
            }
            if ms == 20 {
                second.arm(now).unwrap();
            }
            let is_shooting = ms >= TRIGGER_MS;
            if ms % 2 == 0 {
                let left_switch = if is_shooting { Switch::Up } else { Switch::Middle };
                let remote = Remote { left_switch, ..Remote::default() };
                let shot = shooter.update(&remote, sentry.barrel(&second), now);
                sentry.shoot(&mut second, shot);
                let is_back = shot.loader.is_some_and(|loader| loader.as_rpm() < 0.0);
                turned_back += u32::from(is_back && !was_back);
                was_back = is_back;
            }
            second.update(Tick::new(now, 0.001));
            while let Some(frame) = second.next_frame() {
                _ = can.transmit(&frame);
            }
            let word = world.motor(loader).unwrap().command;
            if word != 0 {
                rested_ms = None;
            } else if rested_ms.is_none() {
                rested_ms = Some(ms);
            }
        }
        assert_eq!(turned_back, 2);
        assert!(shooter.is_jammed());
        assert!(rested_ms.is_some_and(|ms| ms < JAM_MS + 1_200), "{rested_ms:?}");
        assert!(sentry.barrel(&second).flywheels.as_rpm() > 3_600.0);
    }
}
