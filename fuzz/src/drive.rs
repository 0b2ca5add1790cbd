//! The simulated drives that judge actuators.

use drivetrain::sim::{
    self, DamiaoDrive, DriveShaft, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive,
};

/// A simulated drive.
pub trait Drive: sim::Drive {
    /// Whether the next frame may be sent back, while the command before holds again.
    fn sends_back(&self) -> bool {
        false
    }

    fn shaft_mut(&mut self) -> &mut DriveShaft;

    /// Has the drive fail, lose its supply, or refuse.
    fn suffer(&mut self, kind: u8);
}

impl Drive for DamiaoDrive {
    fn shaft_mut(&mut self) -> &mut DriveShaft {
        self.shaft_mut()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 2 {
            0 => self.fail(8 + kind % 7),
            _ => self.lose_supply(),
        }
    }
}

impl Drive for LkDrive {
    fn shaft_mut(&mut self) -> &mut DriveShaft {
        self.shaft_mut()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 4 {
            0 => self.fail(kind >> 2),
            1 => self.set_reasons(kind >> 2),
            2 => self.set_temperature(kind.cast_signed()),
            _ => self.lose_supply(),
        }
    }
}

impl Drive for RmdDrive {
    fn shaft_mut(&mut self) -> &mut DriveShaft {
        self.shaft_mut()
    }
    /// After its time-out.
    fn sends_back(&self) -> bool {
        !self.is_on()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 4 {
            0 => self.fail(1 << (kind >> 4)),
            1 => self.set_reasons(1 << (kind >> 4)),
            2 => self.set_temperature(kind.cast_signed()),
            _ => self.lose_supply(),
        }
    }
}

impl Drive for VescDrive {
    fn shaft_mut(&mut self) -> &mut DriveShaft {
        self.shaft_mut()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 4 {
            0 => self.fail(kind >> 2),
            1 => self.set_tachometer(i32::MAX - i32::from(kind)),
            2 => self.set_temperatures(f32::from(kind), 30.0),
            _ => self.lose_supply(),
        }
    }
}

impl Drive for OdriveDrive {
    fn shaft_mut(&mut self) -> &mut DriveShaft {
        self.shaft_mut()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 4 {
            0 => self.fail(1 << (kind >> 3)),
            1 => self.refuse(kind >> 2 & 0xF),
            // A calibration, say. Closed loop by USB would be another master.
            2 => self.set_state(kind >> 2 & 7),
            _ => self.lose_supply(),
        }
    }
}

impl Drive for RobStrideDrive {
    fn shaft_mut(&mut self) -> &mut DriveShaft {
        self.shaft_mut()
    }
    fn suffer(&mut self, kind: u8) {
        match kind % 3 {
            0 => self.fail(1 << (kind >> 3)),
            1 => self.calibrate(kind & 4 == 0),
            _ => self.lose_supply(),
        }
    }
}
