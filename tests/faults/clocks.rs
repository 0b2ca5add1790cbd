//! F65 to F67 and F71: clocks that are wrong, and ages that would hide it.
//!
//! None of these compiles at 330c201; each comment says what was seen there.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{armed, at_ms, at_once, feedback, step, words};
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Condition, Devices, Link, TargetError, Timeouts};
use drivetrain::runner::{BusCondition, Nb, Runner};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::Current;
use embedded_can::ErrorKind;
use std::cell::Cell;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f65_a_clock_that_wraps_early_or_swings_drives_no_longer_than_the_deadline,
    f66_a_clock_that_is_set_back_gives_zeros_at_once_and_as_long_as_needed,
    f67_a_clock_that_stands_gives_zeros_within_200_000_polls,
    f67_a_clock_that_stops_gives_zeros_within_a_second_in_slow_and_fast_loops,
    f67_a_clock_that_stands_gives_zeros_within_1_600_frames,
    f67_a_clock_that_wanders_within_a_tick_stands,
    f71_ages_that_would_drive_blindly_are_refused,
];

fn at_us(us: u64) -> Instant {
    Instant::from_micros(us)
}

/// 5 A of 20 A.
const WORD: i16 = 4_096;

fn five_amperes(bus: &mut Bus, wheel: Handle<M3508>) -> Result<(), TargetError> {
    bus.set_current(wheel, Current::from_amperes(5.0))
}

/// One motor on each of `N` buses, the first one in 0x200, the second one in 0x1FF.
fn buses<const N: usize>() -> ([Bus; N], [Handle<M3508>; N]) {
    let mut buses = [const { Bus::new() }; N];
    let mut ids = [1, 5].into_iter();
    let wheels = buses.each_mut().map(|bus| bus.attach(at_once(ids.next().unwrap())).unwrap());
    (buses, wheels)
}

/// What a drive does that keeps its last word: tick by tick, while nothing but feedback comes.
#[derive(Debug, Default)]
struct Dead {
    /// In so many ticks after the first one.
    driven: u64,
    /// The time that the clock showed for them, its backward steps left out.
    forward_us: u64,
}

/// Each motor is armed and asked for 5 A in tick 0; then the application is dead. Tick `n` has the time `clock(n)`.
fn after_one_target<const N: usize>(ticks: u64, clock: impl Fn(u64) -> u64) -> Dead {
    let (mut device, wheels) = buses::<N>();
    let (mut dead, mut held) = (Dead::default(), [0; N]);
    for tick in 0..=ticks {
        let now = clock(tick);
        for id in [0x201, 0x205] {
            _ = device.ingest(&feedback(id, 0, 0), at_us(now));
        }
        if tick == 0 {
            device.arm(at_us(now)).unwrap();
            for (bus, wheel) in device.iter_mut().zip(wheels) {
                five_amperes(bus, wheel).unwrap();
            }
        }
        device.update(Tick::new(at_us(now), 0.001));
        let was_driven = held != [0; N];
        while let Some(frame) = device.next_frame(0) {
            held[usize::from(frame.header() == 0x1FF)] = words(&frame)[0];
        }
        if tick == 0 {
            assert_eq!(held, [WORD; N], "it has to be driven first");
        } else if held != [0; N] {
            assert!(was_driven, "driven again at {now} us, tick {tick}");
            dead.driven += 1;
            dead.forward_us += now.saturating_sub(clock(tick - 1));
        }
    }
    assert_eq!(held, [0; N], "for ever: {dead:?}");
    assert!(!device.is_armed() || dead.forward_us > 99_000, "{dead:?}");
    dead
}

/// At 330c201: driven in 9699 of 9699 ticks where the clock wraps, in 19 699 of 19 700 where it swings.
#[cfg_attr(test, test)]
fn f65_a_clock_that_wraps_early_or_swings_drives_no_longer_than_the_deadline() {
    let mut longest = 0;
    let mut check = |what: &str, period_us: u64, clock: &dyn Fn(u64) -> u64| {
        for dead in [after_one_target::<1>(9_700, clock), after_one_target::<2>(9_700, clock)] {
            assert!(dead.forward_us <= 101_000, "{what}: {dead:?}");
            // A clock that wraps in a tick, but for a microsecond, is a slow one: the deadline is in its own time.
            if period_us == 1_000 {
                assert!(dead.driven <= 100, "{what}: {dead:?}");
                longest = longest.max(dead.driven);
            }
        }
    };
    for bits in 8..=32 {
        // It wraps within 50 ms, or after the deadline where it can, and ever again.
        for ahead_us in [50_000, 250_000] {
            let start = (1_u64 << bits) - ahead_us % (1 << bits);
            for period_us in [1_000, 1_001, 1_025, 733] {
                let clock = |tick| (start + tick * period_us) % (1 << bits);
                check(&format!("{bits} bits, {period_us} us"), period_us, &clock);
            }
        }
    }
    for swing_us in [1, 20, 1_000, 9_999, 50_000, 1_000_000, 3_600_000_000] {
        for every in [1, 2, 7] {
            let clock = |tick: u64| 10_000_000 + tick / every % 2 * swing_us;
            check(&format!("{swing_us} us, every {every}"), 1_000, &clock);
            // As it goes on, at half the speed.
            let clock = |tick: u64| clock(tick) + 500 * tick;
            check(&format!("{swing_us} us, every {every}, going on"), 0, &clock);
        }
    }
    safe_after(longest + 1);
    saw(format!("wraps of 8 to 32 bits and swings of 1 us to 1 h: {longest} ticks of 9700 driven"));
}

/// Takes every frame, and has those that are to be received.
#[derive(Default)]
struct Wire {
    /// The word that the drive got last.
    held: i16,
    frames: u64,
    waiting: Option<CanFrame>,
}

impl embedded_can::nb::Can for Wire {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        self.held = words(frame)[0];
        self.frames += 1;
        Ok(None)
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.waiting.take().ok_or(nb::Error::WouldBlock)
    }
}

/// A motor behind a runner, at a loop that turns each 250 us: its clock is right until a test breaks it.
struct Shell<'c> {
    runner: Runner<Nb<Wire>, &'c Cell<Instant>, Bus>,
    wheel: Handle<M3508>,
}

const TURN_US: u64 = 250;

/// From where a clock can be set back by 10 s.
const ORIGIN: Instant = Instant::from_micros(20_000_000);

impl<'c> Shell<'c> {
    /// Armed, with a first tick.
    fn armed(clock: &'c Cell<Instant>) -> Self {
        let (mut bus, wheel) = (Bus::new(), at_once::<M3508>(1));
        let wheel = bus.attach(wheel).unwrap();
        clock.set(ORIGIN);
        let mut shell = Self { runner: Runner::new(Nb(Wire::default()), clock, bus), wheel };
        _ = shell.runner.ingest(&feedback(0x201, 0, 0), ORIGIN);
        shell.runner.arm(Tick::new(ORIGIN, 0.001)).unwrap();
        assert!(shell.go_on(true), "the grid of the ticks begins here");
        shell
    }

    /// Driven at 5 A for 300 ms, until just after a tick.
    fn driving(clock: &'c Cell<Instant>) -> Self {
        let mut shell = Self::armed(clock);
        while clock.get() < ORIGIN + Duration::from_millis(300) {
            clock.set(clock.get() + Duration::from_micros(TURN_US));
            shell.turn(true);
        }
        assert_eq!((shell.held(), shell.runner.is_armed()), (WORD, true));
        shell
    }

    /// One turn of the loop, with feedback; whether there was a tick.
    fn turn(&mut self, asks: bool) -> bool {
        self.runner.port_mut().0.waiting = Some(feedback(0x201, 0, 0));
        self.runner.poll(4);
        self.go_on(asks)
    }

    /// One turn of the loop, without feedback.
    fn go_on(&mut self, asks: bool) -> bool {
        let Some(tick) = self.runner.due() else { return false };
        if asks {
            _ = five_amperes(self.runner.device_mut(), self.wheel);
        }
        self.runner.tick(tick);
        true
    }

    fn held(&mut self) -> i16 {
        self.runner.port_mut().0.held
    }

    fn frames(&mut self) -> u64 {
        self.runner.port_mut().0.frames
    }

    fn told(&mut self, condition: BusCondition) -> bool {
        self.runner.edges().any(|edge| edge.condition == condition && edge.began)
    }
}

/// At 330c201: no frame for as long as the clock was behind, `is_armed` true, then the old target for up to 99 ms.
#[cfg_attr(test, test)]
fn f66_a_clock_that_is_set_back_gives_zeros_at_once_and_as_long_as_needed() {
    let mut longest_us = 0;
    for back_ms in [1, 2, 20, 99, 150, 1_000, 10_000] {
        for (lives, since_tick_us) in [(false, 0), (true, 0), (false, 500), (true, 500)] {
            let clock = Cell::new(ORIGIN);
            let mut shell = Shell::driving(&clock);
            for _ in 0..since_tick_us / TURN_US {
                clock.set(clock.get() + Duration::from_micros(TURN_US));
                assert!(!shell.turn(lives));
            }
            // The turn that reads the clock first after it was set back.
            let behind = clock.get().as_micros() + TURN_US - 1_000 * back_ms;
            clock.set(at_us(behind));
            assert!(shell.turn(lives), "a tick in the first turn");
            assert_eq!(shell.held(), 0, "back by {back_ms} ms, {since_tick_us} us after a tick");
            assert!(!shell.runner.is_armed() && shell.told(BusCondition::ClockReversal));
            // Until the clock is where it was, and longer: frames, and none of them drives.
            let (mut frames, mut since_us) = (shell.frames(), 0);
            for _ in 0..(back_ms + 300) * 1_000 / TURN_US {
                clock.set(clock.get() + Duration::from_micros(TURN_US));
                shell.turn(lives);
                assert!(shell.held() == 0 && !shell.runner.is_armed());
                since_us = if shell.frames() == frames { since_us + TURN_US } else { 0 };
                longest_us = longest_us.max(since_us);
                frames = shell.frames();
            }
            // It is not stuck: armed anew it drives.
            let tick = Tick::new(clock.get(), 0.001);
            assert_eq!(shell.runner.arm(tick), Ok(()));
            clock.set(clock.get() + Duration::from_millis(1));
            assert!(shell.turn(true) && shell.held() == WORD);
        }
    }
    assert!(longest_us <= 11_000, "{longest_us} us without a frame");
    safe_after(1);
    saw(format!("back by 1 ms to 10 s: zero at once, then a frame each {longest_us} us or sooner"));
}

/// Turns the loop until the drive is at rest; returns how many turns it took, which has to be `most` or less.
fn turns_to_rest(shell: &mut Shell<'_>, most: u32, mut turn: impl FnMut(&mut Shell<'_>)) -> u32 {
    let turns = (1..=most).find(|_| {
        turn(shell);
        shell.held() == 0
    });
    assert!(turns.is_some(), "still {} after {most} turns", shell.held());
    turns.unwrap_or(most)
}

/// At 330c201: not one frame in 3 000 000 polls; an edge after 800 999 polls changed nothing.
#[cfg_attr(test, test)]
fn f67_a_clock_that_stands_gives_zeros_within_200_000_polls() {
    let mut longest = 0;
    for (lives, since_tick_us) in [(false, 0), (true, 0), (false, 1), (true, 400), (false, 999)] {
        let clock = Cell::new(ORIGIN);
        let mut shell = Shell::driving(&clock);
        clock.set(clock.get() + Duration::from_micros(since_tick_us));
        let turns = turns_to_rest(&mut shell, 200_001, |shell| _ = shell.go_on(lives));
        longest = longest.max(turns);
        assert!(!shell.runner.is_armed() && shell.told(BusCondition::ClockStandstill));
        assert_eq!(shell.runner.statistics().clock_standstills, 1);
        let fault = std::iter::from_fn(|| shell.runner.device_mut().next_edge())
            .find(|edge| edge.condition == Condition::ClockFault);
        assert!(fault.is_some_and(|edge| edge.began));
        // They are repeated, for a drive that did not get them.
        let frames = shell.frames();
        for _ in 0..400_002 {
            shell.go_on(lives);
            assert_eq!(shell.held(), 0);
        }
        assert!(shell.frames() >= frames + 2, "{since_tick_us}");
        // It goes on again: the old target does not.
        for _ in 0..400 {
            clock.set(clock.get() + Duration::from_micros(TURN_US));
            shell.turn(lives);
            assert_eq!(shell.held(), 0);
        }
    }
    saw(format!("stands: zero after {longest} polls"));
}

/// A loop that waits 1 ms in each turn, and hears nothing any more, read the clock 200 000 times in 200 s.
#[cfg_attr(test, test)]
fn f67_a_clock_that_stops_gives_zeros_within_a_second_in_slow_and_fast_loops() {
    let mut longest_us = 0;
    // The turn of the loop, the resolution of the clock, the bound: in us.
    for (turn_us, resolution_us, bound_us) in [
        (1, 1, 2_000),
        (1, 1_000, 100_000),
        (1, 10_000, 200_000),
        (100, 1, 100_000),
        (250, 1, 250_000),
        (1_000, 1, 1_000_000),
        (1_000, 250, 1_000_000),
    ] {
        let clock = Cell::new(ORIGIN);
        let mut shell = Shell::armed(&clock);
        let mut heard_us = 0;
        for turn in 0..500_000 / turn_us {
            // A wait is never quite regular.
            let true_us = turn * turn_us + turn % 3 * turn_us / 3;
            clock.set(at_us(ORIGIN.as_micros() + true_us / resolution_us * resolution_us));
            if true_us >= heard_us {
                shell.turn(true);
                heard_us += 1_000;
            } else {
                shell.go_on(true);
            }
            assert!(shell.runner.is_armed(), "{turn_us} us, {resolution_us} us: {true_us} us");
        }
        assert_eq!(shell.held(), WORD);
        // It stands while the motor is driven, and nothing is heard.
        let turns = turns_to_rest(&mut shell, 200_001, |shell| _ = shell.go_on(true));
        assert!(!shell.runner.is_armed() && shell.told(BusCondition::ClockStandstill));
        let stood_us = u64::from(turns) * turn_us;
        assert!(stood_us <= bound_us, "{turn_us} us, {resolution_us} us: {stood_us} us");
        longest_us = longest_us.max(stood_us);
    }
    saw(format!("stops in loops of 1 us to 1 ms: zero after {} ms", longest_us / 1_000));
}

/// A loop that sleeps until the interrupt of the CAN controller wakes it up polls once a frame: 1 600 frames take a bus of
/// 1 Mbit/s 80 ms at least. At 330c201, 1 000 000 readings were as many frames.
#[cfg_attr(test, test)]
fn f67_a_clock_that_stands_gives_zeros_within_1_600_frames() {
    let mut longest = 0;
    for (lives, since_tick_us) in [(false, 0), (true, 0), (false, 1), (true, 400), (false, 999)] {
        let clock = Cell::new(ORIGIN);
        let mut shell = Shell::driving(&clock);
        clock.set(clock.get() + Duration::from_micros(since_tick_us));
        let turns = turns_to_rest(&mut shell, 1_600, |shell| _ = shell.turn(lives));
        assert!(!shell.runner.is_armed() && shell.told(BusCondition::ClockStandstill));
        longest = longest.max(turns);
    }
    saw(format!("of a loop that wakes up for frames: after {longest}"));
}

/// Milliseconds that an interrupt counts, with a counter for the microseconds of each: where the interrupt is dead, the clock
/// turns in its last millisecond for ever. No reading repeats the one before, and none lies behind the last tick.
/// At 330c201, no tick and no frame for ever.
#[cfg_attr(test, test)]
fn f67_a_clock_that_wanders_within_a_tick_stands() {
    let mut longest = 0;
    for step_us in [1, 7, 250, 333, 999] {
        let clock = Cell::new(ORIGIN);
        let mut shell = Shell::driving(&clock);
        let (last, mut turn) = (clock.get(), 0);
        let turns = turns_to_rest(&mut shell, 210_000, |shell| {
            turn += 1;
            clock.set(last + Duration::from_micros(turn * step_us % 1_000));
            shell.go_on(false);
        });
        longest = longest.max(turns);
        assert!(!shell.runner.is_armed() && shell.told(BusCondition::ClockReversal), "{step_us}");
    }
    saw(format!("turns within a millisecond: after {longest} polls"));
}

/// At 330c201: late after 10 s and offline after 1 ms was taken, and drove for 10 s without feedback.
#[cfg_attr(test, test)]
fn f71_ages_that_would_drive_blindly_are_refused() {
    let (ms, defaults) = (Duration::from_millis, Timeouts::new());
    let longest = Duration::from_micros(u64::MAX);
    for (late, offline, parameter) in [
        (ms(10_000), ms(1), "late in us"),
        (ms(1_001), ms(2_000), "late in us"),
        (Duration::ZERO, ms(100), "late in us"),
        (longest, longest, "late in us"),
        (ms(40), ms(39), "offline in us"),
        (ms(40), ms(10_001), "offline in us"),
        (ms(40), longest, "offline in us"),
    ] {
        let refused: Result<Timeouts, ConfigError> = defaults.with_feedback(late, offline);
        assert_eq!(refused.unwrap_err().parameter(), parameter, "{late:?} {offline:?}");
    }
    for command in [Duration::ZERO, ms(1_001), longest] {
        assert_eq!(defaults.with_command(command).unwrap_err().parameter(), "command in us");
    }
    for measured in [Duration::ZERO, Duration::from_micros(999), ms(1_001), longest] {
        assert_eq!(defaults.with_measured(measured).unwrap_err().parameter(), "measurement in us");
    }
    let told = defaults.with_feedback(ms(10_000), ms(1)).unwrap_err().to_string();
    assert_eq!(told, "late in us 10000000: 1 to 1000000 are allowed");

    // The longest that is taken: no motor is driven longer without feedback, or without a target.
    let slowest =
        defaults.with_feedback(ms(1_000), ms(10_000)).unwrap().with_command(ms(1_000)).unwrap();
    for (heard, asked) in [(false, true), (true, false)] {
        let (bus, [wheel]) = armed([Config::new(1)]);
        let mut bus: Bus = bus.with_timeouts(slowest);
        bus.set_raw(wheel, 700).unwrap();
        let mut driven = 0;
        let mut word = 0;
        for ms in 2..5_000 {
            if heard {
                _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            }
            if asked && bus.link(wheel) == Some(Link::Online) {
                bus.set_raw(wheel, 700).unwrap();
            }
            word = step(&mut bus, ms).map_or(word, |words| words[0]);
            driven += u64::from(word != 0);
        }
        assert_eq!(driven, 1_000, "heard: {heard}, asked: {asked}");
    }
    assert_eq!(Timeouts::new().with_good_frames(0).good_frames(), 1);
    saw(told);
}
