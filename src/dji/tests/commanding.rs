use super::*;
use crate::error::ConfigError;

#[test]
fn one_ampere_is_the_raw_value_of_each_model() {
    fn raw_of<M: Model<Command = Current>>(amperes: f32) -> i16 {
        let (mut bus, [motor]) = armed([Config::<M>::at_once(1)]);
        bus.set_current(motor, Current::from_amperes(amperes)).unwrap();
        step(&mut bus, 2);
        sent(&mut bus)[0].1[0]
    }
    assert_eq!(
        [raw_of::<M2006>(1.0), raw_of::<M3508>(1.0), raw_of::<Gm6020Current>(1.0)],
        [1000, 819, 5461]
    );
    assert_eq!(
        [raw_of::<M2006>(50.0), raw_of::<M3508>(50.0), raw_of::<Gm6020Current>(50.0)],
        [10_000, 16_384, 16_384]
    );
    assert_eq!([raw_of::<M2006>(-50.0), raw_of::<M3508>(-50.0)], [-10_000, -16_384]);
}

#[test]
fn full_voltage_is_25000_and_30000_on_old_motors() {
    for (config, raw) in [
        (Config::<Gm6020Voltage>::at_once(5), 25_000),
        (Config::<Gm6020Voltage>::at_once(5).with_legacy_full_scale(), 30_000),
        (
            Config::<Gm6020Voltage>::at_once(5).with_nominal_voltage(Voltage::from_volts(25.2)),
            23_810,
        ),
    ] {
        let (mut bus, [yaw]) = armed([config]);
        bus.set_voltage(yaw, Voltage::from_volts(24.0)).unwrap();
        step(&mut bus, 2);
        assert_eq!(sent(&mut bus), [(0x2FF, [raw, 0, 0, 0])]);
    }
}

#[test]
fn extreme_requests_on_a_reversed_motor_saturate_and_keep_their_sign() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).reversed()]);
    let mut ms = 1;
    let mut request = |amperes: f32| {
        ms += 1;
        let result = bus.set_current(wheel, Current::from_amperes(amperes));
        step(&mut bus, ms);
        (result, sent(&mut bus).last().map_or(0, |frame| frame.1[0]))
    };
    assert_eq!(request(50.0), (Ok(()), -16_384));
    assert_eq!(request(-50.0), (Ok(()), 16_384));
    for amperes in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(request(amperes), (Err(TargetError::NotFinite), 0));
    }
    bus.set_raw(wheel, i16::MIN).unwrap();
    step(&mut bus, 9);
    assert_eq!(sent(&mut bus), [(0x200, [16_384, 0, 0, 0])]);
}

#[test]
fn m3508_and_m2006_on_one_bus_share_one_frame_a_cycle() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    let feeder = bus.attach(Config::<M2006>::at_once(2)).unwrap();
    assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(1)), Ingest::Taken);
    assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(1)), Ingest::Taken);
    bus.arm(at_ms(1)).unwrap();
    bus.set_current(wheel, Current::from_amperes(1.0)).unwrap();
    bus.set_current(feeder, Current::from_amperes(1.0)).unwrap();
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [819, 1000, 0, 0])]);
}

#[test]
fn a_motor_that_is_never_commanded_does_not_hold_up_the_others() {
    let (mut bus, [first, _, third]) = armed([1, 2, 3].map(Config::<M3508>::at_once));
    bus.set_raw(first, 11).unwrap();
    bus.set_raw(third, 33).unwrap();
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [11, 0, 33, 0])]);
}

#[test]
fn limits_hold_for_direct_commands_and_for_loops() {
    let limit = Current::from_amperes(2.0);
    let config = Config::<M3508>::at_once(1)
        .with_current_limit(limit)
        .speed_loop(PidConfig::new(100.0, 0.0, 0.0));
    let (mut bus, [wheel]) = armed([config]);
    bus.set_current(wheel, Current::from_amperes(20.0)).unwrap();
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [1638, 0, 0, 0])]);
    bus.set_velocity(wheel, AngularVelocity::from_rpm(-400.0)).unwrap();
    step(&mut bus, 3);
    assert_eq!(sent(&mut bus), [(0x200, [-1638, 0, 0, 0])]);
}

#[test]
fn a_speed_loop_gives_amperes_for_rad_per_s_of_the_output_shaft() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
    bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(10.0)).unwrap();
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [8192, 0, 0, 0])]); // 10 A of 20 A
    let six = AngularVelocity::from_rad_per_s(6.0).as_rpm() * 3591.0 / 187.0;
    #[expect(clippy::cast_possible_truncation, reason = "1100 rpm")]
    let frame = feedback(0x201, 0, six.round() as i16);
    assert_eq!(bus.ingest(&frame, at_ms(2)), Ingest::Taken);
    step(&mut bus, 3);
    let raw = sent(&mut bus)[0].1[0];
    assert!((raw - 3277).abs() < 4, "4 A, got {raw}");
}

#[test]
fn an_angle_goes_the_shortest_way() {
    let config =
        Config::<Gm6020Voltage>::at_once(1).position_loop(PidConfig::new(1.0, 0.0, 0.0), SPEED);
    let (mut bus, [yaw]) = armed([config]);
    let mut ms = 1;
    let mut towards = |from: f32, to: f32| {
        ms += 1;
        bus.set_present_position(yaw, Position::from_angle(Angle::from_degrees(from))).unwrap();
        bus.set_angle(yaw, Angle::from_degrees(to)).unwrap();
        step(&mut bus, ms);
        f32::from(sent(&mut bus)[0].1[0]) * 24.0 / 25_000.0
    };
    assert!((towards(350.0, 10.0) - 20.0_f32.to_radians()).abs() < 2e-3);
    assert!((towards(10.0, 350.0) + 20.0_f32.to_radians()).abs() < 2e-3);
}

#[test]
fn an_absolute_angle_of_a_geared_motor_needs_a_zero() {
    let config = Config::<M3508>::at_once(1).position_loop(PidConfig::new(1.0, 0.0, 0.0), SPEED);
    let (mut bus, [joint]) = armed([config]);
    bus.set_velocity(joint, AngularVelocity::from_rad_per_s(5.0)).unwrap();
    step(&mut bus, 1);
    assert_ne!(sent(&mut bus), [(0x200, [0; 4])]);
    assert_eq!(bus.set_angle(joint, Angle::ZERO), Err(TargetError::NotHomed));
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [0; 4])], "the velocity before it is gone too");
    assert_eq!(bus.set_position(joint, Position::from_turns(2)), Ok(()));
    step(&mut bus, 3);
    assert_ne!(sent(&mut bus), [(0x200, [0; 4])]);
    bus.zero(joint).unwrap();
    step(&mut bus, 4);
    assert_eq!(sent(&mut bus), [(0x200, [0; 4])], "the old target is gone");
    assert_eq!(bus.set_angle(joint, Angle::ZERO), Ok(()));
}

#[test]
fn a_target_without_its_loop_is_an_error() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    assert_eq!(bus.set_velocity(wheel, AngularVelocity::ZERO), Err(TargetError::NoLoop));
    assert_eq!(bus.set_position(wheel, Position::ZERO), Err(TargetError::NoLoop));
    assert_eq!(
        bus.set_speed_loop(wheel, SPEED),
        Err(ConfigError::Unusable("handle of a motor without this loop"))
    );
}

#[test]
fn a_target_is_renewed_by_a_handle_of_its_motor_alone_and_while_the_motor_is_heard() {
    type Ask = fn(&mut Bus, Handle<M3508>) -> Result<(), TargetError>;
    let asks: [Ask; 2] = [
        |bus, wheel| bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(5.0)),
        |bus, wheel| bus.set_position(wheel, Position::from_turns(1)),
    ];
    for ask in asks {
        let config = Config::<M3508>::at_once(1).position_loop(SPEED, SPEED);
        let (mut bus, [old]) = armed([config]);
        bus.detach(old);
        let new = bus.attach(config).unwrap();
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(2)), Ingest::Taken);
        bus.arm(at_ms(2)).unwrap();
        assert_eq!([ask(&mut bus, new), ask(&mut bus, new)], [Ok(()); 2]);
        assert_eq!(ask(&mut bus, old), Err(TargetError::Detached));
        for ms in 3..20 {
            step(&mut bus, ms);
        }
        assert_eq!(bus.link(new), Some(Link::Late));
        assert_eq!(ask(&mut bus, new), Err(TargetError::NoFeedback));
    }
}

#[test]
fn gains_change_while_running() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
    bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(4.0)).unwrap();
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [3277, 0, 0, 0])]);
    bus.set_speed_loop(wheel, PidConfig::new(2.0, 0.0, 0.0)).unwrap();
    let error = bus.set_speed_loop(wheel, PidConfig::new(1.0, f32::NAN, 0.0)).unwrap_err();
    assert_eq!(error, ConfigError::Negative("ki"));
    bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(4.0)).unwrap();
    for ms in 3..50 {
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
        step(&mut bus, ms);
    }
    let raw = sent(&mut bus)[0].1[0];
    assert!((3277..=6554).contains(&raw), "between the old and the new gain: {raw}");
}

#[test]
fn the_angle_that_steers_is_known_while_the_motor_is_heard_and_homed() {
    use crate::motor::AngleDrive;
    let loops = |config: Config<Gm6020Voltage>| config.position_loop(SPEED, SPEED);
    let (mut bus, [module]) = armed([loops(Config::at_once(1))]);
    assert_eq!(bus.ingest(&feedback(0x205, 2048, 0), at_ms(2)), Ingest::Taken);
    assert!(AngleDrive::angle(&bus, module).is_some_and(|a| (a.as_degrees() - 90.0).abs() < 1e-3));
    AngleDrive::set_angle(&mut bus, AnyHandle::from(module), Angle::from_degrees(91.0)).unwrap();
    step(&mut bus, 3);
    assert!(sent(&mut bus)[0].1[0] > 0);
    step(&mut bus, 500);
    assert_eq!(AngleDrive::angle(&bus, module), None); // silent

    let (mut bus, [geared]) = armed([Config::<M2006>::at_once(1).position_loop(SPEED, SPEED)]);
    assert_eq!(AngleDrive::angle(&bus, geared), None);
    let refused = AngleDrive::set_angle(&mut bus, geared, Angle::ZERO);
    assert_eq!(refused, Err(TargetError::NotHomed));
    bus.zero(geared).unwrap();
    assert!(AngleDrive::angle(&bus, AnyHandle::from(geared)).is_some());
}

/// A motor as the generic parts know it: by its own handle, and by one that does not tell the model.
#[test]
fn a_drive_tells_and_takes_velocities_and_angles_by_either_handle() {
    use crate::motor::{AngleDrive, Capability, VelocityDrive};
    fn check<H: Copy>(bus: &mut Bus, motor: H, ms: u64)
    where
        Bus: VelocityDrive<H> + AngleDrive<H>,
    {
        assert_eq!(bus.ingest(&feedback(0x205, 1_024, 30), at_ms(ms)), Ingest::Taken);
        let velocity = VelocityDrive::velocity(bus, motor).unwrap();
        assert!((velocity.as_rpm() - 30.0).abs() < 1e-3, "{velocity:?}");
        let angle = AngleDrive::angle(bus, motor).unwrap();
        assert!((angle.as_degrees() - 45.0).abs() < 1e-3, "{angle:?}");
        assert!(VelocityDrive::capabilities(bus, motor).has(Capability::AbsoluteAngle));
        let target = velocity + AngularVelocity::from_rad_per_s(2.4);
        VelocityDrive::set_velocity(bus, motor, target).unwrap();
        step(bus, ms);
        assert_eq!(sent(bus)[0].1[0], 2_500, "2.4 V of 24");
        VelocityDrive::set_velocity(bus, motor, velocity).unwrap();
        step(bus, ms + 1);
        assert_eq!(sent(bus)[0].1[0], 0);
    }
    let config = Config::<Gm6020Voltage>::at_once(1).position_loop(SPEED, SPEED);
    let (mut bus, [yaw]) = armed([config]);
    check(&mut bus, yaw, 2);
    check(&mut bus, yaw.erase(), 4);
    step(&mut bus, 500);
    assert_eq!(VelocityDrive::velocity(&bus, yaw), None, "silent");
    assert_eq!(VelocityDrive::velocity(&bus, yaw.erase()), None, "silent");
}

/// M3508 without load: 9256 rpm of the rotor, 50.47 rad/s behind 3591 to 187.
#[test]
fn a_position_loop_asks_for_no_more_than_the_motor_runs_without_load_nor_than_it_was_told() {
    let speed = PidConfig::new(0.1, 0.0, 0.0); // A per rad/s
    let strong = PidConfig::new(1_000.0, 0.0, 0.0);
    for (range, forward, backward) in [
        ((f32::MIN, f32::MAX), 50.474, -50.474),
        ((-60.0, 60.0), 50.474, -50.474),
        ((-20.0, 30.0), 30.0, -20.0),
    ] {
        let position = strong.with_output_range(range.0, range.1);
        let (mut bus, [joint]) =
            armed([Config::<M3508>::at_once(1).position_loop(position, speed)]);
        for again in [false, true] {
            for (ms, turns, rad_per_s) in [(2, 9, forward), (3, -9, backward)] {
                bus.set_position(joint, Position::from_turns(turns)).unwrap();
                bus.update(Tick::new(at_ms(ms + 2 * u64::from(again)), 0.001));
                let amperes = f32::from(sent(&mut bus)[0].1[0]) * 20.0 / 16_384.0;
                assert!((amperes - 0.1 * rad_per_s).abs() < 1e-3, "{amperes} A in {range:?}");
            }
            bus.set_position_loop(joint, position).unwrap();
        }
    }
}

#[test]
fn a_position_loop_changes_while_the_motor_runs_or_says_why_not() {
    let loops = |kp| PidConfig::new(kp, 0.0, 0.0);
    let (mut bus, [joint]) = armed([Config::<M3508>::at_once(1).position_loop(loops(1.0), SPEED)]);
    let wrong = bus.set_position_loop(joint, loops(f32::NAN)).unwrap_err();
    assert_eq!(wrong.to_string(), "kp: must be zero or more, and finite");
    bus.set_position(joint, Position::from_turns(1)).unwrap();
    step(&mut bus, 2);
    let before = sent(&mut bus)[0].1[0];
    bus.set_position_loop(joint, loops(2.0)).unwrap();
    bus.relax(joint);
    bus.set_position(joint, Position::from_turns(1)).unwrap();
    step(&mut bus, 3);
    let after = sent(&mut bus)[0].1[0];
    assert!((after - 2 * before).abs() <= 1, "{before}, then {after}");
    bus.detach(joint);
    let detached = bus.set_position_loop(joint, loops(1.0)).unwrap_err();
    assert_eq!(detached.to_string(), "handle of a detached motor is not usable");
    let wheel = bus.attach(Config::<M3508>::at_once(2).speed_loop(SPEED)).unwrap();
    let without = bus.set_position_loop(wheel, loops(1.0)).unwrap_err();
    assert_eq!(without.to_string(), "handle of a motor without this loop is not usable");
}
