use crate::encoder::Position;
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};

/// Where a shaft is and how fast it turns, by another sensor than the motor's own: a gimbal's yaw by an IMU.
///
/// `A` is [`Angle`] where the sensor tells an angle within a turn, and [`Position`] where it counts turns. Angle and
/// velocity are those of one axis, in the motor's positive direction: when the motor turns it that way and its
/// base stands, both grow.
///
/// # Examples
/// ```
/// use drivetrain::motor::Measured;
/// use drivetrain::time::Instant;
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let yaw = Measured {
///     angle: Angle::from_degrees(350.0),
///     velocity: AngularVelocity::from_degrees_per_s(-12.0),
///     at: Instant::from_micros(1_000),
/// };
/// assert!((yaw.way_to(Angle::from_degrees(10.0)).as_degrees() - 20.0).abs() < 1e-3); // across zero
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Measured<A = Angle> {
    /// Where it is.
    pub angle: A,
    /// How fast it turns.
    pub velocity: AngularVelocity,
    /// When it was measured; or when it arrived, if its way was short.
    pub at: Instant,
}

impl Measured<Angle> {
    /// Returns the shortest way to an angle: within half a turn.
    #[must_use]
    pub fn way_to(&self, target: Angle) -> Angle {
        Angle::from_radians(crate::math::wrap_pi((target - self.angle).as_radians()))
    }
}

impl Measured<Position> {
    /// Returns the way to a position, over many turns.
    #[must_use]
    pub fn way_to(&self, target: Position) -> Angle {
        target - self.angle
    }
}
