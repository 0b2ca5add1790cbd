//! Checks of one motor a tick, in rounds.

use super::CommandFrame;
use super::command::Outbox;
use super::motors::{IDS, Motors};
use super::slot::{Surroundings, health};
use crate::motor::{Edge, Rival, Traffic, elapsed};
use crate::time::Instant;

/// The motor to check next, and the times of the round.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rounds {
    /// Begin of the present counting window.
    window_from: u32,
    /// Time of the last command frame of another node.
    rival_heard: u32,
    /// Begin of the present round.
    begun: u32,
    /// The rate of each motor's feedback, as configured.
    pub(super) feedback_hz: u32,
    /// The length of the window that ends in this round, in units of 1.024 ms.
    window: u16,
    /// The length of the previous round.
    pub(super) elapsed: u8,
    /// Place of the motor to check next; in a round that ends a window, beyond [`CLOSING`](Self::CLOSING).
    pub(super) next: u8,
    has_begun: bool,
    /// Whether sent frames are received again.
    pub(super) echoes: bool,
}

impl Rounds {
    pub(super) const NEW: Self = Self {
        window_from: 0,
        rival_heard: 0,
        begun: 0,
        feedback_hz: 1_000,
        window: 0,
        elapsed: 0,
        next: 0,
        has_begun: false,
        echoes: false,
    };

    /// In a round that ends a window, each motor is checked in full: no slot has such a number, so the quick check is skipped.
    const CLOSING: u8 = 0x80;

    /// Returns the length of the window that ends in this round; `None` if no window ends.
    const fn window(&self) -> Option<u16> {
        if self.next & Self::CLOSING != 0 { Some(self.window) } else { None }
    }

    /// Begins a new round: one tick for each place, and one for this call.
    fn begin(&mut self, now: u32) {
        self.elapsed = elapsed(Some(now.wrapping_sub(self.begun)));
        self.begun = now;
        let elapsed = now.wrapping_sub(self.window_from);
        let closes_window = self.has_begun && u64::from(elapsed) >= Traffic::WINDOW.as_micros();
        self.next = if closes_window { Self::CLOSING } else { 0 };
        if closes_window || !self.has_begun {
            self.window = u16::try_from(elapsed >> 10).unwrap_or(u16::MAX);
            self.window_from = now;
            self.has_begun = true;
        }
    }
}

/// Checks a motor in a round that ends a window, or begins a round.
#[cold]
#[inline(never)]
pub(super) fn check_without_slot<const N: usize>(motors: &mut Motors<N>, outbox: &Outbox) {
    let index = motors.rounds.next & !Rounds::CLOSING;
    match motors.slots.get(usize::from(index)) {
        Some(slot) => {
            let word = outbox.get(slot.place);
            motors.rounds.next += 1;
            check(motors, index, word);
        }
        // A round has a turn for each id: it takes the same time on every bus.
        None if usize::from(index) < IDS => motors.rounds.next += 1,
        None => motors.rounds.begin(motors.guard.now()),
    }
}

/// Checks a motor in full.
#[inline(never)]
pub(super) fn check<const N: usize>(motors: &mut Motors<N>, index: u8, word: i16) {
    let now = motors.guard.now();
    let seen = Surroundings {
        now,
        elapsed: motors.rounds.elapsed,
        word,
        window: motors.rounds.window(),
        feedback_hz: motors.rounds.feedback_hz,
        is_alone: u64::from(now.wrapping_sub(motors.rounds.rival_heard))
            > Rival::FORGOTTEN.as_micros(),
    };
    motors.change(index, motors.guard.updated(), |slot| health::check(slot, &seen));
}

/// Takes a frame of another node that may be a command of this bus.
pub(super) fn hear_command<const N: usize>(
    motors: &mut Motors<N>,
    outbox: &Outbox,
    id: u32,
    now: Instant,
) {
    let Some(frame) = CommandFrame::with_id(id) else { return };
    if motors.rounds.echoes || !outbox.is_in_use(frame) {
        return;
    }
    motors.rounds.rival_heard = now.stamp();
    motors.change_all(now, |slot| {
        if slot.facts().is_some() && slot.place.frame() == frame {
            health::hear_rival(slot);
        }
    });
}

/// Takes the oldest unread edge.
#[inline(never)]
pub(super) fn take_edge<const N: usize>(motors: &mut Motors<N>) -> Option<Edge> {
    let updated = motors.guard.updated();
    while let Some(entry) = motors.guard.journal_mut().pop() {
        let at = motors.guard.journal().time_of(&entry, updated);
        let Some(slot) = motors.slots.get_mut(usize::from(entry.motor)) else { continue };
        let Some(motor) = slot.name() else { continue };
        let (condition, began) = (entry.condition, entry.began);
        if slot.guard.latch_mut().take(condition, began) {
            return Some(Edge { motor, condition, began, at });
        }
    }
    let at = motors.guard.journal().last_time(updated);
    let edge = motors.slots.iter_mut().find_map(|slot| {
        let motor = slot.name()?;
        let (condition, began) = slot.guard.latch().next()?;
        slot.guard.latch_mut().take(condition, began);
        Some(Edge { motor, condition, began, at })
    });
    if edge.is_none() {
        motors.guard.journal_mut().clear();
    }
    edge
}
