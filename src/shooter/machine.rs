use super::loader::{Feed, Loader};
use super::{ShooterConfig, ShooterFeedback, ShooterOrder, ShooterState, ShooterTargets};
use crate::encoder::Position;
use crate::error::ConfigError;
use crate::time::{Duration, Tick};
use crate::units::AngularVelocity;
use crate::wire::referee::BarrelHeat;

/// Time within the tolerance after which the wheels are ready.
const SETTLED_S: f32 = 0.02;
/// The longest time to spin up.
const SPIN_UP_S: f32 = 3.0;
/// Longest usable time step: for a longer one, the shooter rests for that tick.
const LONGEST_STEP_S: f32 = 0.1;

/// Two friction wheels and a loader: see the [module](crate::shooter).
///
/// While the position is right, no more chambers pass than ordered. A position that cannot be that of the loader ends the shot, with
/// [`LoaderLost`](ShooterState::LoaderLost):
///
/// | feedback of the loader | example | the shooter stops |
/// |---|---|---|
/// | position or velocity is NaN or infinite | | at once |
/// | position and velocity stand | a frozen sensor | as by a jam |
/// | the goal lies further away than the shots to come and a chamber, or a chamber back | `set_present_position`, a drive that counts anew | at once |
/// | by its velocity, the loader has turned by one and a half chambers since the last count | a smaller jump, a position that stands | at most half a chamber late |
///
/// Each turn back from a jam adds half a chamber to the distance of the goal. **After a wrong position the chambers stand elsewhere**: an order
/// to rest ends the fault, and further shots end between two chambers. Turn the loader to a chamber, and make a new `Shooter`.
///
/// # Examples
/// One shot, with motors that follow at once:
/// ```
/// use drivetrain::encoder::Position;
/// use drivetrain::shooter::{ShooterOrder, Shooter, ShooterFeedback};
/// use drivetrain::time::{Instant, Tick};
/// use drivetrain::units::{Angle, AngularVelocity};
/// use drivetrain::wire::referee::BarrelHeat;
///
/// let mut shooter = Shooter::new(AngularVelocity::from_rpm(6_000.0), 8, 10.0)?;
/// let (mut wheels, mut velocity, mut angle_rad) = (AngularVelocity::ZERO, AngularVelocity::ZERO, 0.0);
/// for ms in 1..=500 {
///     let position = Position::from_angle(Angle::from_radians(angle_rad));
///     let feedback = ShooterFeedback {
///         is_armed: true,
///         wheels: [Some(wheels); 2],
///         loader: Some((position, velocity)),
///         heat: Some(BarrelHeat { heat: 0, limit: 200, cooling_per_s: 10 }), // `Referee::heat_17mm`
///     };
///     let order = if ms < 100 { ShooterOrder::Spin } else { ShooterOrder::Fire(1) };
///     let targets = shooter.update(order, &feedback, Tick::new(Instant::from_micros(1_000 * ms), 0.001));
///     (wheels, velocity) = (targets.wheels, targets.loader);
///     angle_rad += 0.001 * velocity.as_rad_per_s();
/// }
/// assert_eq!(shooter.shots(), 1); // however long the trigger is held
/// assert!((angle_rad.to_degrees() - 45.0).abs() < 5.0); // a chamber further
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Shooter {
    config: ShooterConfig,
    state: ShooterState,
    loader: Loader,
    heat: Heat,
    /// Shots of the burst not yet released.
    ordered: u8,
    /// Whether the trigger was released since the shooter was armed, and since the last burst.
    is_released: bool,
    settled_s: f32,
    spinning_up_s: f32,
    shots: u32,
}

impl Shooter {
    /// Takes the speed of the friction wheels, the number of chambers in a turn of the loader's output shaft, and the shots in 1 s.
    ///
    /// | parameter | default |
    /// |---|---|
    /// | tolerance of the wheels | 1 % of their speed |
    /// | heat of a shot | 10, a ball of 17 mm; 100 for 42 mm |
    /// | reserve below the heat limit | the heat of one shot |
    /// | a loader that stands is jammed after | 100 ms |
    /// | tries to clear a jam | 3 |
    /// | gain from way to speed of the loader | 20 rad/s per rad |
    /// | heat limit without the referee system | none: nothing is shot |
    ///
    /// # Examples
    /// ```
    /// use drivetrain::shooter::Shooter;
    /// use drivetrain::units::AngularVelocity;
    ///
    /// let shooter = Shooter::new(AngularVelocity::from_rpm(6_000.0), 8, 10.0)?.with_tries(5);
    /// assert!((shooter.feed_velocity().as_rad_per_s() - 7.854).abs() < 1e-3); // 10 of 8 chambers in 1 s
    /// let error = shooter.with_tolerance(0.0).unwrap_err();
    /// assert_eq!(error.to_string(), "tolerance: must be more than zero, and finite");
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    ///
    /// # Errors
    /// Names `wheels`, `chambers` or `shots_per_s` when it is not above zero and finite; chambers and shots are at most 64.
    pub const fn new(
        wheels: AngularVelocity,
        chambers: u8,
        shots_per_s: f32,
    ) -> Result<Self, ConfigError> {
        let config = ShooterConfig::new(wheels, chambers, shots_per_s);
        Self {
            config,
            state: ShooterState::Rest,
            loader: Loader::new(chambers, config.tries),
            heat: Heat::new(),
            ordered: 0,
            is_released: false,
            settled_s: 0.0,
            spinning_up_s: 0.0,
            shots: 0,
        }
        .checked()
    }

    const fn checked(self) -> Result<Self, ConfigError> {
        match self.config.validate() {
            Ok(()) => Ok(self),
            Err(error) => Err(error),
        }
    }

    /// Sets the largest error of the wheels, as a share of their speed, at which a shot is released.
    ///
    /// # Errors
    /// `tolerance` is not above zero and finite.
    pub const fn with_tolerance(mut self, share: f32) -> Result<Self, ConfigError> {
        self.config.tolerance = share;
        self.checked()
    }

    /// Sets the heat of a shot and the heat to keep free below the limit.
    #[must_use]
    pub const fn with_heat(mut self, of_shot: u16, reserve: u16) -> Self {
        (self.config.heat_of_shot, self.config.reserve) = (of_shot, Some(reserve));
        self
    }

    /// Sets the time after which a driven loader at standstill counts as jammed.
    ///
    /// # Errors
    /// `jam_after` is not above zero.
    pub const fn with_jam_after(mut self, time: Duration) -> Result<Self, ConfigError> {
        self.config.jam_s = time.as_secs_f32();
        self.checked()
    }

    /// Sets the number of attempts to clear a jam of one shot. After the last, the shooter stops with
    /// [`Jammed`](ShooterState::Jammed).
    #[must_use]
    pub const fn with_tries(mut self, tries: u8) -> Self {
        self.loader.allow_tries(tries);
        self
    }

    /// Sets the gain of the loader: speed per distance to its goal, in rad/s per rad.
    ///
    /// # Errors
    /// `loader_gain` is not above zero and finite.
    pub const fn with_loader_gain(mut self, per_s: f32) -> Result<Self, ConfigError> {
        self.config.gain_per_s = per_s;
        self.checked()
    }

    /// Sets limit and cooling for practice, while the referee system is silent. The field `heat` is ignored.
    #[must_use]
    pub const fn with_heat_without_referee(mut self, heat: BarrelHeat) -> Self {
        self.config.without_referee = Some(heat);
        self
    }

    /// Returns the feeding speed of the loader.
    #[must_use]
    pub const fn feed_velocity(&self) -> AngularVelocity {
        self.config.feed_velocity()
    }

    /// Takes order and feedback of a tick, and returns the target speeds of the motors.
    ///
    /// While the robot is disarmed, all motors stand and no shot waits. If the time step is not a positive number up to 0.1 s, all motors
    /// stand for that tick, and nothing else changes.
    ///
    /// Costs 356 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn update(
        &mut self,
        order: ShooterOrder,
        feedback: &ShooterFeedback,
        tick: Tick,
    ) -> ShooterTargets {
        let dt_s = tick.dt_s();
        if !(dt_s > 0.0 && dt_s <= LONGEST_STEP_S) {
            return ShooterTargets::REST;
        }
        self.heat.update(feedback.heat, self.config.without_referee, dt_s);
        if !feedback.is_armed {
            self.is_released = false;
            return self.rest();
        }
        let fires = matches!(order, ShooterOrder::Fire(1..));
        self.is_released |= !fires;
        if order == ShooterOrder::Rest {
            return self.rest();
        }
        if self.state.is_fault() {
            return ShooterTargets::REST;
        }
        let known = feedback
            .loader
            .filter(|(position, velocity)| position.is_finite() && velocity.is_finite());
        let (wheels, loader) = match (feedback.wheels, known) {
            ([Some(left), Some(right)], Some(loader)) => ([left, right], loader),
            ([Some(_), Some(_)], None) => return self.fail(ShooterState::LoaderLost),
            _ => return self.fail(ShooterState::WheelLost),
        };
        if self.state == ShooterState::Rest {
            self.loader.start(loader.0);
            (self.settled_s, self.spinning_up_s) = (0.0, 0.0);
        }
        match order {
            ShooterOrder::Fire(shots @ 1..) if self.is_released => {
                (self.ordered, self.is_released) = (shots, false);
            }
            ShooterOrder::Fire(1..) => {}
            _ => self.ordered = 0,
        }
        let is_settled = match self.await_speed(wheels, dt_s) {
            Ok(is_settled) => is_settled,
            Err(fault) => return self.fail(fault),
        };
        let is_kept_waiting = self.let_go(is_settled, loader.0);
        self.feed(loader, is_settled, is_kept_waiting, dt_s)
    }

    /// Tells whether the wheels have been at their speed for the settling time.
    fn await_speed(
        &mut self,
        wheels: [AngularVelocity; 2],
        dt_s: f32,
    ) -> Result<bool, ShooterState> {
        let target = self.config.wheels.as_rad_per_s();
        let allowed = self.config.tolerance * target;
        let are_within =
            wheels.iter().all(|wheel| (wheel.as_rad_per_s() - target).abs() <= allowed);
        if are_within {
            self.settled_s = (self.settled_s + dt_s).min(1.0);
            if self.settled_s >= SETTLED_S {
                self.spinning_up_s = 0.0;
                return Ok(true);
            }
        } else {
            self.settled_s = 0.0;
        }
        self.spinning_up_s += dt_s;
        if self.spinning_up_s > SPIN_UP_S { Err(ShooterState::WheelSlow) } else { Ok(false) }
    }

    /// Releases the next shot of the burst if wheels, loader and heat allow. Returns whether a shot waits for the heat alone.
    fn let_go(&mut self, is_settled: bool, loader: Position) -> bool {
        if self.ordered == 0 || !is_settled || !self.loader.takes_next(loader) {
            return false;
        }
        let of_shot = self.config.heat_of_shot;
        let fits = self.heat.take(of_shot, self.config.reserve.unwrap_or(of_shot));
        if fits {
            self.loader.admit();
            self.ordered -= 1;
        }
        !fits
    }

    fn feed(
        &mut self,
        loader: (Position, AngularVelocity),
        is_settled: bool,
        is_kept_waiting: bool,
        dt_s: f32,
    ) -> ShooterTargets {
        let feed = self.config.feed_velocity().as_rad_per_s();
        let rates = (feed, self.config.gain_per_s, self.config.jam_s);
        let (step, counted) = self.loader.step(loader, rates, dt_s);
        self.shots = self.shots.saturating_add(counted);
        let (state, loader) = match step {
            Feed::Jammed => return self.fail(ShooterState::Jammed),
            Feed::Lost => return self.fail(ShooterState::LoaderLost),
            Feed::Forward(velocity) => (ShooterState::Feeding, velocity),
            Feed::Back(velocity) => (ShooterState::Clearing, velocity),
            Feed::Idle if !is_settled => (ShooterState::SpinningUp, 0.0),
            Feed::Idle if is_kept_waiting => (ShooterState::Cooling, 0.0),
            Feed::Idle => (ShooterState::Ready, 0.0),
        };
        self.state = state;
        ShooterTargets {
            wheels: self.config.wheels,
            loader: AngularVelocity::from_rad_per_s(loader),
        }
    }

    fn rest(&mut self) -> ShooterTargets {
        self.state = ShooterState::Rest;
        self.ordered = 0;
        self.loader.stop();
        ShooterTargets::REST
    }

    fn fail(&mut self, fault: ShooterState) -> ShooterTargets {
        self.rest();
        self.state = fault;
        ShooterTargets::REST
    }

    /// Returns the state of the shooter.
    #[must_use]
    pub const fn state(&self) -> ShooterState {
        self.state
    }

    /// Returns the number of shots since construction, saturating.
    #[must_use]
    pub const fn shots(&self) -> u32 {
        self.shots
    }

    /// Returns the number of attempts to clear the jam of the due shot.
    #[must_use]
    pub const fn tries(&self) -> u8 {
        self.loader.tries()
    }

    /// Returns the heat of the barrel: the reported heat, plus the heat of later shots.
    #[must_use]
    pub const fn heat(&self) -> f32 {
        self.heat.get()
    }
}

/// Heat of the barrel: the larger of the referee system's report and of the sum over released shots.
///
/// Heat of a shot counted twice cools down like any other. Heat of a missed shot is in the next report.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Heat {
    heat: f32,
    limit: Option<u16>,
}

impl Heat {
    const fn new() -> Self {
        Self { heat: 0.0, limit: None }
    }

    /// Cools for `dt_s` seconds, and takes a report. Without a report, limit and cooling are those of `without`.
    fn update(&mut self, report: Option<BarrelHeat>, without: Option<BarrelHeat>, dt_s: f32) {
        let source = report.or(without);
        self.limit = source.map(|source| source.limit);
        let cooling = source.map_or(0.0, |source| f32::from(source.cooling_per_s));
        self.heat = (self.heat - cooling * dt_s).max(0.0);
        if let Some(report) = report {
            self.heat = self.heat.max(f32::from(report.heat));
        }
    }

    /// Adds the heat of a shot if the sum and the reserve are at most the limit. Returns whether the heat was added.
    fn take(&mut self, of_shot: u16, reserve: u16) -> bool {
        let after = self.heat + f32::from(of_shot);
        let fits = self.limit.is_some_and(|limit| after + f32::from(reserve) <= f32::from(limit));
        if fits {
            self.heat = after;
        }
        fits
    }

    const fn get(&self) -> f32 {
        self.heat
    }
}
