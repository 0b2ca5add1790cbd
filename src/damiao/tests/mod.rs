//! Facts of the models and the codec of registers.

use super::codec::inquiry;
use super::*;
use crate::motor::Inquiry;
use crate::wire::mit::Ranges;

#[test]
fn the_ranges_of_the_table_are_valid() {
    for model in Model::ALL {
        let (pmax, vmax, tmax) = (model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm());
        assert_eq!(Ranges::new(pmax, vmax, tmax).as_ref(), Ok(model.ranges()), "{}", model.name());
        assert_eq!(Model::new(model.name(), pmax, vmax, tmax), Ok(*model));
    }
}

/// python-damiao-driver: id low, id high, 0x33 read, 0x55 write or 0xAA store, register, value with the low byte first.
#[test]
fn a_question_for_a_register_has_the_bytes_of_the_protocol() {
    for (asked, expected) in [
        (Inquiry::Read(Register::ControlMode), "7FF [8] 03 00 33 0A 00 00 00 00"),
        (Inquiry::Write(Register::Timeout, 2_000.0), "7FF [8] 03 00 55 09 D0 07 00 00"),
        (Inquiry::Write(Register::TorqueRange, 10.0), "7FF [8] 03 00 55 17 00 00 20 41"),
        (Inquiry::Store, "7FF [8] 03 00 AA 01 00 00 00 00"),
    ] {
        assert_eq!(std::format!("{:?}", inquiry(3, asked)), expected);
    }
}

#[test]
fn an_integer_register_holds_whole_numbers_only() {
    for (register, value, holds) in [
        (Register::Timeout, 2_000.0, true),
        (Register::Timeout, 0.5, false),
        (Register::Timeout, -1.0, false),
        (Register::Timeout, 16_777_216.0, false),
        (Register::TorqueRange, 0.5, true),
        (Register::TorqueRange, f32::NAN, false),
    ] {
        assert_eq!(register.form().holds(value), holds, "{register:?} {value}");
    }
}
