//! Who is written to and asked next.

use super::bus::count;
use super::model::IDS;
use super::slot::Slot;
use super::{Command, Joints};
use crate::frame::CanFrame;
use embedded_can::Frame;

impl Joints {
    /// Chooses the frames of this update: what was left or given back, then those whose turn it is.
    pub(super) fn plan(&mut self) {
        let left = (self.stops | self.writes | self.reads).count_ones();
        let (stops, writes, reads) = core::mem::take(&mut self.returned);
        // What the driver refused goes first, so that neither starves the other.
        self.reads_first = self.reads | reads != 0 && self.writes | writes == 0;
        self.stops |= stops;
        self.writes |= writes;
        self.reads |= reads;
        // Whoever owes an answer is in nobody's way.
        let quiet = self.owing();
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
        let packed = (self.stops | self.writes | self.reads).count_ones();
        self.counters.packed = self.counters.packed.wrapping_add(packed);
        self.counters.superseded = self.counters.superseded.wrapping_add(left);
    }

    /// Tells whether a joint is there and owes no answer.
    fn is_free(&self, index: u8) -> bool {
        let slot = self.slots.get(usize::from(index));
        slot.is_some_and(|slot| slot.id.is_some() && slot.awaiting.is_none())
    }

    /// Returns a frame that waits to be sent, and takes it off the list: first who is to stop, then writes and questions.
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        let now = self.now;
        let quiet = self.owing();
        if let Some(index) = lowest(self.stops & !quiet) {
            self.stops &= !(1 << index);
            if let Some(slot) = self.slots.get_mut(usize::from(index)) {
                slot.told_to_relax(now);
            }
            return Command::DISABLE.frame(index + 1);
        }
        let (write, read) = (lowest(self.writes & !quiet), lowest(self.reads & !quiet));
        match (write, read) {
            (Some(index), None) => self.write(index),
            (Some(index), Some(_)) if !self.reads_first => self.write(index),
            (_, Some(index)) => {
                self.reads &= !(1 << index);
                count(&mut self.counters.requests);
                self.slots.get_mut(usize::from(index))?.next_read(now).frame(index + 1)
            }
            (None, None) => None,
        }
    }

    fn write(&mut self, index: u8) -> Option<CanFrame> {
        self.writes &= !(1 << index);
        self.slots.get_mut(usize::from(index))?.next_write(self.now).frame(index + 1)
    }

    /// Returns the joints that owe an answer.
    fn owing(&self) -> u16 {
        let owing = |(index, slot): (u32, &Slot)| u16::from(slot.awaiting.is_some()) << index;
        (0..).zip(&self.slots).map(owing).fold(0, |all, one| all | one)
    }

    /// Takes back a frame that was not sent, or was evicted; `false` when it is not this bus's.
    pub fn requeue(&mut self, frame: &CanFrame) -> bool {
        let index = frame.header().wrapping_sub(1);
        let Some(slot) = self.slots.get_mut(index as usize) else { return false };
        let Some(command) = Command::decode(frame.data()) else { return false };
        let (bit, attached) = (1 << index, slot.id.is_some());
        match command {
            Command::DISABLE => {
                slot.told_to_relax(self.now);
                self.returned.0 |= bit;
                // It comes first the next time too.
                self.writes &= !bit;
            }
            _ if !attached => return false,
            Command::Write(register, _) => {
                slot.take_back(register);
                self.returned.1 |= bit;
            }
            Command::Read(_) => {
                slot.awaiting = None;
                self.returned.2 |= bit;
            }
        }
        true
    }

    /// Has a joint disabled before all else.
    pub(super) const fn stop(&mut self, index: usize) {
        self.stops |= 1 << index;
        self.writes &= !(1 << index);
        self.returned.1 &= !(1 << index);
    }
}

/// All joints, beginning with the one after `last`.
fn turns(last: u8) -> impl Iterator<Item = u8> {
    (1..=IDS).map(move |step| (last + step) % IDS)
}

#[expect(clippy::cast_possible_truncation, reason = "at most 15")]
const fn lowest(bits: u16) -> Option<u8> {
    if bits == 0 { None } else { Some(bits.trailing_zeros() as u8) }
}
