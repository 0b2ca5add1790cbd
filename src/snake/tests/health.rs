//! Every change is an edge with its time, waits until it is read, and is read once.

use super::*;
use crate::motor::{Condition, MotorName, Reaction};
use crate::time::Edge;

/// Reads all that waits: joint, condition, whether it began.
fn edges(joints: &mut Joints) -> Vec<(u8, Condition, bool)> {
    read(joints).into_iter().map(|edge| (edge.source.id(), edge.condition, edge.began)).collect()
}

fn read(joints: &mut Joints) -> Vec<Edge<Condition, MotorName>> {
    core::iter::from_fn(|| joints.next_edge()).collect()
}

#[test]
fn a_healthy_joint_has_no_edges() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(3_000);
    assert_eq!(edges(&mut bench.joints), []);
    assert_eq!(bench.joints.conditions(bench.handles[0]).to_string(), "healthy");
}

#[test]
fn a_silent_joint_is_late_and_lost_and_both_end_when_it_is_back() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.silent = std::vec![5];
    let silent = bench.ms;
    let mut seen = Vec::new();
    for _ in 0..140 {
        bench.drive(1);
        for edge in read(&mut bench.joints) {
            let age = at_ms(bench.ms).since(edge.at).as_micros();
            assert!(age < 1_024, "the time is that of the tick in which it was noticed: {age}");
            seen.push((edge.source.id(), edge.condition, edge.began, bench.ms - silent));
        }
    }
    let [(5, Condition::Late, true, late), (5, Condition::Offline, true, lost), rest] = seen[..]
    else {
        panic!("{seen:?}");
    };
    assert!((28..=41).contains(&late) && lost - late == 60, "{late} {lost}");
    assert_eq!((rest.1, rest.2), (Condition::PositionUncertain, true));
    bench.silent.clear();
    bench.drive(250);
    assert_eq!(
        edges(&mut bench.joints),
        [(5, Condition::Late, false), (5, Condition::Offline, false)]
    );
    assert_eq!(bench.joints.conditions(bench.handles[4]).to_string(), "position uncertain");
    bench.joints.zero(bench.handles[4]).unwrap();
    assert_eq!(edges(&mut bench.joints), [(5, Condition::PositionUncertain, false)]);
}

/// Before the first update the replies of joints are the clock: after 70 s a joint is lost. A reply of nobody and a command tell no time.
#[test]
fn before_the_first_update_only_a_reply_of_a_joint_moves_the_time() {
    let position = |id| reply(id, Register::ActualPosition, 0);
    let command = Command::DISABLE.frame(2).unwrap();
    for (later, is_lost) in [(position(2), true), (position(9), false), (command, false)] {
        let mut bench = Bench::new(&[1, 2]);
        assert_eq!(bench.joints.ingest(&position(1), at_ms(1)), Ingest::Taken);
        _ = bench.joints.ingest(&later, at_ms(70_000));
        let link = bench.joints.link(bench.handles[0]);
        assert_eq!(link, Some(if is_lost { Link::Offline } else { Link::Online }), "{later:?}");
    }
}

#[test]
fn what_changes_a_thousand_times_before_it_is_read_is_one_edge_each_way() {
    let mut bench = Bench::armed(&[1, 2]);
    for _ in 0..1_000 {
        bench.drive(1);
        bench.run(102); // and the application forgets its joints
    }
    let first = (1, Condition::CommandLost, true);
    let mut all = edges(&mut bench.joints);
    assert_eq!(all[0], first, "the oldest first");
    all.sort_unstable();
    let lost = Condition::CommandLost;
    assert_eq!(all, [(1, lost, false), (1, lost, true), (2, lost, false), (2, lost, true)]);
    assert_eq!(bench.state(0).forgotten_targets, 1_000, "and counted");
}

#[test]
fn edges_of_several_joints_are_read_in_the_order_in_which_they_came() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(100);
    for silent in [9, 2, 12, 5] {
        bench.silent = std::vec![silent];
        bench.drive(60);
        bench.silent.clear();
        bench.drive(40);
    }
    let all = read(&mut bench.joints);
    let began: Vec<u8> =
        all.iter().filter(|edge| edge.began).map(|edge| edge.source.id()).collect();
    assert_eq!(began, [9, 2, 12, 5]);
    assert!(all.windows(2).all(|pair| pair[0].at <= pair[1].at), "{all:?}");
    assert_eq!(all.len(), 8, "each of them ended");
}

#[test]
fn a_drive_that_is_not_what_it_was_is_a_fault_until_it_is_armed() {
    use Condition::{Fault, PositionUncertain};
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.enabled[8] = 0;
    bench.drive(300);
    assert_eq!(edges(&mut bench.joints), [(9, Fault, true), (9, PositionUncertain, true)]);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    assert_eq!(edges(&mut bench.joints), [(9, Fault, false)]);
    bench.drive(100);
    // Once more, while its position is uncertain as it was: not in silence.
    bench.raw[8] = 1_000_000;
    bench.drive(30);
    assert_eq!(edges(&mut bench.joints), [(9, Fault, true)]);
    assert!(!bench.state(8).is_driven);
}

#[test]
fn another_controller_is_an_edge_and_refuses_arming_for_a_second() {
    let mut bench = Bench::new(&[3, 4]);
    bench.run(30);
    let foreign = frame(4, &[1, 0x0A, 0, 0, 1, 0]);
    for _ in 0..50 {
        _ = bench.joints.ingest(&foreign, at_ms(bench.ms));
        bench.run(1);
    }
    assert_eq!(edges(&mut bench.joints), [(4, Condition::SecondMaster, true)]);
    let refused = bench.joints.arm(at_ms(bench.ms)).unwrap_err();
    assert_eq!(refused.to_string(), "another node sends the command of snake joint #4 on 0x4");
    bench.run(999);
    assert!(bench.joints.arm(at_ms(bench.ms)).is_err());
    bench.run(2);
    assert_eq!(edges(&mut bench.joints), [(4, Condition::SecondMaster, false)]);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
}

#[test]
fn another_controller_counts_for_a_second_wherever_a_driven_joint_is_between_two_checks() {
    let mut bench = Bench::armed(&[1]);
    let is_present =
        |bench: &Bench| bench.joints.conditions(bench.handles[0]).contains(Condition::SecondMaster);
    for wait_ms in 1..45 {
        bench.drive(wait_ms);
        _ = bench.joints.ingest(&frame(1, &[3, 7]), at_ms(bench.ms));
        bench.drive(1_000);
        assert!(is_present(&bench), "{wait_ms}");
        bench.drive(1);
        assert!(!is_present(&bench) && bench.state(0).is_driven, "{wait_ms}");
    }
}

#[test]
fn own_frames_that_the_driver_hands_back_are_no_other_controllers() {
    let mut bench = Bench::new(&[3]);
    bench.joints = bench.joints.with_loopback();
    bench.run(30);
    let own = frame(3, &[3, 7]);
    assert_eq!(bench.joints.ingest(&own, at_ms(bench.ms)), Ingest::Unrelated);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    assert_eq!((bench.joints.counters().foreign_commands, bench.joints.next_edge()), (0, None));
}

#[test]
fn a_detached_joint_leaves_no_edges_to_the_next_one() {
    let mut bench = Bench::armed(&[3, 7]);
    bench.drive(50);
    bench.silent = std::vec![3, 7];
    bench.drive(60);
    bench.joints.detach(bench.handles[0]);
    let again = bench.joints.attach(Config::new(3)).unwrap();
    assert_eq!(edges(&mut bench.joints), [(7, Condition::Late, true)]);
    assert_eq!(bench.joints.conditions(again).to_string(), "healthy");
}

#[test]
fn health_is_a_line_with_rate_and_longest_gap() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(2_100);
    let health = bench.joints.health(bench.handles[0]).unwrap();
    assert!((54..=57).contains(&health.feedback_hz), "16 positions in 288 ms: {health}");
    assert!((23_900..=24_000).contains(&health.longest_gap.as_micros()), "{health}");
    assert!(health.to_string().starts_with("snake joint #1: online, armed, healthy; 5"));
    bench.joints.detach(bench.handles[0]);
    assert_eq!(bench.joints.health(bench.handles[0]), None);
}

#[test]
fn a_pause_of_a_driven_joint_that_is_not_late_yet_is_its_longest_gap() {
    let mut bench = Bench::armed(&[1]);
    bench.drive(100);
    bench.silent = std::vec![1];
    bench.drive(20);
    bench.silent.clear();
    bench.drive(100);
    let health = bench.joints.health(bench.handles[0]).unwrap();
    assert!((20_000..=24_000).contains(&health.longest_gap.as_micros()), "{health}");
    assert_eq!(edges(&mut bench.joints), []);
}

/// A joint with a stall window of 300 ms, at 10 rpm; it moves to its target as long as it is not blocked.
fn run_to(bench: &mut Bench, pulses: i32, ms: u64, blocked: bool) -> Vec<(Condition, bool, u64)> {
    let begin = bench.ms;
    let mut seen = Vec::new();
    for _ in 0..ms {
        _ = bench.joints.set_pulses(bench.handles[0], pulses);
        bench.run(1);
        if bench.enabled[0] == 1 && !blocked {
            let way = pulses - bench.raw[0];
            bench.raw[0] += way.clamp(-11, 11); // 10 rpm
        }
        let told = read(&mut bench.joints);
        seen.extend(told.iter().map(|edge| (edge.condition, edge.began, bench.ms - begin)));
    }
    seen
}

fn jaw(reaction: Reaction) -> Bench {
    let config = Config::new(1).with_stall(Duration::from_millis(300), reaction);
    Bench::of(Joints::new(), [config]).armed_after(10)
}

#[test]
fn a_blocked_joint_is_stalled_in_either_direction_and_relaxed_where_configured() {
    for direction in [1, -1] {
        let mut bench = jaw(Reaction::Report);
        assert_eq!(run_to(&mut bench, 8_000 * direction, 400, false), []);
        let seen = run_to(&mut bench, 8_000 * direction, 600, true);
        assert!(matches!(seen[..], [(Condition::Stalled, true, 270..=330)]), "{seen:?}");
        assert!(bench.state(0).is_driven);
        let seen = run_to(&mut bench, 8_000 * direction, 2_000, false);
        assert!(matches!(seen[..], [(Condition::Stalled, false, 10..=60)]), "{seen:?}");

        let mut bench = jaw(Reaction::Relax);
        let seen = run_to(&mut bench, 8_000 * direction, 600, true);
        let [(Condition::Stalled, true, at), (Condition::Stalled, false, _)] = seen[..] else {
            panic!("{seen:?}");
        };
        assert!((300..=330).contains(&at) && bench.enabled[0] == 0, "{at}");
        assert_eq!(bench.joints.set_pulses(bench.handles[0], 0), Err(TargetError::Relaxed));
        assert_eq!(bench.joints.arm(at_ms(bench.ms)), Ok(()));
    }
}

#[test]
fn a_joint_is_stalled_from_the_update_in_which_it_stood_for_its_window_to_the_one_in_which_it_moved()
 {
    let mut bench = jaw(Reaction::Report);
    assert_eq!(run_to(&mut bench, 0, 100, false), []);
    let (mut at, mut since, mut stalls) = (bench.raw[0], bench.ms, 0);
    for step in 0..20_000 {
        // Blocked for 279 ms to 355 ms, and free for 40 ms.
        let length = 40 + 279 + step / 1_000 * 4;
        let (raw, is_free) = (bench.state(0).raw_pulses, step % length < 40);
        run_to(&mut bench, 10_000_000, 1, !is_free);
        if (raw - at).abs() > 256 {
            (at, since) = (raw, bench.ms);
        }
        let is_stalled = bench.joints.conditions(bench.handles[0]).contains(Condition::Stalled);
        assert_eq!(is_stalled, bench.ms - since >= 300, "{step}");
        stalls += u32::from(is_stalled && bench.ms - since == 300);
    }
    assert!(stalls > 30, "{stalls}");
}

#[test]
fn a_stalled_joint_that_is_armed_again_after_a_pause_is_brought_up_anew() {
    let mut bench = jaw(Reaction::Relax);
    let mut sent = Vec::new();
    let mut relaxed_ms = 0;
    for _ in 0..550 {
        relaxed_ms = if bench.joints.is_armed() { 0 } else { relaxed_ms + 1 };
        if relaxed_ms == 101 {
            bench.joints.arm(at_ms(bench.ms)).unwrap();
        }
        _ = bench.joints.set_pulses(bench.handles[0], 8_000);
        let was_armed = bench.joints.is_armed();
        let tick = writes(&bench.run(1));
        let trips = was_armed && !bench.joints.is_armed();
        assert!(!trips || tick == [Command::DISABLE], "at once: {tick:?}");
        sent.extend(tick);
    }
    let stops: Vec<_> = (0..sent.len()).filter(|at| sent[*at] == Command::DISABLE).collect();
    // And told again, after 100 ms.
    assert!(matches!(stops[..], [first @ 300..=330, again] if again == first + 1), "{stops:?}");
    assert_eq!(sent[stops[1] + 1], Command::Write(Register::Mode, 1));
    assert_eq!(sent[stops[1] + 7], Command::Write(Register::Enable, 1));
}

#[test]
fn a_joint_whose_target_changes_in_each_tick_is_enabled_and_seen_to_be_blocked_and_disabled() {
    let mut bench = jaw(Reaction::Report);
    let follow = |bench: &mut Bench| {
        for near in [0, 1].into_iter().cycle().take(400) {
            _ = bench.joints.set_pulses(bench.handles[0], 8_000 + near);
            bench.run(1);
        }
        edges(&mut bench.joints)
    };
    assert_eq!(follow(&mut bench), [(1, Condition::Stalled, true)]);
    assert_eq!(bench.enabled[0], 1);
    bench.enabled[0] = 0;
    let seen = follow(&mut bench);
    assert!(seen.contains(&(1, Condition::Fault, true)), "{seen:?}");
    assert_eq!(bench.state(0).resets, 1);
}

#[test]
fn a_joint_that_is_there_or_creeps_or_is_not_looked_at_is_not_stalled() {
    let mut bench = jaw(Reaction::Report);
    assert_eq!(run_to(&mut bench, 1_000, 2_000, true), [], "there");
    assert_eq!(run_to(&mut bench, 30_000, 5_000, false), [], "on its way");
    bench.joints.set_speed(bench.handles[0], AngularVelocity::from_rpm(1.0)).unwrap();
    assert_eq!(run_to(&mut bench, 0, 2_000, true), [], "1 rpm is 328 pulses in 300 ms");
    let mut bench = jaw(Reaction::Ignore);
    assert_eq!(run_to(&mut bench, 30_000, 2_000, true), []);
}

#[test]
fn it_offers_positions_and_nothing_once_it_is_detached() {
    let mut bench = Bench::new(&[1]);
    let neck = bench.handles[0];
    assert_eq!(bench.joints.capabilities(neck).to_string(), "raw, position, feedback");
    bench.joints.detach(neck);
    assert_eq!(bench.joints.capabilities(neck).to_string(), "nothing");
}

#[test]
fn a_joint_is_there_within_a_64th_of_a_turn_and_stands_within_a_256th() {
    for (pulses, stalls) in [(1_024, false), (1_025, true), (-1_024, false), (-1_025, true)] {
        let mut bench = jaw(Reaction::Report);
        assert_eq!(run_to(&mut bench, pulses, 600, true).len(), usize::from(stalls), "{pulses}");
    }
    for (pulses, stalls) in [(256, true), (257, false), (-256, true), (-257, false)] {
        let mut bench = jaw(Reaction::Report);
        assert_eq!(run_to(&mut bench, 30_000, 250, true), []);
        bench.raw[0] = pulses;
        assert_eq!(run_to(&mut bench, 30_000, 200, true).len(), usize::from(stalls), "{pulses}");
    }
}

/// From rest, it makes 900 or 1125 pulses in 300 ms; a 64th of a turn is 1024.
#[test]
fn a_joint_that_speeds_up_too_slowly_for_a_visible_motion_is_not_checked() {
    for (acceleration, is_checked) in [(20_000, false), (25_000, true)] {
        let config = Config::new(1)
            .with_stall(Duration::from_millis(300), Reaction::Report)
            .with_acceleration(acceleration);
        let mut bench = Bench::of(Joints::new(), [config]).armed_after(10);
        let seen = run_to(&mut bench, 30_000, 900, true);
        assert_eq!(seen.len(), usize::from(is_checked), "{acceleration}");
    }
}

/// Of two drives with one id, or an encoder that slips: each jump begins the pause of the gesture anew.
#[test]
fn a_joint_without_a_zero_that_goes_on_to_jump_is_not_armed() {
    let mut bench = Bench::armed(&[1]);
    bench.drive(100);
    for jump in 0..20 {
        bench.raw[0] = if jump % 2 == 0 { 32_768 } else { 0 };
        bench.run(60);
        if jump % 3 == 2 {
            assert_eq!(bench.joints.arm(at_ms(bench.ms)), Err(ArmError::NotReleased), "{jump}");
        }
        assert_eq!(bench.enabled[0], 0);
    }
    bench.run(150);
    assert_eq!(bench.joints.arm(at_ms(bench.ms)), Ok(()));
}
