use super::kinematics::{Normal, Row, fit};
use super::omni::zip_arrays;
use super::steering::Steering;
use super::{Kinematics, WheelSpeed, positive};
use crate::error::ConfigError;
use crate::geometry::{Body, Rotation2, Twist, Vec2};
use crate::math::atan2;
use crate::units::{Angle, AngularVelocity};

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

    fn vector(self) -> Vec2 {
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

/// The kinematics of `N` steered and driven wheels.
///
/// The module at `p` moves with `(vx - wz p.y, vy + wz p.x)`; its angle is the direction of this velocity, its speed the
/// length. The motion is the least-squares fit to all modules. The result of [`inverse`](Self::inverse) goes through
/// [`steer`](Self::steer), which finds the shorter way and keeps the angles at rest, as [`Chassis`](super::Chassis) does.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::Swerve, geometry::{Twist, Vec2}};
///
/// let corner = |x, y| Vec2::new(x, y);
/// let swerve = Swerve::new(
///     0.05,
///     [corner(0.3, 0.3), corner(0.3, -0.3), corner(-0.3, 0.3), corner(-0.3, -0.3)],
/// )?;
/// let [front_left, ..] = swerve.inverse(Twist::new(0.0, 0.0, 2.0)); // turning left in place
/// assert!((front_left.angle.as_degrees() - 135.0).abs() < 0.3);
/// assert!((front_left.velocity.as_rad_per_s() - 0.3 * 2.0_f32.sqrt() * 2.0 / 0.05).abs() < 1e-4);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swerve<const N: usize> {
    positions_m: [Vec2; N],
    shares: [[Twist<Body>; 2]; N],
    wheel_radius_m: f32,
    per_radius: f32,
    pub(super) steering: Steering,
}

/// The part of a motion seen by a module: the velocity of its place forward, and to the left.
const fn rows(position_m: Vec2) -> [Row; 2] {
    [Row::new(Vec2::new(1.0, 0.0), position_m), Row::new(Vec2::new(0.0, 1.0), position_m)]
}

impl<const N: usize> Swerve<N> {
    /// Takes the radius of the wheels and the places of the modules from the origin of the body, in m.
    ///
    /// # Errors
    /// Names the value that is not finite or not above zero. [`ConfigError::Singular`] when there are fewer than two
    /// modules, or all stand in one place, or nearly, as seen from the origin (two modules: at 8 times their distance
    /// from each other).
    pub fn new(wheel_radius_m: f32, positions_m: [Vec2; N]) -> Result<Self, ConfigError> {
        positive(wheel_radius_m, "wheel_radius_m")?;
        if !positions_m.iter().all(|position| position.is_finite()) {
            return Err(ConfigError::NotFinite("positions_m"));
        }
        let inverse = Normal::of(positions_m.into_iter().flat_map(rows))
            .inverse()
            .ok_or(ConfigError::Singular("the rotation"))?;
        let shares = positions_m
            .map(|position| rows(position).map(|row| inverse.share(row) * wheel_radius_m));
        let (per_radius, steering) = (1.0 / wheel_radius_m, Steering::new());
        Ok(Self { positions_m, shares, wheel_radius_m, per_radius, steering })
    }

    /// Returns the places of the modules in m.
    #[must_use]
    pub const fn positions_m(&self) -> &[Vec2; N] {
        &self.positions_m
    }

    /// Returns the state of each module for the motion `twist` of the body: velocities of zero or more, angles in
    /// -180..=180 degrees. A module at rest has the angle 0.
    ///
    /// Costs 513 instructions on a Cortex-M4F, for four modules (`docs/figures.md`).
    #[must_use]
    pub fn inverse(&self, twist: Twist<Body>) -> [ModuleState; N] {
        self.positions_m.map(|position| {
            let velocity = twist.at(position);
            ModuleState::new(
                AngularVelocity::from_rad_per_s(velocity.norm() * self.per_radius),
                Angle::from_radians(atan2(velocity.y, velocity.x)),
            )
        })
    }

    /// Returns the motion of the body of best fit to the states of the modules (least squares).
    ///
    /// Costs 301 instructions on a Cortex-M4F, for four modules (`docs/figures.md`).
    #[must_use]
    pub fn forward(&self, modules: [ModuleState; N]) -> Twist<Body> {
        self.shares.iter().zip(modules).fold(Twist::ZERO, |sum, (&[forward, left], module)| {
            let velocity = module.vector();
            sum + forward * velocity.x + left * velocity.y
        })
    }
}

impl<const N: usize> Kinematics for Swerve<N> {
    type Wheels<T: Copy> = [T; N];
    type Speed = ModuleState;
    /// The commanded angle of each module, and whether its drive is reversed; `None` before its first measured angle.
    type Steering = [Option<(Angle, bool)>; N];

    const UNSTEERED: Self::Steering = [None; N];

    fn inverse(&self, twist: Twist<Body>) -> [ModuleState; N] {
        self.inverse(twist)
    }

    fn forward(&self, modules: [ModuleState; N]) -> Twist<Body> {
        self.forward(modules)
    }

    /// Two modules in different places are enough.
    fn forward_partial(&self, modules: [Option<ModuleState>; N]) -> Option<Twist<Body>> {
        let known = self.positions_m.iter().zip(&modules).filter_map(|(&position, module)| {
            module.map(|module| (position, module.vector() * self.wheel_radius_m))
        });
        fit(known.flat_map(|(position, velocity)| {
            let [forward, left] = rows(position);
            [(forward, velocity.x), (left, velocity.y)]
        }))
    }

    fn steer(
        &self,
        steering: &mut Self::Steering,
        wanted: [ModuleState; N],
        measured: [Option<ModuleState>; N],
    ) -> [ModuleState; N] {
        self.steer(steering, wanted, angles(measured))
    }

    fn lock(
        &self,
        steering: &mut Self::Steering,
        measured: [Option<ModuleState>; N],
    ) -> [ModuleState; N] {
        self.lock(steering, angles(measured))
    }

    fn wheel_radius_m(&self) -> f32 {
        self.wheel_radius_m
    }

    fn map<T: Copy, U: Copy>(wheels: [T; N], f: impl FnMut(T) -> U) -> [U; N] {
        wheels.map(f)
    }

    fn zip<T: Copy, U: Copy>(a: [T; N], b: [U; N]) -> [(T, U); N] {
        zip_arrays(a, b)
    }
}

fn angles<const N: usize>(modules: [Option<ModuleState>; N]) -> [Option<Angle>; N] {
    modules.map(|module| module.map(|module| module.angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec2; 4] =
        [Vec2::new(0.3, 0.3), Vec2::new(0.3, -0.3), Vec2::new(-0.3, 0.3), Vec2::new(-0.3, -0.3)];

    fn angles(vx: f32, vy: f32, wz: f32) -> [i32; 4] {
        let swerve = Swerve::new(0.05, CORNERS).unwrap();
        let near = |degrees: f32| (-180..=180).find(|&i| (degrees - i as f32).abs() < 0.5);
        swerve.inverse(Twist::new(vx, vy, wz)).map(|m| near(m.angle.as_degrees()).unwrap())
    }

    #[test]
    fn forward_points_all_forward_and_strafe_left_all_to_the_left() {
        assert_eq!(angles(1.0, 0.0, 0.0), [0; 4]);
        assert_eq!(angles(0.0, 1.0, 0.0), [90; 4]);
        assert_eq!(angles(0.0, -1.0, 0.0), [-90; 4]);
    }

    #[test]
    fn turning_left_points_front_left_to_the_left_rear_and_right_the_other_way() {
        assert_eq!(angles(0.0, 0.0, 1.0), [135, 45, -135, -45]);
        assert_eq!(angles(0.0, 0.0, -1.0), [-45, -135, 45, 135]);
    }

    #[test]
    fn modules_in_one_place_are_refused() {
        let one = Swerve::new(0.05, [Vec2::new(0.1, 0.2)]);
        assert_eq!(one, Err(ConfigError::Singular("the rotation")));
        let twin = Swerve::new(0.05, [Vec2::new(0.1, 0.2); 2]);
        assert_eq!(twin, Err(ConfigError::Singular("the rotation")));
        let nan = Swerve::new(0.05, [Vec2::ZERO, Vec2::new(f32::NAN, 0.0)]);
        assert_eq!(nan, Err(ConfigError::NotFinite("positions_m")));
        let flat = Swerve::new(-0.05, CORNERS);
        assert_eq!(flat, Err(ConfigError::NotPositive("wheel_radius_m")));
    }

    #[test]
    fn two_modules_are_enough_and_a_single_module_is_refused() {
        let swerve = Swerve::new(0.05, CORNERS).unwrap();
        let motion = Twist::new(0.5, -0.25, 1.0);
        let mut partial = swerve.inverse(motion).map(Some);
        (partial[1], partial[2]) = (None, None);
        let error = swerve.forward_partial(partial).unwrap() - motion;
        assert!(error.linear().norm() < 1e-2 && error.wz_rad_s.abs() < 2e-2, "{error:?}");
        partial[3] = None;
        assert_eq!(swerve.forward_partial(partial), None);
    }

    #[test]
    fn a_blocked_module_shows_as_slip() {
        let swerve = Swerve::new(0.05, CORNERS).unwrap();
        let mut modules = swerve.inverse(Twist::new(1.0, 0.0, 0.0));
        assert!(swerve.slip_m_s(modules) < 1e-5);
        modules[0] = modules[0].stopped();
        assert!(swerve.slip_m_s(modules) > 0.3);
    }
}
