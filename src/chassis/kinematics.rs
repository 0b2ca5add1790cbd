use crate::geometry::{Body, Twist};
use crate::units::AngularVelocity;
use core::fmt::Debug;

/// A layout of wheels: converts a motion of the body to wheel speeds, and wheel speeds to a motion.
///
/// Every layout has `inverse` and `forward` as its own functions; [`Chassis`](super::Chassis) works with all layouts
/// through this trait.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::chassis::{Kinematics, Omni};
/// use drivetrain::geometry::{Body, Twist};
///
/// /// How far the motion that is read back is from the one that was asked for, in m/s.
/// fn error_m_s<K: Kinematics>(layout: K, motion: Twist<Body>) -> f32 {
///     (layout.forward(layout.inverse(motion)) - motion).linear().norm()
/// }
///
/// let motion = Twist::new(1.0, -0.5, 2.0);
/// assert!(error_m_s(Omni::three(0.05, 0.2)?, motion) < 1e-5);
/// assert!(error_m_s(Omni::four(0.05, 0.2)?, motion) < 1e-5);
/// # Ok::<(), ConfigError>(())
/// ```
pub trait Kinematics {
    /// One `T` for each wheel, under the name of the wheel.
    type Wheels<T: Copy>: Copy;
    /// Motion of a wheel: its velocity, and for a steered wheel its angle too.
    type Speed: WheelSpeed;
    /// Memory of the wheels from tick to tick: `()`, or the commanded angles of steered wheels.
    type Steering: Copy + Debug + PartialEq;

    /// Nothing remembered: before the first tick, and after the motors were relaxed.
    const UNSTEERED: Self::Steering;

    /// Returns the motion of each wheel for the motion `twist` of the body.
    fn inverse(&self, twist: Twist<Body>) -> Self::Wheels<Self::Speed>;

    /// Returns the motion of the body that best fits the motion of the wheels.
    fn forward(&self, wheels: Self::Wheels<Self::Speed>) -> Twist<Body>;

    /// Returns the motion of the body from the known wheels; `None` when these do not determine the motion.
    fn forward_partial(&self, wheels: Self::Wheels<Option<Self::Speed>>) -> Option<Twist<Body>>;

    /// Returns the radius of the wheels in m.
    fn wheel_radius_m(&self) -> f32;

    /// Turns the value of every wheel into another.
    fn map<T: Copy, U: Copy>(wheels: Self::Wheels<T>, f: impl FnMut(T) -> U) -> Self::Wheels<U>;

    /// Pairs the values of every wheel.
    fn zip<T: Copy, U: Copy>(a: Self::Wheels<T>, b: Self::Wheels<U>) -> Self::Wheels<(T, U)>;

    /// Returns the commands for the motors, from the wanted and the measured motion of the wheels: the wanted motion,
    /// unless the wheels are steered.
    ///
    /// `None` stands for a wheel without feedback; of a steered wheel with a finite angle only, the angle counts.
    #[must_use]
    fn steer(
        &self,
        steering: &mut Self::Steering,
        wanted: Self::Wheels<Self::Speed>,
        measured: Self::Wheels<Option<Self::Speed>>,
    ) -> Self::Wheels<Self::Speed> {
        let _ = (steering, measured);
        wanted
    }

    /// Returns the commands for a chassis that resists being pushed: zero velocities, unless the wheels are steered.
    #[must_use]
    fn lock(
        &self,
        steering: &mut Self::Steering,
        measured: Self::Wheels<Option<Self::Speed>>,
    ) -> Self::Wheels<Self::Speed> {
        let _ = (steering, measured);
        Self::map(self.inverse(Twist::ZERO), WheelSpeed::stopped)
    }

    /// Slows all wheels by one common factor until none is faster than `limit`: the direction of travel stays.
    ///
    /// Returns the wheels and the factor, 0 to 1: a planner or a loop around the chassis multiplies its motion by the factor, and
    /// does not wind up. A limit below zero or NaN counts as zero; if any wheel is NaN or infinite, all stop and the factor is 0.
    #[must_use]
    fn desaturate(
        &self,
        wheels: Self::Wheels<Self::Speed>,
        limit: AngularVelocity,
    ) -> (Self::Wheels<Self::Speed>, f32) {
        let mut fastest = Fastest::default();
        let _: Self::Wheels<()> = Self::map(wheels, |wheel| fastest.see(wheel.velocity()));
        let scale = fastest.scale(limit);
        (Self::map(wheels, |wheel| slowed(wheel, scale)), scale)
    }

    /// Returns the largest difference in m/s between a wheel and the rigid motion of best fit.
    ///
    /// Zero when all wheels roll. For a lifted, slipping or blocked wheel of an over-determined layout, the result is a
    /// part of its error (a quarter with four wheels); with as few wheels as unknowns the result is always zero.
    fn slip_m_s(&self, wheels: Self::Wheels<Self::Speed>) -> f32 {
        let rolling = self.inverse(self.forward(wheels));
        let mut largest = 0.0_f32;
        let _: Self::Wheels<()> = Self::map(Self::zip(wheels, rolling), |(is, fits)| {
            let difference = is.distance(fits);
            if difference > largest || difference.is_nan() {
                largest = difference;
            }
        });
        largest * self.wheel_radius_m()
    }
}

/// The motion of a wheel, as needed for limiting and comparing.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{ModuleState, WheelSpeed};
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let module = ModuleState::new(AngularVelocity::from_rad_per_s(8.0), Angle::from_degrees(30.0));
/// assert_eq!(module.scaled(0.5).velocity().as_rad_per_s(), 4.0);
/// assert!((module.stopped().angle.as_degrees() - 30.0).abs() < 1e-4); // it stands at its angle
/// assert!((module.distance(module.scaled(-1.0)) - 16.0).abs() < 1e-4);
/// ```
pub trait WheelSpeed: Copy {
    /// Returns the rolling velocity of the wheel, positive forward.
    fn velocity(self) -> AngularVelocity;

    /// Returns whether all values are finite: the velocity, and of a steered wheel the angle.
    fn is_finite(self) -> bool;

    /// Returns the same motion, faster by `factor`.
    #[must_use]
    fn scaled(self, factor: f32) -> Self;

    /// Returns the same wheel at rest, a steered wheel at its angle.
    #[must_use]
    fn stopped(self) -> Self;

    /// Returns the absolute difference to another motion of the same wheel in rad/s.
    fn distance(self, other: Self) -> f32;
}

impl WheelSpeed for AngularVelocity {
    fn velocity(self) -> AngularVelocity {
        self
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }

    fn scaled(self, factor: f32) -> Self {
        self * factor
    }

    fn stopped(self) -> Self {
        Self::ZERO
    }

    fn distance(self, other: Self) -> f32 {
        (self - other).as_rad_per_s().abs()
    }
}

/// Finds the largest speed of some wheels, then brings each under a limit by the common factor.
#[derive(Debug, Default)]
pub(super) struct Fastest {
    rad_per_s: f32,
    broken: bool,
}

impl Fastest {
    pub(super) fn see(&mut self, velocity: AngularVelocity) {
        let speed = velocity.as_rad_per_s().abs();
        self.broken |= !speed.is_finite();
        if speed > self.rad_per_s {
            self.rad_per_s = speed;
        }
    }

    /// The factor for all wheels, 0..=1; zero when a wheel or the limit is broken.
    pub(super) fn scale(&self, limit: AngularVelocity) -> f32 {
        let limit = limit.as_rad_per_s();
        if self.broken || limit.is_nan() || limit <= 0.0 {
            0.0
        } else if self.rad_per_s > limit {
            limit / self.rad_per_s
        } else {
            1.0
        }
    }
}

/// A scale of zero stops a wheel even at NaN.
pub(super) fn slowed<S: WheelSpeed>(wheel: S, scale: f32) -> S {
    if scale > 0.0 { wheel.scaled(scale) } else { wheel.stopped() }
}
