//! What is written is read again, and a buffer that is too small is refused whatever its size.

#![cfg(test)]

use drivetrain::error::ConfigError;
use drivetrain::motor::Impedance;
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::feetech::{self, Goal, Present, ServoId, Status};
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, Reset, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain::wire::mit;
use drivetrain::wire::vofa::{justfloat, text_line};
use drivetrain::wire::{Decode, Deframer, EncodeError};
use proptest::prelude::*;

fn read<F: Decode>(options: F::Options, mut bytes: &[u8]) -> Option<F> {
    let mut decoder = Deframer::<F, 160>::with_options(options);
    let frame = decoder.read(&mut bytes);
    assert_eq!((decoder.counts().skipped_bytes, bytes.len()), (0, 0));
    frame
}

fn any_command() -> impl Strategy<Value = HostCommand> {
    let joints = any::<[(u8, i32); 12]>();
    (joints, any::<[i16; 3]>(), any::<u8>()).prop_map(|(joints, [gm6020, c610, sts3032], reset)| {
        HostCommand {
            positions_pulses: joints.map(|(_, position_pulses)| position_pulses),
            speeds_rpm: joints.map(|(speed_rpm, _)| speed_rpm),
            gm6020_position: gm6020,
            c610_position: c610,
            sts3032_degrees: sts3032,
            reset: Reset::from_raw(reset),
        }
    })
}

proptest! {
    #[test]
    fn commands_come_back_as_they_were(command in any_command()) {
        let mut buffer = [0; COMMAND_LENGTH];
        prop_assert_eq!(read((), command.encode(&mut buffer).unwrap()), Some(command));
    }

    #[test]
    fn reset_codes_come_back_as_they_were(raw: u8) {
        prop_assert_eq!(Reset::from_raw(raw).as_raw(), raw);
    }

    #[test]
    fn telemetry_comes_back_as_it_was(
        positions_pulses: [i32; 12],
        speeds_rpm: [i8; 12],
        gripper: [i32; 2],
        angles: [[f32; 3]; 4],
        document: bool,
        big: bool,
    ) {
        let [gm6020_position, c610_position] = gripper;
        let imu_angles_deg = angles;
        let telemetry =
            Telemetry { positions_pulses, speeds_rpm, gm6020_position, c610_position, imu_angles_deg };
        let format = TelemetryFormat::new();
        let format = if document { format.with_document_header() } else { format };
        let format = if big { format.with_big_endian_floats() } else { format };
        let mut buffer = [0; TELEMETRY_LENGTH];
        prop_assert_eq!(read(format, format.encode(&telemetry, &mut buffer).unwrap()), Some(telemetry));
    }

    #[test]
    fn plotted_values_come_back_but_for_the_last_bit(values: [f32; 4]) {
        let mut buffer = [0; 20];
        let seen = read::<[f32; 4]>((), justfloat(&values, &mut buffer).unwrap()).unwrap();
        for (seen, value) in seen.iter().zip(values) {
            prop_assert!(seen.to_bits() ^ value.to_bits() <= 1);
        }
    }

    #[test]
    fn what_a_servo_is_told_it_can_tell_again(position: i16, speed: i16, load in -1000_i16..=1000) {
        prop_assume!(position > i16::MIN && speed > i16::MIN);
        let goal = Goal { position, speed, ..Goal::default() };
        let [_, p0, p1, _, _, s0, s1] = goal.to_bytes();
        let [l0, l1] = feetech::to_sign_magnitude(load).to_le_bytes();
        let mut frame = vec![0xFF, 0xFF, 3, 10, 0, p0, p1, s0, s1, l0, l1, 121, 30];
        let sum = frame[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        frame.push(!sum);
        let present = Present::from_status(&read::<Status>((), &frame).unwrap());
        let expected = Present { position, speed, load, voltage_dv: 121, temperature_c: 30 };
        prop_assert_eq!(present, Some(expected));
    }
}

/// Tries every buffer from none to one byte more than needed.
fn refuses_less_than(needed: usize, encode: impl Fn(&mut [u8]) -> Result<usize, EncodeError>) {
    for given in 0..=needed + 1 {
        let mut buffer = vec![0; given];
        match encode(&mut buffer) {
            Ok(written) => assert_eq!((written, given >= needed), (needed, true)),
            Err(refused) => {
                assert!(given < needed);
                assert_eq!(refused, EncodeError::BufferTooSmall { needed, given });
                let text = format!("the frame needs {needed} bytes, the buffer has {given}");
                assert_eq!(refused.to_string(), text);
            }
        }
    }
}

#[test]
fn too_small_a_buffer_is_refused_by_every_encoder() {
    let command = HostCommand::default();
    refuses_less_than(79, |out| command.encode(out).map(<[u8]>::len));
    let telemetry = Telemetry::default();
    let format = TelemetryFormat::new();
    refuses_less_than(121, |out| format.encode(&telemetry, out).map(<[u8]>::len));
    refuses_less_than(20, |out| justfloat(&[0.0; 4], out).map(<[u8]>::len));
    refuses_less_than(8, |out| text_line("x", &[1.0], out).map(<[u8]>::len));

    let one = ServoId::ONE;
    refuses_less_than(6, |out| feetech::ping(one, out).map(<[u8]>::len));
    refuses_less_than(6, |out| feetech::action(one, out).map(<[u8]>::len));
    refuses_less_than(6, |out| feetech::reset(one, out).map(<[u8]>::len));
    refuses_less_than(8, |out| feetech::read(one, 56, 8, out).map(<[u8]>::len));
    refuses_less_than(9, |out| feetech::write(one, 42, &[1, 2], out).map(<[u8]>::len));
    refuses_less_than(9, |out| feetech::reg_write(one, 42, &[1, 2], out).map(<[u8]>::len));
    refuses_less_than(10, |out| feetech::sync_read(&[one; 2], 56, 8, out).map(<[u8]>::len));
    let servos = [(one, [1, 2]); 3];
    refuses_less_than(17, |out| feetech::sync_write(42, &servos, out).map(<[u8]>::len));
}

#[test]
fn an_instruction_longer_than_its_length_byte_is_refused() {
    let mut buffer = [0; 300];
    let one = ServoId::ONE;
    assert_eq!(feetech::write(one, 0, &[7; 252], &mut buffer).map(<[u8]>::len), Ok(259));
    let error = feetech::write(one, 0, &[7; 253], &mut buffer).unwrap_err();
    assert_eq!(error, EncodeError::TooManyParameters { parameters: 254 });
    assert!(error.to_string().contains("254 parameter bytes"));
    let servos = [(one, [0; 7]); 32];
    let error = feetech::sync_write(41, &servos, &mut buffer).unwrap_err();
    assert_eq!(error, EncodeError::TooManyParameters { parameters: 258 });
    assert!(feetech::sync_write(41, &servos[..31], &mut buffer).is_ok());
}

/// The checksum by hand: FE + 07 + 82 + 38 + 08 + 01 + 02 + 03 is 1CD, and the complement of CD is 32.
#[test]
fn three_servos_are_asked_in_one_frame() {
    let servos = [1, 2, 3].map(|id| ServoId::new(id).unwrap());
    let mut buffer = [0; 16];
    let frame = feetech::sync_read(&servos, 0x38, 8, &mut buffer).unwrap();
    assert_eq!(frame, [0xFF, 0xFF, 0xFE, 7, 0x82, 0x38, 8, 1, 2, 3, 0x32]);
}

/// The five fields of a command for a drive in MIT mode, by their place: bits, whether the range begins at zero, and the range
/// of a Damiao DM-J4310.
const FIELDS: [(u32, bool, f32); 5] =
    [(16, false, 12.5), (12, false, 30.0), (12, true, 500.0), (12, true, 5.0), (12, false, 10.0)];

fn ranges() -> mit::Ranges {
    mit::Ranges::new(12.5, 30.0, 10.0).unwrap()
}

fn command(fields: [f32; 5]) -> Impedance {
    let [position_rad, velocity_rad_per_s, stiffness, damping, torque_nm] = fields;
    Impedance {
        angle: Angle::from_radians(position_rad),
        velocity: AngularVelocity::from_rad_per_s(velocity_rad_per_s),
        stiffness,
        damping,
        torque_nm,
    }
}

fn fields(command: Impedance) -> [f32; 5] {
    let Impedance { angle, velocity, stiffness, damping, torque_nm } = command;
    [angle.as_radians(), velocity.as_rad_per_s(), stiffness, damping, torque_nm]
}

/// A command frame as the numbers that stand in it.
fn counts(data: [u8; 8]) -> [u64; 5] {
    let mut bits = u64::from_be_bytes(data);
    FIELDS.map(|(width, ..)| {
        let field = bits >> (64 - width);
        bits <<= width;
        field
    })
}

/// The frame that these numbers make.
fn frame(counts: [u64; 5]) -> [u8; 8] {
    let fields = FIELDS.iter().zip(counts);
    fields.fold(0, |bits, ((width, ..), count)| bits << width | count).to_be_bytes()
}

#[test]
fn each_count_of_a_drive_in_mit_mode_is_read_in_order_and_written_as_itself_or_the_next_lower() {
    for (place, (bits, from_zero, range)) in FIELDS.into_iter().enumerate() {
        let mut before = f64::NEG_INFINITY;
        let top = (1 << bits) - 1;
        // Miri is a hundred times slower than the machine.
        let is_tried = |count: &u64| !cfg!(miri) || count.is_multiple_of(509) || *count == top;
        for count in (0..=top).filter(is_tried) {
            let mut sent = [0; 5];
            sent[place] = count;
            let value = fields(ranges().decode(&frame(sent)))[place];
            let (range, share) = (f64::from(range), count as f64 / top as f64);
            let exact = if from_zero { range * share } else { range * (2.0 * share - 1.0) };
            assert!((f64::from(value) - exact).abs() < 1e-6 * range, "{place}: {count}");
            assert!(f64::from(value) > before, "{place}: {count}");
            before = value.into();
            let mut command = [0.0; 5];
            command[place] = value;
            let again = counts(ranges().encode(&self::command(command)))[place];
            assert!(again == count || again + 1 == count, "{place}: {count} {again}");
        }
        assert!((before - f64::from(range)).abs() < 1e-6 * before, "{place}");
    }
}

#[test]
fn a_full_command_in_mit_mode_is_no_special_frame() {
    let ends = fields(ranges().decode(&[0xFF; 8]));
    let count = 20.0 / 4_095.0;
    for below in 0..8_u8 {
        let torque_nm = 10.0 - (f32::from(below) - 0.5).max(0.0) * count;
        let data = ranges().encode(&Impedance { torque_nm, ..command(ends) });
        let expected = match 0xFF - below {
            0xFB..=0xFE => 0xFA,
            last => last,
        };
        assert_eq!(data, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, expected], "{below}");
    }
    let specials = [mit::ENABLE, mit::DISABLE, mit::SET_ZERO].map(|[.., last]| last);
    assert_eq!(specials, [0xFC, 0xFD, 0xFE]);
}

#[test]
fn a_range_that_no_drive_has_is_named() {
    for wrong in [0.0, -12.5, 9e-4, 1.1e6, f32::NAN, f32::INFINITY] {
        let named = |outcome: Result<mit::Ranges, ConfigError>| {
            let error = outcome.unwrap_err().to_string();
            error.split(' ').next().unwrap().to_string()
        };
        assert_eq!(named(mit::Ranges::new(wrong, 1.0, wrong)), "position");
        assert_eq!(named(mit::Ranges::new(1.0, wrong, wrong)), "velocity");
        assert_eq!(named(mit::Ranges::new(1.0, 1.0, wrong)), "torque");
        assert_eq!(named(ranges().with_gains(wrong, wrong)), "kp");
        assert_eq!(named(ranges().with_gains(1.0, wrong)), "kd");
    }
    let ends = mit::Ranges::new(1e-3, 1e6, 1e6).unwrap();
    assert_eq!((ends.velocity_rad_per_s(), ends.torque_nm()), (1e6, 1e6));
}

#[test]
fn gains_of_a_drive_in_mit_mode_have_their_own_ranges() {
    let ranges = ranges().with_gains(5_000.0, 100.0).unwrap();
    let full = command([0.0, 0.0, 5_000.0, 100.0, 0.0]);
    assert_eq!(counts(ranges.encode(&full))[2..4], [0xFFF, 0xFFF]);
    assert_eq!(
        counts(ranges.encode(&command([0.0, 0.0, 2_500.0, 25.0, 0.0])))[2..4],
        [2_047, 1_023]
    );
}

#[test]
fn two_fields_of_the_same_bits_are_a_command_and_no_torque_alone() {
    for (one, other) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
        let mut both = [0.0; 5];
        (both[one], both[other]) = (2.0, 2.0);
        let alone = |place: usize| {
            let mut fields = [0.0; 5];
            fields[place] = 2.0;
            counts(ranges().encode(&command(fields)))[place]
        };
        let rest = counts(ranges().encode(&Impedance::FREE));
        let sent = counts(ranges().encode(&command(both)));
        assert_eq!([sent[one], sent[other]], [alone(one), alone(other)], "{one} {other}");
        assert!(sent[one] > rest[one] && sent[other] > rest[other], "{one} {other}");
    }
}

proptest! {
    /// Law: a torque alone has the bytes of the same command with a gain below a count, which takes the way of all fields.
    #[test]
    fn a_torque_alone_is_encoded_as_beside_gains_of_zero_counts(
        ends in proptest::array::uniform3(1e-3_f32..1e6), share in -1.5_f32..1.5,
    ) {
        let [position_rad, velocity_rad_per_s, most_nm] = ends;
        let ranges = mit::Ranges::new(position_rad, velocity_rad_per_s, most_nm).unwrap();
        for torque_nm in [share * most_nm, 0.0, most_nm, -most_nm, f32::NAN] {
            let alone = Impedance::torque(torque_nm);
            let beside = Impedance { stiffness: 1e-6, ..alone };
            prop_assert_eq!(ranges.encode(&alone), ranges.encode(&beside));
        }
    }

    /// Law: what is sent lies at most a count below what is wanted, or at the end of the range.
    #[test]
    fn a_command_in_mit_mode_is_a_count_off_at_most(
        wanted in proptest::array::uniform5(-2.0_f32..2.0),
    ) {
        let wanted: [f32; 5] = std::array::from_fn(|place| wanted[place] * FIELDS[place].2);
        let data = ranges().encode(&command(wanted));
        let sent = fields(ranges().decode(&data));
        for (place, (bits, from_zero, range)) in FIELDS.into_iter().enumerate() {
            let lower = if from_zero { 0.0 } else { -range };
            let count = (range - lower) / ((1 << bits) - 1) as f32;
            let reached = wanted[place].clamp(lower, range);
            let rounding = 1e-2 * count;
            let off = reached - sent[place];
            prop_assert!(off > -rounding && off < count + rounding, "{place}: {wanted:?} {sent:?}");
        }
    }

    /// Law: a command with a field that is NaN is rest, as is one of nothing, whatever the ranges.
    #[test]
    fn a_command_that_is_not_a_number_is_rest(
        place in 0_usize..5,
        position_rad in 1e-3_f32..1e6,
        velocity_rad_per_s in 1e-3_f32..1e6,
        torque_nm in 1e-3_f32..1e6,
    ) {
        let ranges = mit::Ranges::new(position_rad, velocity_rad_per_s, torque_nm).unwrap();
        let rest = ranges.encode(&Impedance::FREE);
        let mut broken = [position_rad, velocity_rad_per_s, 500.0, 5.0, torque_nm];
        prop_assert_eq!(counts(ranges.encode(&command(broken))), [0xFFFF, 0xFFF, 0xFFF, 0xFFF, 0xFFF]);
        broken[place] = f32::NAN;
        prop_assert_eq!(ranges.encode(&command(broken)), rest);
        prop_assert_eq!(counts(rest), [0x7FFF, 0x7FF, 0, 0, 0x7FF]);
        let sent = ranges.decode(&rest);
        prop_assert!(sent.stiffness == 0.0 && sent.damping == 0.0);
        prop_assert!(sent.torque_nm.abs() <= torque_nm / 4_095.0 * 1.001); // half a count
    }

    #[test]
    fn feedback_of_a_drive_in_mit_mode_comes_back_as_it_was(
        shares in proptest::array::uniform3(-1.0_f32..1.0),
    ) {
        let [position_rad, velocity_rad_per_s, torque_nm] = [shares[0] * 12.5, shares[1] * 30.0, shares[2] * 10.0];
        let feedback = mit::Feedback { position_rad, velocity_rad_per_s, torque_nm };
        let found = ranges().decode_feedback(&ranges().encode_feedback(&feedback));
        prop_assert!((found.position_rad - position_rad).abs() < 1.01 * 25.0 / 65_535.0);
        prop_assert!((found.velocity_rad_per_s - velocity_rad_per_s).abs() < 1.01 * 60.0 / 4_095.0);
        prop_assert!((found.torque_nm - torque_nm).abs() < 1.01 * 20.0 / 4_095.0);
    }
}

#[test]
fn feedback_that_is_not_a_number_is_zero() {
    let nan =
        mit::Feedback { position_rad: f32::NAN, velocity_rad_per_s: f32::NAN, torque_nm: f32::NAN };
    let zero = ranges().encode_feedback(&mit::Feedback::default());
    assert_eq!((ranges().encode_feedback(&nan), zero), (zero, [0x7F, 0xFF, 0x7F, 0xF7, 0xFF]));
}
