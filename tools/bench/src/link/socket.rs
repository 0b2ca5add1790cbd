//! A CAN interface of Linux (SocketCAN).

use super::{Heard, Taken};
use crate::text;
use drivetrain::frame::CanFrame;
use embedded_can::{ErrorKind, ExtendedId, Frame, Id, StandardId};
use rustix::net::{RecvAncillaryBuffer, RecvFlags, recvmsg};
use socketcan::{CanSocket, Socket as _, SocketOptions};
use std::io::{self, IoSliceMut};

/// Set by the kernel for a frame of this socket that the interface sent (`CAN_RAW_RECV_OWN_MSGS`).
const MSG_CONFIRM: u32 = 0x800;

/// The flags in the word with the id (`linux/can.h`).
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;

/// A socket on a CAN interface.
///
/// The socket's own implementation of `embedded-can` takes a full queue (`ENOBUFS`) for a failure; here it is a refusal, and the
/// newest command is offered again.
#[derive(Debug)]
pub(crate) struct Socket {
    socket: CanSocket,
    name: String,
}

impl Socket {
    /// # Errors
    /// Says what to look at.
    pub(crate) fn open(name: &str) -> Result<Self, String> {
        let open = || -> io::Result<CanSocket> {
            let socket = CanSocket::open(name)?;
            socket.set_nonblocking(true)?;
            // Bus errors are counted by kind.
            socket.set_error_filter_accept_all()?;
            // A frame counts as sent when it was on the bus.
            socket.set_recv_own_msgs(true)?;
            Ok(socket)
        };
        let hint = "does `ip link` show it, and is it up? See --help";
        let socket = open().map_err(|error| format!("cannot open {name}: {error}; {hint}"))?;
        Ok(Self { socket, name: name.to_owned() })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn send(&mut self, frame: &CanFrame) -> Taken {
        const ENOBUFS: i32 = 105;
        let Some(frame) = frame.convert::<socketcan::CanFrame>() else {
            return Taken::Failed(ErrorKind::Form);
        };
        match self.socket.write_frame(&frame) {
            Ok(()) => Taken::Yes,
            Err(error) if error.raw_os_error() == Some(ENOBUFS) => Taken::Full,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Taken::Full,
            Err(_) => Taken::Failed(ErrorKind::Other),
        }
    }

    pub(crate) fn receive(&mut self) -> Option<Heard> {
        let mut bytes = [0; 16];
        let mut parts = [IoSliceMut::new(&mut bytes)];
        let mut control = RecvAncillaryBuffer::default();
        let received = recvmsg(&self.socket, &mut parts, &mut control, RecvFlags::DONTWAIT);
        let flags = match received {
            Ok(received) if received.bytes == 16 => received.flags.bits(),
            Ok(_) => return Some(Heard::Foreign(String::new())),
            Err(rustix::io::Errno::AGAIN) => return None,
            Err(_) => return Some(Heard::Failed(ErrorKind::Other)),
        };
        Some(heard(&bytes, flags & MSG_CONFIRM != 0))
    }
}

/// Reads a `struct can_frame`.
fn heard(bytes: &[u8; 16], is_own: bool) -> Heard {
    let [a, b, c, d, length, _, _, _, data @ ..] = *bytes;
    let word = u32::from_ne_bytes([a, b, c, d]);
    let data = data.get(..length.into()).unwrap_or(&data);
    if word & ERROR != 0 {
        return Heard::Error(word & !EXTENDED, data.to_vec(), kind(word, data));
    }
    let id = if word & EXTENDED == 0 {
        u16::try_from(word & 0x7FF).ok().and_then(StandardId::new).map(Id::from)
    } else {
        ExtendedId::new(word & 0x1FFF_FFFF).map(Id::from)
    };
    let frame = id.and_then(|id| match word & REMOTE {
        0 => CanFrame::new(id, data),
        _ => CanFrame::new_remote(id, length.into()),
    });
    match frame {
        Some(frame) if is_own => Heard::Own(frame),
        Some(frame) => Heard::Frame(frame),
        None => Heard::Foreign(text::of_parts(word, length, data)),
    }
}

/// The kind of an error frame (`linux/can/error.h`).
fn kind(class: u32, data: &[u8]) -> ErrorKind {
    const CONTROLLER: u32 = 0x04;
    const PROTOCOL: u32 = 0x08;
    const ACKNOWLEDGE: u32 = 0x20;
    let byte = |index: usize| data.get(index).copied().unwrap_or(0);
    let (controller, protocol, place) = (byte(1), byte(2), byte(3));
    match class {
        _ if class & ACKNOWLEDGE != 0 => ErrorKind::Acknowledge,
        // A buffer of the controller overflowed.
        _ if class & CONTROLLER != 0 && controller & 0x03 != 0 => ErrorKind::Overrun,
        _ if class & PROTOCOL == 0 => ErrorKind::Other,
        // In the sequence of the check sum.
        _ if place == 0x08 => ErrorKind::Crc,
        _ if protocol & 0x04 != 0 => ErrorKind::Stuff,
        _ if protocol & 0x02 != 0 => ErrorKind::Form,
        _ if protocol & 0x19 != 0 => ErrorKind::Bit,
        _ => ErrorKind::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(word: u32, length: u8, data: [u8; 8]) -> [u8; 16] {
        let mut bytes = [0; 16];
        bytes[..4].copy_from_slice(&word.to_ne_bytes());
        bytes[4] = length;
        bytes[8..].copy_from_slice(&data);
        bytes
    }

    #[test]
    fn frames_of_the_kernel_are_told_apart() {
        let data = [1, 2, 3, 4, 5, 6, 7, 8];
        let frame = CanFrame::standard(0x201, data).unwrap();
        assert_eq!(heard(&raw(0x201, 8, data), false), Heard::Frame(frame));
        assert_eq!(heard(&raw(0x201, 8, data), true), Heard::Own(frame));
        let extended = CanFrame::of(ExtendedId::new(0x201).unwrap(), [1, 2]);
        assert_eq!(heard(&raw(0x8000_0201, 2, data), false), Heard::Frame(extended));
        let remote = CanFrame::new_remote(StandardId::new(0x201).unwrap(), 8).unwrap();
        assert_eq!(heard(&raw(0x4000_0201, 8, [0; 8]), false), Heard::Frame(remote));
        let data = vec![0, 1, 0, 0, 0, 0, 0, 0];
        let error = Heard::Error(0x2000_0004, data, ErrorKind::Overrun);
        assert_eq!(heard(&raw(0x2000_0004, 8, [0, 1, 0, 0, 0, 0, 0, 0]), false), error);
    }

    #[test]
    fn an_error_frame_has_the_kind_of_its_class() {
        for (class, data, expected) in [
            (0x20, [0; 8], ErrorKind::Acknowledge),
            (0x08, [0, 0, 0x04, 0, 0, 0, 0, 0], ErrorKind::Stuff),
            (0x08, [0, 0, 0x02, 0, 0, 0, 0, 0], ErrorKind::Form),
            (0x08, [0, 0, 0x10, 0, 0, 0, 0, 0], ErrorKind::Bit),
            (0x08, [0, 0, 0, 0x08, 0, 0, 0, 0], ErrorKind::Crc),
            (0x04, [0, 0x02, 0, 0, 0, 0, 0, 0], ErrorKind::Overrun),
            (0x40, [0; 8], ErrorKind::Other),
        ] {
            assert_eq!(kind(class, &data), expected, "{class:X}");
        }
    }
}
