//! Every change is an edge with its time, waits until it is read, and is read once.

use super::*;
use crate::motor::{Condition, Edge};

/// Reads all that waits: joint, condition, whether it began.
fn edges(joints: &mut Joints) -> Vec<(u8, Condition, bool)> {
    read(joints).into_iter().map(|edge| (edge.motor.id(), edge.condition, edge.began)).collect()
}

fn read(joints: &mut Joints) -> Vec<Edge> {
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
            seen.push((edge.motor.id(), edge.condition, edge.began, bench.ms - silent));
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
    let began: Vec<u8> = all.iter().filter(|edge| edge.began).map(|edge| edge.motor.id()).collect();
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
