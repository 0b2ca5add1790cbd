use super::{Condition, Conditions, HealthConfig};
use crate::motor::{MotorName, Severity};
use crate::time::{Edge, Instant};

impl<C: core::fmt::Display> core::fmt::Display for Edge<C, MotorName> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { source, condition, began, at } = self;
        write!(f, "{source}: {}", Edge { source: (), condition, began: *began, at: *at })
    }
}

/// Conditions of a motor, and their unread changes.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Latch {
    active: Conditions,
    began: Conditions,
    ended: Conditions,
}

impl Latch {
    pub(crate) const NONE: Self =
        Self { active: Conditions::NONE, began: Conditions::NONE, ended: Conditions::NONE };

    /// Returns the conditions that hold now.
    pub(crate) const fn active(&self) -> Conditions {
        self.active
    }

    pub(crate) const fn has(&self, condition: Condition) -> bool {
        self.active.contains(condition)
    }

    /// Sets whether a condition holds. A change is latched until read.
    pub(crate) const fn set(&mut self, condition: Condition, holds: bool) {
        if self.active.contains(condition) == holds {
            return;
        }
        if holds {
            self.active = self.active.with(condition);
            self.began = self.began.with(condition);
        } else {
            self.active = self.active.without(condition);
            self.ended = self.ended.with(condition);
        }
    }

    /// Ends conditions in an update with a usable step: lost time; an expired target, if there is a new one; a second master, if no other node
    /// commands the device.
    pub(crate) const fn end_what_is_over(&mut self, has_target: bool, is_alone: bool) {
        if has_target {
            self.set(Condition::CommandLost, false);
        }
        self.set(Condition::ClockFault, false);
        if is_alone {
            self.set(Condition::SecondMaster, false);
        }
    }

    /// Sets the error reported by an ESC. Another code of the same severity begins the condition again.
    pub(crate) fn report(&mut self, error: Option<Severity>, changed: bool, config: &HealthConfig) {
        for (condition, severity) in
            [(Condition::Warning, Severity::Warning), (Condition::Fault, Severity::Fault)]
        {
            let holds = error == Some(severity) && !config.ignores(condition);
            self.set(condition, holds);
            if holds && changed {
                self.began = self.began.with(condition);
            }
        }
    }

    /// Removes an unread change; `false` if there is no such change.
    pub(crate) const fn take(&mut self, condition: Condition, began: bool) -> bool {
        let waiting = if began { &mut self.began } else { &mut self.ended };
        let waits = waiting.contains(condition);
        *waiting = waiting.without(condition);
        waits
    }

    /// Returns an unread change. If a condition both began and ended, the earlier change comes first.
    pub(crate) fn next(&self) -> Option<(Condition, bool)> {
        let condition = self.began.or(self.ended).iter().next()?;
        let both = self.began.contains(condition) && self.ended.contains(condition);
        let began = if both { !self.has(condition) } else { self.began.contains(condition) };
        Some((condition, began))
    }

    /// Returns the unread changes that were not unread `before`.
    pub(crate) fn news(&self, before: &Self) -> impl Iterator<Item = (Condition, bool)> + use<> {
        let began = self.began.minus(before.began).iter().map(|condition| (condition, true));
        let ended = self.ended.minus(before.ended).iter().map(|condition| (condition, false));
        began.chain(ended)
    }
}

/// A motor with conditions.
pub(crate) trait Latched {
    fn latch(&mut self) -> &mut Latch;
}

/// Times of the unread changes in the order of detection, as long as there is room.
///
/// A change without room, and each one after it until all are read, stays latched: only its time and its place in the order are lost.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Journal<const N: usize> {
    at: [u32; N],
    /// Motor, condition, and whether the condition began.
    what: [u16; N],
    first: u8,
    length: u8,
    /// Whether a change found no room since all changes were last read.
    is_overfull: bool,
    /// Time of the last entry written.
    last: u32,
}

/// An entry of a [`Journal`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) motor: u8,
    pub(crate) condition: Condition,
    pub(crate) began: bool,
    at: u32,
}

impl<const N: usize> Journal<N> {
    pub(crate) const EMPTY: Self =
        Self { at: [0; N], what: [0; N], first: 0, length: 0, is_overfull: false, last: 0 };

    /// Notes the changes of a motor since `before`.
    #[inline]
    pub(crate) fn note(&mut self, motor: u8, before: &Latch, after: &Latch, now: Instant) {
        if before != after {
            self.note_changes(motor, before, after, now);
        }
    }

    #[cold]
    #[inline(never)]
    fn note_changes(&mut self, motor: u8, before: &Latch, after: &Latch, now: Instant) {
        for (condition, began) in after.news(before) {
            self.push(motor, condition, began, coarse(now));
        }
    }

    fn push(&mut self, motor: u8, condition: Condition, began: bool, at: u32) {
        let index = self.index(self.length);
        // Until all are read: an entry now would be read before the changes without one.
        if self.is_overfull || usize::from(self.length) >= N {
            self.is_overfull = true;
            return;
        }
        if let (Some(time), Some(what)) = (self.at.get_mut(index), self.what.get_mut(index)) {
            *time = at;
            *what = u16::from(motor) << 8 | (condition as u16) << 1 | u16::from(began);
            self.length += 1;
            self.last = at;
        }
    }

    /// Tells whether all changes are read, those without an entry too.
    #[inline]
    pub(crate) const fn is_empty(&self) -> bool {
        self.length == 0 && !self.is_overfull
    }

    /// Takes the oldest unread edge of the motors, with the name of its motor.
    pub(crate) fn next_edge<M: Latched>(
        &mut self,
        motors: &mut [M],
        now: Instant,
        name: impl Fn(&M) -> Option<MotorName>,
    ) -> Option<Edge<Condition, MotorName>> {
        while let Some(Entry { motor, condition, began, at }) = self.pop() {
            let Some(motor) = motors.get_mut(usize::from(motor)) else { continue };
            if motor.latch().take(condition, began) {
                return Some(Edge { source: name(motor)?, condition, began, at: fine(at, now) });
            }
        }
        let at = self.last_time(now);
        for motor in motors {
            if let Some((condition, began)) = motor.latch().next() {
                motor.latch().take(condition, began);
                return Some(Edge { source: name(motor)?, condition, began, at });
            }
        }
        self.is_overfull = false;
        None
    }

    /// Takes the oldest entry.
    fn pop(&mut self) -> Option<Entry> {
        if self.length == 0 {
            return None;
        }
        let index = usize::from(self.first);
        let (at, what) = (*self.at.get(index)?, *self.what.get(index)?);
        self.first = u8::try_from(self.index(1)).unwrap_or(0);
        self.length -= 1;
        let [motor, rest] = what.to_be_bytes();
        let condition = *Condition::ALL.get(usize::from(rest >> 1))?;
        Some(Entry { motor, condition, began: rest & 1 != 0, at })
    }

    /// Forgets the entries of a detached motor.
    pub(crate) fn forget(&mut self, motor: u8) {
        for what in &mut self.what {
            if *what >> 8 == u16::from(motor) {
                *what |= 0xFF00;
            }
        }
    }

    /// Returns the time of the last entry: changes without an entry came later.
    pub(crate) fn last_time(&self, now: Instant) -> Instant {
        fine(self.last, now)
    }

    /// Returns the place `ahead` of the oldest entry.
    fn index(&self, ahead: u8) -> usize {
        let index = usize::from(self.first) + usize::from(ahead);
        if index >= N { index - N } else { index }
    }
}

/// Time in units of 1024 µs: a shift, whereas milliseconds need a 64-bit division.
#[expect(clippy::cast_possible_truncation, reason = "ages are told by wrapping difference")]
const fn coarse(now: Instant) -> u32 {
    (now.as_micros() >> 10) as u32
}

/// Returns a time, seen from a `now` that may lie a little before it: exact to 1.024 ms, up to an age of 25 days.
fn fine(at: u32, now: Instant) -> Instant {
    let age = i64::from(coarse(now).wrapping_sub(at).cast_signed()) << 10;
    let rounded = now.as_micros() & !1023;
    Instant::from_micros(rounded.saturating_add_signed(-age))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;
    use proptest::prelude::*;
    use std::collections::BTreeSet;
    use std::string::ToString;

    const NOW: Instant = Instant::from_micros(5_000_000);

    #[test]
    fn a_change_waits_once_however_often_it_comes() {
        let mut latch = Latch::NONE;
        for _ in 0..1_000 {
            latch.set(Condition::Fault, true);
            latch.set(Condition::Fault, false);
        }
        assert_eq!(latch.next(), Some((Condition::Fault, true)));
        assert!(latch.take(Condition::Fault, true) && !latch.take(Condition::Fault, true));
        assert_eq!(latch.next(), Some((Condition::Fault, false)));
        assert!(latch.take(Condition::Fault, false));
        assert_eq!((latch.next(), latch.active()), (None, Conditions::NONE));
    }

    #[test]
    fn what_ended_and_began_again_is_read_in_that_order() {
        let mut latch = Latch::NONE;
        latch.set(Condition::Late, true);
        assert!(latch.take(Condition::Late, true));
        latch.set(Condition::Late, false);
        latch.set(Condition::Late, true);
        assert_eq!(latch.next(), Some((Condition::Late, false)));
        latch.take(Condition::Late, false);
        assert_eq!(latch.next(), Some((Condition::Late, true)));
    }

    #[test]
    fn the_journal_keeps_the_order_and_the_times_that_it_has_room_for() {
        let mut journal = Journal::<4>::EMPTY;
        for (millis, condition) in (0..).zip(Condition::ALL) {
            let mut after = Latch::NONE;
            after.set(condition, true);
            journal.note(
                7,
                &Latch::NONE,
                &after,
                Instant::from_micros(1_000_000 + millis * 10_000),
            );
        }
        for (millis, expected) in (0..4_u64).zip(Condition::ALL) {
            let entry = journal.pop().unwrap();
            assert_eq!((entry.motor, entry.began), (7, true));
            assert_eq!(entry.condition, expected);
            let off = Instant::from_micros(1_000_000 + millis * 10_000).since(fine(entry.at, NOW));
            assert!(off < Duration::from_micros(1_024));
        }
        assert_eq!(journal.pop(), None);
        let last = journal.last_time(NOW).as_micros();
        assert!((1_028_000..=1_030_000).contains(&last), "{last}");
    }

    #[test]
    fn a_time_of_24_days_ago_is_still_told_and_one_that_lies_ahead_is_too() {
        let mut journal = Journal::<1>::EMPTY;
        let mut after = Latch::NONE;
        after.set(Condition::Hot, true);
        let start = Instant::from_micros(1 << 40);
        journal.note(0, &Latch::NONE, &after, start);
        let entry = journal.pop().unwrap();
        for later in
            [start + Duration::from_secs(24 * 86_400), Instant::from_micros((1 << 40) - 900)]
        {
            assert_eq!(fine(entry.at, later), start);
        }
    }

    /// Two motors and room for one: late and heard again without room, and late once more when the first edge is read.
    #[test]
    fn a_change_is_read_behind_those_that_found_no_room_before() {
        let mut journal = Journal::<1>::EMPTY;
        let mut motors = [1, 2].map(|id| One(MotorName::new("one", id), Latch::NONE));
        let set = |journal: &mut Journal<1>, motors: &mut [One; 2], motor: u8, holds| {
            let latch = &mut motors[usize::from(motor)].1;
            let before = *latch;
            latch.set(Condition::Late, holds);
            journal.note(motor, &before, latch, NOW);
        };
        assert!(journal.is_empty());
        set(&mut journal, &mut motors, 0, true);
        set(&mut journal, &mut motors, 1, true);
        let read = |journal: &mut Journal<1>, motors: &mut [One; 2]| {
            let edge = journal.next_edge(motors, NOW, |motor| Some(motor.0))?;
            Some((edge.source.id() - 1, edge.began))
        };
        assert_eq!(read(&mut journal, &mut motors), Some((0, true)));
        assert!(!journal.is_empty(), "the other has no time, and is not read yet");
        set(&mut journal, &mut motors, 1, false);
        let rest = core::array::from_fn(|_| read(&mut journal, &mut motors));
        assert_eq!(rest, [Some((1, true)), Some((1, false)), None]);
        set(&mut journal, &mut motors, 1, true);
        assert_eq!(read(&mut journal, &mut motors), Some((1, true)), "room again");
    }

    #[test]
    fn an_edge_names_its_motor() {
        let source = MotorName::new("fan", 3);
        let edge = Edge { source, condition: Condition::Late, began: true, at: NOW };
        let of_nobody = Edge { source: (), condition: Condition::Late, began: true, at: NOW };
        assert_eq!(edge.to_string(), std::format!("{source}: {of_nobody}"));
    }

    struct One(MotorName, Latch);

    impl Latched for One {
        fn latch(&mut self) -> &mut Latch {
            &mut self.1
        }
    }

    #[test]
    fn what_a_motor_left_behind_is_no_other_motors() {
        let mut journal = Journal::<4>::EMPTY;
        let mut after = Latch::NONE;
        after.set(Condition::Hot, true);
        journal.note(1, &Latch::NONE, &after, NOW);
        journal.note(2, &Latch::NONE, &after, NOW);
        journal.forget(1);
        assert_eq!(
            [journal.pop(), journal.pop()].map(|e| e.map(|e| e.motor)),
            [Some(255), Some(2)]
        );
    }

    proptest! {
        /// Law: for any changes and any times of reading, each kind of change since its last reading is read exactly once more, and after all reads no
        /// edge waits.
        #[test]
        fn no_change_is_lost_and_none_is_told_twice(
            steps in proptest::collection::vec((0_usize..3, 0_usize..4, any::<bool>(), 0_u8..6), 1..300),
        ) {
            let mut motors = [0, 1, 2].map(|id| One(MotorName::new("one", id), Latch::NONE));
            let mut journal = Journal::<4>::EMPTY;
            let mut expected = BTreeSet::new();
            let read = |motors: &mut [One; 3], journal: &mut Journal<4>, expected: &mut BTreeSet<_>| {
                let edge = journal.next_edge(motors, NOW, |motor| Some(motor.0))?;
                Some(expected.remove(&(edge.source.id(), edge.condition as usize, edge.began)))
            };
            for (motor, condition, holds, reads) in steps {
                let (before, kind) = (motors[motor].1, Condition::ALL[condition]);
                motors[motor].1.set(kind, holds);
                let id = u8::try_from(motor).unwrap();
                if before.has(kind) != holds {
                    expected.insert((id, condition, holds));
                }
                journal.note(id, &before, &motors[motor].1, NOW);
                for _ in 0..reads {
                    prop_assert!(read(&mut motors, &mut journal, &mut expected) != Some(false));
                }
            }
            while let Some(is_expected) = read(&mut motors, &mut journal, &mut expected) {
                prop_assert!(is_expected);
            }
            prop_assert!(expected.is_empty(), "lost: {expected:?}");
        }
    }
}
