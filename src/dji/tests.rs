//! Rules of the bus, driven through its public face.

use super::*;
use crate::control::PidConfig;
use crate::encoder::{Homing, Position};
use crate::frame::CanFrame;
use crate::motor::{ArmError, CanDevice, Ingest, Link, Malformed, Recovery, TargetError, Timeouts};
use crate::time::{Duration, Instant, Tick};
use crate::units::{Angle, AngularVelocity, Current, Voltage};
use embedded_can::{ExtendedId, Frame, StandardId};
use std::string::ToString;
use std::vec::Vec;

const SPEED: PidConfig = PidConfig::new(1.0, 0.0, 0.0);

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1_000)
}

fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    CanFrame::standard(id, [a, b, c, d, 0, 0, 25, 0]).unwrap()
}

fn step(bus: &mut Bus, ms: u64) {
    bus.update(Tick::new(at_ms(ms), 0.001));
}

fn sent(bus: &mut Bus) -> Vec<(u32, [i16; 4])> {
    let words = |frame: CanFrame| {
        let [a, b, c, d, e, f, g, h] = *frame.bytes();
        [[a, b], [c, d], [e, f], [g, h]].map(i16::from_be_bytes)
    };
    core::iter::from_fn(|| bus.next_frame()).map(|frame| (frame.header(), words(frame))).collect()
}

/// A bus with these motors heard at 1 ms and armed.
fn armed<M: Model, const N: usize>(configs: [Config<M>; N]) -> (Bus, [Handle<M>; N]) {
    let mut bus = Bus::new();
    let base = M::FACTS.feedback_base;
    let ids = configs.map(|config| base + u16::from(config.id()));
    let handles = bus.attach_all(configs).unwrap();
    for id in ids {
        assert_eq!(bus.ingest(&feedback(id, 0, 0), at_ms(1)), Ingest::Taken);
    }
    bus.arm(at_ms(1)).unwrap();
    (bus, handles)
}

mod attaching {
    use super::*;

    #[test]
    fn ids_outside_of_the_model_are_rejected() {
        let mut bus = Bus::new();
        for id in [0, 9, 255] {
            assert!(matches!(
                bus.attach(Config::<M3508>::new(id)),
                Err(AttachError::Id { highest: 8, .. })
            ));
            assert!(matches!(
                bus.attach(Config::<M2006>::new(id)),
                Err(AttachError::Id { highest: 8, .. })
            ));
        }
        for id in [0, 8, 255] {
            assert!(matches!(
                bus.attach(Config::<Gm6020Voltage>::new(id)),
                Err(AttachError::Id { highest: 7, .. })
            ));
            assert!(matches!(
                bus.attach(Config::<Gm6020Current>::new(id)),
                Err(AttachError::Id { highest: 7, .. })
            ));
        }
        assert_eq!(bus.motors().count(), 0);
    }

    #[test]
    fn c620_5_with_gm6020_current_1_is_rejected_naming_0x205_and_both() {
        let mut bus = Bus::new();
        bus.attach(Config::<M3508>::new(5)).unwrap();
        let error = bus.attach(Config::<Gm6020Current>::new(1)).unwrap_err();
        assert_eq!(error.to_string(), "GM6020 (current) #1 collides with M3508 #5 on 0x205");
        let error = bus.attach(Config::<Gm6020Voltage>::new(1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "GM6020 (voltage) #1 collides with M3508 #5 on 0x205 and on slot 0 of 0x1FF"
        );
        let error = bus.attach(Config::<M2006>::new(5)).unwrap_err();
        assert!(error.to_string().starts_with("M2006 #5 collides with M3508 #5"));
    }

    #[test]
    fn eight_c620_and_three_gm6020_share_a_bus() {
        let mut bus = Bus::new();
        bus.attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(Config::<M3508>::new)).unwrap();
        bus.attach_all([5, 6, 7].map(Config::<Gm6020Voltage>::new)).unwrap();
        assert_eq!(bus.motors().count(), 11);
        assert_eq!(bus.clash(), None);
    }

    #[test]
    fn an_array_is_attached_whole_or_not_at_all() {
        let mut bus = Bus::new();
        bus.attach(Config::<M2006>::new(3)).unwrap();
        assert!(bus.attach_all([1, 2, 3].map(Config::<M3508>::new)).is_err());
        assert_eq!(
            bus.motors().map(|(_, name)| name.to_string()).collect::<Vec<_>>(),
            ["M2006 #3"]
        );
    }

    #[test]
    fn a_parameter_that_is_not_usable_is_named() {
        let mut bus = Bus::new();
        let wheel = Config::<M3508>::new(1);
        for limit in [0.0, -1.0, 20.1, f32::NAN, f32::INFINITY] {
            let error =
                bus.attach(wheel.with_current_limit(Current::from_amperes(limit))).unwrap_err();
            assert_eq!(error.to_string(), "M3508 #1: command limit is not usable");
        }
        let error = bus.attach(wheel.with_torque_constant(f32::NAN)).unwrap_err();
        assert_eq!(error.to_string(), "M3508 #1: torque constant is not usable");
        let yaw = Config::<Gm6020Voltage>::new(1).with_nominal_voltage(Voltage::from_volts(0.0));
        assert_eq!(
            bus.attach(yaw).unwrap_err().to_string(),
            "GM6020 (voltage) #1: nominal voltage is not usable"
        );
        let error = bus.attach(wheel.speed_loop(PidConfig::new(f32::NAN, 0.0, 0.0))).unwrap_err();
        assert_eq!(error.to_string(), "M3508 #1: kp is not usable");
    }

    #[test]
    fn a_detached_handle_finds_nothing_even_when_the_place_is_taken_again() {
        let (mut bus, [old]) = armed([Config::<M3508>::new(1)]);
        bus.detach(old);
        let new = bus.attach(Config::<M3508>::new(1)).unwrap();
        assert!(bus.state(old).is_none());
        assert_eq!(bus.set_current(old, Current::from_amperes(1.0)), Err(TargetError::Detached));
        assert_ne!(old.erase(), new.erase());
        for _ in 0..20 {
            bus.motors()
                .map(|(motor, _)| motor)
                .collect::<Vec<_>>()
                .into_iter()
                .for_each(|motor| bus.detach(motor));
            let again = bus.attach(Config::<M3508>::new(1));
            assert!(again.is_ok_and(|again| again.erase() != old.erase()) || again.is_err());
        }
        assert!(matches!(bus.attach(Config::<M3508>::new(1)), Err(AttachError::WornOut { .. })));
    }

    #[test]
    fn detaching_in_operation_sends_one_frame_with_zero() {
        let (mut bus, [first, second]) = armed([1, 2].map(Config::<M3508>::new));
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
}

mod receiving {
    use super::*;

    #[test]
    fn wrong_lengths_remote_and_extended_frames_are_ignored_and_counted() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        let id = StandardId::new(0x201).unwrap();
        for length in 0..8 {
            let short = CanFrame::new(id, &[0; 8][..length]).unwrap();
            let outcome = bus.ingest(&short, at_ms(1));
            assert_eq!(
                outcome,
                Ingest::Malformed(Malformed::Length(u8::try_from(length).unwrap()))
            );
        }
        let remote = CanFrame::new_remote(id, 8).unwrap();
        let extended = CanFrame::new(ExtendedId::new(0x201).unwrap(), &[0; 8]).unwrap();
        assert_eq!(bus.ingest(&remote, at_ms(1)), Ingest::Unrelated);
        assert_eq!(bus.ingest(&extended, at_ms(1)), Ingest::Unrelated);
        assert_eq!(
            bus.ingest(&feedback(0x201, 8192, 0), at_ms(1)),
            Ingest::Malformed(Malformed::Field)
        );
        assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(1)), Ingest::Unrelated);
        let counters = bus.counters();
        assert_eq!((counters.bad_length, counters.bad_field, counters.unattached), (8, 1, 1));
        assert_eq!((bus.state(wheel), bus.link(wheel)), (None, Some(Link::Unheard)));
    }

    #[test]
    fn the_router_is_total_over_all_ids_and_lengths() {
        let mut bus = Bus::new();
        bus.attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(Config::<M3508>::new)).unwrap();
        bus.attach_all([5, 6, 7].map(Config::<Gm6020Voltage>::new)).unwrap();
        for raw in 0..=0x7FF {
            for length in 0..=8 {
                let frame =
                    CanFrame::new(StandardId::new(raw).unwrap(), &[0; 8][..length]).unwrap();
                let outcome = bus.ingest(&frame, at_ms(1));
                match (raw, length) {
                    (0x201..=0x20B, 8) => assert_eq!(outcome, Ingest::Taken),
                    (0x201..=0x20B, _) => assert!(matches!(outcome, Ingest::Malformed(_))),
                    _ => assert_eq!(outcome, Ingest::Unrelated),
                }
            }
        }
    }

    #[test]
    fn state_is_at_the_output_shaft_in_physical_units() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(4)).unwrap();
        let frame =
            CanFrame::standard(0x204, [0x1F, 0xFF, 0x24, 0x28, 0xE0, 0x00, 0x3C, 0x00]).unwrap();
        assert_eq!(bus.ingest(&frame, at_ms(1)), Ingest::Taken);
        let state = bus.state(wheel).unwrap();
        assert!((state.velocity.as_rpm() - 482.002_78).abs() < 1e-3);
        assert_eq!(state.current, Current::from_amperes(-10.0));
        assert!((state.torque_nm + 3.0).abs() < 1e-6);
        assert_eq!((state.temperature_c, state.error, state.rotor_counts), (Some(60), None, 8191));
        assert_eq!(state.homing, Homing::Relative);
    }

    #[test]
    fn c610_has_no_temperature_and_its_own_error_list() {
        let mut bus = Bus::new();
        let feeder = bus.attach(Config::<M2006>::new(5)).unwrap();
        let frame =
            CanFrame::standard(0x205, [0x10, 0x00, 0xB9, 0xB0, 0x13, 0x88, 0x00, 0x03]).unwrap();
        assert_eq!(bus.ingest(&frame, at_ms(1)), Ingest::Taken);
        let state = bus.state(feeder).unwrap();
        assert!((state.velocity.as_rpm() + 500.0).abs() < 1e-3);
        assert_eq!((state.current, state.temperature_c), (Current::from_amperes(5.0), None));
        assert_eq!(state.error, Some(ErrorCode::PhaseLoss));
    }

    #[test]
    fn a_reversed_motor_turns_everything_around() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1).reversed()).unwrap();
        for (ms, angle) in [(1, 0), (2, 1000)] {
            let frame = CanFrame::standard(0x201, {
                let [a, b] = u16::to_be_bytes(angle);
                [a, b, 0x17, 0x70, 0x10, 0x00, 0, 0]
            });
            assert_eq!(bus.ingest(&frame.unwrap(), at_ms(ms)), Ingest::Taken);
        }
        let state = bus.state(wheel).unwrap();
        assert!(state.velocity.as_rpm() < -312.0 && state.torque_nm < 0.0);
        assert_eq!((state.rotor_counts, state.position.turns()), (-1000, -1));
    }

    #[test]
    fn five_lost_frames_at_9000_rpm_are_resolved_with_the_speed() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        let mut true_counts = 0_i64;
        for ms in 1..2_000_u64 {
            true_counts += 1229;
            if ms % 50 >= 5 {
                let angle = u16::try_from(true_counts.rem_euclid(8192)).unwrap();
                assert_eq!(bus.ingest(&feedback(0x201, angle, 9001), at_ms(ms)), Ingest::Taken);
            }
        }
        let first = 1229 * 5;
        let state = bus.state(wheel).unwrap();
        assert_eq!(state.rotor_counts - first % 8192, true_counts - first);
        assert_eq!(state.ambiguous_gaps, 0);
    }

    #[test]
    fn a_gap_that_cannot_be_resolved_is_flagged_and_unhomes() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        assert_eq!(bus.ingest(&feedback(0x201, 0, 9000), at_ms(1)), Ingest::Taken);
        bus.zero(wheel).unwrap();
        assert_eq!(bus.state(wheel).unwrap().homing, Homing::Homed);
        assert_eq!(bus.ingest(&feedback(0x201, 17, 9000), at_ms(81)), Ingest::Taken);
        let state = bus.state(wheel).unwrap();
        assert_eq!((state.ambiguous_gaps, state.homing), (1, Homing::Uncertain));
    }

    #[test]
    fn frames_of_one_motor_are_handled_in_order() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        // 64 frames at once, after a stall of the loop: half a turn back and forth, and on.
        for step in 0..64_u16 {
            let angle = if step % 2 == 0 { step } else { step + 4000 };
            assert_eq!(bus.ingest(&feedback(0x201, angle, 0), at_ms(70)), Ingest::Taken);
        }
        let state = bus.state(wheel).unwrap();
        assert_eq!((state.rotor_counts, state.feedback.angle()), (4063, 4063));
    }

    #[test]
    fn two_buses_share_no_state() {
        let (mut left, [wheel]) = armed([Config::<M3508>::new(1)]);
        let (mut right, [other]) = armed([Config::<M3508>::new(1)]);
        left.set_raw(wheel, 500).unwrap();
        step(&mut left, 2);
        step(&mut right, 2);
        assert_eq!(sent(&mut left), [(0x200, [500, 0, 0, 0])]);
        assert_eq!(sent(&mut right), [(0x200, [0; 4])]); // its first keep-alive
        assert_eq!(right.state(other).unwrap().rotor_counts, 0);
    }
}

mod commanding {
    use super::*;

    #[test]
    fn one_ampere_is_the_raw_value_of_each_model() {
        fn raw_of<M: CurrentControlled>(amperes: f32) -> i16 {
            let (mut bus, [motor]) = armed([Config::<M>::new(1)]);
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
            (Config::<Gm6020Voltage>::new(5), 25_000),
            (Config::<Gm6020Voltage>::new(5).with_legacy_full_scale(), 30_000),
            (
                Config::<Gm6020Voltage>::new(5).with_nominal_voltage(Voltage::from_volts(25.2)),
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
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1).reversed()]);
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
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        let feeder = bus.attach(Config::<M2006>::new(2)).unwrap();
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
        let (mut bus, [first, _, third]) = armed([1, 2, 3].map(Config::<M3508>::new));
        bus.set_raw(first, 11).unwrap();
        bus.set_raw(third, 33).unwrap();
        step(&mut bus, 2);
        assert_eq!(sent(&mut bus), [(0x200, [11, 0, 33, 0])]);
    }

    #[test]
    fn limits_hold_for_direct_commands_and_for_loops() {
        let limit = Current::from_amperes(2.0);
        let config = Config::<M3508>::new(1)
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
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1).speed_loop(SPEED)]);
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
            Config::<Gm6020Voltage>::new(1).position_loop(PidConfig::new(1.0, 0.0, 0.0), SPEED);
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
        let config = Config::<M3508>::new(1).position_loop(PidConfig::new(1.0, 0.0, 0.0), SPEED);
        let (mut bus, [joint]) = armed([config]);
        assert_eq!(bus.set_angle(joint, Angle::ZERO), Err(TargetError::NotHomed));
        assert_eq!(bus.set_position(joint, Position::from_turns(2)), Ok(()));
        bus.zero(joint).unwrap();
        step(&mut bus, 2);
        assert_eq!(sent(&mut bus), [(0x200, [0; 4])], "the old target is gone");
        assert_eq!(bus.set_angle(joint, Angle::ZERO), Ok(()));
    }

    #[test]
    fn a_target_without_its_loop_is_an_error() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1)]);
        assert_eq!(bus.set_velocity(wheel, AngularVelocity::ZERO), Err(TargetError::NoLoop));
        assert_eq!(bus.set_position(wheel, Position::ZERO), Err(TargetError::NoLoop));
        assert_eq!(bus.set_speed_loop(wheel, SPEED), Err(LoopError::NoLoop));
    }

    #[test]
    fn gains_change_while_running() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1).speed_loop(SPEED)]);
        bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(4.0)).unwrap();
        step(&mut bus, 2);
        assert_eq!(sent(&mut bus), [(0x200, [3277, 0, 0, 0])]);
        bus.set_speed_loop(wheel, PidConfig::new(2.0, 0.0, 0.0)).unwrap();
        let error = bus.set_speed_loop(wheel, PidConfig::new(1.0, f32::NAN, 0.0)).unwrap_err();
        assert_eq!(error, LoopError::Parameter("ki"));
        bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(4.0)).unwrap();
        for ms in 3..50 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            step(&mut bus, ms);
        }
        let raw = sent(&mut bus)[0].1[0];
        assert!((3277..=6554).contains(&raw), "between the old and the new gain: {raw}");
    }
}

mod safety {
    use super::*;

    #[test]
    fn a_clock_that_goes_back_neither_latches_nor_revives_a_motor() {
        let (mut bus, [heard, silent]) = armed([1, 2].map(Config::<M3508>::new));
        let hear = |bus: &mut Bus, id, ms| {
            assert_eq!(bus.ingest(&feedback(id, 0, 0), at_ms(ms)), Ingest::Taken)
        };
        for ms in 2..2_005 {
            hear(&mut bus, 0x201, ms);
            hear(&mut bus, 0x202, ms);
            step(&mut bus, ms);
        }
        // One second back: that step is held, and the old stamps lie ahead, which is not fresh.
        step(&mut bus, 999);
        step(&mut bus, 1_000);
        assert_eq!((bus.link(heard), bus.link(silent)), (Some(Link::Late), Some(Link::Late)));
        for ms in 1_001..1_300 {
            hear(&mut bus, 0x201, ms);
            bus.set_raw(heard, 300).unwrap();
            assert_eq!(bus.set_raw(silent, 300), Err(TargetError::NoFeedback));
            step(&mut bus, ms);
            assert_eq!(sent(&mut bus).last(), Some(&(0x200, [300, 0, 0, 0])));
        }
        assert_eq!(bus.state(heard).unwrap().ambiguous_gaps, 0);
    }

    #[test]
    fn a_frame_stamped_after_the_tick_read_its_clock_is_fresh() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1)]);
        let at = Instant::from_micros;
        for us in (2_000..50_000).step_by(1_000) {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at(us + 300)), Ingest::Taken);
            bus.set_raw(wheel, 300).unwrap();
            bus.update(Tick::new(at(us), 0.001));
            assert_eq!(sent(&mut bus), [(0x200, [300, 0, 0, 0])]);
        }
    }

    #[test]
    fn feedback_that_returns_after_being_late_makes_no_derivative_spike() {
        let config = Config::<M3508>::new(1).speed_loop(PidConfig::new(0.0, 0.0, 0.05));
        let (mut bus, [wheel]) = armed([config]);
        let turning = |ms: u64| feedback(0x201, 0, if ms < 40 { 0 } else { 9_000 });
        for ms in 2..60 {
            if !(10..40).contains(&ms) {
                assert_eq!(bus.ingest(&turning(ms), at_ms(ms)), Ingest::Taken);
            }
            _ = bus.set_velocity(wheel, AngularVelocity::ZERO);
            step(&mut bus, ms);
            assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]), "at {ms} ms");
        }
    }

    #[test]
    fn arming_again_does_not_disturb_the_motors_that_run() {
        let (mut bus, [first, second]) = armed([1, 2].map(Config::<M3508>::new));
        for ms in 2..150 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            bus.set_raw(first, 500).unwrap();
            step(&mut bus, ms);
        }
        assert!(!bus.is_armed() && bus.is_motor_armed(first) && !bus.is_motor_armed(second));
        for ms in 150..160 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(ms)), Ingest::Taken);
        }
        bus.arm(at_ms(160)).unwrap();
        step(&mut bus, 160);
        assert_eq!(sent(&mut bus)[0], (0x200, [500, 0, 0, 0]), "the first keeps its target");
        assert!(bus.is_armed());
    }

    #[test]
    fn engaging_arms_neither_the_unheard_nor_under_an_emergency_stop() {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        bus.engage(at_ms(1));
        assert!(!bus.is_motor_armed(wheel));
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(1)), Ingest::Taken);
        bus.emergency_stop();
        bus.engage(at_ms(1));
        assert!(!bus.is_motor_armed(wheel));
    }

    #[test]
    fn a_position_is_zeroed_only_while_the_motor_is_heard() {
        let mut bus = Bus::new();
        let joint = bus.attach(Config::<M3508>::new(1)).unwrap();
        assert_eq!(bus.zero(joint), Err(TargetError::NoFeedback));
        assert_eq!(bus.ingest(&feedback(0x201, 5000, 0), at_ms(1)), Ingest::Taken);
        assert_eq!(bus.zero(joint), Ok(()));
        let nan = Position::from_angle(Angle::from_radians(f32::NAN));
        assert_eq!(bus.set_present_position(joint, nan), Err(TargetError::NotFinite));
        assert_eq!(bus.state(joint).unwrap().rotor_counts, 0);
    }

    #[test]
    fn nothing_moves_before_it_is_armed_and_the_missing_are_named() {
        let mut bus = Bus::new();
        assert_eq!(bus.arm(at_ms(1)), Err(ArmError::NoMotors));
        let [first, _] = bus.attach_all([1, 2].map(Config::<M3508>::new)).unwrap();
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(1)), Ingest::Taken);
        assert_eq!(bus.set_raw(first, 1000), Err(TargetError::Disarmed));
        assert_eq!(bus.arm(at_ms(2)).unwrap_err().to_string(), "no feedback from M3508 #2");
        step(&mut bus, 2);
        assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]));
        assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(2)), Ingest::Taken);
        assert_eq!(bus.arm(at_ms(2)), Ok(()));
        assert_eq!(
            bus.arm(at_ms(500)).unwrap_err().to_string(),
            "no feedback from M3508 #1, M3508 #2"
        );
    }

    #[test]
    fn late_feedback_is_zero_output_and_clears_itself() {
        let (mut bus, [quiet, other]) =
            armed([1, 2].map(|id| Config::<M3508>::new(id).speed_loop(SPEED)));
        let mut zero_since = None;
        for ms in 2..60 {
            assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(ms)), Ingest::Taken);
            if ms >= 40 {
                assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            }
            _ = bus.set_velocity(quiet, AngularVelocity::from_rad_per_s(1.0));
            bus.set_velocity(other, AngularVelocity::from_rad_per_s(1.0)).unwrap();
            step(&mut bus, ms);
            let words = sent(&mut bus)[0].1;
            assert_eq!(words[1], 819, "the other goes on");
            match words[0] {
                0 => zero_since = zero_since.or(Some(ms)),
                _ if (12..40).contains(&ms) => panic!("moves at {ms} ms without feedback"),
                _ => {}
            }
        }
        assert_eq!(zero_since, Some(12)); // heard at 1 ms, late after 11 ms
        assert!(bus.is_motor_armed(quiet));
        step(&mut bus, 60);
        assert_eq!(sent(&mut bus)[0].1, [819, 819, 0, 0]);
    }

    #[test]
    fn an_offline_motor_is_latched_until_it_is_armed_again() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1).speed_loop(SPEED)]);
        for ms in 2..150 {
            _ = bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(1.0));
            step(&mut bus, ms);
        }
        assert_eq!(bus.link(wheel), Some(Link::Offline));
        for ms in 150..159 {
            assert_eq!(bus.ingest(&feedback(0x201, 4000, 0), at_ms(ms)), Ingest::Taken);
            assert_eq!(bus.link(wheel), Some(Link::Recovering));
            assert!(
                matches!(bus.arm(at_ms(ms)), Err(ArmError::Missing(_))),
                "not before ten good frames"
            );
        }
        assert_eq!(bus.ingest(&feedback(0x201, 4000, 0), at_ms(159)), Ingest::Taken);
        assert_eq!(bus.link(wheel), Some(Link::Online));
        assert_eq!(bus.set_velocity(wheel, AngularVelocity::ZERO), Err(TargetError::Relaxed));
        bus.arm(at_ms(159)).unwrap();
        assert_eq!(bus.set_velocity(wheel, AngularVelocity::ZERO), Ok(()));
        let state = bus.state(wheel).unwrap();
        assert_eq!((state.position.turns(), state.rotor_counts), (0, 4000), "no turn was made up");
    }

    #[test]
    fn a_motor_with_a_ramp_comes_back_by_itself_and_from_zero() {
        let config = Config::<M3508>::new(1)
            .speed_loop(PidConfig::new(100.0, 0.0, 0.0))
            .with_recovery(Recovery::Ramp(Duration::from_millis(100)));
        let (mut bus, [wheel]) = armed([config]);
        for ms in 2..150 {
            step(&mut bus, ms);
        }
        let mut last = 0;
        for ms in 150..300 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            let result = bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(10.0));
            assert_eq!(result.is_ok(), ms >= 159);
            step(&mut bus, ms);
            if let Some((_, words)) = sent(&mut bus).last() {
                assert!(
                    words[0] >= last && words[0] - last <= 2200,
                    "{ms}: {last} to {}",
                    words[0]
                );
                last = words[0];
            }
        }
        assert_eq!(last, 16_384);
    }

    #[test]
    fn an_application_that_stops_setting_targets_stops_the_motor() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1)]);
        bus.set_raw(wheel, 700).unwrap();
        let mut last_driven = 0;
        for ms in 2..300 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            step(&mut bus, ms);
            if sent(&mut bus).iter().any(|frame| frame.1 != [0; 4]) {
                last_driven = ms;
            }
        }
        assert_eq!(last_driven, 101);
        assert_eq!(bus.set_raw(wheel, 700), Ok(()), "not latched");
    }

    #[test]
    fn an_emergency_stop_is_zero_at_the_next_frame_until_cleared_and_armed() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1)]);
        bus.set_raw(wheel, 700).unwrap();
        step(&mut bus, 2);
        bus.emergency_stop();
        assert_eq!(sent(&mut bus), [(0x200, [0; 4])]);
        assert_eq!(bus.set_raw(wheel, 700), Err(TargetError::Disarmed));
        assert_eq!(bus.arm(at_ms(3)), Err(ArmError::Stopped));
        bus.clear_emergency_stop();
        assert_eq!(bus.set_raw(wheel, 700), Err(TargetError::Disarmed));
        assert_eq!(bus.arm(at_ms(3)), Ok(()));
    }

    #[test]
    fn stamps_that_wrap_at_32_bits_change_nothing() {
        let wrap = 1 << 32;
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
        let at = Instant::from_micros;
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at(wrap - 3_000)), Ingest::Taken);
        bus.update(Tick::new(at(wrap - 3_000), 0.001));
        bus.arm(at(wrap - 3_000)).unwrap();
        bus.set_raw(wheel, 5).unwrap();
        for us in (wrap - 2_000..wrap + 5_000).step_by(1_000) {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at(us)), Ingest::Taken);
            bus.update(Tick::new(at(us), 0.001));
            assert_eq!(sent(&mut bus), [(0x200, [5, 0, 0, 0])]);
        }
    }

    #[test]
    fn a_motor_unheard_for_longer_than_a_stamp_can_tell_is_not_revived() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1)]);
        step(&mut bus, 2);
        bus.update(Tick::new(Instant::from_micros(1_000 + (1 << 32)), 0.001));
        assert_eq!(bus.link(wheel), Some(Link::Offline));
        assert_eq!(bus.set_raw(wheel, 5), Err(TargetError::Relaxed));
    }

    #[test]
    fn a_bad_time_step_holds_the_output_once_and_then_stops() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1)]);
        let at = Instant::from_micros;
        for (now, bad) in (1..).zip([0.0, -0.001, f32::NAN, f32::INFINITY]) {
            let now = 2_000 + 100 * now;
            bus.set_raw(wheel, 9).unwrap();
            bus.update(Tick::new(at(now), 0.001));
            assert_eq!(sent(&mut bus), [(0x200, [9, 0, 0, 0])]);
            bus.update(Tick::new(at(now + 10), bad));
            assert_eq!(sent(&mut bus), [(0x200, [9, 0, 0, 0])]);
            bus.update(Tick::new(at(now + 20), bad));
            assert_eq!(sent(&mut bus), [(0x200, [0; 4])]);
        }
        assert_eq!(bus.counters().bad_steps, 8);
    }

    #[test]
    fn timeouts_are_configured_within_ten_seconds() {
        let timeouts = Timeouts::new()
            .with_late(Duration::from_millis(3))
            .with_offline(Duration::from_secs(9_999));
        assert_eq!(
            (timeouts.late(), timeouts.offline()),
            (Duration::from_millis(3), Duration::from_secs(10))
        );
    }
}
