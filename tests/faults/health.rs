//! F05, F08, F14 to F24 and F42: what is noticed, told as an edge, and followed by a reaction.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{Rig, armed, at_ms, at_once, feedback, rpm, step, ticks_since};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, M2006, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    ArmError, Condition, Conditions, HealthConfig, Ingest, Reaction, TargetError,
};
use drivetrain::sim::{Fault, Line, MotorConfig, Simulation};
use drivetrain::units::{Angle, Current};

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f05_a_second_master_is_an_edge_refuses_arming_and_relaxes_where_configured,
    f08_two_escs_with_one_id_are_an_edge_and_relax_it,
    f14_an_ambiguous_gap_is_an_edge_until_the_position_is_set,
    f15_a_power_cycle_has_its_edges_in_order,
    f17_a_speed_beyond_twice_no_load_is_an_edge_and_counts_no_turns,
    f18_heat_derates_on_a_line_to_zero_and_back_with_hysteresis,
    f19_each_error_code_is_an_edge_and_faults_relax,
    f21_a_stall_in_either_direction_is_reported_limited_or_relaxed,
    f22_a_runaway_is_relaxed_and_latched,
    f23_frozen_feedback_is_an_edge_and_a_true_standstill_is_none,
    f24_late_and_offline_are_edges_each_once,
    f42_a_soft_limit_lets_only_inward_output_through,
];

/// Takes all edges of a bus: condition and whether it began.
fn edges(bus: &mut Bus) -> Vec<(Condition, bool)> {
    std::iter::from_fn(|| bus.next_edge()).map(|edge| (edge.condition, edge.began)).collect()
}

fn began(edges: &[(Condition, bool)], condition: Condition) -> usize {
    edges.iter().filter(|edge| **edge == (condition, true)).count()
}

static SOUND: Conditions = Conditions::NONE;

#[cfg_attr(test, test)]
fn f05_a_second_master_is_an_edge_refuses_arming_and_relaxes_where_configured() {
    static RELAX: HealthConfig =
        HealthConfig::new().with_reaction(Condition::SecondMaster, Reaction::Relax);
    static USUAL: HealthConfig = HealthConfig::new();
    for (health, relaxes) in [(&USUAL, false), (&RELAX, true)] {
        let world = Simulation::new(1);
        let mut rig = Rig::with(&world, Line::Can1, 2, |config| config.with_health(health));
        rig.drive(300);
        assert_eq!(edges(rig.runner.device_mut()), []);
        let command = |id| CanFrame::standard(id, [0x10; 8]).unwrap();
        // Frames of a family that nobody uses here are somebody's business.
        world.inject(Line::Can1, command(0x1FF)).unwrap();
        rig.drive(5);
        assert_eq!(edges(rig.runner.device_mut()), []);
        world.inject(Line::Can1, command(0x200)).unwrap();
        rig.drive(20);
        let second = (Condition::SecondMaster, true);
        assert_eq!(edges(rig.runner.device_mut()), [second, second], "one a motor");
        let driven = rig.words(0, 308, 325).iter().any(|word| *word != 0);
        assert_ne!(driven, relaxes);
        let device = rig.runner.device_mut();
        device.disarm();
        let refused = device.arm(at_ms(326)).map_err(|error| error.to_string());
        let why = "another node sends the command of M3508 #1 on 0x200";
        assert_eq!(refused, Err(why.to_owned()));
        let one = [rig.wheels[1].erase()];
        let refused = rig.runner.device_mut().arm_only(&one, at_ms(326));
        assert!(matches!(refused, Err(ArmError::SecondMaster(_))));
        rig.drive(950);
        assert!(rig.runner.device_mut().arm(at_ms(1_275)).is_err(), "within a second");
        rig.drive(80);
        let ended = (Condition::SecondMaster, false);
        assert_eq!(edges(rig.runner.device_mut()), [ended, ended]);
        // Where it relaxed the motors, the refused request of 80 ms ago counts as asking.
        let early = rig.runner.device_mut().arm(at_ms(1_355));
        assert_eq!(early, if relaxes { Err(ArmError::NotReleased) } else { Ok(()) });
        rig.drive(100);
        assert_eq!(rig.runner.device_mut().arm(at_ms(1_455)), Ok(()));
        if relaxes {
            saw(format!("refused: {why}; relaxed; forgotten after 1 s"));
        }
    }
    // Frames of one's own that the driver hands back.
    let mut bus = Bus::new().with_loopback();
    bus.attach(Config::<M3508>::new(1)).unwrap();
    _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(1));
    let echo = CanFrame::standard(0x200, [0; 8]).unwrap();
    assert_eq!(bus.ingest(&echo, at_ms(1)), Ingest::Unrelated);
    assert_eq!((bus.arm(at_ms(1)), bus.next_edge()), (Ok(()), None));
}

#[cfg_attr(test, test)]
fn f08_two_escs_with_one_id_are_an_edge_and_relax_it() {
    for seed in 1..=3 {
        let world = Simulation::new(seed);
        let mut rig = Rig::new(&world, Line::Can1, 2);
        rig.drive(2_500);
        assert_eq!(edges(rig.runner.device_mut()), []);
        world.attach(MotorConfig::m3508(1).with_line(Line::Can1)).unwrap();
        let begin = rig.sent.len();
        rig.drive(2_300);
        let told = edges(rig.runner.device_mut());
        assert_eq!(began(&told, Condition::DuplicateId), 1, "seed {seed}: {told:?}");
        let health = rig.runner.device().health(rig.wheels[0]).unwrap();
        assert!((1_900..2_100).contains(&health.feedback_hz), "{health}");
        assert!(!health.armed && health.conditions.contains(Condition::DuplicateId));
        let last = rig.sent.last().unwrap().words;
        assert!(last[0] == 0 && last[1] != 0, "the other goes on");
        let found = rig.sent[begin..].iter().position(|sent| sent.words[0] == 0).unwrap();
        assert!(found < 2_200, "{found} ms");
        let refused = rig.runner.device_mut().arm(at_ms(4_800));
        assert!(matches!(refused, Err(ArmError::Faulty(_))), "{refused:?}");
        if seed == 1 {
            saw(format!("{} Hz, relaxed after {found} ms, arming refused", health.feedback_hz));
        }
    }
}

#[cfg_attr(test, test)]
fn f14_an_ambiguous_gap_is_an_edge_until_the_position_is_set() {
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    bus.zero(wheel).unwrap();
    _ = bus.ingest(&feedback(0x201, 0, 9_000), at_ms(2));
    for angle in [4_000, 100] {
        _ = bus.ingest(&feedback(0x201, angle, 9_000), at_ms(90 + u64::from(angle)));
    }
    assert_eq!(bus.state(wheel).unwrap().ambiguous_gaps, 2);
    let uncertain = Condition::PositionUncertain;
    assert_eq!(edges(&mut bus), [(uncertain, true)], "one edge for both");
    bus.zero(wheel).unwrap();
    assert_eq!(edges(&mut bus), [(uncertain, false)]);
    saw("one edge for two gaps, its end when the position is set");
}

#[cfg_attr(test, test)]
fn f15_a_power_cycle_has_its_edges_in_order() {
    let world = Simulation::new(3);
    let mut rig = Rig::new(&world, Line::Can1, 2);
    rig.drive(100);
    let wheel = rig.wheels[0];
    rig.runner.device_mut().zero(wheel).unwrap();
    let loss = Fault::PowerLoss { motor: rig.keys[0], forgets_angle: true };
    world.fault(loss, at_ms(500)..at_ms(900)).unwrap();
    rig.drive(1_000);
    let bus = rig.runner.device_mut();
    let told: Vec<_> = std::iter::from_fn(|| bus.next_edge()).collect();
    let expected = [
        (Condition::Late, true, 511),
        (Condition::Offline, true, 601),
        (Condition::PositionUncertain, true, 901),
        (Condition::Late, false, 911),
        (Condition::Offline, false, 911),
    ];
    assert_eq!(told.len(), expected.len(), "{told:?}");
    for (edge, (condition, began, ms)) in told.iter().zip(expected) {
        assert_eq!((edge.source.id(), edge.condition, edge.began), (1, condition, began));
        let off = edge.at.as_micros().abs_diff(ms * 1_000);
        assert!(off < 4_000, "{edge} and not at {ms} ms");
    }
    assert!(bus.conditions(wheel).contains(Condition::PositionUncertain));
    saw(format!("{} edges in order: {}", told.len(), told[1]));
}

#[cfg_attr(test, test)]
fn f17_a_speed_beyond_twice_no_load_is_an_edge_and_counts_no_turns() {
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    let mut hear = |rpm: i16, from: u64| {
        for ms in from..from + 30 {
            _ = bus.ingest(&feedback(0x201, 100, rpm), at_ms(ms));
            step(&mut bus, ms);
        }
        edges(&mut bus)
    };
    assert_eq!(hear(0, 2), []);
    assert!(hear(20_000, 32).contains(&(Condition::Overspeed, true)));
    assert!(hear(-20_000, 62).is_empty(), "the same condition");
    assert_eq!(hear(0, 92), [(Condition::Overspeed, false)]);
    // Eight lost frames at 32 767 rpm would be 43 turns.
    _ = bus.ingest(&feedback(0x201, 100, i16::MAX), at_ms(122));
    let before = bus.state(wheel).unwrap().rotor_counts;
    _ = bus.ingest(&feedback(0x201, 300, i16::MAX), at_ms(130));
    let state = bus.state(wheel).unwrap();
    assert_eq!(state.rotor_counts - before, 200);
    assert!(state.conditions.contains(Condition::PositionUncertain), "and not in silence");
    saw("an edge at 20 000 rpm of 9256; a gap at 32 767 rpm counts no turn");
}

#[cfg_attr(test, test)]
fn f18_heat_derates_on_a_line_to_zero_and_back_with_hysteresis() {
    static COOL: HealthConfig = HealthConfig::new().with_temperatures(60, 80);
    let world = Simulation::new(1);
    let mut rig = Rig::with(&world, Line::Can1, 2, |config| config.with_health(&COOL));
    rig.drive(300); // until the output range is open
    let wheels = rig.wheels.clone();
    let key = rig.keys[0];
    world.fault(Fault::BlockedShaft(key), ..).unwrap();
    let mut at = |celsius: f32| {
        world.set_temperature_c(key, celsius);
        rig.run(40, |bus, _| {
            _ = bus.set_current(wheels[0], Current::from_amperes(20.0));
            _ = bus.set_current(wheels[1], Current::from_amperes(0.1));
        });
        assert_eq!(rig.sent.last().unwrap().words[1], 82, "the other motor");
        (rig.sent.last().unwrap().words[0], edges(rig.runner.device_mut()))
    };
    let (warm, hot) = (Condition::Warm, Condition::Hot);
    assert_eq!(at(59.0), (16_384, vec![]));
    assert_eq!(at(60.0), (16_384, vec![(warm, true)]));
    assert_eq!(at(65.0), (12_288, vec![]));
    assert_eq!(at(75.0), (4_096, vec![]));
    assert_eq!(at(80.0), (0, vec![(hot, true)]));
    assert_eq!(at(76.0), (0, vec![]), "hysteresis");
    assert_eq!(at(74.0), (4_915, vec![(hot, false)]), "0.3");
    assert_eq!(at(56.0), (16_384, vec![]));
    assert_eq!(at(54.0), (16_384, vec![(warm, false)]));
    // Of the model, unless set: a C620 warns at 125 °C and stops at 180 °C.
    for (celsius, conditions) in [
        (124, SOUND),
        (125, SOUND.with(warm)),
        (180, SOUND.with(warm).with(hot)),
        (250, SOUND), // -6 °C, from an ESC that sends it signed
    ] {
        let (mut bus, [wheel]) = armed([Config::new(1)]);
        let mut data = *feedback(0x201, 0, 0).bytes();
        data[6] = celsius;
        let frame = CanFrame::standard(0x201, data).unwrap();
        for ms in 2..20 {
            _ = bus.ingest(&frame, at_ms(ms));
            step(&mut bus, ms);
        }
        assert_eq!(bus.conditions(wheel), conditions, "{celsius}");
    }
    saw("16384, 12288, 4096, 0 raw at 60, 65, 75, 80 °C of 60 to 80; 0 at 76 on the way back");
}

#[cfg_attr(test, test)]
fn f19_each_error_code_is_an_edge_and_faults_relax() {
    #[derive(Debug, Clone, Copy)]
    enum Model {
        M3508,
        M2006,
    }
    let (fault, warning) = (Condition::Fault, Condition::Warning);
    for (model, code, expected) in (1..=8)
        .chain([200])
        .flat_map(|code| [(Model::M3508, code, fault), (Model::M2006, code, fault)])
        .map(|row| match row {
            (Model::M3508, 8, _) | (Model::M2006, 6, _) => (row.0, row.1, warning),
            other => other,
        })
    {
        let mut bus = Bus::new();
        let motor = match model {
            Model::M2006 => bus.attach(at_once::<M2006>(1)).unwrap().erase(),
            Model::M3508 => bus.attach(at_once::<M3508>(1)).unwrap().erase(),
        };
        let mut ms = 0;
        let mut hear = |bus: &mut Bus, code: u8, ticks: u64| {
            let mut data = *feedback(0x201, 0, 0).bytes();
            data[7] = code;
            let frame = CanFrame::standard(0x201, data).unwrap();
            let mut word = 0;
            for _ in 0..ticks {
                ms += 1;
                _ = bus.ingest(&frame, at_ms(ms));
                _ = ms == 1 && bus.arm(at_ms(ms)).is_ok();
                _ = bus.set_raw(motor, 100);
                word = step(bus, ms).map_or(0, |words| words[0]);
            }
            word
        };
        assert_eq!((hear(&mut bus, 0, 20), edges(&mut bus)), (100, vec![]));
        let word = hear(&mut bus, code, 20);
        assert_eq!(word == 0, expected == fault, "{model:?} {code}");
        assert_eq!(edges(&mut bus), [(expected, true)], "{model:?} {code}: one edge");
        assert_eq!(bus.health(motor).unwrap().error_code, code, "raw");
        let armed = bus.is_armed();
        assert_eq!(armed, expected == warning);
        if expected == fault {
            let refused = bus.arm(at_ms(40)).map_err(|error| error.to_string());
            assert!(
                refused.is_err_and(|why| why.starts_with("not fit to be driven, see health(): M"))
            );
        }
        // An error is over when a whole round of looks heard none. A fault stays relaxed then, until it is armed.
        let word = hear(&mut bus, 0, 30);
        assert_eq!((word == 0, edges(&mut bus)), (expected == fault, vec![(expected, false)]));
        let early = bus.arm(at_ms(70));
        assert_eq!(early, if expected == fault { Err(ArmError::NotReleased) } else { Ok(()) });
        hear(&mut bus, 0, 100);
        assert_eq!((bus.arm(at_ms(170)), hear(&mut bus, 0, 1)), (Ok(()), 100));
    }
    // From one fault to another: an edge of its own, and no end between.
    let (mut bus, _) = armed([Config::new(1)]);
    let mut hear = |code: u8, from: u64| {
        for ms in from..from + 20 {
            let mut data = *feedback(0x201, 0, 0).bytes();
            data[7] = code;
            _ = bus.ingest(&CanFrame::standard(0x201, data).unwrap(), at_ms(ms));
            step(&mut bus, ms);
        }
        edges(&mut bus)
    };
    assert_eq!(hear(3, 2), [(fault, true)]);
    assert_eq!(hear(4, 22), [(fault, true)]);
    assert_eq!(hear(8, 42), [(warning, true), (fault, false)]);
    // An error that comes and goes all the time, unread for a second, is one edge.
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    for ms in 2..1_002 {
        let mut data = *feedback(0x201, 0, 0).bytes();
        data[7] = if ms / 13 % 2 == 0 { 3 } else { 0 };
        _ = bus.ingest(&CanFrame::standard(0x201, data).unwrap(), at_ms(ms));
        step(&mut bus, ms);
    }
    let told = edges(&mut bus);
    assert_eq!(began(&told, fault), 1, "{told:?}");
    assert!(told.len() <= 2 && bus.state(wheel).is_some());
    saw("8 of C620 and 6 of C610 warn, the others relax; one edge each; 1 s of flicker is one");
}

#[cfg_attr(test, test)]
fn f21_a_stall_in_either_direction_is_reported_limited_or_relaxed() {
    static REPORT: HealthConfig = HealthConfig::new();
    static LIMIT: HealthConfig = HealthConfig::new().with_stall_hold(0.1);
    static RELAX: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Relax);
    for (health, expected) in [(&REPORT, 16_384), (&LIMIT, 1_638), (&RELAX, 0)] {
        for direction in [1.0, -1.0] {
            let world = Simulation::new(1);
            let mut rig = Rig::with(&world, Line::Can1, 1, |config| config.with_health(health));
            let wheel = rig.wheels[0];
            let drive = |bus: &mut Bus, _| _ = bus.set_velocity(wheel, rpm(300.0 * direction));
            rig.run(400, drive);
            world.fault(Fault::BlockedShaft(rig.keys[0]), at_ms(400)..at_ms(1_500)).unwrap();
            rig.run(450, drive);
            assert_eq!(edges(rig.runner.device_mut()), [], "not before its window");
            rig.run(200, drive);
            let (begins, ends) = ((Condition::Stalled, true), (Condition::Stalled, false));
            let told = edges(rig.runner.device_mut());
            // Relaxed, it is no longer driven, and so the stall is over.
            let relaxed = expected == 0;
            assert_eq!(told, if relaxed { vec![begins, ends] } else { vec![begins] });
            let word = i32::from(rig.sent.last().unwrap().words[0]);
            assert_eq!(word.abs(), expected);
            assert!(word == 0 || (word > 0) == (direction > 0.0));
            rig.run(800, drive);
            if relaxed {
                assert_eq!(
                    rig.runner.device_mut().set_velocity(wheel, rpm(1.0)),
                    Err(TargetError::Relaxed)
                );
                assert_eq!(rig.runner.device_mut().arm(at_ms(1_850)), Ok(()));
            } else {
                let turns = rig.runner.device().state(wheel).unwrap().velocity.as_rpm();
                assert!((turns - 300.0 * direction).abs() < 20.0, "goes on by itself: {turns}");
            }
            let told = edges(rig.runner.device_mut());
            assert_eq!(told, if relaxed { vec![] } else { vec![ends] });
        }
        saw(format!("{expected} raw when stalled"));
    }
}

#[cfg_attr(test, test)]
fn f22_a_runaway_is_relaxed_and_latched() {
    for direction in [1.0, -1.0] {
        let world = Simulation::new(1);
        let mut rig = Rig::new(&world, Line::Can1, 2);
        let wheels = rig.wheels.clone();
        let drive = |bus: &mut Bus, _| {
            for wheel in &wheels {
                _ = bus.set_velocity(*wheel, rpm(200.0 * direction));
            }
        };
        world.fault(Fault::ReversedTorque(rig.keys[0]), ..).unwrap();
        rig.run(1_000, drive);
        let told = edges(rig.runner.device_mut());
        assert_eq!(told, [(Condition::Runaway, true)]);
        let first = rig.sent.iter().find(|sent| sent.words[0] != 0).unwrap().at;
        let driven = rig.sent.iter().rfind(|sent| sent.words[0] != 0).unwrap().at;
        assert!(driven.since(first).as_micros() < 350_000, "{:?}", driven.since(first));
        assert!(rig.sent.last().unwrap().words[1] != 0, "the other goes on");
        let wheel = wheels[0];
        let refused = rig.runner.device_mut().set_velocity(wheel, rpm(1.0));
        assert_eq!(refused, Err(TargetError::Relaxed));
        assert_eq!(rig.runner.device_mut().arm_only(&[wheel.erase()], at_ms(1_000)), Ok(()));
        assert_eq!(edges(rig.runner.device_mut()), [(Condition::Runaway, false)]);
        safe_after(ticks_since(first.as_micros() / 1_000, driven));
        saw(format!("relaxed after {} ms", driven.since(first).as_micros() / 1_000));
    }
}

#[cfg_attr(test, test)]
fn f23_frozen_feedback_is_an_edge_and_a_true_standstill_is_none() {
    let swing = |ms: u64| if (ms / 200).is_multiple_of(2) { 250.0 } else { -150.0 };
    let run = |fault: fn(drivetrain::sim::MotorKey) -> Fault, until: u64| {
        let world = Simulation::new(1);
        let mut rig = Rig::new(&world, Line::Can1, 1);
        world.fault(fault(rig.keys[0]), at_ms(550)..at_ms(until)).unwrap();
        let wheel = rig.wheels[0];
        rig.run(1_400, |bus, ms| _ = bus.set_velocity(wheel, rpm(swing(ms))));
        edges(rig.runner.device_mut())
    };
    for fault in [Fault::FrozenFeedback, Fault::StuckEncoder] {
        let told = run(fault, 900);
        let frozen: Vec<_> =
            told.iter().filter(|(condition, _)| *condition == Condition::Frozen).collect();
        assert_eq!(frozen, [&(Condition::Frozen, true), &(Condition::Frozen, false)], "{told:?}");
    }
    // A shaft that truly stands, pushed to and fro with all that there is.
    let told = run(Fault::BlockedShaft, 1_400);
    assert_eq!(began(&told, Condition::Frozen), 0, "{told:?}");
    // Pushed with a constant current, and at rest without any, for a minute.
    for amperes in [0.0, 20.0] {
        let world = Simulation::new(1);
        let mut rig = Rig::new(&world, Line::Can1, 1);
        world.fault(Fault::BlockedShaft(rig.keys[0]), ..).unwrap();
        let wheel = rig.wheels[0];
        rig.run(20_000, |bus, _| _ = bus.set_current(wheel, Current::from_amperes(amperes)));
        assert_eq!(began(&edges(rig.runner.device_mut()), Condition::Frozen), 0);
    }
    // A gimbal in voltage mode that is held.
    let world = Simulation::new(1);
    let key = world.attach(MotorConfig::gm6020_voltage(1)).unwrap();
    world.fault(Fault::BlockedShaft(key), ..).unwrap();
    let mut bus = Bus::new();
    let yaw = bus.attach(Config::<Gm6020Voltage>::new(1)).unwrap();
    let mut can = world.controller();
    for ms in 1..5_000 {
        world.advance(drivetrain::time::Duration::from_millis(1));
        while let Ok(frame) = embedded_can::nb::Can::receive(&mut can) {
            _ = bus.ingest(&frame, world.now());
        }
        _ = bus.is_armed() || bus.arm(world.now()).is_ok();
        _ = bus.set_raw(yaw, if ms / 300 % 2 == 0 { 5_000 } else { -5_000 });
        bus.update(drivetrain::time::Tick::new(world.now(), 0.001));
        while let Some(frame) = bus.next_frame() {
            _ = embedded_can::nb::Can::transmit(&mut can, &frame);
        }
    }
    assert_eq!(edges(&mut bus), []);
    saw("frozen feedback and a stuck encoder: one edge, and its end; a blocked shaft: none");
}

#[cfg_attr(test, test)]
fn f24_late_and_offline_are_edges_each_once() {
    for (silent, expected) in [
        (15, vec![(Condition::Late, true), (Condition::Late, false)]),
        (
            60,
            vec![
                (Condition::Late, true),
                (Condition::PositionUncertain, true), // nobody saw it stand
                (Condition::Late, false),
            ],
        ),
        (
            150,
            vec![
                (Condition::Late, true),
                (Condition::Offline, true),
                (Condition::PositionUncertain, true),
                (Condition::Late, false),
                (Condition::Offline, false),
            ],
        ),
    ] {
        let world = Simulation::new(2);
        let mut rig = Rig::new(&world, Line::Can1, 4);
        world.fault(Fault::Silent(rig.keys[2]), at_ms(500)..at_ms(500 + silent)).unwrap();
        rig.run(900, |_, _| {});
        let bus = rig.runner.device_mut();
        let told: Vec<_> = std::iter::from_fn(|| bus.next_edge()).collect();
        assert!(told.iter().all(|edge| edge.source.id() == 3), "the others: {told:?}");
        let told: Vec<_> = told.iter().map(|edge| (edge.condition, edge.began)).collect();
        assert_eq!(told, expected);
    }
    saw("late: began, ended; offline: the same around it; no edge of the others");
}

#[cfg_attr(test, test)]
fn f42_a_soft_limit_lets_only_inward_output_through() {
    static LIMITS: HealthConfig =
        HealthConfig::new().with_soft_limits(Angle::from_degrees(-90.0), Angle::from_degrees(90.0));
    const POSITION: PidConfig = PidConfig::new(8.0, 0.0, 0.0);
    for (reversed, direction) in [(false, 1.0), (false, -1.0), (true, 1.0), (true, -1.0)] {
        let world = Simulation::new(1);
        let mut rig = Rig::with(&world, Line::Can1, 1, |config| {
            let config = config.with_health(&LIMITS).position_loop(POSITION, crate::rig::SPEED);
            if reversed { config.reversed() } else { config }
        });
        rig.run(30, |_, _| {});
        let wheel = rig.wheels[0];
        let bus = rig.runner.device_mut();
        bus.zero(wheel).unwrap();
        assert_eq!(edges(bus), []);
        let outward = Current::from_amperes(2.0 * direction);
        let begin = rig.sent.len();
        rig.run(400, |bus, _| _ = bus.set_current(wheel, outward));
        assert_eq!(edges(rig.runner.device_mut()), [(Condition::SoftLimit, true)]);
        assert!(rig.sent[begin..].iter().any(|sent| sent.words[0] != 0));
        assert!(rig.words(0, 400, 430).iter().all(|word| *word == 0), "outward");
        // Outside now, coasting: outward is nothing, also for one that is armed here; inward is.
        let sign = if reversed { -direction } else { direction };
        let here = rig.runner.device().state(wheel).unwrap().position.as_angle().as_degrees();
        assert!(here * direction > 80.0, "{here}");
        rig.runner.device_mut().disarm();
        let now = world.now();
        rig.runner.device_mut().arm(now).unwrap();
        rig.run(20, |bus, _| _ = bus.set_current(wheel, outward));
        assert_eq!(rig.sent.last().unwrap().words[0], 0);
        rig.run(5, |bus, _| _ = bus.set_current(wheel, outward * -1.0));
        let word = f32::from(rig.sent.last().unwrap().words[0]);
        assert!(word * sign < 0.0, "inward: {word}");
        // A position outside is taken to the limit.
        rig.run(1_500, |bus, _| {
            let far =
                drivetrain::encoder::Position::from_turns(if direction > 0.0 { 3 } else { -3 });
            _ = bus.set_position(wheel, far);
        });
        let here = rig.runner.device().state(wheel).unwrap().position.as_angle().as_degrees();
        assert!((here - 90.0 * direction).abs() < 3.0, "{here}");
    }
    saw("outward 0, inward driven, in both directions; a target outside goes to the limit");
}
