//! Lines for somebody who may not read them.

use std::io::{self, BufWriter, Write};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{JoinHandle, spawn};

/// Lines that a thread of its own writes: a reader who reads no more, or a disk that hangs, does not hold up who drives motors.
pub(crate) struct Outlet {
    lines: SyncSender<String>,
    writer: JoinHandle<io::Result<()>>,
    lost: u32,
}

impl Outlet {
    /// `room` is the number of texts that wait at most; what comes after them is lost.
    pub(crate) fn new(sink: impl Write + Send + 'static, room: usize) -> Self {
        let (lines, waiting) = sync_channel(room);
        Self { lines, writer: spawn(|| write(waiting, BufWriter::new(sink))), lost: 0 }
    }

    /// Leaves a text to be written, or loses it where there is no room. Returns whether anybody can still read it.
    pub(crate) fn offer(&mut self, text: String) -> bool {
        match self.lines.try_send(text) {
            Ok(()) => true,
            Err(refused) => {
                self.lost = self.lost.saturating_add(1);
                matches!(refused, TrySendError::Full(_))
            }
        }
    }

    /// Texts that were not written.
    pub(crate) fn lost(&self) -> u32 {
        self.lost
    }

    /// Waits, for ever if need be, until all is written and this `text` after it.
    ///
    /// # Errors
    /// That of the first text that could not be written.
    pub(crate) fn finish(self, text: String) -> io::Result<()> {
        let Self { lines, writer, .. } = self;
        // Where the writer is gone, it says why below.
        _ = lines.send(text);
        drop(lines);
        writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

fn write(waiting: Receiver<String>, mut sink: impl Write) -> io::Result<()> {
    while let Ok(first) = waiting.recv() {
        sink.write_all(first.as_bytes())?;
        waiting.try_iter().try_for_each(|text| sink.write_all(text.as_bytes()))?;
        sink.flush()?;
    }
    Ok(())
}
