//! Filters for measurements and commands.
//!
//! | filter | takes out | delay | time step |
//! |---|---|---|---|
//! | [`LowPass`] | noise, gently | its time constant | any, from call to call |
//! | [`Biquad`] | noise, steeply; one resonance | about `0.2 / cutoff` | fixed |
//! | [`Window::mean`] | noise, and a disturbance of exactly `N` samples | `(N - 1) / 2` samples | fixed |
//! | [`Window::median`] | single wrong samples | `(N - 1) / 2` samples | fixed |
//!
//! A filter starts at rest on its first sample, so there is no transient from zero. A NaN or infinite sample changes
//! nothing: the last output is returned and the sample is counted.

mod window;

pub use window::Window;

use crate::control::number::finite;
use crate::error::{ConfigError, check, positive};
use crate::math;
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
    pub(super) const fn pass(&mut self, input: f32, step: &TimeStep) -> f32 {
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

/// A second-order filter for samples at a fixed rate: low-pass or notch.
///
/// ```text
/// y = (b0 x + b1 x1 + b2 x2 - a1 y1 - a2 y2) / a0
/// w = 2 pi f / sample_hz,   alpha = sin(w) / (2 q)
/// low-pass: b0 = b2 = (1 - cos w)/2, b1 = 1 - cos w    notch: b0 = b2 = 1, b1 = -2 cos w
/// both:     a0 = 1 + alpha, a1 = -2 cos w, a2 = 1 - alpha
/// ```
/// Computed in the transposed direct form II. Source: Bristow-Johnson, "Cookbook formulae for audio equalizer biquad
/// filter coefficients".
///
/// Rounding grows as the cut-off falls: at a thousandth of the sample rate, rounding reaches 0.2 % of the signal, and soon
/// after would grow without bound. At lower cut-offs use a [`LowPass`], or filter every tenth sample.
///
/// # Edge behaviour
/// The first sample is the first output, at rest. The filter knows no time: after a gap in the samples, call
/// [`reset`](Self::reset). If a sample is NaN or infinite, the last output is returned, the state stays and
/// [`rejected`](Self::rejected) grows. The same when a sum overflows; then the next sample is a first sample.
///
/// # Examples
/// ```
/// use drivetrain::control::Biquad;
///
/// // A belt that rings at 35 Hz, in a loop of 1 kHz.
/// const BELT: Biquad = match Biquad::notch(35.0, 2.0, 1000.0) {
///     Ok(filter) => filter,
///     Err(_) => panic!("notch"),
/// };
/// let mut filter = BELT;
/// assert_eq!(filter.update(4.0), 4.0);
/// assert!((filter.update(4.0) - 4.0).abs() < 1e-5); // a constant passes
/// assert!(Biquad::low_pass(500.0, 0.707, 1000.0).is_err()); // at half the sample rate
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Biquad {
    b0: f32,
    b1: f32,
    b2: f32,
    a1: f32,
    a2: f32,
    s1: f32,
    s2: f32,
    value: f32,
    rejected: u16,
    started: bool,
}

impl Biquad {
    /// The quality of a Butterworth low-pass: flat in the pass band, 71 % (-3 dB) at the cut-off.
    pub const BUTTERWORTH: f32 = core::f32::consts::FRAC_1_SQRT_2;

    /// Passes frequencies below `cutoff_hz`. A `q` of [`BUTTERWORTH`](Self::BUTTERWORTH) is flat; a larger `q` peaks.
    ///
    /// # Errors
    /// Names `cutoff`, `q` or `sample_hz` when NaN, infinite, zero or negative; `cutoff` when not from 0.001 to 0.499 of `sample_hz`,
    /// `q` when not from 0.01 to 100.
    pub const fn low_pass(cutoff_hz: f32, q: f32, sample_hz: f32) -> Result<Self, ConfigError> {
        check!(check_all("cutoff", cutoff_hz, q, sample_hz));
        let (sine, cosine) = math::sin_cos(core::f32::consts::TAU * (cutoff_hz / sample_hz));
        let mut filter = Self::normalized(0.0, 0.0, sine / (2.0 * q), cosine);
        // (1 - cos w) / a0, from the rounded a1 and a2: so a constant passes unchanged at low cut-offs too.
        let rise = 0.5 * ((1.0 + filter.a1) + filter.a2);
        (filter.b0, filter.b1, filter.b2) = (0.5 * rise, rise, 0.5 * rise);
        Ok(filter)
    }

    /// Takes out a narrow band about `center_hz`, `center_hz / q` wide at -3 dB.
    ///
    /// # Errors
    /// Names `center`, `q` or `sample_hz` when NaN, infinite, zero or negative; `center` when not from 0.001 to 0.499 of `sample_hz`,
    /// `q` when not from 0.01 to 100.
    pub const fn notch(center_hz: f32, q: f32, sample_hz: f32) -> Result<Self, ConfigError> {
        check!(check_all("center", center_hz, q, sample_hz));
        let (sine, cosine) = math::sin_cos(core::f32::consts::TAU * (center_hz / sample_hz));
        Ok(Self::normalized(1.0, -2.0 * cosine, sine / (2.0 * q), cosine))
    }

    const fn normalized(b0: f32, b1: f32, alpha: f32, cosine: f32) -> Self {
        let scale = 1.0 / (1.0 + alpha);
        Self {
            b0: b0 * scale,
            b1: b1 * scale,
            b2: b0 * scale,
            a1: -2.0 * cosine * scale,
            a2: (1.0 - alpha) * scale,
            s1: 0.0,
            s2: 0.0,
            value: 0.0,
            rejected: 0,
            started: false,
        }
    }

    /// Takes the next sample and returns the new value.
    ///
    /// Costs 46 instructions on a Cortex-M4F (`docs/figures.md`).
    pub const fn update(&mut self, input: f32) -> f32 {
        if !self.started && input.is_finite() {
            self.reset_to(input);
            return self.value;
        }
        let value = self.b0 * input + self.s1;
        let s1 = self.b1 * input - self.a1 * value + self.s2;
        let s2 = self.b2 * input - self.a2 * value;
        if value.is_finite() && s1.is_finite() && s2.is_finite() {
            (self.value, self.s1, self.s2) = (value, s1, s2);
        } else {
            self.rejected = self.rejected.saturating_add(1);
            // If a good sample overflows, the past is the cause: the filter starts anew with the
            // next sample.
            self.started = self.started && !input.is_finite();
        }
        self.value
    }

    /// Forgets the past: the next sample counts as the first.
    pub const fn reset(&mut self) {
        self.reset_to(0.0);
        self.started = false;
    }

    /// Puts the filter at rest at `value`, as after a long constant input. NaN and infinity count as zero.
    pub const fn reset_to(&mut self, value: f32) {
        let value = if value.is_finite() { value } else { 0.0 };
        self.value = value;
        self.s2 = (self.b2 - self.a2) * value;
        self.s1 = (self.b1 - self.a1) * value + self.s2;
        if !self.s1.is_finite() || !self.s2.is_finite() {
            (self.s1, self.s2) = (0.0, 0.0);
        }
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

const fn check_all(
    name: &'static str,
    frequency_hz: f32,
    q: f32,
    sample_hz: f32,
) -> Result<(), ConfigError> {
    check!(positive(name, frequency_hz));
    check!(positive("q", q));
    check!(positive("sample_hz", sample_hz));
    // Nearer to the ends, and at other qualities, the poles round onto the unit circle or past it.
    let part = frequency_hz / sample_hz;
    if part > 0.499 {
        Err(ConfigError::Unstable(name))
    } else if part < 0.001 {
        Err(ConfigError::OutOfRange(name))
    } else if q < 0.01 || q > 100.0 {
        Err(ConfigError::OutOfRange("q"))
    } else {
        Ok(())
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

    /// The gain for a sine of this frequency, at 1 kHz.
    fn gain_at(mut filter: Biquad, frequency_hz: f32) -> f32 {
        let step = core::f32::consts::TAU * frequency_hz / 1000.0;
        let power: f32 = (0..4000_u16)
            .map(|sample| filter.update(math::sin_cos(step * f32::from(sample)).0))
            .skip(2000)
            .map(|value| value * value)
            .sum();
        (power / 1000.0).sqrt()
    }

    #[test]
    fn low_pass_keeps_71_percent_at_the_cut_off_and_a_hundredth_a_decade_up() {
        let filter = Biquad::low_pass(20.0, Biquad::BUTTERWORTH, 1000.0).unwrap();
        assert!((gain_at(filter, 20.0) - 0.707).abs() < 0.005);
        assert!((gain_at(filter, 2.0) - 1.0).abs() < 0.005);
        assert!(gain_at(filter, 200.0) < 0.01);
    }

    #[test]
    fn notch_takes_out_its_centre_only() {
        let filter = Biquad::notch(50.0, 2.0, 1000.0).unwrap();
        assert!(gain_at(filter, 50.0) < 0.01);
        assert!(gain_at(filter, 5.0) > 0.99 && gain_at(filter, 300.0) > 0.98);
    }

    #[test]
    fn a_constant_passes_from_the_first_sample() {
        for frequency_hz in [1.0, 30.0, 499.0] {
            let mut filter = Biquad::low_pass(frequency_hz, 0.707, 1000.0).unwrap();
            for _ in 0..10_000 {
                assert!((filter.update(100.0) - 100.0).abs() < 0.2);
            }
        }
    }

    #[test]
    fn bad_samples_change_nothing_and_are_counted() {
        let mut filter = Biquad::low_pass(20.0, 0.707, 1000.0).unwrap();
        assert_eq!(filter.update(f32::NAN), 0.0);
        filter.update(1.0);
        filter.update(2.0);
        let before = filter;
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(filter.update(bad), before.value());
        }
        assert_eq!((filter.rejected(), Biquad { rejected: 1, ..filter }), (4, before));
        let mut notch = Biquad::notch(300.0, 0.3, 1000.0).unwrap();
        for sample in [f32::MAX, f32::MIN, f32::MAX, 1.0, 2.0] {
            assert!(notch.update(sample).is_finite());
        }
    }

    #[test]
    fn a_frequency_or_a_quality_that_cannot_be_is_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(Biquad::low_pass(bad, 0.7, 1000.0).unwrap_err().parameter(), "cutoff");
            assert_eq!(Biquad::notch(bad, 0.7, 1000.0).unwrap_err().parameter(), "center");
            assert_eq!(Biquad::notch(10.0, bad, 1000.0).unwrap_err().parameter(), "q");
            assert_eq!(Biquad::notch(10.0, 1.0, bad).unwrap_err().parameter(), "sample_hz");
        }
        let out_of_range = ConfigError::OutOfRange("cutoff");
        assert_eq!(Biquad::low_pass(0.03, 0.7, 1000.0), Err(out_of_range)); // once grew to 1e38
        for q in [0.009, 101.0, 1e-44, f32::MAX] {
            let error = ConfigError::OutOfRange("q");
            assert_eq!(Biquad::notch(50.0, q, 1000.0), Err(error));
        }
        for near_half in [499.1, 499.99, 500.0, 1e30] {
            let error = ConfigError::Unstable("center");
            assert_eq!(Biquad::notch(near_half, 1.0, 1000.0), Err(error));
        }
    }

    /// Law: for every accepted parameter, the poles lie within the unit circle, by a hundred roundings at least.
    #[test]
    fn every_filter_that_is_taken_is_stable() {
        let parts = (0..=498_u16).map(|thousandth| f32::from(thousandth + 1) * 1e-3);
        for part in parts.chain([0.001_1, 0.001_5, 0.498_9]) {
            for q in [0.01, 0.1, 0.5, 0.707, 2.0, 10.0, 100.0] {
                for made in [Biquad::low_pass(part, q, 1.0), Biquad::notch(part, q, 1.0)] {
                    let Biquad { a1, a2, .. } = made.unwrap();
                    let (a1, a2) = (f64::from(a1), f64::from(a2));
                    let left = (1.0 - a2).min(1.0 + a2 - a1.abs()); // the triangle of Jury
                    assert!(left > 100.0 * f64::from(f32::EPSILON / 2.0), "{part} {q}: {left}");
                }
            }
        }
    }

    #[test]
    fn a_past_that_overflows_is_forgotten() {
        for huge in [3e38_f32, -3e38] {
            let mut filter = Biquad::low_pass(20.0, 0.707, 1000.0).unwrap();
            for _ in 0..200 {
                filter.update(huge);
            }
            for _ in 0..2_000 {
                filter.update(1.0);
            }
            assert!((filter.value() - 1.0).abs() < 1e-2, "{}", filter.value());
        }
    }
}
