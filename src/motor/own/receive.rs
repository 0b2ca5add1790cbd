//! Received frames of an own motor: feedback, answers, and commands of another controller.

use super::route::Route;
use super::{Own, OwnMotor};
use crate::frame::CanFrame;
use crate::motor::{Ingest, Malformed, Role, Severity, Vitals};
use crate::time::Instant;
use embedded_can::Frame;

/// Takes feedback of exactly 8 bytes. If `take` returns `None`, a field has an impossible value, and nothing has changed.
pub(crate) fn ingest_eight(frame: &CanFrame, take: impl FnOnce(&[u8; 8]) -> Option<()>) -> Ingest {
    if frame.length() != 8 {
        return Ingest::Malformed(Malformed::Length(frame.length()));
    }
    take(frame.bytes()).map_or(Ingest::Malformed(Malformed::Field), |()| Ingest::Taken)
}

impl<M: OwnMotor> Own<M> {
    /// Takes a frame with an id of the feedback.
    pub(super) fn take(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if self.motor.decode_answer(frame) {
            return Ingest::Taken;
        }
        let outcome = self.motor.decode(frame);
        if outcome == Ingest::Taken {
            self.watch.hear(&self.guard, now);
            self.guard.hear(now);
            self.hear_power(now);
        }
        outcome
    }

    #[inline(never)]
    pub(super) fn take_by_claims(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        if frame.is_remote() {
            return Ingest::Unrelated;
        }
        if self.route.is_unknown() {
            self.route = Route::of(|| self.motor.claims());
        }
        let (mut is_feedback, mut command) = (false, None);
        for claim in self.motor.claims().into_iter().filter(|claim| claim.covers(frame.id())) {
            match claim.role() {
                Role::Feedback => is_feedback = true,
                // What others send on a shared id may be for another drive.
                Role::Command if claim.is_shared() => {}
                Role::Command => command = Some(claim),
            }
        }
        let outcome = if is_feedback { self.take(frame, now) } else { Ingest::Unrelated };
        if outcome == Ingest::Unrelated && command.is_some() {
            self.rival = command;
            self.watch.hear_rival(now);
        }
        outcome
    }

    /// Takes the drive's report of its power.
    fn hear_power(&mut self, now: Instant) {
        if !self.power.hear(self.motor.is_enabled(), now) {
            return;
        }
        let vitals = Vitals { error: Some(Severity::Fault), ..self.motor.vitals() };
        _ = self.watch.check(&mut self.guard, || vitals, now);
        self.guard.relax_until_armed();
        self.motor.forget_settings();
    }
}
