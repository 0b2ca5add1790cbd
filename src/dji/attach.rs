//! Who joins and leaves a bus.

use super::bus::FIRST_FEEDBACK_ID;
use super::command::Place;
use super::config::PlainConfig;
use super::handle::Key;
use super::slot::Slot;
use super::{AnyHandle, AttachError, Bus, Config, Facts, Handle, Model};
use crate::motor::MotorName;

impl<B> Bus<B> {
    /// Attaches a motor.
    ///
    /// # Errors
    /// When its id is out of range, another motor uses its feedback id or command slot, a parameter of the
    /// configuration is not usable, or the bus would be loaded beyond its
    /// [ceiling](Self::with_load_ceiling). The bus is then as it was.
    pub const fn attach<M: Model>(
        &mut self,
        config: Config<M>,
    ) -> Result<Handle<M, B>, AttachError> {
        match self.attach_plain(M::FACTS, &config.plain) {
            Ok(key) => Ok(Handle::new(key)),
            Err(error) => Err(error),
        }
    }

    const fn attach_plain(
        &mut self,
        facts: &'static Facts,
        config: &PlainConfig,
    ) -> Result<Key, AttachError> {
        let motor = MotorName::new(facts.name, config.id);
        let Some((frame, slot)) = facts.place(config.id) else {
            return Err(AttachError::Id { motor, highest: facts.ids });
        };
        let feedback_id = facts.feedback_base + config.id as u16;
        let index = feedback_id as usize - FIRST_FEEDBACK_ID as usize;
        let Some((_, [here, ..])) = self.slots.split_at_checked(index) else {
            return Err(AttachError::Id { motor, highest: facts.ids });
        };
        let place = Place::new(frame, slot);
        if let Some(with) = here.name() {
            let slot = if here.place.same_as(place) { Some((frame, slot)) } else { None };
            return Err(AttachError::Collision { motor, with, feedback_id, slot });
        }
        let Some(generation) = here.next_generation() else {
            return Err(AttachError::WornOut { motor });
        };
        let new = match Slot::new(facts, config, place, generation) {
            Ok(slot) => slot,
            Err(error) => return Err(error),
        };
        if let Some((load, ceiling_percent, feedback_hz)) = self.overload(frame) {
            return Err(AttachError::Load { motor, load, ceiling_percent, feedback_hz });
        }
        if let Some((_, [here, ..])) = self.slots.split_at_mut_checked(index) {
            *here = new;
        }
        self.outbox.open(frame);
        #[expect(clippy::cast_possible_truncation, reason = "below 11")]
        let index = index as u8;
        if self.used <= index {
            self.used = index + 1;
        }
        Ok(Key::new(index, generation))
    }

    /// Attaches several motors of one model.
    ///
    /// # Errors
    /// The first error; the bus is then as it was.
    pub fn attach_all<M: Model, const N: usize>(
        &mut self,
        configs: [Config<M>; N],
    ) -> Result<[Handle<M, B>; N], AttachError> {
        let outbox = self.outbox;
        let mut failed = None;
        let handles = configs.map(|config| {
            self.attach(config).unwrap_or_else(|error| {
                failed.get_or_insert(error);
                Handle::new(Key::NONE)
            })
        });
        match failed {
            None => Ok(handles),
            Some(error) => {
                for handle in handles {
                    if let Some(slot) = self.slot_mut(handle.into()) {
                        slot.withdraw();
                    }
                }
                self.outbox = outbox;
                Err(error)
            }
        }
    }

    /// Detaches a motor. Its command slot is sent as zero once more, then the frame stops when nobody else uses it.
    pub fn detach(&mut self, motor: impl Into<AnyHandle<B>>) {
        let motor = motor.into();
        let Some(slot) = self.slot_mut(motor) else { return };
        let place = slot.place;
        slot.free();
        self.guard.journal_mut().forget(motor.key().place());
        self.outbox.put(place, 0);
        let shared = self
            .slots
            .iter()
            .any(|slot| slot.facts().is_some() && slot.place.frame() == place.frame());
        if !shared {
            self.outbox.close(place.frame());
        }
    }

    /// Iterates over the attached motors, in the order of their feedback ids.
    pub fn motors(&self) -> impl Iterator<Item = (AnyHandle<B>, MotorName)> + '_ {
        (0..).zip(&self.slots).filter_map(|(index, slot)| {
            let key = Key::new(index, slot.next_generation()?);
            Some((AnyHandle::new(key), slot.name()?))
        })
    }

    /// Returns id and mask for a hardware filter that lets all attached motors' feedback through.
    ///
    /// A frame passes when `frame id & mask == id & mask`. A mask cannot name any set of ids exactly, so a few
    /// others may pass too. Without motors nothing but 0x7FF passes.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// let mut bus = Bus::new();
    /// bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new))?;
    /// assert_eq!(bus.acceptance_filter(), (0x200, 0x7F8)); // 0x201..=0x204 need three open bits
    /// # Ok::<(), drivetrain::dji::AttachError>(())
    /// ```
    #[must_use]
    pub fn acceptance_filter(&self) -> (u16, u16) {
        let ids = || {
            self.slots
                .iter()
                .zip(0x201_u16..)
                .filter(|(slot, _)| slot.facts().is_some())
                .map(|(_, id)| id)
        };
        let Some(first) = ids().next() else { return (0x7FF, 0x7FF) };
        let differing = ids().fold(0, |bits, id| bits | (id ^ first));
        let open = if differing == 0 { 0 } else { u16::MAX >> differing.leading_zeros() };
        (first & !open, 0x7FF & !open)
    }
}
