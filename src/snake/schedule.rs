//! Order of the joints for disables, writes and requests; outstanding replies, by id, since a reply may arrive after its joint was
//! detached; and the load of the bus.

use super::model::{IDS, SLOTS};
use super::{Command, Joints, Register};
use crate::frame::CanFrame;
use crate::motor::BusLoad;
use crate::time::{Duration, Instant};
use embedded_can::Frame;

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
            let wants = if news { slot.has_news() } else { slot.is_driven() };
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

/// Number of frames in an update, and the rates for the load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Budget {
    pub(super) reads: u8,
    pub(super) writes: u8,
    pub(super) bit_rate: u32,
    pub(super) tick_hz: u32,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self { reads: 1, writes: 1, bit_rate: 1_000_000, tick_hz: 1_000 }
    }

    /// Returns the load of requests, replies and writes, while all joints move.
    pub(super) const fn load(&self) -> BusLoad {
        let Self { reads, writes, bit_rate, tick_hz } = *self;
        BusLoad::new(bit_rate).with_frames_of(2, reads as u32, tick_hz).with_frames_of(
            6,
            reads as u32 + writes as u32,
            tick_hz,
        )
    }
}

/// Returns a number of frames in an update, 1 to 12.
pub(super) const fn limited(frames: u8) -> u8 {
    match frames {
        0 => 1,
        1..=12 => frames,
        _ => 12,
    }
}

/// Counters of a bus. All saturate, except `packed` and `superseded`, which wrap at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Accepted replies.
    pub replies: u32,
    /// Frames with a joint's id and another length than 6.
    pub bad_length: u32,
    /// Frames with a joint's id that are no reply, or that name an unknown register.
    pub bad_field: u32,
    /// Frames with a joint's id that only a controller sends: there is a second controller on the bus.
    pub foreign_commands: u32,
    /// Frames with the id of a joint that is not attached.
    pub unattached: u32,
    /// Requests sent, less requests given back.
    pub requests: u32,
    /// Requests not answered in time, including requests given back after that.
    pub unanswered: u32,
    /// Updates with a time step of zero, negative, infinite or NaN, or with a time that stood still.
    pub bad_steps: u32,
    /// Frames that were ready: chosen by an update, or disables, whenever due; wraps.
    pub packed: u32,
    /// Frames replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

impl Counters {
    pub(super) const NONE: Self = Self {
        replies: 0,
        bad_length: 0,
        bad_field: 0,
        foreign_commands: 0,
        unattached: 0,
        requests: 0,
        unanswered: 0,
        bad_steps: 0,
        packed: 0,
        superseded: 0,
    };
}

/// Counts one more; saturates.
pub(super) const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
