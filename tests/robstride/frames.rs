//! Frames that are damaged, of others, or unexpected.

use crate::bench::{Bench, operation};
use crate::extended;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Devices, Ingest};
use drivetrain::sim::Drive;
use embedded_can::{ExtendedId, Frame, StandardId};

const FEEDBACK: u32 = 0x0280_01FD;

#[test]
fn a_frame_of_another_length_changes_nothing() {
    let mut bench = Bench::new(operation());
    bench.steps(20, |_| {});
    let before = bench.own.motor().feedback().unwrap();
    let now = bench.now();
    for length in 0..8_u8 {
        for raw in [FEEDBACK, 0x1100_01FD, 0x1500_01FD] {
            let data = [0xFF; 8];
            let id = ExtendedId::new(raw).unwrap();
            let frame = CanFrame::new(id, &data[..usize::from(length)]).unwrap();
            let outcome = Devices::ingest(&mut bench.own, &frame, now);
            assert_eq!(outcome, Ingest::WrongLength(length), "{raw:X}");
        }
    }
    assert_eq!(bench.own.motor().feedback().unwrap(), before);
    assert_eq!(bench.own.motor().reported_faults(), 0);
}

#[test]
fn a_state_that_no_drive_has_changes_nothing() {
    let mut bench = Bench::new(operation());
    bench.steps(20, |_| {});
    let before = bench.own.motor().feedback().unwrap();
    let now = bench.now();
    let outcome = Devices::ingest(&mut bench.own, &extended(0x02C0_01FD, [0xFF; 8]), now);
    assert_eq!(outcome, Ingest::WrongField);
    assert_eq!(bench.own.motor().feedback().unwrap(), before);
}

#[test]
fn frames_of_others_are_not_taken() {
    let mut bench = Bench::new(operation());
    bench.steps(20, |_| {});
    let before = bench.own.motor().feedback().unwrap();
    let now = bench.now();
    for frame in [
        extended(0x0280_02FD, [0xFF; 8]), // another motor
        extended(0x1100_02FD, [0xFF; 8]),
        extended(0x0000_01FE, [0xFF; 8]), // its answer about its id
        extended(0x1880_01FD, [0xFF; 8]), // a report of its own
        CanFrame::of(StandardId::new(0x1FD).unwrap(), [0xFF; 8]),
        CanFrame::new_remote(ExtendedId::new(FEEDBACK).unwrap(), 8).unwrap(),
    ] {
        assert_eq!(Devices::ingest(&mut bench.own, &frame, now), Ingest::Unrelated, "{frame:?}");
    }
    assert_eq!(bench.own.motor().feedback().unwrap(), before);
}

/// The answer about the firmware has the id of feedback: as feedback it would be a shaft that turns fast at the lower end.
#[test]
fn the_answer_about_the_firmware_is_no_feedback() {
    let mut bench = Bench::new(operation());
    bench.steps(20, |_| {});
    let before = bench.own.motor().feedback().unwrap();
    let answer = bench.drive.hear(&extended(0x0400_FD01, [0, 0xC4, 0, 0, 0, 0, 0, 0])).unwrap();
    assert_eq!(answer.header() >> 24 & 0x1F, 2);
    let now = bench.now();
    assert_eq!(Devices::ingest(&mut bench.own, &answer, now), Ingest::Taken);
    assert_eq!(bench.own.motor().feedback().unwrap(), before);
}

/// What a tool reads or writes while the motor waits is not taken for an answer to its own question.
#[test]
fn an_answer_that_was_not_asked_for_confirms_nothing() {
    let mut bench = Bench::armed(operation());
    bench.passes = |frame| frame.header() >> 24 & 0x1F != 18;
    let now = bench.now();
    for _ in 0..300 {
        _ = bench.own.set_torque(1.0);
        // A time-out of 0, and one of another parameter that looks like it.
        for data in [[0x28, 0x70, 0, 0, 0, 0, 0, 0], [0x29, 0x70, 0, 0, 0xD0, 0x07, 0, 0]] {
            _ = Devices::ingest(&mut bench.own, &extended(0x1100_01FD, data), now);
        }
        bench.step();
        assert!(!bench.drive.is_enabled());
    }
}

#[test]
fn a_second_master_is_noticed_whatever_host_it_is() {
    for raw in [0x017F_FF01, 0x0300_AA01, 0x0400_AA01, 0x1200_AA01, 0x0600_AA01] {
        let mut bench = Bench::armed(operation());
        let now = bench.now();
        _ = Devices::ingest(&mut bench.own, &extended(raw, [0; 8]), now);
        bench.step();
        use drivetrain::motor::CanDevice;
        assert!(bench.own.second_master().is_some(), "{raw:X}");
    }
}
