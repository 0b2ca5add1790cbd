//! Events after which a joint must be disabled.

use super::*;

#[test]
fn while_an_answer_is_due_nothing_is_sent_to_that_joint_a_stop_neither() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(100);
    bench.silent = ALL.to_vec();
    let sent = bench.drive(1);
    let asked = sent.iter().find(|(_, command)| matches!(command, Command::Read(_))).unwrap().0;
    assert_eq!(
        bench.joints.awaited(bench.handles[usize::from(asked - 1)]),
        Some(Register::ActualPosition)
    );
    bench.joints.emergency_stop();
    let sent = bench.run(1);
    assert!(sent.iter().filter(|(_, command)| *command == Command::DISABLE).count() == 11);
    assert!(sent.iter().all(|(id, _)| *id != asked));
    // After 2 ms it gets its stop in any case.
    assert!(bench.run(2).contains(&(asked, Command::DISABLE)));
    assert!(bench.joints.counters().unanswered >= 1);
}

#[test]
fn a_silent_joint_is_late_after_40_ms_and_offline_after_100_and_the_others_go_on() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.joints.zero(bench.handles[4]).unwrap();
    bench.drive(20);
    bench.silent = std::vec![5];
    let heard = bench.ms;
    let mut late = None;
    for _ in 0..140 {
        let sent = bench.drive(1);
        if sent.contains(&(5, Command::DISABLE)) {
            late.get_or_insert(bench.ms - heard);
        }
        assert!(writes(&sent).iter().any(|command| !command.is_safe()), "the others go on");
    }
    assert!(late.unwrap() <= 43, "{late:?}");
    let state = bench.state(4);
    assert_eq!((state.link, state.homing), (Link::Offline, Homing::Uncertain));
    assert!(state.unanswered > 5 && !bench.joints.is_armed());
    assert!(bench.joints.is_joint_armed(bench.handles[3]));
    let missing = bench.joints.arm(at_ms(bench.ms)).unwrap_err();
    assert_eq!(missing.to_string(), "no feedback from snake joint #5");
    // Ten positions in a row bring it back, but it moves only when it is armed again.
    bench.silent.clear();
    let sent = bench.drive(250);
    assert!(!sent.iter().any(|(id, command)| *id == 5 && !command.is_safe()));
    assert_eq!(bench.state(4).link, Link::Online);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    assert!(!bench.drive(100).iter().any(|(id, command)| *id == 5 && !command.is_safe()));
    bench.joints.zero(bench.handles[4]).unwrap();
    assert!(bench.drive(100).iter().any(|(id, command)| *id == 5 && !command.is_safe()));
}

/// Two turns from its zero a joint loses its supply for a second, and its drive counts from 0 again: an old target leads two turns further.
#[test]
fn a_joint_whose_zero_was_lost_takes_no_target_until_its_zero_is_set() {
    for silent_ms in [101, 1_000] {
        let mut bench = Bench::new(&[1, 2]);
        bench.raw[0] = 2 * PULSES_PER_TURN;
        bench.run(30);
        let [lost, other] = [bench.handles[0], bench.handles[1]];
        bench.joints.set_offset(lost, 0).unwrap();
        bench.joints.arm(at_ms(bench.ms)).unwrap();
        let position = Position::new(2, Angle::ZERO);
        for _ in 0..300 {
            bench.joints.set_position(lost, position).unwrap();
            bench.run(1);
        }
        bench.silent = std::vec![1];
        bench.run(silent_ms);
        (bench.raw[0], bench.enabled[0]) = (0, 0);
        bench.silent.clear();
        bench.run(300);
        bench.joints.arm(at_ms(bench.ms)).unwrap();
        for _ in 0..100 {
            assert_eq!(bench.joints.set_position(lost, position), Err(TargetError::NotHomed));
            assert_eq!(bench.joints.set_pulses(lost, 0), Err(TargetError::NotHomed));
            bench.joints.set_pulses(other, 0).unwrap();
            bench.run(1);
        }
        assert!(bench.joints.is_armed() && bench.enabled[..2] == [0, 1], "{silent_ms}");
        bench.joints.set_offset(lost, -2 * PULSES_PER_TURN).unwrap();
        for _ in 0..100 {
            bench.joints.set_position(lost, position).unwrap();
            bench.run(1);
        }
        assert_eq!((bench.enabled[0], bench.state(0).homing), (1, Homing::Homed));
    }
}

/// A joint that was never given a zero counts as its drive.
#[test]
fn a_joint_without_a_zero_has_none_to_lose() {
    let mut bench = Bench::armed(&[1]);
    bench.run_silent(1, 1_000);
    bench.run(300);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    bench.drive(100);
    assert_eq!((bench.enabled[0], bench.state(0).homing), (1, Homing::Relative));
}

#[test]
fn a_drive_that_lost_its_enable_is_noticed_and_waits_to_be_armed() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.enabled[8] = 0; // its supply was away for a moment
    bench.drive(300);
    let state = bench.state(8);
    assert_eq!((state.resets, state.is_driven, bench.enabled[8]), (1, false, 0));
    assert!(!bench.joints.is_armed() && bench.state(7).is_driven);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    bench.drive(100);
    assert_eq!(bench.enabled, [1; 12]);
}

#[test]
fn a_position_further_off_than_a_joint_can_go_disarms_it() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(100);
    bench.raw[2] = 5_000; // 28 degrees
    bench.drive(30);
    assert_eq!(bench.state(2).position_jumps, 0);
    bench.raw[2] = -60_000;
    bench.drive(30);
    let state = bench.state(2);
    assert_eq!((state.position_jumps, state.is_driven, state.pulses), (1, false, -60_000));
    assert_eq!(bench.joints.set_pulses(bench.handles[2], 0), Err(TargetError::Relaxed));
    bench.drive(100);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
}

/// The name of an event between two updates after which a joint is no longer driven, and the event.
type End = (&'static str, fn(&mut Bench));

const ENDS: [End; 7] = [
    ("a jump", |bench| {
        bench.raw[0] = -60_000;
        bench.hear(Register::ActualPosition, -60_000);
    }),
    ("a reset", |bench| bench.hear(Register::Enable, 0)),
    ("a target of NaN", |bench| {
        let nan = Position::from_angle(Angle::from_radians(f32::NAN));
        _ = bench.joints.set_position(bench.handles[0], nan);
    }),
    ("a speed of NaN", |bench| {
        let nan = AngularVelocity::from_rpm(f32::NAN);
        _ = bench.joints.set_speed(bench.handles[0], nan);
    }),
    ("relaxed", |bench| bench.joints.relax(bench.handles[0])),
    ("disarmed", |bench| bench.joints.disarm()),
    ("stopped", |bench| {
        bench.joints.emergency_stop();
        bench.joints.clear_emergency_stop();
    }),
];

/// A joint that is driven, in the middle of a tick: its frames wait, a new speed among them.
fn in_the_middle_of_a_tick() -> Bench {
    let mut bench = Bench::armed(&[1]);
    bench.drive(100);
    bench.ms += 1;
    bench.joints.set_speed(bench.handles[0], AngularVelocity::from_rpm(20.0)).unwrap();
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    bench
}

/// The fuzzer found that the write which was due went out all the same.
#[test]
fn a_joint_that_may_not_move_any_more_is_disabled_with_the_next_frame_and_then_left_alone() {
    for (what, end) in ENDS {
        let mut bench = in_the_middle_of_a_tick();
        end(&mut bench);
        assert!(!bench.state(0).is_driven, "{what}");
        let sent = bench.take();
        assert_eq!((sent[0], writes(&sent).len()), ((1, Command::DISABLE), 1), "{what}");
        assert_eq!(writes(&bench.run(5)), [], "{what}");
    }
}

#[test]
fn a_joint_that_is_armed_and_led_again_before_the_next_update_is_disabled_all_the_same() {
    for (what, end) in ENDS {
        let mut bench = in_the_middle_of_a_tick();
        end(&mut bench);
        let armed = bench.joints.arm(at_ms(bench.ms));
        let led = bench.joints.set_pulses(bench.handles[0], 3_000);
        assert_eq!(writes(&bench.take()), [Command::DISABLE], "{what}");
        if armed == Err(ArmError::NotReleased) {
            let by_drive = ["a jump", "a reset"].contains(&what);
            let why = if by_drive { TargetError::Relaxed } else { TargetError::Disarmed };
            assert_eq!((led, writes(&bench.run(50))), (Err(why), Vec::new()), "{what}");
            continue;
        }
        assert_eq!((armed, led), (Ok(()), Ok(())), "{what}");
        let sent = writes(&bench.drive(7));
        assert_eq!(sent[0], Command::Write(Register::Mode, 1), "{what}");
        assert_eq!(sent[6], Command::Write(Register::Enable, 1), "{what}");
    }
}

#[test]
fn an_emergency_stop_in_the_middle_of_a_tick_disables_all_with_the_next_frames() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.ms += 1;
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    bench.joints.emergency_stop();
    let sent: Vec<_> = core::iter::from_fn(|| bench.joints.next_frame()).collect();
    let stops = sent.iter().filter(|frame| Command::decode(frame.data()) == Some(Command::DISABLE));
    assert_eq!((stops.count(), sent.len()), (12, 13)); // and one question
    assert_eq!(bench.joints.arm(at_ms(bench.ms)), Err(ArmError::Stopped));
}

/// The fuzzer found settings, which have the first register written anew, to look as if nothing had been written.
#[test]
fn a_joint_that_got_settings_while_it_is_brought_up_is_disabled_all_the_same() {
    let mut bench = Bench::armed(&[1]);
    let joint = bench.handles[0];
    bench.joints.set_pulses(joint, 1_000).unwrap();
    assert_eq!(writes(&bench.run(1)), [Command::Write(Register::Mode, 1)]);
    bench.joints.set_settings(joint, &Config::new(1)).unwrap();
    bench.joints.relax(joint);
    assert_eq!(writes(&bench.run(1)), [Command::DISABLE]);
}

/// Makes an update without a step after so many ms, for a driver with room for so many frames.
fn held(bench: &mut Bench, room: usize, ms: u64) -> Vec<(u8, Command)> {
    bench.ms += ms;
    bench.joints.update(Tick::new(at_ms(bench.ms), f32::NAN));
    bench.take_some(room, false)
}

/// A hostile reader had joints go on for ever whose disable was refused, or waited for an answer, while the updates had no
/// step.
#[test]
fn updates_without_a_step_disable_all_however_small_the_driver_and_whoever_owes_an_answer() {
    // The clock goes on with a step that is no number, it stands, and it goes back, to a place from where it goes on.
    for (goes_on, back) in [(1, 0), (0, 0), (1, 150), (0, 150)] {
        let mut bench = Bench::armed(&ALL);
        bench.drive(200);
        bench.silent = ALL.to_vec();
        bench.drive(1);
        bench.ms -= back;
        let mut disabled = Vec::new();
        for _ in 0..12 {
            let sent = held(&mut bench, 3, goes_on);
            assert!(sent.iter().all(|(_, command)| *command == Command::DISABLE), "{sent:?}");
            disabled.extend(sent.iter().map(|(id, _)| *id));
        }
        disabled.sort_unstable();
        assert_eq!(disabled, ALL);
    }
}

#[test]
fn an_emergency_stop_tells_also_those_that_were_told_before_and_once() {
    let mut bench = Bench::new(&ALL);
    bench.run(30);
    for disables in [12, 0] {
        bench.joints.emergency_stop();
        assert_eq!(writes(&bench.take()), std::vec![Command::DISABLE; disables]);
    }
}

/// A question that is handed out without a step would have to be waited for, nobody knows how long.
#[test]
fn an_update_without_a_step_asks_nobody() {
    let joints = Joints::new().with_frames_per_update(12, 1);
    let mut bench = Bench::of(joints, ALL.map(Config::new));
    bench.run(3);
    bench.joints.update(Tick::new(at_ms(4), 0.001));
    assert!(bench.joints.next_frame().is_some(), "one of twelve questions");
    assert_eq!(held(&mut bench, 100, 4), []);
    assert_eq!(bench.take(), []);
}

/// In a late update without a step, the positions are as old as in a second update without a step: no joint may move.
#[test]
fn an_update_without_a_step_that_is_late_moves_no_joint() {
    for (gap_ms, moves) in [(20, true), (41, false), (10_000, false)] {
        let joints = Joints::new().with_frames_per_update(1, 12);
        let mut bench = Bench::of(joints, ALL.map(Config::new)).armed_after(30);
        bench.drive(6);
        // What the next update has for them stays where it is.
        bench.ms += 1;
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
        let sent = held(&mut bench, 100, gap_ms);
        assert_eq!(sent.iter().any(|(_, command)| !command.is_safe()), moves, "{gap_ms}");
        assert_eq!(sent.iter().all(|(_, command)| *command == Command::DISABLE), !moves);
        assert_eq!(sent.len(), 12);
    }
}

/// The clock ran ahead and was set back: a disable stamped ahead must not put off the next one.
#[test]
fn a_relaxed_joint_is_told_again_after_the_clock_was_set_back() {
    for dt_s in [0.001, f32::NAN] {
        let mut bench = Bench::armed(&[3]);
        bench.joints.update(Tick::new(at_ms(1_000_000), dt_s));
        bench.joints.disarm();
        assert_eq!(writes(&bench.take()), [Command::DISABLE]);
        assert_eq!(writes(&bench.run(250)), [Command::DISABLE; 3]);
    }
}

/// A hostile reader stopped a clock at its start, and twelve joints that fell silent were never disabled.
#[test]
fn a_clock_that_stands_at_its_start_stands() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.silent = ALL.to_vec();
    let update = |bench: &mut Bench| {
        bench.joints.update(Tick::new(Instant::START, 0.001));
        bench.take()
    };
    for _ in 0..30 {
        update(&mut bench);
    }
    assert_eq!((bench.enabled, bench.joints.counters().bad_steps), ([0; 12], 30));
    bench.joints.emergency_stop();
    assert_eq!(bench.take(), ALL.map(|id| (id, Command::DISABLE)));
    // The first update of all may be there.
    let mut bench = Bench::new(&[3]);
    assert_eq!(update(&mut bench).len(), 2);
    assert_eq!(bench.joints.counters().bad_steps, 0);
}

/// And is told again, as long as time passes.
#[test]
fn a_relaxed_joint_is_told_again_each_100_ms_by_updates_without_a_step() {
    let mut bench = Bench::armed(&[3]);
    bench.drive(20);
    let sent: Vec<_> = (0..350).flat_map(|_| held(&mut bench, 3, 1)).collect();
    assert_eq!(sent, [(3, Command::DISABLE); 4]);
}

/// Silence about a reply ends by the clock; where the clock stands, each update counts for a millisecond.
#[test]
fn a_joint_that_owes_an_answer_is_disabled_by_updates_without_a_step_once_its_time_is_over() {
    for (step_us, updates) in [(0, 3), (100, 21), (1_000, 3), (1_500, 2)] {
        let mut bench = Bench::armed(&[3]);
        bench.drive(20);
        bench.silent = std::vec![3];
        while bench.joints.awaited(bench.handles[0]).is_none() {
            bench.drive(1);
        }
        let asked = at_ms(bench.ms);
        for update in 1..=updates {
            let now = asked + Duration::from_micros(step_us * update);
            bench.joints.update(Tick::new(now, f32::NAN));
            let sent = bench.take();
            let expected = if update == updates { &[(3, Command::DISABLE)][..] } else { &[] };
            assert_eq!(sent, expected, "{step_us} us, update {update}");
        }
    }
}

#[test]
fn disarming_disables_also_joints_without_a_target_and_once() {
    let mut bench = Bench::armed(&[3, 5]);
    bench.joints.disarm();
    assert_eq!(bench.take(), [(3, Command::DISABLE), (5, Command::DISABLE)]);
    bench.joints.disarm();
    assert_eq!(bench.take(), []);
}

/// As one of several devices of a runner, joints are reached by their trait alone.
#[test]
fn a_trip_of_the_whole_robot_disables_the_joints_until_the_request_to_arm_is_released() {
    let mut bench = Bench::armed(&[3, 5]);
    bench.drive(50);
    assert_eq!(crate::motor::CanDevice::superseded(&bench.joints), 0);
    bench.ms += 1;
    crate::motor::CanDevice::update(&mut bench.joints, Tick::new(at_ms(bench.ms), 0.001));
    crate::motor::CanDevice::trip(&mut bench.joints);
    // The write that waited is not sent.
    assert_eq!(crate::motor::CanDevice::superseded(&bench.joints), 1);
    let frame = crate::motor::CanDevice::next_frame(&mut bench.joints).unwrap();
    assert_eq!(Some(frame), Command::DISABLE.frame(3));
    assert!(bench.take().contains(&(5, Command::DISABLE)));
    assert_eq!(bench.handles.iter().find(|joint| bench.joints.is_joint_armed(**joint)), None);
    assert_eq!(bench.joints.arm(at_ms(bench.ms)), Err(ArmError::NotReleased));
    bench.run(100);
    assert_eq!(bench.joints.arm(at_ms(bench.ms)), Ok(()));
    assert!(bench.handles.iter().all(|joint| bench.joints.is_joint_armed(*joint)));
}
