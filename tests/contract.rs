//! Every device keeps the contract of `CanDevice`: each model, tuples and arrays of buses, a motor of one's own; and the
//! check finds devices that do not.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{
    AnyHandle, Bus, Config, Gm6020Current, Gm6020Voltage, Handle, M2006, M3508, Model,
};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    CanDevice, Claim, Ingest, MotorName, Own, Recovery, TargetError, VelocityDrive,
};
use drivetrain::sim::{Rule, Subject, Violation, check_contract};
use drivetrain::snake::{Command, Config as JointConfig, Joint, Joints, Register, Reply};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::Frame;

#[expect(dead_code, reason = "the example's own main and simulation")]
#[path = "../examples/custom_motor.rs"]
mod custom_motor;
use custom_motor::MyMotor;

const SPEED: PidConfig = PidConfig::new(1.0, 4.0, 0.0);
const RULES: usize = 20;

fn velocity(share: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(5.0 * share)
}

fn rest(id: u16) -> Option<CanFrame> {
    CanFrame::standard(id, [0x10, 0, 0, 0, 0, 0, 30, 0])
}

/// A bus with motors of one model, driven through `VelocityDrive`.
struct OneModel<M: Model, const N: usize>(Bus, [Handle<M>; N], [u8; N]);

impl<M: Model, const N: usize> OneModel<M, N> {
    fn new(ids: [u8; N], config: impl Fn(Config<M>) -> Config<M>) -> Self {
        let mut bus = Bus::new();
        let handles = bus.attach_all(ids.map(|id| config(Config::new(id).speed_loop(SPEED))));
        Self(bus, handles.unwrap(), ids)
    }
}

impl<M: Model, const N: usize> Subject for OneModel<M, N> {
    type Device = Bus;
    fn device(&mut self) -> &mut Bus {
        &mut self.0
    }
    fn motors(&self) -> usize {
        N
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        rest(M::FACTS.feedback_base + u16::from(self.2[motor]))
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        self.0.drive(self.1.map(|handle| (handle, velocity(share))))
    }
    fn drive_unsupported(&mut self) -> Result<(), TargetError> {
        let positions = self.1.map(|handle| self.0.set_position(handle, Position::ZERO));
        positions.into_iter().collect()
    }
}

#[test]
fn a_bus_of_each_model_keeps_the_contract() {
    assert_eq!(check_contract(|| OneModel::<M3508, 4>::new([1, 2, 3, 4], |c| c)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<M3508, 2>::new([2, 7], Config::reversed)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<M2006, 3>::new([1, 5, 8], |c| c)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<Gm6020Voltage, 2>::new([1, 7], |c| c)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<Gm6020Current, 2>::new([4, 5], |c| c)), Ok(RULES));
    let ramp = Recovery::Ramp(Duration::from_millis(50));
    let ramps = || OneModel::<M3508, 2>::new([1, 2], |config| config.with_recovery(ramp));
    assert_eq!(check_contract(ramps), Ok(RULES));
}

/// Anything with a list of feedback ids and a function that drives it.
struct Mixed<D> {
    device: D,
    ids: Vec<u16>,
    drive: fn(&mut D, f32) -> Result<(), TargetError>,
}

impl<D: CanDevice> Subject for Mixed<D> {
    type Device = D;
    fn device(&mut self) -> &mut D {
        &mut self.device
    }
    fn motors(&self) -> usize {
        self.ids.len()
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        match self.ids[motor] {
            own @ 0x140..0x150 => CanFrame::new(id(own), &[0, 0, 30]),
            dji => rest(dji),
        }
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.drive)(&mut self.device, share)
    }
}

fn id(raw: u16) -> embedded_can::StandardId {
    embedded_can::StandardId::new(raw).unwrap()
}

fn bus<M: Model>(ids: &[u8]) -> Bus {
    let mut bus = Bus::new();
    for id in ids {
        bus.attach(Config::<M>::new(*id).speed_loop(SPEED)).unwrap();
    }
    bus
}

fn drive_all(bus: &mut Bus, share: f32) -> Result<(), TargetError> {
    let motors: Vec<AnyHandle> = bus.motors().map(|(motor, _)| motor).collect();
    bus.drive(motors.into_iter().map(|motor| (motor, velocity(share))))
}

fn drive_own(motor: &mut Own<MyMotor>, share: f32) -> Result<(), TargetError> {
    motor.set_velocity((), velocity(share))
}

#[test]
fn tuples_and_arrays_of_buses_keep_the_contract() {
    let pair = || Mixed {
        device: (bus::<M3508>(&[1, 2]), bus::<Gm6020Voltage>(&[5])),
        ids: vec![0x201, 0x202, 0x209],
        drive: |(wheels, yaw), share| drive_all(wheels, share).and(drive_all(yaw, share)),
    };
    assert_eq!(check_contract(pair), Ok(RULES));
    let array = || Mixed {
        device: [bus::<M3508>(&[1]), bus::<M2006>(&[6]), bus::<Gm6020Current>(&[7])],
        ids: vec![0x201, 0x206, 0x20B],
        drive: |buses, share| {
            let outcomes = buses.each_mut().map(|bus| drive_all(bus, share));
            outcomes.into_iter().collect()
        },
    };
    assert_eq!(check_contract(array), Ok(RULES));
}

#[test]
fn the_motor_of_the_example_keeps_the_contract_alone_and_beside_dji_motors() {
    let alone =
        || Mixed { device: Own::new(MyMotor::new(3).unwrap()), ids: vec![0x143], drive: drive_own };
    assert_eq!(check_contract(alone), Ok(RULES));
    let beside = || Mixed {
        device: (
            bus::<M3508>(&[1]),
            Own::new(MyMotor::new(3).unwrap()),
            Own::new(MyMotor::new(4).unwrap()),
        ),
        ids: vec![0x201, 0x143, 0x144],
        drive: |(bus, third, fourth), share| {
            let (bus, third) = (drive_all(bus, share), drive_own(third, share));
            bus.and(third).and(drive_own(fourth, share))
        },
    };
    assert_eq!(check_contract(beside), Ok(RULES));
}

/// Joints that answer what they are asked.
struct Snake(Joints, Vec<Joint>);

impl Snake {
    fn new(ids: impl IntoIterator<Item = u8>, config: fn(JointConfig) -> JointConfig) -> Self {
        let mut joints = Joints::new();
        let ids = ids.into_iter();
        let handles = ids.map(|id| joints.attach(config(JointConfig::new(id))).unwrap()).collect();
        Self(joints, handles)
    }
}

impl Subject for Snake {
    type Device = Joints;
    fn device(&mut self) -> &mut Joints {
        &mut self.0
    }
    fn motors(&self) -> usize {
        self.1.len()
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        let (joint, name) = self.0.joints().nth(motor)?;
        let register = self.0.awaited(joint).unwrap_or(Register::ActualPosition);
        let value = i32::from(register == Register::Enable);
        CanFrame::new(id(u16::from(name.id())), &Reply::new(register, value).encode())
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        let position = Position::from_angle(Angle::from_turns(share));
        let outcomes = self.1.iter().map(|joint| self.0.set_position(*joint, position));
        outcomes.fold(Ok(()), Result::and)
    }
    fn is_zero(&self, command: &CanFrame) -> bool {
        Command::decode(command.data()).is_some_and(Command::is_safe)
    }
    fn late_ms(&self) -> u64 {
        41
    }
    /// A joint that owes an answer is left alone for 2 ms.
    fn stop_ms(&self) -> u64 {
        3
    }
}

#[test]
fn joints_with_a_position_loop_of_their_own_keep_the_contract() {
    assert_eq!(check_contract(|| Snake::new(1..=12, |config| config)), Ok(RULES));
    assert_eq!(check_contract(|| Snake::new([3, 7], JointConfig::reversed)), Ok(RULES));
    assert_eq!(check_contract(|| Snake::new([12], |config| config)), Ok(RULES));
}

/// What a careless device gets wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mistake {
    None,
    MovesDisarmed,
    OffersForEver,
    SendsUnclaimed,
    TakesShortFrames,
    HearsRemoteFrames,
    ForgetsTheLimit,
    ForgetsTheDeadline,
    IgnoresTheStop,
    RequeuesAnything,
    OffersAtOnce,
    ArmsUnheard,
    KeepsItsTarget,
    KeepsNan,
    TrustsTheStep,
}

/// An own motor with a mistake of its maker in front of it.
struct Careless(Own<MyMotor>, Mistake, Option<CanFrame>, f32);

impl CanDevice for Careless {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let same_number = frame.id() == id(0x143).into();
        let long = CanFrame::new(id(0x143), &[0, 0, 30]).unwrap();
        match self.1 {
            Mistake::TakesShortFrames if same_number && frame.is_data_frame() => {
                self.0.ingest(&long, now)
            }
            Mistake::HearsRemoteFrames if same_number => self.0.ingest(&long, now),
            _ => self.0.ingest(frame, now),
        }
    }
    fn update(&mut self, tick: Tick) {
        match self.1 {
            Mistake::ForgetsTheLimit | Mistake::ForgetsTheDeadline => {
                let forgets_limit = self.1 == Mistake::ForgetsTheLimit;
                if forgets_limit && self.0.is_armed() {
                    let long = CanFrame::new(id(0x143), &[0, 0, 30]).unwrap();
                    _ = self.0.ingest(&long, tick.now());
                } else if self.0.is_armed() && self.3 != 0.0 {
                    _ = drive_own(&mut self.0, self.3);
                }
                self.0.update(tick);
            }
            Mistake::TrustsTheStep => self.0.update(Tick::new(tick.now(), 0.001)),
            _ => self.0.update(tick),
        }
        if self.1 == Mistake::MovesDisarmed
            || (self.1 == Mistake::IgnoresTheStop && self.is_stopped())
        {
            self.2 = CanFrame::standard(0x123, [1; 8]);
        }
    }
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
        let frame = self.2.take().or_else(|| self.0.next_frame(turn));
        match self.1 {
            Mistake::OffersForEver => frame.or(CanFrame::standard(0x123, [0; 8])),
            Mistake::SendsUnclaimed => {
                frame.and_then(|frame| CanFrame::standard(0x100, *frame.bytes()))
            }
            _ => frame,
        }
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        if self.1 == Mistake::OffersAtOnce {
            self.2 = Some(*frame);
        }
        self.0.requeue(frame) || self.1 == Mistake::RequeuesAnything
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.0.claims()
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.0.missing(now).filter(|_| self.1 != Mistake::ArmsUnheard)
    }
    fn engage(&mut self, now: Instant) {
        self.0.engage(now);
        if self.1 == Mistake::KeepsItsTarget && self.3 != 0.0 {
            _ = drive_own(&mut self.0, self.3);
        }
    }
    fn disarm(&mut self) {
        self.0.disarm();
    }
    fn is_armed(&self) -> bool {
        self.0.is_armed()
    }
    fn emergency_stop(&mut self) {
        self.0.emergency_stop();
    }
    fn clear_emergency_stop(&mut self) {
        self.0.clear_emergency_stop();
    }
    fn is_stopped(&self) -> bool {
        self.0.is_stopped()
    }
}

fn careless(mistake: Mistake) -> Result<usize, Violation> {
    check_contract(|| Mixed {
        device: Careless(Own::new(MyMotor::new(3).unwrap()), mistake, None, 0.0),
        ids: vec![0x143],
        drive: |device: &mut Careless, share| {
            let share = match device.1 {
                Mistake::KeepsNan if share.is_nan() => 1.0,
                _ => share,
            };
            drive_own(&mut device.0, share)?;
            device.3 = share;
            Ok(())
        },
    })
}

/// A wheel that takes another target for one that it does not offer; and says so, or not.
struct Obliging(OneModel<M3508, 1>, Result<(), TargetError>);

impl Subject for Obliging {
    type Device = Bus;
    fn device(&mut self) -> &mut Bus {
        self.0.device()
    }
    fn motors(&self) -> usize {
        1
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        self.0.feedback(motor)
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        self.0.drive(share)
    }
    fn drive_unsupported(&mut self) -> Result<(), TargetError> {
        self.0.drive(0.5)?;
        self.1
    }
}

#[test]
fn the_check_finds_a_target_that_is_taken_without_being_offered() {
    for answer in [Ok(()), Err(TargetError::Unsupported)] {
        let found = check_contract(|| Obliging(OneModel::new([1], |config| config), answer));
        assert_eq!(found.map_err(|violation| violation.rule), Err(Rule::UnsupportedIsAnError));
    }
}

#[test]
fn the_check_finds_what_a_careless_device_gets_wrong() {
    assert_eq!(careless(Mistake::None), Ok(RULES));
    for (mistake, rule) in [
        (Mistake::MovesDisarmed, Rule::DisarmedIsZero),
        (Mistake::OffersForEver, Rule::IsBounded),
        (Mistake::SendsUnclaimed, Rule::SendsWhatItClaims),
        (Mistake::TakesShortFrames, Rule::ShortIsNotTaken),
        (Mistake::HearsRemoteFrames, Rule::ForeignIsUnrelated),
        (Mistake::ForgetsTheLimit, Rule::RejectedIsNotFresh),
        (Mistake::ForgetsTheDeadline, Rule::OldTargetsAreZero),
        (Mistake::IgnoresTheStop, Rule::EmergencyStopStays),
        (Mistake::RequeuesAnything, Rule::ForeignIsNotRequeued),
        (Mistake::OffersAtOnce, Rule::RequeuedComesAgain),
        (Mistake::ArmsUnheard, Rule::MissingAreNamed),
        (Mistake::KeepsItsTarget, Rule::StartsFromZero),
        (Mistake::KeepsNan, Rule::NanIsZero),
        (Mistake::TrustsTheStep, Rule::BadStepsAreZero),
    ] {
        assert_eq!(careless(mistake).map_err(|violation| violation.rule), Err(rule), "{mistake:?}");
    }
}
