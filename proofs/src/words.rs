//! From a physical command to the word on the wire, for each model.

use crate::Shared;
use drivetrain::dji::{Bus, Config, Gm6020Current, Gm6020Voltage, Handle, M2006, M3508, Model};
use drivetrain::frame::CanFrame;
use drivetrain::motor::TargetError;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Current, Voltage};

/// A motor in the first slot of its command frame.
pub struct Motor<M: Model> {
    bus: Bus,
    handle: Handle<M>,
}

impl<M: Model> Motor<M> {
    pub const fn new() -> Self {
        let mut bus = Bus::new();
        match bus.attach(Config::new(1).with_opening(Duration::ZERO)) {
            Ok(handle) => Self { bus, handle },
            Err(_) => panic!("not attached"),
        }
    }

    /// Sends a value: 1 when it was accepted, and the word.
    fn send(
        &mut self,
        bits: u32,
        word: &mut i16,
        set: impl Fn(&mut Bus, Handle<M>, f32) -> Result<(), TargetError>,
    ) -> u32 {
        let at = Instant::from_micros;
        if let Some(rest) = CanFrame::standard(M::FACTS.feedback_base + 1, [0; 8]) {
            _ = self.bus.ingest(&rest, at(1_000));
        }
        if self.bus.arm(at(1_000)).is_err() {
            return u32::MAX;
        }
        let accepted = set(&mut self.bus, self.handle, f32::from_bits(bits)).is_ok();
        self.bus.update(Tick::new(at(2_000), 0.001));
        if let Some(frame) = self.bus.next_frame() {
            let [high, low, ..] = *frame.bytes();
            *word = i16::from_be_bytes([high, low]);
        }
        u32::from(accepted)
    }
}

fn amperes<M: Model<Command = Current>>(
    bus: &mut Bus,
    motor: Handle<M>,
    value: f32,
) -> Result<(), TargetError> {
    bus.set_current(motor, Current::from_amperes(value))
}

fn volts(bus: &mut Bus, motor: Handle<Gm6020Voltage>, value: f32) -> Result<(), TargetError> {
    bus.set_voltage(motor, Voltage::from_volts(value))
}

macro_rules! word {
    ($name:ident, $model:ident, $set:expr) => {
        #[unsafe(no_mangle)]
        extern "C" fn $name(bits: u32, word: &mut i16) -> u32 {
            // A copy on the stack would be most of what the proof has to follow.
            static MOTOR: Shared<Motor<$model>> = Shared::new(Motor::new());
            MOTOR.get().send(bits, word, $set)
        }
    };
}

word!(word_m2006, M2006, amperes);
word!(word_m3508, M3508, amperes);
word!(word_gm6020_voltage, Gm6020Voltage, volts);
word!(word_gm6020_current, Gm6020Current, amperes);
