//! Silence, loss and nonsense from the other side: faults F61 to F63.

#![cfg(test)]

use drivetrain::time::{Duration, Edge, Instant};
use drivetrain::wire::Receiver;
use drivetrain::wire::dbus::{Dbus, Remote, Switch};
use drivetrain::wire::hipnuc::{Imu, MAX_FRAME};
use drivetrain::wire::host_link::{COMMAND_LENGTH, HostCommand, Reset};
use proptest::prelude::*;

fn ms(ms: u64) -> Instant {
    Instant::START + Duration::from_millis(ms)
}

const fn heard(at: Instant) -> Edge<&'static str> {
    Edge { source: (), condition: "silence", began: false, at }
}

const fn lost(at: Instant) -> Edge<&'static str> {
    Edge { source: (), condition: "silence", began: true, at }
}

#[test]
fn f61_a_silent_host_relaxes_the_robot_after_its_deadline() {
    let mut host = Receiver::<HostCommand, COMMAND_LENGTH>::new(Duration::from_millis(100));
    let command = HostCommand { reset: Reset::Enable, ..HostCommand::default() };
    let mut buffer = [0; COMMAND_LENGTH];
    let bytes = command.encode(&mut buffer).unwrap();
    assert_eq!(host.latest(ms(0)), None, "nothing moves before the first command");
    assert_eq!(host.losses(), 0, "what never came was not lost");
    for at in [10, 60, 110] {
        assert_eq!(host.read(&mut &bytes[..], ms(at)), Some(command));
    }
    assert_eq!(host.edge(ms(110)), Some(heard(ms(10))));
    assert_eq!(host.latest(ms(210)), Some(command));
    assert_eq!(host.latest(ms(211)), None);

    let mut damaged = bytes.to_vec();
    damaged[40] ^= 0x10;
    assert_eq!(host.read(&mut &damaged[..], ms(215)), None);
    assert_eq!(host.latest(ms(215)), None, "a damaged command is no sign of life");
    assert_eq!(host.edge(ms(215)), Some(lost(ms(210))));
    assert_eq!(host.edge(ms(215)), None, "told once");

    assert_eq!(host.read(&mut &bytes[..], ms(500)), Some(command));
    assert_eq!(host.edge(ms(500)), Some(heard(ms(500))));
    assert_eq!(host.losses(), 1);
}

#[test]
fn f61_half_a_command_given_up_does_not_swallow_the_next() {
    let mut host = Receiver::<HostCommand, COMMAND_LENGTH>::new(Duration::from_millis(100));
    let command = HostCommand { reset: Reset::Enable, ..HostCommand::default() };
    let mut buffer = [0; COMMAND_LENGTH];
    let bytes = command.encode(&mut buffer).unwrap();
    let (half, _) = bytes.split_at(40);
    assert_eq!(host.read(&mut &half[..], ms(10)), None);
    assert!(format!("{host:?}").contains("buffered: 40"), "{host:?}");
    host.abandon();
    assert_eq!(host.read(&mut &[][..], ms(50)), None);
    assert_eq!(host.counts().skipped_bytes, 40);
    assert_eq!(host.read(&mut &bytes[..], ms(60)), Some(command));
    assert_eq!(host.counts().skipped_bytes, 40, "nothing but the half");
}

const SHOWN: [u8; 18] = [0x94, 0x66, 0x0B, 0xA5, 0xD9, 0x92, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4];

#[test]
fn f62_loss_of_the_remote_is_neutral_with_an_edge() {
    let mut dbus = Dbus::new();
    assert_eq!(dbus.remote(ms(0)), Remote::default());
    assert!(dbus.read(&mut &SHOWN[..], ms(0)).is_some());
    assert_eq!(dbus.remote(ms(100)).right_switch, Switch::Up);
    assert_eq!(dbus.remote(ms(101)), Remote::default());
    assert_eq!(dbus.remote(ms(101)).right_switch, Switch::Absent);
    assert_eq!(dbus.edge(ms(101)), Some(heard(ms(0))));
    assert_eq!(dbus.edge(ms(101)), Some(lost(ms(100))));
    assert!(dbus.read(&mut &SHOWN[..], ms(200)).is_some());
    assert_eq!(dbus.edge(ms(200)), Some(heard(ms(200))));
}

#[test]
fn f62_an_implausible_frame_is_neutral_at_once() {
    for (byte, bits) in [(5, 0x30), (5, 0xC0), (0, 0x01), (12, 2), (13, 0x80), (17, 0xF0)] {
        let mut bad = SHOWN;
        bad[byte] = if byte == 5 { bad[byte] & !bits } else { bad[byte] | bits };
        let mut dbus = Dbus::new();
        assert!(dbus.read(&mut &SHOWN[..], ms(0)).is_some());
        assert!(dbus.edge(ms(0)).is_some());
        assert_eq!(dbus.read(&mut &bad[..], ms(14)), None, "byte {byte}");
        assert_eq!(dbus.remote(ms(14)), Remote::default());
        assert_eq!(dbus.edge(ms(14)), Some(lost(ms(14))));
        assert!(dbus.read(&mut &SHOWN[..], ms(28)).is_some());
        assert!((dbus.remote(ms(28)).right_x - 1.0).abs() < 1e-6);
    }
}

#[test]
fn f58_a_remote_frame_cut_short_or_late_is_not_joined_with_the_next() {
    let mut dbus = Dbus::new();
    assert_eq!(dbus.read(&mut &SHOWN[..7], ms(0)), None);
    assert!(dbus.read(&mut &SHOWN[..], ms(14)).is_some());
    assert_eq!((dbus.counts().length_errors, dbus.counts().skipped_bytes), (1, 7));
    // The rest of a frame after an idle interrupt, which says better than the time where a frame begins.
    assert_eq!(dbus.read(&mut &SHOWN[..7], ms(28)), None);
    dbus.note_pause();
    assert!(dbus.read(&mut &SHOWN[..], ms(29)).is_some());
}

#[test]
fn f58_after_an_implausible_remote_frame_nothing_counts_before_a_pause() {
    let mut dbus = Dbus::new();
    let mut shifted = vec![0x00, 0x00];
    shifted.extend(SHOWN);
    shifted.extend(SHOWN);
    assert_eq!(dbus.read(&mut &shifted[..], ms(0)), None);
    assert_eq!((dbus.counts().content_errors, dbus.counts().skipped_bytes), (1, 20));
    assert!(dbus.read(&mut &SHOWN[..], ms(14)).is_some());
}

#[test]
fn the_dead_band_ends_at_zero_and_at_one() {
    let at = |raw: u16, dead_band| {
        let mut frame = SHOWN;
        let [low, high] = raw.to_le_bytes();
        frame[0] = low;
        frame[1] = frame[1] & 0xF8 | high;
        let mut dbus = Dbus::new().with_dead_band(dead_band);
        dbus.read(&mut &frame[..], ms(0)).unwrap().right_x
    };
    for (raw, dead_band, expected) in [
        (1024, 0, 0.0),
        (1034, 10, 0.0),
        (1014, 10, 0.0),
        (1684, 10, 1.0),
        (364, 10, -1.0),
        (1359, 10, 0.5),
        (1354, 0, 0.5),
        (1684, 60_000, 1.0),
        (1683, 60_000, 0.0),
    ] {
        assert!((at(raw, dead_band) - expected).abs() < 1e-6, "{raw} {dead_band}");
    }
}

proptest! {
    #[test]
    fn f57_any_split_of_remote_frames_gives_the_same(cuts in prop::collection::vec(1_usize..18, 0..8)) {
        let mut dbus = Dbus::new();
        for frame in 0..4 {
            let (mut rest, mut cuts) = (&SHOWN[..], cuts.iter());
            let mut found = 0;
            while !rest.is_empty() {
                let length = cuts.next().map_or(rest.len(), |cut| *cut.min(&rest.len()));
                let (mut piece, later) = rest.split_at(length);
                while dbus.read(&mut piece, ms(14 * frame)).is_some() {
                    found += 1;
                }
                rest = later;
            }
            prop_assert_eq!(found, 1);
        }
        let mut at_once: &[u8] = &SHOWN.repeat(3);
        prop_assert!((0..3).all(|_| dbus.read(&mut at_once, ms(100)).is_some()));
        prop_assert_eq!(dbus.counts().skipped_bytes, 0);
    }

    #[test]
    fn f62_any_bytes_give_values_in_range_or_neutral(
        noise in prop::collection::vec(any::<u8>(), 0..40),
        almost in any::<usize>(),
        byte in any::<u8>(),
    ) {
        let mut dbus = Dbus::new();
        let mut frame = SHOWN;
        frame[almost % 18] = byte;
        for (at, bytes) in [(0, &noise[..]), (14, &frame[..]), (28, &SHOWN[..])] {
            let mut input = bytes;
            while let Some(remote) = dbus.read(&mut input, ms(at)) {
                let values = [remote.right_x, remote.right_y, remote.left_x, remote.left_y, remote.dial];
                prop_assert!(values.iter().all(|value| value.abs() <= 1.0));
                prop_assert_ne!(remote.left_switch, Switch::Absent);
            }
            prop_assert_eq!(dbus.is_live(ms(at)) , dbus.remote(ms(at)) != Remote::default());
        }
        prop_assert!(dbus.is_live(ms(28)), "the next good frame is taken");
    }
}

/// A `91` frame with this time, this w of the quaternion (the rest is 0), and this rate around x.
fn imu_frame(time_ms: u32, w: f32, gyro: f32) -> Vec<u8> {
    const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM);
    let mut payload = [0; 76];
    payload[0] = 0x91;
    payload[4..8].copy_from_slice(&f32::NAN.to_le_bytes()); // pressure: this sensor has no barometer
    payload[8..12].copy_from_slice(&time_ms.to_le_bytes());
    payload[24..28].copy_from_slice(&gyro.to_le_bytes());
    payload[60..64].copy_from_slice(&w.to_le_bytes());
    let head = [0x5A, 0xA5, 76, 0];
    let mut digest = CRC.digest();
    digest.update(&head);
    digest.update(&payload);
    [&head[..], &digest.finalize().to_le_bytes(), &payload].concat()
}

#[test]
fn f63_an_imu_with_a_frozen_clock_goes_stale_with_an_edge() {
    let mut imu = Receiver::<Imu, MAX_FRAME>::new(Duration::from_millis(50));
    for step in 0..5 {
        let frame = imu_frame(10 * step, 1.0, 0.0);
        assert!(imu.read(&mut &frame[..], ms(10 * u64::from(step))).is_some());
    }
    assert_eq!(imu.edge(ms(40)), Some(heard(ms(0))));
    let frozen = imu_frame(40, 1.0, 0.0);
    for step in 5..20 {
        assert!(imu.read(&mut &frozen[..], ms(10 * step)).is_some());
        assert_eq!(imu.latest(ms(10 * step)).is_some(), step <= 9, "{step}");
    }
    assert_eq!(imu.frozen_frames(), 15);
    assert_eq!(imu.edge(ms(190)), Some(lost(ms(90))));
    assert_eq!(imu.edge(ms(190)), None);
    assert!(imu.read(&mut &imu_frame(200, 1.0, 0.0)[..], ms(200)).is_some());
    assert_eq!(imu.edge(ms(200)), Some(heard(ms(200))));
}

#[test]
fn f63_an_imu_that_sends_nonsense_is_refused_and_goes_stale() {
    let mut imu = Receiver::<Imu, MAX_FRAME>::new(Duration::from_millis(50));
    assert!(imu.read(&mut &imu_frame(0, 0.95, 0.0)[..], ms(0)).is_some(), "normalised");
    let nonsense = [
        (f32::NAN, 0.0),
        (0.0, 0.0),
        (0.5, 0.0),
        (2.0, 0.0),
        (f32::INFINITY, 0.0),
        (1.0, f32::NAN),
        (1.0, f32::NEG_INFINITY),
    ];
    for (step, (w, gyro)) in (1..).zip(nonsense) {
        let frame = imu_frame(10 * step, w, gyro);
        assert_eq!(imu.read(&mut &frame[..], ms(10 * u64::from(step))), None, "{w} {gyro}");
    }
    assert_eq!(imu.counts().content_errors, 7);
    assert_eq!(imu.counts().checksum_errors, 0);
    assert_eq!(imu.latest(ms(70)), None);
}
