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

/// A gear ratio that cannot be tracked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GearError {
    /// The rotor turns that were asked for.
    pub rotor: u16,
    /// The output turns that were asked for.
    pub output: u16,
}

impl core::fmt::Display for GearError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "gear ratio {}:{} is not between 1:2 and 4096:1, or needs more than 4096 rotor turns in lowest terms",
            self.rotor, self.output
        )
    }
}

impl core::error::Error for GearError {}

impl GearRatio {
    /// The output shaft is the rotor.
    pub const DIRECT: Self = Self { rotor: 1, output: 1 };

    /// Takes the turns of the rotor in the time that the output shaft makes `output` turns.
    ///
    /// # Errors
    /// When one of them is zero, when the output would turn more than twice as fast as the rotor, or when the
    /// reduced fraction has more than 4096 rotor turns.
    pub const fn new(rotor: u16, output: u16) -> Result<Self, GearError> {
        let (mut divisor, mut rest) = (rotor, output);
        while rest != 0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        if divisor == 0 {
            return Err(GearError { rotor, output });
        }
        let ratio = Self { rotor: rotor / divisor, output: output / divisor };
        let valid = ratio.rotor >= 1
            && ratio.rotor <= 4096
            && ratio.output >= 1
            && ratio.output as u32 <= 2 * ratio.rotor as u32;
        if valid { Ok(ratio) } else { Err(GearError { rotor, output }) }
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

    #[test]
    fn ratios_that_cannot_be_tracked_are_refused() {
        for (rotor, output) in [(0, 1), (1, 0), (0, 0), (1, 3), (4099, 1)] {
            assert_eq!(GearRatio::new(rotor, output), Err(GearError { rotor, output }));
        }
        assert!(GearRatio::new(1, 2).is_ok());
        assert!(GearRatio::new(4096, 1).is_ok());
        assert!(GearRatio::new(u16::MAX, u16::MAX).is_ok_and(|ratio| ratio == GearRatio::DIRECT));
    }

    #[test]
    fn a_refused_ratio_is_named_in_words() {
        let error = GearRatio::new(4099, 1).unwrap_err();
        assert!(
            std::format!("{error}").starts_with("gear ratio 4099:1 is not between 1:2 and 4096:1")
        );
    }
}
