use super::CommandFrame;
use super::codec::{ErrorTable, Range, to_raw};
use crate::encoder::GearRatio;
use crate::motor::Capability;
use crate::units::{Current, Voltage};

/// Facts of one motor model: the only home of each number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facts {
    /// The name in errors and logs.
    pub name: &'static str,
    /// The highest id; the lowest is 1.
    pub ids: u8,
    pub(super) command: [CommandFrame; 2],
    /// The feedback id less the motor's id.
    pub feedback_base: u16,
    /// The largest command, on the wire.
    pub command_raw: i16,
    /// The largest command, in A or V.
    pub command_full_scale: f32,
    /// Quantity of the command: [`Capability::Current`] in A, or [`Capability::Voltage`] in nominal V.
    pub control: Capability,
    /// The current feedback at [`current_full_scale_a`](Self::current_full_scale_a), on the wire.
    pub current_raw: i16,
    /// Amperes at [`current_raw`](Self::current_raw).
    pub current_full_scale_a: f32,
    /// The gearbox of the motor as sold.
    pub gear: GearRatio,
    /// Torque at the output shaft of that gearbox, in Nm for each ampere.
    pub torque_constant_nm_per_a: f32,
    /// Speed of the output shaft of that gearbox without load at 24 V, in rpm.
    pub no_load_rpm: f32,
    /// Whether byte 6 of the feedback is a temperature.
    pub has_temperature: bool,
    /// Temperatures in °C from which the output falls, and at which the output is zero, unless set by its
    /// [`HealthConfig`](crate::motor::HealthConfig).
    pub temperatures_c: (i16, i16),
    /// No-load speed of the rotor.
    pub(crate) rotor_rpm: u16,
    pub(crate) errors: ErrorTable,
}

impl Facts {
    /// Returns the no-load speed of the rotor in rpm, rounded.
    #[must_use]
    pub const fn rotor_no_load_rpm(&self) -> u16 {
        self.rotor_rpm
    }

    /// Returns the command word of an output in A, or V in voltage mode: the nearest, within the range of the model. NaN gives 0.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Gm6020Voltage, M3508, Model};
    ///
    /// assert_eq!(M3508::FACTS.to_word(10.0), 8192); // 16384 words are 20 A
    /// assert_eq!(M3508::FACTS.to_word(-25.0), -16_384);
    /// assert_eq!(M3508::FACTS.of_word(8192), 10.0);
    /// assert_eq!(Gm6020Voltage::FACTS.of_word(25_000), 24.0); // nominal volts
    /// ```
    #[must_use]
    pub const fn to_word(&self, output: f32) -> i16 {
        to_raw(output, self.command_raw as f32 / self.command_full_scale, self.command_raw)
    }

    /// Returns the output in A, or V in voltage mode, of a command word. A word beyond the range of the model counts as its end.
    #[must_use]
    pub const fn of_word(&self, word: i16) -> f32 {
        let word = Range::within(self.command_raw).nearest(word as i32);
        word as f32 / self.command_raw as f32 * self.command_full_scale
    }

    /// Returns the ids on the wire of the command frame of ids 1..=4, and of that of higher ids.
    #[must_use]
    pub const fn command_ids(&self) -> [u16; 2] {
        let [low, high] = self.command;
        [low.id(), high.id()]
    }

    /// Returns the id on the wire of the command frame, and the slot 0 to 3 in the frame; `None` if the model has no such id.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{M3508, Model};
    ///
    /// assert_eq!(M3508::FACTS.place(6), Some((0x1FF, 1)));
    /// assert_eq!(M3508::FACTS.command_ids(), [0x200, 0x1FF]);
    /// ```
    #[must_use]
    pub const fn place(&self, id: u8) -> Option<(u16, u8)> {
        match self.place_in(id) {
            Some((frame, slot)) => Some((frame.id(), slot)),
            None => None,
        }
    }

    pub(super) const fn place_in(&self, id: u8) -> Option<(CommandFrame, u8)> {
        let [low, high] = self.command;
        match id {
            _ if id > self.ids => None,
            1..=4 => Some((low, id - 1)),
            5..=8 => Some((high, id - 5)),
            _ => None,
        }
    }
}

const M2006_RPM: f32 = 500.0;
const M3508_RPM: f32 = 482.0;
const GM6020_RPM: f32 = 320.0;

const M2006_GEAR: GearRatio = known_gear(36, 1);
const M3508_GEAR: GearRatio = known_gear(3591, 187);

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "facts are below 20 000"
)]
const fn rotor_rpm(output_rpm: f32, gear: GearRatio) -> u16 {
    (output_rpm * gear.as_f32() + 0.5) as u16
}

const fn known_gear(rotor: u16, output: u16) -> GearRatio {
    match GearRatio::new(rotor, output) {
        Ok(gear) => gear,
        Err(_) => GearRatio::DIRECT,
    }
}

// Ids, slots and scale: C610 user guide, pages 8 and 9. Gear, torque constant: taproot, hcs, IFR. No-load speed: one public source (500 rpm
// at the output). The M2006 reports no temperature, so the temperatures, of the C620, have no effect.
static M2006_FACTS: Facts = Facts {
    name: "M2006",
    ids: 8,
    command: [CommandFrame::X200, CommandFrame::X1FF],
    feedback_base: 0x200,
    command_raw: 10_000,
    command_full_scale: 10.0,
    control: Capability::Current,
    current_raw: 10_000,
    current_full_scale_a: 10.0,
    gear: M2006_GEAR,
    torque_constant_nm_per_a: 0.18,
    no_load_rpm: M2006_RPM,
    has_temperature: false,
    temperatures_c: (125, 180),
    rotor_rpm: rotor_rpm(M2006_RPM, M2006_GEAR),
    errors: ErrorTable::C610,
};

// Scale: librm, IFR. Gear, torque constant: taproot, hcs, IFR. No-load speed: two public sources. Temperatures: those of the ESC's own
// warning and fault, error codes 8 and 5.
static M3508_FACTS: Facts = Facts {
    name: "M3508",
    ids: 8,
    command: [CommandFrame::X200, CommandFrame::X1FF],
    feedback_base: 0x200,
    command_raw: 16_384,
    command_full_scale: 20.0,
    control: Capability::Current,
    current_raw: 16_384,
    current_full_scale_a: 20.0,
    gear: M3508_GEAR,
    torque_constant_nm_per_a: 0.3,
    no_load_rpm: M3508_RPM,
    has_temperature: true,
    temperatures_c: (125, 180),
    rotor_rpm: rotor_rpm(M3508_RPM, M3508_GEAR),
    errors: ErrorTable::C620,
};

// Limit 25000: taproot and current manuals. Volts: nominal. Torque constant, no-load speed: hcs, devrm. No error list was found, nor a
// limit of the temperature. Both temperatures are estimates: 100 is 25 K below the C620's warning, and 125.
static GM6020_VOLTAGE_FACTS: Facts = Facts {
    name: "GM6020 (voltage)",
    ids: 7,
    command: [CommandFrame::X1FF, CommandFrame::X2FF],
    feedback_base: 0x204,
    command_raw: 25_000,
    command_full_scale: 24.0,
    control: Capability::Voltage,
    current_raw: 16_384,
    current_full_scale_a: 3.0,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.741,
    no_load_rpm: GM6020_RPM,
    has_temperature: true,
    temperatures_c: (100, 125),
    rotor_rpm: rotor_rpm(GM6020_RPM, GearRatio::DIRECT),
    errors: ErrorTable::None,
};

// Frames and scale: hcs and one more public driver.
static GM6020_CURRENT_FACTS: Facts = Facts {
    name: "GM6020 (current)",
    command: [CommandFrame::X1FE, CommandFrame::X2FE],
    command_raw: 16_384,
    command_full_scale: 3.0,
    control: Capability::Current,
    ..GM6020_VOLTAGE_FACTS
};

mod sealed {
    pub trait Sealed {}
}

/// A motor model of this family, as a type. A handle carries the type, so a target of the wrong kind does not compile.
///
/// # Examples
/// A current for a motor in voltage mode does not compile:
/// ```compile_fail,E0271
/// use drivetrain::dji::{Bus, Config, Gm6020Voltage};
/// use drivetrain::units::Current;
///
/// let mut bus = Bus::new();
/// let yaw = bus.attach(Config::<Gm6020Voltage>::new(1))?;
/// bus.set_current(yaw, Current::from_amperes(1.0))?; // expected `Current`, found `Voltage`
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Model: sealed::Sealed + Copy + core::fmt::Debug + 'static {
    /// The command of the model: a torque [`Current`], or a terminal [`Voltage`].
    type Command;

    /// The facts of this model.
    const FACTS: &'static Facts;
}

macro_rules! models {
    ($($(#[$doc:meta])* $model:ident, $facts:ident, $command:ident;)+) => {
        $(
            $(#[$doc])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub struct $model;

            impl sealed::Sealed for $model {}
            impl Model for $model {
                type Command = $command;

                const FACTS: &'static Facts = &$facts;
            }
        )+

        /// Facts of every model.
        #[cfg(test)]
        pub(super) const ALL_FACTS: &[&Facts] = &[$(&$facts),+];
    };
}

models! {
    /// The M2006 with its C610 ESC: current control, no temperature.
    M2006, M2006_FACTS, Current;
    /// The M3508 with its C620 ESC: current control.
    M3508, M3508_FACTS, Current;
    /// The GM6020 as delivered: voltage control.
    Gm6020Voltage, GM6020_VOLTAGE_FACTS, Voltage;
    /// The GM6020 with current control switched on in RoboMaster Assistant.
    Gm6020Current, GM6020_CURRENT_FACTS, Current;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn each_id_has_its_own_slot_and_no_other_id_has_one() {
        for (facts, first, second) in [
            (M2006::FACTS, CommandFrame::X200, CommandFrame::X1FF),
            (M3508::FACTS, CommandFrame::X200, CommandFrame::X1FF),
            (Gm6020Voltage::FACTS, CommandFrame::X1FF, CommandFrame::X2FF),
            (Gm6020Current::FACTS, CommandFrame::X1FE, CommandFrame::X2FE),
        ] {
            for id in 0..=255 {
                let place = match id {
                    1..=4 => Some((first, id - 1)),
                    8 if facts.ids == 7 => None,
                    5..=8 => Some((second, id - 5)),
                    _ => None,
                };
                assert_eq!(facts.place_in(id), place, "{} #{id}", facts.name);
                let on_wire = place.map(|(frame, slot)| (frame.id(), slot));
                assert_eq!(facts.place(id), on_wire, "{} #{id}", facts.name);
            }
        }
    }

    #[test]
    fn each_model_has_the_two_command_ids_of_the_manual() {
        let facts = [M2006::FACTS, M3508::FACTS, Gm6020Voltage::FACTS, Gm6020Current::FACTS];
        let expected = [[0x200, 0x1FF], [0x200, 0x1FF], [0x1FF, 0x2FF], [0x1FE, 0x2FE]];
        assert_eq!(facts.map(Facts::command_ids), expected);
    }

    #[test]
    fn every_word_is_an_output_and_back_and_what_is_beyond_is_the_end() {
        for facts in ALL_FACTS {
            let most = facts.command_raw;
            for word in i16::MIN..=i16::MAX {
                let output = facts.of_word(word);
                assert!(output.abs() <= facts.command_full_scale, "{} {word}", facts.name);
                let kept = i32::from(word).clamp(-i32::from(most), most.into());
                assert_eq!(i32::from(facts.to_word(output)), kept, "{} {word}", facts.name);
            }
            let beyond =
                [f32::MAX, f32::NEG_INFINITY, f32::NAN].map(|output| facts.to_word(output));
            assert_eq!(beyond, [most, -most, 0], "{}", facts.name);
        }
    }

    #[test]
    fn the_rotor_turns_as_fast_as_the_output_and_the_gear_say_rounded() {
        let rpm = [M2006::FACTS, M3508::FACTS, Gm6020Voltage::FACTS, Gm6020Current::FACTS]
            .map(Facts::rotor_no_load_rpm);
        assert_eq!(rpm, [18_000, 9_256, 320, 320]); // 482 * 3591 / 187 = 9255.97
        for facts in ALL_FACTS {
            assert_eq!(facts.rotor_rpm, rotor_rpm(facts.no_load_rpm, facts.gear), "{}", facts.name);
        }
    }

    proptest! {
        /// Law: the nearest command is within the range, 0 is always within, and a command within is kept.
        #[test]
        fn the_nearest_is_within(limit in 0..=i16::MAX, raw: i32, negative: bool, positive: bool) {
            let range = Range::within(limit);
            let range = if negative { range } else { range.and(Range::between(0, i16::MAX)) };
            let range = if positive { range } else { range.and(Range::between(i16::MAX, 0)) };
            let nearest = range.nearest(raw);
            prop_assert!(range.contains(nearest.into()) && range.contains(0));
            prop_assert!(nearest >= 0 || negative);
            prop_assert!(nearest <= 0 || positive);
            prop_assert_eq!(range.contains(raw), i32::from(nearest) == raw);
            let end = i32::from(limit);
            let allowed = (if negative { -end } else { 0 })..=(if positive { end } else { 0 });
            prop_assert_eq!(range.contains(raw), allowed.contains(&raw));
            prop_assert_eq!(range.is_end(nearest), nearest != 0 && !allowed.contains(&(i32::from(nearest) + i32::from(nearest.signum()))));
        }
    }
}
