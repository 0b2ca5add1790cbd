//! Facts of the models, as a table open to further models.

use crate::error::{ConfigError, check};
use crate::lk::model::Scale;
use crate::motor::models;

/// The current of a count, in A (manual, "torque closed loop").
pub(super) const AMPERES_PER_COUNT: f32 = 0.01;

/// A model of motor: its torque constant and its largest current. All other values of the protocol are of the output shaft.
///
/// | model | torque constant Nm/A at the output shaft | largest current A | seen in |
/// |---|--:|--:|---|
/// | [`X2_7`](Self::X2_7) | 0.8 | 8.1, peak | Seeed's table of the series |
/// | [`X4_10`](Self::X4_10) | 0.8 | 19.5, peak | the same |
/// | [`X4_36`](Self::X4_36) | 1.9 | 21.5, peak | the same |
/// | [`X8_120`](Self::X8_120) | 2.4 | 43.8, peak | the same |
/// | [`X12_320`](Self::X12_320) | 3.3 | 100, peak | the same |
/// | [`X15_450`](Self::X15_450) | 5.8 | 69.2, peak | the same |
/// | [`X6_40`](Self::X6_40) | 3.46 | 5.2, rated | the vendor's pages, as `myactuator_rmd` quotes them: rated torque through rated current |
/// | [`X8_60`](Self::X8_60) | 7.5 | 4, rated | the same |
/// | [`X8_90`](Self::X8_90) | 2.5 | 10, rated | the same |
/// | [`X10_100`](Self::X10_100) | 7.46 | 6.7, rated | the same |
///
/// The currents of these tables are effective values of a phase. Whether the current on the wire is an effective value is not public:
/// if the current is an amplitude, a motor gives 0.71 of the set torque.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::rmd::Model;
///
/// assert!((Model::X8_60.max_torque_nm() - 30.0).abs() < 1e-4);
/// let mine = Model::new("RMD-X6-8", 1.25, 3.6)?; // 4.5 Nm at 3.6 A
/// assert!((mine.max_torque_nm() - 4.5).abs() < 1e-6);
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    name: &'static str,
    torque_constant: f32,
    max_current_a: f32,
}

models! {
    X2_7 "RMD-X2-7" 0.8 8.1;
    X4_10 "RMD-X4-10" 0.8 19.5;
    X4_36 "RMD-X4-36" 1.9 21.5;
    X6_40 "RMD-X6-40" 3.46 5.2;
    X8_60 "RMD-X8-60" 7.5 4.0;
    X8_90 "RMD-X8-90" 2.5 10.0;
    X8_120 "RMD-X8-120" 2.4 43.8;
    X10_100 "RMD-X10-100" 7.46 6.7;
    X12_320 "RMD-X12-320" 3.3 100.0;
    X15_450 "RMD-X15-450" 5.8 69.2;
}

impl Model {
    /// Describes a model missing from the table: its torque constant in Nm/A at the output shaft, 0.001 to 1000, and its
    /// largest current in A, 0.01 to 327.
    ///
    /// # Errors
    /// Names the first value outside its limits.
    pub const fn new(
        name: &'static str,
        torque_constant: f32,
        max_current_a: f32,
    ) -> Result<Self, ConfigError> {
        check!(ConfigError::check_range("torque constant", torque_constant, 0.001, 1_000.0));
        check!(ConfigError::check_range(
            "largest current in A",
            max_current_a,
            AMPERES_PER_COUNT,
            327.0
        ));
        Ok(Self::known(name, torque_constant, max_current_a))
    }

    const fn known(name: &'static str, torque_constant: f32, max_current_a: f32) -> Self {
        Self { name, torque_constant, max_current_a }
    }

    /// Returns the name, as printed in errors.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the torque constant in Nm/A at the output shaft.
    #[must_use]
    pub const fn torque_constant(&self) -> f32 {
        self.torque_constant
    }

    /// Returns the largest current in A.
    #[must_use]
    pub const fn max_current_a(&self) -> f32 {
        self.max_current_a
    }

    /// Returns the torque of the largest current, in Nm.
    #[must_use]
    pub const fn max_torque_nm(&self) -> f32 {
        self.max_current_a * self.torque_constant
    }

    /// Returns the numbers for the control modes.
    pub(super) const fn scale(&self) -> Scale {
        Scale::new(AMPERES_PER_COUNT * self.torque_constant, self.max_torque_nm(), 1.0, false)
    }
}
