//! Drives with command frames of their own, each written from its manual and without the codec of its family.

mod damiao;
mod lk;
mod odrive;
mod rmd;
mod robstride;
mod vesc;

pub use damiao::DamiaoDrive;
pub use lk::LkDrive;
pub use odrive::OdriveDrive;
pub use rmd::RmdDrive;
pub use robstride::RobStrideDrive;
pub use vesc::{VescDrive, VescMotor};

/// An output shaft with inertia and viscous friction, turned by a drive and by a load.
///
/// # Examples
/// ```
/// use drivetrain::sim::DriveShaft;
///
/// let mut shaft = DriveShaft::new(0.01, 0.0); // kg m², Nm s/rad
/// shaft.set_load(0.5);
/// for _ in 0..1_000 {
///     shaft.step(0.0, 0.001);
/// }
/// assert!((shaft.velocity_rad_per_s() - 50.0).abs() < 0.01);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct DriveShaft {
    angle_rad: f64,
    velocity_rad_per_s: f64,
    torque_nm: f64,
    load_nm: f64,
    inertia_kg_m2: f64,
    friction_nm_s: f64,
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to single precision")]
impl DriveShaft {
    /// Makes a shaft at rest with an inertia in kg m², above zero, and a viscous friction in Nm s/rad.
    #[must_use]
    pub fn new(inertia_kg_m2: f32, friction_nm_s: f32) -> Self {
        Self {
            angle_rad: 0.0,
            velocity_rad_per_s: 0.0,
            torque_nm: 0.0,
            load_nm: 0.0,
            inertia_kg_m2: inertia_kg_m2.into(),
            friction_nm_s: friction_nm_s.into(),
        }
    }

    /// Sets an external torque in Nm, such as the weight of an arm.
    pub fn set_load(&mut self, torque_nm: f32) {
        self.load_nm = torque_nm.into();
    }

    /// Sets the angle in rad.
    pub fn set_angle(&mut self, angle_rad: f32) {
        self.angle_rad = angle_rad.into();
    }

    /// Sets the velocity in rad/s.
    pub fn set_velocity(&mut self, velocity_rad_per_s: f32) {
        self.velocity_rad_per_s = velocity_rad_per_s.into();
    }

    /// Returns the angle in rad, over any number of turns.
    #[must_use]
    pub const fn angle_rad(&self) -> f32 {
        self.angle_rad as f32
    }

    /// Returns the velocity in rad/s.
    #[must_use]
    pub const fn velocity_rad_per_s(&self) -> f32 {
        self.velocity_rad_per_s as f32
    }

    /// Returns the torque of the drive in the last step, in Nm.
    #[must_use]
    pub const fn torque_nm(&self) -> f32 {
        self.torque_nm as f32
    }

    /// Advances by a time in s under a torque of the drive in Nm.
    pub fn step(&mut self, torque_nm: f64, dt_s: f64) {
        self.torque_nm = torque_nm;
        let sum = torque_nm + self.load_nm - self.friction_nm_s * self.velocity_rad_per_s;
        self.velocity_rad_per_s += sum / self.inertia_kg_m2 * dt_s;
        self.angle_rad += self.velocity_rad_per_s * dt_s;
    }

    /// Returns the torque in Nm of a drive's own speed loop that follows a velocity in rad/s.
    fn following_nm(&self, velocity_rad_per_s: f64) -> f64 {
        100.0 * self.inertia_kg_m2 * (velocity_rad_per_s - self.velocity_rad_per_s)
    }
}

/// Clamps a value to a limit and its negative; the sign of the limit does not count.
const fn within(value: f64, limit: f64) -> f64 {
    value.min(limit.abs()).max(-limit.abs())
}

/// Returns the value of the bits of a float in a frame, clamped to a million, and 0 for NaN: the shaft stays finite.
fn float(bits: u32) -> f64 {
    let value = f64::from(f32::from_bits(bits));
    if value.is_nan() { 0.0 } else { value.clamp(-1e6, 1e6) }
}

#[cfg(test)]
mod tests {
    use crate::frame::CanFrame;
    use crate::sim::{DamiaoDrive, OdriveDrive};

    /// Found by fuzzing: a range of torques below zero, and limits that are no numbers, ended the simulation.
    #[test]
    fn a_register_or_a_limit_that_makes_no_sense_gives_a_finite_torque() {
        let mut damiao = DamiaoDrive::new(1, 0x11, [12.5, 30.0, -10.0]);
        let mut odrive = OdriveDrive::new(1, false, 0.05, 1.0);
        for data in [[0xFF; 8], [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC], [0; 8]] {
            let frame = CanFrame::standard(1, data).unwrap();
            assert!(damiao.hear(&frame).is_some());
            damiao.step(1e-3);
            assert!(damiao.shaft().torque_nm().abs() <= 10.0);
        }
        for (number, data) in [(0x0B, [2, 0, 0, 0, 1, 0, 0, 0]), (0x07, [8, 0, 0, 0, 0, 0, 0, 0])] {
            _ = odrive.hear(&CanFrame::standard(1 << 5 | number, data).unwrap());
        }
        // Limits and velocity of NaN.
        for number in [0x0F, 0x0D] {
            _ = odrive.hear(&CanFrame::standard(1 << 5 | number, [0xFF; 8]).unwrap());
            odrive.step(1e-3);
            assert_eq!((odrive.state(), odrive.shaft().torque_nm()), (8, 0.0));
        }
    }
}
