//! What a speed loop goes on from: a loop that only holds its output shows it.

use super::*;
use crate::motor::Measured;
use proptest::collection::vec;
use proptest::prelude::*;

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
    /// What was sent last.
    word: i16,
    /// What the loop sent itself since the last direct command that was sent.
    held: i16,
    was_direct: bool,
    has_rested: bool,
    holds: u8,
}

impl Standing {
    fn new() -> Self {
        let (bus, [motor]) = armed([Config::<M3508>::at_once(1).speed_loop(HOLDING)]);
        Self {
            bus,
            motor,
            ms: 1,
            asked: Call::Relax,
            commanded_ms: 1,
            word: 0,
            held: 0,
            was_direct: false,
            has_rested: true,
            holds: 0,
        }
    }

    fn call(&mut self, call: Call) {
        match call {
            Call::Raw(raw) => {
                self.bus.set_raw(self.motor, raw).unwrap();
                self.ask(call);
            }
            Call::Velocity => {
                self.bus.set_velocity(self.motor, AngularVelocity::ZERO).unwrap();
                self.ask(call);
            }
            Call::Nowhere => {
                let nowhere = AngularVelocity::from_rpm(f32::NAN);
                let refused = self.bus.set_velocity(self.motor, nowhere);
                assert_eq!(refused, Err(TargetError::NotFinite));
                self.relax();
                self.asked = call;
            }
            Call::Relax => {
                self.bus.relax(self.motor);
                self.relax();
            }
            Call::Hold => self.hold(),
            Call::Late => {
                self.step(11);
                _ = self.bus.ingest(&feedback(0x201, 0, 0), at_ms(self.ms));
            }
            Call::Step => self.step(1),
        }
    }

    fn ask(&mut self, call: Call) {
        (self.asked, self.commanded_ms) = (call, self.ms);
    }

    fn relax(&mut self) {
        (self.asked, self.held, self.has_rested) = (Call::Relax, 0, true);
    }

    /// What was sent stays once, then zeros.
    fn hold(&mut self) {
        self.ms += 1;
        self.holds += 1;
        _ = self.bus.ingest(&feedback(0x201, 0, 0), at_ms(self.ms));
        self.bus.update(Tick::new(at_ms(self.ms), f32::NAN));
        let stays = self.holds == 1 && !self.has_rested;
        self.expect(if stays { self.word } else { 0 });
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
        let was_direct = self.was_direct && !self.has_rested;
        let expected = match self.asked {
            _ if ms > 1 => 0,
            Call::Raw(raw) => {
                self.held = 0;
                raw
            }
            Call::Velocity => {
                if was_direct {
                    self.held = self.word;
                }
                self.held
            }
            _ => 0,
        };
        self.expect(expected);
        self.was_direct = matches!(self.asked, Call::Raw(_));
        self.has_rested = ms > 1 || !matches!(self.asked, Call::Raw(_) | Call::Velocity);
    }

    fn expect(&mut self, expected: i16) {
        self.word = sent(&mut self.bus).last().map_or(self.word, |(_, words)| words[0]);
        assert_eq!(self.word, expected, "at {} ms, {:?}", self.ms, self.asked);
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
    let loops = Config::<M3508>::at_once(1).position_loop(HOLDING, HOLDING);
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
    /// direct command was sent since; and otherwise from zero.
    #[test]
    fn a_speed_loop_holds_what_was_sent_or_what_it_sent_itself(calls in vec(call(), 1..60)) {
        let mut motor = Standing::new();
        calls.into_iter().for_each(|call| motor.call(call));
    }
}
