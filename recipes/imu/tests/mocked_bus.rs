//! The adapter over a bus that answers as the chip does: data sheet of the BMI088, sections 5 and 6.

use drivetrain::geometry::{AttitudeSource, Body, Twist, World};
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::Receiver;
use drivetrain::wire::hipnuc::{Imu, MAX_FRAME};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use imu::{Bmi088, ImuError};
use std::cell::Cell;

/// What both parts measure, in degrees/s and in g; and what goes wrong.
#[derive(Debug, Default)]
struct Chip {
    rates: Cell<[f32; 3]>,
    accelerations: Cell<[f32; 3]>,
    noise: Cell<u32>,
    is_noisy: Cell<bool>,
    is_cut: Cell<bool>,
    is_enabled: Cell<bool>,
}

impl Chip {
    /// Level and at rest.
    fn level() -> Self {
        let chip = Self::default();
        chip.accelerations.set([0.0, 0.0, 1.0]);
        chip.is_noisy.set(true);
        chip.noise.set(0x5EED);
        chip
    }

    /// The noise of the last bits.
    fn count(&self, value: f32) -> i16 {
        let mut noise = self.noise.get();
        noise ^= noise << 13;
        noise ^= noise >> 17;
        noise ^= noise << 5;
        self.noise.set(noise);
        value as i16 + if self.is_noisy.get() { (noise % 5) as i16 - 2 } else { 0 }
    }
}

/// One chip select: the accelerometer sends a byte before what was asked for.
struct Select<'c> {
    chip: &'c Chip,
    is_accelerometer: bool,
}

impl ErrorType for Select<'_> {
    type Error = ErrorKind;
}

impl SpiDevice for Select<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        if self.chip.is_cut.get() {
            return Err(ErrorKind::Other);
        }
        for operation in operations {
            let Operation::TransferInPlace(bytes) = operation else { panic!("{operation:?}") };
            let (register, is_read) = (bytes[0] & 0x7F, bytes[0] & 0x80 != 0);
            if !is_read {
                if self.is_accelerometer && register == 0x7D {
                    self.chip.is_enabled.set(bytes[1] == 0x04);
                }
                continue;
            }
            let start = if self.is_accelerometer { 2 } else { 1 };
            let answer: Vec<u8> = match (self.is_accelerometer, register) {
                (true, 0x00) => vec![0x1E],
                (false, 0x00) => vec![0x0F],
                (true, 0x12) => {
                    assert!(self.chip.is_enabled.get(), "read before it was switched on");
                    let counts =
                        self.chip.accelerations.get().map(|g| self.chip.count(g * 32_768.0 / 6.0));
                    counts.iter().flat_map(|count| count.to_le_bytes()).collect()
                }
                (false, 0x02) => {
                    let counts = self.chip.rates.get().map(|rate| self.chip.count(rate * 16.384));
                    counts.iter().flat_map(|count| count.to_le_bytes()).collect()
                }
                other => panic!("no such register: {other:?}"),
            };
            bytes[start..start + answer.len()].copy_from_slice(&answer);
        }
        Ok(())
    }
}

struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

fn imu(chip: &Chip) -> Bmi088<Select<'_>, Select<'_>> {
    let select = |is_accelerometer| Select { chip, is_accelerometer };
    Bmi088::new(select(true), select(false), &mut NoDelay).unwrap()
}

fn ms(ms: u64) -> Instant {
    Instant::from_micros(1_000 * ms)
}

#[test]
fn a_quarter_turn_to_the_left_is_a_heading_of_90_degrees() {
    let chip = Chip::level();
    let mut imu = imu(&chip);
    let mut now = 0;
    let mut turn = |rate: f32, millis: u64| {
        chip.rates.set([0.0, 0.0, rate]);
        for _ in 0..millis {
            now += 1;
            imu.poll(ms(now)).unwrap();
        }
        let attitude = imu.attitude(ms(now)).unwrap();
        let heading = imu.heading(ms(now)).unwrap().angle().as_degrees();
        (heading, attitude.rates[2].as_degrees_per_s())
    };
    let (start, _) = turn(0.0, 2_000);
    let (left, rate) = turn(90.0, 1_000);
    assert!((left - start - 90.0).abs() < 1.0, "{start} to {left}");
    assert!((rate - 90.0).abs() < 2.0, "{rate}");
    let (back, _) = turn(-90.0, 1_000);
    assert!((back - start).abs() < 1.0, "{start} to {back}");
}

/// The loop stands still for 25 ms, as while a page of flash is erased.
#[test]
fn a_pause_keeps_the_yaw() {
    let chip = Chip::level();
    let mut imu = imu(&chip);
    for now in 1..=3_000 {
        chip.rates.set([0.0, 0.0, if now > 2_000 { 90.0 } else { 0.0 }]);
        imu.poll(ms(now)).unwrap();
    }
    let yaw = |imu: &Bmi088<_, _>, now| Some(imu.heading(ms(now))?.angle().as_degrees());
    let before = yaw(&imu, 3_000).unwrap();
    chip.rates.set([0.0; 3]);
    imu.poll(ms(3_025)).unwrap();
    assert_eq!(yaw(&imu, 3_025), None, "the attitude is older than 20 ms");
    imu.poll(ms(3_026)).unwrap();
    let after = yaw(&imu, 3_026).unwrap();
    assert!((after - before).abs() < 1.0, "{before} to {after}");
}

#[test]
fn a_board_that_is_tilted_tells_its_roll_and_pitch_by_gravity() {
    let chip = Chip::level();
    // Nose down by 30 degrees: gravity's reaction points backward in its own axes.
    let (sine, cosine) = 30.0_f32.to_radians().sin_cos();
    chip.accelerations.set([-sine, 0.0, cosine]);
    let mut imu = imu(&chip);
    for now in 1..=2_000 {
        imu.poll(ms(now)).unwrap();
    }
    let [roll, pitch, _] = imu.attitude(ms(2_000)).unwrap().rotation.roll_pitch_yaw();
    assert!(roll.as_degrees().abs() < 1.0, "{}", roll.as_degrees());
    assert!((pitch.as_degrees() - 30.0).abs() < 1.0, "{}", pitch.as_degrees());
}

#[test]
fn a_cable_that_is_cut_leaves_no_attitude_after_20_ms() {
    let chip = Chip::level();
    let mut imu = imu(&chip);
    for now in 1..=100 {
        imu.poll(ms(now)).unwrap();
    }
    chip.is_cut.set(true);
    assert_eq!(imu.poll(ms(101)), Err(ImuError::Bus));
    assert!(imu.attitude(ms(120)).is_some());
    assert_eq!(imu.attitude(ms(121)), None);
    assert_eq!(imu.attitude(ms(99)), None, "a clock that was set back");
    let select = |is_accelerometer| Select { chip: &chip, is_accelerometer };
    assert!(Bmi088::new(select(true), select(false), &mut NoDelay).is_err());
}

#[test]
fn a_sensor_that_repeats_itself_is_frozen() {
    let chip = Chip::level();
    let mut imu = imu(&chip);
    for now in 1..=100 {
        imu.poll(ms(now)).unwrap();
    }
    chip.is_noisy.set(false);
    let results: Vec<_> = (101..=160).map(|now| imu.poll(ms(now))).collect();
    assert_eq!(results[49], Ok(()));
    assert_eq!(results[51], Err(ImuError::Frozen));
    assert_eq!(imu.attitude(ms(160)), None);
    chip.is_noisy.set(true);
    imu.poll(ms(161)).unwrap();
    assert!(imu.attitude(ms(161)).is_some());
}

/// A frame of the manual of HiPNUC's CH0x0, 7.34; its quaternion has a yaw of -119.675 degrees.
#[rustfmt::skip]
const HIPNUC: [u8; 82] = [
    0x5A, 0xA5, 0x4C, 0x00, 0x14, 0xBB, 0x91, 0x08, 0x15, 0x23, 0x09, 0xA2, 0xC4, 0x47, 0x08, 0x15,
    0x1C, 0x00, 0xCC, 0xE8, 0x61, 0xBE, 0x9A, 0x35, 0x56, 0x3E, 0x65, 0xEA, 0x72, 0x3F, 0x31, 0xD0,
    0x7C, 0xBD, 0x75, 0xDD, 0xC5, 0xBB, 0x6B, 0xD7, 0x24, 0xBC, 0x89, 0x88, 0xFC, 0x40, 0x01, 0x00,
    0x6A, 0x41, 0xAB, 0x2A, 0x70, 0xC2, 0x96, 0xD4, 0x50, 0x41, 0xED, 0x03, 0x43, 0x41, 0x41, 0xF4,
    0xF4, 0xC2, 0xCC, 0xCA, 0xF8, 0xBE, 0x73, 0x6A, 0x19, 0xBE, 0xF0, 0x00, 0x1C, 0x3D, 0x8D, 0x37,
    0x5C, 0x3F,
];

/// A part of a robot that knows no sensor: what its chassis makes of a way along x of the room.
fn ahead(source: &impl AttitudeSource, now: Instant) -> Option<Twist<Body>> {
    let heading = source.heading(now)?;
    Some(Twist::<World>::new(1.0, 0.0, 0.0).to_body(heading))
}

#[test]
fn the_same_robot_drives_with_a_chip_on_the_board_and_with_a_hipnuc() {
    let chip = Chip::level();
    let mut bmi088 = imu(&chip);
    chip.rates.set([0.0, 0.0, 0.0]);
    for now in 1..=2_000 {
        bmi088.poll(ms(now)).unwrap();
    }
    let start = bmi088.heading(ms(2_000)).unwrap().angle().as_degrees();
    let of_chip = ahead(&bmi088, ms(2_000)).unwrap();
    assert!(
        (of_chip.vy_m_s.atan2(of_chip.vx_m_s).to_degrees() + start).abs() < 1e-3,
        "{of_chip:?}"
    );

    let mut hipnuc = Receiver::<Imu, MAX_FRAME>::new(Duration::from_millis(50));
    assert_eq!(ahead(&hipnuc, ms(1)), None);
    assert!(hipnuc.read(&mut &HIPNUC[..], ms(1)).is_some());
    let of_hipnuc = ahead(&hipnuc, ms(1)).unwrap();
    let degrees = of_hipnuc.vy_m_s.atan2(of_hipnuc.vx_m_s).to_degrees();
    assert!((degrees - 119.675).abs() < 1e-3, "{degrees}");
}
