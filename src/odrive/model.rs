//! Facts of the motors, as a table open to further models.

use crate::error::{ConfigError, check};

/// A motor at an ODrive: its name and its torque constant.
///
/// The drive takes torques in Nm and currents in A, so the torque constant turns a torque limit into its current limit. The constant is
/// `8.27 / KV` in Nm/A, as the documentation of ODrive says; the drive's own `torque_constant` has to be the same.
///
/// | model | KV rpm/V | Nm/A | seen in |
/// |---|--:|--:|---|
/// | [`D5065`](Self::D5065) | 270 | 0.0306 | documentation of 0.5.6, "commands" |
/// | [`D6374`](Self::D6374) | 150 | 0.0551 | its designation; measured as 0.0551 to 0.0558 Nm/A by a public bench |
/// | [`M8325S`](Self::M8325S) | 100 | 0.0827 | its designation, M8325s-100KV |
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::odrive::Model;
///
/// assert!((Model::D5065.torque_constant() - 0.03063).abs() < 1e-5);
/// let hub = Model::new("hoverboard", 16.0)?; // 0.517 Nm/A
/// assert_eq!(hub.name(), "hoverboard");
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    name: &'static str,
    kv: f32,
}

impl Model {
    /// The D5065 with 270 KV.
    pub const D5065: Self = Self { name: "D5065", kv: 270.0 };
    /// The D6374 with 150 KV.
    pub const D6374: Self = Self { name: "D6374", kv: 150.0 };
    /// The M8325s with 100 KV.
    pub const M8325S: Self = Self { name: "M8325s", kv: 100.0 };

    /// The models of the table.
    pub const ALL: &[Self] = &[Self::D5065, Self::D6374, Self::M8325S];

    /// Describes another motor by its velocity constant in rpm/V.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for a constant not between 0.1 and 100000.
    pub const fn new(name: &'static str, kv: f32) -> Result<Self, ConfigError> {
        check!(ConfigError::check_range("velocity constant in rpm/V", kv, 0.1, 100_000.0));
        Ok(Self { name, kv })
    }

    /// Returns the name, as printed in errors.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the torque constant in Nm/A.
    #[must_use]
    pub const fn torque_constant(&self) -> f32 {
        8.27 / self.kv
    }
}
