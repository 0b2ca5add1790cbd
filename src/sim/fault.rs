//! Faults of the simulator, and errors in the use of the simulator.

use super::esc::{Random, Tampering};
use super::motor::MOTORS;
use super::rotor::Mechanics;
use super::{Line, MotorKey};
use crate::frame::CanFrame;
use crate::time::{Duration, Instant};
use core::ops::{Bound, RangeBounds};
use embedded_can::{ErrorKind, Frame, Id};

/// A fault of a [`Simulation`](super::Simulation) for a limited time.
///
/// Some events need no fault: a second master ([`Simulation::inject`](super::Simulation::inject) of a command frame), two
/// motors with one id (attach both), a burst after a stall (advance without receiving), an overrun (the same, with
/// [`Simulation::with_receive_depth`](super::Simulation::with_receive_depth)), heat
/// ([`Simulation::set_temperature_c`](super::Simulation::set_temperature_c)), a push from outside
/// ([`Simulation::set_load_nm`](super::Simulation::set_load_nm)), a full bus (eight motors).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// Frames take their time on the wire and reach no node.
    LostFrames {
        /// The bus.
        line: Line,
        /// Id of the frames; `None` for all.
        id: Option<Id>,
        /// 0 for none, 1 for all.
        probability: f32,
    },
    /// Frames reach everybody twice, at once.
    DuplicateFrames {
        /// The bus.
        line: Line,
        /// Id of the frames; `None` for all.
        id: Option<Id>,
    },
    /// The controller is bus-off: it neither sends nor receives, and its calls return an error.
    ///
    /// Its mailboxes keep their frames and send them afterwards, as in bxCAN.
    BusOff(Line),
    /// The cable between controller and motors is out: no frame is acknowledged, so the mailboxes fill up and then
    /// refuse, and nothing is received. Afterwards the mailboxes send their frames.
    Unplugged(Line),
    /// The driver refuses every frame to transmit with would-block, with or without room.
    WouldBlock(Line),
    /// Calls of the driver return an error.
    DriverErrors {
        /// The bus.
        line: Line,
        /// 0 for none, 1 for all.
        probability: f32,
    },
    /// A foreign node sends one frame again and again.
    Flood {
        /// The bus.
        line: Line,
        /// The frame of the node.
        frame: CanFrame,
        /// Time between two frames; at least 1 µs. The bus limits the resulting rate.
        period: Duration,
    },
    /// The ESC sends no feedback, or the joint answers nothing; all else works.
    Silent(MotorKey),
    /// There is no supply: no feedback, no current, nothing heard. Afterwards the motor starts afresh, a joint disabled.
    PowerLoss {
        /// The motor.
        motor: MotorKey,
        /// Whether the angle at the restart is its new zero. A joint always takes a new zero: it counts from its angle at
        /// the start.
        forgets_angle: bool,
    },
    /// Angle and speed in the feedback stay constant.
    StuckEncoder(MotorKey),
    /// The ESC sends the same feedback again and again; all else works.
    FrozenFeedback(MotorKey),
    /// Nothing turns the shaft.
    BlockedShaft(MotorKey),
    /// The motor turns against its command, and reports this motion: torque and back-EMF have the wrong sign.
    ReversedTorque(MotorKey),
    /// The angle field of the feedback has this value; a value above 8191 is invalid.
    WrongAngle {
        /// The motor.
        motor: MotorKey,
        /// The value on the wire.
        raw: u16,
    },
    /// The feedback frames have this length instead of 8.
    WrongLength {
        /// The motor.
        motor: MotorKey,
        /// 0 to 8; above 8 the frames fail to appear at all.
        length: u8,
    },
    /// Byte 7 of the feedback has this value.
    ErrorCode {
        /// The motor.
        motor: MotorKey,
        /// The value on the wire.
        code: u8,
    },
}

impl Fault {
    /// Returns whether the fault excludes this motor: a joint has no fault of an ESC.
    const fn is_impossible(&self) -> bool {
        match self {
            Self::Silent(_) | Self::PowerLoss { .. } => false,
            _ => match self.motor() {
                Some(motor) => motor.is_joint(),
                None => false,
            },
        }
    }

    /// Returns the motor of the fault.
    const fn motor(&self) -> Option<MotorKey> {
        match self {
            Self::Silent(motor)
            | Self::StuckEncoder(motor)
            | Self::FrozenFeedback(motor)
            | Self::BlockedShaft(motor)
            | Self::ReversedTorque(motor)
            | Self::PowerLoss { motor, .. }
            | Self::WrongAngle { motor, .. }
            | Self::WrongLength { motor, .. }
            | Self::ErrorCode { motor, .. } => Some(*motor),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Scheduled {
    fault: Fault,
    from_ns: u64,
    until_ns: u64,
    random: Random,
    /// Next frame of a flood.
    due_ns: u64,
}

impl Scheduled {
    const fn is_active(&self, now_ns: u64) -> bool {
        self.from_ns <= now_ns && now_ns < self.until_ns
    }
}

/// The faults of a world, with their windows of time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Faults {
    scheduled: [Option<Scheduled>; 16],
    /// Taken places, from the first on.
    used: usize,
    total: u64,
}

impl Faults {
    pub(crate) const fn new() -> Self {
        Self { scheduled: [None; 16], used: 0, total: 0 }
    }

    pub(crate) fn schedule(
        &mut self,
        fault: Fault,
        window: impl RangeBounds<Instant>,
        seed: u64,
        now_ns: u64,
    ) -> Result<(), SimError> {
        if fault.is_impossible() {
            return Err(SimError::NoFaultOfJoint);
        }
        let ns = |instant: &Instant| instant.as_micros().saturating_mul(1_000);
        let from_ns = match window.start_bound() {
            Bound::Included(from) | Bound::Excluded(from) => ns(from),
            Bound::Unbounded => 0,
        };
        let until_ns = match window.end_bound() {
            Bound::Included(until) => ns(until).saturating_add(1),
            Bound::Excluded(until) => ns(until),
            Bound::Unbounded => u64::MAX,
        };
        let over = |slot: &&mut Option<Scheduled>| slot.is_none_or(|slot| slot.until_ns <= now_ns);
        let mut slots = self.scheduled.iter_mut().enumerate();
        let (index, slot) = slots.find(|(_, slot)| over(slot)).ok_or(SimError::TooManyFaults)?;
        self.used = self.used.max(index + 1);
        self.total += 1;
        let random = Random::new(seed, 2 * self.total);
        *slot = Some(Scheduled { fault, from_ns, until_ns, random, due_ns: from_ns.max(now_ns) });
        Ok(())
    }

    fn slots(&self) -> impl Iterator<Item = &Scheduled> {
        self.scheduled.iter().take(self.used).flatten()
    }

    fn slots_mut(&mut self) -> impl Iterator<Item = &mut Scheduled> {
        self.scheduled.iter_mut().take(self.used).flatten()
    }

    fn active(&self, now_ns: u64) -> impl Iterator<Item = &Fault> {
        let active = move |slot: &&Scheduled| slot.is_active(now_ns);
        self.slots().filter(active).map(|slot| &slot.fault)
    }

    /// Returns whether there was never a fault.
    pub(crate) const fn is_empty(&self) -> bool {
        self.used == 0
    }

    pub(crate) fn is_active(&self, fault: Fault, now_ns: u64) -> bool {
        self.active(now_ns).any(|active| *active == fault)
    }

    /// Returns whether the controller of a bus takes part in the traffic.
    pub(crate) fn is_connected(&self, line: Line, now_ns: u64) -> bool {
        !self
            .active(now_ns)
            .any(|fault| *fault == Fault::BusOff(line) || *fault == Fault::Unplugged(line))
    }

    /// Returns the effects of faults on the feedback of a motor.
    pub(crate) fn tampering(&self, motor: MotorKey, now_ns: u64) -> Tampering {
        let mut tampering = Tampering::default();
        for fault in self.active(now_ns).filter(|fault| fault.motor() == Some(motor)) {
            match *fault {
                Fault::Silent(_) => tampering.silent = true,
                Fault::StuckEncoder(_) => tampering.stuck = true,
                Fault::FrozenFeedback(_) => tampering.frozen = true,
                Fault::WrongAngle { raw, .. } => tampering.angle = Some(raw),
                Fault::WrongLength { length, .. } => tampering.length = Some(length),
                Fault::ErrorCode { code, .. } => tampering.error = code,
                _ => {}
            }
        }
        tampering
    }

    /// Returns whether a motor is without its supply, and whether the motor then forgets its angle.
    pub(crate) fn power_loss(&self, motor: MotorKey, now_ns: u64) -> Option<bool> {
        self.active(now_ns).find_map(|fault| match fault {
            Fault::PowerLoss { motor: dead, forgets_angle } if *dead == motor => {
                Some(*forgets_angle)
            }
            _ => None,
        })
    }

    /// Returns the effects of faults on the mechanics of a motor.
    pub(crate) fn mechanics(&self, motor: MotorKey, now_ns: u64) -> Mechanics {
        let has = |fault| self.is_active(fault, now_ns);
        Mechanics {
            blocked: has(Fault::BlockedShaft(motor)),
            reversed: has(Fault::ReversedTorque(motor)),
        }
    }

    /// Draws how often a frame reaches the others: 0, 1 or 2 times.
    pub(crate) fn copies(&mut self, line: Line, frame: &CanFrame, now_ns: u64) -> u8 {
        let (mut copies, mut lost) = (1, false);
        let concerns = |id: Option<Id>| id.is_none_or(|id| id == frame.id());
        for slot in self.slots_mut().filter(|slot| slot.is_active(now_ns)) {
            match slot.fault {
                Fault::LostFrames { line: bus, id, probability } if bus == line && concerns(id) => {
                    lost |= slot.random.chance(probability);
                }
                Fault::DuplicateFrames { line: bus, id } if bus == line && concerns(id) => {
                    copies = 2
                }
                _ => {}
            }
        }
        if lost { 0 } else { copies }
    }

    /// Draws whether a call of the driver fails.
    pub(crate) fn driver_error(&mut self, line: Line, now_ns: u64) -> bool {
        let mut failed = false;
        for slot in self.slots_mut().filter(|slot| slot.is_active(now_ns)) {
            match slot.fault {
                Fault::DriverErrors { line: bus, probability } if bus == line => {
                    failed |= slot.random.chance(probability);
                }
                _ => {}
            }
        }
        failed
    }

    /// Returns when the next frame of a flood is due, or the next window begins or ends.
    pub(crate) fn next_event(&self, now_ns: u64) -> u64 {
        let mut next = u64::MAX;
        for slot in self.slots() {
            if slot.from_ns > now_ns {
                next = next.min(slot.from_ns);
            } else if slot.until_ns > now_ns {
                next = next.min(slot.until_ns);
                if let Fault::Flood { .. } = slot.fault {
                    next = next.min(slot.due_ns);
                }
            }
        }
        next
    }

    /// Takes one due frame of a flood.
    pub(crate) fn next_of_flood(&mut self, now_ns: u64) -> Option<(Line, CanFrame)> {
        self.slots_mut().find_map(|slot| match slot.fault {
            Fault::Flood { line, frame, period }
                if slot.is_active(now_ns) && slot.due_ns <= now_ns =>
            {
                let period_ns = period.as_micros().max(1).saturating_mul(1_000);
                slot.due_ns = slot.due_ns.saturating_add(period_ns);
                Some((line, frame))
            }
            _ => None,
        })
    }
}

/// Why a [`Simulation`](super::Simulation) refuses something, or a call of its driver failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SimError {
    /// There are 16 motors already.
    Full,
    /// The ESC has no such id.
    Id {
        /// The name of the model.
        model: &'static str,
        /// The requested id.
        id: u8,
    },
    /// There is no joint with this id, or there are 12 joints already.
    Joint {
        /// The requested id.
        id: u8,
    },
    /// A parameter of the chassis, by its name, is invalid; see [`ChassisConfig::validate`](super::ChassisConfig::validate).
    Chassis(&'static str),
    /// There are already 16 faults that are not over.
    TooManyFaults,
    /// The fault belongs to an ESC, and the motor is a joint: a joint can be silent or without supply.
    NoFaultOfJoint,
    /// 64 frames of foreign nodes and drives wait on this bus already.
    BusFull(Line),
    /// The controller is bus-off.
    BusOff,
    /// Frames were missed because the receive queue was full. Reported once; the frames before are still there.
    Overrun,
    /// [`Fault::DriverErrors`] makes the call of the driver fail.
    Scripted,
    /// A blocking call waited for a second.
    TimedOut,
}

impl core::fmt::Display for SimError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Full => write!(f, "the simulation holds {MOTORS} motors and has no place left"),
            Self::Id { model, id } => write!(f, "{model} has no id {id}"),
            Self::Joint { id } => write!(f, "no joint has the id {id}, or there are 12 already"),
            Self::Chassis(name) => {
                write!(f, "{name} of the chassis is out of its range, see ChassisConfig::validate")
            }
            Self::TooManyFaults => f.write_str(
                "the simulation holds 16 faults at a time: schedule more when some have ended",
            ),
            Self::NoFaultOfJoint => {
                f.write_str("a joint can be silent or without supply, and has no other fault")
            }
            Self::BusFull(line) => {
                write!(f, "64 frames wait on {line:?} already: advance the time first")
            }
            Self::BusOff => f.write_str("the controller is bus-off"),
            Self::Overrun => f.write_str("frames were missed: the receive queue was full"),
            Self::Scripted => f.write_str("the driver failed by Fault::DriverErrors"),
            Self::TimedOut => f.write_str("a blocking call timed out after a simulated second"),
        }
    }
}

impl core::error::Error for SimError {}

impl embedded_can::Error for SimError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Overrun => ErrorKind::Overrun,
            Self::Scripted => ErrorKind::Acknowledge,
            _ => ErrorKind::Other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: fn(u64) -> Instant = Instant::from_micros;

    #[test]
    fn windows_include_their_start_and_not_their_end() {
        let mut faults = Faults::new();
        let fault = Fault::BusOff(Line::Can1);
        faults.schedule(fault, AT(10)..AT(20), 1, 0).unwrap();
        for (now_ns, connected) in [(9_999, true), (10_000, false), (19_999, false), (20_000, true)]
        {
            assert_eq!(faults.is_connected(Line::Can1, now_ns), connected, "{now_ns}");
            assert!(faults.is_connected(Line::Can2, now_ns));
        }
        assert_eq!(
            [0, 10_000, 20_000].map(|now| faults.next_event(now)),
            [10_000, 20_000, u64::MAX]
        );
    }

    #[test]
    fn open_windows_hold_for_ever() {
        let mut faults = Faults::new();
        faults.schedule(Fault::Unplugged(Line::Can2), .., 1, 0).unwrap();
        assert!(
            !faults.is_connected(Line::Can2, 0) && !faults.is_connected(Line::Can2, u64::MAX - 1)
        );
    }

    #[test]
    fn the_seventeenth_fault_waits_until_another_is_over() {
        let mut faults = Faults::new();
        for _ in 0..16 {
            faults.schedule(Fault::BusOff(Line::Can1), ..AT(5), 1, 0).unwrap();
        }
        let another = Fault::WouldBlock(Line::Can1);
        assert_eq!(faults.schedule(another, .., 1, 4_000), Err(SimError::TooManyFaults));
        assert_eq!(faults.schedule(another, .., 1, 5_000), Ok(()));
    }

    #[test]
    fn a_flood_keeps_its_period() {
        let mut faults = Faults::new();
        let frame = CanFrame::standard(0x7FF, [0; 8]).unwrap();
        let flood = Fault::Flood { line: Line::Can1, frame, period: Duration::from_micros(100) };
        faults.schedule(flood, AT(1_000)..AT(2_000), 1, 0).unwrap();
        let mut sent = 0;
        let mut now = 0;
        while faults.next_event(now) != u64::MAX {
            now = faults.next_event(now);
            sent += u32::from(faults.next_of_flood(now).is_some());
        }
        assert_eq!(sent, 10);
    }
}
