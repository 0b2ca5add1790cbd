use super::budget::Budget;
use super::command::Outbox;
use super::health::Rounds;
use super::slot::Slot;
use super::{AnyHandle, CommandFrame, Feedback, State};
use crate::control::TimeStep;
use crate::frame::CanFrame;
use crate::motor::{DeviceGuard, Devices, Ingest, Link, Malformed, Timeouts, Visitor};
use crate::time::{Duration, Instant, Tick};
use core::marker::PhantomData;

/// The lowest feedback id, and how many there are: 0x201..=0x20B.
pub(super) const FIRST_FEEDBACK_ID: u32 = 0x201;
const SLOTS: usize = 11;

/// All commands, and the feedback, lie from 0x1FE to 0x2FF.
const LOWEST_COMMAND_ID: u32 = CommandFrame::X1FE.id() as u32;
const COMMAND_IDS: u32 = CommandFrame::X2FF.id() as u32 - LOWEST_COMMAND_ID;

/// Above this step the integrals and derivatives of all loops rest: 20 periods of 1 kHz.
const LONGEST_STEP_S: f32 = 0.02;

/// The motors of one CAN bus, their loops, and the frames for them.
///
/// The bus owns the motors; [`attach`](Self::attach) returns a `Copy` handle for each. Storage is what the protocol
/// needs: 11 feedback ids and 5 command frames, no capacity to choose. It can stand in a `static`.
///
/// # Examples
/// ```
/// use drivetrain::dji::{Bus, Config, M3508};
/// use drivetrain::frame::CanFrame;
/// use drivetrain::time::{Instant, Tick};
/// use drivetrain::units::Current;
///
/// let mut bus = Bus::new();
/// let wheel = bus.attach(Config::<M3508>::new(1))?;
/// let rest = CanFrame::standard(0x201, [0x0E, 0x16, 0, 0, 0xFF, 0xFD, 0x21, 0]).ok_or("not an 11-bit id")?;
///
/// let mut sent = None;
/// for millis in 1..=50 {
///     let now = Instant::from_micros(1_000 * millis);
///     bus.ingest(&rest, now);
///     if millis == 1 {
///         bus.arm(now)?; // the output range opens from here, in 0.2 s
///     }
///     bus.set_current(wheel, Current::from_amperes(1.0))?;
///     bus.update(Tick::new(now, 0.001));
///     while let Some(frame) = bus.next_frame() {
///         sent = Some(frame); // to the driver
///     }
/// }
/// let frame = sent.ok_or("nothing to send")?;
/// assert_eq!(format!("{frame:?}"), "200 [8] 03 33 00 00 00 00 00 00"); // 819 of 16384 = 1 A of 20 A
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
// The slots first: their addresses need no offset then.
#[repr(C)]
pub struct Bus<B = ()> {
    pub(super) slots: [Slot; SLOTS],
    pub(super) outbox: Outbox,
    pub(super) guard: DeviceGuard<12>,
    pub(super) budget: Budget,
    /// The last usable time step as it was given, and as the loops take it.
    dt_s: f32,
    step: TimeStep,
    pub(super) rejects: Rejects,
    /// All slots from here on are free.
    pub(super) used: u8,
    pub(super) rounds: Rounds,
    brand: PhantomData<fn() -> B>,
}

#[cfg(target_pointer_width = "32")]
const _: () = assert!(size_of::<Slot>() <= 296 && size_of::<Bus>() <= 3564);

/// What a bus has counted; every counter saturates or, for frames, wraps at 2^32.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Feedback frames of another length than 8 bytes.
    pub bad_length: u32,
    /// Feedback frames with an angle above 8191.
    pub bad_field: u32,
    /// Frames with a feedback id of this family that no attached motor has: a wrong id switch shows here.
    pub unattached: u32,
    /// Updates whose time step was zero, negative or NaN, or whose time did not move on.
    pub bad_steps: u32,
    /// Command frames that an update had ready; wraps.
    pub packed: u32,
    /// Command frames that were replaced by newer ones before they were taken, or after they were given back; wraps.
    pub superseded: u32,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Rejects {
    pub(super) bad_length: u32,
    pub(super) bad_field: u32,
    pub(super) unattached: u32,
}

impl Bus {
    /// Makes a bus without motors.
    #[must_use]
    pub const fn new() -> Self {
        Self::branded()
    }
}

impl Default for Bus {
    fn default() -> Self {
        Self::new()
    }
}

impl<B> Bus<B> {
    /// Makes a bus without motors whose handles fit only a bus of the same brand.
    ///
    /// # Examples
    /// ```compile_fail,E0277
    /// use drivetrain::dji::{Bus, Config, M3508};
    ///
    /// struct Left;
    /// struct Right;
    /// let mut left = Bus::<Left>::branded();
    /// let right = Bus::<Right>::branded();
    /// let wheel = left.attach(Config::<M3508>::new(1)).expect("a free id");
    /// right.state(wheel); // no `AnyHandle<Right>` from `Handle<M3508, Left>`
    /// ```
    #[must_use]
    pub const fn branded() -> Self {
        Self {
            slots: [Slot::FREE; SLOTS],
            outbox: Outbox::new(),
            guard: DeviceGuard::NEW,
            budget: Budget::new(),
            dt_s: 0.001,
            step: TimeStep::new(0.001, LONGEST_STEP_S),
            rejects: Rejects { bad_length: 0, bad_field: 0, unattached: 0 },
            used: 0,
            rounds: Rounds::NEW,
            brand: PhantomData,
        }
    }

    /// Sets when feedback and commands count as lost.
    #[must_use]
    pub const fn with_timeouts(mut self, timeouts: Timeouts) -> Self {
        self.guard.set_timeouts(timeouts);
        self
    }

    /// Sets how often a command frame of zeros is repeated; 10 ms at first, at most 10 s.
    #[must_use]
    pub const fn with_keep_alive(mut self, period: Duration) -> Self {
        self.outbox.set_keep_alive(match period.micros_u32() {
            Some(micros) if micros < 10_000_000 => micros,
            _ => 10_000_000,
        });
        self.guard.disturb();
        self
    }

    /// Takes a received frame that arrived at `now`. Constant time for one without an error code, once the updates run;
    /// before the first one each frame also looks how old all feedback is.
    ///
    /// A `now` may lie a little ahead of the next update, as from an interrupt. One that lies ahead by more than
    /// [`Timeouts::late`] counts as late: not at once, but within twice that time. Its low 32 bits are kept: one that is
    /// wrong by a multiple of 71 min 35 s is not noticed.
    // A call of its own costs as much as a tenth of what it does.
    #[inline(always)]
    pub fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let index = frame.key().wrapping_sub(FIRST_FEEDBACK_ID) as usize;
        if let Some(slot) = self.slots.get_mut(index) {
            let feedback = Feedback::without_error(frame);
            if feedback.is_some_and(|feedback| slot.receive(feedback, now.stamp())) {
                return Ingest::Taken;
            }
        } else if is_of_others(frame) {
            return Ingest::Unrelated;
        }
        self.ingest_unusual(frame, now)
    }

    /// Takes any frame: also the first one of a motor, one after a gap, one with an error, and what is no feedback at all.
    #[cold]
    #[inline(never)]
    fn ingest_unusual(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let index = frame.header().wrapping_sub(FIRST_FEEDBACK_ID) as usize;
        let Some(slot) = self.slots.get_mut(index) else {
            self.ingest_command(frame, now);
            return Ingest::Unrelated;
        };
        #[expect(clippy::cast_possible_truncation, reason = "below 11")]
        let motor = index as u8;
        let Some(facts) = slot.facts() else {
            self.rejects.unattached = self.rejects.unattached.saturating_add(1);
            return Ingest::Unrelated;
        };
        if frame.length() != 8 {
            self.rejects.bad_length = self.rejects.bad_length.saturating_add(1);
            return Ingest::Malformed(Malformed::Length(frame.length()));
        }
        let Some(feedback) = Feedback::decode(frame.bytes()) else {
            self.rejects.bad_field = self.rejects.bad_field.saturating_add(1);
            return Ingest::Malformed(Malformed::Field);
        };
        let (timeouts, running) = (*self.guard.timeouts(), self.guard.is_running());
        if !running {
            let before = self.guard.pass_unwatched(now);
            self.forget_bygones(before);
        }
        let in_time = self.change(motor, now, |slot| {
            let in_time = slot.receive(feedback, now.stamp());
            if !in_time {
                slot.receive_after_gap(facts, feedback, now.stamp(), &timeouts, running);
            }
            slot.hear_error(facts, feedback.error());
            in_time
        });
        if in_time == Some(false) {
            self.guard.disturb();
        }
        Ingest::Taken
    }

    /// Takes a received standard data frame from a driver without an `embedded-can` frame type.
    pub fn ingest_raw(&mut self, id: u16, data: &[u8], now: Instant) -> Ingest {
        match embedded_can::StandardId::new(id).and_then(|id| embedded_can::Frame::new(id, data)) {
            Some(frame) => self.ingest(&frame, now),
            None => Ingest::Unrelated,
        }
    }

    /// Runs every loop once and encodes the commands.
    ///
    /// An update that does not lie after the one before, or before the arming, sends zeros and relaxes every motor until it is
    /// armed again. A `dt_s` of zero, below zero, infinite or NaN changes nothing and leaves the last commands for one update,
    /// but for motors that were relaxed; a second one in a row, or one that comes late, sends zeros. Above 20 ms integrals and
    /// derivatives rest for the step.
    pub fn update(&mut self, tick: Tick) {
        let before = self.guard.begin(tick.now());
        if !self.takes_step(tick.dt_s()) {
            let moves_on = self.guard.moves_on(before);
            return self.update_without_step(before, moves_on);
        }
        if !self.takes_time(before) {
            return self.update_without_step(before, false);
        }
        self.check_one_slot();
        let step = self.step;
        let mut rest = self.slots.get_mut(..usize::from(self.used)).unwrap_or_default();
        while let [slot, others @ ..] = rest {
            let raw = slot.update(&step, &self.step, &self.outbox);
            self.outbox.put(slot.place, raw);
            rest = others;
        }
        self.outbox.finish_update();
    }

    /// Sees to what the time that passed brings with it; `false` when none passed.
    #[inline]
    fn takes_time(&mut self, before: Instant) -> bool {
        self.guard.is_quiet(before) || self.look_around(before)
    }

    /// Takes over a time step, unless it is none.
    #[inline]
    fn takes_step(&mut self, dt_s: f32) -> bool {
        if dt_s.to_bits() == self.dt_s.to_bits() {
            return true;
        }
        let step = TimeStep::new(dt_s, LONGEST_STEP_S);
        if !step.is_hold() {
            (self.dt_s, self.step) = (dt_s, step);
        }
        !step.is_hold()
    }

    /// Looks at what need not be looked at in every tick, in one motor a tick.
    #[inline]
    fn check_one_slot(&mut self) {
        let motor = self.rounds.next;
        let Some(slot) = self.slots.get_mut(usize::from(motor)) else {
            return self.check_without_glance();
        };
        self.rounds.next = motor + 1;
        let word = self.outbox.get(slot.place);
        if !slot.is_well(word) {
            self.check_closely(motor, word);
        }
    }

    /// Returns a command frame that waits to be sent, and takes it off the list.
    #[inline]
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        self.outbox.next()
    }

    /// Takes back a frame that was not sent, or was evicted; `false` when it is not this bus's.
    pub fn requeue(&mut self, frame: &CanFrame) -> bool {
        self.outbox.requeue(frame.header())
    }

    /// Returns what is known of a motor; `None` before its first frame, and once it is detached.
    ///
    /// Inlined: a program pays for the fields that it reads.
    #[must_use]
    #[inline(always)]
    pub fn state(&self, motor: impl Into<AnyHandle<B>>) -> Option<State> {
        self.slot(motor.into())?.state()
    }

    /// Tells whether a motor is heard; `None` once it is detached.
    #[must_use]
    pub fn link(&self, motor: impl Into<AnyHandle<B>>) -> Option<Link> {
        Some(self.slot(motor.into())?.guard.link())
    }

    /// Tells whether a motor takes targets: armed, and not relaxed by a fault.
    #[must_use]
    pub fn is_motor_armed(&self, motor: impl Into<AnyHandle<B>>) -> bool {
        self.slot(motor.into()).is_some_and(|slot| slot.guard.is_armed())
    }

    /// Returns what the bus has counted.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        let Rejects { bad_length, bad_field, unattached } = self.rejects;
        let bad_steps = self.guard.bad_steps();
        let (packed, superseded) = (self.outbox.packed, self.outbox.superseded);
        Counters { bad_length, bad_field, unattached, bad_steps, packed, superseded }
    }

    /// Changes a slot, and sees to what follows.
    pub(super) fn change<T>(
        &mut self,
        motor: u8,
        now: Instant,
        change: impl FnOnce(&mut Slot) -> T,
    ) -> Option<T> {
        let slot = self.slots.get_mut(usize::from(motor))?;
        let before = slot.guard.known();
        let outcome = change(slot);
        slot.settle();
        self.guard.note(motor, before, &slot.guard, now);
        Some(outcome)
    }

    #[inline]
    pub(super) fn slot(&self, motor: AnyHandle<B>) -> Option<&Slot> {
        self.slots.get(motor.key().index()).filter(|slot| slot.matches(motor.key()))
    }

    #[inline]
    pub(super) fn slot_mut(&mut self, motor: AnyHandle<B>) -> Option<&mut Slot> {
        self.slots.get_mut(motor.key().index()).filter(|slot| slot.matches(motor.key()))
    }
}

/// One device needs no search among several: each goes straight to the bus.
impl<B> Devices for Bus<B> {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }

    #[inline]
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        Self::ingest(self, frame, now)
    }

    #[inline]
    fn update(&mut self, tick: Tick) {
        Self::update(self, tick);
    }

    #[inline]
    fn next_frame(&mut self, _: u32) -> Option<CanFrame> {
        Self::next_frame(self)
    }
}

/// Tells whether a frame is of no id of this family. Twice the header: then it takes no mask to leave the bit of short frames out.
#[inline]
const fn is_of_others(frame: &CanFrame) -> bool {
    (frame.header() << 1).wrapping_sub(LOWEST_COMMAND_ID << 1) > (COMMAND_IDS << 1 | 1)
}
