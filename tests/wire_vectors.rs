//! The golden vectors of `data/wire/vectors.json`, through the public face.

#![cfg(test)]

use drivetrain::geometry::{Attitude, AttitudeSource};
use drivetrain::motor::Impedance;
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::dbus::{Dbus, Keys, Switch};
use drivetrain::wire::feetech::{self, Goal, Present, ServoId, Status, register};
use drivetrain::wire::hipnuc::{self, Imu};
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, Reset, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain::wire::mit;
use drivetrain::wire::{Counts, Decode, Deframer, Receiver};
use serde_json::Value;

fn vector(id: &str) -> Value {
    let file: Value = serde_json::from_str(include_str!("data/wire/vectors.json")).unwrap();
    let vectors = file["vectors"].as_array().unwrap();
    let found = vectors.iter().find(|vector| vector["id"] == id);
    found.unwrap_or_else(|| panic!("no vector {id}")).clone()
}

fn hex(text: &Value) -> Vec<u8> {
    let bytes = text.as_str().unwrap().split_whitespace();
    bytes.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn integers<T: TryFrom<i64>>(list: &Value) -> Vec<T> {
    let numbers = list.as_array().unwrap().iter().map(|number| number.as_i64().unwrap());
    numbers.map(|number| T::try_from(number).ok().unwrap()).collect()
}

fn close(actual: &[f32], expected: &Value, tolerance: f64) {
    let expected: Vec<f64> = match expected {
        Value::Array(list) => list.iter().map(|number| number.as_f64().unwrap()).collect(),
        number => vec![number.as_f64().unwrap()],
    };
    assert_eq!(actual.len(), expected.len());
    for (actual, expected) in actual.iter().zip(expected) {
        assert!((f64::from(*actual) - expected).abs() <= tolerance, "{actual} {expected}");
    }
}

/// Reads all frames of `bytes`.
fn frames<F: Decode, const N: usize>(options: F::Options, bytes: &[u8]) -> (Vec<F>, Counts) {
    let mut decoder = Deframer::<F, N>::with_options(options);
    let mut input = bytes;
    let mut frames = Vec::new();
    while let Some(frame) = decoder.read(&mut input) {
        frames.push(frame);
    }
    (frames, decoder.counts())
}

fn imu(id: &str) -> Imu {
    let (frames, counts) = frames::<Imu, 128>((), &hex(&vector(id)["input"]["frame"]));
    assert_eq!((frames.len(), counts.skipped_bytes), (1, 0), "{id}");
    frames[0]
}

fn compare(imu: &Imu, expect: &Value) {
    let status = expect["main_status"].as_str().unwrap();
    assert_eq!(format!("0x{:04X}", imu.status), status);
    assert_eq!(i64::from(imu.temperature_c), expect["temperature_c"]);
    close(&imu.magnetic_field_ut, &expect["mag_ut"], 1e-4);
    close(&imu.angular_velocity.map(|rate| rate.as_degrees_per_s()), &expect["gyr_dps"], 1e-4);
    close(&[imu.roll.as_degrees()], &expect["roll_deg"], 1e-4);
    close(&[imu.pitch.as_degrees()], &expect["pitch_deg"], 1e-4);
    close(&[imu.yaw.as_degrees()], &expect["yaw_deg"], 1e-4);
}

#[test]
fn hipnuc_91_frames_of_both_manuals() {
    for id in ["hipnuc.hi91.manual_7_34", "hipnuc.hi91.ch0x0_manual_6_3_1"] {
        let (imu, expect) = (imu(id), &vector(id)["expect"]);
        compare(&imu, expect);
        close(&imu.acceleration_m_s2.map(|a| a / 9.806_65), &expect["acc_g"], 1e-5);
        close(&imu.attitude.to_quaternion(), &expect["quat_wxyz"], 1e-5);
        close(&[imu.pressure_pa], &expect["pressure_pa"], 0.01);
        assert_eq!(imu.time_ms.map(i64::from), expect["system_time_ms"].as_i64());
    }
}

#[test]
fn hipnuc_is_a_source_of_attitude_until_it_falls_silent() {
    let id = "hipnuc.hi91.manual_7_34";
    let (frame, imu) = (hex(&vector(id)["input"]["frame"]), imu(id));
    let ms = |ms| Instant::START + Duration::from_millis(ms);
    let mut receiver = Receiver::<Imu, 128>::new(Duration::from_millis(50));
    assert_eq!(receiver.attitude(ms(1)), None);
    assert!(receiver.read(&mut &frame[..], ms(1)).is_some());
    let expected = Attitude { rotation: imu.attitude, rates: imu.angular_velocity };
    assert_eq!(receiver.attitude(ms(51)), Some(expected));
    assert_eq!(receiver.attitude(ms(52)), None);
}

#[test]
fn hipnuc_92_frame() {
    let (imu, expect) = (imu("hipnuc.hi92"), &vector("hipnuc.hi92")["expect"]);
    compare(&imu, expect);
    close(&imu.acceleration_m_s2, &expect["acc_ms2"], 1e-5);
    close(&[imu.pressure_pa], &expect["pressure_pa_python_reading"], 0.01);
    close(&imu.attitude.to_quaternion(), &expect["quat"], 1e-4);
    assert_eq!(imu.time_ms, None);
}

#[test]
fn hipnuc_other_tags_are_skipped_and_counted() {
    let frame = hex(&vector("hipnuc.hi81.crc")["input"]["frame"]);
    let (frames, counts) = frames::<Imu, 128>((), &frame);
    assert!(frames.is_empty());
    assert_eq!(counts, Counts { foreign_frames: 1, ..Counts::default() });
}

#[test]
fn hipnuc_live_frame_passes_and_its_flipped_twin_does_not() {
    // The frame is the live one; the vector is about the CRC that it must not have.
    let live = imu("hipnuc.neg.payload_only_crc");
    assert_eq!(live.temperature_c, 29);
    let norm: f32 = live.attitude.to_quaternion().iter().map(|part| part * part).sum();
    assert!((norm - 1.0).abs() < 1e-6, "sent as 0.99904");
    let flipped = hex(&vector("hipnuc.neg.flip")["input"]["frame"]);
    let (frames, counts) = frames::<Imu, 128>((), &flipped);
    assert_eq!((frames.len(), counts.checksum_errors), (0, 1));
}

#[test]
fn hipnuc_finds_the_good_frame_in_the_public_resync_stream() {
    let vector = vector("hipnuc.resync");
    let (frames, counts) = frames::<Imu, 518>((), &hex(&vector["input"]["stream"]));
    let expect = &vector["expect"];
    assert_eq!(frames.len() as u64, expect["valid_frames"].as_u64().unwrap());
    assert_eq!(i64::from(counts.length_errors), expect["length_errors"]);
    assert_eq!(i64::from(counts.checksum_errors), expect["crc_errors"]);
}

#[test]
fn hipnuc_euler_angles_of_the_quaternion_are_those_of_the_firmware() {
    type Angles = fn(&Imu) -> (Angle, Angle, Angle);
    const ROLL_X: Angles = Imu::euler_roll_x;
    const PITCH_X: Angles = Imu::euler_pitch_x;
    let off = |imu: &Imu, order: Angles| {
        let (roll, pitch, yaw) = order(imu);
        let difference = |a: Angle, b: Angle| (a.as_degrees() - b.as_degrees()).abs();
        difference(roll, imu.roll).max(difference(pitch, imu.pitch)).max(difference(yaw, imu.yaw))
    };
    // 0.01 degrees: the integers of the `92` frame and the length of the live quaternion. micromath is 0.3 off.
    let tolerance = if cfg!(feature = "micromath") { 1.0 } else { 0.02 };
    for (id, order, other) in [
        ("hipnuc.hi91.manual_7_34", PITCH_X, ROLL_X),
        ("hipnuc.neg.payload_only_crc", PITCH_X, ROLL_X),
        ("hipnuc.hi92", PITCH_X, ROLL_X),
        ("hipnuc.hi91.ch0x0_manual_6_3_1", ROLL_X, PITCH_X),
    ] {
        let imu = imu(id);
        let (right, wrong) = (off(&imu, order), off(&imu, other));
        assert!(right < tolerance, "{id}: {right}");
        assert!(wrong > right, "{id}: {wrong}");
    }
    assert_eq!(hipnuc::MAX_FRAME, 128);
}

fn command(input: &Value) -> HostCommand {
    let mut command = HostCommand::default();
    let speeds = integers::<u8>(&input["speeds_rpm_u8"]);
    command.speeds_rpm.iter_mut().zip(speeds).for_each(|(place, speed_rpm)| *place = speed_rpm);
    let positions = integers::<i32>(&input["positions_i32"]);
    command.positions_pulses.iter_mut().zip(positions).for_each(|(place, pulses)| *place = pulses);
    let number = |name: &str| i16::try_from(input[name].as_i64().unwrap()).unwrap();
    command.gm6020_position = number("gm6020");
    command.c610_position = number("c610");
    command.sts3032_degrees = number("sts3032");
    command.reset = Reset::from_raw(u8::try_from(number("reset")).unwrap());
    command
}

#[test]
fn host_link_commands_in_both_directions() {
    for id in ["snake.cmd.ramp", "snake.cmd.zero"] {
        let vector = vector(id);
        let (command, frame) = (command(&vector["input"]), hex(&vector["expect"]["frame"]));
        assert_eq!(command.encode(&mut [0; COMMAND_LENGTH]).unwrap(), frame);
        let (frames, counts) = frames::<HostCommand, COMMAND_LENGTH>((), &frame);
        assert_eq!((frames, counts.skipped_bytes), (vec![command], 0));
    }
    let first = command(&vector("snake.cmd.ramp")["input"]).speeds_pulses_per_s()[0];
    let expected = &vector("snake.cmd.ramp")["expect"]["speed_pulse_per_s_of_first"];
    assert_eq!(i64::from(first), *expected);
}

#[test]
fn host_link_refuses_the_byte_order_of_modbus_in_the_crc() {
    let frame = hex(&vector("snake.cmd.neg.crc_swapped")["input"]["frame"]);
    let (frames, counts) = frames::<HostCommand, COMMAND_LENGTH>((), &frame);
    assert_eq!((frames.len(), counts.checksum_errors), (0, 1));
}

#[test]
fn host_link_telemetry_with_both_headers_in_both_directions() {
    for (id, format) in [
        ("snake.telemetry.seed_AA55", TelemetryFormat::new().with_document_header()),
        ("snake.telemetry.code_BB66", TelemetryFormat::new()),
    ] {
        let vector = vector(id);
        let (frame, expect) = (hex(&vector["input"]["frame"]), &vector["expect"]);
        let (frames, counts) = frames::<Telemetry, TELEMETRY_LENGTH>(format, &frame);
        assert_eq!((frames.len(), counts.skipped_bytes), (1, 0), "{id}");
        let telemetry: Telemetry = frames[0];
        assert_eq!(telemetry.positions_pulses[..], integers::<i32>(&expect["positions"]));
        assert_eq!(telemetry.speeds_rpm[..], integers::<i8>(&expect["speeds"]));
        assert_eq!(i64::from(telemetry.gm6020_position), expect["gm6020"]);
        assert_eq!(i64::from(telemetry.c610_position), expect["c610"]);
        for (angles, expected) in telemetry
            .imu_angles_deg
            .iter()
            .zip(expect["imu_triplets_wire_order"].as_array().unwrap())
        {
            close(angles, expected, 0.0);
        }
        assert_eq!(format.encode(&telemetry, &mut [0; 121]).unwrap(), frame);

        let big = format.with_big_endian_floats();
        let mut buffer = [0; TELEMETRY_LENGTH];
        let swapped = big.encode(&telemetry, &mut buffer).unwrap();
        assert_ne!(swapped, frame);
        assert_eq!(self::frames::<Telemetry, TELEMETRY_LENGTH>(big, swapped).0, [telemetry]);
    }
    assert_eq!(TelemetryFormat::default(), TelemetryFormat::new());
}

#[test]
fn feetech_instructions_of_the_manual() {
    let expected = |id: &str| hex(&vector(id)["expect"]["frame"]);
    let mut buffer = [0; 64];
    let out = &mut buffer;
    let one = ServoId::ONE;
    assert_eq!(feetech::ping(one, out).unwrap(), [0xFF, 0xFF, 1, 2, 1, 0xFB]);
    assert_eq!(feetech::reset(one, out).unwrap(), expected("feetech.reset"));
    let read = feetech::read(one, register::PRESENT_POSITION, 2, out).unwrap();
    assert_eq!(read, expected("feetech.read_pos"));
    let goal = [0x00, 0x08, 0x00, 0x00, 0xE8, 0x03];
    let write = feetech::write(one, register::GOAL_POSITION, &goal, out).unwrap();
    assert_eq!(write, expected("feetech.write_goal"));
    let four = [1, 2, 3, 4].map(|id| (ServoId::new(id).unwrap(), goal));
    let sync = feetech::sync_write(register::GOAL_POSITION, &four, out).unwrap();
    assert_eq!(sync, expected("feetech.sync_write"));
    for (id, goal) in [
        ("feetech.write_pos_ex", Goal { acceleration: 50, position: 4095, time: 0, speed: 2250 }),
        ("feetech.wheel_neg", Goal { acceleration: 50, position: 0, time: 0, speed: -1000 }),
    ] {
        let write = feetech::write(one, Goal::ADDRESS, &goal.to_bytes(), out).unwrap();
        assert_eq!(write, expected(id));
    }
}

#[test]
fn feetech_status_frames_of_the_manual() {
    for (id, position) in [("feetech.status.block1", 2048), ("feetech.status.block2", 2047)] {
        let vector = vector(id);
        let (frames, _) = frames::<Status, 64>((), &hex(&vector["input"]["frame"]));
        let (status, expect) = (&frames[0], &vector["expect"]);
        assert_eq!(i64::from(status.id()), expect["id"]);
        assert!(status.errors() == 0);
        let present = Present::from_status(status).unwrap();
        assert_eq!(present.position, position);
        for (found, name) in [(present.speed, "speed"), (present.load, "load")] {
            assert!(expect[name].is_null() || i64::from(found) == expect[name], "{id}: {name}");
        }
        close(&[present.voltage_v()], &expect["voltage_v"], 1e-5);
        assert_eq!(i64::from(present.temperature_c), expect["temperature_c"]);
    }
    let (acknowledged, _) =
        frames::<Status, 64>((), &hex(&vector("feetech.status.ok")["input"]["frame"]));
    assert_eq!((acknowledged[0].id(), acknowledged[0].parameters()), (1, &[][..]));
    assert_eq!(Present::from_status(&acknowledged[0]), None);
    let bad = hex(&vector("feetech.neg.checksum")["input"]["frame"]);
    let (none, counts) = frames::<Status, 64>((), &bad);
    assert_eq!((none.len(), counts.checksum_errors), (0, 1));
}

#[test]
fn dbus_frames() {
    let read = |id: &str| {
        let mut dbus = Dbus::new();
        let bytes = hex(&vector(id)["input"]["frame"]);
        let remote = dbus.read(&mut &bytes[..], Instant::START);
        assert_eq!(dbus.counts().content_errors == 0, remote.is_some());
        remote
    };
    let all = read("dbus.extremes").unwrap();
    let expect = &vector("dbus.extremes")["expect"];
    close(&[all.right_x, all.right_y, all.left_x, all.left_y], &expect["normalised_660"], 0.0);
    assert_eq!([all.mouse_x, all.mouse_y, all.mouse_z][..], integers::<i16>(&expect["mouse"]));
    assert!(all.mouse_left && all.mouse_right);
    assert!(all.keys.contains(Keys::W) && all.keys.contains(Keys::B) && all.keys.0 == 0xFFFF);
    assert!((all.dial - 1.0).abs() < 1e-6);

    let rest = read("dbus.capture").unwrap();
    close(
        &[rest.right_x, rest.right_y, rest.left_x, rest.left_y],
        &serde_json::json!([0, 0, 0, 0]),
        0.0,
    );
    assert_eq!((rest.right_switch, rest.left_switch), (Switch::Middle, Switch::Up));
    close(&[rest.dial], &serde_json::json!(0), 0.0);
    let expect = &vector("dbus.capture")["expect"];
    assert_eq!([rest.mouse_x, rest.mouse_y, rest.mouse_z][..], integers::<i16>(&expect["mouse"]));
    assert_eq!(i64::from(rest.keys.0), expect["keys"]);
}

#[expect(clippy::cast_possible_truncation, reason = "rounds")]
fn number(value: &Value) -> f32 {
    value.as_f64().unwrap() as f32
}

#[test]
fn mit_commands() {
    for id in ["damiao.mit.zero", "damiao.mit.min"] {
        let vector = vector(id);
        let (input, limits) = (&vector["input"], &vector["input"]["limits"]);
        let [p, v, t] = ["p", "v", "t"].map(|name| number(&limits[name]));
        let ranges = mit::Ranges::new(p, v, t).unwrap();
        let field = |name: &str| number(&input[name]);
        let command = Impedance {
            angle: Angle::from_radians(field("p")),
            velocity: AngularVelocity::from_rad_per_s(field("v")),
            stiffness: field("kp"),
            damping: field("kd"),
            torque_nm: field("t"),
        };
        assert_eq!(ranges.encode(&command)[..], hex(&vector["expect"]["data"])[..], "{id}");
    }
    assert_eq!(mit::ENABLE[..], hex(&vector("damiao.special.enable")["expect"]["data"])[..]);
}

/// A field alone, in a command whose range is that of the vector.
#[test]
fn mit_fields() {
    for id in ["12.5_16", "-12.5_16", "0_12", "600_12"] {
        let vector = vector(&format!("damiao.f2u.{id}"));
        let (input, expected) = (&vector["input"], vector["expect"]["u"].as_u64().unwrap());
        let (value, range) = (number(&input["x"]), number(&input["max"]));
        let ranges = |p, v| mit::Ranges::new(p, v, 1.0).unwrap();
        let free = Impedance::FREE;
        let (ranges, command) = if input["bits"] == 16 {
            let angle = Angle::from_radians(value);
            (ranges(range, 1.0), Impedance { angle, ..free })
        } else if input["min"] == 0 {
            let gains = ranges(1.0, 1.0).with_gains(range, 1.0).unwrap();
            (gains, Impedance { stiffness: value, ..free })
        } else {
            let velocity = AngularVelocity::from_rad_per_s(value);
            (ranges(1.0, range), Impedance { velocity, ..free })
        };
        let bits = u64::from_be_bytes(ranges.encode(&command));
        let sent = match (input["bits"].as_u64(), input["min"].as_f64()) {
            (Some(16), _) => bits >> 48,
            (_, Some(0.0)) => bits >> 24 & 0xFFF,
            _ => bits >> 36 & 0xFFF,
        };
        assert_eq!(sent, expected, "{id}");
    }
}

#[test]
fn mit_feedback() {
    let ranges = mit::Ranges::new(12.5, 30.0, 10.0).unwrap();
    for id in ["damiao.fb.zero", "damiao.fb.mid"] {
        let vector = vector(id);
        let [_, a, b, c, d, e, _, _] = hex(&vector["input"]["data"])[..] else { panic!("{id}") };
        let feedback = ranges.decode_feedback(&[a, b, c, d, e]);
        let expect = &vector["expect"];
        for (found, name, count) in [
            (feedback.position_rad, "p", 25.0 / 65_535.0),
            (feedback.velocity_rad_per_s, "v", 60.0 / 4_095.0),
            (feedback.torque_nm, "t", 20.0 / 4_095.0),
        ] {
            close(&[found], &expect[name], 1e-2 * count);
        }
    }
}

#[test]
fn lk_commands() {
    use drivetrain::lk::Command;
    for (id, command) in [
        ("lk.cmd.read_state1", Command::ReadState),
        ("lk.cmd.clear_error", Command::ClearErrors),
        ("lk.cmd.read_multi_turn", Command::ReadAngle),
        ("lk.cmd.read_state2", Command::ReadFeedback),
        ("lk.a1", Command::Torque(100)),
        ("lk.a1.neg", Command::Torque(-2_048)),
        ("lk.a4", Command::Position(36_000, 360)),
    ] {
        let vector = vector(id);
        assert_eq!(command.encode()[..], hex(&vector["expect"]["data"])[..], "{id}");
    }
}

#[test]
fn lk_feedback() {
    use drivetrain::lk::{Feedback, Series, State};
    let data = |id: &str| -> [u8; 8] { hex(&vector(id)["input"]["data"]).try_into().unwrap() };
    let feedback = Feedback::decode(&data("lk.fb.9C")).unwrap();
    let expect = &vector("lk.fb.9C")["expect"];
    let values = [
        (i64::from(feedback.temperature_c), "temperature_c"),
        (i64::from(feedback.current), "iq_raw"),
        (i64::from(feedback.velocity_dps), "speed_dps"),
        (i64::from(feedback.encoder), "encoder_raw"),
    ];
    for (value, name) in values {
        assert_eq!(expect[name], value, "{name}");
    }
    for (series, name) in [(Series::Mf, "iq_a_MF(33/4096)"), (Series::Mg, "iq_a_MG(66/4096)")] {
        close(&[f32::from(feedback.current) * series.amperes_per_count()], &expect[name], 1e-6);
    }
    let state = State::decode(&data("lk.fb.9A")).unwrap();
    let expect = &vector("lk.fb.9A")["expect"];
    assert_eq!(expect["temperature_c"], i64::from(state.temperature_c));
    close(&[state.supply_v], &expect["bus_v"], 1e-4);
    close(&[state.supply_a], &expect["bus_a"], 1e-4);
    assert!(!state.is_on && state.errors == 0b1001);
}

#[test]
fn rmd_commands() {
    use drivetrain::rmd::Command;
    for (id, command) in [
        ("rmd.a1", Command::Torque(100)),
        ("rmd.a1.neg", Command::Torque(-100)),
        ("rmd.a2.neg", Command::Velocity(-10_000)),
        ("rmd.a4.neg", Command::Position(-36_000, 500)),
        ("rmd.b3", Command::SetTimeout(1_000)),
    ] {
        let vector = vector(id);
        assert_eq!(command.encode()[..], hex(&vector["expect"]["data"])[..], "{id}");
    }
}

#[test]
fn rmd_feedback() {
    use drivetrain::rmd::{Feedback, State};
    let data = |id: &str| -> [u8; 8] { hex(&vector(id)["input"]["data"]).try_into().unwrap() };
    for id in ["rmd.fb.9C", "rmd.fb.A4.neg"] {
        let feedback = Feedback::decode(&data(id)).unwrap();
        let expect = &vector(id)["expect"];
        assert_eq!(expect["temperature_c"], i64::from(feedback.temperature_c), "{id}");
        assert_eq!(expect["speed_dps"], i64::from(feedback.velocity_dps), "{id}");
        assert_eq!(expect["angle_deg"], i64::from(feedback.angle_deg), "{id}");
        close(&[f32::from(feedback.current) / 100.0], &expect["iq_a"], 1e-6);
    }
    let state = State::decode(&data("rmd.fb.9A")).unwrap();
    let expect = &vector("rmd.fb.9A")["expect"];
    assert_eq!(expect["temperature_c"], i64::from(state.temperature_c));
    assert_eq!(expect["errors"], i64::from(state.errors));
    assert_eq!(expect["brake_open"], state.is_brake_open);
    close(&[state.supply_v], &expect["bus_v"], 1e-4);
    let angle = Feedback::decode_angle(&data("rmd.fb.92")).unwrap();
    close(&[angle as f32 / 100.0], &vector("rmd.fb.92")["expect"]["angle_deg"], 1e-4);
}

#[test]
fn f62_dbus_frames_with_impossible_values_are_refused() {
    for id in ["dbus.out_of_range", "dbus.switch_zero"] {
        let mut dbus = Dbus::new();
        let bytes = hex(&vector(id)["input"]["frame"]);
        assert_eq!(dbus.read(&mut &bytes[..], Instant::START), None, "{id}");
        assert_eq!(dbus.counts().content_errors, 1, "{id}");
    }
}
