//! Who may arm, and when: by a turn of the remote control's right switch, while nothing else asks for a motion.

use drivetrain::wire::dbus::{Remote, Switch};

/// What the remote control asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    /// The switch was turned to the top just now.
    Arm,
    /// It still is there.
    GoOn,
    /// It is not, or the remote control is not heard.
    Rest,
}

/// The switch as it was in the cycle before.
#[derive(Debug, Default)]
pub struct Gesture(Switch);

impl Gesture {
    /// Returns what the remote control asks for; to be called once a tick.
    pub fn wish(&mut self, remote: &Remote) -> Wish {
        match (core::mem::replace(&mut self.0, remote.right_switch), remote.right_switch) {
            (Switch::Up, Switch::Up) => Wish::GoOn,
            // The turn of the switch, not its place: a remote that comes back in range must not start a robot.
            (Switch::Middle | Switch::Down, Switch::Up) if asks_for_nothing(remote) => Wish::Arm,
            _ => Wish::Rest,
        }
    }
}

/// Tells whether both sticks are let go, and the left switch is in its middle: elsewhere it shoots, or spins a chassis.
fn asks_for_nothing(remote: &Remote) -> bool {
    at_rest(remote) && remote.left_switch == Switch::Middle
}

/// Tells whether both sticks are let go.
pub fn at_rest(remote: &Remote) -> bool {
    [remote.right_x, remote.right_y, remote.left_x, remote.left_y].iter().all(|share| *share == 0.0)
}
