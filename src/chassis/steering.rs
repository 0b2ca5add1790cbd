use super::WheelSpeed;
use crate::geometry::{Rotation2, Vec2};
use crate::math::{atan2, sin_cos, wrap_pi};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::{FRAC_PI_2, PI};

/// Motion of a steered wheel: its rolling speed, and its direction.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{ModuleState, Swerve}, geometry::Vec2, units::{Angle, AngularVelocity}};
///
/// let to_the_left = ModuleState::new(AngularVelocity::from_rad_per_s(10.0), Angle::from_degrees(90.0));
/// let swerve = Swerve::new(0.1, [Vec2::new(0.3, 0.0), Vec2::new(-0.3, 0.0)])?;
/// assert!((swerve.forward([to_the_left; 2]).vy_m_s - 1.0).abs() < 1e-5);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ModuleState {
    /// Velocity of the wheel, positive in the direction of `angle`.
    pub velocity: AngularVelocity,
    /// Direction of rolling, counter-clockwise from forward; any number of turns.
    pub angle: Angle,
}

impl ModuleState {
    /// Takes the velocity of the wheel and its direction.
    #[must_use]
    pub const fn new(velocity: AngularVelocity, angle: Angle) -> Self {
        Self { velocity, angle }
    }

    pub(super) fn vector(self) -> Vec2 {
        let velocity = Vec2::new(self.velocity.as_rad_per_s(), 0.0);
        Rotation2::new(self.angle).apply(velocity)
    }
}

impl WheelSpeed for ModuleState {
    fn velocity(self) -> AngularVelocity {
        self.velocity
    }

    fn is_finite(self) -> bool {
        self.velocity.is_finite() && self.angle.is_finite()
    }

    fn scaled(self, factor: f32) -> Self {
        Self { velocity: self.velocity * factor, ..self }
    }

    fn stopped(self) -> Self {
        Self { velocity: AngularVelocity::ZERO, ..self }
    }

    fn distance(self, other: Self) -> f32 {
        (self.vector() - other.vector()).norm()
    }
}

/// How the modules of a swerve chassis are steered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steering {
    pub(super) hysteresis: Angle,
    pub(super) hold_below: AngularVelocity,
    pub(super) cosine_compensation: bool,
}

impl Steering {
    pub(super) const fn new() -> Self {
        Self {
            hysteresis: Angle::from_degrees(5.0),
            hold_below: AngularVelocity::from_rad_per_s(0.1),
            cosine_compensation: true,
        }
    }
}

/// Memory of one module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Module {
    target_rad: f32,
    /// Not before the module is measured: a target from nowhere would turn the module when it arms.
    has_target: bool,
    reversed: bool,
}

impl Module {
    /// Acts on a module by its memory: the commanded angle, and whether the drive is reversed.
    pub(super) fn with(
        memory: &mut Option<(Angle, bool)>,
        act: impl FnOnce(&mut Self) -> ModuleState,
    ) -> ModuleState {
        let (target, reversed) = memory.unwrap_or((Angle::ZERO, false));
        let has_target = memory.is_some();
        let mut module = Self { target_rad: target.as_radians(), has_target, reversed };
        let state = act(&mut module);
        let Self { target_rad, has_target, reversed } = module;
        *memory = has_target.then_some((Angle::from_radians(target_rad), reversed));
        state
    }

    pub(super) fn steer(
        &mut self,
        config: Steering,
        wanted: ModuleState,
        measured: Option<Angle>,
    ) -> ModuleState {
        let speed = wanted.velocity.as_rad_per_s().abs();
        let moves = wanted.angle.is_finite() && speed.is_finite();
        let Some(here) = known(measured) else {
            return self.blind(wanted.angle);
        };
        if !moves || speed <= config.hold_below.as_rad_per_s() {
            return self.hold(here);
        }
        let error = self.shorter(config, here, wanted.angle);
        let target = self.keep(here + error);
        let along = if config.cosine_compensation { sin_cos(error).1 } else { 1.0 };
        let along = if along > 0.0 { along } else { 0.0 };
        let turned = wanted.scaled(if self.reversed { -along } else { along });
        ModuleState::new(turned.velocity, target)
    }

    /// The turn from `here` to a direction or against it, whichever is nearer; in the hysteresis, the last choice.
    fn shorter(&mut self, config: Steering, here: f32, direction: Angle) -> f32 {
        let ahead = wrap_pi(direction.as_radians() - here);
        let behind = wrap_pi(ahead + PI);
        let (kept, other) = if self.reversed { (behind, ahead) } else { (ahead, behind) };
        if kept.abs() > FRAC_PI_2 + config.hysteresis.as_radians() {
            self.reversed = !self.reversed;
            other
        } else {
            kept
        }
    }

    fn hold(&mut self, here: f32) -> ModuleState {
        let kept = if self.has_target { self.target_rad } else { here };
        let way = kept - here;
        // An encoder that starts over has lost its turns; the module does not make up for them.
        let target = if way.abs() > PI { here + wrap_pi(way) } else { kept };
        standing(self.keep(target))
    }

    fn blind(self, wanted: Angle) -> ModuleState {
        if self.has_target {
            standing(Angle::from_radians(self.target_rad))
        } else {
            standing(if wanted.is_finite() { wanted } else { Angle::ZERO })
        }
    }

    pub(super) fn lock(
        &mut self,
        config: Steering,
        position: Vec2,
        measured: Option<Angle>,
    ) -> ModuleState {
        let away = Angle::from_radians(atan2(position.y, position.x));
        let Some(here) = known(measured) else {
            return self.blind(away);
        };
        if position == Vec2::ZERO {
            return self.hold(here);
        }
        let turn = self.shorter(config, here, away);
        standing(self.keep(here + turn))
    }

    const fn keep(&mut self, target_rad: f32) -> Angle {
        (self.target_rad, self.has_target) = (target_rad, true);
        Angle::from_radians(target_rad)
    }
}

fn known(measured: Option<Angle>) -> Option<f32> {
    measured.filter(|angle| angle.is_finite()).map(Angle::as_radians)
}

const fn standing(angle: Angle) -> ModuleState {
    ModuleState::new(AngularVelocity::ZERO, angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chassis::Swerve;
    use proptest::prelude::*;

    fn go(degrees: f32) -> ModuleState {
        let velocity = AngularVelocity::from_rad_per_s(10.0);
        ModuleState::new(velocity, Angle::from_degrees(degrees))
    }

    /// One module and its memory.
    struct One {
        swerve: Swerve<2>,
        steering: [Option<(Angle, bool)>; 2],
    }

    impl One {
        fn new(swerve: Swerve<2>) -> Self {
            Self { swerve, steering: [None; 2] }
        }

        fn steer(&mut self, wanted: ModuleState, measured: Option<f32>) -> (f32, f32) {
            let measured = measured.map(Angle::from_degrees);
            let [one, two] = self.swerve.steer(&mut self.steering, [wanted; 2], [measured; 2]);
            assert_eq!(one, two);
            (one.angle.as_degrees(), one.velocity.as_rad_per_s())
        }
    }

    fn swerve() -> Swerve<2> {
        Swerve::new(0.05, [Vec2::new(0.3, 0.3), Vec2::new(0.3, -0.3)]).unwrap()
    }

    fn steered(one: &mut One, wanted: f32, measured: f32) -> (f32, f32) {
        one.steer(go(wanted), Some(measured))
    }

    fn fresh() -> One {
        One::new(swerve().without_cosine_compensation())
    }

    // The fifth seed's system and librm drive to angle 0 at zero command.
    #[test]
    fn at_zero_command_the_angle_is_kept_and_the_drive_stops() {
        let mut steering = fresh();
        let (angle, _) = steered(&mut steering, 60.0, 55.0);
        assert!((angle - 60.0).abs() < 1e-3);
        let (angle, velocity) = steering.steer(ModuleState::default(), Some(57.0));
        assert!((angle - 60.0).abs() < 1e-3 && velocity.abs() < 1e-9);
    }

    #[test]
    fn before_the_first_command_the_measured_angle_is_held() {
        let (angle, _) = fresh().steer(ModuleState::default(), Some(123.0));
        assert!((angle - 123.0).abs() < 1e-3);
    }

    // A target kept from before the first feedback would turn the module to 0 when it arms.
    #[test]
    fn before_the_first_feedback_nothing_is_kept_to_turn_to_later() {
        let nan = ModuleState { velocity: AngularVelocity::from_rad_per_s(f32::NAN), ..go(80.0) };
        for early in [ModuleState::default(), go(80.0), nan] {
            let mut one = fresh();
            assert_eq!(one.steer(early, None), (early.angle.as_degrees(), 0.0));
            let _ = one.swerve.lock(&mut one.steering, [None; 2]);
            assert!((one.steer(ModuleState::default(), Some(123.0)).0 - 123.0).abs() < 1e-3);
        }
        let lost = ModuleState { angle: Angle::from_radians(f32::NAN), ..go(0.0) };
        assert_eq!(fresh().steer(lost, None), (0.0, 0.0));
    }

    #[test]
    fn a_module_whose_angle_is_lost_stands_and_keeps_its_target() {
        let mut one = fresh();
        let _ = steered(&mut one, 60.0, 0.0);
        for measured in [None, Some(f32::NAN)] {
            let (angle, velocity) = one.steer(go(20.0), measured);
            assert!((angle - 60.0).abs() < 1e-3 && velocity.abs() < 1e-9, "{angle} {velocity}");
        }
        assert!((steered(&mut one, 20.0, 50.0).0 - 20.0).abs() < 1e-3);
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
        let (_, velocity) = steered(&mut One::new(swerve()), 92.0, 0.0);
        assert!(velocity.abs() < 1e-6);
        let (_, velocity) = steered(&mut One::new(swerve()), 60.0, 0.0);
        assert!((velocity - 5.0).abs() < 1e-5);
    }

    #[test]
    fn a_state_of_nan_holds() {
        let mut steering = fresh();
        let _ = steered(&mut steering, 30.0, 30.0);
        let (angle, velocity) = steered(&mut steering, f32::NAN, 31.0);
        assert!((angle - 30.0).abs() < 1e-3 && velocity.abs() < 1e-9);
    }

    #[test]
    fn the_lock_makes_an_x_by_the_shorter_way() {
        let One { swerve, mut steering } = One::new(swerve());
        let measured = [0.0, 170.0].map(|degrees| Some(Angle::from_degrees(degrees)));
        let [left, right] = swerve.lock(&mut steering, measured);
        assert!((left.angle.as_degrees() - 45.0).abs() < 0.3);
        assert!((right.angle.as_degrees() - 135.0).abs() < 0.3);
        assert_eq!(left.velocity, AngularVelocity::ZERO);
        // Told to stand, the modules stay crossed.
        let [still, _] = swerve.steer(&mut steering, [ModuleState::default(); 2], measured);
        assert_eq!(still, left);
    }

    #[test]
    fn a_module_across_the_lock_is_not_turned_to_and_fro_by_the_noise_of_its_encoder() {
        let One { swerve, mut steering } = One::new(swerve());
        let mut lock = |noise: f32| {
            let measured = [135.0 + noise; 2].map(|degrees| Some(Angle::from_degrees(degrees)));
            swerve.lock(&mut steering, measured)[0].angle.as_degrees()
        };
        let first = lock(0.05);
        for step in 0..10 {
            let again = lock(if step % 2 == 0 { -0.05 } else { 0.05 });
            assert!((again - first).abs() < 0.1, "{first}, then {again}");
        }
    }

    #[test]
    fn a_held_angle_is_not_unwound_when_the_encoder_has_lost_its_turns() {
        let mut one = fresh();
        let (angle, _) = steered(&mut one, 60.0, 3610.0);
        assert!((angle - 3660.0).abs() < 0.01);
        for _ in 0..3 {
            let (angle, velocity) = one.steer(ModuleState::default(), Some(50.0));
            assert!((angle - 60.0).abs() < 0.01 && velocity.abs() < 1e-9, "{angle}");
        }
    }

    #[test]
    fn a_configuration_of_nan_counts_as_zero() {
        let nan = f32::NAN;
        let swerve = swerve()
            .with_hold_below(AngularVelocity::from_rad_per_s(nan))
            .with_hysteresis(Angle::from_radians(nan))
            .without_cosine_compensation();
        let mut one = One::new(swerve);
        let (angle, velocity) = steered(&mut one, 91.0, 0.0);
        assert!((angle + 89.0).abs() < 1e-3 && velocity < 0.0, "{angle} {velocity}");
        let (angle, velocity) = one.steer(ModuleState::default(), Some(-89.0));
        assert!((angle + 89.0).abs() < 1e-3 && velocity.abs() < 1e-9, "{angle} {velocity}");
    }

    #[test]
    fn a_negative_hysteresis_is_the_positive_one() {
        let width = Angle::from_radians(0.5);
        let swerve = swerve().with_hysteresis(-width);
        assert_eq!(swerve, super::tests::swerve().with_hysteresis(width));
        // With a hysteresis below zero the drive would flip to and fro.
        let (angle, _) = steered(&mut One::new(swerve), 95.0, 0.0);
        assert!((angle - 95.0).abs() < 1e-3);
    }

    #[test]
    fn a_module_at_the_centre_holds_its_angle_in_the_lock() {
        let swerve = Swerve::new(0.05, [Vec2::ZERO, Vec2::new(0.3, 0.0)]).unwrap();
        let measured = [Some(Angle::from_degrees(70.0)); 2];
        let [centre, _] = swerve.lock(&mut [None; 2], measured);
        assert!((centre.angle.as_degrees() - 70.0).abs() < 1e-3);
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
