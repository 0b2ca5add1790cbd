//! What the robot does, without its board: the same code runs on the simulator and on the microcontroller.
#![no_std]

use drivetrain::chassis::{Chassis, ChassisLimits, Differential};
use drivetrain::control::{PidConfig, WheelTuning};
use drivetrain::dji::{Bus, Config, Handle, M3508, Model};
use drivetrain::geometry::Twist;
use drivetrain::motor::Devices;
use drivetrain::time::Tick;
use drivetrain::units::{AngularVelocity, Current};
use drivetrain::wire::dbus::{Remote, Switch};

/// Radius of the wheels, and half the distance between them, in m.
pub const WHEEL_RADIUS_M: f32 = 0.076;
pub const HALF_TRACK_M: f32 = 0.18;
/// Mass of the robot in kg.
pub const MASS_KG: f32 = 12.0;

const CURRENT_LIMIT: Current = Current::from_amperes(6.0);
const SPEED: PidConfig = match (WheelTuning {
    mass_kg: MASS_KG,
    wheel_radius_m: WHEEL_RADIUS_M,
    driven_wheels: 2.0,
    torque_constant_nm_per_a: M3508::FACTS.torque_constant_nm_per_a,
    current_limit_a: CURRENT_LIMIT.as_amperes(),
})
.speed_loop()
{
    Ok(speed) => speed,
    Err(_) => panic!("a value of the wheel is not above zero"),
};

/// What the robot does: one for each position of the switch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    Rest,
    Slow,
    Drive,
}

impl From<Switch> for Mode {
    /// The map of events to modes. The compiler says which position is forgotten.
    fn from(switch: Switch) -> Self {
        match switch {
            Switch::Up => Self::Drive,
            Switch::Middle => Self::Slow,
            Switch::Down | Switch::Absent => Self::Rest,
        }
    }
}

impl Mode {
    /// The fastest motion: m/s ahead and rad/s to the left.
    const fn fastest(self) -> (f32, f32) {
        match self {
            Self::Rest => (0.0, 0.0),
            Self::Slow => (0.3, 1.0),
            Self::Drive => (1.5, 4.0),
        }
    }
}

/// What to do with the motors as a whole, in this tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arming {
    /// Arm, once: the switch left its rest just now, with both sticks at rest.
    Arm,
    /// Leave it as it is.
    Keep,
    /// Disarm.
    Disarm,
}

/// The robot.
#[derive(Debug)]
pub struct Robot {
    /// Left and right.
    wheels: [Handle<M3508>; 2],
    chassis: Chassis<Differential>,
    mode: Mode,
    /// Whether the switch was at rest since the robot was switched on, and the remote control was heard.
    was_at_rest: bool,
}

impl Robot {
    /// Attaches the motors: id 1 is left, id 2 is right and mounted the other way round.
    pub fn new(bus: &mut Bus) -> Result<Self, &'static str> {
        let wheel =
            |id| Config::<M3508>::new(id).speed_loop(SPEED).with_current_limit(CURRENT_LIMIT);
        let mut attach = |config| bus.attach(config).map_err(|_| "the id of a wheel is taken");
        let wheels = [attach(wheel(1))?, attach(wheel(2).reversed())?];
        let layout =
            Differential::new(WHEEL_RADIUS_M, HALF_TRACK_M).map_err(|_| "no such chassis")?;
        let mut chassis = Chassis::new(layout);
        let limits = ChassisLimits::new()
            .with_acceleration(3.0, 10.0)
            .with_wheel_speed(AngularVelocity::from_rpm(400.0));
        chassis.set_limits(limits).map_err(|_| "a limit is not above zero")?;
        Ok(Self { wheels, chassis, mode: Mode::Rest, was_at_rest: false })
    }

    /// Takes what the remote control shows: once a tick, before [`drive`](Self::drive).
    pub fn hear(&mut self, remote: &Remote) -> Arming {
        let before = core::mem::replace(&mut self.mode, remote.right_switch.into());
        let sticks_rest = [remote.right_x, remote.right_y, remote.left_x] == [0.0; 3];
        match (before, self.mode) {
            (_, Mode::Rest) => {
                // Silence is no rest: a remote control that comes back must not arm.
                self.was_at_rest = remote.right_switch == Switch::Down;
                Arming::Disarm
            }
            (Mode::Rest, _) if self.was_at_rest && sticks_rest => {
                self.chassis.restart();
                Arming::Arm
            }
            (Mode::Rest, _) => {
                self.mode = Mode::Rest;
                self.was_at_rest = false;
                Arming::Disarm
            }
            _ => Arming::Keep,
        }
    }

    /// Sets the targets of the wheels: zero unless both are armed, so when one is lost for 100 ms, the other brakes.
    pub fn drive(&mut self, bus: &mut Bus, remote: &Remote, tick: Tick) {
        let mode = if bus.is_armed() { self.mode } else { Mode::Rest };
        let (ahead, left) = mode.fastest();
        self.chassis.set_body(Twist::new(remote.right_y * ahead, 0.0, -remote.left_x * left));
        self.chassis.drive(bus, self.wheels, tick);
    }

    /// Returns what the robot does.
    pub fn mode(&self) -> Mode {
        self.mode
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remote(switch: Switch, right_y: f32) -> Remote {
        Remote { right_switch: switch, right_y, ..Remote::default() }
    }

    #[test]
    fn only_a_switch_that_leaves_its_rest_with_the_sticks_at_rest_arms() {
        use Switch::{Absent, Down, Middle, Up};
        for (positions, expected) in [
            (&[Down, Up][..], Arming::Arm),
            (&[Down, Middle], Arming::Arm),
            (&[Down, Up, Middle], Arming::Keep),
            (&[Up], Arming::Disarm),
            (&[Down, Absent, Up], Arming::Disarm),
            (&[Down, Up, Absent], Arming::Disarm),
        ] {
            let mut robot = Robot::new(&mut Bus::new()).unwrap();
            let mut arming = Arming::Disarm;
            for switch in positions {
                arming = robot.hear(&remote(*switch, 0.0));
            }
            assert_eq!(arming, expected, "{positions:?}");
        }
        let mut robot = Robot::new(&mut Bus::new()).unwrap();
        robot.hear(&remote(Down, 0.0));
        assert_eq!(robot.hear(&remote(Up, 1.0)), Arming::Disarm, "a stick is pushed");
    }
}
