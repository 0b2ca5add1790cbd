//! Newtypes for quantities that this field writes in more than one unit.
//!
//! | type | stored as | also read and written as |
//! |---|---|---|
//! | [`Angle`] | rad | degrees, turns, encoder counts |
//! | [`AngularVelocity`] | rad/s | rpm, degrees/s |
//! | [`Current`] | A | mA |
//! | [`Voltage`] | V | mV |
//!
//! Everything else in this crate is a plain SI `f32` with the unit in its name (`radius_m`, `dt_s`). A newtype accepts
//! any `f32`, NaN included: the function that uses the value refuses an invalid value.
//!
//! ```
//! use drivetrain::units::{Angle, AngularVelocity};
//!
//! assert_eq!(Angle::from_degrees(180.0), Angle::from_turns(0.5));
//! assert!((AngularVelocity::from_rpm(60.0).as_rad_per_s() - core::f32::consts::TAU).abs() < 1e-6);
//! ```

mod angle;

pub use angle::{Angle, AngularVelocity};

/// Gives a newtype over `f32` its linear arithmetic.
macro_rules! linear {
    ($quantity:ident) => {
        impl $quantity {
            /// Zero.
            pub const ZERO: Self = Self(0.0);

            /// Returns the absolute value.
            #[must_use]
            pub const fn abs(self) -> Self {
                Self(self.0.abs())
            }

            /// Returns whether the value is neither NaN nor infinite.
            #[must_use]
            pub const fn is_finite(self) -> bool {
                self.0.is_finite()
            }
        }

        impl core::ops::Neg for $quantity {
            type Output = Self;
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl core::ops::Add for $quantity {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl core::ops::Sub for $quantity {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl core::ops::Mul<f32> for $quantity {
            type Output = Self;
            fn mul(self, factor: f32) -> Self {
                Self(self.0 * factor)
            }
        }

        impl core::ops::Div<f32> for $quantity {
            type Output = Self;
            fn div(self, divisor: f32) -> Self {
                Self(self.0 / divisor)
            }
        }

        impl core::ops::Div for $quantity {
            type Output = f32;
            fn div(self, divisor: Self) -> f32 {
                self.0 / divisor.0
            }
        }
    };
}
use linear;

/// An electric current. Positive drives the shaft counter-clockwise.
///
/// # Examples
/// ```
/// use drivetrain::units::Current;
///
/// assert_eq!(Current::from_milliamperes(500.0), Current::from_amperes(0.5));
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Current(f32);

linear!(Current);

impl Current {
    /// Takes amperes.
    #[must_use]
    pub const fn from_amperes(amperes: f32) -> Self {
        Self(amperes)
    }

    /// Takes milliamperes.
    #[must_use]
    pub const fn from_milliamperes(milliamperes: f32) -> Self {
        Self(milliamperes * 1e-3)
    }

    /// Returns amperes.
    #[must_use]
    pub const fn as_amperes(self) -> f32 {
        self.0
    }

    /// Returns milliamperes.
    #[must_use]
    pub const fn as_milliamperes(self) -> f32 {
        self.0 * 1e3
    }
}

/// A voltage. Positive drives the shaft counter-clockwise.
///
/// # Examples
/// ```
/// use drivetrain::units::Voltage;
///
/// assert_eq!(Voltage::from_volts(1.5).as_millivolts(), 1500.0);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Voltage(f32);

linear!(Voltage);

impl Voltage {
    /// Takes volts.
    #[must_use]
    pub const fn from_volts(volts: f32) -> Self {
        Self(volts)
    }

    /// Takes millivolts.
    #[must_use]
    pub const fn from_millivolts(millivolts: f32) -> Self {
        Self(millivolts * 1e-3)
    }

    /// Returns volts.
    #[must_use]
    pub const fn as_volts(self) -> f32 {
        self.0
    }

    /// Returns millivolts.
    #[must_use]
    pub const fn as_millivolts(self) -> f32 {
        self.0 * 1e3
    }
}
