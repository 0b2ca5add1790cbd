use super::{Heading, Rotation3};
use crate::time::Instant;
use crate::units::AngularVelocity;

/// Orientation of a body, and how fast it turns.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Attitude {
    /// Turns the axes of the body into those of the world, z up.
    pub rotation: Rotation3,
    /// Angular velocity around x, y and z of the body; counter-clockwise is positive.
    pub rates: [AngularVelocity; 3],
}

/// A source of attitude: an IMU that computes it itself, or a chip on the board with a filter.
///
/// A robot that is generic over this trait drives with either. `wire::Receiver<hipnuc::Imu, N>` implements it; for a BMI088 on the board
/// see the package `recipes/imu` of the repository.
///
/// # Examples
/// ```
/// use drivetrain::geometry::{Attitude, AttitudeSource, Rotation3};
/// use drivetrain::time::{Duration, Instant};
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// /// The last attitude of a filter, and when it was computed.
/// struct Filter(Attitude, Instant);
///
/// impl AttitudeSource for Filter {
///     fn attitude(&self, now: Instant) -> Option<Attitude> {
///         (now.since(self.1) <= Duration::from_millis(20)).then_some(self.0)
///     }
/// }
///
/// let rotation = Rotation3::from_roll_pitch_yaw(Angle::ZERO, Angle::ZERO, Angle::from_degrees(30.0));
/// let filter = Filter(Attitude { rotation, rates: [AngularVelocity::ZERO; 3] }, Instant::START);
/// let heading = filter.heading(Instant::START).map(|heading| heading.angle().as_degrees());
/// assert!(heading.is_some_and(|degrees| (degrees - 30.0).abs() < 1e-3));
/// assert_eq!(filter.attitude(Instant::from_micros(20_001)), None); // too old
/// ```
pub trait AttitudeSource {
    /// Returns the attitude at `now`; `None` when the source was silent for longer than its limit, or cannot be trusted.
    fn attitude(&self, now: Instant) -> Option<Attitude>;

    /// Returns the yaw of the attitude: where x of the body points on the floor, counter-clockwise.
    fn heading(&self, now: Instant) -> Option<Heading> {
        let [_, _, yaw] = self.attitude(now)?.rotation.roll_pitch_yaw();
        Some(Heading::new(yaw))
    }
}
