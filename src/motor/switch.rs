//! The switch by which a person arms.

use crate::time::{Duration, Instant, Tick};

/// The switch by which a person arms a robot: a turn from off to on asks to arm, unless a stick is held, since the robot would leap.
///
/// The position is unknown while a remote control is not heard. If the switch was turned on before, the robot [brakes](SwitchOrder::Brake) for a
/// second, and is disarmed: a stop of category 1 in IEC 60204-1. Disarmed at once, a robot rolls on for metres. The switch has to be turned off
/// first if the switch is on at power-on, after the reset of a watchdog, or when the remote control is heard again, or was turned on with a stick
/// held.
///
/// # Examples
/// ```
/// use drivetrain::motor::{ArmingSwitch, SwitchOrder};
/// use drivetrain::time::{Instant, Tick};
///
/// let at_ms = |ms: u64| Tick::new(Instant::from_micros(ms * 1_000), 0.001);
/// let mut switch = ArmingSwitch::new();
/// assert_eq!(switch.read(Some(true), true, at_ms(1)), SwitchOrder::Keep); // on at power-on: disarmed, as it was
/// assert_eq!(switch.read(Some(false), true, at_ms(2)), SwitchOrder::Disarm);
/// assert_eq!(switch.read(Some(true), true, at_ms(3)), SwitchOrder::Arm); // with the sticks at rest
/// assert_eq!(switch.read(None, true, at_ms(4)), SwitchOrder::Brake); // not heard
/// assert_eq!(switch.read(Some(true), true, at_ms(1_004)), SwitchOrder::Disarm); // heard again, and nobody has turned the switch
/// assert_eq!(switch.read(Some(true), true, at_ms(1_005)), SwitchOrder::Keep);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ArmingSwitch {
    position: SwitchPosition,
}

/// The position of a switch, as far as it counts.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum SwitchPosition {
    /// Not known, or on without a turn.
    #[default]
    Unknown,
    Off,
    /// Turned on.
    On,
    /// Not known from this time on, and turned on before.
    Lost(Instant),
}

impl ArmingSwitch {
    /// How long a robot brakes before it is disarmed.
    const BRAKING: Duration = Duration::from_secs(1);

    /// Makes a switch whose position was not read yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { position: SwitchPosition::Unknown }
    }

    /// Takes the position of the switch once a tick: on, off, or `None` while the position is not known. `sticks_rest` is `false` while a stick,
    /// or anything else, asks for a motion: a turn of the switch then arms nothing.
    #[must_use]
    pub fn read(&mut self, is_on: Option<bool>, sticks_rest: bool, tick: Tick) -> SwitchOrder {
        use SwitchPosition::{Lost, Off, On, Unknown};
        let now = tick.now();
        let (position, order) = match (self.position, is_on) {
            (_, Some(false)) => (Off, SwitchOrder::Disarm),
            (Off, Some(true)) if sticks_rest => (On, SwitchOrder::Arm),
            (Off, Some(true)) => (Unknown, SwitchOrder::Keep),
            (Unknown | On, Some(true)) => (self.position, SwitchOrder::Keep),
            (On, None) => (Lost(now), SwitchOrder::Brake),
            (Lost(from), _) if from <= now && now.since(from) < Self::BRAKING => {
                (self.position, SwitchOrder::Brake)
            }
            _ => (Unknown, SwitchOrder::Disarm),
        };
        self.position = position;
        order
    }
}

/// What an [`ArmingSwitch`] asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SwitchOrder {
    /// The switch was turned on just now, and nothing asks for a motion.
    Arm,
    /// The switch is on as before, or was turned on with a stick held: armed motors stay armed, and others disarmed.
    Keep,
    /// The position of a switch that was turned on was lost less than a second ago: armed motors stay armed, and get the targets of a robot
    /// that stands.
    Brake,
    /// The switch is off; its position is not known, and it was not turned on before; or its position was lost a second ago.
    Disarm,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_switch_turned_on_with_a_stick_held_arms_nothing_until_it_is_turned_anew() {
        let mut switch = ArmingSwitch::new();
        let (on, off, at_rest) = (Some(true), Some(false), true);
        let mut orders = [(off, !at_rest), (on, !at_rest), (on, at_rest), (None, at_rest)]
            .into_iter()
            .chain([(off, at_rest), (on, at_rest), (on, !at_rest), (None, !at_rest)])
            .map(|(is_on, is_at_rest)| {
                switch.read(is_on, is_at_rest, Tick::new(Instant::START, 0.001))
            });
        let (disarm, keep) = (SwitchOrder::Disarm, SwitchOrder::Keep);
        for order in
            [disarm, keep, keep, disarm, disarm, SwitchOrder::Arm, keep, SwitchOrder::Brake]
        {
            assert_eq!(orders.next(), Some(order));
        }
    }
}
