use crate::motor::TargetError;

/// Status of a chassis, besides its motion.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{Chassis, Omni};
/// use drivetrain::time::{Instant, Tick};
///
/// let mut chassis = Chassis::new(Omni::three(0.05, 0.2)?);
/// let _ = chassis.update([None; 3], Tick::new(Instant::from_micros(1_000), 0.001));
/// let status = chassis.status();
/// assert_eq!((status.motion_known, status.lost_wheels), (false, 3));
/// assert_eq!(status.blind_s, 0.001);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChassisStatus {
    /// The motion of the last tick was measured: by all wheels, or by the others while [`lost_wheels`](Self::lost_wheels) is
    /// above zero. With too few wheels the motion is unknown: the position stands still; a gyroscope's heading continues.
    pub motion_known: bool,
    /// Wheels without feedback in the last tick; a velocity or an angle that is NaN or infinite is no feedback.
    pub lost_wheels: u8,
    /// Seconds without a known motion, in all.
    pub blind_s: f32,
    /// Largest contradiction between the wheels of the last tick in m/s; `None` while a wheel is lost, because the
    /// others then determine too little. Never NaN: `f32::MAX` on overflow.
    pub slip_m_s: Option<f32>,
    /// The last tick ran without a fresh command, or the clock is dead.
    pub command_stale: bool,
    /// The wheels' speed limit slowed the chassis in the last tick.
    pub saturated: bool,
    /// Commands, headings and poses that were NaN or infinite, in all; a command and its heading count once.
    pub rejected: u16,
    /// Wheels with a motor that refused its target in the last [`drive`](super::Chassis::drive).
    pub refused: u8,
    /// Why the first of them did.
    pub refusal: Option<TargetError>,
}
