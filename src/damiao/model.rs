//! Facts of the models, as a table open to further models.

use crate::error::ConfigError;
use crate::motor::{mit_model, models, registers};
use crate::wire::mit::Ranges;

/// A model of motor: its name and the ranges of its fields, registers of the drive.
///
/// The torques and speeds of the ranges belong to the protocol, not to the motor: a program states the
/// limit of the motor with its mode.
///
/// | model | PMAX rad | VMAX rad/s | TMAX Nm | seen in |
/// |---|--:|--:|--:|---|
/// | [`J3507`](Self::J3507) | 12.566 | 50 | 5 | damiao-motor, Seeed |
/// | [`J4310`](Self::J4310) | 12.5 | 30 | 10 | damiao-motor, reBot, Seeed |
/// | [`J4310P`](Self::J4310P) | 12.5 | 50 | 10 | damiao-motor |
/// | [`J4340`](Self::J4340) | 12.5 | 10 | 28 | damiao-motor, motorbridge, can-motor-control; Seeed has 8 rad/s |
/// | [`J4340P`](Self::J4340P) | 12.5 | 10 | 28 | damiao-motor, reBot |
/// | [`J6006`](Self::J6006) | 12.5 | 45 | 20 | damiao-motor, Seeed |
/// | [`J8006`](Self::J8006) | 12.5 | 45 | 40 | damiao-motor, Seeed |
/// | [`J8009`](Self::J8009) | 12.5 | 45 | 54 | damiao-motor, Seeed |
/// | [`J10010`](Self::J10010) | 12.5 | 20 | 200 | damiao-motor, Seeed |
/// | [`J10010L`](Self::J10010L) | 12.5 | 25 | 200 | damiao-motor, Seeed |
/// | [`H3510`](Self::H3510) | 12.5 | 280 | 1 | damiao-motor |
/// | [`H6215`](Self::H6215) | 12.5 | 45 | 10 | damiao-motor, as G6215 |
///
/// The table has the values at delivery. A drive may have other settings, so a motor reads its registers before arming, and is not
/// armed where they differ: a torque would be wrong by the quotient.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::damiao::Model;
///
/// assert_eq!((Model::J8009.name(), Model::J8009.tmax_nm()), ("DM-J8009", 54.0));
/// let mine = Model::new("DM-S2325", 12.5, 200.0, 10.0)?;
/// assert_eq!(mine.vmax_rad_per_s(), 200.0);
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    name: &'static str,
    pub(super) ranges: Ranges,
}

models! {
    J3507 "DM-J3507" 12.566 50.0 5.0;
    J4310 "DM-J4310" 12.5 30.0 10.0;
    J4310P "DM-J4310P" 12.5 50.0 10.0;
    J4340 "DM-J4340" 12.5 10.0 28.0;
    J4340P "DM-J4340P" 12.5 10.0 28.0;
    J6006 "DM-J6006" 12.5 45.0 20.0;
    J8006 "DM-J8006" 12.5 45.0 40.0;
    J8009 "DM-J8009" 12.5 45.0 54.0;
    J10010 "DM-J10010" 12.5 20.0 200.0;
    J10010L "DM-J10010L" 12.5 25.0 200.0;
    H3510 "DM-H3510" 12.5 280.0 1.0;
    H6215 "DM-H6215" 12.5 45.0 10.0;
}

mit_model!(4_095);

impl Model {
    /// Describes a model missing from the table, or a drive with other settings: its registers PMAX in rad, VMAX in rad/s
    /// and TMAX in Nm.
    ///
    /// # Errors
    /// [`ConfigError::Range`] names the first range not between 0.001 and 1000000.
    pub const fn new(
        name: &'static str,
        pmax_rad: f32,
        vmax_rad_per_s: f32,
        tmax_nm: f32,
    ) -> Result<Self, ConfigError> {
        match Ranges::new(pmax_rad, vmax_rad_per_s, tmax_nm) {
            Ok(ranges) => Ok(Self { name, ranges }),
            Err(error) => Err(error),
        }
    }

    const fn known(name: &'static str, pmax: f32, vmax: f32, tmax: f32) -> Self {
        Self { name, ranges: Ranges::of([pmax, vmax, tmax], [500.0, 5.0]) }
    }
}

registers! {
    /// A register of a drive.
    ///
    /// A [`Float`](Self::is_float) register has an `f32`, any other register an integer. Registers to calibrate or describe the motor are
    /// [read only](Self::is_writable).
    "register" number u8;

    UnderVoltage 0 F32 Rw "UV_Value" "below this supply in V the drive is off",
    TorqueConstant 1 F32 Rw "KT_Value" "torque constant in Nm/A; 0 has the drive reckon it",
    OverTemperature 2 F32 Rw "OT_Value" "above this temperature in °C the drive is off",
    OverCurrent 3 F32 Rw "OC_Value" "above this share of the largest current the drive is off",
    Acceleration 4 F32 Rw "ACC" "acceleration of the drive's own ramps in rad/s²",
    Deceleration 5 F32 Rw "DEC" "deceleration of the drive's own ramps in rad/s², negative",
    MaxSpeed 6 F32 Rw "MAX_SPD" "speed limit in rad/s",
    MasterId 7 U32 Rw "MST_ID" "id of the feedback",
    Id 8 U32 Rw "ESC_ID" "id of the commands",
    Timeout 9 U32 Rw "TIMEOUT" "time without a command until the drive disables itself, in 50 µs; 0 for never",
    ControlMode 10 U32 Rw "CTRL_MODE" "1 MIT, 2 position-velocity, 3 velocity, 4 force-position",
    Damping 11 F32 Ro "Damp" "viscous damping",
    Inertia 12 F32 Ro "Inertia" "moment of inertia",
    SoftwareVersion 14 U32 Ro "sw_ver" "version of the firmware",
    PolePairs 16 U32 Ro "NPP" "pole pairs",
    PhaseResistance 17 F32 Ro "Rs" "phase resistance in Ω",
    PhaseInductance 18 F32 Ro "Ls" "phase inductance in H",
    Flux 19 F32 Ro "Flux" "flux linkage in Wb",
    GearRatio 20 F32 Ro "Gr" "gear ratio",
    PositionRange 21 F32 Rw "PMAX" "range of the positions in rad",
    VelocityRange 22 F32 Rw "VMAX" "range of the velocities in rad/s",
    TorqueRange 23 F32 Rw "TMAX" "range of the torques in Nm",
    CurrentBandwidth 24 F32 Rw "I_BW" "bandwidth of the current loop",
    SpeedKp 25 F32 Rw "KP_ASR" "proportional gain of the speed loop",
    SpeedKi 26 F32 Rw "KI_ASR" "integral gain of the speed loop",
    PositionKp 27 F32 Rw "KP_APR" "proportional gain of the position loop",
    PositionKi 28 F32 Rw "KI_APR" "integral gain of the position loop",
    OverVoltage 29 F32 Rw "OV_Value" "above this supply in V the drive is off",
    GearEfficiency 30 F32 Rw "GREF" "efficiency of the gear, 0 to 1",
    SpeedDamping 31 F32 Rw "Deta" "damping of the speed loop",
    SpeedFilter 32 F32 Rw "V_BW" "bandwidth of the speed filter",
    BitRate 35 U32 Rw "can_br" "bit rate, 0 to 4 for 125, 200, 250, 500 and 1000 kbit/s",
    SubVersion 36 U32 Ro "sub_ver" "lower part of the version",
    SupplyVoltage 60 F32 Ro "VBus" "supply in V",
    DriverTemperature 61 F32 Ro "Tpcb" "temperature of the driver in °C",
    MotorTemperature 62 F32 Ro "Tmtr" "temperature of the motor in °C",
    RotorPosition 80 F32 Ro "p_m" "position of the motor",
    ShaftPosition 81 F32 Ro "xout" "position of the output shaft",
}
