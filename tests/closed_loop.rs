//! Whole paths on the simulator: from feedback frame to command frame and back through a motor.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Current, Gm6020Voltage, Handle, M2006, M3508, Model};
use drivetrain::encoder::{Homing, Position};
use drivetrain::motor::{Devices, Link, TargetError};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    Controller, Fault, Line, MotorConfig, MotorKey, Sender, Simulation, Transmission,
};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};

type SimRunner<'w, D = Bus> = Runner<Nb<Controller<'w>>, &'w Simulation, D>;

const WHEEL_SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0);

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1_000)
}

fn runner(world: &Simulation, bus: Bus) -> SimRunner<'_> {
    Runner::new(Nb(world.controller()), world.clock(), bus)
}

/// Runs `ms` milliseconds in steps of 100 µs; arms once all are heard and calls `work` before each tick.
fn run<'w>(
    world: &'w Simulation,
    runner: &mut SimRunner<'w>,
    ms: u64,
    mut work: impl FnMut(&mut Bus, u64),
    mut show: impl FnMut(&Transmission),
) {
    let end = world.now() + Duration::from_millis(ms);
    let mut was_armed = runner.is_armed();
    while world.now() < end {
        world.advance_with(Duration::from_micros(100), &mut show);
        runner.poll(16);
        if let Some(tick) = runner.due() {
            if !was_armed {
                was_armed = runner.arm(tick).is_ok();
            }
            work(runner.device_mut(), tick.now().as_micros() / 1_000);
            runner.tick(tick);
        }
    }
}

fn word(record: &Transmission, id: u32, slot: usize) -> Option<i16> {
    let bytes = record.frame.bytes();
    let ours = record.frame.header() == id && record.sender == Sender::Controller;
    ours.then(|| i16::from_be_bytes([bytes[2 * slot], bytes[2 * slot + 1]]))
}

fn speed_of<M: Model>(simulated: MotorConfig, id: u8, gains: PidConfig, rpm: f32) -> (f32, f32) {
    let world = Simulation::new(11);
    let key = world.attach(simulated).unwrap();
    let mut bus = Bus::new();
    let motor: Handle<M> = bus.attach(Config::new(id).speed_loop(gains)).unwrap();
    let mut runner = runner(&world, bus);
    let set = |bus: &mut Bus, _| _ = bus.set_velocity(motor, AngularVelocity::from_rpm(rpm));
    run(&world, &mut runner, 1_500, set, |_| {});
    let reported = runner.device().state(motor).unwrap().velocity.as_rpm();
    (world.motor(key).unwrap().velocity.as_rpm(), reported)
}

#[test]
fn every_model_follows_a_velocity_in_both_directions() {
    for sign in [1.0, -1.0] {
        for (name, rpm, (true_rpm, reported)) in [
            (
                "M3508",
                300.0,
                speed_of::<M3508>(MotorConfig::m3508(1), 1, WHEEL_SPEED, 300.0 * sign),
            ),
            (
                "M2006",
                300.0,
                speed_of::<M2006>(
                    MotorConfig::m2006(5),
                    5,
                    PidConfig::new(0.2, 2.0, 0.0),
                    300.0 * sign,
                ),
            ),
            (
                "GM6020 V",
                100.0,
                speed_of::<Gm6020Voltage>(
                    MotorConfig::gm6020_voltage(7),
                    7,
                    PidConfig::new(1.0, 8.0, 0.0),
                    100.0 * sign,
                ),
            ),
            (
                "GM6020 A",
                100.0,
                speed_of::<Gm6020Current>(
                    MotorConfig::gm6020_current(2),
                    2,
                    PidConfig::new(0.2, 2.0, 0.0),
                    100.0 * sign,
                ),
            ),
        ] {
            let target = rpm * sign;
            assert!((true_rpm - target).abs() < 0.02 * rpm, "{name}: {true_rpm} of {target}");
            assert!(
                (reported - true_rpm).abs() < 1.5,
                "{name}: reported {reported}, true {true_rpm}"
            );
        }
    }
}

#[test]
fn a_yaw_motor_goes_the_shortest_way_across_zero() {
    let world = Simulation::new(2);
    world.attach(MotorConfig::gm6020_voltage(3).with_rotor_angle(7_964)).unwrap(); // 350 degrees
    let mut bus = Bus::new();
    let loops = (PidConfig::new(15.0, 0.0, 0.0), PidConfig::new(1.0, 5.0, 0.0));
    let yaw = bus.attach(Config::<Gm6020Voltage>::new(3).position_loop(loops.0, loops.1)).unwrap();
    let mut runner = runner(&world, bus);
    let mut fastest: f32 = 0.0;
    let mut lowest: f32 = 360.0;
    let work = |bus: &mut Bus, _| {
        _ = bus.set_angle(yaw, Angle::from_degrees(10.0));
        if let Some(state) = bus.state(yaw) {
            fastest = fastest.max(state.velocity.as_rpm().abs());
            lowest = lowest.min((state.position.as_angle().as_degrees() - 350.0).abs());
        }
    };
    run(&world, &mut runner, 1_500, work, |_| {});
    let state = runner.device().state(yaw).unwrap();
    assert_eq!(
        (state.homing, state.position.turns()),
        (Homing::Absolute, 1),
        "up over 360, not back through 180"
    );
    assert!((state.position.angle().as_degrees() - 10.0).abs() < 0.5, "{:?}", state.position);
}

#[test]
fn a_geared_joint_holds_a_multi_turn_position() {
    let world = Simulation::new(3);
    let key = world.attach(MotorConfig::m2006(1)).unwrap();
    let mut bus = Bus::new();
    let joint = Config::<M2006>::new(1)
        .position_loop(PidConfig::new(12.0, 0.0, 0.0), PidConfig::new(0.3, 3.0, 0.0));
    let joint = bus.attach(joint).unwrap();
    let mut runner = runner(&world, bus);
    let goal = Position::new(3, Angle::from_degrees(90.0));
    let mut zeroed = false;
    let work = |bus: &mut Bus, _| {
        if !zeroed && bus.is_armed() {
            bus.zero(joint).unwrap();
            zeroed = true;
        }
        _ = bus.set_position(joint, goal);
    };
    run(&world, &mut runner, 2_500, work, |_| {});
    let state = runner.device().state(joint).unwrap();
    assert_eq!(state.homing, Homing::Homed);
    assert!((state.position - goal).as_degrees().abs() < 1.0, "{:?}", state.position);
    let turns = world.motor(key).unwrap().encoder_counts as f64 / 8192.0 / 36.0;
    assert!((turns - 3.25).abs() < 0.05, "the simulated shaft turned {turns}");
}

#[test]
fn lost_frames_at_speed_lose_no_turn() {
    for (seed, loss) in [(1, 0.05), (2, 0.2), (3, 0.5)] {
        let world = Simulation::new(seed);
        let key = world.attach(MotorConfig::m3508(1)).unwrap();
        let all = Fault::LostFrames { line: Line::Can1, id: None, probability: loss };
        world.fault(all, at_ms(50)..).unwrap();
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(WHEEL_SPEED)).unwrap();
        let mut runner = runner(&world, bus);
        let work = |bus: &mut Bus, ms| {
            let rpm = if ms / 700 % 2 == 0 { 460.0 } else { -460.0 };
            _ = bus.set_velocity(wheel, AngularVelocity::from_rpm(rpm));
        };
        run(&world, &mut runner, 4_000, work, |_| {});
        let state = runner.device().state(wheel).unwrap();
        let error = state.rotor_counts - world.motor(key).unwrap().encoder_counts;
        // Up to 11 lost frames in a row lie between the true state and the last one that arrived: 1.7 turns.
        assert!(
            error.abs() < 2 * 8192,
            "seed {seed}: {error} counts off, {} flags",
            state.ambiguous_gaps
        );
    }
}

/// What was sent (µs), how the first wheel was heard (ms), and whether it was armed in the end.
type Silence = (Vec<(u64, [i16; 4])>, Vec<(u64, Link)>, bool);

/// Four wheels at speed; the first one falls silent for `silent` ms at 500 ms.
fn silence(silent: u64, config: impl Fn(u8) -> Config<M3508>) -> Silence {
    let world = Simulation::new(4);
    let keys: Vec<MotorKey> =
        (1..=4).map(|id| world.attach(MotorConfig::m3508(id)).unwrap()).collect();
    world.fault(Fault::Silent(keys[0]), at_ms(500)..at_ms(500 + silent)).unwrap();
    let mut bus = Bus::new();
    let wheels = bus.attach_all([1, 2, 3, 4].map(config)).unwrap();
    let mut runner = runner(&world, bus);
    let (mut sent, mut links) = (Vec::new(), Vec::new());
    let work = |bus: &mut Bus, ms| {
        for wheel in wheels {
            _ = bus.set_velocity(wheel, AngularVelocity::from_rpm(200.0));
        }
        links.push((ms, bus.link(wheels[0]).unwrap()));
    };
    let show = |record: &Transmission| {
        if let Some(first) = word(record, 0x200, 0) {
            let rest = [1, 2, 3].map(|slot| word(record, 0x200, slot).unwrap());
            sent.push((record.at.as_micros(), [first, rest[0], rest[1], rest[2]]));
        }
    };
    run(&world, &mut runner, 1_200, work, show);
    let armed = runner.device().is_motor_armed(wheels[0]);
    (sent, links, armed)
}

#[test]
fn a_motor_silent_for_150_ms_is_zero_one_tick_after_the_late_limit_and_the_others_go_on() {
    let (sent, links, armed) = silence(150, |id| Config::new(id).speed_loop(WHEEL_SPEED));
    // Its last frame may be up to 1 ms old when the silence begins.
    let first_zero = sent.iter().find(|(at, words)| *at > 500_000 && words[0] == 0).unwrap().0;
    assert!((509_000..=512_000).contains(&first_zero), "zero at {first_zero} us");
    let after = |from: u64, to: u64| sent.iter().filter(move |(at, _)| (from..to).contains(at));
    assert!(
        after(512_000, 1_200_000).all(|(_, words)| words[0] == 0),
        "latched: zero until armed again"
    );
    assert!(
        after(500_000, 1_200_000).all(|(_, words)| words[1..].iter().all(|word| *word > 0)),
        "the others go on"
    );
    assert!(links.contains(&(560, Link::Late)) && links.contains(&(640, Link::Offline)));
    assert_eq!(links.last().unwrap().1, Link::Online);
    assert!(!armed);
}

#[test]
fn a_motor_silent_for_50_ms_comes_back_by_itself() {
    let (sent, _, armed) = silence(50, |id| Config::new(id).speed_loop(WHEEL_SPEED));
    let driven = |from: u64, to: u64| sent.iter().filter(move |(at, _)| (from..to).contains(at));
    assert!(driven(512_000, 550_000).all(|(_, words)| words[0] == 0));
    assert!(driven(560_000, 1_200_000).any(|(_, words)| words[0] > 0));
    assert!(armed);
}

#[test]
fn a_motor_with_a_ramp_is_driven_again_after_150_ms_of_silence() {
    let opening = Duration::from_millis(200);
    let (sent, _, armed) = silence(150, |id| {
        Config::new(id).speed_loop(WHEEL_SPEED).with_resume().with_opening(opening)
    });
    let back = sent.iter().find(|(at, words)| *at > 650_000 && words[0] != 0).unwrap();
    assert!((655_000..680_000).contains(&back.0), "driven again at {} us", back.0);
    assert!(back.1[0] < 2_000, "from zero: {}", back.1[0]);
    assert!(armed);
}

#[test]
fn after_bus_off_the_first_new_frames_are_zeros_and_it_has_to_be_armed() {
    let world = Simulation::new(6);
    world.attach(MotorConfig::m3508(1)).unwrap();
    world.fault(Fault::BusOff(Line::Can1), at_ms(300)..at_ms(600)).unwrap();
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(WHEEL_SPEED)).unwrap();
    let mut runner = runner(&world, bus);
    let mut sent = Vec::new();
    let show = |record: &Transmission| {
        sent.extend(word(record, 0x200, 0).map(|word| (record.at.as_micros(), word)))
    };
    let mut refused = None;
    let work = |bus: &mut Bus, ms| {
        let outcome = bus.set_velocity(wheel, AngularVelocity::from_rpm(200.0));
        if ms == 900 {
            refused = outcome.err();
        }
    };
    run(&world, &mut runner, 1_000, work, show);
    assert_eq!(runner.statistics().bus_losses, 1);
    assert_eq!(refused, Some(TargetError::Disarmed));
    let stale = sent.iter().filter(|(at, word)| *at > 600_000 && *word != 0).count();
    assert!(stale <= 3, "{stale} frames from before: three mailboxes at most");
    assert!(sent.iter().all(|(at, word)| *at < 620_000 || *word == 0));
    assert!(!runner.is_bus_down() && !runner.is_armed());
    let tick = drivetrain::time::Tick::new(world.now(), 0.001);
    assert_eq!(runner.arm(tick), Ok(()));
}

#[test]
fn foreign_frames_are_handed_back_while_the_loop_runs() {
    let world = Simulation::new(7);
    world.attach(MotorConfig::m3508(1)).unwrap();
    let foreign = drivetrain::frame::CanFrame::standard(0x321, [7; 8]).unwrap();
    let flood =
        Fault::Flood { line: Line::Can1, frame: foreign, period: Duration::from_micros(500) };
    world.fault(flood, ..).unwrap();
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(WHEEL_SPEED)).unwrap();
    let mut runner = runner(&world, bus);
    let mut handed_back = 0;
    for _ in 0..10_000 {
        world.advance(Duration::from_micros(100));
        runner.poll_with(4, |frame| {
            assert_eq!(*frame, foreign);
            handed_back += 1;
        });
        if let Some(tick) = runner.due() {
            _ = runner.arm(tick);
            _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rpm(100.0));
            runner.tick(tick);
        }
    }
    assert!((1_990..=2_000).contains(&handed_back), "{handed_back}");
    let statistics = runner.statistics();
    assert_eq!(statistics.received, statistics.taken + statistics.unrelated + statistics.malformed);
    assert!((990..=1_001).contains(&statistics.taken));
}

#[test]
fn the_same_seed_gives_the_same_frames() {
    let log = |seed| {
        let world = Simulation::new(seed);
        world.attach(MotorConfig::m3508(1)).unwrap();
        world
            .fault(Fault::LostFrames { line: Line::Can1, id: None, probability: 0.1 }, ..)
            .unwrap();
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(WHEEL_SPEED)).unwrap();
        let mut runner = runner(&world, bus);
        let mut log = String::new();
        let work = |bus: &mut Bus, _| _ = bus.set_velocity(wheel, AngularVelocity::from_rpm(200.0));
        run(&world, &mut runner, 500, work, |record| log += &format!("{record}\n"));
        log
    };
    assert_eq!(log(1), log(1));
    assert_ne!(log(1), log(2));
}
