//! Counters of a runner: frames, errors, and the load of the bus.

use crate::frame::CanFrame;
use crate::motor::{BusLoad, Ingest};
use crate::time::{Duration, Instant};
use embedded_can::ErrorKind;

/// Counters of a runner since its creation; every counter saturates.
///
/// Received frames add up: `received = taken + unrelated + malformed`. Offered frames add up:
/// `offered = sent + refused + send_errors()`.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Statistics {
    /// Frames delivered by the driver or given to `ingest`.
    pub received: u32,
    /// Frames taken by the device as feedback.
    pub taken: u32,
    /// Frames of others, handed back.
    pub unrelated: u32,
    /// Frames with a motor's id but not in the form of its feedback; not used.
    pub malformed: u32,
    pub(super) receive_errors: ErrorCounts,
    /// Frames offered to the driver; refused offers of a poll do not count.
    pub offered: u32,
    /// Frames taken by the driver.
    pub sent: u32,
    /// Frames without a place in the driver in a tick. Kept, and offered again.
    pub refused: u32,
    pub(super) send_errors: ErrorCounts,
    /// Own frames given back by the driver, for frames of higher priority or because they were called back. Kept as well.
    pub evicted: u32,
    /// Frames of others given back by the driver for ours. Handed back, unless they are not classic CAN frames of at most 8
    /// bytes.
    pub evicted_unrelated: u32,
    /// Command frames replaced by newer frames before they were sent; wraps. See
    /// [`Devices::superseded`](crate::motor::Devices::superseded).
    pub superseded: u32,
    /// Received frames dropped by a queue before the runner saw them.
    pub lost: u32,
    /// Periods without a tick: passed before the program asked, or with a step not run by the program.
    pub overruns: u32,
    /// Number of times that some command frame could not be sent for 100 ms: everything was disarmed.
    pub bus_losses: u32,
    /// Ticks with the same time as the tick before, including ticks due because the clock stands.
    pub clock_standstills: u32,
    /// Number of times that the clock went back.
    pub clock_reversals: u32,
}

/// Errors of the driver, by kind; every counter saturates.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ErrorCounts {
    /// The receive buffer overflowed.
    overrun: u32,
    /// A bit on the bus differed from the bit sent.
    bit: u32,
    /// The bit stuffing was wrong.
    stuff: u32,
    /// The checksum was wrong.
    crc: u32,
    /// The frame had a wrong form.
    form: u32,
    /// Nobody acknowledged the frame.
    acknowledge: u32,
    /// Any other error, bus-off included: `embedded-can` has no kind for these.
    other: u32,
}

impl Statistics {
    pub(super) const NONE: Self = Self {
        received: 0,
        taken: 0,
        unrelated: 0,
        malformed: 0,
        receive_errors: ErrorCounts::NONE,
        offered: 0,
        sent: 0,
        refused: 0,
        send_errors: ErrorCounts::NONE,
        evicted: 0,
        evicted_unrelated: 0,
        superseded: 0,
        lost: 0,
        overruns: 0,
        bus_losses: 0,
        clock_standstills: 0,
        clock_reversals: 0,
    };

    /// Returns the number of errors of the driver when asked for a frame.
    #[must_use]
    pub const fn receive_errors(&self) -> u32 {
        self.receive_errors.total()
    }

    /// Returns the number of errors of one kind when the driver was asked for a frame.
    ///
    /// [`ErrorKind::Other`] counts any kind without a name in `embedded-can`, bus-off included.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::runner::Statistics;
    /// use embedded_can::ErrorKind;
    ///
    /// let none = Statistics::default();
    /// assert_eq!((none.receive_errors(), none.receive_errors_of(ErrorKind::Crc)), (0, 0));
    /// ```
    #[must_use]
    pub const fn receive_errors_of(&self, kind: ErrorKind) -> u32 {
        self.receive_errors.of(kind)
    }

    /// Returns the number of errors of the driver when offered a frame. The frame is kept as well.
    #[must_use]
    pub const fn send_errors(&self) -> u32 {
        self.send_errors.total()
    }

    /// Returns the number of errors of one kind when the driver was offered a frame; kinds as in
    /// [`receive_errors_of`](Self::receive_errors_of).
    #[must_use]
    pub const fn send_errors_of(&self, kind: ErrorKind) -> u32 {
        self.send_errors.of(kind)
    }

    /// Counts the received frames of one call; returns the number of frames taken.
    #[inline(always)]
    pub(super) const fn enter(&mut self, frames: u32, tally: &Tally) -> u32 {
        let taken = frames.saturating_sub(tally.rejected);
        let unrelated = tally.rejected.saturating_sub(tally.malformed);
        self.taken = self.taken.saturating_add(taken);
        if tally.rejected > 0 {
            self.unrelated = self.unrelated.saturating_add(unrelated);
            self.malformed = self.malformed.saturating_add(tally.malformed);
        }
        taken
    }

    /// Returns the counters, with the sums that have no counter of their own.
    pub(super) const fn with_sums(self) -> Self {
        let received = self.taken.saturating_add(self.unrelated).saturating_add(self.malformed);
        let offered = self.sent.saturating_add(self.refused);
        Self { received, offered: offered.saturating_add(self.send_errors.total()), ..self }
    }
}

impl ErrorCounts {
    const NONE: Self =
        Self { overrun: 0, bit: 0, stuff: 0, crc: 0, form: 0, acknowledge: 0, other: 0 };

    pub(super) fn count(&mut self, kind: ErrorKind) {
        increment(match kind {
            ErrorKind::Overrun => &mut self.overrun,
            ErrorKind::Bit => &mut self.bit,
            ErrorKind::Stuff => &mut self.stuff,
            ErrorKind::Crc => &mut self.crc,
            ErrorKind::Form => &mut self.form,
            ErrorKind::Acknowledge => &mut self.acknowledge,
            _ => &mut self.other,
        });
    }

    const fn of(&self, kind: ErrorKind) -> u32 {
        match kind {
            ErrorKind::Overrun => self.overrun,
            ErrorKind::Bit => self.bit,
            ErrorKind::Stuff => self.stuff,
            ErrorKind::Crc => self.crc,
            ErrorKind::Form => self.form,
            ErrorKind::Acknowledge => self.acknowledge,
            _ => self.other,
        }
    }

    const fn total(&self) -> u32 {
        self.overrun
            .saturating_add(self.bit)
            .saturating_add(self.stuff)
            .saturating_add(self.crc)
            .saturating_add(self.form)
            .saturating_add(self.acknowledge)
            .saturating_add(self.other)
    }
}

/// The frames of one call other than feedback in 8 bytes: their total gives the number of feedback frames, without a counter.
#[derive(Default)]
pub(super) struct Tally {
    /// Not of 8 bytes with an 11-bit id.
    pub(super) others: u32,
    pub(super) rejected: u32,
    /// Of those that were rejected; the rest is unrelated.
    pub(super) malformed: u32,
}

impl Tally {
    /// Counts a frame that was not taken.
    #[inline(always)]
    pub(super) const fn reject(&mut self, outcome: Ingest) {
        self.rejected += 1;
        if outcome.is_malformed() {
            self.malformed += 1;
        }
    }
}

/// The shortest window.
const WINDOW: Duration = Duration::from_secs(1);

/// Counts frames, and gives a load once a window.
#[derive(Debug)]
pub(super) struct Meter {
    bit_rate: u32,
    since: Option<Instant>,
    /// Standard data frames of 8 bytes: nearly all frames.
    whole: u32,
    /// All others, and their bits.
    others: u32,
    nominal: u32,
    worst_case: u32,
    last: Option<BusLoad>,
}

impl Meter {
    pub(super) const fn new() -> Self {
        Self {
            bit_rate: 1_000_000,
            since: None,
            whole: 0,
            others: 0,
            nominal: 0,
            worst_case: 0,
            last: None,
        }
    }

    pub(super) const fn set_bit_rate(&mut self, bits_per_s: u32) {
        self.bit_rate = bits_per_s;
    }

    #[inline]
    pub(super) const fn count(&mut self, frame: &CanFrame) {
        if frame.is_whole() {
            self.whole = self.whole.saturating_add(1);
        } else {
            self.count_other(frame);
        }
    }

    /// Counts standard data frames of 8 bytes.
    #[inline]
    pub(super) const fn count_whole(&mut self, frames: u32) {
        self.whole = self.whole.saturating_add(frames);
    }

    #[cold]
    #[inline(never)]
    pub(super) const fn count_other(&mut self, frame: &CanFrame) {
        let (nominal, worst_case) = frame.bits();
        self.others = self.others.saturating_add(1);
        self.nominal = self.nominal.saturating_add(nominal);
        self.worst_case = self.worst_case.saturating_add(worst_case);
    }

    /// Removes a counted frame that never left.
    pub(super) const fn discount(&mut self, frame: &CanFrame) {
        if frame.is_whole() {
            self.whole = self.whole.saturating_sub(1);
            return;
        }
        let (nominal, worst_case) = frame.bits();
        self.others = self.others.saturating_sub(1);
        self.nominal = self.nominal.saturating_sub(nominal);
        self.worst_case = self.worst_case.saturating_sub(worst_case);
    }

    /// Closes the window at its end.
    #[inline]
    pub(super) fn finish(&mut self, now: Instant) {
        match self.since {
            Some(since) if since <= now && now.since(since) < WINDOW => {}
            since => self.close(since, now),
        }
    }

    #[cold]
    #[inline(never)]
    fn close(&mut self, since: Option<Instant>, now: Instant) {
        let Some(since) = since.filter(|since| *since <= now) else {
            // The first tick, or the clock went back.
            return self.restart(now);
        };
        let passed_s = now.since(since).as_secs_f32();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let a_second = |count: u32| (count as f32 / passed_s + 0.5) as u32;
        let frames = self.whole.saturating_add(self.others);
        let nominal = self.whole.saturating_mul(BusLoad::NOMINAL_BITS).saturating_add(self.nominal);
        let worst_case =
            self.whole.saturating_mul(BusLoad::WORST_CASE_BITS).saturating_add(self.worst_case);
        let [frames, nominal, worst_case] = [frames, nominal, worst_case].map(a_second);
        self.last = Some(BusLoad::measured(self.bit_rate, frames, nominal, worst_case));
        self.restart(now);
    }

    const fn restart(&mut self, now: Instant) {
        self.since = Some(now);
        (self.whole, self.others) = (0, 0);
        (self.nominal, self.worst_case) = (0, 0);
    }

    pub(super) const fn last(&self) -> Option<BusLoad> {
        self.last
    }
}

pub(super) const fn increment(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_longer_window_gives_the_same_load() {
        let frame = CanFrame::standard(0x200, [0; 8]).unwrap();
        let mut meter = Meter::new();
        meter.set_bit_rate(500_000);
        meter.finish(Instant::from_micros(7));
        (0..3_000).for_each(|_| meter.count(&frame));
        meter.discount(&frame);
        meter.finish(Instant::from_micros(1_000_006));
        assert_eq!(meter.last(), None);
        meter.count(&frame);
        meter.finish(Instant::from_micros(3_000_007));
        let expected = BusLoad::measured(500_000, 1_000, 111_000, 135_000);
        assert_eq!(meter.last(), Some(expected));
    }

    #[test]
    fn absurd_numbers_saturate() {
        let load = BusLoad::measured(0, u32::MAX, u32::MAX, u32::MAX);
        assert!(load.worst_case().is_finite() && load.frames_per_s() == u32::MAX);
        assert_eq!(load.to_string(), "4294967295 % to 4294967295 %");
        let mut meter = Meter::new();
        meter.finish(Instant::from_micros(5));
        meter.finish(Instant::from_micros(1));
        meter.finish(Instant::from_micros(u64::MAX));
        assert_eq!(meter.last(), Some(BusLoad::new(1_000_000)));
    }
}
