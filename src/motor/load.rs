//! The load of a bus, by frames and their rates.

use crate::frame::CanFrame;
use core::num::NonZeroU32;

/// Load of a bus: the share of its bit rate taken by its frames, without stuff bits and with the most possible. Calculated here,
/// or [measured](crate::runner::Runner::measured_load) by a runner.
///
/// Counts standard data frames, each with the pause of three bits after it; for the 8 bytes that DJI motors use:
///
/// | | bits | |
/// |---|---|---|
/// | nominal | 111 | 34 stuffable bits around 64 of data, 13 that are never stuffed: `47 + 8 * 8` |
/// | worst case | 135 | and a stuff bit after the first five, then after every fourth: `(34 + 64 - 1) / 4` = 24 |
///
/// The load is `bits * frames a second / bit rate`. The real load lies between the two, and depends on the content.
/// Above 1, the frames of lowest priority (highest ids) do not get through.
///
/// Feedback of DJI motors at 1 kHz, and a command frame for every four of them at the same rate, at 1 Mbit/s:
///
/// | motors | 4 | 5 | 6 | 7 | 8 |
/// |---|--:|--:|--:|--:|--:|
/// | nominal, % | 55.5 | 77.7 | 88.8 | 99.9 | 111.0 |
/// | worst case, % | 67.5 | 94.5 | 108.0 | 121.5 | 135.0 |
///
/// On such a bus the commands 0x1FE, 0x1FF and 0x200 win over all feedback (0x201 to 0x20B), but **0x2FE and 0x2FF, the
/// commands of GM6020 #5..=7, lose to it**: when feedback alone fills the bus, these motors never get a new command.
///
/// Sources: Bosch CAN specification 2.0 (1991), part B, chapters 3.1 and 5; for the worst case T. Nolte, H. Hansson,
/// C. Norström, "Minimizing CAN response-time jitter by message manipulation" (2002), equation 1.
///
/// # Examples
/// The table above:
/// ```
/// use drivetrain::motor::BusLoad;
///
/// const fn load(motors: u32) -> BusLoad {
///     BusLoad::new(1_000_000).with_frames(motors, 1_000).with_frames(motors.div_ceil(4), 1_000)
/// }
/// // motors              4         5         6          7          8
/// let nominal =    [  55.5,     77.7,     88.8,      99.9,     111.0];
/// let worst_case = [  67.5,     94.5,    108.0,     121.5,     135.0];
/// for (motors, (nominal, worst_case)) in (4..).zip(nominal.into_iter().zip(worst_case)) {
///     assert!((load(motors).nominal() * 100.0 - nominal).abs() < 1e-3);
///     assert!((load(motors).worst_case() * 100.0 - worst_case).abs() < 1e-3);
/// }
/// const SIX: BusLoad = load(6); // in a `const` too
/// assert_eq!(SIX.to_string(), "89 % to 108 %");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BusLoad {
    frames_per_s: u32,
    bit_rate: u32,
    nominal_bits_per_s: u64,
    worst_bits_per_s: u64,
}

impl BusLoad {
    /// Bits of a standard data frame of 8 bytes without stuff bits, with the pause after it.
    pub const NOMINAL_BITS: u32 = Self::nominal_bits(8);

    /// Bits of a standard data frame of 8 bytes with the most stuff bits possible, with the pause after it.
    pub const WORST_CASE_BITS: u32 = Self::worst_bits(8);

    /// Returns the bits of one frame of any kind, with the pause after it: without stuff bits, and with the most stuff
    /// bits possible.
    ///
    /// The sent bits lie between the two. A remote frame carries no data, for any requested length.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::motor::BusLoad;
    /// use embedded_can::{ExtendedId, Frame};
    ///
    /// let command = CanFrame::standard(0x200, [0; 8]).ok_or("not an 11-bit id")?;
    /// assert_eq!(BusLoad::frame_bits(&command), (111, 135));
    /// let id = ExtendedId::new(0x1234).ok_or("not a 29-bit id")?;
    /// let empty = CanFrame::new(id, &[]).ok_or("more than 8 bytes")?;
    /// assert_eq!(BusLoad::frame_bits(&empty), (67, 80));
    /// # Ok::<(), &str>(())
    /// ```
    #[must_use]
    pub const fn frame_bits(frame: &CanFrame) -> (u32, u32) {
        frame.bits()
    }

    /// Takes the bit rate of a bus, in bits a second: 1 000 000 for DJI motors. 0 counts as 1.
    #[must_use]
    pub const fn new(bit_rate: u32) -> Self {
        Self {
            frames_per_s: 0,
            bit_rate: if bit_rate == 0 { 1 } else { bit_rate },
            nominal_bits_per_s: 0,
            worst_bits_per_s: 0,
        }
    }

    /// Takes the bit rate and the counts of one second: frames, bits without stuff bits, bits with the most stuff bits
    /// possible.
    pub(crate) const fn measured(bit_rate: u32, frames: u32, nominal: u32, worst: u32) -> Self {
        Self {
            frames_per_s: frames,
            nominal_bits_per_s: nominal as u64,
            worst_bits_per_s: worst as u64,
            ..Self::new(bit_rate)
        }
    }

    /// Adds a number of frames of 8 bytes, each at a rate in frames a second; saturates.
    #[must_use]
    pub const fn with_frames(self, frames: u32, rate_hz: u32) -> Self {
        self.with_frames_of(8, frames, rate_hz)
    }

    /// Adds a number of frames of `length` bytes, each at a rate in frames a second; saturates. A length above 8 counts
    /// as 8.
    ///
    /// # Examples
    /// A request of 2 bytes and its answer of 6, each millisecond:
    /// ```
    /// use drivetrain::motor::BusLoad;
    ///
    /// let load = BusLoad::new(1_000_000).with_frames_of(2, 1, 1_000).with_frames_of(6, 1, 1_000);
    /// assert!((load.nominal() - 0.158).abs() < 1e-6); // 63 and 95 bits
    /// assert!((load.worst_case() - 0.190).abs() < 1e-6); // 75 and 115 bits
    /// ```
    #[must_use]
    pub const fn with_frames_of(self, length: u8, frames: u32, rate_hz: u32) -> Self {
        let bits = (Self::nominal_bits(length), Self::worst_bits(length));
        self.with_bits(bits, rate_hz.saturating_mul(frames))
    }

    /// Adds frames like this one.
    pub(super) const fn with_each(self, frame: &CanFrame, rate_hz: u32) -> Self {
        self.with_bits(frame.bits(), rate_hz)
    }

    const fn with_bits(self, (nominal, worst): (u32, u32), more: u32) -> Self {
        let nominal = more as u64 * nominal as u64;
        let worst = more as u64 * worst as u64;
        Self {
            frames_per_s: self.frames_per_s.saturating_add(more),
            nominal_bits_per_s: self.nominal_bits_per_s.saturating_add(nominal),
            worst_bits_per_s: self.worst_bits_per_s.saturating_add(worst),
            ..self
        }
    }

    /// Adds the frames of others on the same bus, for example of another device family. The bit rate stays.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::BusLoad;
    ///
    /// let one = BusLoad::new(1_000_000).with_frames(1, 1_000);
    /// assert_eq!(one.and(&one), BusLoad::new(1_000_000).with_frames(2, 1_000));
    /// ```
    #[must_use]
    pub const fn and(self, other: &Self) -> Self {
        Self {
            frames_per_s: self.frames_per_s.saturating_add(other.frames_per_s),
            nominal_bits_per_s: self.nominal_bits_per_s.saturating_add(other.nominal_bits_per_s),
            worst_bits_per_s: self.worst_bits_per_s.saturating_add(other.worst_bits_per_s),
            ..self
        }
    }

    const fn nominal_bits(length: u8) -> u32 {
        47 + 8 * if length > 8 { 8 } else { length as u32 }
    }

    const fn worst_bits(length: u8) -> u32 {
        let nominal = Self::nominal_bits(length);
        nominal + (nominal - 14) / 4
    }

    /// Returns the number of frames a second.
    #[must_use]
    pub const fn frames_per_s(&self) -> u32 {
        self.frames_per_s
    }

    /// Returns the bit rate, in bits a second.
    #[must_use]
    pub const fn bit_rate(&self) -> u32 {
        self.bit_rate
    }

    /// Returns the load without stuff bits; 1 is a full bus.
    #[must_use]
    pub const fn nominal(&self) -> f32 {
        self.nominal_bits_per_s as f32 / self.bit_rate as f32
    }

    /// Returns the load with as many stuff bits as can be; 1 is a full bus.
    #[must_use]
    pub const fn worst_case(&self) -> f32 {
        self.worst_bits_per_s as f32 / self.bit_rate as f32
    }

    /// Returns the number of frames of 8 bytes a second below a ceiling of the worst case, rounded down. A ceiling that is NaN
    /// or negative counts as 0.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::BusLoad;
    ///
    /// assert_eq!(BusLoad::new(1_000_000).frames_within(0.9), 6_666); // of 135 bits
    /// ```
    #[must_use]
    pub const fn frames_within(&self, ceiling: f32) -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, NaN gives 0"
        )]
        let frames = (ceiling * self.bit_rate as f32 / Self::WORST_CASE_BITS as f32) as u32;
        frames
    }

    /// Returns the worst case in percent if frames of a bus with this measured load may have starved: the carried bits lie
    /// between both loads.
    pub(super) fn of_full_bus(self) -> Option<u16> {
        (self.worst_bits_per_s >= u64::from(self.bit_rate))
            .then(|| u16::try_from(self.worst_percent()).unwrap_or(u16::MAX))
    }

    /// Returns the worst case in percent, rounded up.
    pub(crate) const fn worst_percent(&self) -> u32 {
        self.percent(self.worst_bits_per_s)
    }

    /// Returns a load in percent, rounded up; saturates. With 32-bit divisions only, for small cores.
    const fn percent(&self, bits_per_s: u64) -> u32 {
        let Some(rate) = NonZeroU32::new(self.bit_rate) else { return u32::MAX };
        #[expect(clippy::cast_possible_truncation, reason = "limited right here")]
        let bits_per_s = if bits_per_s > u32::MAX as u64 { u32::MAX } else { bits_per_s as u32 };
        let (whole, rest) = (bits_per_s / rate.get(), bits_per_s % rate.get());
        // A hundredth of the rate is exact enough where the rest in percent would not fit.
        let part = match rest.checked_mul(100) {
            Some(rest) => rest.div_ceil(rate.get()),
            None => match rest.checked_div(rate.get() / 100) {
                Some(percent) => percent.saturating_add(1),
                None => 100,
            },
        };
        whole.saturating_mul(100).saturating_add(part)
    }
}

/// Writes both loads in percent, rounded up.
impl core::fmt::Display for BusLoad {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} % to {} %", self.percent(self.nominal_bits_per_s), self.worst_percent())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_numbers_saturate() {
        let load = BusLoad::new(0).with_frames(u32::MAX, u32::MAX).with_frames(1, 1);
        assert_eq!(
            (load.frames_per_s(), load.bit_rate(), load.worst_percent()),
            (u32::MAX, 1, u32::MAX)
        );
        assert!(load.nominal().is_finite() && load.nominal() < load.worst_case());
        for ceiling in [f32::NAN, -1.0, 0.0] {
            assert_eq!(load.frames_within(ceiling), 0);
        }
    }

    #[test]
    fn what_fits_below_a_ceiling_does_not_exceed_it() {
        for bit_rate in [125_000, 500_000, 1_000_000] {
            let empty = BusLoad::new(bit_rate);
            let fits = empty.frames_within(0.8);
            assert!(empty.with_frames(1, fits).worst_case() <= 0.8);
            assert!(empty.with_frames(1, fits + 1).worst_case() > 0.8);
        }
    }
}
