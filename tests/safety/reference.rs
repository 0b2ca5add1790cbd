//! The rules of the safety core for one motor, in 64-bit times: slow, obvious, and without any code of the crate.
//!
//! It shares with the crate the names of a link, of the conditions and of the errors, no more.

mod arming;
mod edges;
mod opening;
mod rival;
mod rules;

use drivetrain::motor::{Condition, Conditions, Link, TargetError};
use edges::Edges;
use opening::Opening;
pub(super) use opening::Opens;
use rival::Rival;
pub(super) use rival::Rivals;
pub(super) use rules::{Bounds, Refusal, Rules, Setup};

const LATE_US: u64 = 10_000;
const DEADLINE_US: u64 = 100_000;
const OFFLINE_US: u64 = 100_000;
const PAUSE_US: u64 = 100_000;
/// A program that stalls did not release its switch.
const LONGEST_STEP_US: u64 = 20_000;
/// After a longer pause nobody knows the age of anything.
const LONGEST_PAUSE_US: u64 = 60_000_000;
/// A 32-bit stamp repeats: a clock that is wrong by as much goes unnoticed where the frames of a recovery are counted.
const REPEATS_US: u64 = 1 << 32;
/// A bus has a turn for each of its ids, and one to begin.
const TURNS: u32 = 12;
/// Where a stamp lies further ahead than this, it may be taken for one long ago.
const TOLD_US: u64 = REPEATS_US / 2;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Arming {
    Disarmed,
    Armed,
    Latched,
    Tripped,
}

#[derive(Debug, Clone)]
pub(super) struct Reference {
    rules: Rules,
    pub(super) link: Link,
    heard: u64,
    good_frames: u8,
    arming: Arming,
    /// When the target was set: a target has the time of the last update or arming.
    target: Option<u64>,
    target_time: u64,
    /// The last update; before the first one, the last feedback.
    updated: u64,
    /// The last update of the device, which has some that the motor does not see.
    device_updated: Option<u64>,
    is_running: bool,
    armed_at: u64,
    is_stopped: bool,
    /// A trip that no arming has taken back.
    tripped: bool,
    /// The updates since the last request to arm, the last trip and the last update without time.
    quiet_us: u64,
    is_granted: bool,
    arms_with_update: bool,
    /// The last update drove the motor with a usable step, and nothing has ended that since.
    may_repeat: bool,
    bad_steps: u32,
    edges: Edges,
    rival: Rival,
    /// The target, as a share of the full output.
    value: f64,
    opening: Opening,
    /// The motor had no target in an update since it was driven, or was armed.
    has_rested: bool,
    /// The share of the last command, which a bus finds at the turn of the motor.
    share: f64,
    /// The updates of a bus with a usable step.
    steps: u32,
    /// The last update that gave a command, and the last that was seen to give none.
    commanded: u64,
    rested: u64,
    /// The last update was seen to give none.
    is_resting: bool,
    /// The motor was driven since it was armed.
    was_driven: bool,
    bounds: Bounds,
    is_in_doubt: bool,
    is_target_ahead: bool,
}

impl Reference {
    pub(super) fn new(rules: Rules, setup: Setup) -> Self {
        Self {
            rules,
            link: if rules.late_us.is_some() { Link::Unheard } else { Link::Online },
            heard: 0,
            good_frames: 0,
            arming: Arming::Disarmed,
            target: None,
            target_time: 0,
            updated: 0,
            device_updated: None,
            is_running: false,
            armed_at: 0,
            is_stopped: false,
            tripped: false,
            quiet_us: 0,
            is_granted: false,
            arms_with_update: false,
            may_repeat: false,
            bad_steps: 0,
            edges: Edges::new(rules.room),
            rival: Rival::new(rules.rivals, setup.on_rival),
            value: 0.0,
            opening: Opening::new(setup.opening),
            has_rested: true,
            share: 1.0,
            steps: 0,
            commanded: 0,
            rested: 0,
            is_resting: true,
            was_driven: false,
            bounds: Bounds { least: 0.0, most: 0.0 },
            is_in_doubt: false,
            is_target_ahead: false,
        }
    }

    pub(super) fn is_armed(&self) -> bool {
        self.arming == Arming::Armed
    }

    pub(super) fn is_tripped(&self) -> bool {
        self.tripped
    }

    // Feedback.

    /// Takes a frame; the device's own link after it counts only where a stamp does not tell.
    pub(super) fn hear(&mut self, now: u64, link: Link) {
        let Some(late_us) = self.rules.late_us else { return };
        self.edges.begin_call();
        let gap = now.saturating_sub(self.heard);
        let is_silence = self.link != Link::Unheard && gap > OFFLINE_US.max(late_us);
        if !self.is_running {
            self.forget_after_a_pause(self.updated, now);
            self.updated = now;
            if self.link != Link::Unheard && self.is_far_ahead(now) && link == Link::Recovering {
                self.lose(now);
            }
        }
        if self.rules.loses_zero && (is_silence || self.link == Link::Offline) {
            self.edges.set(Condition::PositionUncertain, true, now);
            self.fall_to(Arming::Tripped);
        }
        let was_offline = matches!(self.link, Link::Offline | Link::Recovering);
        let is_near =
            (now.wrapping_sub(self.heard).wrapping_add(late_us)) % REPEATS_US <= 2 * late_us;
        let in_a_row = self.link == Link::Recovering && is_near;
        self.good_frames = if in_a_row { self.good_frames + 1 } else { 1 };
        self.heard = now;
        self.link =
            if was_offline && self.good_frames < 10 { Link::Recovering } else { Link::Online };
        if self.link == Link::Online {
            self.edges.set(Condition::Late, false, now);
            self.edges.set(Condition::Offline, false, now);
        }
        let is_back = was_offline && self.link == Link::Online;
        if is_back && self.arming == Arming::Latched && self.rules.resumes {
            self.arming = Arming::Armed;
            self.open(now);
        }
    }

    fn is_fresh(&self, now: u64) -> bool {
        self.rules.late_us.is_none_or(|late_us| now.abs_diff(self.heard) <= late_us)
    }

    fn is_missing(&self, now: u64) -> bool {
        let is_far = now.abs_diff(self.updated) > LONGEST_PAUSE_US;
        let listens = self.rules.late_us.is_some();
        // A motor without feedback is not armed either at a time that is far from its updates.
        let is_far = is_far && (listens || self.is_running && !self.rules.arms_later);
        is_far || listens && (self.link != Link::Online || !self.is_fresh(now))
    }

    /// A stamp that lies far ahead may be taken for one long ago: a motor may be offline then. A target that was set far ahead may be taken for an expired one, where the motor trips anyway.
    pub(super) fn accept(&mut self, link: Link, conditions: Conditions) {
        let is_lost = |link| matches!(link, Link::Late | Link::Recovering | Link::Offline);
        let now = self.device_updated.unwrap_or(0);
        let is_ahead = self.is_far_ahead(now) && link == Link::Offline;
        if is_lost(link) && is_lost(self.link) && is_ahead {
            self.link = link;
            let is_lost = link != Link::Late;
            self.edges.correct(Condition::Offline, is_lost, now);
        }
        if self.rules.loses_zero && self.device_updated.is_some() && self.link == Link::Offline {
            self.edges.set(Condition::PositionUncertain, true, now);
        }
        if self.is_target_ahead && conditions.contains(Condition::CommandLost) {
            self.edges.set(Condition::CommandLost, true, now);
        }
    }

    fn is_far_ahead(&self, now: u64) -> bool {
        self.heard > now.saturating_add(TOLD_US)
    }

    // Targets.

    pub(super) fn set(&mut self, value: f32) -> Result<(), TargetError> {
        let outcome = match (value.is_finite(), self.arming, self.link) {
            (false, ..) => Err(TargetError::NotFinite),
            (true, Arming::Disarmed, _) => Err(TargetError::Disarmed),
            (true, Arming::Latched | Arming::Tripped, _) => Err(TargetError::Relaxed),
            (true, Arming::Armed, Link::Online) => Ok(()),
            (true, Arming::Armed, _) => Err(TargetError::NoFeedback),
        };
        // No older target acts in the place of a refused one.
        match outcome {
            Ok(()) => (self.target, self.value) = (Some(self.target_time), value.into()),
            Err(TargetError::NoFeedback) => self.cancel(),
            Err(_) => self.relax(),
        }
        outcome
    }

    pub(super) fn relax(&mut self) {
        self.cancel();
        self.has_rested = true;
    }

    fn cancel(&mut self) {
        (self.target, self.may_repeat) = (None, false);
    }

    // Time.

    /// Returns the output of the motor if it is driven in this update.
    pub(super) fn update(&mut self, now: u64, has_step: bool) -> Option<Bounds> {
        self.edges.begin_call();
        let has_step = has_step || !self.rules.has_steps;
        self.device_updated = Some(now);
        let before = core::mem::replace(&mut self.updated, now);
        let was_running = core::mem::replace(&mut self.is_running, true);
        self.is_target_ahead = self.target.is_some_and(|set| set > now.saturating_add(TOLD_US));
        let moves_on = self.armed_at <= now && (!was_running || before < now);
        self.target_time = now;
        let step = if was_running { now.saturating_sub(before) } else { 0 };
        self.quiet_us = if moves_on { self.quiet_us + step.min(LONGEST_STEP_US) } else { 0 };
        let loses_time = !moves_on;
        // Before its first update, a motor without feedback has no other time.
        let since = before.max(self.armed_at);
        let is_pause = now.saturating_sub(since) > LONGEST_PAUSE_US;
        if loses_time {
            self.lose_time(now);
        } else {
            if is_pause {
                self.forget_after_a_pause(since, now);
            }
            self.age(now);
        }
        let is_usable = has_step && !loses_time;
        if is_usable && self.rules.takes_turns {
            self.take_turn(now);
        } else if is_usable {
            self.end_what_is_over(now);
        }
        if core::mem::take(&mut self.arms_with_update) {
            if !self.tripped || self.is_granted {
                self.engage(now);
            }
            return None;
        }
        self.bad_steps = if is_usable { 0 } else { self.bad_steps + 1 };
        let may_drive = self.is_armed() && self.link == Link::Online && self.target.is_some();
        let may_repeat = core::mem::replace(&mut self.may_repeat, has_step && may_drive);
        self.has_rested |= self.target.is_none();
        // The last command once more, in the first update without a usable step that is not late itself.
        let late_us = self.rules.late_us.unwrap_or(LATE_US);
        let repeats = may_repeat && self.bad_steps == 1 && now.saturating_sub(before) <= late_us;
        let drives = may_drive && (is_usable || repeats);
        if drives && is_usable {
            self.bounds = self.predict(now);
        }
        drives.then_some(self.bounds)
    }

    /// No age is known: the motor rests, and is not heard until the next feedback.
    fn lose_time(&mut self, now: u64) {
        self.armed_at = now;
        self.arms_with_update = false;
        self.edges.set(Condition::ClockFault, true, now);
        if self.rules.late_us.is_some() && self.link == Link::Online {
            self.link = Link::Late;
            self.edges.set(Condition::Late, true, now);
        }
        self.fall_to(Arming::Tripped);
    }

    fn forget_after_a_pause(&mut self, before: u64, now: u64) {
        let is_unknown = |time: u64| now.saturating_sub(before.min(time)) > LONGEST_PAUSE_US;
        let listens = self.rules.late_us.is_some() && self.link != Link::Unheard;
        if listens && is_unknown(self.heard) {
            self.lose(now);
        } else if self.target.is_some_and(is_unknown) {
            self.forget_target(now);
        }
    }

    fn age(&mut self, now: u64) {
        let is_old = now.saturating_sub(self.heard) > OFFLINE_US;
        match self.link {
            Link::Unheard | Link::Offline => {}
            Link::Online if self.is_fresh(now) => {}
            Link::Online | Link::Late | Link::Recovering if is_old => self.lose(now),
            Link::Online => {
                self.link = Link::Late;
                self.edges.set(Condition::Late, true, now);
            }
            Link::Late | Link::Recovering => {}
        }
        if self.target.is_some_and(|set| now.abs_diff(set) > DEADLINE_US) {
            self.forget_target(now);
        }
    }

    fn lose(&mut self, now: u64) {
        self.link = Link::Offline;
        self.edges.set(Condition::Late, true, now);
        self.edges.set(Condition::Offline, true, now);
        self.fall_to(Arming::Latched);
    }

    fn forget_target(&mut self, now: u64) {
        self.relax();
        self.edges.set(Condition::CommandLost, true, now);
    }

    /// In an update whose time moved on.
    fn end_what_is_over(&mut self, now: u64) {
        if self.target.is_some() {
            self.edges.set(Condition::CommandLost, false, now);
        }
        self.edges.set(Condition::ClockFault, false, now);
        self.look_for_rival(now);
    }

    /// A bus looks at one motor in each update.
    fn take_turn(&mut self, now: u64) {
        let is_its_turn = self.steps.is_multiple_of(TURNS);
        self.steps += 1;
        if is_its_turn {
            self.end_what_is_over(now);
            if self.link == Link::Online {
                self.share = self.opening.share(now);
            }
        }
    }
}
