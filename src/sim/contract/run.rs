use super::{Outcome, Rule, Subject, Violation};
use crate::frame::CanFrame;
use crate::motor::{Devices, Ingest, Role};
use crate::time::{Instant, Tick};

/// More frames than a device may offer between two updates.
const MOST_FRAMES: u32 = 64;

/// The frames between two updates.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Output {
    pub(super) frames: u32,
    /// Frames with a command other than rest.
    pub(super) driving: u32,
    /// The last frame.
    pub(super) last: Option<CanFrame>,
    /// Of all bytes and ids, in order.
    pub(super) digest: u64,
}

/// A device, its time, and its motors.
pub(super) struct Run<S> {
    pub(super) subject: S,
    pub(super) ms: u64,
    turn: u32,
}

impl<S: Subject> Run<S> {
    pub(super) fn new(subject: S) -> Self {
        Self { subject, ms: 1, turn: 0 }
    }

    /// Starts with all motors heard, armed and driven, with the output range open.
    pub(super) fn driving(subject: S) -> Result<Self, Violation> {
        let mut run = Self::new(subject);
        run.step()?;
        run.settle()?;
        run.arm_and_open(Rule::ArmedDrives)?;
        Ok(run)
    }

    /// Waits until arming succeeds.
    pub(super) fn settle(&mut self) -> Outcome {
        for _ in 0..self.subject.settle_ms() {
            self.step()?;
        }
        Ok(())
    }

    /// Arms, waits until the output range is open, and drives.
    pub(super) fn arm_and_open(&mut self, rule: Rule) -> Result<(), Violation> {
        let now = self.now();
        let armed = self.subject.device().arm(now).is_ok();
        self.expect(armed, rule)?;
        for _ in 0..self.subject.opening_ms() {
            // Feedback that stands still while the command changes would be frozen.
            let driven = self.subject.drive(0.0).is_ok();
            self.step()?;
            self.expect(driven, rule)?;
        }
        let driven = self.subject.drive(1.0).is_ok();
        self.expect(driven, rule)
    }

    /// Drives after there was no target: the drives may have to be enabled.
    pub(super) fn drive_again(&mut self, rule: Rule) -> Outcome {
        for _ in 0..=self.subject.settle_ms() {
            let is_taken = self.subject.drive(1.0).is_ok();
            self.expect(is_taken, rule)?;
            if self.step()?.driving > 0 {
                return Ok(());
            }
        }
        self.expect(false, rule)
    }

    pub(super) fn now(&self) -> Instant {
        Instant::from_micros(self.ms * 1_000)
    }

    pub(super) fn expect(&self, holds: bool, rule: Rule) -> Result<(), Violation> {
        if holds { Ok(()) } else { Err(Violation { rule, at_ms: self.ms }) }
    }

    /// Lets a motor be heard; `false` when its frame is not taken.
    pub(super) fn hear(&mut self, motor: usize) -> bool {
        let now = self.now();
        let frame = self.subject.feedback(motor);
        frame.is_some_and(|frame| self.subject.device().ingest(&frame, now) == Ingest::Taken)
    }

    /// A millisecond with feedback from all motors, and another time step in the tick.
    pub(super) fn step_for(&mut self, dt_s: f32) -> Result<Output, Violation> {
        self.ms += 1;
        for motor in 0..self.subject.motors() {
            let taken = self.hear(motor);
            self.expect(taken, Rule::ClaimsFeedback)?;
        }
        self.update(dt_s)
    }

    /// A millisecond with feedback from all motors.
    pub(super) fn step(&mut self) -> Result<Output, Violation> {
        self.step_without(usize::MAX)
    }

    /// A millisecond with feedback from all motors but one.
    pub(super) fn step_without(&mut self, silent: usize) -> Result<Output, Violation> {
        self.ms += 1;
        for motor in (0..self.subject.motors()).filter(|motor| *motor != silent) {
            let taken = self.hear(motor);
            self.expect(taken, Rule::ClaimsFeedback)?;
        }
        self.update(0.001)
    }

    /// A millisecond without feedback.
    pub(super) fn step_silent(&mut self) -> Result<Output, Violation> {
        self.ms += 1;
        self.update(0.001)
    }

    pub(super) fn update(&mut self, dt_s: f32) -> Result<Output, Violation> {
        let tick = Tick::new(self.now(), dt_s);
        self.subject.device().update(tick);
        self.turn = self.turn.wrapping_add(1);
        self.drain()
    }

    /// Takes every pending frame.
    pub(super) fn drain(&mut self) -> Result<Output, Violation> {
        let mut output = Output::default();
        while let Some(frame) = self.subject.device().next_frame(self.turn) {
            output.frames += 1;
            self.expect(output.frames <= MOST_FRAMES, Rule::IsBounded)?;
            let own = self.is_command(&frame);
            self.expect(own, Rule::SendsWhatItClaims)?;
            output.driving += u32::from(!self.subject.is_zero(&frame));
            output.last = Some(frame);
            let bytes = frame.header().to_be_bytes().into_iter().chain(*frame.bytes());
            // FNV-1a.
            output.digest = bytes.fold(output.digest, |digest, byte| {
                (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
            }) ^ 0xCBF2_9CE4_8422_2325;
        }
        Ok(output)
    }

    fn is_command(&mut self, frame: &CanFrame) -> bool {
        use embedded_can::Frame;
        // A remote frame asks for feedback, and commands nothing.
        let role = if frame.is_data_frame() { Role::Command } else { Role::Feedback };
        let mut claims = self.subject.device().claims();
        claims.any(|claim| claim.role() == role && claim.covers(frame.id()))
    }
}
