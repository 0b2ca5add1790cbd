use crate::frame::CanFrame;
use embedded_can::{Frame, Id};

/// Result of handing a frame to full or free mailboxes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Offer {
    Taken,
    /// The frame took the place of this frame, which was not in transmission.
    Replaced(CanFrame),
    /// Full, and no pending frame has a lower priority.
    Refused,
}

#[derive(Debug, Clone, Copy)]
struct Pending {
    frame: CanFrame,
    rank: u32,
    order: u64,
    in_transmission: bool,
}

/// The three transmit mailboxes of a CAN controller.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mailboxes {
    slots: [Option<Pending>; 3],
    order: u64,
    /// The rank of the frame for the next arbitration.
    front: Option<u32>,
}

/// Returns the rank of a frame in an arbitration, the lowest first: the fields of the wire, from the id to the remote bit.
pub(crate) fn rank(frame: &CanFrame) -> u32 {
    let remote = u32::from(frame.is_remote_frame());
    match frame.id() {
        Id::Standard(id) => (u32::from(id.as_raw()) << 20) | remote,
        Id::Extended(id) => {
            let (base, rest) = (id.as_raw() >> 18, id.as_raw() & 0x3_FFFF);
            (base << 20) | (1 << 19) | (rest << 1) | remote
        }
    }
}

impl Pending {
    /// Returns the place among the frames of one node: frames of one rank in the order of arrival.
    const fn place(&self) -> (u32, u64) {
        (self.rank, self.order)
    }
}

impl Mailboxes {
    pub(crate) const fn new() -> Self {
        Self { slots: [None; 3], order: 0, front: None }
    }

    /// Takes a frame as `embedded_can::nb::Can::transmit` requires: frames of one id keep their order, and full
    /// mailboxes evict their lowest priority for a frame of strictly higher priority.
    pub(crate) fn offer(&mut self, frame: CanFrame) -> Offer {
        let rank = rank(&frame);
        let pending = Pending { frame, rank, order: self.order, in_transmission: false };
        if let Some(free) = self.slots.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(pending);
            self.order += 1;
            self.front = Some(self.front.map_or(rank, |front| front.min(rank)));
            return Offer::Taken;
        }
        // The last place: the lowest priority, and the youngest among equal ids.
        let lowest = self
            .slots
            .iter_mut()
            .flatten()
            .filter(|slot| !slot.in_transmission)
            .max_by_key(|slot| slot.place());
        match lowest {
            Some(slot) if rank < slot.rank => {
                let evicted = slot.frame;
                *slot = pending;
                self.order += 1;
                self.front = self.first();
                Offer::Replaced(evicted)
            }
            _ => Offer::Refused,
        }
    }

    /// Returns the frame for the next arbitration.
    pub(crate) fn candidate(&self) -> Option<&CanFrame> {
        self.next().map(|slot| &slot.frame)
    }

    /// Returns the rank of this frame, which each arbitration of the bus compares.
    pub(crate) const fn rank(&self) -> Option<u32> {
        self.front
    }

    fn first(&self) -> Option<u32> {
        self.slots.iter().flatten().map(|slot| slot.rank).min()
    }

    fn next(&self) -> Option<&Pending> {
        self.slots.iter().flatten().min_by_key(|slot| slot.place())
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.front.is_none()
    }

    pub(crate) fn has_room(&self) -> bool {
        self.slots.iter().any(Option::is_none)
    }

    /// Returns and marks the candidate: it can no longer be evicted.
    pub(crate) fn begin(&mut self) -> Option<CanFrame> {
        let slot = self.slots.iter_mut().flatten().min_by_key(|slot| slot.place())?;
        slot.in_transmission = true;
        Some(slot.frame)
    }

    /// Frees the mailbox of the frame in transmission.
    pub(crate) fn finish(&mut self) {
        for slot in &mut self.slots {
            if slot.is_some_and(|pending| pending.in_transmission) {
                *slot = None;
            }
        }
        self.front = self.first();
    }

    /// Treats the frame in transmission as pending.
    pub(crate) fn give_up(&mut self) {
        for slot in self.slots.iter_mut().flatten() {
            slot.in_transmission = false;
        }
    }

    /// Removes all frames except a frame in transmission.
    pub(crate) fn abort(&mut self) {
        for slot in &mut self.slots {
            if slot.is_some_and(|pending| !pending.in_transmission) {
                *slot = None;
            }
        }
        self.front = self.first();
    }

    /// Empties all mailboxes.
    pub(crate) fn clear(&mut self) {
        self.slots = [None; 3];
        self.front = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};

    fn frame(id: u16, tag: u8) -> CanFrame {
        CanFrame::standard(id, [tag; 8]).unwrap()
    }

    fn filled(ids: [u16; 3]) -> Mailboxes {
        let mut mailboxes = Mailboxes::new();
        for id in ids {
            assert_eq!(mailboxes.offer(frame(id, 0)), Offer::Taken);
        }
        mailboxes
    }

    fn sent(mailboxes: &mut Mailboxes) -> std::vec::Vec<CanFrame> {
        std::iter::from_fn(|| {
            let candidate = mailboxes.candidate().copied();
            mailboxes.begin();
            mailboxes.finish();
            candidate
        })
        .collect()
    }

    #[test]
    fn the_lowest_id_goes_first() {
        let mut mailboxes = filled([0x300, 0x100, 0x200]);
        let order = [frame(0x100, 0), frame(0x200, 0), frame(0x300, 0)];
        assert_eq!(sent(&mut mailboxes), order);
    }

    #[test]
    fn equal_ids_go_in_the_order_of_arrival() {
        let mut mailboxes = Mailboxes::new();
        let order = [frame(0x200, 1), frame(0x200, 2), frame(0x200, 3)];
        for frame in order {
            assert_eq!(mailboxes.offer(frame), Offer::Taken);
        }
        assert_eq!(mailboxes.offer(frame(0x200, 4)), Offer::Refused);
        assert_eq!(sent(&mut mailboxes), order);
    }

    #[test]
    fn a_higher_priority_evicts_the_lowest_and_an_equal_or_lower_priority_is_refused() {
        let mut mailboxes = filled([0x300, 0x100, 0x200]);
        assert_eq!(mailboxes.offer(frame(0x300, 1)), Offer::Refused);
        assert_eq!(mailboxes.offer(frame(0x301, 1)), Offer::Refused);
        assert_eq!(mailboxes.offer(frame(0x2FF, 1)), Offer::Replaced(frame(0x300, 0)));
        let order = [frame(0x100, 0), frame(0x200, 0), frame(0x2FF, 1)];
        assert_eq!(sent(&mut mailboxes), order);
    }

    #[test]
    fn of_equal_ids_the_youngest_is_evicted() {
        let mut mailboxes = Mailboxes::new();
        for tag in 1..=3 {
            assert_eq!(mailboxes.offer(frame(0x200, tag)), Offer::Taken);
        }
        assert_eq!(mailboxes.offer(frame(0x1FF, 9)), Offer::Replaced(frame(0x200, 3)));
        assert_eq!(sent(&mut mailboxes), [frame(0x1FF, 9), frame(0x200, 1), frame(0x200, 2)]);
    }

    #[test]
    fn a_frame_in_transmission_is_not_evicted_and_not_overtaken() {
        let mut mailboxes = filled([0x300, 0x300, 0x300]);
        mailboxes.begin();
        assert_eq!(mailboxes.offer(frame(0x100, 1)), Offer::Replaced(frame(0x300, 0)));
        assert_eq!(mailboxes.offer(frame(0x100, 2)), Offer::Replaced(frame(0x300, 0)));
        assert_eq!(mailboxes.offer(frame(0x100, 3)), Offer::Refused);
        assert_eq!(mailboxes.offer(frame(0x0FF, 4)), Offer::Replaced(frame(0x100, 2)));
        mailboxes.finish();
        assert_eq!(sent(&mut mailboxes), [frame(0x0FF, 4), frame(0x100, 1)]);
    }

    #[test]
    fn remote_loses_to_data_and_extended_to_standard_of_the_same_base() {
        let id = StandardId::new(0x200).unwrap();
        let remote = CanFrame::new_remote(id, 8).unwrap();
        let extended = CanFrame::new(ExtendedId::new(0x200 << 18).unwrap(), &[]).unwrap();
        let mut mailboxes = Mailboxes::new();
        for frame in [extended, remote, frame(0x200, 0)] {
            assert_eq!(mailboxes.offer(frame), Offer::Taken);
        }
        assert_eq!(sent(&mut mailboxes), [frame(0x200, 0), remote, extended]);
    }
}
