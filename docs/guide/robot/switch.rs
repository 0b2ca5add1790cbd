/// The order of the switch to the motors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    Arm,
    Keep,
    Disarm,
}

/// The switch that arms.
#[derive(Debug)]
pub struct Switch {
    was_on: bool,
}

impl Switch {
    /// A switch that is on at power-on, or after a watchdog's reset, arms nothing.
    pub const START: Self = Self { was_on: true };

    /// Takes the position of the switch, once a tick.
    pub const fn read(&mut self, is_on: bool) -> Order {
        let was_on = core::mem::replace(&mut self.was_on, is_on);
        match (was_on, is_on) {
            (_, false) => Order::Disarm,
            (false, true) => Order::Arm,
            (true, true) => Order::Keep,
        }
    }
}

#[test]
fn only_a_switch_that_turns_on_arms() {
    let mut switch = Switch::START;
    let positions = [true, true, false, true, true, false, true];
    let orders = positions.map(|is_on| switch.read(is_on));
    assert_eq!(orders.into_iter().filter(|order| *order == Order::Arm).count(), 2);
    assert_eq!(orders[0], Order::Keep);
}
