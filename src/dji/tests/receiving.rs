use super::*;

#[test]
fn wrong_lengths_remote_and_extended_frames_are_ignored_and_counted() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    let id = StandardId::new(0x201).unwrap();
    for length in 0..8 {
        let short = CanFrame::new(id, &[0; 8][..length]).unwrap();
        let outcome = bus.ingest(&short, at_ms(1));
        assert_eq!(outcome, Ingest::WrongLength(u8::try_from(length).unwrap()));
    }
    let remote = CanFrame::new_remote(id, 8).unwrap();
    let extended = CanFrame::new(ExtendedId::new(0x201).unwrap(), &[0; 8]).unwrap();
    assert_eq!(bus.ingest(&remote, at_ms(1)), Ingest::Unrelated);
    assert_eq!(bus.ingest(&extended, at_ms(1)), Ingest::Unrelated);
    assert_eq!(bus.ingest(&feedback(0x201, 8192, 0), at_ms(1)), Ingest::WrongField);
    assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(1)), Ingest::Unrelated);
    let counters = bus.counters();
    assert_eq!((counters.bad_length, counters.bad_field, counters.unattached), (8, 1, 1));
    assert_eq!((bus.state(wheel), bus.link(wheel)), (None, Some(Link::Unheard)));
}

#[test]
fn the_router_is_total_over_all_ids_and_lengths() {
    let mut bus = Bus::new();
    bus.attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(Config::<M3508>::at_once)).unwrap();
    bus.attach_all([5, 6, 7].map(Config::<Gm6020Voltage>::at_once)).unwrap();
    for raw in 0..=0x7FF {
        for length in 0..=8 {
            let frame = CanFrame::new(StandardId::new(raw).unwrap(), &[0; 8][..length]).unwrap();
            let outcome = bus.ingest(&frame, at_ms(1));
            match (raw, length) {
                (0x201..=0x20B, 8) => assert_eq!(outcome, Ingest::Taken),
                (0x201..=0x20B, _) => assert!(outcome.is_malformed()),
                _ => assert_eq!(outcome, Ingest::Unrelated),
            }
        }
    }
}

#[test]
fn state_is_at_the_output_shaft_in_physical_units() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(4)).unwrap();
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
fn below_zero_it_is_cold_and_not_250_degrees() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(4)).unwrap();
    for (byte, celsius) in [(250, -6), (216, -40), (215, 215), (0, 0)] {
        let frame = CanFrame::standard(0x204, [0, 0, 0, 0, 0, 0, byte, 0]).unwrap();
        assert_eq!(bus.ingest(&frame, at_ms(1)), Ingest::Taken);
        assert_eq!(bus.state(wheel).unwrap().temperature_c, Some(celsius));
        assert_eq!(bus.health(wheel).unwrap().temperature_c, Some(celsius));
    }
}

#[test]
fn c610_has_no_temperature_and_its_own_error_list() {
    let mut bus = Bus::new();
    let feeder = bus.attach(Config::<M2006>::at_once(5)).unwrap();
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
    let wheel = bus.attach(Config::<M3508>::at_once(1).reversed()).unwrap();
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
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
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
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    assert_eq!(bus.ingest(&feedback(0x201, 0, 9000), at_ms(1)), Ingest::Taken);
    bus.zero(wheel).unwrap();
    assert_eq!(bus.state(wheel).unwrap().homing, Homing::Homed);
    assert_eq!(bus.ingest(&feedback(0x201, 17, 9000), at_ms(81)), Ingest::Taken);
    let state = bus.state(wheel).unwrap();
    assert_eq!((state.ambiguous_gaps, state.homing), (1, Homing::Uncertain));
}

/// A gap of 80 ms at 9000 rpm: the zero is in doubt by whole turns of the rotor.
#[test]
fn a_position_from_a_zero_in_doubt_is_refused_and_a_velocity_is_taken() {
    let config = Config::<M3508>::at_once(1).position_loop(SPEED, SPEED);
    let (mut bus, [wheel]) = armed([config]);
    let goal = Position::from_turns(3);
    bus.set_position(wheel, goal).unwrap(); // relative to where it was switched on
    bus.zero(wheel).unwrap();
    bus.set_position(wheel, goal).unwrap();
    step(&mut bus, 2);
    assert!(sent(&mut bus).iter().any(|(_, [word, ..])| *word > 0));
    assert_eq!(bus.ingest(&feedback(0x201, 0, 9000), at_ms(3)), Ingest::Taken);
    assert_eq!(bus.ingest(&feedback(0x201, 17, 9000), at_ms(83)), Ingest::Taken);
    assert_eq!(bus.state(wheel).unwrap().homing, Homing::Uncertain);
    assert_eq!(bus.health(wheel).unwrap().ambiguous_gaps, 1);
    step(&mut bus, 84);
    assert!(sent(&mut bus).iter().all(|(_, words)| *words == [0; 4]), "the target is of the zero");
    assert_eq!(bus.set_position(wheel, goal), Err(TargetError::NotHomed));
    assert_eq!(bus.set_velocity(wheel, AngularVelocity::from_rpm(900.0)), Ok(()));
    step(&mut bus, 85);
    assert!(sent(&mut bus).iter().any(|(_, [word, ..])| *word != 0));
    assert_eq!(bus.set_position(wheel, goal), Err(TargetError::NotHomed));
    step(&mut bus, 86);
    assert!(sent(&mut bus).iter().all(|(_, words)| *words == [0; 4]), "no older target either");
    bus.zero(wheel).unwrap();
    assert_eq!(bus.set_position(wheel, goal), Ok(()));
}

#[test]
fn frames_of_one_motor_are_handled_in_order() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
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
    let (mut left, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    let (mut right, [other]) = armed([Config::<M3508>::at_once(1)]);
    left.set_raw(wheel, 500).unwrap();
    step(&mut left, 2);
    step(&mut right, 2);
    assert_eq!(sent(&mut left), [(0x200, [500, 0, 0, 0])]);
    assert_eq!(sent(&mut right), [(0x200, [0; 4])]); // its first keep-alive
    assert_eq!(right.state(other).unwrap().rotor_counts, 0);
}

/// Twice the no-load speed, 18512 rpm, is the fastest that is believed.
#[test]
fn a_gap_is_bridged_by_speeds_that_are_possible_and_the_shortest_way_where_one_is_not() {
    for (before, after, counts) in [
        (9_256, 9_256, 10_111), // 1263.9 counts a millisecond
        (12_000, 12_000, 13_107),
        (18_512, 18_512, 20_221),
        (18_513, 18_512, 20_221 - 2 * 8_192),
        (18_512, -18_513, 20_221 - 2 * 8_192),
        (32_000, 300, 20_221 - 2 * 8_192),
    ] {
        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
        step(&mut bus, 2);
        assert_eq!(bus.ingest(&feedback(0x201, 0, before), at_ms(2)), Ingest::Taken);
        let from = bus.state(wheel).unwrap().rotor_counts;
        let angle = u16::try_from(i32::rem_euclid(counts, 8_192)).unwrap();
        assert_eq!(bus.ingest(&feedback(0x201, angle, after), at_ms(10)), Ingest::Taken);
        let moved = bus.state(wheel).unwrap().rotor_counts - from;
        assert_eq!(moved, i64::from(counts), "{before} and {after} rpm");
    }
}

/// Whatever speed it tells: so it is after the first update, and so it is before.
#[test]
fn a_frame_in_time_is_followed_the_shortest_way() {
    for running in [false, true] {
        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
        if running {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(2)), Ingest::Taken);
            step(&mut bus, 2);
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(2)), Ingest::Taken);
        }
        for ms in 3..10 {
            let frame = feedback(0x201, 0, if ms % 2 == 0 { 20_000 } else { -9_000 });
            assert_eq!(bus.ingest(&frame, at_ms(ms)), Ingest::Taken);
        }
        let state = bus.state(wheel).unwrap();
        assert_eq!((state.rotor_counts, state.ambiguous_gaps), (0, 0), "{running}");
    }
}

/// Half a turn at no-load speed takes 3241 us; 500 us are for the frames of others.
#[test]
fn a_frame_is_in_time_for_as_long_as_half_a_turn_may_not_have_passed() {
    for running in [false, true] {
        for (gap_us, doubts) in [(2_740, 0), (2_741, 1)] {
            let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
            if running {
                step(&mut bus, 2);
            }
            let at = |us: u64| Instant::from_micros(2_000 + us);
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at(0)), Ingest::Taken);
            // Later than that, a speed is asked, and this one is not possible.
            assert_eq!(bus.ingest(&feedback(0x201, 0, 20_000), at(gap_us)), Ingest::Taken);
            let state = bus.state(wheel).unwrap();
            assert_eq!(state.ambiguous_gaps, doubts, "{gap_us} us, {running}");
        }
    }
}
