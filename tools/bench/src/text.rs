//! Frames in the form of `candump -L`.

use drivetrain::frame::CanFrame;
use embedded_can::{Frame, Id};
use std::fmt::Write;

/// A frame without time and interface, as in `201#0E160000FFFD2100`.
pub(crate) fn of(frame: &CanFrame) -> String {
    let id = match frame.id() {
        Id::Standard(id) => format!("{:03X}", id.as_raw()),
        Id::Extended(id) => format!("{:08X}", id.as_raw()),
    };
    if frame.is_remote_frame() {
        return match frame.dlc() {
            0 => format!("{id}#R"),
            length => format!("{id}#R{length}"),
        };
    }
    with_data(id + "#", frame.data())
}

/// An error frame, or one that is none of ours: the word with its flags, and its data.
pub(crate) fn of_parts(word: u32, _length: u8, data: &[u8]) -> String {
    with_data(format!("{word:08X}#"), data)
}

fn with_data(mut text: String, data: &[u8]) -> String {
    for byte in data {
        _ = write!(text, "{byte:02X}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};

    #[test]
    fn each_kind_of_frame_has_the_form_of_candump() {
        let id = StandardId::new(0x21).unwrap();
        assert_eq!(of(&CanFrame::of(id, [0x0E, 0x16])), "021#0E16");
        assert_eq!(of(&CanFrame::of(ExtendedId::new(0x21).unwrap(), [])), "00000021#");
        assert_eq!(of(&CanFrame::new_remote(id, 8).unwrap()), "021#R8");
        assert_eq!(of(&CanFrame::new_remote(id, 0).unwrap()), "021#R");
        assert_eq!(of_parts(0x2000_0004, 2, &[0, 1]), "20000004#0001");
    }
}
