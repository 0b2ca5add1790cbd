/// A kind of target for a motor, or a quantity in the feedback of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Capability {
    /// The motor takes a direct command on its own scale: the word on the wire, a duty, a throttle.
    Raw,
    /// The motor takes a torque current.
    Current,
    /// The motor takes a voltage.
    Voltage,
    /// The motor takes a torque of the output shaft.
    Torque,
    /// The motor takes a velocity of the output shaft.
    Velocity,
    /// The motor takes an angle within a turn, and moves there by the shortest way.
    Angle,
    /// The motor takes a position over many turns.
    Position,
    /// The motor takes a position, a velocity and a torque with a stiffness and a damping:
    /// [`Impedance`](super::Impedance).
    Impedance,
    /// The motor reports the state of its shaft, and so can be missing.
    Feedback,
    /// The motor reports its temperature.
    Temperature,
    /// The motor reports its errors.
    ErrorCodes,
    /// The motor knows the angle of its output shaft at power-on, without being homed.
    AbsoluteAngle,
}

impl Capability {
    /// All of them: the targets first.
    pub const ALL: [Self; 12] = [
        Self::Raw,
        Self::Current,
        Self::Voltage,
        Self::Torque,
        Self::Velocity,
        Self::Angle,
        Self::Position,
        Self::Impedance,
        Self::Feedback,
        Self::Temperature,
        Self::ErrorCodes,
        Self::AbsoluteAngle,
    ];

    /// Returns whether this is a kind of target; otherwise, a quantity reported by the motor.
    #[must_use]
    pub const fn is_target(self) -> bool {
        (self as u16) < Self::Feedback as u16
    }
}

impl core::fmt::Display for Capability {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Raw => "raw",
            Self::Current => "current",
            Self::Voltage => "voltage",
            Self::Torque => "torque",
            Self::Velocity => "velocity",
            Self::Angle => "angle",
            Self::Position => "position",
            Self::Impedance => "impedance",
            Self::Feedback => "feedback",
            Self::Temperature => "temperature",
            Self::ErrorCodes => "error codes",
            Self::AbsoluteAngle => "absolute angle",
        })
    }
}

/// The capabilities of a motor in its configuration: a set of [`Capability`].
///
/// A target outside of the set is refused with an error when set: `Unsupported` if the motor has no such target,
/// `NoLoop` if the motor was attached without the loop.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Capabilities, Capability};
///
/// const SERVO: Capabilities = Capabilities::of(&[Capability::Raw, Capability::Position]);
/// assert!(SERVO.has(Capability::Position) && !SERVO.has(Capability::Temperature));
/// assert_eq!(SERVO.with(Capability::Temperature).to_string(), "raw, position, temperature");
/// assert_eq!(SERVO.iter().filter(|it| it.is_target()).count(), 2);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Capabilities(u16);

impl Capabilities {
    /// No capability: a detached motor.
    pub const NONE: Self = Self(0);

    /// Collects a list.
    #[must_use]
    pub const fn of(list: &[Capability]) -> Self {
        let (mut set, mut rest) = (Self::NONE, list);
        while let [first, others @ ..] = rest {
            set = set.with(*first);
            rest = others;
        }
        set
    }

    /// Adds a capability.
    #[must_use]
    pub const fn with(self, capability: Capability) -> Self {
        Self(self.0 | 1 << capability as u16)
    }

    /// Adds the capabilities of another set.
    pub(crate) const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns whether a capability is in the set.
    #[must_use]
    pub const fn has(self, capability: Capability) -> bool {
        self.0 & 1 << capability as u16 != 0
    }

    /// Iterates over them, the targets first.
    pub fn iter(self) -> impl Iterator<Item = Capability> {
        Capability::ALL.into_iter().filter(move |capability| self.has(*capability))
    }
}

/// Writes their names in a list.
impl core::fmt::Display for Capabilities {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if *self == Self::NONE {
            return f.write_str("nothing");
        }
        for (index, capability) in self.iter().enumerate() {
            write!(f, "{}{capability}", if index == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    #[test]
    fn each_one_is_a_bit_of_its_own_and_comes_back() {
        let all = Capabilities::of(&Capability::ALL);
        assert_eq!(all.iter().collect::<Vec<_>>(), Capability::ALL);
        for one in Capability::ALL {
            let set = Capabilities::NONE.with(one);
            assert!(Capability::ALL.iter().all(|other| set.has(*other) == (*other == one)));
            assert_eq!(set.to_string(), one.to_string());
        }
        assert_eq!(Capabilities::default().to_string(), "nothing");
        assert_eq!(Capability::ALL.iter().filter(|it| it.is_target()).count(), 8);
    }
}
