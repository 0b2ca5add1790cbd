//! A SocketCAN socket as the crate wants a driver.

use crate::options::Options;
use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Frame, Socket, SocketOptions};
use std::fs::File;
use std::io::{self, BufWriter, Write};

/// A SocketCAN socket as the crate wants a driver.
///
/// The socket's own implementation of `embedded-can` takes a full queue (`ENOBUFS`) for a failure; here it is a refusal,
/// and the newest command is offered again. It also writes the log.
pub(crate) struct Adapter {
    socket: CanSocket,
    interface: String,
    log: Option<BufWriter<File>>,
    start: std::time::Instant,
}

impl Adapter {
    pub(crate) fn open(options: &Options, log: Option<File>) -> io::Result<Self> {
        let socket = CanSocket::open(&options.interface)?;
        socket.set_nonblocking(true)?;
        // Bus errors are counted by kind.
        socket.set_error_filter_accept_all()?;
        let log = log.map(BufWriter::new);
        let start = std::time::Instant::now();
        Ok(Self { socket, interface: options.interface.clone(), log, start })
    }

    /// Writes what the log still keeps back.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.log.as_mut().map_or(Ok(()), Write::flush)
    }

    /// The form of `candump -L`.
    fn record(&mut self, frame: &CanFrame) -> io::Result<()> {
        let Some(log) = &mut self.log else { return Ok(()) };
        write!(log, "({:.6}) {} ", self.start.elapsed().as_secs_f64(), self.interface)?;
        match frame {
            CanFrame::Error(_) => write!(log, "{:08X}#", frame.id_word())?,
            _ if frame.is_extended() => write!(log, "{:08X}#", frame.raw_id())?,
            _ => write!(log, "{:03X}#", frame.raw_id())?,
        }
        if frame.is_remote_frame() {
            return match frame.dlc() {
                0 => writeln!(log, "R"),
                length => writeln!(log, "R{length}"),
            };
        }
        frame.data().iter().try_for_each(|byte| write!(log, "{byte:02X}"))?;
        writeln!(log)
    }
}

impl embedded_can::nb::Can for Adapter {
    type Frame = CanFrame;
    type Error = socketcan::Error;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, socketcan::Error> {
        const ENOBUFS: i32 = 105;
        match self.socket.write_frame(frame) {
            Ok(()) => {
                self.record(frame).map_err(socketcan::Error::from)?;
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
        self.record(&frame).map_err(socketcan::Error::from)?;
        match frame {
            CanFrame::Error(frame) => Err(nb::Error::Other(frame.into())),
            frame => Ok(frame),
        }
    }
}
