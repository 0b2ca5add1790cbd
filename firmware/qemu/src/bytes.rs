//! The rows of the byte protocols: a whole frame in one slice, a frame byte by byte, and noise.

use crate::meter::instructions;
use crate::report::row;
use core::hint::black_box;
use drivetrain::time::Instant;
use drivetrain::wire::dbus::Dbus;
use drivetrain::wire::feetech::{self, Goal, ServoId, Status};
use drivetrain::wire::hipnuc::Imu;
use drivetrain::wire::host_link::{HostCommand, Telemetry, TelemetryFormat};
use drivetrain::wire::{Deframer, vofa};

type Hosts = Deframer<HostCommand, 79>;
type Imus = Deframer<Imu, 128>;
type Servos = Deframer<Status, 64>;

/// Functions out of line that say how much came out.
macro_rules! functions {
    ($($name:ident($($argument:ident: $kind:ty),*) = $body:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            #[inline(never)]
            fn $name($($argument: $kind),*) -> usize {
                $body
            }
        )*
    };
}

functions! {
    bytes_host_command(reader: &mut Hosts, bytes: &[u8]) = count(|bytes| black_box(reader.read(bytes)).is_some(), bytes);
    bytes_hipnuc(reader: &mut Imus, bytes: &[u8]) = count(|bytes| black_box(reader.read(bytes)).is_some(), bytes);
    bytes_sts_status(reader: &mut Servos, bytes: &[u8]) = count(|bytes| black_box(reader.read(bytes)).is_some(), bytes);
    bytes_dbus(reader: &mut Dbus, bytes: &[u8]) = count(|bytes| black_box(reader.read(bytes, Instant::START)).is_some(), bytes);
    bytes_command(command: &HostCommand, out: &mut [u8; 128]) = command.encode(out).map_or(0, <[u8]>::len);
    bytes_telemetry(telemetry: &Telemetry, out: &mut [u8; 128]) = TelemetryFormat::new().encode(telemetry, out).map_or(0, <[u8]>::len);
    bytes_goal(goal: &Goal, out: &mut [u8; 128]) = feetech::write(ServoId::ONE, 41, &goal.to_bytes(), out).map_or(0, <[u8]>::len);
    bytes_justfloat(values: &[f32; 4], out: &mut [u8; 128]) = vofa::justfloat(values, out).map_or(0, <[u8]>::len);
}

fn count(mut read: impl FnMut(&mut &[u8]) -> bool, mut bytes: &[u8]) -> usize {
    usize::from(read(&mut bytes))
}

/// The golden frame of HiPNUC's manual 7.34.
#[rustfmt::skip]
const IMU: [u8; 82] = [
    0x5A, 0xA5, 0x4C, 0x00, 0x14, 0xBB, 0x91, 0x08, 0x15, 0x23, 0x09, 0xA2, 0xC4, 0x47, 0x08, 0x15, 0x1C, 0x00,
    0xCC, 0xE8, 0x61, 0xBE, 0x9A, 0x35, 0x56, 0x3E, 0x65, 0xEA, 0x72, 0x3F, 0x31, 0xD0, 0x7C, 0xBD, 0x75, 0xDD,
    0xC5, 0xBB, 0x6B, 0xD7, 0x24, 0xBC, 0x89, 0x88, 0xFC, 0x40, 0x01, 0x00, 0x6A, 0x41, 0xAB, 0x2A, 0x70, 0xC2,
    0x96, 0xD4, 0x50, 0x41, 0xED, 0x03, 0x43, 0x41, 0x41, 0xF4, 0xF4, 0xC2, 0xCC, 0xCA, 0xF8, 0xBE, 0x73, 0x6A,
    0x19, 0xBE, 0xF0, 0x00, 0x1C, 0x3D, 0x8D, 0x37, 0x5C, 0x3F,
];
const STATUS: [u8; 14] = [0xFF, 0xFF, 0x01, 0x0A, 0, 0, 8, 0, 0, 0, 0, 0x79, 0x1E, 0x55];
const REMOTE: [u8; 18] = [0x94, 0x66, 0x0B, 0xA5, 0xD9, 0x92, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4];
const NOISE: [u8; 100] = [0x11; 100];

/// Frames in and out.
pub fn rows() {
    let mut out = [0; 128];
    let command = black_box(HostCommand::default());
    let mut bytes = [0; 79];
    _ = command.encode(&mut bytes);
    let bytes = black_box(bytes);

    macro_rules! row {
        ($($name:literal $function:ident($($argument:expr),*): $kind:ty;)*) => {
            $(
                row($name, &[instructions($function as $kind, |function, _| {
                    _ = function($($argument),*);
                })]);
            )*
        };
    }
    let (mut hosts, mut imus, mut servos) = (Hosts::new(), Imus::new(), Servos::new());
    let (mut noisy, mut remotes) = (Imus::new(), Dbus::new());
    row! {
        "wire_host_command" bytes_host_command(&mut hosts, &bytes): fn(&mut Hosts, &[u8]) -> usize;
        "wire_hipnuc" bytes_hipnuc(&mut imus, black_box(&IMU)): fn(&mut Imus, &[u8]) -> usize;
        "wire_sts_status" bytes_sts_status(&mut servos, black_box(&STATUS)): fn(&mut Servos, &[u8]) -> usize;
        "wire_dbus" bytes_dbus(&mut remotes, black_box(&REMOTE)): fn(&mut Dbus, &[u8]) -> usize;
        "wire_noise" bytes_hipnuc(&mut noisy, black_box(&NOISE)): fn(&mut Imus, &[u8]) -> usize;
        "wire_command" bytes_command(&command, &mut out): fn(&HostCommand, &mut [u8; 128]) -> usize;
        "wire_telemetry" bytes_telemetry(&black_box(Telemetry::default()), &mut out): fn(&Telemetry, &mut [u8; 128]) -> usize;
        "wire_goal" bytes_goal(&black_box(Goal { speed: 2250, ..Goal::default() }), &mut out): fn(&Goal, &mut [u8; 128]) -> usize;
        "wire_justfloat" bytes_justfloat(black_box(&[1.0, 2.0, 3.0, 4.0]), &mut out): fn(&[f32; 4], &mut [u8; 128]) -> usize;
    }
    macro_rules! byte {
        ($($name:literal $function:ident($reader:expr, $bytes:expr): $kind:ty;)*) => {
            $(
                let (mut reader, bytes) = ($reader, black_box($bytes));
                row($name, &[instructions($function as $kind, |read, call| {
                    let next = call as usize % bytes.len();
                    _ = read(&mut reader, bytes.get(next..=next).unwrap_or(&[]));
                })]);
            )*
        };
    }
    byte! {
        "wire_host_byte" bytes_host_command(Hosts::new(), bytes): fn(&mut Hosts, &[u8]) -> usize;
        "wire_hipnuc_byte" bytes_hipnuc(Imus::new(), IMU): fn(&mut Imus, &[u8]) -> usize;
        "wire_sts_byte" bytes_sts_status(Servos::new(), STATUS): fn(&mut Servos, &[u8]) -> usize;
        "wire_dbus_byte" bytes_dbus(Dbus::new(), REMOTE): fn(&mut Dbus, &[u8]) -> usize;
    }
    // A reader that found nothing would be cheap.
    assert_eq!(bytes_host_command(&mut hosts, &bytes), 1);
    assert_eq!(bytes_hipnuc(&mut imus, &IMU), 1);
    assert_eq!(bytes_sts_status(&mut servos, &STATUS), 1);
    assert_eq!(bytes_dbus(&mut remotes, &REMOTE), 1);
    assert_eq!(bytes_command(&command, &mut out), 79);
    assert_eq!(bytes_telemetry(&Telemetry::default(), &mut out), 121);
    assert_eq!(bytes_goal(&Goal::default(), &mut out), 14);
    assert_eq!(bytes_justfloat(&[1.0; 4], &mut out), 20);
}
