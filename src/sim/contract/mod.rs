//! Checks any device, also of the application, against the promises of [`Devices`]: for tests only.

mod edges;
mod rules;

pub use rules::check_contract;

use crate::frame::CanFrame;
use crate::motor::{Claim, Devices, Ingest, TargetError};
use crate::time::{Instant, Tick};

/// A device under test, as needed by [`check_contract`].
pub trait Subject {
    /// The device.
    type Device: Devices;

    /// Returns the device.
    fn device(&mut self) -> &mut Self::Device;

    /// Returns the number of motors with feedback; 0 for a device without feedback, such as a servo, for which rules
    /// about feedback are skipped.
    fn motors(&self) -> usize;

    /// Plays a motor, by its index below [`motors`](Self::motors): its feedback frame at standstill. Motors with a shared id
    /// have the order of the device's claims.
    fn feedback(&self, motor: usize) -> Option<CanFrame>;

    /// Sets the targets of all motors to this share of a moving target, so the commands are not zero; NaN is passed on.
    ///
    /// # Errors
    /// The first error.
    fn drive(&mut self, share: f32) -> Result<(), TargetError>;

    /// Sets a target outside of the capabilities of the motors.
    ///
    /// # Errors
    /// Names the reason, as required; also the default, for a device without functions for such a target.
    fn drive_unsupported(&mut self) -> Result<(), TargetError> {
        Err(TargetError::Unsupported)
    }

    /// Plays a motor whose ESC reports an error that forbids driving; `None` for a motor that reports no errors.
    fn fault(&self, motor: usize) -> Option<CanFrame> {
        let _ = motor;
        None
    }

    /// Plays another controller on the bus, by a frame with the id of one of the device's commands: eight zeros by
    /// default. `None` when the device does not check for a second controller.
    fn rival(&self, command: &Claim) -> Option<CanFrame> {
        embedded_can::Frame::new(command.id(), &[0; 8])
    }

    /// Returns whether a command frame asks for nothing: eight zeros, unless said otherwise. A frame whose [`effort`](Self::effort) is known
    /// and more than 0.01 asks for something all the same: zero bytes are the full negative torque of some drives.
    fn is_zero(&self, command: &CanFrame) -> bool {
        *command.bytes() == [0; 8]
    }

    /// Returns the effort that a command asks of its motor, as a share of the largest, -1 to 1; `None`, the default, for a command
    /// whose effort only the drive knows, for a question, for a brake at rest. Read the frame as the manual of the drive does: with `None`, a
    /// torque at rest is found by [`is_zero`](Self::is_zero) alone. Feedback stands still here, so a rest that brakes a turning shaft passes.
    fn effort(&self, command: &CanFrame) -> Option<f32> {
        let _ = command;
        None
    }

    /// Returns the milliseconds from the loss of feedback to zero output, one tick included.
    fn late_ms(&self) -> u64 {
        11
    }

    /// Returns the milliseconds until an emergency stop is sent: 0, unless the protocol makes the stop wait for an answer.
    fn stop_ms(&self) -> u64 {
        0
    }

    /// Returns the milliseconds after arming until the output range is open; 0 for a range that is open at once.
    fn opening_ms(&self) -> u64 {
        220
    }

    /// Returns the milliseconds of feedback before arming, or before driving after a time without target: 0, unless its drives
    /// are asked for their settings or enabled first.
    fn preparation_ms(&self) -> u64 {
        0
    }

    /// Returns the milliseconds after which a target expires, one tick included.
    fn command_ms(&self) -> u64 {
        101
    }
}

/// The rules of a device.
///
/// Each rule is the invariant of the same name in `docs/faults.md`, or a sentence of [`Devices`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Rule {
    /// The claims have the ids of the motors' frames, and no two claims collide.
    ClaimsFeedback,
    /// Each offered frame is a data frame with an id claimed as a command, or a remote frame with an id claimed as feedback (I3).
    SendsWhatItClaims,
    /// The device offers no more than 64 frames between two updates.
    IsBounded,
    /// Disarmed, the device commands nothing and refuses targets.
    DisarmedIsZero,
    /// Arming fails as long as a motor is not heard, and the error counts the missing.
    MissingAreNamed,
    /// With feedback of all motors, arming succeeds, and a target then leads to a command.
    ArmedDrives,
    /// While the output range opens after arming, commands to one target change. Their effort, if known, is at most 0.02 and 1.25 times the
    /// elapsed share of the opening, and never above 1.
    OpensFromZero,
    /// Foreign, remote and extended frames are handed back and change nothing (I5).
    ForeignIsUnrelated,
    /// Feedback that is too short is refused and changes nothing (I5).
    ShortIsNotTaken,
    /// Refused frames do not count as signs of life.
    RejectedIsNotFresh,
    /// Without feedback a motor's output is zero within a tick of the limit (I4).
    LateIsZero,
    /// One silent motor does not stop the others (I8).
    OthersGoOn,
    /// Without new targets the output is zero within a tick of the deadline (I4).
    OldTargetsAreZero,
    /// A target refused without fresh feedback also removes the older target: the older target does not act when the
    /// feedback is back.
    RefusedTargetsAreZero,
    /// A target of NaN is an error and gives zero.
    NanIsZero,
    /// A target outside of the capabilities is an error, and changes nothing (I5).
    UnsupportedIsAnError,
    /// A second bad time step in a row gives zero.
    BadStepsAreZero,
    /// An update without a later time than the update before gives zero in that cycle, and until the device is armed again.
    LostTimeTrips,
    /// After a trip, a request to arm repeated in each tick is never granted, and a request after a pause is.
    ArmingIsAGesture,
    /// A frame given back is taken, waits for the next update, and comes again with the newest values (I7).
    RequeuedComesAgain,
    /// A frame of another device is not taken back.
    ForeignIsNotRequeued,
    /// After an emergency stop all commands are zero, and arming fails, until the stop is cleared and the device armed.
    EmergencyStopStays,
    /// After disarming, and after arming again, all commands are zero until there is a target (I9).
    StartsFromZero,
    /// While a motor reports a fault, arming is refused.
    FaultIsNotArmed,
    /// While another node sends a command of the device, arming is refused.
    SecondMasterIsNotArmed,
    /// Each change is an edge with its motor and time, and a healthy motor has no edges.
    ChangeIsAnEdge,
    /// An edge waits until read, and is read once.
    EdgesWait,
    /// A condition that comes and goes before the reading is one edge each way.
    EdgesDoNotFlood,
    /// The same inputs give the same frames (I10).
    IsDeterministic,
}

/// A rule that a device breaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Violation {
    /// The rule.
    pub rule: Rule,
    /// When, in milliseconds since the device was made.
    pub at_ms: u64,
    /// The last frame that the device offered; of several in one update, the last that is not rest.
    pub frame: Option<CanFrame>,
}

impl core::fmt::Display for Violation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?} is broken after {} ms, ", self.rule, self.at_ms)?;
        match self.frame {
            Some(frame) => write!(f, "the last frame was {frame:?}"),
            None => f.write_str("without a frame"),
        }
    }
}

impl core::error::Error for Violation {}

type Outcome = Result<(), Violation>;

/// More frames than a device may offer between two updates.
const MOST_FRAMES: u32 = 64;

/// The largest effort of a frame that asks for nothing: rounding of the protocol.
const LITTLE: f32 = 0.01;

/// The frames between two updates.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
struct Output {
    frames: u32,
    /// Frames with a command other than rest.
    driving: u32,
    /// The largest effort.
    effort: f32,
    /// The last frame.
    last: Option<CanFrame>,
    /// Of all bytes and ids, in order.
    digest: u64,
}

/// A device, its time, and its motors.
struct Run<S> {
    subject: S,
    ms: u64,
    turn: u32,
    /// As [`Violation::frame`].
    last: Option<CanFrame>,
}

impl<S: Subject> Run<S> {
    fn new(subject: S) -> Self {
        Self { subject, ms: 1, turn: 0, last: None }
    }

    /// Starts with all motors heard, armed and driven, with the output range open.
    fn driving(subject: S) -> Result<Self, Violation> {
        let mut run = Self::new(subject);
        run.step()?;
        run.prepare()?;
        run.arm_and_open(Rule::ArmedDrives)?;
        Ok(run)
    }

    /// Waits until arming succeeds.
    fn prepare(&mut self) -> Outcome {
        for _ in 0..self.subject.preparation_ms() {
            self.step()?;
        }
        Ok(())
    }

    fn arm(&mut self, rule: Rule) -> Outcome {
        let now = self.now();
        let armed = self.subject.device().arm(now).is_ok();
        self.expect(armed, rule)
    }

    /// Arms, waits until the output range is open, and drives.
    fn arm_and_open(&mut self, rule: Rule) -> Outcome {
        self.arm(rule)?;
        for _ in 0..self.subject.opening_ms() {
            // Feedback that stands still while the command changes would be frozen.
            let driven = self.subject.drive(0.0).is_ok();
            self.step()?;
            self.expect(driven, rule)?;
        }
        let driven = self.subject.drive(1.0).is_ok();
        self.expect(driven, rule)
    }

    /// Drives after there was no target: the drives may have to be enabled, and their output range begins to open.
    fn drive_again(&mut self, rule: Rule) -> Outcome {
        for _ in 0..=self.subject.preparation_ms() + self.subject.opening_ms() / 10 {
            let is_taken = self.subject.drive(1.0).is_ok();
            self.expect(is_taken, rule)?;
            if self.step()?.driving > 0 {
                return Ok(());
            }
        }
        self.expect(false, rule)
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.ms * 1_000)
    }

    fn expect(&self, holds: bool, rule: Rule) -> Result<(), Violation> {
        if holds { Ok(()) } else { Err(Violation { rule, at_ms: self.ms, frame: self.last }) }
    }

    /// Lets a motor be heard; `false` when its frame is not taken.
    fn hear(&mut self, motor: usize) -> bool {
        let now = self.now();
        let frame = self.subject.feedback(motor);
        frame.is_some_and(|frame| self.subject.device().ingest(&frame, now) == Ingest::Taken)
    }

    /// A millisecond with feedback from all motors, and another time step in the tick.
    fn step_for(&mut self, dt_s: f32) -> Result<Output, Violation> {
        self.ms += 1;
        for motor in 0..self.subject.motors() {
            let taken = self.hear(motor);
            self.expect(taken, Rule::ClaimsFeedback)?;
        }
        self.update(dt_s)
    }

    /// A millisecond with feedback from all motors.
    fn step(&mut self) -> Result<Output, Violation> {
        self.step_without(usize::MAX)
    }

    /// A millisecond with feedback from all motors but one.
    fn step_without(&mut self, silent: usize) -> Result<Output, Violation> {
        self.ms += 1;
        for motor in (0..self.subject.motors()).filter(|motor| *motor != silent) {
            let taken = self.hear(motor);
            self.expect(taken, Rule::ClaimsFeedback)?;
        }
        self.update(0.001)
    }

    /// A millisecond without feedback.
    fn step_silent(&mut self) -> Result<Output, Violation> {
        self.ms += 1;
        self.update(0.001)
    }

    fn update(&mut self, dt_s: f32) -> Result<Output, Violation> {
        let tick = Tick::new(self.now(), dt_s);
        self.subject.device().update(tick);
        self.turn = self.turn.wrapping_add(1);
        self.drain()
    }

    /// Takes every pending frame.
    fn drain(&mut self) -> Result<Output, Violation> {
        let mut output = Output::default();
        while let Some(frame) = self.subject.device().next_frame(self.turn) {
            output.frames += 1;
            let effort = self.effort(&frame);
            let drives = !self.subject.is_zero(&frame) || effort > LITTLE;
            if drives || output.driving == 0 {
                self.last = Some(frame);
            }
            self.expect(output.frames <= MOST_FRAMES, Rule::IsBounded)?;
            let own = self.is_command(&frame);
            self.expect(own, Rule::SendsWhatItClaims)?;
            output.driving += u32::from(drives);
            output.effort = output.effort.max(effort);
            output.last = Some(frame);
            let bytes = frame.header().to_be_bytes().into_iter().chain(*frame.bytes());
            // FNV-1a.
            output.digest = bytes.fold(output.digest, |digest, byte| {
                (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
            }) ^ 0xCBF2_9CE4_8422_2325;
        }
        Ok(output)
    }

    /// Returns the size of the effort: 0 if unknown, and infinite for NaN.
    fn effort(&self, frame: &CanFrame) -> f32 {
        let effort = self.subject.effort(frame).unwrap_or(0.0).abs();
        if effort.is_nan() { f32::INFINITY } else { effort }
    }

    fn is_command(&mut self, frame: &CanFrame) -> bool {
        use embedded_can::Frame;
        // A remote frame asks for feedback, and commands nothing.
        let is_feedback = !frame.is_data_frame();
        let mut claims = self.subject.device().claims();
        claims.any(|claim| claim.is_feedback() == is_feedback && claim.covers(frame.id()))
    }
}
