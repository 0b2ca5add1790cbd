//! The simulated drives, with decoders from the manuals.

use crate::station::Drive;
use drivetrain::frame::CanFrame;
use drivetrain::sim::{
    DamiaoDrive, Drive as _, DriveShaft, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive,
};
use embedded_can::{ExtendedId, Frame, Id, StandardId};

macro_rules! usual {
    () => {
        fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
            self.0.hear(frame)
        }
        passive!();
    };
}

/// All but the reaction to a frame.
macro_rules! passive {
    () => {
        fn step(&mut self, dt_s: f32) {
            self.0.step(dt_s);
        }
        fn shaft(&self) -> &DriveShaft {
            self.0.shaft()
        }
        fn shaft_mut(&mut self) -> &mut DriveShaft {
            self.0.shaft_mut()
        }
        fn lose_supply(&mut self) {
            self.0.lose_supply();
        }
    };
}

fn standard(id: u32, data: [u8; 8]) -> CanFrame {
    CanFrame::standard(u16::try_from(id).unwrap(), data).unwrap()
}

pub(crate) fn with_id(frame: &CanFrame, id: u32) -> CanFrame {
    let id = match frame.id() {
        Id::Standard(_) => Id::from(StandardId::new(u16::try_from(id).unwrap()).unwrap()),
        Id::Extended(_) => ExtendedId::new(id).unwrap().into(),
    };
    CanFrame::new(id, frame.data()).unwrap()
}

pub(crate) fn raw(frame: &CanFrame) -> u32 {
    match frame.id() {
        Id::Standard(id) => u32::from(id.as_raw()),
        Id::Extended(id) => id.as_raw(),
    }
}

/// A drive of Damiao with id 1 and master id 0x11; in MIT mode or in another.
pub(crate) struct Damiao(pub(crate) DamiaoDrive, pub(crate) bool);

impl Drive for Damiao {
    usual!();
    fn fail(&mut self) {
        self.0.fail(14);
    }
    fn missets(&mut self) -> Result<(), &'static str> {
        self.0 = self.0.with_register(10, 2.0);
        Ok(())
    }
    fn misranges(&mut self) -> Result<(), &'static str> {
        self.0 = self.0.with_register(21, 12.566);
        Ok(())
    }
    fn impossible(&mut self) -> Result<CanFrame, &'static str> {
        Ok(standard(0x11, [0x71, 0x80, 0, 0x80, 0x08, 0, 30, 30]))
    }
    fn of_neighbour(&self, frame: &CanFrame) -> CanFrame {
        let mut data = *frame.bytes();
        data[0] += 1;
        standard(raw(frame), data)
    }
    fn echo(&self, _command: &CanFrame) -> Result<CanFrame, &'static str> {
        Err("answers have an id of their own")
    }
    /// Disable or clear on the id of the mode or the bare one; a question about a register, TIMEOUT is written on the way to be
    /// enabled only; in MIT mode no gains and a torque within a count of zero.
    fn is_rest(&self, frame: &CanFrame) -> bool {
        let (id, d) = (raw(frame), frame.bytes());
        if id == 0x7FF {
            return d[..2] == [1, 0] && matches!(d[2], 0x33 | 0xCC);
        }
        if d[..7] == [0xFF; 7] {
            return id & 0xFF == 1 && matches!(d[7], 0xFB | 0xFD);
        }
        let no_gains = d[3] & 0xF == 0 && d[4] == 0 && d[5] == 0 && d[6] >> 4 == 0;
        let torque = u16::from(d[6] & 0xF) << 8 | u16::from(d[7]);
        self.1 && id == 1 && no_gains && matches!(torque, 0x7FF | 0x800)
    }
}

/// A drive of RobStride with id 1, of this program with id 0xFD.
pub(crate) struct RobStride(pub(crate) RobStrideDrive);

impl Drive for RobStride {
    usual!();
    fn fail(&mut self) {
        self.0.fail(1);
    }
    fn missets(&mut self) -> Result<(), &'static str> {
        self.0 = self.0.with_parameter(0x7005, 3.0);
        Ok(())
    }
    fn misranges(&mut self) -> Result<(), &'static str> {
        Err("; ranges cannot be read")
    }
    fn of_neighbour(&self, frame: &CanFrame) -> CanFrame {
        with_id(frame, raw(frame) + 0x100)
    }
    fn echo(&self, _command: &CanFrame) -> Result<CanFrame, &'static str> {
        Err("the type of a frame tells its direction")
    }
    /// No gains and a torque within half a count; disabled; a question; the run mode; or no current.
    fn is_rest(&self, frame: &CanFrame) -> bool {
        let (id, data) = (raw(frame), u64::from_be_bytes(*frame.bytes()));
        let index = u16::from_le_bytes([frame.bytes()[0], frame.bytes()[1]]);
        match id >> 24 {
            1 => matches!(id >> 8 & 0xFFFF, 0x7FFF | 0x8000) && data & 0xFFFF_FFFF == 0,
            4 | 17 => true,
            18 => index == 0x7005 || index == 0x7006 && data & 0xFFFF_FFFF == 0,
            _ => false,
        }
    }
}

/// A VESC with id 23, whose status 1, 4 and 5 come each millisecond.
pub(crate) struct Vesc(pub(crate) VescDrive);

impl Drive for Vesc {
    usual!();
    fn reports(&mut self) -> Vec<CanFrame> {
        [27, 16, 9].iter().filter_map(|packet| self.0.report(*packet)).collect()
    }
    fn fail(&mut self) {
        self.0.fail(4);
    }
    fn echo(&self, _command: &CanFrame) -> Result<CanFrame, &'static str> {
        Err("status packets have numbers of their own")
    }
    /// A current of 0, or the question for the fault code.
    fn is_rest(&self, frame: &CanFrame) -> bool {
        match raw(frame) {
            0x117 => frame.data() == [0; 4],
            0x817 => frame.data() == [254, 0, 50, 0, 0, 0x80, 0],
            _ => false,
        }
    }
}

/// A drive of LK-TECH with id 1.
pub(crate) struct Lk(pub(crate) LkDrive);

impl Drive for Lk {
    usual!();
    fn fail(&mut self) {
        self.0.fail(0b1000);
    }
    fn echo(&self, command: &CanFrame) -> Result<CanFrame, &'static str> {
        let mut data = *command.bytes();
        data[0] = 0x88;
        Ok(standard(0x141, data))
    }
    /// Off, questions, clear, and a torque without current.
    fn is_rest(&self, frame: &CanFrame) -> bool {
        let [code, rest @ ..] = *frame.bytes();
        raw(frame) == 0x141
            && [0x80, 0x92, 0x9A, 0x9B, 0x9C, 0xA1].contains(&code)
            && rest == [0; 7]
    }
}

/// A drive of MyActuator with id 1.
pub(crate) struct Rmd(pub(crate) RmdDrive);

impl Drive for Rmd {
    usual!();
    fn reports(&mut self) -> Vec<CanFrame> {
        self.0.next_frame().into_iter().collect()
    }
    fn fail(&mut self) {
        self.0.set_reasons(0x0004);
    }
    fn echo(&self, command: &CanFrame) -> Result<CanFrame, &'static str> {
        Ok(standard(0x241, *command.bytes()))
    }
    /// Off, the lock of the brake, questions, and a torque without current.
    fn is_rest(&self, frame: &CanFrame) -> bool {
        let [code, rest @ ..] = *frame.bytes();
        raw(frame) == 0x141
            && [0x78, 0x80, 0x92, 0x9A, 0x9C, 0xA1].contains(&code)
            && rest == [0; 7]
    }
}

/// An ODrive with node id 3, and whether the drive takes its modes.
pub(crate) struct Odrive(pub(crate) OdriveDrive, pub(crate) bool);

impl Drive for Odrive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        let is_lost = !self.1 && raw(frame) == 0x6B;
        if is_lost { None } else { self.0.hear(frame) }
    }
    passive!();
    fn reports(&mut self) -> Vec<CanFrame> {
        std::iter::from_fn(|| self.0.next_frame()).collect()
    }
    fn fail(&mut self) {
        self.0.fail(0x40);
    }
    /// Velocity mode, by another master.
    fn missets(&mut self) -> Result<(), &'static str> {
        self.0.hear(&standard(0x6B, [2, 0, 0, 0, 1, 0, 0, 0]));
        Ok(())
    }
    fn keeps_modes(&mut self) -> bool {
        self.1 = false;
        true
    }
    fn impossible(&mut self) -> Result<CanFrame, &'static str> {
        Ok(standard(0x69, [0, 0, 0xC0, 0x7F, 0, 0, 0, 0]))
    }
    fn of_neighbour(&self, frame: &CanFrame) -> CanFrame {
        with_id(frame, raw(frame) + 0x20)
    }
    fn echo(&self, _command: &CanFrame) -> Result<CanFrame, &'static str> {
        Err("each message has a number of its own")
    }
    /// Idle, the stop of the drive, a torque of 0, or a question.
    fn is_rest(&self, frame: &CanFrame) -> bool {
        let (node, number) = (raw(frame) >> 5, raw(frame) & 0x1F);
        node == 3
            && match number {
                0x01 | 0x03 | 0x09 => frame.is_remote_frame(),
                0x02 => frame.data().is_empty(),
                0x07 => frame.data() == [1, 0, 0, 0],
                0x0E => frame.data() == [0; 4],
                _ => false,
            }
    }
}
