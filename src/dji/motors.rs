//! Motors of a bus in their slots, and the handles of motors.

use super::outbox::Outbox;
use super::slot::health::CheckRound;
use super::slot::{Key, Slot};
use super::{CommandFrame, Model};
use crate::frame::CanFrame;
use crate::motor::{DeviceGuard, Guarded, MotorGuard, TargetError};
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};
use core::marker::PhantomData;

/// The lowest feedback id, and the number of feedback ids: 0x201..=0x20B.
pub(super) const FIRST_FEEDBACK_ID: u32 = 0x201;
pub(super) const IDS: usize = 11;

/// All commands, and the feedback, lie from 0x1FE to 0x2FF.
const LOWEST_COMMAND_ID: u32 = CommandFrame::X1FE.id() as u32;
const COMMAND_IDS: u32 = CommandFrame::X2FF.id() as u32 - LOWEST_COMMAND_ID;

/// Tells whether the id of a frame is not of this family.
// Twice the header: the comparison then needs no mask for the bit of short frames.
#[inline(always)]
pub(super) const fn is_of_others(frame: &CanFrame) -> bool {
    (frame.header() << 1).wrapping_sub(LOWEST_COMMAND_ID << 1) > (COMMAND_IDS << 1 | 1)
}

/// Motors of a bus in their slots, and their common rules.
#[derive(Debug)]
// The slots first: their addresses then need no offset.
#[repr(C)]
pub(super) struct Motors<const N: usize> {
    pub(super) slots: [Slot; N],
    pub(super) guard: DeviceGuard<12>,
    pub(super) round: CheckRound,
    /// Updates without a usable time or step.
    pub(super) bad_steps: u32,
    /// The slot of each feedback id, from the lowest on; [`NOBODY`](Self::NOBODY) without a motor.
    ///
    /// Not used if there are as many slots as ids: each id then has the slot of its number.
    places: [u8; IDS],
    /// All slots from this one on are free.
    pub(super) used: u8,
}

impl Guarded for Slot {
    fn guard(&mut self) -> &mut MotorGuard {
        &mut self.guard
    }

    fn follow(&mut self) {
        self.apply_rules();
    }
}

impl<const N: usize> Motors<N> {
    pub(super) const NOBODY: u8 = u8::MAX;

    pub(super) const NONE: Self = Self {
        slots: [Slot::FREE; N],
        guard: DeviceGuard::NEW,
        round: CheckRound::NEW,
        bad_steps: 0,
        places: [Self::NOBODY; IDS],
        used: 0,
    };

    /// Returns the slot for a feedback id, counted from the lowest; an index beyond all slots if there is none.
    #[inline(always)]
    pub(super) const fn slot_of(&self, id_index: usize) -> usize {
        if N == IDS {
            return id_index;
        }
        match self.places.as_slice().split_at_checked(id_index) {
            Some((_, [place, ..])) => *place as usize,
            _ => Self::NOBODY as usize,
        }
    }

    /// Returns the present or future slot of a motor with this feedback id; `None` if all slots are taken.
    pub(super) const fn place_for(&self, id_index: usize) -> Option<u8> {
        let own = self.slot_of(id_index);
        if own < N {
            #[expect(clippy::cast_possible_truncation, reason = "below 11")]
            return Some(own as u8);
        }
        let (mut index, mut worn_out) = (0, None);
        let mut slots = self.slots.as_slice();
        while let [slot, rest @ ..] = slots {
            if slot.facts().is_none() {
                if slot.next_generation().is_some() {
                    return Some(index);
                }
                worn_out = Some(index);
            }
            (index, slots) = (index + 1, rest);
        }
        worn_out
    }

    /// Puts a motor into a slot.
    pub(super) const fn put(&mut self, id_index: usize, index: u8, motor: Slot) {
        if let Some((_, [here, ..])) = self.slots.split_at_mut_checked(index as usize) {
            *here = motor;
        }
        if let Some((_, [place, ..])) = self.places.split_at_mut_checked(id_index) {
            *place = index;
        }
        if self.used <= index {
            self.used = index + 1;
        }
    }

    /// Removes the motor of a slot from the list of ids.
    pub(super) fn forget(&mut self, index: u8) {
        self.guard.journal.forget(index);
        for place in &mut self.places {
            if *place == index {
                *place = Self::NOBODY;
            }
        }
    }

    #[inline]
    pub(super) fn get(&self, motor: Key) -> Option<&Slot> {
        self.slots.get(motor.index()).filter(|slot| slot.matches(motor))
    }

    #[inline]
    pub(super) fn get_mut(&mut self, motor: Key) -> Option<&mut Slot> {
        self.slots.get_mut(motor.index()).filter(|slot| slot.matches(motor))
    }

    /// Returns the slots up to the last slot in use.
    #[inline(always)]
    pub(super) fn taken_mut(&mut self) -> &mut [Slot] {
        self.slots.get_mut(..usize::from(self.used)).unwrap_or_default()
    }

    /// Returns the common rules, and the slots up to the last slot in use.
    pub(super) fn parts(&mut self) -> (&mut DeviceGuard<12>, &mut [Slot]) {
        let slots = self.slots.get_mut(..usize::from(self.used)).unwrap_or_default();
        (&mut self.guard, slots)
    }

    /// Iterates over the attached motors in the order of their feedback ids, with id and index of the slot.
    pub(super) fn by_id(&self) -> impl Iterator<Item = (u16, u8, &Slot)> {
        (0x201_u16..).zip(0..IDS).filter_map(|(id, id_index)| {
            let index = self.slot_of(id_index);
            let slot = self.slots.get(index).filter(|slot| slot.facts().is_some())?;
            Some((id, u8::try_from(index).ok()?, slot))
        })
    }

    /// Returns the number of attached motors.
    pub(super) const fn count(&self) -> u32 {
        let mut slots = self.slots.as_slice();
        let mut count = 0;
        while let [slot, rest @ ..] = slots {
            if slot.facts().is_some() {
                count += 1;
            }
            slots = rest;
        }
        count
    }

    /// Changes a slot; applies the rules to the result and notes edges and trips.
    pub(super) fn change<T>(
        &mut self,
        index: u8,
        now: Instant,
        change: impl FnOnce(&mut Slot) -> T,
    ) -> Option<T> {
        let slot = self.slots.get_mut(usize::from(index))?;
        Some(self.guard.change(slot, index, now, change))
    }

    /// Sets a target.
    pub(super) fn set(
        &mut self,
        motor: Key,
        set: impl FnOnce(&mut Slot, u32) -> Result<(), TargetError>,
    ) -> Result<(), TargetError> {
        let now = self.guard.now();
        set(self.get_mut(motor).ok_or(TargetError::Detached)?, now)
    }

    /// Sets a target by `renew`, or by `set` if `renew` returns `false`.
    #[inline(always)]
    pub(super) fn renew(
        &mut self,
        motor: Key,
        renew: impl FnOnce(&mut Slot, u32) -> bool,
        set: impl FnOnce(&mut Slot, u32) -> Result<(), TargetError>,
    ) -> Result<(), TargetError> {
        let now = self.guard.now();
        let Some(slot) = self.slots.get_mut(motor.index()) else {
            return Err(TargetError::Detached);
        };
        if renew(slot, now) {
            return Ok(());
        }
        if slot.matches(motor) { set(slot, now) } else { Err(TargetError::Detached) }
    }

    /// [Changes](Self::change) a motor at the time of the present update.
    pub(super) fn change_present(
        &mut self,
        motor: Key,
        change: impl FnOnce(&mut Slot) -> Result<(), TargetError>,
    ) -> Result<(), TargetError> {
        self.get(motor).ok_or(TargetError::Detached)?;
        let changed = self.change(motor.place(), self.guard.updated(), change);
        changed.unwrap_or(Err(TargetError::Detached))
    }

    /// Sets the remaining way and the rate of a motor, both measured by another sensor at the time `at`.
    pub(super) fn set_measured(
        &mut self,
        motor: Key,
        way: Angle,
        velocity: AngularVelocity,
        at: Instant,
    ) -> Result<(), TargetError> {
        let stamp = self.guard.stamp_of_measurement(at);
        self.change_present(motor, |slot| {
            slot.set_measured(way.as_radians(), velocity.as_rad_per_s(), stamp)
        })?;
        // A measured target expires sooner than others.
        self.guard.disturb();
        Ok(())
    }

    /// Scales the command of a motor by a factor; see [`Bus::scale_outputs`](super::Bus::scale_outputs).
    pub(super) fn scale_output(&mut self, outbox: &mut Outbox, motor: Key, factor: f32) {
        let Some(slot) = self.get_mut(motor) else { return };
        let before = outbox.get(slot.place);
        let after = cut(before, factor);
        if after != before {
            outbox.put(slot.place, after);
            // Meanwhile the loop must not wind up.
            let passed = slot.in_units(after).abs();
            slot.speed_loop_mut().keep_integral_between(-passed, passed);
        }
    }
}

/// Returns the command scaled by a factor: never larger than before, never of the other sign.
const fn cut(raw: i16, factor: f32) -> i16 {
    if factor >= 1.0 {
        return raw;
    }
    if factor > 0.0 {
        #[expect(clippy::cast_possible_truncation, reason = "rounds towards zero, within raw")]
        let less = (raw as f32 * factor) as i16;
        return less;
    }
    0
}

/// Names a motor of a bus: one byte, `Copy`, with the model as a type.
///
/// `B` is the brand of the bus ([`Bus::branded`](super::Bus::branded)); handles of differently branded buses do not mix. A handle of a
/// detached motor finds nothing, even after another motor took its place.
pub struct Handle<M: Model, B = ()> {
    key: Key,
    brand: PhantomData<fn() -> (M, B)>,
}

/// Names a motor of any model: for logging, tuning and all functions common to the models.
pub struct AnyHandle<B = ()> {
    key: Key,
    brand: PhantomData<fn() -> B>,
}

impl<M: Model, B> Handle<M, B> {
    pub(super) const fn new(key: Key) -> Self {
        Self { key, brand: PhantomData }
    }

    /// Forgets the model.
    #[must_use]
    pub const fn erase(self) -> AnyHandle<B> {
        AnyHandle::new(self.key)
    }
}

impl<B> AnyHandle<B> {
    pub(super) const fn new(key: Key) -> Self {
        Self { key, brand: PhantomData }
    }

    pub(super) const fn key(self) -> Key {
        self.key
    }
}

impl<M: Model, B> From<Handle<M, B>> for AnyHandle<B> {
    fn from(handle: Handle<M, B>) -> Self {
        handle.erase()
    }
}

impl<M: Model, B> Clone for Handle<M, B> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Model, B> Copy for Handle<M, B> {}
impl<M: Model, B> PartialEq for Handle<M, B> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}
impl<M: Model, B> Eq for Handle<M, B> {}
impl<M: Model, B> core::fmt::Debug for Handle<M, B> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Handle({} in slot {})", M::FACTS.name, self.key.index())
    }
}

impl<B> Clone for AnyHandle<B> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<B> Copy for AnyHandle<B> {}
impl<B> PartialEq for AnyHandle<B> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}
impl<B> Eq for AnyHandle<B> {}
impl<B> core::fmt::Debug for AnyHandle<B> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "AnyHandle(slot {})", self.key.index())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nothing_is_raised_or_turned_around(raw in any::<i16>(), factor in any::<f32>()) {
            let after = cut(raw, factor);
            prop_assert!(after.unsigned_abs() <= raw.unsigned_abs(), "{raw} {factor} {after}");
            prop_assert!(after == 0 || (after < 0) == (raw < 0), "{raw} {factor} {after}");
        }

        #[test]
        fn what_is_left_is_the_share_to_a_count(raw in any::<i16>(), factor in 0.0_f32..1.0) {
            let share = f32::from(raw) * factor;
            prop_assert!((f32::from(cut(raw, factor)) - share).abs() <= 1.0);
        }
    }

    #[test]
    fn a_factor_that_is_no_share_takes_all_or_nothing() {
        for factor in [f32::NAN, f32::NEG_INFINITY, -1.0, -0.0, 0.0] {
            assert_eq!(cut(-12_345, factor), 0);
        }
        for factor in [1.0, 1.5, f32::INFINITY] {
            assert_eq!((cut(-12_345, factor), cut(i16::MIN, factor)), (-12_345, i16::MIN));
        }
    }
}
