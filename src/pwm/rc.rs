use crate::error::ConfigError;
use crate::math::limited;
use crate::motor::{
    ArmError, Capabilities, Capability, Condition, Conditions, Guard, Health, Hold, MotorName,
    OPENING, Obstacles, Output, TargetError, Timeouts, VelocityDrive,
};
use crate::time::{Duration, Edge, Instant, Tick, TimeStep};
use crate::units::AngularVelocity;
use embedded_hal::pwm::SetDutyCycle;

/// An RC ESC or servo on a PWM channel.
///
/// The motor sends no feedback, so feedback cannot be missing; the motion is up to the ESC.
///
/// # Examples
/// ```
/// use drivetrain::pwm::RcPwm;
/// use drivetrain::time::{Duration, Instant, Tick};
/// # use embedded_hal::pwm::*;
/// # struct Channel(u16);
/// # impl ErrorType for Channel { type Error = core::convert::Infallible; }
/// # impl SetDutyCycle for Channel {
/// #     fn max_duty_cycle(&self) -> u16 { 20_000 }
/// #     fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Self::Error> { self.0 = duty; Ok(()) }
/// # }
/// # let channel = Channel(0); // counts microseconds of 20 ms
///
/// let mut esc = RcPwm::new(channel);
/// let at_ms = |ms: u64| Tick::new(Instant::from_micros(ms * 1_000), 0.001);
/// esc.arm()?;
/// for ms in 0..=2_000 {
///     esc.update(at_ms(ms))?; // neutral for 2 s
/// }
/// for ms in 2_001..=2_200 {
///     esc.set_throttle(0.5)?; // the throttle opens in 0.2 s
///     esc.update(at_ms(ms))?;
/// }
/// assert_eq!(esc.channel().0, 1_750);
///
/// // A fan that turns one way, on a timer of 400 Hz.
/// let fan = esc.with_pulses_us([1_000, 1_000, 2_000], Duration::from_micros(2_500))?;
/// let wrong = fan.with_pulses_us([1_000, 900, 2_000], Duration::from_micros(2_500));
/// assert_eq!(wrong.map(|_| ()).map_err(|error| error.to_string()), Err("neutral pulse is not usable".into()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct RcPwm<P> {
    channel: P,
    guard: Guard,
    name: MotorName,
    pulses_us: [u16; 3],
    period_us: u64,
    off_at_rest: bool,
    arming_time: Duration,
    full_speed: Option<AngularVelocity>,
    arming: Arming,
    throttle: f32,
    /// The last pulse of a target.
    pulse_us: f32,
}

/// Where the arming sequence is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Arming {
    /// Nowhere: armed already, or not asked to.
    Idle,
    /// No neutral pulse was sent yet.
    Asked,
    /// Neutral since then.
    Since(Instant),
}

impl<P: SetDutyCycle> RcPwm<P> {
    /// Takes a channel: disarmed, with pulses of 1000, 1500 and 2000 µs every 20 ms, neutral when idle and for 2 s when arming.
    /// Nothing is sent before the first [`update`](Self::update).
    #[must_use]
    pub const fn new(channel: P) -> Self {
        Self {
            channel,
            guard: Guard::without_feedback().with_opening(OPENING),
            name: MotorName::new("RC PWM", 1),
            pulses_us: [1_000, 1_500, 2_000],
            period_us: 20_000,
            off_at_rest: false,
            arming_time: Duration::from_secs(2),
            full_speed: None,
            arming: Arming::Idle,
            throttle: 0.0,
            pulse_us: 0.0,
        }
    }

    /// Sets the number of the motor in edges; 1 at first.
    #[must_use]
    pub fn with_id(self, id: u8) -> Self {
        Self { name: MotorName::new("RC PWM", id), ..self }
    }

    /// Sets the pulses for throttle -1, 0 and 1 in µs, and the period of the timer. For an ESC with one direction only, the first pulse is
    /// the neutral pulse.
    ///
    /// # Errors
    /// Names the first pulse that is not usable, or the period that is shorter than the last pulse.
    pub fn with_pulses_us(self, pulses: [u16; 3], period: Duration) -> Result<Self, ConfigError> {
        let [low, neutral, high] = pulses;
        let period_us = period.as_micros();
        Err(ConfigError::Unusable(if low == 0 || low >= high {
            "low pulse"
        } else if neutral < low || neutral > high {
            "neutral pulse"
        } else if u64::from(high) > period_us {
            "period"
        } else {
            return Ok(Self { pulses_us: pulses, period_us, ..self });
        }))
    }

    /// Sends no pulse, instead of the neutral pulse, for a motor at rest: a servo goes limp.
    ///
    /// Not for an ESC: most disarm then, and would have to see neutral again. With the neutral pulse an ESC stops and stays
    /// armed, and a servo goes to its centre.
    #[must_use]
    pub fn with_off_at_rest(self) -> Self {
        Self { off_at_rest: true, ..self }
    }

    /// Sets how long the neutral pulse is sent before targets are taken, as required by the ESC. 2 s at first, counted
    /// from the first pulse taken by the channel.
    #[must_use]
    pub fn with_arming_time(self, time: Duration) -> Self {
        Self { arming_time: time, ..self }
    }

    /// Sets the velocity at full throttle, so that velocities are valid targets. The velocity is not measured.
    ///
    /// # Errors
    /// Names the velocity when NaN, infinite, zero or negative.
    pub fn with_full_speed(self, velocity: AngularVelocity) -> Result<Self, ConfigError> {
        if velocity.is_finite() && velocity > AngularVelocity::ZERO {
            Ok(Self { full_speed: Some(velocity), ..self })
        } else {
            Err(ConfigError::Unusable("full speed"))
        }
    }

    /// Sets when a target counts as lost.
    #[must_use]
    pub fn with_timeouts(self, timeouts: Timeouts) -> Self {
        Self { guard: self.guard.with_timeouts(timeouts), ..self }
    }

    /// Sets the time in which the pulse may leave neutral after arming, from not at all to the whole way; 0.2 s at first.
    #[must_use]
    pub fn with_opening(self, time: Duration) -> Self {
        Self { guard: self.guard.with_opening(time), ..self }
    }

    /// Begins to arm: the updates send neutral for the configured time, and targets are taken then. Without effect while
    /// armed or arming.
    ///
    /// # Errors
    /// The emergency stop is set, or, after a trip, another request lies less than 100 ms of updates back.
    pub fn arm(&mut self) -> Result<(), ArmError> {
        if self.arming != Arming::Idle {
            return Ok(());
        }
        Obstacles::check_one(&mut self.guard, None)?;
        if !self.guard.is_armed() {
            self.arming = Arming::Asked;
        }
        Ok(())
    }

    /// Sends idle, and refuses targets until armed again.
    pub const fn disarm(&mut self) {
        self.guard.disarm();
        self.arming = Arming::Idle;
    }

    /// Disarms; the motor stays disarmed until the stop is cleared and the motor armed.
    pub const fn emergency_stop(&mut self) {
        self.guard.emergency_stop();
        self.arming = Arming::Idle;
    }

    /// Clears the emergency stop; the motor stays disarmed.
    pub const fn clear_emergency_stop(&mut self) {
        self.guard.clear_emergency_stop();
    }

    /// Returns whether targets are taken.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.guard.is_armed()
    }

    /// Sets the throttle of an ESC or the place of a servo: -1 to 1, saturating, for low, neutral and high.
    ///
    /// # Errors
    /// Names the reason of the refusal. A value that is NaN or infinite also removes the present target.
    pub fn set_throttle(&mut self, throttle: f32) -> Result<(), TargetError> {
        self.guard.admit(throttle.is_finite())?;
        self.throttle = throttle.clamp(-1.0, 1.0);
        Ok(())
    }

    /// Sends the pulse of this tick. Call this in every tick.
    ///
    /// # Errors
    /// The error of the channel; the next call tries again.
    pub fn update(&mut self, tick: Tick) -> Result<(), P::Error> {
        let is_hold = TimeStep::of_motor(tick.dt_s()).is_hold();
        let held = self.guard.pass(tick.now(), !is_hold);
        if held == Some(Hold::LoseTime) {
            // Nobody knows for how long neutral was sent.
            self.arming = Arming::Idle;
        }
        if self.arming != Arming::Idle {
            return self.go_on_arming(tick.now());
        }
        match self.guard.output(held) {
            Output::Drive => {
                self.guard.end_rest();
                self.pulse_us = self.pulse_of_target();
                self.send(self.pulse_us)
            }
            Output::Repeat => self.send(self.pulse_us),
            Output::Rest if self.off_at_rest => self.channel.set_duty_cycle_fully_off(),
            Output::Rest => self.send(self.neutral_us().into()),
        }
    }

    /// Sends neutral. A pulse refused by the channel does not count.
    fn go_on_arming(&mut self, now: Instant) -> Result<(), P::Error> {
        self.send(self.neutral_us().into())?;
        let since = match self.arming {
            Arming::Since(since) => since,
            Arming::Idle | Arming::Asked => now,
        };
        self.arming = Arming::Since(since);
        if now.since(since) >= self.arming_time {
            self.arming = Arming::Idle;
            self.guard.engage(now);
        }
        Ok(())
    }

    const fn neutral_us(&self) -> u16 {
        let [_, neutral, _] = self.pulses_us;
        neutral
    }

    fn pulse_of_target(&mut self) -> f32 {
        let (lower, upper) = self.guard.range(1.0);
        let [low, neutral, high] = self.pulses_us.map(f32::from);
        let reach = if self.throttle < 0.0 { neutral - low } else { high - neutral };
        neutral + limited(self.throttle, lower, upper) * reach
    }

    fn send(&mut self, pulse_us: f32) -> Result<(), P::Error> {
        let share = pulse_us / self.period_us as f32;
        self.channel.set_duty_cycle(duty(share, self.channel.max_duty_cycle()))
    }

    /// Returns the present conditions: expired targets only, since the motor sends no feedback.
    #[must_use]
    pub const fn conditions(&self) -> Conditions {
        self.guard.conditions()
    }

    /// Returns the health of the motor.
    #[must_use]
    pub const fn health(&self) -> Health {
        self.guard.health(self.name)
    }

    /// Returns the oldest unread edge. No edge is lost, however late the reading; while an edge waits, the same change
    /// is not noted again.
    pub fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.guard.next_edge(self.name)
    }

    /// Returns the channel.
    #[must_use]
    pub const fn channel(&self) -> &P {
        &self.channel
    }

    /// Returns the guard, which decides whether the motor may be driven.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }
}

/// The duty of a share from 0 to 1, to the nearest; saturates.
pub(super) fn duty(share: f32, max: u16) -> u16 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, NaN gives 0"
    )]
    let duty = (share * f32::from(max) + 0.5) as u16;
    duty.min(max)
}

/// Open loop, over [`RcPwm::with_full_speed`]: the velocity is asked for and not measured.
impl<P: SetDutyCycle> VelocityDrive<()> for RcPwm<P> {
    /// Always `None`.
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        None
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        let set = Capabilities::of(&[Capability::Raw]);
        if self.full_speed.is_some() { set.with(Capability::Velocity) } else { set }
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        let full = self.full_speed.ok_or(TargetError::Unsupported)?;
        self.set_throttle(target.as_rad_per_s() / full.as_rad_per_s())
    }
}
