use super::IdentificationError;
use crate::control::number::Sum;
use crate::error::{ConfigError, check, positive};
use crate::math::limited;
use crate::time::TimeStep;

/// Efforts for an [`Identification`](super::Identification): steps that swing the shaft within limits of effort, speed and way.
///
/// The effort drives the shaft up to a speed, then turns. Each swing has one of three efforts and speeds, so
/// that friction, resistance and inertia can be told apart:
///
/// | swing | effort, of the limit | speed of the reversal, of the limit |
/// |---|--:|--:|
/// | 1 | 0.5 | 0.35 |
/// | 2 | 1.0 | 0.7 |
/// | 3 | 0.7 | 0.5 |
///
/// By how much the last swing exceeded its speed (delay), the next one turns earlier. The effort turns too when the way that is
/// left is as long as the way from the last standstill, since the same effort needs at most this way to stop; and after
/// [`HOLD_S`](Self::HOLD_S) in one direction, where resistance keeps the speed below its limit. After
/// [`with_duration`](Self::with_duration), 10 s by default, the shaft is braked, and the effort is zero for ever.
///
/// # Limits
/// The effort never exceeds its limit. If the speed exceeds its limit, the way from the start exceeds its limit to either side, or
/// the feedback is not finite or older than 0.1 s, the effort is zero at once and for ever ([`failure`](Self::failure)): the
/// shaft then runs out by itself. A mechanism that falls without effort needs a brake. A weight that pulls towards one end takes
/// way beyond the reversal.
///
/// # Edge behaviour
/// A `dt_s` that is zero, negative, NaN or infinite changes nothing, and the last effort is returned.
///
/// # Examples
/// ```
/// use drivetrain::control::{Excitation, IdentificationError};
///
/// let mut excitation = Excitation::new(5.0, 30.0, 100.0)?;
/// assert_eq!(excitation.update(0.0, 0.001), 2.5); // half of the effort at first
/// assert_eq!(excitation.update(12.0, 0.001), -2.5); // beyond 35 % of 30 rad/s
/// assert_eq!(excitation.update(31.0, 0.001), 0.0);
/// assert_eq!(excitation.failure(), Some(IdentificationError::TooFast));
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Excitation {
    effort_limit: f32,
    speed_limit: f32,
    way_limit: f32,
    duration_s: f32,
    passed: Sum,
    held_s: f32,
    velocity: f32,
    position: Sum,
    /// Position of the last standstill.
    turned_at: f32,
    /// By how much the last swing exceeded its speed.
    excess: f32,
    peak: f32,
    /// 1 or -1.
    direction: f32,
    /// The effort has turned since the last standstill: noise at rest begins no swing.
    has_turned: bool,
    swing: Swing,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum State {
    Swinging,
    Braking,
    Done,
    Failed(IdentificationError),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Swing {
    Slow,
    Fast,
    Middle,
}

impl Swing {
    /// Shares of the limits of effort and speed.
    const fn shares(self) -> (f32, f32) {
        match self {
            Self::Slow => (0.5, 0.35),
            Self::Fast => (1.0, 0.7),
            Self::Middle => (0.7, 0.5),
        }
    }

    const fn next(self) -> Self {
        match self {
            Self::Slow => Self::Fast,
            Self::Fast => Self::Middle,
            Self::Middle => Self::Slow,
        }
    }
}

impl Excitation {
    /// The longest time in s with one effort.
    pub const HOLD_S: f32 = 0.5;

    /// The share of the way that may be used up by a reversal.
    const USABLE_WAY: f32 = 0.8;

    /// The share of the speed limit below which a shaft counts as unmoved after [`HOLD_S`](Self::HOLD_S).
    const UNMOVED: f32 = 0.05;

    /// Takes the limits: effort in `U`, speed in `M`/s, and way in `M` from the start to either side. A way of `f32::MAX` limits
    /// nothing.
    ///
    /// # Errors
    /// Names `effort_limit`, `speed_limit` or `way_limit` when it is not above zero and finite.
    pub const fn new(
        effort_limit: f32,
        speed_limit: f32,
        way_limit: f32,
    ) -> Result<Self, ConfigError> {
        check!(positive("effort_limit", effort_limit));
        check!(positive("speed_limit", speed_limit));
        check!(positive("way_limit", way_limit));
        Ok(Self {
            effort_limit,
            speed_limit,
            way_limit,
            duration_s: 10.0,
            passed: Sum::ZERO,
            held_s: 0.0,
            velocity: 0.0,
            position: Sum::ZERO,
            turned_at: 0.0,
            excess: 0.0,
            peak: 0.0,
            direction: 1.0,
            has_turned: false,
            swing: Swing::Slow,
            state: State::Swinging,
        })
    }

    /// Sets the time in s after which the shaft is braked, above zero; 10 by default.
    ///
    /// # Errors
    /// Names `duration` when not above zero and finite.
    pub const fn with_duration(self, duration_s: f32) -> Result<Self, ConfigError> {
        check!(positive("duration", duration_s));
        Ok(Self { duration_s, ..self })
    }

    /// Takes the measured speed in `M`/s and the seconds since the call before; returns the effort to send.
    pub fn update(&mut self, velocity: f32, dt_s: f32) -> f32 {
        let step = TimeStep::of(dt_s);
        if self.is_complete() || step.is_hold() {
            return self.effort();
        }
        let before = self.velocity;
        if !velocity.is_finite() || step.is_frozen() {
            return self.fail(IdentificationError::NoFeedback);
        }
        self.velocity = velocity;
        self.position.add(0.5 * (before + velocity) * step.dt_s());
        if velocity.abs() > self.speed_limit {
            return self.fail(IdentificationError::TooFast);
        }
        if self.position.value().abs() > self.way_limit {
            return self.fail(IdentificationError::TooFar);
        }
        self.passed.add(step.dt_s());
        self.held_s += step.dt_s();
        match self.state {
            State::Swinging => self.swing(before),
            State::Braking if velocity * self.direction >= 0.0 || self.held_s >= Self::HOLD_S => {
                self.state = State::Done;
            }
            State::Braking | State::Done | State::Failed(_) => {}
        }
        self.effort()
    }

    fn swing(&mut self, before: f32) {
        let forward = self.velocity * self.direction;
        if self.passed.value() >= self.duration_s {
            self.state = State::Braking;
            self.held_s = 0.0;
            self.direction = if self.velocity > 0.0 { -1.0 } else { 1.0 };
            return;
        }
        let (_, share) = self.swing.shares();
        let reversal = share * self.speed_limit;
        if self.has_turned && before * self.velocity < 0.0 && forward > 0.0 {
            // The shaft stood still, and goes the way it is driven: a new swing.
            self.turned_at = self.position.value();
            self.excess = limited(self.peak - reversal, 0.0, 0.5 * reversal);
            self.has_turned = false;
            self.peak = 0.0;
            self.swing = self.swing.next();
            return;
        }
        self.peak = self.peak.max(self.velocity.abs());
        let way = (self.position.value() - self.turned_at).abs();
        let is_far = self.position.value() * self.direction + way
            >= Self::USABLE_WAY * self.way_limit
            && forward > 0.0;
        let is_held = self.held_s >= Self::HOLD_S;
        if forward >= reversal - self.excess || is_far || is_held {
            if is_held && forward < Self::UNMOVED * self.speed_limit {
                self.swing = self.swing.next();
            }
            self.direction = -self.direction;
            self.has_turned = true;
            self.held_s = 0.0;
        }
    }

    const fn fail(&mut self, error: IdentificationError) -> f32 {
        self.state = State::Failed(error);
        0.0
    }

    /// Returns the effort to send, in ± the limit; zero when complete.
    #[must_use]
    pub const fn effort(&self) -> f32 {
        let (share, _) = self.swing.shares();
        match self.state {
            State::Swinging | State::Braking => share * self.effort_limit * self.direction,
            State::Done | State::Failed(_) => 0.0,
        }
    }

    /// Returns whether the run has ended, by its time or by a limit.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        matches!(self.state, State::Done | State::Failed(_))
    }

    /// Returns the limit that ended the run; `None` during a run, and after its time.
    #[must_use]
    pub const fn failure(&self) -> Option<IdentificationError> {
        match self.state {
            State::Failed(error) => Some(error),
            State::Swinging | State::Braking | State::Done => None,
        }
    }
}
