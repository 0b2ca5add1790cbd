//! DBUS: the output of a DR16 receiver of a remote control. 100000 baud, 8 data bits, even parity, inverted.
//!
//! ```text
//! bits 0..44   4 channels of 11 bits, 364..=1684, centre 1024      bytes  6..12  mouse x, y, z i16
//! bits 44..46  right switch: 1 up, 2 down, 3 middle                bytes 12, 13  mouse buttons: 0 or 1
//! bits 46..48  left switch                                         bytes 14..16  keys
//! all low byte, low bit first                                      bytes 16..18  dial like a channel, 0: none
//! ```
//!
//! A frame has neither header nor checksum. The pause before a frame marks its start (18 bytes take 2.2 ms, one frame
//! comes every 14 ms), and a frame counts only if every field has a possible value. A refused frame is not used in
//! part: the state is neutral at once, until the next good frame.
//!
//! ```
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::dbus::{Dbus, Keys, Remote, Switch};
//!
//! let mut dbus = Dbus::new();
//! let now = Instant::START;
//! let mut received: &[u8] =
//!     &[0x94, 0x66, 0x0B, 0xA5, 0xD9, 0x92, 0, 0, 0, 0, 0, 0, 0, 0, 0x10, 0, 0, 0];
//! while let Some(remote) = dbus.read(&mut received, now) {
//!     assert_eq!((remote.right_x, remote.right_y), (1.0, -1.0));
//!     assert_eq!(remote.right_switch, Switch::Up);
//!     assert!(remote.keys.contains(Keys::SHIFT));
//! }
//! let later = now + Duration::from_millis(101);
//! assert_eq!(dbus.remote(later), Remote::default()); // lost: neutral
//! ```
//!
//! Call [`read`](Dbus::read) with every portion of bytes soon after its arrival, at least every 2 ms, or from the
//! interrupt of the serial port in a pause: in a late portion of several frames, the pauses between them are lost. The
//! frames are still read, but noise between them shows only by its values.
//!
//! Source: taproot (GPL, facts only), librm; a public dump. Older headers, made after the first manual, put Q, E, Shift and
//! Ctrl into bits 4 to 7 of the keys.

pub(super) mod remote;

pub use remote::{Keys, Remote, Switch};

use super::deadline::Deadline;
use super::deframer::count;
use super::{Counts, Silence};
use crate::time::{ConditionEdge, Duration, Instant};

/// The length of a frame in bytes.
pub const FRAME_LENGTH: usize = 18;

/// A streaming decoder of DBUS, with supervision of the signal.
#[derive(Debug, Clone)]
pub struct Dbus {
    pause: Duration,
    dead_band: u16,
    buffer: [u8; FRAME_LENGTH],
    length: usize,
    /// Out of step after an implausible frame: nothing counts before the next pause.
    lost_step: bool,
    last_byte: Option<Instant>,
    latest: Remote,
    deadline: Deadline,
    counts: Counts,
}

impl Default for Dbus {
    fn default() -> Self {
        Self::new()
    }
}

impl Dbus {
    /// A pause is 3 ms, the signal is lost after 100 ms, the dead band is 10 of 660 counts.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            pause: Duration::from_millis(3),
            dead_band: 10,
            buffer: [0; FRAME_LENGTH],
            length: 0,
            lost_step: false,
            last_byte: None,
            latest: Remote::NEUTRAL,
            deadline: Deadline::new(Duration::from_millis(100)),
            counts: Counts::new(),
        }
    }

    /// Sets the silence between two frames. The silence must be longer than the time between two calls of
    /// [`read`](Self::read) within a frame, and shorter than the pause of the receiver (11.8 ms; 4.8 ms for a receiver
    /// with a frame every 7 ms).
    #[must_use]
    pub const fn with_pause(self, pause: Duration) -> Self {
        Self { pause, ..self }
    }

    /// Sets the silence after which the signal is lost.
    #[must_use]
    pub const fn with_deadline(self, deadline: Duration) -> Self {
        Self { deadline: Deadline::new(deadline), ..self }
    }

    /// Sets how many counts around the centre are zero: 0 to 659. Beyond, the value begins at zero and reaches ±1 at
    /// ±660 counts.
    #[must_use]
    pub const fn with_dead_band(self, counts: u16) -> Self {
        Self { dead_band: if counts < 659 { counts } else { 659 }, ..self }
    }

    /// Returns the next frame, and removes the bytes read from `input`; `now` is their time of arrival. `None` when
    /// `input` is used up.
    ///
    /// Costs 473 instructions on a Cortex-M4F, for a frame of 18 bytes (`docs/figures.md`).
    #[must_use]
    pub fn read(&mut self, input: &mut &[u8], now: Instant) -> Option<Remote> {
        if input.is_empty() {
            return None;
        }
        if self.last_byte.is_some_and(|last| now.since(last) >= self.pause) {
            self.note_pause();
        }
        self.last_byte = Some(now);
        while let Some((byte, rest)) = input.split_first() {
            *input = rest;
            let place = self.buffer.get_mut(self.length).filter(|_| !self.lost_step);
            let Some(place) = place else {
                count(&mut self.counts.skipped_bytes, 1);
                continue;
            };
            *place = *byte;
            self.length += 1;
            if self.length == FRAME_LENGTH {
                self.length = 0;
                if let Some(remote) = self.judge(now) {
                    return Some(remote);
                }
            }
        }
        None
    }

    /// Notes a silence of the line: the next byte begins a frame.
    ///
    /// For the idle interrupt of a serial port. Without it, [`read`](Self::read) detects a pause by its time.
    pub fn note_pause(&mut self) {
        if self.length > 0 {
            count(&mut self.counts.length_errors, 1);
            count(&mut self.counts.skipped_bytes, u32::try_from(self.length).unwrap_or(u32::MAX));
        }
        self.length = 0;
        self.lost_step = false;
    }

    /// Returns the state of the remote control; neutral before the first frame, when the signal is lost, and after an
    /// implausible frame.
    #[must_use]
    pub fn remote(&self, now: Instant) -> Remote {
        if self.is_live(now) { self.latest } else { Remote::NEUTRAL }
    }

    /// Returns whether the last frame was good and came in time.
    #[must_use]
    pub fn is_live(&self, now: Instant) -> bool {
        self.deadline.is_live(now)
    }

    /// Returns the oldest unread beginning or end of silence.
    #[must_use]
    pub fn edge(&mut self, now: Instant) -> Option<ConditionEdge<Silence>> {
        self.deadline.edge(now)
    }

    /// Returns the counts of frames and of discarded bytes.
    ///
    /// A content error is a frame with an impossible value in a field; a length error is a frame that ended early: less than
    /// 18 bytes before a pause. There are no other errors, because a frame has no checksum.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    fn judge(&mut self, now: Instant) -> Option<Remote> {
        let remote = Remote::from_frame(&self.buffer, self.dead_band);
        match remote {
            Some(remote) => {
                count(&mut self.counts.frames, 1);
                self.latest = remote;
                self.deadline.meet(now);
            }
            None => {
                count(&mut self.counts.content_errors, 1);
                self.lost_step = true;
                self.deadline.revoke(now);
            }
        }
        remote
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [u8; FRAME_LENGTH] =
        [0x94, 0x66, 0x0B, 0xA5, 0xD9, 0x92, 0, 0, 0, 0, 0, 0, 0, 0, 0x10, 0, 0, 0];

    fn ms(ms: u64) -> Instant {
        Instant::START + Duration::from_millis(ms)
    }

    #[test]
    fn a_pause_between_two_whole_frames_cuts_nothing_off() {
        let mut dbus = Dbus::new();
        for at in [0, 14, 28] {
            assert!(dbus.read(&mut &FRAME[..], ms(at)).is_some());
        }
        assert_eq!(dbus.counts(), Counts { frames: 3, ..Counts::default() });
    }

    #[test]
    fn the_pause_that_separates_two_frames_can_be_set() {
        let mut dbus = Dbus::new().with_pause(Duration::from_millis(6));
        assert_eq!(dbus.read(&mut &FRAME[..9], ms(0)), None);
        assert!(dbus.read(&mut &FRAME[9..], ms(5)).is_some()); // 3 ms would have cut it
        assert_eq!(dbus.read(&mut &FRAME[..9], ms(20)), None);
        assert_eq!(dbus.read(&mut &FRAME[9..], ms(26)), None);
        assert_eq!(dbus.counts().length_errors, 1);
    }

    #[test]
    fn the_silence_after_which_the_signal_is_lost_can_be_set() {
        let mut dbus = Dbus::new().with_deadline(Duration::from_millis(300));
        assert!(dbus.read(&mut &FRAME[..], ms(0)).is_some());
        assert!(dbus.is_live(ms(299)) && !dbus.is_live(ms(301)));
    }
}
