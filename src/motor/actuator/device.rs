//! The motor as a device of the runner.

use super::{Actuator, DriveProtocol, Offered, Order, Target};
use crate::frame::CanFrame;
use crate::motor::{
    AngleDrive, CanDevice, Capabilities, Capability, Claim, Condition, Conditions, Devices, Ingest,
    MotorName, TargetError, VelocityDrive, Visitor, WrongSetting,
};
use crate::time::{Edge, Instant, Tick, TimeStep};
use crate::units::{Angle, AngularVelocity};
use embedded_can::Frame;

impl<M: DriveProtocol> CanDevice for Actuator<M> {
    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if self.route.certain.fits(frame) {
            self.take(frame, now)
        } else if self.route.fits(frame) {
            self.take_by_claims(frame, now)
        } else {
            Ingest::Unrelated
        }
    }

    #[inline]
    fn update(&mut self, tick: Tick) {
        let (mut step, now) = (TimeStep::of_motor(tick.dt_s()), tick.now());
        let goes_on = self.goes_on(step, now);
        if goes_on || self.decide(&mut step, now) {
            if self.offered.waits {
                self.withdraw();
            }
            let target = if goes_on { self.target } else { self.goal };
            let frame = Some(self.motor.control(Order { target, share: self.share, step }));
            self.offered = Offered { frame, waits: true, may_wait: true, is_rest: false };
        }
    }

    #[inline]
    fn next_frame(&mut self) -> Option<CanFrame> {
        if !self.offered.may_wait {
            return None;
        }
        if self.switching.is_some() {
            return self.switching.take();
        }
        self.offered.may_wait = false;
        if !core::mem::take(&mut self.offered.waits) {
            return None;
        }
        let frame = self.offered.frame?;
        self.last = Some(frame);
        Some(frame)
    }

    /// Each update offers the newest command anyway. A frame for the drive's power comes again if still wanted.
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        // Of an id that several motors send, only the frames that this one sent.
        let is_known = [self.switched, self.last].contains(&Some(*frame));
        // Once: a poll may have the same bytes.
        if self.switched.take_if(|switched| switched == frame).is_some() {
            self.give_back();
        }
        let may_send = |claim: Claim| {
            let is_its = is_known || !claim.is_shared();
            !claim.is_feedback() && is_its && claim.covers(frame.id())
        };
        let is_own = match frame.is_remote() {
            true => is_known,
            false => self.motor.claims().into_iter().any(may_send),
        };
        if is_own {
            self.leave_out(frame);
        }
        // Rest that was not sent gives way to no other frame.
        self.offered.is_rest &= self.offered.frame != Some(*frame);
        is_own
    }

    fn put_back(&mut self, frame: &CanFrame) -> bool {
        let taken = Some(*frame);
        if self.has_posted && self.switching.is_none() && self.switched == taken {
            self.switching = taken;
        } else if !self.offered.waits && self.offered.frame == taken && self.last == taken {
            self.offered.waits = true;
        } else {
            return false;
        }
        self.offered.may_wait = true;
        true
    }

    fn superseded(&self) -> u32 {
        self.superseded
    }

    fn claims(&self) -> impl Iterator<Item = Claim> {
        self.motor.claims().into_iter()
    }

    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
        self.guard.is_missing(now).then(|| self.motor.name()).into_iter()
    }

    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)> {
        let unfit = || (self.motor.name(), self.guard.conditions());
        self.watch.is_faulty(&self.guard).then(unfit).into_iter()
    }

    /// An armed motor has asked before, and asks again before its drive is enabled.
    fn wrong_setting(&self) -> Option<WrongSetting> {
        if self.guard.is_armed() {
            return None;
        }
        // Two drives as delivered have one id.
        let is_single = self.motor.frames_per_answer() != 1 || self.watch.is_single();
        let drives = || WrongSetting::new(self.motor.name(), "number of drives", 1.0, None);
        self.motor.wrong_setting().or_else(|| (!is_single).then(drives))
    }

    fn second_master(&self) -> Option<Claim> {
        self.rival.filter(|_| self.guard.conditions().contains(Condition::SecondMaster))
    }

    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> {
        self.guard.next_edge(self.motor.name())
    }

    fn ask(&mut self) -> bool {
        self.guard.ask()
    }

    fn engage(&mut self, now: Instant) {
        let is_fit = !self.watch.is_faulty(&self.guard) && self.wrong_setting().is_none();
        if is_fit && self.guard.engage(now) {
            self.watch.start(&mut self.guard, self.motor.name(), now);
            self.relax();
        }
    }

    fn disarm(&mut self) {
        self.guard.disarm();
        self.stop();
    }

    fn trip(&mut self) {
        self.guard.trip();
        self.stop();
    }

    fn is_armed(&self) -> bool {
        self.guard.is_armed()
    }

    fn emergency_stop(&mut self) {
        self.guard.emergency_stop();
        self.stop();
    }

    fn clear_emergency_stop(&mut self) {
        self.guard.clear_emergency_stop();
    }

    fn is_stopped(&self) -> bool {
        self.guard.is_stopped()
    }
}

impl<M: DriveProtocol> Devices for Actuator<M> {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }

    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        CanDevice::ingest(self, frame, now)
    }

    #[inline]
    fn update(&mut self, tick: Tick) {
        CanDevice::update(self, tick);
    }

    #[inline]
    fn usual_feedback(&self) -> (u32, u32) {
        (self.route.usual.header, self.route.usual.mask)
    }

    #[inline]
    fn next_frame(&mut self, _turn: u32) -> Option<CanFrame> {
        CanDevice::next_frame(self)
    }
}

/// There is one motor, so its handle is `()`.
impl<M: DriveProtocol> VelocityDrive<()> for Actuator<M> {
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        self.is_online().then(|| self.motor.velocity() * self.joint.sign)
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        self.motor.capabilities()
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        let of_drive = target.is_finite().then_some(target * self.joint.sign);
        self.set(Capability::Velocity, of_drive.map(Target::Velocity).ok_or(TargetError::NotFinite))
    }
}

impl<M: DriveProtocol> AngleDrive<()> for Actuator<M> {
    fn angle(&self, (): ()) -> Option<Angle> {
        Some((self.measured_angle()? - self.joint.zero()?) * self.joint.sign)
    }

    fn set_angle(&mut self, (): (), target: Angle) -> Result<(), TargetError> {
        let of_drive = self.joint.angle_of_drive(target).map(Target::Angle);
        self.set(Capability::Angle, of_drive)
    }
}
