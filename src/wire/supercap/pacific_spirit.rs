//! The controller of Pacific Spirit (UBC), protocol 1.0 of July 2024.
//!
//! ```text
//! 0x2C7 to it    u16 power to take in 0.01 W, u16 limit of the referee in 0.01 W, u16 2012h, u16 0712h  little-endian, 8 bytes
//! 0x2C8 from it  u16 discharge at most in 0.01 W, u16 power of the supply in 0.01 W, i16 energy in %, u16 state; 100 Hz
//! ```
//!
//! | state | meaning |
//! |---|---|
//! | 0, 1, 2 | off, ready, on |
//! | 3, 4 | voltage of the supply too high, too low |
//! | 5 | voltage of the capacitor too high |
//!
//! * The energy is counted from the voltage at which the controller starts up, so the energy may be a little below
//!   zero.
//! * Only the power to take counts for the controller; the firmware limits this power to a range of its own.
//! * The controller has no time-out: it continues with the last commanded power.
//!
//! Source: `wele0612/PSP_supercapacitor`, `cap_canmsg_protocal.h`, `g474_fdcan.c`, `dcdc.c` (facts only), and the drivers of two
//! other teams. One version of this firmware has the two ids exchanged, the protocol's header and the drivers have not. **Not
//! known:** whether a firmware checks the two fixed words; one driver sends them high byte first and is served as well.

use crate::frame::CanFrame;

/// The usual id of the frame to the controller.
pub const COMMAND_ID: u16 = 0x2C7;

/// The usual id of the frame from the controller.
pub const STATE_ID: u16 = 0x2C8;

/// State reported by the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PacificSpiritState {
    /// State of the controller, as received: 2 is on.
    pub state: u16,
    /// Power available from the capacitor now, in W.
    pub discharge_w: f32,
    /// Power taken from the supply, in W.
    pub supply_w: f32,
    /// Usable share of the energy, 0 to 1.
    pub share: f32,
}

impl PacificSpiritState {
    /// Returns the share of the energy while the capacitor can be used: the controller is on.
    #[must_use]
    pub const fn energy(&self) -> Option<f32> {
        if self.state == 2 { Some(self.share) } else { None }
    }
}

/// Returns the data of the frame to the controller: the power to take from the supply, and the limit of the referee, in W.
///
/// Both are rounded down to 0.01 W and at most 655.35 W. A value that is negative or NaN is sent as zero.
///
/// # Examples
/// ```
/// use drivetrain::wire::supercap::pacific_spirit::command;
///
/// assert_eq!(command(75.5, 80.0), [0x7E, 0x1D, 0x40, 0x1F, 0x12, 0x20, 0x12, 0x07]);
/// assert_eq!(command(f32::NAN, -1.0)[..4], [0; 4]);
/// ```
#[must_use]
pub fn command(power_w: f32, limit_w: f32) -> [u8; 8] {
    let [a, b] = centiwatts(power_w).to_le_bytes();
    let [c, d] = centiwatts(limit_w).to_le_bytes();
    [a, b, c, d, 0x12, 0x20, 0x12, 0x07]
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, and NaN is zero"
)]
const fn centiwatts(watts: f32) -> u16 {
    (watts * 100.0) as u16
}

/// Reads a frame from the controller; `None` for another id or length, and for an energy outside of -100 to 110 %.
///
/// # Examples
/// ```
/// use drivetrain::frame::CanFrame;
/// use drivetrain::wire::supercap::pacific_spirit::decode;
///
/// let frame = CanFrame::standard(0x2C8, [0x20, 0x4E, 0x7E, 0x1D, 80, 0, 2, 0]).ok_or("no id")?;
/// let state = decode(&frame).ok_or("refused")?;
/// assert_eq!((state.discharge_w, state.supply_w, state.energy()), (200.0, 75.5, Some(0.8)));
/// # Ok::<(), &str>(())
/// ```
#[must_use]
pub fn decode(frame: &CanFrame) -> Option<PacificSpiritState> {
    if frame.header() != u32::from(STATE_ID) || frame.length() != 8 {
        return None;
    }
    let [a, b, c, d, e, f, g, h] = *frame.bytes();
    let watts = |low, high| f32::from(u16::from_le_bytes([low, high])) / 100.0;
    let percent = i16::from_le_bytes([e, f]);
    (-100..=110).contains(&percent).then(|| PacificSpiritState {
        state: u16::from_le_bytes([g, h]),
        discharge_w: watts(a, b),
        supply_w: watts(c, d),
        share: (f32::from(percent) / 100.0).clamp(0.0, 1.0),
    })
}
