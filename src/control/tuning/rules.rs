use crate::control::pid::PidConfig;

/// How gains follow from the ultimate gain `Ku` and period `Tu` of a plant.
///
/// | rule | kp | integral time | derivative time | character |
/// |---|---|---|---|---|
/// | `ZieglerNicholsP` | 0.5 Ku | | | steady error |
/// | `ZieglerNicholsPi` | 0.45 Ku | Tu / 1.2 | | quick, overshoots |
/// | `ZieglerNicholsPid` | 0.6 Ku | Tu / 2 | Tu / 8 | quick, overshoots by a quarter and more |
/// | `TyreusLuybenPi` | Ku / 3.2 | 2.2 Tu | | calm; for speed loops start here |
/// | `TyreusLuybenPid` | Ku / 2.2 | 2.2 Tu | Tu / 6.3 | calm |
///
/// Sources: Ziegler and Nichols, "Optimum Settings for Automatic Controllers", Transactions of the ASME 64 (1942);
/// Tyreus and Luyben, "Tuning PI Controllers for Integrator/Dead Time Processes", Industrial and Engineering Chemistry
/// Research 31 (1992), its PID as in Luyben and Luyben, "Essentials of Process Control" (1997).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum TuningRule {
    /// Proportional only.
    ZieglerNicholsP,
    /// Proportional and integral.
    ZieglerNicholsPi,
    /// All three terms.
    ZieglerNicholsPid,
    /// Proportional and integral, with large margins.
    TyreusLuybenPi,
    /// All three terms, with large margins.
    TyreusLuybenPid,
}

impl TuningRule {
    /// Returns a configuration with the gains for an ultimate gain `Ku` and a period `Tu` in seconds, and no option.
    ///
    /// [`RelayTuner::pid`](super::RelayTuner::pid) measures both.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::TuningRule;
    ///
    /// let speed = TuningRule::ZieglerNicholsPid.pid(10.0, 0.2).with_output_limit(20.0);
    /// assert_eq!(speed.gains(), (6.0, 60.0, 0.15)); // kp, ki, kd
    /// ```
    pub const fn pid(self, ultimate_gain: f32, ultimate_period_s: f32) -> PidConfig {
        let (ku, tu) = (ultimate_gain, ultimate_period_s);
        let (kp, ki, kd) = match self {
            Self::ZieglerNicholsP => (0.5 * ku, 0.0, 0.0),
            Self::ZieglerNicholsPi => (0.45 * ku, 0.54 * ku / tu, 0.0),
            Self::ZieglerNicholsPid => (0.6 * ku, 1.2 * ku / tu, 0.075 * ku * tu),
            Self::TyreusLuybenPi => (ku / 3.2, ku / (3.2 * 2.2 * tu), 0.0),
            Self::TyreusLuybenPid => (ku / 2.2, ku / (2.2 * 2.2 * tu), ku * tu / (2.2 * 6.3)),
        };
        PidConfig::new(kp, ki, kd)
    }
}
