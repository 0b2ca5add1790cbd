//! Functions of an application: state, health, arming, targets.

use super::slot::{DETACHED, config, gap, health};
use super::{AnyHandle, Bus, Handle, Model, State, attach, watch};
use crate::control::PidConfig;
use crate::encoder::Position;
use crate::error::ConfigError;
use crate::motor::{
    ArmError, Capabilities, Condition, Conditions, Devices, Health, Link, Measured, MotorName,
    TargetError,
};
use crate::time::{Edge, Instant};
use crate::units::{Angle, AngularVelocity, Current, Voltage};

/// State, health and arming.
impl<B, const N: usize> Bus<B, N> {
    /// Returns the state of a motor; `None` before its first frame, and for a detached motor. A program pays only for the fields in use.
    ///
    /// Costs 142 instructions on a Cortex-M4F, when every field is read (`docs/figures.md`).
    #[must_use]
    #[inline(always)]
    pub fn state(&self, motor: impl Into<AnyHandle<B>>) -> Option<State> {
        health::state(self.motors.get(motor.into().key())?)
    }

    /// Returns the link of a motor; `None` for a detached motor.
    #[must_use]
    pub fn link(&self, motor: impl Into<AnyHandle<B>>) -> Option<Link> {
        Some(self.motors.get(motor.into().key())?.guard.link())
    }

    /// Tells whether a motor takes targets: armed, and not relaxed by a fault.
    #[must_use]
    pub fn is_motor_armed(&self, motor: impl Into<AnyHandle<B>>) -> bool {
        self.motors.get(motor.into().key()).is_some_and(|slot| slot.guard.is_armed())
    }

    /// Returns the health of a motor; `None` for a detached motor.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{dji::{Bus, Config, M3508}, time::Instant};
    ///
    /// let mut bus = Bus::new();
    /// let wheel = bus.attach(Config::<M3508>::new(2))?;
    /// bus.ingest_raw(0x202, &[0, 0, 0, 0, 0, 0, 131, 8], Instant::from_micros(1_000));
    /// let health = bus.health(wheel).ok_or("detached")?;
    /// assert_eq!(
    ///     health.to_string(),
    ///     "M3508 #2: online, disarmed, ESC warning; 0 Hz, gap 0 us, 131 C, error 8; saturated 0, refused 0, forgotten 0, ambiguous 0",
    /// );
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn health(&self, motor: impl Into<AnyHandle<B>>) -> Option<Health> {
        health::report(self.motors.get(motor.into().key())?)
    }

    /// Returns the conditions of a motor that hold; empty for a detached motor.
    #[must_use]
    pub fn conditions(&self, motor: impl Into<AnyHandle<B>>) -> Conditions {
        self.motors
            .get(motor.into().key())
            .map_or(Conditions::NONE, |slot| slot.guard.latch.active())
    }

    /// Returns the oldest unread edge of a motor.
    ///
    /// No edge is lost. While an edge waits, the same change is not noted again. Beyond 12 edges, the order is that of the motors.
    ///
    /// Costs 6 instructions on a Cortex-M4F, when none waits (`docs/figures.md`).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::{motor::Condition, time::{Instant, Tick}};
    ///
    /// let mut bus = Bus::new();
    /// let wheel = bus.attach(Config::<M3508>::new(2))?;
    /// bus.ingest_raw(0x202, &[0; 8], Instant::from_micros(1_000));
    /// for millis in 1..20 {
    ///     bus.update(Tick::new(Instant::from_micros(millis * 1_000), 0.001));
    /// }
    /// let edge = bus.next_edge().ok_or("nothing happened")?;
    /// assert_eq!((edge.source.id(), edge.condition, edge.began), (2, Condition::Late, true));
    /// assert_eq!(edge.at.as_micros() / 1_024, 12_000 / 1_024); // the first update after 10 ms
    /// assert_eq!(bus.next_edge(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[inline]
    pub fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        if self.motors.guard.journal.is_empty() { None } else { watch::take_edge(&mut self.motors) }
    }

    /// Arms every motor: before, all outputs are zero. After a trip, arming is granted only after 100 ms of updates without a request.
    ///
    /// `now` is the time of the present tick: an update before `now` counts as a set-back of the clock.
    ///
    /// # Errors
    /// As [`Devices::arm`].
    pub fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        Devices::arm(self, now)
    }

    /// Relaxes every motor and refuses targets until armed again.
    pub fn disarm(&mut self) {
        for slot in &mut self.motors.slots {
            slot.guard.disarm();
            slot.apply_rules();
        }
        self.outbox.clear();
    }

    /// Tells whether every motor takes targets: false if any motor waits to be armed.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        attach::is_armed(&self.motors.slots)
    }

    /// Relaxes every motor at once, until the stop is cleared and the bus armed.
    pub fn emergency_stop(&mut self) {
        if self.motors.guard.set_stop(true) {
            Self::disarm(self);
        }
    }

    /// Clears the emergency stop. The bus stays disarmed, and arming needs a new request.
    pub const fn clear_emergency_stop(&mut self) {
        self.motors.guard.set_stop(false);
    }

    /// Tells whether the emergency stop is set.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        self.motors.guard.is_stopped()
    }

    /// Arms only these motors; the others stay as before.
    ///
    /// In a device of several families, check [`clash`](Devices::clash) of the whole first.
    ///
    /// # Errors
    /// As [`Devices::arm`], which arms all motors. Names the motors among `motors` that are not online, or not fit to be driven.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{dji::{Bus, Config, M3508}, time::Instant};
    ///
    /// let mut bus = Bus::new();
    /// let [left, right] = bus.attach_all([1, 2].map(Config::<M3508>::new))?;
    /// let now = Instant::from_micros(1_000);
    /// bus.ingest_raw(0x201, &[0; 8], now);
    /// bus.arm_only(&[left.erase()], now)?;
    /// assert!(bus.is_motor_armed(left) && !bus.is_motor_armed(right));
    /// assert!(!bus.is_armed()); // not all of them
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn arm_only(&mut self, motors: &[AnyHandle<B>], now: Instant) -> Result<(), ArmError> {
        let chosen = motors.iter().map(|motor| motor.key());
        attach::arm_only(&mut self.motors, chosen, now)
    }
}

/// Targets. Each replaces the previous one, works in RAM only, and counts until the command deadline
/// ([`Timeouts::command`](crate::motor::Timeouts::command)): if an application stops setting targets, the motor stops.
///
/// All take the direction of the output shaft, and saturate at the limits of the motor.
///
/// # Errors
/// A target fails, and is not kept for later, if the motor is detached, not armed, relaxed by a fault or not online, or if the motor has no
/// loop for this target; without the loop the present target stays. NaN or infinity also fails, and cancels the present target.
impl<B, const N: usize> Bus<B, N> {
    /// Sets a torque current.
    ///
    /// Costs 48 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// Fails unless the motor is attached, armed and online, and for NaN and infinity.
    pub fn set_current<M: Model<Command = Current>>(
        &mut self,
        motor: Handle<M, B>,
        current: Current,
    ) -> Result<(), TargetError> {
        self.motors.set(motor.erase().key(), |slot, now| slot.set_output(current.as_amperes(), now))
    }

    /// Sets a terminal voltage, in nominal volts.
    ///
    /// # Errors
    /// Fails unless the motor is attached, armed and online, and for NaN and infinity.
    pub fn set_voltage<M: Model<Command = Voltage>>(
        &mut self,
        motor: Handle<M, B>,
        voltage: Voltage,
    ) -> Result<(), TargetError> {
        self.motors.set(motor.erase().key(), |slot, now| slot.set_output(voltage.as_volts(), now))
    }

    /// Sets the command on the wire's own scale.
    ///
    /// # Errors
    /// Fails unless the motor is attached, armed and online.
    pub fn set_raw(&mut self, motor: impl Into<AnyHandle<B>>, raw: i16) -> Result<(), TargetError> {
        self.motors.set(motor.into().key(), |slot, now| slot.set_raw(raw, now))
    }

    /// Sets the velocity for the speed loop.
    ///
    /// Costs 27 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// Fails unless the motor is armed, online and has a speed loop, and for NaN and infinity.
    #[inline]
    pub fn set_velocity(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        velocity: AngularVelocity,
    ) -> Result<(), TargetError> {
        let (motor, rad_per_s) = (motor.into().key(), velocity.as_rad_per_s());
        self.motors.renew(
            motor,
            |slot, now| slot.renew_velocity(motor, rad_per_s, now),
            |slot, now| slot.set_velocity(rad_per_s, now),
        )
    }

    /// Sets the absolute angle for the position loop, by the shortest way: 350° to 10° is +20°.
    ///
    /// # Errors
    /// Fails unless the motor is armed, online and has a position loop, and for NaN and infinity; also while the angle of a geared
    /// motor is unknown, see [`zero`](Self::zero).
    pub fn set_angle(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        angle: Angle,
    ) -> Result<(), TargetError> {
        self.motors
            .set(motor.into().key(), |slot, now| slot.set_angle(Position::from_angle(angle), now))
    }

    /// Sets the multi-turn position for the position loop, within the [soft limits](crate::motor::HealthConfig::with_soft_limits), if any.
    ///
    /// Costs 74 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Errors
    /// Fails unless the motor is armed, online and has a position loop, for NaN and infinity, and as [`TargetError::NotHomed`] while a zero that
    /// was set is [in doubt](crate::encoder::Homing::Uncertain).
    pub fn set_position(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        position: Position,
    ) -> Result<(), TargetError> {
        let motor = motor.into().key();
        self.motors.renew(
            motor,
            |slot, now| slot.renew_position(motor, position, now),
            |slot, now| slot.set_position(position, now),
        )
    }

    /// Discards the target: zero output from the next update on, loops reset. The motor stays armed; pending frames are sent.
    pub fn relax(&mut self, motor: impl Into<AnyHandle<B>>) {
        if let Some(slot) = self.motors.get_mut(motor.into().key()) {
            slot.relax();
        }
    }

    /// Makes the present position of a motor zero: from then on its angle is known.
    ///
    /// A motor that holds an angle or position is relaxed, because its target refers to the old zero.
    ///
    /// # Errors
    /// The motor is detached, or not online: its position is then unknown.
    pub fn zero(&mut self, motor: impl Into<AnyHandle<B>>) -> Result<(), TargetError> {
        self.set_present_position(motor, Position::ZERO)
    }

    /// Sets the present position of a motor to `position`; see [`zero`](Self::zero).
    ///
    /// # Errors
    /// As [`zero`](Self::zero); also for NaN or infinity.
    pub fn set_present_position(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        position: Position,
    ) -> Result<(), TargetError> {
        let now = self.motors.guard.now();
        self.motors.change_present(motor.into().key(), |slot| {
            gap::set_present_position(slot, position, now)
        })
    }

    /// Changes the speed loop of a running motor, without a jump of its output.
    ///
    /// # Errors
    /// Names the parameter that `attach` would refuse, or a handle without motor or loop. The loop stays as before.
    pub fn set_speed_loop(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        config: PidConfig,
    ) -> Result<(), ConfigError> {
        let slot = self.motors.get_mut(motor.into().key()).ok_or(DETACHED)?;
        config::set_speed_loop(slot, config)
    }

    /// Changes the position loop of a running motor, without a jump of its output.
    ///
    /// # Errors
    /// Names the parameter that `attach` would refuse, or a handle without motor or loop. The loop stays as before.
    pub fn set_position_loop(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        config: PidConfig,
    ) -> Result<(), ConfigError> {
        let slot = self.motors.get_mut(motor.into().key()).ok_or(DETACHED)?;
        config::set_position_loop(slot, config)
    }

    /// Returns the capabilities of a motor with its configured loops; empty for a detached motor.
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
        self.motors.get(motor.into().key()).map_or(Capabilities::NONE, config::capabilities)
    }

    /// Sets the angle for the position loop, measured by another sensor, by the shortest way.
    ///
    /// The angle of the encoder may be unknown; see the [module](super), and the example `gimbal`.
    ///
    /// # Errors
    /// As for every target. Also fails for a measurement that is too old, lies ahead by as much, or is not finite: the output is then zero
    /// at once.
    pub fn set_angle_measured(
        &mut self,
        motor: impl Into<AnyHandle<B>>,
        target: Angle,
        measured: Measured<Angle>,
    ) -> Result<(), TargetError> {
        let way = measured.way_to(target);
        self.motors.set_measured(motor.into().key(), way, measured.velocity, measured.at)
    }

    /// Sets the multi-turn position for the position loop, measured by another sensor.
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
        self.motors.set_measured(motor.into().key(), way, measured.velocity, measured.at)
    }

    /// Returns the commanded current of the last update, as on the wire; `None` for a detached motor.
    ///
    /// The direction is that of the shaft. [`State::current`](super::State::current) is the measured current.
    #[must_use]
    pub fn commanded_current<M: Model<Command = Current>>(
        &self,
        motor: Handle<M, B>,
    ) -> Option<Current> {
        let slot = self.motors.get(motor.erase().key())?;
        Some(Current::from_amperes(slot.in_units(self.outbox.get(slot.place))))
    }

    /// Scales the commands of the last update for some motors by one factor: for a common limit, for example of power.
    ///
    /// Call it after [`update`](Self::update) and before [`next_frame`](Self::next_frame); with a runner, in
    /// [`tick_limited`](crate::runner::Runner::tick_limited). A factor of 1 or more changes nothing, a factor of zero, below zero or
    /// NaN gives zero; results are rounded towards zero. Stops and limits stay, each update starts anew, and the integral of a
    /// reduced speed loop stays within the remaining output, without windup.
    pub fn scale_outputs(
        &mut self,
        motors: impl IntoIterator<Item = impl Into<AnyHandle<B>>>,
        factor: f32,
    ) {
        for motor in motors {
            let motor: AnyHandle<B> = motor.into();
            self.motors.scale_output(&mut self.outbox, motor.key(), factor);
        }
    }
}
