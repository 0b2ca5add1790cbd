use super::{Condition, Latch, Sample};

/// Speeds are kept in 64ths of the no-load speed.
const SCALE: f32 = 64.0;
/// 30 % of the no-load speed.
const GAIN: u8 = 19;
/// A speed that is this much lower than the highest has fallen: 5 %.
const FALL: u8 = 3;
/// It has to last 100 ms, and the speed must be gained within 0.5 s, in units of 2.048 ms: more slowly than that, it is
/// a slope or somebody who pushes.
const SHORTEST: u8 = 49;
const LONGEST: u8 = 244;

/// What was seen of a motor that turns the wrong way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Runaway {
    lasted: u8,
    from: u8,
    highest: u8,
}

impl Runaway {
    pub(super) const NONE: Self = Self { lasted: 0, from: 0, highest: 0 };

    /// Looks for a motor that speeds up although its command says otherwise. Latched: it ends when it is armed.
    ///
    /// A motor slows down when its command opposes its motion, and when there is none. So it runs away when its speed
    /// rises, and never falls meanwhile,
    ///
    /// * against at least half of the full command: the sign of the torque is wrong, say; or
    /// * without a command, while its *current* drives it: the ESC follows somebody else, or nobody. Without the current
    ///   it is pushed from outside, which is not its fault.
    pub(super) fn check(&mut self, latch: &mut Latch, sample: &Sample) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let speed = (sample.speed.abs() * SCALE) as u8;
        let effort = sample.effort * 1.0_f32.copysign(sample.speed);
        let current = sample.current * 1.0_f32.copysign(sample.speed);
        let wrong = effort <= -0.5 || (effort.abs() < 0.05 && current >= 0.2);
        let falls = speed.saturating_add(FALL) < self.highest;
        if falls || self.lasted == 0 || self.lasted > LONGEST {
            *self = Self { lasted: 0, from: speed, highest: speed };
        }
        self.lasted =
            if wrong { self.lasted.saturating_add(sample.elapsed.div_ceil(2)) } else { 0 };
        self.highest = self.highest.max(speed);
        if self.lasted >= SHORTEST && self.highest >= self.from.saturating_add(GAIN) {
            latch.set(Condition::Runaway, true);
        }
    }
}

#[cfg(test)]
mod tests {
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
