//! Errors of attaching a motor.

use crate::motor::{BusLoad, MotorName};

/// Reason for a refused motor. The bus stays as before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum AttachError {
    /// The model has no such id.
    Id {
        /// The refused motor.
        motor: MotorName,
        /// The highest id of its model.
        highest: u8,
    },
    /// Two motors cannot share a bus.
    Collision {
        /// The refused motor.
        motor: MotorName,
        /// The attached motor.
        with: MotorName,
        /// The feedback id of both.
        feedback_id: u16,
        /// The id of the common command frame, and the common slot in the frame, if there is one.
        slot: Option<(u16, u8)>,
    },
    /// A parameter of the configuration is not usable.
    Parameter {
        /// The refused motor.
        motor: MotorName,
        /// The name of the parameter.
        parameter: &'static str,
    },
    /// A proportional gain is impossible for the model: the command for the smallest error in the feedback exceeds the whole range.
    ///
    /// The gains are whole numbers in the unit of the loop: A, or V in voltage mode, per rad/s of the output shaft, or rad/s per rad.
    Gain {
        /// The refused motor.
        motor: MotorName,
        /// The name of the gain and of its loop.
        parameter: &'static str,
        /// The configured gain.
        value: u32,
        /// The highest gain for the model.
        highest: u32,
    },
    /// The bus load would exceed its ceiling: lower the rate of the feedback, or use a second bus.
    Load {
        /// The refused motor.
        motor: MotorName,
        /// The load with this motor.
        load: BusLoad,
        /// The ceiling, in percent.
        ceiling_percent: u16,
        /// The highest feedback rate of all motors below the ceiling, in Hz; 0 if the commands alone exceed the ceiling.
        feedback_hz: u32,
    },
    /// The bus has no free slot: use a larger capacity, `Bus<B, N>`.
    Full {
        /// The refused motor.
        motor: MotorName,
        /// The capacity of the bus, in motors.
        capacity: u8,
    },
    /// This place was attached and detached 16 times; a further handle could be confused with an old one.
    WornOut {
        /// The refused motor.
        motor: MotorName,
    },
}

/// An impossible proportional gain for a model, and its bound.
#[derive(Debug, Clone, Copy)]
pub(super) struct SteepGain {
    pub(super) parameter: &'static str,
    pub(super) value: u32,
    pub(super) highest: u32,
}

impl AttachError {
    /// The length of the longest text of an error in bytes.
    pub const LONGEST: usize = 144;

    /// Writes the error in words to `text`, and returns it; `const`, so a `const` wiring can fail to compile with this text.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{AttachError, Bus, Config, M3508};
    ///
    /// let error = Bus::new().attach(Config::<M3508>::new(9)).unwrap_err();
    /// assert_eq!(error.message(&mut [0; AttachError::LONGEST]), "M3508 #9: the id is not within 1..=8");
    /// ```
    #[must_use]
    pub const fn message<'t>(&self, text: &'t mut [u8; Self::LONGEST]) -> &'t str {
        let message = self.in_words();
        *text = message.text;
        let Some((text, _)) = text.split_at_checked(message.length) else { return "" };
        match core::str::from_utf8(text) {
            Ok(text) => text,
            Err(_) => "",
        }
    }

    const fn in_words(&self) -> Message {
        let message = Message::new();
        match self {
            Self::Id { motor, highest } => {
                message.name(*motor).text(": the id is not within 1..=").number(*highest as u32)
            }
            Self::Collision { motor, with, feedback_id, slot } => {
                let message = message
                    .name(*motor)
                    .text(" collides with ")
                    .name(*with)
                    .text(" on ")
                    .hex(*feedback_id);
                match slot {
                    Some((frame, slot)) => {
                        message.text(" and on slot ").number(*slot as u32).text(" of ").hex(*frame)
                    }
                    None => message,
                }
            }
            Self::Parameter { motor, parameter } => {
                message.name(*motor).text(": ").text(parameter).text(" is not usable")
            }
            Self::Gain { motor, parameter, value, highest } => {
                message.name(*motor).text(": ").gain(parameter, *value, *highest)
            }
            Self::Load { motor, load, ceiling_percent, feedback_hz } => {
                let message = message
                    .name(*motor)
                    .text(": the bus load of up to ")
                    .number(load.worst_percent())
                    .text(" % is above its ceiling of ")
                    .number(*ceiling_percent as u32)
                    .text(" %; ");
                match feedback_hz {
                    0 => message.text("use a second bus"),
                    hz => {
                        message.text("feedback at ").number(*hz).text(" Hz fits, or a second bus")
                    }
                }
            }
            Self::Full { motor, capacity } => message
                .name(*motor)
                .text(": the bus has room for ")
                .number(*capacity as u32)
                .text(if *capacity == 1 { " motor; Bus<_, " } else { " motors; Bus<_, " })
                .number(*capacity as u32 + 1)
                .text("> has more"),
            Self::WornOut { motor } => {
                message.name(*motor).text(": attached and detached too often on this bus")
            }
        }
    }
}

impl core::fmt::Display for AttachError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.message(&mut [0; Self::LONGEST]))
    }
}

impl core::error::Error for AttachError {}

#[cfg(feature = "defmt")]
impl defmt::Format for AttachError {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=str}", self.message(&mut [0; Self::LONGEST]));
    }
}

/// A short text composed in `const` code.
#[derive(Clone, Copy)]
struct Message {
    text: [u8; AttachError::LONGEST],
    length: usize,
}

impl Message {
    const fn new() -> Self {
        Self { text: [0; AttachError::LONGEST], length: 0 }
    }

    const fn byte(mut self, byte: u8) -> Self {
        if self.length < AttachError::LONGEST {
            #[expect(
                clippy::indexing_slicing,
                reason = "checked right above; get_mut is not const"
            )]
            {
                self.text[self.length] = byte;
            }
            self.length += 1;
        }
        self
    }

    const fn text(mut self, text: &str) -> Self {
        let mut rest = text.as_bytes();
        while let [byte, tail @ ..] = rest {
            self = self.byte(*byte);
            rest = tail;
        }
        self
    }

    const fn number(self, number: u32) -> Self {
        let mut message = self;
        let mut unit = 1_000_000_000;
        // After the ones, the unit is zero: the division then ends the loop.
        while let Some(leading) = number.checked_div(unit) {
            if leading > 0 || unit == 1 {
                message = message.byte(b'0' + (leading % 10) as u8);
            }
            unit /= 10;
        }
        message
    }

    const fn hex(self, number: u16) -> Self {
        let mut message = self.text("0x");
        let mut shift = 12;
        while shift > 0 {
            shift -= 4;
            let digit = (number >> shift & 0xF) as u8;
            message = message.byte(if digit < 10 { b'0' + digit } else { b'A' + digit - 10 });
        }
        message
    }

    const fn gain(self, parameter: &str, value: u32, highest: u32) -> Self {
        self.text(parameter)
            .text(" is ")
            .number(value)
            .text(", at most ")
            .number(highest)
            .text(" in SI units of the output shaft: WordGains converts words per rpm")
    }

    const fn name(self, motor: MotorName) -> Self {
        self.text(motor.model()).text(" #").number(motor.id() as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    const GM6020: MotorName = MotorName::new("GM6020 (current)", 1);
    const M3508: MotorName = MotorName::new("M3508", 5);

    fn written(message: &Message) -> &str {
        core::str::from_utf8(&message.text[..message.length]).unwrap()
    }

    #[test]
    fn a_collision_names_both_motors_the_id_and_the_slot() {
        let collision =
            |slot| AttachError::Collision { motor: GM6020, with: M3508, feedback_id: 0x205, slot };
        let message = collision(None).to_string();
        assert_eq!(message, "GM6020 (current) #1 collides with M3508 #5 on 0x205");
        let message = collision(Some((0x1FF, 0))).to_string();
        assert_eq!(
            message,
            "GM6020 (current) #1 collides with M3508 #5 on 0x205 and on slot 0 of 0x1FF"
        );
    }

    #[test]
    fn numbers_are_written_in_full() {
        for number in [0, 9, 10, 109, 1_000_000_000, u32::MAX] {
            let message = Message::new().number(number);
            assert_eq!(written(&message), number.to_string());
        }
        for (number, text) in [(0x0A9, "0x0A9"), (0x2FF, "0x2FF"), (0, "0x000")] {
            assert_eq!(written(&Message::new().hex(number)), text);
        }
    }

    #[test]
    fn the_other_errors_name_motor_and_parameter() {
        let id = AttachError::Id { motor: MotorName::new("M2006", 109), highest: 8 };
        assert_eq!(id.to_string(), "M2006 #109: the id is not within 1..=8");
        let parameter = AttachError::Parameter { motor: M3508, parameter: "kp" };
        assert_eq!(parameter.to_string(), "M3508 #5: kp is not usable");
    }

    #[test]
    fn a_steep_gain_tells_value_bound_and_remedy_and_is_not_cut() {
        let motor = MotorName::new("GM6020 (voltage)", 7);
        let (parameter, value, highest) = ("kp of the position loop", u32::MAX, 1_263_787);
        assert_eq!(
            AttachError::Gain { motor, parameter, value, highest }.to_string(),
            "GM6020 (voltage) #7: kp of the position loop is 4294967295, at most 1263787 \
             in SI units of the output shaft: WordGains converts words per rpm"
        );
    }

    #[test]
    fn an_overload_names_motor_load_ceiling_and_what_to_change() {
        let load = BusLoad::new(1_000_000).with_frames(8, 1_000);
        let motor = MotorName::new("GM6020 (voltage)", 7);
        let error = |feedback_hz| {
            AttachError::Load { motor, load, ceiling_percent: 90, feedback_hz }.to_string()
        };
        let why = "GM6020 (voltage) #7: the bus load of up to 108 % is above its ceiling of 90 %; ";
        assert_eq!(error(0), std::format!("{why}use a second bus"));
        assert_eq!(
            error(100_000),
            std::format!("{why}feedback at 100000 Hz fits, or a second bus")
        );
    }

    #[test]
    fn a_message_beyond_its_capacity_is_cut() {
        let long = core::str::from_utf8(&[b'x'; 200]).unwrap().to_string();
        assert_eq!(written(&Message::new().text(&long)).len(), AttachError::LONGEST);
    }
}
