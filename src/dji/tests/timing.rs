use super::watching::{Bench, CALM};
use super::*;

#[test]
fn a_time_that_stands_or_goes_back_is_noticed_however_quiet_all_is() {
    for stray in [20, 19, 5] {
        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(SPEED)]);
        for ms in 2..=20 {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(5.0)).unwrap();
            step(&mut bus, ms);
        }
        assert_eq!(bus.counters().bad_steps, 0);
        step(&mut bus, stray);
        assert_eq!(bus.counters().bad_steps, 1, "{stray} ms after 20 ms");
    }
}

#[test]
fn a_frame_of_zeros_is_repeated_as_often_as_configured_and_at_least_each_ten_seconds() {
    for (period_ms, due_ms) in [(3, 3), (9_999, 9_999), (10_000, 10_000), (60_000, 10_000)] {
        let mut bus: Bus = Bus::new().with_keep_alive(Duration::from_millis(period_ms));
        bus.attach(Config::<M3508>::at_once(1)).unwrap();
        let mut times = (100_000..=121_000).filter(|ms| {
            step(&mut bus, *ms);
            !sent(&mut bus).is_empty()
        });
        let (first, second) = (times.next().unwrap(), times.next().unwrap());
        assert_eq!(second - first, due_ms, "{period_ms} ms asked for");
    }
}

/// A ramp knows its beginning in 16 bits of 1.024 ms: two moments of the clock are close to its zero.
#[test]
fn a_ramp_rises_for_as_long_as_it_is_to_whatever_the_clock_shows() {
    const TURN_US: u64 = 1 << 26;
    for (ramp_ms, expected_ms) in
        [(100, 100), (65_535, 65_535), (66_000, 65_535), (600_000, 65_535)]
    {
        for started_us in [TURN_US - 500, TURN_US + 500, TURN_US + 1_500, TURN_US + 2_500] {
            let opening = Duration::from_millis(ramp_ms);
            let (mut bus, [wheel]) =
                armed([Config::<M3508>::at_once(1).with_resume().with_opening(opening)]);
            // Offline, then heard ten times to the moment.
            let at = |ms: u64| Instant::from_micros(started_us + 1_000 * ms);
            bus.update(Tick::new(at(0), 0.001));
            for _ in 0..10 {
                assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at(0)), Ingest::Taken);
            }
            let mut full_after = None;
            for ms in 1..400 {
                assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at(ms)), Ingest::Taken);
                bus.set_raw(wheel, 16_384).unwrap();
                bus.update(Tick::new(at(ms), 0.001));
                let word = f64::from(sent(&mut bus).last().map_or(0, |frame| frame.1[0]));
                #[expect(clippy::cast_precision_loss, reason = "at most 65 535")]
                let share = |ms: u64| (ms as f64 / expected_ms as f64).min(1.0) * 16_384.0;
                // The motor is looked at every few milliseconds.
                let (lowest, highest) = (share(ms.saturating_sub(14)) - 1.0, share(ms + 2) + 1.0);
                assert!((lowest..=highest).contains(&word), "{ms}: {word}");
                if word >= 16_384.0 {
                    full_after = full_after.or(Some(ms));
                }
            }
            let in_time = full_after.map(|ms| (100..=114).contains(&ms));
            assert_eq!(in_time, (expected_ms == 100).then_some(true), "{full_after:?}");
        }
    }
}

#[test]
fn the_ramp_of_a_motor_that_turns_and_with_which_nothing_is_wrong_rises_from_its_arming_on() {
    let opening = Duration::from_millis(200);
    let mut bench = Bench::new(Config::<M3508>::new(1).with_opening(opening));
    for ms in 1..250_u16 {
        let word = bench.tick(CALM, 16_384);
        // The range opens further at each look.
        let share = |ms: u16| (f32::from(ms) / 200.0).min(1.0) * 16_384.0;
        let expected = share(ms.saturating_sub(14)) - 1.0..=share(ms + 2) + 1.0;
        assert!(expected.contains(&f32::from(word)), "{ms} ms: {word} of {expected:?}");
    }
}
