//! The payload of drives in MIT mode: Damiao, CubeMars AK, and others after the MIT Mini Cheetah.
//!
//! The drive applies the torque `kp * (position - measured) + kd * (velocity - measured) + torque`, all at the output
//! shaft. Each field of a frame is an unsigned number over a range; the range is a setting of the drive.
//!
//! ```text
//! command   byte 0 ..  1  position 16 | velocity 12 | kp 12 | kd 12 | torque 12 bits   byte 7
//! feedback                position 16 | velocity 12 | torque 12 bits                   5 bytes
//! ```
//!
//! **Eight zero bytes are not rest.** A signed field has its zero in the middle of its range, so eight zero bytes are the
//! largest negative torque. [`Impedance::FREE`](crate::motor::Impedance::FREE) is rest: no gains, and a torque within half a count of zero.
//!
//! ```
//! use drivetrain::motor::Impedance;
//! use drivetrain::wire::mit::Ranges;
//!
//! const J4310: Ranges = match Ranges::new(12.5, 30.0, 10.0) {
//!     Ok(ranges) => ranges,
//!     Err(_) => panic!("the ranges of a DM-J4310 are not valid"),
//! };
//! assert_eq!(J4310.encode(&Impedance::FREE), [0x7F, 0xFF, 0x7F, 0xF0, 0x00, 0x00, 0x07, 0xFF]);
//! assert_eq!(J4310.decode(&[0; 8]).torque_nm, -10.0);
//! # Ok::<(), drivetrain::error::ConfigError>(())
//! ```
//!
//! **A drive continues with its last command** when no other comes: after a cut of the cable or a stop of the program, the drive keeps driving.
//! Only a time-out of its own ends this, and has to be set in the drive. For Damiao the time-out is the register `TIMEOUT` (9), in units of 50 µs,
//! 0 for none: 2000 is 100 ms. The drive then disables itself and reports error 13. Other makes have a setting of their own. Pull the cable with
//! lifted wheels to test the setting.
//!
//! A position saturates at the range of the field, so [`Feedback::position_rad`] at either end of the range is no position: the shaft is there or beyond.
//!
//! Sources: Damiao's protocol and registers as python-damiao-driver documents them; frames of public tests, see `tests/data/wire`.

use crate::error::ConfigError;
use crate::units::{Angle, AngularVelocity};
use impedance::Impedance;

/// The data to enable a drive.
pub const ENABLE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
/// The data to disable a drive.
pub const DISABLE: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD];
/// The data to make the present position zero.
pub const SET_ZERO: [u8; 8] = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE];

/// The second half of the largest command below the special frames, which end with 0xFB to 0xFE.
const HIGHEST_SECOND: u32 = 0xFFFF_FFFA;

const TOP_16: u16 = 0xFFFF;
const TOP_12: u16 = 0x0FFF;

/// Measurements of the drive at the output shaft.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Feedback {
    /// The position in rad.
    pub position_rad: f32,
    /// The velocity in rad/s.
    pub velocity_rad_per_s: f32,
    /// The torque in Nm.
    pub torque_nm: f32,
}

impl Feedback {
    pub(crate) const fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(self.velocity_rad_per_s)
    }
}

/// The ranges of the fields, as set in the drive.
///
/// Position, velocity and torque go from minus to plus their range; the gains from zero. A number outside saturates. The
/// drives truncate to the next lower count and so does this, so zero is sent as half a count below zero.
///
/// # Examples
/// ```
/// use drivetrain::motor::Impedance;
/// use drivetrain::wire::mit::Ranges;
///
/// let ranges = Ranges::new(12.5, 30.0, 10.0)?; // a Damiao DM-J4310
/// let velocity = drivetrain::units::AngularVelocity::from_rad_per_s(6.0);
/// let data = ranges.encode(&Impedance { damping: 1.0, velocity, ..Impedance::FREE });
/// let sent = ranges.decode(&data);
/// assert!((sent.velocity.as_rad_per_s() - 6.0).abs() < 60.0 / 4095.0); // a count
/// assert!((sent.damping - 1.0).abs() < 5.0 / 4095.0);
/// let refused = Ranges::new(12.5, 30.0, -10.0).map_err(|error| error.to_string());
/// assert_eq!(refused, Err("torque range -10: 0.001 to 1000000 are allowed".into()));
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ranges {
    position: Range,
    velocity: Range,
    kp: Range,
    kd: Range,
    torque: Range,
}

impl Ranges {
    /// Takes the ranges of position in rad, velocity in rad/s and torque in Nm. `kp` goes to 500 Nm/rad and `kd` to
    /// 5 Nm s/rad.
    ///
    /// # Errors
    /// Names the first range that is not between 0.001 and 1000000.
    pub const fn new(
        position_rad: f32,
        velocity_rad_per_s: f32,
        torque_nm: f32,
    ) -> Result<Self, ConfigError> {
        let position = Range::around_zero("position range", position_rad);
        let velocity = Range::around_zero("velocity range", velocity_rad_per_s);
        let torque = Range::around_zero("torque range", torque_nm);
        match (position, velocity, torque) {
            (Ok(position), Ok(velocity), Ok(torque)) => {
                let (kp, kd) = (Range::KP, Range::KD);
                Ok(Self { position, velocity, kp, kd, torque })
            }
            (Err(error), ..) | (_, Err(error), _) | (_, _, Err(error)) => Err(error),
        }
    }

    /// Takes valid ranges without a check: the three of [`new`](Self::new), and the largest gains.
    pub(crate) const fn of([position, velocity, torque]: [f32; 3], [kp, kd]: [f32; 2]) -> Self {
        Self {
            position: Range { lower: -position, upper: position },
            velocity: Range { lower: -velocity, upper: velocity },
            kp: Range { lower: 0.0, upper: kp },
            kd: Range { lower: 0.0, upper: kd },
            torque: Range { lower: -torque, upper: torque },
        }
    }

    /// Sets the largest gains, in Nm/rad and Nm s/rad.
    ///
    /// # Errors
    /// Names the first range that is not between 0.001 and 1000000.
    pub const fn with_gains(self, kp: f32, kd: f32) -> Result<Self, ConfigError> {
        match (Range::from_zero("kp range", kp), Range::from_zero("kd range", kd)) {
            (Ok(kp), Ok(kd)) => Ok(Self { kp, kd, ..self }),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    /// Returns the range of the position, in rad.
    #[must_use]
    pub const fn position_rad(&self) -> f32 {
        self.position.upper
    }

    /// Returns the range of the torque, in Nm.
    #[must_use]
    pub const fn torque_nm(&self) -> f32 {
        self.torque.upper
    }

    /// Returns the largest gains, in Nm/rad and Nm s/rad.
    #[must_use]
    pub const fn gains(&self) -> (f32, f32) {
        (self.kp.upper, self.kd.upper)
    }

    /// Returns the range of the velocity, in rad/s.
    #[must_use]
    pub const fn velocity_rad_per_s(&self) -> f32 {
        self.velocity.upper
    }

    /// Writes a command. A field outside its range saturates; if any field is NaN, the whole command is rest.
    ///
    /// The result is never one of the special frames. A command equal to a special frame, with every field at its end, gets
    /// up to four counts less torque.
    #[must_use]
    pub const fn encode(&self, command: &Impedance) -> [u8; 8] {
        let [position, velocity, kp, kd, torque] = self.counts(command, TOP_12);
        let first = position << 16 | velocity << 4 | kp >> 8;
        let second = kp << 24 | kd << 12 | torque;
        let is_special = first == u32::MAX && matches!(second, 0xFFFF_FFFB..=0xFFFF_FFFE);
        let second = if is_special { HIGHEST_SECOND } else { second };
        ((first as u64) << 32 | second as u64).to_be_bytes()
    }

    /// Writes a torque in Nm alone, as [`encode`](Self::encode).
    #[inline]
    pub(crate) const fn encode_torque(&self, torque_nm: f32) -> [u8; 8] {
        let torque = self.torque.counts_or_zero(torque_nm, TOP_12);
        (0x7FFF_7FF0_0000_0000 | torque as u64).to_be_bytes()
    }

    /// Returns the counts of all fields, those of a position of 16 bits.
    #[inline]
    const fn counts(&self, command: &Impedance, top: u16) -> [u32; 5] {
        let rest = [TOP_16 as u32 / 2, top as u32 / 2, 0, 0, top as u32 / 2];
        let Some(torque) = self.torque.counts(command.torque_nm, top) else { return rest };
        if command.is_torque() {
            let [position, velocity, kp, kd, _] = rest;
            return [position, velocity, kp, kd, torque];
        }
        let (Some(position), Some(velocity), Some(kp), Some(kd)) = (
            self.position.counts(command.angle.as_radians(), TOP_16),
            self.velocity.counts(command.velocity.as_rad_per_s(), top),
            self.kp.counts(command.stiffness, top),
            self.kd.counts(command.damping, top),
        ) else {
            return rest;
        };
        [position, velocity, kp, kd, torque]
    }

    /// Writes a command as [`encode`](Self::encode), with 16 bits a field: the data of position, velocity, kp and kd, and the torque, which
    /// some drives have in the id.
    pub(crate) const fn encode_wide(&self, command: &Impedance) -> ([u8; 8], u16) {
        let [position, velocity, kp, kd, torque] = self.counts(command, TOP_16);
        let (first, second) = (position << 16 | velocity, kp << 16 | kd);
        let [.., high, low] = torque.to_be_bytes();
        let data = ((first as u64) << 32 | second as u64).to_be_bytes();
        (data, u16::from_be_bytes([high, low]))
    }

    /// Reads feedback with 16 bits a field.
    #[inline(always)]
    pub(crate) const fn decode_wide(&self, data: &[u8; 6]) -> Feedback {
        let [a, b, c, d, e, f] = *data;
        Feedback {
            position_rad: self.position.value(u16::from_be_bytes([a, b]), TOP_16),
            velocity_rad_per_s: self.velocity.value(u16::from_be_bytes([c, d]), TOP_16),
            torque_nm: self.torque.value(u16::from_be_bytes([e, f]), TOP_16),
        }
    }

    /// Reads a command, as a drive does.
    #[must_use]
    pub const fn decode(&self, data: &[u8; 8]) -> Impedance {
        let [a, b, c, d, e, f, g, h] = *data;
        let ((velocity, kp), (kd, torque)) = (unpair([c, d, e]), unpair([f, g, h]));
        let angle = self.position.value(u16::from_be_bytes([a, b]), TOP_16);
        Impedance {
            angle: Angle::from_radians(angle),
            velocity: AngularVelocity::from_rad_per_s(self.velocity.value(velocity, TOP_12)),
            stiffness: self.kp.value(kp, TOP_12),
            damping: self.kd.value(kd, TOP_12),
            torque_nm: self.torque.value(torque, TOP_12),
        }
    }

    /// Reads the five bytes of a feedback frame: in frames of Damiao, all but the first byte and the last two.
    #[must_use]
    pub const fn decode_feedback(&self, data: &[u8; 5]) -> Feedback {
        let [a, b, c, d, e] = *data;
        let (velocity, torque) = unpair([c, d, e]);
        Feedback {
            position_rad: self.position.value(u16::from_be_bytes([a, b]), TOP_16),
            velocity_rad_per_s: self.velocity.value(velocity, TOP_12),
            torque_nm: self.torque.value(torque, TOP_12),
        }
    }

    /// Writes the five bytes of a feedback frame, as a drive does. A field outside its range saturates, NaN is zero.
    #[must_use]
    pub const fn encode_feedback(&self, feedback: &Feedback) -> [u8; 5] {
        let [_, _, a, b] =
            self.position.counts_or_zero(feedback.position_rad, TOP_16).to_be_bytes();
        let velocity = self.velocity.counts_or_zero(feedback.velocity_rad_per_s, TOP_12);
        let torque = self.torque.counts_or_zero(feedback.torque_nm, TOP_12);
        let [_, c, d, e] = (velocity << 12 | torque).to_be_bytes();
        [a, b, c, d, e]
    }
}

/// Reads two numbers of 12 bits.
const fn unpair([a, b, c]: [u8; 3]) -> (u16, u16) {
    let (a, b, c) = (a as u16, b as u16, c as u16);
    (a << 4 | b >> 4, (b & 0xF) << 8 | c)
}

#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Range {
    lower: f32,
    upper: f32,
}

impl Range {
    /// Of every model of Damiao.
    const KP: Self = Self { lower: 0.0, upper: 500.0 };
    const KD: Self = Self { lower: 0.0, upper: 5.0 };

    const fn around_zero(range: &'static str, upper: f32) -> Result<Self, ConfigError> {
        match Self::from_zero(range, upper) {
            Ok(range) => Ok(Self { lower: -upper, ..range }),
            Err(error) => Err(error),
        }
    }

    const fn from_zero(range: &'static str, upper: f32) -> Result<Self, ConfigError> {
        match ConfigError::check_range(range, upper, 1e-3, 1e6) {
            Ok(()) => Ok(Self { lower: 0.0, upper }),
            Err(error) => Err(error),
        }
    }

    /// Truncates to counts of 0 to `top`; `None` for NaN.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    #[inline]
    const fn counts(self, value: f32, top: u16) -> Option<u32> {
        if value >= self.upper {
            Some(top as u32)
        } else if value > self.lower {
            Some(((value - self.lower) * top as f32 / (self.upper - self.lower)) as u32)
        } else if value.is_nan() {
            None
        } else {
            Some(0)
        }
    }

    /// Truncates; NaN is zero, in the middle of the range.
    #[inline]
    const fn counts_or_zero(self, value: f32, top: u16) -> u32 {
        if let Some(counts) = self.counts(value, top) { counts } else { top as u32 / 2 }
    }

    const fn value(self, counts: u16, top: u16) -> f32 {
        self.lower + counts as f32 * (self.upper - self.lower) / top as f32
    }
}

/// The fields of a command; public as [`motor::Impedance`](crate::motor::Impedance).
pub(crate) mod impedance {
    use crate::units::{Angle, AngularVelocity};

    /// A spring and a damper at the output shaft, with a torque beside both: the target of a joint of an arm or a leg.
    ///
    /// The torque is `stiffness * (angle - measured angle) + damping * (velocity - measured velocity) + torque`, within the limits
    /// of the motor.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::Impedance;
    /// use drivetrain::units::Angle;
    ///
    /// let hold = Impedance { angle: Angle::from_degrees(30.0), stiffness: 20.0, damping: 0.6, ..Impedance::FREE };
    /// assert!(hold.is_finite() && hold.torque_nm == 0.0);
    /// ```
    #[derive(Debug, Clone, Copy, PartialEq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Impedance {
        /// The angle where the spring is at rest, in the range of the motor's own angle: turns count.
        pub angle: Angle,
        /// The velocity at which the damper is at rest.
        pub velocity: AngularVelocity,
        /// The stiffness of the spring in Nm/rad, not negative.
        pub stiffness: f32,
        /// The damping in Nm s/rad, not negative.
        pub damping: f32,
        /// The torque beside both, in Nm; positive is counter-clockwise: the weight of an arm, say.
        pub torque_nm: f32,
    }

    impl Impedance {
        /// Neither spring nor damper, and no torque.
        pub const FREE: Self = Self {
            angle: Angle::ZERO,
            velocity: AngularVelocity::ZERO,
            stiffness: 0.0,
            damping: 0.0,
            torque_nm: 0.0,
        };

        /// Returns a torque alone, in Nm.
        #[must_use]
        pub const fn torque(torque_nm: f32) -> Self {
            Self { torque_nm, ..Self::FREE }
        }

        /// Tells whether each value is finite, and stiffness and damping are not negative.
        #[must_use]
        pub const fn is_finite(&self) -> bool {
            self.angle.is_finite()
                && self.velocity.is_finite()
                && self.stiffness.is_finite()
                && self.damping.is_finite()
                && self.torque_nm.is_finite()
                && self.stiffness >= 0.0
                && self.damping >= 0.0
        }

        pub(super) const fn is_torque(&self) -> bool {
            let Self { angle, velocity, stiffness, damping, torque_nm: _ } = self;
            let [angle, velocity] = [angle.as_radians(), velocity.as_rad_per_s()];
            angle.to_bits() | velocity.to_bits() | stiffness.to_bits() | damping.to_bits() == 0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ranges_of_a_model_are_those_that_a_person_gives() {
        let checked =
            Ranges::new(12.5, 30.0, 10.0).and_then(|ranges| ranges.with_gains(400.0, 4.0));
        assert_eq!(checked, Ok(Ranges::of([12.5, 30.0, 10.0], [400.0, 4.0])));
    }
}
