use super::FRAME_LENGTH;

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
    pub(super) const NEUTRAL: Self = Self {
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
    pub(super) fn from_frame(frame: &[u8; FRAME_LENGTH], dead_band: u16) -> Option<Self> {
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

pub(in crate::wire) fn field(bits: u64, first: u32, mask: u16) -> u16 {
    let [low, high, ..] = (bits >> first).to_le_bytes();
    u16::from_le_bytes([low, high]) & mask
}

/// Scales a channel to -1..=1; `None` outside of 364..=1684.
pub(in crate::wire) fn scaled(raw: u16, dead_band: u16) -> Option<f32> {
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
    fn a_stick_in_the_middle_is_zero_with_no_sign() {
        assert_eq!(scaled(CENTRE, 0).map(f32::to_bits), Some(0.0_f32.to_bits()));
    }
}
