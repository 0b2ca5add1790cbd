//! Facts of the models, as a table open to further models.

use crate::error::ConfigError;
use crate::motor::{mit_model, models, registers};
use crate::wire::mit::Ranges;

/// A model of motor: its name, the ranges of its fields, and its largest current.
///
/// | model | position rad | velocity rad/s | torque Nm | kp, kd | current A |
/// |---|--:|--:|--:|--:|--:|
/// | [`RS00`](Self::RS00) | 4π | 33 | 14 | 500, 5 | 16 |
/// | [`RS01`](Self::RS01) | 4π | 44 | 17 | 500, 5 | 23 |
/// | [`RS02`](Self::RS02) | 4π | 44 | 17 | 500, 5 | 16 |
/// | [`RS03`](Self::RS03) | 4π | 20 | 60 | 5000, 100 | 43 |
/// | [`RS04`](Self::RS04) | 4π | 15 | 120 | 5000, 100 | 90 |
/// | [`RS05`](Self::RS05) | 4π | 50 | 5.5 | 500, 5 | 11 |
/// | [`RS06`](Self::RS06) | 4π | 50 | 36 | 5000, 100 | 57 |
/// | [`CYBERGEAR`](Self::CYBERGEAR) | 4π | 30 | 12 | 500, 5 | 23 |
///
/// Ranges and currents come from the maker's manuals of 28 April 2026, and from the manual of the CyberGear. **A drive does not tell
/// its ranges, and not all sources agree**: a torque or a stiffness is wrong by the quotient of the ranges, up to tenfold.
///
/// | model | contested | says |
/// |---|---|---|
/// | all | position 12.57, or 12.5 before firmware 0.0.2.6 of the RS00 | sample code in the manuals |
/// | CyberGear | position 12.5 | sample code in the manual |
/// | RS00, RS05 | 50 rad/s and 17 Nm; 33 rad/s and 17 Nm | robstride-dynamics 0.0.1 |
/// | RS03 | 50 rad/s | robstride-dynamics 0.0.1 |
/// | RS06 | 20 rad/s and 60 Nm | robstride-dynamics 0.0.1 |
/// | RS03, RS04 | kp 500, kd 5 | public programs |
///
/// [`with_position_range`](Self::with_position_range) and [`with_gain_ranges`](Self::with_gain_ranges) set others, and
/// [`new`](Self::new) all of them. Before a motor is enabled its torque limit is written to the drive too
/// (`limit_torque`, in Nm), so that the drive itself limits the torque for any ranges.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::robstride::Model;
///
/// assert_eq!((Model::RS04.name(), Model::RS04.tmax_nm()), ("RS04", 120.0));
/// let old = Model::RS00.with_position_range(12.5)?;
/// assert_eq!((old.pmax_rad(), old.vmax_rad_per_s()), (12.5, 33.0));
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    name: &'static str,
    ranges: Ranges,
    current_a: f32,
    is_cybergear: bool,
}

const FOUR_PI: f32 = 4.0 * core::f32::consts::PI;

models! {
    RS00 "RS00" [33.0, 14.0, 500.0, 5.0] 16.0 false;
    RS01 "RS01" [44.0, 17.0, 500.0, 5.0] 23.0 false;
    RS02 "RS02" [44.0, 17.0, 500.0, 5.0] 16.0 false;
    RS03 "RS03" [20.0, 60.0, 5000.0, 100.0] 43.0 false;
    RS04 "RS04" [15.0, 120.0, 5000.0, 100.0] 90.0 false;
    RS05 "RS05" [50.0, 5.5, 500.0, 5.0] 11.0 false;
    RS06 "RS06" [50.0, 36.0, 5000.0, 100.0] 57.0 false;
    CYBERGEAR "CyberGear" [30.0, 12.0, 500.0, 5.0] 23.0 true;
}

mit_model!(65_535);

impl Model {
    /// Describes a RobStride missing from the table: its ranges, and its largest current in A. The ranges of kp and kd are 500 and
    /// 5 unless [`Ranges::with_gains`] sets them.
    ///
    /// # Errors
    /// [`ConfigError::NotPositive`] for a current that is zero, negative or not finite.
    pub const fn new(
        name: &'static str,
        ranges: Ranges,
        current_a: f32,
    ) -> Result<Self, ConfigError> {
        if current_a > 0.0 && current_a.is_finite() {
            Ok(Self { name, ranges, current_a, is_cybergear: false })
        } else {
            Err(ConfigError::NotPositive("current_a"))
        }
    }

    const fn known(name: &'static str, ranges: [f32; 4], current: f32, is_cybergear: bool) -> Self {
        let [vmax, tmax, kp, kd] = ranges;
        let ranges = Ranges::of([FOUR_PI, vmax, tmax], [kp, kd]);
        Self { name, ranges, current_a: current, is_cybergear }
    }

    /// Sets another range of the position, in rad, and keeps all others: for another firmware.
    ///
    /// # Errors
    /// [`ConfigError::Range`] for a range not between 0.001 and 1000000.
    pub const fn with_position_range(self, pmax_rad: f32) -> Result<Self, ConfigError> {
        let (kp, kd) = self.ranges.gains();
        match Ranges::new(pmax_rad, self.vmax_rad_per_s(), self.tmax_nm()) {
            Ok(ranges) => Self { ranges, ..self }.with_gain_ranges(kp, kd),
            Err(error) => Err(error),
        }
    }

    /// Sets other ranges of kp and kd, in Nm/rad and Nm s/rad, and keeps all others. **A range below the range of the drive makes the
    /// drive stiffer than asked by the quotient.**
    ///
    /// # Errors
    /// [`ConfigError::Range`] for a range not between 0.001 and 1000000.
    pub const fn with_gain_ranges(self, kp: f32, kd: f32) -> Result<Self, ConfigError> {
        match self.ranges.with_gains(kp, kd) {
            Ok(ranges) => Ok(Self { ranges, ..self }),
            Err(error) => Err(error),
        }
    }

    /// Returns the largest current, in A.
    #[must_use]
    pub const fn current_a(&self) -> f32 {
        self.current_a
    }

    /// Tells whether the drive has a time-out for commands. A CyberGear has no time-out, and goes on with its last command for ever.
    #[must_use]
    pub const fn has_timeout(&self) -> bool {
        !self.is_cybergear
    }

    /// Tells whether the drive keeps its parameters over a loss of the supply when told. The frame for storing changes the bit rate of a
    /// CyberGear.
    #[must_use]
    pub const fn can_store(&self) -> bool {
        !self.is_cybergear
    }

    /// Tells whether the drive knows its angle within a turn from power-on. A CyberGear counts from where its shaft was then.
    pub(super) const fn knows_angle(&self) -> bool {
        !self.is_cybergear
    }

    /// Returns the run mode for positions without a profile: 5 (CSP), for a CyberGear 1.
    pub(super) const fn position_mode(&self) -> u8 {
        if self.is_cybergear { 1 } else { 5 }
    }
}

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
