//! What a hostile reader found, and looked for: lost, late and doubled frames, a supply that sags, other tools on the bus, and
//! torques beyond the limit.

use super::bench::{Bench, mit};
use drivetrain::damiao::{Mode, Model, Motor, Register};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Devices, DriveProtocol, Impedance, ImpedanceControl, Order, Target,
    VelocityDrive,
};
use drivetrain::sim::{DamiaoDrive, Drive, DriveShaft};
use drivetrain::time::Tick;
use drivetrain::time::TimeStep;
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::Frame;

fn rad_s(value: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(value)
}

fn quick() -> AngularVelocity {
    rad_s(20.0)
}

/// A decoder of MIT commands that shares nothing with the crate: p, v, kp, kd, t.
fn mit_fields(frame: &CanFrame, [pmax, vmax, tmax]: [f64; 3]) -> [f64; 5] {
    let d = frame.data();
    let p = (f64::from(d[0]) * 256.0 + f64::from(d[1])) / 65_535.0;
    let v = (f64::from(d[2]) * 16.0 + f64::from(d[3] >> 4)) / 4_095.0;
    let kp = (f64::from(d[3] & 15) * 256.0 + f64::from(d[4])) / 4_095.0;
    let kd = (f64::from(d[5]) * 16.0 + f64::from(d[6] >> 4)) / 4_095.0;
    let t = (f64::from(d[6] & 15) * 256.0 + f64::from(d[7])) / 4_095.0;
    [p * 2.0 * pmax - pmax, v * 2.0 * vmax - vmax, kp * 500.0, kd * 5.0, t * 2.0 * tmax - tmax]
}

fn feedback_of([pmax, vmax, tmax]: [f64; 3], id: u8, status: u8, p: f64, v: f64) -> CanFrame {
    let field = |x: f64, most: f64, top: f64| {
        ((x + most).clamp(0.0, 2.0 * most) * top / (2.0 * most)) as u64
    };
    let bits = u64::from(status << 4 | id) << 56
        | field(p, pmax, 65_535.0) << 40
        | field(v, vmax, 4_095.0) << 28
        | field(0.0, tmax, 4_095.0) << 16
        | 0x1E1E;
    CanFrame::standard(0x11, bits.to_be_bytes()).unwrap()
}

/// Reads a register of the simulated drive, without our motor taking part.
fn register(drive: &DamiaoDrive, number: u8) -> [u8; 4] {
    let mut drive = *drive;
    let asked = CanFrame::standard(0x7FF, [1, 0, 0x33, number, 0, 0, 0, 0]).unwrap();
    let answer = drive.hear(&asked).unwrap();
    answer.data()[4..8].try_into().unwrap()
}

fn timeout_of(drive: &DamiaoDrive) -> u32 {
    u32::from_le_bytes(register(drive, 9))
}

/// The torque that the drive gives for a command at the place and velocity it reported.
fn torque_of(model: Model, mode: ImpedanceControl, target: Impedance, p: f64, v: f64) -> f64 {
    let ranges = [model.pmax_rad(), model.vmax_rad_per_s(), model.tmax_nm()].map(f64::from);
    let mut motor = Motor::new(model, 1, mode).unwrap();
    _ = motor.decode(&feedback_of(ranges, 1, 1, p, v));
    let order = Order { target: Target::Impedance(target), share: 1.0, step: TimeStep::of(0.001) };
    let frame = motor.control(order);
    let [ps, vs, kp, kd, t] = mit_fields(&frame, ranges);
    let real = kp * (ps - p) + kd * (vs - v) + t;
    println!("sent p {ps} v {vs} kp {kp} kd {kd} t {t}: {real} Nm");
    real.clamp(-ranges[2], ranges[2])
}

// ---------------------------------------------------------------- answers taken for feedback

/// An answer about a register whose question is over (duplicated, or that of another tool) is no feedback: it should neither change
/// angle nor velocity. It is read as "disabled, at -12.48 rad, -27.6 rad/s".
#[test]
fn an_answer_that_nobody_waits_for_is_no_feedback() {
    let mut bench = Bench::new(mit(), 1.0);
    bench.steps(100, |_| {});
    let answer = CanFrame::standard(0x11, [1, 0, 0x33, 10, 1, 0, 0, 0]).unwrap();
    for _ in 0..2 {
        let now = bench.now();
        _ = Devices::ingest(&mut bench.own, &answer, now);
    }
    let (angle, velocity) = (bench.own.angle(()).unwrap(), bench.own.velocity(()).unwrap());
    println!("{angle:?} {velocity:?}");
    assert!(angle.as_radians().abs() < 0.01 && velocity.as_rad_per_s().abs() < 0.1);
}

/// The answer to our own `store` is no feedback either.
#[test]
fn the_answer_to_a_store_is_no_feedback() {
    let mut bench = Bench::new(mit(), 1.0);
    bench.steps(100, |_| {});
    bench.own.motor_mut().store();
    let mut worst = 0.0_f32;
    for _ in 0..50 {
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if let Some(answer) = bench.drive.hear(&frame) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
                let velocity = bench.own.velocity(()).map_or(0.0, |v| v.as_rad_per_s());
                worst = worst.max(velocity.abs());
            }
        }
    }
    assert!(worst < 0.1, "a shaft that stands was read at {worst} rad/s");
}

/// A drive in velocity mode that stands should not be told any velocity before it is enabled. One duplicated answer (or that of
/// another tool) before the first target makes the "stay" frame -27.6 rad/s, with the drive's full torque behind it.
#[test]
fn velocity_mode_does_not_jump_after_a_duplicated_answer() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    let answer = CanFrame::standard(0x11, [1, 0, 0x33, 10, 3, 0, 0, 0]).unwrap();
    for _ in 0..2 {
        let now = bench.now();
        _ = Devices::ingest(&mut bench.own, &answer, now);
    }
    let (mut torque, mut speed) = (0.0_f32, 0.0_f32);
    for _ in 0..60 {
        bench.own.set_velocity((), AngularVelocity::ZERO).unwrap();
        bench.step();
        torque = torque.max(bench.drive.shaft().torque_nm().abs());
        speed = speed.max(bench.drive.shaft().velocity_rad_per_s().abs());
    }
    assert!(torque < 0.5 && speed < 0.5, "target 0, shaft at rest: {torque} Nm, {speed} rad/s");
}

/// The same while driven: another tool reads the supply voltage. Should be left aside; it trips the motor (the joint falls).
#[test]
fn a_tool_that_reads_a_register_does_not_trip_a_driven_motor() {
    let mut bench = Bench::armed(mit(), 1.0);
    bench.steps(300, |b| b.own.set_velocity((), rad_s(3.0)).unwrap());
    let answer = CanFrame::standard(0x11, [1, 0, 0x33, 60, 0, 0, 0xC0, 0x41]).unwrap();
    let now = bench.now();
    _ = Devices::ingest(&mut bench.own, &answer, now);
    bench.step();
    assert!(bench.own.is_armed(), "{:?}", bench.own.health());
}

/// A drive that takes 15 ms to answer a write should be enabled and driven. The write is repeated after 10 ms, the second answer
/// comes after the drive is enabled, is read as "disabled" and trips the motor: each time.
#[test]
fn a_drive_that_answers_a_write_after_15_ms_can_be_driven() {
    let mut bench = Bench::new(mit(), 1.0);
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let mut waiting: Vec<(u64, CanFrame)> = Vec::new();
    for tick in 0..300 {
        assert_eq!(bench.own.set_velocity((), rad_s(3.0)), Ok(()), "tick {tick}");
        bench.now_us += 1_000;
        let now = bench.now();
        let due: Vec<_> = waiting.iter().filter(|w| w.0 <= bench.now_us).map(|w| w.1).collect();
        waiting.retain(|w| w.0 > bench.now_us);
        for frame in due {
            _ = Devices::ingest(&mut bench.own, &frame, now);
        }
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            let Some(answer) = bench.drive.hear(&frame) else { continue };
            if frame.header() == 0x7FF && frame.data()[2] != 0xCC {
                waiting.push((bench.now_us + 15_000, answer));
            } else {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        bench.drive.step(0.001);
    }
    assert!(bench.drive.is_enabled());
}

// ---------------------------------------------------------------- enabling

/// After the loss of one frame (the first, which replaces the target), the drive should not go on to its target of before.
#[test]
fn velocity_mode_does_not_resume_its_old_speed_when_one_frame_is_lost() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    bench.steps(1_000, |b| b.own.set_velocity((), quick()).unwrap());
    bench.own.disarm();
    bench.steps(5_000, |_| {});
    assert!(bench.drive.shaft().velocity_rad_per_s().abs() < 0.5);
    bench.own.arm(bench.now()).unwrap();
    let (mut lost, mut torque, mut speed) = (false, 0.0_f32, 0.0_f32);
    for _ in 0..60 {
        bench.own.set_velocity((), AngularVelocity::ZERO).unwrap();
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            let is_command = frame.header() == 0x201 && frame.data()[7] == 0;
            if is_command && !lost {
                lost = true;
                continue;
            }
            if let Some(answer) = bench.drive.hear(&frame) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        for _ in 0..10 {
            bench.drive.step(1e-4);
            torque = torque.max(bench.drive.shaft().torque_nm().abs());
        }
        speed = speed.max(bench.drive.shaft().velocity_rad_per_s().abs());
    }
    assert!(lost && torque < 1.0, "target 0, shaft at rest: {torque} Nm, {speed} rad/s");
}

/// Nor when the driver took no frame for 10 ms: nothing was lost, but the frame that waited was replaced by the next step.
#[test]
fn velocity_mode_does_not_resume_its_old_speed_when_the_bus_was_busy() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    bench.steps(1_000, |b| b.own.set_velocity((), quick()).unwrap());
    bench.own.disarm();
    bench.steps(5_000, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let (mut torque, mut seen) = (0.0_f32, Vec::new());
    for tick in 0..80 {
        bench.own.set_velocity((), AngularVelocity::ZERO).unwrap();
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        if tick < 10 {
            // The drive is heard: it answers another node's refresh, and the like.
            let refresh = CanFrame::standard(0x7FF, [1, 0, 0xCC, 0, 0, 0, 0, 0]).unwrap();
            let answer = bench.drive.hear(&refresh).unwrap();
            _ = Devices::ingest(&mut bench.own, &answer, now);
        } else {
            while let Some(frame) = bench.own.next_frame(0) {
                seen.push(frame);
                if let Some(answer) = bench.drive.hear(&frame) {
                    _ = Devices::ingest(&mut bench.own, &answer, now);
                }
            }
        }
        for _ in 0..10 {
            bench.drive.step(1e-4);
            torque = torque.max(bench.drive.shaft().torque_nm().abs());
        }
    }
    assert!(torque < 1.0, "target 0, shaft at rest: {torque} Nm; {:?}", &seen[..6.min(seen.len())]);
}

/// A wheel coasts when it is to be enabled; the drive confirms its time-out only 300 ms later, when the wheel stands. It should be
/// enabled with what the shaft does then, not with the velocity of long ago.
#[test]
fn velocity_mode_does_not_jump_to_a_velocity_measured_long_before() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    bench.steps(1_000, |b| b.own.set_velocity((), quick()).unwrap());
    bench.own.disarm();
    bench.steps(80, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let mut torque = 0.0_f32;
    for tick in 0..400 {
        bench.own.set_velocity((), AngularVelocity::ZERO).unwrap();
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            let is_write = frame.header() == 0x7FF && frame.data()[2] == 0x55;
            if let Some(answer) = bench.drive.hear(&frame).filter(|_| !is_write || tick > 300) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        // Somebody stops the wheel.
        let drag = if tick < 300 { -0.2 * bench.drive.shaft().velocity_rad_per_s() } else { 0.0 };
        bench.drive.shaft_mut().set_load(drag);
        for _ in 0..10 {
            bench.drive.step(1e-4);
            if tick > 290 {
                torque = torque.max(bench.drive.shaft().torque_nm().abs());
            }
        }
    }
    assert!(torque < 1.0, "target 0, shaft at rest: {torque} Nm");
}

/// A drive whose supply sags while it is enabled (the inrush of all motors at once) has lost its TIMEOUT, and its settings. It should not be
/// enabled before it has confirmed TIMEOUT anew.
fn sags(mode: impl Into<Mode> + Copy, number: f32, gap: u32, set: impl Fn(&mut Actuator<Motor>)) {
    let mut bad = Vec::new();
    for at in 0..60 {
        let mut bench = Bench::armed(mode, number);
        for tick in 0..200 {
            set(&mut bench.own);
            if tick == at {
                bench.drive.lose_supply();
            }
            bench.is_cut = (at..at + gap).contains(&tick);
            bench.step();
            if bench.drive.is_enabled() && timeout_of(&bench.drive) != 2_000 {
                bad.push(at);
                break;
            }
        }
    }
    assert!(bad.is_empty(), "enabled without a time-out after a sag at tick {bad:?}");
}

#[test]
fn no_drive_is_enabled_without_its_time_out_after_a_sag_mit() {
    sags(mit(), 1.0, 12, |own| _ = own.set_velocity((), rad_s(1.0)));
}

#[test]
fn no_drive_is_enabled_without_its_time_out_after_a_sag_of_30_ms_mit() {
    sags(mit(), 1.0, 30, |own| _ = own.set_velocity((), rad_s(1.0)));
}

#[test]
fn no_drive_is_enabled_without_its_time_out_after_a_sag_position() {
    sags(Mode::position_velocity(quick()), 2.0, 12, |own| _ = own.set_angle((), Angle::ZERO));
}

/// A sag brings back what was written and not stored: TMAX 28 in the place of 10. The drive should not be driven before that is noticed.
#[test]
fn a_range_that_a_sag_brought_back_is_noticed() {
    let mut bad = Vec::new();
    for at in 0..60 {
        let mut bench = Bench::new(mit(), 1.0);
        bench.drive = bench.drive.with_register(23, 28.0);
        bench.own.motor_mut().write(Register::TorqueRange, 10.0).unwrap();
        bench.steps(150, |_| {});
        bench.own.arm(bench.now()).unwrap();
        let mut most = 0.0_f32;
        for tick in 0..400 {
            _ = bench.own.set_torque(1.0);
            if tick == at {
                bench.drive.lose_supply();
            }
            bench.is_cut = (at..at + 12).contains(&tick); // it starts
            bench.step();
            most = most.max(bench.drive.shaft().torque_nm());
        }
        if most > 1.5 {
            bad.push((at, most));
        }
    }
    assert!(bad.is_empty(), "1 Nm was asked for, after a sag at tick: {bad:?}");
}

/// Another tool changes TMAX while the motor is driven. `DriveProtocol::inquire`: "a setting is read before the motor is armed and again
/// before it is armed next". It is not: disarmed and armed at once, the motor takes what it read before.
#[test]
fn settings_are_read_again_before_a_motor_is_armed_again() {
    let mut bench = Bench::armed(mit(), 1.0);
    bench.steps(300, |b| b.own.set_torque(0.0).unwrap());
    let write = |[a, b, c, d]: [u8; 4]| CanFrame::standard(0x7FF, [1, 0, 0x55, 23, a, b, c, d]);
    _ = bench.drive.hear(&write(28.0_f32.to_le_bytes()).unwrap());
    bench.steps(300, |b| b.own.set_torque(0.0).unwrap());
    bench.own.disarm();
    bench.step();
    assert!(bench.own.arm(bench.now()).is_err(), "armed with TMAX 28 in the place of 10");
}

// ---------------------------------------------------------------- torque limits

/// The gains are truncated to counts of 0.122 Nm/rad and 0.0012 after the damper was allowed to work against the spring: what is sent
/// should keep within the limit as the drive reads it.
#[test]
fn a_spring_that_truncates_to_nothing_leaves_no_damper_of_twice_the_limit() {
    let mode = ImpedanceControl::new(3.0).unwrap();
    let target = Impedance {
        angle: Angle::from_radians(12.0),
        velocity: rad_s(-20.0),
        stiffness: 0.12,
        damping: 2.0,
        torque_nm: 0.0,
    };
    let torque = torque_of(Model::J4310, mode, target, -12.4, 0.0);
    assert!(torque.abs() < 3.05, "{torque} Nm, limit 3");
    let target = Impedance { stiffness: 0.24, ..target };
    let torque = torque_of(Model::J4310, mode, target, -12.4, 0.0);
    assert!(torque.abs() < 3.05, "{torque} Nm, limit 3");
}

/// A count of position is 0.00038 rad: with 500 Nm/rad 0.19 Nm.
#[test]
fn a_stiff_spring_keeps_a_small_limit() {
    let mode = ImpedanceControl::new(0.1).unwrap();
    for milli in 0..100 {
        let p = f64::from(milli) * 1e-3;
        let target =
            Impedance { angle: Angle::from_radians(-1.0), stiffness: 500.0, ..Impedance::FREE };
        // The place that the drive reports is truncated already: p lies up to a count above.
        let torque = torque_of(Model::J4310, mode, target, p, 0.0);
        assert!(torque.abs() < 0.11, "{torque} Nm, limit 0.1");
    }
}

/// A count of velocity of the DM-H3510 is 0.137 rad/s: with 5 Nm s/rad 0.68 Nm, of a motor of 1 Nm.
#[test]
fn a_damper_of_a_fast_motor_keeps_its_limit() {
    let mode = ImpedanceControl::new(0.1).unwrap();
    for milli in 0..100 {
        let v = f64::from(milli) * 1e-2;
        let target = Impedance { velocity: rad_s(-50.0), damping: 5.0, ..Impedance::FREE };
        let torque = torque_of(Model::H3510, mode, target, 0.0, v);
        assert!(torque.abs() < 0.15, "{torque} Nm, limit 0.1");
    }
}

/// A shaft that is dragged faster than VMAX reports VMAX. The damper should not brake it with more than the limit.
#[test]
fn a_damper_keeps_its_limit_beyond_vmax() {
    let mode = ImpedanceControl::new(3.0).unwrap();
    let target = Impedance { damping: 5.0, ..Impedance::FREE };
    let torque = torque_of(Model::J4340, mode, target, 0.0, 12.0);
    assert!(torque.abs() < 3.1, "{torque} Nm, limit 3");
}

/// Feedback that comes 9 ms late is fresh. A stiff joint that turns should keep near its limit all the same.
#[test]
fn a_spring_with_feedback_9_ms_late_keeps_near_its_limit() {
    let mut bench =
        Bench::new(ImpedanceControl::new(2.0).unwrap().with_gains(150.0, 2.0).unwrap(), 1.0);
    let mut waiting: Vec<(u64, CanFrame)> = Vec::new();
    let mut most = 0.0_f32;
    for tick in 0..2_500_u32 {
        bench.now_us += 1_000;
        let now = bench.now();
        let due: Vec<_> = waiting.iter().filter(|w| w.0 <= bench.now_us).map(|w| w.1).collect();
        waiting.retain(|w| w.0 > bench.now_us);
        for frame in due {
            _ = Devices::ingest(&mut bench.own, &frame, now);
        }
        if tick == 300 {
            bench.own.arm(now).unwrap();
        }
        let target = if tick / 400 % 2 == 0 { 1.0 } else { -1.0 };
        _ = bench.own.set_angle((), Angle::from_radians(target));
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if let Some(answer) = bench.drive.hear(&frame) {
                waiting.push((bench.now_us + 9_000, answer));
            }
        }
        for _ in 0..10 {
            bench.drive.step(1e-4);
            most = most.max(bench.drive.shaft().torque_nm().abs());
        }
    }
    println!(
        "{most} Nm, enabled {}, at {}",
        bench.drive.is_enabled(),
        bench.drive.shaft().angle_rad()
    );
    assert!(bench.drive.is_enabled(), "{:?}", bench.own.health());
    assert!(most < 4.0, "{most} Nm, limit 2");
}

// ---------------------------------------------------------------- end of PMAX

fn is_held_at_the_ends(mode: impl Into<Mode> + Copy, number: f32) {
    for angle in [12.7_f32, -12.7] {
        let mut bench = Bench::new(mode, number);
        bench.drive.shaft_mut().set_angle(angle.signum() * 12.3);
        bench.steps(100, |_| {});
        bench.own.arm(bench.now()).unwrap();
        for tick in 0..3_000 {
            let set = bench.own.set_angle((), Angle::from_radians(angle));
            assert_eq!(set, Ok(()), "tick {tick}, at {} rad", bench.drive.shaft().angle_rad());
            bench.step();
        }
    }
}

/// A target whose nearest turn lies beyond PMAX: the motor should stop short of the end and hold there. It goes to the end, its feedback
/// is no position there, so it is disabled and trips: a loaded arm falls.
#[test]
fn a_joint_that_is_led_to_the_end_of_its_range_is_held() {
    is_held_at_the_ends(Mode::position_velocity(quick()), 2.0);
}

#[test]
fn a_spring_that_is_led_to_the_end_of_its_range_is_held() {
    is_held_at_the_ends(mit(), 1.0);
}

// ---------------------------------------------------------------- configuration, settings, bus

/// `ForcePosition::new`: "the velocity, above 0 and at most VMAX and 100 rad/s". 200 should be refused.
#[test]
fn force_position_refuses_more_than_100_rad_s() {
    assert!(Motor::new(Model::H3510, 1, Mode::force_position(rad_s(200.0), 0.5)).is_err());
}

/// 0x7FF is the id of all drives. A tool, or a second controller, that asks *another* drive should not be a second master of this one.
#[test]
fn a_question_to_another_drive_is_no_second_master() {
    let mut bench = Bench::new(mit(), 1.0);
    bench.steps(100, |_| {});
    let asked = CanFrame::standard(0x7FF, [5, 0, 0x33, 10, 0, 0, 0, 0]).unwrap();
    let now = bench.now();
    _ = Devices::ingest(&mut bench.own, &asked, now);
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

/// Two motors in one program hear each other's questions where the driver receives what it sends, as with socketcan.
#[test]
fn frames_for_each_update_are_few() {
    for (name, frames) in
        [("mit", most_frames(mit(), 1.0)), ("velocity", most_frames(Mode::velocity(quick()), 3.0))]
    {
        println!("{name}: {frames:?} frames in an update at most: disarmed, enabling, driven");
        assert!(frames.iter().all(|count| *count <= 3));
    }
}

fn most_frames(mode: impl Into<Mode> + Copy, number: f32) -> [usize; 3] {
    let mut bench = Bench::new(mode, number);
    let mut most = [0; 3];
    for tick in 0..600 {
        if tick == 200 {
            bench.own.arm(bench.now()).unwrap();
        }
        _ = bench.own.set_velocity((), rad_s(1.0));
        bench.step();
        let phase = usize::from(tick > 200) + usize::from(bench.drive.is_enabled());
        most[phase.min(2)] = most[phase.min(2)].max(bench.frames.len());
    }
    most
}

// ---------------------------------------------------------------- rest at every moment

struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

/// Random calls, lost, delayed, duplicated and refused frames, bad clocks and power cycles. After a disarm or an emergency stop every
/// frame is rest as a foreign decoder reads it; a drive is never enabled without TIMEOUT by a frame while disarmed; what MIT commands ask for
/// at the reported place keeps within the limit and half a count.
fn storm(
    mode: impl Into<Mode> + Copy,
    number: f32,
    set: impl Fn(&mut Actuator<Motor>, f32),
    sags: bool,
    writes: bool,
) {
    let (seeds, must_confirm) = (60, !sags || writes);
    let mut confirmations = 0;
    let is_mit = number == 1.0;
    for seed in 0..seeds {
        let mut random = Random(seed * 7_919 + 13);
        let mut bench = Bench::new(mode, number);
        let mut waiting: Vec<(u64, CanFrame)> = Vec::new();
        let (mut resting, mut stopped) = (true, false);
        for tick in 0..1_500 {
            bench.now_us += match random.below(200) {
                0 => 0,
                1 => 15_000,
                2 => 150_000,
                _ => 1_000,
            };
            let now = bench.now();
            let due: Vec<_> = waiting.iter().filter(|w| w.0 <= bench.now_us).map(|w| w.1).collect();
            waiting.retain(|w| w.0 > bench.now_us);
            for frame in due {
                _ = Devices::ingest(&mut bench.own, &frame, now);
            }
            match random.below(300) {
                0 => {
                    bench.own.disarm();
                    resting = true;
                }
                1 => {
                    bench.own.emergency_stop();
                    resting = true;
                    stopped = true;
                }
                2 if stopped => {
                    bench.own.clear_emergency_stop();
                    stopped = false;
                }
                3 if sags => bench.drive.lose_supply(),
                4 => bench.drive.fail(8 + random.below(7) as u8),
                5 if writes => _ = bench.own.motor_mut().write(Register::Timeout, 0.0),
                _ => {}
            }
            if random.below(40) == 0 && bench.own.arm(now).is_ok() {
                resting = false;
            }
            if random.below(100) > 0 {
                set(&mut bench.own, (random.below(2_001) as f32 - 1_000.0) / 1_000.0);
            }
            if random.below(3_000) == 0 {
                set(&mut bench.own, f32::NAN);
            }
            let dt = if random.below(150) == 0 { f32::NAN } else { 0.001 };
            if random.below(20) > 0 {
                bench.own.update(Tick::new(now, dt));
            }
            let must_rest = resting
                || !bench.own.guard().has_target()
                || bench.own.guard().link() != drivetrain::motor::Link::Online;
            while let Some(frame) = bench.own.next_frame(0) {
                if random.below(40) == 0 {
                    bench.own.requeue(&frame);
                    if random.below(3) == 0 {
                        let again = bench.own.requeue(&frame);
                        _ = again;
                    }
                    continue;
                }
                if must_rest && frame.header() != 0x7FF {
                    let d = frame.data();
                    let is_switch = d[..7] == [0xFF; 7];
                    let is_off = is_switch && matches!(d[7], 0xFD | 0xFB);
                    let [_, _, kp, kd, t] = mit_fields(&frame, [12.5, 30.0, 10.0]);
                    let is_free = is_mit
                        && !is_switch
                        && kp == 0.0
                        && kd == 0.0
                        && t.abs() <= 10.0 / 4_095.0 + 1e-9;
                    assert!(
                        is_off || is_free,
                        "seed {seed} tick {tick}: {frame:?} while it should rest"
                    );
                }
                if random.below(30) == 0 {
                    continue;
                }
                let was_enabled = bench.drive.is_enabled();
                let answer = bench.drive.hear(&frame);
                confirmations += u32::from(!was_enabled && bench.drive.is_enabled());
                if must_confirm && !was_enabled && bench.drive.is_enabled() {
                    assert_eq!(
                        timeout_of(&bench.drive),
                        2_000,
                        "seed {seed} tick {tick}: enabled without TIMEOUT"
                    );
                }
                if let Some(answer) = answer.filter(|_| random.below(30) > 0) {
                    match random.below(20) {
                        0 => waiting.push((bench.now_us + random.below(40_000), answer)),
                        _ => _ = Devices::ingest(&mut bench.own, &answer, now),
                    }
                }
            }
            bench.drive.step(0.001);
        }
    }
    println!("enabled {confirmations} times");
    assert!(confirmations > 20);
}

#[test]
fn rest_in_a_storm_mit() {
    storm(mit(), 1.0, |own, x| _ = own.set_angle((), Angle::from_radians(x)), true, false);
}

#[test]
fn rest_in_a_storm_velocity() {
    storm(
        Mode::velocity(quick()),
        3.0,
        |own, x| _ = own.set_velocity((), rad_s(10.0 * x)),
        true,
        false,
    );
}

#[test]
fn rest_in_a_storm_position() {
    storm(
        Mode::position_velocity(quick()),
        2.0,
        |own, x| _ = own.set_angle((), Angle::from_radians(x)),
        true,
        false,
    );
}

#[test]
fn rest_in_a_storm_force() {
    storm(
        Mode::force_position(quick(), 2.0),
        4.0,
        |own, x| _ = own.set_angle((), Angle::from_radians(x)),
        true,
        false,
    );
}

/// As above without sags of the supply: the time-out is confirmed whatever is lost, late or refused.
#[test]
fn time_out_in_a_storm() {
    storm(mit(), 1.0, |own, x| _ = own.set_angle((), Angle::from_radians(x)), false, false);
    storm(
        Mode::velocity(quick()),
        3.0,
        |own, x| _ = own.set_velocity((), rad_s(10.0 * x)),
        false,
        false,
    );
    storm(
        Mode::position_velocity(quick()),
        2.0,
        |own, x| _ = own.set_angle((), Angle::from_radians(x)),
        false,
        false,
    );
    storm(
        Mode::force_position(quick(), 2.0),
        4.0,
        |own, x| _ = own.set_angle((), Angle::from_radians(x)),
        false,
        false,
    );
}

/// As above, and the program writes TIMEOUT 0 while disarmed: "the drive is enabled only after it has confirmed that".
#[test]
fn time_out_in_a_storm_with_writes() {
    storm(mit(), 1.0, |own, x| _ = own.set_angle((), Angle::from_radians(x)), false, true);
}

/// A question that waits when the motor is driven should not go out any more: it is sent after the time-out was written, and here
/// sets it to 0. The drive is then enabled without one.
#[test]
fn a_write_that_waits_does_not_undo_the_time_out() {
    let mut bench = Bench::new(mit(), 1.0);
    bench.steps(100, |_| {});
    bench.own.motor_mut().write(Register::Timeout, 0.0).unwrap();
    let mut kept = Vec::new();
    for tick in 0..200 {
        bench.now_us += 1_000;
        let now = bench.now();
        if tick == 25 {
            bench.own.arm(now).unwrap();
        }
        _ = bench.own.set_velocity((), rad_s(1.0));
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            // The driver has no room for it and its queue is long: it leaves 40 ms later.
            let is_write =
                frame.header() == 0x7FF && frame.data()[2] == 0x55 && frame.data()[4] == 0;
            if is_write && tick < 25 {
                kept = vec![frame];
                continue;
            }
            if let Some(answer) = bench.drive.hear(&frame) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        if tick == 26 {
            for frame in kept.drain(..) {
                let answer = bench.drive.hear(&frame).unwrap();
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
        assert!(!bench.drive.is_enabled() || timeout_of(&bench.drive) == 2_000, "tick {tick}");
    }
    assert!(bench.drive.is_enabled());
}

/// The same, waiting in our own slot while the driver takes nothing.
#[test]
fn a_write_that_waits_in_the_slot_does_not_undo_the_time_out() {
    for from in 0..40 {
        let mut bench = Bench::new(mit(), 1.0);
        bench.steps(100, |_| {});
        bench.own.motor_mut().write(Register::Timeout, 0.0).unwrap();
        for tick in 0..200 {
            bench.now_us += 1_000;
            let now = bench.now();
            if tick == from + 2 {
                bench.own.arm(now).unwrap();
            }
            _ = bench.own.set_velocity((), rad_s(1.0));
            bench.own.update(Tick::new(now, 0.001));
            if tick >= from && tick < from + 3 {
                let refresh = CanFrame::standard(0x7FF, [1, 0, 0xCC, 0, 0, 0, 0, 0]).unwrap();
                let answer = bench.drive.hear(&refresh).unwrap();
                _ = Devices::ingest(&mut bench.own, &answer, now);
                continue;
            }
            while let Some(frame) = bench.own.next_frame(0) {
                if let Some(answer) = bench.drive.hear(&frame) {
                    _ = Devices::ingest(&mut bench.own, &answer, now);
                }
            }
            assert!(
                !bench.drive.is_enabled() || timeout_of(&bench.drive) == 2_000,
                "busy from {from}, tick {tick}"
            );
        }
    }
}

/// `Target::Impedance` beside a warm motor: at every share the drive should get at most `share * limit`, as it reads the frame.
#[test]
fn an_impedance_keeps_the_limit_of_each_share() {
    let ranges = [12.5, 30.0, 10.0];
    let mut random = Random(5);
    let mut worst = (0.0, 0.0, Impedance::FREE);
    for _ in 0..300_000 {
        let mut unit = || (random.below(20_001) as f64 - 10_000.0) / 10_000.0;
        let share = unit().abs() as f32;
        let (p, v) = (12.4 * unit(), 29.0 * unit());
        let target = Impedance {
            angle: Angle::from_radians(14.0 * unit() as f32),
            velocity: rad_s(35.0 * unit() as f32),
            stiffness: (50.0 * unit().powi(4)) as f32,
            damping: 5.0 * unit().abs() as f32,
            torque_nm: 5.0 * unit() as f32,
        };
        let mut motor = Motor::new(Model::J4310, 1, ImpedanceControl::new(3.0).unwrap()).unwrap();
        _ = motor.decode(&feedback_of(ranges, 1, 1, p, v));
        let frame = motor.control(Order {
            target: Target::Impedance(target),
            share,
            step: TimeStep::of(0.001),
        });
        if frame.data()[..7] == [0xFF; 7] {
            continue;
        }
        let [ps, vs, kp, kd, t] = mit_fields(&frame, ranges);
        let over = (kp * (ps - p) + kd * (vs - v) + t).abs() - 3.0 * f64::from(share);
        if over > worst.0 {
            worst = (over, share.into(), target);
        }
    }
    assert!(
        worst.0 < 0.2,
        "{:.2} Nm above the limit of 3 Nm times {}: {:?}",
        worst.0,
        worst.1,
        worst.2
    );
}

/// A wheel turns at its target of 20 rad/s when its feedback is late once, by 15 ms. It should go on smoothly. It is disabled, enabled with
/// "stay at 20 rad/s", and then told 0 rad/s, as the output opens from zero: a full brake.
#[test]
fn velocity_mode_does_not_brake_hard_after_late_feedback() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    bench.drive = bench.drive.with_shaft(DriveShaft::new(0.01, 0.001));
    bench.steps(3_000, |b| b.own.set_velocity((), quick()).unwrap());
    let (mut torque, mut slowest) = (0.0_f32, f32::MAX);
    for tick in 0..400 {
        _ = bench.own.set_velocity((), quick());
        bench.is_cut = tick < 15;
        bench.step();
        torque = torque.min(bench.drive.shaft().torque_nm());
        slowest = slowest.min(bench.drive.shaft().velocity_rad_per_s());
    }
    assert!(
        torque > -1.0 && slowest > 15.0,
        "target 20 all the time: {torque} Nm, down to {slowest} rad/s"
    );
}

/// The same when a coasting wheel is armed, its target the speed that it has.
#[test]
fn velocity_mode_does_not_brake_a_coasting_wheel_when_armed() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    bench.drive = bench.drive.with_shaft(DriveShaft::new(0.01, 0.001));
    bench.steps(3_000, |b| b.own.set_velocity((), quick()).unwrap());
    bench.own.disarm();
    bench.steps(80, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let (mut torque, mut slowest) = (0.0_f32, f32::MAX);
    for _ in 0..400 {
        _ = bench.own.set_velocity((), quick());
        bench.step();
        torque = torque.min(bench.drive.shaft().torque_nm());
        slowest = slowest.min(bench.drive.shaft().velocity_rad_per_s());
    }
    assert!(
        torque > -1.0 && slowest > 15.0,
        "target 20 all the time: {torque} Nm, down to {slowest} rad/s"
    );
}

/// After a short loss of feedback (30 ms) a spring should not come back at full stiffness at once: the shaft may be elsewhere by then.
#[test]
fn a_spring_does_not_come_back_at_once_after_late_feedback() {
    let mut bench =
        Bench::armed(ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap(), 1.0);
    bench.steps(1_000, |b| b.own.set_angle((), Angle::ZERO).unwrap());
    for tick in 0..60 {
        _ = bench.own.set_angle((), Angle::ZERO);
        bench.is_cut = tick < 30;
        if tick == 25 {
            bench.drive.shaft_mut().set_angle(-1.0);
        }
        bench.step();
        if tick > 31 {
            println!("{tick} {:.2}", bench.drive.shaft().torque_nm());
        }
        assert!(
            !(30..=40).contains(&tick) || bench.drive.shaft().torque_nm() < 1.0,
            "{} Nm, tick {tick}",
            bench.drive.shaft().torque_nm()
        );
    }
}

/// A drive that is in another mode and enabled (by another tool, or by this program before it was restarted) should be disabled by an
/// emergency stop. The frames go to the id of our mode alone, which such a drive discards.
#[test]
fn an_emergency_stop_disables_a_drive_in_another_mode() {
    let mut bench = Bench::new(Mode::velocity(quick()), 1.0);
    bench.steps(100, |_| {});
    _ = bench.drive.hear(&CanFrame::standard(1, [255, 255, 255, 255, 255, 255, 255, 252]).unwrap());
    assert!(bench.drive.is_enabled());
    bench.own.emergency_stop();
    bench.steps(300, |_| {});
    assert!(!bench.drive.is_enabled());
}

/// A refused frame is its sender's: `requeue` should return true for each frame that came from `next_frame`.
#[test]
fn each_frame_of_a_motor_can_be_given_back() {
    let mut bench = Bench::new(Mode::velocity(quick()), 3.0);
    let mut foreign = Vec::new();
    for tick in 0..300 {
        if tick == 150 {
            bench.own.arm(bench.now()).unwrap();
        }
        _ = bench.own.set_velocity((), rad_s(1.0));
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if frame.header() == 0x7FF && frame.data()[2] == 0xCC && !bench.own.requeue(&frame) {
                foreign.push(frame);
            }
            if let Some(answer) = bench.drive.hear(&frame) {
                _ = Devices::ingest(&mut bench.own, &answer, now);
            }
        }
    }
    assert!(foreign.is_empty(), "{foreign:?}");
}

/// A late frame with an error arrives while the drive is enabled, and nothing more is heard then. The drive should be disabled. It gets nothing but
/// "clear error", 1000 times a second, which also feeds its watchdog: it goes on with its last velocity for ever.
#[test]
fn a_drive_is_disabled_after_an_error_that_is_over() {
    let mut bench = Bench::armed(Mode::velocity(quick()), 3.0);
    bench.steps(1_000, |b| b.own.set_velocity((), quick()).unwrap());
    let now = bench.now();
    _ = Devices::ingest(&mut bench.own, &feedback_of([12.5, 30.0, 10.0], 1, 8, 0.0, 20.0), now);
    bench.own.emergency_stop();
    for _ in 0..2_000 {
        bench.now_us += 1_000;
        let now = bench.now();
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            _ = bench.drive.hear(&frame); // nothing comes back
        }
        bench.drive.step(0.001);
    }
    let speed = bench.drive.shaft().velocity_rad_per_s();
    assert!(!bench.drive.is_enabled(), "2 s after the emergency stop: {speed} rad/s");
}

/// Feedback that is 20 ms old when it arrives, each ms: nobody sees that. What the torque then is, beside the limit.
#[test]
fn a_spring_with_feedback_20_ms_old_keeps_within_twice_its_limit() {
    let mut worst = Vec::new();
    for (stiffness, damping) in [(20.0, 0.6), (60.0, 1.0), (150.0, 3.0), (400.0, 5.0)] {
        let mode = ImpedanceControl::new(2.0).unwrap().with_gains(stiffness, damping).unwrap();
        let mut bench = Bench::new(mode, 1.0);
        let mut waiting: Vec<(u64, CanFrame)> = Vec::new();
        let mut most = 0.0_f32;
        for tick in 0..3_000_u32 {
            bench.now_us += 1_000;
            let now = bench.now();
            let due: Vec<_> = waiting.iter().filter(|w| w.0 <= bench.now_us).map(|w| w.1).collect();
            waiting.retain(|w| w.0 > bench.now_us);
            for frame in due {
                _ = Devices::ingest(&mut bench.own, &frame, now);
            }
            if tick == 400 {
                bench.own.arm(now).unwrap();
            }
            _ = bench
                .own
                .set_angle((), Angle::from_radians(if tick / 400 % 2 == 0 { 1.0 } else { -1.0 }));
            bench.own.update(Tick::new(now, 0.001));
            while let Some(frame) = bench.own.next_frame(0) {
                if let Some(answer) = bench.drive.hear(&frame) {
                    waiting.push((bench.now_us + 20_000, answer));
                }
            }
            for _ in 0..10 {
                bench.drive.step(1e-4);
                most = most.max(bench.drive.shaft().torque_nm().abs());
            }
        }
        worst.push((stiffness, damping, most, bench.drive.is_enabled()));
    }
    println!("{worst:?}");
    assert!(
        worst.iter().all(|it| it.2 < 4.0 && it.3),
        "limit 2 Nm: (stiffness, damping, torque): {worst:?}"
    );
}

/// A joint on its way in position-velocity mode, whose feedback is late once by 15 ms: how hard it is braked.
#[test]
fn position_mode_does_not_brake_hard_after_late_feedback() {
    let mut bench = Bench::new(Mode::position_velocity(rad_s(10.0)), 2.0);
    bench.drive = bench.drive.with_shaft(DriveShaft::new(0.01, 0.001));
    bench.steps(100, |_| {});
    bench.own.arm(bench.now()).unwrap();
    bench.steps(300, |b| b.own.set_angle((), Angle::from_radians(3.0)).unwrap());
    let before = bench.drive.shaft().velocity_rad_per_s();
    let (mut slowest, mut torque) = (f32::MAX, 0.0_f32);
    for tick in 0..40 {
        _ = bench.own.set_angle((), Angle::from_radians(3.0));
        bench.is_cut = tick < 15;
        bench.step();
        torque = torque.min(bench.drive.shaft().torque_nm());
        slowest = slowest.min(bench.drive.shaft().velocity_rad_per_s());
    }
    assert!(torque > -1.0, "{before} rad/s before, then {torque} Nm, down to {slowest} rad/s");
}

/// A motor of one's own whose commands have an id that others share. Its command was refused: it is its own, as at 374294f.
#[test]
fn a_shared_command_of_an_own_motor_can_be_given_back() {
    use drivetrain::motor::{Claim, Ingest, MotorName};
    use embedded_can::StandardId;
    struct Shared;
    impl DriveProtocol for Shared {
        fn name(&self) -> MotorName {
            MotorName::new("shared", 1)
        }
        fn claims(&self) -> impl IntoIterator<Item = Claim> {
            let id = |raw| StandardId::new(raw).unwrap();
            let command = Claim::command(id(0x123), self.name());
            [command, Claim::feedback(id(0x124), self.name())].map(Claim::shared)
        }
        fn decode(&mut self, _: &CanFrame) -> Ingest {
            Ingest::Taken
        }
        fn velocity(&self) -> AngularVelocity {
            AngularVelocity::ZERO
        }
        fn rest(&mut self) -> CanFrame {
            CanFrame::standard(0x123, [1, 0, 0, 0, 0, 0, 0, 0]).unwrap()
        }
        fn control(&mut self, _: Order) -> CanFrame {
            CanFrame::standard(0x123, [1, 0, 0, 0, 0, 0, 0, 9]).unwrap()
        }
        fn reset(&mut self) {}
    }
    let mut own = Actuator::new(Shared);
    own.update(Tick::new(drivetrain::time::Instant::from_micros(1_000), 0.001));
    let frame = own.next_frame(0).unwrap();
    assert!(own.requeue(&frame), "{frame:?}");
}

/// The driver refuses the frames of rest while feedback is late, and then a frame that clears an error took the place of the next one: the
/// drive went on with its last command. Found by a fuzzer.
#[test]
fn rest_that_the_driver_refused_gives_way_to_no_other_frame() {
    let mode = ImpedanceControl::new(3.0).unwrap().with_gains(20.0, 0.6).unwrap();
    for lost in 1..8 {
        let mut bench = Bench::armed(mode, 1.0);
        bench.steps(200, |b| {
            b.own.set_velocity((), AngularVelocity::from_rad_per_s(6.0)).unwrap();
        });
        bench.drive.shaft_mut().set_load(-1.0);
        bench.steps(20, |b| b.own.set_velocity((), AngularVelocity::from_rad_per_s(6.0)).unwrap());
        assert!(bench.drive.shaft().torque_nm() > 0.5);
        let update = |bench: &mut Bench| {
            bench.now_us += 12_000;
            let now = bench.now();
            Devices::update(&mut bench.own, Tick::new(now, 0.001));
        };
        for _ in 0..lost {
            update(&mut bench);
            while let Some(frame) = Devices::next_frame(&mut bench.own, 0) {
                assert!(Devices::requeue(&mut bench.own, &frame));
            }
        }
        // Somebody else's frame with the id of the feedback: an error that the drive does not have.
        let fake = CanFrame::standard(0x11, [0xA1, 0x80, 0, 0x7F, 0xF7, 0xFF, 30, 30]).unwrap();
        let now = bench.now();
        assert_eq!(Devices::ingest(&mut bench.own, &fake, now), drivetrain::motor::Ingest::Taken);
        update(&mut bench);
        assert!(!Devices::is_armed(&mut bench.own));
        while let Some(frame) = Devices::next_frame(&mut bench.own, 0) {
            _ = bench.drive.hear(&frame);
        }
        bench.drive.step(1e-5);
        assert!(bench.drive.shaft().torque_nm().abs() < 0.003, "after {lost} refused frames");
    }
}

/// 90° with a stiffness of 8 Nm/rad pass VMAX, 10 rad/s. Without its damper the joint swung 79° beyond its target.
#[test]
fn a_damper_still_brakes_a_joint_that_is_faster_than_vmax() {
    let gains = ImpedanceControl::new(25.0).unwrap().with_gains(8.0, 0.8).unwrap();
    let mut bench = Bench::new(mit(), 1.0);
    bench.own = Actuator::new(Motor::new(Model::J4340, 1, gains).unwrap());
    let shaft = DriveShaft::new(0.02, 0.0);
    bench.drive = DamiaoDrive::of(Model::J4340, 1).with_shaft(shaft);
    bench.steps(200, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let (mut fastest, mut farthest) = (0.0_f32, 0.0_f32);
    bench.steps(400, |bench| bench.own.set_angle((), Angle::ZERO).unwrap());
    bench.steps(2_000, |bench| {
        bench.own.set_angle((), Angle::from_degrees(90.0)).unwrap();
        fastest = fastest.max(bench.drive.shaft().velocity_rad_per_s());
        farthest = farthest.max(bench.drive.shaft().angle_rad());
    });
    assert!(fastest > 10.0 && farthest.to_degrees() < 92.0, "{fastest} rad/s, {farthest} rad");
}
