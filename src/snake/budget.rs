//! How full the bus is.

use super::Joints;
use crate::motor::BusLoad;

/// How many frames an update gives to send, and what the load is reckoned with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) reads: u8,
    pub(super) writes: u8,
    bit_rate: u32,
    tick_hz: u32,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { reads: 1, writes: 1, bit_rate: 1_000_000, tick_hz: 1_000 }
    }
}

/// The load of the bus. It does not depend on the number of joints: they take turns.
impl Joints {
    /// Sets how many joints are asked, and how many are written to, in an update; one each at first, 1 to 12.
    ///
    /// The fewer frames, the longer until a joint has its next turn: choose
    /// [`Timeouts::late`](crate::motor::Timeouts::late) above three turns. More than the driver has room for only wait, and
    /// take turns; where it has room for fewer than it is given, it must not choose by the lowest id.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::snake::Joints;
    ///
    /// let fast = Joints::new().with_frames_per_update(2, 2);
    /// assert_eq!(fast.load().to_string(), "51 % to 61 %"); // a bus without other motors
    /// ```
    #[must_use]
    pub const fn with_frames_per_update(mut self, reads: u8, writes: u8) -> Self {
        self.budget.reads = limited(reads);
        self.budget.writes = limited(writes);
        self
    }

    /// Sets the bit rate, in bits a second, for [`load`](Self::load); 1 000 000 at first.
    #[must_use]
    pub const fn with_bit_rate(mut self, bits_per_s: u32) -> Self {
        self.budget.bit_rate = bits_per_s;
        self
    }

    /// Sets the rate of updates in Hz, for [`load`](Self::load); 1000 at first.
    #[must_use]
    pub const fn with_tick_rate(mut self, hz: u32) -> Self {
        self.budget.tick_hz = hz;
        self
    }

    /// Returns the load of requests, their replies, and writes, while all joints move.
    ///
    /// Relaxed joints take less. A stop of all joints takes 12 frames more, once. [`BusLoad::and`] adds other families.
    #[must_use]
    pub const fn load(&self) -> BusLoad {
        let Budget { reads, writes, bit_rate, tick_hz } = self.budget;
        BusLoad::new(bit_rate).with_frames_of(2, reads as u32, tick_hz).with_frames_of(
            6,
            reads as u32 + writes as u32,
            tick_hz,
        )
    }
}

const fn limited(frames: u8) -> u8 {
    match frames {
        0 => 1,
        1..=12 => frames,
        _ => 12,
    }
}
