use crate::control::error::{check, positive};
use crate::control::number::finite;
use crate::error::ConfigError;
use crate::time::TimeStep;

/// A first-order low-pass filter.
///
/// ```text
/// value' = (input - value) / T,   T = 1 / (2 pi cutoff_hz)
/// ```
/// stepped by the backward rule, `value += dt / (dt + T) (input - value)`: stable for every `dt`, and true to the cut-off
/// frequency as long as `dt` is well below `T`.
///
/// # Edge behaviour
/// The first sample is the first output. If `dt_s` is zero, negative, NaN or infinite, or the input is NaN or infinite, the
/// last output is returned and [`rejected`](Self::rejected) grows. There is no maximum: after a long `dt_s` the old value
/// rightly counts for little. Every cut-off works: near `f32::MAX` the input passes, near zero the first sample stays. A
/// change smaller than half the spacing of `f32` at the value is lost, so the output stands still within
/// `6e-8 (1 + T / dt)` of the value: 1e-5 of the value for 1 Hz at 1 kHz, 1e-2 for 1 mHz.
///
/// # Examples
/// ```
/// use drivetrain::control::LowPass;
///
/// const SMOOTH: LowPass = match LowPass::new(10.0) {
///     Ok(filter) => filter,
///     Err(_) => panic!("cut-off"),
/// };
/// let mut filter = SMOOTH;
/// filter.update(0.0, 0.001);
/// for _ in 0..16 {
///     filter.update(1.0, 0.001); // 16 ms is one time constant
/// }
/// assert!((filter.value() - 0.63).abs() < 0.02);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LowPass {
    time_constant_s: f32,
    value: f32,
    rejected: u16,
    started: bool,
}

impl LowPass {
    /// Takes the frequency at which a sine passes at 71 % (-3 dB), in Hz.
    ///
    /// # Errors
    /// Names `cutoff` when NaN, infinite, zero or negative.
    pub const fn new(cutoff_hz: f32) -> Result<Self, ConfigError> {
        check!(positive("cutoff", cutoff_hz));
        let time_constant_s = finite(1.0 / (core::f32::consts::TAU * cutoff_hz));
        Ok(Self { time_constant_s, value: 0.0, rejected: 0, started: false })
    }

    /// Steps by `dt_s` seconds and returns the new value.
    ///
    /// Costs 30 instructions on a Cortex-M4F (`docs/figures.md`).
    #[inline]
    pub const fn update(&mut self, input: f32, dt_s: f32) -> f32 {
        self.step(input, &TimeStep::new(dt_s, f32::MAX))
    }

    /// Steps by a validated time step, and returns the new value.
    #[inline]
    pub const fn step(&mut self, input: f32, step: &TimeStep) -> f32 {
        if step.admits(input.is_finite(), &mut self.rejected) {
            self.pass(input, step);
        }
        self.value
    }

    /// Steps to a finite input, by a time step that is not on hold.
    #[inline]
    pub(in crate::control) const fn pass(&mut self, input: f32, step: &TimeStep) -> f32 {
        if self.started {
            let gain = step.dt_s / (step.dt_s + self.time_constant_s);
            self.value = finite(self.value + gain * finite(input - self.value));
        } else {
            (self.value, self.started) = (input, true);
        }
        self.value
    }

    /// Forgets the past: the next sample counts as the first.
    pub const fn reset(&mut self) {
        self.value = 0.0;
        self.started = false;
    }

    /// Puts the output at `value`. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, value: f32) {
        self.value = if value.is_finite() { value } else { 0.0 };
        self.started = true;
    }

    /// Returns the last output; zero before the first sample.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Returns the number of refused samples; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn first_sample_is_the_first_output_and_again_after_a_reset() {
        let mut filter = LowPass::new(1.0).unwrap();
        assert_eq!((filter.value(), filter.update(5.0, 0.001)), (0.0, 5.0));
        filter.reset();
        assert_eq!(filter.update(-3.0, 10.0), -3.0);
    }

    #[test]
    fn bad_samples_and_bad_times_change_nothing_and_are_counted() {
        let mut filter = LowPass::new(1.0).unwrap();
        filter.update(5.0, 0.001);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!((filter.update(bad, 0.001), filter.update(9.0, bad)), (5.0, 5.0));
        }
        assert_eq!((filter.update(9.0, 0.0), filter.update(9.0, -1.0)), (5.0, 5.0));
        assert_eq!(filter.rejected(), 8);
    }

    #[test]
    fn a_cut_off_that_cannot_be_is_named() {
        for cutoff_hz in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(LowPass::new(cutoff_hz).unwrap_err().parameter(), "cutoff");
        }
    }

    #[test]
    fn a_sine_at_the_cut_off_keeps_71_percent() {
        let mut filter = LowPass::new(10.0).unwrap();
        let peak = (0..40_000_u16)
            .map(|sample| {
                let phase = core::f32::consts::TAU * 10.0 * f32::from(sample) * 1e-4;
                filter.update(crate::math::sin_cos(phase).0, 1e-4)
            })
            .skip(20_000)
            .fold(0.0, f32::max);
        assert!((peak - 0.707).abs() < 0.005, "{peak}");
    }

    proptest! {
        #[test]
        fn output_stays_between_the_extremes_of_the_input(
            cutoff_hz in 0.001_f32..1e4,
            samples in prop::collection::vec((-1e30_f32..1e30, 1e-6_f32..100.0), 1..50),
        ) {
            let mut filter = LowPass::new(cutoff_hz).unwrap();
            let (mut lowest, mut highest) = (f32::MAX, f32::MIN);
            for (input, dt_s) in samples {
                (lowest, highest) = (lowest.min(input), highest.max(input));
                let slack = 1e-6 * (highest - lowest);
                prop_assert!((lowest - slack..=highest + slack).contains(&filter.update(input, dt_s)));
            }
        }
    }

    #[test]
    fn the_slowest_cut_off_keeps_the_first_sample_and_the_fastest_lets_all_pass() {
        for cutoff_hz in [f32::MIN_POSITIVE, 1e-45] {
            let mut slow = LowPass::new(cutoff_hz).unwrap();
            assert_eq!((slow.update(3.0, 0.001), slow.update(9.0, 0.1)), (3.0, 3.0));
        }
        let mut fast = LowPass::new(f32::MAX).unwrap();
        assert_eq!((fast.update(3.0, 0.001), fast.update(9.0, 1e-6)), (3.0, 9.0));
    }

    #[test]
    fn a_low_pass_stands_still_within_the_documented_distance() {
        for (cutoff_hz, part) in [(1.0, 1e-5), (1e-3, 1e-2)] {
            let mut filter = LowPass::new(cutoff_hz).unwrap();
            filter.reset_to(100.0 * (1.0 - 2.0 * part));
            for _ in 0..1_000_000 {
                filter.update(100.0, 0.001);
            }
            let left = 1.0 - filter.value() / 100.0;
            assert!(left > 0.0 && left <= part, "{cutoff_hz} Hz: {left}");
        }
    }

    #[test]
    fn the_largest_floats_round_to_no_infinity() {
        let mut filter = LowPass::new(1e38).unwrap();
        filter.reset_to(-1.5e31);
        assert_eq!(filter.update(f32::MIN, 0.001), f32::MIN);
    }
}
