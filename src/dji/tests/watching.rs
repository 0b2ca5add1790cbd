//! What a look at one motor finds, case by case: its feedback is written here, and nothing is simulated.

use super::*;
use crate::motor::{Condition, Conditions, HealthConfig, Reaction};

/// What a motor tells. It turns, unless said otherwise: the angle of each frame differs from the one before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Told {
    pub(super) rpm: i16,
    pub(super) current: i16,
    pub(super) celsius: u8,
    pub(super) code: u8,
    pub(super) counts_per_ms: u16,
}

pub(super) const CALM: Told =
    Told { rpm: 100, current: 0, celsius: 30, code: 0, counts_per_ms: 14 };

/// One motor on a bus, armed, in the millisecond `ms`.
pub(super) struct Bench<M: Model> {
    pub(super) bus: Bus,
    pub(super) motor: Handle<M>,
    pub(super) ms: u64,
    pub(super) angle: u16,
}

impl<M: Model> Bench<M> {
    pub(super) fn new(config: Config<M>) -> Self {
        let (bus, [motor]) = armed([config]);
        Self { bus, motor, ms: 1, angle: 0 }
    }

    fn with_health(health: &'static HealthConfig) -> Self {
        Self::new(Config::at_once(1).with_health(health))
    }

    pub(super) fn hear(&mut self, told: Told) {
        self.angle = (self.angle + told.counts_per_ms) % 8_192;
        let ([a, b], [c, d]) = (self.angle.to_be_bytes(), told.rpm.to_be_bytes());
        let [e, f] = told.current.to_be_bytes();
        let data = [a, b, c, d, e, f, told.celsius, told.code];
        let frame = CanFrame::standard(M::FACTS.feedback_base + 1, data).unwrap();
        // Somewhat before the tick, as on a bus.
        let at = Instant::from_micros(1_000 * self.ms - 300);
        assert_eq!(self.bus.ingest(&frame, at), Ingest::Taken);
    }

    /// A tick of 1 ms: a frame, a raw command, an update. Returns the word that is sent.
    pub(super) fn tick(&mut self, told: Told, raw: i16) -> i16 {
        self.ms += 1;
        self.hear(told);
        _ = self.bus.set_raw(self.motor, raw);
        step(&mut self.bus, self.ms);
        sent(&mut self.bus).last().map_or(0, |(_, words)| words[0])
    }

    pub(super) fn run(&mut self, ms: u64, told: Told, raw: i16) -> Conditions {
        for _ in 0..ms {
            self.tick(told, raw);
        }
        self.bus.conditions(self.motor)
    }

    /// Speeds up by `rpm_per_ms` for so long.
    fn speed_up(&mut self, ms: i16, rpm_per_ms: i16, current: i16, raw: i16) -> Conditions {
        for elapsed in 0..ms {
            let rpm = 100 + elapsed * rpm_per_ms;
            self.tick(Told { rpm, current, ..CALM }, raw);
        }
        self.bus.conditions(self.motor)
    }
}

pub(super) const SOUND: Conditions = Conditions::NONE;

#[test]
fn a_turning_motor_is_warm_from_the_degree_on_that_says_so() {
    for (celsius, expected) in [(124, SOUND), (125, SOUND.with(Condition::Warm))] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1));
        assert_eq!(bench.run(30, Told { celsius, ..CALM }, 500), expected, "{celsius} °C");
        assert_eq!(bench.run(30, CALM, 500), SOUND);
    }
}

#[test]
fn a_motor_that_turns_too_fast_is_noticed_while_its_angle_changes_and_is_sound_again_after_it() {
    for rpm in [18_600, -18_600] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1));
        bench.run(10, CALM, 0);
        assert_eq!(bench.run(30, Told { rpm: rpm / 20 * 19, ..CALM }, 0), SOUND, "17670 rpm");
        let fast = bench.run(13, Told { rpm, ..CALM }, 0);
        assert_eq!(fast, SOUND.with(Condition::Overspeed), "{rpm} rpm of 9256");
        assert_eq!(bench.run(13, Told { celsius: 0, ..CALM }, 0), SOUND);
    }
}

#[test]
fn a_motor_that_drives_itself_and_one_that_turns_against_its_command_run_away() {
    let runaway = SOUND.with(Condition::Runaway);
    for (raw, current, expected) in [
        (0, 4_000, runaway),
        (0, 3_000, SOUND), // pushed from outside
        (-9_000, 0, runaway),
        (-7_000, 0, SOUND),
        (5_000, 4_000, SOUND),
    ] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1));
        bench.run(50, CALM, 0);
        assert_eq!(bench.speed_up(300, 15, current, raw), expected, "{raw} and {current}");
    }
    // A fifth of a C610's current is the least that counts.
    for (current, expected) in [(2_000, runaway), (1_999, SOUND)] {
        let mut bench = Bench::new(Config::<M2006>::at_once(1));
        bench.run(50, CALM, 0);
        assert_eq!(bench.speed_up(300, 30, current, 0), expected, "{current}");
    }
}

/// It crawls: the angle changes, but at 1 % of the no-load speed.
#[test]
fn a_motor_that_crawls_is_stalled_from_the_effort_on_that_says_so() {
    static WEAK: HealthConfig =
        HealthConfig::new().with_stall(0.3, 0.02, Duration::from_millis(200));
    static USUAL: HealthConfig =
        HealthConfig::new().with_stall(0.5, 0.02, Duration::from_millis(200));
    for (health, raw, stalls) in
        [(&WEAK, 4_900, false), (&WEAK, 4_916, true), (&USUAL, 8_191, false), (&USUAL, 8_192, true)]
    {
        let mut bench = Bench::<M3508>::with_health(health);
        let expected = if stalls { SOUND.with(Condition::Stalled) } else { SOUND };
        assert_eq!(bench.run(260, CALM, raw), expected, "{raw}");
        assert_eq!(bench.run(13, Told { rpm: 500, ..CALM }, raw), SOUND, "it turns");
    }
}

#[test]
fn an_angle_that_stands_still_while_the_speed_says_otherwise_is_frozen() {
    let stuck = Told { rpm: 600, counts_per_ms: 0, ..CALM };
    let mut bench = Bench::new(Config::<M3508>::at_once(1));
    assert_eq!(bench.run(90, stuck, 0), SOUND);
    assert_eq!(bench.run(40, stuck, 0), SOUND.with(Condition::Frozen));
    assert_eq!(bench.run(13, Told { rpm: 600, ..CALM }, 0), SOUND);
}

/// At rest the same bits may come for ever. They contradict a command that has changed by a fifth of full scale, when not even
/// the current answers.
#[test]
fn feedback_that_does_not_answer_a_command_is_frozen_and_one_whose_current_answers_is_not() {
    let still = Told { rpm: 0, counts_per_ms: 0, ..CALM };
    for (raw, answer, expected) in [
        (0, 0, SOUND),
        (2_900, 0, SOUND),
        (3_100, 0, SOUND.with(Condition::Frozen)),
        (-3_400, 0, SOUND.with(Condition::Frozen)),
        (3_100, 3_000, SOUND),
    ] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1));
        bench.run(60, still, 0);
        for tick in 0..200 {
            // A current that is measured is never quiet.
            bench.tick(
                Told { current: answer + if answer == 0 { 0 } else { tick % 7 }, ..still },
                raw,
            );
        }
        assert_eq!(bench.bus.conditions(bench.motor), expected, "{raw}, {answer}");
    }
}

/// The full check costs each update: it is kept for a motor that needs it.
#[test]
fn the_short_check_is_enough_for_a_motor_that_turns_and_with_which_nothing_is_wrong() {
    // Up to half of full scale is calm, and from an eighth on a current of its own is no wonder; above, the motor hardly turns.
    let cases: [(i16, i16, bool); 9] = [
        (0, 0, true),
        (0, 1_999, true),
        (0, 2_000, false),
        (2_047, 3_000, false),
        (2_048, 3_000, true),
        (-2_100, -3_000, true),
        (8_191, 0, true),
        (-8_191, 0, true),
        (8_192, 0, false),
    ];
    for (raw, current, expected) in cases {
        let mut bench = Bench::new(Config::<M3508>::at_once(1));
        bench.run(40, CALM, 500);
        bench.hear(Told { current, ..CALM });
        let motor = bench.motor.erase();
        let glance = |bench: &mut Bench<M3508>| {
            bench.bus.motors.get_mut(motor.key()).unwrap().is_well(raw, 12)
        };
        assert_eq!(glance(&mut bench), expected, "{raw} and {current}");
        // After something was wrong, and is over, a glance is enough again.
        bench.run(24, Told { celsius: 130, ..CALM }, 500);
        bench.hear(Told { current, ..CALM });
        assert!(!glance(&mut bench), "warm");
        bench.run(24, CALM, 500);
        bench.hear(Told { current, ..CALM });
        assert_eq!(glance(&mut bench), expected, "{raw} and {current}, cool again");
    }
}

/// A motor that is driven and hardly turns may stall: the short check leaves it to the full one.
#[test]
fn the_short_check_is_not_enough_for_a_motor_that_is_driven_and_stands() {
    for (rpm, expected) in [(0, false), (185, false), (186, true), (-185, false), (-186, true)] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1));
        bench.run(40, CALM, 500);
        bench.hear(Told { rpm, ..CALM });
        let slot = bench.bus.motors.get_mut(bench.motor.erase().key()).unwrap();
        assert_eq!(slot.is_well(16_384, 12), expected, "{rpm}");
    }
}

#[test]
fn looks_at_the_limit_are_counted_and_others_are_not() {
    let limited = Config::<M3508>::at_once(1).with_current_limit(Current::from_amperes(5.0));
    for (raw, range) in [(4_095, 0..=0), (4_096, 9..=11), (i16::MIN, 9..=11), (0, 0..=0)] {
        let mut bench = Bench::new(limited);
        // Each twelfth tick is a look.
        bench.run(120, Told { rpm: 2_000, counts_per_ms: 273, ..CALM }, raw);
        let health = bench.bus.health(bench.motor).unwrap();
        assert!(range.contains(&health.saturated), "{raw}: {health}");
    }
}

#[test]
fn codes_of_one_weight_that_take_turns_are_told_by_the_looks_and_not_by_the_frames() {
    let mut bench = Bench::new(Config::<M3508>::at_once(1));
    let mut told = 0;
    for tick in 0..1_200_u16 {
        bench.tick(Told { code: if tick % 2 == 0 { 3 } else { 4 }, ..CALM }, 0);
        told += core::iter::from_fn(|| bench.bus.next_edge()).count();
    }
    assert!((1..=1_200 / 12 + 1).contains(&told), "{told} edges");
}

#[test]
fn a_temperature_is_told_by_a_motor_that_is_heard_and_has_one() {
    let mut bus: Bus = Bus::new();
    let unheard = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    assert_eq!(bus.health(unheard).unwrap().temperature_c, None);
    let mut without = Bench::new(Config::<M2006>::at_once(1));
    without.run(1, CALM, 0);
    assert_eq!(without.bus.health(without.motor).unwrap().temperature_c, None);
    let mut with = Bench::new(Config::<M3508>::at_once(1));
    with.run(1, CALM, 0);
    assert_eq!(with.bus.health(with.motor).unwrap().temperature_c, Some(30));
}

/// What is not looked at any more must not be there for ever: a motor that comes back from a short silence is looked at as
/// closely as before.
#[test]
fn a_short_silence_hides_nothing_from_the_looks_after_it() {
    let silence = |bench: &mut Bench<M3508>| {
        for _ in 0..13 {
            bench.ms += 1;
            step(&mut bench.bus, bench.ms);
        }
        assert_eq!(bench.bus.link(bench.motor), Some(Link::Late));
        bench.tick(CALM, 0);
        assert_eq!(bench.bus.link(bench.motor), Some(Link::Online));
    };
    // Silent just before a second master is forgotten: the window of a second, with which all is looked at, is over.
    let mut bench = Bench::new(Config::<M3508>::at_once(1));
    bench.run(40, CALM, 0);
    let command = CanFrame::standard(0x200, [0; 8]).unwrap();
    assert_eq!(bench.bus.ingest(&command, at_ms(bench.ms)), Ingest::Unrelated);
    bench.run(984, CALM, 0);
    silence(&mut bench);
    let second = Condition::SecondMaster;
    assert!(bench.bus.conditions(bench.motor).contains(second));
    assert!(!bench.run(20, CALM, 0).contains(second), "a second and a look later");

    static REPORT: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Fault, Reaction::Report);
    static IGNORE: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Fault, Reaction::Ignore);
    for (health, told) in [(&REPORT, true), (&IGNORE, false)] {
        let mut bench = Bench::<M3508>::with_health(health);
        bench.run(40, CALM, 0);
        let fault = bench.run(1, Told { code: 3, ..CALM }, 0);
        assert_eq!(fault.contains(Condition::Fault), told);
        silence(&mut bench);
        assert!(!bench.run(30, CALM, 0).contains(Condition::Fault));
        assert_eq!(bench.bus.health(bench.motor).unwrap().error_code, 0);
    }
}

/// The position is set during the ramp, so that nothing is wrong with the motor, and still it is not left to itself.
#[test]
fn a_ramp_of_a_motor_with_which_nothing_is_wrong_comes_to_its_end() {
    for (ramp_ms, ticks) in [(2_000, 2_100), (65_000, 80_000)] {
        let opening = Duration::from_millis(ramp_ms);
        let mut bench = Bench::new(Config::<M3508>::at_once(1).with_resume().with_opening(opening));
        bench.run(30, CALM, 0);
        bench.ms += 150;
        step(&mut bench.bus, bench.ms);
        assert_eq!(bench.bus.link(bench.motor), Some(Link::Offline));
        let mut words: Vec<i16> = Vec::new();
        let mut known = false;
        for _ in 0..ticks {
            words.push(bench.tick(CALM, 8_000));
            if !known && bench.bus.link(bench.motor) == Some(Link::Online) {
                bench.bus.zero(bench.motor).unwrap();
                assert_eq!(bench.bus.conditions(bench.motor), SOUND);
                known = true;
            }
        }
        assert!(words.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] < 200));
        let whole = words.iter().position(|word| *word == 8_000).unwrap() as u64;
        // 8000 of 16384, from the tenth frame on.
        let expected = ramp_ms * 8_000 / 16_384 + 10;
        assert!((expected - 3..=expected + 14).contains(&whole), "{whole} of {expected} ms");
        // The end of the ramp itself, by a command that needs all of it.
        if ramp_ms == 2_000 {
            assert_eq!(bench.tick(CALM, 16_384), 16_384);
        }
    }
}

#[test]
fn the_longest_gap_is_that_of_frames_that_were_lost() {
    let mut bench = Bench::new(Config::<M3508>::at_once(1));
    let gap = |bench: &Bench<M3508>| bench.bus.health(bench.motor).unwrap().longest_gap.as_micros();
    // Before the first update every frame counts.
    bench.run(2_100, CALM, 0);
    assert_eq!(gap(&bench), 0, "none was lost");
    for _ in 0..5 {
        bench.ms += 1;
        step(&mut bench.bus, bench.ms);
    }
    bench.run(50, CALM, 0);
    assert_eq!(gap(&bench), 6_000);
    bench.run(900, CALM, 0);
    assert_eq!(gap(&bench), 6_000);
    bench.run(2_100, CALM, 0);
    assert_eq!(gap(&bench), 0, "that was in a window of long ago");
    // The time before the first frame is no gap.
    let mut bus: Bus = Bus::new();
    let late = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    step(&mut bus, 100_000);
    assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(100_000)), Ingest::Taken);
    assert_eq!(bus.health(late).unwrap().longest_gap.as_micros(), 0);
}

/// Half a rotor turn at no-load speed less 500 µs; any, when an update found the motor late before it ended.
#[test]
fn a_gap_counts_from_half_a_turn_on_or_when_the_motor_was_late() {
    fn longest<M: Model>(gap_us: u64, is_updated: bool) -> u64 {
        let mut bench = Bench::new(Config::<M>::at_once(1));
        bench.run(2_100, CALM, 0);
        let now = Instant::from_micros(1_000 * bench.ms - 300 + gap_us);
        if is_updated {
            for ms in 1..=gap_us / 1_000 {
                step(&mut bench.bus, bench.ms + ms);
            }
        }
        _ = bench.bus.ingest(&feedback(M::FACTS.feedback_base + 1, 0, 0), now);
        bench.bus.health(bench.motor).unwrap().longest_gap.as_micros()
    }
    for is_updated in [false, true] {
        assert_eq!([1_165, 1_166].map(|us| longest::<M2006>(us, is_updated)), [0, 1_152]);
        assert_eq!([2_740, 2_741].map(|us| longest::<M3508>(us, is_updated)), [0, 2_736]);
    }
    assert_eq!([93_249, 93_250].map(|us| longest::<Gm6020Voltage>(us, false)), [0, 93_248]);
    assert_eq!([9_900, 11_200].map(|us| longest::<Gm6020Voltage>(us, true)), [0, 11_200]);
}

#[test]
fn every_gap_counts_before_the_first_update_and_while_too_many_frames_come() {
    let mut bus: Bus = Bus::new().with_feedback_rate(100);
    let motor = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    let gap = |bus: &Bus| bus.health(motor).unwrap().longest_gap.as_micros();
    let hear = |bus: &mut Bus, ms| _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
    (0..3).for_each(|ms| hear(&mut bus, ms));
    assert_eq!(gap(&bus), 992, "in steps of 16 µs");
    // The first whole window tells that 1000 frames a second come and not 100.
    for ms in 3..4_300 {
        hear(&mut bus, ms);
        step(&mut bus, ms);
    }
    assert_eq!(gap(&bus), 992);
}
