//! Facts of the models, as a table open to further models.

use crate::error::{ConfigError, check};
use crate::motor::models;

/// The largest current of a command, in counts.
pub(super) const MOST_COUNTS: f32 = 2_048.0;

/// The supply for which the speed without load is estimated, in V.
const SUPPLY_V: f32 = 24.0;

/// A series of drives: the scale of its currents.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Series {
    /// MF: 2048 counts are 16.5 A.
    Mf,
    /// MG: 2048 counts are 33 A.
    Mg,
}

impl Series {
    /// Returns the current of a count in A: 33/4096 for MF and 66/4096 for MG (manual, "torque closed loop").
    #[must_use]
    pub const fn amperes_per_count(self) -> f32 {
        match self {
            Self::Mf => 33.0 / 4_096.0,
            Self::Mg => 66.0 / 4_096.0,
        }
    }
}

/// A model of motor: the scale of its currents, its gear and its encoder.
///
/// | model | series | gear | torque constant Nm/A at the output shaft | encoder | seen in |
/// |---|---|--:|--:|--:|---|
/// | [`MF9025_16T`](Self::MF9025_16T) | MF | 1 | 0.32 | 16 bits | offisaac, SCNU |
/// | [`MF9025_35T`](Self::MF9025_35T) | MF | 1 | 0.81 | 16 bits | offisaac |
/// | [`MG4005E_I10`](Self::MG4005E_I10) | MG | 10 | 0.6 | 18 bits, 16 of them sent | the vendor's table of the series, public drivers |
/// | [`MG5010E_I10`](Self::MG5010E_I10) | MG | 10 | 1.0 | 16 bits | the vendor's table of the series, librmcs |
///
/// The vendor gives the torque constant of some geared motors at the rotor: 0.06 for the MG4005, 0.1 for the MG5010.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::lk::{Model, Series};
///
/// assert!((Model::MF9025_16T.max_torque_nm() - 16.5 * 0.32).abs() < 1e-5);
/// let mine = Model::new("MG8008E-i9", Series::Mg, 9.0, 2.07, 16)?;
/// assert_eq!(mine.gear(), 9.0);
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    name: &'static str,
    series: Series,
    gear: f32,
    torque_constant: f32,
    encoder_bits: u8,
}

models! {
    MF9025_16T "MF9025-16T" Series::Mf 1.0 0.32 16;
    MF9025_35T "MF9025-35T" Series::Mf 1.0 0.81 16;
    MG4005E_I10 "MG4005E-i10" Series::Mg 10.0 0.6 16;
    MG5010E_I10 "MG5010E-i10" Series::Mg 10.0 1.0 16;
}

impl Model {
    /// Describes a model missing from the table: its series, the turns of its rotor for one of the output shaft, 1 to 1000, its
    /// torque constant in Nm/A at the output shaft, 0.001 to 1000, and the number of encoder bits sent, 14 to 16.
    ///
    /// A drive with an encoder of 18 bits sends the upper 16. An encoder with fewer bits than are stated here is not noticed, and
    /// its angles are too small by the power of two; feedback of an encoder with more is [malformed](crate::motor::Ingest::WrongField).
    ///
    /// # Errors
    /// Names the first value outside its limits.
    pub const fn new(
        name: &'static str,
        series: Series,
        gear: f32,
        torque_constant: f32,
        encoder_bits: u8,
    ) -> Result<Self, ConfigError> {
        check!(ConfigError::check_range("gear", gear, 1.0, 1_000.0));
        check!(ConfigError::check_range("torque constant", torque_constant, 0.001, 1_000.0));
        check!(ConfigError::check_range("encoder bits", encoder_bits as f32, 14.0, 16.0));
        Ok(Self::known(name, series, gear, torque_constant, encoder_bits))
    }

    const fn known(name: &'static str, series: Series, gear: f32, constant: f32, bits: u8) -> Self {
        Self { name, series, gear, torque_constant: constant, encoder_bits: bits }
    }

    /// Returns the name, as printed in errors.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the series.
    #[must_use]
    pub const fn series(&self) -> Series {
        self.series
    }

    /// Returns the turns of the rotor for one of the output shaft.
    #[must_use]
    pub const fn gear(&self) -> f32 {
        self.gear
    }

    /// Returns the torque constant in Nm/A at the output shaft.
    #[must_use]
    pub const fn torque_constant(&self) -> f32 {
        self.torque_constant
    }

    /// Returns how many bits of the encoder are sent.
    #[must_use]
    pub const fn encoder_bits(&self) -> u8 {
        self.encoder_bits
    }

    /// Returns the torque of the largest current in a frame, in Nm: a limit of the protocol, not of the motor. A
    /// program states the limit of the motor with its mode.
    #[must_use]
    pub const fn max_torque_nm(&self) -> f32 {
        MOST_COUNTS * self.torque_per_count()
    }

    /// Returns the torque of a count of current, in Nm.
    pub(super) const fn torque_per_count(&self) -> f32 {
        self.series.amperes_per_count() * self.torque_constant
    }

    /// Returns the numbers for the control modes.
    pub(super) const fn scale(&self) -> Scale {
        Scale::new(self.torque_per_count(), self.max_torque_nm(), self.gear, true)
    }

    /// Returns a share of the speed without load, estimated from the torque constant.
    pub(super) const fn speed_share(&self, rad_per_s: f32) -> f32 {
        rad_per_s * self.torque_constant / SUPPLY_V
    }
}

pub(crate) const RAD_PER_DEGREE: f32 = core::f32::consts::PI / 180.0;

/// The numbers of a model for the control modes, also of `rmd`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    /// The torque of a count of current, in Nm.
    pub torque_per_count: f32,
    /// The largest torque, in Nm.
    pub max_torque_nm: f32,
    /// The largest velocity of the output shaft within the range of the feedback, in rad/s.
    pub max_velocity: f32,
    /// The turns on the wire for one of the output shaft.
    pub gear: f32,
    /// A velocity command has a field for the largest current.
    pub limits_torque: bool,
}

impl Scale {
    pub(crate) const fn new(
        torque_per_count: f32,
        max_torque_nm: f32,
        gear: f32,
        limits_torque: bool,
    ) -> Self {
        let max_velocity = 32_767.0 * RAD_PER_DEGREE / gear;
        Self { torque_per_count, max_torque_nm, max_velocity, gear, limits_torque }
    }
}
