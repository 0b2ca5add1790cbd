use crate::geometry::{Body, Twist};
use crate::units::AngularVelocity;
use core::fmt::Debug;

/// A layout of wheels: converts a motion of the body to wheel speeds, and wheel speeds to a motion.
///
/// Every layout has `inverse` and `forward` as its own functions; the trait is what
/// [`Chassis`](super::Chassis) needs to work with all of them.
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
    /// One `T` for each wheel, under the wheel's name.
    type Wheels<T: Copy>: Copy;
    /// What a wheel does: its velocity, and for a steered one its angle too.
    type Speed: WheelSpeed;
    /// What is remembered of the wheels from one tick to the next: `()`, or where steered ones point.
    type Steering: Copy + Debug + PartialEq;

    /// Nothing remembered: before the first tick, and after the motors were relaxed.
    const UNSTEERED: Self::Steering;

    /// Returns what each wheel must do for the motion `twist` of the body.
    fn inverse(&self, twist: Twist<Body>) -> Self::Wheels<Self::Speed>;

    /// Returns the motion of the body that fits best to what the wheels do.
    fn forward(&self, wheels: Self::Wheels<Self::Speed>) -> Twist<Body>;

    /// Returns the motion of the body from the wheels that are known; `None` when they do not determine it.
    fn forward_partial(&self, wheels: Self::Wheels<Option<Self::Speed>>) -> Option<Twist<Body>>;

    /// Returns the radius of the wheels in m.
    fn wheel_radius_m(&self) -> f32;

    /// Turns the value of every wheel into another.
    fn map<T: Copy, U: Copy>(wheels: Self::Wheels<T>, f: impl FnMut(T) -> U) -> Self::Wheels<U>;

    /// Pairs the values of every wheel.
    fn zip<T: Copy, U: Copy>(a: Self::Wheels<T>, b: Self::Wheels<U>) -> Self::Wheels<(T, U)>;

    /// Returns what the motors are told, from what is wanted and what the wheels do: the same, unless they are steered.
    ///
    /// `None` stands for a wheel that is not heard; of a steered one that is finite in its angle alone, the angle counts.
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

    /// Returns what the motors are told so that the chassis resists being pushed: to stand, unless they are steered.
    #[must_use]
    fn lock(
        &self,
        steering: &mut Self::Steering,
        measured: Self::Wheels<Option<Self::Speed>>,
    ) -> Self::Wheels<Self::Speed> {
        let _ = (steering, measured);
        Self::map(self.inverse(Twist::ZERO), WheelSpeed::stopped)
    }

    /// Slows all wheels by one common factor so that none is faster than `limit`: the direction of travel stays.
    ///
    /// Returns the wheels and the factor, 0 to 1: a planner or a loop around the chassis multiplies its motion by it, so that it does not
    /// wind up. A limit below zero or NaN counts as zero; if any wheel is NaN or infinite, all stop and the factor is 0.
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

    /// Returns the largest difference in m/s between a wheel and the rigid motion that fits best.
    ///
    /// Zero when all wheels roll. A lifted, slipping or blocked wheel of an over-determined layout shows here
    /// with a part of its error (a quarter with four wheels); with as few wheels as unknowns it is always zero.
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

/// What a wheel does, as far as limiting and comparing needs to know it.
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

    /// Returns whether all of it is a number: the velocity, and of a steered wheel the angle.
    fn is_finite(self) -> bool;

    /// Returns the same motion, faster by `factor`.
    #[must_use]
    fn scaled(self, factor: f32) -> Self;

    /// Returns the same wheel standing still, a steered one at its angle.
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

/// Zero stops a wheel even if it is NaN.
pub(super) fn slowed<S: WheelSpeed>(wheel: S, scale: f32) -> S {
    if scale > 0.0 { wheel.scaled(scale) } else { wheel.stopped() }
}
