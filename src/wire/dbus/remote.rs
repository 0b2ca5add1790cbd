use super::FRAME_LENGTH;

/// The channels' raw value at rest.
const CENTRE: u16 = 1024;
/// The channels' largest distance from the centre.
const SPAN: u16 = 660;

/// What a remote control shows. The default is neutral: nothing moved, nothing pressed, switches absent.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Remote {
    /// The right stick.
    pub right: Stick,
    /// The left stick.
    pub left: Stick,
    /// The dial at the corner: -1 to 1; 0 from receivers that do not send it.
    pub dial: f32,
    /// The switch above the right stick.
    pub right_switch: Switch,
    /// The switch above the left stick.
    pub left_switch: Switch,
    /// The mouse of the computer that the remote control is plugged into.
    pub mouse: Mouse,
    /// The keyboard of that computer.
    pub keys: Keys,
}

/// The two channels of a stick, -1 to 1, zero within the dead band.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stick {
    /// Right is positive.
    pub x: f32,
    /// Away from the person is positive.
    pub y: f32,
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

/// The mouse: counts moved since the last frame, and its buttons.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Mouse {
    /// Right is positive.
    pub x: i16,
    /// Towards the person is positive.
    pub y: i16,
    /// The wheel.
    pub z: i16,
    /// Whether the left button is down.
    pub left: bool,
    /// Whether the right button is down.
    pub right: bool,
}

/// The keys that are down.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Keys(
    /// One bit a key, as it came.
    pub u16,
);

/// A key of the keyboard, by its bit.
#[expect(missing_docs, reason = "the names are those on the keys")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Key {
    W,
    S,
    A,
    D,
    Shift,
    Ctrl,
    Q,
    E,
    R,
    F,
    G,
    Z,
    X,
    C,
    V,
    B,
}

impl Keys {
    /// Returns whether `key` is down.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::wire::dbus::{Key, Keys};
    ///
    /// assert!(Keys(0b10_0001).is_pressed(Key::W) && Keys(0b10_0001).is_pressed(Key::Ctrl));
    /// ```
    #[must_use]
    pub const fn is_pressed(self, key: Key) -> bool {
        self.0 >> key as u16 & 1 != 0
    }
}

impl Remote {
    /// Nothing moved, nothing pressed, switches absent.
    pub(super) const NEUTRAL: Self = Self {
        right: Stick { x: 0.0, y: 0.0 },
        left: Stick { x: 0.0, y: 0.0 },
        dial: 0.0,
        right_switch: Switch::Absent,
        left_switch: Switch::Absent,
        mouse: Mouse { x: 0, y: 0, z: 0, left: false, right: false },
        keys: Keys(0),
    };

    /// Reads a frame; `None` when one of its fields has a value that it cannot have.
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
            right: Stick { x: channel(0)?, y: channel(11)? },
            left: Stick { x: channel(22)?, y: channel(33)? },
            dial,
            right_switch: switch(field(bits, 44, 3))?,
            left_switch: switch(field(bits, 46, 3))?,
            mouse: Mouse {
                x: i16::from_le_bytes([x0, x1]),
                y: i16::from_le_bytes([y0, y1]),
                z: i16::from_le_bytes([z0, z1]),
                left: button(l)?,
                right: button(r)?,
            },
            keys: Keys(u16::from_le_bytes([k0, k1])),
        })
    }
}

fn field(bits: u64, first: u32, mask: u16) -> u16 {
    let [low, high, ..] = (bits >> first).to_le_bytes();
    u16::from_le_bytes([low, high]) & mask
}

/// Scales a channel to -1..=1; `None` outside of 364..=1684.
fn scaled(raw: u16, dead_band: u16) -> Option<f32> {
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
        use Key::{A, B, C, Ctrl, D, E, F, G, Q, R, S, Shift, V, W, X, Z};
        for (bit, key) in [W, S, A, D, Shift, Ctrl, Q, E, R, F, G, Z, X, C, V, B].iter().enumerate()
        {
            assert!(Keys(1 << bit).is_pressed(*key), "{key:?} is bit {bit}");
            assert!(!Keys(!(1 << bit)).is_pressed(*key), "{key:?} has no other bit");
        }
    }

    #[test]
    fn a_stick_in_the_middle_is_zero_with_no_sign() {
        assert_eq!(scaled(CENTRE, 0).map(f32::to_bits), Some(0.0_f32.to_bits()));
    }
}
