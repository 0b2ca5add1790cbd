//! The rotor's encoder, and the gear behind it.

use crate::error::{ConfigError, check};
use core::num::NonZeroU16;

/// Counts in one rotor turn of a 13-bit encoder.
pub const COUNTS_PER_TURN: u16 = 8192;

/// A gear ratio as an exact fraction: rotor turns to output turns.
///
/// # Examples
/// ```
/// use drivetrain::encoder::GearRatio;
///
/// const M3508: GearRatio = match GearRatio::new(3591, 187) {
///     Ok(ratio) => ratio,
///     Err(_) => panic!("not a gear"),
/// };
/// assert!((M3508.as_f32() - 19.2032).abs() < 1e-4);
/// assert_eq!(GearRatio::new(72, 2), GearRatio::new(36, 1)); // kept in lowest terms
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GearRatio {
    rotor: u16,
    output: u16,
}

impl GearRatio {
    /// The output shaft is the rotor.
    pub const DIRECT: Self = Self { rotor: 1, output: 1 };

    /// Takes the turns of the rotor during `output` turns of the output shaft.
    ///
    /// # Errors
    /// When a number is zero, when the output would turn more than twice as fast as the rotor, or when the reduced
    /// fraction has more than 4096 rotor turns.
    pub const fn new(rotor: u16, output: u16) -> Result<Self, ConfigError> {
        let (mut divisor, mut rest) = (rotor, output);
        while rest != 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        // Both zero: NaN, outside of every range.
        let ratio = rotor as f32 / output as f32;
        check!(ConfigError::check_range("gear ratio", ratio, 0.5, 4_096.0));
        let Some(divisor) = NonZeroU16::new(divisor) else {
            return Err(ConfigError::NotPositive("gear ratio"));
        };
        let (rotor, output) = (rotor / divisor.get(), output / divisor.get());
        let turns = "rotor turns of the gear ratio in lowest terms";
        check!(ConfigError::check_range(turns, rotor as f32, 1.0, 4_096.0));
        Ok(Self { rotor, output })
    }

    /// Returns the rotor turns of the reduced fraction: 1 to 4096.
    #[must_use]
    pub const fn rotor(self) -> u16 {
        self.rotor
    }

    /// Returns the output turns of the reduced fraction: 1 to 8192.
    #[must_use]
    pub const fn output(self) -> u16 {
        self.output
    }

    /// Returns rotor turns for one output turn, rounded to `f32`.
    #[must_use]
    pub const fn as_f32(self) -> f32 {
        self.rotor as f32 / self.output as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn ratios_that_cannot_be_tracked_are_refused() {
        for (rotor, output) in [(0, 1), (1, 0), (0, 0), (1, 3), (4099, 1)] {
            let name = GearRatio::new(rotor, output).map_err(|error| error.parameter());
            assert!(name.is_err_and(|name| name.contains("gear ratio")), "{rotor}:{output}");
        }
        assert!(GearRatio::new(1, 2).is_ok());
        assert!(GearRatio::new(4096, 1).is_ok());
        assert!(GearRatio::new(u16::MAX, u16::MAX).is_ok_and(|ratio| ratio == GearRatio::DIRECT));
    }

    #[test]
    fn a_refused_ratio_is_named_in_words() {
        let text = |rotor, output| GearRatio::new(rotor, output).unwrap_err().to_string();
        assert_eq!(text(4_099, 1), "gear ratio 4099: 0.5 to 4096 are allowed");
        assert_eq!(text(1, 3), "gear ratio 0.33333334: 0.5 to 4096 are allowed");
        assert_eq!(
            text(4_099, 4_098),
            "rotor turns of the gear ratio in lowest terms 4099: 1 to 4096 are allowed"
        );
    }
}
