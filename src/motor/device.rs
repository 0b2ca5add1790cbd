//! A device, and actions on every device of several: one visitor for each action.

use super::{Claim, Condition, Conditions, MotorName, Obstacles, WrongSetting};
use crate::frame::CanFrame;
use crate::time::{Edge, Instant, Tick};
use core::ops::Range;
use embedded_can::Frame;

/// A device family on a CAN bus: the interface between its motors and the transport of their frames.
///
/// [`Devices`](super::Devices) is the side of the caller: a runner, an async task, a test. A type with this trait implements
/// `Devices` by a line, `visitor.visit(self)`. Both have calls of the same names, so a file imports one of the two: a program
/// imports `Devices`, and the author of a device `CanDevice`.
///
/// No method has a body here. A device with a missing method does not compile:
/// ```compile_fail,E0046
/// use drivetrain::{frame::CanFrame, motor::*, time::*};
///
/// struct Careless;
/// impl CanDevice for Careless {
///     fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest { Ingest::Unrelated }
///     fn update(&mut self, tick: Tick) {}
///     fn next_frame(&mut self) -> Option<CanFrame> { None }
///     fn requeue(&mut self, frame: &CanFrame) -> bool { false }
///     fn put_back(&mut self, frame: &CanFrame) -> bool { false }
///     fn superseded(&self) -> u32 { 0 }
///     fn claims(&self) -> impl Iterator<Item = Claim> { core::iter::empty() }
///     fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> { core::iter::empty() }
///     // fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)>
///     fn wrong_setting(&self) -> Option<WrongSetting> { None }
///     fn second_master(&self) -> Option<Claim> { None }
///     fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>> { None }
///     fn ask(&mut self) -> bool { true }
///     fn engage(&mut self, now: Instant) {}
///     fn disarm(&mut self) {}
///     fn trip(&mut self) {}
///     fn is_armed(&self) -> bool { false }
///     fn emergency_stop(&mut self) {}
///     fn clear_emergency_stop(&mut self) {}
///     fn is_stopped(&self) -> bool { false }
/// }
/// ```
pub trait CanDevice {
    /// Takes a frame received at `now`. Constant time, no I/O, no control.
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest;

    /// Runs every control loop once and encodes the commands.
    ///
    /// An update that does not lie after the last sends zeros in that cycle, and relaxes every motor until armed again.
    fn update(&mut self, tick: Tick);

    /// Returns a pending frame, and removes it from the list.
    fn next_frame(&mut self) -> Option<CanFrame>;

    /// Takes back a frame that was not sent, or was evicted; `false` for a frame of another device.
    ///
    /// The frame is not offered again before the next update, and then with the newest values.
    fn requeue(&mut self, frame: &CanFrame) -> bool;

    /// Takes back a frame of this update for which the driver had no place: [`next_frame`](Self::next_frame) returns the frame
    /// again, with the newest values. `false` for every other frame, which nothing has changed then: [`requeue`](Self::requeue) it.
    fn put_back(&mut self, frame: &CanFrame) -> bool;

    /// Returns the number of frames replaced by newer frames before sending, wrapping.
    fn superseded(&self) -> u32;

    /// Lists the CAN ids sent and expected by this device.
    fn claims(&self) -> impl Iterator<Item = Claim>;

    /// Lists the motors without fresh feedback at `now`.
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName>;

    /// Lists the motors that must not be driven despite their feedback, for example after a fault of the ESC, with their conditions.
    fn faulty(&self) -> impl Iterator<Item = (MotorName, Conditions)>;

    /// Returns a setting of a drive that differs from the expected value, or is not known yet.
    fn wrong_setting(&self) -> Option<WrongSetting>;

    /// Returns a command of this device sent by another node within the last second.
    fn second_master(&self) -> Option<Claim>;

    /// Returns the oldest unread edge of a motor.
    ///
    /// Edges wait until read, so the interval between calls is free.
    fn next_edge(&mut self) -> Option<Edge<Condition, MotorName>>;

    /// Takes a request to arm; `false` if the request does not count: after a trip, when another request or the trip lies
    /// less than 100 ms of updates back.
    fn ask(&mut self) -> bool;

    /// Allows targets from now on, for the motors with feedback; an armed motor keeps its target. Called by
    /// [`arm`](super::Devices::arm) when all of its conditions hold; without effect while the emergency stop is set, and,
    /// after a trip, unless the last request [counted](Self::ask).
    fn engage(&mut self, now: Instant);

    /// Relaxes every motor and refuses targets until armed again.
    fn disarm(&mut self);

    /// Disarms because of a fault around the motors, such as a bus that is down: arming again needs a new request.
    fn trip(&mut self);

    /// Returns whether every motor takes targets: false as long as a motor waits to be armed, at the start and after a
    /// fault that relaxed it.
    fn is_armed(&self) -> bool;

    /// Trips every motor at once. From the next frame on, all commands are zero until the stop is cleared and the device armed.
    fn emergency_stop(&mut self);

    /// Clears the emergency stop. The device stays disarmed, and arming needs a new request.
    fn clear_emergency_stop(&mut self);

    /// Tells whether the emergency stop is set.
    fn is_stopped(&self) -> bool;
}

/// Result of offering a received frame to a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum Ingest {
    /// The frame was feedback and was taken.
    Taken,
    /// The frame belongs to another device; nothing changed.
    Unrelated,
    /// The frame has the id of one of this device's motors, but too few or too many bytes for its feedback: so many; nothing changed.
    WrongLength(u8),
    /// The frame has the id and the length of feedback, and a field with an impossible value; nothing changed.
    WrongField,
}

impl Ingest {
    /// Returns whether a frame with the id of a motor was not its feedback.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::Ingest;
    ///
    /// assert!(Ingest::WrongLength(7).is_malformed() && !Ingest::Unrelated.is_malformed());
    /// ```
    #[must_use]
    pub const fn is_malformed(self) -> bool {
        matches!(self, Self::WrongLength(_) | Self::WrongField)
    }
}

/// An action on every device of [`Devices`](super::Devices).
pub trait Visitor {
    /// Visits one device.
    fn visit(&mut self, device: &mut impl CanDevice);
}

pub(super) struct Offer<'a> {
    pub(super) frame: &'a CanFrame,
    pub(super) now: Instant,
    pub(super) outcome: Ingest,
}

impl Visitor for Offer<'_> {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        if self.outcome == Ingest::Unrelated {
            self.outcome = device.ingest(self.frame, self.now);
        }
    }
}

pub(super) struct Update(pub(super) Tick);

impl Visitor for Update {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.update(self.0);
    }
}

pub(super) struct Parts(pub(super) u32);

impl Visitor for Parts {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        _ = device;
        self.0 += 1;
    }
}

/// Looks for a frame among the devices with these numbers.
pub(super) struct Search {
    pub(super) among: Range<u32>,
    pub(super) number: u32,
    pub(super) frame: Option<CanFrame>,
}

impl Search {
    pub(super) const fn among(among: Range<u32>) -> Self {
        Self { among, number: 0, frame: None }
    }
}

impl Visitor for Search {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        if self.frame.is_none() && self.among.contains(&self.number) {
            self.frame = device.next_frame();
        }
        self.number += 1;
    }
}

/// Gives a frame back: first to the device that claims its id as a command, then to a former sender.
pub(super) struct Back<'a> {
    pub(super) frame: &'a CanFrame,
    pub(super) to_owner: bool,
    pub(super) taken: bool,
}

impl Visitor for Back<'_> {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        let sends = |claim: Claim| !claim.is_feedback() && claim.id() == self.frame.id();
        let asks = !self.to_owner || device.claims().any(sends);
        self.taken = self.taken || (asks && device.requeue(self.frame));
    }
}

/// Puts a frame back into the list of its device.
pub(super) struct PutBack<'a> {
    pub(super) frame: &'a CanFrame,
    pub(super) taken: bool,
}

impl Visitor for PutBack<'_> {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.taken = self.taken || device.put_back(self.frame);
    }
}

pub(super) struct Superseded(pub(super) u32);

impl Visitor for Superseded {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.0 = self.0.wrapping_add(device.superseded());
    }
}

pub(super) struct Nth {
    pub(super) left: usize,
    pub(super) claim: Option<Claim>,
}

impl Visitor for Nth {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        for claim in device.claims() {
            match self.left.checked_sub(1) {
                Some(left) => self.left = left,
                None => self.claim = self.claim.or(Some(claim)),
            }
        }
    }
}

/// Searches for a claim that clashes with the claim at this index.
pub(super) struct Rival {
    pub(super) left: usize,
    pub(super) claim: Option<Claim>,
    pub(super) other: Option<Claim>,
}

impl Visitor for Rival {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        for other in device.claims() {
            match (self.claim, self.left.checked_sub(1)) {
                (Some(claim), _) => {
                    let clashes = self.other.is_none() && other.clashes_with(&claim);
                    self.other = if clashes { Some(other) } else { self.other };
                }
                (None, Some(left)) => self.left = left,
                (None, None) => self.claim = Some(other),
            }
        }
    }
}

/// Collects what stands against arming.
pub(super) struct Survey<'a> {
    pub(super) now: Instant,
    pub(super) found: &'a mut Obstacles,
}

impl Visitor for Survey<'_> {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        let found = &mut *self.found;
        found.missing.extend(device.missing(self.now));
        found.faulty.extend_unfit(device.faulty());
        found.wrong_setting = found.wrong_setting.or_else(|| device.wrong_setting());
        found.second_master = found.second_master.or_else(|| device.second_master());
    }
}

/// Hands a request to arm to every device, and tells whether the request counts for all of them.
pub(super) struct Ask {
    pub(super) granted: bool,
}

impl Visitor for Ask {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.granted &= device.ask();
    }
}

pub(super) struct Engage(pub(super) Instant);

impl Visitor for Engage {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.engage(self.0);
    }
}

pub(super) struct Standing {
    pub(super) any: bool,
    pub(super) all_armed: bool,
    pub(super) stopped: bool,
}

impl Standing {
    pub(super) const NONE: Self = Self { any: false, all_armed: true, stopped: false };
}

impl Visitor for Standing {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.any = true;
        self.all_armed &= device.is_armed();
        self.stopped |= device.is_stopped();
    }
}

pub(super) struct Read(pub(super) Option<Edge<Condition, MotorName>>);

impl Visitor for Read {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        self.0 = self.0.or_else(|| device.next_edge());
    }
}

pub(super) struct Disarm;

impl Visitor for Disarm {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.disarm();
    }
}

pub(super) struct Trip;

impl Visitor for Trip {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.trip();
    }
}

pub(super) struct Stop;

impl Visitor for Stop {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.emergency_stop();
    }
}

pub(super) struct ClearStop;

impl Visitor for ClearStop {
    #[inline]
    fn visit(&mut self, device: &mut impl CanDevice) {
        device.clear_emergency_stop();
    }
}
