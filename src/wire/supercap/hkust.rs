//! The controller of HKUST Enterprize, firmware of 2024.
//!
//! ```text
//! 0x061 to it    flags (bit 0 on, bit 1 restart), u16 limit in W, u16 buffer in J, 3 spare      little-endian, 8 bytes
//! 0x051 from it  errors (bit 7 output off), f32 power of the chassis in W, u16 limit of the chassis in W, energy / 255
//! ```
//!
//! | bit of the errors | meaning |
//! |---|---|
//! | 0, 1 | voltage too low, too high |
//! | 2 | fault of the converter |
//! | 3 | short circuit |
//! | 4 | too hot |
//! | 5 | no supply |
//! | 6 | fault of the capacitor |
//!
//! * The energy is the square of the capacitor's voltage over the square of its highest voltage (28.8 V).
//! * After an error with a permanent switch-off, the output comes back when bit 0 was seen cleared and set again.
//! * The controller raises a limit below 30 W to 30 W, and switches itself off at a limit above 250 W.
//!
//! Source: `hkustenterprize/RM2024-SuperCapacitorController`, `Communication.cpp`, `PowerManager.cpp`, `Config.hpp` (facts only).
//! **Not known:** the frame of a later firmware. Drivers of 2025 read the powers as two integers at the same id, and nothing in
//! the frame names its firmware; a frame of it is refused here only if its power is impossible.

use crate::frame::CanFrame;

/// The usual id of the frame to the controller.
pub const COMMAND_ID: u16 = 0x061;

/// The usual id of the frame from the controller.
pub const STATE_ID: u16 = 0x051;

/// The limits between which the firmware takes a limit unchanged, in W.
const LIMITS_W: (u16, u16) = (30, 250);

/// A larger power of the chassis is impossible, in W: the controller is built for 22.5 A at 28.8 V.
const MOST_W: f32 = 2_000.0;

/// State reported by the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct HkustState {
    /// The errors, bits 0 to 6.
    pub errors: u8,
    /// Whether the output is on: the capacitor is charged and discharged.
    pub is_on: bool,
    /// Power taken by the chassis, in W; below zero while the chassis feeds back.
    pub chassis_w: f32,
    /// Power available from the controller for the chassis, in W.
    pub chassis_limit_w: u16,
    /// Share of the energy of a full capacitor, 0 to 1, from zero volts on.
    pub share: f32,
}

impl HkustState {
    /// Returns the share of the energy while the capacitor can be used: the output is on, without an error.
    #[must_use]
    pub const fn energy(&self) -> Option<f32> {
        if self.is_on && self.errors == 0 { Some(self.share) } else { None }
    }
}

/// Returns the data of the frame to the controller: on or off, the power limit in W and the charge of the buffer in J.
///
/// A limit below 30 W switches the controller off, because it would take 30 W. A limit above 250 W is sent as 250 W. The frame
/// never requests a restart.
///
/// # Examples
/// ```
/// use drivetrain::wire::supercap::hkust::command;
///
/// assert_eq!(command(true, 300, 60), [1, 250, 0, 60, 0, 0, 0, 0]);
/// assert_eq!(command(true, 20, 60)[0], 0);
/// ```
#[must_use]
pub const fn command(on: bool, limit_w: u16, buffer_j: u16) -> [u8; 8] {
    let (least, most) = LIMITS_W;
    let on = on && limit_w >= least;
    let [limit_low, limit_high] = if limit_w < most { limit_w } else { most }.to_le_bytes();
    let [buffer_low, buffer_high] = buffer_j.to_le_bytes();
    [on as u8, limit_low, limit_high, buffer_low, buffer_high, 0, 0, 0]
}

/// Reads a frame from the controller; `None` for another id or length, and for a power that is not finite or beyond 2000 W.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::wire::supercap::hkust::decode;
///
/// let frame = CanFrame::standard(0x051, [0x81, 0, 0, 0x5C, 0x42, 0, 0, 255]).ok_or("no id")?;
/// let state = decode(&frame).ok_or("refused")?;
/// assert_eq!((state.errors, state.is_on, state.chassis_w), (1, false, 55.0));
/// assert_eq!((state.share, state.energy()), (1.0, None)); // voltage too low: off
/// # Ok::<(), &str>(())
/// ```
#[must_use]
pub fn decode(frame: &CanFrame) -> Option<HkustState> {
    if frame.header() != u32::from(STATE_ID) || frame.length() != 8 {
        return None;
    }
    let [status, a, b, c, d, low, high, energy] = *frame.bytes();
    let chassis_w = f32::from_le_bytes([a, b, c, d]);
    (chassis_w.abs() <= MOST_W).then(|| HkustState {
        errors: status & 0x7F,
        is_on: status & 0x80 == 0,
        chassis_w,
        chassis_limit_w: u16::from_le_bytes([low, high]),
        share: f32::from(energy) / 255.0,
    })
}
