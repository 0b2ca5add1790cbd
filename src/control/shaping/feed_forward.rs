use crate::control::error::{check, not_negative};
use crate::control::number::finite;
use crate::error::ConfigError;

/// The effort that a motion takes: `kS sign(velocity) + kV velocity + kA acceleration`.
///
/// `kS` overcomes dry friction, `kV` what grows with speed (viscous friction, back-EMF), `kA` the inertia. With the output in
/// a unit `U` (A, V) and the velocity in `M`/s they are in `U`, `U s/M` and `U s²/M`.
///
/// # Edge behaviour
/// It has no state and knows no time. At rest, the sign is that of the acceleration: the effort to set off. NaN or infinity in
/// an argument gives zero, and a sum that overflows ±`f32::MAX`, however large the gains.
///
/// # Examples
/// ```
/// use drivetrain::control::FeedForward;
///
/// const WHEEL: FeedForward = match FeedForward::new(0.3, 0.05, 0.01) {
///     Ok(feed_forward) => feed_forward,
///     Err(_) => panic!("gains"),
/// };
/// assert_eq!(WHEEL.effort(10.0, 20.0), 1.0); // 0.3 + 0.5 + 0.2
/// assert_eq!(WHEEL.effort(0.0, -20.0), -0.5); // sets off backwards
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FeedForward {
    ks: f32,
    kv: f32,
    ka: f32,
}

impl FeedForward {
    /// Takes the static gain, the velocity gain and the acceleration gain, each zero or more.
    ///
    /// # Errors
    /// Names `ks`, `kv` or `ka` when NaN, infinite or negative.
    pub const fn new(ks: f32, kv: f32, ka: f32) -> Result<Self, ConfigError> {
        check!(not_negative("ks", ks));
        check!(not_negative("kv", kv));
        check!(not_negative("ka", ka));
        Ok(Self { ks, kv, ka })
    }

    /// Returns the effort for this velocity and this acceleration.
    ///
    /// Costs 53 instructions on a Cortex-M4F (`docs/figures.md`).
    #[must_use]
    pub const fn effort(&self, velocity: f32, acceleration: f32) -> f32 {
        if !(velocity.is_finite() && acceleration.is_finite()) {
            return 0.0;
        }
        let direction = if velocity == 0.0 { acceleration } else { velocity };
        let friction = if direction == 0.0 { 0.0 } else { self.ks.copysign(direction) };
        let with_speed = finite(friction + finite(self.kv * velocity));
        finite(with_speed + finite(self.ka * acceleration))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;

    #[test]
    fn it_is_odd() {
        let feed_forward = FeedForward::new(0.3, 0.05, 0.01).unwrap();
        for (velocity, acceleration) in [(3.0, 1.0), (-3.0, 1.0), (0.0, 2.0), (0.0, 0.0)] {
            let forward = feed_forward.effort(velocity, acceleration);
            assert_eq!(feed_forward.effort(-velocity, -acceleration), -forward);
        }
        assert_eq!(feed_forward.effort(0.0, 0.0), 0.0);
    }

    #[test]
    fn bad_arguments_take_no_effort_and_huge_ones_stay_finite() {
        let feed_forward = FeedForward::new(0.3, 1e30, 1e30).unwrap();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!((feed_forward.effort(bad, 1.0), feed_forward.effort(1.0, bad)), (0.0, 0.0));
        }
        assert_eq!(feed_forward.effort(1e30, 1e30), f32::MAX);
        assert!(feed_forward.effort(1e30, -1e30).is_finite());
    }

    #[test]
    fn a_gain_that_cannot_be_is_named() {
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(FeedForward::new(bad, 0.0, 0.0).unwrap_err().parameter(), "ks");
            assert_eq!(FeedForward::new(0.0, bad, 0.0).unwrap_err().parameter(), "kv");
            assert_eq!(FeedForward::new(0.0, 0.0, bad).unwrap_err().parameter(), "ka");
        }
    }
}
