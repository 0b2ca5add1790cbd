use super::{ArmError, Claim, Edge, Missing, MotorName};
use crate::frame::CanFrame;
use crate::time::{Instant, Tick};

/// The seam between a device family and whatever moves its frames: a runner, an async task, a test.
///
/// The caller pushes received frames in and *pulls* frames to send out; a device never does I/O. In each cycle:
///
/// 1. `ingest` every received frame, with the time of its arrival;
/// 2. `update` once: all loops run, all commands are encoded;
/// 3. `next_frame` until it returns `None`, sending each; give a frame that was not sent, or was sent and
///    evicted again, back to `requeue`. It is offered again after the next update, with the newest values.
///
/// Devices are combined statically: a tuple or array of devices and `&mut D` are devices.
///
/// # Examples
/// A struct of two buses forwards to the tuple of both:
/// ```
/// use drivetrain::{dji, frame::CanFrame, motor::*, time::*};
///
/// struct Robot { chassis: dji::Bus, gimbal: dji::Bus }
///
/// impl CanDevice for Robot {
///     fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
///         (&mut self.chassis, &mut self.gimbal).ingest(frame, now)
///     }
///     fn update(&mut self, tick: Tick) { (&mut self.chassis, &mut self.gimbal).update(tick) }
///     fn next_frame(&mut self, turn: u32) -> Option<CanFrame> {
///         (&mut self.chassis, &mut self.gimbal).next_frame(turn)
///     }
///     fn requeue(&mut self, frame: &CanFrame) -> bool {
///         (&mut self.chassis, &mut self.gimbal).requeue(frame)
///     }
///     fn superseded(&self) -> u32 { self.chassis.superseded().wrapping_add(self.gimbal.superseded()) }
///     fn claims(&self) -> impl Iterator<Item = Claim> { self.chassis.claims().chain(self.gimbal.claims()) }
///     fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName> {
///         self.chassis.missing(now).chain(self.gimbal.missing(now))
///     }
///     fn faulty(&self) -> impl Iterator<Item = MotorName> { self.chassis.faulty().chain(self.gimbal.faulty()) }
///     fn second_master(&self) -> Option<Claim> { self.chassis.second_master().or_else(|| self.gimbal.second_master()) }
///     fn next_edge(&mut self) -> Option<Edge> { (&mut self.chassis, &mut self.gimbal).next_edge() }
///     fn engage(&mut self, now: Instant) { (&mut self.chassis, &mut self.gimbal).engage(now) }
///     fn disarm(&mut self) { (&mut self.chassis, &mut self.gimbal).disarm() }
///     fn is_armed(&self) -> bool { self.chassis.is_armed() && self.gimbal.is_armed() }
///     fn emergency_stop(&mut self) { (&mut self.chassis, &mut self.gimbal).emergency_stop() }
///     fn clear_emergency_stop(&mut self) { (&mut self.chassis, &mut self.gimbal).clear_emergency_stop() }
///     fn is_stopped(&self) -> bool { self.chassis.is_stopped() || self.gimbal.is_stopped() }
/// }
/// let robot = Robot { chassis: dji::Bus::new(), gimbal: dji::Bus::new() };
/// assert!(!robot.is_armed());
/// ```
pub trait CanDevice {
    /// Takes a received frame that arrived at `now`. Constant time, no I/O, no control.
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest;

    /// Takes a received frame of any driver's own type. One of more than 8 bytes is nobody's here.
    fn ingest_any(&mut self, frame: &impl embedded_can::Frame, now: Instant) -> Ingest
    where
        Self: Sized,
    {
        CanFrame::copy_of(frame).map_or(Ingest::Unrelated, |frame| self.ingest(&frame, now))
    }

    /// Runs every control loop once and encodes the commands.
    fn update(&mut self, tick: Tick);

    /// Returns a frame that waits to be sent, and takes it off the list.
    ///
    /// `turn` is any number that grows by one a cycle: a combined device starts with another part each time, so
    /// that none starves on a full bus.
    fn next_frame(&mut self, turn: u32) -> Option<CanFrame>;

    /// Takes back a frame that was not sent, or was evicted; `false` when it is not this device's.
    ///
    /// It is not offered again before the next update, and then with the newest values.
    fn requeue(&mut self, frame: &CanFrame) -> bool;

    /// Returns how many frames were replaced by newer ones before they were taken, wrapping; 0 for a device that does
    /// not count.
    fn superseded(&self) -> u32 {
        0
    }

    /// Lists the CAN ids that this device sends and expects.
    fn claims(&self) -> impl Iterator<Item = Claim>;

    /// Lists the motors without fresh feedback at `now`.
    fn missing(&self, now: Instant) -> impl Iterator<Item = MotorName>;

    /// Lists the motors that must not be driven although they are heard: a fault of the ESC, say. None unless said
    /// otherwise: a struct of devices has to forward it, and [`second_master`](Self::second_master), or it is armed in spite
    /// of them.
    fn faulty(&self) -> impl Iterator<Item = MotorName> {
        core::iter::empty()
    }

    /// Returns a command of this device that another node has sent within the last second; `None` for a device that does
    /// not look for it.
    fn second_master(&self) -> Option<Claim> {
        None
    }

    /// Returns the oldest change of a motor's condition that was not read yet; of a combined device, that of its first part
    /// with one. None for a device that notes none.
    ///
    /// Changes wait until they are read, so it can be called as often or as seldom as is convenient.
    fn next_edge(&mut self) -> Option<Edge> {
        None
    }

    /// Lets targets through from now on, for the motors that are heard; one that takes them already goes on
    /// undisturbed. Called by [`arm`](Self::arm) when all of its conditions hold; without effect while the emergency
    /// stop is set.
    fn engage(&mut self, now: Instant);

    /// Relaxes every motor and refuses targets until armed again.
    fn disarm(&mut self);

    /// Tells whether every motor takes targets: false as long as one of them waits to be armed, at the start and after
    /// a fault that relaxed it.
    fn is_armed(&self) -> bool;

    /// Relaxes every motor at once; the runner repeats it in each tick while the stop is set. From the next frame on, all commands are zero until it is cleared and armed.
    fn emergency_stop(&mut self);

    /// Clears the emergency stop. The device stays disarmed.
    fn clear_emergency_stop(&mut self);

    /// Tells whether the emergency stop is set.
    fn is_stopped(&self) -> bool;

    /// Arms the device: nothing moves before.
    ///
    /// # Errors
    /// Names what stands in the way: motors without feedback, a CAN id with two owners or
    /// two senders, a fault, a set emergency stop.
    #[expect(clippy::result_large_err, reason = "no heap, and arming is rare")]
    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        if self.is_stopped() {
            return Err(ArmError::Stopped);
        }
        if self.claims().next().is_none() {
            return Err(ArmError::NoMotors);
        }
        if let Some((one, other)) = self.clash() {
            return Err(ArmError::Clash(one, other));
        }
        if let Some(missing) = Missing::collect(self.missing(now)) {
            return Err(ArmError::Missing(missing));
        }
        if let Some(claim) = self.second_master() {
            return Err(ArmError::SecondMaster(claim));
        }
        if let Some(faulty) = Missing::collect(self.faulty()) {
            return Err(ArmError::Faulty(faulty));
        }
        self.engage(now);
        Ok(())
    }

    /// Returns two motors that use one CAN id, if any: on a bus with several families, say.
    fn clash(&self) -> Option<(Claim, Claim)> {
        self.claims().enumerate().find_map(|(index, claim)| {
            let other = self.claims().skip(index + 1).find(|other| other.clashes_with(&claim))?;
            Some((claim, other))
        })
    }
}

/// What a device did with a received frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum Ingest {
    /// It was feedback and was taken.
    Taken,
    /// It belongs to somebody else; nothing changed.
    Unrelated,
    /// It has the id of one of this device's motors, but not the form of its feedback; nothing changed.
    Malformed(Malformed),
}

/// Why a frame with a motor's id is not its feedback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Malformed {
    /// Too few or too many bytes.
    Length(u8),
    /// A field has a value that it cannot have.
    Field,
}
