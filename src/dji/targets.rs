//! What the application asks of the motors.

use super::slot::Slot;
use super::{AnyHandle, Bus, CurrentControlled, Handle, Model, SteepGain, VoltageControlled};
use crate::control::PidConfig;
use crate::encoder::Position;
use crate::motor::{AngleDrive, Capabilities, TargetError, VelocityDrive};
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
    pub fn set_current<M: CurrentControlled>(
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
    pub fn set_voltage<M: VoltageControlled>(
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
    /// Names the parameter that `attach` would refuse; the loop is then as it was.
    pub fn set_speed_loop(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        config: PidConfig,
    ) -> Result<(), LoopError> {
        let slot = self.slot_mut(motor.into()).ok_or(LoopError::Detached)?;
        slot.set_speed_loop(config)
    }

    /// Changes the position loop of a motor while it runs, without a jump of its output.
    ///
    /// # Errors
    /// Names the parameter that `attach` would refuse; the loop is then as it was.
    pub fn set_position_loop(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        config: PidConfig,
    ) -> Result<(), LoopError> {
        let slot = self.slot_mut(motor.into()).ok_or(LoopError::Detached)?;
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

/// Why a loop was not changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LoopError {
    /// The handle's motor was detached.
    Detached,
    /// The motor was attached without this loop.
    NoLoop,
    /// A parameter is not usable.
    Parameter(&'static str),
    /// A proportional gain is impossible for the model.
    Gain(SteepGain),
}

impl core::fmt::Display for LoopError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Detached => f.write_str("the motor was detached"),
            Self::NoLoop => f.write_str("the motor was attached without this loop"),
            Self::Parameter(parameter) => write!(f, "{parameter} is not usable"),
            Self::Gain(gain) => write!(f, "{gain}"),
        }
    }
}

impl core::error::Error for LoopError {}

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
