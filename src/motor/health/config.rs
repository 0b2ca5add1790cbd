use super::{Condition, Conditions};
use crate::time::Duration;
use crate::units::Angle;

/// Consequence of a condition at its begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reaction {
    /// Nothing: the condition is not checked.
    Ignore,
    /// An [`Edge`](crate::time::Edge).
    Report,
    /// An edge, and zero output with the loops reset until the motor is armed again.
    Relax,
}

/// Configures the checks of a motor and the reaction to each condition.
///
/// A motor keeps a reference to its configuration, so the configuration is a `static` or a `const`, one for all motors of a kind.
///
/// | check | default |
/// |---|---|
/// | heat | the temperatures of the model: less output from the warning on, zero from the limit on |
/// | stall | half of the full command and more, at 2 % of the no-load speed and less, for 0.5 s: reported |
/// | runaway | 30 % of the no-load speed gained against half of the full command: relaxed |
/// | frozen feedback | for 0.1 s: reported |
/// | speed beyond twice the speed without load | reported |
/// | faults of the ESC, two motors with one id | relaxed |
/// | warnings of the ESC, a second master | reported |
/// | soft limits | none |
///
/// # Examples
/// ```
/// use drivetrain::motor::{Condition, HealthConfig, Reaction};
/// use drivetrain::units::Angle;
///
/// static FEEDER: HealthConfig = HealthConfig::new()
///     .with_stall_hold(0.2)
///     .with_temperatures(70, 90);
/// static PITCH: HealthConfig = HealthConfig::new()
///     .with_soft_limits(Angle::from_degrees(-20.0), Angle::from_degrees(35.0))
///     .with_reaction(Condition::Stalled, Reaction::Relax);
/// assert_eq!(FEEDER.validate(), Ok(()));
/// assert_eq!(PITCH.with_temperatures(90, 70).validate(), Err("health temperatures"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HealthConfig {
    ignored: Conditions,
    relaxing: Conditions,
    temperatures_c: Option<(i16, i16)>,
    stall_effort: f32,
    stall_speed: f32,
    stall_window: u16,
    stall_hold: f32,
    /// Radians of the output shaft.
    pub(crate) soft_limits: Option<(f32, f32)>,
}

impl HealthConfig {
    /// Checks every condition, as in the table above.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            ignored: Conditions::NONE,
            relaxing: Conditions::NONE
                .with(Condition::Fault)
                .with(Condition::Runaway)
                .with(Condition::DuplicateId),
            temperatures_c: None,
            stall_effort: 0.5,
            stall_speed: 0.02,
            stall_window: units(500_000),
            stall_hold: 1.0,
            soft_limits: None,
        }
    }

    /// Sets the reaction to the begin of a condition.
    ///
    /// Late or lost feedback, expired targets, lost time, soft limits and [`Condition::PositionUncertain`] have their own rules: a configuration
    /// with [`Reaction::Ignore`] or [`Reaction::Relax`] for one of these is [refused](Self::validate). If [`Condition::Warm`] is ignored, there is no derating. If [`Condition::Hot`] is ignored, there is
    /// no limit.
    #[must_use]
    pub const fn with_reaction(mut self, condition: Condition, reaction: Reaction) -> Self {
        self.ignored = self.ignored.without(condition);
        self.relaxing = self.relaxing.without(condition);
        match reaction {
            Reaction::Ignore => self.ignored = self.ignored.with(condition),
            Reaction::Report => {}
            Reaction::Relax => self.relaxing = self.relaxing.with(condition),
        }
        self
    }

    /// Replaces the model's temperatures in °C: the output falls from the first on, and is zero at the second. Both conditions end 5 K
    /// lower. No effect for a motor without a reported temperature.
    #[must_use]
    pub const fn with_temperatures(self, warning_c: i16, limit_c: i16) -> Self {
        Self { temperatures_c: Some((warning_c, limit_c)), ..self }
    }

    /// Sets the bounds of a stall: at least this share of the full command and at most this share of the no-load speed, for this time of up
    /// to 60 s.
    #[must_use]
    pub const fn with_stall(self, effort: f32, speed: f32, window: Duration) -> Self {
        let window = match window.micros_u32() {
            Some(micros) if micros <= 60_000_000 => units(micros),
            _ => units(60_000_000),
        };
        Self { stall_effort: effort, stall_speed: speed, stall_window: window, ..self }
    }

    /// Limits the output of a stalled motor to this share of the full command: 0 to 1; 1 by default. The output is full again when the
    /// motor turns, or when the command is below half of this share.
    #[must_use]
    pub const fn with_stall_hold(self, share: f32) -> Self {
        Self { stall_hold: share, ..self }
    }

    /// Sets the positions of the output shaft within which the motor may be driven outward. The positions count turns: a limit of 720° lies
    /// two turns from zero.
    ///
    /// Outside, the motor is driven inward only, also if the shaft starts there; at speed, already a little before. No effect while the
    /// absolute position is unknown: for a geared motor, until the position is set. A motor without CAN refuses soft limits.
    ///
    /// A motor of a [`dji::Bus`](crate::dji::Bus) is held 0.015 rad inside of a limit, under any load and without an edge: a position outside is
    /// that limit, an outward velocity, also that of a position loop, is at most the distance divided by 0.1 s, and an angle whose shortest way
    /// leads out stops there. Beyond, an outward velocity leads back as below. A current or voltage outward is zero at the limit and beyond, so the
    /// shaft coasts; at a speed that the motor cannot brake in the distance left, each target does.
    ///
    /// An [`Actuator`](crate::motor::Actuator) changes each kind of target, and has the edge from 0.02 rad before a limit. A mode that takes
    /// angles, loops of this crate and a stiffness hold a loaded joint at its limit; a damper alone and a torque do not:
    ///
    /// * An angle is reached by the shortest way that stays inside; an angle outside is the limit next to it.
    /// * An outward velocity is at most the distance to the limit divided by 0.1 s. At the limit and beyond, a mode with
    ///   [`Capability::Angle`](crate::motor::Capability::Angle) follows an angle in the place of a velocity, from where the shaft was found: outward
    ///   to the limit, no faster than 0.5 rad/s and than the target; zero holds the angle, and an inward velocity leads it inside. A load
    ///   stretches the spring of a drive by the load divided by the stiffness. The angle leads the shaft by at most 0.25 rad, or the way in 0.2 s
    ///   of a faster inward velocity, so a blocked shaft turns so far at once when it is freed, and a load above a quarter of the stiffness is
    ///   held where it is. Inside, a damper alone follows the velocity again.
    /// * A mode without angles is led back by a velocity, no faster than 0.5 rad/s and than the target. There a velocity of zero stays zero.
    /// * The angle of an impedance is limited, its velocity as in a mode without angles, and its torque as below: the stiffness holds the load, and
    ///   a damper without stiffness holds up to its damping times 0.5 rad/s. A larger load pulls the joint on, and so does any load on a
    ///   damper with a velocity of zero.
    /// * An outward torque falls to zero over the last 0.02 rad, and from half of that velocity on; at a higher velocity it brakes, with at most
    ///   as much torque as the target has. So a small target stops a fast joint late, and a torque of zero never does; neither holds a load.
    /// * Where the drive has no angle, beyond the range of its feedback, the motor rests, armed and without an edge.
    ///
    /// The limits count from the zero of the joint: [given](crate::motor::Actuator::with_zero) or
    /// [set](crate::motor::Actuator::set_present_angle), otherwise that of a drive with
    /// [`Capability::AbsoluteAngle`](crate::motor::Capability::AbsoluteAngle). The joint is within half a turn of the middle of its limits when it is
    /// heard first. Without a zero there are no limits, so a joint can look for its stop.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::damiao::{Model, Motor};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::{CanDevice, Condition, HealthConfig, ImpedanceControl, Actuator};
    /// use drivetrain::time::{Instant, Tick};
    /// use drivetrain::units::Angle;
    ///
    /// static ELBOW: HealthConfig =
    ///     HealthConfig::new().with_soft_limits(Angle::from_radians(-0.5), Angle::from_radians(1.5));
    /// let motor = Motor::new(Model::J4310, 1, ImpedanceControl::new(3.0)?)?;
    /// let mut elbow = Actuator::new(motor).with_health(&ELBOW)?;
    /// let feedback = [0x11, 0x94, 0x7A, 0x7F, 0xF7, 0xFF, 30, 35]; // 2 rad of 12.5
    /// let feedback = CanFrame::standard(0x011, feedback).ok_or("id")?;
    /// for ms in 1..=2 {
    ///     elbow.ingest(&feedback, Instant::from_micros(ms * 1_000));
    ///     elbow.update(Tick::new(Instant::from_micros(ms * 1_000), 0.001));
    /// }
    /// assert!(elbow.health().conditions.contains(Condition::SoftLimit)); // 0.5 rad outside
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn with_soft_limits(self, lower: Angle, upper: Angle) -> Self {
        Self { soft_limits: Some((lower.as_radians(), upper.as_radians())), ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the first unusable parameter.
    pub const fn validate(&self) -> Result<(), &'static str> {
        const OWN_RULES: Conditions = Conditions::NONE
            .with(Condition::Late)
            .with(Condition::Offline)
            .with(Condition::CommandLost)
            .with(Condition::ClockFault)
            .with(Condition::SoftLimit)
            .with(Condition::PositionUncertain);
        if !self.ignored.or(self.relaxing).and(OWN_RULES).is_empty() {
            return Err("health reaction");
        }
        if let Some((warning, limit)) = self.temperatures_c {
            if warning >= limit {
                return Err("health temperatures");
            }
        }
        if !(self.stall_effort > 0.0 && self.stall_effort <= 1.0) {
            return Err("stall effort");
        }
        if !(self.stall_speed > 0.0 && self.stall_speed <= 1.0) {
            return Err("stall speed");
        }
        if !(self.stall_hold >= 0.0 && self.stall_hold <= 1.0) {
            return Err("stall hold");
        }
        if let Some((lower, upper)) = self.soft_limits {
            // Beyond a million turns, f32 does not resolve the angle.
            if !(lower < upper && lower > -6e6 && upper < 6e6) {
                return Err("soft limits");
            }
        }
        Ok(())
    }

    /// Tells whether a motor with these conditions must not be armed.
    pub(crate) const fn forbids(&self, active: Conditions) -> bool {
        const OBSTACLES: Conditions =
            Conditions::NONE.with(Condition::Fault).with(Condition::DuplicateId);
        !active.and(OBSTACLES).and(self.relaxing).is_empty()
    }

    /// Tells whether a motor relaxes: a condition with this reaction began, or the motor must not be armed.
    pub(crate) const fn relaxes(&self, before: Conditions, active: Conditions) -> bool {
        !active.minus(before).and(self.relaxing).is_empty() || self.forbids(active)
    }

    pub(crate) const fn ignores(&self, condition: Condition) -> bool {
        self.ignored.contains(condition)
    }

    pub(crate) const fn temperatures_c(&self) -> Option<(i16, i16)> {
        self.temperatures_c
    }

    pub(crate) const fn stall_effort(&self) -> f32 {
        self.stall_effort
    }

    pub(super) const fn stall_speed(&self) -> f32 {
        self.stall_speed
    }

    pub(super) const fn stall_window(&self) -> u16 {
        self.stall_window
    }

    pub(super) const fn stall_hold(&self) -> f32 {
        self.stall_hold
    }
}

impl Default for HealthConfig {
    fn default() -> Self {
        Self::new()
    }
}

/// Times of the checks are in units of 1.024 ms.
#[expect(clippy::cast_possible_truncation, reason = "60 s at most")]
const fn units(micros: u32) -> u16 {
    (micros >> 10) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_sense_is_named() {
        let config = HealthConfig::new;
        let angle = Angle::from_degrees;
        let window = Duration::from_millis(100);
        for (config, name) in [
            (config().with_temperatures(80, 80), "health temperatures"),
            (config().with_stall(0.0, 0.1, window), "stall effort"),
            (config().with_stall(1.1, 0.1, window), "stall effort"),
            (config().with_stall(f32::NAN, 0.1, window), "stall effort"),
            (config().with_stall(0.5, -0.1, window), "stall speed"),
            (config().with_stall(0.5, f32::NAN, window), "stall speed"),
            (config().with_stall_hold(1.5), "stall hold"),
            (config().with_stall_hold(f32::NAN), "stall hold"),
            (config().with_soft_limits(angle(10.0), angle(10.0)), "soft limits"),
            (config().with_soft_limits(angle(f32::NAN), angle(10.0)), "soft limits"),
            (config().with_soft_limits(angle(0.0), angle(f32::INFINITY)), "soft limits"),
        ] {
            assert_eq!(config.validate(), Err(name));
        }
        assert_eq!(config().validate(), Ok(()));
        assert_eq!(config().with_stall(1.0, 0.5, Duration::MAX).validate(), Ok(()));
    }

    #[test]
    fn what_has_a_rule_of_its_own_has_no_reaction() {
        use Condition::{ClockFault, CommandLost, Late, Offline, PositionUncertain, SoftLimit};
        let own = [Late, Offline, CommandLost, ClockFault, SoftLimit, PositionUncertain];
        for condition in Condition::ALL {
            for reaction in [Reaction::Ignore, Reaction::Relax] {
                let config = HealthConfig::new().with_reaction(condition, reaction);
                assert_eq!(config.validate().is_err(), own.contains(&condition), "{condition}");
            }
        }
    }

    #[test]
    fn the_last_reaction_counts() {
        let stalled = Condition::Stalled;
        let config = HealthConfig::new().with_reaction(stalled, Reaction::Relax);
        let relaxes =
            |config: HealthConfig| config.relaxes(Conditions::NONE, Conditions::NONE.with(stalled));
        assert!(relaxes(config));
        let config = config.with_reaction(stalled, Reaction::Ignore);
        assert!(!relaxes(config) && config.ignores(stalled));
        let config = config.with_reaction(stalled, Reaction::Report);
        assert!(!config.ignores(stalled));
    }
}
