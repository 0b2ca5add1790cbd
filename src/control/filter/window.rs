use crate::control::number::finite;

/// The mean of the last `N` samples.
///
/// ```text
/// value = (x + x1 + ... + x(N-1)) / N
/// ```
/// Every call adds `N` numbers, so there is no running sum that could drift. Takes out a disturbance whose period is `N` samples.
///
/// # Edge behaviour
/// Before `N` samples it is the mean of those there are. It knows no time: after a gap in the samples, [`reset`](Self::reset) it. A
/// sample that is NaN or infinite changes nothing and is counted. Of samples whose sum is beyond `f32` the mean is right all the same.
///
/// # Examples
/// ```
/// use drivetrain::control::MovingAverage;
///
/// let mut average = MovingAverage::<3>::new();
/// average.update(1.0);
/// assert_eq!(average.update(2.0), 1.5);
/// average.update(3.0);
/// assert_eq!(average.update(7.0), 4.0); // 2, 3, 7
/// ```
/// A window of no samples does not compile:
/// ```compile_fail
/// let none = drivetrain::control::MovingAverage::<0>::new();
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MovingAverage<const N: usize> {
    window: Window<N>,
    value: f32,
}

/// The middle one of the last `N` samples: single wrong samples vanish, edges stay sharp.
///
/// For an even number of samples it is the lower one of the two in the middle. A call makes `N` times `N` comparisons.
///
/// # Edge behaviour
/// Before `N` samples it is the median of those there are. It knows no time: after a gap in the samples, [`reset`](Self::reset)
/// it. A sample that is NaN or infinite changes nothing and is counted.
///
/// # Examples
/// ```
/// use drivetrain::control::Median;
///
/// let mut median = Median::<3>::new();
/// for sample in [1.0, 1.1] {
///     median.update(sample);
/// }
/// assert_eq!(median.update(99.0), 1.1); // one wrong sample
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Median<const N: usize> {
    window: Window<N>,
    value: f32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Window<const N: usize> {
    samples: [f32; N],
    oldest: usize,
    filled: usize,
    rejected: u16,
}

impl<const N: usize> Window<N> {
    const fn new() -> Self {
        const { assert!(N > 0, "a window needs at least one sample") }
        Self { samples: [0.0; N], oldest: 0, filled: 0, rejected: 0 }
    }

    /// Tells whether the sample was good.
    fn push(&mut self, sample: f32) -> bool {
        if !sample.is_finite() {
            self.rejected = self.rejected.saturating_add(1);
            return false;
        }
        if let Some(oldest) = self.samples.get_mut(self.oldest) {
            *oldest = sample;
        }
        self.oldest = if self.oldest + 1 < N { self.oldest + 1 } else { 0 };
        self.filled = if self.filled < N { self.filled + 1 } else { N };
        true
    }

    fn held(&self) -> impl Iterator<Item = f32> + Clone {
        self.samples.iter().copied().take(self.filled)
    }
}

impl<const N: usize> MovingAverage<N> {
    /// Starts without samples. `N` must be at least 1, or it does not compile.
    #[must_use]
    pub const fn new() -> Self {
        Self { window: Window::new(), value: 0.0 }
    }

    /// Takes the next sample and returns the new mean.
    pub fn update(&mut self, sample: f32) -> f32 {
        if self.window.push(sample) {
            let part = 1.0 / self.window.filled as f32;
            let sum: f32 = self.window.held().sum();
            self.value = if sum.is_finite() {
                sum * part
            } else {
                // Rounding may pass the largest number.
                finite(self.window.held().map(|sample| sample * part).sum())
            };
        }
        self.value
    }

    /// Forgets the samples.
    pub const fn reset(&mut self) {
        (self.window.oldest, self.window.filled, self.value) = (0, 0, 0.0);
    }

    /// Returns the last mean; zero before the first sample.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Returns the number of samples that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.window.rejected
    }
}

impl<const N: usize> Default for MovingAverage<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Median<N> {
    /// Starts without samples. `N` must be at least 1, or it does not compile.
    #[must_use]
    pub const fn new() -> Self {
        Self { window: Window::new(), value: 0.0 }
    }

    /// Takes the next sample and returns the new median.
    pub fn update(&mut self, sample: f32) -> f32 {
        if self.window.push(sample) {
            let middle = (self.window.filled - 1) / 2;
            let samples = self.window.held();
            self.value = samples
                .clone()
                .find(|&candidate| {
                    let below = samples.clone().filter(|&other| other < candidate).count();
                    let up_to = samples.clone().filter(|&other| other <= candidate).count();
                    below <= middle && middle < up_to
                })
                .unwrap_or(sample);
        }
        self.value
    }

    /// Forgets the samples.
    pub const fn reset(&mut self) {
        (self.window.oldest, self.window.filled, self.value) = (0, 0, 0.0);
    }

    /// Returns the last median; zero before the first sample.
    #[must_use]
    pub const fn value(&self) -> f32 {
        self.value
    }

    /// Returns the number of samples that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.window.rejected
    }
}

impl<const N: usize> Default for Median<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bad_samples_change_nothing_and_are_counted() {
        let (mut average, mut median) = (MovingAverage::<3>::new(), Median::<3>::new());
        for sample in [f32::NAN, 4.0, f32::INFINITY, f32::NEG_INFINITY] {
            average.update(sample);
            median.update(sample);
        }
        assert_eq!((average.value(), average.rejected()), (4.0, 3));
        assert_eq!((median.value(), median.rejected()), (4.0, 3));
    }

    #[test]
    fn the_mean_of_huge_samples_is_finite() {
        let mut average = MovingAverage::<10>::new();
        for _ in 0..10 {
            average.update(f32::MAX);
        }
        assert_eq!(average.value(), f32::MAX);
    }

    #[test]
    fn a_million_samples_leave_no_drift() {
        let mut average = MovingAverage::<8>::new();
        for sample in 0..1_000_000_u32 {
            average.update((sample % 17) as f32 * 1e4);
        }
        for _ in 0..8 {
            average.update(0.0);
        }
        assert_eq!(average.value(), 0.0);
    }

    #[test]
    fn reset_forgets() {
        let (mut average, mut median) = (MovingAverage::<3>::default(), Median::<3>::default());
        for sample in [1.0, 2.0, 3.0] {
            average.update(sample);
            median.update(sample);
        }
        average.reset();
        median.reset();
        assert_eq!((average.update(8.0), median.update(8.0)), (8.0, 8.0));
    }

    proptest! {
        #[test]
        fn the_median_is_that_of_the_sorted_window(samples in prop::collection::vec(-9_i8..9, 1..30)) {
            let mut median = Median::<5>::new();
            for (index, &sample) in samples.iter().enumerate() {
                let mut window: Vec<i8> = samples[index.saturating_sub(4)..=index].to_vec();
                window.sort_unstable();
                let expected = f32::from(window[(window.len() - 1) / 2]);
                prop_assert_eq!(median.update(f32::from(sample)), expected);
            }
        }
    }

    use std::vec::Vec;
}
