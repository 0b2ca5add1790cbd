use crate::control::motion::in_step::Motions;
use crate::control::motion::plan::MotionTarget;
use crate::control::number::Sum;
use crate::control::shaping::{MotionLimits, ProfileState};

/// Follows targets that move, within limits that change, with `N` axes in step.
///
/// Each update with another target or other limits plans anew from the state that the last one returned, so position, velocity and
/// acceleration never jump, whatever the targets do.
///
/// A target with a velocity is met where it was told to be, so a target that moves on is pursued: tell the follower where it will be
/// after [`left_s`](Self::left_s) to meet it.
///
/// # Edge behaviour
/// A `dt_s` that is zero, negative, NaN or infinite, a target that is NaN or infinite, and limits that [`Motion::plan`] would refuse change
/// nothing: the last states are returned, and [`rejected`](Self::rejected) grows. A long step is one along the plan. Steps of
/// the position that are smaller than the spacing of `f32` there add up.
///
/// # Examples
/// ```
/// use drivetrain::control::{MotionFollower, MotionLimits, MotionTarget, ProfileState};
///
/// let limits = [MotionLimits::new(2.0, 8.0).with_jerk(80.0)]; // rad/s, rad/s², rad/s³
/// let mut yaw = MotionFollower::new([ProfileState::default()]);
/// for _ in 0..300 {
///     yaw.update(&[MotionTarget::at_rest(1.0)], &limits, 0.001);
/// }
/// let [turning] = yaw.states();
/// assert!((turning.velocity - 1.9).abs() < 1e-4); // full speed in 0.05 s: 2 - 80 / 2 * 0.05²
/// let [turned_round] = yaw.update(&[MotionTarget::at_rest(-1.0)], &limits, 0.001);
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
    to: [MotionTarget; N],
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
        to: &[MotionTarget; N],
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
