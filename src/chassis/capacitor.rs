use super::error::not_negative;
use crate::error::ConfigError;

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
/// [`PowerBuffer`](super::PowerBuffer) if lower. A burst then takes all of its power from the capacitor, and the buffer is left
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
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn values_that_cannot_work_are_named() {
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
