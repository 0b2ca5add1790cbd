//! What the application asks of the motors.

use super::slot::DETACHED;
use super::slot::Slot;
use super::{AnyHandle, Bus, Handle, Model};
use crate::control::PidConfig;
use crate::encoder::Position;
use crate::error::ConfigError;
use crate::motor::{AngleDrive, Capabilities, LONGEST_PAUSE, Measured, TargetError, VelocityDrive};
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity, Current, Voltage};

/// Targets. Each replaces the one before, works in RAM only, and counts until the command deadline
/// ([`Timeouts::command`](crate::motor::Timeouts::command)): an application that stops setting targets stops the motor.
///
/// All take the direction of the output shaft, and saturate at the limits of the motor.
///
/// # Errors
/// Each fails, and the value is not kept for later, when the motor is detached, not armed, relaxed by a fault or
/// not heard, when it has not the loop that it needs, and for NaN or infinity, which takes the present target away.
impl<B> Bus<B> {
    /// Sets a torque current.
    ///
    /// # Errors
    /// See above.
    pub fn set_current<M: Model<Command = Current>>(
        &mut self,
        motor: Handle<M, B>,
        current: Current,
    ) -> Result<(), TargetError> {
        self.set(motor.into(), |slot, now| slot.set_output(current.as_amperes(), now))
    }

    /// Sets a terminal voltage, in nominal volts.
    ///
    /// # Errors
    /// See above.
    pub fn set_voltage<M: Model<Command = Voltage>>(
        &mut self,
        motor: Handle<M, B>,
        voltage: Voltage,
    ) -> Result<(), TargetError> {
        self.set(motor.into(), |slot, now| slot.set_output(voltage.as_volts(), now))
    }

    /// Sets the command on the wire's own scale.
    ///
    /// # Errors
    /// See above.
    pub fn set_raw(&mut self, motor: impl Into<AnyHandle<B>>, raw: i16) -> Result<(), TargetError> {
        self.set(motor.into(), |slot, now| slot.set_raw(raw, now))
    }

    /// Sets the velocity that the speed loop follows.
    ///
    /// Costs 39 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// See above.
    #[inline]
    pub fn set_velocity(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        velocity: AngularVelocity,
    ) -> Result<(), TargetError> {
        self.set(motor.into(), |slot, now| slot.set_velocity(velocity.as_rad_per_s(), now))
    }

    /// Sets the absolute angle that the position loop goes to, by the shortest way: 350° to 10° is +20°.
    ///
    /// # Errors
    /// See above; also when the angle of a geared motor is not known, see [`zero`](Self::zero).
    pub fn set_angle(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        angle: Angle,
    ) -> Result<(), TargetError> {
        self.set(motor.into(), |slot, now| slot.set_angle(Position::from_angle(angle), now))
    }

    /// Sets the multi-turn position that the position loop goes to; within the soft limits, where there are some.
    ///
    /// Costs 92 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// See above.
    pub fn set_position(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        position: Position,
    ) -> Result<(), TargetError> {
        self.set(motor.into(), |slot, now| slot.set_position(position, now))
    }

    /// Asks a motor for nothing: zero output from the next update on, loops reset. It stays armed, and frames that wait go
    /// out as they are.
    pub fn relax(&mut self, motor: impl Into<AnyHandle<B>>) {
        if let Some(slot) = self.slot_mut(motor.into()) {
            slot.relax();
        }
    }

    /// Makes the present position of a motor zero: from then on its angle is known.
    ///
    /// A motor that holds an angle or position is relaxed, because its target was given in the old terms.
    ///
    /// # Errors
    /// When the motor is detached, or not heard: where it is now is not known then.
    pub fn zero(&mut self, motor: impl Into<AnyHandle<B>>) -> Result<(), TargetError> {
        self.set_present_position(motor, Position::ZERO)
    }

    /// Calls the present position of a motor `position`; see [`zero`](Self::zero).
    ///
    /// # Errors
    /// As [`zero`](Self::zero); also for NaN or infinity.
    pub fn set_present_position(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        position: Position,
    ) -> Result<(), TargetError> {
        self.change_at(motor.into(), |slot| slot.set_present_position(position))
    }

    /// Changes the speed loop of a motor while it runs, without a jump of its output.
    ///
    /// # Errors
    /// Names the parameter that `attach` would refuse, or the handle of a motor that was detached, or attached without this loop. The
    /// loop is then as it was.
    pub fn set_speed_loop(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        config: PidConfig,
    ) -> Result<(), ConfigError> {
        let slot = self.slot_mut(motor.into()).ok_or(DETACHED)?;
        slot.set_speed_loop(config)
    }

    /// Changes the position loop of a motor while it runs, without a jump of its output.
    ///
    /// # Errors
    /// Names the parameter that `attach` would refuse, or the handle of a motor that was detached, or attached without this loop. The
    /// loop is then as it was.
    pub fn set_position_loop(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        config: PidConfig,
    ) -> Result<(), ConfigError> {
        let slot = self.slot_mut(motor.into()).ok_or(DETACHED)?;
        slot.set_position_loop(config)
    }

    /// Returns what a motor offers with the loops that it was attached with; nothing once it is detached.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::PidConfig;
    /// use drivetrain::dji::{Bus, Config, Gm6020Voltage, M3508};
    ///
    /// let speed = PidConfig::new(1.9, 2.4, 0.0);
    /// let mut bus = Bus::new();
    /// let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(speed))?;
    /// let yaw = bus.attach(Config::<Gm6020Voltage>::new(1))?;
    /// let offered = bus.capabilities(wheel).to_string();
    /// assert_eq!(offered, "raw, current, velocity, feedback, temperature, error codes");
    /// assert_eq!(bus.capabilities(yaw).to_string(), "raw, voltage, feedback, temperature, absolute angle");
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub fn capabilities(&self, motor: impl Into<AnyHandle<B>>) -> Capabilities {
        self.slot(motor.into()).map_or(Capabilities::NONE, Slot::capabilities)
    }

    /// Changes a motor now, and sees to what follows.
    pub(super) fn change_at(
        &mut self,
        motor: AnyHandle<B>,
        change: impl FnOnce(&mut Slot) -> Result<(), TargetError>,
    ) -> Result<(), TargetError> {
        self.slot(motor).ok_or(TargetError::Detached)?;
        let changed = self.change(motor.key().place(), self.guard.updated(), change);
        changed.unwrap_or(Err(TargetError::Detached))
    }

    #[inline]
    fn set(
        &mut self,
        motor: AnyHandle<B>,
        set: impl FnOnce(&mut Slot, u32) -> Result<(), TargetError>,
    ) -> Result<(), TargetError> {
        let now = self.guard.now();
        set(self.slot_mut(motor).ok_or(TargetError::Detached)?, now)
    }
}

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

impl<M: Model, B> VelocityDrive<Handle<M, B>> for Bus<B> {
    fn velocity(&self, motor: Handle<M, B>) -> Option<AngularVelocity> {
        self.fresh_velocity(motor.into())
    }

    fn capabilities(&self, motor: Handle<M, B>) -> Capabilities {
        Self::capabilities(self, motor)
    }

    fn set_velocity(
        &mut self,
        motor: Handle<M, B>,
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        Self::set_velocity(self, motor, target)
    }
}

impl<B> VelocityDrive<AnyHandle<B>> for Bus<B> {
    fn velocity(&self, motor: AnyHandle<B>) -> Option<AngularVelocity> {
        self.fresh_velocity(motor)
    }

    fn capabilities(&self, motor: AnyHandle<B>) -> Capabilities {
        Self::capabilities(self, motor)
    }

    fn set_velocity(
        &mut self,
        motor: AnyHandle<B>,
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        Self::set_velocity(self, motor, target)
    }
}

impl<M: Model, B> AngleDrive<Handle<M, B>> for Bus<B> {
    fn angle(&self, motor: Handle<M, B>) -> Option<Angle> {
        self.fresh_angle(motor.into())
    }

    fn set_angle(&mut self, motor: Handle<M, B>, target: Angle) -> Result<(), TargetError> {
        Self::set_angle(self, motor, target)
    }
}

impl<B> AngleDrive<AnyHandle<B>> for Bus<B> {
    fn angle(&self, motor: AnyHandle<B>) -> Option<Angle> {
        self.fresh_angle(motor)
    }

    fn set_angle(&mut self, motor: AnyHandle<B>, target: Angle) -> Result<(), TargetError> {
        Self::set_angle(self, motor, target)
    }
}
