//! Every input, one after the other, against an oracle that is not our code: integers and `f64`.
//!
//! Ignored in the everyday run: minutes in release, with checks for overflow. `.ci/run` runs them; the five sweeps of
//! conversions take turns there, one a day, so that five days see every value of every scale. All of it:
//! `DRIVETRAIN_EXHAUSTIVE=full cargo test --profile soak --all-features --test exhaustive -- --ignored --nocapture --test-threads 1`

#![cfg(test)]

use drivetrain::dji::{
    AttachError, Bus, Config, Gm6020Current, Gm6020Voltage, Handle, M2006, M3508, Model,
};
use drivetrain::encoder::{Position, shortest};
use drivetrain::frame::CanFrame;
use drivetrain::math::{wrap, wrap_pi, wrap_positive, wrap_tau};
use drivetrain::motor::{Ingest, TargetError};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, Current, Voltage};
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use std::ops::Range;
use std::thread;
use std::time::{SystemTime, UNIX_EPOCH};

const fn at_us(us: u64) -> Instant {
    Instant::from_micros(us)
}

/// Splits the work over two threads, and prints how much it was and how long it took.
fn both_halves(what: &str, all: Range<u64>, work: impl Fn(Range<u64>) -> u64 + Sync) {
    let start = std::time::Instant::now();
    let middle = all.start.midpoint(all.end);
    let count: u64 = thread::scope(|scope| {
        let halves = [all.start..middle, middle..all.end];
        let threads = halves.map(|half| scope.spawn(|| work(half)));
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    println!("exhaustive: {count} {what} in {:.1} s", start.elapsed().as_secs_f64());
}

/// One model's motors on a bus of their own: half of them take a value, the others its negative.
struct Words<M: Model, const N: usize> {
    bus: Bus,
    motors: [Handle<M>; N],
    now_us: u64,
}

impl<M: Model, const N: usize> Words<M, N> {
    /// A new bus for every few values: no time passes in which a motor that stands still could be a fault.
    fn new(config: impl Fn(u8) -> Config<M>) -> Self {
        let mut bus = Bus::new();
        let ids: [u8; N] = core::array::from_fn(|index| u8::try_from(index + 1).unwrap());
        let at_once = |id| config(id).with_opening(Duration::ZERO);
        let motors = bus.attach_all(ids.map(at_once)).unwrap();
        for id in ids {
            let id = M::FACTS.feedback_base + u16::from(id);
            let rest = CanFrame::standard(id, [0, 0, 0, 0, 0, 0, 25, 0]).unwrap();
            assert_eq!(bus.ingest(&rest, at_us(1_000)), Ingest::Taken);
        }
        bus.arm(at_us(1_000)).unwrap();
        Self { bus, motors, now_us: 1_000 }
    }

    /// Sends one value to each motor and returns the words, 0 where it was refused.
    fn send(
        &mut self,
        values: &[f32; N],
        set: &impl Fn(&mut Bus, Handle<M>, f32) -> Result<(), TargetError>,
    ) -> [i16; 8] {
        for (motor, value) in self.motors.iter().zip(values) {
            let done = set(&mut self.bus, *motor, *value);
            assert_eq!(done.is_ok(), value.is_finite(), "{value:e}");
        }
        self.now_us += 1;
        self.bus.update(Tick::new(at_us(self.now_us), 1e-6));
        let mut words = [0; 8];
        while let Some(frame) = self.bus.next_frame() {
            let high = frame.header() != u32::from(M::FACTS.command_ids()[0]);
            for (slot, word) in frame.bytes().chunks_exact(2).enumerate() {
                words[slot + 4 * usize::from(high)] = i16::from_be_bytes([word[0], word[1]]);
            }
        }
        words
    }
}

/// What the word of `value` has to be, from the facts alone: within half a unit of the exact product and the rounding of
/// two `f32` operations, saturated.
fn check_word(word: i16, value: f32, scale: f64, limit: i16) {
    let exact = f64::from(value) * scale;
    let saturated = exact.clamp(-f64::from(limit), f64::from(limit));
    let off = (f64::from(word) - saturated).abs();
    assert!(off <= 0.5 + saturated.abs() / 4e6, "{value:e} gives {word}, not {exact}");
}

/// A sweep of minutes takes its turn with the others: one of five a day, unless all are asked for.
fn has_its_turn(what: &str, turn: u64) -> bool {
    const TURNS: u64 = 5;
    let everything = std::env::var("DRIVETRAIN_EXHAUSTIVE").is_ok_and(|share| share == "full");
    let day = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs() / 86_400;
    let now = everything || day % TURNS == turn;
    if !now {
        let days = (turn + TURNS - day % TURNS) % TURNS;
        println!(
            "exhaustive: {what}: not today, in {days} days; DRIVETRAIN_EXHAUSTIVE=full runs all"
        );
    }
    now
}

/// Every `f32`: to the nearest, saturated, odd-symmetric, monotone; what is not finite is refused and gives 0.
fn every_value<M: Model, const N: usize>(
    (turn, scale_name): (u64, &str),
    limit: i16,
    full_scale: f64,
    config: impl Fn(u8) -> Config<M> + Sync,
    set: impl Fn(&mut Bus, Handle<M>, f32) -> Result<(), TargetError> + Sync,
) {
    const VALUES_A_BUS: u64 = 1 << 12;
    let what = format!("values of {}{scale_name}", M::FACTS.name);
    if !has_its_turn(&what, turn) {
        return;
    }
    let scale = f64::from(limit) / full_scale;
    let pairs = N as u64 / 2;
    // The sign bit is the negative of each pair.
    both_halves(&what, 0..1 << 31, |bits| {
        let mut last = i16::MIN;
        let mut next = bits.start;
        while next < bits.end {
            let mut words = Words::<M, N>::new(&config);
            let end = bits.end.min(next + VALUES_A_BUS);
            while next < end {
                let mut values = [0.0; N];
                let some = pairs.min(end - next);
                for (pair, bits) in values.as_chunks_mut::<2>().0.iter_mut().zip(next..end) {
                    let value = f32::from_bits(u32::try_from(bits).unwrap());
                    *pair = [value, -value];
                }
                let sent = words.send(&values, &set);
                for (pair, word) in (0..some).zip(sent.as_chunks::<2>().0) {
                    let value = values[2 * usize::try_from(pair).unwrap()];
                    let [one, other] = *word;
                    assert_eq!(one, -other, "{value:e}");
                    if value.is_finite() {
                        check_word(one, value, scale, limit);
                        assert!(one >= last, "{value:e}: not monotone");
                        last = one;
                    } else {
                        assert_eq!(one, 0, "{value:e}");
                    }
                }
                next += some;
            }
        }
        2 * (bits.end - bits.start)
    });
}

fn set_amperes<M: Model<Command = Current>>(
    bus: &mut Bus,
    motor: Handle<M>,
    value: f32,
) -> Result<(), TargetError> {
    bus.set_current(motor, Current::from_amperes(value))
}

fn set_volts(bus: &mut Bus, motor: Handle<Gm6020Voltage>, value: f32) -> Result<(), TargetError> {
    bus.set_voltage(motor, Voltage::from_volts(value))
}

#[test]
#[ignore = "2^32 values: by .ci/run"]
fn every_f32_of_an_m2006_is_the_nearest_word() {
    every_value::<M2006, 8>((0, ""), 10_000, 10.0, Config::new, set_amperes);
}

#[test]
#[ignore = "2^32 values: by .ci/run"]
fn every_f32_of_an_m3508_is_the_nearest_word() {
    every_value::<M3508, 8>((1, ""), 16_384, 20.0, Config::new, set_amperes);
}

#[test]
#[ignore = "2^32 values: by .ci/run"]
fn every_f32_of_a_gm6020_in_voltage_mode_is_the_nearest_word() {
    every_value::<Gm6020Voltage, 6>((2, ""), 25_000, 24.0, Config::new, set_volts);
}

/// The scale of motors of 2020 and before.
#[test]
#[ignore = "2^32 values: by .ci/run"]
fn every_f32_of_a_gm6020_with_the_legacy_scale_is_the_nearest_word() {
    every_value::<Gm6020Voltage, 6>(
        (4, ", legacy scale"),
        30_000,
        24.0,
        |id| Config::new(id).with_legacy_full_scale(),
        set_volts,
    );
}

#[test]
#[ignore = "2^32 values: by .ci/run"]
fn every_f32_of_a_gm6020_in_current_mode_is_the_nearest_word() {
    every_value::<Gm6020Current, 6>((3, ""), 16_384, 3.0, Config::new, set_amperes);
}

/// How far two angles are apart, whole periods not counted.
fn apart(one: f32, other: f32, period: f64) -> f64 {
    let difference = f64::from(one) - f64::from(other);
    (difference - (difference / period).round() * period).abs()
}

fn spacing(x: f32) -> f64 {
    f64::from(x.abs().next_up()) - f64::from(x.abs())
}

/// Every `f32`: in range, the same direction as far as `f32` can tell one, odd-symmetric but for the half
/// turn itself.
#[test]
#[ignore = "2^32 angles: by .ci/run"]
#[expect(clippy::float_cmp, reason = "exact symmetry is the rule under test")]
fn every_f32_wraps_to_the_same_direction() {
    use core::f32::consts::{PI, TAU};
    /// Beyond four million turns, `f32` holds no angle.
    const TURNS: f32 = 4.0e6;
    both_halves("angles", 0..1 << 31, |bits| {
        for bits in bits.clone() {
            let x = f32::from_bits(u32::try_from(bits).unwrap());
            let symmetric = [
                (wrap_pi(x), wrap_pi(-x), PI, f64::from(TAU), core::f64::consts::TAU),
                (wrap(x, 360.0), wrap(-x, 360.0), 180.0, 360.0, 360.0),
            ];
            let positive = [(wrap_tau(x), TAU), (wrap_positive(x, 360.0), 360.0)];
            if !x.is_finite() {
                assert!(symmetric.iter().all(|(one, other, ..)| one.is_nan() && other.is_nan()));
                assert!(positive.iter().all(|(angle, _)| angle.is_nan()));
                continue;
            }
            for ((one, other, half, rough, period), (angle, turn)) in
                symmetric.into_iter().zip(positive)
            {
                assert!((-half..half).contains(&one) && (-half..half).contains(&other), "{x:e}");
                assert!((0.0..turn).contains(&angle), "{x:e}");
                if f64::from(x) < f64::from(TURNS) * rough {
                    assert!(
                        one == -other || (one == -half && other == -half),
                        "{x:e}: {one} {other}"
                    );
                    let slack =
                        if x <= 1e4 { 4e-7 * rough / 6.0 } else { spacing(x) + 4e-7 * rough / 6.0 };
                    assert!(apart(one, x, period) <= slack, "{x:e} to {one:e}");
                    let slack = slack + spacing(turn);
                    assert!(apart(angle, x, period) <= slack, "{x:e} to {angle:e}");
                }
            }
        }
        2 * (bits.end - bits.start)
    });
}

/// Every `f32`: whole turns and the rest of one are the angle, as far as `f32` can tell it; beyond 2^31 turns it saturates, and
/// what is not finite stays so.
#[test]
#[ignore = "2^32 angles: by .ci/run"]
fn every_f32_is_a_number_of_turns_and_a_rest() {
    const FURTHEST: f64 = 2_147_483_648.0;
    both_halves("angles as positions", 0..1 << 32, |bits| {
        for bits in bits.clone() {
            let radians = f32::from_bits(u32::try_from(bits).unwrap());
            let position = Position::from_angle(Angle::from_radians(radians));
            let rest = position.angle().as_radians();
            if !radians.is_finite() {
                assert!(!position.is_finite() && position.turns() == 0, "{radians:e}");
                continue;
            }
            assert!((0.0..core::f32::consts::TAU).contains(&rest), "{radians:e}: {rest:e}");
            let exact = f64::from(radians) / core::f64::consts::TAU;
            let turns = position.turns() as f64 + f64::from(rest) / core::f64::consts::TAU;
            let inside = exact.clamp(-FURTHEST, FURTHEST);
            assert!((turns - inside).abs() <= 3e-7 * (1.0 + inside.abs()), "{radians:e}: {turns}");
        }
        bits.end - bits.start
    });
}

/// Every `f32`: to the nearest microsecond that `f32` can tell, or refused.
#[test]
#[ignore = "2^32 times: by .ci/run"]
fn every_f32_of_seconds_is_a_duration_or_refused() {
    both_halves("times in seconds", 0..1 << 32, |bits| {
        for bits in bits.clone() {
            let seconds = f32::from_bits(u32::try_from(bits).unwrap());
            let duration = Duration::from_secs_f32(seconds);
            assert_eq!(duration.is_some(), (0.0..=4294.0).contains(&seconds), "{seconds:e}");
            let Some(duration) = duration else { continue };
            let exact = f64::from(seconds) * 1e6;
            let off = (duration.as_micros() as f64 - exact).abs();
            assert!(off <= 0.5 + exact * 1.2e-7, "{seconds:e}: {duration:?}");
        }
        bits.end - bits.start
    });
}

/// The only number in -4096..4096 that leads from the one angle to the other.
fn way(previous: u64, next: u64) -> i64 {
    let ahead = (next + 8192 - previous) % 8192;
    i64::try_from(ahead).unwrap() - if ahead >= 4096 { 8192 } else { 0 }
}

/// Every pair of angles, alone and through a bus.
#[test]
#[ignore = "2^26 pairs: by .ci/run"]
fn every_pair_of_angles_is_the_shortest_way() {
    both_halves("pairs of angles", 0..8192, |previous_angles| {
        let mut bus = Bus::new();
        let motor = bus.attach(Config::<Gm6020Voltage>::new(1)).unwrap();
        let mut now_us = 1_000;
        let mut hear = |bus: &mut Bus, angle: u64| {
            now_us += 1_000;
            let [high, low] = u16::try_from(angle).unwrap().to_be_bytes();
            let frame = CanFrame::standard(0x205, [high, low, 0, 0, 0, 0, 25, 0]).unwrap();
            assert_eq!(bus.ingest(&frame, at_us(now_us)), Ingest::Taken);
        };
        hear(&mut bus, previous_angles.start);
        let mut counts = bus.state(motor).unwrap().rotor_counts;
        let mut here = previous_angles.start;
        for previous in previous_angles.clone() {
            for next in 0..8192 {
                let expected = way(previous, next);
                let alone =
                    shortest(u16::try_from(previous).unwrap(), u16::try_from(next).unwrap());
                assert_eq!(i64::from(alone), expected, "{previous} to {next}");
                hear(&mut bus, previous);
                hear(&mut bus, next);
                counts += way(here, previous) + expected;
                here = next;
            }
            assert_eq!(bus.state(motor).unwrap().rotor_counts, counts, "from {previous}");
        }
        (previous_angles.end - previous_angles.start) * 8192
    });
}

/// The feedback id and command slot of a motor, from the manuals: not from the crate's tables.
fn place(model: usize, id: u64) -> Option<(u64, (u16, u64))> {
    let (base, low, high, ids) = [
        (0x200, 0x200, 0x1FF, 8),
        (0x200, 0x200, 0x1FF, 8),
        (0x204, 0x1FF, 0x2FF, 7),
        (0x204, 0x1FE, 0x2FE, 7),
    ][model];
    let slot = if id <= 4 { (low, id.wrapping_sub(1)) } else { (high, id.wrapping_sub(5)) };
    (1..=ids).contains(&id).then_some((base + id, slot))
}

fn attach(bus: &mut Bus, model: usize, id: u64) -> Result<(), AttachError> {
    let id = u8::try_from(id).unwrap();
    match model {
        0 => bus.attach(Config::<M2006>::new(id)).map(|_| ()),
        1 => bus.attach(Config::<M3508>::new(id)).map(|_| ()),
        2 => bus.attach(Config::<Gm6020Voltage>::new(id)).map(|_| ()),
        _ => bus.attach(Config::<Gm6020Current>::new(id)).map(|_| ()),
    }
}

/// Every pair of models with every byte as an id: refused exactly when an id or a slot would have two owners, and then
/// the bus is as it was.
#[test]
#[ignore = "2^20 pairs: by .ci/run"]
fn every_pair_of_motors_is_refused_exactly_when_it_collides() {
    both_halves("pairs of motors", 0..4 * 256, |firsts| {
        let mut count = 0;
        for first in firsts {
            let (model, id) = (usize::try_from(first / 256).unwrap(), first % 256);
            for second in 0..4 * 256 {
                let (other, other_id) = (usize::try_from(second / 256).unwrap(), second % 256);
                let mut bus = Bus::new();
                let here = place(model, id);
                assert_eq!(attach(&mut bus, model, id).is_ok(), here.is_some());
                let motors = bus.motors().count();
                let there = place(other, other_id);
                let collides = here
                    .zip(there)
                    .is_some_and(|(here, there)| here.0 == there.0 || here.1 == there.1);
                let done = attach(&mut bus, other, other_id);
                match done {
                    Ok(()) => assert!(there.is_some() && !collides),
                    Err(AttachError::Collision { .. }) => assert!(collides),
                    Err(AttachError::Id { .. }) => assert!(there.is_none()),
                    Err(error) => panic!("{error}"),
                }
                assert_eq!(bus.motors().count(), motors + usize::from(done.is_ok()));
                count += 1;
            }
        }
        count
    });
}

fn identifier(raw: u64, extended: bool) -> Id {
    let raw = u32::try_from(raw).unwrap();
    if extended {
        ExtendedId::new(raw).unwrap().into()
    } else {
        StandardId::new(u16::try_from(raw).unwrap()).unwrap().into()
    }
}

/// Every set of motors, every standard id, data and remote, every length, a good angle and a bad one.
#[test]
#[ignore = "2^11 sets of motors: by .ci/run"]
fn every_standard_frame_is_for_exactly_its_motor() {
    both_halves("standard frames", 0..1 << 11, |sets| {
        let mut count = 0;
        for set in sets {
            let mut bus = Bus::new();
            for motor in (0..11).filter(|motor| set >> motor & 1 == 1) {
                // 0x201..=0x204 are M3508, the others GM6020.
                if motor < 4 {
                    bus.attach(Config::<M3508>::new(u8::try_from(motor + 1).unwrap())).unwrap();
                } else {
                    let id = u8::try_from(motor - 3).unwrap();
                    bus.attach(Config::<Gm6020Current>::new(id)).unwrap();
                }
            }
            let (mut bad_length, mut bad_field, mut unattached) = (0, 0, 0);
            for raw in 0..1 << 11 {
                let family = (0x201..=0x20B).contains(&raw);
                let ours = family && set >> (raw - 0x201) & 1 == 1;
                for (length, angle_high) in (0..=8).zip([0; 9]).chain([(8, 0x20)]) {
                    let data = [angle_high, 1, 2, 3, 4, 5, 6, 7];
                    let id = identifier(raw, false);
                    let remote = CanFrame::new_remote(id, length).unwrap();
                    assert_eq!(bus.ingest(&remote, at_us(raw)), Ingest::Unrelated, "{remote:?}");
                    let frame = CanFrame::new(id, &data[..length]).unwrap();
                    let expected = match (ours, length, angle_high) {
                        (false, ..) => Ingest::Unrelated,
                        (true, 8, 0) => Ingest::Taken,
                        (true, 8, _) => Ingest::WrongField,
                        (true, ..) => Ingest::WrongLength(frame.length()),
                    };
                    assert_eq!(bus.ingest(&frame, at_us(raw)), expected, "{frame:?}");
                    unattached += u32::from(family && !ours);
                    bad_length += u32::from(ours && length != 8);
                    bad_field += u32::from(ours && length == 8 && angle_high != 0);
                    count += 2;
                }
            }
            let counters = bus.counters();
            assert_eq!(
                (counters.bad_length, counters.bad_field, counters.unattached),
                (bad_length, bad_field, unattached)
            );
        }
        count
    });
}

/// Every extended id, data and remote, every length: none is ours, and none leaves a trace.
#[test]
#[ignore = "2^29 ids: by .ci/run"]
fn no_extended_frame_is_ours() {
    both_halves("extended frames", 0..1 << 29, |ids| {
        let mut bus = Bus::new();
        bus.attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(Config::<M3508>::new)).unwrap();
        let before = format!("{bus:?}");
        for raw in ids.clone() {
            let id = identifier(raw, true);
            for length in 0..=8 {
                let data = CanFrame::new(id, &[0; 8][..length]).unwrap();
                let remote = CanFrame::new_remote(id, length).unwrap();
                for frame in [data, remote] {
                    assert!(bus.ingest(&frame, at_us(raw)) == Ingest::Unrelated, "{frame:?}");
                }
            }
        }
        assert_eq!(format!("{bus:?}"), before);
        18 * (ids.end - ids.start)
    });
}
