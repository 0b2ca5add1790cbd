//! From one way of driving a motor to another: no jump of the output where a loop has an integral to carry it.

use super::watching::{Bench, CALM, Told};
use super::*;
use crate::motor::{Condition, Measured};
use proptest::collection::vec;
use proptest::prelude::*;

const STILL: Told = Told { rpm: 0, counts_per_ms: 0, ..CALM };
/// 60 rpm: 2 pi rad/s, and 8.192 counts a millisecond.
const TURNING: Told = Told { rpm: 60, counts_per_ms: 8, ..CALM };
const RATE: f32 = core::f32::consts::TAU;
const PI: PidConfig = PidConfig::new(2.0, 5.0, 0.0);

fn yaw() -> Bench<Gm6020Voltage> {
    Bench::new(Config::new(1).position_loop(PidConfig::new(10.0, 5.0, 0.0), PI))
}

fn volts(
    bench: &mut Bench<Gm6020Voltage>,
    told: Told,
    ask: impl FnOnce(&mut Bus, Handle<Gm6020Voltage>),
) -> f32 {
    bench.ms += 1;
    bench.hear(told);
    ask(&mut bench.bus, bench.motor);
    step(&mut bench.bus, bench.ms);
    f32::from(sent(&mut bench.bus).last().map_or(0, |(_, words)| words[0])) * 24.0 / 25_000.0
}

/// What another sensor says: here, and as fast as the encoder.
fn measured(bench: &Bench<Gm6020Voltage>) -> Measured {
    let velocity = AngularVelocity::from_rad_per_s(RATE);
    Measured { angle: Angle::ZERO, velocity, at: at_ms(bench.ms) }
}

#[test]
fn a_speed_loop_goes_on_from_a_direct_command() {
    for raw in [5_000, -7_000] {
        let mut bench = yaw();
        bench.run(20, TURNING, raw);
        let first = volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
        assert!((first - f32::from(raw) * 24.0 / 25_000.0).abs() < 0.01, "{first} V after {raw}");
    }
}

#[test]
fn a_position_loop_goes_on_from_the_velocity_and_starts_from_rest_without_one() {
    let here = |bus: &mut Bus, yaw| {
        let here = bus.state(yaw).unwrap().position;
        bus.set_position(yaw, here).unwrap();
    };
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
    }
    let first = volts(&mut bench, TURNING, here);
    assert!(first.abs() < 0.05, "{first} V: it goes on at its velocity");
    let mut bench = yaw();
    bench.run(20, TURNING, 0);
    bench.bus.relax(bench.motor);
    let first = volts(&mut bench, TURNING, here);
    assert!((first + 2.0 * RATE).abs() < 0.05, "{first} V: it is to stop");
}

#[test]
fn an_angle_by_another_sensor_goes_on_from_a_velocity_and_starts_from_rest_without_one() {
    let hold = |bench: &mut Bench<Gm6020Voltage>| {
        let measured = Measured { at: at_ms(bench.ms + 1), ..measured(bench) };
        volts(bench, TURNING, |bus, yaw| {
            bus.set_angle_measured(yaw, Angle::ZERO, measured).unwrap();
        })
    };
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
    }
    let first = hold(&mut bench);
    assert!(first.abs() < 0.05, "{first} V: it goes on at its velocity");
    let mut bench = yaw();
    bench.run(20, TURNING, 0);
    bench.bus.relax(bench.motor);
    let first = hold(&mut bench);
    assert!((first + 2.0 * RATE).abs() < 0.05, "{first} V: it is to stop");
    // From an angle by the encoder: the position loop has what it needs, and keeps it.
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, STILL, |bus, yaw| bus.set_angle(yaw, Angle::ZERO).unwrap());
    }
    let first = hold(&mut bench);
    assert!((first + 2.0 * RATE).abs() < 0.05, "{first} V: no integral was made up");
}

/// A second against an obstacle, then the other way: an integral beyond the limit would take as long to come back.
#[test]
fn a_speed_loop_that_is_changed_is_limited_as_the_one_it_was_attached_with() {
    let loops = PidConfig::new(0.0, 100.0, 0.0);
    let limited = |bench: &mut Bench<Gm6020Voltage>, rad_per_s: f32| {
        volts(bench, STILL, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(rad_per_s)).unwrap();
        })
    };
    for change in [false, true] {
        let mut bench = Bench::new(Config::new(1).speed_loop(loops));
        if change {
            bench.bus.set_speed_loop(bench.motor, loops).unwrap();
        }
        for _ in 0..1_000 {
            limited(&mut bench, 10.0);
        }
        let highest = limited(&mut bench, 10.0);
        assert!((highest - 24.0).abs() < 1e-3, "{highest} V");
        for _ in 0..12 {
            limited(&mut bench, -10.0);
        }
        let after = limited(&mut bench, -10.0);
        assert!(
            (after - 12.0).abs() < 0.01,
            "1 V a tick, and the first one is the turn: {after} V"
        );
    }
}

/// Half way from the warning to the limit half of the output is left, whatever is asked for.
#[test]
fn a_motor_that_is_warm_keeps_to_its_share_in_a_position_loop_too() {
    let strong = PidConfig::new(1_000.0, 0.0, 0.0);
    for position in [strong, PidConfig::new(1_000.0, 0.0, 0.0).with_integral_limit(1.0)] {
        let mut bench = Bench::new(Config::<M3508>::new(1).position_loop(position, strong));
        let warm = Told { celsius: 154, ..CALM };
        let mut word = 0;
        for ms in 0..40 {
            bench.ms += 1;
            bench.hear(warm);
            let far = Position::from_turns(if ms < 20 { 100 } else { -100 });
            bench.bus.set_position(bench.motor, far).unwrap();
            step(&mut bench.bus, bench.ms);
            word = sent(&mut bench.bus)[0].1[0];
            if ms == 19 {
                assert_eq!(word, 7_745, "26 K of 55 are left");
            }
        }
        assert_eq!(word, -7_745);
        assert!(bench.bus.conditions(bench.motor).contains(Condition::Warm));
    }
}

#[test]
fn a_position_loop_does_not_go_on_from_a_velocity_before_a_rest() {
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
    }
    let here = |bus: &mut Bus, yaw| {
        let here = bus.state(yaw).unwrap().position;
        bus.set_position(yaw, here).unwrap();
    };
    volts(&mut bench, TURNING, |bus, yaw| {
        here(bus, yaw);
        let nowhere = AngularVelocity::from_rpm(f32::NAN);
        assert_eq!(bus.set_velocity(yaw, nowhere), Err(TargetError::NotFinite));
    });
    let integral = bench.bus.slot_mut(bench.motor.into()).unwrap().speed_loop_mut().terms().i;
    let first = volts(&mut bench, STILL, here);
    assert!((first - integral).abs() < 0.05, "{first} V: it is where it is to be");
}

/// Without an error it holds its output, whatever that is.
const HOLDING: PidConfig = PidConfig::new(0.0, 0.01, 0.0);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Call {
    Raw(i16),
    Velocity,
    /// A target that is no number.
    Nowhere,
    Relax,
    /// An update with feedback that is too old, and a frame after it.
    Late,
    /// An update without a step.
    Hold,
    Step,
}

fn call() -> impl Strategy<Value = Call> {
    prop_oneof![
        2 => (-16_384_i16..=16_384).prop_map(Call::Raw),
        3 => Just(Call::Velocity),
        1 => Just(Call::Nowhere),
        1 => Just(Call::Relax),
        1 => Just(Call::Late),
        1 => Just(Call::Hold),
        4 => Just(Call::Step),
    ]
}

/// A motor that stands, and what its next word has to be.
struct Standing {
    bus: Bus,
    motor: Handle<M3508>,
    ms: u64,
    asked: Call,
    commanded_ms: u64,
    word: i16,
    /// What the loop sent itself since the last direct command, or is to take over.
    held: i16,
    takes_over: bool,
    has_rested: bool,
    holds: u8,
}

impl Standing {
    fn new() -> Self {
        let (bus, [motor]) = armed([Config::<M3508>::new(1).speed_loop(HOLDING)]);
        Self {
            bus,
            motor,
            ms: 1,
            asked: Call::Relax,
            commanded_ms: 1,
            word: 0,
            held: 0,
            takes_over: false,
            has_rested: true,
            holds: 0,
        }
    }

    fn call(&mut self, call: Call) {
        match call {
            Call::Raw(raw) => {
                self.bus.set_raw(self.motor, raw).unwrap();
                (self.held, self.takes_over) = (0, false);
                self.ask(call);
            }
            Call::Velocity => {
                self.bus.set_velocity(self.motor, AngularVelocity::ZERO).unwrap();
                if matches!(self.asked, Call::Raw(_)) && !self.has_rested {
                    (self.held, self.takes_over) = (self.word, true);
                }
                self.ask(call);
            }
            Call::Nowhere => {
                let nowhere = AngularVelocity::from_rpm(f32::NAN);
                let refused = self.bus.set_velocity(self.motor, nowhere);
                assert_eq!(refused, Err(TargetError::NotFinite));
                self.rest();
                self.asked = call;
            }
            Call::Relax => {
                self.bus.relax(self.motor);
                self.relax();
            }
            Call::Late => {
                self.rest();
                self.step(11);
            }
            Call::Hold => self.hold(),
            Call::Step => self.step(1),
        }
    }

    fn ask(&mut self, call: Call) {
        (self.asked, self.commanded_ms) = (call, self.ms);
    }

    fn relax(&mut self) {
        self.rest();
        (self.asked, self.held) = (Call::Relax, 0);
    }

    fn rest(&mut self) {
        if core::mem::take(&mut self.takes_over) {
            self.held = 0;
        }
        self.has_rested = true;
    }

    /// What was sent stays once, then zeros.
    fn hold(&mut self) {
        self.ms += 1;
        self.holds += 1;
        _ = self.bus.ingest(&feedback(0x201, 0, 0), at_ms(self.ms));
        self.bus.update(Tick::new(at_ms(self.ms), f32::NAN));
        let word = sent(&mut self.bus).last().map_or(self.word, |(_, words)| words[0]);
        if self.holds > 1 && core::mem::take(&mut self.takes_over) {
            self.held = 0;
        }
        let stays = self.holds == 1 && !self.has_rested;
        assert_eq!(word, if stays { self.word } else { 0 });
        self.word = word;
    }

    fn step(&mut self, ms: u64) {
        self.ms += ms;
        self.holds = 0;
        if self.ms - self.commanded_ms > 100 {
            self.relax();
        }
        if ms == 1 {
            _ = self.bus.ingest(&feedback(0x201, 0, 0), at_ms(self.ms));
        }
        step(&mut self.bus, self.ms);
        self.word = sent(&mut self.bus).last().map_or(self.word, |(_, words)| words[0]);
        let expected = match self.asked {
            _ if ms > 1 => 0,
            Call::Raw(raw) => raw,
            Call::Velocity => self.held,
            _ => 0,
        };
        assert_eq!(self.word, expected, "at {} ms, {:?}", self.ms, self.asked);
        self.has_rested = ms > 1 || !matches!(self.asked, Call::Raw(_) | Call::Velocity);
        self.takes_over &= self.has_rested;
        if ms > 1 {
            _ = self.bus.ingest(&feedback(0x201, 0, 0), at_ms(self.ms));
        }
    }
}

/// Hostile readers had full current from rest in six ways: from a direct command that was replaced before it was sent, from
/// the integral of a loop that a direct command had replaced since, and from a take-over that a rest came before.
#[test]
fn a_speed_loop_goes_on_from_nothing_but_what_was_sent() {
    use Call::{Hold, Late, Nowhere, Raw, Step, Velocity};
    const FULL: Call = Raw(16_384);
    let sequences: [&[Call]; 6] = [
        &[FULL, Velocity, Step],
        &[Velocity, Step, FULL, Velocity, Step],
        &[FULL, Step, Velocity, Step, Raw(0), Step, Late, Velocity, Step],
        &[FULL, Step, Velocity, Step, Raw(0), Step, Nowhere, Step, Velocity, Step],
        &[FULL, Step, Velocity, Nowhere, Step, Velocity, Step],
        &[FULL, Step, Velocity, Hold, Hold, Step],
    ];
    for calls in sequences {
        let mut motor = Standing::new();
        calls.iter().for_each(|call| motor.call(*call));
        assert_eq!(motor.word, 0, "{calls:?}");
    }
    // One that was sent it takes over, in a ramp of direct commands the last of them.
    let mut motor = Standing::new();
    [Raw(1_000), Step, FULL, Velocity, Step].into_iter().for_each(|call| motor.call(call));
    assert_eq!(motor.word, 1_000);
}

#[test]
fn a_position_loop_does_not_go_on_from_a_direct_command_that_was_not_sent() {
    let loops = Config::<M3508>::new(1).position_loop(HOLDING, HOLDING);
    let here = Position::ZERO;
    let measured = Measured { angle: Angle::ZERO, velocity: AngularVelocity::ZERO, at: at_ms(2) };
    type Ask = fn(&mut Bus, Handle<M3508>, Measured) -> Result<(), TargetError>;
    let asking: [Ask; 3] = [
        |bus, motor, _| bus.set_position(motor, Position::ZERO),
        |bus, motor, _| bus.set_angle(motor, Angle::ZERO),
        |bus, motor, measured| bus.set_angle_measured(motor, Angle::ZERO, measured),
    ];
    for ask in asking {
        let (mut bus, [motor]) = armed([loops]);
        bus.set_present_position(motor, here).unwrap();
        bus.set_raw(motor, 1_000).unwrap();
        step(&mut bus, 2);
        bus.set_raw(motor, 16_384).unwrap();
        ask(&mut bus, motor, measured).unwrap();
        step(&mut bus, 3);
        assert_eq!(sent(&mut bus).last().map(|(_, words)| words[0]), Some(1_000));
    }
}

proptest! {
    /// Law: a speed loop without an error goes on from what was sent; after a rest from what it sent itself, as long as no
    /// direct command came since; and otherwise from zero.
    #[test]
    fn a_speed_loop_holds_what_was_sent_or_what_it_sent_itself(calls in vec(call(), 1..60)) {
        let mut motor = Standing::new();
        calls.into_iter().for_each(|call| motor.call(call));
    }
}
