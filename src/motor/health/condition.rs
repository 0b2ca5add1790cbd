/// What can be wrong with one motor.
///
/// | condition | it holds while | the motor |
/// |---|---|---|
/// | [`Late`](Self::Late) | there is no fresh feedback | is safe, and goes on by itself |
/// | [`Offline`](Self::Offline) | it is lost, until ten good frames came in a row | is relaxed |
/// | [`PositionUncertain`](Self::PositionUncertain) | turns may have been missed, until the position is set | goes on |
/// | [`Warning`](Self::Warning) | the ESC reports a warning | goes on |
/// | [`Fault`](Self::Fault) | the ESC reports a fault | is relaxed |
/// | [`Warm`](Self::Warm) | it is above its warning temperature | has less output |
/// | [`Hot`](Self::Hot) | it is above its limit temperature | has none |
/// | [`Stalled`](Self::Stalled) | it is driven and does not turn | as configured; goes on |
/// | [`Runaway`](Self::Runaway) | it sped up against its command, until it is armed | is relaxed |
/// | [`Frozen`](Self::Frozen) | its feedback contradicts itself by standing still | as configured; goes on |
/// | [`Overspeed`](Self::Overspeed) | it reports more than twice its speed without load | goes on |
/// | [`DuplicateId`](Self::DuplicateId) | two motors answer with its id | is relaxed |
/// | [`SoftLimit`](Self::SoftLimit) | it is at or outside of a soft limit | turns inward only |
/// | [`CommandLost`](Self::CommandLost) | the application let its target grow too old | is relaxed, until the next target |
/// | [`SecondMaster`](Self::SecondMaster) | another node sends its command frame | as configured; goes on |
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
#[repr(u8)]
pub enum Condition {
    /// No fresh feedback.
    Late,
    /// Lost.
    Offline,
    /// Rotor turns may have been missed.
    PositionUncertain,
    /// The ESC reports a warning.
    Warning,
    /// The ESC reports a fault.
    Fault,
    /// Above the warning temperature.
    Warm,
    /// Above the limit temperature.
    Hot,
    /// Driven, and does not turn.
    Stalled,
    /// Speeds up without or against its command.
    Runaway,
    /// Feedback that stands still and cannot be true.
    Frozen,
    /// More than twice the speed without load.
    Overspeed,
    /// Two motors answer with one id.
    DuplicateId,
    /// At or outside of a soft limit.
    SoftLimit,
    /// The application set no target in time.
    CommandLost,
    /// Another node sends the command frame.
    SecondMaster,
    /// The last update did not lie after the one before: the clock stands or went back. The motor trips.
    ClockFault,
}

impl Condition {
    /// All of them.
    pub const ALL: [Self; 16] = [
        Self::Late,
        Self::Offline,
        Self::PositionUncertain,
        Self::Warning,
        Self::Fault,
        Self::Warm,
        Self::Hot,
        Self::Stalled,
        Self::Runaway,
        Self::Frozen,
        Self::Overspeed,
        Self::DuplicateId,
        Self::SoftLimit,
        Self::CommandLost,
        Self::SecondMaster,
        Self::ClockFault,
    ];

    /// Returns it in the words of a log line.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::Offline => "offline",
            Self::PositionUncertain => "position uncertain",
            Self::Warning => "ESC warning",
            Self::Fault => "ESC fault",
            Self::Warm => "warm",
            Self::Hot => "hot",
            Self::Stalled => "stalled",
            Self::Runaway => "runaway",
            Self::Frozen => "frozen feedback",
            Self::Overspeed => "overspeed",
            Self::DuplicateId => "duplicate id",
            Self::SoftLimit => "soft limit",
            Self::CommandLost => "command lost",
            Self::SecondMaster => "second master",
            Self::ClockFault => "clock fault",
        }
    }

    const fn bit(self) -> u16 {
        1 << self as u8
    }
}

impl core::fmt::Display for Condition {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

/// A set of conditions, in 16 bits.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Condition, Conditions};
///
/// let conditions = Conditions::NONE.with(Condition::Stalled).with(Condition::Warm);
/// assert!(conditions.contains(Condition::Warm));
/// assert_eq!(conditions.iter().count(), 2);
/// assert_eq!(conditions.to_string(), "warm, stalled");
/// assert_eq!(Conditions::NONE.to_string(), "healthy");
/// ```
#[derive(Default, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Conditions(u16);

impl Conditions {
    /// None of them: healthy.
    pub const NONE: Self = Self(0);

    /// Adds one.
    #[must_use]
    pub const fn with(self, condition: Condition) -> Self {
        Self(self.0 | condition.bit())
    }

    /// Takes one away.
    #[must_use]
    pub const fn without(self, condition: Condition) -> Self {
        Self(self.0 & !condition.bit())
    }

    /// Tells whether one is among them.
    #[must_use]
    pub const fn contains(self, condition: Condition) -> bool {
        self.0 & condition.bit() != 0
    }

    /// Tells whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Iterates over them, in the order of [`Condition::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Condition> {
        let mut left = self.0;
        core::iter::from_fn(move || {
            // Behind the last bit there is no condition.
            let first = Condition::ALL.get(left.trailing_zeros() as usize)?;
            left &= left.wrapping_sub(1);
            Some(*first)
        })
    }

    /// Returns those that are in both.
    pub(crate) const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Returns those that are in one of them.
    pub(crate) const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns those that are in this set and not in the other.
    pub(crate) const fn minus(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

impl core::fmt::Debug for Conditions {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// Names them in one line, separated by commas.
impl core::fmt::Display for Conditions {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.is_empty() {
            return f.write_str("healthy");
        }
        for (index, condition) in self.iter().enumerate() {
            write!(f, "{}{condition}", if index == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Conditions {
    fn format(&self, f: defmt::Formatter<'_>) {
        if self.is_empty() {
            return defmt::write!(f, "healthy");
        }
        for (index, condition) in self.iter().enumerate() {
            let separator = if index == 0 { "" } else { ", " };
            defmt::write!(f, "{=str}{=str}", separator, condition.as_str());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn each_condition_has_a_bit_and_a_name_of_its_own() {
        let all = Condition::ALL.into_iter().fold(Conditions::NONE, Conditions::with);
        assert_eq!(all.iter().count(), Condition::ALL.len());
        for condition in Condition::ALL {
            let others = all.without(condition);
            assert!(!others.contains(condition) && others.iter().count() == 15);
            assert!(!others.to_string().contains(condition.as_str()), "{condition}");
        }
    }
}
