//! Ids, parameters and handles.

use super::*;
use crate::motor::Reaction;

#[test]
fn ids_and_parameters_that_make_no_sense_are_named() {
    let mut joints = Joints::new();
    let mut refused = |config| joints.attach(config).unwrap_err().to_string();
    assert_eq!(refused(Config::new(0)), "snake joint #0: the id is not within 1..=12");
    assert_eq!(refused(Config::new(13)), "snake joint #13: the id is not within 1..=12");
    for rpm in [-1.0, 256.0, f32::NAN] {
        let speed = AngularVelocity::from_rpm(rpm);
        assert_eq!(
            refused(Config::new(1).with_speed(speed)),
            "snake joint #1: speed is not usable"
        );
    }
    let no_window = Config::new(1).with_stall(Duration::ZERO, Reaction::Report);
    assert_eq!(refused(no_window), "snake joint #1: stall window is not usable");
    assert_eq!(refused(Config::new(1).with_current(0)), "snake joint #1: current is not usable");
    joints.attach(Config::new(1)).unwrap();
    assert_eq!(joints.attach(Config::new(1)), Err(AttachError::Taken(model::name(1))));
    assert_eq!(joints.joints().count(), 1);
}

#[test]
fn a_detached_joint_is_disabled_once_and_its_handle_finds_nothing() {
    let mut bench = Bench::armed(&[1, 2]);
    bench.drive(50);
    let gone = bench.handles[0];
    bench.joints.detach(gone);
    let sent = bench.run(50);
    assert_eq!(sent[0], (1, Command::DISABLE));
    assert!(sent[1..].iter().all(|(id, _)| *id == 2));
    let again = bench.joints.attach(Config::new(1)).unwrap();
    assert_eq!(bench.joints.set_pulses(gone, 0), Err(TargetError::Detached));
    assert_eq!((bench.joints.state(gone), bench.joints.link(again)), (None, Some(Link::Unheard)));
    for _ in 0..14 {
        let last = bench.joints.joints().next().unwrap().0;
        bench.joints.detach(last);
        bench.joints.attach(Config::new(1)).unwrap();
    }
    let last = bench.joints.joints().next().unwrap().0;
    bench.joints.detach(last);
    assert_eq!(bench.joints.attach(Config::new(1)), Err(AttachError::WornOut(model::name(1))));
}
