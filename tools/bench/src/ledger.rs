//! Which motors have been told to rest, and of which of them the bus has seen it.

use drivetrain::frame::CanFrame;
use drivetrain::motor::{Claim, MotorName};
use embedded_can::Frame;

/// The last command of a motor that the interface took.
#[derive(Debug, Clone, Copy)]
struct Standing {
    motor: MotorName,
    frame: CanFrame,
    drives: bool,
    /// Rest was seen on the bus after what drove.
    is_seen: bool,
}

/// Keeps the last command of each motor, or of each frame for several motors.
#[derive(Debug)]
pub(crate) struct Ledger {
    commands: Vec<Claim>,
    standing: Vec<Standing>,
    /// The interface says which frames were on the bus.
    is_told: bool,
}

impl Ledger {
    pub(crate) fn new(claims: impl Iterator<Item = Claim>, is_told: bool) -> Self {
        let commands = claims.filter(|claim| !claim.is_feedback()).collect();
        Self { commands, standing: Vec::new(), is_told }
    }

    /// Notes a frame that the interface took; `is_driving` while the motors are armed. A DJI frame of zeros and a frame of a
    /// disarmed motor are rest.
    pub(crate) fn taken(&mut self, frame: &CanFrame, is_driving: bool) {
        let Some(claim) = self.commands.iter().find(|claim| claim.covers(frame.id())) else {
            return;
        };
        let motor = claim.motor();
        let drives = is_driving && frame.data().iter().any(|byte| *byte != 0);
        let known = self.standing.iter_mut().find(|standing| standing.motor == motor);
        match known {
            Some(standing) => {
                let was_seen = standing.is_seen && !standing.drives;
                let is_seen = !drives && (was_seen || !self.is_told);
                *standing = Standing { motor, frame: *frame, drives, is_seen };
            }
            None => {
                let is_seen = !drives && !self.is_told;
                self.standing.push(Standing { motor, frame: *frame, drives, is_seen });
            }
        }
    }

    /// Notes a frame of ours that was on the bus.
    pub(crate) fn seen(&mut self, frame: &CanFrame) {
        for standing in self.standing.iter_mut().filter(|standing| standing.frame == *frame) {
            standing.is_seen = !standing.drives;
        }
    }

    /// Says why some motor may not rest.
    pub(crate) fn doubt(&self, interface: &str) -> Option<String> {
        if self.standing.iter().any(|standing| standing.drives) {
            return Some(format!("{interface} takes no zeros"));
        }
        let unseen = self.standing.iter().find(|standing| !standing.is_seen)?;
        Some(format!("the zeros of {} were not seen on {interface}", unseen.motor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motors;
    use crate::robot::Robot;
    use drivetrain::motor::Devices;

    fn frame(id: u16, data: [u8; 8]) -> CanFrame {
        CanFrame::standard(id, data).unwrap()
    }

    fn ledger(list: &str, is_told: bool) -> Ledger {
        let mut robot = Robot::new(&motors::parse(list).unwrap(), false).unwrap();
        Ledger::new(robot.claims(), is_told)
    }

    #[test]
    fn zeros_count_when_they_were_seen_and_not_when_they_were_taken() {
        let mut ledger = ledger("m3508:1", true);
        let (zeros, driven) = (frame(0x200, [0; 8]), frame(0x200, [1, 0, 0, 0, 0, 0, 0, 0]));
        assert_eq!(ledger.doubt("can0"), None, "nothing was sent");
        ledger.taken(&driven, true);
        ledger.seen(&driven);
        assert_eq!(ledger.doubt("can0").as_deref(), Some("can0 takes no zeros"));
        ledger.taken(&zeros, false);
        assert!(ledger.doubt("can0").unwrap().contains("M3508 #1 were not seen on can0"));
        ledger.seen(&zeros);
        assert_eq!(ledger.doubt("can0"), None);
        ledger.taken(&zeros, false);
        assert_eq!(ledger.doubt("can0"), None, "a keep-alive");
    }

    #[test]
    fn where_nobody_tells_what_was_on_the_bus_taken_zeros_count() {
        let mut ledger = ledger("m3508:1", false);
        ledger.taken(&frame(0x200, [1; 8]), true);
        ledger.taken(&frame(0x200, [0; 8]), false);
        assert_eq!(ledger.doubt("can0"), None);
    }

    #[test]
    fn rest_of_a_drive_with_an_impedance_is_no_frame_of_zeros() {
        let mut ledger = ledger("damiao4310:1", true);
        let rest = frame(0x001, [0x7F, 0xFF, 0x7F, 0xF0, 0, 0, 0x07, 0xFF]);
        ledger.taken(&rest, true);
        assert!(ledger.doubt("can0").is_some(), "armed, whatever it says");
        ledger.taken(&rest, false);
        ledger.seen(&rest);
        assert_eq!(ledger.doubt("can0"), None);
    }
}
