//! Who may arm, and when: by a turn of the remote control's right switch, while nothing else asks for a motion.

use drivetrain::motor::{ArmingSwitch, SwitchOrder};
use drivetrain::time::Tick;
use drivetrain::wire::dbus::{Remote, Switch};

/// The right switch of the remote control: on at the top.
#[derive(Debug, Default)]
pub struct Gesture(ArmingSwitch);

impl Gesture {
    /// Returns what the switch asks for; to be called once a tick. A turn to the top while a stick is held arms nothing.
    pub fn read(&mut self, remote: &Remote, tick: Tick) -> SwitchOrder {
        match self.0.read(remote.right_switch.is_at(Switch::Up), tick) {
            SwitchOrder::Arm if !asks_for_nothing(remote) => SwitchOrder::Keep,
            order => order,
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
