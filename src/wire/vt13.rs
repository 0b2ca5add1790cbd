//! The remote control of the video link, VT03 and VT13: sticks, keys and mouse with a checksum.
//!
//! ```text
//! A9 53 | 64 bits | mouse x, y, z i16 | mouse buttons | keys u16 | CRC-16       all little-endian, low bit first
//! bits  0..44  4 channels of 11 bits, 364..=1684, centre 1024     bits 49..60  dial, like a channel
//! bits 44..46  mode switch: 0 C, 1 N, 2 S                         bit  60      trigger
//! bit  46      pause, 47 left button, 48 right button             bits 61..64  spare
//! buttons: left, right, middle of two bits each, 0 or 1; CRC-16/MCRF4XX over all before it, as in the referee system
//! ```
//!
//! | channel | here, by the names of [`dbus`](super::dbus) | in a DR16 frame |
//! |---|---|---|
//! | 0 | `right_x` | the same |
//! | 1 | `right_y` | the same |
//! | 2 | `left_y` | `left_x` |
//! | 3 | `left_x` | `left_y` |
//!
//! Read the line with a [`Receiver`](super::Receiver): when the remote control falls silent its `latest` is `None` and an edge is
//! latched. The serial line is often shared with the [`referee`] system; give the same bytes to both.
//!
//! ```
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::dbus::Keys;
//! use drivetrain::wire::vt13::{DEAD_BAND, FRAME_LENGTH, VideoRemote};
//! use drivetrain::wire::Receiver;
//!
//! let ms = |ms| Instant::START + Duration::from_millis(ms);
//! let mut remote = Receiver::<VideoRemote, FRAME_LENGTH>::with_options(DEAD_BAND, Duration::from_millis(100));
//! let mut received: &[u8] = &[
//!     0xA9, 0x53, 0x94, 0x66, 0x0B, 0x00, 0x29, 0x6D, 0xD9, 0x12, 0xFB, 0xFF, 0x06, 0x00, 0xF9, 0xFF, 0x05, 0x01, 0x80,
//!     0x9B, 0x5D,
//! ];
//! while let Some(shown) = remote.read(&mut received, ms(0)) {
//!     assert_eq!((shown.right_x, shown.right_y, shown.left_y, shown.left_x), (1.0, -1.0, 0.0, 1.0));
//!     assert_eq!(shown.mode.is_at(VideoRemote::S), Some(true));
//!     assert!(shown.keys.contains(Keys::W) && shown.pause);
//! }
//! assert!(remote.latest(ms(100)).is_some());
//! assert!(remote.latest(ms(101)).is_none()); // lost: relax the robot
//! assert!(remote.edge(ms(101)).is_some_and(|heard| !heard.began && heard.at == ms(0)));
//! assert!(remote.edge(ms(101)).is_some_and(|silent| silent.began && silent.at == ms(100)));
//! ```
//!
//! Source: five public drivers agree on every field; three of them name channel 3 the left stick across. Some compute its sign or
//! its order otherwise, and one leaves key C out. **Not known:** a captured frame (the vectors are computed), and the rate of the
//! frames: the drivers use a time-out of 100 ms, one of 500 ms.

use super::dbus::{Keys, Switch, field, scaled};
use super::{Decode, Reader, Reject, referee};

/// The length of a frame in bytes.
pub const FRAME_LENGTH: usize = 21;

/// The usual dead band, the option of the frames: this many of 660 counts around the centre are zero.
pub const DEAD_BAND: u16 = 10;

/// State of the remote control of the video link.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VideoRemote {
    /// The right stick across, -1 to 1, zero within the dead band: right is positive.
    pub right_x: f32,
    /// The right stick along, the same: away from the person is positive.
    pub right_y: f32,
    /// The left stick across, the same: right is positive.
    pub left_x: f32,
    /// The left stick along, the same: away from the person is positive.
    pub left_y: f32,
    /// The dial, -1 to 1. The sources do not state the positive direction.
    pub dial: f32,
    /// The mode switch: [`C`](Self::C), [`N`](Self::N) or [`S`](Self::S), the letters printed beside it.
    pub mode: Switch,
    /// Whether the pause button is down.
    pub pause: bool,
    /// Whether the left of the two buttons to be assigned is down (`fn_1`).
    pub button_left: bool,
    /// Whether the right of the two buttons to be assigned is down (`fn_2`).
    pub button_right: bool,
    /// Whether the trigger is pulled.
    pub trigger: bool,
    /// Counts of the client's mouse since the last frame: right is positive.
    pub mouse_x: i16,
    /// The same: towards the person is positive.
    pub mouse_y: i16,
    /// The same of the wheel.
    pub mouse_z: i16,
    /// Whether the left button of the mouse is down.
    pub mouse_left: bool,
    /// Whether the right button of the mouse is down.
    pub mouse_right: bool,
    /// Whether the middle button of the mouse is down.
    pub mouse_middle: bool,
    /// The keyboard of the client.
    pub keys: Keys,
}

impl VideoRemote {
    /// The mode switch at C, at one end.
    pub const C: Switch = Switch::Up;
    /// The mode switch at N, in the middle.
    pub const N: Switch = Switch::Middle;
    /// The mode switch at S, at the other end.
    pub const S: Switch = Switch::Down;

    fn read(mut fields: Reader<'_>, dead_band: u16) -> Option<Self> {
        let _header: [u8; 2] = fields.take()?;
        let bits = u64::from_le_bytes(fields.take()?);
        let channel = |first: u32| scaled(field(bits, first, 0x7FF), dead_band);
        let button = |place: u32| field(bits, place, 1) == 1;
        let [mouse_x, mouse_y, mouse_z] = fields.array(Reader::i16_le)?;
        let buttons = u64::from(fields.u8()?);
        Some(Self {
            right_x: channel(0)?,
            right_y: channel(11)?,
            left_y: channel(22)?,
            left_x: channel(33)?,
            dial: channel(49)?,
            mode: match field(bits, 44, 3) {
                0 => Self::C,
                1 => Self::N,
                2 => Self::S,
                _ => return None,
            },
            pause: button(46),
            button_left: button(47),
            button_right: button(48),
            trigger: button(60),
            mouse_x,
            mouse_y,
            mouse_z,
            mouse_left: pressed(buttons, 0)?,
            mouse_right: pressed(buttons, 2)?,
            mouse_middle: pressed(buttons, 4)?,
            keys: Keys(fields.u16_le()?),
        })
    }
}

/// A button of the mouse: two bits, with two known values.
fn pressed(buttons: u64, place: u32) -> Option<bool> {
    match field(buttons, place, 3) {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}

impl Decode for VideoRemote {
    /// The dead band in counts, 0 to 659.
    type Options = u16;
    const PREFIX: usize = 2;

    fn header(_: &u16) -> &[u8] {
        &[0xA9, 0x53]
    }

    fn length(_: &u16, _prefix: &[u8]) -> Option<usize> {
        Some(FRAME_LENGTH)
    }

    fn decode(dead_band: &u16, frame: &[u8]) -> Result<Self, Reject> {
        let body = referee::checked(frame)?;
        Self::read(Reader(body), (*dead_band).min(659)).ok_or(Reject::Content)
    }
}
