use super::loader::{Feed, Loader};
use super::{
    LoaderFeedback, ShooterConfig, ShooterFault, ShooterFeedback, ShooterOrder, ShooterState,
    ShooterTargets,
};
use crate::error::ConfigError;
use crate::time::Tick;
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
/// # Examples
/// One shot, with motors that follow at once:
/// ```
/// use drivetrain::encoder::Position;
/// use drivetrain::shooter::{LoaderFeedback, ShooterOrder, Shooter, ShooterConfig, ShooterFeedback};
/// use drivetrain::time::{Instant, Tick};
/// use drivetrain::units::{Angle, AngularVelocity};
/// use drivetrain::wire::referee::BarrelHeat;
///
/// let config = ShooterConfig::new(AngularVelocity::from_rpm(6_000.0), 8, 10.0);
/// let mut shooter = Shooter::new(config)?;
/// let (mut wheels, mut velocity, mut angle_rad) = (AngularVelocity::ZERO, AngularVelocity::ZERO, 0.0);
/// for ms in 1..=500 {
///     let position = Position::from_angle(Angle::from_radians(angle_rad));
///     let feedback = ShooterFeedback {
///         is_armed: true,
///         wheels: [Some(wheels); 2],
///         loader: Some(LoaderFeedback { position, velocity }),
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
    /// Takes a configuration.
    ///
    /// # Errors
    /// Names the unusable parameter.
    pub const fn new(config: ShooterConfig) -> Result<Self, ConfigError> {
        match config.validate() {
            Ok(()) => Ok(Self {
                config,
                state: ShooterState::Rest,
                loader: Loader::new(config.chambers, config.tries),
                heat: Heat::new(),
                ordered: 0,
                is_released: false,
                settled_s: 0.0,
                spinning_up_s: 0.0,
                shots: 0,
            }),
            Err(error) => Err(error),
        }
    }

    /// Takes order and feedback of a tick, and returns the target speeds of the motors.
    ///
    /// While the robot is disarmed, all motors stand and no shot waits. If the time step is not a positive number up to 0.1 s, all motors
    /// stand for that tick, and nothing else changes.
    ///
    /// Costs 206 instructions on a Cortex-M4F (`docs/figures.md`).
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
        if let ShooterState::Fault(_) = self.state {
            return ShooterTargets::REST;
        }
        let (wheels, loader) = match (feedback.wheels, feedback.loader) {
            ([Some(left), Some(right)], Some(loader)) => ([left, right], loader),
            ([Some(_), Some(_)], None) => return self.fail(ShooterFault::LoaderLost),
            _ => return self.fail(ShooterFault::WheelLost),
        };
        if self.state == ShooterState::Rest {
            self.loader.start(loader.position);
            (self.settled_s, self.spinning_up_s) = (0.0, 0.0);
        }
        match order {
            ShooterOrder::Fire(shots @ 1..) if self.is_released => {
                (self.ordered, self.is_released) = (shots, false);
            }
            ShooterOrder::Fire(1..) => {}
            _ => self.ordered = 0,
        }
        let is_settled = match self.settle(wheels, dt_s) {
            Ok(is_settled) => is_settled,
            Err(fault) => return self.fail(fault),
        };
        let is_kept_waiting = self.let_go(is_settled, &loader);
        self.feed(&loader, is_settled, is_kept_waiting, dt_s)
    }

    /// Tells whether the wheels have been at their speed for the settling time.
    fn settle(&mut self, wheels: [AngularVelocity; 2], dt_s: f32) -> Result<bool, ShooterFault> {
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
        if self.spinning_up_s > SPIN_UP_S { Err(ShooterFault::WheelSlow) } else { Ok(false) }
    }

    /// Releases the next shot of the burst if wheels, loader and heat allow. Returns whether a shot waits for the heat alone.
    fn let_go(&mut self, is_settled: bool, loader: &LoaderFeedback) -> bool {
        if self.ordered == 0 || !is_settled || !self.loader.takes_next(loader.position) {
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
        loader: &LoaderFeedback,
        is_settled: bool,
        is_kept_waiting: bool,
        dt_s: f32,
    ) -> ShooterTargets {
        let feed = self.config.feed_velocity().as_rad_per_s();
        let rates = (feed, self.config.gain_per_s, self.config.jam_s);
        let (step, counted) = self.loader.step(loader, rates, dt_s);
        self.shots = self.shots.saturating_add(counted);
        let (state, loader) = match step {
            Feed::Jammed => return self.fail(ShooterFault::Jammed),
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

    fn fail(&mut self, fault: ShooterFault) -> ShooterTargets {
        self.rest();
        self.state = ShooterState::Fault(fault);
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
