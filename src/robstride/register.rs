//! The parameters of a drive.

use crate::error::ConfigError;

macro_rules! registers {
    ($($register:ident $index:literal $kind:ident $access:ident $doc:literal,)+) => {
        /// A parameter of a drive. Those above 0x7020 are RobStride's alone, but for those that [`Model::CYBERGEAR`](super::Model)
        /// has by its manual.
        ///
        /// # Examples
        /// ```
        /// use drivetrain::robstride::Register;
        ///
        /// assert_eq!(Register::Timeout.index(), 0x7028);
        /// assert!(Register::RunMode.is_writable() && !Register::SupplyVoltage.is_writable());
        /// ```
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[non_exhaustive]
        pub enum Register {
            $(
                #[doc = concat!($doc, " (", stringify!($index), ").")]
                $register = $index,
            )+
        }

        impl Register {
            /// The parameters of the table.
            pub const ALL: &[Self] = &[$(Self::$register),+];

            /// The name and the index, as errors print them.
            const fn name(self) -> &'static str {
                match self {
                    $(Self::$register => {
                        concat!("parameter ", stringify!($index), " (", stringify!($register), ")")
                    })+
                }
            }

            const fn kind(self) -> (Kind, Access) {
                match self {
                    $(Self::$register => (Kind::$kind, Access::$access),)+
                }
            }
        }
    };
}

#[derive(Clone, Copy)]
enum Kind {
    U8,
    U16,
    U32,
    Float,
}

#[derive(Clone, Copy, PartialEq)]
enum Access {
    Rw,
    Ro,
}

registers! {
    RunMode 0x7005 U8 Rw "run_mode: 0 operation, 1 position, 2 speed, 3 current, 5 cyclic position (RobStride)",
    CurrentTarget 0x7006 Float Rw "iq_ref: target of the current mode in A",
    VelocityTarget 0x700A Float Rw "spd_ref: target of the speed mode in rad/s",
    TorqueLimit 0x700B Float Rw "limit_torque: torque limit in Nm",
    CurrentKp 0x7010 Float Rw "cur_kp: proportional gain of the current loop",
    CurrentKi 0x7011 Float Rw "cur_ki: integral gain of the current loop",
    CurrentFilter 0x7014 Float Rw "cur_filt_gain: filter of the current, 0 to 1",
    PositionTarget 0x7016 Float Rw "loc_ref: target of the position mode in rad",
    VelocityLimit 0x7017 Float Rw "limit_spd: velocity limit of the position mode in rad/s",
    CurrentLimit 0x7018 Float Rw "limit_cur: current limit of the speed and position modes in A",
    MechanicalPosition 0x7019 Float Ro "mechPos: position of the output shaft in rad; turns count",
    Current 0x701A Float Ro "iqf: filtered current in A",
    MechanicalVelocity 0x701B Float Ro "mechVel: velocity of the output shaft in rad/s",
    SupplyVoltage 0x701C Float Ro "VBUS: supply in V",
    PositionKp 0x701E Float Rw "loc_kp: gain of the position loop",
    VelocityKp 0x701F Float Rw "spd_kp: proportional gain of the speed loop",
    VelocityKi 0x7020 Float Rw "spd_ki: integral gain of the speed loop",
    VelocityFilter 0x7021 Float Rw "spd_filt_gain: filter of the velocity",
    Acceleration 0x7022 Float Rw "acc_rad: acceleration of the speed mode in rad/s²",
    ProfileVelocity 0x7024 Float Rw "vel_max: velocity of the position mode 1 in rad/s",
    ProfileAcceleration 0x7025 Float Rw "acc_set: acceleration of the position mode 1 in rad/s²",
    ReportTime 0x7026 U16 Rw "EPScan_time: period of the drive's own reports, 1 for 10 ms and 5 ms more for each above",
    Timeout 0x7028 U32 Rw "canTimeout: time without a command until the drive lets go, in 50 µs; 0 for never",
    ZeroState 0x7029 U8 Rw "zero_sta: position after power-on, 0 for 0 to 2π, 1 for -π to π",
    Damper 0x702A U8 Rw "damper: 1 lifts the brake against fast turning by hand",
    ZeroOffset 0x702B Float Rw "add_offset: offset of the position in rad",
}

impl Register {
    /// # Errors
    /// It is read only, or cannot hold the value.
    pub(super) fn check(self, value: f32) -> Result<(), ConfigError> {
        if !self.is_writable() {
            Err(ConfigError::ReadOnly(self.name()))
        } else if !self.holds(value) {
            Err(ConfigError::CannotHold(self.name(), value))
        } else {
            Ok(())
        }
    }

    /// Returns the index in the protocol.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }

    /// Tells whether the value is an `f32` on the wire; otherwise it is an integer.
    #[must_use]
    pub const fn is_float(self) -> bool {
        matches!(self.kind().0, Kind::Float)
    }

    /// Tells whether a program may write it.
    #[must_use]
    pub const fn is_writable(self) -> bool {
        matches!(self.kind().1, Access::Rw)
    }

    /// Returns the largest integer; `None` for a float. Above 2^24 an `f32` has gaps.
    const fn top(self) -> Option<u32> {
        match self.kind().0 {
            Kind::U8 => Some(0xFF),
            Kind::U16 => Some(0xFFFF),
            Kind::U32 => Some(0xFF_FFFF),
            Kind::Float => None,
        }
    }

    /// Tells whether the parameter can hold a value: finite, and of an integer one a whole number within its range.
    pub(super) fn holds(self, value: f32) -> bool {
        let whole = whole(value);
        let is_whole = (whole as f32).to_bits() == value.to_bits();
        value.is_finite() && self.top().is_none_or(|top| is_whole && whole <= top)
    }

    pub(super) const fn bytes_of(self, value: f32) -> [u8; 4] {
        if self.is_float() { value.to_le_bytes() } else { whole(value).to_le_bytes() }
    }

    /// Reads a value; bytes beyond the width of an integer do not count.
    pub(super) const fn value_of(self, bytes: [u8; 4]) -> f32 {
        let [low, high, ..] = bytes;
        match self.kind().0 {
            Kind::U8 => low as f32,
            Kind::U16 => u16::from_le_bytes([low, high]) as f32,
            Kind::U32 => u32::from_le_bytes(bytes) as f32,
            Kind::Float => f32::from_le_bytes(bytes),
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
const fn whole(value: f32) -> u32 {
    value as u32
}
