//! The codecs, with bytes of the protocol's documentation.

use super::codec::{endpoint, endpoint_value, request};
use super::*;
use crate::motor::{Form, Inquiry, lowest_bit};

/// can-protocol.csv of 0.5.6; the bytes of 0x07, 0x0C and 0x0D are those of `tests/data/wire`.
#[test]
fn a_command_has_the_bytes_of_the_protocol() {
    for (command, expected) in [
        (Command::Stop, "062 [0]"),
        (Command::AxisState(1), "067 [4] 01 00 00 00"),
        (Command::ControllerMode(3, 5), "06B [8] 03 00 00 00 05 00 00 00"),
        (Command::Position(1.5, 0.5, -0.1), "06C [8] 00 00 C0 3F F4 01 9C FF"),
        (Command::Velocity(-2.5, 0.25), "06D [8] 00 00 20 C0 00 00 80 3E"),
        (Command::Torque(0.25), "06E [4] 00 00 80 3E"),
        (Command::Limits(2.0, 10.0), "06F [8] 00 00 00 40 00 00 20 41"),
        (Command::TrajectoryVelocity(2.0), "071 [4] 00 00 00 40"),
        (Command::TrajectoryAcceleration(0.5, 0.25), "072 [8] 00 00 00 3F 00 00 80 3E"),
        (Command::ClearErrors, "078 [1] 00"),
    ] {
        assert_eq!(std::format!("{:?}", command.frame(3)).trim_end(), expected);
    }
}

#[test]
fn thousandths_saturate_and_round_to_nearest() {
    for (value, expected) in [
        (0.0, [0, 0]),
        (0.0014, [1, 0]),
        (0.0016, [2, 0]),
        (-0.0016, [0xFE, 0xFF]),
        (1e9, [0xFF, 0x7F]),
        (-1e9, [0x00, 0x80]),
        (f32::NAN, [0, 0]),
    ] {
        let frame = Command::Position(0.0, value, 0.0).frame(0);
        assert_eq!(frame.bytes()[4..6], expected, "{value}");
    }
}

#[test]
fn a_request_is_a_remote_frame_of_the_length_of_its_message() {
    assert_eq!(std::format!("{:?}", request(1, 0x09)), "029 [8] remote request");
}

/// The example of the documentation of 0.6: `struct.pack('<BHB', ...)` and the value in its own length.
#[test]
fn an_endpoint_is_asked_for_and_written_as_in_the_example_of_the_documentation() {
    let frame = |asked| std::format!("{:?}", endpoint(0, asked).unwrap());
    let read = |number| Inquiry::Read((number, Form::U8, 0));
    let write = |form, value| Inquiry::Write((0x0102, form, 0), value);
    assert_eq!(frame(read(0x1234)), "004 [4] 00 34 12 00");
    assert_eq!(frame(write(Form::U8, 1.0)), "004 [5] 01 02 01 00 01");
    assert_eq!(frame(write(Form::F32, 0.1)), "004 [8] 01 02 01 00 CD CC CC 3D");
    let answer = [0, 0x34, 0x12, 0, 1, 0, 0, 0];
    assert_eq!(endpoint_value(&answer, 5, read(0x1234)), Some(1.0));
    assert_eq!(endpoint_value(&answer, 4, read(0x1234)), None, "no value");
    assert_eq!(endpoint_value(&answer, 5, read(0x1235)), None, "of another endpoint");
}

#[test]
fn a_heartbeat_that_the_firmware_never_sends_is_none() {
    for (at, value) in [(5, 2), (6, 2), (7, 2), (7, 0x40), (5, 14)] {
        let mut data = [0, 0, 0, 0, 1, 0, 0, 0];
        data[at] = value;
        assert_eq!(Heartbeat::decode(&data, Firmware::V0_5), None, "byte {at}: {value}");
        assert!(Heartbeat::decode(&data, Firmware::V0_6).is_some());
    }
}

#[test]
fn an_error_code_is_the_lowest_bit_from_1_and_beside_it_the_module() {
    let code = |data| Heartbeat::decode(&data, Firmware::V0_5).unwrap().error_code();
    assert_eq!(code([0, 0, 0, 0, 1, 0, 0, 0x80]), 0);
    assert_eq!(code([1, 0, 0, 0, 1, 0, 0, 0]), 1); // INVALID_STATE
    assert_eq!(code([0, 0x48, 0, 0, 1, 1, 1, 1]), 12); // WATCHDOG_TIMER_EXPIRED, and a stop
    assert_eq!(code([0, 0, 0, 0x80, 1, 0, 0, 0]), 32);
    assert_eq!(code([0, 0, 0, 0, 1, 1, 1, 1]), 33);
    assert_eq!(code([0, 0, 0, 0, 1, 0, 1, 0]), 34);
    assert_eq!(code([0, 0, 0, 0, 1, 0, 0, 1]), 35);
    assert_eq!(lowest_bit(0), 0);
}

#[test]
fn a_model_has_the_torque_constant_of_its_velocity_constant() {
    for model in Model::ALL {
        let kv = 8.27 / model.torque_constant();
        let again = Model::new(model.name(), kv).unwrap();
        assert!((again.torque_constant() / model.torque_constant() - 1.0).abs() < 1e-6);
    }
    for kv in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(Model::new("none", kv).is_err());
    }
}
