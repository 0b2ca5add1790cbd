//! Facts of the models and the codecs.

use super::codec::{FAULTS, VALUE, answer, register};
use super::*;
use crate::motor::Impedance;
use crate::units::{Angle, AngularVelocity};
use crate::wire::mit::Ranges;
use std::format;

#[test]
fn the_ranges_of_the_table_are_valid() {
    for model in Model::ALL {
        let (stiffness, damping) = model.ranges().gains();
        let ranges = Ranges::new(model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm());
        let ranges = ranges.and_then(|ranges| ranges.with_gains(stiffness, damping));
        assert_eq!(ranges.as_ref(), Ok(model.ranges()), "{}", model.name());
        let made = Model::new(model.name(), *model.ranges(), model.current_a()).unwrap();
        assert_eq!(made == *model, model.has_timeout(), "all but the CyberGear");
    }
    let stiff: std::vec::Vec<_> = Model::ALL
        .iter()
        .filter(|model| model.ranges().gains() == (5_000.0, 100.0))
        .map(Model::name)
        .collect();
    assert_eq!(stiff, ["RS03", "RS04", "RS06"]);
}

#[test]
fn the_count_times_65535_is_the_range() {
    for model in Model::ALL {
        let (most, count) = (model.most(), model.count());
        let parts = |it: Impedance| {
            [
                it.angle.as_radians(),
                it.velocity.as_rad_per_s(),
                it.stiffness,
                it.damping,
                it.torque_nm,
            ]
        };
        let spans = [2.0, 2.0, 1.0, 1.0, 2.0];
        for ((most, count), span) in parts(most).into_iter().zip(parts(count)).zip(spans) {
            assert!((count * 65_535.0 / (most * span) - 1.0).abs() < 1e-5, "{}", model.name());
        }
    }
}

#[test]
fn rest_is_within_half_a_count_of_no_torque_and_has_no_gains() {
    for model in Model::ALL {
        let frame = Command::Operation(Impedance::FREE).encode(model, 0xFD, 1);
        assert_eq!(
            format!("{frame:?}"),
            "017FFF01 [8] 7F FF 7F FF 00 00 00 00",
            "{}",
            model.name()
        );
    }
}

#[test]
fn a_command_that_is_no_number_is_rest() {
    let rest = Command::Operation(Impedance::FREE).encode(&Model::RS04, 0xFD, 1);
    let full = Impedance {
        angle: Angle::from_radians(12.0),
        velocity: AngularVelocity::from_rad_per_s(15.0),
        stiffness: 5_000.0,
        damping: 100.0,
        torque_nm: 120.0,
    };
    let with = |change: fn(&mut Impedance)| {
        let mut command = full;
        change(&mut command);
        Command::Operation(command).encode(&Model::RS04, 0xFD, 1)
    };
    for change in [
        |command: &mut Impedance| command.angle = Angle::from_radians(f32::NAN),
        |command: &mut Impedance| command.velocity = AngularVelocity::from_rad_per_s(f32::NAN),
        |command: &mut Impedance| command.stiffness = f32::NAN,
        |command: &mut Impedance| command.damping = f32::NAN,
        |command: &mut Impedance| command.torque_nm = f32::NAN,
    ] {
        assert_eq!(with(change), rest);
    }
    let saturated = with(|command| command.torque_nm = f32::INFINITY);
    assert_eq!(saturated.header() & 0xFF_FF00, 0xFF_FF00);
}

/// RS00 manual, 4.1: the type, the host, the motor; the index and the value with the low byte first.
#[test]
fn frames_have_the_bytes_of_the_manual() {
    for (command, expected) in [
        (Command::Enable, "0300FD7F [8] 00 00 00 00 00 00 00 00"),
        (Command::Disable, "0400FD7F [8] 00 00 00 00 00 00 00 00"),
        (Command::ClearFaults, "0400FD7F [8] 01 00 00 00 00 00 00 00"),
        (Command::SetZero, "0600FD7F [8] 01 00 00 00 00 00 00 00"),
        (Command::SetId(5), "0705FD7F [8] 01 00 00 00 00 00 00 00"),
        (Command::Read(Register::PositionKp), "1100FD7F [8] 1E 70 00 00 00 00 00 00"),
        (Command::Write(Register::RunMode, 2.0), "1200FD7F [8] 05 70 00 00 02 00 00 00"),
        (Command::Write(Register::Timeout, 2_000.0), "1200FD7F [8] 28 70 00 00 D0 07 00 00"),
        (Command::Store, "1600FD7F [8] 01 02 03 04 05 06 07 08"),
    ] {
        assert_eq!(format!("{:?}", command.encode(&Model::RS00, 0xFD, 127)), expected);
    }
}

#[test]
fn a_parameter_that_cannot_be_read_has_no_value() {
    let frame = |raw, data| crate::frame::CanFrame::of(crate::frame::extended_id(raw), data);
    let data = [0x28, 0x70, 0, 0, 0xD0, 0x07, 0, 0];
    assert_eq!(answer(&frame(0x1100_01FD, data)), Some((VALUE, true, data)));
    assert_eq!(answer(&frame(0x1101_01FD, data)), Some((VALUE, false, data)));
    assert_eq!(answer(&frame(0x1500_01FD, data)), Some((FAULTS, true, data)));
    assert_eq!(answer(&frame(0x0280_01FD, data)), None);
    assert_eq!((register(0x7028), register(0x7003)), (Some(Register::Timeout), None));
}

#[test]
fn an_integer_parameter_holds_whole_numbers_of_its_width_only() {
    for (register, value, holds) in [
        (Register::Timeout, 2_000.0, true),
        (Register::Timeout, 0.5, false),
        (Register::Timeout, -1.0, false),
        (Register::Timeout, 16_777_216.0, false),
        (Register::RunMode, 255.0, true),
        (Register::RunMode, 256.0, false),
        (Register::ReportTime, 65_536.0, false),
        (Register::TorqueLimit, 0.5, true),
        (Register::TorqueLimit, f32::NAN, false),
    ] {
        assert_eq!(register.form().holds(value), holds, "{register:?} {value}");
    }
    let value = Register::RunMode.form().value_of([5, 0xFF, 0xFF, 0xFF]);
    assert_eq!(value.to_bits(), 5.0_f32.to_bits());
}

/// An RS03 with the kp of another drive would be ten times as stiff as asked.
#[test]
fn another_range_of_the_position_keeps_those_of_the_gains() {
    let old = Model::RS03.with_position_range(12.5).unwrap();
    assert_eq!(old.ranges().gains(), (5_000.0, 100.0));
    assert_eq!((old.pmax_rad(), old.vmax_rad_per_s(), old.tmax_nm()), (12.5, 20.0, 60.0));
    let soft = old.with_gain_ranges(500.0, 5.0).unwrap();
    assert_eq!((soft.ranges().gains(), soft.pmax_rad()), ((500.0, 5.0), 12.5));
    assert!(old.with_gain_ranges(0.0, 5.0).is_err() && old.with_position_range(f32::NAN).is_err());
}
