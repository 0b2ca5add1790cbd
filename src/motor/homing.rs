//! The zero of a shaft, found at a mechanical stop.

use crate::encoder::Position;
use crate::error::{ConfigError, check, not_negative, positive};
use crate::time::{Duration, Instant, Tick};
use crate::units::{Angle, AngularVelocity};

/// Position, velocity and effort of a shaft.
type Shaft = (Position, AngularVelocity, f32);

const fn is_finite((position, velocity, effort): &Shaft) -> bool {
    position.is_finite() && velocity.is_finite() && effort.is_finite()
}

/// Next action of a homing procedure.
///
/// A failure is final: relax the motor; later steps return the same.
///
/// # Examples
/// ```
/// use drivetrain::motor::HomingStep;
///
/// assert_eq!(HomingStep::NoStop.to_string(), "no stop within the travel");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum HomingStep {
    /// Set this velocity.
    Drive(AngularVelocity),
    /// The shaft is at the stop: call `set_present_position` with this position, once, and set no target.
    SetPresentPosition(Position),
    /// The shaft is homed: relax the motor, or give it its first target.
    Done,
    /// Failed: the time-out expired. The motor does not move, and does not press against a stop either.
    TimedOut,
    /// Failed: the shaft turned by its whole travel without a stop.
    NoStop,
    /// Failed: there was no fresh feedback, or feedback that is not finite.
    LostFeedback,
}

impl core::fmt::Display for HomingStep {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Drive(_) => "homing in progress",
            Self::SetPresentPosition(_) => "at the stop",
            Self::Done => "homed",
            Self::TimedOut => "homing took too long",
            Self::NoStop => "no stop within the travel",
            Self::LostFeedback => "no fresh feedback while homing",
        })
    }
}

/// Homes a shaft against a mechanical stop: approaches slowly until the motor presses and the shaft stands.
///
/// ```text
/// approach ──> effort >= threshold and speed < threshold, for the window ──> set the position ──> back off ──> done
///    └── travel, time-out, feedback ──> failed
/// ```
///
/// Does no I/O and sets no target: each step takes the state of the shaft and returns the next action. A shaft that already
/// touches the stop is homed in place.
///
/// The motor limits the torque: give it a current limit, or its speed loop an output limit, within the strength of the
/// mechanics and above the effort of the stop; and a speed loop with an integral, which presses up to this effort.
///
/// # Examples
/// Down at 20 rpm until 3 A meet a standing shaft; this position is zero, and the shaft rests 5° away from it:
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::motor::StopHoming;
/// use drivetrain::time::Duration;
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let arm = StopHoming::new(AngularVelocity::from_rpm(-20.0), 3.0)?
///     .with_travel(Angle::from_degrees(200.0))?
///     .with_back_off(Angle::from_degrees(5.0))?;
/// assert_eq!(arm.with_window(Duration::ZERO).err(), Some(ConfigError::Unusable("window")));
/// # Ok::<(), ConfigError>(())
/// ```
///
/// The whole procedure with a DJI motor is a loop of a few lines, the same for a motor of the application:
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{Bus, Config, M2006};
/// use drivetrain::encoder::Position;
/// use drivetrain::motor::{HomingStep, Link, StopHoming};
/// use drivetrain::runner::{Nb, Runner};
/// use drivetrain::sim::{MotorConfig, Simulation};
/// use drivetrain::time::Duration;
/// use drivetrain::units::{Angle, AngularVelocity, Current};
///
/// let world = Simulation::new(1);
/// let stops = (Angle::from_degrees(-90.0), Angle::from_degrees(90.0)); // from where it starts
/// let motor = world.attach(MotorConfig::m2006(1).with_stops(stops.0, stops.1))?;
/// let mut bus = Bus::new();
/// let limit = Current::from_amperes(3.0);
/// let speed = PidConfig::new(0.2, 3.0, 0.0); // A per rad/s, A per rad
/// let arm = bus.attach(Config::<M2006>::new(1).speed_loop(speed).with_current_limit(limit))?;
/// let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
///
/// let mut homing = StopHoming::new(AngularVelocity::from_rpm(-30.0), 2.0)?;
/// let mut end = None;
/// while end.is_none() {
///     world.advance(Duration::from_millis(1));
///     runner.poll(16);
///     let Some(tick) = runner.due() else { continue };
///     if !runner.is_armed() {
///         _ = runner.arm(tick); // heard with the first frames
///     } else {
///         let bus = runner.device_mut();
///         let fresh = bus.state(arm).filter(|state| state.link == Link::Online);
///         let shaft = fresh.map(|state| (state.position, state.velocity, state.current.as_amperes()));
///         match homing.step(shaft, tick) {
///             HomingStep::Drive(velocity) => bus.set_velocity(arm, velocity)?,
///             HomingStep::SetPresentPosition(position) => bus.set_present_position(arm, position)?,
///             last => {
///                 bus.relax(arm); // done or failed: the tick below sends rest
///                 end = Some(last);
///             }
///         }
///     }
///     runner.tick(tick);
/// }
/// world.advance(Duration::from_millis(1));
/// assert_eq!(world.motor(motor).ok_or("detached")?.command, 0);
/// assert_eq!(end, Some(HomingStep::Done)); // a failure says its reason by `to_string`
/// let state = runner.device().state(arm).ok_or("detached")?;
/// assert!((state.position - Position::ZERO).as_degrees().abs() < 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StopHoming {
    velocity: AngularVelocity,
    effort: f32,
    speed: f32,
    window: Duration,
    timeout: Duration,
    travel: Angle,
    stop_at: Position,
    back_off: Angle,
    phase: Phase,
    started: Option<Instant>,
    /// The time of the step before.
    stepped: Option<Instant>,
}

/// After a longer step, the shaft is not known to have stood meanwhile.
const LONGEST_STEP: Duration = Duration::from_millis(20);

#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Phase {
    Start,
    /// From this position; pressing since then.
    Approach(Position, Option<Instant>),
    /// The position was set in the step before.
    Set,
    /// From this position.
    BackOff(Position),
    /// Done or failed: the last step, forever.
    Over(HomingStep),
}

impl StopHoming {
    /// Takes the velocity of the approach, whose sign is the way to the stop, and the effort of the shaft at the stop, in
    /// its measured unit: amperes or newton metres, above friction and load on the way.
    ///
    /// At first, a shaft below a tenth of the velocity stands; the window is 100 ms, the time-out 10 s, the travel a turn,
    /// the stop at zero, and there is no back-off.
    ///
    /// # Errors
    /// Names `velocity` when zero or not finite, `effort` when not above zero and finite.
    pub const fn new(velocity: AngularVelocity, effort: f32) -> Result<Self, ConfigError> {
        check!(positive("velocity", magnitude(velocity)));
        check!(positive("effort", effort));
        Ok(Self {
            velocity,
            effort,
            speed: magnitude(velocity) / 10.0,
            window: Duration::from_millis(100),
            timeout: Duration::from_secs(10),
            travel: Angle::from_turns(1.0),
            stop_at: Position::ZERO,
            back_off: Angle::ZERO,
            phase: Phase::Start,
            started: None,
            stepped: None,
        })
    }

    /// Sets the speed below which the shaft stands, in either direction.
    ///
    /// # Errors
    /// Names `speed` when not above zero and below the velocity of the approach.
    pub const fn with_standing_below(self, speed: AngularVelocity) -> Result<Self, ConfigError> {
        let speed = speed.as_rad_per_s();
        if speed > 0.0 && speed < magnitude(self.velocity) {
            Ok(Self { speed, ..self })
        } else {
            Err(ConfigError::Unusable("speed"))
        }
    }

    /// Sets the time for which the shaft has to stand against the effort: longer than the time to break loose from friction.
    ///
    /// # Errors
    /// Names `window` when zero, or not below the time-out: set a longer time-out first.
    pub const fn with_window(self, window: Duration) -> Result<Self, ConfigError> {
        if window.as_micros() > 0 && window.as_micros() < self.timeout.as_micros() {
            Ok(Self { window, ..self })
        } else {
            Err(ConfigError::Unusable("window"))
        }
    }

    /// Sets the time limit of the procedure, the back-off included.
    ///
    /// # Errors
    /// Names `timeout` when not above the window.
    pub const fn with_timeout(self, timeout: Duration) -> Result<Self, ConfigError> {
        if timeout.as_micros() > self.window.as_micros() {
            Ok(Self { timeout, ..self })
        } else {
            Err(ConfigError::Unusable("timeout"))
        }
    }

    /// Sets the largest turn of the shaft before the stop, in either direction.
    ///
    /// # Errors
    /// Names `travel` when not above zero and finite.
    pub const fn with_travel(self, travel: Angle) -> Result<Self, ConfigError> {
        check!(positive("travel", travel.as_radians()));
        Ok(Self { travel, ..self })
    }

    /// Sets the position of the stop.
    ///
    /// # Errors
    /// Names `position` when not finite.
    pub const fn with_stop_at(self, position: Position) -> Result<Self, ConfigError> {
        if position.is_finite() {
            Ok(Self { stop_at: position, ..self })
        } else {
            Err(ConfigError::NotFinite("position"))
        }
    }

    /// Sets the turn of the shaft back from the stop at the end.
    ///
    /// # Errors
    /// Names `back_off` when negative or not finite.
    pub const fn with_back_off(self, back_off: Angle) -> Result<Self, ConfigError> {
        check!(not_negative("back_off", back_off.as_radians()));
        Ok(Self { back_off, ..self })
    }

    /// Takes position, velocity and effort of the output shaft, `None` without fresh feedback, and returns the action of this tick.
    ///
    /// The position counts over many turns. The effort is the measured current of the motor in amperes, or its torque in newton metres.
    ///
    /// Call this in each tick from the first to the last. After a step of more than 20 ms the window begins anew, for nothing is known of
    /// the shaft meanwhile: a loop slower than 50 Hz finds no stop. Time that goes back counts as standing.
    pub fn step(
        &mut self,
        shaft: Option<(Position, AngularVelocity, f32)>,
        tick: Tick,
    ) -> HomingStep {
        let now = tick.now();
        let started = *self.started.get_or_insert(now);
        let before = self.stepped.replace(now);
        let is_known = before.is_some_and(|before| now.since(before) <= LONGEST_STEP);
        if let Phase::Over(last) = self.phase {
            return last;
        }
        let Some(shaft) = shaft.filter(is_finite) else {
            return self.end(HomingStep::LostFeedback);
        };
        if now.since(started) >= self.timeout {
            return self.end(HomingStep::TimedOut);
        }
        match self.phase {
            Phase::Start => self.approach(shaft, shaft.0, None, now),
            Phase::Approach(from, pressing) => {
                self.approach(shaft, from, pressing.filter(|_| is_known), now)
            }
            Phase::Set => self.back_off(shaft.0, shaft.0),
            Phase::BackOff(from) => self.back_off(shaft.0, from),
            Phase::Over(last) => last,
        }
    }

    fn approach(
        &mut self,
        (position, velocity, effort): Shaft,
        from: Position,
        pressing: Option<Instant>,
        now: Instant,
    ) -> HomingStep {
        let downwards = self.velocity.as_rad_per_s() < 0.0;
        let effort = if downwards { -effort } else { effort };
        // Braked by a load that drives it, a shaft is at no stop.
        let presses = effort >= self.effort && velocity.as_rad_per_s().abs() < self.speed;
        let since = presses.then(|| pressing.unwrap_or(now));
        if since.is_some_and(|since| now.since(since) >= self.window) {
            self.phase = Phase::Set;
            return HomingStep::SetPresentPosition(self.stop_at);
        }
        if (position - from).as_radians().abs() > self.travel.as_radians() {
            return self.end(HomingStep::NoStop);
        }
        self.phase = Phase::Approach(from, since);
        HomingStep::Drive(self.velocity)
    }

    fn back_off(&mut self, position: Position, from: Position) -> HomingStep {
        let moved = (position - from).as_radians();
        // A stop that yields is no way back.
        let away = if self.velocity.as_rad_per_s() < 0.0 { moved } else { -moved };
        if away >= self.back_off.as_radians() {
            return self.end(HomingStep::Done);
        }
        self.phase = Phase::BackOff(from);
        HomingStep::Drive(-self.velocity)
    }

    const fn end(&mut self, last: HomingStep) -> HomingStep {
        self.phase = Phase::Over(last);
        last
    }

    /// Returns whether the shaft is homed.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        matches!(self.phase, Phase::Over(HomingStep::Done))
    }
}

const fn magnitude(velocity: AngularVelocity) -> f32 {
    let value = velocity.as_rad_per_s();
    if value < 0.0 { -value } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn homing(rad_per_s: f32) -> Result<StopHoming, ConfigError> {
        StopHoming::new(AngularVelocity::from_rad_per_s(rad_per_s), 3.0)?
            .with_travel(Angle::from_radians(1.5))?
            .with_back_off(Angle::from_radians(0.1))?
            .with_stop_at(Position::from_turns(4))
    }

    fn down() -> StopHoming {
        homing(-2.0).unwrap()
    }

    fn at(radians: f32, rad_per_s: f32, effort: f32) -> Option<Shaft> {
        let position = Position::from_angle(Angle::from_radians(radians));
        Some((position, AngularVelocity::from_rad_per_s(rad_per_s), effort))
    }

    fn tick(ms: u64) -> Tick {
        Tick::new(Instant::from_micros(1_000 * ms), 0.001)
    }

    const DRIVE: HomingStep = HomingStep::Drive(AngularVelocity::from_rad_per_s(-2.0));
    const BACK: HomingStep = HomingStep::Drive(AngularVelocity::from_rad_per_s(2.0));

    #[test]
    fn it_takes_effort_and_standstill_for_the_whole_window() {
        let mut homing = down();
        for ms in 0..60 {
            assert_eq!(homing.step(at(0.0, -0.1, -3.5), tick(ms)), DRIVE); // presses
        }
        assert_eq!(homing.step(at(-0.1, -0.9, -3.5), tick(60)), DRIVE); // and breaks loose
        for ms in 61..400 {
            let wrong_way = 3.5; // braked by a load that drives it
            let effort = if ms < 200 { -2.9 } else { wrong_way };
            assert_eq!(homing.step(at(-0.2, 0.0, effort), tick(ms)), DRIVE);
        }
        for ms in 400..500 {
            assert_eq!(homing.step(at(-0.3, 0.0, -3.0), tick(ms)), DRIVE);
        }
        let found = homing.step(at(-0.3, 0.0, -3.0), tick(500));
        assert_eq!(found, HomingStep::SetPresentPosition(Position::from_turns(4)));
        // From now on the position is told in the new terms.
        let turned = |radians| {
            let position = Position::from_turns(4) + Angle::from_radians(radians);
            Some((position, AngularVelocity::ZERO, 0.0))
        };
        assert_eq!(homing.step(turned(0.0), tick(501)), BACK);
        assert_eq!(homing.step(turned(0.05), tick(502)), BACK);
        assert!(!homing.is_done());
        assert_eq!(homing.step(turned(0.11), tick(503)), HomingStep::Done);
        assert_eq!(homing.step(None, tick(9_999)), HomingStep::Done);
        assert!(homing.is_done());
    }

    #[test]
    fn a_stop_that_yields_is_no_way_back_in_either_direction() {
        for (mut homing, direction) in [(down(), -1.0), (homing(2.0).unwrap(), 1.0)] {
            let mut step = |radians: f32, ms| {
                homing.step(at(radians * direction, 0.0, 9.0 * direction), tick(ms))
            };
            for ms in (0..100).step_by(20) {
                assert!(matches!(step(0.0, ms), HomingStep::Drive(_)));
            }
            assert!(matches!(step(0.0, 100), HomingStep::SetPresentPosition(_)));
            for (ms, radians) in [(101, 0.0), (102, 0.2), (103, -0.09)] {
                assert!(matches!(step(radians, ms), HomingStep::Drive(_)), "{radians} further on");
            }
            assert_eq!(step(-0.11, 104), HomingStep::Done);
        }
    }

    #[test]
    fn each_failure_has_its_name_and_stays() {
        let nan = at(0.0, f32::NAN, 0.0);
        let long = tick(10_000);
        for (shaft, when, error) in [
            (None, tick(1), HomingStep::LostFeedback),
            (nan, tick(1), HomingStep::LostFeedback),
            (at(0.0, 0.0, 0.0), long, HomingStep::TimedOut),
            (at(-1.6, -2.0, -1.0), tick(800), HomingStep::NoStop),
            (at(1.6, 2.0, -1.0), tick(800), HomingStep::NoStop), // wired the wrong way round
        ] {
            let mut homing = down();
            assert_eq!(homing.step(at(0.0, 0.0, 0.0), tick(0)), DRIVE);
            assert_eq!(homing.step(shaft, when), error);
            assert_eq!(homing.step(at(0.0, 0.0, -9.0), tick(20_000)), error);
        }
    }

    #[test]
    fn parameters_that_make_no_sense_are_named() {
        let velocity = AngularVelocity::from_rad_per_s;
        let angle = Angle::from_radians;
        for (refused, error) in [
            (StopHoming::new(velocity(0.0), 1.0), ConfigError::NotPositive("velocity")),
            (StopHoming::new(velocity(f32::NAN), 1.0), ConfigError::NotPositive("velocity")),
            (StopHoming::new(velocity(1.0), -1.0), ConfigError::NotPositive("effort")),
            (down().with_standing_below(velocity(2.0)), ConfigError::Unusable("speed")),
            (down().with_standing_below(velocity(f32::NAN)), ConfigError::Unusable("speed")),
            (down().with_window(Duration::ZERO), ConfigError::Unusable("window")),
            (down().with_window(Duration::from_secs(10)), ConfigError::Unusable("window")),
            (down().with_timeout(Duration::from_millis(100)), ConfigError::Unusable("timeout")),
            (down().with_travel(angle(0.0)), ConfigError::NotPositive("travel")),
            (
                down().with_stop_at(Position::from_angle(angle(f32::NAN))),
                ConfigError::NotFinite("position"),
            ),
            (down().with_back_off(angle(-0.1)), ConfigError::Negative("back_off")),
        ] {
            assert_eq!(refused, Err(error));
        }
    }
}
