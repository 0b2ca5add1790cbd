use super::kinematics::{Normal, Row, fit};
use super::omni::zip_arrays;
use super::steering::{Module, ModuleState, Steering};
use super::{Kinematics, positive};
use crate::error::ConfigError;
use crate::geometry::{Body, Twist, Vec2};
use crate::math::atan2;
use crate::units::{Angle, AngularVelocity};

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
    steering: Steering,
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

/// How the modules are steered: a hysteresis of 5 degrees, angles held below 0.1 rad/s, cosine compensation on.
impl<const N: usize> Swerve<N> {
    /// Sets how far beyond 90 degrees a module must be off before its drive reverses. The sign does not matter; NaN counts as 0.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::Swerve, geometry::{Twist, Vec2}, units::Angle};
    ///
    /// let swerve = Swerve::new(0.1, [Vec2::new(0.3, 0.0), Vec2::new(-0.3, 0.0)])?
    ///     .with_hysteresis(Angle::from_degrees(20.0));
    /// let left = swerve.inverse(Twist::new(-0.1763, 1.0, 0.0)); // 100 degrees
    /// let [front, _] = swerve.steer(&mut [None; 2], left, [Some(Angle::ZERO); 2]);
    /// assert!((front.angle.as_degrees() - 100.0).abs() < 0.3); // and not -80 with the drive reversed
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[must_use]
    pub const fn with_hysteresis(mut self, hysteresis: Angle) -> Self {
        self.steering.hysteresis = Angle::from_radians(size(hysteresis.as_radians()));
        self
    }

    /// Sets the wheel speed below which a module stands still and keeps its angle. The sign does not matter; NaN counts as 0.
    #[must_use]
    pub const fn with_hold_below(mut self, speed: AngularVelocity) -> Self {
        self.steering.hold_below = AngularVelocity::from_rad_per_s(size(speed.as_rad_per_s()));
        self
    }

    /// Lets a module drive at full speed before it reaches its angle.
    #[must_use]
    pub const fn without_cosine_compensation(mut self) -> Self {
        self.steering.cosine_compensation = false;
        self
    }
}

/// Turns wanted states into states that the motors of the modules can follow.
impl<const N: usize> Swerve<N> {
    /// Returns the target of each module, from the wanted states and the measured angles.
    ///
    /// `memory` has for each module its commanded angle, and whether its drive is reversed. [`Chassis`](super::Chassis) keeps this memory;
    /// without a chassis, keep it beside the layout for [`steer`](Self::steer) and [`lock`](Self::lock), and begin with `None`
    /// when the motors were relaxed: a module without a memory and a command holds its first measured angle.
    ///
    /// * A module turns by at most 90 degrees and the hysteresis; if the opposite direction is nearer, its drive reverses.
    ///   The hysteresis keeps a command at 90 degrees from flipping the module to and fro.
    /// * A module away from its target angle drives with the cosine of its error, so it does not push sideways.
    /// * At zero command a module stands still and keeps its angle, also for a wanted state that is NaN or infinite.
    /// * The returned angles are near the measured angles, for any number of turns: no unwinding.
    /// * A module without a measured angle stands still, because its direction of push is unknown. The module keeps its
    ///   angle; a module never measured has no angle to keep, and gets the wanted angle, which its motor refuses.
    ///
    /// Costs 738 instructions on a Cortex-M4F, for four modules (`docs/figures.md`).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::Swerve, geometry::{Twist, Vec2}, units::Angle};
    ///
    /// let swerve = Swerve::new(0.1, [Vec2::new(0.3, 0.0), Vec2::new(-0.3, 0.0)])?;
    /// let mut memory = [None; 2];
    /// let back = swerve.inverse(Twist::new(-1.0, 0.1763, 0.0)); // 170 degrees
    /// let [front, _] = swerve.steer(&mut memory, back, [Some(Angle::ZERO); 2]);
    /// assert!((front.angle.as_degrees() + 10.0).abs() < 0.3); // 10 degrees to the right, drive reversed
    /// assert!((front.velocity.as_rad_per_s() + 10.0).abs() < 0.01); // 10.15 rad/s times cos(10 degrees)
    /// let [front, _] = swerve.steer(&mut memory, [drivetrain::chassis::ModuleState::default(); 2], [Some(Angle::from_degrees(-4.0)); 2]);
    /// assert!((front.angle.as_degrees() + 10.0).abs() < 0.3); // told to stand, a module keeps its angle
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub fn steer(
        &self,
        memory: &mut [Option<(Angle, bool)>; N],
        wanted: [ModuleState; N],
        measured: [Option<Angle>; N],
    ) -> [ModuleState; N] {
        let config = self.steering;
        let mut inputs = wanted.into_iter().zip(measured);
        memory.each_mut().map(|memory| match inputs.next() {
            Some((wanted, measured)) => {
                Module::with(memory, |module| module.steer(config, wanted, measured))
            }
            None => ModuleState::default(),
        })
    }

    /// Returns the states of a chassis locked in an X: all at rest, each module pointing at the origin of the body, or away
    /// from it, whichever is nearer. The hysteresis keeps a module that lies across from turning to and fro.
    ///
    /// A module at the origin has no such direction, and holds its angle.
    pub fn lock(
        &self,
        memory: &mut [Option<(Angle, bool)>; N],
        measured: [Option<Angle>; N],
    ) -> [ModuleState; N] {
        let config = self.steering;
        let mut inputs = self.positions_m().iter().zip(measured);
        memory.each_mut().map(|memory| match inputs.next() {
            Some((&position, measured)) => {
                Module::with(memory, |module| module.lock(config, position, measured))
            }
            None => ModuleState::default(),
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

/// Without a sign; with NaN no comparison would hold, and a module at zero command would turn to 0.
const fn size(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.abs() }
}

#[cfg(test)]
mod tests {
    use super::super::WheelSpeed;
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
