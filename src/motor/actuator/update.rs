//! The reaction of a motor to a frame of its drive and to a target, and its update.

use super::joint::{Inside, Start};
use super::power::Reading;
use super::{Actuator, DriveProtocol, INQUIRY, Impedance, Target};
use crate::frame::CanFrame;
use crate::motor::{
    Capability, Claim, Ingest, Link, Output, Rest, Route, SILENCE_US, TargetError, Vitals,
};
use crate::time::{Instant, TimeStep};
use embedded_can::Frame;

/// Targets, and received frames: feedback, answers, and commands of another controller.
impl<M: DriveProtocol> Actuator<M> {
    /// Takes a frame with an id of the feedback.
    pub(super) fn take(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if self.motor.decode_answer(frame) {
            return Ingest::Taken;
        }
        let outcome = self.motor.decode(frame);
        if outcome == Ingest::Taken {
            let (report, power) = (self.motor.is_enabled(), &self.power);
            let is_usual = report == power.seen && (report != Some(false) || !power.on);
            if !is_usual || !self.guard.hear_in_time(now) {
                self.hear(is_usual, now);
            }
        }
        outcome
    }

    /// Takes feedback that comes later than usual, or reports another state of the drive. After a silence, unless feedback is late only
    /// after more, the drive may have started again, or be another one.
    #[cold]
    #[inline(never)]
    fn hear(&mut self, is_usual: bool, now: Instant) {
        self.is_steady &= is_usual;
        let gap_us = self.guard.gap_us(now).unwrap_or(0);
        let is_silence = self.guard.motor.is_silence(gap_us, self.guard.device.timeouts());
        self.watch.hear(self.guard.gap_us(now), now);
        self.guard.hear(now);
        let has_reset = self.power.hear(self.motor.is_enabled(), now);
        if has_reset {
            self.watch.fail(&mut self.guard, self.motor.vitals().error_code, now);
        }
        if has_reset || is_silence {
            self.motor.forget_settings();
            self.watch.forget_drive();
        }
        if self.joint.depends_on_supply() {
            self.doubt(gap_us, is_silence, now);
        }
        let is_trusted = !self.joint.depends_on_supply();
        self.guard.trust(if is_trusted { self.watch.usual_gap_us().min(SILENCE_US) } else { 0 });
    }

    /// Asks whether the drive of a joint started again: in a silence, or before an angle that jumped. The joint stays where it is, with
    /// its target; without its zero, it trips.
    #[cold]
    #[inline(never)]
    fn doubt(&mut self, gap_us: u32, is_silence: bool, now: Instant) {
        let (velocity, at) = (self.motor.velocity(), now.stamp());
        let reading = self.motor.angle().map(|angle| Reading { angle, velocity, at });
        match self.joint.follow(reading, at, gap_us, is_silence) {
            None => {
                self.guard.lose_zero(now);
                self.watch.fail(&mut self.guard, self.motor.vitals().error_code, now);
            }
            Some(turns) if turns.as_radians() != 0.0 => {
                self.target = self.target.moved(turns);
                self.start.turn(turns);
                self.guard.motor.pause();
                self.is_steady = false;
            }
            Some(_) => {}
        }
    }

    #[inline(never)]
    pub(super) fn take_by_claims(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if frame.is_remote() {
            return Ingest::Unrelated;
        }
        if self.route.is_unknown() {
            self.route = Route::of(|| self.motor.claims());
        }
        let is_its = |claim: Claim| claim.is_feedback() && claim.covers(frame.id());
        let is_feedback =
            self.route.usual.fits(frame) || self.motor.claims().into_iter().any(is_its);
        let outcome = if is_feedback { self.take(frame, now) } else { Ingest::Unrelated };
        if outcome == Ingest::Unrelated {
            self.hear_command(frame, now);
        }
        outcome
    }

    /// Notes a command of another controller. A command with a shared id may be for another drive.
    #[inline(never)]
    fn hear_command(&mut self, frame: &CanFrame, now: Instant) {
        let is_its =
            |claim: &Claim| !claim.is_feedback() && !claim.is_shared() && claim.covers(frame.id());
        let command = self.motor.claims().into_iter().find(is_its);
        if command.is_some() {
            self.rival = command;
            self.watch.hear_rival(&mut self.guard, now);
            self.is_steady = false;
        }
    }

    /// Sets the torque of the output shaft in Nm; positive is counter-clockwise.
    ///
    /// # Errors
    /// Says why the motor cannot take the target now. The value is then not kept for later.
    pub fn set_torque(&mut self, torque_nm: f32) -> Result<(), TargetError> {
        let of_drive = torque_nm.is_finite().then_some(torque_nm * self.joint.sign);
        self.set(Capability::Torque, of_drive.map(Target::Torque).ok_or(TargetError::NotFinite))
    }

    /// Sets a spring and a damper at the output shaft, and a torque beside them.
    ///
    /// # Errors
    /// As [`set_torque`](Self::set_torque), and [`TargetError::NotFinite`] for a stiffness or a damping below zero.
    pub fn set_impedance(&mut self, target: Impedance) -> Result<(), TargetError> {
        self.set(Capability::Impedance, self.joint.impedance_of_drive(target))
    }

    /// Takes a target of the drive, or the reason why there is none.
    pub(super) fn set(
        &mut self,
        kind: Capability,
        target: Result<Target, TargetError>,
    ) -> Result<(), TargetError> {
        if kind != self.kind || !self.guard.has_target() {
            if !self.motor.capabilities().has(kind) {
                return Err(TargetError::Unsupported);
            }
            self.kind = kind;
            // Where there was no target, the loops start afresh.
            self.is_steady = false;
        }
        self.guard.admit(!matches!(target, Err(TargetError::NotFinite)))?;
        self.target = self.guard.require_zero(target.ok())?;
        Ok(())
    }
}

impl<M: DriveProtocol> Actuator<M> {
    /// Moves on to a tick in which the rules have nothing to change; otherwise returns `false`, and moves nothing.
    #[inline(always)]
    pub(super) fn goes_on(&mut self, step: TimeStep, now: Instant) -> bool {
        if !self.is_steady || step.is_hold() {
            return false;
        }
        let Vitals { has_fault, has_warning, .. } = self.motor.vitals();
        !has_fault && !has_warning && self.guard.goes_on(now)
    }

    /// Applies all rules: enables, disables, asks and rests, as the motor may be driven or not. Returns whether a command is due, of the goal
    /// and with the share found here.
    #[cold]
    #[inline(never)]
    pub(super) fn decide(&mut self, step: &mut TimeStep, now: Instant) -> bool {
        let was_steady = core::mem::replace(&mut self.is_steady, false);
        if self.guard.has_target() && !self.motor.capabilities().has(self.kind) {
            self.guard.relax();
        }
        self.place_zero();
        let held = self.guard.pass(now, !step.is_hold());
        let left = self.check(now);
        let output = self.guard.output(held);
        if output == Output::Drive {
            if was_steady {
                self.keep_on(left, true);
                return true;
            }
            if self.was_online && self.has_nothing_due() {
                self.has_posted = false;
                self.follow(left, step);
                return true;
            }
        }
        let may_drive = output != Output::Rest;
        // A question that is given back from now on did not enable the drive, and rest that nobody took was not sent.
        self.switched.take_if(|_| self.power.is_confirmed() && self.switching.is_none());
        self.offered.is_rest &= !self.offered.waits;
        // Frames taken since the update before count, but for a question, whose answer is no feedback.
        if self.motor.frames_per_answer() == 1 {
            let is_told = self.has_posted && self.switching.is_none() && self.switched.is_some();
            self.watch.ask(u16::from(self.offered.is_rest) + u16::from(is_told));
        }
        self.withdraw();
        self.has_posted = false;
        let was_on = self.power.is_on();
        self.switch(may_drive, now);
        let may_drive = may_drive && self.guard.is_armed();
        // Before the drive was on for certain, it was polled where rest would have disabled it.
        self.offered.is_rest &= !was_on || self.power.is_on();
        let inquiry = self.inquire(now);
        let is_at_rest = !may_drive || !self.power.is_ready();
        if !is_at_rest && output == Output::Drive {
            self.follow(left, step);
            return true;
        }
        let command = self.act(may_drive);
        // Between two frames of rest, another frame takes the place of one: the bus never has two of them at once to carry.
        let has_other = self.has_posted || inquiry.is_some();
        let gives_way = is_at_rest && self.offered.is_rest && has_other;
        self.offer(if gives_way { inquiry } else { command });
        let is_rest = |frame: CanFrame| is_at_rest && !gives_way && !frame.is_remote();
        self.offered.is_rest = command.is_some_and(is_rest);
        false
    }

    /// Tells whether the drive is enabled, and no frame but a command is due.
    fn has_nothing_due(&self) -> bool {
        let waits = self.switched.is_some() || self.switching.is_some() || self.offered.is_rest;
        self.power.is_steady() && !waits
    }

    /// Finds what the drive is told of the target, and the share of the output, of which the conditions leave so much.
    fn follow(&mut self, left: f32, step: &mut TimeStep) {
        match self.guard.end_rest() {
            Rest::Relaxed => self.relax(),
            Rest::Pause => *step = step.frozen(),
            Rest::None => {}
        }
        // Without an earlier command nothing is known of the load.
        if core::mem::take(&mut self.is_resting) {
            self.reopen();
        }
        (_, self.share) = self.guard.range(left);
        let opened = self.guard.share();
        if opened < 1.0 || self.watch.soft_limits().is_some() {
            self.narrow(opened, *step);
            return;
        }
        self.keep_on(self.share, self.has_nothing_due() && !self.joint.awaits_zero());
    }

    /// Lets so much of the output, until the slow quantities are due. Of a `settled` motor a condition alone unsettles the next update.
    #[inline]
    fn keep_on(&mut self, left: f32, is_settled: bool) {
        (self.goal, self.share) = (self.target, left);
        // An error and a second master are conditions too, unless ignored.
        self.is_steady = is_settled && self.guard.conditions().is_empty();
        self.guard.wake_at(self.watch.next());
    }

    /// Finds the goal on the way from the start, as far as the output range is open, and within the soft limits.
    #[inline(never)]
    fn narrow(&mut self, opened: f32, step: TimeStep) {
        let (shaft, inside) = self.shaft();
        let dt_s = self.motor.capabilities().has(Capability::Angle).then_some(step.dt_s());
        self.goal = self.start.goal(self.target, opened, shaft, inside, dt_s);
    }

    /// Checks the health of the motor and takes the reactions, which may relax the motor; returns the share of the output left.
    pub(super) fn check(&mut self, now: Instant) -> f32 {
        let share = self.watch.check(&mut self.guard, || self.motor.vitals(), now);
        if self.watch.soft_limits().is_some() && self.is_online() {
            self.check_limits(now);
        }
        share
    }

    /// Returns a question for a setting. The question takes the place of a frame of rest after another one, so an update with a
    /// question has no more frames. A drive reported as enabled gets rest instead.
    fn inquire(&mut self, now: Instant) -> Option<CanFrame> {
        // A drive that lost its supply is silent until it runs again.
        let was_online =
            core::mem::replace(&mut self.was_online, self.guard.link() == Link::Online);
        if was_online && !self.was_online {
            self.motor.forget_settings();
        }
        let is_idle = !self.power.is_on() && !self.has_posted && self.offered.is_rest;
        let is_due = now < self.inquired || now.since(self.inquired) >= INQUIRY;
        if !is_idle || !is_due || self.motor.is_enabled() == Some(true) {
            return None;
        }
        self.inquired = now;
        self.motor.inquire()
    }

    /// Enables or disables the drive, if a frame is due: enabled from when the motor may be driven until no target is left.
    fn switch(&mut self, may_drive: bool, now: Instant) {
        if self.power.begin(now) {
            self.disable();
            if self.switched.is_some() {
                return;
            }
        }
        // A late motor whose target was not set anew stays enabled, and nothing enables it meanwhile, no frame that waits either.
        let stays = self.guard.has_target() && self.power.is_on() && !self.rest_disables;
        if stays && !may_drive {
            if self.switching.is_some() {
                self.give_back();
                self.withdraw_switching();
            }
            return;
        }
        if !self.power.is_on() {
            self.enabling = 0;
        }
        match self.power.step(may_drive, now) {
            Some(true) => self.enable(now),
            Some(false) => self.disable(),
            None => {}
        }
        if may_drive && !self.power.is_ready() {
            self.reopen();
        }
    }

    fn enable(&mut self, now: Instant) {
        if self.motor.wrong_setting().is_some_and(|wrong| wrong.found.is_some()) {
            self.watch.fail(&mut self.guard, self.motor.vitals().error_code, now);
            return;
        }
        // Of several frames none is left out: the one before still waits for the bus.
        if self.switching.is_some() && self.enabling > 0 {
            self.has_posted = true;
            return;
        }
        self.withdraw_switching();
        let frame = self.motor.enable(self.enabling);
        self.enabling = self.enabling.saturating_add(1);
        if frame.is_some() {
            self.reopen();
        }
        self.post(frame);
    }

    fn disable(&mut self) {
        self.withdraw_switching();
        let frame = self.motor.disable();
        self.rest_disables = frame.is_none();
        self.post(frame);
    }

    /// A frame for the drive's power was not sent, and comes again.
    pub(super) const fn give_back(&mut self) {
        self.power.give_back();
        self.enabling = self.enabling.saturating_sub(1);
    }

    /// Returns the command before, or rest. If rest would disable a drive on the way to be enabled, returns the frame that asks
    /// for feedback.
    fn act(&mut self, may_drive: bool) -> Option<CanFrame> {
        if !may_drive || !self.power.is_ready() {
            // A late motor with a target keeps its integral, a motor without a target starts afresh.
            if !self.guard.has_target() {
                self.relax();
            }
            let polls = may_drive && self.switched.is_some() && self.rest_disables;
            return if polls { self.motor.poll() } else { Some(self.rest()) };
        }
        self.offered.frame
    }

    /// Notes whether the shaft is at a soft limit.
    #[inline(never)]
    fn check_limits(&mut self, now: Instant) {
        let ((angle, _), inside) = self.shaft();
        let is_lost = angle.is_none() && self.joint.has_limits();
        if is_lost {
            self.guard.relax();
        }
        self.guard.change_conditions(now, |latch| Inside::check(inside, is_lost, latch));
    }

    pub(super) fn relax(&mut self) {
        if !self.is_resting {
            self.start = Start::NONE;
            self.watch.begin_rest(&mut self.guard);
            self.motor.reset();
            self.is_resting = true;
        }
    }

    /// Rests at once, between two updates.
    pub(super) fn stop(&mut self) {
        self.is_steady = false;
        self.relax();
        if self.power.stop(self.guard.device.updated()) {
            self.disable();
        } else if self.offered.is_rest {
            // At rest already: a program that disarms in each tick must not keep the questions from their turn, nor fill the bus.
            return;
        }
        self.offered.is_rest = false;
        let rest = self.rest();
        self.offer(Some(rest));
        self.offered.is_rest = !rest.is_remote();
    }

    /// Returns the frame of rest: no question unless rest was sent before.
    fn rest(&mut self) -> CanFrame {
        let frame = self.motor.rest();
        if frame.is_remote() && !self.offered.is_rest { self.motor.rest() } else { frame }
    }
}
