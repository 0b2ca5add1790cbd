//! The whole path on the simulated bus: runner, DJI bus, motors, and what goes wrong between them.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::motor::Link;
use drivetrain::runner::{BlockingTx, Nb, Runner};
use drivetrain::sim::{Controller, Fault, Line, MotorConfig, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_can::nb::Can;

const SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0).with_output_limit(20.0);

type Robot<'a> = Runner<Nb<Controller<'a>>, &'a Simulation, Bus>;

fn at(millis: u64) -> Instant {
    Instant::START + Duration::from_millis(millis)
}

fn rpm(value: f32) -> AngularVelocity {
    AngularVelocity::from_rpm(value)
}

/// A world with two M3508, and a robot on it that has them in speed loops.
fn two_wheels(world: &Simulation) -> ([MotorKey; 2], [Handle<M3508>; 2], Robot<'_>) {
    let keys = [1, 2].map(|id| world.attach(MotorConfig::m3508(id)).unwrap());
    let mut bus = Bus::new();
    let handles = [1, 2].map(|id| bus.attach(Config::<M3508>::new(id).speed_loop(SPEED)).unwrap());
    (keys, handles, Runner::new(Nb(world.controller()), world.clock(), bus))
}

/// Runs the loop of a robot for a time, with `work` before each tick.
fn run(
    world: &Simulation,
    robot: &mut Robot<'_>,
    millis: u64,
    mut work: impl FnMut(&mut Bus, Tick),
) {
    for _ in 0..10 * millis {
        world.advance(Duration::from_micros(100));
        robot.poll(16);
        if let Some(tick) = robot.due() {
            let _missing = robot.is_armed() || robot.arm(tick).is_ok();
            work(robot.device_mut(), tick);
            robot.tick(tick);
        }
    }
}

#[test]
fn a_speed_loop_reaches_its_target_and_the_library_sees_what_is_true() {
    let world = Simulation::new(7);
    let (keys, handles, mut robot) = two_wheels(&world);
    let targets = [rpm(100.0), rpm(-300.0)];
    run(&world, &mut robot, 500, |bus, _| {
        for (handle, target) in handles.into_iter().zip(targets) {
            let _disarmed = bus.set_velocity(handle, target);
        }
    });
    for ((key, handle), target) in keys.into_iter().zip(handles).zip(targets) {
        let truth = world.motor(key).unwrap();
        assert!((truth.velocity / target - 1.0).abs() < 0.01, "{truth:?}");
        let state = robot.device().state(handle).unwrap();
        assert_eq!((state.link, state.ambiguous_gaps), (Link::Online, 0));
        assert!((state.velocity - truth.velocity).abs() < rpm(1.0));
        assert!((state.current - truth.current).abs().as_amperes() < 0.05);
        // The last frame is a millisecond old at most: 8192 counts at 19.2 * 300 rpm are 787 a millisecond.
        assert!(state.rotor_counts.abs_diff(truth.encoder_counts) < 1_000, "{state:?} {truth:?}");
    }
    let (statistics, traffic) = (robot.statistics(), world.traffic(Line::Can1));
    assert_eq!((statistics.sent, statistics.refused), (traffic.sent, 0));
    assert!((traffic.load() - 0.33).abs() < 0.05, "{traffic:?}"); // three frames a millisecond
}

#[test]
fn a_silent_motor_gets_zero_and_the_other_goes_on() {
    let world = Simulation::new(8);
    let (keys, handles, mut robot) = two_wheels(&world);
    world.fault(Fault::Silent(keys[0]), at(300)..at(450)).unwrap();
    let target = |bus: &mut Bus, _: Tick| {
        for handle in handles {
            let _refused = bus.set_velocity(handle, rpm(200.0));
        }
    };
    run(&world, &mut robot, 299, target);
    assert!(handles.iter().all(|handle| robot.device().link(*handle) == Some(Link::Online)));
    run(&world, &mut robot, 15, target);
    assert_eq!(world.motor(keys[0]).unwrap().command, 0); // late after 10 ms
    run(&world, &mut robot, 100, target);
    assert_eq!(robot.device().link(handles[0]), Some(Link::Offline));
    let other = world.motor(keys[1]).unwrap().velocity;
    assert!((other / rpm(200.0) - 1.0).abs() < 0.02, "{other:?}");
}

#[test]
fn what_waits_in_the_mailboxes_at_bus_off_still_goes_out_afterwards() {
    let world = Simulation::new(9);
    let (keys, handles, mut robot) = two_wheels(&world);
    world.fault(Fault::Unplugged(Line::Can1), at(300)..at(900)).unwrap();
    run(&world, &mut robot, 850, |bus, _| {
        for handle in handles {
            let _refused = bus.set_velocity(handle, rpm(200.0));
        }
    });
    // The ESCs hold their last command, and three old frames wait: no call of embedded-can takes them back.
    assert!(world.motor(keys[0]).unwrap().command != 0);
    let before = world.traffic(Line::Can1).sent;
    robot.device_mut().emergency_stop();
    let mut commands = Vec::new();
    for _ in 0..1_000 {
        world.advance_with(Duration::from_micros(100), |record| {
            if record.frame.header() == 0x200 {
                commands.push(*record.frame.bytes());
            }
        });
        robot.poll(16);
        if let Some(tick) = robot.due() {
            robot.tick(tick);
        }
    }
    assert!(world.traffic(Line::Can1).sent > before + 3);
    let stale = commands.iter().take_while(|data| **data != [0; 8]).count();
    assert!((1..=3).contains(&stale), "{stale} frames from before the stop");
    assert!(commands[stale..].iter().all(|data| *data == [0; 8]));
    assert_eq!(world.motor(keys[0]).unwrap().command, 0);
}

#[test]
fn over_a_blocking_driver_frames_come_in_by_another_door_and_sending_takes_time() {
    let world = Simulation::new(10);
    let key = world.attach(MotorConfig::m3508(1)).unwrap();
    let mut bus = Bus::new();
    let handle = bus.attach(Config::<M3508>::new(1).speed_loop(SPEED)).unwrap();
    let mut robot = Runner::new(BlockingTx(world.controller()), world.clock(), bus);
    let mut interrupt = world.controller();
    while world.now() < at(500) {
        world.advance(Duration::from_micros(100));
        while let Ok(frame) = interrupt.receive() {
            let _unrelated = robot.ingest(&frame, world.now());
        }
        if let Some(tick) = robot.due() {
            let _missing = robot.is_armed() || robot.arm(tick).is_ok();
            let _disarmed = robot.device_mut().set_velocity(handle, rpm(100.0));
            robot.tick(tick);
        }
    }
    let velocity = world.motor(key).unwrap().velocity;
    assert!((velocity / rpm(100.0) - 1.0).abs() < 0.02, "{velocity:?}");
}

#[test]
fn two_runs_of_one_seed_are_the_same_to_the_last_bit() {
    let story = || {
        let world = Simulation::new(11);
        let (keys, handles, mut robot) = two_wheels(&world);
        let line = Line::Can1;
        world.fault(Fault::LostFrames { line, id: None, probability: 0.2 }, ..).unwrap();
        run(&world, &mut robot, 300, |bus, tick| {
            let wave = (tick.now().as_micros() / 1_000 % 200) as f32;
            for handle in handles {
                let _refused = bus.set_velocity(handle, rpm(wave));
            }
        });
        let truth = keys.map(|key| world.motor(key).unwrap());
        (
            truth.map(|motor| (motor.encoder_counts, motor.velocity.as_rad_per_s().to_bits())),
            robot.statistics(),
        )
    };
    let (first, second) = (story(), story());
    assert_eq!(first, second);
    assert!(world_moved(first.0));
}

fn world_moved(truth: [(i64, u32); 2]) -> bool {
    truth.iter().all(|(counts, _)| counts.abs() > 8192)
}

/// Four motors send 40 frames in each period of 10 ms.
#[test]
fn a_budget_below_the_frames_of_a_period_arms_nothing() {
    for (budget, is_armed) in [(16, false), (39, false), (41, true), (64, true)] {
        let world = Simulation::new(12).with_receive_depth(Line::Can1, 64);
        let keys = [1, 2, 3, 4].map(|id| world.attach(MotorConfig::m3508(id)).unwrap());
        let mut bus: Bus = Bus::new();
        let wheels = bus
            .attach_all([1, 2, 3, 4].map(|id| Config::<M3508>::new(id).speed_loop(SPEED)))
            .unwrap();
        let mut robot = Runner::new(Nb(world.controller()), world.clock(), bus)
            .with_period(Duration::from_millis(10));
        for ms in (0..2_000).step_by(10) {
            world.advance(Duration::from_millis(10));
            robot.poll(budget);
            let Some(tick) = robot.due() else { continue };
            if ms == 1_000 {
                let refused = robot.arm(tick).err().map(|why| why.to_string());
                let waits =
                    refused.as_ref().is_some_and(|why| why.contains("received frames wait"));
                assert_eq!((refused.is_none(), waits), (is_armed, !is_armed), "{refused:?}");
            }
            for wheel in wheels {
                _ = robot.device_mut().set_velocity(wheel, rpm(100.0));
            }
            robot.tick(tick);
        }
        let turns = world.motor(keys[0]).unwrap().velocity / rpm(100.0);
        assert!((turns - f32::from(u8::from(is_armed))).abs() < 0.05, "{budget}: {turns}");
    }
}
