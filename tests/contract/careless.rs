//! The check finds what a careless device gets wrong.

use super::dji::OneModel;
use super::*;
use drivetrain::dji::M3508;
use drivetrain::motor::{
    CanDevice, Capabilities, Capability, Claim, Condition, Conditions, Ingest, MotorName, Target,
    Visitor, WrongSetting,
};
use drivetrain::sim::contract::{Rule, Violation};
use drivetrain::time::{Duration, Edge, Instant, Tick};

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
    KeepsRefused,
    TrustsTheStep,
    ArmsAgainAndAgain,
}

/// An actuator with a mistake of its maker in front of it; what it was told last, and whether that was refused.
struct Careless(Actuator<MyMotor>, Mistake, Option<CanFrame>, f32, bool);

impl CanDevice for Careless {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let same_number = frame.id() == id(0x143).into();
        let long = CanFrame::new(id(0x143), &[0, 0, 30]).unwrap();
        match self.1 {
            Mistake::TakesShortFrames if same_number && frame.is_data_frame() => {
                CanDevice::ingest(&mut self.0, &long, now)
            }
            Mistake::HearsRemoteFrames if same_number => CanDevice::ingest(&mut self.0, &long, now),
            _ => CanDevice::ingest(&mut self.0, frame, now),
        }
    }
    fn update(&mut self, tick: Tick) {
        match self.1 {
            Mistake::ForgetsTheLimit | Mistake::ForgetsTheDeadline => {
                let forgets_limit = self.1 == Mistake::ForgetsTheLimit;
                if forgets_limit && self.0.is_armed() {
                    let long = CanFrame::new(id(0x143), &[0, 0, 30]).unwrap();
                    _ = CanDevice::ingest(&mut self.0, &long, tick.now());
                } else if self.0.is_armed() && self.3 != 0.0 {
                    _ = drive_own(&mut self.0, self.3);
                }
                CanDevice::update(&mut self.0, tick);
            }
            Mistake::KeepsRefused => {
                if self.4 && drive_own(&mut self.0, self.3).is_ok() {
                    self.4 = false;
                }
                CanDevice::update(&mut self.0, tick);
            }
            Mistake::TrustsTheStep => CanDevice::update(&mut self.0, Tick::new(tick.now(), 0.001)),
            _ => CanDevice::update(&mut self.0, tick),
        }
        if self.1 == Mistake::MovesDisarmed
            || (self.1 == Mistake::IgnoresTheStop && self.is_stopped())
        {
            self.2 = CanFrame::standard(0x123, [1; 8]);
        }
    }
    fn next_frame(&mut self) -> Option<CanFrame> {
        let frame = self.2.take().or_else(|| CanDevice::next_frame(&mut self.0));
        match self.1 {
            Mistake::OffersForEver => frame.or(CanFrame::standard(0x123, [0; 8])),
            Mistake::SendsUnclaimed => {
                frame.and_then(|frame| CanFrame::standard(0x100, *frame.bytes()))
            }
            _ => frame,
        }
    }
    fn put_back(&mut self, frame: &CanFrame) -> bool {
        CanDevice::put_back(&mut self.0, frame)
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        if self.1 == Mistake::OffersAtOnce {
            self.2 = Some(*frame);
        }
        CanDevice::requeue(&mut self.0, frame) || self.1 == Mistake::RequeuesAnything
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.0.claims()
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.0.missing(now).filter(|_| self.1 != Mistake::ArmsUnheard)
    }
    fn superseded(&self) -> u32 {
        CanDevice::superseded(&self.0)
    }
    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        self.0.faulty()
    }
    fn wrong_setting(&self) -> Option<WrongSetting> {
        self.0.wrong_setting()
    }
    fn second_master(&self) -> Option<Claim> {
        self.0.second_master()
    }
    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        CanDevice::next_edge(&mut self.0)
    }
    fn ask(&mut self) -> bool {
        let granted = self.0.ask();
        granted || self.1 == Mistake::ArmsAgainAndAgain
    }
    fn trip(&mut self) {
        CanDevice::trip(&mut self.0);
    }
    fn engage(&mut self, now: Instant) {
        if self.1 == Mistake::ArmsAgainAndAgain && !self.0.is_armed() {
            self.0 = Actuator::new(MyMotor::new(3).unwrap());
            let heard = CanFrame::new(id(0x143), &[0, 0, 30]).unwrap();
            _ = CanDevice::ingest(&mut self.0, &heard, now);
        }
        self.0.engage(now);
        if self.1 == Mistake::KeepsItsTarget && self.3 != 0.0 {
            _ = drive_own(&mut self.0, self.3);
        }
    }
    fn disarm(&mut self) {
        CanDevice::disarm(&mut self.0);
    }
    fn is_armed(&self) -> bool {
        self.0.is_armed()
    }
    fn emergency_stop(&mut self) {
        CanDevice::emergency_stop(&mut self.0);
    }
    fn clear_emergency_stop(&mut self) {
        CanDevice::clear_emergency_stop(&mut self.0);
    }
    fn is_stopped(&self) -> bool {
        self.0.is_stopped()
    }
}

impl Devices for Careless {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }
}

fn careless(mistake: Mistake) -> Result<usize, Violation> {
    check_contract(|| Mixed {
        device: Careless(Actuator::new(MyMotor::new(3).unwrap()), mistake, None, 0.0, false),
        ids: vec![0x143],
        drive: |device: &mut Careless, share| {
            let share = match device.1 {
                Mistake::KeepsNan if share.is_nan() => 1.0,
                _ => share,
            };
            let taken = drive_own(&mut device.0, share);
            match taken {
                Ok(()) => device.3 = share,
                Err(error) => device.4 = error == TargetError::NoFeedback,
            }
            taken
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
        (Mistake::KeepsRefused, Rule::RefusedTargetsAreZero),
        (Mistake::KeepsNan, Rule::NanIsZero),
        (Mistake::TrustsTheStep, Rule::BadStepsAreZero),
    ] {
        assert_eq!(careless(mistake).map_err(|violation| violation.rule), Err(rule), "{mistake:?}");
    }
}

#[test]
fn a_violation_names_rule_time_and_the_last_frame() {
    let violation = careless(Mistake::MovesDisarmed).unwrap_err();
    let text =
        "DisarmedIsZero is broken after 2 ms, the last frame was 123 [8] 01 01 01 01 01 01 01 01";
    assert_eq!(violation.to_string(), text);
}

/// What a struct of devices forgets to forward, or gets wrong on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Slip {
    None,
    ArmsFaulty,
    ArmsBesideAnother,
    HasNoEdges,
    DropsEdges,
    RepeatsEdges,
    SwapsEdges,
    StampsWhenRead,
    NamesAnother,
    CountsItsOwnTime,
}

/// Two wheels behind somebody's own struct.
struct Slipping {
    wheels: OneModel<M3508, 2>,
    slip: Slip,
    last: Option<Edge<Condition, MotorName>>,
    repeated: u32,
    now: Instant,
}

impl CanDevice for Slipping {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        self.wheels.device().ingest(frame, now)
    }
    fn update(&mut self, tick: Tick) {
        let own_time = self.slip == Slip::CountsItsOwnTime && tick.now() <= self.now;
        let now = if own_time { self.now + Duration::from_millis(1) } else { tick.now() };
        self.now = now;
        self.wheels.device().update(Tick::new(now, tick.dt_s()));
        if self.slip == Slip::DropsEdges {
            self.last = self.wheels.device().next_edge().or(self.last);
        }
    }
    fn next_frame(&mut self) -> Option<CanFrame> {
        self.wheels.device().next_frame()
    }
    fn put_back(&mut self, frame: &CanFrame) -> bool {
        CanDevice::put_back(self.wheels.device(), frame)
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        self.wheels.device().requeue(frame)
    }
    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.wheels.bus().claims()
    }
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.wheels.bus().missing(now)
    }
    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        self.wheels.bus().faulty().filter(|_| self.slip != Slip::ArmsFaulty)
    }
    fn wrong_setting(&self) -> Option<WrongSetting> {
        self.wheels.bus().wrong_setting()
    }
    fn second_master(&self) -> Option<Claim> {
        self.wheels.bus().second_master().filter(|_| self.slip != Slip::ArmsBesideAnother)
    }
    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        let edge = match self.slip {
            Slip::HasNoEdges => None,
            Slip::DropsEdges => self.last.take(),
            _ => self.wheels.device().next_edge(),
        };
        match (self.slip, edge) {
            (Slip::RepeatsEdges, Some(edge)) if self.repeated < 3 => self.last = Some(edge),
            (Slip::RepeatsEdges, None) if self.repeated < 3 => {
                self.repeated += 1;
                return self.last.take();
            }
            _ => {}
        }
        edge.map(|edge| Edge {
            at: if self.slip == Slip::StampsWhenRead { self.now } else { edge.at },
            began: edge.began ^ (self.slip == Slip::SwapsEdges),
            source: match self.slip {
                Slip::NamesAnother => MotorName::new("M3508", 3 - edge.source.id()),
                _ => edge.source,
            },
            ..edge
        })
    }
    fn superseded(&self) -> u32 {
        self.wheels.bus().superseded()
    }
    fn ask(&mut self) -> bool {
        self.wheels.device().ask()
    }
    fn trip(&mut self) {
        CanDevice::trip(self.wheels.device());
    }
    fn engage(&mut self, now: Instant) {
        self.wheels.device().engage(now);
    }
    fn disarm(&mut self) {
        self.wheels.device().disarm();
    }
    fn is_armed(&self) -> bool {
        self.wheels.bus().is_armed()
    }
    fn emergency_stop(&mut self) {
        self.wheels.device().emergency_stop();
    }
    fn clear_emergency_stop(&mut self) {
        self.wheels.device().clear_emergency_stop();
    }
    fn is_stopped(&self) -> bool {
        self.wheels.bus().is_stopped()
    }
}

impl Devices for Slipping {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }
}

impl Subject for Slipping {
    type Device = Self;
    fn device(&mut self) -> &mut Self {
        self
    }
    fn motors(&self) -> usize {
        self.wheels.motors()
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        self.wheels.feedback(motor)
    }
    fn fault(&self, motor: usize) -> Option<CanFrame> {
        self.wheels.fault(motor)
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        self.wheels.drive(share)
    }
}

#[test]
fn the_check_finds_what_a_struct_of_devices_does_not_forward() {
    let slipping = |slip| {
        let check = check_contract(|| Slipping {
            wheels: OneModel::new([1, 2], |config| config),
            slip,
            last: None,
            repeated: 0,
            now: Instant::START,
        });
        check.map_err(|violation| violation.rule)
    };
    assert_eq!(slipping(Slip::None), Ok(RULES));
    for (slip, rule) in [
        (Slip::CountsItsOwnTime, Rule::LostTimeTrips),
        (Slip::ArmsFaulty, Rule::FaultIsNotArmed),
        (Slip::ArmsBesideAnother, Rule::SecondMasterIsNotArmed),
        (Slip::HasNoEdges, Rule::ChangeIsAnEdge),
        (Slip::NamesAnother, Rule::ChangeIsAnEdge),
        (Slip::SwapsEdges, Rule::ChangeIsAnEdge),
        (Slip::DropsEdges, Rule::ChangeIsAnEdge),
        (Slip::RepeatsEdges, Rule::EdgesDoNotFlood),
        (Slip::StampsWhenRead, Rule::EdgesWait),
    ] {
        assert_eq!(slipping(slip), Err(rule), "{slip:?}");
    }
}

/// What the loop of an actuator gets wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Haste {
    None,
    IgnoresTheShare,
    BeginsAbove,
    OpensTooEarly,
    HasNoLimit,
    /// Its command is an offset binary number, and its rest zero bytes.
    RestsAtTheEnd,
    /// Rests for 50 ms more after each rest.
    SleepsOn,
}

/// A motor whose command is its torque in percent of the largest, 2 Nm; and the commands for which it sleeps on.
struct Hasty(Haste, u8);

impl DriveProtocol for Hasty {
    fn name(&self) -> MotorName {
        MotorName::new("hasty", 1)
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        [Claim::command(id(0x123), self.name()), Claim::feedback(id(0x143), self.name())]
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        if frame.data().len() == 3 { Ingest::Taken } else { Ingest::Unrelated }
    }
    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::ZERO
    }
    fn rest(&mut self) -> CanFrame {
        CanFrame::new(id(0x123), &[0]).unwrap()
    }
    fn control(&mut self, Order { target, share, .. }: Order) -> CanFrame {
        let Target::Torque(torque_nm) = target else { return self.rest() };
        if self.1 > 0 {
            self.1 -= 1;
            return self.rest();
        }
        let limit = match self.0 {
            Haste::None | Haste::RestsAtTheEnd | Haste::SleepsOn => share,
            Haste::IgnoresTheShare => 1.0,
            Haste::BeginsAbove => (0.3 + 0.7 * share).min(1.0),
            Haste::OpensTooEarly => (3.0 * share).min(1.0),
            Haste::HasNoLimit => 10.0 * share,
        };
        let effort = (torque_nm / 2.0).clamp(-limit, limit);
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let percent = (100.0 * effort) as i8;
        let offset = if self.0 == Haste::RestsAtTheEnd { 100 } else { 0 };
        CanFrame::new(id(0x123), &[percent.cast_unsigned().wrapping_add(offset)]).unwrap()
    }
    fn reset(&mut self) {
        self.1 = if self.0 == Haste::SleepsOn { 50 } else { 0 };
    }
    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Torque, Capability::Feedback])
    }
}

struct HastySubject(Actuator<Hasty>, bool);

impl Subject for HastySubject {
    type Device = Actuator<Hasty>;
    fn device(&mut self) -> &mut Actuator<Hasty> {
        &mut self.0
    }
    fn motors(&self) -> usize {
        1
    }
    fn feedback(&self, _motor: usize) -> Option<CanFrame> {
        CanFrame::new(id(0x143), &[0, 0, 30])
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        self.0.set_torque(2.4 * share)
    }
    fn effort(&self, command: &CanFrame) -> Option<f32> {
        let [byte, ..] = *command.bytes();
        let percent = match self.0.motor().0 {
            Haste::RestsAtTheEnd => f32::from(byte) - 100.0,
            _ => f32::from(byte.cast_signed()),
        };
        self.1.then_some(percent / 100.0)
    }
}

#[test]
fn the_check_finds_a_loop_that_drives_at_once_or_without_a_limit() {
    for (haste, knows_effort, found) in [
        (Haste::None, true, Ok(RULES)),
        (Haste::IgnoresTheShare, false, Err(Rule::OpensFromZero)),
        (Haste::BeginsAbove, true, Err(Rule::OpensFromZero)),
        (Haste::OpensTooEarly, true, Err(Rule::OpensFromZero)),
        (Haste::HasNoLimit, true, Err(Rule::OpensFromZero)),
        (Haste::RestsAtTheEnd, true, Err(Rule::DisarmedIsZero)),
        (Haste::SleepsOn, true, Err(Rule::OldTargetsAreZero)),
    ] {
        let checked = check_contract(|| HastySubject(Actuator::new(Hasty(haste, 0)), knows_effort));
        assert_eq!(checked.map_err(|violation| violation.rule), found, "{haste:?}");
    }
}
