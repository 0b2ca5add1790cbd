use crate::frame::CanFrame;
use crate::motor::BusLoad;
use crate::time::{Duration, Instant};

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

/// Counts bits, and gives a load once a window.
#[derive(Debug)]
pub(super) struct Meter {
    bit_rate: u32,
    since: Option<Instant>,
    frames: u32,
    nominal: u32,
    worst_case: u32,
    last: Option<MeasuredLoad>,
}

impl Meter {
    pub(super) const fn new() -> Self {
        Self { bit_rate: 1_000_000, since: None, frames: 0, nominal: 0, worst_case: 0, last: None }
    }

    pub(super) const fn set_bit_rate(&mut self, bits_per_s: u32) {
        self.bit_rate = bits_per_s;
    }

    pub(super) const fn count(&mut self, frame: &CanFrame) {
        let (nominal, worst_case) = BusLoad::frame_bits(frame);
        self.frames = self.frames.saturating_add(1);
        self.nominal = self.nominal.saturating_add(nominal);
        self.worst_case = self.worst_case.saturating_add(worst_case);
    }

    /// Takes back a frame that was counted and never left.
    pub(super) const fn discount(&mut self, frame: &CanFrame) {
        let (nominal, worst_case) = BusLoad::frame_bits(frame);
        self.frames = self.frames.saturating_sub(1);
        self.nominal = self.nominal.saturating_sub(nominal);
        self.worst_case = self.worst_case.saturating_sub(worst_case);
    }

    /// Closes the window when it is over.
    pub(super) fn finish(&mut self, now: Instant) {
        let Some(since) = self.since.filter(|since| *since <= now) else {
            // The first tick, or the clock went back.
            return self.restart(now);
        };
        let passed = now.since(since);
        if passed < WINDOW {
            return;
        }
        let passed_s = passed.as_secs_f32();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let a_second = |count: u32| (count as f32 / passed_s + 0.5) as u32;
        let [frames, nominal, worst_case] =
            [self.frames, self.nominal, self.worst_case].map(a_second);
        self.last = Some(MeasuredLoad::new(self.bit_rate, frames, nominal, worst_case));
        self.restart(now);
    }

    const fn restart(&mut self, now: Instant) {
        self.since = Some(now);
        (self.frames, self.nominal, self.worst_case) = (0, 0, 0);
    }

    pub(super) const fn last(&self) -> Option<MeasuredLoad> {
        self.last
    }
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
