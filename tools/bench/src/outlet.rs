//! Lines for somebody who may not read them.

use std::io::{self, BufWriter, Write};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant};

/// What a text is written to, which may have an end of its own.
pub(crate) trait Sink: Write + Send + 'static {
    /// Writes the end.
    ///
    /// # Errors
    /// That of the write.
    fn close(&mut self) -> io::Result<()> {
        self.flush()
    }
}

impl Sink for std::fs::File {}
impl Sink for io::Stdout {}
impl Sink for io::Stderr {}

/// Lines that a thread of its own writes: a reader who reads no more, or a disk that hangs, does not hold up who drives motors.
#[derive(Debug)]
pub(crate) struct Outlet {
    name: String,
    lines: SyncSender<String>,
    writer: JoinHandle<io::Result<()>>,
    lost: u32,
    is_broken: bool,
    /// What [`is_full`](Self::is_full) could not leave yet.
    refused: Option<String>,
}

impl Outlet {
    /// `room` is the number of texts that wait at most; what comes after them is lost.
    ///
    /// # Errors
    /// Where there can be no thread more.
    pub(crate) fn new(name: &str, sink: impl Sink, room: usize) -> io::Result<Self> {
        let (lines, waiting) = sync_channel(room);
        let writer = Builder::new().spawn(|| write(waiting, sink))?;
        let (lost, is_broken, refused) = (0, false, None);
        Ok(Self { name: name.into(), lines, writer, lost, is_broken, refused })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Leaves a text to be written, or loses it where there is no room. Returns whether anybody can still read it.
    pub(crate) fn offer(&mut self, text: String) -> bool {
        match self.lines.try_send(text) {
            Ok(()) => true,
            Err(refused) => {
                self.lost = self.lost.saturating_add(1);
                self.is_broken = matches!(refused, TrySendError::Disconnected(_));
                !self.is_broken
            }
        }
    }

    /// Tells whether there is no room now.
    pub(crate) fn is_full(&mut self) -> bool {
        match self.lines.try_send(self.refused.take().unwrap_or_default()) {
            Err(TrySendError::Full(text)) => {
                self.refused = Some(text);
                true
            }
            Ok(()) | Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// Tells whether a text was offered, and nothing is written any more.
    pub(crate) fn is_broken(&self) -> bool {
        self.is_broken
    }

    /// Texts that were not written.
    pub(crate) fn lost(&self) -> u32 {
        self.lost
    }

    /// Waits, for ever if need be, until all is written and this `text` after it; has `say` say so when that takes a while.
    ///
    /// # Errors
    /// That of the first text that could not be written.
    pub(crate) fn finish(
        self,
        mut text: String,
        mut say: impl FnMut(String),
    ) -> Result<(), String> {
        let Self { name, lines, writer, .. } = self;
        let (begun, mut is_said) = (Instant::now(), false);
        let mut wait = || {
            sleep(Duration::from_millis(5));
            if begun.elapsed() > Duration::from_secs(1) && !std::mem::replace(&mut is_said, true) {
                say(format!("nothing more is sent; waits for {name}, and a signal ends that"));
            }
        };
        // Where the writer is gone, it says why below.
        while let Err(TrySendError::Full(back)) = lines.try_send(text) {
            text = back;
            wait();
        }
        drop(lines);
        while !writer.is_finished() {
            wait();
        }
        let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        written.map_err(|error| format!("{name}: {error}"))
    }
}

fn write(waiting: Receiver<String>, sink: impl Sink) -> io::Result<()> {
    let mut sink = BufWriter::new(sink);
    while let Ok(first) = waiting.recv() {
        sink.write_all(first.as_bytes())?;
        waiting.try_iter().try_for_each(|text| sink.write_all(text.as_bytes()))?;
        sink.flush()?;
    }
    sink.get_mut().close()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Sender, channel};
    use std::sync::{Arc, Mutex};

    /// Says when it is written to, and is held up then.
    struct HeldUp {
        begins: Sender<()>,
        may_go_on: Receiver<()>,
        written: Arc<Mutex<String>>,
    }

    impl Sink for HeldUp {}

    impl Write for HeldUp {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            _ = self.begins.send(());
            _ = self.may_go_on.recv();
            self.written.lock().unwrap().push_str(std::str::from_utf8(bytes).unwrap());
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_finds_no_room_is_lost_and_counted_and_the_rest_is_written_in_order() {
        let (begins, has_begun) = channel();
        let (go_on, may_go_on) = channel();
        let written = Arc::<Mutex<String>>::default();
        let sink = HeldUp { begins, may_go_on, written: Arc::clone(&written) };
        let mut outlet = Outlet::new("a pipe", sink, 2).unwrap();
        assert!(outlet.offer("a".into()));
        has_begun.recv().unwrap();
        for text in ["b", "c", "d", "e"] {
            assert!(outlet.offer(text.into()), "it may still be read");
        }
        assert_eq!(outlet.lost(), 2);
        drop(go_on);
        outlet.finish("f".into(), |_| {}).unwrap();
        assert_eq!(*written.lock().unwrap(), "abcf");
    }

    #[test]
    fn who_can_read_no_more_is_noticed_and_the_reason_is_kept() {
        struct Gone;
        impl Sink for Gone {}
        impl Write for Gone {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut outlet = Outlet::new("a pipe", Gone, 2).unwrap();
        while outlet.offer("a".into()) {
            std::thread::yield_now();
        }
        assert_eq!(outlet.finish("b".into(), |_| {}), Err("a pipe: broken pipe".into()));
    }
}
