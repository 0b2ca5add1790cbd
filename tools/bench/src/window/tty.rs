//! The terminal, watched for its end.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

/// The terminal that the keys come from. crossterm's `poll` and `read` never return once it is gone: crossterm 0.29 repeats a
/// read that ends at once (issue 793 of crossterm), so a thread without crossterm watches it.
#[derive(Debug)]
pub(super) struct Tty(OwnedFd);

impl Tty {
    /// Takes standard input, or `/dev/tty` if standard input is no terminal, as crossterm does.
    ///
    /// # Errors
    /// The system's error if the process has no terminal.
    pub(super) fn open() -> io::Result<Self> {
        let input = io::stdin();
        let tty = if input.is_terminal() {
            input.as_fd().try_clone_to_owned()?
        } else {
            File::options().read(true).write(true).open("/dev/tty")?.into()
        };
        Ok(Self(tty))
    }

    /// Waits at most so long for the end of the terminal, and tells whether it has ended.
    pub(super) fn is_gone(&self, wait: Duration) -> bool {
        // Without a flag that is asked for, the system reports POLLHUP and POLLERR alone.
        let mut tty = [PollFd::new(&self.0, PollFlags::empty())];
        let wait = Timespec { tv_sec: 0, tv_nsec: wait.subsec_nanos().into() };
        // An interrupting signal is looked at by the caller.
        if poll(&mut tty, Some(&wait)).is_err() {
            return false;
        }
        let [tty] = tty;
        tty.revents().intersects(PollFlags::HUP | PollFlags::ERR)
    }
}
