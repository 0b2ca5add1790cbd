//! Golden frames, each with its origin in `tests/data/robstride/vectors.json`.

use crate::bench::{Bench, operation};
use crate::extended;
use drivetrain::frame::CanFrame;
use drivetrain::motor::Impedance;
use drivetrain::motor::{Devices, DriveProtocol};
use drivetrain::robstride::{Command, Feedback, Model, Motor, Register, Status};
use drivetrain::units::{Angle, AngularVelocity};
use serde_json::Value;

fn vector(id: &str) -> Value {
    let text = include_str!("../data/robstride/vectors.json");
    let file: Value = serde_json::from_str(text).unwrap();
    let vectors = file["vectors"].as_array().unwrap();
    vectors.iter().find(|vector| vector["id"] == id).unwrap_or_else(|| panic!("no {id}")).clone()
}

fn hexadecimal(text: &Value) -> u32 {
    u32::from_str_radix(text.as_str().unwrap().trim_start_matches("0x"), 16).unwrap()
}

fn frame(of: &Value) -> CanFrame {
    let bytes: Vec<u8> = of["data"]
        .as_str()
        .unwrap()
        .split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect();
    extended(hexadecimal(&of["ext_id"]), bytes.try_into().unwrap())
}

fn byte(of: &Value) -> u8 {
    of.as_u64().unwrap().try_into().unwrap()
}

#[test]
fn commands() {
    // A public test of a parameter that no drive has, 0x1234, fixes the places of the bytes; here they hold one of the table.
    for (id, model, command) in [
        ("cybergear.enable", Model::CYBERGEAR, Command::Enable),
        ("cybergear.set_zero", Model::CYBERGEAR, Command::SetZero),
        ("cybergear.run_mode_speed", Model::CYBERGEAR, Command::Write(Register::RunMode, 2.0)),
        ("cybergear.spd_ref", Model::CYBERGEAR, Command::Write(Register::VelocityTarget, 10.0)),
        ("robstride.save", Model::RS00, Command::Store),
        ("robstride.manual.read_loc_kp", Model::RS00, Command::Read(Register::PositionKp)),
    ] {
        let vector = vector(id);
        let (host, motor) = (byte(&vector["input"]["host"]), byte(&vector["input"]["motor"]));
        assert_eq!(command.encode(&model, host, motor), frame(&vector["expect"]), "{id}");
    }
    let vector = vector("cybergear.change_id");
    let sent = Command::SetId(85).encode(&Model::CYBERGEAR, 165, 1);
    assert_eq!(sent.header() & 0x1FFF_FFFF, hexadecimal(&vector["expect"]["ext_id"]));
    assert_eq!(sent.bytes()[0], 1);
}

#[test]
fn parameters_have_their_index_low_byte_first_and_the_value_behind() {
    for (id, command) in [
        ("cybergear.read_param", Command::Read(Register::RunMode)),
        ("cybergear.write_param", Command::Write(Register::Timeout, 0.0)),
    ] {
        let expected = frame(&vector(id)["expect"]);
        let sent = command.encode(&Model::RS00, 165, 1);
        assert_eq!(sent.header(), expected.header(), "{id}");
        let [low, high, a, b, ..] = *sent.bytes();
        assert_eq!([high, low, a, b][..2], [0x70, low]);
        assert_eq!([a, b], [expected.bytes()[2], expected.bytes()[3]]);
    }
}

/// Two public tests round to the nearest count; the vendor's code, and this, truncate: one count less where it is not exact.
#[test]
fn operation_frames_are_those_that_round_or_one_count_below() {
    let moved = Impedance {
        angle: Angle::from_radians(1.0),
        velocity: AngularVelocity::from_rad_per_s(2.0),
        stiffness: 50.0,
        damping: 1.0,
        torque_nm: 3.0,
    };
    for (id, model, motor, command) in [
        ("cybergear.op.zero.round", Model::CYBERGEAR, 66, Impedance::FREE),
        ("robstride.rs02.op", Model::RS02, 1, moved),
    ] {
        let expected = fields(&frame(&vector(id)["expect"]));
        let sent = Command::Operation(command).encode(&model, 0xFD, motor);
        for (ours, rounded) in fields(&sent).into_iter().zip(expected) {
            assert!(ours == rounded || ours + 1 == rounded, "{id}: {ours:X} for {rounded:X}");
        }
    }
}

/// Torque, position, velocity, kp and kd.
fn fields(frame: &CanFrame) -> [u64; 5] {
    let (id, data) = (u64::from(frame.header()), u64::from_be_bytes(*frame.bytes()));
    [id >> 8 & 0xFFFF, data >> 48, data >> 32 & 0xFFFF, data >> 16 & 0xFFFF, data & 0xFFFF]
}

#[test]
#[expect(clippy::float_cmp, reason = "250 tenths")]
fn feedback() {
    let vector = vector("cybergear.status");
    let found = Feedback::decode(&frame(&vector["input"]), &Model::CYBERGEAR).unwrap();
    let expected = &vector["expect"];
    assert_eq!(found.id, byte(&expected["motor"]));
    assert_eq!(found.status, Status::Run);
    assert_eq!(found.faults, byte(&expected["fault_bits"]));
    assert_eq!(f64::from(found.temperature_c), expected["temperature_c"].as_f64().unwrap());
    for (value, name) in [
        (found.measured.position_rad, "p_abs_lt"),
        (found.measured.velocity_rad_per_s, "v_abs_lt"),
        (found.measured.torque_nm, "t_abs_lt"),
    ] {
        assert!(f64::from(value.abs()) < expected[name].as_f64().unwrap(), "{name}: {value}");
    }
}

#[test]
fn a_parameter() {
    let vector = vector("robstride.manual.loc_kp");
    let mut bench = Bench::new(operation());
    bench.own =
        drivetrain::motor::Actuator::new(Motor::new(Model::RS00, 127, operation()).unwrap());
    bench.own.motor_mut().read(Register::PositionKp);
    for _ in 0..200 {
        bench.step();
        let now = bench.now();
        _ = Devices::ingest(&mut bench.own, &frame(&vector["input"]), now);
    }
    assert_eq!(bench.own.motor().register(), Some((Register::PositionKp, 30.0)));
    assert_eq!(bench.own.motor().name().to_string(), "RS00 #127");
}
