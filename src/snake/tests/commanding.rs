//! Targets, zeros and directions.

use super::*;

#[test]
fn zeroing_makes_the_present_position_zero_and_relaxes() {
    let mut bench = Bench::new(&[2, 3]);
    bench.raw = [70_000; 12];
    bench.run(30);
    assert_eq!(bench.state(0).homing, Homing::Relative);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    bench.drive(20);
    assert!(bench.state(0).is_driven);
    bench.joints.zero(bench.handles[0]).unwrap();
    let sent = bench.run(1);
    assert_eq!(sent[0], (2, Command::DISABLE));
    let state = bench.state(0);
    assert_eq!((state.pulses, state.raw_pulses, state.homing), (0, 70_000, Homing::Homed));
    assert_eq!(bench.joints.offset(bench.handles[0]).map(|offset| offset.target(0)), Some(70_000));
    bench.joints.set_pulses(bench.handles[0], -1_000).unwrap();
    let sent = bench.run(20);
    assert!(sent.contains(&(2, Command::Write(Register::Position, 69_000))));
}

#[test]
fn a_reversed_joint_turns_position_speed_and_target_around() {
    let mut bench = Bench::new(&[]);
    bench.handles.push(bench.joints.attach(Config::new(6).reversed()).unwrap());
    bench.raw = [16_384; 12];
    bench.run(10);
    let state = bench.state(0);
    assert_eq!((state.pulses, state.position.as_turns()), (-16_384, -0.25));
    assert!((state.velocity.as_rpm() + 60.0).abs() < 1e-3);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    let quarter = Position::from_angle(Angle::from_degrees(90.0));
    bench.joints.set_position(bench.handles[0], quarter).unwrap();
    assert!(writes(&bench.run(8)).contains(&Command::Write(Register::Position, -16_384)));
}

#[test]
fn positions_saturate_and_refused_ones_relax() {
    let mut bench = Bench::armed(&[1]);
    let joint = bench.handles[0];
    for (turns, pulses) in [(i64::MAX, 0x7FFF_0000), (i64::MIN, i32::MIN), (-2, -131_072)] {
        bench.joints.set_position(joint, Position::from_turns(turns)).unwrap();
        let sent = writes(&bench.run(8));
        assert!(sent.contains(&Command::Write(Register::Position, pulses)), "{turns}");
    }
    let nan = Position::from_angle(Angle::from_radians(f32::NAN));
    assert_eq!(bench.joints.set_position(joint, nan), Err(TargetError::NotFinite));
    assert_eq!(bench.run(1)[0], (1, Command::DISABLE));
    assert_eq!(bench.state(0).refused_targets, 1);
    let rate = AngularVelocity::from_rpm(f32::INFINITY);
    assert_eq!(bench.joints.set_speed(joint, rate), Err(TargetError::NotFinite));
    bench.joints.set_speed(joint, AngularVelocity::from_rpm(9_999.0)).unwrap();
    bench.drive(8);
    assert!(
        !writes(&bench.drive(8))
            .iter()
            .any(|c| matches!(c, Command::Write(Register::Speed, v) if *v > 278_528))
    );
}
