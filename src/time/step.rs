/// The time since the step before, validated once for all loops of a tick.
///
/// | `dt_s` | kind | reaction of a controller |
/// |---|---|---|
/// | above 0, up to `dt_max_s` | normal | its work |
/// | above `dt_max_s` | [frozen](Self::is_frozen) | integral and derivative stay for this step, the rest follows, the step is counted |
/// | zero, negative, NaN, infinite | [hold](Self::is_hold) | nothing changes, the last output is returned, the step is counted |
///
/// # Examples
/// ```
/// use drivetrain::time::TimeStep;
///
/// assert_eq!(TimeStep::new(0.001, 0.1).dt_s(), 0.001);
/// assert!(TimeStep::new(0.0, 0.1).is_hold());
/// assert!(TimeStep::new(10.0, 0.1).is_frozen()); // back from a breakpoint
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TimeStep {
    pub(crate) dt_s: f32,
    /// Infinite unless the step is normal, so no plain arithmetic mistakes it for a number.
    pub(crate) half_dt_s: f32,
    pub(crate) per_dt: f32,
}

impl TimeStep {
    /// The longest step in seconds that counts in full, unless [`new`](Self::new) sets another.
    pub const MAX_S: f32 = 0.1;

    /// Takes the seconds since the step before; up to [`MAX_S`](Self::MAX_S) counts in full: for loops of more than 10 Hz. A
    /// slower loop sets its longest step with [`new`](Self::new).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::time::TimeStep;
    ///
    /// assert_eq!(TimeStep::of(0.001), TimeStep::new(0.001, 0.1));
    /// ```
    #[must_use]
    #[inline]
    pub const fn of(dt_s: f32) -> Self {
        Self::new(dt_s, Self::MAX_S)
    }

    /// Takes the seconds since the step before and the longest step that counts in full.
    ///
    /// A `dt_max_s` of NaN counts as infinite; with a `dt_max_s` of zero or less every step holds.
    #[must_use]
    #[inline]
    pub const fn new(dt_s: f32, dt_max_s: f32) -> Self {
        match Self::usable(dt_s, dt_max_s) {
            Some(step) => step,
            None => Self { dt_s: 0.0, half_dt_s: f32::INFINITY, per_dt: f32::INFINITY },
        }
    }

    /// The longest step of a motor's loops in seconds, 20 periods of 1 kHz: above, integrals and derivatives rest.
    pub(crate) const MOTOR_MAX_S: f32 = 0.02;

    /// Takes the seconds since the step before, for a loop of a motor.
    pub(crate) const fn of_motor(dt_s: f32) -> Self {
        Self::new(dt_s, Self::MOTOR_MAX_S)
    }

    /// As [`new`](Self::new); `None` for a step that [holds](Self::is_hold).
    #[inline]
    pub(crate) const fn usable(dt_s: f32, dt_max_s: f32) -> Option<Self> {
        if is_within(dt_s, dt_max_s) {
            return Some(Self { dt_s, half_dt_s: 0.5 * dt_s, per_dt: 1.0 / dt_s });
        }
        Self::unusual(dt_s, dt_max_s)
    }

    #[cold]
    const fn unusual(dt_s: f32, dt_max_s: f32) -> Option<Self> {
        if !is_within(dt_s, f32::MAX) {
            return None;
        }
        if dt_max_s.is_nan() {
            return Self::usable(dt_s, f32::INFINITY);
        }
        // With a longest step of zero or less every step holds.
        let frozen = Self { dt_s: dt_max_s, half_dt_s: f32::INFINITY, per_dt: f32::INFINITY };
        if dt_max_s > 0.0 { Some(frozen) } else { None }
    }

    /// Returns the seconds to count with: `dt_max_s` when frozen, 0 when on hold.
    #[must_use]
    pub const fn dt_s(&self) -> f32 {
        self.dt_s
    }

    /// Returns whether nothing may change: `dt_s` was zero, negative, NaN or infinite, or below 1.2e-38.
    #[must_use]
    pub const fn is_hold(&self) -> bool {
        // Never negative and never NaN: a comparison of bits, which the compiler derives from that of `new`.
        self.dt_s.to_bits() == 0
    }

    /// Returns whether time has passed and the inputs are finite; refusals are counted, up to 65535.
    pub(crate) const fn admits(&self, finite: bool, rejected: &mut u16) -> bool {
        let admitted = finite && !self.is_hold();
        if !admitted {
            *rejected = rejected.saturating_add(1);
        }
        admitted
    }

    /// Returns whether integral and derivative stay for this step: `dt_s` was above the maximum.
    #[must_use]
    pub const fn is_frozen(&self) -> bool {
        !self.is_hold() && self.half_dt_s.to_bits() == f32::INFINITY.to_bits()
    }
}

/// Returns whether a step is above 0 and up to the longest, by the bits: those of positive numbers are in the order of the
/// numbers, and those of negative numbers below.
#[inline]
const fn is_within(dt_s: f32, dt_max_s: f32) -> bool {
    const LEAST: i32 = f32::MIN_POSITIVE.to_bits().cast_signed();
    const MOST: i32 = f32::MAX.to_bits().cast_signed();
    let (bits, most) = (dt_s.to_bits().cast_signed(), dt_max_s.to_bits().cast_signed());
    bits >= LEAST && bits <= MOST && bits <= most
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;

    #[test]
    fn a_longest_step_of_zero_holds_all_steps_and_a_longest_step_of_nan_freezes_no_step() {
        for dt_max_s in [0.0, -0.1, f32::NEG_INFINITY] {
            let step = TimeStep::new(0.001, dt_max_s);
            assert!(step.is_hold() && !step.is_frozen(), "{dt_max_s}");
        }
        for dt_max_s in [f32::NAN, -f32::NAN, f32::INFINITY] {
            let step = TimeStep::new(1e30, dt_max_s);
            assert!(!step.is_hold() && !step.is_frozen() && step.dt_s() == 1e30, "{dt_max_s}");
        }
    }

    #[test]
    fn every_dt_is_of_one_kind() {
        let below = f32::MIN_POSITIVE.next_down();
        for dt_s in
            [0.0, -0.0, -0.001, f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, below]
        {
            for dt_max_s in [0.1, f32::MAX, f32::INFINITY, f32::NAN, -f32::NAN] {
                let step = TimeStep::new(dt_s, dt_max_s);
                assert!(step.is_hold() && !step.is_frozen(), "{dt_s} {dt_max_s}");
            }
        }
        for dt_s in [0.100_001, 10.0, f32::MAX] {
            let step = TimeStep::new(dt_s, 0.1);
            assert!(step.is_frozen() && !step.is_hold() && step.dt_s() == 0.1, "{dt_s}");
        }
        for dt_s in [f32::MIN_POSITIVE, 1e-6, 0.001, 0.1] {
            let step = TimeStep::new(dt_s, 0.1);
            assert!(!step.is_frozen() && !step.is_hold() && step.dt_s() == dt_s, "{dt_s}");
            assert!(step.per_dt.is_finite(), "{dt_s}");
        }
    }
}
