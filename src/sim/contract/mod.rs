//! Checks any device, yours too, against what [`Devices`] promises: for tests only.

mod edges;
mod rules;
mod run;

use crate::frame::CanFrame;
use crate::motor::{Claim, Devices, TargetError};

/// What [`check_contract`] has to know of a device.
pub trait Subject {
    /// The device.
    type Device: Devices;

    /// Returns the device.
    fn device(&mut self) -> &mut Self::Device;

    /// Returns how many motors it has that are heard; 0 for one that reports nothing, such as a servo, and what is about
    /// feedback is not asked of it then.
    fn motors(&self) -> usize;

    /// Plays a motor, by its index below [`motors`](Self::motors): its feedback frame, in which it stands still. Motors that
    /// share an id have the order of the device's claims.
    fn feedback(&self, motor: usize) -> Option<CanFrame>;

    /// Sets the targets of all motors to this share of something that moves them, and so gives commands that are not
    /// zero; NaN is passed on.
    ///
    /// # Errors
    /// The first error.
    fn drive(&mut self, share: f32) -> Result<(), TargetError>;

    /// Sets some target that the motors do not offer, by their capabilities.
    ///
    /// # Errors
    /// Says why not, as has to be; and so it does by default, for a device whose functions offer no such thing.
    fn drive_unsupported(&mut self) -> Result<(), TargetError> {
        Err(TargetError::Unsupported)
    }

    /// Plays a motor whose ESC reports something for which it must not be driven; `None` for one that reports no errors.
    fn fault(&self, motor: usize) -> Option<CanFrame> {
        let _ = motor;
        None
    }

    /// Plays another controller on the bus, by a frame with the id of one of the device's commands: eight zeros, unless
    /// said otherwise. `None` when the device does not look for one.
    fn rival(&self, command: &Claim) -> Option<CanFrame> {
        embedded_can::Frame::new(command.id(), &[0; 8])
    }

    /// Tells whether a command frame asks for nothing: eight zeros, unless said otherwise.
    fn is_zero(&self, command: &CanFrame) -> bool {
        *command.bytes() == [0; 8]
    }

    /// Returns the milliseconds after which lost feedback has to be zero output, one tick included.
    fn late_ms(&self) -> u64 {
        11
    }

    /// Returns the milliseconds that an emergency stop may take until it is on its way: 0, unless the protocol has it wait
    /// for an answer.
    fn stop_ms(&self) -> u64 {
        0
    }

    /// Returns the milliseconds after arming until the output range is open.
    fn opening_ms(&self) -> u64 {
        220
    }

    /// Returns the milliseconds of feedback after which it can be armed, or driven after it had no target: 0, unless its drives are
    /// asked for their settings or enabled first.
    fn settle_ms(&self) -> u64 {
        0
    }

    /// Returns the milliseconds after which a target no longer counts, one tick included.
    fn command_ms(&self) -> u64 {
        101
    }
}

/// What a device has to do.
///
/// Each rule is the invariant of that name in `docs/faults.md`, or a sentence of [`Devices`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Rule {
    /// Its claims have the ids that its motors send, and no two of them clash.
    ClaimsFeedback,
    /// Each frame that it offers is a data frame with an id that it claims as a command, or a remote frame with one that it claims as
    /// feedback (I3).
    SendsWhatItClaims,
    /// It offers no more than 64 frames between two updates.
    IsBounded,
    /// Disarmed, it asks for nothing and refuses targets.
    DisarmedIsZero,
    /// Arming fails as long as a motor is not heard, and the error counts the missing.
    MissingAreNamed,
    /// With all motors heard it can be armed, and a target then leads to a command.
    ArmedDrives,
    /// Foreign, remote and extended frames are handed back and change nothing (I5).
    ForeignIsUnrelated,
    /// Feedback that is too short is not taken and changes nothing (I5).
    ShortIsNotTaken,
    /// Frames that were not taken do not count as signs of life.
    RejectedIsNotFresh,
    /// Without feedback a motor's output is zero within a tick of the limit (I4).
    LateIsZero,
    /// One silent motor does not stop the others (I8).
    OthersGoOn,
    /// Without new targets the output is zero within a tick of the deadline (I4).
    OldTargetsAreZero,
    /// A target that is refused without fresh feedback takes the older one away: it does not act when the feedback is back.
    RefusedTargetsAreZero,
    /// A target that is NaN is an error and gives zero.
    NanIsZero,
    /// A target that is not offered is an error, and changes nothing (I5).
    UnsupportedIsAnError,
    /// A second bad time step in a row gives zero.
    BadStepsAreZero,
    /// An update that does not lie after the one before gives zero in that cycle, and until the device is armed again.
    LostTimeTrips,
    /// After a trip, a request to arm that is repeated in each tick is never granted, and one after a pause is.
    ArmingIsAGesture,
    /// A frame that is given back is taken, waits for the next update, and comes again with the newest values (I7).
    RequeuedComesAgain,
    /// A frame that is not its own is not taken back.
    ForeignIsNotRequeued,
    /// After an emergency stop all that comes is zero, and arming fails, until it is cleared and armed.
    EmergencyStopStays,
    /// After disarming, and after arming again, all that comes is zero until there is a target (I9).
    StartsFromZero,
    /// As long as a motor reports a fault it is not armed.
    FaultIsNotArmed,
    /// While another node sends one of its commands it is not armed.
    SecondMasterIsNotArmed,
    /// Each change is an edge that names its motor and has its time, and a healthy motor has none.
    ChangeIsAnEdge,
    /// An edge waits until it is read, and is read once.
    EdgesWait,
    /// What comes and goes before it is read is one edge each way.
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
}

impl core::fmt::Display for Violation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?} is broken after {} ms", self.rule, self.at_ms)
    }
}

impl core::error::Error for Violation {}

/// Checks a device against what [`Devices`] promises, yours too: makes fresh ones, plays their motors, and watches
/// what they send.
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, Handle, M3508};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::motor::TargetError;
/// use drivetrain::sim::contract::{Subject, check_contract};
/// use drivetrain::units::Current;
///
/// struct OneWheel(Bus, Handle<M3508>);
///
/// impl Subject for OneWheel {
///     type Device = Bus;
///     fn device(&mut self) -> &mut Bus { &mut self.0 }
///     fn motors(&self) -> usize { 1 }
///     fn feedback(&self, _motor: usize) -> Option<CanFrame> { CanFrame::standard(0x201, [0; 8]) }
///     fn drive(&mut self, share: f32) -> Result<(), TargetError> {
///         self.0.set_current(self.1, Current::from_amperes(5.0 * share))
///     }
/// }
///
/// let make = || {
///     let mut bus = Bus::new();
///     let wheel = bus.attach(Config::new(1)).expect("a free id");
///     OneWheel(bus, wheel)
/// };
/// assert_eq!(check_contract(make), Ok(28)); // rules
/// ```
///
/// # Errors
/// The first rule that the device breaks.
pub fn check_contract<S: Subject>(make: impl Fn() -> S) -> Result<usize, Violation> {
    rules::check(&make)
}

type Outcome = Result<(), Violation>;
