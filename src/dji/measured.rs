//! Angles by another sensor than the encoder of the motor.

use super::{AnyHandle, Bus};
use crate::encoder::Position;
use crate::motor::{LONGEST_PAUSE, Measured, TargetError};
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};

/// Targets that another sensor measures: a gimbal's yaw that an IMU tells, whatever the chassis under it does.
///
/// **Both loops** run on the measurement: the position loop on its angle, the speed loop on its rate. The rate of the
/// encoder is that against the base; a speed loop on it would hold the gimbal against the chassis, not in the
/// world, and the angle would be off for as long as the chassis turns.
///
/// The measurement counts from its own time: older than [`Timeouts::measured`](crate::motor::Timeouts::measured) it is an
/// error when it is set, and one that becomes so is zero output within a tick, as if the application had stopped. The
/// feedback of the motor has to be fresh as well. Set it in each tick; between two measurements, the last one again.
impl<B> Bus<B> {
    /// Sets the angle that the position loop goes to by another sensor, by the shortest way.
    ///
    /// It needs no encoder that knows its angle. The example `gimbal` is a whole one.
    ///
    /// # Errors
    /// Those of every target; also for a measurement that is too old, lies ahead by as much, or is not finite: the
    /// motor then goes to its safe output at once.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::PidConfig;
    /// use drivetrain::dji::{Bus, Config, Gm6020Voltage};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::{Measured, TargetError};
    /// use drivetrain::time::{Duration, Instant, Tick};
    /// use drivetrain::units::{Angle, AngularVelocity};
    ///
    /// let angle = PidConfig::new(10.0, 0.0, 0.0); // rad/s per rad
    /// let rate = PidConfig::new(2.0, 0.0, 0.0); // V per rad/s
    /// let mut bus = Bus::new();
    /// let config = Config::<Gm6020Voltage>::new(1).position_loop(angle, rate);
    /// let yaw = bus.attach(config.with_opening(Duration::ZERO))?; // for one update
    /// let now = Instant::from_micros(1_000);
    /// bus.ingest(&CanFrame::standard(0x205, [0; 8]).ok_or("not an 11-bit id")?, now);
    /// bus.arm(now)?;
    ///
    /// // 0.1 rad to go, and the gimbal already turns there at 0.5 rad/s in the world.
    /// let imu = Measured {
    ///     angle: Angle::from_radians(0.2),
    ///     velocity: AngularVelocity::from_rad_per_s(0.5),
    ///     at: now,
    /// };
    /// bus.set_angle_measured(yaw, Angle::from_radians(0.3), imu)?;
    /// bus.update(Tick::new(now, 0.001));
    /// let frame = bus.next_frame().ok_or("nothing to send")?;
    /// assert_eq!(format!("{frame:?}"), "1FF [8] 04 12 00 00 00 00 00 00"); // 2 * (10 * 0.1 - 0.5) = 1 V: 1042
    ///
    /// let late = Instant::from_micros(30_000);
    /// bus.ingest(&CanFrame::standard(0x205, [0; 8]).ok_or("not an 11-bit id")?, late);
    /// bus.update(Tick::new(late, 0.001));
    /// let refused = bus.set_angle_measured(yaw, Angle::from_radians(0.3), imu);
    /// assert_eq!(refused, Err(TargetError::StaleMeasurement)); // 29 ms old
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_angle_measured(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        target: Angle,
        measured: Measured<Angle>,
    ) -> Result<(), TargetError> {
        let way = measured.way_to(target);
        self.set_measured(motor.into(), way, measured.velocity, measured.at)
    }

    /// Sets the multi-turn position that the position loop goes to by another sensor.
    ///
    /// # Errors
    /// As [`set_angle_measured`](Self::set_angle_measured).
    pub fn set_position_measured(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        target: Position,
        measured: Measured<Position>,
    ) -> Result<(), TargetError> {
        let way = measured.way_to(target);
        self.set_measured(motor.into(), way, measured.velocity, measured.at)
    }

    fn set_measured(
        &mut self,
        motor: AnyHandle<B>,
        way: Angle,
        velocity: AngularVelocity,
        at: Instant,
    ) -> Result<(), TargetError> {
        let (now, updated, timeouts) =
            (self.guard.now(), self.guard.updated(), *self.guard.timeouts());
        // A stamp of 32 bits alone would be fresh again every 71 minutes.
        let is_ahead = self.guard.is_running() && at.since(updated) > LONGEST_PAUSE;
        let is_far = is_ahead || updated.since(at) > timeouts.measured();
        let at = (!is_far).then(|| at.stamp());
        self.change_at(motor, |slot| {
            slot.set_measured(way.as_radians(), velocity.as_rad_per_s(), at, now, &timeouts)
        })?;
        // It lasts for a shorter time than other targets.
        self.guard.disturb();
        Ok(())
    }
}
