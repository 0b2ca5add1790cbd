//! Replies, and what is none.

use super::*;

#[test]
fn replies_are_sorted_by_their_register() {
    let mut bench = Bench::new(&[3]);
    bench.raw = [-7; 12];
    bench.run(10);
    let (pulses, rpm) = (bench.state(0).pulses, bench.state(0).velocity.as_rpm());
    assert!(pulses == -7 && (rpm - 60.0).abs() < 1e-3);
    bench.joints.read(bench.handles[0], Register::Deceleration).unwrap();
    assert_eq!(bench.joints.answer(bench.handles[0]), None);
    bench.run(4);
    let answer = bench.joints.answer(bench.handles[0]);
    assert_eq!(answer, Some((Register::Deceleration, 77)));
    assert_eq!((bench.state(0).pulses, bench.joints.answer(bench.handles[0])), (-7, None));
}

#[test]
fn what_is_no_reply_is_refused_counted_and_keeps_nothing_fresh() {
    let mut bench = Bench::armed(&[3]);
    let now = at_ms(bench.ms);
    let mut ingest = |id, data: &[u8]| bench.joints.ingest(&frame(id, data), now);
    assert_eq!(ingest(3, &[4, 7, 0, 0, 0]), Ingest::WrongLength(5));
    assert_eq!(ingest(3, &[4, 0x0D, 0, 0, 0, 0]), Ingest::WrongField);
    assert_eq!(ingest(3, &[9, 7, 0, 0, 0, 0]), Ingest::WrongField);
    assert_eq!(ingest(3, &[1, 0x10, 0, 0, 0, 1]), Ingest::WrongField);
    assert_eq!(ingest(3, &[3, 7]), Ingest::WrongLength(2));
    assert_eq!(ingest(4, &[4, 7, 0, 0, 0, 0]), Ingest::Unrelated);
    assert_eq!(ingest(13, &[4, 7, 0, 0, 0, 0]), Ingest::Unrelated);
    let counters = bench.joints.counters();
    assert_eq!((counters.bad_length, counters.bad_field), (1, 2));
    assert_eq!((counters.foreign_commands, counters.unattached), (2, 1));
    assert_eq!(bench.state(0).bad_replies, 5);
}

/// Armed, homed a turn from where its drive counts, and led there for 30 ms.
fn homed() -> Bench {
    homed_with(Timeouts::POLLED)
}

fn homed_with(timeouts: Timeouts) -> Bench {
    let joints = Joints::new().with_timeouts(timeouts);
    let mut bench = Bench::of(joints, [Config::new(1)]).armed_after(30);
    bench.joints.set_offset(bench.handles[0], -65_536).unwrap();
    bench.joints.set_speed(bench.handles[0], AngularVelocity::from_rpm(200.0)).unwrap();
    for _ in 0..30 {
        bench.joints.set_pulses(bench.handles[0], 0).unwrap();
        bench.run(1);
    }
    assert!(bench.state(0).is_driven);
    bench
}

/// Late and offline after so many ms.
fn timeouts(late: u64, offline: u64) -> Timeouts {
    let [late, offline] = [late, offline].map(Duration::from_millis);
    Timeouts::POLLED.with_feedback(late, offline).unwrap()
}

/// Reports another position after a time in which nothing was heard, and not even an update was made if `is_stalled`. Returns whether the
/// zero counts as lost, and whether the joint is enabled again by targets.
fn turns_unheard(bench: &mut Bench, silent_ms: u64, is_stalled: bool, raw: i32) -> (bool, bool) {
    if is_stalled {
        bench.ms += silent_ms;
    } else {
        bench.run_silent(1, silent_ms);
    }
    bench.raw[0] = raw;
    bench.hear(Register::ActualPosition, raw);
    let sent = bench.drive(100);
    let is_enabled = sent.contains(&(1, Command::Write(Register::Enable, 1)));
    (bench.state(0).homing == Homing::Uncertain, is_enabled)
}

#[test]
fn a_zero_is_lost_in_a_silence_of_which_a_stalled_loop_knows_nothing() {
    assert_eq!(turns_unheard(&mut homed(), 900, true, 61_000), (true, false));
    assert_eq!(turns_unheard(&mut homed(), 101, true, 0), (true, false), "as an offline joint");
    assert!(!turns_unheard(&mut homed(), 99, true, 0).0);
    for (silent_ms, is_lost) in [(49, false), (51, true)] {
        let timeouts = timeouts(20, 50);
        assert_eq!(turns_unheard(&mut homed_with(timeouts), silent_ms, true, 0).0, is_lost);
    }
}

#[test]
fn a_joint_that_is_not_led_does_not_turn_to_a_target_of_before() {
    let mut bench = homed();
    bench.run(500);
    assert!(!bench.state(0).is_driven);
    assert_eq!(turns_unheard(&mut bench, 80, false, 27_000), (true, false));
    // Led, the joint may be on the way.
    assert!(!turns_unheard(&mut homed(), 80, false, 27_000).0);
}

#[test]
fn two_positions_at_once_after_one_that_waited_are_no_great_speed() {
    let mut bench = homed();
    bench.run(500);
    bench.ms += 35;
    bench.hear(Register::ActualPosition, 100);
    bench.ms += 1;
    bench.hear(Register::ActualPosition, 2_200);
    assert_eq!(turns_unheard(&mut bench, 60, true, 92_200), (true, false));
}

/// Not led, turned by hand at 300 rpm in one direction: 327 pulses a millisecond.
fn turn_by_hand(bench: &mut Bench, ms: u64, direction: i32) {
    for _ in 0..ms {
        bench.raw[0] += 327 * direction;
        bench.run(1);
    }
}

#[test]
fn a_joint_turned_fast_by_hand_keeps_its_zero_in_a_silence_that_its_last_rate_explains() {
    for direction in [1, -1] {
        // 0.4 turns in 80 ms are 300 rpm, and a full turn is 750 rpm.
        for (pulses, is_lost) in [(26_214, false), (65_536, true)] {
            let mut bench = homed();
            bench.run(500);
            turn_by_hand(&mut bench, 60, direction);
            assert_eq!((bench.state(0).is_driven, bench.state(0).position_jumps), (false, 0));
            let raw = bench.raw[0] + pulses * direction;
            assert_eq!(turns_unheard(&mut bench, 80, false, raw), (is_lost, !is_lost), "{pulses}");
            assert_eq!(bench.state(0).position_jumps, u16::from(is_lost));
        }
    }
}

#[test]
fn a_joint_that_was_turned_by_hand_and_stands_again_has_no_rate_left() {
    for pause_ms in [0, 30] {
        let mut bench = homed();
        bench.run(500);
        turn_by_hand(&mut bench, 60, 1);
        bench.silent = std::vec![1];
        turn_by_hand(&mut bench, pause_ms, 1);
        bench.silent.clear();
        turn_by_hand(&mut bench, 30, 1);
        bench.run(200);
        let raw = bench.raw[0] + 26_214;
        assert_eq!(turns_unheard(&mut bench, 80, false, raw), (true, false), "{pause_ms}");
    }
}

#[test]
fn two_positions_at_once_may_be_a_sixteenth_of_a_turn_apart() {
    for (pulses, jumps) in [(4_096, 0), (-4_096, 0), (4_097, 1), (-4_097, 1)] {
        let mut bench = homed();
        bench.run(500);
        bench.hear(Register::ActualPosition, 0);
        bench.hear(Register::ActualPosition, pulses);
        assert_eq!(bench.state(0).position_jumps, jumps, "{pulses}");
        let health = bench.joints.health(bench.handles[0]).unwrap();
        assert_eq!(health.ambiguous_gaps, jumps, "{health}");
    }
}

#[test]
fn a_zero_set_while_the_joint_is_offline_is_uncertain_until_it_is_back() {
    let mut bench = Bench::new(&[1]);
    bench.run(30);
    bench.silent = std::vec![1];
    bench.run(60);
    assert_eq!(bench.state(0).link, Link::Late);
    assert_eq!(bench.joints.zero(bench.handles[0]), Err(TargetError::NoFeedback));
    bench.run(100);
    assert_eq!(bench.state(0).link, Link::Offline);
    assert_eq!(bench.joints.zero(bench.handles[0]), Err(TargetError::NoFeedback));
    for _ in 0..20 {
        bench.joints.set_offset(bench.handles[0], 100).unwrap();
        bench.run(1);
        assert_eq!(bench.state(0).homing, Homing::Uncertain);
    }
    bench.silent.clear();
    bench.run(100);
    bench.joints.zero(bench.handles[0]).unwrap();
    bench.run(100);
    assert_eq!(bench.state(0).homing, Homing::Homed);
}

#[test]
fn a_rate_does_not_outlast_a_set_back_of_the_clock() {
    for set_back_ms in [0, 400] {
        let mut bench = homed();
        bench.run(500);
        turn_by_hand(&mut bench, 60, 1);
        bench.ms -= set_back_ms;
        bench.run(300);
        _ = bench.joints.arm(at_ms(bench.ms));
        bench.run(10);
        let raw = bench.raw[0] + 65_536 / 4;
        assert_eq!(turns_unheard(&mut bench, 60, false, raw), (true, false), "{set_back_ms} ms");
    }
}

#[test]
fn a_joint_that_is_not_enabled_yet_is_not_led() {
    let mut bench = homed();
    bench.run(500);
    bench.run_silent(1, 35);
    bench.raw[0] += 12_500; // 1.2 rad
    let sent = bench.drive(100);
    assert_eq!(bench.state(0).homing, Homing::Uncertain);
    assert!(!sent.contains(&(1, Command::Write(Register::Enable, 1))));

    let mut bench = homed();
    bench.run(500);
    let sent = bench.drive(3);
    assert!(bench.state(0).is_driven && !sent.contains(&(1, Command::Write(Register::Enable, 1))));
    assert_eq!(turns_unheard(&mut bench, 1, true, 9_000), (true, false)); // 0.86 rad
}

/// Led between two positions, with neither of them.
#[test]
fn a_joint_that_was_led_for_a_moment_may_have_gone_on_its_way() {
    let joints = Joints::new().with_timeouts(timeouts(200, 600)).with_frames_per_update(1, 12);
    let fast = |id| Config::new(id).with_speed(AngularVelocity::from_rpm(200.0));
    let mut bench = Bench::of(joints, ALL.map(fast));
    // 200 rpm are 1092 pulses in 5 ms.
    let step = |bench: &mut Bench| {
        bench.ms += 5;
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.005));
        bench.raw[0] += 1_092 * bench.enabled[0];
        bench.take();
    };
    (0..100).for_each(|_| step(&mut bench));
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    for phase in 0..36 {
        (0..60 + phase).for_each(|_| step(&mut bench));
        for _ in 0..20 {
            bench.joints.set_pulses(bench.handles[0], 6_553_600).unwrap();
            step(&mut bench);
        }
        bench.joints.relax(bench.handles[0]);
    }
    assert!(bench.raw[0] > 100_000 && bench.state(0).position_jumps == 0, "{:?}", bench.state(0));
}

/// A drive may start again in 100 ms, however long the program goes without feedback, unless its joints are polled less often.
#[test]
fn a_silence_of_100_ms_costs_the_zero_also_of_a_joint_that_is_offline_later() {
    for (late, offline, silent_ms, is_kept) in
        [(40, 800, 90, true), (40, 800, 110, false), (200, 800, 190, true), (200, 800, 210, false)]
    {
        let mut bench = homed_with(timeouts(late, offline));
        bench.run_silent(1, silent_ms);
        bench.run(50);
        let is_armed = bench.joints.is_joint_armed(bench.handles[0]);
        let is_homed = bench.state(0).homing == Homing::Homed;
        assert_eq!((is_homed, is_armed), (is_kept, is_kept), "{late}, {silent_ms} ms");
    }
    let mut bench = homed_with(timeouts(40, 800));
    assert_eq!(turns_unheard(&mut bench, 700, false, 60_000), (true, false), "5.75 rad");
}

#[test]
fn a_joint_whose_enable_comes_back_is_not_led() {
    let mut bench = homed();
    bench.run(500);
    let enable = Command::Write(Register::Enable, 1).frame(1).unwrap();
    let mut refused = 0;
    let mut step = |bench: &mut Bench| {
        bench.joints.set_pulses(bench.handles[0], 0).unwrap();
        bench.ms += 1;
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
        while let Some(frame) = bench.joints.next_frame() {
            if frame == enable {
                assert!(bench.joints.requeue(&frame));
                refused += 1;
                break;
            }
            bench.answer(1, Command::decode(frame.data()).unwrap());
        }
    };
    (0..20).for_each(|_| step(&mut bench));
    bench.silent = std::vec![1];
    (0..29).for_each(|_| step(&mut bench));
    bench.silent.clear();
    assert!(refused > 20 && bench.enabled[0] == 0, "{refused}");
    bench.hear(Register::ActualPosition, 12_000); // 1.15 rad
    assert_eq!((bench.state(0).homing, bench.state(0).position_jumps), (Homing::Uncertain, 1));
}

#[test]
fn a_jump_of_a_joint_that_recovers_costs_the_zero_that_was_set_meanwhile() {
    let mut bench = homed();
    bench.run_silent(1, 1_500);
    assert_eq!(bench.state(0).link, Link::Offline);
    bench.run(3);
    assert_eq!(bench.state(0).link, Link::Recovering);
    bench.joints.set_offset(bench.handles[0], -65_536).unwrap();
    bench.raw[0] = 12_000;
    bench.run(3);
    assert_eq!((bench.state(0).homing, bench.state(0).position_jumps), (Homing::Uncertain, 1));
}
