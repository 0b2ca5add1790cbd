//! What carries the frames: the simulator, an interface of Linux, a serial adapter, or a recording.

mod replay;
mod simulated;
mod slcan;
#[cfg(target_os = "linux")]
mod socket;

pub(crate) use replay::Replay;
pub(crate) use simulated::Simulated;
pub(crate) use slcan::Slcan;
#[cfg(target_os = "linux")]
pub(crate) use socket::Socket;

use drivetrain::frame::CanFrame;
use embedded_can::ErrorKind;

/// What a link received.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Heard {
    /// A frame of another node.
    Frame(CanFrame),
    /// A frame of ours, which was on the bus.
    Own(CanFrame),
    /// An error frame of Linux: its class and its data, and what kind of error that is.
    Error(u32, Vec<u8>, ErrorKind),
    /// Anything else, in the form of candump.
    Foreign(String),
    /// The link itself fails.
    Failed(ErrorKind),
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Taken {
    Yes,
    /// There is no room now.
    Full,
    Failed(ErrorKind),
}

/// What carries the frames.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "one of it in a program")]
pub(crate) enum Link {
    Simulated(Simulated),
    #[cfg(target_os = "linux")]
    Socket(Socket),
    Slcan(Slcan),
    Replay(Replay),
}

impl Link {
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Simulated(_) => "simulator",
            #[cfg(target_os = "linux")]
            Self::Socket(socket) => socket.name(),
            Self::Slcan(slcan) => slcan.name(),
            Self::Replay(replay) => replay.name(),
        }
    }

    /// Tells whether [`Heard::Own`] tells which frames were on the bus.
    pub(crate) fn echoes(&self) -> bool {
        #[cfg(target_os = "linux")]
        if matches!(self, Self::Socket(_)) {
            return true;
        }
        false
    }

    /// How to get rid of what the link may still send.
    pub(crate) fn emptying(&self) -> String {
        match self {
            #[cfg(target_os = "linux")]
            Self::Socket(socket) => {
                format!(
                    "have `ip link set {} down` empty the queue before it is back",
                    socket.name()
                )
            }
            Self::Slcan(_) => {
                "pull out the adapter, which may keep frames, before it is back".into()
            }
            Self::Simulated(_) | Self::Replay(_) => "begin anew".into(),
        }
    }

    /// Tells whether frames can be sent at all.
    pub(crate) fn sends(&self) -> bool {
        !matches!(self, Self::Replay(_))
    }

    pub(crate) fn send(&mut self, frame: &CanFrame) -> Taken {
        match self {
            Self::Simulated(simulated) => simulated.send(frame),
            #[cfg(target_os = "linux")]
            Self::Socket(socket) => socket.send(frame),
            Self::Slcan(slcan) => slcan.send(frame),
            Self::Replay(_) => Taken::Failed(ErrorKind::Other),
        }
    }

    pub(crate) fn receive(&mut self) -> Option<Heard> {
        match self {
            Self::Simulated(simulated) => simulated.receive(),
            #[cfg(target_os = "linux")]
            Self::Socket(socket) => socket.receive(),
            Self::Slcan(slcan) => slcan.receive(),
            Self::Replay(replay) => replay.receive(),
        }
    }
}
