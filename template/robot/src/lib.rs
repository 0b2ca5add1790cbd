//! What the robot does, without its board: the same code runs on the simulator and on the microcontroller.
#![no_std]

use drivetrain::chassis::{Chassis, ChassisLimits, Differential};
use drivetrain::control::{PidConfig, WheelTuning};
use drivetrain::dji::{Bus, Config, Handle, M3508, Model};
use drivetrain::geometry::Twist;
use drivetrain::motor::{ArmingSwitch, Devices, SwitchOrder};
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

/// The robot.
#[derive(Debug)]
pub struct Robot {
    /// Left and right.
    wheels: [Handle<M3508>; 2],
    chassis: Chassis<Differential>,
    mode: Mode,
    /// The right switch: on in its middle and at its top.
    switch: ArmingSwitch,
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
        Ok(Self { wheels, chassis, mode: Mode::Rest, switch: ArmingSwitch::new() })
    }

    /// Takes what the remote control shows: once a tick, before [`drive`](Self::drive). Arms only with both sticks at rest. When the remote
    /// control is lost, the robot brakes for a second, and is disarmed.
    pub fn hear(&mut self, remote: &Remote, tick: Tick) -> SwitchOrder {
        let is_on = remote.right_switch.is_at(Switch::Down).map(|is_down| !is_down);
        let is_at_rest = [remote.right_x, remote.right_y, remote.left_x] == [0.0; 3];
        let order = self.switch.read(is_on, is_at_rest, tick);
        let brakes = order == SwitchOrder::Brake;
        self.mode = if brakes { Mode::Rest } else { remote.right_switch.into() };
        if order == SwitchOrder::Arm {
            self.chassis.restart();
        }
        order
    }

    /// Sets the targets of the wheels: zero unless both are armed, so when one is lost for 100 ms, the other brakes.
    pub fn drive(&mut self, bus: &mut Bus, remote: &Remote, tick: Tick) {
        let mode = if bus.is_armed() { self.mode } else { Mode::Rest };
        let (ahead, left) = mode.fastest();
        self.chassis.set_body(Twist::new(remote.right_y * ahead, 0.0, -remote.left_x * left));
        self.chassis.drive(bus, self.wheels, tick);
    }

    /// Returns the mode of the switch; a robot that is not armed rests in each.
    pub fn mode(&self) -> Mode {
        self.mode
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::time::Instant;

    const TICK: Tick = Tick::new(Instant::from_micros(1_000), 0.001);

    fn remote(switch: Switch, right_y: f32) -> Remote {
        Remote { right_switch: switch, right_y, ..Remote::default() }
    }

    #[test]
    fn only_a_switch_that_leaves_its_rest_with_the_sticks_at_rest_arms() {
        use Switch::{Absent, Down, Middle, Up};
        for (positions, expected) in [
            (&[Down, Up][..], SwitchOrder::Arm),
            (&[Down, Middle], SwitchOrder::Arm),
            (&[Down, Up, Middle], SwitchOrder::Keep),
            (&[Up], SwitchOrder::Keep),
            (&[Down, Absent, Up], SwitchOrder::Keep),
            (&[Down, Up, Absent], SwitchOrder::Brake),
            (&[Down, Up, Absent, Up], SwitchOrder::Brake),
            (&[Down, Up, Down], SwitchOrder::Disarm),
        ] {
            let mut robot = Robot::new(&mut Bus::new()).unwrap();
            let orders = positions.iter().map(|switch| robot.hear(&remote(*switch, 0.0), TICK));
            assert_eq!(orders.last(), Some(expected), "{positions:?}");
        }
        let mut robot = Robot::new(&mut Bus::new()).unwrap();
        _ = robot.hear(&remote(Down, 0.0), TICK);
        let held = robot.hear(&remote(Up, 1.0), TICK);
        assert_eq!(held, SwitchOrder::Keep, "a stick is pushed: disarmed as before");
    }
}
