//! Controllers of super-capacitors: the payload of their CAN frames.
//!
//! A controller stands between the supply of the referee system and the chassis. The controller draws the commanded power from
//! the supply: surplus power charges the capacitor, and missing power comes from the capacitor.
//!
//! | module | controller | told | tells |
//! |---|---|---|---|
//! | [`hkust`] | HKUST Enterprize, 2024 | switch, power limit, buffer energy | energy, errors, power of the chassis |
//! | [`pacific_spirit`] | Pacific Spirit (UBC), 2024 | power to take from the supply | energy, state, power of the supply |
//!
//! Teams assign ids of their own, so these modules only name the usual ids, which collide with no motor of [`dji`](crate::dji)
//! (`0x1FE` to `0x20B`, `0x2FE`, `0x2FF`). No frame has a checksum except the CRC of CAN. Keep each state with its time of
//! arrival, and give [`chassis::CapacitorPlan`](crate::chassis::CapacitorPlan) no energy when the state is too old:
//!
//! ```
//! use drivetrain::chassis::CapacitorPlan;
//! use drivetrain::frame::CanFrame;
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::supercap::hkust;
//!
//! let ms = |ms| Instant::START + Duration::from_millis(ms);
//! // From the CAN driver: no error, 55 W, 180 W allowed, 204/255 of the energy.
//! let frame = CanFrame::standard(0x051, [0, 0, 0, 0x5C, 0x42, 180, 0, 204]).ok_or("no id")?;
//! let mut heard = None;
//! if let Some(state) = hkust::decode(&frame) {
//!     heard = Some((state, ms(0)));
//! }
//! let energy = |now: Instant| {
//!     let fresh = heard.filter(|(_, at)| now.since(*at) <= Duration::from_millis(100));
//!     fresh.and_then(|(state, _)| state.energy())
//! };
//! assert!(energy(ms(100)).is_some_and(|share| (share - 0.8).abs() < 1e-6));
//!
//! let plan = CapacitorPlan::new(2_000.0, 600.0)?.with_most_w(150.0)?; // J, J, W
//! assert_eq!(plan.allowance_w(80.0, energy(ms(100)), true), 230.0);
//! assert_eq!(plan.allowance_w(80.0, energy(ms(101)), true), 80.0); // too old
//!
//! let command = hkust::command(true, 80, 60);
//! assert_eq!(command, [1, 80, 0, 60, 0, 0, 0, 0]); // to 0x061
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

pub mod hkust {
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
}

pub mod pacific_spirit {
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
}
