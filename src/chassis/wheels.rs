use super::kinematics::{Fastest, slowed};
use crate::units::AngularVelocity;

/// Makes a struct with one value for each named wheel, and the functions on all of them at once.
macro_rules! named_wheels {
    ($(#[$doc:meta])* $name:ident, $count:literal { $($(#[$wheel_doc:meta])* $wheel:ident),+ }) => {
        $(#[$doc])*
        #[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct $name<T> {
            $($(#[$wheel_doc])* pub $wheel: T,)+
        }

        impl<T> $name<T> {
            /// Turns the value of every wheel into another, in the order of the fields.
            #[must_use]
            pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> $name<U> {
                $name { $($wheel: f(self.$wheel),)+ }
            }

            /// Maps every value with a function that can fail.
            ///
            /// # Errors
            /// Passes on the first error; the wheels after it are left out.
            pub fn try_map<U, E>(
                self,
                mut f: impl FnMut(T) -> Result<U, E>,
            ) -> Result<$name<U>, E> {
                Ok($name { $($wheel: f(self.$wheel)?,)+ })
            }

            /// Pairs the values of every wheel with those of another set.
            #[must_use]
            pub fn zip<U>(self, other: $name<U>) -> $name<(T, U)> {
                $name { $($wheel: (self.$wheel, other.$wheel),)+ }
            }

            /// Borrows the value of every wheel.
            #[must_use]
            pub const fn as_ref(&self) -> $name<&T> {
                $name { $($wheel: &self.$wheel,)+ }
            }

            /// Borrows the value of every wheel for changing it.
            #[must_use]
            pub const fn as_mut(&mut self) -> $name<&mut T> {
                $name { $($wheel: &mut self.$wheel,)+ }
            }

            /// Returns the values in the order of the fields.
            #[must_use]
            pub fn into_array(self) -> [T; $count] {
                [$(self.$wheel,)+]
            }

            /// Takes the values in the order of the fields.
            #[must_use]
            pub fn from_array(values: [T; $count]) -> Self {
                let [$($wheel,)+] = values;
                Self { $($wheel,)+ }
            }
        }

        impl<T: Copy> $name<T> {
            /// Takes the same value for every wheel.
            #[must_use]
            pub const fn splat(value: T) -> Self {
                Self { $($wheel: value,)+ }
            }
        }

        impl<T> $name<Option<T>> {
            /// Returns all values if every wheel has a value.
            #[must_use]
            pub fn all(self) -> Option<$name<T>> {
                Some($name { $($wheel: self.$wheel?,)+ })
            }
        }

        impl<T> IntoIterator for $name<T> {
            type Item = T;
            type IntoIter = core::array::IntoIter<T, $count>;
            fn into_iter(self) -> Self::IntoIter {
                self.into_array().into_iter()
            }
        }

        impl $name<AngularVelocity> {
            /// Slows all wheels by one common factor until none is faster than `limit`: the direction of travel stays.
            ///
            /// Returns the wheels and the factor, 0 to 1. A limit that is negative or NaN counts as zero; if any wheel is NaN or
            /// infinite, all stop and the factor is 0.
            #[must_use]
            pub fn desaturate(self, limit: AngularVelocity) -> (Self, f32) {
                let mut fastest = Fastest::default();
                $(fastest.see(self.$wheel);)+
                let scale = fastest.scale(limit);
                (self.map(|wheel| slowed(wheel, scale)), scale)
            }
        }
    };
}

named_wheels! {
    /// One value for each wheel of a mecanum chassis: a speed, a handle, a target.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::MecanumWheels, units::AngularVelocity};
    ///
    /// let rpm = MecanumWheels { front_left: 300.0, front_right: 600.0, rear_left: 0.0, rear_right: -150.0 };
    /// let (limited, factor) = rpm.map(AngularVelocity::from_rpm).desaturate(AngularVelocity::from_rpm(450.0));
    /// assert!((factor - 0.75).abs() < 1e-6);
    /// assert!((limited.front_right.as_rpm() - 450.0).abs() < 1e-3);
    /// assert!((limited.rear_right.as_rpm() + 112.5).abs() < 1e-3); // all by the same factor
    /// ```
    MecanumWheels, 4 {
        /// Front left: +x, +y.
        front_left,
        /// Front right: +x, -y.
        front_right,
        /// Rear left: -x, +y.
        rear_left,
        /// Rear right: -x, -y.
        rear_right
    }
}
