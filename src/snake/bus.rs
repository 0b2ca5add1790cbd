use super::model::{Budget, Counters, IDS, SLOTS, limited, name};
use super::schedule::{self, Answers, count};
use super::slot::Slot;
use super::{AttachError, Command, Config, Joint, Joints, Register, State};
use crate::frame::CanFrame;
use crate::motor::{BusLoad, Condition, DeviceGuard, Hold, Ingest, Link, MotorName, Timeouts};
use crate::time::{Duration, Instant, Tick, TimeStep};
use embedded_can::Frame;

/// Upper bound on how long a stop may wait for an outstanding reply.
const LONGEST_REPLY: Duration = Duration::from_millis(10);

impl Joints {
    /// Makes a bus without joints. Feedback is late after 40 ms, since each of twelve joints is polled for its position every 12 or 24 ms.
    /// A joint is offline after 100 ms, and a target expires after 100 ms.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            slots: [Slot::FREE; SLOTS],
            now: Instant::START,
            reply_timeout: Duration::from_millis(2),
            answers: Answers::NONE,
            budget: Budget::new(),
            stops: 0,
            writes: 0,
            reads: 0,
            returned: (0, 0, 0),
            reads_first: false,
            last_write: 0,
            last_read: IDS / 2,
            told: IDS - 1,
            written: IDS - 1,
            asked: IDS - 1,
            guard: DeviceGuard::NEW,
            echoes: false,
            counters: Counters::NONE,
        }
        .with_timeouts(Timeouts::POLLED)
    }

    /// Sets the ages at which feedback and targets count as lost.
    #[must_use]
    pub const fn with_timeouts(mut self, timeouts: Timeouts) -> Self {
        self.guard.set_timeouts(timeouts);
        self
    }

    /// Sets the time for a reply: 2 ms by default, at most 10 ms; a longer time counts as 10 ms. Until the first update after that time no
    /// frame is sent to the joint, not even a stop: see the [module](super).
    #[must_use]
    pub const fn with_reply_timeout(mut self, timeout: Duration) -> Self {
        let is_long = timeout.as_micros() > LONGEST_REPLY.as_micros();
        self.reply_timeout = if is_long { LONGEST_REPLY } else { timeout };
        self
    }

    /// Sets the numbers of joints polled and of joints written to in an update: 1 to 12, by default 1 each.
    ///
    /// With fewer frames, the turn of a joint comes later: choose [`Timeouts::late`](crate::motor::Timeouts::late) above three turns. If
    /// the driver has less room than the update has frames, the other frames wait and take turns. Such a driver must not choose by the
    /// lowest id.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::snake::Joints;
    ///
    /// let fast = Joints::new().with_frames_per_update(2, 2);
    /// assert_eq!(fast.load().to_string(), "51 % to 61 %"); // a bus without other motors
    /// ```
    #[must_use]
    pub const fn with_frames_per_update(mut self, reads: u8, writes: u8) -> Self {
        self.budget.reads = limited(reads);
        self.budget.writes = limited(writes);
        self
    }

    /// Sets the bit rate, in bits a second, for [`load`](Self::load); 1 000 000 by default.
    #[must_use]
    pub const fn with_bit_rate(mut self, bits_per_s: u32) -> Self {
        self.budget.bit_rate = bits_per_s;
        self
    }

    /// Sets the rate of updates in Hz, for [`load`](Self::load); 1000 by default.
    #[must_use]
    pub const fn with_tick_rate(mut self, hz: u32) -> Self {
        self.budget.tick_hz = hz;
        self
    }

    /// Returns the load of requests, replies and writes, while all joints move.
    ///
    /// Relaxed joints take less. A stop of all joints takes 12 frames more, once. [`BusLoad::and`] adds other families.
    #[must_use]
    pub const fn load(&self) -> BusLoad {
        self.budget.load()
    }

    /// Attaches a joint. The joint is disabled with the next update, or once an earlier joint with this id has no outstanding reply.
    ///
    /// # Errors
    /// The id is out of range or taken, or a parameter is not usable. The bus stays as before.
    pub fn attach(&mut self, config: Config) -> Result<Joint, AttachError> {
        let joint = name(config.id());
        let index = config.id().checked_sub(1).ok_or(AttachError::Id(joint))?;
        let slot = self.slots.get_mut(usize::from(index)).ok_or(AttachError::Id(joint))?;
        if slot.id.is_some() {
            return Err(AttachError::Taken(joint));
        }
        let generation = slot.next_generation().ok_or(AttachError::WornOut(joint))?;
        *slot = Slot::new(&config, generation)?;
        self.returned.0 |= 1 << index;
        Ok(Joint::new(index, generation))
    }

    /// Detaches a joint and disables it once more.
    pub fn detach(&mut self, joint: Joint) {
        let Some(slot) = self.slot_mut(joint) else { return };
        let place = slot.place();
        slot.free();
        self.guard.journal.forget(place);
        schedule::stop(self, joint.index());
        schedule::drop_read(self, joint.index());
    }

    /// Takes a frame received at `now`. Runs in constant time.
    ///
    /// Costs 223 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        let index = frame.header().wrapping_sub(1) as usize;
        let reply = Register::from_reply(frame.data());
        if reply.is_some() && self.slots.get(index).is_some_and(|slot| slot.id.is_some()) {
            self.guard.hear_first(&mut self.slots, now);
        }
        let Some(slot) = self.slots.get_mut(index) else { return Ingest::Unrelated };
        let (counters, rules) = (&mut self.counters, &mut self.guard);
        if let Some((register, _)) = reply {
            self.answers.take(index, register);
        }
        if slot.id.is_none() {
            count(&mut counters.unattached);
            return Ingest::Unrelated;
        }
        match reply {
            Some(reply) => {
                count(&mut counters.replies);
                slot.receive(rules, reply, now);
                self.let_go(index);
                return Ingest::Taken;
            }
            None if Command::decode(frame.data()).is_some() => {
                if self.echoes {
                    return Ingest::Unrelated;
                }
                count(&mut counters.foreign_commands);
                rules.hear_rival(now, |rules| {
                    rules.change(slot, slot.place(), now, |slot| {
                        slot.guard.judge(Condition::SecondMaster, true, slot.stall.health());
                    });
                });
            }
            None => count(match frame.length() {
                6 => &mut counters.bad_field,
                _ => &mut counters.bad_length,
            }),
        }
        slot.bad_replies = slot.bad_replies.saturating_add(1);
        match frame.length() {
            6 => Ingest::WrongField,
            length => Ingest::WrongLength(length),
        }
    }

    /// Chooses the joints for requests and writes, and relaxes joints that may not be driven.
    ///
    /// An update before the arming, or not after the previous one, relaxes every joint until armed again. A `dt_s` of zero, below zero, infinite or
    /// NaN chooses no joint for one update; a second such update in a row, or a late one, disables all joints until the next usable step.
    /// Frames that disable a joint are sent nevertheless.
    ///
    /// Costs 2957 instructions on a Cortex-M4F, for 12 joints, with the frames out and an answer in (`docs/figures.md`).
    pub fn update(&mut self, tick: Tick) {
        let before = self.guard.begin(tick.now());
        let has_step = !TimeStep::of_motor(tick.dt_s()).is_hold();
        let is_quiet = has_step && self.guard.is_quiet(before, tick.now());
        if !is_quiet {
            if let Some(hold) = self.guard.pass(&mut self.slots, before, has_step, u32::MAX) {
                return self.hold(hold);
            }
        }
        self.now = tick.now();
        self.give_up(Some(self.reply_timeout));
        self.update_joints(is_quiet, None);
        schedule::plan(self);
    }

    fn update_joints(&mut self, is_quiet: bool, held: Option<Hold>) {
        for index in 0..SLOTS {
            let Some(slot) = self.slots.get_mut(index).filter(|slot| slot.id.is_some()) else {
                continue;
            };
            let stops = slot.update(&mut self.guard, is_quiet, held);
            if stops || slot.wants_reminder(self.now) {
                schedule::stop(self, index);
            }
        }
    }

    /// Counts overdue replies; without a time-out, all.
    fn give_up(&mut self, reply_timeout: Option<Duration>) {
        for index in self.answers.give_up(self.now, reply_timeout) {
            if let Some(slot) = self.slots.get_mut(index) {
                count(&mut slot.unanswered);
            }
            count(&mut self.counters.unanswered);
        }
    }

    /// Ends an update without a step: chooses no joint, but disables joints that must rest.
    fn hold(&mut self, hold: Hold) {
        count(&mut self.counters.bad_steps);
        let now = self.guard.updated();
        let stands = now <= self.now;
        self.now = self.now.max(now);
        // A clock that stands or was set back does not show when a reply is overdue: an update then counts for a millisecond.
        let held = Duration::from_millis(self.guard.held_steps().into());
        self.give_up((!(stands && held > self.reply_timeout)).then_some(self.reply_timeout));
        self.update_joints(false, Some(hold));
        schedule::stop_again(self);
    }

    /// Disables a joint that may no longer be driven. This happens at once: the joint may be armed and have a target again before the next
    /// update, which would then find no reason.
    pub(super) fn let_go(&mut self, index: usize) {
        if self.slots.get_mut(index).is_some_and(Slot::let_go) {
            schedule::stop(self, index);
        }
    }

    /// Returns the next frame to send and removes it from the list: first disables, then writes and requests.
    pub fn next_frame(&mut self) -> Option<CanFrame> {
        schedule::next_frame(self)
    }

    /// Requeues a frame that was not sent, or was evicted. Returns `false` for a frame of another sender.
    pub fn requeue(&mut self, frame: &CanFrame) -> bool {
        schedule::requeue(self, frame)
    }

    /// Returns the state of a joint; `None` before its first position, and after it was detached.
    #[must_use]
    pub fn state(&self, joint: Joint) -> Option<State> {
        self.slot(joint)?.state()
    }

    /// Returns the link of a joint; `None` after the joint was detached.
    #[must_use]
    pub fn link(&self, joint: Joint) -> Option<Link> {
        Some(self.slot(joint)?.guard.link())
    }

    /// Tells whether a joint takes targets: armed, and not relaxed by a fault.
    #[must_use]
    pub fn is_joint_armed(&self, joint: Joint) -> bool {
        self.slot(joint).is_some_and(|slot| slot.guard.is_armed())
    }

    /// Iterates over the attached joints, in the order of their ids.
    pub fn joints(&self) -> impl Iterator<Item = (Joint, MotorName)> + '_ {
        (0..).zip(&self.slots).filter_map(|(index, slot)| {
            Some((Joint::new(index, slot.next_generation()?), slot.name()?))
        })
    }

    /// Returns the counters.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    pub(super) fn slot(&self, joint: Joint) -> Option<&Slot> {
        self.slots.get(joint.index()).filter(|slot| slot.matches(joint))
    }

    pub(super) fn slot_mut(&mut self, joint: Joint) -> Option<&mut Slot> {
        self.slots.get_mut(joint.index()).filter(|slot| slot.matches(joint))
    }
}
