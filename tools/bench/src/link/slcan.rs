//! A serial CAN adapter that speaks the protocol of Lawicel (slcan): a line of characters for each frame.

use super::{Heard, Taken};
use drivetrain::frame::CanFrame;
use embedded_can::{ErrorKind, ExtendedId, Frame, Id, StandardId};
use std::io::{self, Read, Write};
use std::time::Duration;

/// Longer lines are none of the protocol: `T`, 8 digits of an id, the length, 8 bytes, 4 digits of a time, and what ends it.
const LONGEST: usize = 32;

/// A serial port, or for a test anything that is read and written.
pub(crate) trait Port: Read + Write {}

impl<T: Read + Write> Port for T {}

/// An adapter on a serial port.
pub(crate) struct Slcan {
    port: Box<dyn Port>,
    name: String,
    /// What was received of a line.
    line: Vec<u8>,
    /// What was received and not looked at yet, last byte first.
    received: Vec<u8>,
    /// What the port did not take yet.
    waiting: Vec<u8>,
}

impl std::fmt::Debug for Slcan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Slcan").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Slcan {
    /// Opens the adapter at 1 Mbit/s.
    ///
    /// # Errors
    /// Says which port does not open, and why.
    pub(crate) fn open(path: &str) -> Result<Self, String> {
        let said = |error: &dyn std::fmt::Display| format!("cannot open {path}: {error}");
        let port = serialport::new(path, 2_000_000).timeout(Duration::ZERO).open();
        let mut slcan = Self::on(path, Box::new(port.map_err(|error| said(&error))?));
        slcan.start().map_err(|error| said(&error))?;
        Ok(slcan)
    }

    pub(crate) fn on(name: &str, port: Box<dyn Port>) -> Self {
        let (line, received, waiting) = Default::default();
        Self { port, name: name.to_owned(), line, received, waiting }
    }

    /// Closes the channel, in case that it is open, sets 1 Mbit/s and opens it.
    fn start(&mut self) -> io::Result<()> {
        self.port.write_all(b"\rC\rS8\rO\r")?;
        self.port.flush()
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn send(&mut self, frame: &CanFrame) -> Taken {
        if self.flush().is_err() {
            return Taken::Failed(ErrorKind::Other);
        }
        if !self.waiting.is_empty() {
            return Taken::Full;
        }
        self.waiting = encode(frame).into_bytes();
        match self.flush() {
            Ok(()) => Taken::Yes,
            Err(_) => Taken::Failed(ErrorKind::Other),
        }
    }

    /// Writes what waits, as far as the port takes it.
    fn flush(&mut self) -> io::Result<()> {
        while !self.waiting.is_empty() {
            match self.port.write(&self.waiting) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(written) => _ = self.waiting.drain(..written.min(self.waiting.len())),
                Err(error) if is_later(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    pub(crate) fn receive(&mut self) -> Option<Heard> {
        loop {
            while let Some(byte) = self.received.pop() {
                // A bell says that the adapter refused a command.
                if byte == 7 {
                    self.line.clear();
                    return Some(Heard::Failed(ErrorKind::Other));
                }
                if byte != b'\r' {
                    self.line.push(byte);
                    self.line.truncate(LONGEST);
                    continue;
                }
                let line = std::mem::take(&mut self.line);
                match decode(&line) {
                    Some(frame) => return Some(Heard::Frame(frame)),
                    // An answer to a command of ours.
                    None if matches!(
                        line.first(),
                        None | Some(b'z' | b'Z' | b'V' | b'N' | b'F')
                    ) => {}
                    None => return Some(Heard::Failed(ErrorKind::Form)),
                }
            }
            let mut bytes = [0; 256];
            match self.port.read(&mut bytes) {
                Ok(0) => return None,
                Ok(count) => self.received.extend(bytes.iter().take(count).rev()),
                Err(error) if is_later(&error) => return None,
                Err(_) => return Some(Heard::Failed(ErrorKind::Other)),
            }
        }
    }
}

fn is_later(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), TimedOut | WouldBlock | Interrupted)
}

/// A frame as the adapter takes it.
fn encode(frame: &CanFrame) -> String {
    let kind = if frame.is_remote_frame() { 'r' } else { 't' };
    let mut line = match frame.id() {
        Id::Standard(id) => format!("{kind}{:03X}", id.as_raw()),
        Id::Extended(id) => format!("{}{:08X}", kind.to_ascii_uppercase(), id.as_raw()),
    };
    line += &frame.dlc().to_string();
    if frame.is_data_frame() {
        frame.data().iter().for_each(|byte| line += &format!("{byte:02X}"));
    }
    line + "\r"
}

/// A line of the adapter without its end; `None` if the line is no frame. Digits of a time may follow the data.
fn decode(line: &[u8]) -> Option<CanFrame> {
    let line = std::str::from_utf8(line).ok()?;
    let (kind, rest) = line.split_at_checked(1)?;
    let digits = if kind.chars().all(char::is_uppercase) { 8 } else { 3 };
    let (id, rest) = rest.split_at_checked(digits)?;
    let id = u32::from_str_radix(id, 16).ok()?;
    let id = match digits {
        8 => Id::from(ExtendedId::new(id)?),
        _ => Id::from(StandardId::new(u16::try_from(id).ok()?)?),
    };
    let (length, rest) = rest.split_at_checked(1)?;
    let length = length.parse().ok().filter(|length| *length <= 8)?;
    match kind {
        "r" | "R" => CanFrame::new_remote(id, length),
        "t" | "T" => {
            let byte =
                |index: usize| u8::from_str_radix(rest.get(2 * index..2 * index + 2)?, 16).ok();
            let data: Option<Vec<u8>> = (0..length).map(byte).collect();
            CanFrame::new(id, &data?)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    fn id(raw: u16) -> StandardId {
        StandardId::new(raw).unwrap()
    }

    /// The lines are those of the manual of the CANUSB by Lawicel, with the commands `t` and `T`.
    #[test]
    fn frames_are_lines_and_lines_are_frames() {
        for (frame, line) in [
            (CanFrame::of(id(0x100), [0x11, 0x33]), "t10021133\r"),
            (CanFrame::of(ExtendedId::new(0x100).unwrap(), [0x11, 0x33]), "T0000010021133\r"),
            (CanFrame::new_remote(id(0x100), 3).unwrap(), "r1003\r"),
            (CanFrame::of(id(0x7FF), []), "t7FF0\r"),
        ] {
            assert_eq!(encode(&frame), line);
            assert_eq!(decode(line.trim_end().as_bytes()), Some(frame));
        }
        assert_eq!(decode(b"t100211336000"), decode(b"t10021133"), "with a time");
        for wrong in
            ["", "t", "t1", "t8001", "t10091", "t100211", "t1002113", "x10021133", "t1002é1"]
        {
            assert_eq!(decode(wrong.as_bytes()), None, "{wrong}");
        }
    }

    /// Gives a byte at a time, and takes nothing in every second call.
    #[derive(Clone, Default)]
    struct Slow(Arc<Mutex<Wire>>);

    /// What is to be read, what was written, and whether it takes a byte now.
    type Wire = (Vec<u8>, Vec<u8>, bool);

    impl Read for Slow {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            let mut inner = self.0.lock().unwrap();
            if inner.0.is_empty() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            bytes[0] = inner.0.remove(0);
            Ok(1)
        }
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut inner = self.0.lock().unwrap();
            inner.2 = !inner.2;
            if !inner.2 {
                return Err(io::ErrorKind::WouldBlock.into());
            }
            inner.1.extend(&bytes[..1]);
            Ok(1)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_slow_port_takes_each_frame_whole_and_refuses_the_next_until_then() {
        let port = Slow::default();
        let mut slcan = Slcan::on("port", Box::new(port.clone()));
        let frame = CanFrame::of(id(0x201), [0xAB]);
        assert_eq!(slcan.send(&frame), Taken::Yes);
        let mut refused = 0;
        while slcan.send(&frame) == Taken::Full {
            refused += 1;
        }
        assert!(refused > 3, "{refused}");
        (0..100).for_each(|_| slcan.flush().unwrap());
        assert_eq!(port.0.lock().unwrap().1, b"t2011AB\rt2011AB\r");
    }

    #[test]
    fn answers_are_no_frames_and_a_bell_is_a_failure() {
        let port = Slow::default();
        port.0.lock().unwrap().0 = b"\rz\rt2011AB\r\x07q\rr2018\r".to_vec();
        let mut slcan = Slcan::on("port", Box::new(port));
        let heard: Vec<_> = std::iter::from_fn(|| slcan.receive()).collect();
        assert_eq!(
            heard,
            [
                Heard::Frame(CanFrame::of(id(0x201), [0xAB])),
                Heard::Failed(ErrorKind::Other),
                Heard::Failed(ErrorKind::Form),
                Heard::Frame(CanFrame::new_remote(id(0x201), 8).unwrap()),
            ]
        );
    }
}
