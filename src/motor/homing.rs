use crate::encoder::Position;
use crate::time::{Duration, Instant, Tick};
use crate::units::{Angle, AngularVelocity};

/// How a shaft is homed against a mechanical stop.
///
/// # Examples
/// ```
/// use drivetrain::encoder::Position;
/// use drivetrain::motor::StopHomingConfig;
/// use drivetrain::time::Duration;
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// // Down at 20 rpm until 3 A meet a shaft that stands: that is zero, and 5° free of it is the place to rest.
/// const ARM: StopHomingConfig = StopHomingConfig::new(AngularVelocity::from_rpm(-20.0), 3.0)
///     .with_travel(Angle::from_degrees(200.0))
///     .with_back_off(Angle::from_degrees(5.0))
///     .with_stop_at(Position::ZERO);
/// assert_eq!(ARM.validate(), Ok(()));
/// assert_eq!(ARM.with_window(Duration::ZERO).validate(), Err("window"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StopHomingConfig {
    velocity: AngularVelocity,
    effort: f32,
    speed: f32,
    window: Duration,
    timeout: Duration,
    travel: Angle,
    stop_at: Position,
    back_off: Angle,
}

impl StopHomingConfig {
    /// Takes the velocity of the approach, whose sign is the way to the stop, and the effort that the shaft meets there,
    /// in the unit in which it is measured: amperes or newton metres, above what friction and load ask for on the way.
    ///
    /// A shaft below a tenth of the velocity stands; the window is 100 ms, the time-out 10 s, the travel a turn, the stop
    /// at zero, and there is no back-off.
    #[must_use]
    pub const fn new(velocity: AngularVelocity, effort: f32) -> Self {
        let speed = velocity.as_rad_per_s() / 10.0;
        Self {
            velocity,
            effort,
            speed: if speed < 0.0 { -speed } else { speed },
            window: Duration::from_millis(100),
            timeout: Duration::from_secs(10),
            travel: Angle::from_turns(1.0),
            stop_at: Position::ZERO,
            back_off: Angle::ZERO,
        }
    }

    /// Sets the speed below which the shaft stands, in either direction.
    #[must_use]
    pub const fn with_standing_below(self, speed: AngularVelocity) -> Self {
        Self { speed: speed.as_rad_per_s(), ..self }
    }

    /// Sets for how long the shaft has to stand against the effort: longer than it takes to break loose from friction.
    #[must_use]
    pub const fn with_window(self, window: Duration) -> Self {
        Self { window, ..self }
    }

    /// Sets after how long the procedure gives up, the back-off included.
    #[must_use]
    pub const fn with_timeout(self, timeout: Duration) -> Self {
        Self { timeout, ..self }
    }

    /// Sets how far the shaft may turn until the stop is there, in either direction.
    #[must_use]
    pub const fn with_travel(self, travel: Angle) -> Self {
        Self { travel, ..self }
    }

    /// Sets the position that the stop has.
    #[must_use]
    pub const fn with_stop_at(self, position: Position) -> Self {
        Self { stop_at: position, ..self }
    }

    /// Sets how far the shaft turns back from the stop in the end.
    #[must_use]
    pub const fn with_back_off(self, back_off: Angle) -> Self {
        Self { back_off, ..self }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the first that is not usable.
    pub const fn validate(&self) -> Result<(), &'static str> {
        let velocity = self.velocity.as_rad_per_s();
        let fastest = if velocity < 0.0 { -velocity } else { velocity };
        let (travel, back_off) = (self.travel.as_radians(), self.back_off.as_radians());
        Err(if !(fastest > 0.0 && fastest.is_finite()) {
            "approach velocity"
        } else if !(self.effort > 0.0 && self.effort.is_finite()) {
            "effort"
        } else if !(self.speed > 0.0 && self.speed < fastest) {
            "standing speed"
        } else if self.window.as_micros() == 0 {
            "window"
        } else if self.timeout.as_micros() <= self.window.as_micros() {
            "time-out"
        } else if !(travel > 0.0 && travel.is_finite()) {
            "travel"
        } else if !self.stop_at.is_finite() {
            "position of the stop"
        } else if !(back_off >= 0.0 && back_off.is_finite()) {
            "back-off"
        } else {
            return Ok(());
        })
    }
}

/// What a homing procedure has to know of its motor in each tick, all in the direction of the output shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShaftState {
    /// Where it is, over many turns.
    pub position: Position,
    /// How fast it turns.
    pub velocity: AngularVelocity,
    /// What the motor does: its measured current in amperes, or its torque in newton metres.
    pub effort: f32,
}

impl ShaftState {
    fn is_finite(&self) -> bool {
        self.position.is_finite() && self.velocity.is_finite() && self.effort.is_finite()
    }
}

/// What to do in this tick.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum HomingStep {
    /// Set this velocity.
    Drive(AngularVelocity),
    /// The stop is there: call the present position this, once, and set no target.
    SetPresentPosition(Position),
    /// It is homed: relax the motor, or give it its first target.
    Done,
    /// It is not: relax the motor. Later steps say the same.
    Failed(HomingError),
}

/// Why a shaft was not homed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum HomingError {
    /// It took too long: the motor does not move, and does not press against anything either.
    TimedOut,
    /// The shaft turned as far as it may, and there was no stop.
    NoStop,
    /// There was no fresh feedback, or it was not finite.
    LostFeedback,
}

impl core::fmt::Display for HomingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TimedOut => "homing took too long",
            Self::NoStop => "no stop within the travel",
            Self::LostFeedback => "no fresh feedback while homing",
        })
    }
}

impl core::error::Error for HomingError {}

/// Homes a shaft against a mechanical stop: goes there slowly until the motor presses and the shaft stands.
///
/// ```text
/// approach ──> effort >= threshold and speed < threshold, for the window ──> set the position ──> back off ──> done
///    └── travel, time-out, feedback ──> failed
/// ```
///
/// Does no I/O and sets nothing itself: it is fed with the state of the shaft in each tick and answers with what to set. A
/// shaft that already touches the stop is homed where it is.
///
/// What bounds the torque is the motor: give it a current limit, or its speed loop an output limit, that the mechanics
/// bear and that is above the effort of the stop; and a speed loop with an integral, that presses until it gets there.
///
/// # Examples
/// The whole procedure with a DJI motor is a loop of a few lines, and with a motor of your own it is the same.
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{Bus, Config, M2006};
/// use drivetrain::encoder::Position;
/// use drivetrain::motor::{HomingStep, Link, ShaftState, StopHoming, StopHomingConfig};
/// use drivetrain::runner::{Nb, Runner};
/// use drivetrain::sim::{MotorConfig, Simulation};
/// use drivetrain::time::Duration;
/// use drivetrain::units::{Angle, AngularVelocity, Current};
///
/// let world = Simulation::new(1);
/// let stops = (Angle::from_degrees(-90.0), Angle::from_degrees(90.0)); // from where it starts
/// world.attach(MotorConfig::m2006(1).with_stops(stops.0, stops.1))?;
/// let mut bus = Bus::new();
/// let limit = Current::from_amperes(3.0);
/// let speed = PidConfig::new(0.2, 3.0, 0.0); // A per rad/s, A per rad
/// let arm = bus.attach(Config::<M2006>::new(1).speed_loop(speed).with_current_limit(limit))?;
/// let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
///
/// let config = StopHomingConfig::new(AngularVelocity::from_rpm(-30.0), 2.0);
/// let mut homing = StopHoming::new(config)?;
/// let mut homed = false;
/// while !homed {
///     world.advance(Duration::from_millis(1));
///     runner.poll(16);
///     let Some(tick) = runner.due() else { continue };
///     if !runner.is_armed() {
///         _ = runner.arm(tick); // heard with the first frames
///     } else {
///         let bus = runner.device_mut();
///         let fresh = bus.state(arm).filter(|state| state.link == Link::Online);
///         let shaft = fresh.map(|state| ShaftState {
///             position: state.position,
///             velocity: state.velocity,
///             effort: state.current.as_amperes(),
///         });
///         match homing.step(shaft, tick) {
///             HomingStep::Drive(velocity) => bus.set_velocity(arm, velocity)?,
///             HomingStep::SetPresentPosition(position) => bus.set_present_position(arm, position)?,
///             HomingStep::Done => homed = true,
///             HomingStep::Failed(why) => return Err(why.into()),
///         }
///     }
///     runner.tick(tick);
/// }
/// let state = runner.device().state(arm).ok_or("detached")?;
/// assert!((state.position - Position::ZERO).as_degrees().abs() < 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct StopHoming {
    config: StopHomingConfig,
    phase: Phase,
    started: Option<Instant>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Start,
    /// From this position; pressing since then.
    Approach(Position, Option<Instant>),
    /// The position was set in the step before.
    Set,
    /// From this position.
    BackOff(Position),
    Done,
    Failed(HomingError),
}

impl StopHoming {
    /// Takes the configuration: begins with the first step.
    ///
    /// # Errors
    /// Names the parameter that is not usable.
    pub const fn new(config: StopHomingConfig) -> Result<Self, &'static str> {
        match config.validate() {
            Ok(()) => Ok(Self { config, phase: Phase::Start, started: None }),
            Err(parameter) => Err(parameter),
        }
    }

    /// Takes the state of the shaft, `None` without fresh feedback, and returns what to do in this tick.
    ///
    /// Call it in each tick from the first to the last. Time that goes back counts as none that passed.
    pub fn step(&mut self, shaft: Option<ShaftState>, tick: Tick) -> HomingStep {
        let now = tick.now();
        let started = *self.started.get_or_insert(now);
        match self.phase {
            Phase::Done => return HomingStep::Done,
            Phase::Failed(error) => return HomingStep::Failed(error),
            _ => {}
        }
        let Some(shaft) = shaft.filter(ShaftState::is_finite) else {
            return self.fail(HomingError::LostFeedback);
        };
        if now.since(started) >= self.config.timeout {
            return self.fail(HomingError::TimedOut);
        }
        match self.phase {
            Phase::Start => self.approach(shaft, shaft.position, None, now),
            Phase::Approach(from, pressing) => self.approach(shaft, from, pressing, now),
            Phase::Set => self.back_off(shaft, shaft.position),
            Phase::BackOff(from) => self.back_off(shaft, from),
            Phase::Done | Phase::Failed(_) => HomingStep::Done,
        }
    }

    fn approach(
        &mut self,
        shaft: ShaftState,
        from: Position,
        pressing: Option<Instant>,
        now: Instant,
    ) -> HomingStep {
        let config = &self.config;
        let downwards = config.velocity.as_rad_per_s() < 0.0;
        let effort = if downwards { -shaft.effort } else { shaft.effort };
        // Braked by a load that drives it, a shaft is at no stop.
        let presses = effort >= config.effort && shaft.velocity.as_rad_per_s().abs() < config.speed;
        let since = presses.then(|| pressing.unwrap_or(now));
        if since.is_some_and(|since| now.since(since) >= config.window) {
            self.phase = Phase::Set;
            return HomingStep::SetPresentPosition(config.stop_at);
        }
        if (shaft.position - from).as_radians().abs() > config.travel.as_radians() {
            return self.fail(HomingError::NoStop);
        }
        self.phase = Phase::Approach(from, since);
        HomingStep::Drive(config.velocity)
    }

    fn back_off(&mut self, shaft: ShaftState, from: Position) -> HomingStep {
        let moved = (shaft.position - from).as_radians();
        // A stop that yields is no way back.
        let away = if self.config.velocity.as_rad_per_s() < 0.0 { moved } else { -moved };
        if away >= self.config.back_off.as_radians() {
            self.phase = Phase::Done;
            return HomingStep::Done;
        }
        self.phase = Phase::BackOff(from);
        HomingStep::Drive(-self.config.velocity)
    }

    const fn fail(&mut self, error: HomingError) -> HomingStep {
        self.phase = Phase::Failed(error);
        HomingStep::Failed(error)
    }

    /// Tells whether the shaft is homed.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        matches!(self.phase, Phase::Done)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOWN: StopHomingConfig =
        StopHomingConfig::new(AngularVelocity::from_rad_per_s(-2.0), 3.0)
            .with_travel(Angle::from_radians(1.5))
            .with_back_off(Angle::from_radians(0.1))
            .with_stop_at(Position::from_turns(4));

    fn at(radians: f32, rad_per_s: f32, effort: f32) -> Option<ShaftState> {
        Some(ShaftState {
            position: Position::from_angle(Angle::from_radians(radians)),
            velocity: AngularVelocity::from_rad_per_s(rad_per_s),
            effort,
        })
    }

    fn tick(ms: u64) -> Tick {
        Tick::new(Instant::from_micros(1_000 * ms), 0.001)
    }

    const DRIVE: HomingStep = HomingStep::Drive(AngularVelocity::from_rad_per_s(-2.0));
    const BACK: HomingStep = HomingStep::Drive(AngularVelocity::from_rad_per_s(2.0));

    #[test]
    fn it_takes_effort_and_standstill_for_the_whole_window() {
        let mut homing = StopHoming::new(DOWN).unwrap();
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
            at(0.0, 0.0, 0.0).map(|shaft| ShaftState {
                position: Position::from_turns(4) + Angle::from_radians(radians),
                ..shaft
            })
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
        let up = StopHomingConfig { velocity: AngularVelocity::from_rad_per_s(2.0), ..DOWN };
        for (config, direction) in [(DOWN, -1.0), (up, 1.0)] {
            let mut homing = StopHoming::new(config).unwrap();
            let mut step = |radians: f32, ms| {
                homing.step(at(radians * direction, 0.0, 9.0 * direction), tick(ms))
            };
            _ = step(0.0, 0);
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
            (None, tick(1), HomingError::LostFeedback),
            (nan, tick(1), HomingError::LostFeedback),
            (at(0.0, 0.0, 0.0), long, HomingError::TimedOut),
            (at(-1.6, -2.0, -1.0), tick(800), HomingError::NoStop),
            (at(1.6, 2.0, -1.0), tick(800), HomingError::NoStop), // wired the wrong way round
        ] {
            let mut homing = StopHoming::new(DOWN).unwrap();
            assert_eq!(homing.step(at(0.0, 0.0, 0.0), tick(0)), DRIVE);
            assert_eq!(homing.step(shaft, when), HomingStep::Failed(error));
            assert_eq!(homing.step(at(0.0, 0.0, -9.0), tick(20_000)), HomingStep::Failed(error));
        }
    }

    #[test]
    fn parameters_that_make_no_sense_are_named() {
        let velocity = AngularVelocity::from_rad_per_s;
        let angle = Angle::from_radians;
        for (config, name) in [
            (StopHomingConfig::new(velocity(0.0), 1.0), "approach velocity"),
            (StopHomingConfig::new(velocity(f32::NAN), 1.0), "approach velocity"),
            (StopHomingConfig::new(velocity(1.0), -1.0), "effort"),
            (DOWN.with_standing_below(velocity(2.0)), "standing speed"),
            (DOWN.with_standing_below(velocity(f32::NAN)), "standing speed"),
            (DOWN.with_window(Duration::ZERO), "window"),
            (DOWN.with_timeout(Duration::from_millis(100)), "time-out"),
            (DOWN.with_travel(angle(0.0)), "travel"),
            (DOWN.with_stop_at(Position::from_angle(angle(f32::NAN))), "position of the stop"),
            (DOWN.with_back_off(angle(-0.1)), "back-off"),
        ] {
            assert_eq!(StopHoming::new(config).map(|_| ()), Err(name));
        }
    }
}
