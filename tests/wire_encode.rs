//! What is written is read again, and a buffer that is too small is refused whatever its size.

#![cfg(test)]

use drivetrain::wire::feetech::{self, Goal, InstructionError, Present, ServoId, Sts};
use drivetrain::wire::host_link::{
    ByteOrder, COMMAND_LENGTH, Command, CommandFormat, JointTarget, Reset, TELEMETRY_LENGTH,
    Telemetry, TelemetryFormat, TelemetryHeader,
};
use drivetrain::wire::vofa::{JustFloat, justfloat, text_line};
use drivetrain::wire::{BufferTooSmall, Deframer, Protocol};
use proptest::prelude::*;

fn read<P: Protocol>(protocol: P, mut bytes: &[u8]) -> Option<P::Frame> {
    let mut decoder = Deframer::<P, 160>::new(protocol);
    let frame = decoder.read(&mut bytes);
    assert_eq!((decoder.counts().skipped_bytes, bytes.len()), (0, 0));
    frame
}

fn any_command() -> impl Strategy<Value = Command> {
    let joints = any::<[(u8, i32); 12]>();
    (joints, any::<[i16; 3]>(), any::<u8>()).prop_map(|(joints, [gm6020, c610, sts3032], reset)| {
        Command {
            joints: joints
                .map(|(speed_rpm, position_pulses)| JointTarget { speed_rpm, position_pulses }),
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
        prop_assert_eq!(read(CommandFormat, command.encode(&mut buffer).unwrap()), Some(command));
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
        let header = if document { TelemetryHeader::Document } else { TelemetryHeader::Firmware };
        let floats = if big { ByteOrder::Big } else { ByteOrder::Little };
        let format = TelemetryFormat::new().with_header(header).with_floats(floats);
        let mut buffer = [0; TELEMETRY_LENGTH];
        prop_assert_eq!(read(format, format.encode(&telemetry, &mut buffer).unwrap()), Some(telemetry));
    }

    #[test]
    fn plotted_values_come_back_but_for_the_last_bit(values: [f32; 4]) {
        let mut buffer = [0; 20];
        let seen = read(JustFloat::<4>, justfloat(&values, &mut buffer).unwrap()).unwrap();
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
        let present = Present::from_status(&read(Sts, &frame).unwrap());
        let expected = Present { position, speed, load, voltage_dv: 121, temperature_c: 30 };
        prop_assert_eq!(present, Some(expected));
    }
}

/// Tries every buffer from none to one byte more than needed.
fn refuses_less_than<E: std::fmt::Debug>(
    needed: usize,
    encode: impl Fn(&mut [u8]) -> Result<usize, E>,
    error: impl Fn(&E) -> Option<BufferTooSmall>,
) {
    for given in 0..=needed + 1 {
        let mut buffer = vec![0; given];
        match encode(&mut buffer) {
            Ok(written) => assert_eq!((written, given >= needed), (needed, true)),
            Err(refused) => {
                assert!(given < needed);
                assert_eq!(error(&refused), Some(BufferTooSmall { needed, given }));
                let text = format!("the frame needs {needed} bytes, the buffer has {given}");
                assert_eq!(error(&refused).unwrap().to_string(), text);
            }
        }
    }
}

#[test]
fn too_small_a_buffer_is_refused_by_every_encoder() {
    let plain = |error: &BufferTooSmall| Some(*error);
    let command = Command::default();
    refuses_less_than(79, |out| command.encode(out).map(<[u8]>::len), plain);
    let telemetry = Telemetry::default();
    let format = TelemetryFormat::new();
    refuses_less_than(121, |out| format.encode(&telemetry, out).map(<[u8]>::len), plain);
    refuses_less_than(20, |out| justfloat(&[0.0; 4], out).map(<[u8]>::len), plain);
    refuses_less_than(8, |out| text_line("x", &[1.0], out).map(<[u8]>::len), plain);

    let one = ServoId::ONE;
    refuses_less_than(6, |out| feetech::ping(one, out).map(<[u8]>::len), plain);
    refuses_less_than(6, |out| feetech::action(one, out).map(<[u8]>::len), plain);
    refuses_less_than(6, |out| feetech::reset(one, out).map(<[u8]>::len), plain);
    refuses_less_than(8, |out| feetech::read(one, 56, 8, out).map(<[u8]>::len), plain);
    let instruction = |error: &InstructionError| match error {
        InstructionError::Buffer(error) => Some(*error),
        _ => None,
    };
    refuses_less_than(9, |out| feetech::write(one, 42, &[1, 2], out).map(<[u8]>::len), instruction);
    refuses_less_than(
        9,
        |out| feetech::reg_write(one, 42, &[1, 2], out).map(<[u8]>::len),
        instruction,
    );
    refuses_less_than(
        10,
        |out| feetech::sync_read(&[one; 2], 56, 8, out).map(<[u8]>::len),
        instruction,
    );
    let servos = [(one, [1, 2]); 3];
    refuses_less_than(
        17,
        |out| feetech::sync_write(42, &servos, out).map(<[u8]>::len),
        instruction,
    );
}

#[test]
fn an_instruction_longer_than_its_length_byte_is_refused() {
    let mut buffer = [0; 300];
    let one = ServoId::ONE;
    assert_eq!(feetech::write(one, 0, &[7; 252], &mut buffer).map(<[u8]>::len), Ok(259));
    let error = feetech::write(one, 0, &[7; 253], &mut buffer).unwrap_err();
    assert_eq!(error, InstructionError::TooLong { parameters: 254 });
    assert!(error.to_string().contains("254 parameter bytes"));
    let servos = [(one, [0; 7]); 32];
    let error = feetech::sync_write(41, &servos, &mut buffer).unwrap_err();
    assert_eq!(error, InstructionError::TooLong { parameters: 258 });
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
