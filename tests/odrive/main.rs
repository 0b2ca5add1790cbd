//! Motors at an ODrive with an axis that is written from the firmware: states, arming, targets, limits, rest, and what an axis refuses.

#![cfg(test)]

mod bench;
mod chaos;
mod refused;
mod vectors;

use bench::{Bench, GEAR, motor, torque};
use drivetrain::control::PidConfig;
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Condition, Devices, DriveProtocol, Ingest, VelocityDrive,
};
use drivetrain::odrive::{Endpoints, Feedback, Firmware, Heartbeat, Mode, Model, Motor};
use drivetrain::sim::{Drive, DriveShaft, OdriveDrive};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};

const BOTH: [Firmware; 2] = [Firmware::V0_5, Firmware::V0_6];
const ENDPOINTS: Endpoints =
    Endpoints { control_mode: 1, input_mode: 2, watchdog_timeout: 3, enable_watchdog: 4 };

fn velocity(rad_per_s: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(rad_per_s)
}

fn angle(radians: f32) -> Angle {
    Angle::from_radians(radians)
}

/// Disarmed, the shaft gets no torque from the next frames on, and the axis is idle.
fn rests(mut bench: Bench) {
    bench.own.disarm();
    bench.step();
    assert!(bench.drive.state() == Heartbeat::IDLE, "{:?}", bench.frames);
    bench.steps(150, |bench| assert!(bench.drive.shaft().torque_nm() == 0.0));
    assert_eq!(bench.own.motor().heartbeat().unwrap().state, Heartbeat::IDLE);
}

#[test]
fn a_motor_is_armed_when_its_heartbeat_says_that_it_is_idle() {
    for firmware in BOTH {
        let mut bench = Bench::new(torque(), firmware);
        let refused = |bench: &mut Bench| bench.own.arm(bench.now()).unwrap_err().to_string();
        assert_eq!(refused(&mut bench), "no feedback from D6374 #3");
        bench.lost = Some(1);
        bench.steps(50, |_| {});
        assert_eq!(refused(&mut bench), "D6374 #3: its axis state is not known yet, ask again");
        bench.lost = None;
        bench.steps(150, |_| {});
        assert_eq!(bench.own.arm(bench.now()), Ok(()));
    }
}

#[test]
fn an_axis_that_calibrates_is_not_armed() {
    let mut bench = Bench::new(Mode::velocity(3.0), Firmware::V0_5);
    bench.is_cut = true;
    bench.drive.set_state(7);
    bench.steps(150, |_| {});
    let refused = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert!(refused.starts_with("D6374 #3 has axis state 7, the program needs 1"), "{refused}");
}

#[test]
fn each_mode_reaches_its_target_with_each_firmware_and_rests_after_a_disarm() {
    for firmware in BOTH {
        let mut wheel = Bench::armed(Mode::velocity(3.0), firmware);
        wheel.steps(1_500, |bench| {
            bench.own.set_velocity((), velocity(6.0)).unwrap();
            assert!(bench.drive.shaft().torque_nm().abs() <= 3.001);
        });
        assert!((wheel.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
        assert!((wheel.own.velocity(()).unwrap().as_rad_per_s() - 6.0).abs() < 0.2);
        rests(wheel);

        let loops = torque().with_loops(
            PidConfig::new(10.0, 0.0, 0.0).with_output_limit(15.0),
            PidConfig::new(0.5, 2.0, 0.0),
        );
        for mode in [torque(), loops.unwrap()] {
            let mut wheel = Bench::armed(mode, firmware);
            wheel.steps(1_500, |bench| bench.own.set_velocity((), velocity(6.0)).unwrap());
            assert!((wheel.drive.shaft().velocity_rad_per_s() - 6.0).abs() < 0.2);
            wheel.steps(2_000, |bench| bench.own.set_angle((), angle(1.0)).unwrap());
            let off = (wheel.drive.shaft().angle_rad() - 1.0).rem_euclid(core::f32::consts::TAU);
            assert!(off.min(core::f32::consts::TAU - off) < 0.02, "{off}");
            rests(wheel);
        }

        for mode in [
            Mode::position(3.0),
            Mode::position_with_filter(3.0),
            Mode::position_with_trajectory(3.0, 20.0),
        ] {
            let mut joint = Bench::armed(mode, firmware);
            joint.steps(2_500, |bench| bench.own.set_angle((), angle(1.0)).unwrap());
            assert!((joint.drive.shaft().angle_rad() - 1.0).abs() < 0.02, "{mode:?}");
            rests(joint);
        }
    }
}

#[test]
fn a_reversed_gear_turns_the_shaft_the_other_way_and_its_torque_too() {
    let mut wheel = Bench::with(motor(torque(), Firmware::V0_6), -GEAR);
    wheel.own = wheel.own.reversed();
    wheel.arm();
    wheel.steps(300, |bench| bench.own.set_torque(0.5).unwrap());
    assert!((wheel.drive.shaft().torque_nm() - 0.5).abs() < 1e-3);
    wheel.steps(1_000, |bench| bench.own.set_velocity((), velocity(-4.0)).unwrap());
    assert!((wheel.drive.shaft().velocity_rad_per_s() + 4.0).abs() < 0.2);
    let mut joint = Bench::with(motor(Mode::position(3.0), Firmware::V0_5), -GEAR);
    joint.own = joint.own.reversed();
    joint.arm();
    joint.steps(2_000, |bench| bench.own.set_angle((), angle(-1.0)).unwrap());
    assert!((joint.drive.shaft().angle_rad() + 1.0).abs() < 0.02);
    assert!((joint.own.angle(()).unwrap().as_radians() + 1.0).abs() < 0.02);
}

#[test]
fn closed_loop_is_requested_once_after_modes_and_limits_and_a_target_where_the_shaft_is() {
    for firmware in BOTH {
        let mut bench = Bench::new(Mode::position_with_trajectory(3.0, 10.0), firmware);
        bench.drive.shaft_mut().set_angle(1.5);
        bench.arm();
        let mut order = Vec::new();
        bench.steps(400, |bench| {
            bench.own.set_angle((), angle(1.5)).unwrap();
            let sent = bench.frames.iter().filter(|frame| frame.is_data_frame());
            order.extend(sent.map(|frame| (frame.header() & 0x1F, *frame.bytes())));
        });
        let first = |number| order.iter().position(|(sent, _)| *sent == number).unwrap();
        let request = order.iter().position(|sent| *sent == (7, [8, 0, 0, 0, 0, 0, 0, 0])).unwrap();
        for number in [0x0B, 0x0C, 0x0F, 0x11, 0x12] {
            assert!(first(number) < request, "{number:X}");
        }
        let requests = order.iter().filter(|(number, data)| (*number, data[0]) == (7, 8)).count();
        assert_eq!(requests, 1, "a second one would drop the torque");
        assert_eq!(bench.drive.modes(), (3, 5));
        let turns = f32::from_le_bytes(order[first(0x0C)].1[..4].try_into().unwrap());
        assert!((turns - 1.5 * GEAR / core::f32::consts::TAU).abs() < 1e-5);
        assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
    }
}

#[test]
fn nothing_jumps_when_a_motor_far_from_its_target_is_armed() {
    for mode in [Mode::position(3.0), Mode::position_with_filter(3.0)] {
        let mut joint = Bench::new(mode, Firmware::V0_6);
        joint.drive.shaft_mut().set_angle(1.5);
        joint.arm();
        let mut since = 0;
        joint.steps(260, |bench| {
            bench.own.set_angle((), angle(-1.5)).unwrap();
            since += u32::from(bench.drive.state() == Heartbeat::CLOSED_LOOP);
            if since < 40 {
                let at = bench.drive.shaft().angle_rad();
                assert!((at - 1.5).abs() < 0.05, "{since} ms in closed loop at {at}");
            }
        });
        assert!(since > 100);
    }
    let mut wheel = Bench::new(Mode::velocity(3.0), Firmware::V0_5);
    wheel.drive = wheel.drive.with_shaft(DriveShaft::new(0.01, 0.0));
    wheel.drive.shaft_mut().set_velocity(5.0);
    wheel.arm();
    let mut since = 0;
    wheel.steps(300, |bench| {
        bench.own.set_velocity((), velocity(-5.0)).unwrap();
        since += u32::from(bench.drive.state() == Heartbeat::CLOSED_LOOP);
        if since < 10 {
            let at = bench.drive.shaft().velocity_rad_per_s();
            assert!((at - 5.0).abs() < 0.5, "{since} ms in closed loop at {at}");
        }
    });
    assert!(since > 10);
}

#[test]
fn the_current_limit_is_that_of_the_torque_limit_and_opens_with_the_share() {
    let mut wheel = Bench::armed(Mode::velocity(2.0), Firmware::V0_6);
    let constant = Model::D6374.torque_constant();
    let mut limits = Vec::new();
    wheel.steps(600, |bench| {
        bench.own.set_velocity((), velocity(5.0)).unwrap();
        let (fastest, current) = bench.drive.limits();
        limits.push(current * constant * GEAR);
        if bench.drive.state() == Heartbeat::CLOSED_LOOP {
            assert!((fastest - 20.0 * GEAR / core::f32::consts::TAU).abs() < 1e-3);
            assert!(current * constant * GEAR <= 2.001);
        }
    });
    assert!(limits.iter().any(|limit| (limit - 0.125).abs() < 1e-3), "it opens from a sixteenth");
    assert!((limits.last().unwrap() - 2.0).abs() < 1e-3);
}

#[test]
fn late_estimates_beside_a_fresh_heartbeat_do_not_drive() {
    for firmware in BOTH {
        let mut wheel = Bench::armed(torque(), firmware);
        wheel.drive = wheel.drive.with_periods(0.002, 0.002);
        wheel.steps(400, |bench| bench.own.set_torque(1.0).unwrap());
        assert!(wheel.drive.shaft().torque_nm() > 0.99);
        wheel.lost = Some(9);
        wheel.steps(12, |bench| _ = bench.own.set_torque(1.0));
        wheel.steps(200, |bench| {
            _ = bench.own.set_torque(1.0);
            assert!(bench.drive.shaft().torque_nm() == 0.0);
        });
        let mut joint = Bench::armed(Mode::position(3.0), firmware);
        joint.steps(400, |bench| bench.own.set_angle((), angle(1.0)).unwrap());
        joint.lost = Some(9);
        joint.steps(12, |bench| _ = bench.own.set_angle((), angle(1.0)));
        joint.steps(200, |bench| {
            _ = bench.own.set_angle((), angle(1.0));
            assert!(bench.drive.state() == Heartbeat::IDLE);
        });
    }
}

#[test]
fn a_lost_heartbeat_trips_within_half_a_second_and_is_not_armed() {
    let mut wheel = Bench::armed(Mode::velocity(3.0), Firmware::V0_5);
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), velocity(5.0));
    wheel.steps(400, drive);
    assert_eq!(wheel.drive.state(), Heartbeat::CLOSED_LOOP);
    wheel.lost = Some(1);
    wheel.steps(510, drive);
    assert_eq!(wheel.drive.state(), Heartbeat::IDLE);
    assert!(!Devices::is_armed(&mut wheel.own));
    wheel.steps(800, |_| {});
    assert!(wheel.own.arm(wheel.now()).is_err());
}

#[test]
fn estimates_that_are_not_cyclic_are_asked_for_within_one_frame_a_cycle() {
    for firmware in BOTH {
        let mut wheel = Bench::new(Mode::velocity(3.0), firmware);
        wheel.drive = wheel.drive.with_periods(0.1, 0.0);
        wheel.arm();
        let mut commands = 0;
        wheel.steps(1_500, |bench| {
            bench.own.set_velocity((), velocity(5.0)).unwrap();
            assert!(bench.frames.len() <= 2);
            commands += u32::from(bench.has_sent(0x0D));
        });
        assert!((wheel.drive.shaft().velocity_rad_per_s() - 5.0).abs() < 0.2);
        assert!(commands > 900, "{commands}");
        rests(wheel);
    }
}

/// Firmware 0.5.6, `set_input_pos_callback` and `set_input_vel_callback`: both set the torque beside the target, and an axis in torque
/// mode follows this torque.
#[test]
fn a_target_of_another_node_is_a_second_master_in_each_mode() {
    let each: [fn() -> Bench; 3] = [
        || Bench::armed(torque(), Firmware::V0_5),
        || Bench::armed(Mode::velocity(3.0), Firmware::V0_5),
        || Bench::armed(Mode::position(3.0), Firmware::V0_6),
    ];
    for bench in each {
        for number in [0x0C, 0x0D, 0x0E, 0x0F, 0x11, 0x12] {
            let mut bench = bench();
            let master = |bench: &Bench| drivetrain::motor::CanDevice::second_master(&bench.own);
            assert_eq!(master(&bench), None);
            let foreign = CanFrame::of(StandardId::new(0x60 | number).unwrap(), [0; 8]);
            let now = bench.now();
            assert_eq!(Devices::ingest(&mut bench.own, &foreign, now), Ingest::Unrelated);
            let name = master(&bench).map(|claim| claim.to_string());
            assert_eq!(name, Some(format!("command of D6374 #3 on 0x{:X}", 0x60 | number)));
        }
    }
}

/// A wheel that somebody turns faster than the limit is not asked to go on so fast while its drive is brought into closed loop.
#[test]
fn a_velocity_before_closed_loop_keeps_within_the_limit() {
    let most_turns = 20.0 * GEAR / core::f32::consts::TAU;
    for (turns_per_s, expected) in
        [(3.0, 3.0), (-3.0, -3.0), (40.0, most_turns), (-1e30, -most_turns), (f32::MAX, most_turns)]
    {
        let mut wheel = motor(Mode::velocity(3.0), Firmware::V0_5);
        let [[a, b, c, d], [e, f, g, h]] = [0.0, turns_per_s].map(f32::to_le_bytes);
        let estimates = CanFrame::of(StandardId::new(0x69).unwrap(), [a, b, c, d, e, f, g, h]);
        assert_eq!(wheel.decode(&estimates), Ingest::Taken);
        let target = wheel.poll().unwrap();
        assert_eq!(target.header(), 0x6D);
        let [a, b, c, d, ..] = *target.bytes();
        let sent = f32::from_le_bytes([a, b, c, d]);
        assert!((sent - expected).abs() < 1e-5 * expected.abs(), "{sent} of {turns_per_s}");
    }
}

#[test]
fn a_refused_closed_loop_is_a_fault_with_its_reason_and_can_be_tried_again() {
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_6);
    bench.drive.refuse(14);
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), velocity(5.0));
    let mut codes = Vec::new();
    bench.steps(900, |bench| {
        drive(bench);
        codes.push(bench.own.motor().vitals().error_code);
    });
    assert!(codes.contains(&78), "64 and NOT_CALIBRATED");
    assert!(!Devices::is_armed(&mut bench.own) && bench.drive.state() == Heartbeat::IDLE);
    bench.drive.refuse(0);
    bench.steps(600, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    bench.steps(400, drive);
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
    // Firmware 0.5 says INVALID_STATE instead, until it is cleared.
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_5);
    bench.drive.refuse(14);
    bench.steps(600, drive);
    assert_eq!(bench.own.motor().vitals().error_code, 1);
    assert!(!Devices::is_armed(&mut bench.own));
}

#[test]
fn errors_stay_until_they_are_cleared_by_the_program() {
    for (firmware, error) in [(Firmware::V0_5, 0x100), (Firmware::V0_6, 0x0400_0000)] {
        let mut bench = Bench::armed(torque(), firmware);
        bench.steps(300, |bench| bench.own.set_torque(0.5).unwrap());
        bench.drive.fail(error);
        bench.steps(200, |bench| _ = bench.own.set_torque(0.5));
        assert!(!Devices::is_armed(&mut bench.own));
        bench.steps(500, |_| {});
        assert!(bench.own.arm(bench.now()).is_err());
        bench.own.motor_mut().clear_errors();
        bench.steps(300, |_| {});
        assert_eq!(bench.own.arm(bench.now()), Ok(()));
        assert_eq!(bench.drive.state(), Heartbeat::IDLE);
    }
}

#[test]
fn a_reset_of_the_drive_trips_and_it_is_set_up_anew() {
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_6);
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), velocity(5.0));
    bench.steps(400, drive);
    bench.drive.lose_supply();
    bench.steps(400, drive);
    assert!(bench.drive.state() == Heartbeat::IDLE && !Devices::is_armed(&mut bench.own));
    bench.steps(200, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(400, drive);
    assert_eq!((bench.drive.state(), bench.drive.modes()), (Heartbeat::CLOSED_LOOP, (2, 1)));
}

#[test]
fn an_axis_that_others_left_in_closed_loop_is_made_idle_before_its_mode_is_set() {
    let mut bench = Bench::new(torque(), Firmware::V0_5);
    bench.drive.set_state(Heartbeat::CLOSED_LOOP);
    bench.arm();
    let mut was_idle = false;
    bench.steps(400, |bench| {
        bench.own.set_torque(0.5).unwrap();
        was_idle |= bench.drive.state() == Heartbeat::IDLE;
        if bench.drive.shaft().torque_nm().abs() > 0.0 {
            assert!(was_idle && bench.drive.modes() == (1, 1));
        }
    });
    assert!(was_idle && bench.drive.state() == Heartbeat::CLOSED_LOOP);
}

#[test]
fn a_target_that_comes_back_before_the_heartbeat_enables_the_drive_anew() {
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_5);
    let drive = |bench: &mut Bench| bench.own.set_velocity((), velocity(5.0)).unwrap();
    bench.steps(400, drive);
    bench.steps(110, |_| {}); // the target is too old, and the drive idle, but its heartbeat is of before
    assert_eq!(bench.drive.state(), Heartbeat::IDLE);
    bench.steps(500, drive);
    assert!(Devices::is_armed(&mut bench.own));
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
}

#[test]
fn a_driver_that_takes_no_frames_for_a_while_does_not_lose_the_mode() {
    let mut bench = Bench::armed(torque(), Firmware::V0_5);
    bench.own.set_torque(0.5).unwrap();
    // For 80 ms the driver takes nothing.
    for _ in 0..80 {
        bench.now_us += 1_000;
        let now = bench.now();
        bench.drive.step(0.001);
        while let Some(frame) = bench.drive.next_frame() {
            _ = Devices::ingest(&mut bench.own, &frame, now);
        }
        bench.own.set_torque(0.5).unwrap();
        bench.own.update(Tick::new(now, 0.001));
    }
    bench.steps(400, |bench| bench.own.set_torque(0.5).unwrap());
    assert_eq!((bench.drive.state(), bench.drive.modes()), (Heartbeat::CLOSED_LOOP, (1, 1)));
}

/// In firmware 0.5 the frames that wait for the heartbeat are polls, and a poll given back is no request given back.
#[test]
fn polls_that_the_bus_gives_back_request_closed_loop_no_second_time() {
    let mut bench = Bench::new(torque(), Firmware::V0_5);
    let drive = OdriveDrive::new(3, false, Model::D6374.torque_constant(), GEAR);
    bench.drive = drive.with_periods(0.1, 0.0);
    bench.steps(400, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let (mut requests, mut given_back) = (0, 0);
    for _ in 0..400 {
        _ = bench.own.set_torque(0.5);
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            let is_request = frame.header() == 0x67 && frame.bytes()[0] == Heartbeat::CLOSED_LOOP;
            requests += u32::from(is_request);
            if requests > 0 && frame.is_remote_frame() {
                // With earlier polls, which waited in mailboxes.
                (0..4).for_each(|_| _ = bench.own.requeue(&frame));
                given_back += 1;
            }
            // The axis does not follow.
            if let Some(answer) = bench.drive.hear(&frame).filter(|_| !is_request) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        bench.drive.step(0.001);
        while let Some(frame) = bench.drive.next_frame().filter(|_| requests == 0) {
            _ = Devices::ingest(&mut bench.own, &frame, now);
        }
    }
    assert!(given_back > 30 && Devices::is_armed(&mut bench.own), "{given_back}");
    assert_eq!(requests, 1);
}

/// The frame is withdrawn by an update without a step, before the driver took it.
#[test]
fn an_enabling_frame_that_was_never_taken_comes_again() {
    for taken in 0..4 {
        let mut bench = Bench::armed(torque(), Firmware::V0_5);
        let velocity = CanFrame::standard(0x6B, [2, 0, 0, 0, 1, 0, 0, 0]).unwrap();
        _ = bench.drive.hear(&velocity);
        assert_eq!(bench.drive.modes(), (2, 1));
        let mut numbers = Vec::new();
        for update in 0..=taken {
            bench.own.set_torque(0.5).unwrap();
            bench.now_us += 1_000;
            let now = bench.now();
            bench.own.update(Tick::new(now, 0.001));
            while update < taken
                && let Some(frame) = bench.own.next_frame(0)
            {
                numbers.push(frame.header() & 0x1F);
                _ = bench.drive.hear(&frame);
            }
        }
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, f32::NAN));
        for _ in 0..400 {
            bench.step();
            _ = bench.own.set_torque(0.5);
            if bench.drive.state() != Heartbeat::CLOSED_LOOP {
                numbers.extend(bench.frames.iter().map(|frame| frame.header() & 0x1F));
            } else {
                assert_eq!(bench.drive.modes(), (1, 1), "{taken} taken: {numbers:x?}");
            }
        }
        assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP, "{taken} taken: {numbers:x?}");
        assert!(Devices::is_armed(&mut bench.own));
        for number in [0x0B, 0x0F] {
            assert!(numbers.contains(&number), "{taken} taken: no {number:#x} in {numbers:x?}");
        }
    }
}

#[test]
fn frames_that_the_bus_gives_back_come_again_remote_ones_too() {
    let mut bench = Bench::new(torque(), Firmware::V0_6);
    bench.arm();
    let mut given_back = 0;
    for ms in 0..600 {
        bench.own.set_torque(0.5).unwrap();
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if ms % 3 == 0 {
                assert!(bench.own.requeue(&frame), "{frame:?}");
                given_back += 1;
                break;
            }
            if let Some(answer) = bench.drive.hear(&frame) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        bench.drive.step(0.001);
        while let Some(frame) = bench.drive.next_frame() {
            _ = Devices::ingest(&mut bench.own, &frame, now);
        }
    }
    assert!(given_back > 150);
    assert_eq!((bench.drive.state(), bench.drive.modes()), (Heartbeat::CLOSED_LOOP, (1, 1)));
}

#[test]
fn the_watchdog_of_0_6_is_set_and_the_modes_read_back_before_the_drive_is_enabled() {
    let mode = Mode::velocity(3.0);
    let set = motor(mode, Firmware::V0_6).with_endpoints(ENDPOINTS, Duration::from_millis(50));
    let mut bench = Bench::with(set.unwrap(), GEAR);
    bench.arm();
    let drive = |bench: &mut Bench| _ = bench.own.set_velocity((), velocity(5.0));
    bench.steps(500, |bench| {
        drive(bench);
        if bench.drive.state() == Heartbeat::CLOSED_LOOP {
            assert_eq!(bench.drive.watchdog_s(), Some(0.05));
        }
    });
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
    bench.is_cut = true;
    bench.steps(49, drive);
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
    bench.steps(3, drive);
    assert!(bench.drive.state() == Heartbeat::IDLE && bench.drive.error() == 0x0100_0000);
    // Back on the bus it is not armed before its error is cleared.
    bench.is_cut = false;
    bench.steps(300, |_| {});
    assert!(bench.own.arm(bench.now()).is_err());
    bench.own.motor_mut().clear_errors();
    bench.steps(300, |_| {});
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[test]
fn a_drive_that_does_not_take_its_mode_is_never_enabled() {
    let mode = Mode::velocity(3.0);
    // The endpoints are those of another version: what is read as the control mode is the input mode.
    let wrong = Endpoints { control_mode: 2, input_mode: 1, ..ENDPOINTS };
    let set = motor(mode, Firmware::V0_6).with_endpoints(wrong, Duration::from_millis(50));
    let mut bench = Bench::with(set.unwrap(), GEAR);
    bench.arm();
    let refusal = |bench: &mut Bench| bench.own.arm(bench.now()).map_err(|error| error.to_string());
    bench.steps(300, |bench| {
        _ = bench.own.set_velocity((), velocity(5.0));
        assert_eq!(bench.drive.state(), Heartbeat::IDLE);
        assert_eq!(bench.drive.watchdog_s(), None, "nothing is written by numbers that are wrong");
    });
    assert!(!Devices::is_armed(&mut bench.own));
    let told =
        "D6374 #3 has control_mode 1, the program needs 2: write it, or change the configuration";
    assert_eq!(refusal(&mut bench), Err(told.to_owned()));
    // A drive that answers nothing stays idle too, until it has answered.
    let set = motor(mode, Firmware::V0_6).with_endpoints(ENDPOINTS, Duration::from_millis(50));
    let mut bench = Bench::with(set.unwrap(), GEAR);
    bench.arm();
    bench.lost = Some(5);
    bench.steps(600, |bench| {
        _ = bench.own.set_velocity((), velocity(5.0));
        assert_eq!(bench.drive.state(), Heartbeat::IDLE);
    });
    let told = refusal(&mut bench).unwrap_err();
    assert!(
        told.starts_with("D6374 #3 does not report its control_mode, the program needs 2"),
        "{told}"
    );
    bench.lost = None;
    bench.steps(200, |_| {});
    assert_eq!(refusal(&mut bench), Ok(()));
    bench.steps(400, |bench| _ = bench.own.set_velocity((), velocity(5.0)));
    assert_eq!(bench.drive.state(), Heartbeat::CLOSED_LOOP);
}

/// The numbers of the modes are right, that of the watchdog is of another version.
#[test]
fn an_endpoint_that_is_not_confirmed_is_read_at_rest_and_never_written() {
    let wrong = Endpoints { watchdog_timeout: 77, ..ENDPOINTS };
    let set =
        motor(Mode::velocity(3.0), Firmware::V0_6).with_endpoints(wrong, Duration::from_millis(50));
    let mut bench = Bench::with(set.unwrap(), GEAR);
    bench.arm();
    bench.steps(400, |bench| _ = bench.own.set_velocity((), velocity(5.0)));
    assert!(!Devices::is_armed(&mut bench.own) && bench.drive.state() == Heartbeat::IDLE);
    let edges: Vec<_> = core::iter::from_fn(|| bench.own.next_edge()).collect();
    let faults: Vec<_> = edges.iter().filter(|edge| edge.condition == Condition::Fault).collect();
    assert!(faults.len() == 2 && faults[0].began && !faults[1].began, "{edges:?}");
    let (mut reads, mut writes) = (0, 0);
    bench.steps(2_000, |bench| {
        for frame in bench.frames.iter().filter(|frame| frame.header() == 0x64) {
            let [operation, ..] = *frame.bytes();
            (reads, writes) = (reads + u32::from(operation == 0), writes + u32::from(operation));
        }
    });
    assert!(reads > 20 && writes == 0, "{reads} reads, {writes} writes");
    let told = bench.own.arm(bench.now()).unwrap_err().to_string();
    assert!(told.starts_with("D6374 #3 does not report its watchdog_timeout"), "{told}");
}

#[test]
fn a_stop_is_sent_until_the_heartbeat_has_it() {
    for (firmware, bit) in [(Firmware::V0_5, 0x4000), (Firmware::V0_6, 0x0200_0000)] {
        let mut bench = Bench::armed(Mode::velocity(3.0), firmware);
        bench.steps(400, |bench| bench.own.set_velocity((), velocity(5.0)).unwrap());
        bench.is_cut = true;
        bench.own.motor_mut().stop();
        bench.steps(20, |bench| {
            _ = bench.own.set_velocity((), velocity(5.0));
            assert!(bench.has_sent(0x02), "{:?}", bench.frames);
        });
        bench.is_cut = false;
        bench.step();
        assert!(bench.drive.state() == Heartbeat::IDLE && bench.drive.error() & bit != 0);
        bench.steps(150, |_| {});
        assert!(!bench.has_sent(0x02));
        assert!(bench.own.arm(bench.now()).is_err());
    }
}

#[test]
fn frames_that_are_damaged_or_of_others_change_nothing() {
    let mut own = Actuator::new(motor(torque(), Firmware::V0_5));
    let now = drivetrain::time::Instant::from_micros(1_000);
    let good = [0x00, 0x00, 0x44, 0x41, 0x00, 0x00, 0x60, 0xC0];
    let id = |raw| StandardId::new(raw).unwrap();
    assert_eq!(own.ingest(&CanFrame::of(id(0x69), good), now), Ingest::Taken);
    let before = *own.motor().feedback().unwrap();
    assert_eq!(before, Feedback { turns: 12.25, turns_per_s: -3.5 });
    for number in [0x61, 0x69] {
        for length in 0..8_u8 {
            let frame = CanFrame::new(id(number), &[0xFF; 8][..length.into()]).unwrap();
            let outcome = own.ingest(&frame, now);
            assert_eq!(outcome, Ingest::WrongLength(length));
        }
    }
    for data in [
        [0, 0, 0xC0, 0x7F, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0, 0x80, 0x7F],
        [0, 0, 0, 0, 0, 0, 0x80, 0xFF],
    ] {
        let outcome = own.ingest(&CanFrame::of(id(0x69), data), now);
        assert_eq!(outcome, Ingest::WrongField);
    }
    // A heartbeat of 0.6 that says "not calibrated" is none of 0.5.
    let frame = CanFrame::of(id(0x61), [0, 0, 0, 0, 1, 14, 0, 0]);
    assert_eq!(own.ingest(&frame, now), Ingest::WrongField);
    assert_eq!(own.motor().heartbeat(), None);
    for other in [0x49, 0x89, 0x63, 0x65, 0x74] {
        assert_eq!(own.ingest(&CanFrame::of(id(other), good), now), Ingest::Unrelated, "{other:X}");
    }
    assert_eq!(own.motor().feedback(), Some(&before));
}

#[test]
fn bad_configurations_are_refused_with_the_limit() {
    let fastest = velocity(10.0);
    let text = |outcome: Result<Motor, ConfigError>| outcome.unwrap_err().to_string();
    let made = |node, fastest, limit| {
        Motor::new(Model::D5065, Firmware::V0_5, node, fastest, Mode::velocity(limit))
    };
    assert_eq!(text(made(63, fastest, 1.0)), "node id 63: 0 to 62 are allowed");
    assert_eq!(
        text(made(0, velocity(0.0), 1.0)),
        "velocity limit in rad/s 0: must be above 0 and finite"
    );
    for limit in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(
            matches!(
                made(0, fastest, limit),
                Err(ConfigError::Limit { parameter: "torque limit in Nm", .. })
            ),
            "{limit}"
        );
        assert!(made(0, velocity(limit), 1.0).is_err());
        let mode = Mode::position_with_trajectory(1.0, limit);
        let made = Motor::new(Model::D5065, Firmware::V0_5, 0, fastest, mode);
        assert!(matches!(
            made,
            Err(ConfigError::Limit { parameter: "acceleration in rad/s^2", .. })
        ));
    }
    for ratio in [0.0, -5.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(
            made(0, fastest, 1.0).unwrap().with_gear(ratio),
            Err(ConfigError::Range { parameter: "gear ratio", .. })
        ));
    }
    let refused = made(0, fastest, 1.0).unwrap().with_endpoints(ENDPOINTS, Duration::from_secs(1));
    assert_eq!(
        refused.unwrap_err(),
        ConfigError::Unsupported("endpoints over CAN (set the watchdog by USB)")
    );
    let pro = Motor::new(Model::D5065, Firmware::V0_6, 0, fastest, Mode::velocity(1.0)).unwrap();
    for time in [Duration::ZERO, Duration::from_secs(11)] {
        let value = time.as_micros() as f32;
        let refused =
            ConfigError::Range { parameter: "watchdog in us", value, least: 1e4, most: 1e7 };
        assert_eq!(pro.with_endpoints(ENDPOINTS, time).unwrap_err(), refused);
    }
}

#[test]
fn a_drive_that_never_says_that_it_is_idle_is_a_fault_and_not_silence() {
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_5);
    let mut codes = Vec::new();
    // Its frames do not reach the axis, which others hold in closed loop.
    bench.is_cut = true;
    bench.drive.set_state(Heartbeat::CLOSED_LOOP);
    bench.steps(150, |_| {});
    bench.steps(2_500, |bench| {
        _ = bench.own.set_velocity((), velocity(5.0));
        codes.push(bench.own.motor().vitals().error_code);
    });
    assert!(codes.contains(&63) && !Devices::is_armed(&mut bench.own));
}

#[test]
fn a_request_to_clear_errors_does_not_wait_for_errors_to_come() {
    let mut bench = Bench::armed(torque(), Firmware::V0_6);
    bench.steps(400, |bench| bench.own.set_torque(0.5).unwrap());
    bench.own.motor_mut().clear_errors();
    bench.steps(100, |bench| bench.own.set_torque(0.5).unwrap());
    bench.drive.fail(0x20);
    bench.steps(800, |_| {});
    assert_eq!(bench.drive.error(), 0x20);
    assert!(bench.own.arm(bench.now()).is_err());
}

#[test]
fn nothing_is_enabled_while_a_stop_waits_for_its_heartbeat() {
    let mut bench = Bench::armed(Mode::velocity(3.0), Firmware::V0_5);
    bench.own.motor_mut().stop();
    bench.lost = Some(1);
    bench.steps(400, |bench| {
        _ = bench.own.set_velocity((), velocity(5.0));
        let closes = |frame: &CanFrame| frame.header() == 0x67 && frame.bytes()[0] == 8;
        assert!(!bench.frames.iter().any(closes), "{:?}", bench.frames);
    });
}

/// Each update until the drive reports that it is idle again, at every moment of a run.
#[test]
fn whenever_it_is_disarmed_no_torque_follows_the_next_frames() {
    for firmware in BOTH {
        for ms in (0..420).step_by(7) {
            let mut bench = Bench::armed(Mode::position(3.0), firmware);
            bench.steps(ms, |bench| bench.own.set_angle((), angle(1.0)).unwrap());
            bench.own.disarm();
            bench.step();
            bench.steps(120, |bench| assert!(bench.drive.shaft().torque_nm() == 0.0, "{ms}"));
            assert_eq!(bench.drive.state(), Heartbeat::IDLE);
            let mut bench = Bench::armed(torque(), firmware);
            bench.steps(ms, |bench| bench.own.set_torque(1.0).unwrap());
            Devices::emergency_stop(&mut bench.own);
            bench.step();
            bench.steps(120, |bench| assert!(bench.drive.shaft().torque_nm() == 0.0, "{ms}"));
            assert_eq!(bench.drive.state(), Heartbeat::IDLE);
        }
    }
}

#[test]
fn limits_that_the_driver_gives_back_come_before_the_next_command() {
    let mut wheel = Bench::armed(Mode::velocity(2.0), Firmware::V0_6);
    let mut run = |refused, steps| {
        wheel.refused = refused;
        let mut limits = 0;
        wheel.steps(steps, |bench| {
            _ = bench.own.set_velocity((), velocity(5.0));
            let is_driven = bench.drive.state() == Heartbeat::CLOSED_LOOP;
            let numbers = bench.frames.iter().map(|frame| frame.header() & 0x1F);
            limits += numbers.filter(|number| *number == 0x0F && is_driven).count();
        });
        limits
    };
    assert!(run(None, 600) > 3);
    // The regular turn of the limits comes within 100 commands; from then on each frame is one.
    let refused = run(Some(0x0F), 150);
    assert!((50..=150).contains(&refused), "{refused}");
    let after = run(None, 50);
    assert_eq!(after, 1);
}
