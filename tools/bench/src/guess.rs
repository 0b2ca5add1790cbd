//! Whose a frame may be, by its id and length: a guess for a person, from the tables of the families.

use drivetrain::frame::CanFrame;
use embedded_can::{Frame, Id};

/// Says whose a frame may be; `None` for an id that no family here has.
pub(crate) fn of(frame: &CanFrame) -> Option<String> {
    match frame.id() {
        Id::Standard(id) => standard(id.as_raw(), frame.dlc(), frame.data()),
        Id::Extended(id) => extended(id.as_raw()),
    }
}

fn standard(id: u16, length: usize, data: &[u8]) -> Option<String> {
    let first = data.first().copied();
    let number = |base: u16| id - base;
    Some(match (id, length) {
        (0x200 | 0x1FF | 0x2FF | 0x1FE | 0x2FE, 8) => "commands to DJI motors".into(),
        (0x201..=0x204, 8) => format!("M3508 or M2006 #{}", number(0x200)),
        (0x205..=0x208, 8) => {
            format!("M3508 or M2006 #{}, or GM6020 #{}", number(0x200), number(0x204))
        }
        (0x209..=0x20B, 8) => format!("GM6020 #{}", number(0x204)),
        (0x141..=0x160, 8) => format!("LK #{n}, or a command to LK or RMD #{n}", n = number(0x140)),
        (0x241..=0x260, 8) => format!("RMD #{}", number(0x240)),
        (0x280, 8) => "commands to LK motors".into(),
        (0x7FF, 8) if matches!(data.get(2), Some(0x33 | 0x55 | 0xAA)) => {
            "registers of Damiao".into()
        }
        (0x001..=0x00F, 8) => format!("a command to Damiao #{id}"),
        (0x101..=0x10F, 8) => {
            format!("a command (position, velocity) to Damiao #{}", number(0x100))
        }
        (0x011..=0x01F, 8) if first.is_some_and(|byte| u16::from(byte & 0xF) == number(0x10)) => {
            format!("Damiao #{}", number(0x10))
        }
        _ => {
            // ODrive: the node in the upper six bits, the command in the lower five.
            let (node, command) = (id >> 5, id & 0x1F);
            match (command, length) {
                (0x01, 8) => format!("ODrive #{node} (heartbeat)"),
                (0x09, 8) => format!("ODrive #{node} (position and velocity)"),
                _ => return None,
            }
        }
    })
}

fn extended(id: u32) -> Option<String> {
    let (kind, low) = (id >> 8, id & 0xFF);
    Some(match (kind, id >> 24) {
        (9 | 14 | 15 | 16 | 27 | 58, _) => format!("VESC #{low} (status)"),
        (0..=6, _) => format!("a command to VESC #{low}"),
        (_, 2 | 0x18) => format!("RobStride #{}", kind & 0xFF),
        (_, 1 | 3 | 4 | 6 | 7 | 0x11 | 0x12) => format!("a command to RobStride #{low}"),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::wire::candump::Record;

    fn guess(text: &str) -> Option<String> {
        of(&Record::parse(format!("can0 {text}").as_bytes()).unwrap().frame)
    }

    /// The frames are those of `tests/data/candump`, whose origin stands there.
    #[test]
    fn frames_of_real_logs_are_guessed() {
        for (file, guess) in [
            (include_str!("../../../tests/data/candump/c620_rest.log"), "M3508 or M2006 #1"),
            (include_str!("../../../tests/data/candump/vesc.log"), "VESC #23 (status)"),
            (include_str!("../../../tests/data/candump/odrive.log"), "ODrive #1 (heartbeat)"),
            (include_str!("../../../tests/data/candump/robstride.log"), "RobStride #127"),
            (
                include_str!("../../../tests/data/candump/lk.log"),
                "LK #1, or a command to LK or RMD #1",
            ),
        ] {
            let guesses: Vec<_> = file
                .lines()
                .filter_map(|line| of(&Record::parse(line.as_bytes()).ok()?.frame))
                .collect();
            assert!(guesses.iter().any(|found| found == guess), "{guess} not in {guesses:?}");
        }
    }

    #[test]
    fn what_no_family_has_is_not_guessed() {
        assert_eq!(guess("7F0#00"), None);
        assert_eq!(guess("201#00"), None, "feedback of DJI has eight bytes");
        assert_eq!(guess("012#1180007FF7FF1E1F"), None, "the id in it is another's");
        assert_eq!(guess("011#1180007FF7FF1E1F").as_deref(), Some("Damiao #1"));
        assert_eq!(guess("1FFFFFFF#00"), None);
    }
}
