//! The snake robot: 12 joints and a gripper on one bus, led by a computer. Neither board nor tasks.

use drivetrain::control::PidConfig;
use drivetrain::dji::{self, Bus, Gm6020Voltage, Handle, M2006};
use drivetrain::encoder::Position;
use drivetrain::snake::{Config, Joint, Joints};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::host_link::{HostCommand, JOINTS, Reset};

/// Three commands may be damaged in a row; they come each 50 ms.
pub const HOST_DEADLINE: Duration = Duration::from_millis(160);
/// An IMU that was not heard for so long has no angle in the telemetry.
pub const IMU_DEADLINE: Duration = Duration::from_millis(50);

/// rad/s per rad, at most 8 rad/s; V per rad/s and V per rad.
const YAW: (PidConfig, PidConfig) =
    (PidConfig::new(15.0, 0.0, 0.0).with_output_limit(8.0), PidConfig::new(1.0, 5.0, 0.0));
/// rad/s per rad, at most 8 rad/s; A per rad/s and A per rad.
const FINGER: (PidConfig, PidConfig) =
    (PidConfig::new(15.0, 0.0, 0.0).with_output_limit(8.0), PidConfig::new(0.8, 4.0, 0.0));

/// All motors on the bus.
pub type Motors = (Joints, Bus);

/// What a task heard, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heard<T> {
    /// The last whole frame.
    pub value: T,
    /// When it was complete.
    pub at: Instant,
}

impl<T: Copy> Heard<T> {
    /// Returns the value, unless it is older than `deadline`.
    pub fn fresh(&self, now: Instant, deadline: Duration) -> Option<T> {
        (now.since(self.at) <= deadline).then_some(self.value)
    }
}

/// What is to be done with the motors, in the tick in which it is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// Take the present positions as zero, then arm.
    Rezero,
    /// Arm.
    Arm,
    /// Go on as before.
    GoOn,
    /// Disarm: the computer wants it, or is silent.
    Rest,
}

/// What happened, for whoever listens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The motors are armed.
    Armed,
    /// Arming was refused.
    Refused,
    /// The motors rest: wanted, the computer is silent, or a motor is lost.
    Rests,
}

/// Positions and speeds, for the telemetry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Of the joints, from their zero.
    pub pulses: [i32; JOINTS],
    /// Of the joints.
    pub rpm: [i8; JOINTS],
    /// Of the gripper, in degrees: GM6020, C610.
    pub gripper_degrees: [i32; 2],
}

/// The robot without its board.
#[derive(Debug)]
pub struct Snake {
    joints: [Joint; JOINTS],
    yaw: Handle<Gm6020Voltage>,
    finger: Handle<M2006>,
    /// As in the last command: a change of it does something, not its value. It is none at power-on, so a robot that was reset
    /// while the computer asks to enable would be armed: see [`Snake::wish`].
    reset: Option<Reset>,
}

impl Snake {
    /// Attaches everything.
    ///
    /// # Errors
    /// When an id is taken.
    pub fn new() -> Result<(Self, Motors), &'static str> {
        const IDS: [u8; JOINTS] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12];
        let mut joints = Joints::new();
        let attached = IDS.map(|id| joints.attach(Config::new(id)).ok());
        // The frames of the gripper leave in each tick: a load of the bus that is always the same.
        let mut bus = Bus::new().with_keep_alive(Duration::from_millis(1));
        let yaw = dji::Config::<Gm6020Voltage>::new(1).position_loop(YAW.0, YAW.1);
        let finger = dji::Config::<M2006>::new(1).position_loop(FINGER.0, FINGER.1);
        let yaw = bus.attach(yaw).map_err(|_| "the yaw motor's id is taken")?;
        let finger = bus.attach(finger).map_err(|_| "the finger's id is taken")?;
        let [first, ..] = attached;
        let first = first.ok_or("a joint's id is taken")?;
        if attached.contains(&None) {
            return Err("a joint's id is taken");
        }
        let joints_of = attached.map(|joint| joint.unwrap_or(first));
        Ok((Self { joints: joints_of, yaw, finger, reset: None }, (joints, bus)))
    }

    /// Returns what the computer asks for; to be called once a tick. `command` is `None` when it is silent.
    ///
    /// The first command after a silence, and after power-on, asks for nothing: only its next change does.
    pub fn wish(&mut self, command: Option<&HostCommand>) -> Wish {
        let Some(command) = command else {
            self.reset = None;
            return Wish::Rest;
        };
        match (self.reset.replace(command.reset), command.reset) {
            (Some(before), Reset::Rezero) if before != Reset::Rezero => Wish::Rezero,
            (Some(before), Reset::Enable) if before != Reset::Enable => Wish::Arm,
            (_, Reset::Disable) => Wish::Rest,
            _ => Wish::GoOn,
        }
    }

    /// Takes the present positions as zero.
    pub fn zero(&self, (joints, bus): &mut Motors) {
        for joint in self.joints {
            // Refused for a joint that was not heard, which then is not armed either.
            _ = joints.zero(joint);
        }
        _ = bus.zero(self.yaw);
        _ = bus.zero(self.finger);
    }

    /// Sets the targets. Those of motors that are not armed are refused, which is harmless; so are those of a joint that lost its zero, which
    /// rests until the computer asks for [`Wish::Rezero`], with the robot in its zero pose.
    pub fn follow(&self, (joints, bus): &mut Motors, command: &HostCommand) {
        let targets = command.speeds_rpm.into_iter().zip(command.positions_pulses);
        for (joint, (rpm, pulses)) in self.joints.into_iter().zip(targets) {
            _ = joints.set_speed(joint, AngularVelocity::from_rpm(rpm.into()));
            _ = joints.set_pulses(joint, pulses);
        }
        let position = |degrees: i16| Position::from_angle(Angle::from_degrees(degrees.into()));
        _ = bus.set_position(self.yaw, position(command.gm6020_position));
        _ = bus.set_position(self.finger, position(command.c610_position));
    }

    /// Returns where everything is; 0 for what was never heard.
    pub fn report(&self, (joints, bus): &Motors) -> Report {
        let states = self.joints.map(|joint| joints.state(joint));
        let degrees = |turns: f32| (turns * 360.0) as i32;
        let yaw = bus.state(self.yaw).map_or(0, |state| degrees(state.position.as_turns()));
        let finger = bus.state(self.finger).map_or(0, |state| degrees(state.position.as_turns()));
        Report {
            pulses: states.map(|state| state.map_or(0, |state| state.pulses)),
            rpm: states.map(|state| state.map_or(0, |state| state.velocity.as_rpm() as i8)),
            gripper_degrees: [yaw, finger],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wishes(resets: &[Option<Reset>]) -> Vec<Wish> {
        let (mut snake, _) = Snake::new().unwrap();
        let command = |reset: Reset| HostCommand { reset, ..HostCommand::default() };
        resets.iter().map(|reset| snake.wish(reset.map(command).as_ref())).collect()
    }

    #[test]
    fn only_a_change_of_the_reset_byte_arms() {
        use Reset::{Disable, Enable, None as Nothing, Rezero};
        assert_eq!(
            wishes(&[Some(Nothing), Some(Enable), Some(Enable)]),
            [Wish::GoOn, Wish::Arm, Wish::GoOn]
        );
        assert_eq!(
            wishes(&[Some(Nothing), Some(Rezero), Some(Disable)]),
            [Wish::GoOn, Wish::Rezero, Wish::Rest]
        );
    }

    #[test]
    fn a_computer_that_asks_to_enable_at_power_on_or_after_a_silence_arms_nothing() {
        use Reset::{Enable, None as Nothing};
        assert_eq!(wishes(&[Some(Enable), Some(Enable)]), [Wish::GoOn, Wish::GoOn]);
        assert_eq!(
            wishes(&[Some(Nothing), Some(Enable), None, Some(Enable), Some(Nothing), Some(Enable)]),
            [Wish::GoOn, Wish::Arm, Wish::Rest, Wish::GoOn, Wish::GoOn, Wish::Arm]
        );
    }

    #[test]
    fn what_was_heard_is_fresh_until_its_deadline() {
        let heard = Heard { value: 7, at: Instant::START };
        let at = |ms| Instant::START + Duration::from_millis(ms);
        assert_eq!(heard.fresh(at(160), HOST_DEADLINE), Some(7));
        assert_eq!(heard.fresh(at(161), HOST_DEADLINE), None);
    }
}
