use crate::encoder::Position;
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};

/// Angle and velocity of a shaft by another sensor than the motor's own, for example a gimbal's yaw by an IMU.
///
/// `A` is [`Angle`] for a sensor with an angle within a turn, and [`Position`] for a sensor that counts turns. Angle
/// and velocity are those of one axis, in the motor's positive direction: when the motor turns in this direction and
/// its base stands, both grow.
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
    /// The angle or position.
    pub angle: A,
    /// The velocity.
    pub velocity: AngularVelocity,
    /// Time of the measurement; or of its arrival, after a short way.
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
