//! The registers of a drive.

use crate::error::ConfigError;

macro_rules! registers {
    ($($register:ident $number:literal $kind:ident $doc:literal,)+) => {
        /// A register of a drive.
        ///
        /// A [`Float`](Self::is_float) register has an `f32`, another one an integer. Those that calibrate or describe the motor are
        /// [read only](Self::is_writable).
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[non_exhaustive]
        pub enum Register {
            $(
                #[doc = concat!($doc, " (", stringify!($number), ").")]
                $register = $number,
            )+
        }

        impl Register {
            /// The name and the number, as errors print them.
            const fn name(self) -> &'static str {
                match self {
                    $(Self::$register => {
                        concat!("register ", stringify!($number), " (", stringify!($register), ")")
                    })+
                }
            }

            const fn kind(self) -> Kind {
                match self {
                    $(Self::$register => Kind::$kind,)+
                }
            }
        }
    };
}

enum Kind {
    Float,
    Integer,
    FloatFact,
    IntegerFact,
}

registers! {
    UnderVoltage 0 Float "UV_Value: below this supply in V the drive is off",
    TorqueConstant 1 Float "KT_Value: torque constant in Nm/A; 0 has the drive reckon it",
    OverTemperature 2 Float "OT_Value: above this temperature in °C the drive is off",
    OverCurrent 3 Float "OC_Value: above this share of the largest current the drive is off",
    Acceleration 4 Float "ACC: acceleration of the drive's own ramps in rad/s²",
    Deceleration 5 Float "DEC: deceleration of the drive's own ramps in rad/s², negative",
    MaxSpeed 6 Float "MAX_SPD: speed limit in rad/s",
    MasterId 7 Integer "MST_ID: id of the feedback",
    Id 8 Integer "ESC_ID: id of the commands",
    Timeout 9 Integer "TIMEOUT: time without a command until the drive disables itself, in 50 µs; 0 for never",
    ControlMode 10 Integer "CTRL_MODE: 1 MIT, 2 position-velocity, 3 velocity, 4 force-position",
    Damping 11 FloatFact "Damp: viscous damping",
    Inertia 12 FloatFact "Inertia: moment of inertia",
    SoftwareVersion 14 IntegerFact "sw_ver: version of the firmware",
    PolePairs 16 IntegerFact "NPP: pole pairs",
    PhaseResistance 17 FloatFact "Rs: phase resistance in Ω",
    PhaseInductance 18 FloatFact "Ls: phase inductance in H",
    Flux 19 FloatFact "Flux: flux linkage in Wb",
    GearRatio 20 FloatFact "Gr: gear ratio",
    PositionRange 21 Float "PMAX: range of the positions in rad",
    VelocityRange 22 Float "VMAX: range of the velocities in rad/s",
    TorqueRange 23 Float "TMAX: range of the torques in Nm",
    CurrentBandwidth 24 Float "I_BW: bandwidth of the current loop",
    SpeedKp 25 Float "KP_ASR: proportional gain of the speed loop",
    SpeedKi 26 Float "KI_ASR: integral gain of the speed loop",
    PositionKp 27 Float "KP_APR: proportional gain of the position loop",
    PositionKi 28 Float "KI_APR: integral gain of the position loop",
    OverVoltage 29 Float "OV_Value: above this supply in V the drive is off",
    GearEfficiency 30 Float "GREF: efficiency of the gear, 0 to 1",
    SpeedDamping 31 Float "Deta: damping of the speed loop",
    SpeedFilter 32 Float "V_BW: bandwidth of the speed filter",
    BitRate 35 Integer "can_br: bit rate, 0 to 4 for 125, 200, 250, 500 and 1000 kbit/s",
    SubVersion 36 IntegerFact "sub_ver: lower part of the version",
    SupplyVoltage 60 FloatFact "VBus: supply in V",
    DriverTemperature 61 FloatFact "Tpcb: temperature of the driver in °C",
    MotorTemperature 62 FloatFact "Tmtr: temperature of the motor in °C",
    RotorPosition 80 FloatFact "p_m: position of the motor",
    ShaftPosition 81 FloatFact "xout: position of the output shaft",
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

    /// Returns the number in the protocol.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Tells whether the value is an `f32` on the wire; otherwise it is an integer.
    #[must_use]
    pub const fn is_float(self) -> bool {
        matches!(self.kind(), Kind::Float | Kind::FloatFact)
    }

    /// Tells whether a program may write it.
    #[must_use]
    pub const fn is_writable(self) -> bool {
        matches!(self.kind(), Kind::Float | Kind::Integer)
    }

    /// Tells whether the register can hold a value: finite, and of an integer register a whole number below 2^24.
    pub(super) fn holds(self, value: f32) -> bool {
        let is_whole = value < 16_777_216.0 && (whole(value) as f32).to_bits() == value.to_bits();
        value.is_finite() && (self.is_float() || is_whole)
    }

    pub(super) const fn bytes_of(self, value: f32) -> [u8; 4] {
        if self.is_float() { value.to_le_bytes() } else { whole(value).to_le_bytes() }
    }

    pub(super) const fn value_of(self, bytes: [u8; 4]) -> f32 {
        if self.is_float() { f32::from_le_bytes(bytes) } else { u32::from_le_bytes(bytes) as f32 }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
const fn whole(value: f32) -> u32 {
    value as u32
}
