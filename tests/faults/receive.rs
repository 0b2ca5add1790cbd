//! F01 to F12, F92: what is received.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{Rig, armed, at_ms, feedback, rpm, step, ticks_since};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Ingest, Link};
use drivetrain::runner::{BusCondition, FrameQueue, Nb, Runner};
use drivetrain::sim::{Fault, Line, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use embedded_can::{ErrorKind, ExtendedId, Frame, StandardId};
use std::cell::Cell;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f01_a_wrong_length_is_counted_and_keeps_nothing_fresh,
    f02_a_remote_frame_is_handed_back,
    f03_an_extended_frame_of_the_same_number_is_handed_back,
    f04_every_unknown_id_is_handed_back_untouched_and_counted_apart,
    f06_an_angle_above_8191_refuses_the_whole_frame,
    f07_feedback_of_an_unattached_motor_has_its_own_counter,
    f09_duplicated_frames_change_nothing,
    f10_reordered_frames_are_one_sample_off_and_converge,
    f11_64_frames_after_a_stall_are_all_taken_and_the_last_one_wins,
    f12_a_full_queue_and_an_overrun_are_counted_and_freshness_does_the_rest,
    f92_frames_that_waited_in_a_pause_drive_nothing,
    f92_a_pause_of_more_than_100_ms_relaxes_whatever_waits,
];

#[cfg_attr(test, test)]
fn f01_a_wrong_length_is_counted_and_keeps_nothing_fresh() {
    for length in 0..8 {
        let world = Simulation::new(1);
        let mut rig = Rig::new(&world, Line::Can1, 2);
        world
            .fault(Fault::WrongLength { motor: rig.keys[0], length }, at_ms(600)..at_ms(650))
            .unwrap();
        rig.drive(700);
        assert!(rig.first_zero(0, 600) < at_ms(613), "length {length}");
        assert!(rig.words(0, 613, 650).iter().all(|word| *word == 0));
        assert!(rig.words(1, 613, 650).iter().all(|word| *word > 0), "the other goes on");
        let counted = rig.runner.device().counters().bad_length;
        assert!((49..=51).contains(&counted), "{counted}");
        assert_eq!(rig.runner.statistics().malformed, counted);
        assert!(rig.words(0, 680, 700).iter().all(|word| *word != 0), "clears itself");
        safe_after(ticks_since(600, rig.first_zero(0, 600)));
        if length == 7 {
            saw(format!("{counted} refused, the other motor went on, clears itself"));
        }
    }
}

#[cfg_attr(test, test)]
fn f02_a_remote_frame_is_handed_back() {
    let world = Simulation::new(1);
    let mut rig = Rig::new(&world, Line::Can1, 1);
    let remote = CanFrame::new_remote(StandardId::new(0x201).unwrap(), 8).unwrap();
    rig.drive(100);
    let before = rig.runner.device().state(rig.wheels[0]).unwrap();
    assert_eq!(rig.runner.ingest(&remote, at_ms(100)), Ingest::Unrelated);
    assert_eq!(rig.runner.device().state(rig.wheels[0]), Some(before));
    world.inject(Line::Can1, remote).unwrap();
    rig.drive(2);
    assert_eq!(rig.unrelated, [remote]);
    saw(format!("handed back: {:?}", rig.unrelated[0]));
}

#[cfg_attr(test, test)]
fn f03_an_extended_frame_of_the_same_number_is_handed_back() {
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    let before = bus.state(wheel);
    for raw in [0x201, 0x201 << 18, 0x1000_0201] {
        let frame = CanFrame::new(ExtendedId::new(raw).unwrap(), &[0x10; 8]).unwrap();
        assert_eq!(bus.ingest(&frame, at_ms(2)), Ingest::Unrelated);
    }
    assert_eq!((bus.state(wheel), bus.counters().bad_length), (before, 0));
    saw("3 handed back, nothing changed");
}

#[cfg_attr(test, test)]
fn f04_every_unknown_id_is_handed_back_untouched_and_counted_apart() {
    let world = Simulation::new(1);
    let mut rig = Rig::new(&world, Line::Can1, 1);
    rig.drive(50);
    let foreign = |id| CanFrame::standard(id, [0x5A; 8]).unwrap();
    for id in (0..0x201).chain(0x20C..0x800) {
        assert_eq!(rig.runner.ingest(&foreign(id), at_ms(50)), Ingest::Unrelated);
    }
    let counters = rig.runner.device().counters();
    assert_eq!((counters.bad_length, counters.bad_field, counters.unattached), (0, 0, 0));
    assert_eq!(rig.runner.statistics().unrelated, 0x800 - 11);
    world.inject(Line::Can1, foreign(0x321)).unwrap();
    rig.drive(2);
    assert_eq!(rig.unrelated, [foreign(0x321)]);
    saw(format!("{} handed back, counted apart", rig.runner.statistics().unrelated));
}

#[cfg_attr(test, test)]
fn f06_an_angle_above_8191_refuses_the_whole_frame() {
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    let before = bus.state(wheel).unwrap();
    for angle in [8192, 9_000, u16::MAX] {
        let outcome = bus.ingest(&feedback(0x201, angle, 5_000), at_ms(2));
        assert_eq!(outcome, Ingest::WrongField);
    }
    assert_eq!(bus.state(wheel), Some(before), "no half update");
    assert_eq!(bus.counters().bad_field, 3);

    let world = Simulation::new(1);
    let mut rig = Rig::new(&world, Line::Can1, 2);
    let wrong = Fault::WrongAngle { motor: rig.keys[0], raw: 8192 };
    world.fault(wrong, at_ms(200)..at_ms(400)).unwrap();
    rig.drive(350);
    assert!(rig.first_zero(0, 200) < at_ms(213), "such frames are no sign of life");
    assert_eq!(rig.link(0), Link::Offline);
    safe_after(ticks_since(200, rig.first_zero(0, 200)));
    saw(format!("{} refused whole, {:?}", rig.runner.device().counters().bad_field, rig.link(0)));
}

#[cfg_attr(test, test)]
fn f07_feedback_of_an_unattached_motor_has_its_own_counter() {
    let mut bus = Bus::new();
    bus.attach(Config::<M3508>::new(1)).unwrap();
    for id in 0x202..=0x20B {
        assert_eq!(bus.ingest(&feedback(id, 0, 0), at_ms(1)), Ingest::Unrelated);
    }
    assert_eq!(bus.counters().unattached, 10);
    saw("10 handed back, 10 counted");
}

#[cfg_attr(test, test)]
fn f09_duplicated_frames_change_nothing() {
    let run = |duplicated| {
        let world = Simulation::new(4);
        let mut rig = Rig::new(&world, Line::Can1, 1);
        if duplicated {
            let all = Fault::DuplicateFrames { line: Line::Can1, id: None };
            world.fault(all, ..).unwrap();
        }
        rig.drive(1_000);
        let state = rig.runner.device().state(rig.wheels[0]).unwrap();
        (state.rotor_counts, world.motor(rig.keys[0]).unwrap().encoder_counts, state.ambiguous_gaps)
    };
    assert_eq!(run(true), run(false));

    let (mut bus, [wheel]) = armed([Config::new(1)]);
    bus.set_raw(wheel, 500).unwrap();
    for _ in 0..100 {
        _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(1)); // all stamped with the first arrival
    }
    assert!(step(&mut bus, 11).is_some_and(|words| words[0] == 500));
    assert_eq!(step(&mut bus, 12), Some([0; 4]), "not fresher than the real arrival");
    saw("the same counts with every frame twice; 100 copies: late all the same");
}

#[cfg_attr(test, test)]
fn f10_reordered_frames_are_one_sample_off_and_converge() {
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    let angle = |sample: u64| u16::try_from(sample * 1_000 % 8_192).unwrap();
    for pair in (1..2_000_u64).step_by(2) {
        let late_first = [pair + 1, pair];
        for (arrival, sample) in (pair..).zip(late_first) {
            _ = bus.ingest(&feedback(0x201, angle(sample), 7_324), at_ms(1 + arrival));
            let counts = bus.state(wheel).unwrap().rotor_counts;
            assert_eq!(counts, sample.cast_signed() * 1_000, "the sample that came last");
        }
    }
    _ = bus.ingest(&feedback(0x201, angle(2_001), 7_324), at_ms(2_003));
    assert_eq!(bus.state(wheel).unwrap().rotor_counts, 2_001_000);
    saw("one sample off, exact with the next");
}

#[cfg_attr(test, test)]
fn f11_64_frames_after_a_stall_are_all_taken_and_the_last_one_wins() {
    let speed = PidConfig::new(0.6, 6.0, 0.001);
    let config = Config::new(1).speed_loop(speed);
    let (mut bus, [wheel]) = armed([config]);
    let mut counts = 0_u64;
    let mut hear = |bus: &mut Bus, ms| {
        counts += 500;
        let frame = feedback(0x201, u16::try_from(counts % 8_192).unwrap(), 3_662);
        assert_eq!(bus.ingest(&frame, at_ms(ms)), Ingest::Taken);
        counts
    };
    let mut last = 0;
    for ms in 2..300 {
        hear(&mut bus, ms);
        bus.set_velocity(wheel, rpm(195.0)).unwrap();
        last = step(&mut bus, ms).unwrap()[0];
    }
    // The loop stood for 64 ms; then all of it arrives at once.
    let mut total = 0;
    for _ in 0..64 {
        total = hear(&mut bus, 364);
    }
    bus.set_velocity(wheel, rpm(195.0)).unwrap();
    bus.update(drivetrain::time::Tick::new(at_ms(364), 0.064));
    let raw = crate::rig::words(&bus.next_frame().unwrap())[0];
    assert!((raw - last).abs() < 50, "no spike: {last} to {raw}");
    let state = bus.state(wheel).unwrap();
    assert_eq!(state.rotor_counts, total.cast_signed());
    assert!(state.ambiguous_gaps <= 1, "64 ms between two stamps may be flagged");
    saw(format!("all taken, output {last} to {raw}, {} flagged", state.ambiguous_gaps));
}

#[cfg_attr(test, test)]
fn f12_a_full_queue_and_an_overrun_are_counted_and_freshness_does_the_rest() {
    let mut queue = FrameQueue::<8>::new();
    let (mut interrupt, mut task) = queue.split();
    for ms in 0..20 {
        interrupt.push(&feedback(0x201, ms, 0), at_ms(ms.into()));
    }
    assert_eq!(task.dropped(), 13);
    assert_eq!(core::iter::from_fn(|| task.pop()).count(), 7);

    // By the runner: one edge, whatever the rate, and its end a second after the last.
    let mut queue = FrameQueue::<4>::new();
    let (mut interrupt, mut task) = queue.split();
    let clock = Cell::new(at_ms(1));
    let world = Simulation::new(1);
    let (bus, _) = armed([Config::new(1)]);
    let mut runner = Runner::new(Nb(world.controller()), &clock, bus);
    for ms in 2..3_000 {
        clock.set(at_ms(ms));
        world.advance(Duration::from_millis(1));
        for _ in 0..if ms < 1_000 { 5 } else { 1 } {
            interrupt.push(&feedback(0x201, 0, 0), at_ms(ms));
        }
        assert!((1..=3).contains(&runner.poll_queue(&mut task, 16)));
        runner.tick(Tick::new(at_ms(ms), 0.001));
    }
    assert_eq!(runner.statistics().lost, 998 * 2);
    let edges: Vec<String> = runner.edges().map(|edge| edge.to_string()).collect();
    assert_eq!(edges, ["receive overrun began at 2000 us", "receive overrun ended at 1999000 us"]);

    let world = Simulation::new(1).with_receive_depth(Line::Can1, 4);
    let mut rig = Rig::new(&world, Line::Can1, 4);
    rig.drive(100);
    world.advance(Duration::from_millis(20)); // the application hangs
    rig.drive(50);
    assert_eq!(rig.runner.statistics().receive_errors_of(ErrorKind::Overrun), 1);
    let overrun = rig.runner.edges().find(|edge| edge.condition == BusCondition::ReceiveOverrun);
    assert_eq!(
        overrun.map(|edge| (edge.at, edge.began)),
        Some((Instant::from_micros(120_100), true))
    );
    assert!((0..4).all(|wheel| rig.link(wheel) == Link::Online));
    assert!(rig.words(0, 140, 160).iter().all(|word| *word > 0));
    saw("13 dropped by the queue, 1 overrun of the controller, counted");
}

/// A step of 1 ms with a poll of 16 frames; tells whether the motors are late, and so at rest.
fn rests(rig: &mut Rig<'_>) -> bool {
    rig.runner.poll(16);
    let tick = rig.runner.due().unwrap();
    for wheel in &rig.wheels {
        _ = rig.runner.device_mut().set_velocity(*wheel, rpm(200.0));
    }
    rig.runner.tick(tick);
    rig.world.advance(Duration::from_millis(1));
    let is_late = rig.link(0) != Link::Online;
    let is_zero = |key: &MotorKey| rig.world.motor(*key).unwrap().command == 0;
    assert!(!is_late || rig.keys.iter().all(is_zero));
    is_late
}

#[cfg_attr(test, test)]
fn f92_frames_that_waited_in_a_pause_drive_nothing() {
    for pause_ms in [20, 40, 80] {
        let world = Simulation::new(12).with_receive_depth(Line::Can1, 64);
        let mut rig = Rig::new(&world, Line::Can1, 2);
        rig.drive(500);
        world.advance(Duration::from_millis(pause_ms));
        let late = (0..100).take_while(|_| rests(&mut rig)).count();
        assert!((2..=5).contains(&late), "{pause_ms} ms: {late} ticks");
        assert!(rig.runner.is_armed(), "{pause_ms} ms");
        rig.drive(500);
        let velocity = world.motor(rig.keys[0]).unwrap().velocity;
        assert!((velocity / rpm(200.0) - 1.0).abs() < 0.02, "{pause_ms} ms: {velocity:?}");
    }
    safe_after(1);
    saw("20 to 80 ms, 64 frames wait: rest in the first tick, until none waits");
}

#[cfg_attr(test, test)]
fn f92_a_pause_of_more_than_100_ms_relaxes_whatever_waits() {
    for (pause_ms, depth) in [(110, 3), (110, 64), (500, 3), (500, 64), (3_000, 64)] {
        let world = Simulation::new(13).with_receive_depth(Line::Can1, depth);
        let mut rig = Rig::new(&world, Line::Can1, 2);
        rig.drive(500);
        assert!(rig.runner.is_armed());
        world.advance(Duration::from_millis(pause_ms));
        for _ in 0..300 {
            rig.poll_and_tick(|_, _| {});
            world.advance(Duration::from_millis(1));
            let command = world.motor(rig.keys[0]).unwrap().command;
            let rests = !rig.runner.is_armed() && command == 0;
            assert!(rests, "{pause_ms} ms, {depth} frames");
        }
    }
    safe_after(1);
    saw("110 ms to 3 s: relaxed with the first tick, latched");
}
