use crate::control::motion::Motion;
use crate::control::motion::planner::Planner;
use crate::control::number::{Sum, Wide, finite};
use crate::control::shaping::{MotionLimits, ProfileState};
use crate::error::ConfigError;

/// Motions of `N` axes that start together and end together.
///
/// The axis that takes longest makes its fastest [`Motion`]. Each other axis makes a weighted mean of two motions of the same duration: of the
/// longest way and of the shortest way within its limits. Limits that hold in both hold in each mean of them, so a slower motion is
/// always found. Between rest and rest it is the fastest one with all its rates lowered in proportion.
///
/// A duration may be impossible for an axis whose target moves: too long to arrive and too short to come back. All axes then take the
/// next duration that is possible.
///
/// # Examples
/// ```
/// use drivetrain::control::{MotionLimits, Motions, ProfileState};
///
/// // A chassis: 2 m forward, 1 m to the left and 1.5 rad about its axis.
/// let way = MotionLimits::new(2.0, 3.0).with_jerk(30.0); // m/s, m/s², m/s³
/// let heading = MotionLimits::new(4.0, 10.0).with_jerk(100.0); // rad/s, rad/s², rad/s³
/// let targets = [2.0, 1.0, 1.5].map(ProfileState::at_rest);
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
        to: &[ProfileState; N],
        limits: &[MotionLimits; N],
    ) -> Result<Self, ConfigError> {
        Self::from_exact(from, &[0.0; N], to, limits)
    }

    /// As [`plan`](Self::plan), from positions that are farther by `rests`.
    fn from_exact(
        from: &[ProfileState; N],
        rests: &[f32; N],
        to: &[ProfileState; N],
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
    fn exactly_at(&self, time_s: f32, rests: &[f32; N]) -> [(ProfileState, f32); N] {
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

/// Follows targets that move, within limits that change, with `N` axes in step.
///
/// An update with another target or other limits plans anew, from the state that the update before returned: position, velocity and
/// acceleration never jump, for any sequence of targets.
///
/// A target with a velocity is met where it was told to be, so a target that moves on is pursued: tell the follower where it will be
/// after [`left_s`](Self::left_s) to meet it.
///
/// The follower does not know the motors: its plan goes on while they are disarmed. Until the motors are armed, make the follower
/// [`new`](Self::new) in each step, at the measured state: otherwise the motors leap to the plan, beyond its limits.
///
/// # Edge behaviour
/// A `dt_s` that is zero, negative, NaN or infinite, a target that is NaN or infinite, and limits that [`Motion::plan`] would refuse change
/// nothing: the last states are returned, and [`rejected`](Self::rejected) grows. A long step is one along the plan. Steps of
/// the position that are smaller than the spacing of `f32` there add up.
///
/// # Examples
/// ```
/// use drivetrain::control::{MotionFollower, MotionLimits, ProfileState};
///
/// let limits = [MotionLimits::new(2.0, 8.0).with_jerk(80.0)]; // rad/s, rad/s², rad/s³
/// let mut yaw = MotionFollower::new([ProfileState::default()]);
/// for _ in 0..300 {
///     yaw.update(&[ProfileState::at_rest(1.0)], &limits, 0.001);
/// }
/// let [turning] = yaw.states();
/// assert!((turning.velocity - 1.9).abs() < 1e-4); // full speed in 0.05 s: 2 - 80 / 2 * 0.05²
/// let [turned_round] = yaw.update(&[ProfileState::at_rest(-1.0)], &limits, 0.001);
/// assert!((turned_round.velocity - turning.velocity).abs() <= 0.008);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
///
/// [`Motion::plan`]: crate::control::Motion::plan
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionFollower<const N: usize> {
    states: [ProfileState; N],
    /// Remainder of each position beyond the resolution of the start of the plan.
    rests: [f32; N],
    plan: Option<Plan<N>>,
    elapsed_s: Sum,
    rejected: u16,
}

/// The motions to a target within limits.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Plan<const N: usize> {
    to: [ProfileState; N],
    limits: [MotionLimits; N],
    motions: Motions<N>,
}

impl<const N: usize> MotionFollower<N> {
    /// Starts from these states. NaN and infinity count as zero.
    #[must_use]
    pub fn new(states: [ProfileState; N]) -> Self {
        let sane = |x: f32| if x.is_finite() { x } else { 0.0 };
        let states = states.map(|state| ProfileState {
            position: sane(state.position),
            velocity: sane(state.velocity),
            acceleration: sane(state.acceleration),
        });
        Self { states, rests: [0.0; N], plan: None, elapsed_s: Sum::ZERO, rejected: 0 }
    }

    /// Steps by `dt_s` seconds towards the targets and returns the new states.
    pub fn update(
        &mut self,
        to: &[ProfileState; N],
        limits: &[MotionLimits; N],
        dt_s: f32,
    ) -> [ProfileState; N] {
        let plan = match &self.plan {
            Some(plan) if plan.to == *to && plan.limits == *limits => *plan,
            _ => {
                let (mut from, mut rests) = (self.states, self.rests);
                if let Some(plan) = &self.plan {
                    let now = plan.motions.exactly_at(self.elapsed_s.value(), &self.rests);
                    (from, rests) = (now.map(|(state, _)| state), now.map(|(_, rest)| rest));
                }
                let Ok(motions) = Motions::from_exact(&from, &rests, to, limits) else {
                    self.rejected = self.rejected.saturating_add(1);
                    return self.states;
                };
                (self.rests, self.elapsed_s) = (rests, Sum::ZERO);
                Plan { to: *to, limits: *limits, motions }
            }
        };
        self.plan = Some(plan);
        if dt_s.is_finite() && dt_s > 0.0 {
            self.elapsed_s.add(dt_s);
            self.states = plan.motions.at(self.elapsed_s.value());
        } else {
            self.rejected = self.rejected.saturating_add(1);
        }
        self.states
    }

    /// Returns the states of the last update.
    #[must_use]
    pub const fn states(&self) -> [ProfileState; N] {
        self.states
    }

    /// Returns the time until all axes are at their targets, in seconds; zero before the first update.
    #[must_use]
    pub fn left_s(&self) -> f32 {
        let plan = self.plan.as_ref();
        let left_s = plan.map_or(0.0, |plan| plan.motions.duration_s() - self.elapsed_s.value());
        if left_s > 0.0 { left_s } else { 0.0 }
    }

    /// Returns the number of updates that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}
