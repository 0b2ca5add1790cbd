//! The joints of a bus, and their order for disables, writes and requests; outstanding replies, by id, since a reply may arrive after its
//! joint was detached.

use super::model::{Budget, Counters, IDS, SLOTS};
use super::slot::{Rules, Slot};
use super::{Command, Register};
use crate::frame::CanFrame;
use crate::time::{Duration, Instant};
use embedded_can::Frame;

/// The joints of one CAN bus, and the frames for them.
///
/// Owns the joints; [`attach`](Self::attach) returns a `Copy` handle for each. The [module](super) describes the order of requests and
/// writes. A bus can be a `static`.
///
/// # Examples
/// ```
/// use drivetrain::encoder::Position;
/// use drivetrain::frame::CanFrame;
/// use drivetrain::motor::Devices;
/// use drivetrain::snake::{Config, Joints, Register};
/// use drivetrain::time::{Instant, Tick};
/// use drivetrain::units::Angle;
/// use embedded_can::{Frame, StandardId};
///
/// let mut joints = Joints::new();
/// let neck = joints.attach(Config::new(3))?;
/// let at_ms = |ms: u64| Instant::from_micros(ms * 1_000);
/// joints.update(Tick::new(at_ms(1), 0.001));
/// let sent = |joints: &mut Joints| joints.next_frame().map(|frame| format!("{frame:?}"));
/// assert_eq!(sent(&mut joints).as_deref(), Some("003 [6] 01 10 00 00 00 00")); // disabled
/// assert_eq!(sent(&mut joints).as_deref(), Some("003 [2] 03 07")); // where are you?
///
/// let id = StandardId::new(3).ok_or("id")?;
/// let reply = Register::ActualPosition.reply(16_384);
/// _ = joints.ingest(&CanFrame::new(id, &reply).ok_or("length")?, at_ms(2));
/// assert_eq!(joints.state(neck).map(|state| state.position.as_turns()), Some(0.25));
/// joints.zero(neck)?;
/// joints.arm(at_ms(2))?;
/// joints.set_position(neck, Position::from_angle(Angle::from_degrees(30.0)))?;
/// joints.update(Tick::new(at_ms(2), 0.001));
/// assert_eq!(sent(&mut joints).as_deref(), Some("003 [6] 01 0F 00 00 00 01")); // mode first, enable last
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Joints {
    pub(super) slots: [Slot; SLOTS],
    pub(super) now: Instant,
    pub(super) reply_timeout: Duration,
    pub(super) answers: Answers,
    pub(super) budget: Budget,
    /// Joints to be disabled before all else, to be written to, and to be polled; one bit each.
    pub(super) stops: u16,
    pub(super) writes: u16,
    pub(super) reads: u16,
    /// Requeued frames, by the same three kinds: for the next update.
    pub(super) returned: (u16, u16, u16),
    pub(super) reads_first: bool,
    /// Joints last chosen for a write and a request; joints last disabled, written to and polled.
    pub(super) last_write: u8,
    pub(super) last_read: u8,
    pub(super) told: u8,
    pub(super) written: u8,
    pub(super) asked: u8,
    pub(super) guard: Rules,
    /// Whether sent frames are received again.
    pub(super) echoes: bool,
    pub(super) counters: Counters,
}

/// Chooses the frames of this update: first pending and requeued frames, then those of the next joints in turn.
pub(super) fn plan(joints: &mut Joints) {
    stop_again(joints);
    let (_, writes, reads) = core::mem::take(&mut joints.returned);
    drop_frames(joints, joints.writes.count_ones() + joints.reads.count_ones());
    joints.writes |= writes;
    joints.reads |= reads;
    // Frames without room go first. If both kinds had none, the kinds take turns: neither starves the other.
    joints.reads_first = joints.reads != 0 && !(joints.writes != 0 && joints.reads_first);
    // Joints with an outstanding reply do not count against the budget.
    let quiet = joints.answers.owing();
    // Joints with new values go before periodic refreshes.
    for news in [true, false] {
        for index in turns(joints.last_write) {
            if (joints.writes & !quiet).count_ones() >= u32::from(joints.budget.writes) {
                break;
            }
            let Some(slot) = joints.slots.get(usize::from(index)) else { continue };
            let free = is_free(joints, index) && joints.writes & 1 << index == 0;
            let wants = if news { slot.has_news() } else { slot.driven };
            if free && wants {
                joints.writes |= 1 << index;
                joints.last_write = index;
            }
        }
    }
    for index in turns(joints.last_read) {
        if (joints.reads & !quiet).count_ones() >= u32::from(joints.budget.reads) {
            break;
        }
        if is_free(joints, index) && joints.reads & 1 << index == 0 {
            joints.reads |= 1 << index;
            joints.last_read = index;
        }
    }
    pack(joints, joints.writes.count_ones() + joints.reads.count_ones());
}

/// Disables again each joint whose disable was requeued.
pub(super) fn stop_again(joints: &mut Joints) {
    let stops = core::mem::take(&mut joints.returned.0);
    pack(joints, (stops & !joints.stops).count_ones());
    joints.stops |= stops;
}

/// Counts one more; saturates.
pub(super) const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

const fn pack(joints: &mut Joints, frames: u32) {
    joints.counters.packed = joints.counters.packed.wrapping_add(frames);
}

const fn drop_frames(joints: &mut Joints, frames: u32) {
    joints.counters.superseded = joints.counters.superseded.wrapping_add(frames);
}

/// Tells whether a joint is attached and has no outstanding reply.
fn is_free(joints: &Joints, index: u8) -> bool {
    let slot = joints.slots.get(usize::from(index));
    slot.is_some_and(|slot| slot.id.is_some()) && joints.answers.of(index.into()).is_none()
}

/// Returns the next frame to send and removes it from the list: first disables, then writes and requests.
pub(super) fn next_frame(joints: &mut Joints) -> Option<CanFrame> {
    let now = joints.now;
    let quiet = joints.answers.owing();
    if let Some(index) = next_after(joints.told, joints.stops & !quiet) {
        joints.stops &= !(1 << index);
        joints.told = index;
        if let Some(slot) = joints.slots.get_mut(usize::from(index)) {
            slot.told_to_relax(now);
        }
        return Command::DISABLE.frame(index + 1);
    }
    let write = next_after(joints.written, joints.writes & !quiet);
    // In an update without a step, the waiting time for a reply is unknown.
    let reads = if joints.guard.held_steps() == 0 { joints.reads & !quiet } else { 0 };
    let read = next_after(joints.asked, reads);
    match (write, read) {
        (Some(index), None) => write_next(joints, index),
        (Some(index), Some(_)) if !joints.reads_first => write_next(joints, index),
        (_, Some(index)) => {
            joints.reads &= !(1 << index);
            joints.asked = index;
            count(&mut joints.counters.requests);
            let register = joints.slots.get_mut(usize::from(index))?.next_read();
            joints.answers.expect(index.into(), register, now);
            Command::Read(register).frame(index + 1)
        }
        (None, None) => None,
    }
}

fn write_next(joints: &mut Joints, index: u8) -> Option<CanFrame> {
    joints.writes &= !(1 << index);
    joints.written = index;
    joints.slots.get_mut(usize::from(index))?.next_write(joints.now).frame(index + 1)
}

/// Requeues a frame that was not sent, or was evicted. Returns `false` for a frame of another sender.
pub(super) fn requeue(joints: &mut Joints, frame: &CanFrame) -> bool {
    let Ok(index) = u8::try_from(frame.header().wrapping_sub(1)) else { return false };
    let Some(slot) = joints.slots.get_mut(usize::from(index)) else { return false };
    let Some(command) = Command::decode(frame.data()) else { return false };
    if !slot.was_ever_attached() {
        return false;
    }
    let (bit, attached) = (1 << index, slot.id.is_some());
    if let Command::Read(register) = command {
        joints.counters.requests = joints.counters.requests.saturating_sub(1);
        if joints.answers.take_back(index.into(), register) {
            slot.take_back_question();
        }
    }
    let (stops, writes, reads) = &mut joints.returned;
    // The first frame requeued is the next of its kind.
    let (returned, last) = match command {
        Command::DISABLE => {
            slot.told_to_relax(joints.now);
            (stops, &mut joints.told)
        }
        _ if !attached => {
            drop_frames(joints, 1);
            return true;
        }
        Command::Write(register, _) => {
            slot.take_back(register);
            (writes, &mut joints.written)
        }
        Command::Read(_) => (reads, &mut joints.asked),
    };
    if *returned == 0 {
        *last = (index + IDS - 1) % IDS;
    }
    *returned |= bit;
    if command == Command::DISABLE {
        drop_write(joints, bit);
    }
    drop_frames(joints, 1);
    true
}

/// Disables a joint before all else.
pub(super) const fn stop(joints: &mut Joints, index: usize) {
    let bit = 1 << index;
    pack(joints, (bit & !joints.stops).count_ones());
    joints.stops |= bit;
    drop_write(joints, bit);
}

pub(super) fn stop_all(joints: &mut Joints) {
    for index in 0..joints.slots.len() {
        if joints.slots.get(index).is_some_and(|slot| slot.id.is_some()) {
            stop(joints, index);
        }
    }
}

/// Drops other writes to a joint that is to be disabled.
const fn drop_write(joints: &mut Joints, bit: u16) {
    drop_frames(joints, (joints.writes & bit).count_ones());
    joints.writes &= !bit;
    joints.returned.1 &= !bit;
}

/// Drops requests to a detached joint.
pub(super) const fn drop_read(joints: &mut Joints, index: usize) {
    let bit = 1 << index;
    drop_frames(joints, (joints.reads & bit).count_ones());
    joints.reads &= !bit;
    joints.returned.2 &= !bit;
}

/// Returns all joints, beginning with the joint after `last`.
fn turns(last: u8) -> impl Iterator<Item = u8> {
    (1..=IDS).map(move |step| (last + step) % IDS)
}

/// Returns the first of some joints behind `last`, or else the first.
const fn next_after(last: u8, joints: u16) -> Option<u8> {
    match lowest(joints & (u16::MAX << (last + 1))) {
        None => lowest(joints),
        next => next,
    }
}

#[expect(clippy::cast_possible_truncation, reason = "at most 15")]
const fn lowest(bits: u16) -> Option<u8> {
    if bits == 0 { None } else { Some(bits.trailing_zeros() as u8) }
}

/// Requests without a reply, one place per joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct Answers([Owed; SLOTS]);

#[derive(Debug, Clone, Copy)]
struct Owed {
    due: Option<(Register, Instant)>,
    /// Requests that expired and were not answered since, one bit each: a driver may still hold them.
    given_up: u32,
}

const fn bit(register: Register) -> u32 {
    1 << register.as_raw()
}

impl Answers {
    pub(super) const NONE: Self = Self([Owed { due: None, given_up: 0 }; SLOTS]);

    pub(super) fn of(&self, index: usize) -> Option<Register> {
        let (register, _) = self.0.get(index)?.due?;
        Some(register)
    }

    pub(super) fn expect(&mut self, index: usize, register: Register, now: Instant) {
        if let Some(owed) = self.0.get_mut(index) {
            owed.due = Some((register, now));
        }
    }

    /// Takes a reply: the outstanding one, or a reply for another register.
    pub(super) fn take(&mut self, index: usize, register: Register) {
        if let Some(owed) = self.0.get_mut(index) {
            owed.given_up &= !bit(register);
            owed.due = owed.due.filter(|(asked, _)| *asked != register);
        }
    }

    /// Takes back a request that was not sent. Returns `false` if the request expired before, or may have: the reply to another request is
    /// then still outstanding.
    pub(super) fn take_back(&mut self, index: usize, register: Register) -> bool {
        let Some(owed) = self.0.get_mut(index) else { return false };
        let is_given_up = owed.given_up & bit(register) != 0;
        owed.due.take_if(|(asked, _)| *asked == register && !is_given_up).is_some()
    }

    /// Returns the joints with an outstanding reply, one bit each.
    fn owing(&self) -> u16 {
        (0..).zip(&self.0).map(|(index, owed)| u16::from(owed.due.is_some()) << index).sum()
    }

    /// Drops overdue replies, and returns their joints; without a time-out, drops all.
    pub(super) fn give_up(
        &mut self,
        now: Instant,
        reply_timeout: Option<Duration>,
    ) -> impl Iterator<Item = usize> {
        self.0.iter_mut().enumerate().filter_map(move |(index, owed)| {
            let (register, since) = owed.due?;
            // After a set-back of the clock, the time since the request alone would delay the expiry for long.
            let passed = now.since(since).max(since.since(now));
            reply_timeout.is_none_or(|timeout| passed > timeout).then(|| {
                *owed = Owed { due: None, given_up: owed.given_up | bit(register) };
                index
            })
        })
    }
}
