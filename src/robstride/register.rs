//! The parameters of a drive.

use crate::motor::registers;

registers! {
    /// A parameter of a drive. Parameters above 0x7020 are RobStride's alone, except those of [`Model::CYBERGEAR`](super::Model)
    /// in its manual.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::robstride::Register;
    ///
    /// assert_eq!(Register::Timeout.index(), 0x7028);
    /// assert!(Register::RunMode.is_writable() && !Register::SupplyVoltage.is_writable());
    /// ```
    "parameter" index u16;

    RunMode 0x7005 U8 Rw "run_mode" "0 operation, 1 position, 2 speed, 3 current, 5 cyclic position (RobStride)",
    CurrentTarget 0x7006 F32 Rw "iq_ref" "target of the current mode in A",
    VelocityTarget 0x700A F32 Rw "spd_ref" "target of the speed mode in rad/s",
    TorqueLimit 0x700B F32 Rw "limit_torque" "torque limit in Nm",
    CurrentKp 0x7010 F32 Rw "cur_kp" "proportional gain of the current loop",
    CurrentKi 0x7011 F32 Rw "cur_ki" "integral gain of the current loop",
    CurrentFilter 0x7014 F32 Rw "cur_filt_gain" "filter of the current, 0 to 1",
    PositionTarget 0x7016 F32 Rw "loc_ref" "target of the position mode in rad",
    VelocityLimit 0x7017 F32 Rw "limit_spd" "velocity limit of the position mode in rad/s",
    CurrentLimit 0x7018 F32 Rw "limit_cur" "current limit of the speed and position modes in A",
    MechanicalPosition 0x7019 F32 Ro "mechPos" "position of the output shaft in rad; turns count",
    Current 0x701A F32 Ro "iqf" "filtered current in A",
    MechanicalVelocity 0x701B F32 Ro "mechVel" "velocity of the output shaft in rad/s",
    SupplyVoltage 0x701C F32 Ro "VBUS" "supply in V",
    PositionKp 0x701E F32 Rw "loc_kp" "gain of the position loop",
    VelocityKp 0x701F F32 Rw "spd_kp" "proportional gain of the speed loop",
    VelocityKi 0x7020 F32 Rw "spd_ki" "integral gain of the speed loop",
    VelocityFilter 0x7021 F32 Rw "spd_filt_gain" "filter of the velocity",
    Acceleration 0x7022 F32 Rw "acc_rad" "acceleration of the speed mode in rad/s²",
    ProfileVelocity 0x7024 F32 Rw "vel_max" "velocity of the position mode 1 in rad/s",
    ProfileAcceleration 0x7025 F32 Rw "acc_set" "acceleration of the position mode 1 in rad/s²",
    ReportTime 0x7026 U16 Rw "EPScan_time" "period of the drive's own reports, 1 for 10 ms and 5 ms more for each above",
    Timeout 0x7028 U32 Rw "canTimeout" "time without a command until the drive lets go, in 50 µs; 0 for never",
    ZeroState 0x7029 U8 Rw "zero_sta" "position after power-on, 0 for 0 to 2π, 1 for -π to π",
    Damper 0x702A U8 Rw "damper" "1 lifts the brake against fast turning by hand",
    ZeroOffset 0x702B F32 Rw "add_offset" "offset of the position in rad",
}
