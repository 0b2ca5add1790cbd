//! The order of requests and writes.

use super::*;

#[test]
fn a_controller_that_starts_disables_every_joint_first() {
    let mut bench = Bench::new(&ALL);
    let sent = bench.run(1);
    assert_eq!(sent[..12], ALL.map(|id| (id, Command::DISABLE)));
    assert!(sent[12..].iter().all(|(_, command)| matches!(command, Command::Read(_))));
}

#[test]
fn each_joint_of_twelve_is_asked_each_12_ms_for_two_positions_and_a_speed() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    let sent = bench.drive(12 * 24);
    let asked = |id, wanted| {
        let asks = |(to, command): &&(u8, Command)| *to == id && *command == Command::Read(wanted);
        sent.iter().filter(asks).count()
    };
    for id in ALL {
        let counts = [Register::ActualPosition, Register::ActualSpeed, Register::Enable];
        assert_eq!(counts.map(|register| asked(id, register)), [16, 7, 1], "{id}");
    }
    // One question and one write in each millisecond, no more and no less: what `load` reckons.
    assert_eq!(sent.len(), 2 * 12 * 24);
    assert_eq!(bench.joints.load().frames_per_s(), 3_000);
    assert!((bench.joints.load().worst_case() - 0.305).abs() < 1e-6);
}

#[test]
fn a_joint_is_brought_up_in_order_with_its_enable_last() {
    let mut bench = Bench::armed(&[4]);
    let sent = bench.drive(9);
    use Register::{Acceleration, Current, Deceleration, Enable, Mode, Speed};
    let expected = [
        (Mode, 1),
        (Current, 2_000),
        (Acceleration, 0x0010_AAAA),
        (Deceleration, 0x0010_AAAA),
        (Speed, 10_923),
        (Register::Position, 1_000),
        (Enable, 1),
        (Register::Position, 1_000),
        (Register::Position, 1_000),
    ];
    assert_eq!(writes(&sent), expected.map(|(register, value)| Command::Write(register, value)));
}

#[test]
fn news_go_before_repetitions_and_only_what_changed_is_written() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    let (first, last) = (bench.handles[0], bench.handles[11]);
    bench.joints.set_speed(last, AngularVelocity::from_rpm(-20.0)).unwrap();
    bench.joints.set_pulses(first, -5).unwrap();
    let sent = bench.run(3);
    let mut news = sent.iter().filter(|(_, command)| matches!(command, Command::Write(..)));
    let two = [*news.next().unwrap(), *news.next().unwrap()];
    assert!(two.contains(&(12, Command::Write(Register::Speed, 21_845))));
    assert!(two.contains(&(1, Command::Write(Register::Position, -5))));
    assert!(matches!(news.next(), Some((_, Command::Write(Register::Position, 1_000)))));
}

#[test]
fn a_joint_that_gets_a_new_target_at_once_is_disabled_before_it_is_brought_up() {
    let mut bench = Bench::armed(&[2]);
    bench.drive(20);
    bench.joints.relax(bench.handles[0]);
    bench.joints.set_pulses(bench.handles[0], 5).unwrap();
    let sent = writes(&bench.run(9));
    assert_eq!(sent[..2], [Command::DISABLE, Command::Write(Register::Mode, 1)]);
    assert_eq!(sent[7], Command::Write(Register::Enable, 1));
    // The same when the driver gives the disable back.
    bench.joints.relax(bench.handles[0]);
    bench.joints.set_pulses(bench.handles[0], 6).unwrap();
    let refused = bench.joints.next_frame().unwrap();
    assert!(bench.joints.requeue(&refused));
    let sent = writes(&bench.run(9));
    assert_eq!(sent[..2], [Command::DISABLE, Command::Write(Register::Mode, 1)]);
    // And when what brings it up waits behind the disable that is given back.
    bench.joints.relax(bench.handles[0]);
    bench.joints.set_pulses(bench.handles[0], 7).unwrap();
    bench.ms += 1;
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    let refused = bench.joints.next_frame().unwrap();
    assert!(bench.joints.requeue(&refused));
    assert_eq!(writes(&bench.take()), []);
    let sent = writes(&bench.run(9));
    assert_eq!(sent[..2], [Command::DISABLE, Command::Write(Register::Mode, 1)]);
}

#[test]
fn a_relaxed_joint_is_told_again_each_100_ms() {
    let mut bench = Bench::new(&[7]);
    bench.run(1);
    let sent = bench.run(1_000);
    assert_eq!(writes(&sent), [Command::DISABLE; 10]);
}

#[test]
fn a_driver_that_takes_one_frame_a_tick_starves_no_joint() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    let mut asked = [0; 12];
    let mut written = [0; 12];
    for _ in 0..2_400 {
        bench.ms += 1;
        for joint in bench.handles.clone() {
            _ = bench.joints.set_pulses(joint, 1_000);
        }
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
        let sent = bench.joints.next_frame().unwrap();
        if let Some(refused) = bench.joints.next_frame() {
            assert!(bench.joints.requeue(&refused));
        }
        let id = u8::try_from(sent.header()).unwrap();
        let command = Command::decode(sent.data()).unwrap();
        let counts = if command.is_safe() { &mut asked } else { &mut written };
        counts[usize::from(id - 1)] += 1;
        bench.answer(id, command);
    }
    assert!(written.iter().all(|count| *count > 20), "{written:?}");
    assert!(asked.iter().all(|count| *count > 20), "{asked:?}");
}

/// Hostile readers had no question sent, joint 12 written nothing, and joints asked for anything but their position, where
/// an update has more frames than the driver has room for.
#[test]
fn a_driver_with_less_room_than_an_update_has_frames_starves_no_joint() {
    // Some of them ask seldom.
    let (late, offline) = (Duration::from_millis(400), Duration::from_millis(500));
    let patient = Timeouts::new().with_feedback(late, offline).unwrap();
    let budgets = (1..=5).flat_map(|reads| (1..=5).map(move |writes| (reads, writes)));
    let drivers = || (1..=3).flat_map(|room| [(room, false), (room, true)]);
    for ((reads, writes), (room, all_come_back)) in
        budgets.flat_map(|budget| drivers().map(move |driver| (budget, driver)))
    {
        let joints = Joints::new().with_timeouts(patient).with_frames_per_update(reads, writes);
        let mut bench = Bench::of(joints, ALL.map(Config::new)).armed_after(60);
        let (mut asked, mut written) = ([0; 12], [0; 12]);
        for _ in 0..1_200 {
            bench.ms += 1;
            for joint in bench.handles.clone() {
                _ = bench.joints.set_pulses(joint, 1_000);
            }
            bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
            for (id, command) in bench.take_some(room, all_come_back) {
                let is_read = matches!(command, Command::Read(_));
                let counts = if is_read { &mut asked } else { &mut written };
                counts[usize::from(id - 1)] += 1;
            }
        }
        let which = (reads, writes, room, all_come_back);
        let all = asked.iter().chain(&written);
        assert!(all.clone().all(|count| *count >= 20), "{which:?}: {asked:?} {written:?}");
        assert_eq!((bench.enabled, bench.joints.is_armed()), ([1; 12], true), "{which:?}");
    }
}

/// A hostile reader had nine joints hold on for ever: a program that disarms in each tick had the first three disabled again
/// and again. And 12 000 frames a second, where the driver has room.
#[test]
fn a_program_that_disarms_in_each_tick_disables_all_and_floods_nobody() {
    for (room, step_ms) in [(3, 1), (100, 1), (1, 10)] {
        let mut bench = Bench::armed(&ALL);
        bench.drive(200);
        assert_eq!(bench.enabled, [1; 12]);
        let (mut disables, mut questions) = (0, 0);
        for _ in 0..1_000 {
            bench.ms += step_ms;
            bench.joints.disarm();
            bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
            for (_, command) in bench.take_some(room, false) {
                disables += usize::from(command == Command::DISABLE);
                questions += usize::from(matches!(command, Command::Read(_)));
            }
        }
        assert_eq!(bench.enabled, [0; 12], "{room}");
        // Where a tick has room for a tenth of what is to be said, all of it goes to what is safe.
        assert!(step_ms > 1 || disables <= 12 + 120 && questions >= 900, "{disables}, {questions}");
    }
}

/// I6, through refusals, stops in the middle of a tick and detaching.
#[test]
fn frames_that_were_ready_are_sent_superseded_or_wait() {
    let mut bench = Bench::armed(&ALL);
    let before = bench.joints.counters();
    let (mut taken, mut given_back) = (0_u32, 0_u32);
    for round in 0..600_u32 {
        bench.ms += 1;
        for joint in bench.handles.clone() {
            _ = bench.joints.set_pulses(joint, 1_000);
        }
        bench.joints.update(Tick::new(at_ms(bench.ms), if round % 7 == 3 { 0.0 } else { 0.001 }));
        match round % 50 {
            20 => bench.joints.relax(bench.handles[3]),
            30 => bench.joints.emergency_stop(),
            40 => {
                bench.joints.clear_emergency_stop();
                _ = bench.joints.arm(at_ms(bench.ms));
            }
            45 => {
                bench.joints.detach(bench.handles[7]);
                bench.handles[7] = bench.joints.attach(Config::new(8)).unwrap();
            }
            _ => {}
        }
        for place in 0..round % 6 {
            let Some(frame) = bench.joints.next_frame() else { break };
            taken += 1;
            if (round + place) % 5 == 0 {
                given_back += u32::from(bench.joints.requeue(&frame));
            } else {
                let id = u8::try_from(frame.header()).unwrap();
                bench.answer(id, Command::decode(frame.data()).unwrap());
            }
        }
        if round % 50 > 30 {
            bench.joints.disarm(); // with what was just given back
        }
    }
    bench.joints.update(Tick::new(at_ms(bench.ms + 1), 0.0)); // what came back is ready again
    let waiting = core::iter::from_fn(|| bench.joints.next_frame()).count();
    let waiting = u32::try_from(waiting).unwrap();
    let after = bench.joints.counters();
    let packed = after.packed - before.packed;
    let superseded = after.superseded - before.superseded;
    assert!(given_back > 50 && superseded > given_back);
    assert_eq!(packed, taken - given_back + superseded + waiting);
}

#[test]
fn an_update_has_at_least_one_frame_of_a_kind_and_at_most_twelve() {
    for (wanted, each) in [(0, 1), (1, 1), (11, 11), (12, 12), (13, 12), (255, 12)] {
        let joints = Joints::new().with_frames_per_update(wanted, wanted);
        assert_eq!(joints.load().frames_per_s(), 3_000 * each);
        let mut bench = Bench::of(joints, ALL.map(Config::new)).armed_after(200);
        bench.drive(10);
        assert_eq!(bench.drive(10).len(), 2 * each as usize * 10, "{wanted}");
    }
}

/// Has joints 3 and 5 written to and asked; returns the frames.
fn all_of_an_update(bench: &mut Bench) -> Vec<CanFrame> {
    bench.ms += 1;
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    core::iter::from_fn(|| bench.joints.next_frame()).collect()
}

/// Joints 3 and 5, both written to and asked in each update.
fn two_at_once() -> Bench {
    let joints = Joints::new().with_frames_per_update(2, 2);
    let mut bench = Bench::of(joints, [3, 5].map(Config::new)).armed_after(30);
    bench.drive(20);
    bench
}

#[test]
fn a_write_that_comes_back_before_its_joint_is_relaxed_is_not_sent_again() {
    let mut bench = two_at_once();
    let frames = all_of_an_update(&mut bench);
    assert_eq!(frames.len(), 4);
    assert!(frames.iter().all(|frame| bench.joints.requeue(frame)));
    bench.joints.relax(bench.handles[0]);
    let sent = bench.run(1);
    let write = Command::Write(Register::Position, 1_000);
    assert_eq!(writes(&sent), [Command::DISABLE, write]);
    assert!(sent.contains(&(3, Command::DISABLE)) && sent.contains(&(5, write)));
    assert!(bench.run(20).iter().all(|(id, command)| *id == 5 || command.is_safe()));
}

#[test]
fn a_detached_joint_is_disabled_once_and_not_asked_whatever_waits_or_comes_back() {
    let detached = |end: fn(&mut Bench)| {
        let mut bench = two_at_once();
        end(&mut bench);
        let sent = bench.run(10);
        let of_first: Vec<_> = sent.iter().filter(|(id, _)| *id == 3).map(|sent| sent.1).collect();
        let asked = sent.iter().filter(|(id, command)| *id == 5 && command.is_safe()).count();
        (of_first, asked)
    };
    let once = (std::vec![Command::DISABLE], 10);
    // Its frames wait.
    let waits = detached(|bench| {
        bench.ms += 1;
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
        bench.joints.detach(bench.handles[0]);
    });
    assert_eq!(waits, once);
    // They came back.
    let returned = detached(|bench| {
        let frames = all_of_an_update(bench);
        assert!(frames.iter().all(|frame| bench.joints.requeue(frame)));
        bench.joints.detach(bench.handles[0]);
    });
    assert_eq!(returned, once);
    // They come back afterwards.
    let returns = detached(|bench| {
        let frames = all_of_an_update(bench);
        bench.joints.detach(bench.handles[0]);
        assert!(frames.iter().all(|frame| bench.joints.requeue(frame)));
    });
    assert_eq!(returns, once);
}

/// A drive may have missed its last target. Without a turn of its own, the joint would stand until the other joint stops.
#[test]
fn a_target_that_does_not_change_is_repeated_beside_one_that_changes_in_each_update() {
    for (writes, room) in [(1, usize::MAX), (2, 1)] {
        let joints = Joints::new().with_frames_per_update(1, writes);
        let mut bench = Bench::of(joints, [1, 2, 3, 4].map(Config::new)).armed_after(30);
        bench.drive(60);
        let mut written = [0; 4];
        for tick in 0..400 {
            bench.ms += 1;
            for (joint, pulses) in
                bench.handles.clone().into_iter().zip([tick, 1_000, 1_000, 1_000])
            {
                bench.joints.set_pulses(joint, pulses).unwrap();
            }
            bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
            for (id, command) in bench.take_some(room, false) {
                let is_target = matches!(command, Command::Write(Register::Position, _));
                written[usize::from(id - 1)] += u32::from(is_target);
            }
        }
        let [moving, holding @ ..] = written;
        assert!(moving > 90 && holding.iter().all(|count| *count >= 3), "{writes}: {written:?}");
    }
}

/// An enable that waits for a newer target is refused for ever by a driver whose room has the same rhythm.
#[test]
fn a_driver_with_room_for_one_frame_a_tick_enables_all_joints() {
    for (ids, most) in [(&[4][..], 100), (&[4, 5], 100), (&[1, 2, 3, 4, 5, 6], 300)] {
        let mut bench = Bench::armed(ids);
        for tick in 0..most {
            bench.ms += 1;
            for joint in bench.handles.clone() {
                _ = bench.joints.set_pulses(joint, tick);
            }
            bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
            bench.take_some(1, false);
        }
        let enabled: i32 = bench.enabled.iter().sum();
        assert_eq!(usize::try_from(enabled).unwrap(), ids.len(), "{ids:?}");
    }
}
