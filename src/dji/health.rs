//! What is wrong with the motors of a bus.

use super::bus::Bus;
use super::slot::{Look, Slot};
use super::{AnyHandle, CommandFrame};
use crate::frame::CanFrame;
use crate::motor::{Claim, Condition, Conditions, Edge, Health, Role, elapsed};
use crate::time::Instant;

/// Feedback frames are counted for this long, in µs.
const WINDOW_US: u32 = 1_000_000;

/// So long after another node sent a command frame it is forgotten, in µs.
const RIVAL_FORGOTTEN_US: u32 = 1_000_000;

/// Where the checks are that look at one motor a tick, and what they share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rounds {
    /// When the present window of counting began.
    window_from: u32,
    /// When another node sent a command frame last.
    rival_heard: u32,
    /// When the present round began.
    begun: u32,
    /// The length of the window that ends in this round, in units of 1.024 ms.
    window: u16,
    /// The length of the round before.
    elapsed: u8,
    /// Whose turn it is; in a round that ends a window, beyond [`CLOSING`](Self::CLOSING).
    pub(super) next: u8,
    has_begun: bool,
    /// Frames that are sent are heard again.
    echoes: bool,
}

impl Rounds {
    pub(super) const NEW: Self = Self {
        window_from: 0,
        rival_heard: 0,
        begun: 0,
        window: 0,
        elapsed: 0,
        next: 0,
        has_begun: false,
        echoes: false,
    };

    /// In a round that ends a window each motor is looked at closely: no slot has such a number, so nobody asks for it.
    const CLOSING: u8 = 0x80;

    /// Returns the length of the window that ends in this round, if one does.
    const fn window(&self) -> Option<u16> {
        if self.next & Self::CLOSING != 0 { Some(self.window) } else { None }
    }

    /// A new round begins: one tick for each place, and one for this.
    fn begin(&mut self, now: u32) {
        self.elapsed = elapsed(Some(now.wrapping_sub(self.begun)));
        self.begun = now;
        let elapsed = now.wrapping_sub(self.window_from);
        let closes_window = self.has_begun && elapsed >= WINDOW_US;
        self.next = if closes_window { Self::CLOSING } else { 0 };
        if closes_window || !self.has_begun {
            self.window = u16::try_from(elapsed >> 10).unwrap_or(u16::MAX);
            self.window_from = now;
            self.has_begun = true;
        }
    }
}

/// Health: what is wrong with each motor, and every change of it.
impl<B> Bus<B> {
    /// Says that the driver hands back the frames that it sent, so that a command frame that is received is no sign of a
    /// second master. None is looked for then.
    #[must_use]
    pub const fn with_loopback(mut self) -> Self {
        self.rounds.echoes = true;
        self
    }

    /// Returns how a motor is; `None` once it is detached.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::time::Instant;
    ///
    /// let mut bus = Bus::new();
    /// let wheel = bus.attach(Config::<M3508>::new(2))?;
    /// bus.ingest_raw(0x202, &[0, 0, 0, 0, 0, 0, 131, 8], Instant::from_micros(1_000));
    /// let health = bus.health(wheel).ok_or("detached")?;
    /// assert_eq!(
    ///     health.to_string(),
    ///     "M3508 #2: online, disarmed, ESC warning; 0 Hz, gap 0 us, 131 C, error 8; saturated 0, refused 0, forgotten 0, ambiguous 0",
    /// );
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn health(&self, motor: impl Into<AnyHandle<B>>) -> Option<Health> {
        self.slot(motor.into())?.health()
    }

    /// Returns what is wrong with a motor; nothing once it is detached.
    #[must_use]
    pub fn conditions(&self, motor: impl Into<AnyHandle<B>>) -> Conditions {
        self.slot(motor.into()).map_or(Conditions::NONE, |slot| slot.guard.latch().active())
    }

    /// Returns the oldest change of a motor's condition that was not read yet.
    ///
    /// None is lost, however late it is read; while it waits, the same change is not noted again. Beyond 12 that wait,
    /// the order of the later ones is that of the motors.
    ///
    /// Costs 6 instructions on a Cortex-M4F, when none waits (`docs/figures.md`).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::motor::Condition;
    /// use drivetrain::time::{Instant, Tick};
    ///
    /// let mut bus = Bus::new();
    /// let wheel = bus.attach(Config::<M3508>::new(2))?;
    /// bus.ingest_raw(0x202, &[0; 8], Instant::from_micros(1_000));
    /// for millis in 1..20 {
    ///     bus.update(Tick::new(Instant::from_micros(millis * 1_000), 0.001));
    /// }
    /// let edge = bus.next_edge().ok_or("nothing happened")?;
    /// assert_eq!((edge.motor.id(), edge.condition, edge.began), (2, Condition::Late, true));
    /// assert_eq!(edge.at.as_micros() / 1_024, 12_000 / 1_024); // the first update after 10 ms
    /// assert_eq!(bus.next_edge(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[inline]
    pub fn next_edge(&mut self) -> Option<Edge> {
        if self.guard.journal().is_empty() { None } else { self.take_edge() }
    }

    #[inline(never)]
    fn take_edge(&mut self) -> Option<Edge> {
        let updated = self.guard.updated();
        while let Some(entry) = self.guard.journal_mut().pop() {
            let at = self.guard.journal().time_of(&entry, updated);
            let Some(slot) = self.slots.get_mut(usize::from(entry.motor)) else { continue };
            let Some(motor) = slot.name() else { continue };
            let (condition, began) = (entry.condition, entry.began);
            if slot.guard.latch_mut().take(condition, began) {
                return Some(Edge { motor, condition, began, at });
            }
        }
        let at = self.guard.journal().last_time(updated);
        let edge = self.slots.iter_mut().find_map(|slot| {
            let motor = slot.name()?;
            let (condition, began) = slot.guard.latch().next()?;
            slot.guard.latch_mut().take(condition, began);
            Some(Edge { motor, condition, began, at })
        });
        if edge.is_none() {
            self.guard.journal_mut().clear();
        }
        edge
    }

    /// Looks at a motor in a round that ends a window, or begins a round.
    #[cold]
    #[inline(never)]
    pub(super) fn check_without_glance(&mut self) {
        let motor = self.rounds.next & !Rounds::CLOSING;
        match self.slots.get(usize::from(motor)) {
            Some(slot) => {
                let word = self.outbox.get(slot.place);
                self.rounds.next += 1;
                self.check_closely(motor, word);
            }
            None => self.rounds.begin(self.guard.now()),
        }
    }

    #[inline(never)]
    pub(super) fn check_closely(&mut self, motor: u8, word: i16) {
        let look = Look {
            now: self.guard.now(),
            elapsed: self.rounds.elapsed,
            word,
            window: self.rounds.window(),
            feedback_hz: self.budget.feedback_hz,
            is_alone: self.guard.now().wrapping_sub(self.rounds.rival_heard) > RIVAL_FORGOTTEN_US,
        };
        self.change(motor, self.guard.updated(), |slot| slot.check(&look));
    }

    /// Takes a frame of another node that may be one of our commands.
    pub(super) fn ingest_command(&mut self, frame: &CanFrame, now: Instant) {
        let Some(frame) = CommandFrame::with_id(frame.header()) else { return };
        if self.rounds.echoes || !self.outbox.is_in_use(frame) {
            return;
        }
        self.rounds.rival_heard = now.stamp();
        for motor in 0..self.used {
            self.change(motor, now, |slot| {
                if slot.facts().is_some() && slot.place.frame() == frame {
                    slot.hear_rival();
                }
            });
        }
    }

    /// Returns a command of one of these motors that another node has sent.
    pub(super) fn rival_among<'a>(
        &self,
        mut slots: impl Iterator<Item = &'a Slot>,
    ) -> Option<Claim> {
        let slot = slots.find(|slot| slot.guard.latch().has(Condition::SecondMaster))?;
        super::device::claim(slot.place.frame().id(), Role::Command, slot.name()?)
    }
}
