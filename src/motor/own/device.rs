//! The motor as a device of the runner.

use super::{LONGEST_STEP_S, Own, OwnMotor};
use crate::control::TimeStep;
use crate::frame::CanFrame;
use crate::motor::{
    CanDevice, Claim, Devices, Edge, Ingest, MotorName, Role, Visitor, WrongSetting,
};
use crate::time::{Instant, Tick};
use embedded_can::Frame;

impl<M: OwnMotor> CanDevice for Own<M> {
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if frame.is_remote() {
            return Ingest::Unrelated;
        }
        let (mut is_feedback, mut command) = (false, None);
        for claim in self.motor.claims().into_iter().filter(|claim| claim.covers(frame.id())) {
            match claim.role() {
                Role::Feedback => is_feedback = true,
                Role::Command => command = Some(claim),
            }
        }
        if is_feedback && self.motor.decode_answer(frame) {
            return Ingest::Taken;
        }
        let outcome = if is_feedback { self.motor.decode(frame) } else { Ingest::Unrelated };
        if outcome == Ingest::Taken {
            self.watch.hear(now);
            self.guard.hear(now);
            self.hear_power(now);
        } else if outcome == Ingest::Unrelated && command.is_some() {
            self.rival = command;
            self.watch.hear_rival(now);
        }
        outcome
    }

    fn update(&mut self, tick: Tick) {
        let step = TimeStep::new(tick.dt_s(), LONGEST_STEP_S);
        let left = self.look(tick.now());
        let drives = self.guard.drives(tick.now());
        let may_drive = drives && !(step.is_hold() && self.held.is_none());
        self.switch(may_drive, tick.now());
        self.inquire(tick.now());
        let command = self.act(may_drive, step, left);
        self.offer(command);
    }

    fn next_frame(&mut self) -> Option<CanFrame> {
        self.switching.take().or_else(|| self.inquiry.take()).or_else(|| self.command.take())
    }

    /// Each update offers the newest command anyway. A frame for the drive's power comes again if it is still wanted.
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        if self.switched == Some(*frame) {
            self.power.give_back();
            self.enabling = self.enabling.saturating_sub(1);
        }
        // Of an id that several motors send, only the frames that this one sent.
        let is_known = [self.switched, self.asked].contains(&Some(*frame));
        let mut commands = self
            .motor
            .claims()
            .into_iter()
            .filter(|claim| claim.role() == Role::Command && (is_known || !claim.is_shared()));
        let is_own = !frame.is_remote() && commands.any(|claim| claim.covers(frame.id()));
        self.superseded = self.superseded.wrapping_add(u32::from(is_own));
        is_own
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

    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        self.watch.is_faulty(&self.guard).then(|| self.motor.name()).into_iter()
    }

    fn wrong_setting(&self) -> Option<WrongSetting> {
        self.motor.wrong_setting()
    }

    fn second_master(&self) -> Option<Claim> {
        self.rival.filter(|_| self.watch.has_rival())
    }

    fn next_edge(&mut self) -> Option<Edge> {
        self.guard.next_edge(self.motor.name())
    }

    fn ask(&mut self) -> bool {
        self.guard.ask()
    }

    fn engage(&mut self, now: Instant) {
        let is_fit = !self.watch.is_faulty(&self.guard) && self.motor.wrong_setting().is_none();
        if is_fit && self.guard.engage(now) {
            self.watch.start(&mut self.guard, now);
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

impl<M: OwnMotor> Devices for Own<M> {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }
}
