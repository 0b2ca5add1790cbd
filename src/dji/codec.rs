//! The codec: values to words of command frames, and feedback frames to values.

use crate::encoder::{Homing, Position};
use crate::frame::CanFrame;
use crate::motor::{Conditions, Link, MotorName, Severity};
use crate::units::{AngularVelocity, Current};

/// A feedback frame in integers, as on the wire.
///
/// # Examples
/// The first frame of a real C620 at rest:
/// ```
/// use drivetrain::dji::Feedback;
///
/// let feedback = Feedback::decode(&[0x0E, 0x16, 0x00, 0x00, 0xFF, 0xFD, 0x21, 0x00]).ok_or("angle")?;
/// assert_eq!((feedback.angle(), feedback.rpm(), feedback.current()), (3606, 0, -3));
/// assert_eq!((feedback.temperature(), feedback.error()), (33, 0));
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Feedback {
    /// Angle in the upper half, speed in the lower.
    motion: u32,
    /// Error in the upper byte, then temperature, then current in the order of the wire.
    condition: u32,
}

impl Feedback {
    pub(super) const NONE: Self = Self { motion: 0, condition: 0 };

    /// Takes the eight bytes of a feedback frame. Returns `None` for an angle above 8191, which no motor of this family reports.
    #[must_use]
    #[inline(always)]
    pub const fn decode(data: &[u8; 8]) -> Option<Self> {
        let [a, b, c, d, e, f, g, h] = *data;
        let feedback = Self {
            motion: u32::from_be_bytes([a, b, c, d]),
            condition: u32::from_le_bytes([e, f, g, h]),
        };
        if feedback.motion < (8192 << 16) { Some(feedback) } else { None }
    }

    /// Takes a frame of 8 bytes with a possible angle and without an error code, with one comparison for all. `None` does not name the
    /// reason.
    #[inline(always)]
    pub(super) const fn without_error(frame: &CanFrame) -> Option<Self> {
        // As one number, so each half is loaded as a word: a byte read alone would be loaded alone.
        let words = u64::from_le_bytes(*frame.bytes());
        #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
        let (motion, condition) = ((words as u32).swap_bytes(), (words >> 32) as u32);
        // For the id of a motor, the compiler knows that the frame is whole.
        let unusual = !frame.is_whole() as u32 | (motion >> 29) | (condition >> 24);
        if unusual != 0 {
            return None;
        }
        Some(Self { motion, condition })
    }

    /// Returns the eight bytes of the feedback frame.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        let ([a, b, c, d], [e, f, g, h]) =
            (self.motion.to_be_bytes(), self.condition.to_le_bytes());
        [a, b, c, d, e, f, g, h]
    }

    /// Returns the rotor angle in counts: 0 to 8191.
    #[must_use]
    pub const fn angle(self) -> u16 {
        (self.motion >> 16) as u16
    }

    /// Returns the rotor speed in rpm.
    #[must_use]
    pub const fn rpm(self) -> i16 {
        let [.., high, low] = self.motion.to_be_bytes();
        i16::from_be_bytes([high, low])
    }

    /// Returns the torque current in the raw scale of the model.
    #[must_use]
    pub const fn current(self) -> i16 {
        let [high, low, ..] = self.condition.to_le_bytes();
        i16::from_be_bytes([high, low])
    }

    /// Returns byte 6: the temperature in °C, on models with a sensor.
    #[must_use]
    pub const fn temperature(self) -> u8 {
        let [_, _, temperature, _] = self.condition.to_le_bytes();
        temperature
    }

    /// Returns bytes 7 and 6: the temperature, or a larger value if there is an error.
    #[inline(always)]
    pub(super) const fn error_and_temperature(self) -> u32 {
        self.condition >> 16
    }

    /// Returns byte 7: the error code; see [`ErrorCode`].
    #[must_use]
    pub const fn error(self) -> u8 {
        let [.., error] = self.condition.to_le_bytes();
        error
    }
}

impl core::fmt::Debug for Feedback {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Feedback")
            .field("angle", &self.angle())
            .field("rpm", &self.rpm())
            .field("current", &self.current())
            .field("temperature", &self.temperature())
            .field("error", &self.error())
            .finish()
    }
}

/// An error of an ESC, from byte 7. If several errors hold, the ESC reports the smallest code.
///
/// Sources: two public drivers for each ESC (hcs and IFR for C620; two MR libraries for C610). A code outside the ESC's list is kept as
/// received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ErrorCode {
    /// 1, C620: the motor's memory chip cannot be read (power-on self test).
    MemoryChip,
    /// 2: the supply voltage is too high (power-on self test).
    SupplyVoltage,
    /// 3: the three phases are not connected.
    PhaseLoss,
    /// 4: the position sensor sends no data.
    PositionSensor,
    /// 5, C620: the motor is at 180 °C or above.
    TemperatureLimit,
    /// 6, C610: the motor is stalled.
    Stalled,
    /// 7: calibration failed.
    Calibration,
    /// 8, C620: the motor is at 125 °C or above. A warning.
    TemperatureWarning,
    /// A code outside the list of this ESC.
    Unlisted(u8),
}

impl core::fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::MemoryChip => "motor memory chip not accessible",
            Self::SupplyVoltage => "supply voltage too high",
            Self::PhaseLoss => "phases not connected",
            Self::PositionSensor => "position sensor lost",
            Self::TemperatureLimit => "180 °C reached",
            Self::Stalled => "stalled",
            Self::Calibration => "calibration failed",
            Self::TemperatureWarning => "125 °C reached",
            Self::Unlisted(code) => return write!(f, "unlisted code {code}"),
        })
    }
}

/// List of codes of an ESC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ErrorTable {
    C610,
    C620,
    /// No list was found: every code is kept as received.
    None,
}

impl ErrorTable {
    pub(crate) const fn read(self, code: u8) -> Option<ErrorCode> {
        Some(match (code, self) {
            (0, _) => return None,
            (code, Self::None) => ErrorCode::Unlisted(code),
            (1, Self::C620) => ErrorCode::MemoryChip,
            (2, _) => ErrorCode::SupplyVoltage,
            (3, _) => ErrorCode::PhaseLoss,
            (4, _) => ErrorCode::PositionSensor,
            (5, Self::C620) => ErrorCode::TemperatureLimit,
            (6, Self::C610) => ErrorCode::Stalled,
            (7, _) => ErrorCode::Calibration,
            (8, Self::C620) => ErrorCode::TemperatureWarning,
            (code, _) => ErrorCode::Unlisted(code),
        })
    }
}

impl ErrorTable {
    /// Returns the severity of a code. The C620's 8 is a warning. All other codes, also unlisted ones, are faults, as in public drivers.
    /// The C610's 6 (stalled) is a warning here: a jammed feeder frees itself by turning back, which is impossible after a fault has
    /// relaxed the motor. Without a known list the severity is unknown, and every code is a warning.
    pub(crate) const fn severity(self, code: u8) -> Option<Severity> {
        Some(match (code, self) {
            (0, _) => return None,
            (8, Self::C620) | (6, Self::C610) | (_, Self::None) => Severity::Warning,
            _ => Severity::Fault,
        })
    }
}

/// State of a motor, at its output shaft.
///
/// The positive direction is counter-clockwise looking at the shaft, reversed for a motor attached as
/// [`reversed`](super::Config::reversed).
///
/// Takes 72 bytes on a Cortex-M4F (`docs/figures.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct State {
    /// The motor.
    pub motor: MotorName,
    /// Turns and angle of the output shaft; relative to power-on or absolute: see [`homing`](Self::homing).
    pub position: Position,
    /// Knowledge of the absolute angle.
    pub homing: Homing,
    /// Velocity of the output shaft.
    pub velocity: AngularVelocity,
    /// Torque current.
    pub current: Current,
    /// Torque at the output shaft in Nm, from the current and the torque constant.
    pub torque_nm: f32,
    /// Motor temperature in °C; `None` on C610, which has no sensor.
    pub temperature_c: Option<i16>,
    /// The reported error of the ESC.
    pub error: Option<ErrorCode>,
    /// Rotor counts in the direction of the shaft since the first frame (which counts its angle) or since the last setting of zero; 8192 a
    /// turn, exact.
    pub rotor_counts: i64,
    /// Number of feedback gaps that left the number of rotor turns in doubt, saturating.
    pub ambiguous_gaps: u16,
    /// Number of NaN or infinite targets, saturating.
    pub refused_targets: u16,
    /// Number of expired targets, each of which relaxed the motor; saturating.
    pub forgotten_targets: u16,
    /// The conditions that hold.
    pub conditions: Conditions,
    /// The link, as of the last update or frame.
    pub link: Link,
    /// The last frame as received.
    pub feedback: Feedback,
}

/// Converts a command to the nearest value on the wire, saturated at ±`limit`; NaN gives 0.
///
/// Odd-symmetric: `to_raw(-x) == -to_raw(x)` for every `x` except NaN.
#[inline]
pub(super) const fn to_raw(value: f32, raw_per_unit: f32, limit: i16) -> i16 {
    let scaled = value * raw_per_unit;
    #[expect(clippy::cast_possible_truncation, reason = "saturates, NaN gives 0")]
    let halves = (scaled + scaled) as i32;
    // Half of the value, ties away from zero: the shift rounds down, which is away from zero for negative values.
    saturate((halves >> 1) + (halves & !(halves >> 31) & 1), Range::within(limit))
}

/// From 2^23 to 2^24, floats are exactly the whole numbers: a sum with this value is rounded, and its last bits count from here.
const WHOLE: f32 = 1.5 * 8_388_608.0;

/// As [`to_raw`], for the output of a loop in every update. Half a count is rounded to the even neighbour.
#[inline(always)]
pub(super) const fn loop_to_raw(value: f32, raw_per_unit: f32, range: Range) -> i16 {
    let sum = value * raw_per_unit + WHOLE;
    let raw = sum.to_bits().wrapping_sub(WHOLE.to_bits()).cast_signed();
    if !range.contains(raw) {
        return beyond(value, raw_per_unit, range);
    }
    #[expect(clippy::cast_possible_truncation, reason = "within the range")]
    let raw = raw as i16;
    raw
}

/// As [`loop_to_raw`], for an output within the motor's limit, and so within 16 bits.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    reason = "within 16 bits, and the last bits count from zero"
)]
pub(super) const fn free_to_raw(value: f32, raw_per_unit: f32) -> i16 {
    (value * raw_per_unit + WHOLE).to_bits() as i16
}

/// Cold path of [`loop_to_raw`], also for NaN and for values too large for the sum.
#[cold]
#[inline(never)]
const fn beyond(value: f32, raw_per_unit: f32, range: Range) -> i16 {
    range.nearest(to_raw(value, raw_per_unit, i16::MAX) as i32)
}

/// Limits a raw command.
#[inline(always)]
pub(super) const fn saturate(raw: i32, range: Range) -> i16 {
    if !range.contains(raw) {
        return at_the_limit(raw, range);
    }
    #[expect(clippy::cast_possible_truncation, reason = "within the range")]
    let raw = raw as i16;
    raw
}

/// Cold path of [`saturate`].
#[cold]
#[inline(never)]
const fn at_the_limit(raw: i32, range: Range) -> i16 {
    range.nearest(raw)
}

/// Allowed raw commands of a motor: all commands between two ends. The range includes 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    lowest: i16,
    span: u16,
}

impl Range {
    /// Only 0.
    pub(super) const ZERO: Self = Self::within(0);

    /// Both directions up to `limit`, which must not be negative.
    pub(super) const fn within(limit: i16) -> Self {
        Self::between(limit, limit)
    }

    /// Down to -`below` and up to `above`, neither of which may be negative.
    pub(super) const fn between(below: i16, above: i16) -> Self {
        Self { lowest: -below, span: below.cast_unsigned() + above.cast_unsigned() }
    }

    /// Returns the commands within both ranges.
    pub(super) fn and(self, other: Self) -> Self {
        Self::between(-self.lowest.max(other.lowest), self.highest().min(other.highest()))
    }

    /// Tells whether a command is within the range. One comparison covers both ends: as unsigned, a value below the lowest is far above.
    #[inline]
    pub(super) const fn contains(self, raw: i32) -> bool {
        raw.wrapping_sub(self.lowest as i32).cast_unsigned() <= self.span as u32
    }

    /// Tells whether a command is not 0 and at an end of the range.
    pub(super) const fn is_end(self, raw: i16) -> bool {
        (raw < 0 && raw <= self.lowest) || (raw > 0 && raw >= self.highest())
    }

    /// Returns the nearest command within the range.
    pub(super) const fn nearest(self, raw: i32) -> i16 {
        if raw < self.lowest as i32 {
            return self.lowest;
        }
        if raw > self.highest() as i32 {
            return self.highest();
        }
        #[expect(clippy::cast_possible_truncation, reason = "between two of 16 bits")]
        let raw = raw as i16;
        raw
    }

    const fn highest(self) -> i16 {
        self.lowest.wrapping_add_unsigned(self.span)
    }
}

/// The temperature byte that stands for -40 °C.
pub(super) const FIRST_BELOW_ZERO: u8 = 216;

/// Some drivers read the byte as signed, others as unsigned: -40 to -1 is more plausible than 216 to 255.
pub(super) fn celsius(byte: u8) -> i16 {
    if byte < FIRST_BELOW_ZERO { byte.into() } else { i16::from(byte) - 256 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    #[test]
    fn an_angle_above_8191_refuses_the_whole_frame() {
        assert_eq!(Feedback::decode(&[0x20, 0, 0, 0, 0, 0, 0, 0]), None);
        assert_eq!(Feedback::decode(&[0xFF; 8]), None);
        assert!(Feedback::decode(&[0x1F, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]).is_some());
    }

    /// A whole frame with a possible angle and no error: each of the three alone refuses it.
    #[test]
    fn without_error_is_decode_of_all_that_is_usual() {
        use embedded_can::{Frame, StandardId};
        let id = StandardId::new(0x201).unwrap();
        let usual = [0x1F, 0xFF, 0x80, 0x01, 0x7F, 0xFE, 250, 0];
        let frame = CanFrame::new(id, &usual).unwrap();
        let feedback = Feedback::without_error(&frame).unwrap();
        assert_eq!(Some(feedback), Feedback::decode(&usual));
        assert_eq!((feedback.angle(), feedback.rpm(), feedback.current()), (8191, -32767, 0x7FFE));
        assert_eq!((feedback.temperature(), feedback.error_and_temperature()), (250, 250));

        assert_eq!(Feedback::without_error(&CanFrame::new(id, &usual[..7]).unwrap()), None);
        for (byte, value) in [(0, 0x20), (0, 0x80), (7, 1), (7, 0x80)] {
            let mut data = usual;
            data[byte] = value;
            assert_eq!(Feedback::without_error(&CanFrame::new(id, &data).unwrap()), None);
        }
        // Two things wrong at once, of the same size.
        let short_and_far = CanFrame::new(id, &[0x20, 0, 0, 0, 0, 0, 0]).unwrap();
        let far_with_error = CanFrame::new(id, &[0x20, 0, 0, 0, 0, 0, 0, 1]).unwrap();
        assert_eq!(Feedback::without_error(&short_and_far), None);
        assert_eq!(Feedback::without_error(&far_with_error), None);
        let faulty = Feedback::decode(&[0, 0, 0, 0, 0, 0, 9, 3]).unwrap();
        assert_eq!(faulty.error_and_temperature(), 0x309);
    }

    #[test]
    fn texts_say_what_came() {
        use std::format;
        let feedback = Feedback::decode(&[0, 1, 0, 2, 0, 3, 4, 5]).unwrap();
        assert_eq!(
            format!("{feedback:?}"),
            "Feedback { angle: 1, rpm: 2, current: 3, temperature: 4, error: 5 }"
        );
        assert_eq!(ErrorCode::Stalled.to_string(), "stalled");
        assert_eq!(ErrorCode::Unlisted(6).to_string(), "unlisted code 6");
    }

    #[test]
    fn undocumented_codes_are_kept() {
        assert_eq!(ErrorTable::C620.read(6), Some(ErrorCode::Unlisted(6)));
        for code in [1, 5, 8, 255] {
            assert_eq!(ErrorTable::C610.read(code), Some(ErrorCode::Unlisted(code)));
        }
        assert_eq!((ErrorTable::C610.read(0), ErrorTable::C620.read(0)), (None, None));
    }

    #[test]
    fn warnings_are_few_and_everything_else_is_a_fault() {
        for code in 1..=255 {
            let severity = |table: ErrorTable| table.severity(code);
            let warns = |warning| if warning { Severity::Warning } else { Severity::Fault };
            assert_eq!(severity(ErrorTable::C620), Some(warns(code == 8)));
            assert_eq!(severity(ErrorTable::C610), Some(warns(code == 6)));
            assert_eq!(severity(ErrorTable::None), Some(Severity::Warning));
        }
        assert_eq!(ErrorTable::C620.severity(0), None);
    }

    proptest! {
        /// Law: every byte of a valid frame is kept, in its field of the manual.
        #[test]
        fn decode_then_encode_is_the_frame(angle in 0_u16..8192, rest: [u8; 6]) {
            let [high, low] = angle.to_be_bytes();
            let [a, b, c, d, e, f] = rest;
            let data = [high, low, a, b, c, d, e, f];
            let feedback = Feedback::decode(&data).unwrap();
            prop_assert_eq!(feedback.encode(), data);
            prop_assert_eq!(feedback.angle(), angle);
            prop_assert_eq!(feedback.rpm(), i16::from_be_bytes([a, b]));
            prop_assert_eq!(feedback.current(), i16::from_be_bytes([c, d]));
            prop_assert_eq!((feedback.temperature(), feedback.error()), (e, f));
        }
    }

    #[test]
    fn ties_of_a_loop_go_to_the_even_neighbour() {
        for (value, raw) in [(0.5, 0), (1.5, 2), (2.5, 2), (-0.5, 0), (-1.5, -2), (-2.5, -2)] {
            assert_eq!(loop_to_raw(value, 1.0, Range::within(100)), raw, "{value}");
            assert_eq!(free_to_raw(value, 1.0), raw, "{value}");
        }
    }

    #[test]
    fn ties_of_rounding_go_away_from_zero_and_nan_is_zero() {
        for (value, raw) in [(0.5, 1), (-0.5, -1), (0.49, 0), (-0.0, 0), (f32::NAN, 0), (1e-40, 0)]
        {
            assert_eq!(to_raw(value, 1.0, 100), raw, "{value}");
        }
    }

    proptest! {
        /// Law: saturated, odd-symmetric and monotonic, for any bits.
        #[test]
        fn to_raw_saturates_symmetrically(a in any::<f32>(), b in any::<f32>(), limit in 0_i16..=i16::MAX, scale in -2000.0_f32..2000.0) {
            let raw = |value| to_raw(value, scale, limit);
            prop_assert!(raw(a).unsigned_abs() <= limit.unsigned_abs());
            prop_assert_eq!(raw(-a), -raw(a));
            if a <= b {
                let (low, high) = if scale >= 0.0 { (raw(a), raw(b)) } else { (raw(b), raw(a)) };
                prop_assert!(low <= high);
            }
        }

        /// Law: a loop's output goes to the nearest number too, and is limited the same way.
        #[test]
        fn loop_to_raw_is_to_raw_but_for_ties(value in any::<f32>(), near in -40_000.0_f32..40_000.0, limit in 0_i16..=i16::MAX, scale in -2000.0_f32..2000.0) {
            for value in [value, near / scale, near.round() / scale, (near.round() + 0.5) / scale] {
                let range = Range::within(limit);
                let (raw, other) = (loop_to_raw(value, scale, range), to_raw(value, scale, limit));
                let is_tie = (value * scale).fract().abs().to_bits() == 0.5_f32.to_bits();
                prop_assert!(raw == other || is_tie && raw % 2 == 0 && raw.abs_diff(other) == 1, "{} {} {}", value, raw, other);
                prop_assert_eq!(loop_to_raw(-value, scale, range), -raw);
            }
        }
    }
}
