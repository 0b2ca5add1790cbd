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

use crate::math::{wrap_pi, wrap_tau};
use core::f32::consts::TAU;

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

/// An angle; counter-clockwise is positive. Any `f32`, not reduced to one turn.
///
/// # Examples
/// ```
/// use drivetrain::units::Angle;
///
/// let quarter = Angle::from_counts(2048, 8192);
/// assert_eq!(quarter.as_degrees(), 90.0);
/// assert_eq!(quarter.as_turns(), 0.25);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Angle(f32);

linear!(Angle);

impl Angle {
    /// Takes radians.
    #[must_use]
    pub const fn from_radians(radians: f32) -> Self {
        Self(radians)
    }

    /// Takes degrees.
    #[must_use]
    pub const fn from_degrees(degrees: f32) -> Self {
        Self(degrees * (TAU / 360.0))
    }

    /// Takes turns.
    #[must_use]
    pub const fn from_turns(turns: f32) -> Self {
        Self(turns * TAU)
    }

    /// Takes encoder counts and the number of counts in a turn. A count above 2^24 is rounded.
    #[must_use]
    pub const fn from_counts(counts: i32, counts_per_turn: u16) -> Self {
        Self::from_turns(counts as f32 / counts_per_turn as f32)
    }

    /// Returns radians.
    #[must_use]
    pub const fn as_radians(self) -> f32 {
        self.0
    }

    /// Returns degrees.
    #[must_use]
    pub const fn as_degrees(self) -> f32 {
        self.0 * (360.0 / TAU)
    }

    /// Returns turns.
    #[must_use]
    pub const fn as_turns(self) -> f32 {
        self.0 * (1.0 / TAU)
    }

    /// Returns the angle in -180 to 180 degrees, the upper end excluded, of the same direction.
    ///
    /// The shortest way from `a` to `b` is `(b - a).wrapped()`. Errors, NaN and infinity are those of
    /// [`wrap_pi`].
    ///
    /// # Examples
    /// ```
    /// use drivetrain::units::Angle;
    ///
    /// let degrees = |degrees| Angle::from_degrees(degrees).wrapped().as_degrees();
    /// assert!((degrees(270.0) + 90.0).abs() < 1e-4);
    /// assert!((degrees(-190.0) - 170.0).abs() < 1e-4);
    /// let way = Angle::from_degrees(10.0) - Angle::from_degrees(350.0);
    /// assert!((way.wrapped().as_degrees() - 20.0).abs() < 1e-4); // through zero
    /// ```
    #[must_use]
    pub const fn wrapped(self) -> Self {
        Self(wrap_pi(self.0))
    }

    /// Returns the angle in 0 to 360 degrees, the upper end excluded, of the same direction.
    ///
    /// For display and for programs with this range. Errors, NaN and infinity are those of
    /// [`wrap_tau`].
    ///
    /// # Examples
    /// ```
    /// use drivetrain::units::Angle;
    ///
    /// let degrees = |degrees| Angle::from_degrees(degrees).wrapped_positive().as_degrees();
    /// assert!((degrees(-90.0) - 270.0).abs() < 1e-4);
    /// assert!((degrees(725.0) - 5.0).abs() < 1e-4);
    /// assert!(degrees(360.0) < 1e-4);
    /// ```
    #[must_use]
    pub const fn wrapped_positive(self) -> Self {
        Self(wrap_tau(self.0))
    }
}

/// An angular velocity; counter-clockwise is positive.
///
/// # Examples
/// ```
/// use drivetrain::units::AngularVelocity;
///
/// let no_load = AngularVelocity::from_rpm(482.0); // output shaft of an M3508
/// assert!((no_load.as_rad_per_s() - 50.475).abs() < 1e-3);
/// assert!((no_load.as_degrees_per_s() - 2892.0).abs() < 1e-3);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AngularVelocity(f32);

linear!(AngularVelocity);

impl AngularVelocity {
    /// Takes radians a second.
    #[must_use]
    pub const fn from_rad_per_s(rad_per_s: f32) -> Self {
        Self(rad_per_s)
    }

    /// Takes revolutions a minute.
    #[must_use]
    pub const fn from_rpm(rpm: f32) -> Self {
        Self(rpm * (TAU / 60.0))
    }

    /// Takes degrees a second.
    #[must_use]
    pub const fn from_degrees_per_s(degrees_per_s: f32) -> Self {
        Self(degrees_per_s * (TAU / 360.0))
    }

    /// Returns radians a second.
    #[must_use]
    pub const fn as_rad_per_s(self) -> f32 {
        self.0
    }

    /// Returns revolutions a minute.
    #[must_use]
    pub const fn as_rpm(self) -> f32 {
        self.0 * (60.0 / TAU)
    }

    /// Returns degrees a second.
    #[must_use]
    pub const fn as_degrees_per_s(self) -> f32 {
        self.0 * (360.0 / TAU)
    }
}

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
