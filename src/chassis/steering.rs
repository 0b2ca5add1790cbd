use super::{ModuleState, Swerve, WheelSpeed};
use crate::geometry::Vec2;
use crate::math::{atan2, sin_cos, wrap_pi};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::{FRAC_PI_2, PI};

/// How the modules of a swerve chassis are steered.
///
/// ```
/// use drivetrain::{chassis::SteeringConfig, units::Angle};
///
/// let config = SteeringConfig::new().with_hysteresis(Angle::from_degrees(10.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(from = "Stored"))]
pub struct SteeringConfig {
    hysteresis: Angle,
    hold_below: AngularVelocity,
    cosine_compensation: bool,
}

/// The configuration as it stands in a file, where anybody may have changed it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "SteeringConfig")]
struct Stored {
    hysteresis: Angle,
    hold_below: AngularVelocity,
    cosine_compensation: bool,
}

#[cfg(feature = "serde")]
impl From<Stored> for SteeringConfig {
    fn from(stored: Stored) -> Self {
        let config =
            Self::new().with_hysteresis(stored.hysteresis).with_hold_below(stored.hold_below);
        Self { cosine_compensation: stored.cosine_compensation, ..config }
    }
}

impl SteeringConfig {
    /// A hysteresis of 5 degrees, angles held below 0.1 rad/s, cosine compensation on.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            hysteresis: Angle::from_degrees(5.0),
            hold_below: AngularVelocity::from_rad_per_s(0.1),
            cosine_compensation: true,
        }
    }

    /// Sets how far beyond 90 degrees a module must be off before its drive reverses. The sign does not matter; NaN counts as 0.
    #[must_use]
    pub const fn with_hysteresis(self, hysteresis: Angle) -> Self {
        Self { hysteresis: hysteresis.abs(), ..self }
    }

    /// Sets the wheel speed below which a module stands still and keeps its angle. The sign does not matter; NaN counts as 0.
    #[must_use]
    pub const fn with_hold_below(self, speed: AngularVelocity) -> Self {
        Self { hold_below: speed.abs(), ..self }
    }

    /// Lets a module drive at full speed while it still points elsewhere.
    #[must_use]
    pub const fn without_cosine_compensation(self) -> Self {
        Self { cosine_compensation: false, ..self }
    }
}

impl Default for SteeringConfig {
    fn default() -> Self {
        Self::new()
    }
}

/// Brings the modules of a swerve chassis to their angles by the shorter way.
///
/// * A module turns by at most 90 degrees and the hysteresis; where the other direction is nearer, its drive reverses.
///   The hysteresis keeps a command at 90 degrees from flipping it to and fro.
/// * A module that does not point where it should drives with the cosine of its error, so it does not push sideways.
/// * At zero command it stands still and keeps its angle.
/// * The angles that come out are near the measured ones, whatever their number of turns: no unwinding.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{ModuleState, SteeringConfig, SwerveSteering};
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let mut steering = SwerveSteering::<1>::new(SteeringConfig::new());
/// let back = ModuleState::new(AngularVelocity::from_rad_per_s(10.0), Angle::from_degrees(170.0));
/// let [module] = steering.steer([back], [Some(Angle::ZERO)]);
/// assert!((module.angle.as_degrees() + 10.0).abs() < 1e-3); // 10 degrees to the right, drive reversed
/// assert!((module.velocity.as_rad_per_s() + 9.848).abs() < 1e-3); // cos(10 degrees)
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwerveSteering<const N: usize> {
    config: SteeringConfig,
    modules: [Module; N],
}

/// What is remembered of one module.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Module {
    target_rad: f32,
    reversed: bool,
}

impl<const N: usize> SwerveSteering<N> {
    /// Takes the configuration; until the first command the modules are held at the angle they are measured at.
    #[must_use]
    pub const fn new(config: SteeringConfig) -> Self {
        Self { config, modules: [Module { target_rad: f32::NAN, reversed: false }; N] }
    }

    /// Returns what each module shall do, from what is wanted and the angles measured; without one, from its last target.
    ///
    /// A wanted state that is NaN or infinite holds the module.
    pub fn steer(
        &mut self,
        wanted: [ModuleState; N],
        measured: [Option<Angle>; N],
    ) -> [ModuleState; N] {
        let (config, mut inputs) = (self.config, wanted.into_iter().zip(measured));
        self.modules.each_mut().map(|module| match inputs.next() {
            Some((wanted, measured)) => module.steer(config, wanted, measured),
            None => ModuleState::default(),
        })
    }

    /// Returns the states that lock the chassis: all at rest, each module pointing at the origin of the body.
    pub fn lock(&mut self, swerve: &Swerve<N>, measured: [Option<Angle>; N]) -> [ModuleState; N] {
        let mut inputs = swerve.positions_m().iter().zip(measured);
        self.modules.each_mut().map(|module| match inputs.next() {
            Some((&position, measured)) => module.lock(position, measured),
            None => ModuleState::default(),
        })
    }
}

impl Module {
    fn reference(self, measured: Option<Angle>) -> f32 {
        let known = measured.filter(|angle| angle.is_finite()).map(Angle::as_radians);
        let last = if self.target_rad.is_finite() { self.target_rad } else { 0.0 };
        known.unwrap_or(last)
    }

    fn steer(
        &mut self,
        config: SteeringConfig,
        wanted: ModuleState,
        measured: Option<Angle>,
    ) -> ModuleState {
        let here = self.reference(measured);
        let speed = wanted.velocity.as_rad_per_s().abs();
        let moves = wanted.angle.is_finite() && wanted.velocity.is_finite();
        if !moves || speed <= config.hold_below.as_rad_per_s() {
            return self.hold(here);
        }
        let ahead = wrap_pi(wanted.angle.as_radians() - here);
        let behind = wrap_pi(ahead + PI);
        let (kept, other) = if self.reversed { (behind, ahead) } else { (ahead, behind) };
        let error = if kept.abs() > FRAC_PI_2 + config.hysteresis.as_radians() {
            self.reversed = !self.reversed;
            other
        } else {
            kept
        };
        self.target_rad = here + error;
        let along = if config.cosine_compensation { sin_cos(error).1 } else { 1.0 };
        let along = if along > 0.0 { along } else { 0.0 };
        let turned = wanted.scaled(if self.reversed { -along } else { along });
        ModuleState::new(turned.velocity, Angle::from_radians(self.target_rad))
    }

    fn hold(&mut self, here: f32) -> ModuleState {
        if !self.target_rad.is_finite() {
            self.target_rad = here;
        }
        ModuleState::new(AngularVelocity::ZERO, Angle::from_radians(self.target_rad))
    }

    fn lock(&mut self, position: Vec2, measured: Option<Angle>) -> ModuleState {
        let here = self.reference(measured);
        let outward = wrap_pi(atan2(position.y, position.x) - here);
        let inward = wrap_pi(outward + PI);
        let nearer = if outward.abs() <= inward.abs() { outward } else { inward };
        self.target_rad = here + nearer;
        ModuleState::new(AngularVelocity::ZERO, Angle::from_radians(self.target_rad))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn go(degrees: f32) -> [ModuleState; 1] {
        let velocity = AngularVelocity::from_rad_per_s(10.0);
        [ModuleState::new(velocity, Angle::from_degrees(degrees))]
    }

    fn at(degrees: f32) -> [Option<Angle>; 1] {
        [Some(Angle::from_degrees(degrees))]
    }

    fn steered(steering: &mut SwerveSteering<1>, wanted: f32, measured: f32) -> (f32, f32) {
        let [module] = steering.steer(go(wanted), at(measured));
        (module.angle.as_degrees(), module.velocity.as_rad_per_s())
    }

    fn fresh() -> SwerveSteering<1> {
        SwerveSteering::new(SteeringConfig::new().without_cosine_compensation())
    }

    // The fifth seed's system and librm drive to angle 0 at zero command.
    #[test]
    fn at_zero_command_the_angle_is_kept_and_the_drive_stops() {
        let mut steering = fresh();
        let (angle, _) = steered(&mut steering, 60.0, 55.0);
        assert!((angle - 60.0).abs() < 1e-3);
        let [held] = steering.steer([ModuleState::default()], at(57.0));
        assert!((held.angle.as_degrees() - 60.0).abs() < 1e-3);
        assert_eq!(held.velocity, AngularVelocity::ZERO);
    }

    #[test]
    fn before_the_first_command_the_measured_angle_is_held() {
        let [held] = fresh().steer([ModuleState::default()], at(123.0));
        assert!((held.angle.as_degrees() - 123.0).abs() < 1e-3);
    }

    #[test]
    fn more_than_ninety_degrees_and_the_hysteresis_reverse_the_drive_less_do_not() {
        assert!((steered(&mut fresh(), 94.0, 0.0).0 - 94.0).abs() < 1e-3);
        let (angle, velocity) = steered(&mut fresh(), 96.0, 0.0);
        assert!((angle + 84.0).abs() < 1e-3 && (velocity + 10.0).abs() < 1e-6);
        let (angle, velocity) = steered(&mut fresh(), -96.0, 0.0);
        assert!((angle - 84.0).abs() < 1e-3 && (velocity + 10.0).abs() < 1e-6);
    }

    #[test]
    fn a_command_that_dithers_about_ninety_degrees_flips_the_drive_once_at_most() {
        let mut steering = fresh();
        let mut flips = 0;
        let mut last = steered(&mut steering, 88.0, 0.0).1;
        for step in 0..100 {
            let now = steered(&mut steering, if step % 2 == 0 { 94.0 } else { 86.0 }, 0.0).1;
            flips += u32::from(now * last < 0.0);
            last = now;
        }
        assert_eq!(flips, 0);
    }

    #[test]
    fn many_turns_of_the_module_are_not_unwound() {
        let (angle, _) = steered(&mut fresh(), 10.0, 3600.0);
        assert!((angle - 3610.0).abs() < 1e-2, "{angle}");
        let (angle, _) = steered(&mut fresh(), -10.0, -3600.0);
        assert!((angle + 3610.0).abs() < 1e-2, "{angle}");
    }

    #[test]
    fn a_module_across_the_way_does_not_push() {
        let mut steering = SwerveSteering::<1>::new(SteeringConfig::new());
        let [module] = steering.steer(go(92.0), at(0.0));
        assert!(module.velocity.as_rad_per_s().abs() < 1e-6);
    }

    #[test]
    fn a_state_of_nan_holds() {
        let mut steering = fresh();
        let _ = steered(&mut steering, 30.0, 30.0);
        let [module] = steering.steer(go(f32::NAN), at(31.0));
        assert!((module.angle.as_degrees() - 30.0).abs() < 1e-3);
        assert_eq!(module.velocity, AngularVelocity::ZERO);
    }

    #[test]
    fn the_lock_makes_an_x_by_the_shorter_way() {
        let swerve = Swerve::new(0.05, [Vec2::new(0.3, 0.3), Vec2::new(0.3, -0.3)]).unwrap();
        let mut steering = SwerveSteering::<2>::new(SteeringConfig::new());
        let [left, right] =
            steering.lock(&swerve, [Some(Angle::ZERO), Some(Angle::from_degrees(170.0))]);
        assert!((left.angle.as_degrees() - 45.0).abs() < 0.3);
        assert!((right.angle.as_degrees() - 135.0).abs() < 0.3);
        assert_eq!(left.velocity, AngularVelocity::ZERO);
    }

    proptest! {
        #[test]
        fn the_module_ends_along_the_wanted_direction(wanted in -1000.0_f32..1000.0, here in -1000.0_f32..1000.0) {
            let (angle, velocity) = steered(&mut fresh(), wanted, here);
            let is = Angle::from_degrees(angle).as_radians();
            let should = Angle::from_degrees(wanted).as_radians();
            let ((s, c), (ws, wc)) = (sin_cos(is), sin_cos(should));
            prop_assert!((velocity * c - 10.0 * wc).abs() < 1e-2 && (velocity * s - 10.0 * ws).abs() < 1e-2);
            prop_assert!((angle - here).abs() < 95.01);
        }
    }
}
