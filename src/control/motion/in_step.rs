use crate::control::motion::plan::{Motion, MotionTarget};
use crate::control::motion::planner::Planner;
use crate::control::number::finite;
use crate::control::shaping::{MotionLimits, ProfileState};
use crate::control::wide::Wide;
use crate::error::ConfigError;

/// Motions of `N` axes that start together and end together.
///
/// The axis that takes longest makes its fastest [`Motion`], and each other one the mean, with weights, of two motions of that duration: the
/// longest way and the shortest one that its limits allow. Limits that hold in both hold in each mean of them, so a slower motion is
/// always found. Between rest and rest it is the fastest one with all its rates lowered in proportion.
///
/// A duration may be impossible for an axis whose target moves: too long to arrive and too short to come back. All axes then take the
/// next duration that is possible.
///
/// # Examples
/// ```
/// use drivetrain::control::{MotionLimits, MotionTarget, Motions, ProfileState};
///
/// // A chassis: 2 m forward, 1 m to the left and 1.5 rad about its axis.
/// let way = MotionLimits::new(2.0, 3.0).with_jerk(30.0); // m/s, m/s², m/s³
/// let heading = MotionLimits::new(4.0, 10.0).with_jerk(100.0); // rad/s, rad/s², rad/s³
/// let targets = [2.0, 1.0, 1.5].map(MotionTarget::at_rest);
/// let motions = Motions::plan(&[ProfileState::default(); 3], &targets, &[way, way, heading])?;
/// assert!((motions.duration_s() - 1.766_67).abs() < 1e-5); // of the first axis: 2 / 2 + 2 / 3 + 3 / 30
/// let [x, y, _] = motions.at(0.6);
/// assert!((x.velocity - 2.0 * y.velocity).abs() < 1e-5); // a straight line
/// assert_eq!(motions.at(9.0).map(|axis| axis.position), [2.0, 1.0, 1.5]);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motions<const N: usize> {
    axes: [Mean; N],
    duration_s: f32,
}

impl<const N: usize> Motions<N> {
    /// Plans the fastest motions that end together.
    ///
    /// # Errors
    /// As [`Motion::plan`], for the first axis that has such a parameter.
    pub fn plan(
        from: &[ProfileState; N],
        to: &[MotionTarget; N],
        limits: &[MotionLimits; N],
    ) -> Result<Self, ConfigError> {
        Self::from_exact(from, &[0.0; N], to, limits)
    }

    /// As [`plan`](Self::plan), from positions that are farther by `rests`.
    pub(super) fn from_exact(
        from: &[ProfileState; N],
        rests: &[f32; N],
        to: &[MotionTarget; N],
        limits: &[MotionLimits; N],
    ) -> Result<Self, ConfigError> {
        let mut planners = [Planner::default(); N];
        let axes = from.iter().zip(rests).zip(to).zip(limits);
        for (planner, (((from, rest), to), limits)) in planners.iter_mut().zip(axes) {
            *planner = Planner::new(from, *rest, to, limits)?;
        }
        let fastest = planners.each_ref().map(Planner::fastest);
        let longest = |longest: f32, motion: &Motion| longest.max(motion.duration_s);
        let mut duration_s = fastest.iter().fold(0.0, longest);
        // An axis makes all wait once at most: it has one gap in its durations.
        for _ in 0..N {
            for (planner, motion) in planners.iter().zip(&fastest) {
                if motion.duration_s < duration_s {
                    duration_s = planner.duration_from(duration_s);
                }
            }
        }
        let mut axes = fastest.map(Mean::of);
        for (axis, planner) in axes.iter_mut().zip(&planners) {
            if axis.high.duration_s < duration_s {
                let (high, low, share) = planner.lasting(duration_s);
                *axis = Mean { high, low, share };
            }
        }
        Ok(Self { axes, duration_s })
    }

    /// Returns position, velocity and acceleration of each axis `time_s` seconds after the start.
    #[must_use]
    pub fn at(&self, time_s: f32) -> [ProfileState; N] {
        self.axes.each_ref().map(|axis| axis.at(time_s))
    }

    /// Returns the time from start to end in seconds.
    #[must_use]
    pub const fn duration_s(&self) -> f32 {
        self.duration_s
    }

    /// Returns the positions at a time, and the remainder beyond `f32` of each, for starts that are farther by `rests`.
    pub(super) fn exactly_at(&self, time_s: f32, rests: &[f32; N]) -> [(ProfileState, f32); N] {
        let mut states = self.axes.each_ref().map(|axis| (axis.at(time_s), 0.0));
        for ((state, axis), rest) in states.iter_mut().zip(&self.axes).zip(rests) {
            let position = axis.position_at(time_s, *rest);
            if position.narrow().is_finite() {
                state.0.position = position.narrow();
                state.1 = position.rest();
            }
        }
        states
    }
}

/// The mean of two motions of one duration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Mean {
    high: Motion,
    low: Motion,
    share: f32,
}

impl Mean {
    const fn of(motion: Motion) -> Self {
        Self { high: motion, low: motion, share: 1.0 }
    }

    fn at(&self, time_s: f32) -> ProfileState {
        let high = self.high.at(time_s);
        if self.share >= 1.0 || time_s >= self.high.duration_s {
            return high;
        }
        let low = self.low.at(time_s);
        ProfileState {
            position: finite(self.position_at(time_s, 0.0).narrow()),
            velocity: self.mean(high.velocity, low.velocity),
            acceleration: self.mean(high.acceleration, low.acceleration),
        }
    }

    fn position_at(&self, time_s: f32, rest: f32) -> Wide {
        let (motion, sample) = (&self.high, self.high.sample(time_s));
        if sample.is_last && (self.share >= 1.0 || time_s >= motion.duration_s) {
            return Wide::difference(motion.end.position, sample.way);
        }
        let high = motion.way_at(&sample);
        let way = if self.share >= 1.0 {
            high
        } else {
            self.mean(high, self.low.way_at(&self.low.sample(time_s)))
        };
        Wide::difference(motion.start.position, -way) + rest
    }

    fn mean(&self, high: f32, low: f32) -> f32 {
        low + self.share * (high - low)
    }
}
