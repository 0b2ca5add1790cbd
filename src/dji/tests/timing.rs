use super::*;

#[test]
fn a_time_that_stands_or_goes_back_is_noticed_however_quiet_all_is() {
    for stray in [20, 19, 5] {
        let (mut bus, [wheel]) = armed([Config::<M3508>::new(1).speed_loop(SPEED)]);
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
        bus.attach(Config::<M3508>::new(1)).unwrap();
        let mut times = (100_000..=121_000).filter(|ms| {
            step(&mut bus, *ms);
            !sent(&mut bus).is_empty()
        });
        let (first, second) = (times.next().unwrap(), times.next().unwrap());
        assert_eq!(second - first, due_ms, "{period_ms} ms asked for");
    }
}
