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

use super::Counts;
use super::deframer::count;
use super::receiver::Deadline;
use crate::time::{Duration, Edge, Instant};

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
    /// Costs 481 instructions on a Cortex-M4F, for a frame of 18 bytes (`docs/figures.md`).
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
    pub fn edge(&mut self, now: Instant) -> Option<Edge<&'static str>> {
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

/// The channels' raw value at rest.
const CENTRE: u16 = 1024;
/// The channels' largest distance from the centre.
const SPAN: u16 = 660;

/// State of a remote control. The default is neutral: nothing moved, nothing pressed, switches absent.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Remote {
    /// The right stick across, -1 to 1, zero within the dead band: right is positive.
    pub right_x: f32,
    /// The right stick along, the same: away from the person is positive.
    pub right_y: f32,
    /// The left stick across, the same: right is positive.
    pub left_x: f32,
    /// The left stick along, the same: away from the person is positive.
    pub left_y: f32,
    /// The dial at the corner: -1 to 1; 0 from receivers without the dial.
    pub dial: f32,
    /// The switch above the right stick.
    pub right_switch: Switch,
    /// The switch above the left stick.
    pub left_switch: Switch,
    /// Counts of the mouse since the last frame, at the computer of the remote control: right is positive.
    pub mouse_x: i16,
    /// The same: towards the person is positive.
    pub mouse_y: i16,
    /// The same of the wheel.
    pub mouse_z: i16,
    /// Whether the left button of the mouse is down.
    pub mouse_left: bool,
    /// Whether the right button of the mouse is down.
    pub mouse_right: bool,
    /// The keyboard of the same computer.
    pub keys: Keys,
}

/// The position of a switch.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Switch {
    /// There is no signal. No frame says so.
    #[default]
    Absent,
    /// Towards the antenna.
    Up,
    /// Towards the person.
    Down,
    /// Between them.
    Middle,
}

impl Switch {
    /// Tells whether the switch is at a position; `None` without a signal.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::wire::dbus::Switch;
    ///
    /// assert_eq!(Switch::Middle.is_at(Switch::Up), Some(false));
    /// assert_eq!(Switch::Absent.is_at(Switch::Up), None);
    /// ```
    #[must_use]
    pub fn is_at(self, position: Self) -> Option<bool> {
        (self != Self::Absent).then_some(self == position)
    }
}

/// The pressed keys, one bit a key, as received.
///
/// # Examples
/// ```
/// use drivetrain::wire::dbus::Keys;
///
/// let down = Keys(0b10_0001);
/// assert!(down.contains(Keys::W) && down.contains(Keys::CTRL));
/// assert!(!down.contains(Keys::A));
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Keys(
    /// Bit 0 is W, bit 15 is B.
    pub u16,
);

#[expect(missing_docs, reason = "the names are those on the keys")]
impl Keys {
    pub const W: Self = Self(1 << 0);
    pub const S: Self = Self(1 << 1);
    pub const A: Self = Self(1 << 2);
    pub const D: Self = Self(1 << 3);
    pub const SHIFT: Self = Self(1 << 4);
    pub const CTRL: Self = Self(1 << 5);
    pub const Q: Self = Self(1 << 6);
    pub const E: Self = Self(1 << 7);
    pub const R: Self = Self(1 << 8);
    pub const F: Self = Self(1 << 9);
    pub const G: Self = Self(1 << 10);
    pub const Z: Self = Self(1 << 11);
    pub const X: Self = Self(1 << 12);
    pub const C: Self = Self(1 << 13);
    pub const V: Self = Self(1 << 14);
    pub const B: Self = Self(1 << 15);
}

impl Keys {
    /// Returns whether all keys of `keys` are down.
    #[must_use]
    pub const fn contains(self, keys: Self) -> bool {
        self.0 & keys.0 == keys.0
    }
}

impl Remote {
    /// Nothing moved, nothing pressed, switches absent.
    const NEUTRAL: Self = Self {
        right_x: 0.0,
        right_y: 0.0,
        left_x: 0.0,
        left_y: 0.0,
        dial: 0.0,
        right_switch: Switch::Absent,
        left_switch: Switch::Absent,
        mouse_x: 0,
        mouse_y: 0,
        mouse_z: 0,
        mouse_left: false,
        mouse_right: false,
        keys: Keys(0),
    };

    /// Reads a frame; `None` when a field has an impossible value.
    fn from_frame(frame: &[u8; FRAME_LENGTH], dead_band: u16) -> Option<Self> {
        let [c0, c1, c2, c3, c4, c5, mouse @ .., l, r, k0, k1, d0, d1] = *frame;
        let [x0, x1, y0, y1, z0, z1] = mouse;
        let bits = u64::from_le_bytes([c0, c1, c2, c3, c4, c5, 0, 0]);
        let channel = |first: u32| scaled(field(bits, first, 0x7FF), dead_band);
        let dial = match u16::from_le_bytes([d0, d1]) {
            0 => 0.0, // a receiver without a dial
            raw => scaled(raw, dead_band)?,
        };
        Some(Self {
            right_x: channel(0)?,
            right_y: channel(11)?,
            left_x: channel(22)?,
            left_y: channel(33)?,
            dial,
            right_switch: switch(field(bits, 44, 3))?,
            left_switch: switch(field(bits, 46, 3))?,
            mouse_x: i16::from_le_bytes([x0, x1]),
            mouse_y: i16::from_le_bytes([y0, y1]),
            mouse_z: i16::from_le_bytes([z0, z1]),
            mouse_left: button(l)?,
            mouse_right: button(r)?,
            keys: Keys(u16::from_le_bytes([k0, k1])),
        })
    }
}

pub(super) fn field(bits: u64, first: u32, mask: u16) -> u16 {
    let [low, high, ..] = (bits >> first).to_le_bytes();
    u16::from_le_bytes([low, high]) & mask
}

/// Scales a channel to -1..=1; `None` outside of 364..=1684.
pub(super) fn scaled(raw: u16, dead_band: u16) -> Option<f32> {
    let distance = raw.abs_diff(CENTRE);
    if distance > SPAN {
        return None;
    }
    let beyond =
        f32::from(distance.saturating_sub(dead_band)) / f32::from(SPAN - dead_band.min(659));
    Some(if raw < CENTRE { -beyond } else { beyond })
}

const fn switch(raw: u16) -> Option<Switch> {
    match raw {
        1 => Some(Switch::Up),
        2 => Some(Switch::Down),
        3 => Some(Switch::Middle),
        _ => None,
    }
}

const fn button(raw: u8) -> Option<bool> {
    match raw {
        0 => Some(false),
        1 => Some(true),
        _ => None,
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

    #[test]
    fn a_key_is_its_own_bit_and_no_other() {
        let keys = [
            Keys::W,
            Keys::S,
            Keys::A,
            Keys::D,
            Keys::SHIFT,
            Keys::CTRL,
            Keys::Q,
            Keys::E,
            Keys::R,
            Keys::F,
            Keys::G,
            Keys::Z,
            Keys::X,
            Keys::C,
            Keys::V,
            Keys::B,
        ];
        for (bit, key) in keys.into_iter().enumerate() {
            assert!(Keys(1 << bit).contains(key), "{key:?} is bit {bit}");
            assert!(!Keys(!(1 << bit)).contains(key), "{key:?} has no other bit");
        }
    }

    #[test]
    fn a_switch_is_at_one_position_and_at_none_without_a_signal() {
        let positions = [Switch::Up, Switch::Middle, Switch::Down];
        for switch in positions {
            for position in positions {
                assert_eq!(switch.is_at(position), Some(switch == position));
            }
        }
        assert_eq!(positions.map(|position| Switch::Absent.is_at(position)), [None; 3]);
    }

    #[test]
    fn a_stick_in_the_middle_is_zero_with_no_sign() {
        assert_eq!(scaled(CENTRE, 0).map(f32::to_bits), Some(0.0_f32.to_bits()));
    }
}
