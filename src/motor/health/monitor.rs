use super::{Condition, HealthConfig, Latch};
use crate::math::limited;

/// Returns the time between two checks in units of 1.024 ms, at most 128.
pub(crate) fn elapsed(micros: Option<u32>) -> u8 {
    const LONGEST: u8 = 128;
    let units = micros.and_then(|micros| u8::try_from(micros >> 10).ok());
    units.map_or(LONGEST, |units| units.min(LONGEST))
}

/// Duration of a state, in units of 1.024 ms; saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Timer(u16);

impl Timer {
    const ZERO: Self = Self(0);

    /// Continues while the state holds; otherwise starts anew.
    const fn run(&mut self, holds: bool, elapsed: u8) -> u16 {
        self.0 = if holds { self.0.saturating_add(elapsed as u16) } else { 0 };
        self.0
    }
}

/// Input of a check, in the direction of the rotor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// Time since the previous check, in units of 1.024 ms: at most 128, because the time between was not observed.
    pub(crate) elapsed: u8,
    /// Whether a frame was received since.
    pub(crate) fresh: bool,
    /// The command sent, as a share of the motor's limit.
    pub(crate) effort: f32,
    /// The reported speed, as a share of the speed without load.
    pub(crate) speed: f32,
    /// The reported current, as a share of its full scale; 0 if unknown.
    pub(crate) current: f32,
    /// The command sent, in a coarse unit, and the smallest change of the command that a current must follow.
    pub(crate) word: i8,
    pub(crate) word_change: u8,
    /// The reported rotor angle.
    pub(crate) angle: u16,
    /// A value that changes with the current; its upper three bits count.
    pub(crate) rest: u16,
    /// The reported temperature, and the temperatures at which the motor is warm and hot.
    pub(crate) temperature: Option<(i16, (i16, i16))>,
}

impl Sample {
    #[cfg(test)]
    const AT_REST: Self = Self {
        elapsed: 0,
        fresh: true,
        effort: 0.0,
        speed: 0.0,
        current: 0.0,
        word: 0,
        word_change: 20,
        angle: 0,
        rest: 0,
        temperature: None,
    };
}

/// The slow checks of one motor: everything that need not be checked in every tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Monitor {
    stall: Timer,
    runaway: Runaway,
    frozen: Frozen,
    error_heard: bool,
}

impl Monitor {
    pub(crate) const NEW: Self = Self {
        stall: Timer::ZERO,
        runaway: Runaway::NONE,
        frozen: Frozen::NONE,
        error_heard: false,
    };

    /// As [`check`](Self::check), for a motor that is moderately driven and cool. Returns `false` if the angle did not move: the motor must
    /// then be checked in full.
    #[inline]
    pub(crate) const fn follow(&mut self, angle: u16, word: i8) -> bool {
        let moved = self.frozen.has_moved(angle);
        if moved {
            self.stall = Timer::ZERO;
            self.runaway = Runaway::NONE;
            self.frozen.follow(angle, word);
        }
        moved
    }

    /// As [`check`](Self::check), for a cool motor driven with `effort`, so that the current needs no check. Returns `false`, without a
    /// change, if the angle did not move, or a stall or runaway may begin.
    #[inline]
    pub(crate) fn follow_driven(
        &mut self,
        angle: u16,
        word: i8,
        (effort, speed): (f32, f32),
        elapsed: u8,
        config: &HealthConfig,
    ) -> bool {
        let stands = speed.abs() <= config.stall_speed();
        if stands || !self.frozen.has_moved(angle) || effort.abs() < UNDRIVEN {
            return false;
        }
        let mut runaway = Runaway::NONE;
        if effort * speed < 0.0 && !config.ignores(Condition::Runaway) {
            runaway = self.runaway;
            if runaway.holds(speed, effort <= -0.5 || effort >= 0.5, elapsed) {
                return false;
            }
        }
        self.runaway = runaway;
        self.stall = Timer::ZERO;
        self.frozen.follow(angle, word);
        true
    }

    /// As [`check`](Self::check), for a motor without a condition, whose feedback is not compared with the feedback before. Returns `false`,
    /// without a change, if a condition may begin.
    #[inline]
    pub(crate) fn passes(&mut self, sample: &Sample, config: &HealthConfig) -> bool {
        let is_cool = sample.temperature.is_none_or(|(celsius, (warning, _))| celsius < warning);
        let is_other = stalls(sample, config)
            || Runaway::is_wrong(sample)
            || sample.speed.abs() > 2.0
            || sample.fresh;
        if !is_cool || is_other {
            return false;
        }
        (self.stall, self.runaway) = (Timer::ZERO, Runaway::NONE);
        true
    }

    /// Begins anew as a motor is armed: a condition that still holds begins again, and relaxes the motor again.
    pub(crate) fn start(&mut self, latch: &mut Latch) {
        for condition in [Condition::Runaway, Condition::Stalled, Condition::Overspeed] {
            latch.set(condition, false);
        }
        *self = Self::NEW;
    }

    /// Notes an error code.
    pub(crate) const fn hear_error(&mut self) {
        self.error_heard = true;
    }

    /// Tells whether an error code was received since the last call.
    pub(crate) const fn take_error(&mut self) -> bool {
        core::mem::replace(&mut self.error_heard, false)
    }

    /// Checks the motor and returns the share of the output that stays available.
    pub(crate) fn check(
        &mut self,
        latch: &mut Latch,
        sample: &Sample,
        config: &HealthConfig,
    ) -> f32 {
        let mut share = 1.0;
        if let Some((celsius, (warning, limit))) = sample.temperature {
            let warning = (!config.ignores(Condition::Warm)).then_some(warning);
            let limit = (!config.ignores(Condition::Hot)).then_some(limit);
            share = check_temperature(latch, celsius, warning, limit);
        }
        if !config.ignores(Condition::Stalled) {
            share = share.min(check_stall(&mut self.stall, latch, sample, config));
        }
        if !config.ignores(Condition::Runaway) {
            self.runaway.check(latch, sample);
        }
        if !config.ignores(Condition::Frozen) {
            self.frozen.check(latch, sample);
        }
        if !config.ignores(Condition::Overspeed) {
            latch.set(Condition::Overspeed, sample.speed.abs() > 2.0);
        }
        share
    }
}

/// Share of the no-load speed below which a rotor moves too little between two checks.
const MOVES: f32 = 0.05;
/// 100 ms, in units of 1.024 ms.
const FROZEN_WINDOW: u8 = 98;

/// An angle has 13 bits.
const ANGLE: u16 = 0x1FFF;

/// Feedback at the last check.
#[derive(Debug, Clone, Copy)]
struct Frozen {
    lasted: u8,
    /// The angle, and three bits that change with the current: by chance the bits are equal once, but not ten times in a row.
    feedback: u16,
    /// The command when the feedback last changed.
    word: i8,
}

impl Frozen {
    const NONE: Self = Self { lasted: 0, feedback: 0, word: 0 };

    /// Tells whether an angle differs from the angle at the last check.
    #[inline]
    const fn has_moved(&self, angle: u16) -> bool {
        (self.feedback ^ angle) & ANGLE != 0
    }

    /// Takes changed feedback.
    #[inline]
    const fn follow(&mut self, angle: u16, word: i8) {
        *self = Self { lasted: 0, feedback: angle, word };
    }

    /// Detects feedback that stands still in contradiction to other values.
    ///
    /// A motor at standstill, even when blocked at a constant current, may send the same bits for ever. Equal bits are therefore not
    /// enough. The feedback is frozen if
    ///
    /// * the angle does not move while the reported speed is not zero, or
    /// * neither angle nor current change, although the command has changed by a fifth of full scale since.
    ///
    /// Without a new frame there is no check.
    fn check(&mut self, latch: &mut Latch, sample: &Sample) {
        if !sample.fresh {
            return;
        }
        let feedback = (sample.angle & ANGLE) | (sample.rest & !ANGLE);
        let changes = feedback ^ self.feedback;
        self.feedback = feedback;
        if changes != 0 {
            self.word = sample.word;
        }
        let change = sample.word.abs_diff(self.word);
        let answers_not = changes == 0 && change >= sample.word_change;
        let contradicts = changes & ANGLE == 0 && sample.speed.abs() >= MOVES;
        let holds = answers_not || contradicts;
        self.lasted = if holds { self.lasted.saturating_add(sample.elapsed) } else { 0 };
        latch.set(Condition::Frozen, self.lasted >= FROZEN_WINDOW);
    }
}

/// Share of the full command below which a motor counts as not driven.
const UNDRIVEN: f32 = 0.05;

/// Speeds are kept in 64ths of the no-load speed.
const SCALE: f32 = 64.0;
/// 30 % of the no-load speed.
const GAIN: u8 = 19;
/// A speed lower than the highest by more than this has fallen: 5 %.
const FALL: u8 = 3;
/// A runaway lasts at least 100 ms, and gains its speed within 0.5 s, in units of 2.048 ms. A slower gain is a slope, or a person who
/// pushes.
const SHORTEST: u8 = 49;
const LONGEST: u8 = 244;

/// Progress of a possible runaway.
#[derive(Debug, Clone, Copy)]
struct Runaway {
    lasted: u8,
    from: u8,
    highest: u8,
}

impl Runaway {
    const NONE: Self = Self { lasted: 0, from: 0, highest: 0 };

    /// Detects a motor that speeds up against its command. Latched until armed.
    ///
    /// A motor slows down if its command opposes its motion, and without a command. A motor runs away if its speed rises, and never falls
    /// meanwhile,
    ///
    /// * against at least half of the full command: the sign of the torque is wrong, for example; or
    /// * without a command, while the *current* drives the motor: the ESC follows another controller, or no controller. Without the current
    ///   an external force pushes the motor, which is no fault of the motor.
    fn check(&mut self, latch: &mut Latch, sample: &Sample) {
        if self.holds(sample.speed, Self::is_wrong(sample), sample.elapsed) {
            latch.set(Condition::Runaway, true);
        }
    }

    /// Tells whether command and current oppose a rise of the speed.
    #[inline]
    fn is_wrong(sample: &Sample) -> bool {
        let effort = sample.effort * 1.0_f32.copysign(sample.speed);
        let current = sample.current * 1.0_f32.copysign(sample.speed);
        effort <= -0.5 || (effort.abs() < UNDRIVEN && current >= 0.2)
    }

    /// Takes a speed, and whether command and current oppose a rise (`wrong`). Returns whether the motor runs away.
    fn holds(&mut self, speed: f32, wrong: bool, elapsed: u8) -> bool {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let speed = (speed.abs() * SCALE) as u8;
        let falls = speed.saturating_add(FALL) < self.highest;
        if falls || self.lasted == 0 || self.lasted > LONGEST {
            *self = Self { lasted: 0, from: speed, highest: speed };
        }
        self.lasted = if wrong { self.lasted.saturating_add(elapsed.div_ceil(2)) } else { 0 };
        self.highest = self.highest.max(speed);
        self.lasted >= SHORTEST && self.highest >= self.from.saturating_add(GAIN)
    }
}

/// Distance inside of a soft limit from which the motor is no longer at the limit.
const CLEAR_RAD: f32 = 0.01;

/// Compares a shaft with its soft limits, in rad, `here` and a little later `there`. Returns whether the shaft may turn up only, and whether
/// the shaft may turn down only.
pub(crate) fn check_soft_limits(
    latch: &mut Latch,
    (lower, upper): (f32, f32),
    here: f32,
    there: f32,
) -> (bool, bool) {
    let (below, above) = (here.min(there) <= lower, here.max(there) >= upper);
    let lingers =
        latch.has(Condition::SoftLimit) && !(here > lower + CLEAR_RAD && here < upper - CLEAR_RAD);
    latch.set(Condition::SoftLimit, below || above || lingers);
    (below, above)
}

/// A shaft comes no sooner to a soft limit than in this time, in s, at its present velocity.
pub(crate) const BRAKING_S: f32 = 0.1;
/// An outward velocity beyond a soft limit leads back, at most so fast in rad/s.
pub(crate) const BACK: f32 = 0.5;

/// Returns the velocity of a target within soft limits, in rad and rad/s: slower toward a limit, and back from beyond.
pub(crate) fn velocity_inside((lower, upper): (f32, f32), here: f32, wanted: f32) -> f32 {
    // A target of zero moves no shaft.
    let back = wanted.abs().min(BACK);
    let least = ((lower - here) / BRAKING_S).min(back);
    let most = ((upper - here) / BRAKING_S).max(-back);
    limited(wanted, least, most)
}

/// Detects a motor that is driven and does not turn, in either direction. Returns the share of the output that stays available.
///
/// The stall ends when the motor turns at twice the speed of a standstill, or when the command is below half of the share.
fn check_stall(
    timer: &mut Timer,
    latch: &mut Latch,
    sample: &Sample,
    config: &HealthConfig,
) -> f32 {
    let (effort, speed) = (sample.effort.abs(), sample.speed.abs());
    let stalled = if latch.has(Condition::Stalled) {
        let (pushed, hold) = (config.stall_effort(), config.stall_hold());
        let least = if pushed < hold { pushed } else { hold };
        effort > 0.0 && effort >= 0.5 * least && speed < 2.0 * config.stall_speed()
    } else {
        let holds = stalls(sample, config);
        timer.run(holds, sample.elapsed) >= config.stall_window() && holds
    };
    latch.set(Condition::Stalled, stalled);
    if stalled { config.stall_hold() } else { 1.0 }
}

/// Tells whether a motor is driven and does not turn.
#[inline]
fn stalls(sample: &Sample, config: &HealthConfig) -> bool {
    sample.effort.abs() >= config.stall_effort() && sample.speed.abs() <= config.stall_speed()
}

/// A condition ends this far below the temperature of its begin.
const HYSTERESIS_K: i16 = 5;

/// Checks a temperature and returns the share of the output that stays available: 1 up to the warning, 0 from the limit on, linear in
/// between. After the limit, 0 until the motor is 5 K below. A bound of `None` is not checked, and takes nothing away.
fn check_temperature(
    latch: &mut Latch,
    celsius: i16,
    warning: Option<i16>,
    limit: Option<i16>,
) -> f32 {
    for (condition, from) in [(Condition::Warm, warning), (Condition::Hot, limit)] {
        let Some(from) = from else { continue };
        let below = celsius < from.saturating_sub(HYSTERESIS_K);
        latch.set(condition, celsius >= from || (latch.has(condition) && !below));
    }
    match (warning, limit) {
        _ if latch.has(Condition::Hot) => 0.0,
        (Some(warning), Some(limit)) if celsius > warning => {
            f32::from(limit.saturating_sub(celsius)) / f32::from(limit.saturating_sub(warning))
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod frozen_tests {
    use super::*;

    fn check(frozen: &mut Frozen, angle: u16, rest: u16, effort: f32, speed: f32) -> bool {
        let mut latch = Latch::NONE;
        #[expect(clippy::cast_possible_truncation, reason = "at most 100")]
        let word = (effort * 100.0) as i8;
        let sample = Sample { angle, rest, word, speed, elapsed: 11, ..Sample::AT_REST };
        frozen.check(&mut latch, &sample);
        latch.has(Condition::Frozen)
    }

    #[test]
    fn a_true_standstill_is_not_frozen_however_long_and_however_hard_it_is_pushed() {
        for effort in [0.0, 0.04, -0.7, 1.0] {
            let mut frozen = Frozen::NONE;
            assert!((0..1_000).all(|_| !check(&mut frozen, 77, 5, effort, 0.0)));
        }
        // Blocked under a command that swings: the current answers.
        let mut frozen = Frozen::NONE;
        for step in 0..1_000_u16 {
            let effort = f32::from(step % 200) / 200.0;
            assert!(!check(&mut frozen, 77, step.wrapping_mul(0x9E37), effort, 0.0));
        }
    }

    #[test]
    fn an_angle_that_rests_while_the_speed_does_not_is_frozen_and_ends() {
        let mut frozen = Frozen::NONE;
        let looks =
            (0..20_u16).map(|step| check(&mut frozen, 77, step << 13, 0.1, -0.3)).position(|f| f);
        assert_eq!(looks, Some(9), "100 ms");
        assert!(!check(&mut frozen, 78, 0, 0.1, -0.3));
    }

    #[test]
    fn feedback_that_does_not_answer_a_change_of_the_command_is_frozen() {
        let mut frozen = Frozen::NONE;
        let mut step = |effort| check(&mut frozen, 77, 5, effort, 0.0);
        assert!((0..50).all(|_| !step(0.1)));
        let looks = (0..20).map(|_| step(0.4)).position(|frozen| frozen);
        assert_eq!(looks, Some(8));
    }
}

#[cfg(test)]
mod runaway_tests {
    use super::*;
    use proptest::prelude::*;

    const STEP: u8 = 11;

    /// Lets a motor with this effort, current and no-load speed of 1 run for a second.
    fn runs_away(motor: impl Fn(f32) -> (f32, f32, f32)) -> bool {
        let (mut runaway, mut latch) = (Runaway::NONE, Latch::NONE);
        for step in 0..90_u8 {
            let (effort, current, speed) = motor(f32::from(step) * 0.011);
            runaway.check(
                &mut latch,
                &Sample { effort, current, speed, elapsed: STEP, ..Sample::AT_REST },
            );
        }
        latch.has(Condition::Runaway)
    }

    #[test]
    fn a_wrong_sign_is_found_in_both_directions_and_a_right_one_is_not() {
        for sign in [1.0, -1.0] {
            let speed = |t: f32| sign * (t * 8.0).min(1.0);
            assert!(runs_away(|t| (-sign, -sign, speed(t))));
            assert!(!runs_away(|t| (sign, sign, speed(t))));
            assert!(!runs_away(|t| (-0.4 * sign, sign, speed(t))), "a light brake");
        }
    }

    #[test]
    fn braking_reversing_and_a_slope_are_healthy() {
        for sign in [1.0, -1.0] {
            // From full speed through zero to full speed the other way.
            assert!(!runs_away(|t| (-sign, -sign, sign * (1.0 - 4.0 * t).max(-1.0))));
            // Held back on a slope, at a speed that is let rise slowly.
            assert!(!runs_away(|t| (-0.8 * sign, -0.8 * sign, sign * (0.2 + 0.4 * t))));
        }
    }

    #[test]
    fn without_a_command_only_a_current_makes_it_a_runaway() {
        for sign in [1.0, -1.0] {
            let speed = |t: f32| sign * (t * 3.0).min(1.0);
            assert!(runs_away(|t| (0.0, 0.5 * sign, speed(t))));
            assert!(!runs_away(|t| (0.0, 0.0, speed(t))), "pushed");
            assert!(!runs_away(|t| (0.0, -0.5 * sign, speed(t))), "pushed against its brake");
        }
    }

    proptest! {
        /// Law: a motor whose speed follows its torque, against friction and a moderate load, never runs away.
        #[test]
        fn a_motor_that_follows_its_torque_never_runs_away(
            efforts in proptest::collection::vec(-1.0_f32..=1.0, 1..400),
            gain in 0.5_f32..15.0,
            load in -0.45_f32..0.45,
        ) {
            let (mut runaway, mut latch, mut speed) = (Runaway::NONE, Latch::NONE, 0.0_f32);
            for effort in efforts {
                let current = effort.clamp(-1.0 - speed, 1.0 - speed);
                speed += gain * (current + load - 0.05_f32.copysign(speed)) * 0.011;
                let sample = Sample { effort, current, speed, elapsed: STEP, ..Sample::AT_REST };
                runaway.check(&mut latch, &sample);
                prop_assert!(!latch.has(Condition::Runaway));
            }
        }
    }
}

#[cfg(test)]
mod stall_tests {
    use super::*;
    use crate::time::Duration;

    fn sample(effort: f32, speed: f32) -> Sample {
        Sample { effort, speed, elapsed: 10, ..Sample::AT_REST }
    }

    #[test]
    fn a_stall_begins_after_its_window_in_both_directions() {
        let config = HealthConfig::new().with_stall(0.5, 0.02, Duration::from_micros(100 << 10));
        for direction in [1.0, -1.0] {
            let (mut timer, mut latch) = (Timer::ZERO, Latch::NONE);
            let mut check = |effort, speed| {
                check_stall(&mut timer, &mut latch, &sample(effort, speed), &config);
                latch.has(Condition::Stalled)
            };
            assert!(!check(0.9 * direction, 0.5 * direction), "turns");
            for _ in 0..9 {
                assert!(!check(0.5 * direction, -0.02 * direction));
            }
            assert!(check(0.5 * direction, 0.0));
            assert!(check(0.3 * direction, 0.039), "still pushed, still standing");
            assert!(!check(0.3 * direction, 0.04 * direction), "turns");
            for _ in 0..20 {
                assert!(!check(0.49 * direction, 0.0), "pushed too little");
            }
        }
    }

    #[test]
    fn the_held_output_does_not_end_the_stall_by_itself() {
        let config = HealthConfig::new().with_stall_hold(0.1);
        let (mut timer, mut latch) = (Timer::ZERO, Latch::NONE);
        let mut effort = 1.0;
        for _ in 0..100 {
            effort = check_stall(&mut timer, &mut latch, &sample(effort, 0.0), &config);
        }
        assert_eq!((effort, latch.has(Condition::Stalled)), (0.1, true));
        assert!(check_stall(&mut timer, &mut latch, &sample(0.04, 0.0), &config) >= 1.0);
        // A hold of nothing is over at once, and then looked for again.
        let config = HealthConfig::new().with_stall_hold(0.0);
        assert!(check_stall(&mut timer, &mut latch, &sample(0.0, 0.0), &config) >= 1.0);
    }
}

#[cfg(test)]
mod thermal_tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_output_falls_on_a_line_and_comes_back_with_hysteresis() {
        let mut latch = Latch::NONE;
        let mut at = |celsius| {
            let share = check_temperature(&mut latch, celsius, Some(100), Some(120));
            (share, latch.has(Condition::Warm), latch.has(Condition::Hot))
        };
        assert_eq!(at(99), (1.0, false, false));
        assert_eq!(at(100), (1.0, true, false));
        assert_eq!(at(105), (0.75, true, false));
        assert_eq!(at(119), (0.05, true, false));
        assert_eq!(at(120), (0.0, true, true));
        assert_eq!(at(115), (0.0, true, true));
        assert_eq!(at(114), (0.3, true, false));
        assert_eq!(at(95), (1.0, true, false));
        assert_eq!(at(94), (1.0, false, false));
    }

    #[test]
    fn what_is_not_looked_for_is_no_edge_and_takes_nothing_away() {
        for (warning, limit) in [(None, Some(120)), (Some(100), None), (None, None)] {
            let mut latch = Latch::NONE;
            let share = check_temperature(&mut latch, 119, warning, limit);
            assert!(share >= 1.0, "{share}");
            let share = check_temperature(&mut latch, i16::MAX, warning, limit);
            assert_eq!(share > 0.0, limit.is_none());
            let seen = (latch.has(Condition::Warm), latch.has(Condition::Hot));
            assert_eq!(seen, (warning.is_some(), limit.is_some()));
        }
    }

    proptest! {
        /// Law: the share is within 0..=1, and less for a hotter motor with the same past.
        #[test]
        fn hotter_is_never_more(celsius: i16, more: u8, warning in -100_i16..300, span in 1_i16..200, hot: bool) {
            let share = |celsius: i16| {
                let mut latch = Latch::NONE;
                if hot {
                    check_temperature(&mut latch, i16::MAX, Some(warning), Some(warning + span));
                }
                check_temperature(&mut latch, celsius, Some(warning), Some(warning + span))
            };
            let cool = share(celsius);
            prop_assert!((0.0..=1.0).contains(&cool));
            prop_assert!(share(celsius.saturating_add(more.into())) <= cool);
        }
    }
}

#[cfg(test)]
mod driven_tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Law: where the short check of a driven motor is enough, the full one finds nothing either, and both go on alike.
        #[test]
        fn the_short_check_of_a_driven_motor_is_the_full_one(
            steps in prop::collection::vec((0_u16..8192, -2.0_f32..2.0, -1.0_f32..1.0, 0_u8..30), 1..80),
        ) {
            let config = HealthConfig::new();
            let (mut short, mut full) = (Monitor::NEW, Monitor::NEW);
            let mut latch = Latch::NONE;
            for (angle, speed, effort, elapsed) in steps {
                #[expect(clippy::cast_possible_truncation, reason = "at most 127")]
                let word = (effort * 127.0) as i8;
                let sample = Sample { angle, effort, speed, elapsed, word, ..Sample::AT_REST };
                let before = short;
                if !short.follow_driven(angle, word, (effort, speed), elapsed, &config) {
                    prop_assert_eq!((short.stall, short.frozen.feedback), (before.stall, before.frozen.feedback));
                    short.check(&mut latch.clone(), &sample, &config);
                }
                full.check(&mut latch, &sample, &config);
                let found = latch.active();
                prop_assert_eq!(short.stall, full.stall);
                prop_assert_eq!(short.runaway.lasted, full.runaway.lasted);
                if full.runaway.lasted > 0 {
                    prop_assert_eq!((short.runaway.from, short.runaway.highest), (full.runaway.from, full.runaway.highest));
                }
                prop_assert_eq!(short.frozen.lasted, full.frozen.lasted);
                // A motor with a condition is checked in full.
                if !found.is_empty() {
                    return Ok(());
                }
            }
        }
    }
}
