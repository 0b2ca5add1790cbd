//! What a runner counts: frames, errors, and how full the bus is.

use crate::frame::CanFrame;
use crate::motor::{BusLoad, Ingest};
use crate::time::{Duration, Instant};
use embedded_can::ErrorKind;

/// What a runner has counted since it was made; every counter saturates.
///
/// Received frames add up: `received = taken + unrelated + malformed`. Offered frames add up:
/// `offered = sent + refused + send_errors.total()`.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Statistics {
    /// Frames that the driver delivered, or that were given to `ingest`.
    pub received: u32,
    /// Frames that the device took as feedback.
    pub taken: u32,
    /// Frames of others, handed back.
    pub unrelated: u32,
    /// Frames with a motor's id in a form that is not its feedback; not used.
    pub malformed: u32,
    /// Errors of the driver when asked for a frame.
    pub receive_errors: ErrorCounts,
    /// Frames offered to the driver.
    pub offered: u32,
    /// Frames that the driver took.
    pub sent: u32,
    /// Frames that the driver had no place for. Kept, and offered again with newer values.
    pub refused: u32,
    /// Errors of the driver when offered a frame. The frame is kept as well.
    pub send_errors: ErrorCounts,
    /// Own frames that the driver gave back, for others of higher priority or because they were called back. Kept as well.
    pub evicted: u32,
    /// Frames of others that the driver gave back for ours. Handed back, unless they are no classic CAN frames of at most 8 bytes.
    pub evicted_unrelated: u32,
    /// Command frames that newer ones replaced before they were sent; wraps. See
    /// [`Devices::superseded`](crate::motor::Devices::superseded).
    pub superseded: u32,
    /// Received frames that a queue dropped before they came here.
    pub lost: u32,
    /// Periods without a tick: that passed before the program asked, or whose step it did not run.
    pub overruns: u32,
    /// Times that some command frame could not be sent for 100 ms: everything was disarmed.
    pub bus_losses: u32,
    /// Ticks whose time was that of the one before, those included that are due because the clock stands.
    pub clock_standstills: u32,
    /// Times that the clock went back.
    pub clock_reversals: u32,
}

/// Errors of the driver, by kind; every counter saturates.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorCounts {
    /// The receive buffer overflowed.
    pub overrun: u32,
    /// A bit on the bus was not the one sent.
    pub bit: u32,
    /// The bit stuffing was wrong.
    pub stuff: u32,
    /// The checksum was wrong.
    pub crc: u32,
    /// The frame had a wrong form.
    pub form: u32,
    /// Nobody acknowledged the frame.
    pub acknowledge: u32,
    /// Any other error, bus-off included: `embedded-can` has no kind for it.
    pub other: u32,
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

    /// Returns the counters with the sums, which are not counted by themselves.
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

    /// Returns the sum over all kinds.
    #[must_use]
    pub const fn total(&self) -> u32 {
        self.overrun
            .saturating_add(self.bit)
            .saturating_add(self.stuff)
            .saturating_add(self.crc)
            .saturating_add(self.form)
            .saturating_add(self.acknowledge)
            .saturating_add(self.other)
    }
}

/// The frames of one call that are no feedback in 8 bytes: what else there is follows from their number, and costs no counter.
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
        if let Ingest::Malformed(_) = outcome {
            self.malformed += 1;
        }
    }
}

/// How full a bus was in the last window of a second or a little more, by the frames that the runner sent and received.
///
/// Frames are counted by their length: without stuff bits, and with as many as can be. What the bus carried lies
/// between the two. Compare it with what [`BusLoad`] reckons from the motors' rates: a measured load above that
/// means that somebody else talks, or that an ESC is set to another rate.
///
/// # Limits
/// **Frames that the controller's filter drops are not seen**, and neither are those that were lost in an overrun, nor
/// error frames and repetitions. A sent frame counts when the driver takes it, and no longer when it is given back.
///
/// # Examples
/// ```
/// use drivetrain::runner::MeasuredLoad;
///
/// // Four motors and one command frame at 1 kHz, as `Runner::measured_load` may return it.
/// let load = MeasuredLoad::new(1_000_000, 5_000, 555_000, 675_000);
/// assert_eq!((load.nominal(), load.worst_case()), (0.555, 0.675));
/// assert_eq!(load.to_string(), "56 % to 68 %");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeasuredLoad {
    bit_rate: u32,
    frames_per_s: u32,
    nominal_bits_per_s: u32,
    worst_case_bits_per_s: u32,
}

impl MeasuredLoad {
    /// Takes the bit rate in bits a second, of which 0 counts as 1; and what was counted in a second: frames, bits without
    /// stuff bits, bits with as many as can be.
    #[must_use]
    pub const fn new(bit_rate: u32, frames: u32, nominal_bits: u32, worst_case_bits: u32) -> Self {
        Self {
            bit_rate: if bit_rate == 0 { 1 } else { bit_rate },
            frames_per_s: frames,
            nominal_bits_per_s: nominal_bits,
            worst_case_bits_per_s: worst_case_bits,
        }
    }

    /// Returns the number of frames a second.
    #[must_use]
    pub const fn frames_per_s(&self) -> u32 {
        self.frames_per_s
    }

    /// Returns the load without stuff bits; 1 is a full bus.
    #[must_use]
    pub const fn nominal(&self) -> f32 {
        self.nominal_bits_per_s as f32 / self.bit_rate as f32
    }

    /// Returns the load with as many stuff bits as can be; 1 is a full bus.
    #[must_use]
    pub const fn worst_case(&self) -> f32 {
        self.worst_case_bits_per_s as f32 / self.bit_rate as f32
    }
}

/// Writes both loads in percent, rounded up.
impl core::fmt::Display for MeasuredLoad {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let percent = |bits: u32| (u64::from(bits) * 100).div_ceil(u64::from(self.bit_rate));
        let (low, high) = (self.nominal_bits_per_s, self.worst_case_bits_per_s);
        write!(f, "{} % to {} %", percent(low), percent(high))
    }
}

/// The shortest window.
const WINDOW: Duration = Duration::from_secs(1);

/// Counts frames, and gives a load once a window.
#[derive(Debug)]
pub(super) struct Meter {
    bit_rate: u32,
    since: Option<Instant>,
    /// Standard data frames of 8 bytes, which nearly all are.
    whole: u32,
    /// All others, and their bits.
    others: u32,
    nominal: u32,
    worst_case: u32,
    last: Option<MeasuredLoad>,
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
        let (nominal, worst_case) = BusLoad::frame_bits(frame);
        self.others = self.others.saturating_add(1);
        self.nominal = self.nominal.saturating_add(nominal);
        self.worst_case = self.worst_case.saturating_add(worst_case);
    }

    /// Takes back a frame that was counted and never left.
    pub(super) const fn discount(&mut self, frame: &CanFrame) {
        if frame.is_whole() {
            self.whole = self.whole.saturating_sub(1);
            return;
        }
        let (nominal, worst_case) = BusLoad::frame_bits(frame);
        self.others = self.others.saturating_sub(1);
        self.nominal = self.nominal.saturating_sub(nominal);
        self.worst_case = self.worst_case.saturating_sub(worst_case);
    }

    /// Closes the window when it is over.
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
        self.last = Some(MeasuredLoad::new(self.bit_rate, frames, nominal, worst_case));
        self.restart(now);
    }

    const fn restart(&mut self, now: Instant) {
        self.since = Some(now);
        (self.whole, self.others) = (0, 0);
        (self.nominal, self.worst_case) = (0, 0);
    }

    pub(super) const fn last(&self) -> Option<MeasuredLoad> {
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
    fn a_window_that_lasts_longer_is_no_fuller_for_it() {
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
        let expected = MeasuredLoad::new(500_000, 1_000, 111_000, 135_000);
        assert_eq!(meter.last(), Some(expected));
    }

    #[test]
    fn absurd_numbers_saturate() {
        let load = MeasuredLoad::new(0, u32::MAX, u32::MAX, u32::MAX);
        assert!(load.worst_case().is_finite() && load.frames_per_s() == u32::MAX);
        assert_eq!(load.to_string(), "429496729500 % to 429496729500 %");
        let mut meter = Meter::new();
        meter.finish(Instant::from_micros(5));
        meter.finish(Instant::from_micros(1));
        meter.finish(Instant::from_micros(u64::MAX));
        assert_eq!(meter.last(), Some(MeasuredLoad::new(1_000_000, 0, 0, 0)));
    }
}
