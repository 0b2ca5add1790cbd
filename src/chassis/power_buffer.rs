//! Energy beside the power limit: the buffer of the referee system, and a super-capacitor.

use super::{DeadClock, not_negative};
use crate::control::{Pid, PidConfig};
use crate::error::ConfigError;
use crate::time::TimeStep;

/// Spends an energy buffer down to a reserve and refills it: the allowed power from the charge.
///
/// The referee's buffer (60 J) drains by the power of the chassis above its limit, and fills by the power below. The
/// allowance is `limit + pid(energy - reserve)`: with a proportional gain `kp` in W/J the charge nears the reserve with the
/// time constant `1/kp` and never falls below it, as far as the power model is right. An integral gain corrects errors of
/// the model: the integral only ever takes power away, up to the whole limit, and so a full buffer winds nothing up to
/// empty it later. Without a reading only `blind_share` of the limit is allowed.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::PowerBuffer, control::PidConfig};
///
/// let mut buffer = PowerBuffer::new(20.0, PidConfig::new(2.0, 0.0, 0.0).with_output_limit(120.0))?;
/// assert_eq!(buffer.allowance_w(80.0, Some(60.0), 0.01), 160.0); // 40 J to spend
/// assert_eq!(buffer.allowance_w(80.0, Some(20.0), 0.01), 80.0); // at the reserve
/// assert_eq!(buffer.allowance_w(80.0, Some(0.0), 0.01), 40.0); // to fill up
/// assert_eq!(buffer.allowance_w(80.0, None, 0.01), 72.0);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerBuffer {
    pid: Pid,
    clock: DeadClock,
    reserve_j: f32,
    blind_share: f32,
}

impl PowerBuffer {
    /// Takes the charge to keep in J, and the loop from J to W.
    ///
    /// # Errors
    /// Names the invalid value.
    pub fn new(reserve_j: f32, pid: PidConfig) -> Result<Self, ConfigError> {
        Ok(Self {
            pid: Pid::new(pid)
                .map_err(|error| ConfigError::Loop("the buffer's loop", error.parameter()))?,
            clock: DeadClock::new(),
            reserve_j: not_negative(reserve_j, "reserve_j")?,
            blind_share: 0.9,
        })
    }

    /// Sets the share of the limit that is allowed without a reading: zero or more.
    ///
    /// # Errors
    /// [`ConfigError::Negative`] when the share is negative or not finite.
    pub fn with_blind_share(self, share: f32) -> Result<Self, ConfigError> {
        let blind_share = not_negative(share, "blind_share")?;
        Ok(Self { blind_share, ..self })
    }

    /// Returns the power in W to allow now, zero or more, from the limit in W and the charge in J.
    ///
    /// A charge that is NaN or infinite counts as missing; the loop then starts anew. A limit that is negative, NaN or infinite
    /// counts as zero. A `dt_s` that is zero, negative, NaN or infinite leaves the allowance above the limit unchanged; from the
    /// 100th such call in a row on the clock is dead, and a charge counts as missing.
    pub fn allowance_w(&mut self, limit_w: f32, energy_j: Option<f32>, dt_s: f32) -> f32 {
        let limit_w = not_negative(limit_w, "limit_w").unwrap_or(0.0);
        let dt_s = self.clock.take_step(dt_s);
        let charge = energy_j.filter(|energy| energy.is_finite() && !self.clock.is_dead());
        let Some(energy_j) = charge else {
            self.pid.reset();
            return limit_w * self.blind_share;
        };
        // The buffer is the measurement: above the reserve the loop's output is negative.
        let step = TimeStep::of(dt_s);
        let allowance_w = limit_w - self.pid.step(self.reserve_j, energy_j, &step);
        self.pid.keep_integral_between(0.0, limit_w);
        if allowance_w > 0.0 { allowance_w } else { 0.0 }
    }
}

/// The charge nears the reserve with a time constant of 1 / this, in 1/s.
const RATE_PER_S: f32 = 2.0;

/// The largest share of the supply's power left for charging below the reserve.
const CHARGING_SHARE: f32 = 0.1;

/// Plans a burst from a super-capacitor: the power for the chassis beside the power that the controller takes from the supply.
///
/// A burst adds `2/s (energy - reserve)`, at most the power that the controller can give. So the charge nears the reserve with a
/// time constant of 0.5 s. Below the reserve the same rule takes power away, at most a tenth, with or without a burst: an empty
/// capacitor charges, and an error of the power model is charged back. Without a burst nothing is added, and without a reading
/// nothing is added or taken away.
///
/// The power of the supply has to be the power commanded to the controller: the limit of the referee, or the allowance of
/// [`PowerBuffer`] if lower. A burst then takes all of its power from the capacitor, and the buffer is left
/// for the error of the controller.
///
/// # Examples
/// ```
/// use drivetrain::chassis::CapacitorPlan;
///
/// let plan = CapacitorPlan::new(2_000.0, 600.0)?.with_most_w(150.0)?;
/// assert_eq!(plan.allowance_w(80.0, Some(0.9), true), 230.0); // at most 150 W
/// assert_eq!(plan.allowance_w(80.0, Some(0.325), true), 180.0); // 50 J above the reserve: 100 W
/// assert_eq!(plan.allowance_w(80.0, Some(0.25), true), 72.0); // below it: 8 W to charge
/// assert_eq!(plan.allowance_w(80.0, Some(0.9), false), 80.0); // no burst
/// assert_eq!(plan.allowance_w(80.0, None, true), 80.0); // switched off, in error, or not heard
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CapacitorPlan {
    full_j: f32,
    reserve_j: f32,
    most_w: f32,
}

impl CapacitorPlan {
    /// Takes the energy of a full capacitor and the reserve, in J, both from the charge at which the controller reports zero.
    ///
    /// # Errors
    /// Names the value that is negative or not finite.
    pub fn new(full_j: f32, reserve_j: f32) -> Result<Self, ConfigError> {
        Ok(Self {
            full_j: not_negative(full_j, "full_j")?,
            reserve_j: not_negative(reserve_j, "reserve_j")?,
            most_w: f32::MAX,
        })
    }

    /// Sets the largest power in W taken from the capacitor.
    ///
    /// # Errors
    /// [`ConfigError::Negative`] when the power is negative or not finite.
    pub fn with_most_w(self, most_w: f32) -> Result<Self, ConfigError> {
        Ok(Self { most_w: not_negative(most_w, "most_w")?, ..self })
    }

    /// Returns the power in W for the chassis, from the power in W that the controller takes from the supply, and the remaining
    /// share of the capacitor's energy.
    ///
    /// A share of NaN counts as no reading, a share outside of 0 to 1 as the nearest end. A power that is negative, NaN or
    /// infinite counts as zero.
    #[must_use]
    pub fn allowance_w(&self, supply_w: f32, share: Option<f32>, burst: bool) -> f32 {
        let supply_w = not_negative(supply_w, "supply_w").unwrap_or(0.0);
        let Some(share) = share.filter(|share| !share.is_nan()) else { return supply_w };
        let above_j = share.clamp(0.0, 1.0) * self.full_j - self.reserve_j;
        let most_w = if burst { self.most_w } else { 0.0 };
        supply_w + (RATE_PER_S * above_j).max(-CHARGING_SHARE * supply_w).min(most_w)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "zero and one are exact")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn buffer() -> PowerBuffer {
        PowerBuffer::new(15.0, PidConfig::new(3.0, 0.0, 0.0)).unwrap()
    }

    #[test]
    fn full_throttle_drains_to_the_reserve_and_not_below() {
        let (mut buffer, mut energy_j, mut lowest) = (buffer(), 60.0_f32, 60.0_f32);
        for _ in 0..10_000 {
            let power_w = buffer.allowance_w(80.0, Some(energy_j), 0.001);
            energy_j += (80.0 - power_w) * 0.001;
            lowest = lowest.min(energy_j);
        }
        assert!(lowest >= 14.99 && energy_j < 15.1, "{lowest} {energy_j}");
    }

    #[test]
    fn with_a_model_that_is_wrong_by_a_tenth_the_buffer_never_empties() {
        let (mut buffer, mut energy_j) = (buffer(), 60.0_f32);
        for _ in 0..10_000 {
            let power_w = buffer.allowance_w(80.0, Some(energy_j), 0.001) * 1.1;
            energy_j += (80.0 - power_w) * 0.001;
            assert!(energy_j > 10.0, "{energy_j}");
        }
    }

    /// Ten seconds with nothing to drive, then thirty at full throttle: the lowest charge and the last.
    fn idle_then_throttle(gains: PidConfig, wrong: f32) -> (f32, f32) {
        let mut buffer = PowerBuffer::new(20.0, gains).unwrap();
        let (mut energy_j, mut lowest) = (60.0_f32, 60.0_f32);
        for step in 0..40_000 {
            let allowed_w = buffer.allowance_w(80.0, Some(energy_j), 0.001);
            let power_w = if step < 10_000 { 0.0 } else { allowed_w * wrong };
            energy_j = (energy_j + (80.0 - power_w) * 0.001).clamp(0.0, 60.0);
            lowest = lowest.min(energy_j);
        }
        (lowest, energy_j)
    }

    #[test]
    fn idling_with_a_full_buffer_winds_nothing_up() {
        for (kp, ki) in [(2.0, 0.5), (2.0, 10.0), (0.5, 5.0), (20.0, 1.0), (3.0, 0.0)] {
            for gains in
                [PidConfig::new(kp, ki, 0.0), PidConfig::new(kp, ki, 0.0).with_output_limit(120.0)]
            {
                let (lowest, last) = idle_then_throttle(gains, 1.0);
                assert!(lowest >= 19.9, "{kp} {ki}: {lowest} J");
                assert!(last < 20.1, "{kp} {ki}: {last} J are never used");
            }
        }
    }

    #[test]
    fn an_integral_gain_restores_the_reserve_despite_a_wrong_model() {
        for (kp, ki) in [(2.0, 0.5), (2.0, 2.0), (3.0, 1.0)] {
            let (lowest, last) = idle_then_throttle(PidConfig::new(kp, ki, 0.0), 1.1);
            assert!(lowest > 15.0 && (last - 20.0).abs() < 0.1, "{kp} {ki}: {lowest} {last}");
        }
    }

    #[test]
    fn a_buffer_empty_for_a_minute_is_spent_again_when_full() {
        let mut buffer = PowerBuffer::new(20.0, PidConfig::new(2.0, 0.5, 0.0)).unwrap();
        for _ in 0..60_000 {
            assert!(buffer.allowance_w(80.0, Some(0.0), 0.001) >= 0.0);
        }
        let mut allowed_w = 0.0;
        for _ in 0..4_500 {
            allowed_w = buffer.allowance_w(80.0, Some(60.0), 0.001);
        }
        assert!((allowed_w - 160.0).abs() < 0.1, "{allowed_w}");
    }

    #[test]
    fn readings_and_limits_that_are_no_numbers_are_safe() {
        for limit in [f32::NAN, f32::INFINITY, -10.0] {
            assert!(buffer().allowance_w(limit, Some(15.0), 0.001).abs() < 1e-6);
        }
        assert!((buffer().allowance_w(80.0, Some(f32::NAN), 0.001) - 72.0).abs() < 1e-4);
        assert_eq!(buffer().allowance_w(10.0, Some(0.0), 0.001), 0.0);
    }

    // Without time the loop holds its output: an empty buffer kept the allowance of a full buffer.
    #[test]
    fn a_clock_that_died_allows_no_more_than_without_a_reading() {
        for dt_s in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let mut buffer = buffer();
            for _ in 0..10 {
                assert!(buffer.allowance_w(80.0, Some(60.0), 0.001) > 200.0);
            }
            for _ in 0..99 {
                buffer.allowance_w(80.0, Some(0.0), dt_s);
            }
            assert!((buffer.allowance_w(80.0, Some(0.0), dt_s) - 72.0).abs() < 1e-4, "{dt_s}");
            assert!((buffer.allowance_w(80.0, Some(0.0), 0.001) - 35.0).abs() < 1e-4, "{dt_s}");
        }
    }

    #[test]
    fn values_of_a_buffer_that_cannot_work_are_named() {
        let reserve = PowerBuffer::new(-1.0, PidConfig::new(1.0, 0.0, 0.0));
        assert_eq!(reserve, Err(ConfigError::Negative("reserve_j")));
        assert!(matches!(
            PowerBuffer::new(1.0, PidConfig::new(f32::NAN, 0.0, 0.0)),
            Err(ConfigError::Loop(_, _))
        ));
    }

    #[test]
    fn values_of_a_plan_that_cannot_work_are_named() {
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(CapacitorPlan::new(bad, 1.0), Err(ConfigError::Negative("full_j")));
            assert_eq!(CapacitorPlan::new(1.0, bad), Err(ConfigError::Negative("reserve_j")));
            let plan = CapacitorPlan::new(1.0, 1.0).unwrap();
            assert_eq!(plan.with_most_w(bad), Err(ConfigError::Negative("most_w")));
        }
    }

    #[test]
    fn a_long_burst_ends_at_the_reserve() {
        let plan = CapacitorPlan::new(2_000.0, 600.0).unwrap().with_most_w(150.0).unwrap();
        let mut energy_j = 2_000.0_f32;
        for _ in 0..20_000 {
            let added_w = plan.allowance_w(80.0, Some(energy_j / 2_000.0), true) - 80.0;
            energy_j -= added_w * 0.001;
            assert!(energy_j >= 599.9, "{energy_j}");
        }
        assert!(energy_j < 600.1, "{energy_j}");
    }

    #[test]
    fn a_model_that_is_wrong_by_a_twentieth_empties_no_capacitor() {
        let plan = CapacitorPlan::new(2_000.0, 600.0).unwrap().with_most_w(150.0).unwrap();
        let mut energy_j = 2_000.0_f32;
        for _ in 0..60_000 {
            let taken_w = 1.05 * plan.allowance_w(80.0, Some(energy_j / 2_000.0), true);
            energy_j -= (taken_w - 80.0) * 0.001;
            assert!(energy_j >= 597.0, "{energy_j}");
        }
    }

    proptest! {
        #[test]
        fn no_reading_adds_more_than_the_most_or_takes_more_than_a_tenth(
            (full_j, reserve_j, most_w) in (0.0_f32..1e5, 0.0_f32..1e5, 0.0_f32..1e3),
            (supply, share) in (any::<u32>(), any::<u32>()),
            burst: bool,
        ) {
            let plan = CapacitorPlan::new(full_j, reserve_j).unwrap().with_most_w(most_w).unwrap();
            let (supply_w, share) = (f32::from_bits(supply), f32::from_bits(share));
            let allowed_w = plan.allowance_w(supply_w, Some(share), burst);
            let base_w = if supply_w > 0.0 && supply_w.is_finite() { supply_w } else { 0.0 };
            prop_assert!(allowed_w >= 0.899 * base_w && allowed_w <= base_w + most_w);
            let has_more = burst && share.clamp(0.0, 1.0) * full_j > reserve_j;
            prop_assert!(has_more || allowed_w <= base_w);
        }
    }
}
