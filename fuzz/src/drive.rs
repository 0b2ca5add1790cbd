//! The simulated drives that judge own motors.

use drivetrain::frame::CanFrame;
use drivetrain::sim::{
    DamiaoDrive, DriveShaft, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive,
};

/// A simulated drive.
pub trait Drive {
    /// Takes a frame from the bus and returns the answer.
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame>;

    /// Moves on by a time in s.
    fn step(&mut self, dt_s: f32);

    /// Appends the frames that the drive sends by itself.
    fn report(&mut self, frames: &mut Vec<CanFrame>) {
        _ = frames;
    }

    /// Whether the next frame may be sent back, while the command before holds again.
    fn sends_back(&self) -> bool {
        false
    }

    fn shaft_mut(&mut self) -> &mut DriveShaft;

    /// Has the drive fail, lose its supply, or refuse.
    fn suffer(&mut self, kind: u8);
}

/// The methods that the drives have by themselves.
macro_rules! forward {
    () => {
        fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
            Self::hear(self, frame)
        }
        fn step(&mut self, dt_s: f32) {
            Self::step(self, dt_s);
        }
        fn shaft_mut(&mut self) -> &mut DriveShaft {
            Self::shaft_mut(self)
        }
    };
}

impl Drive for DamiaoDrive {
    forward!();
    fn suffer(&mut self, kind: u8) {
        match kind % 2 {
            0 => self.fail(8 + kind % 7),
            _ => self.lose_supply(),
        }
    }
}

impl Drive for LkDrive {
    forward!();
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
    forward!();
    fn report(&mut self, frames: &mut Vec<CanFrame>) {
        frames.extend(Self::report(self));
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
    forward!();
    fn report(&mut self, frames: &mut Vec<CanFrame>) {
        frames.extend([27, 16, 9].into_iter().filter_map(|packet| Self::report(self, packet)));
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
    forward!();
    fn report(&mut self, frames: &mut Vec<CanFrame>) {
        frames.extend(core::iter::from_fn(|| self.next_frame()));
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
    forward!();
    fn suffer(&mut self, kind: u8) {
        match kind % 3 {
            0 => self.fail(1 << (kind >> 3)),
            1 => self.calibrate(kind & 4 == 0),
            _ => self.lose_supply(),
        }
    }
}
