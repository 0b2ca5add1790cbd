//! A motor of one's own: its feedback says how it is, and it notes whether it was driven.

use drivetrain::control::TimeStep;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Malformed, MotorName, Own, OwnMotor, Severity, Vitals};
use drivetrain::units::AngularVelocity;
use embedded_can::{Frame, Id, StandardId};

pub(crate) struct Mine {
    id: u8,
    pub(crate) vitals: Vitals,
    /// How often its loop ran.
    pub(crate) runs: u32,
    /// How often its loop was brought to rest.
    pub(crate) resets: u32,
}

/// A motor with a number below 16 that is disarmed and was not heard.
pub(crate) fn own(id: u8) -> Own<Mine> {
    Own::new(Mine { id, vitals: Vitals::default(), runs: 0, resets: 0 })
}

fn standard(raw: u16) -> Id {
    StandardId::new(raw).unwrap().into()
}

/// What a motor sends that stands and has no fault.
pub(crate) fn healthy(id: u8) -> CanFrame {
    feedback(id, 0, 0, 0)
}

/// What a motor sends whose ESC reports a fault.
pub(crate) fn faulty(id: u8) -> CanFrame {
    feedback(id, 9, 0, 0)
}

/// Feedback with an error code, and current and speed in percent.
pub(crate) fn feedback(id: u8, code: u8, current: i8, speed: i8) -> CanFrame {
    let bytes = [code, current.cast_unsigned(), speed.cast_unsigned()];
    CanFrame::new(standard(0x180 + u16::from(id)), &bytes).unwrap()
}

/// The command of a motor, as another node would send it.
pub(crate) fn rival(id: u8) -> CanFrame {
    CanFrame::new(standard(0x100 + u16::from(id)), &[7; 8]).unwrap()
}

impl OwnMotor for Mine {
    fn name(&self) -> MotorName {
        MotorName::new("mine", self.id)
    }
    fn command_id(&self) -> Id {
        standard(0x100 + u16::from(self.id))
    }
    fn feedback_id(&self) -> Id {
        standard(0x180 + u16::from(self.id))
    }
    fn decode(&mut self, frame: &CanFrame) -> Result<(), Malformed> {
        let [code, current, speed] = *frame.data() else {
            return Err(Malformed::Length(frame.length()));
        };
        let share = |byte: u8| f32::from(byte.cast_signed()) / 100.0;
        self.vitals = Vitals {
            error: (code != 0).then_some(Severity::Fault),
            error_code: code,
            current: share(current),
            speed: share(speed),
            ..self.vitals
        };
        Ok(())
    }
    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::ZERO
    }
    fn control(&mut self, target: AngularVelocity, _: &TimeStep) -> [u8; 8] {
        self.runs += 1;
        [if target > AngularVelocity::ZERO { 1 } else { 0xFF }; 8]
    }
    fn reset(&mut self) {
        self.resets += 1;
    }
    fn vitals(&self) -> Vitals {
        self.vitals
    }
}
