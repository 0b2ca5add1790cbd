//! Reasons against arming: missing motors, settings that differ, and all others; and the order in which a request is refused.

#[cfg(feature = "hal")]
use super::Guard;
use super::{BusLoad, Claim, Condition, Conditions, MotorGuard, MotorName};

/// The motors that prevent arming, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Missing {
    names: [Option<MotorName>; Self::CAPACITY],
    total: u16,
    full_bus: Option<u16>,
    /// Received frames wait in the driver.
    has_waiting: bool,
    /// The conditions of the motors that have feedback and are not fit to be driven.
    conditions: Conditions,
}

impl Missing {
    /// How many names are kept; the others are only counted.
    pub const CAPACITY: usize = 12;

    /// Collects names; `None` without any.
    pub fn collect(names: impl Iterator<Item = MotorName>) -> Option<Self> {
        let mut missing = Self::NONE;
        missing.extend(names);
        (missing.total > 0).then_some(missing)
    }

    pub(crate) fn extend(&mut self, names: impl Iterator<Item = MotorName>) {
        names.for_each(|name| self.add(name));
    }

    const NONE: Self = Self {
        names: [None; Self::CAPACITY],
        total: 0,
        full_bus: None,
        has_waiting: false,
        conditions: Conditions::NONE,
    };

    pub(crate) fn extend_unfit(&mut self, motors: impl Iterator<Item = (MotorName, Conditions)>) {
        for (name, conditions) in motors {
            self.add(name);
            self.conditions = self.conditions.or(conditions);
        }
    }

    /// Keeps the load of the bus if the bus may be full, and whether received frames wait in the driver.
    fn on_bus(self, load: Option<BusLoad>, has_waiting: bool) -> Self {
        Self { full_bus: load.and_then(BusLoad::of_full_bus), has_waiting, ..self }
    }

    /// Says what to do about drives as delivered.
    fn advise(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.conditions.contains(Condition::DuplicateId) {
            f.write_str(
                "; two drives answer with one id: connect one at a time, and give each an id",
            )?;
        }
        Ok(())
    }

    fn add(&mut self, name: MotorName) {
        if let Some(place) = self.names.get_mut(usize::from(self.total)) {
            *place = Some(name);
        }
        self.total = self.total.saturating_add(1);
    }

    /// Iterates over the kept names.
    pub fn names(&self) -> impl Iterator<Item = MotorName> + '_ {
        self.names.iter().flatten().copied()
    }

    /// Returns the load in percent, 100 or more, of a bus that may be too full for the feedback of every motor: the measured worst case, rounded
    /// up. `None` if the bus has room, or its load is not known: [`Runner::arm`](crate::runner::Runner::arm) knows it from the second second on.
    #[must_use]
    pub const fn full_bus(&self) -> Option<u16> {
        self.full_bus
    }

    /// Returns how many motors are missing.
    #[must_use]
    pub const fn total(&self) -> u16 {
        self.total
    }
}

impl core::fmt::Display for Missing {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        for (index, name) in self.names().enumerate() {
            write!(f, "{}{name}", if index == 0 { "" } else { ", " })?;
        }
        match usize::from(self.total).saturating_sub(Self::CAPACITY) {
            0 => {}
            more => write!(f, " and {more} more")?,
        }
        if self.has_waiting {
            f.write_str("; received frames wait: poll oftener, with a larger budget, or set the period of the loop (with_period)")?;
        }
        let Some(load) = self.full_bus else { return Ok(()) };
        write!(
            f,
            "; the bus may be full (load up to {load} %): lower the feedback rate or use a second bus"
        )
    }
}

/// Why a device was not armed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ArmError {
    /// These motors send no fresh feedback.
    Missing(Missing),
    /// Two motors of different owners use one CAN id.
    Clash(Claim, Claim),
    /// The emergency stop is set: `clear_emergency_stop` first.
    Stopped,
    /// Another node sends a command frame of this device.
    SecondMaster(Claim),
    /// These motors report a fault, or run away, or share an id with another. Their `Health` has the code.
    Faulty(Missing),
    /// The drive of a motor is not set up as the program expects.
    Setting(WrongSetting),
    /// There is no motor to arm.
    NoMotors,
    /// The driver takes no frames.
    BusDown,
    /// A motor was relaxed since it was armed, and the last request to arm, or the relaxing, lies less than 100 ms back. A request repeated in
    /// each tick is one request, and is not granted. Only updates with advancing time count.
    NotReleased,
}

impl core::fmt::Display for ArmError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Missing(missing) => {
                write!(f, "no feedback from {missing}")?;
                missing.advise(f)
            }
            Self::Clash(one, other) => write!(f, "{one} clashes with {other}"),
            Self::SecondMaster(claim) => write!(f, "another node sends the {claim}"),
            Self::Faulty(motors) => {
                write!(f, "not fit to be driven, see health(): {motors} ({})", motors.conditions)?;
                motors.advise(f)
            }
            Self::Setting(wrong) => write!(f, "{wrong}"),
            Self::Stopped => f.write_str("the emergency stop is set: call clear_emergency_stop"),
            Self::NoMotors => f.write_str("no motor is attached"),
            Self::BusDown => f.write_str("the CAN driver takes no frames"),
            Self::NotReleased => f.write_str(
                "a motor was relaxed since it was armed: release the request to arm for 100 ms of a clock that moves on, then arm again",
            ),
        }
    }
}

impl core::error::Error for ArmError {}

impl ArmError {
    /// Returns the refusal for a reason around the devices: a set emergency stop, or a driver that takes no frames.
    pub(crate) const fn around(is_stopped: bool, is_bus_down: bool) -> Option<Self> {
        if is_stopped {
            Some(Self::Stopped)
        } else if is_bus_down {
            Some(Self::BusDown)
        } else {
            None
        }
    }

    /// Keeps for motors that are missing the load of the bus, if the bus may be full, and whether received frames wait.
    pub(crate) fn on_bus(self, load: Option<BusLoad>, has_waiting: bool) -> Self {
        match self {
            Self::Missing(missing) => Self::Missing(missing.on_bus(load, has_waiting)),
            other => other,
        }
    }
}

/// The reasons against arming some motors, beside the emergency stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Obstacles {
    pub(crate) has_motors: bool,
    pub(crate) clash: Option<(Claim, Claim)>,
    pub(crate) missing: Missing,
    pub(crate) second_master: Option<Claim>,
    pub(crate) faulty: Missing,
    pub(crate) wrong_setting: Option<WrongSetting>,
}

impl Obstacles {
    /// Checks a request to arm. The reasons against arming come in this order, for all devices: the emergency stop, no motor, a clash of
    /// ids, another setting, missing feedback, a second master, a fault, a setting not known yet, and a request that is
    /// [not granted](crate::motor::safety::DeviceGuard::ask). If the stop is set, `survey` is not called.
    ///
    /// # Errors
    /// The first reason.
    pub(crate) fn check(
        is_stopped: bool,
        granted: bool,
        survey: impl FnOnce(&mut Self),
    ) -> Result<(), ArmError> {
        if is_stopped {
            return Err(ArmError::Stopped);
        }
        let mut found = Self {
            has_motors: true,
            clash: None,
            missing: Missing::NONE,
            second_master: None,
            faulty: Missing::NONE,
            wrong_setting: None,
        };
        survey(&mut found);
        found.refusal(granted)
    }

    /// As [`check`](Self::check) for one motor outside of the devices: takes the request. `missing` is the motor, if its feedback is
    /// [missing](super::Guard::is_missing).
    ///
    /// # Errors
    /// The first reason.
    #[cfg(feature = "hal")]
    pub(crate) fn check_one(guard: &mut Guard, missing: Option<MotorName>) -> Result<(), ArmError> {
        let (granted, is_stopped) = (guard.ask(), guard.is_stopped());
        Self::check(is_stopped, granted, |found| found.missing.extend(missing.into_iter()))
    }

    #[inline] // A program that reads no names has no code for them.
    fn refusal(&self, granted: bool) -> Result<(), ArmError> {
        if !self.has_motors {
            return Err(ArmError::NoMotors);
        }
        if let Some((one, other)) = self.clash {
            return Err(ArmError::Clash(one, other));
        }
        // A drive set up for other commands may answer none of ours.
        if let Some(wrong) = self.wrong_setting.filter(|wrong| wrong.found.is_some()) {
            return Err(ArmError::Setting(wrong));
        }
        if self.missing.total > 0 {
            // Of two drives with one id, the motor of the other has no feedback.
            let conditions = self.faulty.conditions;
            return Err(ArmError::Missing(Missing { conditions, ..self.missing }));
        }
        if let Some(claim) = self.second_master {
            return Err(ArmError::SecondMaster(claim));
        }
        if self.faulty.total > 0 {
            return Err(ArmError::Faulty(self.faulty));
        }
        if let Some(wrong) = self.wrong_setting {
            return Err(ArmError::Setting(wrong));
        }
        if granted { Ok(()) } else { Err(ArmError::NotReleased) }
    }
}

/// Tells whether there are motors, and all take targets.
pub(crate) fn are_armed<'a>(motors: impl Iterator<Item = &'a MotorGuard>) -> bool {
    let mut motors = motors.peekable();
    motors.peek().is_some() && motors.all(MotorGuard::is_armed)
}

/// A setting of a drive that prevents arming: the setting differs from the expected value, or is not known.
///
/// # Examples
/// ```
/// use drivetrain::motor::{MotorName, WrongSetting};
///
/// let wrong = WrongSetting {
///     motor: MotorName::new("DM-J4310", 1),
///     setting: "CTRL_MODE",
///     expected: 1.0,
///     found: Some(2.0),
/// };
/// assert_eq!(wrong.to_string(), "DM-J4310 #1 has CTRL_MODE 2, the program needs 1: write it, or change the configuration");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WrongSetting {
    /// The motor.
    pub motor: MotorName,
    /// The name of the setting in the manual of the drive.
    pub setting: &'static str,
    /// The value in the configuration of the motor, in the unit of the manual.
    pub expected: f32,
    /// The value in the drive; `None` if the value is not known yet, NaN if the drive did not answer on the way to be enabled, or
    /// does not have the setting.
    pub found: Option<f32>,
}

impl WrongSetting {
    pub(crate) const fn new(
        motor: MotorName,
        setting: &'static str,
        expected: f32,
        found: Option<f32>,
    ) -> Self {
        Self { motor, setting, expected, found }
    }
}

impl core::fmt::Display for WrongSetting {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { motor, setting, expected, found } = self;
        match found {
            Some(found) if found.is_nan() => write!(
                f,
                "{motor} does not report its {setting}, the program needs {expected}: set it with the tool of the drive, or change the configuration"
            ),
            Some(found) => write!(
                f,
                "{motor} has {setting} {found}, the program needs {expected}: write it, or change the configuration"
            ),
            None => write!(f, "{motor}: its {setting} is not known yet, ask again"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_refusal_says_what_to_do() {
        let doubled = Conditions::NONE.with(Condition::DuplicateId);
        let mut faulty = Missing::NONE;
        faulty.extend_unfit([(MotorName::new("DM-J8009", 5), doubled)].into_iter());
        for (error, remedy) in [
            (ArmError::Stopped, "clear_emergency_stop"),
            (ArmError::NotReleased, "a clock that moves on"),
            (ArmError::Faulty(faulty), "see health(): DM-J8009 #5 (duplicate id); two drives"),
            (ArmError::Missing(faulty), "DM-J8009 #5; two drives answer with one id: connect one"),
        ] {
            assert!(error.to_string().contains(remedy), "{error}");
        }
    }

    #[test]
    fn the_missing_are_named_up_to_the_capacity_and_counted_beyond() {
        let names = |count| (1..=count).map(|id| MotorName::new("M3508", id));
        assert_eq!(Missing::collect(names(0)), None);
        let two = Missing::collect(names(2)).unwrap();
        assert_eq!(ArmError::Missing(two).to_string(), "no feedback from M3508 #1, M3508 #2");
        let many = Missing::collect(names(15)).unwrap();
        assert_eq!((many.names().count(), many.total()), (12, 15));
        assert!(many.to_string().ends_with("M3508 #12 and 3 more"));
    }
}
