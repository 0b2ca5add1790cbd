use super::*;

#[test]
fn a_frame_stamped_after_the_tick_read_its_clock_is_fresh() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
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
    let config = Config::<M3508>::at_once(1).speed_loop(PidConfig::new(0.0, 0.0, 0.05));
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
    let (mut bus, [first, second]) = armed([1, 2].map(Config::<M3508>::at_once));
    for ms in 2..150 {
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
        bus.set_raw(first, 500).unwrap();
        step(&mut bus, ms);
    }
    assert!(!bus.is_armed() && bus.is_motor_armed(first) && !bus.is_motor_armed(second));
    for ms in 150..203 {
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
        assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(ms)), Ingest::Taken);
        bus.set_raw(first, 500).unwrap();
        step(&mut bus, ms);
    }
    bus.arm(at_ms(203)).unwrap();
    _ = sent(&mut bus);
    step(&mut bus, 204);
    assert_eq!(sent(&mut bus)[0], (0x200, [500, 0, 0, 0]), "the first keeps its target");
    assert!(bus.is_armed());
}

#[test]
fn engaging_arms_neither_the_unheard_nor_the_faulty_nor_under_an_emergency_stop() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    CanDevice::engage(&mut bus, at_ms(1));
    assert!(!bus.is_motor_armed(wheel));
    let faulty = bus.attach(Config::<M3508>::at_once(2)).unwrap();
    let phase_loss = CanFrame::standard(0x202, [0, 0, 0, 0, 0, 0, 25, 3]).unwrap();
    assert_eq!(bus.ingest(&phase_loss, at_ms(1)), Ingest::Taken);
    CanDevice::engage(&mut bus, at_ms(1));
    assert!(!bus.is_motor_armed(faulty));
    assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(1)), Ingest::Taken);
    bus.emergency_stop();
    CanDevice::engage(&mut bus, at_ms(1));
    assert!(!bus.is_motor_armed(wheel));
}

#[test]
fn a_position_is_zeroed_only_while_the_motor_is_heard() {
    let mut bus = Bus::new();
    let joint = bus.attach(Config::<M3508>::at_once(1)).unwrap();
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
    let [first, _] = bus.attach_all([1, 2].map(Config::<M3508>::at_once)).unwrap();
    assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(1)), Ingest::Taken);
    assert_eq!(bus.set_raw(first, 1000), Err(TargetError::Disarmed));
    assert_eq!(bus.arm(at_ms(2)).unwrap_err().to_string(), "no feedback from M3508 #2");
    step(&mut bus, 2);
    assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]));
    assert_eq!(bus.ingest(&feedback(0x202, 0, 0), at_ms(2)), Ingest::Taken);
    assert_eq!(bus.arm(at_ms(2)), Ok(()));
    assert_eq!(bus.arm(at_ms(500)).unwrap_err().to_string(), "no feedback from M3508 #1, M3508 #2");
}

#[test]
fn late_feedback_is_zero_output_and_clears_itself() {
    let (mut bus, [quiet, other]) =
        armed([1, 2].map(|id| Config::<M3508>::at_once(id).speed_loop(SPEED)));
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
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
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
    assert_eq!(bus.arm(at_ms(159)), Err(ArmError::NotReleased), "asked for a millisecond before");
    for ms in 160..260 {
        assert_eq!(bus.ingest(&feedback(0x201, 4000, 0), at_ms(ms)), Ingest::Taken);
        step(&mut bus, ms);
    }
    bus.arm(at_ms(259)).unwrap();
    assert_eq!(bus.set_velocity(wheel, AngularVelocity::ZERO), Ok(()));
    let state = bus.state(wheel).unwrap();
    assert_eq!((state.position.turns(), state.rotor_counts), (0, 4000), "no turn was made up");
}

#[test]
fn a_motor_with_a_ramp_comes_back_by_itself_and_from_zero() {
    let config = Config::<M3508>::at_once(1)
        .speed_loop(PidConfig::new(100.0, 0.0, 0.0))
        .with_resume()
        .with_opening(Duration::from_millis(100));
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
            assert!(words[0] >= last && words[0] - last <= 2200, "{ms}: {last} to {}", words[0]);
            last = words[0];
        }
    }
    assert_eq!(last, 16_384);
}

#[test]
fn a_motor_that_one_frame_brings_back_comes_from_zero_as_well() {
    let opening = Duration::from_millis(100);
    let config = Config::<M3508>::new(1).with_resume().with_opening(opening);
    let (bus, [wheel]) = armed([config]);
    let mut bus = bus.with_timeouts(Timeouts::new().with_good_frames(1));
    // Open, then offline.
    for ms in 2..300 {
        if ms < 150 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
        }
        step(&mut bus, ms);
    }
    let mut last = 0;
    for ms in 300..410 {
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
        bus.set_raw(wheel, 10_000).unwrap();
        step(&mut bus, ms);
        last = sent(&mut bus).last().map_or(last, |(_, words)| words[0]);
        assert!(u64::from(last.unsigned_abs()) <= 164 * (ms - 298), "{last} at {ms} ms");
    }
    assert_eq!(last, 10_000);
}

#[test]
fn an_application_that_stops_setting_targets_stops_the_motor() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
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
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    bus.set_raw(wheel, 700).unwrap();
    step(&mut bus, 2);
    bus.emergency_stop();
    assert_eq!(sent(&mut bus), [(0x200, [0; 4])]);
    assert_eq!(bus.set_raw(wheel, 700), Err(TargetError::Disarmed));
    assert_eq!(bus.arm(at_ms(3)), Err(ArmError::Stopped));
    bus.clear_emergency_stop();
    assert_eq!(bus.set_raw(wheel, 700), Err(TargetError::Disarmed));
    assert_eq!(bus.arm(at_ms(4)), Err(ArmError::NotReleased), "the switch stays on");
    for ms in 5..104 {
        assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
        step(&mut bus, ms);
    }
    assert_eq!(bus.arm(at_ms(104)), Ok(()));
}

#[test]
fn stamps_that_wrap_at_32_bits_change_nothing() {
    let wrap = 1 << 32;
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
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
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    step(&mut bus, 2);
    bus.update(Tick::new(Instant::from_micros(1_000 + (1 << 32)), 0.001));
    assert_eq!(bus.link(wheel), Some(Link::Offline));
    assert_eq!(bus.set_raw(wheel, 5), Err(TargetError::Relaxed));
}

#[test]
fn a_bad_time_step_holds_the_output_once_and_then_stops() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
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
fn timeouts_that_would_drive_blindly_are_refused() {
    let (ms, us) = (Duration::from_millis, Duration::from_micros);
    let timeouts = Timeouts::new().with_feedback(ms(3), ms(10_000)).unwrap();
    assert_eq!((timeouts.late(), timeouts.offline()), (ms(3), ms(10_000)));
    assert_eq!(timeouts.with_command(ms(1_000)).unwrap().command(), ms(1_000));
    assert_eq!(timeouts.with_measured(us(1_999)).unwrap().measured(), ms(1));
    let refused =
        |late, offline| Timeouts::new().with_feedback(late, offline).unwrap_err().parameter();
    assert_eq!(refused(ms(10_000), ms(1)), "late in us");
    assert_eq!(refused(us(1_000_001), ms(10_000)), "late in us");
    assert_eq!(refused(us(0), ms(100)), "late in us");
    assert_eq!(refused(ms(20), us(19_999)), "offline in us");
    assert_eq!(refused(ms(20), us(10_000_001)), "offline in us");
    for command in [us(0), us(1_000_001), ms(u64::MAX / 1_000)] {
        assert_eq!(timeouts.with_command(command).unwrap_err().parameter(), "command in us");
    }
    for measured in [us(999), us(1_000_001)] {
        assert_eq!(timeouts.with_measured(measured).unwrap_err().parameter(), "measurement in us");
    }
}

/// The expected target of a motor, calculated anew in each tick.
#[derive(Default, Clone, Copy)]
struct Watched {
    heard: u64,
    is_late: bool,
    commanded: Option<u64>,
}

impl Watched {
    fn is_driven(&mut self, now: u64) -> bool {
        self.is_late |= now > self.heard + 4_000;
        if self.is_late {
            return false;
        }
        self.commanded = self.commanded.filter(|commanded| now <= commanded + 6_000);
        self.commanded.is_some()
    }
}

#[test]
fn each_of_several_motors_stops_at_its_own_limit_however_the_ages_are_mixed() {
    let mut seed = 0x5EED_u64;
    let mut random = |below: u64| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        seed % below
    };
    let (bus, wheels) = armed([1, 2, 3].map(Config::<M3508>::at_once));
    let timeouts = Timeouts::new().with_feedback(Duration::from_millis(4), Duration::from_secs(10));
    let timeouts = timeouts.unwrap().with_command(Duration::from_millis(6)).unwrap();
    let mut bus = bus.with_timeouts(timeouts);
    let mut watched = [Watched { heard: 1_000, ..Watched::default() }; 3];
    let (mut now, mut words, mut stops) = (1_000, [0; 4], 0);
    for _ in 0..200_000 {
        let before = now;
        now += 1 + random(2_500);
        for ((id, wheel), watched) in (0x201..).zip(wheels).zip(&mut watched) {
            if random(3) != 0 {
                // Some frames are stamped before the last update, or after the one to come.
                let at = (now + random(600)).saturating_sub(300).max(watched.heard);
                assert_eq!(
                    bus.ingest(&feedback(id, 0, 0), Instant::from_micros(at)),
                    Ingest::Taken
                );
                (watched.heard, watched.is_late) = (at, false);
            }
            match random(4) {
                0 => {
                    let set = bus.set_raw(wheel, 100);
                    assert_eq!(set.is_err(), watched.is_late);
                    watched.commanded = (!watched.is_late).then_some(before);
                }
                1 if random(8) == 0 => {
                    bus.relax(wheel);
                    watched.commanded = None;
                }
                _ => {}
            }
        }
        bus.update(Tick::new(Instant::from_micros(now), 0.001));
        for (_, sent) in sent(&mut bus) {
            words = sent;
        }
        for (word, watched) in words.iter().zip(&mut watched) {
            let was = watched.commanded.is_some();
            assert_eq!(*word != 0, watched.is_driven(now), "at {now} us");
            stops += u32::from(was && *word == 0);
        }
    }
    assert!(stops > 10_000, "{stops}");
}

/// Feedback of one turn of the stamps ago, to the microsecond, is old: in a first update that late, and in an update without a usable time
/// step at the end of the pause.
#[test]
fn a_pause_of_a_whole_turn_of_the_stamps_revives_nobody() {
    let turn = Duration::from_micros(1 << 32);
    for dt_s in [0.001, 0.0] {
        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
        assert!(bus.arm(at_ms(1) + turn).is_err(), "heard an hour ago");
        bus.update(Tick::new(at_ms(1) + turn, dt_s));
        assert_eq!((bus.link(wheel), bus.is_motor_armed(wheel)), (Some(Link::Offline), false));

        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
        step(&mut bus, 2);
        bus.update(Tick::new(at_ms(2) + turn, dt_s));
        assert_eq!((bus.link(wheel), bus.is_motor_armed(wheel)), (Some(Link::Offline), false));
    }

    // Updates without a usable step, however close to each other, do not end the pause.
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
    step(&mut bus, 2);
    for seconds in 1..=4294 {
        bus.update(Tick::new(at_ms(seconds * 1_000), 0.0));
    }
    assert!(bus.arm_only(&[wheel.erase()], at_ms(2) + turn).is_err(), "heard an hour ago");
    bus.update(Tick::new(at_ms(2) + turn, 0.001));
    assert_eq!((bus.link(wheel), bus.is_motor_armed(wheel)), (Some(Link::Offline), false));
}
