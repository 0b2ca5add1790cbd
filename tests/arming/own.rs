//! A motor of one's own: its feedback says how it is, and it notes whether it was driven.

use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Claim, DriveProtocol, Ingest, MotorName, Order, Target, Vitals};
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
pub(crate) fn own(id: u8) -> Actuator<Mine> {
    Actuator::new(Mine { id, vitals: Vitals::default(), runs: 0, resets: 0 })
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

impl DriveProtocol for Mine {
    fn name(&self) -> MotorName {
        MotorName::new("mine", self.id)
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let id = |base| standard(base + u16::from(self.id));
        [Claim::feedback(id(0x180), self.name()), Claim::command(id(0x100), self.name())]
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let [code, current, speed] = *frame.data() else {
            return Ingest::WrongLength(frame.length());
        };
        let share = |byte: u8| f32::from(byte.cast_signed()) / 100.0;
        self.vitals = Vitals {
            has_fault: code != 0,
            error_code: code,
            current: share(current),
            speed: share(speed),
            ..self.vitals
        };
        Ingest::Taken
    }
    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::ZERO
    }
    fn rest(&mut self) -> CanFrame {
        CanFrame::of(standard(0x100 + u16::from(self.id)), [0; 8])
    }
    fn control(&mut self, order: Order) -> CanFrame {
        self.runs += 1;
        let forward = matches!(order.target, Target::Velocity(it) if it > AngularVelocity::ZERO);
        CanFrame::of(standard(0x100 + u16::from(self.id)), [if forward { 1 } else { 0xFF }; 8])
    }
    fn reset(&mut self) {
        self.resets += 1;
    }
    fn vitals(&self) -> Vitals {
        self.vitals
    }
}
