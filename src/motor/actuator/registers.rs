//! Registers of a drive as a table of facts.

/// The form of a value on the wire, low byte first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    U8,
    U16,
    U32,
    F32,
}

impl Form {
    /// Returns the largest integer; `None` for a float. Above 2^24 an `f32` has gaps.
    const fn top(self) -> Option<u32> {
        match self {
            Self::U8 => Some(0xFF),
            Self::U16 => Some(0xFFFF),
            Self::U32 => Some(0xFF_FFFF),
            Self::F32 => None,
        }
    }

    /// Tells whether the form can hold a value: finite, and of an integer a whole number within its range.
    pub(crate) fn holds(self, value: f32) -> bool {
        let whole = whole(value);
        let is_whole = (whole as f32).to_bits() == value.to_bits();
        value.is_finite() && self.top().is_none_or(|top| is_whole && whole <= top)
    }

    pub(crate) const fn bytes_of(self, value: f32) -> [u8; 4] {
        match self {
            Self::F32 => value.to_le_bytes(),
            _ => whole(value).to_le_bytes(),
        }
    }

    /// Reads a value; bytes beyond the width of an integer do not count.
    pub(crate) const fn value_of(self, bytes: [u8; 4]) -> f32 {
        let [low, high, ..] = bytes;
        match self {
            Self::U8 => low as f32,
            Self::U16 => u16::from_le_bytes([low, high]) as f32,
            Self::U32 => u32::from_le_bytes(bytes) as f32,
            Self::F32 => f32::from_le_bytes(bytes),
        }
    }
}

/// Returns the number of the lowest bit of a word of errors, from 1; 0 for no bit.
#[expect(clippy::cast_possible_truncation, reason = "at most 32")]
pub(crate) const fn lowest_bit(errors: u32) -> u8 {
    if errors == 0 { 0 } else { errors.trailing_zeros() as u8 + 1 }
}

/// Returns the error code of the lowest bit, where bit 0 has the code `first`; 0 for no bit.
pub(crate) const fn code_from(first: u8, errors: u32) -> u8 {
    if errors == 0 { 0 } else { first - 1 + lowest_bit(errors) }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
const fn whole(value: f32) -> u32 {
    value as u32
}

/// Makes the type `Register` of a family: its noun in errors, the name and the type of its number, then for each register its
/// number, form, the access of a program (`Rw` or `Ro`), its name in the manual, and text.
macro_rules! registers {
    (
        $(#[$about:meta])*
        $noun:literal $number:ident $width:ident;
        $($register:ident $value:literal $form:ident $access:ident $manual:literal $doc:literal,)+
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[non_exhaustive]
        pub enum Register {
            $(
                #[doc = concat!($manual, ": ", $doc, " (", stringify!($value), ").")]
                $register = $value,
            )+
        }

        impl Register {
            /// The registers of the table.
            pub const ALL: &[Self] = &[$(Self::$register),+];

            /// The name and the number, as errors print them.
            const fn name(self) -> &'static str {
                match self {
                    $(Self::$register => {
                        concat!($noun, " ", stringify!($value), " (", stringify!($register), ")")
                    })+
                }
            }

            /// Returns the name in the manual of the drive, as errors of a wrong setting print it.
            #[must_use]
            pub const fn manual(self) -> &'static str {
                match self {
                    $(Self::$register => $manual,)+
                }
            }

            pub(super) const fn form(self) -> $crate::motor::Form {
                match self {
                    $(Self::$register => $crate::motor::Form::$form,)+
                }
            }

            #[doc = concat!("Returns the ", stringify!($number), " in the protocol.")]
            #[must_use]
            pub const fn $number(self) -> $width {
                self as $width
            }

            /// Tells whether the value is an `f32` on the wire; otherwise an integer.
            #[must_use]
            pub const fn is_float(self) -> bool {
                matches!(self.form(), $crate::motor::Form::F32)
            }

            /// Tells whether a program may write the register.
            #[must_use]
            pub const fn is_writable(self) -> bool {
                match self {
                    $(Self::$register => $crate::motor::registers!(@ $access),)+
                }
            }

            /// # Errors
            /// The register is read only, or cannot hold the value.
            pub(super) fn check(self, value: f32) -> Result<(), $crate::error::ConfigError> {
                if !self.is_writable() {
                    Err($crate::error::ConfigError::ReadOnly(self.name()))
                } else if !self.form().holds(value) {
                    Err($crate::error::ConfigError::CannotHold(self.name(), value))
                } else {
                    Ok(())
                }
            }
        }
    };
    (@ Rw) => { true };
    (@ Ro) => { false };
}

/// Makes the questions of an application about the registers of a motor, whose `settings` have them.
macro_rules! register_questions {
    () => {
        impl Motor {
            /// Asks the drive for a register. While the motor is disarmed the frame goes out within some 10 ms, and again until
            /// [`register`](Self::register) has the answer. A later request takes the place of a waiting request.
            pub const fn read(&mut self, register: Register) {
                self.settings.request($crate::motor::Inquiry::Read(register));
            }

            /// Writes a register of the drive, until the supply is lost; while the motor is disarmed, as [`read`](Self::read). The
            /// answer is the value in the drive afterwards.
            ///
            /// # Errors
            /// [`ConfigError::ReadOnly`] and [`ConfigError::CannotHold`] name the register.
            pub fn write(&mut self, register: Register, value: f32) -> Result<(), ConfigError> {
                register.check(value)?;
                self.settings.request($crate::motor::Inquiry::Write(register, value));
                Ok(())
            }

            /// Returns the answer to the last [`read`](Self::read) or [`write`](Self::write): the register and its value in the
            /// drive, NaN if the drive does not have the register.
            #[must_use]
            pub const fn register(&self) -> Option<(Register, f32)> {
                self.settings.answer()
            }
        }
    };
}

/// Makes the constants of the models of a family, each by `Model::known(name, facts)`, and their table.
macro_rules! models {
    ($($model:ident $name:literal $($fact:expr)*;)+) => {
        impl Model {
            $(
                #[doc = concat!("The ", $name, ".")]
                pub const $model: Self = Self::known($name, $($fact),*);
            )+

            /// The models of the table.
            pub const ALL: &[Self] = &[$(Self::$model),+];
        }
    };
}

/// Makes the functions of a model with a name and the ranges of an MIT frame, whose fields but the position go to `$top`.
macro_rules! mit_model {
    ($top:literal) => {
        impl Model {
            /// Returns the name, as printed in errors.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                self.name
            }

            /// Returns the ranges of the fields.
            #[must_use]
            pub const fn ranges(&self) -> &$crate::wire::mit::Ranges {
                &self.ranges
            }

            /// Returns the largest value of each field of a command.
            #[must_use]
            pub const fn most(&self) -> $crate::motor::Impedance {
                $crate::motor::Impedance::most(&self.ranges)
            }

            /// Returns the value of a count of each field of a command.
            #[must_use]
            pub const fn count(&self) -> $crate::motor::Impedance {
                $crate::motor::Impedance::count(&self.ranges, $top)
            }

            /// Returns the largest position of the fields, in rad.
            #[must_use]
            pub const fn pmax_rad(&self) -> f32 {
                self.ranges.position_rad()
            }

            /// Returns the largest velocity of the fields, in rad/s.
            #[must_use]
            pub const fn vmax_rad_per_s(&self) -> f32 {
                self.ranges.velocity_rad_per_s()
            }

            /// Returns the largest torque of the fields, in Nm.
            #[must_use]
            pub const fn tmax_nm(&self) -> f32 {
                self.ranges.torque_nm()
            }
        }
    };
}

pub(crate) use {mit_model, models, register_questions, registers};
