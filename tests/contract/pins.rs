//! Motors that are not on CAN, behind an adapter as a program would write it for a bridge of its own.

use super::*;
use drivetrain::motor::{
    ArmError, CanDevice, Claim, Condition, Conditions, Ingest, MotorName, Visitor, WrongSetting,
};
use drivetrain::pwm::{Brushed, BrushedConfig, RcPwm};
use drivetrain::time::{Duration, Edge, Instant, Tick};
use embedded_hal::{digital, pwm};
use std::cell::Cell;
use std::convert::Infallible;
use std::rc::Rc;

/// A pin that remembers what it was set to.
#[derive(Debug, Clone, Default)]
struct Pin(Rc<Cell<u16>>);

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(0);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(1);
        Ok(())
    }
}

impl pwm::ErrorType for Pin {
    type Error = Infallible;
}

impl pwm::SetDutyCycle for Pin {
    fn max_duty_cycle(&self) -> u16 {
        20_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0.set(duty);
        Ok(())
    }
}

/// What the two kinds have in common.
trait OnPins: VelocityDrive<()> {
    fn hear(&mut self, counter: u32, now: Instant);
    fn go_on(&mut self, tick: Tick);
    fn is_missing(&self, now: Instant) -> bool;
    fn start(&mut self, now: Instant) -> Result<(), ArmError>;
    fn rest(&mut self);
    fn is_ready(&self) -> bool;
    fn stop(&mut self);
    fn clear(&mut self);
    fn is_held(&self) -> bool;
    fn edge(&mut self) -> Option<Edge<Condition, MotorName>>;
}

impl OnPins for Brushed<Pin, [Pin; 1]> {
    fn hear(&mut self, counter: u32, now: Instant) {
        self.ingest_counts(counter, now);
    }
    fn go_on(&mut self, tick: Tick) {
        self.update(tick).unwrap();
    }
    fn is_missing(&self, now: Instant) -> bool {
        self.guard().is_missing(now)
    }
    fn start(&mut self, now: Instant) -> Result<(), ArmError> {
        self.arm(now)
    }
    fn rest(&mut self) {
        self.disarm();
    }
    fn is_ready(&self) -> bool {
        self.is_armed()
    }
    fn stop(&mut self) {
        self.emergency_stop();
    }
    fn clear(&mut self) {
        self.clear_emergency_stop();
    }
    fn is_held(&self) -> bool {
        self.guard().is_stopped()
    }
    fn edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.next_edge()
    }
}

impl OnPins for RcPwm<Pin> {
    fn hear(&mut self, _counter: u32, _now: Instant) {}
    fn go_on(&mut self, tick: Tick) {
        self.update(tick).unwrap();
    }
    fn is_missing(&self, now: Instant) -> bool {
        self.guard().is_missing(now)
    }
    /// The ESC is one that wants no time: armed with its first pulse.
    fn start(&mut self, now: Instant) -> Result<(), ArmError> {
        self.arm()?;
        self.go_on(Tick::new(now + Duration::from_micros(1), 0.001));
        Ok(())
    }
    fn rest(&mut self) {
        self.disarm();
    }
    fn is_ready(&self) -> bool {
        self.is_armed()
    }
    fn stop(&mut self) {
        self.emergency_stop();
    }
    fn clear(&mut self) {
        self.clear_emergency_stop();
    }
    fn is_held(&self) -> bool {
        self.guard().is_stopped()
    }
    fn edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.next_edge()
    }
}

const COMMAND: u16 = 0x300;
const COUNTS: u16 = 0x301;

/// Its pulse as a frame that is sent, its counter as a frame that is received.
struct Wired<M> {
    motor: M,
    pulse: Pin,
    /// The pulse that moves nothing.
    rest: u16,
    listens: bool,
    now: Instant,
    waits: bool,
}

impl<M: OnPins> CanDevice for Wired<M> {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if frame.id() != id(COUNTS).into() || frame.is_remote_frame() || !self.listens {
            return Ingest::Unrelated;
        }
        let Ok(counter) = <[u8; 4]>::try_from(frame.data()) else {
            return Ingest::WrongLength(frame.length());
        };
        self.now = self.now.max(now);
        self.motor.hear(u32::from_be_bytes(counter), now);
        Ingest::Taken
    }
    fn update(&mut self, tick: Tick) {
        self.now = tick.now();
        self.motor.go_on(tick);
        self.waits = true;
    }
    fn next_frame(&mut self) -> Option<CanFrame> {
        let waits = std::mem::take(&mut self.waits);
        waits.then(|| CanFrame::new(id(COMMAND), &self.pulse.0.get().to_be_bytes())).flatten()
    }
    fn put_back(&mut self, frame: &CanFrame) -> bool {
        let is_own = CanDevice::requeue(self, frame);
        self.waits |= is_own;
        is_own
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        frame.id() == id(COMMAND).into() && frame.is_data_frame()
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        let name = MotorName::new("brushed", 3);
        let command = Claim::command(id(COMMAND), name);
        let feedback = Claim::feedback(id(COUNTS), name);
        [Some(command), self.listens.then_some(feedback)].into_iter().flatten()
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.motor.is_missing(now).then(|| MotorName::new("brushed", 3)).into_iter()
    }
    fn superseded(&self) -> u32 {
        0
    }
    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        std::iter::empty()
    }
    fn wrong_setting(&self) -> Option<WrongSetting> {
        None
    }
    fn second_master(&self) -> Option<Claim> {
        None
    }
    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.motor.edge()
    }
    /// The motor asks and starts in one.
    fn ask(&mut self) -> bool {
        self.motor.start(self.now) != Err(ArmError::NotReleased)
    }
    fn engage(&mut self, _now: Instant) {}
    fn trip(&mut self) {
        CanDevice::disarm(self);
    }
    fn disarm(&mut self) {
        self.motor.rest();
        self.pulse.0.set(self.rest);
        self.waits = true;
    }
    fn is_armed(&self) -> bool {
        self.motor.is_ready()
    }
    fn emergency_stop(&mut self) {
        self.motor.stop();
        self.pulse.0.set(self.rest);
        self.waits = true;
    }
    fn clear_emergency_stop(&mut self) {
        self.motor.clear();
    }
    fn is_stopped(&self) -> bool {
        self.motor.is_held()
    }
}

impl<M: OnPins> Devices for Wired<M> {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }
}

impl<M: OnPins> Subject for Wired<M> {
    type Device = Self;
    fn device(&mut self) -> &mut Self {
        self
    }
    fn motors(&self) -> usize {
        usize::from(self.listens)
    }
    fn feedback(&self, _motor: usize) -> Option<CanFrame> {
        CanFrame::new(id(COUNTS), &[0, 0, 0, 7])
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        self.motor.set_velocity((), velocity(share))
    }
    fn is_zero(&self, command: &CanFrame) -> bool {
        command.data() == self.rest.to_be_bytes()
    }
    /// Pins are nobody else's.
    fn rival(&self, _command: &Claim) -> Option<CanFrame> {
        None
    }
}

fn brushed(config: BrushedConfig) -> Wired<Brushed<Pin, [Pin; 1]>> {
    let (pulse, now) = (Pin::default(), Instant::START);
    let motor = Brushed::new(pulse.clone(), [Pin::default()], config).unwrap();
    Wired { motor, pulse, rest: 0, listens: true, now, waits: false }
}

fn rc(config: fn(RcPwm<Pin>) -> RcPwm<Pin>, rest: u16) -> Wired<RcPwm<Pin>> {
    let (pulse, now) = (Pin::default(), Instant::START);
    let motor = config(RcPwm::new(pulse.clone())).with_arming_time(Duration::ZERO);
    let motor = motor.with_full_speed(velocity(2.0)).unwrap();
    Wired { motor, pulse, rest, listens: false, now, waits: false }
}

#[test]
fn motors_on_pins_keep_the_contract() {
    let wheel = BrushedConfig::new(3)
        .with_encoder(1_320.0, 32)
        .with_speed_loop(PidConfig::new(0.02, 0.3, 0.0));
    assert_eq!(check_contract(|| brushed(wheel)), Ok(RULES));
    assert_eq!(check_contract(|| brushed(wheel.reversed().with_limit(0.3))), Ok(RULES));
    assert_eq!(check_contract(|| rc(|esc| esc, 1_500)), Ok(RULES));
    assert_eq!(check_contract(|| rc(RcPwm::with_off_at_rest, 0)), Ok(RULES));
}
