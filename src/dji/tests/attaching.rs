use super::*;
use crate::motor::VelocityDrive;

#[test]
fn ids_outside_of_the_model_are_rejected() {
    let mut bus = Bus::new();
    for id in [0, 9, 255] {
        assert!(matches!(
            bus.attach(Config::<M3508>::at_once(id)),
            Err(AttachError::Id { highest: 8, .. })
        ));
        assert!(matches!(
            bus.attach(Config::<M2006>::at_once(id)),
            Err(AttachError::Id { highest: 8, .. })
        ));
    }
    for id in [0, 8, 255] {
        assert!(matches!(
            bus.attach(Config::<Gm6020Voltage>::at_once(id)),
            Err(AttachError::Id { highest: 7, .. })
        ));
        assert!(matches!(
            bus.attach(Config::<Gm6020Current>::at_once(id)),
            Err(AttachError::Id { highest: 7, .. })
        ));
    }
    assert_eq!(bus.motors().count(), 0);
}

#[test]
fn c620_5_with_gm6020_current_1_is_rejected_naming_0x205_and_both() {
    let mut bus = Bus::new();
    bus.attach(Config::<M3508>::at_once(5)).unwrap();
    let error = bus.attach(Config::<Gm6020Current>::at_once(1)).unwrap_err();
    assert_eq!(error.to_string(), "GM6020 (current) #1 collides with M3508 #5 on 0x205");
    let error = bus.attach(Config::<Gm6020Voltage>::at_once(1)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "GM6020 (voltage) #1 collides with M3508 #5 on 0x205 and on slot 0 of 0x1FF"
    );
    let error = bus.attach(Config::<M2006>::at_once(5)).unwrap_err();
    assert!(error.to_string().starts_with("M2006 #5 collides with M3508 #5"));
}

#[test]
fn eight_c620_and_three_gm6020_share_a_bus() {
    let mut bus = Bus::new();
    bus.attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(Config::<M3508>::at_once)).unwrap();
    bus.attach_all([5, 6, 7].map(Config::<Gm6020Voltage>::at_once)).unwrap();
    assert_eq!(bus.motors().count(), 11);
    assert_eq!(bus.clash(), None);
}

#[test]
fn an_array_is_attached_whole_or_not_at_all() {
    let mut bus = Bus::new();
    bus.attach(Config::<M2006>::at_once(3)).unwrap();
    assert!(bus.attach_all([1, 2, 3].map(Config::<M3508>::at_once)).is_err());
    assert_eq!(bus.motors().map(|(_, name)| name.to_string()).collect::<Vec<_>>(), ["M2006 #3"]);
}

#[test]
fn a_parameter_that_is_not_usable_is_named() {
    let mut bus = Bus::new();
    let wheel = Config::<M3508>::at_once(1);
    for limit in [0.0, -1.0, 20.1, f32::NAN, f32::INFINITY] {
        let error = bus.attach(wheel.with_current_limit(Current::from_amperes(limit))).unwrap_err();
        assert_eq!(error.to_string(), "M3508 #1: command limit is not usable");
    }
    for nm_per_a in [0.0, -0.3, f32::NAN, f32::INFINITY] {
        let error = bus.attach(wheel.with_torque_constant(nm_per_a)).unwrap_err();
        assert_eq!(error.to_string(), "M3508 #1: torque constant is not usable");
    }
    let yaw = Config::<Gm6020Voltage>::at_once(1).with_nominal_voltage(Voltage::from_volts(0.0));
    assert_eq!(
        bus.attach(yaw).unwrap_err().to_string(),
        "GM6020 (voltage) #1: nominal voltage is not usable"
    );
    let error = bus.attach(wheel.speed_loop(PidConfig::new(f32::NAN, 0.0, 0.0))).unwrap_err();
    assert_eq!(error.to_string(), "M3508 #1: kp is not usable");
}

#[test]
fn a_detached_handle_finds_nothing_even_when_the_place_is_taken_again() {
    let (mut bus, [old]) = armed([Config::<M3508>::at_once(1)]);
    bus.detach(old);
    let new = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    assert!(bus.state(old).is_none());
    assert_eq!(bus.set_current(old, Current::from_amperes(1.0)), Err(TargetError::Detached));
    assert_ne!(old.erase(), new.erase());
    for _ in 0..20 {
        bus.motors()
            .map(|(motor, _)| motor)
            .collect::<Vec<_>>()
            .into_iter()
            .for_each(|motor| bus.detach(motor));
        let again = bus.attach(Config::<M3508>::at_once(1));
        assert!(again.is_ok_and(|again| again.erase() != old.erase()) || again.is_err());
    }
    assert!(matches!(bus.attach(Config::<M3508>::at_once(1)), Err(AttachError::WornOut { .. })));
}

#[test]
fn detaching_in_operation_sends_one_frame_with_zero() {
    let (mut bus, [first, second]) = armed([1, 2].map(Config::<M3508>::at_once));
    bus.set_raw(first, 100).unwrap();
    bus.set_raw(second, 200).unwrap();
    step(&mut bus, 2);
    assert_eq!(sent(&mut bus), [(0x200, [100, 200, 0, 0])]);
    bus.detach(first);
    step(&mut bus, 3);
    assert_eq!(sent(&mut bus), [(0x200, [0, 200, 0, 0])]);
    bus.detach(second);
    assert_eq!(sent(&mut bus), [(0x200, [0, 0, 0, 0])]);
    for ms in 4..30 {
        step(&mut bus, ms);
    }
    assert_eq!(sent(&mut bus), []);
}

#[test]
fn a_bus_is_built_in_a_static_and_a_handle_is_one_byte() {
    static BUS: Bus = Bus::new();
    assert_eq!(BUS.motors().count(), 0);
    assert!(size_of::<Handle<M3508>>() == 1);
}

#[test]
fn a_frame_goes_on_as_long_as_one_of_its_motors_is_attached() {
    let mut bus: Bus = Bus::new().with_keep_alive(Duration::from_millis(1));
    let [one, two, five] = bus.attach_all([1, 2, 5].map(Config::<M3508>::at_once)).unwrap();
    let round = |bus: &mut Bus, ms| {
        step(bus, ms);
        let mut ids: Vec<_> = sent(bus).into_iter().map(|(id, _)| id).collect();
        ids.sort_unstable();
        ids
    };
    assert_eq!(round(&mut bus, 1), [0x1FF, 0x200]);
    bus.detach(one);
    bus.detach(five);
    assert_eq!(round(&mut bus, 2), [0x1FF, 0x200], "one last frame of zeros");
    assert_eq!(round(&mut bus, 3), [0x200]);
    bus.detach(two);
    assert_eq!(round(&mut bus, 4), [0x200]);
    assert_eq!(round(&mut bus, 5), [0_u32; 0]);
}

#[test]
fn handles_are_equal_when_they_are_of_one_motor_and_say_which() {
    let mut bus: Bus = Bus::new();
    let [one, two] = bus.attach_all([1, 2].map(Config::<M3508>::at_once)).unwrap();
    let same = one;
    assert!(one == same && one != two);
    assert!(one.erase() == one.into() && one.erase() != two.erase());
    assert_eq!(std::format!("{two:?}"), "Handle(M3508 in slot 1)");
    assert_eq!(std::format!("{:?}", two.erase()), "AnyHandle(slot 1)");
}

/// A key holds the place and how often it was taken.
#[test]
fn a_place_that_was_taken_before_is_armed_and_measured_as_a_new_one() {
    let mut bus: Bus = Bus::new();
    let other = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    let mut wheel = bus.attach(Config::<M3508>::at_once(3)).unwrap();
    for _ in 0..3 {
        bus.detach(wheel);
        wheel = bus.attach(Config::<M3508>::at_once(3)).unwrap();
    }
    assert_eq!(VelocityDrive::velocity(&bus, wheel), None);
    for id in [0x201, 0x203] {
        assert_eq!(bus.ingest(&feedback(id, 0, 1_920), at_ms(1)), Ingest::Taken);
    }
    bus.arm_only(&[wheel.erase()], at_ms(1)).unwrap();
    assert!(bus.is_motor_armed(wheel) && !bus.is_motor_armed(other));
    let rpm = VelocityDrive::velocity(&bus, wheel).unwrap().as_rpm();
    assert!((rpm - 1_920.0 * 187.0 / 3591.0).abs() < 0.01, "{rpm}");
    bus.update(Tick::new(at_ms(500), 0.001));
    assert_eq!(VelocityDrive::velocity(&bus, wheel), None, "lost");
}

/// The place of one that is refused with others was taken before, and its old handle is still somewhere.
#[test]
fn an_array_that_is_refused_revives_no_handle_of_before() {
    let mut bus: Bus = Bus::new();
    let old = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    bus.detach(old);
    bus.attach(Config::<M3508>::at_once(2)).unwrap();
    assert!(bus.attach_all([1, 2].map(Config::<M3508>::at_once)).is_err());
    let new = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    assert!(old != new && bus.link(old).is_none() && bus.link(new).is_some());
}
