//! The rules of the safety core for one motor, in 64-bit times: slow, obvious, and without any code of the crate.
//!
//! It shares with the crate the names of a link and of the errors, no more.

use drivetrain::motor::{Link, TargetError};

const DEADLINE_US: u64 = 100_000;
const OFFLINE_US: u64 = 100_000;
const PAUSE_US: u64 = 100_000;
/// A program that stalls did not release its switch.
const LONGEST_STEP_US: u64 = 20_000;
/// After a longer pause nobody knows the age of anything.
const LONGEST_PAUSE_US: u64 = 60_000_000;
/// A 32-bit stamp repeats: a clock that is wrong by as much goes unnoticed where the frames of a recovery are counted.
const REPEATS_US: u64 = 1 << 32;
/// Where a stamp lies further ahead than this, it may be taken for one long ago.
const TOLD_US: u64 = REPEATS_US / 2;

/// What a time step that is zero or NaN does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum BadStep {
    /// The device leaves the last commands for one update that is not late, whatever the ages are.
    Repeats,
    /// The same, and the next one takes every target away; the motors do not see either update.
    RepeatsThenRelaxes,
    /// Ages count as ever; a motor that may be driven gets its last command once.
    Ages,
    /// The same, and the command is the target itself: there is no loop.
    OpenLoop,
}

/// What one motor differs in from the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    /// It has feedback, which is late after so long.
    pub(super) late_us: Option<u64>,
    /// It takes targets again after a recovery.
    pub(super) resumes: bool,
    pub(super) bad_step: BadStep,
    /// A request to arm is granted by the next update.
    pub(super) arms_later: bool,
    /// A request gives its time to targets, of a motor that is armed already as well.
    pub(super) arms_again: bool,
    /// Its drive is asked for settings and enabled first: it may rest where the reference drives, and refuse to be armed.
    pub(super) is_prepared: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Arming {
    Disarmed,
    Armed,
    Latched,
    Tripped,
}

/// Why arming is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Refusal {
    Stopped,
    Missing,
    NotReleased,
}

#[derive(Debug, Clone, Copy)]
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
}

impl Reference {
    pub(super) fn new(rules: Rules) -> Self {
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
        if !self.is_running {
            self.forget_after_a_pause(self.updated, now);
            self.updated = now;
            if self.link != Link::Unheard && self.is_far_ahead(now) && link == Link::Recovering {
                self.lose();
            }
        }
        let was_offline = matches!(self.link, Link::Offline | Link::Recovering);
        let is_near =
            (now.wrapping_sub(self.heard).wrapping_add(late_us)) % REPEATS_US <= 2 * late_us;
        let in_a_row = self.link == Link::Recovering && is_near;
        self.good_frames = if in_a_row { self.good_frames + 1 } else { 1 };
        self.heard = now;
        self.link =
            if was_offline && self.good_frames < 10 { Link::Recovering } else { Link::Online };
        let is_back = was_offline && self.link == Link::Online;
        if is_back && self.arming == Arming::Latched && self.rules.resumes {
            self.arming = Arming::Armed;
        }
    }

    fn is_fresh(&self, now: u64) -> bool {
        self.rules.late_us.is_none_or(|late_us| now.abs_diff(self.heard) <= late_us)
    }

    fn is_missing(&self, now: u64) -> bool {
        let is_far = now.abs_diff(self.updated) > LONGEST_PAUSE_US;
        self.rules.late_us.is_some() && (is_far || self.link != Link::Online || !self.is_fresh(now))
    }

    /// A stamp that lies far ahead may be taken for one long ago: a motor may be offline then. The pause that made one old is
    /// lost where a joint saw only the update after it, whose time did not move on: its link may stay what it was.
    pub(super) fn accept(&mut self, link: Link) {
        let is_lost = |link| matches!(link, Link::Late | Link::Recovering | Link::Offline);
        let now = self.device_updated.unwrap_or(0);
        let is_ahead = self.is_far_ahead(now) && link == Link::Offline;
        let is_old = now > self.heard.saturating_add(TOLD_US)
            && self.rules.bad_step == BadStep::RepeatsThenRelaxes;
        if is_lost(link) && is_lost(self.link) && (is_ahead || is_old) {
            self.link = link;
        }
    }

    fn is_far_ahead(&self, now: u64) -> bool {
        self.heard > now.saturating_add(TOLD_US)
    }

    // Targets.

    pub(super) fn set(&mut self, is_finite: bool) -> Result<(), TargetError> {
        let outcome = match (is_finite, self.arming, self.link) {
            (false, ..) => Err(TargetError::NotFinite),
            (true, Arming::Disarmed, _) => Err(TargetError::Disarmed),
            (true, Arming::Latched | Arming::Tripped, _) => Err(TargetError::Relaxed),
            (true, Arming::Armed, Link::Online) => Ok(()),
            (true, Arming::Armed, _) => Err(TargetError::NoFeedback),
        };
        if outcome.is_ok() {
            self.target = Some(self.target_time);
        } else {
            // No older target acts in its place.
            self.relax();
        }
        outcome
    }

    pub(super) fn relax(&mut self) {
        (self.target, self.may_repeat) = (None, false);
    }

    // Arming.

    /// Takes a request to arm, whatever comes of it.
    pub(super) fn ask(&mut self) {
        self.is_granted = !self.tripped || self.quiet_us >= PAUSE_US;
        self.quiet_us = 0;
    }

    pub(super) fn refusal(&self, now: u64) -> Option<Refusal> {
        if self.is_stopped {
            Some(Refusal::Stopped)
        } else if self.is_missing(now) {
            Some(Refusal::Missing)
        } else {
            (!self.is_granted).then_some(Refusal::NotReleased)
        }
    }

    pub(super) fn is_arming(&self) -> bool {
        self.arms_with_update
    }

    /// The request is granted, of all motors.
    pub(super) fn arm(&mut self, now: u64) {
        if self.rules.arms_later {
            self.arms_with_update = !self.is_armed();
        } else {
            self.engage(now);
        }
    }

    fn engage(&mut self, now: u64) {
        if self.is_armed() && !self.rules.arms_again {
            return;
        }
        self.tripped = false;
        if !self.is_armed() {
            self.relax();
            self.arming = Arming::Armed;
        }
        self.armed_at = self.armed_at.max(now);
        self.target_time = now;
    }

    pub(super) fn disarm(&mut self) {
        self.relax();
        self.arming = Arming::Disarmed;
        self.arms_with_update = false;
    }

    pub(super) fn stop(&mut self) {
        if !self.is_stopped {
            self.disarm();
            self.begin_pause();
        }
        self.is_stopped = true;
        self.arms_with_update = false;
    }

    pub(super) fn clear_stop(&mut self) {
        if self.is_stopped {
            self.begin_pause();
        }
        self.is_stopped = false;
    }

    fn begin_pause(&mut self) {
        (self.tripped, self.quiet_us, self.is_granted) = (true, 0, false);
    }

    /// The motor is relaxed until it is armed again.
    fn fall_to(&mut self, arming: Arming) {
        if self.is_armed() {
            self.begin_pause();
        }
        if self.is_armed() || self.arming == Arming::Latched && arming == Arming::Tripped {
            self.arming = arming;
        }
        self.relax();
    }

    // Time.

    /// Returns whether the motor is driven in this update.
    pub(super) fn update(&mut self, now: u64, has_step: bool) -> bool {
        let is_shielded = self.rules.bad_step == BadStep::RepeatsThenRelaxes;
        let device_before = self.device_updated.replace(now);
        let device_moves_on = device_before.is_none_or(|before| before < now);
        if is_shielded && device_moves_on && !has_step {
            return self.update_unseen(device_before.unwrap_or(0), now);
        }
        let before = core::mem::replace(&mut self.updated, now);
        let was_running = core::mem::replace(&mut self.is_running, true);
        let moves_on = self.armed_at <= now && (!was_running || before < now);
        self.target_time = now;
        let step = if was_running { now.saturating_sub(before) } else { 0 };
        self.quiet_us = if moves_on { self.quiet_us + step.min(LONGEST_STEP_US) } else { 0 };
        let loses_time = !moves_on || is_shielded && !device_moves_on;
        if !loses_time || self.rules.bad_step == BadStep::Repeats {
            self.forget_after_a_pause(before, now);
        }
        if loses_time {
            self.lose_time(now);
        }
        if !loses_time && (has_step || self.rules.bad_step != BadStep::Repeats) {
            self.age(now);
        }
        if core::mem::take(&mut self.arms_with_update) {
            if !self.tripped || self.is_granted {
                self.engage(now);
            }
            return false;
        }
        let is_usable = has_step && (device_moves_on || !is_shielded);
        self.bad_steps = if is_usable { 0 } else { self.bad_steps + 1 };
        let may_drive = self.is_armed() && self.link == Link::Online && self.target.is_some();
        let may_repeat = core::mem::replace(&mut self.may_repeat, has_step && may_drive);
        match self.rules.bad_step {
            _ if has_step => may_drive,
            BadStep::Repeats => may_repeat && !self.is_late_step(before, now),
            BadStep::OpenLoop => may_drive && self.bad_steps == 1,
            BadStep::Ages | BadStep::RepeatsThenRelaxes => may_drive && may_repeat,
        }
    }

    fn is_late_step(&self, before: u64, now: u64) -> bool {
        self.rules.late_us.is_some_and(|late_us| now - before > late_us)
    }

    /// An update without a usable step that the motor does not see, its device alone.
    fn update_unseen(&mut self, before: u64, now: u64) -> bool {
        self.bad_steps += 1;
        if self.bad_steps > 1 || self.is_late_step(before, now) {
            self.relax();
        }
        core::mem::take(&mut self.may_repeat)
    }

    /// No age is known: the motor rests, and is not heard until the next feedback.
    fn lose_time(&mut self, now: u64) {
        self.armed_at = now;
        self.arms_with_update = false;
        if self.rules.late_us.is_some() && self.link == Link::Online {
            self.link = Link::Late;
        }
        self.fall_to(Arming::Tripped);
    }

    fn forget_after_a_pause(&mut self, before: u64, now: u64) {
        let is_unknown = |time: u64| now.saturating_sub(before.min(time)) > LONGEST_PAUSE_US;
        let listens = self.rules.late_us.is_some() && self.link != Link::Unheard;
        if listens && is_unknown(self.heard) {
            self.lose();
        } else if self.target.is_some_and(is_unknown) {
            self.relax();
        }
    }

    fn age(&mut self, now: u64) {
        let is_old = now.saturating_sub(self.heard) > OFFLINE_US;
        match self.link {
            Link::Unheard | Link::Offline => {}
            Link::Online if self.is_fresh(now) => {}
            Link::Online | Link::Late | Link::Recovering if is_old => self.lose(),
            Link::Online => self.link = Link::Late,
            Link::Late | Link::Recovering => {}
        }
        if self.target.is_some_and(|set| now.abs_diff(set) > DEADLINE_US) {
            self.relax();
        }
    }

    fn lose(&mut self) {
        self.link = Link::Offline;
        self.fall_to(Arming::Latched);
    }
}
