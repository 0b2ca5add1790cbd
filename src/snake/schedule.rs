//! Order of the joints for disables, writes and requests.

use super::counters::count;
use super::model::IDS;
use super::{Command, Joints};
use crate::frame::CanFrame;
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
