//! Who may arm, and when: by a turn of the remote control's right switch, while nothing else asks for a motion.

use drivetrain::motor::{ArmingSwitch, SwitchOrder};
use drivetrain::time::Tick;
use drivetrain::wire::dbus::{Remote, Switch};

/// The right switch of the remote control: on at the top.
#[derive(Debug, Default)]
pub struct Gesture(ArmingSwitch);

impl Gesture {
    /// Returns what the switch asks for; to be called once a tick. A turn to the top arms nothing while a stick is held, or anything else
    /// asks for a motion.
    pub fn read(&mut self, remote: &Remote, is_at_rest: bool, tick: Tick) -> SwitchOrder {
        let is_at_rest = is_at_rest && asks_for_nothing(remote);
        self.0.read(remote.right_switch.is_at(Switch::Up), is_at_rest, tick)
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
