//! Who is written to and asked next.

use super::bus::count;
use super::model::IDS;
use super::{Command, Joints};
use crate::frame::CanFrame;
use embedded_can::Frame;

impl Joints {
    /// Chooses the frames of this update: what was left or given back, then those whose turn it is.
    pub(super) fn plan(&mut self) {
        self.stop_again();
        let (_, writes, reads) = core::mem::take(&mut self.returned);
        self.drop_frames(self.writes.count_ones() + self.reads.count_ones());
        self.writes |= writes;
        self.reads |= reads;
        // What had no room goes first, and where both had none, they take turns: neither starves the other.
        self.reads_first = self.reads != 0 && !(self.writes != 0 && self.reads_first);
        // Whoever owes an answer is in nobody's way.
        let quiet = self.answers.owing();
        // Who has news goes before who only hears the old again.
        for news in [true, false] {
            for index in turns(self.last_write) {
                if (self.writes & !quiet).count_ones() >= u32::from(self.budget.writes) {
                    break;
                }
                let Some(slot) = self.slots.get(usize::from(index)) else { continue };
                let free = self.is_free(index) && self.writes & 1 << index == 0;
                let wants = if news { slot.has_news() } else { slot.is_driven() };
                if free && wants {
                    self.writes |= 1 << index;
                    self.last_write = index;
                }
            }
        }
        for index in turns(self.last_read) {
            if (self.reads & !quiet).count_ones() >= u32::from(self.budget.reads) {
                break;
            }
            if self.is_free(index) && self.reads & 1 << index == 0 {
                self.reads |= 1 << index;
                self.last_read = index;
            }
        }
        self.pack(self.writes.count_ones() + self.reads.count_ones());
    }

    /// Has the joints whose disable was given back disabled now.
    pub(super) fn stop_again(&mut self) {
        let stops = core::mem::take(&mut self.returned.0);
        self.pack((stops & !self.stops).count_ones());
        self.stops |= stops;
    }

    const fn pack(&mut self, frames: u32) {
        self.counters.packed = self.counters.packed.wrapping_add(frames);
    }

    const fn drop_frames(&mut self, frames: u32) {
        self.counters.superseded = self.counters.superseded.wrapping_add(frames);
    }

    /// Tells whether a joint is there and owes no answer.
    fn is_free(&self, index: u8) -> bool {
        let slot = self.slots.get(usize::from(index));
        slot.is_some_and(|slot| slot.id.is_some()) && self.answers.of(index.into()).is_none()
    }

    /// Returns a frame that waits to be sent, and takes it off the list: first who is to stop, then writes and questions.
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        let now = self.now;
        let quiet = self.answers.owing();
        if let Some(index) = next_after(self.told, self.stops & !quiet) {
            self.stops &= !(1 << index);
            self.told = index;
            if let Some(slot) = self.slots.get_mut(usize::from(index)) {
                slot.told_to_relax(now);
            }
            return Command::DISABLE.frame(index + 1);
        }
        let write = next_after(self.written, self.writes & !quiet);
        // An update without a step does not know how long an answer is waited for.
        let reads = if self.guard.held_steps() == 0 { self.reads & !quiet } else { 0 };
        let read = next_after(self.asked, reads);
        match (write, read) {
            (Some(index), None) => self.write(index),
            (Some(index), Some(_)) if !self.reads_first => self.write(index),
            (_, Some(index)) => {
                self.reads &= !(1 << index);
                self.asked = index;
                count(&mut self.counters.requests);
                let register = self.slots.get_mut(usize::from(index))?.next_read();
                self.answers.expect(index.into(), register, now);
                Command::Read(register).frame(index + 1)
            }
            (None, None) => None,
        }
    }

    fn write(&mut self, index: u8) -> Option<CanFrame> {
        self.writes &= !(1 << index);
        self.written = index;
        self.slots.get_mut(usize::from(index))?.next_write(self.now).frame(index + 1)
    }

    /// Takes back a frame that was not sent, or was evicted; `false` when it is not this bus's.
    pub fn requeue(&mut self, frame: &CanFrame) -> bool {
        let Ok(index) = u8::try_from(frame.header().wrapping_sub(1)) else { return false };
        let Some(slot) = self.slots.get_mut(usize::from(index)) else { return false };
        let Some(command) = Command::decode(frame.data()) else { return false };
        if !slot.was_ever_attached() {
            return false;
        }
        let (bit, attached) = (1 << index, slot.id.is_some());
        if let Command::Read(register) = command {
            self.counters.requests = self.counters.requests.saturating_sub(1);
            if self.answers.take_back(index.into(), register) {
                slot.take_back_question();
            }
        }
        let (stops, writes, reads) = &mut self.returned;
        // The first that comes back is the next of its kind.
        let (returned, last) = match command {
            Command::DISABLE => {
                slot.told_to_relax(self.now);
                (stops, &mut self.told)
            }
            _ if !attached => {
                self.drop_frames(1);
                return true;
            }
            Command::Write(register, _) => {
                slot.take_back(register);
                (writes, &mut self.written)
            }
            Command::Read(_) => (reads, &mut self.asked),
        };
        if *returned == 0 {
            *last = (index + IDS - 1) % IDS;
        }
        *returned |= bit;
        if command == Command::DISABLE {
            self.drop_write(bit);
        }
        self.drop_frames(1);
        true
    }

    /// Has a joint disabled before all else.
    pub(super) const fn stop(&mut self, index: usize) {
        let bit = 1 << index;
        self.pack((bit & !self.stops).count_ones());
        self.stops |= bit;
        self.drop_write(bit);
    }

    pub(super) fn stop_all(&mut self) {
        for index in 0..self.slots.len() {
            if self.slots.get(index).is_some_and(|slot| slot.id.is_some()) {
                self.stop(index);
            }
        }
    }

    /// What is to be disabled is written nothing else before.
    const fn drop_write(&mut self, bit: u16) {
        self.drop_frames((self.writes & bit).count_ones());
        self.writes &= !bit;
        self.returned.1 &= !bit;
    }

    /// Asks a joint that is detached nothing more.
    pub(super) const fn drop_read(&mut self, index: usize) {
        let bit = 1 << index;
        self.drop_frames((self.reads & bit).count_ones());
        self.reads &= !bit;
        self.returned.2 &= !bit;
    }
}

/// All joints, beginning with the one after `last`.
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
