//! Updates that do not lie after the one before.

use super::*;
use crate::motor::Condition;

#[test]
fn a_clock_that_goes_back_trips_every_motor_and_leaves_no_feedback_fresh() {
    let (mut bus, [heard, silent]) = armed([1, 2].map(Config::<M3508>::at_once));
    let hear = |bus: &mut Bus, id, ms| {
        assert_eq!(bus.ingest(&feedback(id, 0, 0), at_ms(ms)), Ingest::Taken)
    };
    for ms in 2..2_005 {
        hear(&mut bus, 0x201, ms);
        hear(&mut bus, 0x202, ms);
        step(&mut bus, ms);
    }
    bus.set_raw(heard, 300).unwrap();
    _ = sent(&mut bus);
    // One second back: zeros in that cycle, and the old stamps lie ahead, which is not fresh.
    step(&mut bus, 999);
    assert_eq!(sent(&mut bus), [(0x200, [0; 4])]);
    assert_eq!((bus.link(heard), bus.link(silent)), (Some(Link::Late), Some(Link::Late)));
    for ms in 1_001..1_300 {
        hear(&mut bus, 0x201, ms);
        assert_eq!(bus.set_raw(heard, 300), Err(TargetError::Relaxed));
        assert_eq!(bus.set_raw(silent, 300), Err(TargetError::Relaxed));
        step(&mut bus, ms);
        assert!(sent(&mut bus).iter().all(|frame| frame.1 == [0; 4]));
    }
    bus.arm_only(&[heard.erase()], at_ms(1_300)).unwrap();
    bus.set_raw(heard, 300).unwrap();
    step(&mut bus, 1_300);
    assert_eq!(sent(&mut bus).last(), Some(&(0x200, [300, 0, 0, 0])));
    assert_eq!(bus.state(heard).unwrap().ambiguous_gaps, 0);
}

/// The clock is a 16-bit timer without an extension, and the application stopped after one target.
#[test]
fn a_clock_that_wraps_early_or_swings_drives_no_longer_than_the_deadline() {
    let wrap = |period_us: u64| move |tick: u64| 1_000 * tick % period_us;
    let swing = |tick: u64| 10_000 + 1_000 * (tick % 2);
    let clocks: [&dyn Fn(u64) -> u64; 4] = [&wrap(65_536), &wrap(20_000), &wrap(2_000), &swing];
    for (index, clock) in clocks.into_iter().enumerate() {
        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
        bus.set_raw(wheel, 4_096).unwrap();
        let mut driven = 0;
        for tick in 2..10_000 {
            let now = Instant::from_micros(clock(tick));
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), now), Ingest::Taken);
            bus.update(Tick::new(now, 0.001));
            driven += u32::from(sent(&mut bus).iter().any(|frame| frame.1 != [0; 4]));
        }
        assert!(driven <= 101, "clock {index}: {driven} ticks");
        let told = core::iter::from_fn(|| bus.next_edge())
            .any(|edge| edge.condition == Condition::ClockFault && edge.began);
        assert!(told && !bus.is_armed(), "clock {index}");
    }
}

/// The task of a button may read the clock before the tick does.
#[test]
fn an_arming_at_an_earlier_time_makes_no_target_younger() {
    let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1)]);
    assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(10)), Ingest::Taken);
    bus.arm(at_ms(10)).unwrap();
    bus.set_raw(wheel, 300).unwrap();
    // The motor runs on, and its target is one of 10 ms.
    bus.arm(at_ms(2)).unwrap();
    step(&mut bus, 3);
    assert_eq!((sent(&mut bus), bus.is_armed()), (std::vec![(0x200, [0; 4])], false));
}

/// Of 11 slots, nine lie between both motors. The journal has room for 12 edges.
#[test]
fn a_free_slot_has_no_edge_of_a_clock_that_went_back() {
    let mut bus = Bus::new();
    bus.attach(Config::<M3508>::at_once(1)).unwrap();
    bus.attach(Config::<Gm6020Voltage>::new(7)).unwrap();
    let run = |bus: &mut Bus, times: core::ops::Range<u64>, ids: &[u16]| {
        for ms in times {
            for id in ids {
                assert_eq!(bus.ingest(&feedback(*id, 0, 0), at_ms(ms)), Ingest::Taken);
            }
            step(bus, ms);
        }
    };
    run(&mut bus, 1_000..1_100, &[0x201, 0x20B]);
    while bus.next_edge().is_some() {}
    run(&mut bus, 1_050..3_000, &[0x201, 0x20B]);
    run(&mut bus, 3_000..3_200, &[0x20B]);
    let offline = core::iter::from_fn(|| bus.next_edge())
        .filter(|edge| edge.condition == Condition::Offline)
        .map(|edge| (edge.source.id(), edge.at.as_micros() / 1_000));
    assert_eq!(offline.collect::<Vec<_>>(), [(1, 3_099)]);
}
