//! Frames that find no place in the controller, and stops between two ticks.

use super::*;
use crate::motor::Link;
use std::string::ToString;
use std::vec;

/// A tick in which only the first of both frames finds a place.
fn tick_with_one_place(runner: &mut TestRunner<'_>, clock: &Cell<Instant>) {
    clock.set(clock.get() + Duration::from_millis(1));
    hear(runner, clock);
    runner.port_mut().0.transmit.extend([Ok(None), Err(nb::Error::WouldBlock)]);
    runner.tick(Tick::new(clock.get(), 0.001));
    assert_eq!(offered(runner).len(), 2);
}

#[test]
fn a_frame_without_a_place_is_offered_by_each_poll_until_sent() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    set(&mut runner, wheels, 2);
    tick_with_one_place(&mut runner, &clock);
    runner.port_mut().0.transmit.push_back(Err(nb::Error::WouldBlock));
    for expected in [&[(0x1FF, 2)][..], &[(0x1FF, 2)], &[]] {
        clock.set(clock.get() + Duration::from_micros(100));
        assert_eq!(runner.poll(8), 0);
        assert_eq!(offered(&mut runner), expected);
    }
    let statistics = runner.statistics();
    assert_eq!((statistics.refused, statistics.superseded), (1, 0), "a poll is no new refusal");
}

#[test]
fn a_poll_offers_nothing_after_a_stop_and_after_the_period() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let stops: [fn(&mut TestRunner<'_>, &Cell<Instant>); 4] = [
        |runner, _| runner.device_mut().emergency_stop(),
        |runner, _| runner.device_mut().disarm(),
        |_, _| STOP.set(),
        |_, clock| clock.set(clock.get() + Duration::from_micros(900)),
    ];
    for stop in stops {
        let clock = Cell::new(Instant::from_micros(1_000));
        let (runner, wheels) = driving(&clock);
        let mut runner = runner.with_emergency_stop(&STOP);
        set(&mut runner, wheels, 2);
        tick_with_one_place(&mut runner, &clock);
        clock.set(clock.get() + Duration::from_micros(100));
        stop(&mut runner, &clock);
        runner.poll(8);
        assert_eq!(offered(&mut runner), []);
        STOP.clear();
    }
}

/// The frames of a tick under the stop are rest: they leave as soon as there is a place.
#[test]
fn a_poll_offers_the_rest_of_a_tick_that_saw_the_stop() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let clock = Cell::new(Instant::from_micros(1_000));
    let (runner, wheels) = driving(&clock);
    let mut runner = runner.with_emergency_stop(&STOP);
    set(&mut runner, wheels, 2);
    STOP.set();
    tick_with_one_place(&mut runner, &clock);
    clock.set(clock.get() + Duration::from_micros(100));
    runner.poll(8);
    assert_eq!(offered(&mut runner), [(0x1FF, 0)]);
}

#[test]
fn a_frame_of_others_evicted_by_a_poll_is_handed_back_by_the_next_tick() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    let foreign = frame(0x7FF, [9; 8]);
    set(&mut runner, wheels, 2);
    tick_with_one_place(&mut runner, &clock);
    runner.port_mut().0.transmit.push_back(Ok(Some(foreign)));
    runner.poll(8);
    assert_eq!(offered(&mut runner), [(0x1FF, 2)]);
    runner.poll(8);
    assert_eq!(offered(&mut runner), [], "one at a time is kept");
    let mut handed_back = Vec::new();
    clock.set(clock.get() + Duration::from_millis(1));
    runner.tick_with(Tick::new(clock.get(), 0.001), |frame| handed_back.push(*frame));
    assert_eq!((handed_back, runner.statistics().evicted_unrelated), (vec![foreign], 1));
}

#[test]
fn a_frame_of_others_evicted_after_one_without_a_place_is_not_lost() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    let foreign = frame(0x7FF, [9; 8]);
    clock.set(clock.get() + Duration::from_millis(1));
    hear(&mut runner, &clock);
    set(&mut runner, wheels, 2);
    runner.port_mut().0.transmit.push_back(Err(nb::Error::WouldBlock));
    runner.tick(Tick::new(clock.get(), 0.001));
    let full = Err(nb::Error::WouldBlock);
    runner.port_mut().0.transmit.extend([full, Ok(Some(foreign))]);
    for offers in [2, 0] {
        _ = offered(&mut runner);
        runner.poll(8);
        assert_eq!(offered(&mut runner).len(), offers);
    }
    let mut handed_back = Vec::new();
    clock.set(clock.get() + Duration::from_millis(1));
    runner.tick_with(Tick::new(clock.get(), 0.001), |frame| handed_back.push(*frame));
    assert_eq!(handed_back, [foreign]);
}

#[test]
fn a_stop_that_is_cleared_before_the_tick_stops_and_needs_a_clear_of_each_runner() {
    static STOP: EmergencyStop = EmergencyStop::new();
    STOP.set();
    STOP.clear();
    let clock = Cell::new(Instant::from_micros(1_000));
    let mut runners = [0; 2].map(|_| {
        let (runner, wheels) = driving(&clock);
        (runner.with_emergency_stop(&STOP), wheels)
    });
    let step = |(runner, wheels): &mut (TestRunner<'_>, _), now| {
        hear(runner, &Cell::new(now));
        set(runner, *wheels, 50);
        runner.tick(Tick::new(now, 0.001));
        offered(runner).into_iter().map(|(_, raw)| raw).collect::<Vec<_>>()
    };
    let at_ms = |ms: u64| Instant::from_micros(1_000 * ms);
    assert_eq!(step(&mut runners[0], at_ms(2)), [50, 50], "set before the stop was watched");
    STOP.set();
    STOP.clear(); // a button that bounces
    assert_eq!(runners[0].0.arm(Tick::new(at_ms(2), 0.001)), Err(ArmError::Stopped));
    for (runner, wheels) in &mut runners {
        assert!(runner.device_mut().set_raw(wheels[0], 51).is_ok(), "until the tick");
        runner.tick(Tick::new(at_ms(3), 0.001));
        assert_eq!(offered(runner).iter().map(|(_, raw)| *raw).max(), Some(0));
        assert!(runner.device_mut().set_raw(wheels[0], 51).is_err());
        STOP.set();
        runner.clear_emergency_stop(); // of this one; the other has not run since
    }
    let [(one, _), _] = &mut runners;
    one.tick(Tick::new(at_ms(4), 0.001));
    assert!(one.device().is_stopped(), "set again after the tick before");
}

#[test]
fn a_clear_stops_each_part_first_where_no_tick_has_seen_the_stop() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut front, mut rear) = (Bus::new(), Bus::new());
    _ = front.attach(Config::<M3508>::at_once(1)).unwrap();
    let wheel = rear.attach(Config::<M3508>::at_once(5)).unwrap();
    let runner = Runner::new(Nb(Scripted::default()), &clock, (front, rear));
    let mut runner = runner.with_emergency_stop(&STOP);
    for id in [0x201, 0x205] {
        assert_eq!(runner.ingest(&frame(id, [0; 8]), clock.get()), Ingest::Taken);
    }
    runner.arm(Tick::new(clock.get(), 0.001)).unwrap();
    runner.tick(Tick::new(clock.get(), 0.001));
    runner.device_mut().1.set_raw(wheel, 50).unwrap();
    // The program stops one bus, a person both, and the program clears what it stopped.
    runner.device_mut().0.emergency_stop();
    STOP.set();
    runner.clear_emergency_stop();
    runner.port_mut().0.offered.clear();
    runner.tick(Tick::new(Instant::from_micros(2_000), 0.001));
    assert!(runner.port_mut().0.offered.iter().all(|frame| *frame.bytes() == [0; 8]));
    assert!(!runner.device_mut().1.is_armed() && !runner.device_mut().1.is_stopped());
}

/// A frame each half of a millisecond, and a poll for each: with a budget of 1, no poll shows that none is left.
#[test]
fn a_program_learns_that_no_frame_waits_by_a_poll_with_room_for_another() {
    for (budget, is_fresh) in [(1, false), (2, true)] {
        let clock = Cell::new(Instant::START);
        let (mut runner, wheels) = driving(&clock);
        for _ in 0..200 {
            clock.set(clock.get() + Duration::from_millis(1));
            for id in [0x201, 0x205] {
                runner.port_mut().0.receive.push_back(Ok(frame(id, [0; 8])));
                assert_eq!(runner.poll(budget), 1);
            }
            let tick = runner.due().unwrap();
            wheels.into_iter().for_each(|wheel| _ = runner.device_mut().set_raw(wheel, 1));
            runner.tick(tick);
        }
        assert_eq!(runner.is_armed(), is_fresh, "a budget of {budget}");
        let refused = runner.arm(Tick::new(clock.get(), 0.001)).map_err(|why| why.to_string());
        let waits = refused.is_err_and(|why| why.contains("received frames wait"));
        assert_eq!(waits, !is_fresh, "a budget of {budget}");
    }
}

/// A timer makes the ticks, so nothing but a poll reads the clock; one frame comes each 8 ms.
#[test]
fn a_program_without_due_hears_a_motor_of_125_hz() {
    let clock = Cell::new(Instant::START);
    let (mut runner, wheels) = driving(&clock);
    for ms in 1..2_000 {
        clock.set(clock.get() + Duration::from_millis(1));
        if ms % 8 == 0 {
            runner.port_mut().0.receive.extend([0x201, 0x205].map(|id| Ok(frame(id, [0; 8]))));
        }
        runner.poll(16);
        runner.tick(Tick::new(clock.get(), 0.001));
        let links = wheels.map(|wheel| runner.device().link(wheel));
        assert_eq!(links, [Some(Link::Online); 2], "{ms} ms");
    }
}

/// The clock counts from the reset, and the program begins later; frames come from its second poll on.
#[test]
fn a_program_that_begins_late_in_the_time_of_its_clock_has_no_edge() {
    let clock = Cell::new(Instant::from_micros(200_000));
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let mut runner = Runner::new(Nb(Scripted::default()), &clock, bus);
    for ms in 0..20 {
        runner.poll(16);
        runner.port_mut().0.receive.push_back(Ok(frame(0x201, [0; 8])));
        let tick = runner.due().unwrap();
        runner.tick(tick);
        clock.set(clock.get() + Duration::from_millis(1));
        assert_eq!(Devices::next_edge(runner.device_mut()), None, "{ms} ms");
    }
    assert_eq!(runner.device().link(wheel), Some(Link::Online));
}
