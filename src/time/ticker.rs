//! Ticks of a loop, and the time step of each tick.

use super::{Duration, Instant};
use core::num::NonZeroU32;

/// One step of the control loop: its time, and the time since the last step.
///
/// Made by a [`Ticker`], or by hand in tests and in loops started by a hardware timer.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tick {
    now: Instant,
    dt_s: f32,
}

impl Tick {
    /// Takes the time of this step and the seconds since the last step.
    ///
    /// Any `dt_s` is accepted: each controller documents its reaction to zero, negative, NaN and very long steps.
    #[must_use]
    pub const fn new(now: Instant, dt_s: f32) -> Self {
        Self { now, dt_s }
    }

    /// Returns the time of this step.
    #[must_use]
    pub const fn now(self) -> Instant {
        self.now
    }

    /// Returns the seconds since the step before.
    #[must_use]
    pub const fn dt_s(self) -> f32 {
        self.dt_s
    }
}

/// Keeps the cadence of the control loop: no drift, and every missed period is counted.
///
/// Call [`due`](Self::due) as often as you like. Steps stay on the grid `first call + n * period`; a late step does not
/// move the following steps. Periods without a call are skipped, not made up for: the step after them carries the real
/// `dt_s`, and [`overruns`](Self::overruns) grows by their number. If the clock goes back behind the last step, a step
/// with a `dt_s` of 0 is due at once, so the devices notice, and the grid starts anew there.
///
/// # Examples
/// ```
/// use drivetrain::time::{Duration, Instant, Ticker};
///
/// let at = Instant::from_micros;
/// let mut ticker = Ticker::new(Duration::from_millis(1));
/// ticker.due(at(0)).ok_or("starts")?;
/// let late = ticker.due(at(3_200)).ok_or("due at 1000")?;
/// assert_eq!((late.dt_s(), ticker.overruns()), (0.0032, 2)); // 2000 and 3000 were skipped
/// assert!(ticker.due(at(3_999)).is_none());
/// assert!(ticker.due(at(4_000)).is_some()); // still on the grid
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Ticker {
    period_us: NonZeroU32,
    next: Option<Instant>,
    last: Instant,
    overruns: u32,
}

impl Ticker {
    /// Takes the period: at least 1 µs and at most 71 minutes, otherwise the nearest of these.
    #[must_use]
    pub const fn new(period: Duration) -> Self {
        let period_us = match period.micros_u32() {
            Some(micros) => match NonZeroU32::new(micros) {
                Some(micros) => micros,
                None => NonZeroU32::MIN,
            },
            None => NonZeroU32::MAX,
        };
        Self { period_us, next: None, last: Instant::START, overruns: 0 }
    }

    /// Returns the step due at `now`, or `None` when the next step lies ahead.
    ///
    /// The first call starts the cadence and carries one nominal period as `dt_s`.
    pub fn due(&mut self, now: Instant) -> Option<Tick> {
        let Some(next) = self.next else {
            self.last = now;
            self.next = Some(now + self.period());
            return Some(Tick::new(now, self.period().as_secs_f32()));
        };
        if now < next {
            return self.go_back(now);
        }
        let late = now.since(next);
        if late < self.period() {
            self.next = Some(next + self.period());
        } else {
            self.skip(next, late);
        }
        let tick = Tick::new(now, now.since(self.last).as_secs_f32());
        self.last = now;
        Some(tick)
    }

    /// Leaves out the elapsed steps, and stays on the grid.
    #[cold]
    #[inline(never)]
    fn skip(&mut self, next: Instant, late: Duration) {
        match late.micros_u32() {
            Some(late_us) => {
                let skipped = late_us / self.period_us;
                self.overruns = self.overruns.saturating_add(skipped);
                let steps = u64::from(skipped) + 1;
                let micros = steps * u64::from(self.period_us.get());
                self.next = Some(next + Duration::from_micros(micros));
            }
            None => {
                self.overruns = u32::MAX;
                self.next = Some(next + late + self.period());
            }
        }
    }

    /// A clock that went back behind the last step starts a new grid with a step at once.
    fn go_back(&mut self, now: Instant) -> Option<Tick> {
        if now >= self.last {
            return None;
        }
        self.last = now;
        self.next = Some(now + self.period());
        Some(Tick::new(now, 0.0))
    }

    /// Returns the time of the last step.
    pub(crate) const fn last(&self) -> Instant {
        self.last
    }

    /// Returns the number of skipped periods; `u32::MAX` after a single pause of over 71 minutes.
    #[must_use]
    pub const fn overruns(&self) -> u32 {
        self.overruns
    }

    /// Returns the period.
    #[must_use]
    pub const fn period(&self) -> Duration {
        Duration::from_micros(self.period_us.get() as u64)
    }
}

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
    /// use drivetrain::time::{Instant, Tick, TimeStep};
    ///
    /// let tick = Tick::new(Instant::from_micros(5_000), 0.001); // of `Runner::due`, in a program
    /// assert_eq!(TimeStep::of(tick.dt_s()), TimeStep::new(0.001, 0.1));
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

    /// The same step, [frozen](Self::is_frozen): the measurement before is too old for a rate.
    pub(crate) const fn frozen(self) -> Self {
        Self { half_dt_s: f32::INFINITY, per_dt: f32::INFINITY, ..self }
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

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    #[test]
    fn an_hour_at_one_kilohertz_does_not_drift() {
        let mut ticker = Ticker::new(Duration::from_millis(1));
        let (mut now, mut steps) = (0_u64, 0_u64);
        while now < 3_600_000_000 {
            steps += u64::from(ticker.due(at(now)).is_some());
            now += 137; // polled off the grid
        }
        assert_eq!((steps, ticker.overruns()), (3_600_000, 0));
    }

    #[test]
    fn time_that_goes_back_is_a_step_at_once_and_a_new_grid() {
        let mut ticker = Ticker::new(Duration::from_millis(1));
        assert!(ticker.due(at(10_000)).is_some());
        assert_eq!(ticker.due(at(10_500)), None);
        assert_eq!(ticker.due(at(10_200)), None, "back, but not behind the last step");
        assert_eq!(ticker.due(at(2_000)), Some(Tick::new(at(2_000), 0.0)));
        assert_eq!((ticker.due(at(2_999)), ticker.overruns()), (None, 0));
        assert_eq!(ticker.due(at(3_000)).map(Tick::dt_s), Some(0.001));
    }

    #[test]
    fn a_step_that_is_late_by_a_period_leaves_one_out() {
        let mut ticker = Ticker::new(Duration::from_millis(1));
        assert!(ticker.due(at(0)).is_some());
        assert_eq!(ticker.due(at(1_999)).map(Tick::dt_s), Some(0.001_999));
        assert_eq!(
            (ticker.overruns(), ticker.due(at(3_000)).map(Tick::dt_s)),
            (0, Some(0.001_001))
        );
        assert_eq!((ticker.overruns(), ticker.due(at(3_999))), (1, None));
        assert!(ticker.due(at(4_000)).is_some());
    }

    #[test]
    fn a_pause_of_days_is_one_step_and_a_saturated_count() {
        let mut ticker = Ticker::new(Duration::from_millis(1));
        assert!(ticker.due(at(0)).is_some());
        let after = at(10 * 86_400 * 1_000_000);
        assert!(ticker.due(after).is_some_and(|tick| tick.dt_s() > 863_999.0));
        assert_eq!(ticker.overruns(), u32::MAX);
        assert_eq!(ticker.due(after), None);
        assert!(ticker.due(after + Duration::from_millis(1)).is_some());
    }

    #[test]
    fn a_period_of_zero_is_one_microsecond() {
        let mut ticker = Ticker::new(Duration::ZERO);
        assert!(ticker.due(at(0)).is_some());
        assert_eq!(ticker.due(at(0)), None);
        assert!(ticker.due(at(1)).is_some());
    }

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
    fn a_step_of_no_time_and_an_input_that_is_no_number_are_counted_and_not_admitted() {
        let (step, hold) = (TimeStep::new(0.25, 1.0), TimeStep::new(0.0, 1.0));
        assert_eq!(TimeStep::usable(0.25, 1.0).map(|step| step.per_dt), Some(4.0));
        assert!(TimeStep::usable(0.25, 0.0).is_none());
        let mut rejected = u16::MAX - 2;
        assert!(step.admits(true, &mut rejected));
        assert_eq!(rejected, u16::MAX - 2);
        assert!(!step.admits(false, &mut rejected) && !hold.admits(true, &mut rejected));
        assert_eq!(rejected, u16::MAX);
        assert!(!hold.admits(false, &mut rejected));
        assert_eq!(rejected, u16::MAX);
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
