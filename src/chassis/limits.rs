use crate::error::ConfigError;
use crate::geometry::{Twist, World};
use crate::units::AngularVelocity;

/// The longest time for which a command may drive: the deadline of a motor's target, which the chassis renews in each tick.
const MAX_COMMAND_TIMEOUT_S: f32 = 1.0;

/// How fast a chassis may go and change. Everything is off by default but the deadline for commands: 0.1 s.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::ChassisLimits, units::AngularVelocity};
///
/// let limits = ChassisLimits::new()
///     .with_acceleration(3.0, 20.0)
///     .with_wheel_speed(AngularVelocity::from_rpm(450.0));
/// assert!(limits.validate().is_ok());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChassisLimits {
    linear_m_s2: f32,
    angular_rad_s2: f32,
    wheel_rad_s: f32,
    command_timeout_s: f32,
}

impl ChassisLimits {
    /// Nothing limited; commands older than 0.1 s count as zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            linear_m_s2: f32::MAX,
            angular_rad_s2: f32::MAX,
            wheel_rad_s: f32::MAX,
            command_timeout_s: 0.1,
        }
    }

    /// Sets the largest acceleration in m/s² in any direction, and in rad/s². Both above zero.
    ///
    /// One factor shortens the change of the whole motion, turn included, so the change keeps its direction.
    #[must_use]
    pub const fn with_acceleration(self, linear_m_s2: f32, angular_rad_s2: f32) -> Self {
        Self { linear_m_s2, angular_rad_s2, ..self }
    }

    /// Sets the largest speed of a wheel, above zero. All wheels slow down together.
    #[must_use]
    pub const fn with_wheel_speed(self, limit: AngularVelocity) -> Self {
        Self { wheel_rad_s: limit.as_rad_per_s(), ..self }
    }

    /// Sets after how many seconds without a new command the chassis comes to a stop. Above zero, and at most 1 s.
    #[must_use]
    pub const fn with_command_timeout(self, timeout_s: f32) -> Self {
        Self { command_timeout_s: timeout_s, ..self }
    }

    /// Checks all values.
    ///
    /// # Errors
    /// Names the first value that is not above zero, or a command timeout above 1 s: with an infinite time-out, a chassis
    /// whose program is dead would drive for ever.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let named = [
            (self.linear_m_s2, "linear_m_s2"),
            (self.angular_rad_s2, "angular_rad_s2"),
            (self.wheel_rad_s, "wheel speed"),
            (self.command_timeout_s, "command timeout"),
        ];
        for (value, name) in named {
            if value.is_nan() || value <= 0.0 {
                return Err(ConfigError::NotAboveZero(name));
            }
        }
        let timeout_s = self.command_timeout_s;
        ConfigError::check_limit("command timeout in s", timeout_s, MAX_COMMAND_TIMEOUT_S)
    }

    pub(super) const fn wheel_speed(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(self.wheel_rad_s)
    }

    pub(super) const fn command_timeout_s(&self) -> f32 {
        self.command_timeout_s
    }

    /// Moves `from` towards `to` as far as `dt_s` allows: without time nothing moves, limited or not.
    pub(super) fn approach(&self, from: Twist<World>, to: Twist<World>, dt_s: f32) -> Twist<World> {
        if dt_s <= 0.0 {
            return from;
        }
        let change = to - from;
        let linear = share(change.linear().norm(), self.linear_m_s2, dt_s);
        let angular = share(change.wz_rad_s.abs(), self.angular_rad_s2, dt_s);
        let share = if linear < angular { linear } else { angular };
        if share < 1.0 { from + change * share } else { to }
    }
}

/// How much of a change fits into a step.
fn share(change: f32, limit: f32, dt_s: f32) -> f32 {
    if limit >= f32::MAX || change <= limit * dt_s { 1.0 } else { limit * dt_s / change }
}

impl Default for ChassisLimits {
    fn default() -> Self {
        Self::new()
    }
}
