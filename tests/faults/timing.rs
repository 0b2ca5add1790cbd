//! F24 to F33: time.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{Rig, SPEED, armed, at_ms, at_once, feedback, rpm, step, ticks_since, words};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::motor::{ArmError, Condition, Link, TargetError};
use drivetrain::runner::{BusCondition, Nb, Runner};
use drivetrain::sim::{Fault, Line, Simulation};
use drivetrain::time::{Duration, ExtendedCounter, Instant, Tick};
use std::cell::Cell;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f24_lost_feedback_is_zero_within_a_tick_and_the_others_do_not_notice,
    f25_with_all_feedback_lost_frames_are_still_offered,
    f27_a_heartbeat_stops_with_any_part_of_the_loop,
    f26_an_application_that_stops_is_zero_after_the_deadline,
    f28_nothing_notices_that_a_hardware_counter_wraps,
    f29_time_that_stands_or_goes_back_is_never_fresh_for_ever,
    f30_a_motor_unheard_for_longer_than_any_counter_stays_offline,
    f31_a_bad_time_step_holds_once_and_is_counted,
    f32_a_huge_time_step_moves_no_integral,
    f33_recovery_takes_ten_good_frames_and_starts_from_zero,
    f24_a_million_silences_end_with_the_first_tick_after_the_limit,
    f26_a_million_hung_applications_end_with_the_first_tick_after_the_deadline,
];

#[cfg_attr(test, test)]
fn f24_lost_feedback_is_zero_within_a_tick_and_the_others_do_not_notice() {
    let run = |silent: Option<u64>| {
        let world = Simulation::new(2);
        let mut rig = Rig::new(&world, Line::Can1, 4);
        if let Some(ms) = silent {
            world.fault(Fault::Silent(rig.keys[2]), at_ms(500)..at_ms(500 + ms)).unwrap();
        }
        rig.drive(900);
        let others: Vec<[i16; 3]> =
            rig.sent.iter().map(|sent| [sent.words[0], sent.words[1], sent.words[3]]).collect();
        let armed = rig.runner.device().is_motor_armed(rig.wheels[2]);
        let words = (rig.words(2, 512, 900), rig.words(2, 565, 900));
        (others, (silent.map(|_| rig.first_zero(2, 500)), armed, words, rig.link(2)))
    };
    let (healthy, _) = run(None);
    let (others, (zero, armed, (_, after), link)) = run(Some(60));
    assert!(zero.is_some_and(|zero| zero < at_ms(512)));
    assert!(armed && link == Link::Online && after.iter().all(|word| *word != 0), "clears itself");
    assert_eq!(others, healthy, "late: another motor's bytes");
    let (others, (zero, armed, (all, _), link)) = run(Some(150));
    assert!(zero.is_some_and(|zero| zero < at_ms(512)));
    safe_after(zero.map_or(u64::MAX, |zero| ticks_since(500, zero)));
    saw("60 ms: late, clears itself; 150 ms: relaxed, latched; others the same to the bit");
    assert!(!armed && link == Link::Online && all.iter().all(|word| *word == 0), "latched");
    assert_eq!(others, healthy, "offline: another motor's bytes");

    // The integrator rests while the feedback is late.
    let speed = PidConfig::new(0.0, 1.0, 0.0);
    let (mut bus, [wheel]) = armed_at_rest(speed);
    let mut words = Vec::new();
    for ms in 2..60 {
        if !(20..50).contains(&ms) {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
        }
        _ = bus.set_velocity(wheel, rpm(100.0));
        words.push(step(&mut bus, ms).map_or(0, |words| words[0]));
    }
    let (before, after) = (words[27], words[48]); // ticks 29 and 50
    let a_tick = words[10] - words[9];
    assert!(after - before <= 2 * a_tick, "{before} to {after}");
    assert_eq!(words[30], 0);
}

fn armed_at_rest(speed: PidConfig) -> (Bus, [drivetrain::dji::Handle<M3508>; 1]) {
    armed([Config::new(1).speed_loop(speed)])
}

#[cfg_attr(test, test)]
fn f25_with_all_feedback_lost_frames_are_still_offered() {
    let world = Simulation::new(2);
    let mut rig = Rig::new(&world, Line::Can1, 4);
    for key in rig.keys.clone() {
        world.fault(Fault::Silent(key), at_ms(300)..at_ms(900)).unwrap();
    }
    rig.drive(890);
    assert!((0..4).all(|wheel| rig.link(wheel) == Link::Offline));
    let sent: Vec<_> = rig.sent.iter().filter(|sent| sent.at > at_ms(320)).collect();
    assert!((50..=60).contains(&sent.len()), "a keep-alive every 10 ms, not {}", sent.len());
    assert!(sent.iter().all(|sent| sent.words == [0; 4]));
    let edge = rig.runner.next_edge().unwrap();
    assert_eq!((edge.condition, edge.began), (BusCondition::Silent, true));
    // From the tick that heard the last frame, 100 ms and a tick at most.
    assert!((at_ms(399)..=at_ms(402)).contains(&edge.at), "{edge}");
    assert_eq!(rig.runner.next_edge(), None, "one edge for 490 ms, and the bus is not down");
    let sent = sent.len();
    rig.drive(100);
    assert!((0..4).all(|wheel| rig.link(wheel) == Link::Online));
    safe_after(ticks_since(300, rig.first_zero(0, 300)));
    saw(format!("{sent} zero frames in 570 ms; {edge}"));
    let edge = rig.runner.next_edge().unwrap();
    assert!(!edge.began && (at_ms(900)..=at_ms(903)).contains(&edge.at), "{edge}");

    // One motor of four is no silence of the bus, and neither is a bus on which nothing was ever heard.
    let world = Simulation::new(2);
    let mut rig = Rig::new(&world, Line::Can1, 4);
    for key in rig.keys.clone().into_iter().skip(1) {
        world.fault(Fault::Silent(key), ..).unwrap();
    }
    rig.drive(500);
    assert_eq!(rig.runner.next_edge(), None);
    let mut rig = Rig::new(&world, Line::Can2, 0);
    rig.drive(500);
    assert_eq!(rig.runner.next_edge(), None);
}

#[cfg_attr(test, test)]
fn f27_a_heartbeat_stops_with_any_part_of_the_loop() {
    const TICKS: u32 = 50;
    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Stops {
        Nothing,
        Receive,
        Tick,
        Clock,
        Bus,
    }
    // A hardware watchdog of 5 ms, fed as the documentation says; 200 ms in which one part stops after 50.
    let resets_at = |stops: Stops| {
        let clock = Cell::new(at_ms(1));
        let world = Simulation::new(1);
        let (bus, [wheel]) = armed([Config::new(1)]);
        let mut runner = Runner::new(Nb(world.controller()), &clock, bus);
        if stops == Stops::Bus {
            world.fault(Fault::BusOff(Line::Can1), ..).unwrap();
        }
        let (mut beat, mut fed) = (runner.heartbeat(), 1);
        for ms in 2..200 {
            let stopped = ms > 50;
            world.advance(Duration::from_millis(1));
            if !(stopped && stops == Stops::Clock) {
                clock.set(at_ms(ms));
            }
            if !(stopped && stops == Stops::Receive) {
                runner.poll(8);
            }
            if let Some(tick) = runner.due().filter(|_| !(stopped && stops == Stops::Tick)) {
                _ = runner.device_mut().set_raw(wheel, 7);
                runner.tick(tick);
            }
            if runner.heartbeat() != beat {
                (beat, fed) = (runner.heartbeat(), ms);
            }
            if ms - fed >= 5 {
                return Err((ms, beat));
            }
        }
        Ok(beat)
    };
    assert_eq!(resets_at(Stops::Nothing), Ok(198));
    assert_eq!(resets_at(Stops::Bus), Ok(198), "a dead bus is no reason to reset");
    for stops in [Stops::Receive, Stops::Tick, Stops::Clock] {
        assert!(resets_at(stops).is_err_and(|(ms, beat)| ms <= 56 && beat <= TICKS), "{stops:?}");
    }
    saw("stops without receive, tick or a clock that goes on, and not with a dead bus");
}

#[cfg_attr(test, test)]
fn f26_an_application_that_stops_is_zero_after_the_deadline() {
    let world = Simulation::new(2);
    let mut rig = Rig::new(&world, Line::Can1, 2);
    rig.drive(300);
    rig.run(300, |_, _| {}); // ticks and frames go on, targets do not
    let zero = rig.first_zero(0, 300);
    assert!(zero > at_ms(395) && zero < at_ms(402), "{zero:?}");
    assert!(rig.words(0, 402, 600).iter().all(|word| *word == 0));
    let state = rig.runner.device().state(rig.wheels[0]).unwrap();
    assert_eq!(state.forgotten_targets, 1);
    rig.drive(50);
    assert!(rig.words(0, 610, 650).iter().all(|word| *word > 0), "not latched");
    safe_after(ticks_since(300, zero));
    saw(format!("zero, {} target forgotten, not latched", state.forgotten_targets));
}

#[cfg_attr(test, test)]
fn f28_nothing_notices_that_a_hardware_counter_wraps() {
    for (mut counter, mask, start) in [
        (ExtendedCounter::new_16_bit(1_000_000).unwrap(), 0xFFFF_u64, 0xFF00_u64),
        (ExtendedCounter::new_32_bit(1_000_000).unwrap(), 0xFFFF_FFFF, 0xFFFF_FF00),
    ] {
        let mut read =
            |micros: u64| counter.extend(u32::try_from((start + micros) & mask).unwrap());
        let mut bus = Bus::new();
        let wheel = bus.attach(at_once::<M3508>(1)).unwrap();
        let first = read(0);
        _ = bus.ingest(&feedback(0x201, 0, 0), first);
        bus.arm(first).unwrap();
        for ms in 1..200 {
            let now = read(ms * 1_000);
            assert_eq!(now.since(first), Duration::from_millis(ms));
            _ = bus.ingest(&feedback(0x201, 0, 0), now);
            bus.set_raw(wheel, 7_000).unwrap();
            bus.update(Tick::new(now, 0.001));
            assert_eq!(words(&bus.next_frame().unwrap()), [7_000, 0, 0, 0]);
        }
    }
    saw("200 ticks across the wrap of 16 and of 32 bits: nothing");
}

#[cfg_attr(test, test)]
fn f29_time_that_stands_or_goes_back_is_never_fresh_for_ever() {
    // Back by as much, while the loop goes on and sets a target in each round.
    for back in [1, 5, 9, 11, 1_000, 3_000_000] {
        let start = 4_000_000;
        let mut bus = Bus::new();
        let wheel = bus.attach(at_once::<M3508>(1)).unwrap();
        _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(start));
        bus.arm(at_ms(start)).unwrap();
        step(&mut bus, start);
        bus.set_raw(wheel, 700).unwrap();
        assert_eq!(step(&mut bus, start + 1), Some([700, 0, 0, 0]));
        bus.set_raw(wheel, 700).unwrap();
        assert_eq!(step(&mut bus, start + 1 - back), Some([0; 4]), "back by {back} ms");
        for round in 1..200 {
            assert_eq!(bus.set_raw(wheel, 700), Err(TargetError::Relaxed));
            let sent = step(&mut bus, start + 1 - back + round);
            assert!(sent.is_none_or(|words| words == [0; 4]), "back by {back} ms: {round}");
        }
        safe_after(1);
        // Heard again, it is online, and takes targets when it is armed anew.
        let now = start + 201 - back;
        for round in 0..20 {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(now + round));
            step(&mut bus, now + round);
        }
        assert_eq!(bus.link(wheel), Some(Link::Online), "{back}");
        assert_eq!(bus.set_raw(wheel, 700), Err(TargetError::Relaxed));
        assert_eq!(bus.arm(at_ms(now + 19)), Ok(()));
        bus.set_raw(wheel, 700).unwrap();
        assert_eq!(step(&mut bus, now + 20), Some([700, 0, 0, 0]));
        let told: Vec<_> = std::iter::from_fn(|| bus.next_edge()).collect();
        let fault = told.iter().find(|edge| edge.condition == Condition::ClockFault).unwrap();
        let off = at_ms(start + 1 - back).since(fault.at);
        assert!(fault.began && off < Duration::from_micros(1_024), "{told:?}");
    }
    // Standing: the runner has no tick for as long as a clock may be coarse, and a tick by hand sends zeros.
    let clock = Cell::new(at_ms(10));
    let (bus, [wheel]) = armed([Config::new(1)]);
    let world = Simulation::new(1);
    let mut runner = Runner::new(Nb(world.controller()), &clock, bus);
    let tick = runner.due().unwrap();
    _ = runner.ingest(&feedback(0x201, 0, 0), at_ms(10));
    runner.device_mut().set_raw(wheel, 700).unwrap();
    runner.tick(tick);
    assert!((0..1_000).all(|_| runner.due().is_none()));
    assert_eq!(runner.next_edge(), None, "a clock may be coarse");
    assert!(runner.is_armed());
    for _ in 0..3 {
        runner.tick(Tick::new(at_ms(10), 0.0));
        assert!(!runner.is_armed());
        assert_eq!(runner.device_mut().set_raw(wheel, 700), Err(TargetError::Relaxed));
    }
    assert_eq!(runner.device().counters().bad_steps, 3);
    assert_eq!(runner.statistics().clock_standstills, 3);
    let edge = runner.next_edge().unwrap();
    assert_eq!((edge.condition, edge.at), (BusCondition::ClockStandstill, at_ms(10)));
    // Back: a tick at once, for the zeros, and the ticks go on from there.
    clock.set(at_ms(3));
    for _ in 0..2 {
        assert_eq!(runner.due(), Some(Tick::new(at_ms(3), 0.0)), "due until it is run");
    }
    assert_eq!(runner.statistics().clock_reversals, 1);
    let edge = runner.next_edge().unwrap();
    assert_eq!(
        (edge.condition, edge.at, edge.began),
        (BusCondition::ClockReversal, at_ms(3), true)
    );
    // Ticks by hand that go back are counted as well, once.
    for ms in [12, 11, 12, 13] {
        clock.set(at_ms(ms));
        _ = runner.poll(1);
        _ = runner.due();
        runner.tick(Tick::new(at_ms(ms), 0.001));
    }
    assert_eq!(runner.statistics().clock_reversals, 2);
    let others: Vec<_> = runner.edges().map(|edge| edge.condition).collect();
    assert_eq!(others, [BusCondition::TickOverrun], "going back is one condition that lasts");
    saw(
        "zero in the same cycle, back by 1 ms to 50 min or standing; online again, relaxed until armed",
    );
}

#[cfg_attr(test, test)]
fn f30_a_motor_unheard_for_longer_than_any_counter_stays_offline() {
    for days in [1_u64, 50, 5_000] {
        let (mut bus, [wheel]) = armed([Config::new(1)]);
        for ms in (2..300).step_by(1) {
            step(&mut bus, ms);
        }
        assert_eq!(bus.link(wheel), Some(Link::Offline));
        // Exactly where a stamp of 32 bits looks fresh again.
        let wraps = days * 86_400_000_000 / (1 << 32) + 1;
        for micros in [1_000, 5_000] {
            bus.update(Tick::new(Instant::from_micros(wraps * (1 << 32) + micros), 0.001));
            assert_eq!(bus.link(wheel), Some(Link::Offline));
            assert_eq!(bus.set_raw(wheel, 5), Err(TargetError::Relaxed));
        }
    }
    saw("offline after 1, 50 and 5000 days, where 32 bits look fresh");
}

#[cfg_attr(test, test)]
fn f31_a_bad_time_step_holds_once_and_is_counted() {
    for bad in [0.0, -0.0, -0.001, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let (mut bus, [wheel]) = armed([Config::new(1).speed_loop(SPEED)]);
        let run = |bus: &mut Bus, ms| {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            bus.set_velocity(wheel, rpm(100.0)).unwrap();
            step(bus, ms).unwrap()[0]
        };
        let before = run(&mut bus, 2);
        bus.update(Tick::new(at_us(2_500), bad));
        assert_eq!(words(&bus.next_frame().unwrap())[0], before, "held");
        let after = run(&mut bus, 3);
        assert!(after >= before && after - before < 100, "goes on: {before}, {after}");
        for us in [3_300, 3_600] {
            bus.update(Tick::new(at_us(us), bad));
        }
        assert_eq!(words(&bus.next_frame().unwrap())[0], 0, "only once");
        assert_eq!(bus.counters().bad_steps, 3);
        let again = run(&mut bus, 4);
        assert!(again >= after && again - after < 100, "not latched: {after}, {again}");
        // Where the time does not move on either, nothing is held: F29.
        bus.update(Tick::new(at_ms(4), bad));
        assert_eq!(words(&bus.next_frame().unwrap())[0], 0, "time stands");
        assert_eq!(bus.set_velocity(wheel, rpm(100.0)), Err(TargetError::Relaxed));
        assert_eq!(bus.counters().bad_steps, 4);
    }
    saw("held once where time moves on, then zero; zero at once where it stands; each counted");
}

#[cfg_attr(test, test)]
fn f32_a_huge_time_step_moves_no_integral() {
    let integral = PidConfig::new(0.0, 1.0, 0.0);
    for dt_s in [0.021, 10.0, 1e30] {
        let (mut bus, [wheel]) = armed([Config::new(1).speed_loop(integral)]);
        let run = |bus: &mut Bus, ms, dt_s| {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            bus.set_velocity(wheel, rpm(300.0)).unwrap();
            bus.update(Tick::new(at_ms(ms), dt_s));
            bus.next_frame().map_or(0, |frame| words(&frame)[0])
        };
        let before = (2..50).map(|ms| run(&mut bus, ms, 0.001)).last().unwrap();
        assert!(before > 500);
        let late = run(&mut bus, 50, dt_s);
        assert!((late - before).abs() <= 26, "{before} to {late}"); // half a tick at most
    }
    let clock = Cell::new(at_ms(1));
    let world = Simulation::new(1);
    let mut runner = Runner::new(Nb(world.controller()), &clock, Bus::new());
    let tick = runner.due().unwrap();
    runner.tick(tick);
    clock.set(clock.get() + Duration::from_secs(10));
    let tick = runner.due().unwrap();
    runner.tick(tick);
    assert_eq!(runner.statistics().overruns, 9_999);
    let edges: Vec<_> = runner.edges().map(|edge| (edge.condition, edge.at)).collect();
    assert_eq!(edges, [(BusCondition::TickOverrun, at_ms(10_001))]);
    saw("steps of 21 ms to 1e30 s move nothing, 9999 overruns counted");
}

#[cfg_attr(test, test)]
fn f33_recovery_takes_ten_good_frames_and_starts_from_zero() {
    let (mut bus, [wheel]) = armed([Config::new(1).speed_loop(PidConfig::new(0.0, 5.0, 0.0))]);
    for ms in 2..40 {
        _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
        bus.set_velocity(wheel, rpm(300.0)).unwrap();
        step(&mut bus, ms);
    }
    for ms in 40..160 {
        step(&mut bus, ms);
    }
    // Nine good frames, a pause, and the count begins again.
    for ms in (160..169).chain(185..194) {
        _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
        step(&mut bus, ms);
        assert_eq!(bus.link(wheel), Some(Link::Recovering), "{ms}");
    }
    _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(194));
    assert_eq!(bus.link(wheel), Some(Link::Online));
    assert_eq!(bus.set_velocity(wheel, rpm(300.0)), Err(TargetError::Relaxed), "waits for arming");
    assert_eq!(bus.arm(at_ms(194)), Err(ArmError::NotReleased), "54 ms after it was lost");
    for ms in 195..295 {
        _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
        assert_eq!(bus.set_velocity(wheel, rpm(300.0)), Err(TargetError::Relaxed));
        assert!(step(&mut bus, ms).is_none_or(|words| words[0] == 0), "{ms}");
    }
    bus.arm(at_ms(294)).unwrap();
    bus.set_velocity(wheel, rpm(300.0)).unwrap();
    let first = step(&mut bus, 295).unwrap()[0];
    assert!(first < 200, "the old integral is gone: {first}");

    let world = Simulation::new(2);
    let opening = Duration::from_millis(200);
    let mut rig =
        Rig::with(&world, Line::Can1, 1, |config| config.with_resume().with_opening(opening));
    world.fault(Fault::Silent(rig.keys[0]), at_ms(300)..at_ms(500)).unwrap();
    rig.drive(800);
    let back = rig.words(0, 500, 800).into_iter().find(|word| *word != 0).unwrap();
    assert!((1..2_000).contains(&back), "from zero: {back}");
    saw(format!("ten good frames; then {first} after arming, {back} of 16384 on a ramp"));
}

/// Numbers without pattern: xorshift.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

fn at_us(us: u64) -> Instant {
    Instant::from_micros(us)
}

/// Whether the motor is driven after an update.
fn is_driven(bus: &mut Bus, now_us: u64, driven: bool) -> bool {
    bus.update(Tick::new(at_us(now_us), 0.001));
    core::iter::from_fn(|| bus.next_frame()).last().map_or(driven, |frame| words(&frame)[0] != 0)
}

#[cfg_attr(test, test)]
fn f24_a_million_silences_end_with_the_first_tick_after_the_limit() {
    let (mut random, mut longest) = (Random(0x5EED), 0);
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    let mut now = 2_000;
    for _ in 0..1_000_000 {
        now += 1 + random.below(3_000);
        let heard = now;
        _ = bus.ingest(&feedback(0x201, 0, 0), at_us(heard));
        now += random.below(1_000);
        let mut driven = is_driven(&mut bus, now, false);
        bus.set_raw(wheel, 500).unwrap();
        while now <= heard + 10_000 {
            // Ticks of 1 ms, each up to 200 us late.
            now += 1_000 + random.below(200);
            driven = is_driven(&mut bus, now, driven);
            assert_eq!(driven, now <= heard + 10_000, "heard at {heard}, now {now}");
            _ = bus.set_raw(wheel, 500);
        }
        longest = longest.max(now - heard);
    }
    safe_after(longest.div_ceil(1_000));
    saw(format!("1000000 silences, {longest} us at most"));
}

#[cfg_attr(test, test)]
fn f26_a_million_hung_applications_end_with_the_first_tick_after_the_deadline() {
    let (mut random, mut longest) = (Random(0xDEAD), 0);
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    let mut now = 2_000;
    for _ in 0..1_000_000 {
        let tick = |bus: &mut Bus, now: u64, driven| {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_us(now));
            is_driven(bus, now, driven)
        };
        now += 1 + random.below(3_000);
        let mut driven = tick(&mut bus, now, false);
        let commanded = now;
        bus.set_raw(wheel, 500).unwrap();
        while now <= commanded + 100_000 {
            // Long strides first, then ticks.
            let far = now + 12_000 < commanded + 100_000;
            now += if far { 9_000 } else { 1_000 } + random.below(200);
            driven = tick(&mut bus, now, driven);
            assert_eq!(driven, now <= commanded + 100_000, "commanded at {commanded}, now {now}");
        }
        longest = longest.max(now - commanded);
    }
    safe_after(longest.div_ceil(1_000));
    saw(format!("1000000 hung applications, {longest} us at most"));
}
