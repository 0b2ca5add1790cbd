//! Any bytes from the computer or from the robot, in any split.
#![no_main]

use core::array::from_fn;
use drivetrain::wire::Decode;
use drivetrain::wire::host_link::{
    COMMAND_LENGTH, HostCommand, Reset, TELEMETRY_LENGTH, Telemetry, TelemetryFormat,
};
use drivetrain_fuzz::{Input, any_split_gives_the_same, refuses_a_flipped_bit};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    any_split_gives_the_same::<HostCommand>((), data, command);
    let document = TelemetryFormat::new().with_document_header();
    for format in [document, TelemetryFormat::new().with_big_endian_floats()] {
        any_split_gives_the_same::<Telemetry>(format, data, |input| telemetry(format, input));
    }
});

fn command(input: &mut Input) -> Vec<u8> {
    let speeds_rpm = from_fn(|_| input.byte());
    let positions_pulses = from_fn(|_| i32::from_le_bytes(input.bytes()));
    let [gm6020_position, c610_position, sts3032_degrees] =
        from_fn(|_| i16::from_le_bytes(input.bytes()));
    let reset = Reset::from_raw(input.byte());
    let command = HostCommand {
        positions_pulses,
        speeds_rpm,
        gm6020_position,
        c610_position,
        sts3032_degrees,
        reset,
    };
    let frame = command.encode(&mut [0; COMMAND_LENGTH]).expect("room").to_vec();
    assert_eq!(HostCommand::decode(&(), &frame), Ok(command));
    refuses_a_flipped_bit::<HostCommand>(&(), &frame);
    frame
}

fn telemetry(format: TelemetryFormat, input: &mut Input) -> Vec<u8> {
    let telemetry = Telemetry {
        positions_pulses: from_fn(|_| i32::from_le_bytes(input.bytes())),
        speeds_rpm: from_fn(|_| input.byte().cast_signed()),
        gm6020_position: i32::from_le_bytes(input.bytes()),
        c610_position: i32::from_le_bytes(input.bytes()),
        imu_angles_deg: from_fn(|_| from_fn(|_| input.float())),
    };
    let frame = format.encode(&telemetry, &mut [0; TELEMETRY_LENGTH]).expect("room").to_vec();
    // The format refuses no angle, infinite or NaN. As text and as bytes, because NaN is not equal to itself.
    let read = Telemetry::decode(&format, &frame).expect("a whole frame");
    assert_eq!(format!("{read:?}"), format!("{telemetry:?}"));
    assert_eq!(format.encode(&read, &mut [0; TELEMETRY_LENGTH]), Ok(&frame[..]));
    refuses_a_flipped_bit::<Telemetry>(&format, &frame);
    frame
}
