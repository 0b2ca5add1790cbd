mod config;

use super::Direction;
use super::rc::duty;
use crate::control::Pid;
use crate::error::ConfigError;
use crate::math::limited;
use crate::motor::{
    ArmError, Capabilities, Capability, Condition, Conditions, Guard, Health, Link, MotorName,
    Obstacles, OneOf, Output, Rest, TargetError, VelocityDrive, Vitals, Watch,
};
use crate::time::{Edge, Instant, Tick, TimeStep};
use crate::units::AngularVelocity;
use core::f32::consts::TAU;
use embedded_hal::pwm::SetDutyCycle;

pub use config::BrushedConfig;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Target {
    Duty(f32),
    Velocity(f32),
}

/// Direction in which the pins drive the bridge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Coast,
    Forward,
    Backward,
}

/// Speed of a turning shaft when the no-load speed is not known, as a share of it: no stall, and never a runaway.
const TURNS: f32 = 0.1;

/// A shaft turns if it moves a count in this time.
const COUNT_S: f32 = 0.05;

/// A brushed DC motor: a PWM channel and direction pins of its bridge, and the counts of its encoder.
///
/// # Examples
/// ```
/// use drivetrain::pwm::{Brushed, BrushedConfig};
/// use drivetrain::time::{Instant, Tick};
/// # use embedded_hal::{digital, pwm::*};
/// # struct Pin(u16);
/// # impl ErrorType for Pin { type Error = core::convert::Infallible; }
/// # impl digital::ErrorType for Pin { type Error = core::convert::Infallible; }
/// # impl SetDutyCycle for Pin {
/// #     fn max_duty_cycle(&self) -> u16 { 1_000 }
/// #     fn set_duty_cycle(&mut self, duty: u16) -> Result<(), core::convert::Infallible> { self.0 = duty; Ok(()) }
/// # }
/// # impl digital::OutputPin for Pin {
/// #     fn set_low(&mut self) -> Result<(), core::convert::Infallible> { self.0 = 0; Ok(()) }
/// #     fn set_high(&mut self) -> Result<(), core::convert::Infallible> { self.0 = 1; Ok(()) }
/// # }
/// # let (channel, pin) = (Pin(0), Pin(0));
///
/// let mut motor = Brushed::new(channel, [pin], BrushedConfig::new(1).with_limit(0.5))?;
/// motor.arm(Instant::from_micros(1_000))?;
/// for millis in 1..=201 {
///     motor.set_duty(-0.9)?; // saturates at its limit, which opens in 0.2 s
///     motor.update(Tick::new(Instant::from_micros(1_000 * millis), 0.001))?;
/// }
/// assert_eq!((motor.channel().0, motor.direction()[0].0), (500, 1)); // backward with half of 1000
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Brushed<P, D> {
    channel: P,
    direction: D,
    config: BrushedConfig,
    speed: Option<Pid>,
    guard: Guard,
    target: Target,
    way: Way,
    output: f32,
    /// The last update set a duty of its own; the loop continues from there.
    was_direct: bool,
    counted: Option<(u32, Instant)>,
    counts: i64,
    rad_per_s: f32,
    watch: Watch,
}

impl<P: SetDutyCycle, D: Direction> Brushed<P, D> {
    /// Takes the pins: disarmed. Nothing is sent before the first [`update`](Self::update).
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn new(channel: P, direction: D, config: BrushedConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        let speed = config.make_loop()?;
        let guard =
            if config.counts_per_turn.is_some() { Guard::new() } else { Guard::without_feedback() };
        ConfigError::check_support(config.health.soft_limits.is_none(), "soft limits")?;
        let watch = Watch::new().with_config(config.health).map_err(ConfigError::Unusable)?;
        Ok(Self {
            channel,
            direction,
            config,
            speed,
            guard: guard.with_timeouts(config.timeouts).with_opening(config.opening),
            target: Target::Duty(0.0),
            way: Way::Coast,
            output: 0.0,
            was_direct: false,
            counted: None,
            counts: 0,
            rad_per_s: 0.0,
            watch,
        })
    }

    /// Takes a reading of the encoder's counter, which may wrap. Read the counter at least once in half a wrap.
    pub fn ingest_counts(&mut self, counter: u32, now: Instant) {
        let Some(counts_per_turn) = self.config.counts_per_turn else { return };
        let (before, then) = self.counted.replace((counter, now)).unwrap_or((counter, now));
        let spare_bits = 32 - self.config.counter_bits.min(32);
        let moved = counter.wrapping_sub(before) << spare_bits;
        let moved = i64::from(moved.cast_signed() >> spare_bits);
        let moved = if self.config.reversed { -moved } else { moved };
        self.counts = self.counts.wrapping_add(moved);
        let dt_s = now.since(then).as_secs_f32();
        if dt_s > 0.0 {
            let measured = moved as f32 * TAU / (counts_per_turn * dt_s);
            let share = dt_s / (self.config.filter_s + dt_s);
            self.rad_per_s += (measured - self.rad_per_s) * share;
        } else {
            // No time between: the way belongs to the next reading.
            self.counted = Some((before, then));
            self.counts = self.counts.wrapping_sub(moved);
        }
        self.watch.hear(self.guard.gap_us(now), now);
        self.guard.hear(now);
    }

    /// Takes targets from now on.
    ///
    /// # Errors
    /// When the emergency stop is set, or no counts came.
    pub fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        let missing = self.guard.is_missing(now).then_some(self.config.name);
        Obstacles::check_one(&mut self.guard, missing)?;
        if self.guard.engage(now) {
            self.watch.start(&mut self.guard, self.config.name, now);
        }
        Ok(())
    }

    /// Refuses targets until armed again; the next update stops the motor.
    pub const fn disarm(&mut self) {
        self.guard.disarm();
    }

    /// Disarms; the motor stays disarmed until the stop is cleared and the motor armed.
    pub const fn emergency_stop(&mut self) {
        self.guard.emergency_stop();
    }

    /// Takes the emergency stop back; the motor stays disarmed.
    pub const fn clear_emergency_stop(&mut self) {
        self.guard.clear_emergency_stop();
    }

    /// Returns whether targets are taken.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.guard.is_armed()
    }

    /// Sets the duty directly: -1 to 1, saturating at the limit.
    ///
    /// # Errors
    /// Names the reason of the refusal. A value that is NaN or infinite also removes the present target.
    pub fn set_duty(&mut self, share: f32) -> Result<(), TargetError> {
        self.guard.admit(share.is_finite())?;
        self.target = Target::Duty(share);
        Ok(())
    }

    /// Runs the loop and sets the pins. Call this in every tick.
    ///
    /// # Errors
    /// The error of a pin, the first of the PWM channel, the second of a direction pin; the next call tries again.
    pub fn update(&mut self, tick: Tick) -> Result<(), OneOf<P::Error, D::Error>> {
        let step = TimeStep::of_motor(tick.dt_s());
        let held = self.guard.pass(tick.now(), !step.is_hold());
        let left = self.check(tick.now());
        let asked = match self.guard.output(held) {
            Output::Drive => self.drive(step),
            Output::Repeat => self.output,
            Output::Rest => 0.0,
        };
        let (lower, upper) = self.guard.range(left);
        let (lower, upper) = (lower * self.config.limit, upper * self.config.limit);
        self.output = limited(asked, lower, upper);
        if upper < self.config.limit {
            // The loop knows only the full limit, and would wind up.
            self.speed.iter_mut().for_each(|speed| speed.keep_integral_between(lower, upper));
        }
        let output = if self.config.reversed { -self.output } else { self.output };
        let share = output.abs();
        let way = match duty(share, self.channel.max_duty_cycle()) {
            0 => Way::Coast,
            _ if output > 0.0 => Way::Forward,
            _ => Way::Backward,
        };
        if way == Way::Coast {
            return self.coast();
        }
        if way != self.way {
            // Never a pulse in the wrong direction while the pins change.
            self.channel.set_duty_cycle_fully_off().map_err(OneOf::First)?;
            // A failed pin may have changed or not: the next call sets both again.
            self.way = Way::Coast;
            let set = match way {
                Way::Coast => self.direction.coast(),
                Way::Forward => self.direction.forward(),
                Way::Backward => self.direction.backward(),
            };
            set.map_err(OneOf::Second)?;
            self.way = way;
        }
        self.channel
            .set_duty_cycle(duty(share, self.channel.max_duty_cycle()))
            .map_err(OneOf::First)
    }

    /// Stops by both means, even if one of them fails.
    fn coast(&mut self) -> Result<(), OneOf<P::Error, D::Error>> {
        let off = self.channel.set_duty_cycle_fully_off().map_err(OneOf::First);
        let set = self.direction.coast().map_err(OneOf::Second);
        self.way = Way::Coast;
        off.and(set)
    }

    fn drive(&mut self, step: TimeStep) -> f32 {
        match self.guard.end_rest() {
            Rest::Relaxed => {
                self.was_direct = false;
                self.speed.iter_mut().for_each(Pid::reset);
            }
            Rest::Pause => self.speed.iter_mut().for_each(Pid::interrupt),
            Rest::None => {}
        }
        let is_direct = matches!(self.target, Target::Duty(_));
        let was_direct = core::mem::replace(&mut self.was_direct, is_direct);
        match (self.target, &mut self.speed) {
            (Target::Duty(share), speed) => {
                if !was_direct {
                    // The loop has no part in this output.
                    speed.iter_mut().for_each(Pid::reset);
                }
                share
            }
            (Target::Velocity(goal), Some(speed)) => {
                if was_direct {
                    speed.reset_to(self.output);
                }
                speed.step(goal, self.rad_per_s, &step)
            }
            (Target::Velocity(_), None) => 0.0,
        }
    }

    /// Returns the counts since the first reading, in the positive direction; 0 without an encoder.
    #[must_use]
    pub const fn counts(&self) -> i64 {
        self.counts
    }

    /// Returns the share of full duty of the last update, in the positive direction.
    #[must_use]
    pub const fn duty(&self) -> f32 {
        self.output
    }

    /// Returns the PWM channel.
    #[must_use]
    pub const fn channel(&self) -> &P {
        &self.channel
    }

    /// Returns the direction pins.
    #[must_use]
    pub const fn direction(&self) -> &D {
        &self.direction
    }

    /// Returns the guard, which decides whether the motor may be driven.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }
}

/// Health: conditions of the motor, and every change of a condition.
impl<P: SetDutyCycle, D: Direction> Brushed<P, D> {
    /// Returns the present conditions of the motor.
    #[must_use]
    pub const fn conditions(&self) -> Conditions {
        self.guard.conditions()
    }

    /// Returns the health of the motor; without an encoder there is neither rate nor gap.
    #[must_use]
    pub fn health(&self) -> Health {
        self.watch.health(self.config.name, &self.guard, &self.vitals())
    }

    /// Returns the oldest unread edge. No edge is lost, however late the reading; while an edge waits, the same change
    /// is not noted again.
    pub fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.guard.next_edge(self.config.name)
    }

    /// Monitors the motor, and relaxes it if configured; returns the remaining share of its limit.
    fn check(&mut self, now: Instant) -> f32 {
        let vitals = self.vitals();
        self.watch.check(&mut self.guard, || vitals, now)
    }

    /// A motor without an encoder is not known to turn or to stand.
    fn vitals(&self) -> Vitals {
        let Some(counts_per_turn) = self.config.counts_per_turn else { return Vitals::default() };
        let speed = match self.config.no_load {
            Some(no_load) => self.rad_per_s / no_load.as_rad_per_s(),
            None if self.rad_per_s.abs() > TAU / (counts_per_turn * COUNT_S) => {
                TURNS.copysign(self.rad_per_s)
            }
            None => 0.0,
        };
        Vitals { effort: self.output / self.config.limit, speed, ..Vitals::default() }
    }
}

impl<P: SetDutyCycle, D: Direction> VelocityDrive<()> for Brushed<P, D> {
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        let fresh = self.config.counts_per_turn.is_some() && self.guard.link() == Link::Online;
        fresh.then(|| AngularVelocity::from_rad_per_s(self.rad_per_s))
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        let set = Capabilities::of(&[Capability::Raw]);
        let set = if self.speed.is_some() { set.with(Capability::Velocity) } else { set };
        let listens = self.config.counts_per_turn.is_some();
        if listens { set.with(Capability::Feedback) } else { set }
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        if self.speed.is_none() {
            return Err(TargetError::NoLoop);
        }
        self.guard.admit(target.as_rad_per_s().is_finite())?;
        self.target = Target::Velocity(target.as_rad_per_s());
        Ok(())
    }
}
