//! A SocketCAN socket as the crate wants a driver.

use crate::options::Options;
use crate::outlet::Outlet;
use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Frame, Socket, SocketOptions};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;

/// Frames that wait for the disk: seven seconds of 8-byte frames with nothing between them.
const LOG_ROOM: usize = 1 << 16;

/// A SocketCAN socket as the crate wants a driver.
///
/// The socket's own implementation of `embedded-can` takes a full queue (`ENOBUFS`) for a failure; here it is a refusal,
/// and the newest command is offered again. It also writes the log.
pub(crate) struct Adapter {
    socket: CanSocket,
    interface: String,
    log: Option<Outlet>,
    /// By id: whether the last command that the interface took asks for anything.
    standing: BTreeMap<u32, bool>,
    start: std::time::Instant,
}

impl Adapter {
    pub(crate) fn open(options: &Options, log: Option<File>) -> io::Result<Self> {
        let socket = CanSocket::open(&options.interface)?;
        socket.set_nonblocking(true)?;
        // Bus errors are counted by kind.
        socket.set_error_filter_accept_all()?;
        let log = log.map(|file| Outlet::new("--log", file, LOG_ROOM)).transpose()?;
        let (interface, start) = (options.interface.clone(), std::time::Instant::now());
        Ok(Self { socket, interface, log, standing: BTreeMap::new(), start })
    }

    /// Tells whether the interface took a zero after whatever else it took, for every motor.
    pub(crate) fn is_at_zero(&self) -> bool {
        !self.standing.values().any(|asks| *asks)
    }

    /// Waits until the log is written; has `say` say so when that takes a while.
    ///
    /// # Errors
    /// Where a part of it is missing.
    pub(crate) fn finish(self, say: impl FnMut(String)) -> Result<(), String> {
        let Some(log) = self.log else { return Ok(()) };
        let lost = log.lost();
        log.finish(String::new(), say)?;
        if lost == 0 { Ok(()) } else { Err(format!("--log: {lost} frames came too fast for it")) }
    }

    fn record(&mut self, frame: &CanFrame) {
        let Some(log) = &mut self.log else { return };
        let seconds = self.start.elapsed().as_secs_f64();
        // What is lost is said at the end.
        _ = log.offer(format!("({seconds:.6}) {} {}\n", self.interface, text_of(frame)));
    }
}

/// A frame in the form of `candump -L`.
fn text_of(frame: &CanFrame) -> String {
    let id = match frame {
        CanFrame::Error(_) => format!("{:08X}", frame.id_word()),
        _ if frame.is_extended() => format!("{:08X}", frame.raw_id()),
        _ => format!("{:03X}", frame.raw_id()),
    };
    match frame.dlc() {
        0 if frame.is_remote_frame() => format!("{id}#R"),
        length if frame.is_remote_frame() => format!("{id}#R{length}"),
        _ => frame.data().iter().fold(id + "#", |text, byte| format!("{text}{byte:02X}")),
    }
}

impl embedded_can::nb::Can for Adapter {
    type Frame = CanFrame;
    type Error = socketcan::Error;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, socketcan::Error> {
        const ENOBUFS: i32 = 105;
        match self.socket.write_frame(frame) {
            Ok(()) => {
                let asks = frame.data().iter().any(|byte| *byte != 0);
                self.standing.insert(frame.raw_id(), asks);
                self.record(frame);
                Ok(None)
            }
            Err(error) if error.raw_os_error() == Some(ENOBUFS) => Err(nb::Error::WouldBlock),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Err(nb::Error::WouldBlock),
            Err(error) => Err(nb::Error::Other(error.into())),
        }
    }

    fn receive(&mut self) -> nb::Result<CanFrame, socketcan::Error> {
        let frame = match self.socket.read_frame() {
            Ok(frame) => frame,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                return Err(nb::Error::WouldBlock);
            }
            Err(error) => return Err(nb::Error::Other(error.into())),
        };
        self.record(&frame);
        match frame {
            CanFrame::Error(frame) => Err(nb::Error::Other(frame.into())),
            frame => Ok(frame),
        }
    }
}
