//! Load of the bus.

use crate::motor::BusLoad;

/// Number of frames in an update, and the rates for the load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) reads: u8,
    pub(super) writes: u8,
    pub(super) bit_rate: u32,
    pub(super) tick_hz: u32,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { reads: 1, writes: 1, bit_rate: 1_000_000, tick_hz: 1_000 }
    }

    /// Returns the load of requests, replies and writes, while all joints move.
    pub(super) const fn load(&self) -> BusLoad {
        let Self { reads, writes, bit_rate, tick_hz } = *self;
        BusLoad::new(bit_rate).with_frames_of(2, reads as u32, tick_hz).with_frames_of(
            6,
            reads as u32 + writes as u32,
            tick_hz,
        )
    }
}

/// Returns a number of frames in an update, 1 to 12.
pub(super) const fn limited(frames: u8) -> u8 {
    match frames {
        0 => 1,
        1..=12 => frames,
        _ => 12,
    }
}
