//! The registers of a drive.

use crate::motor::registers;

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
